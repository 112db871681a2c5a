//! What was changed of the rules of analysis after a study began.

use crate::protocol::{AnalysisRules, ExclusionRule, Protocol};
use std::fmt::Display;

/// A rule that a sentence would call stated before the data.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stated {
    /// What to leave out.
    Exclusions,
    /// From which rating on one counts as realistic.
    RealisticFrom,
    /// The margin of equivalence.
    Margin,
}

impl Stated {
    const ALL: [Self; 3] = [Self::Exclusions, Self::RealisticFrom, Self::Margin];
}

/// A change after a study began.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Deviation {
    /// In words. Names in it are untrusted.
    pub text: String,
    /// The rules that it changes: no sentence may call them stated beforehand.
    pub of: &'static [Stated],
}

/// The changes of `[analysis]`, the planned participants, VAF and covariates from
/// one version of a protocol to a later one.
pub fn deviations(before: &Protocol, after: &Protocol) -> Vec<Deviation> {
    // Taken apart without `..`, so that a new rule has to be compared.
    let AnalysisRules {
        primary,
        vaf,
        realistic_from,
        equivalence_margin,
        unfinished,
        exclude,
    } = &after.analysis;
    let b = &before.analysis;
    let mut found = Vec::new();
    let mut compare = |what: &str, of: &'static [Stated], old: String, new: String| {
        if old != new {
            let text = format!("{what}: {old} → {new}");
            found.push(Deviation { text, of });
        }
    };
    compare(
        "planned participants",
        &[],
        before.design.participants.to_string(),
        after.design.participants.to_string(),
    );
    // The rules were stated for the first one.
    compare(
        "primary question",
        &Stated::ALL,
        b.primary.to_string(),
        primary.to_string(),
    );
    compare("vaf", &[], shown(&b.vaf), shown(vaf));
    compare(
        "realistic_from",
        &[Stated::RealisticFrom],
        shown(&b.realistic_from),
        shown(realistic_from),
    );
    compare(
        "equivalence_margin",
        &[Stated::Margin],
        shown(&b.equivalence_margin),
        shown(equivalence_margin),
    );
    let word = |u| match u {
        crate::protocol::Unfinished::Include => "include".to_owned(),
        crate::protocol::Unfinished::Exclude => "exclude".to_owned(),
    };
    compare("unfinished", &[], word(b.unfinished), word(*unfinished));
    compare(
        "exclusion rules",
        &[Stated::Exclusions],
        rules(&b.exclude),
        rules(exclude),
    );
    for new in &after.models {
        let Some(old) = before.model(&new.id) else {
            continue;
        };
        compare(
            &format!("VAF of {}", new.id),
            &[],
            shown(&old.vaf),
            shown(&new.vaf),
        );
        let numbers = |m: &crate::protocol::ModelEntry| {
            let all = m.covariates.iter().map(|(k, v)| format!("{k} = {v}"));
            joined(all.collect())
        };
        compare(
            &format!("covariates of {}", new.id),
            &[],
            numbers(old),
            numbers(new),
        );
    }
    found
}

fn shown(x: &Option<impl Display>) -> String {
    x.as_ref()
        .map_or_else(|| "none".to_owned(), ToString::to_string)
}

fn rules(all: &[ExclusionRule]) -> String {
    let one = |e: &ExclusionRule| {
        let parameters = e.parameters.iter().map(|(k, v)| format!(" {k} = {v}"));
        format!("{}{}", e.rule, parameters.collect::<String>())
    };
    joined(all.iter().map(one).collect())
}

fn joined(all: Vec<String>) -> String {
    if all.is_empty() {
        "none".to_owned()
    } else {
        all.join(", ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::example;

    #[test]
    fn every_change_of_the_rules_is_named_and_nothing_else() {
        let before = example::protocol(3, 3);
        let mut after = before.clone();
        after.study.title = "Another title".to_owned();
        assert_eq!(deviations(&before, &after), []);
        after.analysis.realistic_from = Some(6.0);
        after.design.participants += 1;
        after.analysis.exclude.push(ExclusionRule {
            rule: "constant-rater".to_owned(),
            parameters: std::collections::BTreeMap::new(),
        });
        let found: Vec<String> = (deviations(&before, &after).into_iter())
            .map(|d| d.text)
            .collect();
        let found = found.join("; ");
        assert!(found.contains("realistic_from: 5 → 6"), "{found}");
        assert!(found.contains("planned participants: "), "{found}");
        assert!(found.contains("constant-rater"), "{found}");
    }

    #[test]
    fn a_change_is_of_the_rule_that_it_changes() {
        let before = example::protocol(3, 3);
        let of = |change: &dyn Fn(&mut Protocol)| {
            let mut after = before.clone();
            change(&mut after);
            let found = deviations(&before, &after);
            assert_eq!(found.len(), 1, "{found:?}");
            found[0].of
        };
        assert_eq!(
            of(&|p| p.analysis.realistic_from = Some(6.0)),
            [Stated::RealisticFrom]
        );
        assert_eq!(
            of(&|p| p.analysis.equivalence_margin = Some(0.25)),
            [Stated::Margin]
        );
        assert_eq!(of(&|p| p.analysis.vaf = Some("other".to_owned())), []);
        assert_eq!(
            of(&|p| p.analysis.primary = study_base::text::QuestionId::new("other").unwrap()),
            Stated::ALL
        );
    }
}
