//! The findings of a part of adjustment.

use super::{PartFacts, PartFinding, PartQuestion, estimate};
use crate::analyze::findings::{Direction, Finding, Test, TestKind};
use crate::analyze::psychophysics::adjustment::Adjusted;
use crate::analyze::record::{Interval, Number as _, Stat};

/// Whether settings differ from the standard, if that is a level, and whether they depend on their start.
pub(in crate::analyze::psychophysics) fn settings_of(
    facts: &PartFacts,
    found: &Adjusted,
) -> Vec<PartFinding> {
    let error = found.error.as_ref().map(|error| {
        let mean = (&error.mean, &error.ci95);
        let test = [&error.t, &error.df, &error.p];
        of_mean(facts, PartQuestion::Adjusted, mean, test)
    });
    let start = &found.start;
    let mean = (&start.difference, &start.ci95);
    let test = [&start.t, &start.df, &start.p];
    let sides = of_mean(facts, PartQuestion::Starts, mean, test);
    error.into_iter().chain([sides]).collect()
}

/// Whether a mean over participants, with its interval, is not 0. It rests on those who have a value, who may be fewer than
/// all.
fn of_mean(
    facts: &PartFacts,
    question: PartQuestion,
    (mean, ci95): (&Stat, &Interval),
    [t, df, p]: [&Stat; 3],
) -> PartFinding {
    let (Some(mean), Some(value)) = (mean.number(), p.number()) else {
        return facts.undefined(question, p, 0);
    };
    let df = df.number();
    let test = Test::single(TestKind::OneSampleT, value, facts.alpha);
    let test = test.with("t", t.number(), &[df]);
    Finding {
        participants: df.map_or(facts.participants, |df| df as usize + 1),
        direction: Some(Direction::of(mean)).filter(|_| test.is_significant()),
        estimate: Some(estimate("difference", mean, ci95)),
        ..Finding::decided(question, test, facts.design(0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analyze::psychophysics::adjustment::{SettingRow, adjustment};

    /// Who has settings from one side only has a point of equality and no difference of sides.
    #[test]
    fn a_finding_rests_on_those_who_have_a_value() {
        let set = |(who, level, ascending): (&str, f64, bool)| SettingRow {
            participant: who.to_owned(),
            level,
            ascending,
            changes: None,
        };
        let rows = [
            ("P1", 1.0, true),
            ("P1", 1.3, false),
            ("P2", 1.1, true),
            ("P2", 1.2, false),
            ("P3", 0.9, true),
        ]
        .map(set);
        let facts = PartFacts {
            alpha: 0.05,
            participants: 3,
        };
        let found = settings_of(&facts, &adjustment(&rows, Some(1.0), (1, "equal")));
        let people: Vec<usize> = found.iter().map(|f| f.participants).collect();
        assert_eq!(people, [3, 2]);
    }
}
