//! The simulated participant.
//!
//! A [`Rater`] answers the questions of a study, so that runner, files and analysis can
//! be rehearsed before people take part. It judges a realization by its [`Impression`]:
//! the deviation of the force from the target's and the activeness of the table, modified
//! by the rater's bias, gain, noise and lapses.
//!
//! **The effect is built in.** A rehearsal shows that the analysis finds the effect that
//! was built in. It is no evidence about people or for the paper's claim. With
//! [`Effect::None`] nothing depends on the realization.
//!
//! `docs/simulation.md` gives formulas and constants. Everything is determined by the
//! seed, the rater's number and the order of the calls. The number of random draws of an
//! answer never depends on the realization.

mod adjusting;
mod comparison;
mod impression;
mod remarks;

pub use adjusting::Aim;
pub use comparison::Percepts;
pub use impression::{Impression, Reference};

use adjusting::Adjusting;
use comparison::Comparing;

use study_base::rng::Stream;
use study_plan::protocol::kinds::Draws;
use study_plan::protocol::{Answer, Question, Scale};

/// Whether ratings depend on the realization.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// With the effect described in `docs/simulation.md`.
    BuiltIn,
    /// Ratings do not depend on the realization.
    None,
}

/// A simulated participant.
#[derive(Debug)]
pub struct Rater {
    stream: Stream,
    effect: Effect,
    bias: f64,
    gain: f64,
    noise: f64,
    lapse_rate: f64,
    /// Probability of a comment.
    comment_rate: f64,
    comparing: Comparing,
    adjusting: Adjusting,
}

/// Midpoint of the scale of opinions, which goes from 1 to 7.
const MIDPOINT: f64 = 4.0;

impl Rater {
    /// Rater number `number` in the study with this seed.
    pub fn new(seed: u64, number: u32, effect: Effect) -> Self {
        let mut stream = Stream::new(seed, &["rater", &number.to_string()]);
        Self {
            bias: 0.4 * stream.normal(),
            gain: libm::exp(0.2 * stream.normal()),
            noise: 0.75 * libm::exp(0.15 * stream.normal()),
            lapse_rate: 0.04 * stream.unit(),
            comment_rate: 0.1 + 0.4 * stream.unit(),
            stream,
            effect,
            comparing: Comparing::new(seed, number),
            adjusting: Adjusting::new(seed, number),
        }
    }

    /// Duration of an exploration of the reference, s.
    pub fn reference_s(&mut self) -> f64 {
        self.duration_s(4.0, 0.3, [2.0, 15.0])
    }

    /// Duration of an exploration of a realization, s, mostly 6 to 15.
    pub fn exploration_s(&mut self) -> f64 {
        self.duration_s(9.5, 0.25, [5.0, 20.0])
    }

    /// Time to answer the questions of a trial, s.
    pub fn response_s(&mut self) -> f64 {
        self.duration_s(4.0, 0.4, [1.0, 30.0])
    }

    /// A log-normal duration with the given median and logarithmic standard deviation,
    /// limited to `range_s`.
    fn duration_s(&mut self, median_s: f64, spread: f64, range_s: [f64; 2]) -> f64 {
        let [min, max] = range_s;
        (median_s * libm::exp(spread * self.stream.normal())).clamp(min, max)
    }

    /// Answers a question so that [`Question::accepts`] the answer. For the questions of a
    /// trial `felt` is the impression of the realization.
    pub fn answer(&mut self, question: &Question, felt: Option<&Impression>) -> Answer {
        let felt = felt.filter(|_| self.effect == Effect::BuiltIn);
        question.kind.simulate(&mut Answering {
            rater: self,
            question,
            felt,
        })
    }

    /// Position of the answer on a scale, from 0 to 1.
    fn position(&mut self, question: &Question, felt: Option<&Impression>) -> f64 {
        let noise = self.noise * self.stream.normal();
        let lapses = self.stream.unit() < self.lapse_rate;
        let anywhere = self.stream.unit();
        if lapses {
            return anywhere;
        }
        let opinion = felt.map_or(MIDPOINT, |felt| felt.opinion(question.id.as_str()));
        let judged = MIDPOINT + self.gain * (opinion - MIDPOINT) + self.bias + noise;
        ((judged - 1.0) / 6.0).clamp(0.0, 1.0)
    }

    /// The answer to a choice of which the share of one option is analyzed: `counted` if the
    /// realization is judged above the middle of the scale, otherwise one of the others.
    pub fn answer_counted(
        &mut self,
        question: &Question,
        counted: &str,
        felt: Option<&Impression>,
    ) -> Answer {
        let felt = felt.filter(|_| self.effect == Effect::BuiltIn);
        let above = self.position(question, felt) > 0.5;
        let others: Vec<&String> = match question.kind.scale() {
            Scale::Names { options, .. } => options.iter().filter(|o| *o != counted).collect(),
            _ => Vec::new(),
        };
        let other = others.get(self.pick(others.len()));
        let chosen = other.filter(|_| !above).map_or(counted, |o| o.as_str());
        Answer::Choice(vec![chosen.to_owned()])
    }

    fn pick(&mut self, count: usize) -> usize {
        // The number is drawn also for an empty list, to keep the stream aligned.
        let drawn = self.stream.below(count.max(1) as u64);
        usize::try_from(drawn).expect("below a length")
    }
}

/// A rater at a question.
struct Answering<'a> {
    rater: &'a mut Rater,
    question: &'a Question,
    felt: Option<&'a Impression>,
}

impl Draws for Answering<'_> {
    fn position(&mut self) -> f64 {
        self.rater.position(self.question, self.felt)
    }

    fn unit(&mut self) -> f64 {
        self.rater.stream.unit()
    }

    fn pick(&mut self, count: usize) -> usize {
        self.rater.pick(count)
    }

    fn comment(&mut self) -> String {
        let silent = self.rater.stream.unit() >= self.rater.comment_rate;
        let draw = self.rater.stream.unit();
        if silent && !self.question.required {
            return String::new();
        }
        let text =
            (self.felt).map_or_else(|| remarks::general(draw), |felt| remarks::about(felt, draw));
        text.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;
    use study_base::text::QuestionId;
    use study_plan::protocol::QuestionKind;
    use study_plan::protocol::kinds::{self, KINDS};

    fn question(id: &str, required: bool, kind: QuestionKind) -> Question {
        Question {
            id: QuestionId::new(id).unwrap(),
            prompt: "?".to_owned(),
            kind,
            required,
        }
    }

    fn realism() -> Question {
        let labels = BTreeMap::new();
        question(
            "realism",
            true,
            QuestionKind::Rating(kinds::Rating {
                from: 1,
                to: 7,
                labels,
            }),
        )
    }

    fn felt(force_error_n: f64) -> Impression {
        Impression {
            force_error_n,
            end_error_n: force_error_n,
            activeness: 0.0,
            detent: 1.0,
            crispness: 1.0,
        }
    }

    /// Mean and standard deviation of ratings of 200 raters, 5 each.
    fn ratings(effect: Effect, felt: &Impression) -> (f64, f64) {
        let mut all = Vec::new();
        for number in 1..=200 {
            let mut rater = Rater::new(11, number, effect);
            for _ in 0..5 {
                all.push(rater.answer(&realism(), Some(felt)).number().unwrap());
            }
        }
        let n = all.len() as f64;
        let mean = all.iter().sum::<f64>() / n;
        let squares: f64 = all.iter().map(|r| (r - mean).powi(2)).sum();
        (mean, (squares / (n - 1.0)).sqrt())
    }

    #[test]
    fn a_larger_force_error_is_rated_lower_on_average() {
        let means: Vec<f64> = [0.2, 1.0, 2.0, 3.0, 4.0]
            .iter()
            .map(|e| ratings(Effect::BuiltIn, &felt(*e)).0)
            .collect();
        assert!(means.windows(2).all(|w| w[0] > w[1] + 0.2), "{means:?}");
    }

    #[test]
    fn without_an_effect_ratings_do_not_depend_on_the_realization() {
        let one = ratings(Effect::None, &felt(0.1));
        let other = ratings(Effect::None, &felt(9.0));
        assert_eq!(one, other);
    }

    #[test]
    fn the_standard_deviation_of_ratings_is_about_one() {
        let (_, sd) = ratings(Effect::BuiltIn, &felt(2.0));
        assert!((0.8..1.3).contains(&sd), "{sd}");
    }

    #[test]
    fn answers_depend_only_on_seed_and_number() {
        let answers = |seed, number| {
            let mut rater = Rater::new(seed, number, Effect::BuiltIn);
            (0..40)
                .map(|_| rater.answer(&realism(), Some(&felt(1.5))))
                .collect::<Vec<_>>()
        };
        assert_eq!(answers(1, 1), answers(1, 1));
        assert_ne!(answers(1, 1), answers(1, 2));
        assert_ne!(answers(1, 1), answers(2, 1));
    }

    #[test]
    fn the_impression_does_not_change_later_draws() {
        let after = |first: f64| {
            let mut rater = Rater::new(3, 1, Effect::BuiltIn);
            rater.answer(&realism(), Some(&felt(first)));
            rater.answer(
                &question("c", false, QuestionKind::Text(kinds::Text)),
                Some(&felt(first)),
            );
            rater.exploration_s()
        };
        assert_eq!(after(0.1), after(8.0));
    }

    #[test]
    fn most_explorations_last_six_to_fifteen_seconds() {
        let mut rater = Rater::new(5, 1, Effect::BuiltIn);
        let within = (0..1000)
            .map(|_| rater.exploration_s())
            .filter(|s| (6.0..15.0).contains(s))
            .count();
        assert!(within > 880, "{within}");
    }

    #[test]
    fn the_counted_answer_is_that_of_what_is_judged_above_the_middle() {
        let options = ["no", "yes", "cannot say"].map(str::to_owned).to_vec();
        let kind = QuestionKind::Choice(kinds::Choice {
            options,
            multiple: false,
        });
        let question = question("real", true, kind);
        let share = |effect, error: f64| {
            let mut said = [0u32; 3];
            for number in 1..=400 {
                let mut rater = Rater::new(11, number, effect);
                let answer = rater.answer_counted(&question, "yes", Some(&felt(error)));
                assert_eq!(question.accepts(&answer), Ok(()));
                let Answer::Choice(chosen) = answer else {
                    panic!()
                };
                let options = ["yes", "no", "cannot say"];
                said[options.iter().position(|o| *o == chosen[0]).unwrap()] += 1;
            }
            // the other answers are drawn
            assert!(said[1].abs_diff(said[2]) < 60, "{said:?}");
            f64::from(said[0]) / 400.0
        };
        // opinions of 6, 4 and 2 on the scale from 1 to 7
        let [good, middle, bad] = [0.0, 20.0 / 7.0, 40.0 / 7.0].map(|e| share(Effect::BuiltIn, e));
        assert!(good > 0.9 && bad < 0.1, "{good} {bad}");
        assert!((middle - 0.5).abs() < 0.1, "{middle}");
        assert!((share(Effect::None, 0.0) - 0.5).abs() < 0.1);
    }

    fn any_kind() -> impl Strategy<Value = QuestionKind> {
        prop_oneof![
            (-5i64..5, 1i64..100).prop_map(|(from, span)| QuestionKind::Rating(kinds::Rating {
                from,
                to: from + span,
                labels: BTreeMap::new()
            })),
            (-10.0..10.0, 1e-6..200.0).prop_map(|(from, span)| QuestionKind::Slider(
                kinds::Slider {
                    from,
                    to: from + span,
                    step: 1.0,
                    labels: BTreeMap::new()
                }
            )),
            (1usize..6, any::<bool>()).prop_map(|(n, multiple)| QuestionKind::Choice(
                kinds::Choice {
                    options: (0..n).map(|i| format!("option {i}")).collect(),
                    multiple
                }
            )),
            (
                prop::option::of(-1e6..1e6f64),
                prop::option::of(1e-6..1e6f64)
            )
                .prop_map(|(min, above)| QuestionKind::Number(kinds::Number {
                    unit: None,
                    min,
                    max: above.map(|above| min.unwrap_or(0.0) + above),
                    above: above.and(min),
                })),
            prop::sample::select(
                KINDS
                    .iter()
                    .flat_map(|k| (k.examples)())
                    .collect::<Vec<_>>()
            ),
        ]
    }

    proptest! {
        #[test]
        fn every_answer_is_accepted(
            kind in any_kind(),
            required in any::<bool>(),
            seed in any::<u64>(),
            error in prop::option::of(0.0..20.0f64),
        ) {
            let question = question("q", required, kind);
            let mut rater = Rater::new(seed, 1, Effect::BuiltIn);
            let felt = error.map(felt);
            for _ in 0..5 {
                let answer = rater.answer(&question, felt.as_ref());
                prop_assert_eq!(question.accepts(&answer), Ok(()), "{:?}", answer);
            }
        }
    }
}
