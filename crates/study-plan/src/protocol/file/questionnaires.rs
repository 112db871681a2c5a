//! `[[questionnaires]]`.

use super::agree::{Sections, at, collision};
use super::outcomes::PartialOutcome;
use super::parts::RawPart;
use super::questions::PartialQuestion;
use crate::protocol::keys::{Id, Kind, Shape, Variants, Words as _, keys};
use crate::protocol::questionnaires::{Inventory, Occasion, Questionnaire, item_id};
use crate::protocol::section::{Section, Variant, shapes};
use crate::protocol::{Order, Part, Role, Task};
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
        /// The texts at both ends of every scale.
        "labels": Kind::Texts(2), r#"["stimme gar nicht zu", "stimme voll zu"]"#, derived("those of the source, in English");
    },
    shapes: &SHAPES,
};

static SHAPES: [Shape; KINDS.len()] = shapes(&KINDS);

/// Reads the own key of a questionnaire: the word for what is judged.
type Read = (Inventory, Option<String>);

const KINDS: [Variant<Read>; 2] = [
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
        |section| Some((Inventory::Sus, section.text("system"))),
    ),
    Variant::new(
        "nasa-tlx",
        "The NASA Task Load Index without weights, the raw TLX (Hart 2006).",
        keys! {
            /// The six items in other words or in another language, in their order.
            "items": Kind::Texts(1), r#"["Wie hoch war die geistige Anforderung?", "…", "…", "…", "…", "…"]"#, derived("those of the source, in English");
        },
        |_| Some((Inventory::NasaTlx, None)),
    ),
];

/// A questionnaire that may be faulty in part.
#[derive(Debug)]
pub(super) struct PartialQuestionnaire {
    /// Such as `questionnaires[0]`.
    path: String,
    id: Option<PartId>,
    kind: Option<Inventory>,
    after: Occasion,
    /// The texts of its items, with the labels of their scales.
    items: Vec<(String, [String; 2])>,
}

pub(super) fn read(root: &mut Section<'_, '_>) -> Vec<PartialQuestionnaire> {
    (root.variants("questionnaires", &KINDS).into_iter())
        .map(|(mut section, kind)| {
            let read = kind.and_then(|kind| (kind.read)(&mut section));
            PartialQuestionnaire {
                path: section.path().to_owned(),
                id: section.part_id("id"),
                kind: read.as_ref().map(|(kind, _)| *kind),
                after: section.word("after").unwrap_or(Occasion::Session),
                items: read.map_or_else(Vec::new, |read| items(&mut section, &read)),
            }
        })
        .collect()
}

/// The texts of the items, as they are asked.
fn items(section: &mut Section<'_, '_>, (kind, system): &Read) -> Vec<(String, [String; 2])> {
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
    let own = texts(section, "items", known.len());
    let labels = texts(section, "labels", 2);
    let system = system.as_deref().unwrap_or("system");
    let item = |(i, item): (usize, &crate::protocol::questionnaires::Item)| {
        let prompt = own.get(i).map_or(item.prompt, String::as_str);
        let [low, high] = [(0, item.low), (1, item.high)]
            .map(|(end, label)| labels.get(end).map_or(label, String::as_str).to_owned());
        (prompt.replace("{system}", system), [low, high])
    };
    known.iter().enumerate().map(item).collect()
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
        let (id, kind) = (self.id.as_ref()?, self.kind?);
        let own = || PartialOutcome::of_questionnaire(&self.path, id, kind);
        (self.after == Occasion::Condition).then(own)
    }

    /// The items as questions.
    pub(super) fn questions(&self) -> Vec<PartialQuestion> {
        let (Some(id), Some(kind)) = (&self.id, self.kind) else {
            return Vec::new();
        };
        let items = kind.items().iter().zip(&self.items);
        let question = |(item, (prompt, [low, high])): (_, &(String, [String; 2]))| {
            let name = item_id(id, item);
            PartialQuestion::made(&self.path, name.as_str(), prompt, kind.scale(low, high))
        };
        items.map(question).collect()
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
