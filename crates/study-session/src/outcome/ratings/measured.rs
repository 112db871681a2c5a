//! What was measured in each trial beside the rating: `[[outcomes]]`.

use super::Ratings;
use crate::outcome::rows::{RatingRow, Status};
use std::collections::BTreeMap;
use study_plan::protocol::{Answer, Clock, Measure, OutcomeRules, Telemetry};

/// What was measured of the motion in trials, by the place of their row.
pub type Motions = BTreeMap<usize, Vec<(Telemetry, f64)>>;

/// The numbers of an outcome.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// The name of the outcome.
    pub id: String,
    /// By row, in the unit of the outcome; `None` where it was not measured.
    pub values: Vec<Option<f64>>,
}

impl Measured {
    /// The numbers of some of the rows.
    pub(super) fn pick(&self, rows: &[usize]) -> Self {
        Self {
            id: self.id.clone(),
            values: rows.iter().map(|&i| self.values[i]).collect(),
        }
    }

    /// Adds the numbers of other ratings, before their columns are added: an outcome that one of both
    /// has not is unknown in its rows.
    pub(super) fn extend(all: &mut Ratings, other: &Ratings) {
        let (before, after) = (all.len(), all.len() + other.len());
        for own in &other.measured {
            let known = all.measured.iter().position(|m| m.id == own.id);
            let at = known.unwrap_or_else(|| {
                all.measured.push(Self {
                    id: own.id.clone(),
                    values: vec![None; before],
                });
                all.measured.len() - 1
            });
            all.measured[at].values.extend_from_slice(&own.values);
        }
        for own in &mut all.measured {
            own.values.resize(after, None);
        }
    }
}

impl Ratings {
    /// Adds what was measured in the trials. `rows` are those that the ratings were made of; `telemetry` has
    /// what was measured of the motion, by the place of the row.
    pub fn set_measured(
        &mut self,
        rows: &[RatingRow],
        outcomes: &[OutcomeRules],
        telemetry: &Motions,
    ) {
        let of = |outcome: &OutcomeRules| Measured {
            id: outcome.id.to_string(),
            values: (self.source_row.iter())
                .map(|source| {
                    let at = (*source as usize).checked_sub(1)?;
                    measured(at, rows.get(at)?, outcome, telemetry)
                })
                .map(|value| value.filter(|x| x.is_finite()))
                .collect(),
        };
        self.measured = outcomes.iter().map(of).collect();
    }

    /// The same trials with what was measured in place of the rating, transformed: of the trials that have a
    /// rating, so that both are of the same ones. Nothing that belongs to the rating alone is kept.
    #[must_use]
    pub fn of_measured(&self, own: &Measured, transform: impl Fn(f64) -> Option<f64>) -> Self {
        let rating = (self.rating.iter().zip(&own.values))
            .map(|(rating, value)| rating.and(*value).and_then(&transform));
        let rating: Vec<Option<f64>> = rating.collect();
        let status = (self.status.iter().zip(&rating)).map(|(status, rating)| match rating {
            None if *status == Status::Ok => Status::Missing,
            _ => *status,
        });
        let status = status.collect();
        let every: Vec<usize> = (0..self.len()).collect();
        Self {
            question: own.id.clone(),
            subjects: self.subjects.clone(),
            models: self.models.clone(),
            rating,
            status,
            felt: Vec::new(),
            measured: Vec::new(),
            ..self.pick(&every)
        }
    }
}

/// What was measured in a trial.
fn measured(
    at: usize,
    row: &RatingRow,
    outcome: &OutcomeRules,
    telemetry: &Motions,
) -> Option<f64> {
    match &outcome.measure {
        Measure::Clock(Clock::Exploration) => row.exploration_s,
        Measure::Clock(Clock::Response) => row.response_s,
        Measure::Telemetry(Telemetry::Strokes) => row.strokes.map(f64::from),
        Measure::Telemetry(what) => {
            let own = telemetry.get(&at)?;
            own.iter().find(|m| m.0 == *what).map(|m| m.1)
        }
        Measure::Answers(answers) => {
            let of = |question| row.answers.get(question).and_then(Answer::number);
            let all: Option<Vec<f64>> = answers.questions.iter().map(of).collect();
            let all = all.filter(|all| !all.is_empty())?;
            Some(all.iter().sum::<f64>() / all.len() as f64)
        }
        Measure::Questionnaire(own) => own.of(&row.answers),
        Measure::Device(_) => row.sent.get(outcome.id.as_str()).copied(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_base::text::{ModelId, ParticipantId, QuestionId};
    use study_plan::protocol::{Answers, Transform};

    fn table(rows: &str) -> Ratings {
        let csv = format!("subject,model,rating\n{rows}");
        Ratings::read_csv("t.csv", csv.as_bytes(), None).unwrap()
    }

    fn with(mut ratings: Ratings, id: &str, values: &[f64]) -> Ratings {
        ratings.measured.push(Measured {
            id: id.to_owned(),
            values: values.iter().map(|x| Some(*x)).collect(),
        });
        ratings
    }

    #[test]
    fn numbers_stay_with_their_rows() {
        let all = with(table("P1,a,1\nP1,b,2\nP2,a,3\n"), "time", &[1.5, 2.5, 3.5]);
        let kept = all.keep(|i| i != 1);
        assert_eq!(kept.measured[0].values, [Some(1.5), Some(3.5)]);
    }

    #[test]
    fn what_was_measured_takes_the_place_of_the_ratings_of_the_same_trials() {
        let all = with(table("P1,a,1\nP1,b,\nP2,a,3\n"), "time", &[1.0, 2.0, -1.0]);
        let of = all.of_measured(&all.measured[0], |x| (x > 0.0).then(|| x.ln()));
        assert_eq!(of.rating, [Some(0.0), None, None]);
        assert_eq!((of.subjects.len(), of.models.len()), (2, 2));
        assert_eq!(
            (of.model.as_slice(), of.vaf.len()),
            (all.model.as_slice(), 3)
        );
    }

    /// Each number comes from its own place, and a mean of answers needs all of them.
    #[test]
    fn numbers_are_those_of_the_clock_the_device_and_the_answers() {
        let id = |name: &str| QuestionId::new(name).unwrap();
        let row = |trial: u32, answers: &[(&str, Answer)]| {
            let who = ParticipantId::new("P1").unwrap();
            let rating = (id("rough"), Answer::Rating(4));
            let mut row = RatingRow::answered(who, 1, trial, rating);
            row.model = Some(ModelId::new("a").unwrap());
            (row.exploration_s, row.response_s) = (Some(f64::from(trial)), Some(0.5));
            row.strokes = Some(7);
            for (name, answer) in answers {
                row.answers.insert(id(name), answer.clone());
            }
            row
        };
        let (ten, thirty) = (Answer::Number(10.0), Answer::Number(30.0));
        let rows = [
            row(1, &[("mental", ten.clone()), ("effort", thirty)]),
            row(2, &[("mental", ten)]),
        ];
        let outcome = |name: &str, measure: Measure| OutcomeRules {
            id: id(name),
            measure,
            better: None,
            transform: Transform::Identity,
            model: None,
            of: None,
        };
        let load = Answers {
            questions: vec![id("mental"), id("effort")],
            unit: "points".to_owned(),
        };
        let outcomes = [
            outcome("time", Measure::Clock(Clock::Exploration)),
            outcome("answer", Measure::Clock(Clock::Response)),
            outcome("presses", Measure::Telemetry(Telemetry::Strokes)),
            outcome("way", Measure::Telemetry(Telemetry::Path)),
            outcome("load", Measure::Answers(load)),
        ];
        let motions = Motions::from([(1, vec![(Telemetry::Path, 81.5), (Telemetry::Dwell, 2.0)])]);
        let mut ratings = Ratings::from_rows(&rows, &id("rough"), None);
        ratings.set_measured(&rows, &outcomes, &motions);
        let values: Vec<&[Option<f64>]> = ratings
            .measured
            .iter()
            .map(|m| m.values.as_slice())
            .collect();
        assert_eq!(
            values,
            [
                [Some(1.0), Some(2.0)],
                [Some(0.5), Some(0.5)],
                [Some(7.0), Some(7.0)],
                [None, Some(81.5)],
                [Some(20.0), None],
            ]
        );
    }

    #[test]
    fn an_outcome_that_one_site_has_not_is_unknown_there() {
        let one = with(table("P1,a,1\nP1,b,2\n"), "time", &[1.5, 2.5]);
        let other = with(table("P1,a,1\n"), "force", &[9.0]);
        let both = Ratings::pooled(&[("x".to_owned(), one), ("y".to_owned(), other)]);
        assert_eq!(both.measured[0].values, [Some(1.5), Some(2.5), None]);
        assert_eq!(both.measured[1].values, [None, None, Some(9.0)]);
    }
}
