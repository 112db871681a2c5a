//! From parts, families and tracks as they were read to those of a protocol: ids are
//! looked up, and defaults that depend on other sections are filled in.

use super::agree::{Sections, at, collision, unknown};
use super::families::PartialFamily;
use super::looked::Looked;
use super::pairs::RawPairs;
use super::parts::{RawPart, RawTask};
use super::questions::PartialQuestion;
use super::spaces::PartialSpace;
use super::standard::RawStandard;
use super::tracks::RawTrack;
use super::{Content, Named};
use crate::protocol::ranking::question;
use crate::protocol::{
    Compared, FamilyRules, Identification, Magnitude, Method, Mushra, OrderVersion, Pairs, Part,
    Presentations, QuestionKind, SearchTask, SpaceRules, Standard, Task, TrackRules, kinds,
};
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::Document;
use study_base::text::{ModelId, PartId, QuestionId};

/// The answers to a pair.
const FIRST_OR_SECOND: [&str; 3] = ["first", "second", "tie"];

fn one_of(options: &[&str]) -> QuestionKind {
    QuestionKind::Choice(kinds::Choice {
        options: options.iter().map(|o| (*o).to_owned()).collect(),
        multiple: false,
    })
}

/// Parts, families and tracks as they were read.
#[derive(Debug)]
pub(super) struct Raw {
    pub(super) parts: Vec<RawPart>,
    pub(super) families: Vec<PartialFamily>,
    pub(super) spaces: Vec<PartialSpace>,
    pub(super) tracks: Vec<RawTrack>,
}

/// The same without faults; each `None` if it has one.
#[derive(Debug)]
pub(super) struct Resolved {
    pub(super) parts: Option<Vec<Part>>,
    pub(super) families: Option<Vec<FamilyRules>>,
    pub(super) spaces: Option<Vec<SpaceRules>>,
    pub(super) tracks: Option<Vec<TrackRules>>,
}

impl Raw {
    /// The files that families and spaces name.
    pub(super) fn files(&self) -> Vec<Named> {
        let of = |family: &PartialFamily| {
            let named = family.files.iter().map(|(key, file)| Named {
                place: format!("{}.{key}", family.path),
                file: file.clone(),
                content: Content::Model,
            });
            named.collect::<Vec<_>>()
        };
        let spaces = self.spaces.iter().filter_map(|space| {
            Some(Named {
                place: format!("{}.from", space.path),
                file: space.file.clone()?,
                content: Content::Model,
            })
        });
        self.families.iter().flat_map(of).chain(spaces).collect()
    }

    /// The questions with which the trials of a part begin, by part: one, but of a ranking one for each interval. Rating parts have
    /// none.
    pub(super) fn questions(&self) -> Vec<Vec<PartialQuestion>> {
        let question = |part: &RawPart| {
            let id = part.id.as_ref()?.as_str();
            match part.task.as_ref()? {
                RawTask::Rating { .. } => None,
                RawTask::Magnitude { prompt, .. } => {
                    let positive = QuestionKind::Number(kinds::Number {
                        unit: None,
                        min: None,
                        max: None,
                        above: Some(0.0),
                    });
                    Some(PartialQuestion::made(&part.path, id, prompt, positive))
                }
                RawTask::Mushra { prompt, labels, .. } => {
                    let scale = QuestionKind::Slider(kinds::Slider {
                        from: 0.0,
                        to: 100.0,
                        step: 1.0,
                        labels: labels.clone(),
                    });
                    Some(PartialQuestion::made(&part.path, id, prompt, scale))
                }
                RawTask::Identification { prompt, labels, .. } => {
                    let labels: Vec<&str> = labels.iter().map(|l| l.text.as_str()).collect();
                    let choice = one_of(&labels);
                    Some(PartialQuestion::made(&part.path, id, prompt, choice))
                }
                RawTask::Pairs { prompt, tie, .. } => {
                    let options = &FIRST_OR_SECOND[..if *tie { 3 } else { 2 }];
                    Some(PartialQuestion::made(
                        &part.path,
                        id,
                        prompt,
                        one_of(options),
                    ))
                }
                RawTask::Similarity(own) => {
                    let [same, different] = own.ends.clone();
                    let scale = QuestionKind::Slider(kinds::Slider {
                        from: 0.0,
                        to: 100.0,
                        step: 1.0,
                        labels: [("0".to_owned(), same), ("100".to_owned(), different)].into(),
                    });
                    Some(PartialQuestion::made(&part.path, id, &own.prompt, scale))
                }
                // It has several.
                RawTask::Ranking(_) => None,
                // The level that was set.
                RawTask::Adjustment(own) => {
                    let number = QuestionKind::Number(kinds::Number {
                        unit: None,
                        min: None,
                        max: None,
                        above: None,
                    });
                    Some(PartialQuestion::made(&part.path, id, &own.prompt, number))
                }
                RawTask::Search { prompt, .. } => Some(PartialQuestion::made(
                    &part.path,
                    id,
                    prompt,
                    one_of(&FIRST_OR_SECOND[..2]),
                )),
                RawTask::Discrimination { prompt, tracks, .. } => {
                    let first = self.track(tracks.first()?)?;
                    let options = first.method?.answers();
                    Some(PartialQuestion::made(
                        &part.path,
                        id,
                        prompt,
                        one_of(options),
                    ))
                }
            }
        };
        let of_part = |part: &RawPart| match (&part.task, &part.id) {
            (Some(RawTask::Ranking(own)), Some(id)) => Some(own.questions(&part.path, id)),
            _ => question(part).map(|own| vec![own]),
        };
        self.parts.iter().filter_map(of_part).collect()
    }

    /// Parts without an answer of their own.
    pub(super) fn rating_parts(&self) -> usize {
        let rated = |part: &&RawPart| matches!(part.task, Some(RawTask::Rating { .. }));
        self.parts.iter().filter(rated).count()
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
                spaces: None,
                tracks: None,
            };
        }
        self.ids(sections, document);
        self.unused(document);
        let looked = Looked { sections, document };
        let families: Option<Vec<FamilyRules>> =
            self.families.iter().map(|f| f.family.clone()).collect();
        let known = families.as_deref();
        let tracks: Option<Vec<TrackRules>> =
            self.tracks.iter().map(|t| looked.track(t, known)).collect();
        self.conditions(tracks.as_deref().unwrap_or_default(), &looked);
        let parts = self.parts.iter().map(|p| self.part(p, known, &looked));
        let parts = parts.collect();
        let spaces = self.spaces.iter().map(|s| s.space.clone()).collect();
        Resolved {
            parts,
            families,
            spaces,
            tracks,
        }
    }

    /// Reports tracks that cannot measure one condition.
    fn conditions(&self, tracks: &[TrackRules], looked: &Looked<'_>) {
        for (i, (track, raw)) in tracks.iter().zip(&self.tracks).enumerate() {
            let Some(condition) = &track.measures else {
                continue;
            };
            let fault = |what: String, hint: &str| {
                looked.fault(&raw.path, "condition", Fault::error(what).hint(hint));
            };
            if track.family().is_none() {
                let what = format!("the track `{}` compares two models", track.id);
                fault(
                    what,
                    "leave `condition` out; more trials of one track say the same",
                );
            }
            let others = tracks[..i].iter();
            let mut alike = others.filter(|other| other.condition() == condition);
            if let Some((other, what)) = alike.find_map(|o| Some((o, track.differs_in(o)?))) {
                let what = format!(
                    "the tracks `{}` and `{}` measure the condition `{condition}`, and differ in {what}",
                    other.id, track.id
                );
                fault(what, "what differs is a condition of its own");
            }
            let named =
                |other: &&TrackRules| other.id == *condition && other.condition() != condition;
            if tracks.iter().any(|other| named(&other)) {
                let what = format!("`{condition}` is a track of another condition");
                fault(what, "choose another name");
            }
        }
    }

    /// Reports ids that are there twice, and names of levels that models have.
    fn ids(&self, sections: &Sections<'_>, document: &Document<'_>) {
        let parts = self.parts.iter().map(|p| (p.id.clone(), p.path.as_str()));
        let families = (self.families.iter())
            .map(|f| (f.family.as_ref().map(|f| f.id.clone()), f.path.as_str()));
        // Levels of both have the same kind of names.
        let spaces =
            (self.spaces.iter()).map(|s| (s.space.as_ref().map(|s| s.id.clone()), s.path.as_str()));
        let tracks = self.tracks.iter().map(|t| (t.id.clone(), t.path.as_str()));
        for list in [
            parts.collect::<Vec<_>>(),
            families.chain(spaces).collect(),
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

    /// Reports tracks, families and spaces that no part uses.
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
            let felt = |p: &RawPart| match &p.task {
                Some(RawTask::Magnitude {
                    family: Some((family, _)),
                    ..
                }) => family == id,
                Some(RawTask::Identification { family, .. }) => family.as_ref() == Some(id),
                Some(RawTask::Similarity(own)) => {
                    own.family.as_ref().is_some_and(|own| own.0 == *id)
                }
                Some(RawTask::Ranking(own)) => own.felt.is_of(id),
                Some(RawTask::Adjustment(own)) => own.family == *id,
                _ => false,
            };
            if !self.tracks.iter().any(of) && !self.parts.iter().any(felt) {
                let fault = Fault::warning(format!("no track and no part has the family `{id}`"));
                document.fault(fault.at(at(document, &family.path, "id")));
            }
        }
        for space in &self.spaces {
            let Some(id) = space.space.as_ref().map(|s| &s.id) else {
                continue;
            };
            let searched =
                |p: &RawPart| matches!(&p.task, Some(RawTask::Search { space, .. }) if space == id);
            if !self.parts.iter().any(searched) {
                let fault = Fault::warning(format!("no part searches in the space `{id}`"));
                document.fault(fault.at(at(document, &space.path, "id")));
            }
        }
    }

    /// `families`: `None` if one of them has a fault of its own.
    fn part(
        &self,
        raw: &RawPart,
        families: Option<&[FamilyRules]>,
        looked: &Looked<'_>,
    ) -> Option<Part> {
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
            RawTask::Magnitude {
                family,
                standard,
                presentations,
                gap_s,
                ..
            } => {
                asks.push(QuestionId::new(id.as_str()).ok()?);
                let standard = match (standard, family) {
                    (None, _) => None,
                    (Some(RawStandard::Level(level, modulus)), Some((family, _))) => {
                        let family = looked.family(family, families?, path)?;
                        let model = looked.level(family, *level, (path, "standard"))?;
                        let modulus = *modulus;
                        Some(Standard { model, modulus })
                    }
                    (Some(RawStandard::Model(model, modulus)), _) => {
                        looked.model(model, &format!("{path}.reference"));
                        let (model, modulus) = (model.clone(), *modulus);
                        Some(Standard { model, modulus })
                    }
                    (Some(RawStandard::Level(..)), None) => return None,
                };
                let presentations = match family {
                    None => looked.presentations(presentations, path)?,
                    Some((family, levels)) => {
                        let family = looked.family(family, families?, path)?;
                        looked.practice(presentations, path);
                        Presentations {
                            models: looked.levels(family, levels.as_deref(), path)?,
                            ..presentations.clone()
                        }
                    }
                };
                let gap_s = if standard.is_some() { *gap_s } else { 0.0 };
                let task = Magnitude {
                    standard,
                    presentations,
                };
                (Task::Magnitude(task), gap_s)
            }
            RawTask::Mushra {
                reference,
                presentations,
                gap_s,
                ..
            } => {
                asks.push(QuestionId::new(id.as_str()).ok()?);
                if let Some(reference) = reference {
                    looked.model(reference, &format!("{path}.reference"));
                }
                let presentations = looked.presentations(presentations, path)?;
                looked.hidden_reference(&presentations, path);
                let task = Mushra {
                    reference: reference.clone(),
                    presentations,
                };
                let gap_s = if reference.is_some() { *gap_s } else { 0.0 };
                (Task::Mushra(task), gap_s)
            }
            RawTask::Identification {
                family,
                labels,
                feedback,
                criterion,
                presentations,
                ..
            } => {
                asks.push(QuestionId::new(id.as_str()).ok()?);
                let practice = &presentations.practice;
                let family = match family {
                    Some(family) => Some(looked.family(family, families?, path)?),
                    None => None,
                };
                let labels = looked.labels(labels, family, practice, path)?;
                looked.reachable(criterion.as_ref(), practice, path);
                let presentations = Presentations {
                    models: labels.iter().flat_map(|l| l.models.clone()).collect(),
                    ..presentations.clone()
                };
                let task = Identification {
                    labels,
                    feedback: *feedback,
                    criterion: *criterion,
                    presentations,
                };
                (Task::Identification(task), 0.0)
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
                    neighbors: matches!(pairs, RawPairs::Adjacent)
                        && looked.sections.design.is_some_and(|design| {
                            design.order_version == OrderVersion::Unguessable
                        }),
                };
                (Task::Pairs(task), *gap_s)
            }
            RawTask::Discrimination { tracks, gap_s, .. } => {
                asks.push(QuestionId::new(id.as_str()).ok()?);
                self.tracks_of(tracks, path, looked)?;
                let tracks = tracks.clone();
                (Task::Discrimination { tracks }, *gap_s)
            }
            RawTask::Search {
                space, rule, gap_s, ..
            } => {
                asks.push(QuestionId::new(id.as_str()).ok()?);
                looked.space(space, &self.spaces, path);
                let (space, rule) = (space.clone(), *rule);
                (Task::Search(SearchTask { space, rule }), *gap_s)
            }
            RawTask::Similarity(own) => {
                asks.push(QuestionId::new(id.as_str()).ok()?);
                (
                    Task::Similarity(looked.similarity(own, families, path)?),
                    own.gap_s,
                )
            }
            RawTask::Ranking(own) => {
                let ranking = looked.ranking(own, families, path)?;
                asks.extend((1..=ranking.models.len()).map(|interval| question(&id, interval)));
                (Task::Ranking(ranking), own.gap_s)
            }
            RawTask::Adjustment(own) => {
                asks.push(QuestionId::new(id.as_str()).ok()?);
                (
                    Task::Adjustment(looked.adjustment(own, families?, path)?),
                    own.gap_s,
                )
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
            named.any(|n| n == id) || self.parts.iter().any(|part| part.begins_with(id))
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
            if track.relative != self.track(&tracks[0]).and_then(|first| first.relative) {
                let what = "the tracks of a part count levels alike, all of them with the same \
                            `relative` or none";
                looked.fault_at(&place, Fault::error(what).hint("make a part of each"));
            }
        }
        (!tracks.is_empty()).then_some(())
    }
}
