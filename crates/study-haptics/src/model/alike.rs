//! Whether two realizations feel the same.

use super::{Branch, Elements, Realization};

/// Parameters that differ by less than this share of the largest are equal: they went different ways to the same number.
const ROUNDING: f64 = 1e-9;

impl Realization {
    /// Whether two realizations ask for the same force everywhere: the same nodes and parameters, look-up and direction rule,
    /// apart from rounding errors. Names, origins and trained ranges do not matter.
    pub fn is_alike(&self, other: &Self) -> bool {
        let branches = [
            (&self.positive, &other.positive),
            (&self.negative, &other.negative),
        ];
        let parameters: [fn(&Branch) -> &Vec<f64>; 4] = [
            |b| &b.m_kg,
            |b| &b.b_n_s_per_mm,
            |b| &b.k_n_per_mm,
            |b| &b.f0_n,
        ];
        self.units == other.units
            && self.lookup == other.lookup
            && self.direction == other.direction
            && self.mechanism == other.mechanism
            && same(&self.x_mm, &other.x_mm)
            && (branches.iter()).all(|(a, b)| parameters.iter().all(|of| same(of(a), of(b))))
            && match (&self.elements, &other.elements) {
                (None, None) => true,
                (Some(own), Some(other)) => own.is_alike(other),
                _ => false,
            }
    }
}

impl Elements {
    fn is_alike(&self, other: &Self) -> bool {
        self.springs == other.springs
            && same(&[self.mass_kg], &[other.mass_kg])
            && same(&self.x_mm, &other.x_mm)
            && same(&self.force_n, &other.force_n)
            && (self
                .damping_n_s_per_mm
                .iter()
                .zip(&other.damping_n_s_per_mm))
            .chain(self.spring_n.iter().zip(&other.spring_n))
            .all(|(a, b)| same(a, b))
    }
}

fn same(a: &[f64], b: &[f64]) -> bool {
    let largest = a
        .iter()
        .chain(b)
        .fold(0.0, |most: f64, x| most.max(x.abs()));
    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= ROUNDING * largest;
    a.len() == b.len() && a.iter().zip(b).all(near)
}

#[cfg(test)]
mod tests {
    use super::same;

    #[test]
    fn rounding_errors_are_no_difference() {
        let (a, b) = ([0.1 + 0.2, -4.0], [0.3, -4.0]);
        assert!(a != b && same(&a, &b));
        assert!(!same(&[0.3, -4.0], &[0.3001, -4.0]));
        assert!(same(&[0.0], &[0.0]) && !same(&[0.0], &[1e-12]));
        assert!(!same(&[1.0], &[1.0, 1.0]));
    }
}
