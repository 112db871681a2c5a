//! `[[questions]]`, `[[setup]]`, `[[intake]]`, `[[outro]]`: the same kinds in each.

use super::section::{Section, Variant, shapes, text};
use crate::protocol::keys::{Id, Kind, Shape, Variants, keys};
use crate::protocol::{Question, QuestionKind};
use std::collections::BTreeMap;
use std::fmt::Display;
use study_base::diagnostic::Fault;
use study_base::text::{QuestionId, Untrusted};

/// Most points of a rating scale: one key or click each.
const MAX_RATING_POINTS: i64 = 101;

pub(super) static QUESTIONS: Variants = Variants {
    tag: "kind",
    effect: "The kind of answer",
    common: keys! {
        /// The name of the question and of its column in the results.
        "id": Kind::Id(Id::Question), r#""realism""#, required;
        /// What is asked, in any language.
        "prompt": Kind::Text, r#""How realistic did it feel?""#, required;
        /// Whether an answer is needed. "Declined", with a reason, is always an answer.
        "required": Kind::Flag, "false", derived("`false` for a text, else `true`");
    },
    shapes: &SHAPES,
};

static SHAPES: [Shape; KINDS.len()] = shapes(&KINDS);

/// The kinds of question. A new one is declared here and in [`QuestionKind`];
/// CONTRIBUTING.md lists the other places, some of which the compiler does not find.
const KINDS: [Variant<QuestionKind>; 5] = [
    Variant::new(
        "rating",
        "A whole number on a labelled scale.",
        keys! {
            /// The smallest rating.
            "from": Kind::ANY_WHOLE, "1", required;
            /// The largest rating, above `from`. A scale has at most 101 points.
            "to": Kind::ANY_WHOLE, "7", required;
            /// Texts at some of the numbers.
            "labels": Kind::WholeLabels, r#"{ 1 = "not at all realistic", 7 = "very realistic" }"#;
        },
        rating,
    ),
    Variant::new(
        "slider",
        "A number on a continuous scale.",
        keys! {
            /// The left end.
            "from": Kind::ANY_NUMBER, "0", required;
            /// The right end, above `from`.
            "to": Kind::ANY_NUMBER, "100", required;
            /// How far one key press moves the slider.
            "step": Kind::positive(""), "5", derived("a hundredth of the scale");
            /// Texts at some of the numbers.
            "labels": Kind::NumberLabels, r#"{ 0 = "not at all", 50 = "half", 100 = "completely" }"#;
        },
        slider,
    ),
    Variant::new(
        "choice",
        "One or several of a list of options.",
        keys! {
            /// The options, no two alike. With `multiple`, none contains a `;`, which
            /// separates them in the results.
            "options": Kind::Texts(1), r#"["left", "right", "both"]"#, required;
            /// Whether several can be chosen.
            "multiple": Kind::Flag, "true", default("false");
        },
        choice,
    ),
    Variant::new(
        "number",
        "A number that is typed.",
        keys! {
            /// The unit, shown with the prompt and recorded in the data dictionary.
            "unit": Kind::Text, r#""years""#;
            /// The smallest number that is accepted.
            "min": Kind::ANY_NUMBER, "18";
            /// The largest number that is accepted.
            "max": Kind::ANY_NUMBER, "99";
            /// Only numbers above this one are accepted.
            "above": Kind::ANY_NUMBER, "0";
        },
        number,
    ),
    Variant::new("text", "Free text.", &[], |_| Some(QuestionKind::Text)),
];

/// A question that may be faulty in part.
#[derive(Debug)]
pub(super) struct PartialQuestion {
    /// Such as `questions[0]`.
    pub(super) path: String,
    pub(super) id: Option<QuestionId>,
    pub(super) kind: Option<QuestionKind>,
    prompt: Option<String>,
    required: Option<bool>,
}

impl PartialQuestion {
    /// A required question that another section states.
    pub(super) fn made(path: &str, id: &str, prompt: &str, kind: QuestionKind) -> Self {
        Self {
            path: path.to_owned(),
            id: QuestionId::new(id).ok(),
            kind: Some(kind),
            prompt: Some(prompt.to_owned()),
            required: Some(true),
        }
    }

    /// The question, if every part could be read.
    pub(super) fn finish(self) -> Option<Question> {
        let kind = self.kind?;
        let required = self.required.unwrap_or(!matches!(kind, QuestionKind::Text));
        Some(Question {
            id: self.id?,
            prompt: self.prompt?,
            kind,
            required,
        })
    }
}

/// All questions of an array.
pub(super) fn read(root: &mut Section<'_, '_>, name: &str) -> Vec<PartialQuestion> {
    (root.variants(name, &KINDS).into_iter())
        .map(|(mut section, kind)| PartialQuestion {
            path: section.path().to_owned(),
            id: section.question_id("id"),
            prompt: section.text("prompt"),
            required: section.flag("required"),
            kind: kind.and_then(|kind| (kind.read)(&mut section)),
        })
        .collect()
}

fn rating(section: &mut Section<'_, '_>) -> Option<QuestionKind> {
    let (from, to) = (section.whole::<i64>("from"), section.whole::<i64>("to"));
    let (from, to) = (from?, to?);
    ascending(section, from, to)?;
    if to.checked_sub(from).is_none_or(|n| n >= MAX_RATING_POINTS) {
        section.fault_at(
            "to",
            Fault::error(format!(
                "a rating has at most {MAX_RATING_POINTS} points, not {from} to {to}"
            ))
            .hint("`kind = \"slider\"` is for fine scales"),
        );
        return None;
    }
    let mut labels = BTreeMap::new();
    for (key, label) in section.entries("labels") {
        match key.parse::<i64>() {
            Ok(at) if (from..=to).contains(&at) => {
                labels.insert(at, text(&label)?);
            }
            Ok(at) => label.fault(Fault::error(format!(
                "the label at {at} is outside the scale {from} to {to}"
            ))),
            Err(_) => label.fault(
                Fault::error(format!(
                    "a label belongs to a whole number, not to `{}`",
                    Untrusted(&key)
                ))
                .hint("such as labels = { 1 = \"not at all\", 7 = \"very\" }"),
            ),
        }
    }
    Some(QuestionKind::Rating { from, to, labels })
}

fn slider(section: &mut Section<'_, '_>) -> Option<QuestionKind> {
    let (from, to) = (section.number("from"), section.number("to"));
    let step = section.number("step");
    let (from, to) = (from?, to?);
    ascending(section, from, to)?;
    let step = step.unwrap_or((to - from) / 100.0);
    if !(step > 0.0 && step <= to - from) {
        section.fault_at(
            "step",
            Fault::error(format!(
                "`{}.step` has to be above 0 and at most {}, not {step}",
                section.path(),
                to - from
            )),
        );
    }
    let labels = number_labels(section, from, to)?;
    Some(QuestionKind::Slider {
        from,
        to,
        step,
        labels,
    })
}

/// Texts at numbers of a scale.
pub(super) fn number_labels(
    section: &mut Section<'_, '_>,
    from: f64,
    to: f64,
) -> Option<BTreeMap<String, String>> {
    let mut labels = BTreeMap::new();
    for (key, label) in section.entries("labels") {
        match key.parse::<f64>() {
            Ok(at) if (from..=to).contains(&at) => {
                labels.insert(at.to_string(), text(&label)?);
            }
            _ => label.fault(Fault::error(format!(
                "a label belongs to a number from {from} to {to}, not to `{}`",
                Untrusted(&key)
            ))),
        }
    }
    Some(labels)
}

fn choice(section: &mut Section<'_, '_>) -> Option<QuestionKind> {
    let multiple = section.flag("multiple")?;
    let mut options: Vec<String> = Vec::new();
    for (value, option) in section.texts("options") {
        if options.iter().any(|o| o.trim() == option.trim()) {
            value.fault(Fault::error(format!(
                "`{}` is there twice",
                Untrusted(&option)
            )));
        }
        if multiple && option.contains(';') {
            value.fault(
                Fault::error("an option of a multiple choice cannot contain a `;`")
                    .hint("it separates the chosen options in the results"),
            );
        }
        options.push(option);
    }
    Some(QuestionKind::Choice { options, multiple })
}

fn number(section: &mut Section<'_, '_>) -> Option<QuestionKind> {
    let unit = section.text("unit");
    let (min, max) = (section.number("min"), section.number("max"));
    let above = section.number("above");
    if let (Some(above), Some(max)) = (above, max)
        && above >= max
    {
        let what = format!("no number is above {above} and at most max = {max}");
        section.fault_at("above", Fault::error(what));
    }
    if let (Some(min), Some(max)) = (min, max)
        && min > max
    {
        section.fault_at(
            "min",
            Fault::error(format!(
                "no number lies between min = {min} and max = {max}"
            ))
            .hint("swap them"),
        );
    }
    Some(QuestionKind::Number {
        unit,
        min,
        max,
        above,
    })
}

/// Reports a scale that does not ascend.
fn ascending<T: PartialOrd + Display>(section: &Section<'_, '_>, from: T, to: T) -> Option<()> {
    if from < to {
        return Some(());
    }
    section.fault_at(
        "from",
        Fault::error(format!(
            "the scale of `{}` is reversed: from {from} to {to}",
            section.path()
        ))
        .label("has to be below `to`"),
    );
    None
}
