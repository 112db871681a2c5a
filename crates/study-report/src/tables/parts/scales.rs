//! The tables of estimated magnitudes, of ratings beside a reference and of questionnaires.

use super::column;
use crate::apa::{interval_or_dash, name, plain, two};
use crate::table::{Builder, Cell, Table};
use study_analysis::analyze::psychophysics::results::{ConditionName, PartResults, Rated};
use study_analysis::analyze::results::Number as _;
use study_base::sort::SmallSort as _;
use study_base::text::counted;

/// Estimates of levels or of realizations.
pub(super) fn magnitudes(results: &PartResults) -> Table {
    let found = results.over.magnitude.as_ref();
    let law = found.and_then(|m| m.law.as_ref());
    let exponent = law.and_then(|law| law.exponent.number()).map(|exponent| {
        let interval = law.and_then(|law| law.exponent_over_participants.ci95.ends());
        let left_out = found
            .and_then(|m| m.n_left_out.number())
            .unwrap_or_default();
        format!(
            "Exponent {} {}, over participants. {} left out, because not above 0.",
            two(exponent),
            interval_or_dash(interval, two),
            counted(left_out as usize, "estimate", "estimates"),
        )
    });
    let levels = found.into_iter().flat_map(|m| &m.levels);
    let levels = levels.map(|(level, mean)| (Ok(level.0), mean));
    let realizations = found.into_iter().flat_map(|m| &m.realizations);
    let realizations = realizations.map(|(name, mean)| (Err(name.as_str()), mean));
    Builder::new("Estimated magnitudes", levels.chain(realizations))
        .column(column("", "level"), &|(of, _)| match of {
            Ok(level) => Cell::Number(Some(level), plain),
            Err(name) => Cell::Name(name.to_owned()),
        })
        .field(column("geometric mean", "geometric_mean"), plain, |r| {
            &r.1.geometric_mean
        })
        .ends(column("95 %", "geometric_mean_ci95"), plain, &|r| {
            r.1.ci95.ends()
        })
        .notes(exponent)
}

/// Ratings beside a reference.
pub(super) fn ratings(results: &PartResults) -> Table {
    let found = results.over.mushra.as_ref();
    let unscreened = |(condition, kept): (&ConditionName, &Rated)| {
        let all = results.mushra_unscreened.get(condition);
        all.unwrap_or(kept).mean.number()
    };
    let participants = found.into_iter().flat_map(|m| &m.participants);
    let screened: Vec<String> = participants
        .filter(|(_, found)| found.screened.is_set())
        .map(|(who, _)| name(who.as_str()))
        .collect();
    let screened = (!screened.is_empty()).then(|| {
        format!(
            "Screened, and only in the last column, the mean over all: {}.",
            screened.join(", ")
        )
    });
    let conditions = found.into_iter().flat_map(|m| &m.conditions);
    Builder::new("Ratings from 0 to 100", conditions)
        .name("", "condition", &|c| c.0.as_str().to_owned())
        .field(column("median", "median"), plain, |c| &c.1.median)
        .ends(column("quartiles", "quartile"), plain, &|c| {
            c.1.q1.number().zip(c.1.q3.number())
        })
        .field(column("mean", "mean"), plain, |c| &c.1.mean)
        .field(
            column("95 %", "mean_ci95_half"),
            |h| format!("± {}", plain(h)),
            |c| &c.1.ci95_half,
        )
        .number(
            column("with screened", "mean_unscreened"),
            plain,
            &unscreened,
        )
        .notes(screened)
}

/// The score of each participant in a questionnaire.
pub(super) fn scores(results: &PartResults) -> Table {
    let found = results.questionnaire.as_ref();
    let mean = found.and_then(|q| {
        Some(format!(
            "Score: mean {} {} of {}.",
            plain(q.mean.number()?),
            interval_or_dash(q.ci95.ends(), plain),
            counted(q.n.number()? as usize, "participant", "participants"),
        ))
    });
    let scores = found.into_iter().flat_map(|q| &q.score);
    Builder::new("Scores", scores)
        .name("", "participant", &|s| s.0.as_str().to_owned())
        .field(column("score", "score"), plain, |s| s.1)
        .notes(mean)
}

/// The scores of the subscales of a questionnaire.
pub(super) fn subscales(results: &PartResults) -> Table {
    let scales = results.questionnaire.iter().flat_map(|q| &q.scale);
    Builder::new("Subscales", scales)
        .name("subscale", "subscale", &|own| own.0.as_str().to_owned())
        .field(column("participants", "n"), plain, |own| &own.1.n)
        .field(column("mean", "mean"), two, |own| &own.1.mean)
        .ends(column("95 %", "mean_ci95"), two, &|own| own.1.ci95.ends())
        .field(column("SD", "sd"), two, |own| &own.1.sd)
        .done()
}

/// The scores after each condition, block or part.
pub(super) fn scores_after(results: &PartResults) -> Table {
    let after = results.questionnaire.iter().flat_map(|q| &q.after);
    let mut after: Vec<_> = after.collect();
    // Block 2 before 10; names as they are.
    after.small_sort_by_key(|own| own.0.as_str().parse::<u32>().unwrap_or(0));
    let note = "After each realization, block or part: over participants, of each the mean.";
    let any = !after.is_empty();
    Builder::new("Scores between the trials", after)
        .name("after", "after", &|own| own.0.as_str().to_owned())
        .field(column("participants", "n"), plain, |own| &own.1.n)
        .field(column("mean", "mean"), two, |own| &own.1.mean)
        .ends(column("95 %", "mean_ci95"), two, &|own| own.1.ci95.ends())
        .field(column("SD", "sd"), two, |own| &own.1.sd)
        .notes(any.then(|| note.to_owned()))
}

/// The answers to the items of a questionnaire, as they were given.
pub(super) fn items(results: &PartResults) -> Table {
    let items = results.questionnaire.iter().flat_map(|q| &q.item);
    let mut items: Vec<_> = items.collect();
    // 2 before 10; names as they are.
    items.small_sort_by_key(|item| item.0.as_str().parse::<u32>().unwrap_or(0));
    Builder::new("Items, as answered", items)
        .name("item", "item", &|i| i.0.as_str().to_owned())
        .field(column("mean", "mean"), two, |i| &i.1.mean)
        .field(column("SD", "sd"), two, |i| &i.1.sd)
        .done()
}
