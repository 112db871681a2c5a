//! How late the commanded force came, and of which table it was.

use super::moments::{Lag, Moments, best_lag};
use super::predicted::{accelerations, predicted};
use super::scale::Scale;
use super::{LONGEST_DELAY_S, Played, SEARCHED_S};
use crate::outcome::Sample;
use study_base::text::ModelId;
use study_wire::servo::{self, ServoSettings};

/// The lag of two forces is known from this correlation on.
const ALIKE: f64 = 0.5;

/// How much later the second of two forces comes; `pair` has both at a sample where they are
/// known. `None` if they hardly correlate.
pub(super) fn delay(
    samples: &[Sample],
    interval_s: f64,
    pair: impl Fn(usize) -> Option<[f64; 2]>,
) -> Option<Lag> {
    let first_s = samples.first()?.t_s;
    let place = |s: &Sample| ((s.t_s - first_s) / interval_s).round() as usize;
    // A clock that jumps must not ask for an array of any size.
    let most = 2 * (SEARCHED_S / interval_s) as usize;
    let size = place(samples.last()?).min(most) + 1;
    let (mut first, mut second) = (vec![None; size], vec![None; size]);
    for (i, sample) in samples.iter().enumerate() {
        let at = place(sample);
        if let Some([one, other]) = pair(i).filter(|_| at < size) {
            (first[at], second[at]) = (Some(one), Some(other));
        }
    }
    let lags = (LONGEST_DELAY_S / interval_s) as usize;
    best_lag(&first, &second, lags).filter(|lag| lag.correlation > ALIKE)
}

/// The table of the study that explains the commanded force best.
pub(super) struct Nearest<'a> {
    pub(super) model: &'a ModelId,
    /// Whether it is another one than was sent, and explains the force where that one
    /// does not.
    pub(super) explains: bool,
}

/// Compares all tables at the rate of the samples.
pub(super) fn nearest<'a>(
    played: &Played<'a>,
    samples: &[Sample],
    keep: &[bool],
    interval_s: f64,
    scale: Scale,
) -> Option<Nearest<'a>> {
    let settings = ServoSettings {
        servo_hz: 1.0 / interval_s,
        ..played.servo
    };
    let a_m_s2 = accelerations(samples, played.numbered);
    let score = |what: &servo::Rendering<'_>| {
        let fades = played.faded_from_s;
        let forces = predicted(what, settings, fades, samples, |i| a_m_s2[i]);
        let pairs = (samples.iter().zip(&forces).zip(keep)).filter(|(_, keep)| **keep);
        let moments = Moments::of(pairs.map(|((s, p), _)| (p.force_n, s.force_command_n)));
        let far = moments.residual()? + moments.bias()?.powi(2);
        Some((far, moments.vaf()))
    };
    let (own, _) = score(&played.what)?;
    let mut best = Nearest {
        model: played.model,
        explains: false,
    };
    let distinct = own > scale.force_n.powi(2);
    let mut least = own;
    for (model, what) in played.others {
        if let Some((far, vaf)) = score(what)
            && far < least
        {
            least = far;
            best = Nearest {
                model,
                explains: distinct && far < 0.25 * own && vaf.is_some_and(|vaf| vaf > 0.95),
            };
        }
    }
    Some(best)
}
