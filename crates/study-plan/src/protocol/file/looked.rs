//! What the ids in parts and tracks stand for; every unknown one is reported.

use super::adjustment::RawAdjustment;
use super::agree::{Sections, at, unknown};
use super::pairs::RawPairs;
use super::parts::RawLabel;
use super::ranking::{RawRanking, RawSet};
use super::similarity::RawSimilarity;
use super::spaces::PartialSpace;
use crate::protocol::pairs::{every, neighbors};
use crate::protocol::ranking::MOST_RANKED;
use crate::protocol::similarity::unconnected;
use crate::protocol::{
    Adjustment, Criterion, DeviceKind, FamilyRules, Label, Presentations, Ranking, Role, Similarity,
};
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::Document;
use study_base::text::{ModelId, PartId, QuestionId};

/// What is looked up while a part or track is resolved.
pub(super) struct Looked<'a> {
    pub(super) sections: &'a Sections<'a>,
    pub(super) document: &'a Document<'a>,
}

impl Looked<'_> {
    pub(super) fn fault(&self, path: &str, key: &str, fault: Fault) {
        self.document.fault(fault.at(at(self.document, path, key)));
    }

    pub(super) fn fault_at(&self, path: &str, fault: Fault) {
        self.document.fault(fault.at(self.document.span_of(path)));
    }

    /// Reports an id that no model has; returns whether one has it.
    pub(super) fn model(&self, id: &ModelId, place: &str) -> bool {
        let known = || self.sections.models.iter().filter_map(|m| m.id.as_ref());
        let found = known().any(|k| k == id);
        if !found {
            let fault = unknown("model", id.as_str(), known().map(ModelId::as_str));
            self.fault_at(place, fault);
        }
        found
    }

    /// Reports ids that no model has, and those that are there twice.
    pub(super) fn models(&self, ids: &[ModelId], place: &str) {
        for (i, id) in ids.iter().enumerate() {
            let place = format!("{place}[{i}]");
            if self.model(id, &place) && ids[..i].contains(id) {
                self.fault_at(&place, Fault::error(format!("`{id}` is there twice")));
            }
        }
    }

    /// The family that a track or a part names. Samples mounted by hand have none.
    pub(super) fn family<'f>(
        &self,
        id: &PartId,
        families: &'f [FamilyRules],
        path: &str,
    ) -> Option<&'f FamilyRules> {
        let device = self.sections.device;
        if device.is_some_and(|d| d.kind == DeviceKind::Manual) {
            let fault = Fault::error("a sample mounted by hand has no levels");
            self.fault(
                path,
                "family",
                fault.hint("a track can compare two `models`"),
            );
        }
        let found = families.iter().find(|f| f.id == *id);
        if found.is_none() {
            let known = families.iter().map(|f| f.id.as_str());
            self.fault(path, "family", unknown("family", id.as_str(), known));
        }
        found
    }

    /// Reports a space that there is not. Samples mounted by hand have none.
    pub(super) fn space(&self, id: &PartId, spaces: &[PartialSpace], path: &str) {
        let device = self.sections.device;
        if device.is_some_and(|d| d.kind == DeviceKind::Manual) {
            let fault = Fault::error("samples mounted by hand are no points of a space");
            let hint = "a part of kind \"pairs\" compares samples";
            self.fault(path, "space", fault.hint(hint));
        }
        // One with a fault of its own may be the one that is meant.
        if spaces.iter().any(|space| space.space.is_none()) {
            return;
        }
        let known = || {
            spaces
                .iter()
                .filter_map(|s| s.space.as_ref())
                .map(|s| &s.id)
        };
        if !known().any(|known| known == id) {
            let known = known().map(PartId::as_str);
            self.fault(path, "space", unknown("space", id.as_str(), known));
        }
    }

    /// The realizations of some levels of a family, or of all.
    pub(super) fn levels(
        &self,
        family: &FamilyRules,
        levels: Option<&[f64]>,
        path: &str,
    ) -> Option<Vec<ModelId>> {
        let Some(levels) = levels else {
            return Some(family.realizations().map(|(id, _)| id).collect());
        };
        let mut models = Vec::new();
        for level in levels {
            let id = self.level(family, *level, (path, "levels"))?;
            if models.contains(&id) {
                let what = format!("the level {level} is there twice");
                self.fault(path, "levels", Fault::error(what));
                return None;
            }
            models.push(id);
        }
        Some(models)
    }

    /// The realization of a level of a family, which a key names.
    pub(super) fn level(
        &self,
        family: &FamilyRules,
        level: f64,
        (path, key): (&str, &str),
    ) -> Option<ModelId> {
        let found = family.realizations().find(|(_, own)| *own == level);
        if found.is_none() {
            let what = format!("{level} is no level of the family `{}`", family.id);
            let far = |own: &f64| (own - level).abs();
            let all = family.ladder.levels().iter().copied();
            let near = all.min_by(|a, b| far(a).total_cmp(&far(b)));
            let near = near.map_or_else(String::new, |near| format!("the nearest level is {near}"));
            self.fault(path, key, Fault::error(what).hint(near));
        }
        found.map(|(id, _)| id)
    }

    /// Reports a part of MUSHRA without one hidden reference, which its screening needs.
    pub(super) fn hidden_reference(&self, presentations: &Presentations, path: &str) {
        let of = |role| {
            let models = self.sections.models.iter().filter(move |m| m.role == role);
            let ids = models.filter_map(|m| m.id.as_ref());
            ids.filter(|id| presentations.models.contains(id)).count()
        };
        if of(Role::HiddenReference) != 1 {
            let what =
                "a part of kind \"mushra\" needs one realization with role = \"hidden-reference\"";
            let hint = "who rates it below 90 too often is flagged";
            self.fault(path, "id", Fault::error(what).hint(hint));
        } else if of(Role::LowAnchor) + of(Role::MidAnchor) == 0 {
            let what = "no anchor is rated: ratings of different studies cannot be compared";
            let hint = "add a realization with role = \"low-anchor\" or \"mid-anchor\"";
            self.fault(path, "id", Fault::warning(what).hint(hint));
        }
    }

    pub(super) fn question(&self, id: &QuestionId, place: &str) {
        let known = || self.sections.questions.iter().filter_map(|q| q.id.as_ref());
        if !known().any(|k| k == id) {
            let fault = unknown("question", id.as_str(), known().map(QuestionId::as_str));
            self.fault_at(place, fault);
        }
    }

    /// The models that a part presents if it names none.
    pub(super) fn default_models(&self, duplicates: bool) -> Vec<ModelId> {
        let models = self.sections.models.iter();
        models
            .filter(|m| m.role != Role::Practice && (duplicates || m.duplicate_of.is_none()))
            .filter_map(|m| m.id.clone())
            .collect()
    }

    /// Reports practice trials with realizations that do not exist.
    pub(super) fn practice(&self, raw: &Presentations, path: &str) {
        for (i, id) in raw.practice.iter().enumerate() {
            self.model(id, &format!("{path}.practice[{i}]"));
        }
    }

    /// The labels with their realizations. Realizations that do not exist, those with two labels,
    /// and practice trials with realizations that have none are reported.
    pub(super) fn labels(
        &self,
        raw: &[RawLabel],
        family: Option<&FamilyRules>,
        practice: &[ModelId],
        path: &str,
    ) -> Option<Vec<Label>> {
        let mut labels: Vec<Label> = Vec::new();
        let is_labeled =
            |labels: &[Label], id: &ModelId| labels.iter().any(|l| l.models.contains(id));
        for (i, raw) in raw.iter().enumerate() {
            let path = format!("{path}.answers[{i}]");
            let levels = match (family, &raw.levels) {
                (Some(family), Some(levels)) => self.levels(family, Some(levels), &path)?,
                _ => Vec::new(),
            };
            for (j, id) in raw.models.iter().enumerate() {
                self.model(id, &format!("{path}.models[{j}]"));
            }
            let models: Vec<ModelId> = raw.models.iter().cloned().chain(levels).collect();
            for (j, id) in models.iter().enumerate() {
                if models[..j].contains(id) || is_labeled(&labels, id) {
                    let fault = Fault::error(format!("`{id}` is there twice"));
                    let hint = "leave it with the one label that is right for it";
                    self.fault_at(&path, fault.hint(hint));
                }
            }
            let text = raw.text.clone();
            labels.push(Label { text, models });
        }
        for (i, id) in practice.iter().enumerate() {
            let place = format!("{path}.practice[{i}]");
            if !is_labeled(&labels, id) && self.model(id, &place) {
                let fault = Fault::error(format!("`{id}` has no label"));
                let hint = "give it a label in answers, or leave it out: its practice trial has no right answer";
                self.fault_at(&place, fault.hint(hint));
            }
        }
        Some(labels)
    }

    /// Reports a criterion over more answers than practice has.
    pub(super) fn reachable(
        &self,
        criterion: Option<&Criterion>,
        practice: &[ModelId],
        path: &str,
    ) {
        let Some(Criterion { of, rounds, .. }) = criterion else {
            return;
        };
        let trials = practice.len() * *rounds as usize;
        if !practice.is_empty() && (*of as usize) > trials {
            let what = format!(
                "`{path}.criterion` is never reached: practice has {trials} trials at most"
            );
            let fault = Fault::error(what).hint("raise rounds, or lower of");
            self.fault(path, "criterion", fault);
        }
    }

    pub(super) fn presentations(&self, raw: &Presentations, path: &str) -> Option<Presentations> {
        self.models(&raw.models, &format!("{path}.models"));
        self.practice(raw, path);
        let models = match raw.models.is_empty() {
            true => self.default_models(true),
            false => raw.models.clone(),
        };
        if models.is_empty() {
            let fault =
                Fault::error("nothing to present: no [[models]] whose role is not practice");
            self.fault(
                path,
                "id",
                fault.hint("add [[models]] with an id and a file"),
            );
            return None;
        }
        Some(Presentations {
            models,
            ..raw.clone()
        })
    }

    /// What a part of similarity compares. Fewer than two realizations, and pairs that do not connect all of them, are
    /// reported.
    pub(super) fn similarity(
        &self,
        raw: &RawSimilarity,
        families: Option<&[FamilyRules]>,
        path: &str,
    ) -> Option<Similarity> {
        let different = match &raw.family {
            Some((family, levels)) => {
                let family = self.family(family, families?, path)?;
                every(&self.levels(family, levels.as_deref(), path)?)
            }
            None => self.pairs(raw.models.as_deref(), &raw.pairs, path)?,
        };
        if different.is_empty() {
            let fault = Fault::error("a pair needs two levels");
            self.fault(
                path,
                "levels",
                fault.hint("name two of the ladder, or more"),
            );
            return None;
        }
        let mut models: Vec<ModelId> = Vec::new();
        for model in different.iter().flatten() {
            if !models.contains(model) {
                models.push(model.clone());
            }
        }
        if let Some([one, other]) = unconnected(&models, &different) {
            let what =
                format!("no pairs connect `{one}` and `{other}`: they have no place in one map");
            let hint = "add pairs, so that every realization can be reached from every other one";
            self.fault(path, "pairs", Fault::error(what).hint(hint));
        }
        Some(Similarity {
            models,
            different,
            order: raw.order.clone(),
            repetitions: raw.repetitions,
            identical: raw.identical,
            practice: raw.practice,
        })
    }

    /// What a part of ranking presents. Fewer than two realizations, and too many to remember, are reported.
    pub(super) fn ranking(
        &self,
        raw: &RawRanking,
        families: Option<&[FamilyRules]>,
        path: &str,
    ) -> Option<Ranking> {
        let (key, models) = match &raw.felt {
            RawSet::Models(models) => {
                self.models(models, &format!("{path}.models"));
                ("models", models.clone())
            }
            RawSet::Levels(family, levels) => {
                let family = self.family(family, families?, path)?;
                (
                    "levels",
                    self.levels(family, Some(levels.as_slice()), path)?,
                )
            }
        };
        let n = models.len();
        if !(2..=MOST_RANKED).contains(&n) {
            let what = format!("a ranking has 2 to {MOST_RANKED} realizations, not {n}");
            let hint = "a part of kind \"pairs\" compares more of them, two at a time";
            self.fault(path, key, Fault::error(what).hint(hint));
            return None;
        }
        Some(Ranking {
            models,
            order: raw.order.clone(),
            repetitions: raw.repetitions,
            ties: raw.ties,
            practice: raw.practice,
        })
    }

    /// What a part of adjustment sets. Starts that are not on both sides, and steps above the just noticeable difference, are
    /// reported.
    pub(super) fn adjustment(
        &self,
        raw: &RawAdjustment,
        families: &[FamilyRules],
        path: &str,
    ) -> Option<Adjustment> {
        let family = self.family(&raw.family, families, path)?;
        let standard = match (&raw.reference, raw.standard) {
            (Some(model), _) => {
                self.model(model, &format!("{path}.reference"));
                Some(model.clone())
            }
            (None, Some(level)) => Some(self.level(family, level, (path, "standard"))?),
            (None, None) => None,
        };
        let models: Vec<ModelId> = family.realizations().map(|(id, _)| id).collect();
        let quarter = (models.len() / 4).max(1);
        let starts = |levels: &Option<Vec<f64>>, key: &str, own: &[ModelId]| match levels {
            Some(levels) => {
                let level = |level: &f64| self.level(family, *level, (path, key));
                levels.iter().map(level).collect::<Option<Vec<ModelId>>>()
            }
            None => Some(own.to_vec()),
        };
        let below = starts(&raw.below, "start_below", &models[..quarter])?;
        let above = starts(&raw.above, "start_above", &models[models.len() - quarter..])?;
        let level = |id: &ModelId| family.level_of(id);
        let highest = below
            .iter()
            .filter_map(level)
            .fold(f64::NEG_INFINITY, f64::max);
        let lowest = above.iter().filter_map(level).fold(f64::INFINITY, f64::min);
        let between = match raw.standard {
            Some(standard) => highest < standard && standard < lowest,
            None => highest < lowest,
        };
        if !between {
            let what = match raw.standard {
                Some(standard) => format!(
                    "the standard {standard} is not between the starts: those below reach {highest}, and those above begin at {lowest}"
                ),
                None => format!(
                    "the starts below reach {highest}, and those above begin at {lowest}: nothing lies between them"
                ),
            };
            let hint = "such as start_below = [0.5] and start_above = [2.0], or take a family with more levels";
            self.fault(path, "start_below", Fault::error(what).hint(hint));
        }
        if let Some(jnd) = raw.jnd {
            let steps = family.ladder.levels().windows(2).map(|two| two[1] - two[0]);
            let widest = steps.fold(0.0, f64::max);
            if widest > jnd * (1.0 + 1e-9) {
                let what = format!(
                    "a step of the ladder of `{}` is {}, more than the just noticeable difference {jnd}",
                    family.id,
                    (1e6 * widest).round() / 1e6
                );
                let hint = "give the family more levels: each change has to be one that can hardly be felt";
                self.fault(path, "jnd", Fault::error(what).hint(hint));
            }
        }
        Some(Adjustment {
            family: family.id.clone(),
            models,
            standard,
            below,
            above,
            repetitions: raw.repetitions,
            practice: raw.practice,
            jnd: raw.jnd,
            words: raw.words.clone(),
        })
    }

    pub(super) fn pairs(
        &self,
        models: Option<&[ModelId]>,
        pairs: &RawPairs,
        path: &str,
    ) -> Option<Vec<[ModelId; 2]>> {
        let place = format!("{path}.pairs");
        if let RawPairs::List(list) = pairs {
            if models.is_some() {
                let what = format!("`{path}` has `models` and a list of pairs");
                self.fault(
                    path,
                    "models",
                    Fault::error(what).hint("leave `models` out"),
                );
            }
            for (i, pair) in list.iter().enumerate() {
                self.models(pair, &format!("{place}[{i}]"));
                let [a, b] = pair;
                let same = |other: &[ModelId; 2]| other.contains(a) && other.contains(b);
                if list[..i].iter().any(same) {
                    let fault = Fault::error(format!("the pair of `{a}` and `{b}` is there twice"));
                    self.fault_at(&format!("{place}[{i}]"), fault);
                }
            }
            return Some(list.clone());
        }
        let models = match models {
            Some(models) => {
                self.models(models, &format!("{path}.models"));
                models.to_vec()
            }
            None => self.default_models(false),
        };
        if models.len() < 2 {
            let fault = Fault::error("a pair needs two realizations");
            self.fault(
                path,
                "models",
                fault.hint("add [[models]] with an id and a file"),
            );
            return None;
        }
        Some(match pairs {
            RawPairs::All => every(&models),
            RawPairs::Adjacent => neighbors(&models),
            RawPairs::Versus(one) => {
                if !models.contains(one) {
                    let known = models.iter().map(ModelId::as_str);
                    self.fault_at(&place, unknown("model", one.as_str(), known));
                }
                let others = models.iter().filter(|m| *m != one);
                others.map(|m| [one.clone(), m.clone()]).collect()
            }
            RawPairs::List(list) => list.clone(),
        })
    }
}
