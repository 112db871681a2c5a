//! What was changed of the rules of analysis after a study began.

use crate::protocol::{AnalysisRules, ExclusionRule, Protocol};
use std::fmt::Display;

/// The changes of `[analysis]`, the planned participants, VAF and covariates from
/// one version of a protocol to a later one, in words. Names in it are untrusted.
pub fn deviations(before: &Protocol, after: &Protocol) -> Vec<String> {
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
    let mut compare = |what: &str, old: String, new: String| {
        if old != new {
            found.push(format!("{what}: {old} → {new}"));
        }
    };
    compare(
        "planned participants",
        before.design.participants.to_string(),
        after.design.participants.to_string(),
    );
    compare(
        "primary question",
        b.primary.to_string(),
        primary.to_string(),
    );
    compare("vaf", shown(&b.vaf), shown(vaf));
    compare(
        "realistic_from",
        shown(&b.realistic_from),
        shown(realistic_from),
    );
    compare(
        "equivalence_margin",
        shown(&b.equivalence_margin),
        shown(equivalence_margin),
    );
    let word = |u| match u {
        crate::protocol::Unfinished::Include => "include".to_owned(),
        crate::protocol::Unfinished::Exclude => "exclude".to_owned(),
    };
    compare("unfinished", word(b.unfinished), word(*unfinished));
    compare("exclusion rules", rules(&b.exclude), rules(exclude));
    for new in &after.models {
        let Some(old) = before.model(&new.id) else {
            continue;
        };
        compare(
            &format!("VAF of {}", new.id),
            shown(&old.vaf),
            shown(&new.vaf),
        );
        let numbers = |m: &crate::protocol::ModelEntry| {
            let all = m.covariates.iter().map(|(k, v)| format!("{k} = {v}"));
            joined(all.collect())
        };
        compare(
            &format!("covariates of {}", new.id),
            numbers(old),
            numbers(new),
        );
    }
    found
}

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

/// Whether any of the changes, as [`deviations`] words them (alone or behind a
/// reason in quotes), is of this rule. Another primary question changes all of
/// them: they were stated for the first one.
pub(super) fn touches(changes: &[String], rule: Stated) -> bool {
    let own = match rule {
        Stated::Exclusions => "exclusion rules: ",
        Stated::RealisticFrom => "realistic_from: ",
        Stated::Margin => "equivalence_margin: ",
    };
    changes.iter().any(|change| {
        [own, "primary question: "]
            .iter()
            .any(|key| change.starts_with(key) || change.contains(&format!("\": {key}")))
    })
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
        assert_eq!(deviations(&before, &after), Vec::<String>::new());
        after.analysis.realistic_from = Some(6.0);
        after.design.participants += 1;
        after.analysis.exclude.push(ExclusionRule {
            rule: "constant-rater".to_owned(),
            parameters: std::collections::BTreeMap::new(),
        });
        let found = deviations(&before, &after).join("; ");
        assert!(found.contains("realistic_from: 5 → 6"), "{found}");
        assert!(found.contains("planned participants: "), "{found}");
        assert!(found.contains("constant-rater"), "{found}");
    }

    #[test]
    fn a_change_touches_the_rule_that_it_names() {
        let before = example::protocol(3, 3);
        let mut after = before.clone();
        after.analysis.realistic_from = Some(6.0);
        let mut found = deviations(&before, &after);
        for _ in 0..2 {
            assert!(touches(&found, Stated::RealisticFrom));
            assert!(!touches(&found, Stated::Exclusions) && !touches(&found, Stated::Margin));
            // As a command tells it, with a reason that names another rule.
            found[0] = format!(
                "protocol 2 of 2026-01-01, because \"exclusion rules: no\": {}",
                found[0]
            );
        }
        let other = ["primary question: a → b".to_owned()];
        assert!(touches(&other, Stated::Margin) && touches(&other, Stated::Exclusions));
    }
}
