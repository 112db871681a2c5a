//! When the media of a session came, and how evenly.

use super::{Attempt, History};
use crate::outcome::media::Onset;
use study_plan::protocol::Medium;

/// A medium that came, in the order of the journal.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Came {
    /// Trial and attempt.
    of: (u32, u32),
    medium: Medium,
    offset_ms: f64,
}

/// What a row has of the media of an attempt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct InStep {
    /// The onset that is farthest from the start.
    pub(super) onset: Onset,
    /// Standard deviation of the offsets of the session up to the attempt, ms.
    pub(super) jitter_ms: Option<f64>,
}

impl History {
    /// A medium came in an interval of an attempt.
    pub(super) fn came(&mut self, of: (u32, u32), interval: u32, (medium, onset): (Medium, Onset)) {
        if let Some(attempt) = self.attempt_mut(of.0, of.1) {
            attempt.came(interval, medium, onset);
        }
        self.came.push(Came {
            of,
            medium,
            offset_ms: onset.offset_ms,
        });
    }

    /// The media of an attempt; `None` if the page confirmed none.
    pub(super) fn in_step(&self, trial: u32, attempt: &Attempt) -> Option<InStep> {
        let onsets = attempt.presentations.iter().flat_map(|p| p.media.iter());
        let farther = |a: &Onset, b: &Onset| a.offset_ms.abs().total_cmp(&b.offset_ms.abs());
        let onset = onsets.max_by(farther)?;
        let of = (trial, attempt.number);
        let last = self.came.iter().rposition(|came| came.of == of);
        let until = &self.came[..last.map_or(0, |last| last + 1)];
        Some(InStep {
            onset,
            jitter_ms: jitter_ms(until),
        })
    }
}

/// Standard deviation within pictures, within videos and within sounds, pooled; `None` if there are not two of any.
fn jitter_ms(all: &[Came]) -> Option<f64> {
    let (mut squares, mut degrees) = (0.0, 0_usize);
    for medium in Medium::ALL {
        let own = || {
            (all.iter())
                .filter(|came| came.medium == medium)
                .map(|came| came.offset_ms)
        };
        let n = own().count();
        if n > 1 {
            let mean = own().sum::<f64>() / n as f64;
            squares += own().map(|x| (x - mean).powi(2)).sum::<f64>();
            degrees += n - 1;
        }
    }
    (degrees > 0).then(|| (squares / degrees as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Python: `statistics.stdev` of 10, 20, 30 is 10, of 40, 44 it is 2 √2; pooled √((200 + 8) / 3).
    #[test]
    fn the_jitter_is_pooled_within_the_media() {
        let came = |medium, offset_ms| Came {
            of: (1, 1),
            medium,
            offset_ms,
        };
        let pictures = [10.0, 20.0, 30.0].map(|ms| came(Medium::Picture, ms));
        let sounds = [40.0, 44.0].map(|ms| came(Medium::Sound, ms));
        assert_eq!(jitter_ms(&pictures), Some(10.0));
        assert_eq!(jitter_ms(&pictures[..1]), None);
        let one_each = [pictures[0].clone(), sounds[0].clone()];
        assert_eq!(
            jitter_ms(&one_each),
            None,
            "a difference of media is no jitter"
        );
        let all = [&pictures[..], &sounds[..]].concat();
        let pooled = jitter_ms(&all).unwrap();
        assert!((pooled - 8.326_663_997_864_53).abs() < 1e-12, "{pooled}");
    }
}
