//! Whether a recording tells m, b, k and F0 apart.
//!
//! In each window of x and each direction: the condition number of the matrix with
//! the columns [a v x 1], x from the middle of the window and every column scaled
//! to length 1. Where two columns are nearly one (on a single sine a follows from
//! x), least squares divides what belongs together at will, and the parameters
//! fail on another trajectory whatever their VAF on this one. A swept sine has
//! about 5, a single sine thousands.

use crate::recording::Recording;

/// Width of a window, mm.
pub const WINDOW_MM: f64 = 1.0;
/// Condition number above which parameters are not to be trusted.
pub const DOUBTFUL: f64 = 100.0;
/// Windows with fewer samples are left out.
const LEAST_SAMPLES: usize = 20;
/// More windows than this are a mistake in units.
const MOST_WINDOWS: f64 = 100_000.0;
/// What a double can tell from infinite in a matrix of squares.
const MOST_CONDITION: f64 = 1e8;

/// The condition number in one window and direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Window {
    /// Its middle, mm.
    pub x_mm: f64,
    /// Whether of v > 0, else of v < 0.
    pub positive: bool,
    /// How many samples.
    pub samples: usize,
    /// From 1; at most 1e8, which stands for more.
    pub condition: f64,
}

/// The windows of a recording, ascending in x, + before −.
#[derive(Debug, Clone, PartialEq)]
pub struct Excitation {
    /// Those with enough samples.
    pub windows: Vec<Window>,
}

impl Excitation {
    /// Looks at a recording in windows of [`WINDOW_MM`].
    pub fn of(recording: &Recording) -> Self {
        let [low, high] = recording.range_mm();
        let first = (low / WINDOW_MM).floor();
        let count = ((high / WINDOW_MM).floor() - first + 1.0).min(MOST_WINDOWS);
        // at most MOST_WINDOWS, so the cast is exact
        let mut sums = vec![[Gram::default(); 2]; count as usize];
        for i in 0..recording.len() {
            let (x, v) = (recording.x_mm[i], recording.v_mm_s[i]);
            if v == 0.0 {
                continue;
            }
            let place = (x / WINDOW_MM).floor() - first;
            let Some(window) = sums.get_mut(place as usize) else {
                continue;
            };
            let middle = (first + place + 0.5) * WINDOW_MM;
            window[usize::from(v < 0.0)].add([recording.a_m_s2[i], v, x - middle, 1.0]);
        }
        let windows = sums
            .iter()
            .enumerate()
            .flat_map(|(place, both)| {
                let x_mm = (first + place as f64 + 0.5) * WINDOW_MM;
                [(true, both[0]), (false, both[1])].map(|(positive, gram)| Window {
                    x_mm,
                    positive,
                    samples: gram.samples,
                    condition: gram.condition(),
                })
            })
            .filter(|window| window.samples >= LEAST_SAMPLES)
            .collect();
        Self { windows }
    }

    /// The middle one of all condition numbers; `None` without windows.
    pub fn median(&self) -> Option<f64> {
        let mut all: Vec<f64> = self.windows.iter().map(|w| w.condition).collect();
        all.sort_by(f64::total_cmp);
        all.get(all.len() / 2).copied()
    }

    /// The window with the largest.
    pub fn worst(&self) -> Option<Window> {
        let by = |a: &&Window, b: &&Window| a.condition.total_cmp(&b.condition);
        self.windows.iter().max_by(by).copied()
    }

    /// Share of the windows above [`DOUBTFUL`], 0 to 1.
    pub fn doubtful_share(&self) -> f64 {
        let doubtful = self
            .windows
            .iter()
            .filter(|w| w.condition > DOUBTFUL)
            .count();
        doubtful as f64 / self.windows.len().max(1) as f64
    }

    /// One sentence if the parameters of half of the windows are not to be trusted.
    pub fn warning(&self) -> Option<String> {
        let median = self.median()?;
        (median > DOUBTFUL).then(|| {
            format!(
                "a, v and x hardly move independently: the condition number of [a v x 1] has a median of {median:.0} (above {DOUBTFUL}): m, b and k cannot be told apart; record a swept sine, or leave m or k out"
            )
        })
    }
}

/// Sums of products of the columns.
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

    /// Of the matrix with columns of length 1: the root of the ratio of the
    /// extreme eigenvalues of its products.
    fn condition(&self) -> f64 {
        let length: [f64; 4] = std::array::from_fn(|i| libm::sqrt(self.sums[i][i]));
        if !length.iter().all(|l| *l > 0.0) {
            return MOST_CONDITION;
        }
        let scaled = std::array::from_fn(|i| {
            std::array::from_fn(|j| self.sums[i][j] / (length[i] * length[j]))
        });
        let values = eigenvalues(scaled);
        let [low, high] = extremes(&values);
        if low <= high / (MOST_CONDITION * MOST_CONDITION) {
            return MOST_CONDITION;
        }
        libm::sqrt(high / low)
    }
}

fn extremes(values: &[f64]) -> [f64; 2] {
    values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| {
            [low.min(*v), high.max(*v)]
        })
}

/// Eigenvalues of a symmetric matrix by Jacobi's rotations.
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
