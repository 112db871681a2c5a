//! The runs of samples to sum over for the tables of several dx, and the parameters
//! at the nodes from these sums.
//!
//! All three resampling methods are sums over runs of neighboring samples. The bin
//! edges of all tables together divide the samples into disjoint runs, and every node
//! combines a few of them, so that another table costs nothing per sample. The values
//! are those of [`resample`] up to the order of addition.

use crate::identify::lanes::recursion::{Run, Sums};
use crate::identify::resample::{self, Resample, Resampled};
use crate::identify::samples::Theta;
use std::ops::Range;

/// The nodes of one table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Nodes {
    pub(super) dx_mm: f64,
    pub(super) x_mm: Vec<f64>,
}

/// The runs of one direction of travel.
#[derive(Debug)]
pub(super) struct Runs {
    /// Ascending, without overlap.
    pub(super) runs: Vec<Run>,
    /// Number of samples of each run and Σ(x − origin), mm.
    sizes: Vec<(f64, f64)>,
    /// One for each table.
    tables: Vec<Composition>,
    /// Whether Σ (x − origin) θ is needed.
    pub(super) moments: bool,
}

/// The runs to the left of a node and to the right.
type Halves = [Range<usize>; 2];

/// How the nodes of a table are composed of runs, given by their indices.
#[derive(Debug)]
enum Composition {
    /// Interpolation between the means of runs at these positions.
    Point {
        positions: Vec<f64>,
        runs: Vec<usize>,
    },
    /// The mean over the runs of each node.
    Bin(Vec<Range<usize>>),
    /// The weighted mean over the runs on both sides of each node.
    Hat(Vec<Halves>),
}

impl Runs {
    /// For samples at `x_mm`, ascending and not empty.
    pub(super) fn new(method: Resample, x_mm: &[f64], tables: &[Nodes]) -> Self {
        let (bounds, tables) = match method {
            Resample::Point => points(x_mm, tables),
            Resample::Bin => {
                let ranges = |t: &Nodes| -> Vec<[usize; 3]> {
                    let below = |edge: f64| x_mm.partition_point(|x| *x < edge);
                    let of = |node: &f64| {
                        let from = below(node - 0.5 * t.dx_mm);
                        [from, from, below(node + 0.5 * t.dx_mm)]
                    };
                    t.x_mm.iter().map(of).collect()
                };
                let (bounds, nodes) = divide(tables.iter().map(ranges).collect());
                let whole = |node: Halves| node[0].start..node[1].end;
                let composition =
                    |nodes: Vec<_>| Composition::Bin(nodes.into_iter().map(whole).collect());
                (bounds, nodes.into_iter().map(composition).collect())
            }
            Resample::Hat => {
                let ranges = |t: &Nodes| -> Vec<[usize; 3]> {
                    let of = |node: &f64| {
                        [
                            x_mm.partition_point(|x| *x <= node - t.dx_mm),
                            x_mm.partition_point(|x| x < node),
                            x_mm.partition_point(|x| *x < node + t.dx_mm),
                        ]
                    };
                    t.x_mm.iter().map(of).collect()
                };
                let (bounds, nodes) = divide(tables.iter().map(ranges).collect());
                (bounds, nodes.into_iter().map(Composition::Hat).collect())
            }
        };
        let runs: Vec<Run> = bounds
            .iter()
            .map(|range| Run {
                from: range.start,
                to: range.end,
                origin_mm: x_mm[range.start],
            })
            .collect();
        let sizes = runs
            .iter()
            .map(|run| {
                let arms = x_mm[run.from..run.to].iter().map(|x| x - run.origin_mm);
                ((run.to - run.from) as f64, arms.sum())
            })
            .collect();
        Self {
            runs,
            sizes,
            tables,
            moments: method == Resample::Hat,
        }
    }

    /// The parameters at the nodes of table `i`; `None` if no node has samples.
    pub(super) fn table(&self, i: usize, nodes: &Nodes, sums: &[Sums]) -> Option<Resampled> {
        match &self.tables[i] {
            Composition::Point { positions, runs } => {
                let mean = |run: &usize| sums[*run].theta.map(|s| s / self.sizes[*run].0);
                let means: Vec<Theta> = runs.iter().map(mean).collect();
                let at = |node: &f64| resample::interpolate(positions, &means, *node);
                Some(Resampled {
                    theta: nodes.x_mm.iter().map(at).collect(),
                    filled: 0,
                })
            }
            Composition::Bin(ranges) => {
                let own: Vec<Option<Theta>> = ranges
                    .iter()
                    .map(|range| {
                        let samples: f64 = self.sizes[range.clone()].iter().map(|s| s.0).sum();
                        let mut sum = [0.0; 4];
                        for run in &sums[range.clone()] {
                            add(&mut sum, 1.0, &run.theta);
                        }
                        (samples > 0.0).then(|| sum.map(|s| s / samples))
                    })
                    .collect();
                resample::filled(&nodes.x_mm, &own)
            }
            Composition::Hat(ranges) => {
                let own: Vec<Option<Theta>> = nodes
                    .x_mm
                    .iter()
                    .zip(ranges)
                    .map(|(node, halves)| self.hat(*node, nodes.dx_mm, halves, sums))
                    .collect();
                resample::filled(&nodes.x_mm, &own)
            }
        }
    }

    /// Σ w θ / Σ w with w = 1 ∓ (x − node)/dx to the right and left.
    fn hat(&self, node: f64, dx_mm: f64, halves: &Halves, sums: &[Sums]) -> Option<Theta> {
        let mut total = 0.0;
        let mut sum = [0.0; 4];
        for (half, slope) in halves.iter().zip([1.0 / dx_mm, -1.0 / dx_mm]) {
            for i in half.clone() {
                // w = base + slope · (x − origin)
                let base = 1.0 + slope * (self.runs[i].origin_mm - node);
                total += base * self.sizes[i].0 + slope * self.sizes[i].1;
                add(&mut sum, base, &sums[i].theta);
                add(&mut sum, slope, &sums[i].moment);
            }
        }
        (total > 0.0).then(|| sum.map(|s| s / total))
    }
}

fn add(sum: &mut Theta, factor: f64, theta: &Theta) {
    for (s, p) in sum.iter_mut().zip(theta) {
        *s += factor * p;
    }
}

/// Groups at equal encoder counts, only those next to nodes.
fn points(x_mm: &[f64], tables: &[Nodes]) -> (Vec<Range<usize>>, Vec<Composition>) {
    let (positions, groups) = resample::equal_counts(x_mm);
    let neighbors = |node: &f64| {
        let right = positions.partition_point(|position| position <= node);
        [right.saturating_sub(1), right.min(positions.len() - 1)]
    };
    let mut used = vec![false; groups.len()];
    for node in tables.iter().flat_map(|t| &t.x_mm) {
        for group in neighbors(node) {
            used[group] = true;
        }
    }
    // group → run
    let mut number = vec![0; groups.len()];
    let mut bounds = Vec::new();
    for (group, range) in groups.into_iter().enumerate().filter(|(g, _)| used[*g]) {
        number[group] = bounds.len();
        bounds.push(range);
    }
    let composition = |t: &Nodes| {
        let mut own: Vec<usize> = t.x_mm.iter().flat_map(neighbors).collect();
        own.sort_unstable();
        own.dedup();
        Composition::Point {
            positions: own.iter().map(|group| positions[*group]).collect(),
            runs: own.iter().map(|group| number[*group]).collect(),
        }
    };
    (bounds, tables.iter().map(composition).collect())
}

/// Divides the samples into runs. `tables` has for each node the indices [from,
/// middle, to) of its samples. Returns the runs between all of these indices, and for
/// each table and node the runs on either side of its middle.
fn divide(tables: Vec<Vec<[usize; 3]>>) -> (Vec<Range<usize>>, Vec<Vec<Halves>>) {
    let mut edges: Vec<usize> = tables.iter().flatten().flatten().copied().collect();
    edges.sort_unstable();
    edges.dedup();
    let run = |edge: usize| edges.partition_point(|e| *e < edge);
    let halves = tables
        .iter()
        .map(|nodes| {
            nodes
                .iter()
                .map(|[from, middle, to]| [run(*from)..run(*middle), run(*middle)..run(*to)])
                .collect()
        })
        .collect();
    let bounds = edges.windows(2).map(|pair| pair[0]..pair[1]).collect();
    (bounds, halves)
}
