//! Force over displacement of slow presses and releases: mean curves, and how much repeated
//! measurements differ.
//!
//! A loop is a press from below 10 % of the travel to above 90 % of it, and the release. The curve of a
//! loop is the mean force in [`BINS`] bins of displacement, of the press and of the release. What
//! differs between repetitions no model can predict; their rms difference, by position, is what a
//! model's error is compared with.

use super::vaf;
use crate::model::Realization;
use crate::recording::{Recording, mean_and_variance, range};
use std::ops::Range;

/// Bins of displacement of a curve.
pub const BINS: usize = 100;
/// Numbers about a whole curve are those between these shares of the travel: before, the probe touches
/// the target; behind, it presses on its stop.
pub const WITHIN: [f64; 2] = [0.08, 0.92];
/// A loop goes from below the first to above the second share of the travel, and back.
const TURNS: [f64; 2] = [0.1, 0.9];

/// Mean force by displacement, N: of the press and of the release.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve(pub [Vec<f64>; 2]);

/// The rows of each loop; none if the displacement does not go there and back.
pub fn loops(x_mm: &[f64]) -> Vec<Range<usize>> {
    let [low, high] = range(x_mm);
    let at = |share: f64| low + share * (high - low);
    let first = first_press(x_mm, TURNS.map(at));
    let (mut found, mut begin, mut deep) = (Vec::new(), first, false);
    // the row of least displacement since the loop was left
    let mut end: Option<usize> = None;
    for (i, x) in x_mm.iter().enumerate().skip(first) {
        if *x > at(TURNS[1]) {
            if let Some(end) = end.take() {
                found.push(begin..end + 1);
                begin = end + 1;
            }
            deep = true;
        } else if deep && *x < at(TURNS[0]) && end.is_none_or(|end| *x < x_mm[end]) {
            end = Some(i);
        }
    }
    if deep && end.is_some() {
        found.push(begin..x_mm.len());
    }
    found
}

/// The row at which the first press begins: a recording that begins at the bottom has a release before it.
fn first_press(x_mm: &[f64], [low, high]: [f64; 2]) -> usize {
    if x_mm.first().is_none_or(|x| *x <= high) {
        return 0;
    }
    let after = |from: usize, is: &dyn Fn(f64) -> bool| {
        let way = x_mm[from..].iter().position(|x| is(*x));
        way.map_or(x_mm.len(), |way| from + way)
    };
    let rest = after(0, &|x| x < low);
    let deep = after(rest, &|x| x > high);
    let least = |least: usize, i: usize| if x_mm[i] < x_mm[least] { i } else { least };
    (rest..deep).reduce(least).unwrap_or(x_mm.len())
}

impl Curve {
    /// The curve of one loop between two displacements, mm; `None` if a direction has none there.
    pub fn of(x_mm: &[f64], f_n: &[f64], [low, high]: [f64; 2]) -> Option<Self> {
        let top = (0..x_mm.len()).reduce(|top, i| if x_mm[i] > x_mm[top] { i } else { top })?;
        let branch = |rows: Range<usize>| {
            let mut sums = [(0.0, 0.0); BINS];
            for i in rows {
                let share = (x_mm[i] - low) / (high - low);
                if (0.0..1.0).contains(&share) {
                    let (sum, count) = &mut sums[(share * BINS as f64) as usize];
                    *sum += f_n[i];
                    *count += 1.0;
                }
            }
            filled(&sums.map(|(sum, count)| (count > 0.0).then(|| sum / count)))
        };
        Some(Self([branch(0..top + 1)?, branch(top..x_mm.len())?]))
    }

    /// The standard deviation of the force over both directions, N.
    pub fn deviation_n(&self) -> f64 {
        mean_and_variance(&self.0.concat()).1.sqrt()
    }

    /// The rms difference of two curves of the same displacements, N.
    pub fn difference_n(&self, other: &Self) -> f64 {
        let both = self.0.iter().flatten().zip(other.0.iter().flatten());
        let squares: f64 = both.map(|(a, b)| (a - b) * (a - b)).sum();
        (squares / (2 * BINS) as f64).sqrt()
    }
}

/// Bins with values on the line between their neighbors where they have none.
fn filled(bins: &[Option<f64>]) -> Option<Vec<f64>> {
    let known: Vec<usize> = (0..bins.len()).filter(|i| bins[*i].is_some()).collect();
    let value = |i: usize| bins[i].unwrap_or_default();
    (!known.is_empty()).then(|| {
        let between = |i: usize| {
            let next = known.partition_point(|k| *k < i);
            match (next.checked_sub(1).map(|n| known[n]), known.get(next)) {
                (_, Some(k)) if *k == i => value(i),
                (Some(a), Some(b)) => {
                    value(a) + (value(*b) - value(a)) * (i - a) as f64 / (b - a) as f64
                }
                (Some(one), None) | (None, Some(&one)) => value(one),
                (None, None) => 0.0,
            }
        };
        (0..bins.len()).map(between).collect()
    })
}

/// All loops of some force curves, over the displacements that all of them have.
#[derive(Debug, Clone, PartialEq)]
pub struct Loops {
    /// Where the curves are, mm: the whole common travel.
    pub range_mm: [f64; 2],
    /// The same between the shares [`WITHIN`].
    pub within_mm: [f64; 2],
    loops: Vec<(Vec<f64>, Vec<f64>)>,
    /// Of the press of each loop, mm/s; `None` where the time was made up.
    speeds_mm_s: Vec<Option<f64>>,
}

/// How the width of a loop, press minus release, depends on the speed of the press.
#[derive(Debug, Clone, PartialEq)]
pub struct RateDependence {
    /// Speed, mm/s, and mean width, N, of each loop.
    pub loops: Vec<[f64; 2]>,
    /// Change of the width with ten times the speed, N.
    pub per_decade_n: f64,
    /// Half of its confidence interval of 95 %, N; `None` with two loops, which leave no error.
    pub error_n: Option<f64>,
}

/// Speeds that differ by less than this factor are the same.
const OTHER_SPEED: f64 = 1.5;
/// Quantiles .975 of Student's t for 1, 2, … degrees of freedom; with more than these it is 2.2 or less.
const STUDENT: [f64; 10] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228,
];

impl RateDependence {
    /// Least squares of the width on the logarithm of the speed; `None` if the speeds hardly differ.
    fn of(loops: Vec<[f64; 2]>) -> Option<Self> {
        let [slowest, fastest] = range(&loops.iter().map(|of| of[0]).collect::<Vec<_>>());
        // false without loops
        let differ = slowest > 0.0 && fastest >= OTHER_SPEED * slowest && fastest.is_finite();
        if !differ {
            return None;
        }
        let n = loops.len() as f64;
        let points: Vec<[f64; 2]> = (loops.iter()).map(|of| [of[0].log10(), of[1]]).collect();
        let mean = |k: usize| points.iter().map(|p| p[k]).sum::<f64>() / n;
        let (x, y) = (mean(0), mean(1));
        let information: f64 = points.iter().map(|p| (p[0] - x).powi(2)).sum();
        let product: f64 = points.iter().map(|p| (p[0] - x) * (p[1] - y)).sum();
        let per_decade_n = product / information;
        let left = |p: &[f64; 2]| (p[1] - y - per_decade_n * (p[0] - x)).powi(2);
        let freedom = loops.len().saturating_sub(2);
        let error_n = (freedom > 0).then(|| {
            let variance = points.iter().map(left).sum::<f64>() / freedom as f64;
            let student = STUDENT[freedom.min(STUDENT.len()) - 1];
            student * (variance / information).sqrt()
        });
        Some(Self {
            loops,
            per_decade_n,
            error_n,
        })
    }

    /// Whether the width depends on the speed; `None` without an error to compare with.
    pub fn depends(&self) -> Option<bool> {
        self.error_n
            .map(|error_n| self.per_decade_n.abs() > error_n)
    }
}

impl Loops {
    /// The loops of those recordings that are force curves; `None` without one.
    pub fn of(recordings: &[&Recording]) -> Option<Self> {
        let (mut found, mut speeds_mm_s) = (Vec::new(), Vec::new());
        for recording in recordings.iter().filter(|r| r.is_force_curve()) {
            let timed = recording.quasi_static().is_none();
            for rows in loops(&recording.x_mm) {
                let of = |column: &[f64]| column[rows.clone()].to_vec();
                let x_mm = of(&recording.x_mm);
                let speed = press_mm_s(&of(&recording.t_s), &x_mm);
                speeds_mm_s.push(speed.filter(|_| timed));
                found.push((x_mm, of(&recording.f_n)));
            }
        }
        let ranges = found.iter().map(|(x, _)| range(x));
        let range_mm = ranges.reduce(|a, b| [a[0].max(b[0]), a[1].min(b[1])])?;
        let at = |share: f64| range_mm[0] + share * (range_mm[1] - range_mm[0]);
        Some(Self {
            range_mm,
            within_mm: WITHIN.map(at),
            loops: found,
            speeds_mm_s,
        })
    }

    /// Number of loops.
    pub fn count(&self) -> usize {
        self.loops.len()
    }

    /// The middles of the bins between two displacements, mm.
    pub fn positions([low, high]: [f64; 2]) -> Vec<f64> {
        let width = (high - low) / BINS as f64;
        (0..BINS).map(|i| low + (i as f64 + 0.5) * width).collect()
    }

    /// The curve of each loop between two displacements.
    pub fn curves(&self, range_mm: [f64; 2]) -> Vec<Curve> {
        let of = |(x, f): &(Vec<f64>, Vec<f64>)| Curve::of(x, f, range_mm);
        self.loops.iter().filter_map(of).collect()
    }

    /// The mean of all curves, and the rms difference of two of them by position, N; the
    /// differences are `None` with a single loop.
    pub fn mean(&self, range_mm: [f64; 2]) -> Option<(Curve, Option<Curve>)> {
        let curves = self.curves(range_mm);
        let column = |side: usize, bin: usize| -> Vec<f64> {
            curves.iter().map(|curve| curve.0[side][bin]).collect()
        };
        let each = |of: &dyn Fn(&[f64]) -> f64| {
            Curve([0, 1].map(|side| (0..BINS).map(|bin| of(&column(side, bin))).collect()))
        };
        let n = curves.len() as f64;
        let mean = each(&|values| mean_and_variance(values).0);
        // the mean square of F_i − F_j over all pairs is twice the variance with divisor n − 1
        let difference =
            |values: &[f64]| (2.0 * mean_and_variance(values).1 * n / (n - 1.0)).sqrt();
        match curves.len() {
            0 => None,
            1 => Some((mean, None)),
            _ => Some((mean, Some(each(&difference)))),
        }
    }

    /// How the width depends on the speed; `None` unless loops of several speeds have a measured time.
    pub fn rate_dependence(&self) -> Option<RateDependence> {
        let width = |((x, f), speed): (&(Vec<f64>, Vec<f64>), &Option<f64>)| {
            let Curve([press, release]) = Curve::of(x, f, self.within_mm)?;
            let differences = press.iter().zip(&release).map(|(p, r)| p - r);
            Some([(*speed)?, differences.sum::<f64>() / BINS as f64])
        };
        let loops = self.loops.iter().zip(&self.speeds_mm_s);
        RateDependence::of(loops.filter_map(width).collect())
    }

    /// The curve of a realization that is moved as in the first loop.
    pub fn played(&self, realization: &Realization, range_mm: [f64; 2]) -> Option<Curve> {
        let (x_mm, f_n) = self.loops.first()?;
        let n = x_mm.len();
        // so slow that mass and damping have no force
        let motion = Recording {
            name: String::new(),
            t_s: (0..n).map(|i| i as f64).collect(),
            x_mm: x_mm.clone(),
            v_mm_s: directions(x_mm),
            a_m_s2: vec![0.0; n],
            f_n: f_n.clone(),
            header: Vec::new(),
            sha256: String::new(),
            warnings: Vec::new(),
        };
        // springs that relax begin at rest, as those of a device do
        let forces: Vec<f64> = vaf::predict_told(realization, &motion, |_| false).collect();
        Curve::of(x_mm, &forces, range_mm)
    }
}

/// The mean speed of a press between the shares [`WITHIN`] of its travel, mm/s.
fn press_mm_s(t_s: &[f64], x_mm: &[f64]) -> Option<f64> {
    let [low, high] = range(x_mm);
    let reached = |share: f64| x_mm.iter().position(|x| *x >= low + share * (high - low));
    let (from, to) = (reached(WITHIN[0])?, reached(WITHIN[1])?);
    let speed = (x_mm[to] - x_mm[from]) / (t_s[to] - t_s[from]);
    (speed.is_finite() && speed > 0.0).then_some(speed)
}

/// Hardly any speed, in the direction of the press until the deepest row and of the release then.
fn directions(x_mm: &[f64]) -> Vec<f64> {
    let deepest = (0..x_mm.len()).fold(0, |top, i| if x_mm[i] > x_mm[top] { i } else { top });
    let speed = |i: usize| if i <= deepest { 1e-9 } else { -1e-9 };
    (0..x_mm.len()).map(speed).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Presses and releases of 0 to 1 mm and back in 2 × 200 rows, with these forces at 1 mm.
    fn curve(tops: &[f64]) -> Recording {
        let mut text = String::from("# measured force curve: a test\nt_s,x_mm,f_n\n");
        let mut t = 0;
        for top in tops {
            for i in (0..200).chain((0..200).rev()) {
                let x = f64::from(i) / 199.0;
                text += &format!(
                    "{t},{x},{}\n",
                    top * x + if t % 400 < 200 { 0.2 } else { 0.0 }
                );
                t += 1;
            }
        }
        crate::recording::read("r", text.as_bytes()).unwrap()
    }

    #[test]
    fn every_press_with_its_release_is_a_loop() {
        let recording = curve(&[1.0, 1.0, 1.0]);
        assert_eq!(loops(&recording.x_mm), [0..400, 400..800, 800..1200]);
        assert_eq!(loops(&[0.0, 0.5, 1.0]), []);
        assert_eq!(loops(&[]), []);
        // a release whose press was not recorded is no loop
        assert_eq!(loops(&[1.0, 0.5, 0.05, 0.0, 0.5, 1.0]), []);
        let from_the_bottom = [1.0, 0.5, 0.05, 0.0, 0.05, 0.5, 1.0, 0.5, 0.0];
        assert_eq!(
            loops(&from_the_bottom).as_slice(),
            std::slice::from_ref(&(3..9))
        );
        assert_eq!(
            loops(&[0.0, 1.0, 0.0]).as_slice(),
            std::slice::from_ref(&(0..3))
        );
    }

    #[test]
    fn repetitions_differ_by_what_was_added() {
        // forces of x, 1.1 x and 1.2 x: differences of 0.1 x, 0.1 x, 0.2 x, rms 0.1 √2 x
        let recording = curve(&[1.0, 1.1, 1.2]);
        let loops = Loops::of(&[&recording]).unwrap();
        assert_eq!(loops.count(), 3);
        let (mean, difference) = loops.mean(loops.range_mm).unwrap();
        let difference = difference.unwrap();
        let x = Loops::positions(loops.range_mm);
        // a bin has two rows, whose mean is within half a bin of its middle
        for (i, x) in x.iter().enumerate() {
            for (side, friction) in [(0, 0.2), (1, 0.0)] {
                assert!((mean.0[side][i] - 1.1 * x - friction).abs() < 0.012, "{i}");
                let expected = 0.02_f64.sqrt() * x;
                assert!((difference.0[side][i] - expected).abs() < 0.002, "{i}");
            }
        }
        assert!(
            Loops::of(&[&curve(&[1.0])])
                .unwrap()
                .mean([0.0, 1.0])
                .unwrap()
                .1
                .is_none()
        );
    }

    /// Presses of 1 mm in 10 s, 10 s, 1 s, 1 s and .1 s, with widths of .2 N and .05 N more with each decade.
    #[test]
    fn a_width_that_depends_on_the_speed_is_told_from_one_that_does_not() {
        let recording = |more: f64, header: &str| {
            let mut text = format!("# measured force curve: a test\n{header}t_s,x_mm,f_n\n");
            let mut t = 0.0;
            for (k, decade) in [0, 0, 1, 1, 2].into_iter().enumerate() {
                let width = 0.2 + more * f64::from(decade) + [0.002, -0.002][k % 2];
                for i in (0..200).chain((0..200).rev().map(|i| i + 1000)) {
                    let (x, press) = (f64::from(i % 1000) / 199.0, i < 1000);
                    text += &format!("{t},{x},{}\n", x + if press { width } else { 0.0 });
                    t += 0.05 / 10_f64.powi(decade);
                }
            }
            crate::recording::read("r", text.as_bytes()).unwrap()
        };
        let of = |recording: &Recording| Loops::of(&[recording]).unwrap().rate_dependence();
        let found = of(&recording(0.05, "")).unwrap();
        assert!((found.loops[0][0] - 0.1).abs() < 2e-3, "{found:?}");
        assert!((found.loops[4][0] - 10.0).abs() < 0.2, "{found:?}");
        assert!((found.per_decade_n - 0.05).abs() < 0.003, "{found:?}");
        assert_eq!(found.depends(), Some(true));
        let found = of(&recording(0.0, "")).unwrap();
        assert_eq!(found.depends(), Some(false), "{found:?}");
        // t(.975, 3) √(Σ e²/3 / Σ (x − x̄)²) of y = ±.002 on x = 0, 0, 1, 1, 2, computed apart in Python
        let error_n = found.error_n.unwrap();
        assert!((error_n - 0.004_546).abs() < 2e-5, "{error_n}");
        assert_eq!(of(&recording(0.05, "# quasi-static: made up\n")), None);
    }

    #[test]
    fn empty_bins_are_on_the_line_between_their_neighbors() {
        let bins = [None, Some(1.0), None, Some(3.0), None];
        assert_eq!(filled(&bins), Some(vec![1.0, 1.0, 2.0, 3.0, 3.0]));
        assert_eq!(filled(&[None]), None);
    }
}
