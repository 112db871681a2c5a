//! Ladders that are coarser than the steps of a staircase.

use super::Spans;
use crate::procedure::{Ladder, Rule, Scale, Staircase};
use crate::protocol::Protocol;
use study_base::diagnostic::Fault;

/// Staircases most of whose steps would present the same level again: the median distance of two
/// levels is more than twice the least step. In a study that has started they are warnings, since
/// it goes on.
pub fn coarse(protocol: &Protocol, spans: &Spans, started: bool) -> Vec<Fault> {
    let found = protocol.tracks.iter().enumerate().filter_map(|(i, track)| {
        let Rule::Staircase(rule) = &track.rule else {
            return None;
        };
        let ladder = protocol.ladder(track);
        let (step, gap) = finer_than(rule, &ladder)?;
        let what = format!(
            "the steps of the track `{}` are finer than its levels: the least step is {}, and levels are {} apart",
            track.id,
            shown(step, rule.scale),
            shown(gap, rule.scale)
        );
        let fault = if started {
            Fault::warning(what)
        } else {
            Fault::error(what)
        };
        let (low, high) = (lowest(&ladder, rule.scale)?, ladder.last());
        let levels = (distance(low, high, rule.scale) / step).ceil() as usize + 1;
        let place = format!("tracks[{i}].procedure");
        let hint = format!(
            "take steps of at least {}, or a family with {levels} levels or more",
            shown(gap, rule.scale)
        );
        Some(fault.at(spans.get(&place).cloned()).hint(hint))
    });
    found.collect()
}

/// The least step and the median distance of two levels, where the step is less than half of it.
fn finer_than(rule: &Staircase, ladder: &Ladder) -> Option<(f64, f64)> {
    let steps = rule.steps.iter().copied();
    let step = steps.fold(f64::INFINITY, f64::min) * rule.step_up_factor.min(1.0);
    let first = lowest(ladder, rule.scale)?;
    let levels = ladder.levels().iter().copied().filter(|l| *l >= first);
    let levels: Vec<f64> = levels.collect();
    let mut gaps: Vec<f64> = (levels.windows(2))
        .map(|two| distance(two[0], two[1], rule.scale))
        .collect();
    gaps.sort_by(f64::total_cmp);
    let median = *gaps.get(gaps.len() / 2)?;
    (step < 0.5 * median * (1.0 - 1e-9)).then_some((step, median))
}

/// The lowest level that has a place on the scale.
fn lowest(ladder: &Ladder, scale: Scale) -> Option<f64> {
    let has_place = |level: &f64| scale == Scale::Lin || *level > 0.0;
    ladder.levels().iter().copied().find(has_place)
}

/// The step from one level to another.
fn distance(from: f64, to: f64, scale: Scale) -> f64 {
    match scale {
        Scale::Lin => to - from,
        Scale::Log => libm::log10(to / from),
        Scale::Db => 20.0 * libm::log10(to / from),
    }
}

/// A step with three digits.
fn shown(step: f64, scale: Scale) -> String {
    let rounded: f64 = format!("{step:.2e}").parse().unwrap_or(step);
    match scale {
        Scale::Lin => rounded.to_string(),
        Scale::Log => format!("{rounded} (a factor of {:.3})", libm::pow(10.0, step)),
        Scale::Db => format!("{rounded} dB"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::procedure::Stop;

    fn rule(scale: Scale, steps: &[f64]) -> Staircase {
        Staircase {
            up: 1,
            down: 3,
            start: 0.5,
            steps: steps.to_vec(),
            scale,
            step_up_factor: 1.0,
            min_level: None,
            max_level: None,
            initial_one_up_one_down: true,
            stop: Stop {
                reversals: 8,
                min_trials: 0,
                max_trials: 80,
            },
            estimate_last: 6,
        }
    }

    #[test]
    fn a_step_that_presents_the_same_level_again_is_too_fine() {
        let of = |scale, steps: &[f64], levels: &[f64]| {
            finer_than(&rule(scale, steps), &Ladder::new(levels.to_vec()).unwrap())
        };
        let near = |found: Option<(f64, f64)>, step: f64, gap: f64| {
            let (s, g) = found.unwrap();
            assert!(
                (s - step).abs() < 1e-12 && (g - gap).abs() < 1e-12,
                "{s} {g}"
            );
        };
        near(of(Scale::Lin, &[0.1, 0.03], &[0.1, 0.3, 0.5]), 0.03, 0.2);
        // A step of half the distance moves every second time.
        assert_eq!(of(Scale::Lin, &[0.1], &[0.1, 0.3, 0.5]), None);
        // 10^0.05 where levels double.
        near(
            of(Scale::Log, &[0.2, 0.05], &[0.1, 0.2, 0.4, 0.8]),
            0.05,
            libm::log10(2.0),
        );
        near(
            of(Scale::Db, &[2.0], &[0.1, 0.2, 0.4]),
            2.0,
            20.0 * libm::log10(2.0),
        );
        // 0 has no place on a scale of ratios.
        assert_eq!(of(Scale::Log, &[0.2], &[0.0, 0.1, 0.15, 0.2]), None);
        assert_eq!(of(Scale::Lin, &[0.01], &[0.3]), None);
    }
}
