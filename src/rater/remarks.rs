//! Comments of simulated participants: a fixed list.

use super::Impression;

/// A comment about the most prominent property; `draw` in [0, 1) selects the wording.
pub(super) fn about(felt: &Impression, draw: f64) -> &'static str {
    let remarks = [
        (
            felt.activeness,
            &[
                "it felt active in the middle",
                "some vibration",
                "it pushed by itself",
            ],
        ),
        (
            (1.0 - felt.crispness) * 2.0,
            &[
                "detents not crisp",
                "rather soft clicks",
                "a bit blurred between positions",
            ],
        ),
        (
            (felt.detent - 1.0) * 3.0,
            &[
                "detent force too high",
                "stiffer than the real one",
                "takes too much force",
            ],
        ),
        (
            (1.0 - felt.detent) * 3.0,
            &[
                "detent force too low",
                "weaker than the real one",
                "too easy to move",
            ],
        ),
        (
            felt.end_error_n / 4.0,
            &[
                "the end stop felt different",
                "odd near the end",
                "the last detent was off",
            ],
        ),
        (
            0.6 - felt.force_error_n / 3.0,
            &["quite close", "felt like the real one", "crisp, good force"],
        ),
    ];
    let most_prominent = remarks
        .iter()
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map_or(&GENERAL, |(_, wordings)| *wordings);
    pick(most_prominent, draw)
}

/// A general comment.
pub(super) fn general(draw: f64) -> &'static str {
    pick(&GENERAL, draw)
}

const GENERAL: [&str; 3] = [
    "nothing to add",
    "I compared it with the real one",
    "I moved it slowly, then quickly",
];

fn pick(wordings: &[&'static str; 3], draw: f64) -> &'static str {
    wordings[((draw * 3.0) as usize).min(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_comment_is_about_the_most_prominent_property() {
        let good = Impression {
            force_error_n: 0.2,
            end_error_n: 0.2,
            activeness: 0.0,
            detent: 1.0,
            crispness: 1.0,
        };
        assert_eq!(about(&good, 0.0), "quite close");
        let active = Impression {
            activeness: 1.2,
            ..good
        };
        assert_eq!(about(&active, 0.5), "some vibration");
        let weak = Impression {
            detent: 0.5,
            ..good
        };
        assert_eq!(about(&weak, 0.999), "too easy to move");
    }
}
