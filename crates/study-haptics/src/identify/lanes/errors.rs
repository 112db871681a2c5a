//! Prediction errors of the tables of several λ on one recording.
//!
//! The position of a sample between the nodes does not depend on λ, so it is found
//! once for all tables that share their nodes. The force is bit for bit that of
//! [`study_wire::predict`] with the direction rule `sign`. Mean and variance of the
//! errors come from one pass: within chunks of 512 samples the errors are taken
//! relative to the first, which preserves precision, and the chunks are combined as
//! in Chan, Golub & LeVeque (1979).

use super::{Lane, Processor, WIDTH};
use crate::model::Realization;
use crate::recording::Recording;
use study_wire::predict::Lookup;

/// Samples that are located before they are compared.
const CHUNK: usize = 512;

/// Mean and variance of the prediction errors of a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Errors {
    /// mean(F̂ − F), N.
    pub mean_n: f64,
    /// var(F̂ − F) with divisor n, N².
    pub variance_n2: f64,
}

/// The errors of each realization on `recording`. All have to share their nodes and
/// look-up and have the direction rule `sign`.
pub fn errors(
    processor: Processor,
    realizations: &[&Realization],
    recording: &Recording,
) -> Vec<Errors> {
    let Some(first) = realizations.first() else {
        return Vec::new();
    };
    let tables: Vec<LaneTable> = realizations.chunks(WIDTH).map(LaneTable::new).collect();
    let mut moments = vec![Moments::default(); tables.len()];
    let nodes = Nodes {
        x_mm: &first.x_mm,
        lookup: first.lookup,
    };
    match processor {
        #[cfg(target_arch = "x86_64")]
        Processor::Avx2 => {
            assert_eq!(Processor::best(), processor, "this machine has AVX2");
            // SAFETY: the assertion above shows that the machine has AVX2 and FMA.
            #[allow(unsafe_code, reason = "the same loop, compiled for AVX2")]
            unsafe {
                avx2(nodes, &tables, recording, &mut moments);
            }
        }
        _ => compare(nodes, &tables, recording, &mut moments),
    }
    (0..realizations.len())
        .map(|i| {
            let moments = &moments[i / WIDTH];
            Errors {
                mean_n: moments.mean.0[i % WIDTH],
                variance_n2: moments.squares.0[i % WIDTH] / moments.n,
            }
        })
        .collect()
}

#[derive(Debug, Clone, Copy)]
struct Nodes<'a> {
    x_mm: &'a [f64],
    lookup: Lookup,
}

/// m, b, k, F0 of four realizations at the nodes of the + direction, then of the −
/// direction.
#[derive(Debug)]
struct LaneTable(Vec<[Lane; 4]>);

impl LaneTable {
    /// From at most four realizations; the last one fills unused lanes.
    fn new(realizations: &[&Realization]) -> Self {
        let of = |i: usize| realizations[i.min(realizations.len() - 1)];
        let mut table = Vec::new();
        for negative in [false, true] {
            for node in 0..realizations[0].x_mm.len() {
                let mut theta = [Lane::ZERO; 4];
                for lane in 0..WIDTH {
                    let r = of(lane);
                    let branch = if negative { &r.negative } else { &r.positive };
                    theta[0].0[lane] = branch.m_kg[node];
                    theta[1].0[lane] = branch.b_n_s_per_mm[node];
                    theta[2].0[lane] = branch.k_n_per_mm[node];
                    theta[3].0[lane] = branch.f0_n[node];
                }
                table.push(theta);
            }
        }
        Self(table)
    }
}

/// The position of a sample in a [`LaneTable`]: between the entries `left` and
/// `right`, whose weights are 1 − `weight` and `weight`.
#[derive(Debug, Clone, Copy, Default)]
struct Position {
    left: usize,
    right: usize,
    weight: f64,
}

/// Locates the samples of a recording one after the other.
#[derive(Debug)]
struct Cursor {
    left: usize,
    negative: bool,
}

impl Cursor {
    /// As `locate` in [`study_wire::predict`], searching from the previous sample.
    #[inline(always)]
    fn step(&mut self, nodes: Nodes<'_>, x: f64, v: f64) -> Position {
        if v > 0.0 {
            self.negative = false;
        } else if v < 0.0 {
            self.negative = true;
        }
        let last = nodes.x_mm.len() - 1;
        let (at, weight) = if x <= nodes.x_mm[0] {
            self.left = 0;
            (0, 0.0)
        } else if x >= nodes.x_mm[last] {
            self.left = last - 1;
            (last, 0.0)
        } else {
            let mut left = self.left;
            while nodes.x_mm[left] > x {
                left -= 1;
            }
            while nodes.x_mm[left + 1] <= x {
                left += 1;
            }
            self.left = left;
            let weight = (x - nodes.x_mm[left]) / (nodes.x_mm[left + 1] - nodes.x_mm[left]);
            nodes.lookup.between(left, weight)
        };
        let offset = if self.negative { last + 1 } else { 0 };
        Position {
            left: offset + at,
            right: offset + (at + 1).min(last),
            weight,
        }
    }
}

/// n, mean and Σ(e − mean)² for four tables.
#[derive(Debug, Clone, Copy)]
struct Moments {
    n: f64,
    mean: Lane,
    squares: Lane,
}

impl Default for Moments {
    fn default() -> Self {
        Self {
            n: 0.0,
            mean: Lane::ZERO,
            squares: Lane::ZERO,
        }
    }
}

impl Moments {
    #[inline(always)]
    fn join(&mut self, other: &Self) {
        let n = self.n + other.n;
        let apart = other.mean - self.mean;
        self.mean = self.mean + apart * Lane::all(other.n / n);
        self.squares =
            self.squares + other.squares + apart * apart * Lane::all(self.n * other.n / n);
        self.n = n;
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn avx2(nodes: Nodes<'_>, tables: &[LaneTable], recording: &Recording, moments: &mut [Moments]) {
    compare(nodes, tables, recording, moments);
}

/// F̂ − F of a sample [a, v, x, F]. A function, not a closure: only inlined code is
/// compiled for AVX2.
#[inline(always)]
fn error(table: &LaneTable, at: Position, [a, v, x, f]: [f64; 4]) -> Lane {
    let (left, right) = (&table.0[at.left], &table.0[at.right]);
    let weight = Lane::all(at.weight);
    let m = left[0] + weight * (right[0] - left[0]);
    let b = left[1] + weight * (right[1] - left[1]);
    let k = left[2] + weight * (right[2] - left[2]);
    let f0 = left[3] + weight * (right[3] - left[3]);
    m * Lane::all(a) + b * Lane::all(v) + k * Lane::all(x) + f0 - Lane::all(f)
}

#[inline(always)]
fn compare(nodes: Nodes<'_>, tables: &[LaneTable], recording: &Recording, moments: &mut [Moments]) {
    let mut cursor = Cursor {
        left: 0,
        negative: false,
    };
    let mut positions = [Position::default(); CHUNK];
    for from in (0..recording.len()).step_by(CHUNK) {
        let range = from..(from + CHUNK).min(recording.len());
        let positions = &mut positions[..range.len()];
        let (x, v) = (
            &recording.x_mm[range.clone()],
            &recording.v_mm_s[range.clone()],
        );
        for (position, (x, v)) in positions.iter_mut().zip(x.iter().zip(v)) {
            *position = cursor.step(nodes, *x, *v);
        }
        let (a, f) = (&recording.a_m_s2[range.clone()], &recording.f_n[range]);
        for (table, moments) in tables.iter().zip(moments.iter_mut()) {
            let first = error(table, positions[0], [a[0], v[0], x[0], f[0]]);
            let mut sum = Lane::ZERO;
            let mut squares = Lane::ZERO;
            for i in 0..positions.len() {
                let e = error(table, positions[i], [a[i], v[i], x[i], f[i]]) - first;
                sum = sum + e;
                squares = e.mul_add(e, squares);
            }
            let n = positions.len() as f64;
            let mean = sum * Lane::all(1.0 / n);
            moments.join(&Moments {
                n,
                mean: first + mean,
                squares: squares - sum * mean,
            });
        }
    }
}
