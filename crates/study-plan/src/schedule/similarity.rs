//! The practice trials of a part of similarity; its other trials are those of pairs.

use crate::protocol::{Seat, Similarity, Stimuli};
use study_base::rng::Stream;
use study_base::text::PartId;

/// Pairs of different realizations, drawn without replacement until all have come; which of two comes first is drawn, too.
pub(super) fn practiced(seed: u64, part: &PartId, own: &Similarity, seat: Seat) -> Vec<Stimuli> {
    let number = seat.number().to_string();
    let path = [
        "schedule",
        "part",
        part.as_str(),
        "practice",
        seat.stream(),
        &number,
    ];
    let mut stream = Stream::new(seed, &path);
    let mut trials = Vec::new();
    while trials.len() < own.practice as usize {
        let mut pairs = own.different.clone();
        if pairs.is_empty() {
            break;
        }
        stream.shuffle(&mut pairs);
        for [a, b] in pairs {
            let pair = match stream.below(2) {
                0 => [a, b],
                _ => [b, a],
            };
            trials.push(Stimuli::Pair { pair });
        }
    }
    trials.truncate(own.practice as usize);
    trials
}
