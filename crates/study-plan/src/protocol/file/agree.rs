//! Consistency of the sections of a file: colliding ids, unknown ids, rules that the
//! device cannot fulfil.

use super::models::PartialModel;
use super::questions::PartialQuestion;
use super::{Content, Named};
use crate::protocol::columns::{
    is_participants_column, is_participants_column_of_parts, is_parts_column, is_ratings_column,
};
use crate::protocol::{
    AnalysisRules, Design, DeviceKind, DeviceRules, Exposure, Factor, Order, Role, Scale,
};
use study_base::diagnostic::table::Document;
use study_base::diagnostic::{Fault, did_you_mean};
use study_base::text::{ModelId, PartId, QuestionId, Untrusted};

/// The sections, as far as they could be read.
#[derive(Debug)]
pub(super) struct Sections<'a> {
    pub(super) design: Option<&'a Design>,
    pub(super) device: Option<&'a DeviceRules>,
    pub(super) minimum_strokes: u32,
    pub(super) exposure: Exposure,
    pub(super) models: Vec<PartialModel>,
    pub(super) factors: &'a [Factor],
    pub(super) questions: Vec<PartialQuestion>,
    pub(super) setup: Vec<PartialQuestion>,
    pub(super) intake: Vec<PartialQuestion>,
    pub(super) outro: Vec<PartialQuestion>,
    /// The items of the questionnaires between the trials.
    pub(super) between: Vec<PartialQuestion>,
    /// The ids of the questionnaires.
    pub(super) questionnaires: Vec<PartId>,
    pub(super) analysis: Option<&'a AnalysisRules>,
    /// Whether there are `[[parts]]`.
    pub(super) has_parts: bool,
    /// Whether the answer of one of them is unknown.
    pub(super) has_faulty_parts: bool,
}

impl Sections<'_> {
    /// The other files that the protocol names.
    pub(super) fn files(&self) -> Vec<Named> {
        let models = self.models.iter().filter_map(|model| {
            Some(Named {
                place: format!("{}.{}", model.path, model.key()),
                file: model.file.clone()?,
                content: model.content.clone(),
            })
        });
        let orders = match self.design.map(|design| &design.order) {
            Some(Order::File(file)) => Some(Named {
                place: "design.order.file".to_owned(),
                file: file.clone(),
                content: Content::Orders,
            }),
            _ => None,
        };
        models.chain(orders).collect()
    }

    /// Reports every inconsistency.
    pub(super) fn agree(&self, document: &Document<'_>) {
        self.presence(document);
        self.model_ids(document);
        self.duplicates(document);
        self.practice(document);
        self.devices(document);
        self.columns(document);
        self.analysis(document);
    }

    /// Gives hidden duplicates without a file that of their original.
    pub(super) fn fill_duplicates(&mut self) {
        for i in 0..self.models.len() {
            let model = &self.models[i];
            if model.has_file {
                continue;
            }
            let original = model.duplicate_of.as_ref().and_then(|id| self.model(id));
            if let Some(file) = original.and_then(|o| o.file.clone()) {
                self.models[i].file = Some(file);
            }
        }
    }

    fn model(&self, id: &ModelId) -> Option<&PartialModel> {
        self.models.iter().find(|m| m.id.as_ref() == Some(id))
    }

    fn model_ids_as_words(&self) -> impl Iterator<Item = &str> {
        self.models
            .iter()
            .filter_map(|m| m.id.as_ref())
            .map(ModelId::as_str)
    }

    /// Whether the study presents nothing and asks questionnaires.
    pub(super) fn only_asks(&self) -> bool {
        let presents = self.has_parts || !self.models.is_empty();
        !presents && self.questions.is_empty() && !self.questionnaires.is_empty()
    }

    fn presence(&self, document: &Document<'_>) {
        // What a part lacks is reported there.
        if self.has_parts || self.only_asks() {
            return;
        }
        if self.models.iter().all(|m| m.role == Role::Practice) {
            document.fault(
                Fault::error("nothing to present: no [[models]] whose role is not practice")
                    .hint("add [[models]] with an id and a file"),
            );
        }
        if self.questions.is_empty() {
            document.fault(
                Fault::error("nothing to ask: no [[questions]]")
                    .hint("add [[questions]] with an id, a prompt and a kind"),
            );
        }
    }

    fn model_ids(&self, document: &Document<'_>) {
        for (i, model) in self.models.iter().enumerate() {
            let Some(id) = &model.id else { continue };
            let mut earlier = self.models[..i].iter().filter_map(|m| m.id.as_ref());
            if let Some(other) = earlier.find(|other| other.collides_with(id)) {
                let place = at(document, &model.path, "id");
                document.fault(collision(id.as_str(), other.as_str()).at(place));
            }
        }
    }

    fn duplicates(&self, document: &Document<'_>) {
        for model in &self.models {
            let Some(of) = &model.duplicate_of else {
                continue;
            };
            let place = at(document, &model.path, "duplicate_of");
            if model.id.as_ref() == Some(of) {
                document.fault(
                    Fault::error(format!("`{of}` cannot be a duplicate of itself")).at(place),
                );
                continue;
            }
            let Some(original) = self.model(of) else {
                document.fault(unknown("model", of.as_str(), self.model_ids_as_words()).at(place));
                continue;
            };
            if let Some(first) = &original.duplicate_of {
                document.fault(
                    Fault::error(format!("`{of}` is itself a duplicate, of `{first}`"))
                        .at(place)
                        .label("name the original"),
                );
            } else if model.file.is_some() && original.file.is_some() && model.file != original.file
            {
                document.fault(
                    Fault::error(format!("a duplicate of `{of}` has to have the same file"))
                        .at(at(document, &model.path, model.key()))
                        .hint(format!("leave `{}` out", model.key())),
                );
            } else if (model.role == Role::Practice) != (original.role == Role::Practice) {
                document.fault(
                    Fault::error(format!(
                        "a duplicate and its original, `{of}`, have to be both for practice or both not"
                    ))
                    .at(place),
                );
            }
        }
    }

    fn practice(&self, document: &Document<'_>) {
        let Some(design) = self.design else { return };
        for (i, id) in design.practice.iter().enumerate() {
            if self.model(id).is_none() {
                document.fault(
                    unknown("model", id.as_str(), self.model_ids_as_words())
                        .at(document.span_of(&format!("design.practice[{i}]"))),
                );
            }
        }
    }

    fn devices(&self, document: &Document<'_>) {
        let Some(device) = self.device else { return };
        let mut by_hand = None;
        let mut by_process = device.kind == DeviceKind::Process;
        for model in &self.models {
            let kind = model.device.unwrap_or(device.kind);
            let name = model.id.as_ref().map_or("?", ModelId::as_str);
            match kind {
                DeviceKind::Manual => by_hand = by_hand.or(Some(name)),
                DeviceKind::Process => by_process = true,
                DeviceKind::Simulated | DeviceKind::Serial => {
                    if !model.has_file && model.duplicate_of.is_none() && model.id.is_some() {
                        document.fault(
                            Fault::error(format!("model `{name}` has no `file`"))
                                .at(document.span_of(&model.path))
                                .hint(format!(
                                    "a {} device plays a model file; a sample mounted by hand has device = \"manual\"",
                                    kind.as_str()
                                )),
                        );
                    }
                }
            }
            if model
                .device
                .is_some_and(|own| own != device.kind && own != DeviceKind::Manual)
            {
                document.fault(
                    Fault::error(format!(
                        "model `{name}` cannot have a {} device of its own",
                        kind.as_str()
                    ))
                    .at(at(document, &model.path, "device"))
                    .label("only `manual` differs from [device]"),
                );
            }
        }
        let has = |list| document.span_of(list).is_some();
        let plays = self.models.iter().any(|m| m.file.is_some())
            || ["families", "families[0]", "spaces", "spaces[0]"]
                .into_iter()
                .any(has);
        if device.kind == DeviceKind::Process
            && plays
            && document.span_of("device.limits").is_none()
        {
            document.fault(
                Fault::error("[device] has no `limits`")
                    .at(document.span_of("device"))
                    .hint("such as limits = { force_n = 12.0, velocity_mm_s = 1000.0 }: its program plays tables of force"),
            );
        }
        if self.minimum_strokes == 0 {
            return;
        }
        let place = document.span_of("trial.minimum_strokes");
        if let Some(name) = by_hand {
            document.fault(
                Fault::error(format!(
                    "`minimum_strokes` cannot be reached with `{name}`: a sample mounted by hand reports no strokes"
                ))
                .at(place)
                .hint("leave it out, or ask for the strokes in `trial.reference`"),
            );
        } else if by_process {
            document.fault(
                Fault::warning(
                    "`minimum_strokes` needs telemetry, which this process device may not have",
                )
                .at(place),
            );
        }
    }

    /// Questions, covariates and factors become columns: of `ratings.csv`, or of
    /// `participants.csv` for those that are asked once.
    fn columns(&self, document: &Document<'_>) {
        let mut taken: Vec<String> = Vec::new();
        let fixed_once: fn(&str) -> bool = match self.has_parts {
            true => is_participants_column_of_parts,
            false => is_participants_column,
        };
        let participants = "participants.csv";
        let fixed_in_ratings = match self.has_parts || self.exposure.replays > 0 {
            true => is_parts_column,
            false => is_ratings_column,
        };
        let ratings = "ratings.csv";
        for question in self.questions.iter().chain(&self.between) {
            column(document, question, &mut taken, fixed_in_ratings, ratings);
        }
        let mut once: Vec<String> = Vec::new();
        for question in self.setup.iter().chain(&self.intake).chain(&self.outro) {
            column(document, question, &mut once, fixed_once, participants);
        }
        for (i, factor) in self.factors.iter().enumerate() {
            let name = factor.id.as_str();
            let covariate = |model: &PartialModel| {
                let mut names = model.covariates.keys();
                names.any(|own| own.eq_ignore_ascii_case(name))
            };
            let fault = if fixed_in_ratings(name) {
                fixed(name, ratings)
            } else if taken.iter().any(|t| t.eq_ignore_ascii_case(name)) {
                Fault::error(format!("`{name}` is a question and a factor"))
            } else if self.models.iter().any(covariate) {
                Fault::error(format!("`{name}` is a covariate and a factor"))
            } else {
                continue;
            };
            document.fault(fault.at(at(document, &format!("factors[{i}]"), "id")));
        }
        let mut reported: Vec<&str> = Vec::new();
        for model in &self.models {
            for name in model.covariates.keys() {
                let place = document.span_of(&format!("{}.covariates.{name}", model.path));
                let fault = if fixed_in_ratings(name) {
                    fixed(name, ratings)
                } else if taken.iter().any(|t| t.eq_ignore_ascii_case(name)) {
                    let name = Untrusted(name);
                    Fault::error(format!("`{name}` is a question and a covariate"))
                } else {
                    continue;
                };
                // One fault for all realizations with the same covariate.
                if !reported.contains(&name.as_str()) {
                    reported.push(name);
                    document.fault(fault.at(place));
                }
            }
        }
    }

    fn analysis(&self, document: &Document<'_>) {
        let Some(analysis) = self.analysis else {
            return;
        };
        if self.only_asks() {
            return self.analysis_of_questionnaires(analysis, document);
        }
        let place = document.span_of("analysis.primary");
        let primary = &analysis.primary;
        let mut questions = self.questions.iter();
        let Some(question) = questions.find(|q| q.id.as_ref() == Some(primary)) else {
            // It may be the answer of a part with a fault of its own.
            if self.has_faulty_parts {
                return;
            }
            let ids = self.questions.iter().filter_map(|q| q.id.as_ref());
            let fault = unknown("question", primary.as_str(), ids.map(QuestionId::as_str));
            return document.fault(fault.at(place));
        };
        let no_effect = |key: &str, why: &str| {
            let what = format!("`analysis.{key}` has no effect: `{primary}` is {why}");
            let place = document.span_of(&format!("analysis.{key}"));
            document.fault(Fault::error(what).at(place));
        };
        let of_part = question.path.starts_with("parts[");
        let scale = question.kind.as_ref().map(|kind| kind.scale());
        let is_choice = matches!(scale, Some(Scale::Names { .. }));
        if analysis.share_of.is_some() && (of_part || !is_choice) && question.kind.is_some() {
            no_effect("share_of", "no choice of [[questions]]");
        }
        if analysis.realistic_from.is_some() && is_choice {
            no_effect("realistic_from", "a choice");
        }
        let (from, to) = match scale {
            Some(Scale::Levels { from, to, .. }) => (from as f64, to as f64),
            Some(Scale::Interval { from, to, .. }) => (from, to),
            Some(Scale::Open { min, max, .. }) => (
                min.unwrap_or(f64::NEG_INFINITY),
                max.unwrap_or(f64::INFINITY),
            ),
            // Of pairs and of discrimination, which have analyses of their own.
            Some(Scale::Names { .. }) if of_part => return,
            Some(Scale::Names {
                options,
                multiple: false,
            }) => {
                let (given, fault) = match &analysis.share_of {
                    Some(given) if options.contains(given) => return,
                    Some(given) => {
                        let known = options.iter().map(String::as_str);
                        ("analysis.share_of", unknown("option", given, known))
                    }
                    None => {
                        let what = format!("`{primary}` is a choice: the share of which answer?");
                        ("analysis.primary", Fault::error(what))
                    }
                };
                let options: Vec<String> = options.iter().map(|o| format!("{o:?}")).collect();
                let hint = format!("share_of in [analysis] is one of {}", options.join(", "));
                return document.fault(fault.at(document.span_of(given)).hint(hint));
            }
            Some(Scale::Names { .. } | Scale::Free) => {
                let what = "cannot be the primary question: its answers are not numbers";
                let fault = Fault::error(format!("`{primary}` {what}")).at(place);
                return document
                    .fault(fault.hint("a rating, a slider, a number or a choice of one can"));
            }
            None => return,
        };
        let least = analysis.realistic_from;
        if least.is_some_and(|r| !(from..=to).contains(&r)) {
            let what = format!("`analysis.realistic_from` is outside the scale of `{primary}`");
            let place = document.span_of("analysis.realistic_from");
            document.fault(
                Fault::error(what)
                    .at(place)
                    .label(format!("{from} to {to}")),
            );
        }
    }
}

impl Sections<'_> {
    /// The analysis of a study that presents nothing is about one of its questionnaires.
    fn analysis_of_questionnaires(&self, analysis: &AnalysisRules, document: &Document<'_>) {
        let primary = analysis.primary.as_str();
        let known: Vec<&str> = self.questionnaires.iter().map(PartId::as_str).collect();
        if !known.contains(&primary) {
            let place = document.span_of("analysis.primary");
            document.fault(unknown("questionnaire", primary, known).at(place));
        }
        for (key, given) in [
            ("share_of", analysis.share_of.is_some()),
            ("realistic_from", analysis.realistic_from.is_some()),
            ("equivalence_margin", analysis.equivalence_margin.is_some()),
            ("equivalence_r", analysis.equivalence_r.is_some()),
        ] {
            if given {
                let what = format!("`analysis.{key}` has no effect: nothing is rated");
                let place = document.span_of(&format!("analysis.{key}"));
                document.fault(Fault::error(what).at(place));
            }
        }
    }
}

fn column(
    document: &Document<'_>,
    question: &PartialQuestion,
    taken: &mut Vec<String>,
    is_fixed: fn(&str) -> bool,
    table: &str,
) {
    let Some(id) = &question.id else { return };
    let name = id.as_str();
    let place = at(document, &question.path, "id");
    if is_fixed(name) {
        document.fault(fixed(name, table).at(place));
    } else if let Some(other) = taken.iter().find(|t| t.eq_ignore_ascii_case(name)) {
        document.fault(collision(name, other).at(place));
    } else {
        taken.push(name.to_owned());
    }
}

fn fixed(name: &str, table: &str) -> Fault {
    Fault::error(format!(
        "`{}` is a column of {table} already",
        Untrusted(name)
    ))
    .label("choose another name")
}

pub(super) fn collision(id: &str, other: &str) -> Fault {
    if id == other {
        Fault::error(format!("`{id}` is there twice"))
    } else {
        Fault::error(format!("`{id}` and `{other}` differ only in case"))
            .label("some file systems and tools do not distinguish them")
    }
}

pub(super) fn unknown<'a>(
    what: &str,
    given: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> Fault {
    let fault = Fault::error(format!("there is no {what} `{}`", Untrusted(given)));
    match did_you_mean(given, known) {
        Some(near) => fault.label(format!("did you mean `{near}`?")),
        None => fault,
    }
}

pub(super) fn at(document: &Document<'_>, path: &str, key: &str) -> Option<std::ops::Range<usize>> {
    document
        .span_of(&format!("{path}.{key}"))
        .or_else(|| document.span_of(path))
}
