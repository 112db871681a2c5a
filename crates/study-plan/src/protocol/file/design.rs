//! `[design]`.

use crate::protocol::keys::{Key, Kind, Word, Words, keys};
use crate::protocol::section::Section;
use crate::protocol::{Breaks, Design, Order, OrderVersion, PartsOrder};
use study_base::diagnostic::Fault;

pub(super) const DESIGN: &[Key] = keys! {
    /// How many participants are planned. An analysis of fewer is reported as interim.
    "participants": Kind::Whole(1, 100_000), "10", required;
    /// How often each participant rates each realization.
    "repetitions": Kind::Whole(1, 10_000), "3", derived("required, unless there are `[[parts]]`, which have their own, or nothing is presented");
    /// How the order of the trials is made. [schedule.md](schedule.md) specifies each.
    "order": Kind::WordOrTable(Order::WORDS, ORDER_FILE), r#""blocked""#, derived("required, unless there are `[[parts]]`, which have their own, or nothing is presented");
    /// The largest number of consecutive trials with the same realization; 1 forbids the
    /// same realization twice in a row.
    "max_run": Kind::COUNT, "1";
    /// The least distance between two positions of the same realization.
    "min_distance": Kind::COUNT, "2";
    /// The realizations of the practice trials, in this order, before all other trials.
    /// Practice is never analyzed.
    "practice": Kind::ModelIds, r#"["spring"]"#;
    /// Breaks between trials.
    "breaks": Kind::Table(BREAKS), "{ every = 8, at_least_s = 60 }";
    /// Failed attempts after which a trial is closed as failed and the session goes on. A
    /// trial fails if the device does, or if somebody marks it as bad; until then it
    /// comes back at the end of its block.
    "max_attempts": Kind::COUNT, "5", default("3");
    /// The order of the `[[parts]]`.
    "parts_order": Kind::Word(PartsOrder::WORDS), r#""williams""#, default(r#""fixed""#);
    /// How the intervals of tracks and pairs are ordered: 1, every sequence of intervals twice in
    /// each block, so that somebody who counts can guess the last ones; 2, drawn so that no way
    /// of guessing is right more often than chance by more than 0.02, even if every answer is
    /// followed by feedback. With 2, a group with some of the realizations of a part with
    /// `pairs = "adjacent"` compares the neighbors among its own. Needs the format
    /// `study-protocol/3`; `study new` writes 2.
    "order_version": Kind::Whole(1, 2), "2", default("1");
};

/// Keys of `[design]` that each part has for itself.
const OF_A_PART: [&str; 5] = [
    "repetitions",
    "order",
    "max_run",
    "min_distance",
    "practice",
];

impl Words for Order {
    const VALUES: &'static [(&'static str, Self)] = &[
        ("blocked", Self::Blocked),
        ("shuffled", Self::Shuffled),
        ("williams", Self::Williams),
        ("latin-square", Self::LatinSquare),
        ("fixed", Self::Fixed),
    ];
    const WORDS: &'static [Word] = &[
        Word::new(
            "blocked",
            "A new random permutation of the realizations in each repetition.",
        ),
        Word::new("shuffled", "One random order of all trials."),
        Word::new(
            "williams",
            "Lines of a Williams design: positions and first-order carry-over are balanced.",
        ),
        Word::new(
            "latin-square",
            "Lines of a cyclic Latin square: positions are balanced.",
        ),
        Word::new("fixed", "The order of `[[models]]`, in each repetition."),
    ];
}

const ORDER_FILE: &[Key] = keys! {
    /// A CSV file of orders with the columns `row,position,model`, one line a trial.
    "file": Kind::Path, r#""orders.csv""#, required;
};

const BREAKS: &[Key] = keys! {
    /// Trials between two breaks; practice is not counted.
    "every": Kind::COUNT, "8", required;
    /// The least duration of a break.
    "at_least_s": Kind::not_negative("s"), "60", default("0");
};

impl Order {
    /// The word in the protocol file; `file` for [`Order::File`].
    pub fn as_str(&self) -> &'static str {
        let found = Self::VALUES.iter().find(|(_, order)| order == self);
        found.map_or("file", |(word, _)| word)
    }
}

/// `has_parts`: whether there are `[[parts]]`; `only_asks`: whether there are only questionnaires.
pub(super) fn read(
    mut section: Section<'_, '_>,
    has_parts: bool,
    only_asks: bool,
) -> Option<Design> {
    let elsewhere = match (has_parts, only_asks) {
        (true, _) => Some((
            "in a study with [[parts]]",
            "each part has its own; write it there",
        )),
        (false, true) => Some(("in a study that presents nothing", "leave it out")),
        (false, false) => None,
    };
    let participants = section.whole("participants");
    let mut repetitions = section.whole("repetitions");
    let mut order = order(&mut section);
    for name in OF_A_PART {
        let given = section.value(name).is_some();
        match elsewhere {
            Some((study, hint)) if given => {
                let what = format!("`design.{name}` has no effect {study}");
                section.fault_at(name, Fault::error(what).hint(hint));
            }
            None if !given && matches!(name, "repetitions" | "order") => {
                section.report_missing(name, section.key(name).such_as());
            }
            _ => {}
        }
    }
    if !has_parts && section.value("parts_order").is_some() {
        let what = "`design.parts_order` has no effect: there are no [[parts]]";
        section.fault_at("parts_order", Fault::error(what));
    }
    if elsewhere.is_some() {
        (repetitions, order) = (Some(1), Some(Order::Fixed));
    }
    let parts_order = section.word("parts_order");
    let order_version = match section.whole::<u32>("order_version")? {
        1 => OrderVersion::Balanced,
        _ => OrderVersion::Unguessable,
    };
    let max_run = section.whole("max_run");
    let min_distance = section.whole("min_distance");
    let practice = section.model_ids("practice");
    let breaks = section.section("breaks").and_then(breaks);
    let max_attempts = section.whole("max_attempts");
    Some(Design {
        participants: participants?,
        repetitions: repetitions?,
        order: order?,
        max_run,
        min_distance,
        practice,
        breaks,
        max_attempts: max_attempts?,
        parts_order: parts_order?,
        order_version,
    })
}

fn order(section: &mut Section<'_, '_>) -> Option<Order> {
    let value = section.value("order")?;
    if !value.is_table() {
        return value.word(Order::VALUES);
    }
    section.section("order")?.path_of("file").map(Order::File)
}

fn breaks(mut section: Section<'_, '_>) -> Option<Breaks> {
    let (every, at_least_s) = (section.whole("every"), section.number("at_least_s"));
    Some(Breaks {
        every: every?,
        at_least_s: at_least_s?,
    })
}
