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
use study_stats::questionnaire::{raw_tlx, sus, weighted_tlx};

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
        /// The NASA Task Load Index with weights (Hart & Staveland 1988): the six ratings, then 15 comparisons of two subscales each.
        NasaTlxWeighted = "nasa-tlx-weighted",
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
    /// Of a comparison, the places of both among the items, from 0; the answer is 1 or 2.
    pub pair: Option<[usize; 2]>,
}

const fn agree(name: &'static str, prompt: &'static str) -> Item {
    Item {
        name,
        prompt,
        low: "strongly disagree",
        high: "strongly agree",
        pair: None,
    }
}

const fn load(name: &'static str, prompt: &'static str) -> Item {
    Item {
        name,
        prompt,
        low: "very low",
        high: "very high",
        pair: None,
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

/// The titles of these subscales, those of the source.
const TITLES: [&str; 6] = [
    "mental demand",
    "physical demand",
    "temporal demand",
    "performance",
    "effort",
    "frustration",
];

const fn compare(name: &'static str, first: usize, second: usize) -> Item {
    Item {
        name,
        prompt: "Which of the two contributed more to the workload of the task?",
        low: TITLES[first],
        high: TITLES[second],
        pair: Some([first, second]),
    }
}

/// The ratings, and all pairs of subscales: m, p, t, o (own performance), e and f. Each comes first in
/// two or three of its five pairs.
const NASA_TLX_WEIGHTED: [Item; 21] = [
    NASA_TLX[0],
    NASA_TLX[1],
    NASA_TLX[2],
    NASA_TLX[3],
    NASA_TLX[4],
    NASA_TLX[5],
    compare("pair_mp", 0, 1),
    compare("pair_tm", 2, 0),
    compare("pair_mo", 0, 3),
    compare("pair_em", 4, 0),
    compare("pair_mf", 0, 5),
    compare("pair_pt", 1, 2),
    compare("pair_op", 3, 1),
    compare("pair_pe", 1, 4),
    compare("pair_fp", 5, 1),
    compare("pair_to", 2, 3),
    compare("pair_et", 4, 2),
    compare("pair_tf", 2, 5),
    compare("pair_oe", 3, 4),
    compare("pair_fo", 5, 3),
    compare("pair_ef", 4, 5),
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
            Self::NasaTlxWeighted => &NASA_TLX_WEIGHTED,
            Self::Own => &[],
        }
    }

    /// The answers to an item, with labels at both ends of its scale; `None` of one of the study's own.
    pub fn scale(self, item: &Item, low: &str, high: &str) -> Option<QuestionKind> {
        let (low, high) = (low.to_owned(), high.to_owned());
        Some(match self {
            _ if item.pair.is_some() => QuestionKind::Rating(kinds::Rating {
                from: 1,
                to: 2,
                labels: BTreeMap::from([(1, low), (2, high)]),
            }),
            Self::Own => return None,
            Self::Sus => QuestionKind::Rating(kinds::Rating {
                from: 1,
                to: 5,
                labels: BTreeMap::from([(1, low), (5, high)]),
            }),
            Self::NasaTlx | Self::NasaTlxWeighted => QuestionKind::Slider(kinds::Slider {
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
            Inventory::NasaTlxWeighted => {
                let all = all?;
                let items = self.kind.items().iter().zip(&all);
                let chosen: Option<Vec<usize>> = items
                    .filter_map(|(item, answer)| Some((item.pair?, *answer)))
                    .map(|(pair, answer)| {
                        let at = [1.0, 2.0].iter().position(|own| *own == answer)?;
                        Some(pair[at])
                    })
                    .collect();
                weighted_tlx(all.get(..6)?, &chosen?)
            }
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
        for kind in [
            Inventory::Sus,
            Inventory::NasaTlx,
            Inventory::NasaTlxWeighted,
        ] {
            let id = PartId::new("x".repeat(20)).unwrap();
            let own = None;
            let ids = Scored { id, kind, own }.questions();
            assert_eq!(ids.len(), kind.items().len());
            assert!((1..ids.len()).all(|i| !ids[..i].contains(&ids[i])));
        }
    }

    /// Each pair of subscales is there once, and none is always the first or the second.
    #[test]
    fn all_pairs_of_subscales_are_compared() {
        let items = Inventory::NasaTlxWeighted.items();
        let pairs: Vec<[usize; 2]> = items.iter().filter_map(|item| item.pair).collect();
        for first in 0..6 {
            for second in first + 1..6 {
                let both = [[first, second], [second, first]];
                let there = pairs.iter().filter(|pair| both.contains(pair));
                assert_eq!(there.count(), 1, "{both:?}");
            }
            let ahead = pairs.iter().filter(|pair| pair[0] == first).count();
            assert!(ahead == 2 || ahead == 3, "{first}: {ahead}");
        }
    }

    /// Who always chooses the same subscale where it is compared, and the first one elsewhere.
    #[test]
    fn a_weighted_score_counts_what_was_chosen() {
        let own = Scored {
            id: PartId::new("load").unwrap(),
            kind: Inventory::NasaTlxWeighted,
            own: None,
        };
        let ratings = [70.0, 20.0, 55.0, 30.0, 65.0, 15.0];
        let pairs = own.kind.items().iter().filter_map(|item| item.pair);
        let choices: Vec<usize> = pairs.map(|pair| usize::from(pair[1] == 0)).collect();
        let mut given: Vec<Option<f64>> = ratings.map(Some).to_vec();
        given.extend(choices.iter().map(|at| Some((at + 1) as f64)));
        // Mental demand 5 times, as often as they come first physical demand 2, temporal demand 2, performance 2,
        // effort 2, frustration 2.
        let expected = (5.0 * 70.0 + 2.0 * (20.0 + 55.0 + 30.0 + 65.0 + 15.0)) / 15.0;
        let found = own.score(&given).unwrap();
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        given[20] = Some(3.0);
        assert_eq!(own.score(&given), None);
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
