//! Resampling: from one θ per sample to one θ per node.
//!
//! The nodes are the multiples of dx in the range of both directions, so that every
//! node has samples of both around it. Three methods:
//!
//! * `point`, the literal reading of the paper: samples at equal counts of a 5 µm
//!   encoder, round(x / 0.005), are averaged, and the averages interpolated linearly.
//! * `bin`: the mean over [node − dx/2, node + dx/2). An empty bin is interpolated
//!   linearly between the nearest bins with samples (at an end it takes the nearest
//!   one) and counted, so that a table with gaps is recognized.
//! * `hat`: the mean weighted by 1 − |x − node|/dx over (node − dx, node + dx), the
//!   weight of the node in a linear look-up. Nodes without samples as for `bin`.
//!
//! All are linear in θ, so a shift of the origin of x does not change the force.

use super::samples::Theta;
use std::ops::Range;

/// Resolution of the encoder assumed by the `point` method, mm.
const COUNT_MM: f64 = 0.005;

/// Most nodes of a table; more are a mistake in dx.
pub const MAX_NODES: usize = crate::model::file::MAX_NODES;

study_base::named! {
    /// How the parameters at a node follow from the estimates around it.
    Resample {
        /// Interpolated between means over equal encoder counts.
        Point = "point",
        /// The mean over the bin around the node.
        Bin = "bin",
        /// The mean weighted by the distance from the node.
        Hat = "hat",
    }
}

/// The multiples of `dx_mm` in [`low`, `high`], mm; empty if dx is not positive or
/// there would be more than [`MAX_NODES`].
///
/// ```
/// # use study_haptics::identify::resample::nodes;
/// assert_eq!(nodes(0.3, 2.2, 0.5), [0.5, 1.0, 1.5, 2.0]);
/// ```
pub fn nodes(low: f64, high: f64, dx_mm: f64) -> Vec<f64> {
    let first = (low / dx_mm).ceil();
    let last = (high / dx_mm).floor();
    // also rejects NaN
    if !(dx_mm > 0.0 && last - first < MAX_NODES as f64) {
        return Vec::new();
    }
    let mut nodes = Vec::new();
    let mut i = first;
    while i <= last {
        // + 0.0 turns −0 into 0
        nodes.push(i * dx_mm + 0.0);
        i += 1.0;
    }
    nodes
}

/// The parameters at the nodes of one direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Resampled {
    /// One per node.
    pub theta: Vec<Theta>,
    /// Number of nodes interpolated between their neighbors for want of samples.
    pub filled: usize,
}

/// The parameters at the nodes. `x_mm` ascends and is not empty.
pub fn at_nodes(
    method: Resample,
    x_mm: &[f64],
    theta: &[Theta],
    nodes: &[f64],
    dx_mm: f64,
) -> Resampled {
    match method {
        Resample::Point => point(x_mm, theta, nodes),
        Resample::Bin => bin(x_mm, theta, nodes, dx_mm),
        Resample::Hat => hat(x_mm, theta, nodes, dx_mm),
    }
}

/// Groups of samples at equal encoder counts: the position of the count, mm, and
/// the samples. `x_mm` ascends.
pub(super) fn equal_counts(x_mm: &[f64]) -> (Vec<f64>, Vec<Range<usize>>) {
    let count = |x: f64| (x / COUNT_MM).round_ties_even();
    let mut positions = Vec::new();
    let mut groups = Vec::new();
    let mut from = 0;
    while from < x_mm.len() {
        let own = count(x_mm[from]);
        let to = from + x_mm[from..].partition_point(|x| count(*x) <= own);
        positions.push(own * COUNT_MM);
        groups.push(from..to);
        from = to;
    }
    (positions, groups)
}

/// Interpolated between means over equal counts. `x_mm` ascends and is not empty.
pub fn point(x_mm: &[f64], theta: &[Theta], nodes: &[f64]) -> Resampled {
    let (positions, groups) = equal_counts(x_mm);
    let means: Vec<Theta> = groups.into_iter().map(|g| mean(&theta[g])).collect();
    Resampled {
        theta: nodes
            .iter()
            .map(|node| interpolate(&positions, &means, *node))
            .collect(),
        filled: 0,
    }
}

/// Means over [node − dx/2, node + dx/2). `x_mm` ascends and is not empty.
pub fn bin(x_mm: &[f64], theta: &[Theta], nodes: &[f64], dx_mm: f64) -> Resampled {
    let below = |edge: f64| x_mm.partition_point(|x| *x < edge);
    means(x_mm, theta, nodes, |node| {
        let members = below(node - 0.5 * dx_mm)..below(node + 0.5 * dx_mm);
        (!members.is_empty()).then(|| mean(&theta[members]))
    })
}

/// Means weighted by 1 − |x − node|/dx. `x_mm` ascends and is not empty.
pub fn hat(x_mm: &[f64], theta: &[Theta], nodes: &[f64], dx_mm: f64) -> Resampled {
    means(x_mm, theta, nodes, |node| {
        let first = x_mm.partition_point(|x| *x <= node - dx_mm);
        let mut total = 0.0;
        let mut sum = [0.0; 4];
        for (x, theta) in x_mm[first..].iter().zip(&theta[first..]) {
            let weight = 1.0 - (x - node).abs() / dx_mm;
            if *x > node && weight <= 0.0 {
                break;
            }
            let weight = weight.max(0.0);
            total += weight;
            for (s, p) in sum.iter_mut().zip(theta) {
                *s += weight * p;
            }
        }
        (total > 0.0).then(|| sum.map(|s| s / total))
    })
}

/// The means at the nodes, interpolated where a node has no samples.
fn means(
    x_mm: &[f64],
    theta: &[Theta],
    nodes: &[f64],
    own: impl Fn(f64) -> Option<Theta>,
) -> Resampled {
    let own: Vec<Option<Theta>> = nodes.iter().map(|node| own(*node)).collect();
    filled(nodes, &own).unwrap_or_else(|| Resampled {
        // no node has samples around it: interpolate between the samples themselves
        filled: nodes.len(),
        ..point(x_mm, theta, nodes)
    })
}

/// Interpolates nodes without a value between their neighbors; `None` if no node has
/// a value.
pub(super) fn filled(nodes: &[f64], own: &[Option<Theta>]) -> Option<Resampled> {
    let (positions, values): (Vec<f64>, Vec<Theta>) = nodes
        .iter()
        .zip(own)
        .filter_map(|(node, theta)| theta.map(|theta| (*node, theta)))
        .unzip();
    if positions.is_empty() {
        return None;
    }
    Some(Resampled {
        theta: nodes
            .iter()
            .map(|node| interpolate(&positions, &values, *node))
            .collect(),
        filled: nodes.len() - positions.len(),
    })
}

fn mean(values: &[Theta]) -> Theta {
    let mut sum = [0.0; 4];
    for theta in values {
        for (s, p) in sum.iter_mut().zip(theta) {
            *s += p;
        }
    }
    sum.map(|s| s / values.len() as f64)
}

/// Linear interpolation between (`positions`, `values`), constant beyond the ends.
pub(super) fn interpolate(positions: &[f64], values: &[Theta], x: f64) -> Theta {
    let right = positions.partition_point(|position| *position <= x);
    if right == 0 {
        return values[0];
    }
    let left = right - 1;
    if right == positions.len() || positions[left] == x {
        return values[left];
    }
    let weight = (x - positions[left]) / (positions[right] - positions[left]);
    std::array::from_fn(|i| values[left][i] + weight * (values[right][i] - values[left][i]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn theta(f0: f64) -> Theta {
        [0.0, 0.0, 0.0, f0]
    }

    fn f0(resampled: &Resampled) -> Vec<f64> {
        resampled.theta.iter().map(|t| t[3]).collect()
    }

    #[test]
    fn nodes_are_the_multiples_inside_the_range() {
        assert_eq!(nodes(1.2, 4.0, 1.0), [2.0, 3.0, 4.0]);
        assert_eq!(nodes(-0.4, 0.6, 0.5), [0.0, 0.5]);
        assert_eq!(nodes(0.2, 0.8, 1.0), [0.0; 0]);
        for bad in [0.0, -1.0, f64::NAN, 1e-12] {
            assert!(nodes(0.0, 35.0, bad).is_empty(), "{bad}");
        }
    }

    #[test]
    fn a_bin_is_closed_on_the_left_and_open_on_the_right() {
        let x = [0.5, 1.0, 1.4, 1.5, 2.0];
        let values: Vec<_> = [3.0, 6.0, 9.0, 100.0, 200.0].map(theta).to_vec();
        let at = bin(&x, &values, &[1.0, 2.0], 1.0);
        assert_eq!(f0(&at), [6.0, 150.0]);
        assert_eq!(at.filled, 0);
    }

    #[test]
    fn an_empty_bin_is_filled_from_its_neighbors_and_counted() {
        let x = [1.0, 4.0];
        let values = [theta(10.0), theta(40.0)];
        let at = bin(&x, &values, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0], 1.0);
        assert_eq!(f0(&at), [10.0, 10.0, 20.0, 30.0, 40.0, 40.0]);
        assert_eq!(at.filled, 4);
    }

    #[test]
    fn a_hat_weighs_by_the_distance_and_leaves_out_the_next_node() {
        let x = [0.0, 0.5, 1.0, 1.75, 2.0];
        let values: Vec<_> = [100.0, 2.0, 8.0, 4.0, 100.0].map(theta).to_vec();
        let at = hat(&x, &values, &[1.0, 4.0], 1.0);
        // (0.5·2 + 1·8 + 0.25·4) / 1.75; 4.0 has none within 1 mm and takes it
        assert_eq!(f0(&at), [10.0 / 1.75, 10.0 / 1.75]);
        assert_eq!(at.filled, 1);
    }

    #[test]
    fn points_average_equal_counts_before_they_interpolate() {
        // two samples within one count of 5 µm, one 10 µm further
        let x = [0.999, 1.001, 1.010];
        let values = [theta(1.0), theta(3.0), theta(6.0)];
        let at = point(&x, &values, &[1.0, 1.005]);
        assert_eq!(at.theta[0][3], 2.0);
        assert!((at.theta[1][3] - 4.0).abs() < 1e-9, "{at:?}");
    }
}
