//! Whether the excitation of a recording suffices to identify m, b, k and F0.
//!
//! For each window of x and each direction: the condition number of the matrix with
//! the columns [a v x 1], with x relative to the center of the window and every column
//! scaled to length 1. If two columns are nearly collinear (in a single sine a follows
//! from x), their parameters are not identifiable and fail on another trajectory,
//! whatever the VAF on this one. A swept sine has a condition number of about 5, a
//! single sine of thousands.

use crate::recording::{Recording, range};

/// Condition number above which parameters are not identifiable.
pub const ILL_CONDITIONED: f64 = 100.0;
/// Windows with fewer samples are left out.
const MIN_SAMPLES: usize = 20;
/// More windows than this are a mistake in units.
const MAX_WINDOWS: f64 = 100_000.0;
/// The largest condition number that the eigenvalues of a Gram matrix resolve in
/// double precision.
const MAX_CONDITION: f64 = 1e8;

/// The condition number of one window and direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Center of the window, mm.
    pub x_mm: f64,
    /// Whether v > 0, else v < 0.
    pub positive: bool,
    /// Number of samples.
    pub samples: usize,
    /// Condition number, at least 1; saturates at 1e8, the limit of double precision.
    pub condition: f64,
}

/// The windows of a recording, ascending in x, + before −.
#[derive(Debug, Clone, PartialEq)]
pub struct Excitation {
    /// The windows with at least 20 samples.
    pub windows: Vec<Window>,
    /// Their width, mm: [`Recording::scale_mm`].
    pub window_mm: f64,
}

impl Excitation {
    /// Analyzes a recording in windows of [`Recording::scale_mm`].
    pub fn of(recording: &Recording) -> Self {
        let [low, high] = recording.range_mm();
        let window_mm = recording.scale_mm();
        let first = (low / window_mm).floor();
        let count = ((high / window_mm).floor() - first + 1.0).min(MAX_WINDOWS);
        // at most MAX_WINDOWS, so the cast is exact
        let mut sums = vec![[Gram::default(); 2]; count as usize];
        for i in 0..recording.len() {
            let (x, v) = (recording.x_mm[i], recording.v_mm_s[i]);
            if v == 0.0 {
                continue;
            }
            let index = (x / window_mm).floor() - first;
            let Some(window) = sums.get_mut(index as usize) else {
                continue;
            };
            let center = (first + index + 0.5) * window_mm;
            window[usize::from(v < 0.0)].add([recording.a_m_s2[i], v, x - center, 1.0]);
        }
        let windows = sums
            .iter()
            .enumerate()
            .flat_map(|(index, both)| {
                let x_mm = (first + index as f64 + 0.5) * window_mm;
                [(true, both[0]), (false, both[1])].map(|(positive, gram)| Window {
                    x_mm,
                    positive,
                    samples: gram.samples,
                    condition: gram.condition(),
                })
            })
            .filter(|window| window.samples >= MIN_SAMPLES)
            .collect();
        Self { windows, window_mm }
    }

    /// The median of the condition numbers; `None` without windows.
    pub fn median(&self) -> Option<f64> {
        let mut all: Vec<f64> = self.windows.iter().map(|w| w.condition).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    }

    /// The window with the largest condition number; `None` without windows.
    pub fn worst(&self) -> Option<Window> {
        let by = |a: &&Window, b: &&Window| a.condition.total_cmp(&b.condition);
        self.windows.iter().max_by(by).copied()
    }

    /// The share of windows above [`ILL_CONDITIONED`], 0 to 1.
    pub fn ill_conditioned_share(&self) -> f64 {
        let above = self
            .windows
            .iter()
            .filter(|w| w.condition > ILL_CONDITIONED)
            .count();
        above as f64 / self.windows.len().max(1) as f64
    }

    /// A warning if the parameters are not identifiable in half of the windows.
    pub fn warning(&self) -> Option<String> {
        let median = self.median()?;
        (median > ILL_CONDITIONED).then(|| {
            let median = match median < 1e6 {
                true => format!("{median:.0}"),
                false => format!("{median:.0e}"),
            };
            format!(
                "m, b and k are not identifiable, because a, v and x hardly vary independently: the median condition number of [a v x 1] is {median}, above {ILL_CONDITIONED}; record a swept sine"
            )
        })
    }
}

/// The Gram matrix of the columns.
#[derive(Debug, Clone, Copy, Default)]
struct Gram {
    samples: usize,
    sums: [[f64; 4]; 4],
}

impl Gram {
    fn add(&mut self, row: [f64; 4]) {
        self.samples += 1;
        for (sums, one) in self.sums.iter_mut().zip(row) {
            for (sum, other) in sums.iter_mut().zip(row) {
                *sum += one * other;
            }
        }
    }

    /// The condition number of the matrix with columns of length 1: the square root of
    /// the ratio of the extreme eigenvalues of its Gram matrix.
    fn condition(&self) -> f64 {
        let length: [f64; 4] = std::array::from_fn(|i| libm::sqrt(self.sums[i][i]));
        if !length.iter().all(|l| *l > 0.0) {
            return MAX_CONDITION;
        }
        let scaled = std::array::from_fn(|i| {
            std::array::from_fn(|j| self.sums[i][j] / (length[i] * length[j]))
        });
        let [low, high] = range(&eigenvalues(scaled));
        if low <= high / (MAX_CONDITION * MAX_CONDITION) {
            return MAX_CONDITION;
        }
        libm::sqrt(high / low)
    }
}

/// The eigenvalues of a symmetric matrix by Jacobi rotations.
fn eigenvalues(mut m: [[f64; 4]; 4]) -> [f64; 4] {
    for _ in 0..30 {
        let off: f64 = (0..4)
            .flat_map(|i| (0..i).map(move |j| (i, j)))
            .map(|(i, j)| m[i][j] * m[i][j])
            .sum();
        if off < 1e-32 {
            break;
        }
        for p in 0..3 {
            for q in p + 1..4 {
                if m[p][q] == 0.0 {
                    continue;
                }
                let theta = 0.5 * (m[q][q] - m[p][p]) / m[p][q];
                let t = libm::copysign(1.0, theta)
                    / (libm::fabs(theta) + libm::sqrt(theta * theta + 1.0));
                let c = 1.0 / libm::sqrt(t * t + 1.0);
                let s = t * c;
                for row in &mut m {
                    let (one, other) = (row[p], row[q]);
                    row[p] = c * one - s * other;
                    row[q] = s * one + c * other;
                }
                let (one, other) = (m[p], m[q]);
                m[p] = std::array::from_fn(|k| c * one[k] - s * other[k]);
                m[q] = std::array::from_fn(|k| s * one[k] + c * other[k]);
            }
        }
    }
    std::array::from_fn(|i| m[i][i])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn independent_columns_have_condition_one_and_equal_ones_the_most() {
        let mut gram = Gram::default();
        for bits in 0..16 {
            let sign = |bit: i32| if bits >> bit & 1 == 1 { 3.0 } else { -3.0 };
            gram.add([sign(0), 10.0 * sign(1), 0.1 * sign(2), 1.0]);
        }
        assert!((gram.condition() - 1.0).abs() < 1e-9);
        let mut twice = Gram::default();
        for i in 0..30 {
            let x = f64::from(i % 7);
            twice.add([x, f64::from(i % 5), 2.0 * x, 1.0]);
        }
        assert!(twice.condition() > 1e7, "{}", twice.condition());
    }

    /// Reference: numpy 2.4.6, linalg.eigvalsh; 1e-12.
    #[test]
    fn the_eigenvalues_are_those_of_numpy() {
        let m = [
            [1.0, 0.3, -0.2, 0.1],
            [0.3, 1.0, 0.5, 0.0],
            [-0.2, 0.5, 1.0, -0.4],
            [0.1, 0.0, -0.4, 1.0],
        ];
        let mut found = eigenvalues(m);
        found.sort_by(f64::total_cmp);
        let expected = [
            0.2536264622053983,
            0.8012953530052591,
            1.3039321268500834,
            1.641146057939259,
        ];
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
}
