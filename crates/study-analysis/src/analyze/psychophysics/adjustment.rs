//! Adjustment: `adjustment/…`.

use crate::analyze::draws::Draws;
use crate::analyze::record::{Interval, ParticipantName, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::adjustment::{FEWEST_RESAMPLED, Setting, Settings, spread};
use study_stats::describe::{mean, sd};
use study_stats::paired::{OneSample, one_sample};

statistics! {
    /// Whether settings differ from the standard.
    pub struct ConstantError {
        /// the level of the standard
        standard: Stat,
        /// mean over participants of the point of equality less the standard
        mean: Stat,
        /// t interval of the mean
        ci95: Interval,
        /// the mean as a share of the standard
        relative: Stat,
        /// t of the test against 0
        t: Stat,
        /// its degrees of freedom
        df: Stat,
        /// its p, two-sided
        p: Stat,
    }

    /// Whether it matters from which side a level is set.
    pub struct SidesOfStart {
        /// mean over participants of the mean setting from below, of those who have both
        ascending: Stat,
        /// the same from above
        descending: Stat,
        /// the first less the second: below 0 if settings stay near their start, above 0 if they overshoot
        difference: Stat,
        /// t interval of the difference
        ci95: Interval,
        /// t of the test against 0
        t: Stat,
        /// its degrees of freedom
        df: Stat,
        /// its p, two-sided
        p: Stat,
    }

    /// How much settings scatter, a measure of the just noticeable difference.
    pub struct SettingSpread {
        /// pooled standard deviation within participants and sides
        sd: Stat,
        /// percentile interval over participants, by the bootstrap
        sd_ci95: Interval,
        /// its degrees of freedom
        df: Stat,
        /// as a share of the mean point of equality
        relative: Stat,
    }

    /// A participant.
    pub struct OwnSettings {
        /// number of settings
        n: Stat,
        /// point of equality: the mean of the means from both sides
        pse: Stat,
        /// mean setting from below
        ascending: Stat,
        /// mean setting from above
        descending: Stat,
        /// standard deviation within sides
        sd: Stat,
    }

    /// Settings by the method of adjustment.
    pub struct Adjusted {
        /// number of settings
        n: Stat,
        /// number of participants
        n_participants: Stat,
        /// mean number of changes of level in a setting
        changes: Stat,
        /// mean over participants of their points of equality
        pse: Stat,
        /// t interval of the mean
        pse_ci95: Interval,
        /// standard deviation over participants
        pse_sd: Stat,
        /// difference from the standard, if that is a level
        error: Option<ConstantError>,
        /// ascending and descending settings
        start: SidesOfStart,
        /// scatter of settings
        spread: SettingSpread,
        /// by participant
        participants: BTreeMap<ParticipantName, OwnSettings> as "participant",
    }
}

/// One setting.
#[derive(Debug, Clone, PartialEq)]
pub struct SettingRow {
    /// Participant. Untrusted.
    pub participant: String,
    /// The level that was set.
    pub level: f64,
    /// Whether it was set from below.
    pub ascending: bool,
    /// How often the level was changed, if that is known.
    pub changes: Option<f64>,
}

const NO_SETTINGS: &str = "there are no settings";
const ONE_PARTICIPANT: &str = "there is one participant";
const ALIKE: &str = "all participants are alike";
const ONE_SIDE: &str = "nobody has settings from both sides";
const NO_SPREAD: &str = "nobody has two settings from one side";

/// The statistics of settings. `standard`: its level, if it is one; `seed` and `name` are those of the random streams.
pub fn adjustment(
    rows: &[SettingRow],
    standard: Option<f64>,
    (seed, name): (u64, &str),
) -> Adjusted {
    let mut settings: BTreeMap<&str, Vec<Setting>> = BTreeMap::new();
    for row in rows {
        let own = settings.entry(&row.participant).or_default();
        own.push(Setting {
            level: row.level,
            ascending: row.ascending,
        });
    }
    let people: Vec<(&str, Settings)> = (settings.iter())
        .filter_map(|(who, own)| Some((*who, Settings::of(own)?)))
        .collect();
    let all: Vec<Settings> = people.iter().map(|person| person.1).collect();
    let pse: Vec<f64> = all.iter().map(|own| own.pse).collect();
    let changes: Vec<f64> = rows.iter().filter_map(|row| row.changes).collect();
    let tested = one_sample(&pse);
    let center = mean(&pse);
    let few = match pse.len() {
        0 => NO_SETTINGS,
        _ => ONE_PARTICIPANT,
    };
    let mut draws = Draws::new(seed, &format!("adjustment/{name}/spread"));
    let scatter = spread(&all, &mut draws);
    let ratio = |of: Option<f64>, to: Option<f64>| match (of, to) {
        (Some(of), Some(to)) if to > 0.0 => Some(of / to),
        _ => None,
    };
    Adjusted {
        n: Stat::count(rows.len()),
        n_participants: Stat::count(all.len()),
        changes: Stat::or(mean(&changes), "the changes are not known"),
        pse: Stat::or(center, NO_SETTINGS),
        pse_ci95: Interval::or(tested.map(|t| t.ci95), few),
        pse_sd: Stat::or(sd(&pse), few),
        error: standard.map(|standard| error(&pse, standard)),
        start: sides(&all),
        spread: SettingSpread {
            sd: Stat::or(scatter.map(|s| s.sd), NO_SPREAD),
            sd_ci95: Interval::or(
                scatter.and_then(|s| s.ci95),
                match scatter {
                    None => NO_SPREAD.to_owned(),
                    Some(_) => format!("it takes {FEWEST_RESAMPLED} participants"),
                },
            ),
            df: Stat::or(scatter.map(|s| s.df as f64), NO_SPREAD),
            relative: Stat::or(
                ratio(scatter.map(|s| s.sd), center),
                "there is no spread, or the mean is not above 0",
            ),
        },
        participants: (people.iter())
            .map(|(who, own)| (ParticipantName::from(*who), of_participant(own)))
            .collect(),
    }
}

fn of_participant(own: &Settings) -> OwnSettings {
    OwnSettings {
        n: Stat::count(own.n),
        pse: Stat::of(own.pse),
        ascending: Stat::or(own.ascending, "no setting is from below"),
        descending: Stat::or(own.descending, "no setting is from above"),
        sd: Stat::or(own.sd(), "no two settings are from one side"),
    }
}

/// Why a t test over participants is undefined.
fn untested(n: usize, none: &'static str) -> &'static str {
    match n {
        0 => none,
        1 => ONE_PARTICIPANT,
        _ => ALIKE,
    }
}

fn degrees(test: Option<OneSample>) -> Option<f64> {
    test.map(|test| test.n as f64 - 1.0)
}

fn error(pse: &[f64], standard: f64) -> ConstantError {
    let errors: Vec<f64> = pse.iter().map(|own| own - standard).collect();
    let (test, why) = (one_sample(&errors), untested(errors.len(), NO_SETTINGS));
    let center = mean(&errors);
    ConstantError {
        standard: Stat::of(standard),
        mean: Stat::or(center, NO_SETTINGS),
        ci95: Interval::or(test.map(|t| t.ci95), why),
        relative: Stat::or(
            center.filter(|_| standard > 0.0).map(|e| e / standard),
            "there are no settings, or the standard is not above 0",
        ),
        t: Stat::or(test.and_then(|t| t.t), why),
        df: Stat::or(degrees(test), why),
        p: Stat::or(test.and_then(|t| t.p), why),
    }
}

fn sides(all: &[Settings]) -> SidesOfStart {
    let both = |own: &Settings| Some((own.ascending?, own.descending?));
    let known: Vec<(f64, f64)> = all.iter().filter_map(both).collect();
    let side = |of: fn(&(f64, f64)) -> f64| {
        let means: Vec<f64> = known.iter().map(of).collect();
        mean(&means)
    };
    let differences: Vec<f64> = known.iter().map(|(up, down)| up - down).collect();
    let (test, why) = (one_sample(&differences), untested(known.len(), ONE_SIDE));
    SidesOfStart {
        ascending: Stat::or(side(|own| own.0), ONE_SIDE),
        descending: Stat::or(side(|own| own.1), ONE_SIDE),
        difference: Stat::or(mean(&differences), ONE_SIDE),
        ci95: Interval::or(test.map(|t| t.ci95), why),
        t: Stat::or(test.and_then(|t| t.t), why),
        df: Stat::or(degrees(test), why),
        p: Stat::or(test.and_then(|t| t.p), why),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::record::Number as _;

    fn rows(people: &[(&[f64], &[f64])]) -> Vec<SettingRow> {
        let mut rows = Vec::new();
        for (who, (up, down)) in (1..).zip(people) {
            let mut set = |levels: &[f64], ascending: bool| {
                rows.extend(levels.iter().map(|level| SettingRow {
                    participant: format!("P{who}"),
                    level: *level,
                    ascending,
                    changes: Some(4.0),
                }));
            };
            set(up, true);
            set(down, false);
        }
        rows
    }

    fn near(found: &Stat, expected: f64) {
        let found = found.number().unwrap();
        assert!((found - expected).abs() < 1e-9, "{found} {expected}");
    }

    /// Numbers of R, as in crates/study-stats/src/adjustment.rs.
    #[test]
    fn settings_have_an_error_sides_and_a_spread() {
        let rows = rows(&[
            (&[0.9, 1.0, 1.1], &[1.2, 1.1, 1.3]),
            (&[1.2, 1.1, 1.0], &[1.2, 1.4, 1.3]),
            (&[0.8, 0.9, 0.9], &[1.0, 1.0, 0.9]),
            (&[1.3, 1.1], &[1.3, 1.5, 1.2]),
            (&[1.0, 1.2, 1.1], &[1.1, 1.0, 1.3]),
            (&[1.4], &[1.5]),
        ]);
        let found = adjustment(&rows, Some(1.0), (1, "equal"));
        near(&found.n, 31.0);
        near(&found.changes, 4.0);
        near(&found.pse, 1.175);
        let error = found.error.as_ref().unwrap();
        near(&error.mean, 0.175);
        near(&error.relative, 0.175);
        near(&error.t, 2.393_172_105_652_4);
        near(&error.p, 0.062_143_319_372_778);
        near(&found.start.difference, -0.127_777_777_777_778);
        near(&found.start.p, 0.004_722_863_406_675);
        near(&found.spread.sd, 0.109_223_736_254_55);
        near(&found.spread.relative, 0.109_223_736_254_55 / 1.175);
        assert!(found.spread.sd_ci95.ends().is_some());
        let sixth = &found.participants[&ParticipantName::from("P6")];
        near(&sixth.pse, 1.45);
        assert_eq!(sixth.sd.reason(), Some("no two settings are from one side"));
    }

    #[test]
    fn what_is_missing_is_said() {
        let none = adjustment(&[], Some(1.0), (1, "equal"));
        assert_eq!(none.pse.reason(), Some(NO_SETTINGS));
        assert_eq!(none.error.unwrap().p.reason(), Some(NO_SETTINGS));
        let one = adjustment(&rows(&[(&[1.0, 1.2], &[])]), None, (1, "equal"));
        assert!(one.error.is_none());
        assert_eq!(one.pse_sd.reason(), Some(ONE_PARTICIPANT));
        assert_eq!(one.start.difference.reason(), Some(ONE_SIDE));
        assert!(one.spread.sd.number().is_some());
    }
}
