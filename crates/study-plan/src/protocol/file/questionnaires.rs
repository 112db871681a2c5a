//! `[[questionnaires]]`.

use super::agree::{Sections, at, collision};
use super::outcomes::PartialOutcome;
use super::parts::RawPart;
use super::questions::PartialQuestion;
use super::scoring::{self, OWN, RawOwn};
use crate::protocol::keys::{Id, Kind, Shape, Variants, Words as _, keys};
use crate::protocol::outcomes::BetterEnd;
use crate::protocol::questionnaires::{Inventory, Occasion, Questionnaire, Scored, item_id};
use crate::protocol::scoring::Scoring;
use crate::protocol::section::{Section, Variant, shapes};
use crate::protocol::{Order, Part, QuestionKind, Role, Task, kinds};
use std::collections::BTreeMap;
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::Document;
use study_base::text::{PartId, counted};

pub(super) static QUESTIONNAIRES: Variants = Variants {
    tag: "kind",
    effect: "Which questionnaire",
    common: keys! {
        /// The name of the questionnaire. Its answers are in columns that begin with this name,
        /// such as `sus_1`.
        "id": Kind::Id(Id::Part), r#""sus""#, required;
        /// After what it is asked. What is not `session` needs the format `study-protocol/3`.
        "after": Kind::Word(Occasion::WORDS), r#""condition""#, default(r#""session""#);
        /// The texts at both ends of every scale; of the Task Load Index and of kind `own` also two for each item.
        "labels": Kind::Texts(2), r#"["stimme gar nicht zu", "stimme voll zu"]"#, derived("those of the source, in English; none of kind `own`");
    },
    shapes: &SHAPES,
};

static SHAPES: [Shape; KINDS.len()] = shapes(&KINDS);

/// What only one kind has.
struct Read {
    kind: Inventory,
    /// The word for what is judged.
    system: Option<String>,
    /// What is asked of two subscales, and their titles.
    compare: Option<String>,
    titles: Vec<String>,
    own: Option<RawOwn>,
}

impl Read {
    fn standard(kind: Inventory, system: Option<String>) -> Self {
        Self {
            kind,
            system,
            compare: None,
            titles: Vec::new(),
            own: None,
        }
    }
}

/// An item: the end of its id, its text and its answers.
type Asked = (String, String, QuestionKind);

const KINDS: [Variant<Read>; 4] = [
    Variant::new(
        "sus",
        "The System Usability Scale (Brooke 1996), free to use where the source is named.",
        keys! {
            /// What is judged, in its sentences: "I thought the switch was easy to use."
            "system": Kind::Text, r#""switch""#, default(r#""system""#);
            /// The ten items in other words or in another language, in their order. `{system}`
            /// stands for that word.
            "items": Kind::Texts(1), r#"["Den {system} würde ich gern oft nutzen.", "…", "…", "…", "…", "…", "…", "…", "…", "…"]"#, derived("those of the source, in English");
        },
        |section| Some(Read::standard(Inventory::Sus, section.text("system"))),
    ),
    Variant::new(
        "nasa-tlx",
        "The NASA Task Load Index without weights, the raw TLX (Hart 2006).",
        keys! {
            /// The six items in other words or in another language, in their order.
            "items": Kind::Texts(1), r#"["Wie hoch war die geistige Anforderung?", "…", "…", "…", "…", "…"]"#, derived("those of the source, in English");
        },
        |_| Some(Read::standard(Inventory::NasaTlx, None)),
    ),
    Variant::new(
        "nasa-tlx-weighted",
        "The NASA Task Load Index with weights (Hart & Staveland 1988): six ratings, and 15 comparisons of two subscales, which give the \
         weights. Asked after each condition, both are asked each time.",
        keys! {
            /// The six items in other words or in another language, in their order.
            "items": Kind::Texts(1), r#"["Wie hoch war die geistige Anforderung?", "…", "…", "…", "…", "…"]"#, derived("those of the source, in English");
            /// What is asked of two subscales.
            "compare": Kind::Text, r#""Was hat mehr zur Belastung beigetragen?""#, derived("in English");
            /// The titles of the six subscales in another language, in the order of the items.
            "titles": Kind::Texts(1), r#"["geistige Anforderung", "…", "…", "…", "…", "…"]"#, derived("in English");
        },
        |section| {
            let titles = section.texts("titles");
            Some(Read {
                compare: section.text("compare"),
                titles: titles.into_iter().map(|(_, text)| text).collect(),
                ..Read::standard(Inventory::NasaTlxWeighted, None)
            })
        },
    ),
    Variant::new(
        "own",
        "A questionnaire that the study brings itself, with its items and its scoring: one of the laboratory, or one whose terms do not let \
         a program have its text. Needs the format `study-protocol/3`.",
        OWN,
        |section| {
            let own = scoring::read(section)?;
            Some(Read {
                own: Some(own),
                ..Read::standard(Inventory::Own, None)
            })
        },
    ),
];

/// A questionnaire that may be faulty in part.
#[derive(Debug)]
pub(super) struct PartialQuestionnaire {
    /// Such as `questionnaires[0]`.
    path: String,
    id: Option<PartId>,
    kind: Option<Inventory>,
    own: Option<Scoring>,
    better: Option<BetterEnd>,
    after: Occasion,
    items: Vec<Asked>,
}

pub(super) fn read(root: &mut Section<'_, '_>) -> Vec<PartialQuestionnaire> {
    (root.variants("questionnaires", &KINDS).into_iter())
        .map(|(mut section, kind)| {
            let read = kind.and_then(|kind| (kind.read)(&mut section));
            let own = read.as_ref().and_then(|read| read.own.as_ref());
            PartialQuestionnaire {
                path: section.path().to_owned(),
                id: section.part_id("id"),
                kind: read.as_ref().map(|read| read.kind),
                own: own.map(|own| own.scoring.clone()),
                better: match read.as_ref().map(|read| read.kind) {
                    Some(Inventory::Sus) => Some(BetterEnd::Higher),
                    Some(Inventory::NasaTlx | Inventory::NasaTlxWeighted) => Some(BetterEnd::Lower),
                    Some(Inventory::Own) | None => own.and_then(|own| own.better),
                },
                after: section.word("after").unwrap_or(Occasion::Session),
                items: match (&read, own) {
                    (Some(_), Some(own)) => own_items(&mut section, own),
                    (Some(read), None) => items(&mut section, read),
                    (None, _) => Vec::new(),
                },
            }
        })
        .collect()
}

/// The items of a questionnaire of the study's own.
fn own_items(section: &mut Section<'_, '_>, own: &RawOwn) -> Vec<Asked> {
    let labels = labels(section, own.items.len());
    let (from, to) = (own.scoring.from, own.scoring.to);
    let item = |(i, text): (usize, &String)| {
        let at = if labels.len() == 2 { 0 } else { 2 * i };
        let ends = labels.get(at).zip(labels.get(at + 1));
        let labels = ends.map_or_else(BTreeMap::new, |(low, high)| {
            BTreeMap::from([(from, low.clone()), (to, high.clone())])
        });
        let kind = QuestionKind::Rating(kinds::Rating { from, to, labels });
        ((i + 1).to_string(), text.clone(), kind)
    };
    own.items.iter().enumerate().map(item).collect()
}

/// The texts at the ends of the scales: two, or two for each of `n` items.
fn labels(section: &mut Section<'_, '_>, n: usize) -> Vec<String> {
    let labels = section.texts("labels");
    let labels: Vec<String> = labels.into_iter().map(|(_, text)| text).collect();
    if ![0, 2, 2 * n].contains(&labels.len()) {
        let what = format!(
            "`{}.labels` has {}, not 2 or, two for each item, {}",
            section.path(),
            counted(labels.len(), "text", "texts"),
            2 * n
        );
        section.fault_at("labels", Fault::error(what));
    }
    labels
}

/// The items of a standard questionnaire, as they are asked.
fn items(section: &mut Section<'_, '_>, read: &Read) -> Vec<Asked> {
    let kind = read.kind;
    let texts = |section: &mut Section<'_, '_>, key: &str, needed: usize| -> Vec<String> {
        let texts: Vec<String> = section.texts(key).into_iter().map(|(_, t)| t).collect();
        if !texts.is_empty() && texts.len() != needed {
            let what = format!(
                "`{}.{key}` has {}, not {needed}",
                section.path(),
                counted(texts.len(), "text", "texts")
            );
            section.fault_at(key, Fault::error(what));
        }
        texts
    };
    let known = kind.items();
    let rated = known.iter().filter(|item| item.pair.is_none()).count();
    let own = texts(section, "items", rated);
    let labels = match kind {
        // Success is rated from perfect to failure, and the rest from low to high.
        Inventory::NasaTlx | Inventory::NasaTlxWeighted => labels(section, rated),
        Inventory::Sus | Inventory::Own => texts(section, "labels", 2),
    };
    let titles = &read.titles;
    if !titles.is_empty() && titles.len() != rated {
        let what = format!(
            "`{}.titles` has {}, not {rated}",
            section.path(),
            counted(titles.len(), "text", "texts")
        );
        section.fault_at("titles", Fault::error(what));
    }
    let system = read.system.as_deref().unwrap_or("system");
    let item = |(i, item): (usize, &crate::protocol::questionnaires::Item)| {
        let at = if labels.len() == 2 { 0 } else { 2 * i };
        let (prompt, ends) = match item.pair {
            None => (own.get(i), [labels.get(at), labels.get(at + 1)]),
            Some(pair) => (read.compare.as_ref(), pair.map(|at| titles.get(at))),
        };
        let prompt = prompt.map_or(item.prompt, String::as_str);
        let low = ends[0].map_or(item.low, String::as_str);
        let high = ends[1].map_or(item.high, String::as_str);
        let scale = kind.scale(item, low, high)?;
        let prompt = prompt.replace("{system}", system);
        Some((item.name.to_owned(), prompt, scale))
    };
    known.iter().enumerate().filter_map(item).collect()
}

impl PartialQuestionnaire {
    pub(super) fn id(&self) -> Option<&PartId> {
        self.id.as_ref()
    }

    /// Whether it is asked between the trials, and not at the end.
    pub(super) fn is_between(&self) -> bool {
        self.after != Occasion::Session
    }

    /// The measured outcome that its scores are, if there is one for each condition.
    pub(super) fn outcome(&self) -> Option<PartialOutcome> {
        let scored = Scored {
            id: self.id.clone()?,
            kind: self.kind?,
            own: self.own.clone(),
        };
        let own = || PartialOutcome::of_questionnaire(&self.path, scored, self.better);
        (self.after == Occasion::Condition).then(own)
    }

    /// The items as questions.
    pub(super) fn questions(&self) -> Vec<PartialQuestion> {
        let Some(id) = &self.id else {
            return Vec::new();
        };
        let question = |(name, prompt, kind): &Asked| {
            let name = item_id(id, name);
            PartialQuestion::made(&self.path, name.as_str(), prompt, kind.clone())
        };
        self.items.iter().map(question).collect()
    }

    pub(super) fn finish(&self) -> Option<Questionnaire> {
        let questions = match self.is_between() {
            true => self.questions(),
            false => Vec::new(),
        };
        let questions = questions.into_iter().map(PartialQuestion::finish);
        Some(Questionnaire {
            id: self.id.clone()?,
            kind: self.kind?,
            own: self.own.clone(),
            after: self.after,
            questions: questions.collect::<Option<_>>()?,
        })
    }
}

/// Reports ids of questionnaires that are there twice or belong to a part.
pub(super) fn agree(all: &[PartialQuestionnaire], parts: &[RawPart], document: &Document<'_>) {
    let of_parts: Vec<&PartId> = parts.iter().filter_map(|p| p.id.as_ref()).collect();
    for (i, own) in all.iter().enumerate() {
        let Some(id) = &own.id else { continue };
        let earlier = all[..i].iter().filter_map(|q| q.id.as_ref());
        let mut others = earlier.chain(of_parts.iter().copied());
        if let Some(other) = others.find(|other| other.collides_with(id)) {
            let fault = collision(id.as_str(), other.as_str());
            document.fault(fault.at(at(document, &own.path, "id")));
        }
    }
}

/// Reports questionnaires after something that the study has not, or that does not end before the rest.
pub(super) fn agree_after(
    all: &[PartialQuestionnaire],
    sections: &Sections<'_>,
    parts: &[Part],
    document: &Document<'_>,
) {
    let orders = orders(sections, parts);
    for own in all.iter().filter(|own| own.is_between()) {
        if let Some(fault) = without_end(own.after, sections.has_parts, &orders) {
            document.fault(fault.at(at(document, &own.path, "after")));
        }
    }
}

/// The order of the trials that rate realizations, of a part or of the study.
struct Rated<'a> {
    part: Option<&'a PartId>,
    order: &'a Order,
    repetitions: u32,
    realizations: usize,
}

fn orders<'a>(sections: &Sections<'a>, parts: &'a [Part]) -> Vec<Rated<'a>> {
    let of_part = |part: &'a Part| match &part.task {
        Task::Rating(own) => Some(Rated {
            part: Some(&part.id),
            order: &own.order,
            repetitions: own.repetitions,
            realizations: own.models.len(),
        }),
        _ => None,
    };
    match sections.design {
        _ if sections.has_parts => parts.iter().filter_map(of_part).collect(),
        None => Vec::new(),
        Some(design) => {
            let scheduled = sections.models.iter().filter(|m| m.role != Role::Practice);
            vec![Rated {
                part: None,
                order: &design.order,
                repetitions: design.repetitions,
                realizations: scheduled.count(),
            }]
        }
    }
}

/// Why nothing can be asked after this; a file of orders is looked at where it is read.
fn without_end(after: Occasion, has_parts: bool, orders: &[Rated<'_>]) -> Option<Fault> {
    let said = format!("after = \"{}\"", after.as_str());
    let of = |rated: &Rated<'_>| match rated.part {
        Some(part) => format!(" in part `{part}`"),
        None => String::new(),
    };
    let shuffled = |rated: &&Rated<'_>| *rated.order == Order::Shuffled;
    match after {
        Occasion::Session => None,
        Occasion::Part => (!has_parts).then(|| {
            Fault::error(format!("{said} needs [[parts]], and the study has none"))
                .hint("after = \"session\" asks it at the end")
        }),
        Occasion::Condition | Occasion::Block if orders.iter().any(|r| r.realizations == 0) => {
            Some(
                Fault::error(format!(
                    "{said} needs realizations, and nothing is presented"
                ))
                .hint("after = \"session\" asks it once"),
            )
        }
        Occasion::Condition | Occasion::Block if has_parts && orders.is_empty() => Some(
            Fault::error(format!("{said} needs a part of kind `rating`"))
                .hint("after = \"part\" asks it after each part of any kind"),
        ),
        Occasion::Condition => {
            let mixed = |rated: &&Rated<'_>| rated.repetitions > 1 && rated.realizations > 1;
            let rated = orders.iter().filter(shuffled).find(mixed)?;
            let what = format!(
                "{said} has no meaning{}: order = \"shuffled\" mixes the repetitions of the realizations, so that none is over before the others",
                of(rated)
            );
            Some(Fault::error(what).hint(
                "order = \"blocked\" (or williams, latin-square, fixed) asks it in each block; a file of orders that has the trials of a realization one after another, or a part for each realization with parts_order = \"williams\", asks it once for each",
            ))
        }
        Occasion::Block => {
            let file = |rated: &&Rated<'_>| matches!(rated.order, Order::File(_));
            let rated = orders.iter().find(|r| shuffled(r) || file(r))?;
            let what = format!(
                "{said} has no meaning{}: its order has no blocks",
                of(rated)
            );
            Some(Fault::error(what).hint(
                "the orders blocked, williams, latin-square and fixed have: in each block every realization comes once",
            ))
        }
    }
}
