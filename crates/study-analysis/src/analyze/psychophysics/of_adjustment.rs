//! Adjustment of a study.

use super::adjustment::{SettingRow, adjustment};
use super::part_data::{Found, Intervals, PartData};
use super::results::PartResults;
use crate::analyze::Rules;
use crate::analyze::warning::Warning;
use study_base::text::counted;
use study_plan::protocol::parts::{FamilyRules, Part};
use study_plan::protocol::{Adjustment, Answer, Protocol};
use study_session::outcome::{IntervalRow, RatingRow};

/// The settings of a part.
pub(super) fn of_adjustment(
    protocol: &Protocol,
    part: &Part,
    own: &Adjustment,
    (rows, intervals): (&[&RatingRow], &Intervals<'_>),
    rules: &Rules,
) -> Found {
    let set = |row: &&RatingRow| {
        let felt = intervals.counted(row).iter();
        let levels: Vec<&IntervalRow> = felt
            .filter(|interval| interval.target == Some(true))
            .copied()
            .collect();
        let start = levels.first()?.model.as_ref()?;
        let changes = levels.windows(2).filter(|two| two[0].model != two[1].model);
        Some(SettingRow {
            participant: row.participant.as_str().to_owned(),
            level: (row.answers.get(part.asks.first()?)).and_then(Answer::number)?,
            ascending: own.ascends_from(start),
            changes: Some(changes.count() as f64),
        })
    };
    let settings: Vec<SettingRow> = rows.iter().filter_map(set).collect();
    let standard = own.standard.as_ref().and_then(|id| protocol.level_of(id));
    let family = protocol.family(&own.family);
    let mut results = PartResults::undefined("");
    let streams = (rules.seed, part.id.as_str());
    results.over.adjustment = Some(adjustment(&settings, standard, streams));
    Found {
        task: "adjustment",
        trials: settings.len(),
        results,
        warnings: family
            .and_then(|family| at_an_end(family, &settings))
            .into_iter()
            .collect(),
        names: Vec::new(),
        data: PartData {
            dimension: family.map(FamilyRules::dimension),
            ..PartData::default()
        },
    }
}

/// Settings at an end of the ladder, beyond which nobody could go.
fn at_an_end(family: &FamilyRules, settings: &[SettingRow]) -> Option<Warning> {
    let ends = [family.ladder.first(), family.ladder.last()];
    let there = settings.iter().filter(|s| ends.contains(&s.level)).count();
    (there > 0).then(|| Warning {
        code: "ends",
        text: format!(
            "{there} of {} at an end of the ladder, {} and {}: what feels equal may lie beyond",
            counted(settings.len(), "setting is", "settings are"),
            ends[0],
            ends[1]
        ),
    })
}
