//! What is doubtful about the measured values themselves: spikes, saturation, and a force
//! of the wrong sign.

use super::differences::{acceleration, velocity};
use super::{Recording, Warning, range};

/// A sample is a spike if it differs from the median of its neighborhood by more than this
/// share of the range that most samples cover …
const SPIKE_SHARE: f64 = 0.2;
/// … and by this many times what is usual.
const SPIKE_RATIO: f64 = 50.0;
/// Samples on either side of a sample in its neighborhood.
const REACH: usize = 3;
/// So many samples in a row at the highest or lowest value are saturation; a smooth peak has
/// fewer that are equal.
const FLAT_RUN: usize = 5;
/// A position that moves by more than this share of its range from sample to sample says
/// nothing of cycles.
const COARSE: f64 = 0.2;
/// Less energy per path than this share of the range of the force may be noise.
const ENERGY_SHARE: f64 = 0.005;

/// The samples of a column that differ from all their neighbors as no motion does.
pub(super) fn spikes(values: &[f64]) -> Vec<usize> {
    if values.len() < 20 * REACH {
        return Vec::new();
    }
    let mut around = Vec::with_capacity(2 * REACH + 1);
    let away: Vec<f64> = (0..values.len())
        .map(|i| {
            let (from, to) = (i.saturating_sub(REACH), (i + REACH + 1).min(values.len()));
            around.clear();
            around.extend_from_slice(&values[from..to]);
            (values[i] - median(&mut around)).abs()
        })
        .collect();
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
    let reach = at(0.99) - at(0.01);
    let mut usual = away.clone();
    usual.sort_by(f64::total_cmp);
    // of the larger ones, because most samples of a slow signal are their own median
    let usual = usual[(usual.len() - 1) * 9 / 10];
    let least = (SPIKE_SHARE * reach).max(SPIKE_RATIO * usual);
    (0..values.len()).filter(|i| away[*i] > least).collect()
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// The number of samples in runs at the highest or lowest value, and that value. Spikes
/// are no part of the range.
fn saturated(values: &[f64], spikes: &[usize]) -> Option<(usize, f64)> {
    let mut usual = values.to_vec();
    for at in spikes {
        usual[*at] = f64::NAN;
    }
    let [low, high] = range(&usual);
    let tolerance = 1e-9 * (high - low);
    [high, low].into_iter().find_map(|end| {
        let (mut run, mut count) = (0, 0);
        for value in values.iter().chain([&f64::NAN]) {
            if (value - end).abs() <= tolerance {
                run += 1;
            } else {
                count += if run >= FLAT_RUN { run } else { 0 };
                run = 0;
            }
        }
        (count > 0).then_some((count, end))
    })
}

/// Warnings about spikes and saturation.
pub(super) fn warnings(x_mm: &[f64], f_n: &[f64], t_s: &[f64]) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let of_force = spikes(f_n);
    for (column, values, found) in [("x_mm", x_mm, &spikes(x_mm)), ("f_n", f_n, &of_force)] {
        let largest = |a: &&usize, b: &&usize| values[**a].abs().total_cmp(&values[**b].abs());
        if let Some(at) = found.iter().max_by(largest) {
            warnings.push(Warning::Spikes {
                column,
                count: found.len(),
                value: values[*at],
                at_s: t_s[*at],
            });
        }
    }
    if let Some((count, force_n)) = saturated(f_n, &of_force) {
        warnings.push(Warning::Saturated { count, force_n });
    }
    warnings
}

/// The energy that the probe put into the target over closed cycles.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Energy {
    /// ∮ F dx, J; negative if the target drove the probe.
    pub supplied_j: f64,
    /// ∫ |dx|, mm.
    pub path_mm: f64,
    /// Whether it is so negative that the target cannot be passive, or the force has the wrong
    /// sign.
    pub negative: bool,
}

impl Recording {
    /// The energy from the first sample to the last one at the same position and direction;
    /// `None` if there is no closed cycle, or too few samples in it. Around a cycle a constant
    /// force does no work; its middle is left out, because no cycle of samples closes exactly.
    pub fn energy(&self) -> Option<Energy> {
        let x = &self.x_mm;
        let start = x[0];
        let crossing = |i: &usize| (x[i - 1] - start) * (x[*i] - start) <= 0.0 && x[*i] != x[i - 1];
        let first = (1..x.len()).find(|i| x[*i] != start)?;
        let upwards = x[first] > start;
        let last = (first + 1..x.len())
            .rev()
            .filter(crossing)
            .find(|i| (x[*i] > x[i - 1]) == upwards)?;
        let [low, high] = range(&self.f_n);
        let middle = 0.5 * low + 0.5 * high;
        let (mut energy, mut path_mm) = (0.0, 0.0);
        for i in 1..=last {
            let dx = x[i] - x[i - 1];
            energy += (0.5 * (self.f_n[i] - middle) + 0.5 * (self.f_n[i - 1] - middle)) * dx;
            path_mm += dx.abs();
        }
        let [left, right] = range(x);
        if path_mm > COARSE * (right - left) * last as f64 {
            return None;
        }
        Some(Energy {
            supplied_j: 1e-3 * energy,
            path_mm,
            negative: energy < -ENERGY_SHARE * (high - low) * path_mm,
        })
    }

    /// Replaces spikes of x and F by the line between the samples before and after; their
    /// number. Differences of x that were computed from a spike are computed anew.
    pub fn without_spikes(&mut self) -> usize {
        let (in_x, in_f) = (spikes(&self.x_mm), spikes(&self.f_n));
        bridge(&self.t_s, &mut self.x_mm, &in_x);
        bridge(&self.t_s, &mut self.f_n, &in_f);
        let derived = |column| {
            let of = |w: &Warning| matches!(w, Warning::Derived { column: c, .. } if *c == column);
            self.warnings.iter().any(of)
        };
        let (v, a) = (derived("v_mm_s"), derived("a_m_s2"));
        if !in_x.is_empty() && v {
            let all = 0..self.t_s.len();
            self.v_mm_s = (all.map(|i| velocity(&self.t_s, &self.x_mm, i))).collect();
        }
        if !in_x.is_empty() && a {
            let all = 0..self.t_s.len();
            self.a_m_s2 = (all.map(|i| acceleration(&self.t_s, &self.x_mm, i))).collect();
        }
        in_x.len() + in_f.len()
    }
}

/// Replaces the values at `bad`, ascending, by the line between the nearest others.
fn bridge(t_s: &[f64], values: &mut [f64], bad: &[usize]) {
    let mut i = 0;
    while i < bad.len() {
        let first = bad[i];
        while i + 1 < bad.len() && bad[i + 1] == bad[i] + 1 {
            i += 1;
        }
        let last = bad[i];
        let before = first.checked_sub(1);
        let after = (last + 1 < values.len()).then_some(last + 1);
        for at in first..=last {
            values[at] = match (before, after) {
                (Some(b), Some(a)) => {
                    let share = (t_s[at] - t_s[b]) / (t_s[a] - t_s[b]);
                    values[b] + share * (values[a] - values[b])
                }
                (Some(only), None) | (None, Some(only)) => values[only],
                (None, None) => values[at],
            };
        }
        i += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A target with 1 N of friction and a spring, over three cycles.
    fn recording(sign: f64) -> Recording {
        let mut text = String::from("t_s,x_mm,f_n\n");
        for i in 0..3000 {
            let t = f64::from(i) * 1e-3;
            let (x, v) = ((6.3 * t).sin() * 10.0, (6.3 * t).cos());
            let force = sign * (0.4 * x + v.signum());
            text += &format!("{t},{x},{force}\n");
        }
        super::super::read("r", text.as_bytes()).unwrap()
    }

    #[test]
    fn a_flipped_force_takes_energy_out_of_the_target() {
        let right = recording(1.0).energy().unwrap();
        // 1 N over the path of three cycles of 40 mm, up to the last closed one
        assert!((right.supplied_j - 1e-3 * right.path_mm).abs() < 0.002);
        assert!(!right.negative);
        let flipped = recording(-1.0).energy().unwrap();
        assert!(flipped.negative);
        assert!((flipped.supplied_j + right.supplied_j).abs() < 1e-12);
    }

    /// Cycles of samples do not close exactly, and ten samples are no cycle.
    #[test]
    fn an_offset_of_the_force_does_no_work_and_few_samples_are_no_evidence() {
        let right = recording(1.0);
        let mut far = right.clone();
        far.f_n.iter_mut().for_each(|f| *f -= 1e8);
        let difference = far.energy().unwrap().supplied_j - right.energy().unwrap().supplied_j;
        assert!(difference.abs() < 1e-6, "{difference}");
        let few: Vec<usize> = (0..10).map(|i| 290 * i).collect();
        assert_eq!(recording(-1.0).select(&few).energy(), None);
    }

    #[test]
    fn one_impossible_sample_is_found_and_replaced() {
        let good = recording(1.0);
        assert_eq!(spikes(&good.f_n), [0_usize; 0]);
        assert_eq!(spikes(&good.x_mm), [0_usize; 0]);
        let mut bad = good.clone();
        bad.f_n[700] = 1e8;
        bad.f_n[1200] = -60.0;
        bad.x_mm[900] = 300.0;
        assert_eq!(spikes(&bad.f_n), [700, 1200]);
        let warnings = warnings(&bad.x_mm, &bad.f_n, &bad.t_s);
        assert_eq!(
            warnings[1].to_string(),
            "2 spikes in f_n, the largest 100000000 at 0.7000 s: --robust replaces them"
        );
        assert_eq!(bad.without_spikes(), 3);
        for i in [700, 1200] {
            assert!((bad.f_n[i] - good.f_n[i]).abs() < 0.05, "{i}");
        }
        assert!((bad.x_mm[900] - good.x_mm[900]).abs() < 0.01);
    }

    #[test]
    fn a_clipped_force_is_saturated() {
        let mut clipped = recording(1.0);
        assert_eq!(saturated(&clipped.f_n, &[]), None);
        clipped.f_n.iter_mut().for_each(|f| *f = f.clamp(-9.0, 3.0));
        let (count, force_n) = saturated(&clipped.f_n, &[]).unwrap();
        assert_eq!(force_n, 3.0);
        assert!(count > 400, "{count}");
        // a spike neither hides it nor makes a smooth peak look flat
        clipped.f_n[700] = 1e8;
        assert_eq!(saturated(&clipped.f_n, &[700]).unwrap().1, 3.0);
        let mut smooth = recording(1.0);
        smooth.f_n[700] = -1e9;
        assert_eq!(saturated(&smooth.f_n, &[700]), None);
    }
}
