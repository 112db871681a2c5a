//! What is doubtful about the measured values themselves: spikes, saturation, and a force
//! of the wrong sign.

use super::differences::{acceleration, velocity};
use super::spikes::{jumps, spikes};
use super::{Recording, Warning, range, saturation};

/// A position that moves by more than this share of its range from sample to sample says
/// nothing of cycles.
const COARSE: f64 = 0.2;
/// A cycle whose path is less than this share of the range of the position is jitter of the sensor.
const SHORT: f64 = 0.5;
/// Another cycle is far longer if this share of its path is more than the first one's.
const FAR: f64 = 0.5;
/// Through so many equal parts of the range of the position, less one, cycles are looked for.
const LEVELS: u32 = 10;
/// Less energy per path than this share of the range of the force may be noise.
const ENERGY_SHARE: f64 = 0.005;

/// The share of the acceleration that neither a spring nor a damping explains, from which on a mass can be told.
const LEAST_OWN: f64 = 0.01;

/// Warnings about spikes, snaps and saturation.
pub(super) fn warnings(x_mm: &[f64], f_n: &[f64], t_s: &[f64]) -> Vec<Warning> {
    let mut warnings = Vec::new();
    let jumps = jumps(x_mm, f_n);
    for (column, values, found) in [("x_mm", x_mm, &spikes(x_mm)), ("f_n", f_n, &jumps.spikes)] {
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
    if let Some((count, first, why)) = jumps.snaps {
        warnings.push(Warning::Snap {
            count,
            at_s: t_s[first],
            at_mm: x_mm[first],
            why,
        });
    }
    if let Some((count, force_n)) = saturation::exact(f_n, &jumps.spikes) {
        warnings.push(Warning::Saturated { count, force_n });
    } else if let Some((count, runs, force_n)) = saturation::noisy(f_n) {
        warnings.push(Warning::Plateau {
            count,
            runs,
            force_n,
        });
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

/// A part of a recording whose ends are at one position.
#[derive(Debug, Clone, Copy)]
struct Cycle {
    first: usize,
    last: usize,
    path_mm: f64,
    /// Whether both ends have the same direction.
    directed: bool,
}

impl Recording {
    /// The energy over a cycle from a position to the last sample at the same position and in the same direction, or, if
    /// the probe only went there and back, at the same position; `None` if there is none that is long enough, or too few
    /// samples in it. The position is that of the first sample, or one that far longer cycles pass: a recording can begin
    /// where no stroke comes back to. Around a cycle a constant
    /// force does no work; its middle is left out, because no cycle of samples closes exactly. What a
    /// mass took up because the speed is another one is no work of the target.
    pub fn energy(&self) -> Option<Energy> {
        let x = &self.x_mm;
        let [left, right] = range(x);
        let cycle = self.cycle()?;
        if cycle.path_mm < SHORT * (right - left) {
            return None;
        }
        let [low, high] = range(&self.f_n);
        let middle = 0.5 * low + 0.5 * high;
        let mut energy = 0.0;
        for i in cycle.first + 1..=cycle.last {
            let mean = 0.5 * (self.f_n[i] - middle) + 0.5 * (self.f_n[i - 1] - middle);
            energy += mean * (x[i] - x[i - 1]);
        }
        let path_mm = cycle.path_mm;
        if path_mm > COARSE * (right - left) * (cycle.last - cycle.first) as f64 {
            return None;
        }
        let supplied = energy - self.kinetic_n_mm(cycle.first, cycle.last);
        Some(Energy {
            supplied_j: 1e-3 * energy,
            path_mm,
            negative: supplied < -ENERGY_SHARE * (high - low) * path_mm,
        })
    }

    /// The cycle that begins with the first sample, unless one through another position is far longer. Cycles in one
    /// direction come before there and back.
    fn cycle(&self) -> Option<Cycle> {
        let [left, right] = range(&self.x_mm);
        let levels = (1..LEVELS).map(|k| left + (right - left) * f64::from(k) / f64::from(LEVELS));
        let others: Vec<Cycle> = levels.flat_map(|at| self.cycles_at(at)).collect();
        let longest = |directed: bool| {
            let some = others.iter().filter(|cycle| cycle.directed || !directed);
            some.max_by(|a, b| a.path_mm.total_cmp(&b.path_mm)).copied()
        };
        let any = longest(false);
        let far = |than: &Cycle| any.is_some_and(|any| than.path_mm < FAR * any.path_mm);
        let [own, other] = [self.first_cycle(), longest(true)];
        let fine = |cycle: Option<Cycle>| cycle.filter(|cycle| !far(cycle));
        fine(own).or_else(|| fine(other)).or(any).or(own)
    }

    /// From the first sample to the last one at the same position, in the same direction if there is one.
    fn first_cycle(&self) -> Option<Cycle> {
        let x = &self.x_mm;
        let start = x[0];
        let crossing = |i: &usize| (x[i - 1] - start) * (x[*i] - start) <= 0.0 && x[*i] != x[i - 1];
        let first = (1..x.len()).find(|i| x[*i] != start)?;
        let upwards = x[first] > start;
        let crossings = || (first + 1..x.len()).rev().filter(crossing);
        let same = crossings().find(|i| (x[*i] > x[i - 1]) == upwards);
        let last = same.or_else(|| crossings().next())?;
        Some(self.cycle_of(0, last, same.is_some()))
    }

    /// The longest cycles through a position: upwards, downwards, and there and back.
    fn cycles_at(&self, at_mm: f64) -> Vec<Cycle> {
        let x = &self.x_mm;
        // the first and the last crossing in each direction
        let mut ends: [Option<(usize, usize)>; 2] = [None; 2];
        for i in 1..x.len() {
            let upwards = x[i - 1] < at_mm && x[i] >= at_mm;
            if upwards || (x[i - 1] > at_mm && x[i] <= at_mm) {
                let end = &mut ends[usize::from(upwards)];
                *end = Some((end.map_or(i, |(first, _)| first), i));
            }
        }
        let mut cycles: Vec<Cycle> = (ends.iter().flatten())
            .filter(|(first, last)| first < last)
            .map(|&(first, last)| self.cycle_of(first, last, true))
            .collect();
        if let [Some(down), Some(up)] = ends {
            let (first, last) = (down.0.min(up.0), down.1.max(up.1));
            cycles.push(self.cycle_of(first, last, false));
        }
        cycles
    }

    fn cycle_of(&self, first: usize, last: usize, directed: bool) -> Cycle {
        let steps = self.x_mm[first..=last].windows(2);
        Cycle {
            first,
            last,
            path_mm: steps.map(|pair| (pair[1] - pair[0]).abs()).sum(),
            directed,
        }
    }

    /// The kinetic energy that a mass has more at one sample than at another, N·mm, with the
    /// mass that least squares find beside a constant, a spring and a damping.
    fn kinetic_n_mm(&self, from: usize, at: usize) -> f64 {
        let others = [&self.x_mm, &self.v_mm_s].map(|column| centered(column));
        let mut own = centered(&self.a_m_s2);
        let whole = dot(&own, &own);
        let [mut x, v] = others;
        remove(&mut x, &v);
        for other in [&v, &x] {
            remove(&mut own, other);
        }
        let left = dot(&own, &own);
        if left <= LEAST_OWN * whole {
            return 0.0;
        }
        let mass_kg = (dot(&own, &self.f_n) / left).max(0.0);
        let square = |i: usize| self.v_mm_s[i].powi(2);
        0.5e-3 * mass_kg * (square(at) - square(from))
    }

    /// Whether its energy is negative because of spikes: without them it is not.
    pub fn spikes_make_it_active(&self) -> bool {
        let negative = |recording: &Self| recording.energy().is_some_and(|e| e.negative);
        let mut without = self.clone();
        negative(self) && without.without_spikes() > 0 && !negative(&without)
    }

    /// Replaces spikes of x and F by the line between the samples before and after; their
    /// number. Snaps of the force stay as they are. Differences of x that were computed from a spike are computed anew.
    pub fn without_spikes(&mut self) -> usize {
        let (in_x, in_f) = (spikes(&self.x_mm), jumps(&self.x_mm, &self.f_n).spikes);
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

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Values less their mean.
fn centered(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    values.iter().map(|value| value - mean).collect()
}

/// Takes out of values what is in proportion to others.
fn remove(values: &mut [f64], other: &[f64]) {
    let square = dot(other, other);
    if square > 0.0 {
        let share = dot(values, other) / square;
        (values.iter_mut().zip(other)).for_each(|(value, other)| *value -= share * other);
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

    /// A recording that begins at rest where no stroke comes back to, with one step of the encoder: that is no cycle.
    #[test]
    fn the_beginning_is_not_taken_for_the_cycle() {
        for sign in [1.0, -1.0] {
            let strokes = recording(sign);
            let mut text = String::from("t_s,x_mm,f_n\n");
            let mut add = |i: usize, x: f64, f: f64| {
                text += &format!("{},{x},{f}\n", 1e-3 * i as f64);
            };
            for i in 0..1000 {
                // The force at rest lies on the other side of what one step would give.
                let step = if i == 500 { 0.05 } else { 0.0 };
                add(i, -14.0 + step, sign * (-5.6 - 30.0 * step));
            }
            // to the first sample of the strokes, which are between −10 and 10 mm
            for i in 0..200 {
                let x = -14.0 + 0.07 * i as f64;
                add(1000 + i, x, sign * (0.4 * x + 1.0));
            }
            for (i, (x, f)) in strokes.x_mm.iter().zip(&strokes.f_n).enumerate() {
                add(1200 + i, *x, *f);
            }
            let whole = super::super::read("r", text.as_bytes()).unwrap();
            let energy = whole.energy().unwrap();
            assert_eq!(energy.negative, sign < 0.0, "{energy:?}");
            assert!(energy.path_mm > 60.0, "{energy:?}");
        }
        // Rest alone, with jitter, closes nothing.
        let mut text = String::from("t_s,x_mm,f_n\n");
        for i in 0..2000 {
            let x = f64::from(i) * 0.01 + if i % 7 == 0 { 0.015 } else { 0.0 };
            text += &format!("{},{x},{}\n", 1e-3 * f64::from(i), 0.2 * x);
        }
        let pressed = super::super::read("r", text.as_bytes()).unwrap();
        assert_eq!(pressed.energy(), None);
    }

    /// A press and a release close no cycle in the same direction.
    #[test]
    fn a_single_loop_that_was_turned_around_supplies_energy() {
        let once = |sign: f64| {
            let half: Vec<usize> = (0..520).collect();
            let mut loop_ = recording(sign).select(&half);
            loop_.a_m_s2.iter_mut().for_each(|a| *a = 0.0);
            loop_.energy().unwrap()
        };
        assert!(once(1.0).supplied_j > 0.0 && !once(1.0).negative);
        assert!(once(-1.0).negative);
    }

    /// A mass that is faster at the end than at the beginning has taken up energy, or given it back.
    #[test]
    fn a_mass_alone_supplies_no_energy() {
        let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
        for i in 0..3100 {
            let t = f64::from(i) * 1e-3;
            let (w, u) = (6.3, 14.1);
            let x = 10.0 * (w * t).sin() + 4.0 * (u * t).sin();
            let v = 10.0 * w * (w * t).cos() + 4.0 * u * (u * t).cos();
            let a = -1e-3 * (10.0 * w * w * (w * t).sin() + 4.0 * u * u * (u * t).sin());
            let force = 0.8 * a;
            text += &format!("{t},{x},{v},{a},{force}\n");
        }
        let recording = super::super::read("r", text.as_bytes()).unwrap();
        let energy = recording.energy().unwrap();
        assert!(energy.supplied_j < -1e-4, "{energy:?}");
        assert!(!energy.negative, "{energy:?}");
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
}
