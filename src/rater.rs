//! The simulated participant.
//!
//! A [`Rater`] answers the questions of a study so that the study can be
//! rehearsed: the runner, the files and the analysis, before a person is asked.
//! It judges a realization by its [`Impression`]: how far the force is from the
//! target's and how active the table is, seen through a bias, a gain, noise and
//! lapses of its own.
//!
//! **The effect is built in.** What comes out of a rehearsal shows that the
//! analysis finds what was put in. It is no evidence about people, and none for
//! the paper's claim. With [`Effect::None`] nothing depends on the realization.
//!
//! Formulas and constants are in `docs/simulation.md`. Everything follows from
//! the seed, the rater's number and the order of the calls. How many numbers an
//! answer draws never depends on what was felt.

mod impression;
mod remarks;

pub use impression::Impression;

use study_base::rng::Stream;
use study_core::protocol::{Answer, Question, QuestionKind};

/// Whether ratings depend on the realization.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effect {
    /// As in `docs/simulation.md`.
    BuiltIn,
    /// Not at all.
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
    talks: f64,
}

/// Middle of the 1-to-7 scale that opinions are formed on.
const MIDDLE: f64 = 4.0;

impl Rater {
    /// The rater of that number in the study with this seed.
    pub fn new(seed: u64, number: u32, effect: Effect) -> Self {
        let mut stream = Stream::new(seed, &["rater", &number.to_string()]);
        Self {
            bias: 0.4 * stream.normal(),
            gain: libm::exp(0.2 * stream.normal()),
            noise: 0.75 * libm::exp(0.15 * stream.normal()),
            lapse_rate: 0.04 * stream.unit(),
            talks: 0.1 + 0.4 * stream.unit(),
            stream,
            effect,
        }
    }

    /// How long it tries the reference, s.
    pub fn reference_s(&mut self) -> f64 {
        self.duration_s(4.0, 0.3, [2.0, 15.0])
    }

    /// How long it explores a realization, s: mostly 6 to 15.
    pub fn exploration_s(&mut self) -> f64 {
        self.duration_s(9.5, 0.25, [5.0, 20.0])
    }

    /// How long it takes to answer the questions of a trial, s.
    pub fn response_s(&mut self) -> f64 {
        self.duration_s(4.0, 0.4, [1.0, 30.0])
    }

    /// How long it rests in a break of at least `at_least_s`, s.
    pub fn takes_break_s(&mut self, at_least_s: f64) -> f64 {
        at_least_s + self.duration_s(15.0, 0.6, [2.0, 120.0])
    }

    /// A log-normal time about a median.
    fn duration_s(&mut self, median_s: f64, spread: f64, within_s: [f64; 2]) -> f64 {
        let [least, most] = within_s;
        (median_s * libm::exp(spread * self.stream.normal())).clamp(least, most)
    }

    /// Answers a question so that [`Question::accepts`] it; `felt` is what was
    /// played, for the questions of a trial.
    pub fn answer(&mut self, question: &Question, felt: Option<&Impression>) -> Answer {
        let felt = felt.filter(|_| self.effect == Effect::BuiltIn);
        match &question.kind {
            QuestionKind::Rating { from, to, .. } => {
                let span = (*to - *from) as f64;
                let steps = (self.share(question, felt) * span).round() as i64;
                Answer::Rating((from + steps).clamp(*from, *to))
            }
            QuestionKind::Slider { from, to, step, .. } => {
                let along = self.share(question, felt) * (to - from);
                // as the keys move it
                let along = if *step > 0.0 {
                    (along / step).round() * step
                } else {
                    along
                };
                Answer::Number((from + along).clamp(*from, *to))
            }
            QuestionKind::Choice { options, multiple } => self.choose(options, *multiple),
            QuestionKind::Number { min, max, .. } => self.number(*min, *max),
            QuestionKind::Text => self.say(question.required, felt),
        }
    }

    /// Where on a scale it answers, from 0 at the one end to 1 at the other.
    fn share(&mut self, question: &Question, felt: Option<&Impression>) -> f64 {
        let noise = self.noise * self.stream.normal();
        let lapses = self.stream.unit() < self.lapse_rate;
        let anywhere = self.stream.unit();
        if lapses {
            return anywhere;
        }
        let opinion = felt.map_or(MIDDLE, |felt| felt.opinion(question.id.as_str()));
        let judged = MIDDLE + self.gain * (opinion - MIDDLE) + self.bias + noise;
        ((judged - 1.0) / 6.0).clamp(0.0, 1.0)
    }

    fn choose(&mut self, options: &[String], multiple: bool) -> Answer {
        let first = self.pick(options.len());
        let chosen = options
            .iter()
            .enumerate()
            .filter(|(i, _)| {
                let also = multiple && self.stream.unit() < 0.2;
                *i == first || also
            })
            .map(|(_, option)| option.clone())
            .collect();
        Answer::Choice(chosen)
    }

    /// A whole number within the bounds where one fits; without bounds one that
    /// could be an age.
    fn number(&mut self, min: Option<f64>, max: Option<f64>) -> Answer {
        let low = min.unwrap_or_else(|| max.map_or(18.0, |max| max - 40.0));
        let high = max.unwrap_or(low + 40.0);
        let drawn = low + self.stream.unit() * (high - low);
        let whole = drawn.round();
        Answer::Number(if (low..=high).contains(&whole) {
            whole
        } else {
            drawn.clamp(low, high)
        })
    }

    fn say(&mut self, required: bool, felt: Option<&Impression>) -> Answer {
        let silent = self.stream.unit() >= self.talks;
        let draw = self.stream.unit();
        if silent && !required {
            return Answer::Text(String::new());
        }
        let said = felt.map_or_else(|| remarks::general(draw), |felt| remarks::about(felt, draw));
        Answer::Text(said.to_owned())
    }

    fn pick(&mut self, count: usize) -> usize {
        // an empty list has no first either; the draw is made all the same
        let drawn = self.stream.below(count.max(1) as u64);
        usize::try_from(drawn).expect("below a length")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeMap;
    use study_base::text::QuestionId;

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
            QuestionKind::Rating {
                from: 1,
                to: 7,
                labels,
            },
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
    fn without_an_effect_the_realization_changes_nothing() {
        let one = ratings(Effect::None, &felt(0.1));
        let other = ratings(Effect::None, &felt(9.0));
        assert_eq!(one, other);
    }

    #[test]
    fn ratings_spread_by_about_one() {
        let (_, sd) = ratings(Effect::BuiltIn, &felt(2.0));
        assert!((0.8..1.3).contains(&sd), "{sd}");
    }

    #[test]
    fn the_seed_and_the_number_alone_decide() {
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
    fn what_was_felt_moves_no_later_draw() {
        let after = |first: f64| {
            let mut rater = Rater::new(3, 1, Effect::BuiltIn);
            rater.answer(&realism(), Some(&felt(first)));
            rater.answer(
                &question("c", false, QuestionKind::Text),
                Some(&felt(first)),
            );
            rater.exploration_s()
        };
        assert_eq!(after(0.1), after(8.0));
    }

    #[test]
    fn explorations_last_six_to_fifteen_seconds_mostly() {
        let mut rater = Rater::new(5, 1, Effect::BuiltIn);
        let within = (0..1000)
            .map(|_| rater.exploration_s())
            .filter(|s| (6.0..15.0).contains(s))
            .count();
        assert!(within > 880, "{within}");
    }

    fn any_kind() -> impl Strategy<Value = QuestionKind> {
        prop_oneof![
            (-5i64..5, 1i64..100).prop_map(|(from, span)| QuestionKind::Rating {
                from,
                to: from + span,
                labels: BTreeMap::new()
            }),
            (-10.0..10.0, 1e-6..200.0).prop_map(|(from, span)| QuestionKind::Slider {
                from,
                to: from + span,
                step: 1.0,
                labels: BTreeMap::new()
            }),
            (1usize..6, any::<bool>()).prop_map(|(n, multiple)| QuestionKind::Choice {
                options: (0..n).map(|i| format!("option {i}")).collect(),
                multiple
            }),
            (
                prop::option::of(-1e6..1e6f64),
                prop::option::of(1e-6..1e6f64)
            )
                .prop_map(|(min, above)| QuestionKind::Number {
                    unit: None,
                    min,
                    max: above.map(|above| min.unwrap_or(0.0) + above),
                }),
            Just(QuestionKind::Text),
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
