//! The tables of identification.

use super::{column, count};
use crate::apa::{interval_or_dash, percent, two};
use crate::table::{Builder, Head, Table, file, page};
use study_analysis::analyze::psychophysics::results::{
    ConfusionName, Identified, LabelName, LabelUse, PartResults,
};
use study_analysis::analyze::results::Number as _;
use study_base::sort::SmallSort as _;

/// Most labels whose matrix is on a page.
const MAX_COLUMNS: usize = 12;

/// The labels in their order on the page.
fn labels(found: &Identified) -> Vec<(&LabelName, &LabelUse)> {
    let mut labels: Vec<_> = found.labels.iter().collect();
    let place = |label: &(&LabelName, &LabelUse)| label.1.place.number().unwrap_or(0.0);
    labels.small_sort_by(|a, b| place(a).total_cmp(&place(b)));
    labels
}

/// How often each label was given where another one was right.
pub(super) fn confusions(results: &PartResults) -> Table {
    let Some(found) = &results.over.identification else {
        return Table::default();
    };
    let labels = labels(found);
    let few = labels.len() <= MAX_COLUMNS;
    let note = "Rows are the labels that were right; below each number is how often the label of this number was \
                given. Bias: β of Luce's choice model, which sum to 1.";
    let mut table = Builder::new("Confusion matrix", labels.iter().copied())
        .name("right", "label", &|(name, _)| name.as_str().to_owned())
        .field(
            column("no.", "place").explained(note.to_owned()),
            count,
            |l| &l.1.place,
        )
        .field(file("n"), count, |l| &l.1.n)
        .field(file("given"), count, |l| &l.1.given)
        .field(column("bias", "bias").droppable(1), two, |l| &l.1.bias);
    for (i, (given, _)) in labels.iter().enumerate() {
        let number = (i + 1).to_string();
        let head = match few {
            true => page(&number),
            false => Head::default(),
        };
        let head = head.file(&format!("given_{number}"));
        table = table.number(head, count, &|(right, _)| {
            let cell = ConfusionName::of(right.as_str(), given.as_str());
            found.confusion.get(&cell)?.number()
        });
    }
    let many = (!few).then(|| {
        format!(
            "The matrix of {} labels is in part_confusions.csv, and its figure.",
            labels.len()
        )
    });
    table.notes(many.into_iter().chain(transfer(found)))
}

/// The share of correct answers, and information transfer.
fn transfer(found: &Identified) -> Option<String> {
    let bits = &found.information;
    Some(format!(
        "Correct: {} {}; by guessing {}. Information transfer: {} bits {} of {} bits; {} before its bias is corrected.",
        percent(found.all.correct.number()?),
        interval_or_dash(found.all.correct_ci95.ends(), two),
        percent(found.by_guessing.number()?),
        two(bits.corrected.number()?),
        interval_or_dash(bits.corrected_ci95.ends(), two),
        two(bits.stimulus.number()?),
        two(bits.transmitted.number()?),
    ))
}

/// Pairs of labels, the most similar first.
pub(super) fn label_pairs(results: &PartResults) -> Table {
    let found = results.over.identification.as_ref();
    let mut pairs: Vec<_> = found.into_iter().flat_map(|own| &own.pairs).collect();
    pairs.small_sort_by(|a, b| {
        let similarity = [a, b].map(|p| p.1.similarity.number().unwrap_or(0.0));
        similarity[1].total_cmp(&similarity[0])
    });
    let note = "Similarity: η of Luce's choice model, 1 for labels that are never told apart. d′: from the answers to the \
                two that are one of the two. Intervals by leaving out each participant in turn.";
    Builder::new("Pairs of labels", pairs)
        .name("labels", "labels", &|p| p.0.names().join(" | "))
        .field(
            column("similarity", "similarity").explained(note.to_owned()),
            two,
            |p| &p.1.similarity,
        )
        .ends(column("95 %", "similarity_ci95"), two, &|p| {
            p.1.similarity_ci95.ends()
        })
        .field(column("d′", "d"), two, |p| &p.1.d)
        .ends(column("95 %", "d_ci95"), two, &|p| p.1.d_ci95.ends())
        .done()
}

/// Realizations with the share of correct answers.
pub(super) fn recall(results: &PartResults) -> Table {
    let found = results.over.identification.as_ref();
    let realizations = found.into_iter().flat_map(|own| &own.realizations);
    Builder::new("Realizations identified", realizations)
        .name("realization", "realization", &|r| r.0.as_str().to_owned())
        .field(column("answers", "n"), count, |r| &r.1.n)
        .field(column("correct", "correct"), two, |r| &r.1.correct)
        .ends(column("95 %", "correct_ci95"), two, &|r| {
            r.1.correct_ci95.ends()
        })
        .done()
}

/// Participants.
pub(super) fn participants(results: &PartResults) -> Table {
    let found = results.over.identification.as_ref();
    let participants = found.into_iter().flat_map(|own| &own.participants);
    let note = "By guessing: of guesses with the participant's own preferences for labels.";
    Builder::new("Identification by participant", participants)
        .name("participant", "participant", &|p| p.0.as_str().to_owned())
        .field(column("answers", "n"), count, |p| &p.1.n)
        .field(column("correct", "correct"), two, |p| &p.1.correct)
        .field(
            column("by guessing", "by_guessing").explained(note.to_owned()),
            two,
            |p| &p.1.by_guessing,
        )
        .field(column("bits", "information"), two, |p| &p.1.information)
        .done()
}
