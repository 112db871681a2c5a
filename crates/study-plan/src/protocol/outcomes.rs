//! Measured outcomes: `[[outcomes]]`, what a study measures in each trial beside its questions.

use super::Protocol;
use super::keys::words;
use super::questionnaires::{Inventory, Scored};
use serde::Serialize;
use std::borrow::Cow;
use study_base::text::QuestionId;

/// Most outcomes of a study: each is tested, and the tests are corrected for their number.
pub const MAX_OUTCOMES: usize = 12;

/// One of `[[outcomes]]`: a number that is measured in each trial of a rating part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OutcomeRules {
    /// Its name, also in the identifiers of its statistics.
    pub id: QuestionId,
    /// What is measured.
    pub measure: Measure,
    /// Which end is better; `None` if the study does not say.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub better: Option<BetterEnd>,
    /// What is analyzed of it.
    pub transform: Transform,
    /// The generalized mixed model that is fitted besides; it decides nothing.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model: Option<OutcomeFamily>,
    /// Of how many trials it is the successes, of a binomial model.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub of: Option<u32>,
}

/// What is measured, and by what.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "from", content = "measure", rename_all = "lowercase")]
pub enum Measure {
    /// By the clock of the session.
    Clock(Clock),
    /// From what the device reports of the motion and the force.
    Telemetry(Telemetry),
    /// The mean of the answers to some questions of the trial.
    Answers(Answers),
    /// The score of a questionnaire that is asked after each condition.
    Questionnaire(Scored),
    /// What a controller program sends with the outcome of a playback.
    Device(DeviceNumber),
}

/// A number that a controller program sends.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct DeviceNumber {
    /// What it measures, such as `time`.
    pub name: QuestionId,
    /// Its unit; `1` if it has none.
    pub unit: String,
}

impl DeviceNumber {
    /// Its key in the message: the name and the unit in small letters, such as `time_s`, `stiffness_n_per_mm`. Without
    /// a unit it is the name.
    pub fn key(&self) -> String {
        match suffix(&self.unit) {
            None => self.name.to_string(),
            Some(unit) => format!("{}_{unit}", self.name),
        }
    }
}

/// A unit as a part of a key: letters and digits, `per` for `/`, `percent`, `deg` and `u` for `%`, `°` and `µ`. `None` without any, and of
/// `1`.
pub(super) fn suffix(unit: &str) -> Option<String> {
    let mut text = String::new();
    for sign in unit.chars() {
        match sign {
            '/' => text.push_str("_per_"),
            '%' => text.push_str("percent"),
            '°' => text.push_str("deg"),
            'µ' | 'μ' => text.push('u'),
            sign if sign.is_ascii_alphanumeric() => text.push(sign.to_ascii_lowercase()),
            _ => text.push('_'),
        }
    }
    let parts: Vec<&str> = text.split('_').filter(|part| !part.is_empty()).collect();
    (!parts.is_empty() && unit != "1").then(|| parts.join("_"))
}

impl Protocol {
    /// The outcomes that a controller program sends, by their names.
    pub fn numbers_of_device(&self) -> impl Iterator<Item = (&QuestionId, &DeviceNumber)> {
        self.outcomes.iter().filter_map(|own| match &own.measure {
            Measure::Device(number) => Some((&own.id, number)),
            _ => None,
        })
    }
}

/// The mean of some answers of a trial, such as the items of a questionnaire, or the one answer.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Answers {
    /// The questions, each answered by a number.
    pub questions: Vec<QuestionId>,
    /// The unit of the answers.
    pub unit: String,
}

words! {
    /// What the clock of a session measures, s.
    Clock {
        /// How long the realization was felt, from the confirmed start of the playback to its confirmed stop:
        /// the column `exploration_s`.
        Exploration = "exploration",
        /// How long the answer took, from the opening of the questions to its confirmation: the column `response_s`.
        Response = "response",
    }
}

words! {
    /// What is measured from the telemetry of a playback; docs/outcomes.md has the formulas.
    Telemetry {
        /// The largest size of the mean force over 20 ms, N.
        PeakForce = "peak-force",
        /// The way that the handle went, mm.
        Path = "path",
        /// Full strokes, each from one end of the range to the other, as the device counts them.
        Strokes = "strokes",
        /// The energy that the hand put in and did not get back, J.
        Energy = "energy",
        /// How far the handle was beyond the place where it ended, seen from where it began, mm.
        Overshoot = "overshoot",
        /// The time in rests: slower than 5 mm/s for at least 0.1 s, s.
        Dwell = "dwell",
    }
}

words! {
    /// Which end of an outcome is better.
    BetterEnd {
        /// The higher, the better.
        Higher = "higher",
        /// The lower, the better.
        Lower = "lower",
    }
}

words! {
    /// What is analyzed of an outcome.
    Transform {
        /// The number itself.
        Identity = "none",
        /// Its natural logarithm: differences are ratios, and means are geometric. What is 0 or less has no
        /// logarithm; it is left out and counted.
        Log = "log",
    }
}

words! {
    /// The family of a generalized mixed model of an outcome.
    OutcomeFamily {
        /// Counts, such as errors: Poisson, the logarithm of the mean is linear.
        Poisson = "poisson",
        /// Successes in `of` trials, such as hits: binomial, the logit of the probability is linear.
        Binomial = "binomial",
        /// Numbers above 0 whose spread is in proportion to their mean, such as times and forces: gamma, the logarithm
        /// of the mean is linear.
        Gamma = "gamma",
    }
}

impl Measure {
    /// Whether its numbers can be counts: full strokes, the answer to one question, or what a program may count.
    pub fn can_be_counted(&self) -> bool {
        match self {
            Self::Clock(_) | Self::Questionnaire(_) => false,
            Self::Telemetry(what) => *what == Telemetry::Strokes,
            Self::Answers(answers) => answers.questions.len() == 1,
            Self::Device(_) => true,
        }
    }

    /// What measures it, as the protocol says it.
    pub fn from(&self) -> &'static str {
        match self {
            Self::Clock(_) => "clock",
            Self::Telemetry(_) => "telemetry",
            Self::Answers(_) => "answers",
            Self::Questionnaire(_) => "questionnaire",
            Self::Device(_) => "device",
        }
    }

    /// The unit of its numbers.
    pub fn unit(&self) -> &str {
        match self {
            Self::Clock(_) | Self::Telemetry(Telemetry::Dwell) => "s",
            Self::Telemetry(Telemetry::PeakForce) => "N",
            Self::Telemetry(Telemetry::Path | Telemetry::Overshoot) => "mm",
            Self::Telemetry(Telemetry::Strokes) => "1",
            Self::Telemetry(Telemetry::Energy) => "J",
            Self::Answers(answers) => &answers.unit,
            Self::Questionnaire(_) => "points",
            Self::Device(own) => &own.unit,
        }
    }

    /// What it is, as a noun.
    pub fn noun(&self) -> Cow<'_, str> {
        Cow::Borrowed(match self {
            Self::Clock(Clock::Exploration) => "exploration time",
            Self::Clock(Clock::Response) => "response time",
            Self::Telemetry(Telemetry::PeakForce) => "peak force",
            Self::Telemetry(Telemetry::Path) => "path of the handle",
            Self::Telemetry(Telemetry::Strokes) => "number of strokes",
            Self::Telemetry(Telemetry::Energy) => "energy of the hand",
            Self::Telemetry(Telemetry::Overshoot) => "overshoot",
            Self::Telemetry(Telemetry::Dwell) => "time at rest",
            Self::Answers(answers) => match answers.questions.as_slice() {
                [one] => return format!("answer to {one}").into(),
                all => return format!("mean of {} answers", all.len()).into(),
            },
            Self::Questionnaire(own) => match own.kind {
                Inventory::Sus => "score of the System Usability Scale",
                Inventory::NasaTlx => "raw score of the Task Load Index",
                Inventory::NasaTlxWeighted => "weighted score of the Task Load Index",
                Inventory::Own => return format!("score of the questionnaire {}", own.id).into(),
            },
            Self::Device(own) => return format!("{} that the device sends", own.name).into(),
        })
    }
}

impl OutcomeRules {
    /// Its declaration in a phrase: `time (exploration time, s, lower is better, log)`.
    pub fn in_words(&self) -> String {
        let noun = self.measure.noun();
        let trials = self.of.map_or_else(String::new, |of| format!(" of {of}"));
        let model = self.model.map(|family| match family {
            OutcomeFamily::Poisson => "Poisson model besides".to_owned(),
            OutcomeFamily::Binomial => format!("binomial model{trials} besides"),
            OutcomeFamily::Gamma => "gamma model besides".to_owned(),
        });
        let mut facts = vec![&*noun, self.measure.unit()];
        facts.extend(self.better.map(|better| match better {
            BetterEnd::Higher => "higher is better",
            BetterEnd::Lower => "lower is better",
        }));
        facts.extend((self.transform == Transform::Log).then_some("log"));
        facts.extend(model.as_deref());
        format!("{} ({})", self.id, facts.join(", "))
    }
}

impl Transform {
    /// The number that is analyzed; `None` if it has none.
    pub fn apply(self, x: f64) -> Option<f64> {
        match self {
            Self::Identity => Some(x),
            Self::Log => (x > 0.0).then(|| x.ln()),
        }
    }

    /// The measured number of one that is analyzed.
    pub fn back(self, y: f64) -> f64 {
        match self {
            Self::Identity => y,
            Self::Log => y.exp(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_transformed_number_comes_back() {
        for transform in [Transform::Identity, Transform::Log] {
            let there = transform.apply(2.5).unwrap();
            assert!((transform.back(there) - 2.5).abs() < 1e-15);
        }
        // Only positive numbers have a logarithm.
        assert_eq!(Transform::Log.apply(0.0), None);
        assert_eq!(Transform::Log.apply(-1.0), None);
        assert_eq!(Transform::Identity.apply(-1.0), Some(-1.0));
    }

    #[test]
    fn a_key_is_the_name_with_its_unit() {
        for (name, unit, key) in [
            ("time", "s", "time_s"),
            ("peak", "N", "peak_n"),
            ("slope", "N/mm", "slope_n_per_mm"),
            ("share", "%", "share_percent"),
            ("angle", "°", "angle_deg"),
            ("gap", "µm", "gap_um"),
            ("work", "N·m", "work_n_m"),
            ("errors", "1", "errors"),
        ] {
            let number = DeviceNumber {
                name: QuestionId::new(name).unwrap(),
                unit: unit.to_owned(),
            };
            assert_eq!(number.key(), key);
        }
        assert_eq!(suffix("·"), None);
    }

    #[test]
    fn the_form_in_a_fingerprint_never_changes() {
        let rules = OutcomeRules {
            id: QuestionId::new("time").unwrap(),
            measure: Measure::Clock(Clock::Exploration),
            better: Some(BetterEnd::Lower),
            transform: Transform::Log,
            model: None,
            of: None,
        };
        assert_eq!(
            serde_json::json!(rules),
            serde_json::json!({
                "id": "time",
                "measure": { "from": "clock", "measure": "exploration" },
                "better": "lower",
                "transform": "log",
            })
        );
        let modeled = OutcomeRules {
            model: Some(OutcomeFamily::Binomial),
            of: Some(12),
            ..rules
        };
        let sent = OutcomeRules {
            measure: Measure::Device(DeviceNumber {
                name: QuestionId::new("time").unwrap(),
                unit: "s".to_owned(),
            }),
            ..modeled.clone()
        };
        assert_eq!(
            serde_json::json!(sent)["measure"],
            serde_json::json!({ "from": "device", "measure": { "name": "time", "unit": "s" } })
        );
        let written = serde_json::json!(modeled);
        assert_eq!(
            (&written["model"], &written["of"]),
            (&serde_json::json!("binomial"), &serde_json::json!(12))
        );
    }
}
