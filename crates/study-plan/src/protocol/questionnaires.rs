//! Standard questionnaires, at the end of a session or between its trials.

use super::keys::words;
use super::kinds::{self, QuestionKind};
use super::parts::Task;
use super::plan::Trial;
use super::scoring::Scoring;
use super::{Answer, Order, Protocol, Question};
use serde::Serialize;
use std::collections::BTreeMap;
use study_base::text::{ModelId, PartId, QuestionId};
use study_stats::questionnaire::{raw_tlx, sus};

/// One of `[[questionnaires]]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Questionnaire {
    /// Identifier of the questionnaire.
    pub id: PartId,
    /// Which one it is.
    pub kind: Inventory,
    /// How one of the study's own is scored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub own: Option<Scoring>,
    /// After what it is asked.
    pub after: Occasion,
    /// Its items, if it is asked between the trials; at the end they are questions of the `[[outro]]`.
    pub questions: Vec<Question>,
}

words! {
    /// After what a questionnaire is asked.
    #[derive(PartialOrd, Ord)]
    Occasion {
        /// After the last trial of each realization, in the orders with blocks (`blocked`, `williams`, `latin-square`,
        /// `fixed`) in each block, unless there is only one realization. Each score belongs to its realization, and is a
        /// measured outcome.
        Condition = "condition",
        /// After each block of trials that rate realizations.
        Block = "block",
        /// After each of `[[parts]]`.
        Part = "part",
        /// Once, after `[[outro]]`.
        Session = "session",
    }
}

impl Occasion {
    /// When that is, in a sentence.
    pub fn when(self) -> &'static str {
        match self {
            Self::Condition => "after each realization",
            Self::Block => "after each block",
            Self::Part => "after each part",
            Self::Session => "at the end",
        }
    }
}

/// The trials that a questionnaire is about: their part, block and realization, as far as these matter.
pub type Stretch<'a> = (Option<&'a PartId>, Option<u32>, Option<&'a ModelId>);

words! {
    /// A standard questionnaire.
    Inventory {
        /// The System Usability Scale (Brooke 1996): ten sentences, agreed to from 1 to 5; a score from 0 to 100.
        Sus = "sus",
        /// The NASA Task Load Index without weights (Hart & Staveland 1988; Hart 2006): six ratings from 0 to 100.
        NasaTlx = "nasa-tlx",
        /// One that the study brings itself, with its items and its scoring.
        Own = "own",
    }
}

/// What is asked in an item, in English.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Item {
    /// The end of its id.
    pub name: &'static str,
    /// Its text; `{system}` is the word for what is judged.
    pub prompt: &'static str,
    /// Label of the lowest answer.
    pub low: &'static str,
    /// Label of the highest answer.
    pub high: &'static str,
}

const fn agree(name: &'static str, prompt: &'static str) -> Item {
    Item {
        name,
        prompt,
        low: "strongly disagree",
        high: "strongly agree",
    }
}

const fn load(name: &'static str, prompt: &'static str) -> Item {
    Item {
        name,
        prompt,
        low: "very low",
        high: "very high",
    }
}

/// Brooke's items, free to use with acknowledgement of the source.
const SUS: [Item; 10] = [
    agree(
        "1",
        "I think that I would like to use this {system} frequently.",
    ),
    agree("2", "I found the {system} unnecessarily complex."),
    agree("3", "I thought the {system} was easy to use."),
    agree(
        "4",
        "I think that I would need the support of a technical person to be able to use this {system}.",
    ),
    agree(
        "5",
        "I found the various functions in this {system} were well integrated.",
    ),
    agree(
        "6",
        "I thought there was too much inconsistency in this {system}.",
    ),
    agree(
        "7",
        "I would imagine that most people would learn to use this {system} very quickly.",
    ),
    agree("8", "I found the {system} very cumbersome to use."),
    agree("9", "I felt very confident using the {system}."),
    agree(
        "10",
        "I needed to learn a lot of things before I could get going with this {system}.",
    ),
];

/// The subscales of the Task Load Index, a work of the United States government.
const NASA_TLX: [Item; 6] = [
    load("mental", "How mentally demanding was the task?"),
    load("physical", "How physically demanding was the task?"),
    load(
        "temporal",
        "How hurried or rushed was the pace of the task?",
    ),
    Item {
        low: "perfect",
        high: "failure",
        ..load(
            "performance",
            "How successful were you in accomplishing what you were asked to do?",
        )
    },
    load(
        "effort",
        "How hard did you have to work to accomplish your level of performance?",
    ),
    load(
        "frustration",
        "How insecure, discouraged, irritated, stressed, and annoyed were you?",
    ),
];

impl Inventory {
    /// Its items, in their order; none of one of the study's own.
    ///
    /// ```
    /// # use study_plan::protocol::Inventory;
    /// assert_eq!((Inventory::Sus.items().len(), Inventory::NasaTlx.items().len()), (10, 6));
    /// ```
    pub fn items(self) -> &'static [Item] {
        match self {
            Self::Sus => &SUS,
            Self::NasaTlx => &NASA_TLX,
            Self::Own => &[],
        }
    }

    /// The answers to an item, with labels at both ends of its scale; `None` of one of the study's own.
    pub fn scale(self, low: &str, high: &str) -> Option<QuestionKind> {
        let (low, high) = (low.to_owned(), high.to_owned());
        Some(match self {
            Self::Own => return None,
            Self::Sus => QuestionKind::Rating(kinds::Rating {
                from: 1,
                to: 5,
                labels: BTreeMap::from([(1, low), (5, high)]),
            }),
            Self::NasaTlx => QuestionKind::Slider(kinds::Slider {
                from: 0.0,
                to: 100.0,
                step: 5.0,
                labels: BTreeMap::from([("0".to_owned(), low), ("100".to_owned(), high)]),
            }),
        })
    }
}

impl Questionnaire {
    /// What its score is made of.
    pub fn scored(&self) -> Scored {
        Scored {
            id: self.id.clone(),
            kind: self.kind,
            own: self.own.clone(),
        }
    }

    /// How often it is asked between the trials of a session, unless trials fail; 0 at the end.
    pub fn times(&self, protocol: &Protocol) -> u32 {
        let parts: Vec<Option<&PartId>> = match protocol.parts.is_empty() {
            true => vec![None],
            false => protocol.parts.iter().map(|part| Some(&part.id)).collect(),
        };
        let of_part = |id: &Option<&PartId>| -> u32 {
            let design = protocol.design_of(*id);
            let blocks = match design.order {
                Order::Shuffled | Order::File(_) => 1,
                _ => design.repetitions,
            };
            let rated = protocol.rated(*id);
            match self.after {
                Occasion::Condition if rated == 1 => 1,
                Occasion::Condition => rated.saturating_mul(blocks),
                Occasion::Block if rated == 0 => 0,
                Occasion::Block => blocks,
                Occasion::Part => 1,
                Occasion::Session => 0,
            }
        };
        parts.iter().map(of_part).sum()
    }

    /// The trials to which one belongs, if the questionnaire is asked after them.
    pub fn stretch<'a>(&self, protocol: &Protocol, trial: &'a Trial) -> Option<Stretch<'a>> {
        if trial.practice {
            return None;
        }
        let part = trial.part.as_ref();
        match (self.after, protocol.rated(part)) {
            (Occasion::Session, _) | (Occasion::Condition | Occasion::Block, 0) => None,
            (Occasion::Condition, 1) => Some((part, None, Some(trial.model()?))),
            (Occasion::Condition, _) => Some((part, Some(trial.block), Some(trial.model()?))),
            (Occasion::Block, _) => Some((part, Some(trial.block), None)),
            (Occasion::Part, _) => Some((part, None, None)),
        }
    }
}

/// What the score of a questionnaire is made of.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scored {
    /// Identifier of the questionnaire.
    pub id: PartId,
    /// Which one it is.
    pub kind: Inventory,
    /// How one of the study's own is scored.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub own: Option<Scoring>,
}

impl Scored {
    /// The names of its items, in their order.
    pub fn names(&self) -> Vec<String> {
        match &self.own {
            Some(own) => (1..=own.items).map(|item| item.to_string()).collect(),
            None => (self.kind.items().iter())
                .map(|item| item.name.to_owned())
                .collect(),
        }
    }

    /// The questions of its items, such as `sus_1`.
    pub fn questions(&self) -> Vec<QuestionId> {
        let names = self.names();
        names.iter().map(|name| item_id(&self.id, name)).collect()
    }

    /// The score of answers to its items, in their order; `None` if one is missing or not on its scale.
    pub fn score(&self, answers: &[Option<f64>]) -> Option<f64> {
        if let Some(own) = &self.own {
            return own.score(answers);
        }
        let all: Option<Vec<f64>> = answers.iter().copied().collect();
        match self.kind {
            Inventory::Sus => sus(&all?),
            Inventory::NasaTlx => raw_tlx(&all?),
            Inventory::Own => None,
        }
    }

    /// The score of these answers; `None` if one is missing.
    pub fn of(&self, answers: &BTreeMap<QuestionId, Answer>) -> Option<f64> {
        let answer = |id: &QuestionId| answers.get(id).and_then(Answer::number);
        let all: Vec<Option<f64>> = self.questions().iter().map(answer).collect();
        self.score(&all)
    }
}

impl Protocol {
    /// The items of the questionnaires that are asked between the trials.
    pub fn between(&self) -> impl Iterator<Item = &Question> {
        self.questionnaires.iter().flat_map(|own| &own.questions)
    }

    /// Whether nothing is presented, and only questionnaires are asked.
    pub fn only_asks(&self) -> bool {
        self.parts.is_empty() && self.models.is_empty() && !self.questionnaires.is_empty()
    }

    /// Number of realizations that the trials of a part rate, one a trial, or those of a study without
    /// parts; 0 of a part of another kind.
    fn rated(&self, part: Option<&PartId>) -> u32 {
        let task = part.and_then(|id| self.part(id)).map(|part| &part.task);
        let rated = match task {
            None => self.scheduled_models().count(),
            Some(Task::Rating(own)) => own.models.len(),
            Some(_) => 0,
        };
        u32::try_from(rated).unwrap_or(u32::MAX)
    }
}

/// The question of an item: the id of the questionnaire and the name of the item.
pub(super) fn item_id(id: &PartId, name: &str) -> QuestionId {
    let id = QuestionId::new(format!("{id}_{name}"));
    id.expect("a part id has at most 20 characters and the name of an item at most 11")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_item_of_every_questionnaire_has_an_id() {
        for kind in [Inventory::Sus, Inventory::NasaTlx] {
            let id = PartId::new("x".repeat(20)).unwrap();
            let own = None;
            let ids = Scored { id, kind, own }.questions();
            assert_eq!(ids.len(), kind.items().len());
            assert!((1..ids.len()).all(|i| !ids[..i].contains(&ids[i])));
        }
    }

    #[test]
    fn a_score_needs_every_item() {
        let own = Scored {
            id: PartId::new("load").unwrap(),
            kind: Inventory::NasaTlx,
            own: None,
        };
        let ratings = [70.0, 20.0, 55.0, 30.0, 65.0, 15.0];
        let items = own.questions().into_iter().zip(ratings);
        let given = items.map(|(id, x)| (id, Answer::Number(x)));
        let mut answers: BTreeMap<QuestionId, Answer> = given.collect();
        assert_eq!(own.of(&answers), Some(42.5));
        answers.remove(&QuestionId::new("load_effort").unwrap());
        assert_eq!(own.of(&answers), None);
    }
}
