//! The virtual mechanism: identified by minimizing the simulation error of the force.
//!
//! Its parameters enter the force through its state, so the problem is nonlinear. It is
//! solved by Levenberg–Marquardt steps within bounds (`levenberg`), with exact
//! derivatives (`sensitivity`), from several starts (`start`) that are first fitted to
//! a part of the recordings, in parallel; the two best are then fitted to all of them.
//! The recorded and the predicted force pass the same zero-phase low-pass (`objective`).
//! Every parameter is bounded so that the mechanism is passive
//! ([`study_wire::mechanism`]).

mod decision;
mod estimator;
mod levenberg;
mod objective;
mod reach;
mod sensitivity;
mod start;
#[cfg(test)]
mod tests;

use study_base::sort::SmallSort as _;
use super::elements::start_of;
use super::method::Progress;
use super::samples::weight_of;
use super::signal::{LowPass, SignalError, sampling_interval_s};
use super::{Estimate, IdentifyError, Training, Warning};
use crate::model::coverage::Origin;
use crate::model::{Elements, Mechanism};
use crate::recording::Recording;
pub use decision::Decision;
use decision::Part;
pub use estimator::Mechanism as Options;
use levenberg::Fit;
use objective::Compared;
pub use objective::Filter;
use rayon::prelude::*;
use sensitivity::{STRIBECK, STRIBECK_MM_S};
use study_wire::elements;
use study_wire::mechanism::{MechanismView, SCALARS, State};
use study_wire::predict::Motion;

/// Corners that are tried, Hz.
pub const CORNERS_HZ: [f64; 9] = [10.0, 15.0, 20.0, 25.0, 30.0, 40.0, 50.0, 75.0, 100.0];
/// The corner with which starts are compared, and of a force that was not filtered, Hz.
const CORNER_HZ: f64 = 30.0;
/// Least rate of the steps in a prediction, Hz. A recording that is slower is
/// interpolated.
pub const PREDICTED_HZ: f64 = 8000.0;
/// The same while starts are compared.
const STARTED_HZ: f64 = 4000.0;
/// Share of a sampling interval in which nothing relaxes.
const AT_ONCE: f64 = 1e-9;
/// Of each recording as much is used while starts are compared that together they last so
/// long, s.
const STARTED_S: f64 = 20.0;
/// A standard error above this share of a parameter is no determination.
const UNSURE: f64 = 0.5;
/// Largest number of steps of the comparison and of the fit.
const ITERATIONS: [usize; 2] = [12, 40];
/// The same when a fit is repeated on a part of the recordings.
const REFITTED: usize = 8;
/// An rms error that is larger by this factor at most is as good, with fewer parameters.
const AS_GOOD: f64 = 1.002;

/// Options of the identification.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Settings {
    /// Distance of the nodes of D, mm.
    pub dx_mm: f64,
    /// The corner of the low-pass that the recorded force has passed, Hz, if it is known.
    /// Otherwise it is found: see [`Fitted::filter`].
    pub recorded_hz: Option<f64>,
}

/// A start and how far it came.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attempt {
    /// Backlash at the start, mm.
    pub gap_mm: f64,
    /// Mass at the start, kg.
    pub mass_kg: f64,
    /// rms error after the comparison, N.
    pub compared_n: f64,
    /// rms error of the low-passed force on all recordings, N; `None` if another start was
    /// better in the comparison.
    pub fitted_n: Option<f64>,
}

/// An identified mechanism.
#[derive(Debug, Clone, PartialEq)]
pub struct Fitted {
    /// Parameters of the mechanism.
    pub mechanism: Mechanism,
    /// Standard error of each scalar, in the order of
    /// [`Scalars::to_array`](study_wire::mechanism::Scalars::to_array); `None` at a bound or
    /// where the recordings do not determine it.
    pub standard_errors: [Option<f64>; SCALARS],
    /// The low-pass of the comparison. Where the recorded force has passed one already, the one
    /// of the headers, or that of [`CORNERS_HZ`] whose prediction has the least error.
    pub filter: Filter,
    /// How the low-pass was decided; `None` if it was given.
    pub decision: Option<Decision>,
    /// All starts.
    pub attempts: Vec<Attempt>,
    /// Steps of the fit that is reported.
    pub iterations: usize,
    /// Where the follower was on the recordings, mm: beyond, detents and friction keep the
    /// last value that the data support.
    pub reach_mm: [f64; 2],
}

/// How many values D and F_c have, and where.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Layout {
    detents: usize,
    frictions: usize,
}

/// The scalars: name, unit, and the motion that determines them.
pub const PARAMETERS: [(&str, &str, &str); SCALARS] = [
    ("handle mass", "kg", FASTER),
    ("follower mass", "kg", FASTER),
    ("contact stiffness", "N/mm", FASTER),
    ("contact damping", "N·s/mm", FASTER),
    ("backlash", "mm", REVERSALS),
    ("follower damping", "N·s/mm", FASTER),
    ("presliding length", "mm", REVERSALS),
    ("breakaway share", "", SLOWER),
    ("Stribeck speed", "mm/s", SLOWER),
    ("handle friction", "N", REVERSALS),
    ("its presliding length", "mm", REVERSALS),
    ("handle damping", "N·s/mm", FASTER),
    ("offset force", "N", REVERSALS),
];
const FASTER: &str = "record faster motion, such as a sweep to higher frequencies";
const SLOWER: &str = "record slow motion as well, with several speeds below 20 mm/s";
const REVERSALS: &str = "record more reversals, at different positions and with small strokes";

impl Fitted {
    /// What was found of each scalar.
    pub(super) fn terms(&self) -> Vec<Estimate> {
        let values = self.mechanism.scalars.to_array();
        (PARAMETERS.into_iter().zip(values).zip(self.standard_errors))
            .map(|(((name, unit, _), value), standard_error)| Estimate {
                name,
                unit,
                value,
                standard_error,
                origin: Origin::Training,
                upper_bound: None,
                identified: is_sure(value, standard_error),
            })
            .collect()
    }

    /// A warning for each scalar whose standard error is above half its value, or that is 0, except of a force, which may well be 0.
    pub(super) fn warnings(&self) -> Vec<Warning> {
        let values = self.mechanism.scalars.to_array();
        (PARAMETERS.into_iter().zip(values).zip(self.standard_errors))
            .filter(|(((name, ..), value), error)| {
                *name != "offset force" && !is_sure(*value, *error)
            })
            .map(
                |(((parameter, _, excitation), value), error)| Warning::NotDetermined {
                    parameter,
                    value,
                    error,
                    excitation,
                },
            )
            .collect()
    }
}

/// Whether a scalar is determined: at least two standard errors, as for every other term.
fn is_sure(value: f64, standard_error: Option<f64>) -> bool {
    standard_error.is_some_and(|error| error <= UNSURE * value.abs())
}

impl Layout {
    fn parameters(&self) -> usize {
        SCALARS + self.detents + self.frictions
    }
}

/// Identifies a mechanism. `progress` is called after each step, from any thread.
///
/// # Errors
/// [`IdentifyError`] if a recording is not evenly sampled, or as for a passive table.
pub fn identify(
    training: &Training<'_>,
    settings: Settings,
    progress: impl Fn(Progress) + Sync,
) -> Result<Fitted, IdentifyError> {
    let starts = start::starts(training, settings.dx_mm)?;
    let recordings = training.recordings();
    let total_s: f64 = recordings.iter().map(|r| r.duration_s()).sum();
    let compared = |filter, share: f64| -> Result<Vec<Compared<'_>>, SignalError> {
        recordings
            .iter()
            .map(|r| Compared::new(r, filter, share * r.duration_s() + 1e-9))
            .collect()
    };
    let known = settings.recorded_hz.map(Filter::Recorded);
    let share = (STARTED_S / total_s).min(1.0);
    let part = compared(known.unwrap_or(Filter::Recorded(CORNER_HZ)), share)?;
    let of = starts.len() * ITERATIONS[0] + 2 * ITERATIONS[1];
    let steps = std::sync::atomic::AtomicUsize::new(0);
    let step = || {
        let steps = 1 + steps.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
        progress(Progress { steps, of });
    };
    let top_mm_s = 2.0 * training.top_speed_mm_s;
    let fit = |from: &Mechanism, on: &[Compared<'_>], hz, iterations| {
        levenberg::fit(from, on, hz, iterations, top_mm_s, &step)
    };
    let begun: Vec<Option<Fit>> = starts
        .par_iter()
        .map(|from| fit(from, &part, STARTED_HZ, ITERATIONS[0]))
        .collect();
    let mut attempts: Vec<Attempt> = (starts.iter().zip(&begun))
        .map(|(from, fit)| Attempt {
            gap_mm: from.scalars.gap_mm,
            mass_kg: from.scalars.handle_kg + from.scalars.follower_kg,
            compared_n: fit.as_ref().map_or(f64::INFINITY, |fit| fit.rms_n),
            fitted_n: None,
        })
        .collect();
    let mut order: Vec<usize> = (0..starts.len()).collect();
    order.small_sort_by(|a, b| attempts[*a].compared_n.total_cmp(&attempts[*b].compared_n));
    let best = begun[order[0]].as_ref().ok_or(IdentifyError::NoMechanism)?;
    let (filter, decision) = match known {
        Some(known) => (known, None),
        None => {
            let part = Part {
                recordings,
                share,
                top_mm_s,
            };
            let decided = part.decide(&best.mechanism);
            let (filter, decision) = decided.ok_or(IdentifyError::NoMechanism)?;
            (filter, Some(decision))
        }
    };
    let whole = compared(filter, 2.0)?;
    // from where a start came to in the comparison, with these scalars set
    let continued = |which: &[usize], set: [bool; SCALARS]| -> Vec<(usize, Fit)> {
        (which.par_iter())
            .filter_map(|i| {
                let mut begun = begun[*i].as_ref()?.mechanism.clone();
                if set[STRIBECK] {
                    begun.scalars.stribeck = 0.0;
                }
                if set[STRIBECK_MM_S] {
                    begun.scalars.stribeck_mm_s = starts[*i].scalars.stribeck_mm_s;
                }
                let from = reach::held(&begun, &reach::of(&begun, recordings, None));
                let mut fit = levenberg::fit_with(
                    &from,
                    &set,
                    &whole,
                    PREDICTED_HZ,
                    ITERATIONS[1],
                    top_mm_s,
                    &step,
                )?;
                fit.mechanism = reach::bridged(fit.mechanism, &reach::of(&from, recordings, None));
                Some((*i, fit))
            })
            .collect()
    };
    let least = |fits: &[(usize, Fit)]| {
        (fits.iter())
            .min_by(|a, b| a.1.rms_n.total_cmp(&b.1.rms_n))
            .map(|(_, fit)| fit.clone())
    };
    let mut fitted = continued(&order[..2.min(order.len())], [false; SCALARS]);
    // what is not determined spoils the others: it is set, and every start is continued
    if let Some(best) = least(&fitted)
        && let Some(set) = best.hopeless()
    {
        let again = continued(&order, set);
        if least(&again).is_some_and(|fit| fit.rms_n <= AS_GOOD * best.rms_n) {
            fitted = again;
        }
    }
    for (i, fit) in &fitted {
        attempts[*i].fitted_n = Some(fit.rms_n);
    }
    let (_, best) = (fitted.into_iter())
        .min_by(|a, b| a.1.rms_n.total_cmp(&b.1.rms_n))
        .ok_or(IdentifyError::NoMechanism)?;
    Ok(Fitted {
        reach_mm: reach::of(&best.mechanism, recordings, None).range_mm,
        filter,
        decision,
        standard_errors: best.standard_errors,
        mechanism: Mechanism {
            recorded_hz: match filter {
                Filter::Recorded(hz) => Some(hz),
                Filter::Both(_) => None,
            },
            ..best.mechanism
        },
        attempts,
        iterations: best.iterations,
    })
}

/// A mechanism fitted to the samples whose weight is not 0, from where a fit ended, with the same
/// low-pass; `None` if the recordings do not suit it.
pub(super) fn refitted(fitted: &Fitted, training: &Training<'_>) -> Option<Mechanism> {
    let compared: Vec<Compared<'_>> = (training.recordings.iter().enumerate())
        .map(|(r, recording)| {
            let mut compared = Compared::new(recording, fitted.filter, f64::INFINITY).ok()?;
            compared.keep(|i| weight_of(training.weights.as_deref(), r, i) > 0.0);
            Some(compared)
        })
        .collect::<Option<_>>()?;
    let top_mm_s = 2.0 * training.top_speed_mm_s;
    let reach = |of| reach::of(of, &training.recordings, training.weights.as_deref());
    let from = reach::held(&fitted.mechanism, &reach(&fitted.mechanism));
    let fit = levenberg::fit(&from, &compared, STARTED_HZ, REFITTED, top_mm_s, &|| ())?;
    Some(reach::bridged(fit.mechanism, &reach(&from)))
}

/// The force of each sample of a recording, N, after the low-pass that the recorded force
/// had passed. A recording that is too slow or too uneven for it gets none.
pub(super) fn low_passed(mechanism: &Mechanism, recording: &Recording) -> Vec<f64> {
    let force_n = predict(&mechanism.view(), recording, recording.len(), PREDICTED_HZ);
    let low_pass = mechanism.recorded_hz.and_then(|hz| {
        let interval_s = sampling_interval_s(recording).ok()?;
        LowPass::new(hz, 1.0 / interval_s).ok()
    });
    match low_pass {
        Some(low_pass) => low_pass.zero_phase(&force_n),
        None => force_n,
    }
}

/// The motion at a share of the way from sample `i − 1` to sample `i`: the cubic through both
/// positions with the recorded speeds. Sample 0 is preceded by itself.
fn motion_between(recording: &Recording, i: usize, share: f64) -> Motion {
    let r = recording;
    let before = i.saturating_sub(1);
    let v = r.v_mm_s[before] + share * (r.v_mm_s[i] - r.v_mm_s[before]);
    let (t, h) = (share, r.t_s[i] - r.t_s[before]);
    let (t2, t3) = (t * t, t * t * t);
    let x_mm = (2.0 * t3 - 3.0 * t2 + 1.0) * r.x_mm[before]
        + (t3 - 2.0 * t2 + t) * h * r.v_mm_s[before]
        + (3.0 * t2 - 2.0 * t3) * r.x_mm[i]
        + (t3 - t2) * h * r.v_mm_s[i];
    Motion {
        x_mm,
        v_mm_s: v,
        a_m_s2: r.a_m_s2[i],
    }
}

/// The force of each of the first `samples` of a recording, N.
pub fn predict(
    mechanism: &MechanismView<'_>,
    recording: &Recording,
    samples: usize,
    least_hz: f64,
) -> Vec<f64> {
    follow(mechanism, recording, samples, least_hz, |_| ())
}

/// The force of each sample of a recording by elements, N, in steps of at least
/// [`PREDICTED_HZ`]. The state in which the springs enter the recording is that which the force of
/// some of its samples tells ([`start_of`]).
pub(super) fn predict_elements(
    elements: &Elements,
    recording: &Recording,
    tells: impl Fn(usize) -> bool,
) -> Vec<f64> {
    let view = elements.view();
    let start = start_of(elements, recording, tells);
    let mut state = elements::State::deflected(recording.x_mm[0], start);
    (0..recording.len())
        .map(|i| {
            let mut force_n = 0.0;
            for (motion, span_s) in substeps(recording, i, PREDICTED_HZ) {
                // the state is that of the first sample, so that nothing relaxes before it
                let span_s = if i == 0 { AT_ONCE * span_s } else { span_s };
                force_n = state.step(&view, motion, span_s);
            }
            force_n + view.mass_kg * recording.a_m_s2[i]
        })
        .collect()
}

/// The motion and the duration of each step up to a sample.
fn substeps(recording: &Recording, i: usize, least_hz: f64) -> impl Iterator<Item = (Motion, f64)> {
    let span_s = match i {
        0 => recording.t_s[1] - recording.t_s[0],
        _ => recording.t_s[i] - recording.t_s[i - 1],
    };
    let substeps = ((span_s * least_hz * (1.0 - 1e-9)).ceil()).max(1.0);
    (1..=substeps as usize).map(move |j| {
        let motion = motion_between(recording, i, j as f64 / substeps);
        (motion, span_s / substeps)
    })
}

/// The same; `visit` sees the state at each of the samples.
fn follow(
    mechanism: &MechanismView<'_>,
    recording: &Recording,
    samples: usize,
    least_hz: f64,
    mut visit: impl FnMut(&State),
) -> Vec<f64> {
    let mut state = State::settled(mechanism, motion_between(recording, 0, 0.0));
    (0..samples)
        .map(|i| {
            let mut force_n = 0.0;
            for (motion, span_s) in substeps(recording, i, least_hz) {
                force_n = state.step(mechanism, motion, span_s);
            }
            visit(&state);
            force_n + mechanism.scalars.handle_kg * recording.a_m_s2[i]
        })
        .collect()
}
