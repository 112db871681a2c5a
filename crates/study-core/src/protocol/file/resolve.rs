//! From parts, families and tracks as they were read to those of a protocol: ids are
//! looked up, and defaults that depend on other sections are filled in.

use super::Named;
use super::agree::{Sections, at, collision, unknown};
use super::families::PartialFamily;
use super::parts::{RawPairs, RawPart, RawTask};
use super::questions::PartialQuestion;
use super::tracks::{RawRule, RawTrack};
use crate::procedure::{Constant, Function, Ladder, Parameter, QuestPlus, Rule, Staircase, Track};
use crate::protocol::{
    Compared, DeviceKind, FamilyRules, Method, Pairs, Part, Presentations, Role, Task, TrackRules,
};
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::Document;
use study_base::rng::Stream;
use study_base::text::{ModelId, PartId, QuestionId};

/// The answers to a pair.
const FIRST_OR_SECOND: [&str; 3] = ["first", "second", "tie"];

/// Parts, families and tracks as they were read.
#[derive(Debug)]
pub(super) struct Raw {
    pub(super) parts: Vec<RawPart>,
    pub(super) families: Vec<PartialFamily>,
    pub(super) tracks: Vec<RawTrack>,
}

/// The same without faults; each `None` if it has one.
#[derive(Debug)]
pub(super) struct Resolved {
    pub(super) parts: Option<Vec<Part>>,
    pub(super) families: Option<Vec<FamilyRules>>,
    pub(super) tracks: Option<Vec<TrackRules>>,
}

/// What is looked up while a part or track is resolved.
struct Looked<'a> {
    sections: &'a Sections<'a>,
    document: &'a Document<'a>,
}

impl Raw {
    /// The files that families name.
    pub(super) fn files(&self) -> Vec<Named> {
        let of = |family: &PartialFamily| {
            let named = family.files.iter().map(|(key, file)| Named {
                place: format!("{}.{key}", family.path),
                file: file.clone(),
                orders: false,
            });
            named.collect::<Vec<_>>()
        };
        self.families.iter().flat_map(of).collect()
    }

    /// The questions with which trials of pairs and of discrimination begin.
    pub(super) fn questions(&self) -> Vec<PartialQuestion> {
        let question = |part: &RawPart| {
            let id = part.id.as_ref()?.as_str();
            match part.task.as_ref()? {
                RawTask::Rating { .. } => None,
                RawTask::Pairs { prompt, tie, .. } => {
                    let options = &FIRST_OR_SECOND[..if *tie { 3 } else { 2 }];
                    Some(PartialQuestion::of_part(&part.path, id, prompt, options))
                }
                RawTask::Discrimination { prompt, tracks, .. } => {
                    let first = self.track(tracks.first()?)?;
                    let options = first.method?.answers();
                    Some(PartialQuestion::of_part(&part.path, id, prompt, options))
                }
            }
        };
        self.parts.iter().filter_map(question).collect()
    }

    fn track(&self, id: &PartId) -> Option<&RawTrack> {
        self.tracks.iter().find(|t| t.id.as_ref() == Some(id))
    }

    /// Looks up every id. Ids are not reported while the syntax of the file is `broken`.
    pub(super) fn resolve(
        &self,
        sections: &Sections<'_>,
        document: &Document<'_>,
        broken: bool,
    ) -> Resolved {
        if broken {
            return Resolved {
                parts: None,
                families: None,
                tracks: None,
            };
        }
        self.ids(sections, document);
        self.unused(document);
        let looked = Looked { sections, document };
        let families: Option<Vec<FamilyRules>> =
            self.families.iter().map(|f| f.family.clone()).collect();
        let known = families.as_deref();
        let tracks = self.tracks.iter().map(|t| looked.track(t, known)).collect();
        let parts = self.parts.iter().map(|p| self.part(p, &looked)).collect();
        Resolved {
            parts,
            families,
            tracks,
        }
    }

    /// Reports ids that are there twice, and names of levels that models have.
    fn ids(&self, sections: &Sections<'_>, document: &Document<'_>) {
        let parts = self.parts.iter().map(|p| (p.id.clone(), p.path.as_str()));
        let families = (self.families.iter())
            .map(|f| (f.family.as_ref().map(|f| f.id.clone()), f.path.as_str()));
        let tracks = self.tracks.iter().map(|t| (t.id.clone(), t.path.as_str()));
        for list in [
            parts.collect::<Vec<_>>(),
            families.collect(),
            tracks.collect(),
        ] {
            for (i, (id, path)) in list.iter().enumerate() {
                let Some(id) = id else { continue };
                let earlier = list[..i].iter().filter_map(|(id, _)| id.as_ref());
                let mut twice = earlier.filter(|other| other.collides_with(id));
                if let Some(other) = twice.next() {
                    let fault = collision(id.as_str(), other.as_str());
                    document.fault(fault.at(at(document, path, "id")));
                }
                for model in &sections.models {
                    let name = model.id.as_ref().map_or("", ModelId::as_str);
                    let level = name.strip_prefix(id.as_str());
                    if level.is_some_and(|rest| rest.starts_with('.')) {
                        let what = format!("`{name}` could be a level of `{id}`");
                        let fault = Fault::error(what).label("choose another name");
                        document.fault(fault.at(at(document, &model.path, "id")));
                    }
                }
            }
        }
    }

    /// Reports tracks and families that no part uses.
    fn unused(&self, document: &Document<'_>) {
        let named = |part: &RawPart| match &part.task {
            Some(RawTask::Discrimination { tracks, .. }) => tracks.clone(),
            _ => Vec::new(),
        };
        let used: Vec<PartId> = self.parts.iter().flat_map(named).collect();
        for track in &self.tracks {
            let Some(id) = &track.id else { continue };
            if !used.contains(id) {
                let what = format!("no part of kind \"discrimination\" has the track `{id}`");
                document.fault(Fault::error(what).at(at(document, &track.path, "id")));
            }
        }
        for family in &self.families {
            let Some(id) = family.family.as_ref().map(|f| &f.id) else {
                continue;
            };
            let of = |t: &RawTrack| matches!(&t.compared, Some(Compared::Levels { family, .. }) if family == id);
            if !self.tracks.iter().any(of) {
                let fault = Fault::warning(format!("no track has the family `{id}`"));
                document.fault(fault.at(at(document, &family.path, "id")));
            }
        }
    }

    fn part(&self, raw: &RawPart, looked: &Looked<'_>) -> Option<Part> {
        let path = &raw.path;
        let (id, exposure) = (raw.id.clone()?, raw.exposure?);
        let exposure = exposure.unwrap_or(looked.sections.exposure);
        let mut asks = Vec::new();
        let (task, gap_s) = match raw.task.as_ref()? {
            RawTask::Rating { presentations } => {
                asks.extend(self.asked(raw, &looked.sections.questions));
                if asks.is_empty() {
                    let fault = Fault::error(format!("nothing to ask in the part `{id}`"));
                    let hint = "add [[questions]] with an id, a prompt and a kind";
                    looked.fault(path, "id", fault.hint(hint));
                }
                (
                    Task::Rating(looked.presentations(presentations, path)?),
                    0.0,
                )
            }
            RawTask::Pairs {
                models,
                pairs,
                repetitions,
                order,
                tie,
                interval_order,
                gap_s,
                ..
            } => {
                asks.push(QuestionId::new(id.as_str()).ok()?);
                let task = Pairs {
                    pairs: looked.pairs(models.as_deref(), pairs, path)?,
                    order: order.clone(),
                    repetitions: *repetitions,
                    tie: *tie,
                    interval_order: *interval_order,
                };
                (Task::Pairs(task), *gap_s)
            }
            RawTask::Discrimination { tracks, gap_s, .. } => {
                asks.push(QuestionId::new(id.as_str()).ok()?);
                self.tracks_of(tracks, path, looked)?;
                let tracks = tracks.clone();
                (Task::Discrimination { tracks }, *gap_s)
            }
        };
        if !matches!(task, Task::Rating(_)) {
            asks.extend(raw.questions.clone().unwrap_or_default());
        }
        for (i, question) in raw.questions.iter().flatten().enumerate() {
            looked.question(question, &format!("{path}.questions[{i}]"));
        }
        Some(Part {
            id,
            task,
            text: raw.text.clone(),
            asks,
            exposure,
            gap_s,
        })
    }

    /// The questions of a rating part: those that it names, or all that no other part
    /// does.
    fn asked(&self, raw: &RawPart, questions: &[PartialQuestion]) -> Vec<QuestionId> {
        if let Some(named) = &raw.questions {
            return named.clone();
        }
        let elsewhere = |id: &QuestionId| {
            let mut named = self.parts.iter().flat_map(|p| p.questions.iter().flatten());
            let of_part = |p: &RawPart| p.id.as_ref().is_some_and(|p| p.as_str() == id.as_str());
            named.any(|n| n == id) || self.parts.iter().any(of_part)
        };
        let ids = questions.iter().filter_map(|q| q.id.clone());
        ids.filter(|id| !elsewhere(id)).collect()
    }

    /// Checks the tracks of a part.
    fn tracks_of(&self, tracks: &[PartId], path: &str, looked: &Looked<'_>) -> Option<()> {
        let mut method: Option<Method> = None;
        if tracks.is_empty() {
            looked.fault(
                path,
                "tracks",
                Fault::error(format!("`{path}.tracks` is empty")),
            );
        }
        for (i, id) in tracks.iter().enumerate() {
            let place = format!("{path}.tracks[{i}]");
            let Some(track) = self.track(id) else {
                let known = self.tracks.iter().filter_map(|t| t.id.as_ref());
                let fault = unknown("track", id.as_str(), known.map(PartId::as_str));
                looked.fault_at(&place, fault);
                continue;
            };
            let holds = |p: &&RawPart| matches!(&p.task, Some(RawTask::Discrimination { tracks, .. }) if tracks.contains(id));
            let again = tracks[..i].contains(id) || self.parts.iter().filter(holds).count() > 1;
            if again {
                let fault = Fault::error(format!("the track `{id}` is there twice"));
                looked.fault_at(&place, fault);
            }
            if let (Some(first), Some(other)) = (method, track.method)
                && first != other
            {
                let fault = Fault::error(format!(
                    "the tracks of a part have one method, not {} and {}",
                    first.as_str(),
                    other.as_str()
                ));
                looked.fault_at(&place, fault.hint("make a part of each"));
            }
            method = method.or(track.method);
        }
        (!tracks.is_empty()).then_some(())
    }
}

impl Looked<'_> {
    fn fault(&self, path: &str, key: &str, fault: Fault) {
        self.document.fault(fault.at(at(self.document, path, key)));
    }

    fn fault_at(&self, path: &str, fault: Fault) {
        self.document.fault(fault.at(self.document.span_of(path)));
    }

    /// Reports an id that no model has; returns whether one has it.
    fn model(&self, id: &ModelId, place: &str) -> bool {
        let known = || self.sections.models.iter().filter_map(|m| m.id.as_ref());
        let found = known().any(|k| k == id);
        if !found {
            let fault = unknown("model", id.as_str(), known().map(ModelId::as_str));
            self.fault_at(place, fault);
        }
        found
    }

    /// Reports ids that no model has, and those that are there twice.
    fn models(&self, ids: &[ModelId], place: &str) {
        for (i, id) in ids.iter().enumerate() {
            let place = format!("{place}[{i}]");
            if self.model(id, &place) && ids[..i].contains(id) {
                self.fault_at(&place, Fault::error(format!("`{id}` is there twice")));
            }
        }
    }

    fn question(&self, id: &QuestionId, place: &str) {
        let known = || self.sections.questions.iter().filter_map(|q| q.id.as_ref());
        if !known().any(|k| k == id) {
            let fault = unknown("question", id.as_str(), known().map(QuestionId::as_str));
            self.fault_at(place, fault);
        }
    }

    /// The models that a part presents if it names none.
    fn default_models(&self, duplicates: bool) -> Vec<ModelId> {
        let models = self.sections.models.iter();
        models
            .filter(|m| m.role != Role::Practice && (duplicates || m.duplicate_of.is_none()))
            .filter_map(|m| m.id.clone())
            .collect()
    }

    fn presentations(&self, raw: &Presentations, path: &str) -> Option<Presentations> {
        self.models(&raw.models, &format!("{path}.models"));
        for (i, id) in raw.practice.iter().enumerate() {
            self.model(id, &format!("{path}.practice[{i}]"));
        }
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

    fn pairs(
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
            RawPairs::All => {
                let from = |i: usize| models[i + 1..].iter().map(move |b| (i, b));
                let all = (0..models.len()).flat_map(from);
                all.map(|(i, b)| [models[i].clone(), b.clone()]).collect()
            }
            RawPairs::Adjacent => (models.windows(2))
                .map(|w| [w[0].clone(), w[1].clone()])
                .collect(),
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

    /// `families`: `None` if one of them has a fault of its own.
    fn track(&self, raw: &RawTrack, families: Option<&[FamilyRules]>) -> Option<TrackRules> {
        let path = &raw.path;
        let (id, method) = (raw.id.clone()?, raw.method?);
        let compared = raw.compared.clone()?;
        let ladder = match &compared {
            Compared::Models { models } => {
                self.models(models, &format!("{path}.models"));
                Ladder::new(vec![1.0]).ok()?
            }
            Compared::Levels { family, .. } => {
                if self
                    .sections
                    .device
                    .is_some_and(|d| d.kind == DeviceKind::Manual)
                {
                    let fault = Fault::error("a sample mounted by hand has no levels");
                    self.fault(path, "family", fault.hint("compare two `models`"));
                }
                let families = families?;
                let Some(family) = families.iter().find(|f| f.id == *family) else {
                    let known = families.iter().map(|f| f.id.as_str());
                    self.fault(path, "family", unknown("family", family.as_str(), known));
                    return None;
                };
                family.ladder.clone()
            }
        };
        let rule = self.rule(raw.rule.clone()?, method, &compared, &ladder);
        if let Err(why) = Track::new(&rule, &ladder, &mut Stream::new(0, &["check"])) {
            self.fault(path, "procedure", Fault::error(why.to_string()));
            return None;
        }
        let catch = raw.catch.unwrap_or(match method {
            Method::YesNo => 0.2,
            Method::SameDifferent => 0.5,
            _ => 0.0,
        });
        Some(TrackRules {
            id,
            method,
            compared,
            rule,
            feedback: raw.feedback,
            catch,
            easy: raw.easy,
        })
    }

    /// The rule with its defaults.
    fn rule(&self, raw: RawRule, method: Method, compared: &Compared, ladder: &Ladder) -> Rule {
        match raw {
            RawRule::Staircase(rule) => {
                let standard = match compared {
                    Compared::Levels { standard, .. } => Some(*standard),
                    Compared::Models { .. } => None,
                };
                // Below the standard a smaller level is easier, not harder.
                let min_level = standard.filter(|s| *s > ladder.first());
                Rule::Staircase(Staircase { min_level, ..rule })
            }
            RawRule::Constant {
                levels,
                repetitions,
            } => Rule::Constant(Constant {
                levels: levels.unwrap_or_else(|| ladder.levels().to_vec()),
                repetitions,
            }),
            RawRule::QuestPlus {
                rule,
                threshold,
                slope,
                guess,
                lapse,
            } => {
                if !rule.parameters.is_empty() {
                    return Rule::QuestPlus(rule);
                }
                let grids = Grids {
                    threshold,
                    slope,
                    guess,
                    lapse,
                };
                let parameters = grids.parameters(&rule.function, method, ladder);
                Rule::QuestPlus(QuestPlus { parameters, ..rule })
            }
        }
    }
}

/// The grids of a QUEST+ track.
struct Grids {
    threshold: Option<Vec<f64>>,
    slope: Option<Vec<f64>>,
    guess: Option<Vec<f64>>,
    lapse: Vec<f64>,
}

impl Grids {
    /// The parameters of a named function.
    fn parameters(self, function: &Function, method: Method, ladder: &Ladder) -> Vec<Parameter> {
        let span = ladder.last() - ladder.first();
        let linear = *function == Function::Weibull;
        let threshold = self.threshold.unwrap_or_else(|| {
            let levels = ladder.levels().iter().copied();
            levels.filter(|level| !linear || *level > 0.0).collect()
        });
        let (location, width, slopes) = match function {
            Function::Normal | Function::NormalSymmetric => {
                let parts = [0.5, 0.3, 0.2, 0.12, 0.07, 0.04];
                ("mean", "sd", parts.map(|part| part * span))
            }
            Function::Logistic => {
                let steps = [2.0, 4.0, 7.0, 12.0, 20.0, 35.0];
                ("threshold", "slope", steps.map(|step| step / span))
            }
            _ => ("threshold", "slope", [0.8, 1.3, 2.0, 3.0, 5.0, 8.0]),
        };
        let guess = self.guess.unwrap_or_else(|| match method.guess_rate() {
            Some(rate) => vec![rate],
            None => vec![0.02, 0.08, 0.16, 0.3],
        });
        let mut parameters = vec![
            Parameter::new(location, threshold),
            Parameter::new(width, self.slope.unwrap_or_else(|| slopes.to_vec())),
        ];
        if *function != Function::NormalSymmetric {
            parameters.push(Parameter::new("gamma", guess));
        }
        parameters.push(Parameter::new("lambda", self.lapse));
        parameters
    }
}
