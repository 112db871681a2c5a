//! Deviations: changes of the analysis rules after a study has begun.

use super::warning::Warning;
use std::fmt::Display;
use study_base::text::PartId;
use study_plan::protocol::{AnalysisRules, Exclusion, OutcomeRules, Protocol};

/// A rule that a report calls preregistered unless it was changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PreregisteredRule {
    /// Which rows are excluded.
    Exclusions,
    /// The least rating that counts as realistic.
    RealisticFrom,
    /// The margin of the equivalence test.
    Margin,
}

impl PreregisteredRule {
    const ALL: [Self; 3] = [Self::Exclusions, Self::RealisticFrom, Self::Margin];
}

/// A change after a study has begun.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Deviation {
    /// The change in words. Names in it are untrusted.
    pub text: String,
    /// The rules that it changes; a report must not call them preregistered.
    pub affects: &'static [PreregisteredRule],
    /// The track whose fit it changes.
    pub track: Option<PartId>,
    /// Whether an analysis had been preregistered, from which it deviates.
    pub registered: bool,
}

impl Deviation {
    /// The change as a warning: without a preregistration there is none to deviate from.
    pub fn warning(&self) -> Warning {
        let what = match self.registered {
            true => "deviation from the preregistered analysis",
            false => "the analysis was changed after the study began",
        };
        Warning {
            code: "deviation",
            text: format!("{what}: {}", self.text),
        }
    }
}

/// The changes of `[analysis]`, the planned participants, VAF and covariates, and of the fits and
/// conditions of tracks, from one version of a protocol to a later one.
pub fn deviations(before: &Protocol, after: &Protocol) -> Vec<Deviation> {
    // No `..`: a new field has to be compared.
    let AnalysisRules {
        primary,
        vaf,
        share_of,
        realistic_from,
        equivalence_margin,
        equivalence_r,
        unfinished,
        exclude,
        alpha,
        construct,
        model,
    } = &after.analysis;
    let b = &before.analysis;
    let mut found = Vec::new();
    let mut compare = |what: &str, affects, old: String, new: String| {
        if old != new {
            let text = format!("{what}: {old} → {new}");
            found.push(Deviation {
                text,
                affects,
                track: None,
                registered: false,
            });
        }
    };
    compare(
        "planned participants",
        &[],
        before.design.participants.to_string(),
        after.design.participants.to_string(),
    );
    // Every rule was stated for the previous primary question.
    compare(
        "primary question",
        &PreregisteredRule::ALL,
        b.primary.to_string(),
        primary.to_string(),
    );
    compare("vaf", &[], shown(&b.vaf), shown(vaf));
    compare(
        "share_of",
        &PreregisteredRule::ALL,
        shown(&b.share_of),
        shown(share_of),
    );
    compare(
        "realistic_from",
        &[PreregisteredRule::RealisticFrom],
        shown(&b.realistic_from),
        shown(realistic_from),
    );
    compare(
        "equivalence_margin",
        &[PreregisteredRule::Margin],
        shown(&b.equivalence_margin),
        shown(equivalence_margin),
    );
    compare(
        "equivalence_r",
        &[PreregisteredRule::Margin],
        shown(&b.equivalence_r),
        shown(equivalence_r),
    );
    compare(
        "unfinished",
        &[],
        b.unfinished.as_str().to_owned(),
        unfinished.as_str().to_owned(),
    );
    compare(
        "exclusion rules",
        &[PreregisteredRule::Exclusions],
        rules(&b.exclude),
        rules(exclude),
    );
    compare("alpha", &[], shown(&b.alpha), shown(alpha));
    compare("construct", &[], shown(&b.construct), shown(construct));
    compare("tested effects", &[], shown(&b.model), shown(model));
    let factors = |protocol: &Protocol| {
        let all = protocol.factors.iter();
        joined(
            all.map(|f| format!("{} ({})", f.id, f.levels.join(", ")))
                .collect(),
        )
    };
    compare("factors", &[], factors(before), factors(after));
    let outcomes = |protocol: &Protocol| {
        let all = protocol.outcomes.iter();
        joined(all.map(OutcomeRules::in_words).collect())
    };
    compare("outcomes", &[], outcomes(before), outcomes(after));
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
        let numbers = |m: &study_plan::protocol::ModelEntry| {
            let all = m.covariates.iter().map(|(k, v)| format!("{k} = {v}"));
            joined(all.collect())
        };
        compare(
            &format!("covariates of {}", new.id),
            &[],
            numbers(old),
            numbers(new),
        );
        let levels = |m: &study_plan::protocol::ModelEntry| {
            let all = m.levels.iter().map(|(k, v)| format!("{k} = {v}"));
            joined(all.collect())
        };
        compare(
            &format!("levels of {}", new.id),
            &[],
            levels(old),
            levels(new),
        );
    }
    for new in &after.tracks {
        let Some(old) = before.track(&new.id) else {
            continue;
        };
        let fits = [before.fit_in_words(old), after.fit_in_words(new)];
        let [old_name, new_name] = [old, new].map(|track| track.condition().to_string());
        let pairs = [
            (format!("fit of track {}", new.id), fits),
            (
                format!("condition of track {}", new.id),
                [old_name, new_name],
            ),
        ];
        for (what, [old, new_value]) in pairs {
            if old != new_value {
                found.push(Deviation {
                    text: format!("{what}: {old} → {new_value}"),
                    affects: &[],
                    track: Some(new.id.clone()),
                    registered: false,
                });
            }
        }
    }
    found
}

fn shown(x: &Option<impl Display>) -> String {
    x.as_ref()
        .map_or_else(|| "none".to_owned(), ToString::to_string)
}

fn rules(all: &[Exclusion]) -> String {
    let one = |rule: &Exclusion| {
        let parameters = rule.parameters().into_iter();
        let stated = parameters.map(|(name, value)| format!(" {name} = {value}"));
        format!("{}{}", rule.name(), stated.collect::<String>())
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
    use study_plan::protocol::example;

    #[test]
    fn only_changes_of_the_analysis_are_deviations() {
        let before = example::protocol(3, 3);
        let mut after = before.clone();
        after.study.title = "Another title".to_owned();
        assert_eq!(deviations(&before, &after), []);
        after.analysis.realistic_from = Some(6.0);
        after.design.participants += 1;
        after.analysis.exclude.push(Exclusion::ConstantRater);
        after.analysis.exclude.push(Exclusion::StrokesBelow(2.0));
        let found: Vec<String> = (deviations(&before, &after).into_iter())
            .map(|d| d.text)
            .collect();
        let found = found.join("; ");
        assert!(found.contains("realistic_from: 5 → 6"), "{found}");
        assert!(found.contains("planned participants: "), "{found}");
        assert!(
            found.contains("none → constant-rater, strokes-below strokes = 2"),
            "{found}"
        );
    }

    #[test]
    fn a_change_of_a_fit_is_a_deviation_of_its_track() {
        let protocol = |fit: &str| {
            let text = format!(
                r#"
format = "study-protocol/3"
study = {{ id = "example", title = "An example", seed = 1 }}
design = {{ participants = 10 }}
device = {{ kind = "simulated", limits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }} }}
analysis = {{ primary = "more" }}
families = [{{ id = "friction", from = "static.toml", vary = "friction", range = [0.02, 0.6], steps = 30 }}]
parts = [{{ id = "more", kind = "discrimination", prompt = "Which?", tracks = ["up"] }}]
tracks = [{{ id = "up", method = "2ifc", family = "friction", standard = 0.0, procedure = {{ rule = "quest+", trials = 40 }}, {fit} }}]
"#
            );
            let parsed = study_plan::protocol::file::parse("protocol.toml", &text);
            let shown = parsed.findings.render(false);
            parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
        };
        let before = protocol("feedback = false");
        assert_eq!(deviations(&before, &before), []);
        for (fit, says) in [
            (
                "fit = { scale = \"log\" }",
                "fit of track up: norm over lin levels, lapse rate 0.02 → gumbel over log levels, lapse rate 0.02",
            ),
            (
                "fit = { lapse = 0.05 }",
                "fit of track up: norm over lin levels, lapse rate 0.02 → norm over lin levels, lapse rate 0.05",
            ),
            ("condition = \"all\"", "condition of track up: up → all"),
        ] {
            let found = deviations(&before, &protocol(fit));
            assert_eq!(found.len(), 1, "{found:?}");
            assert_eq!(found[0].text, says);
            assert_eq!(found[0].track.as_ref().map(PartId::as_str), Some("up"));
            let said = |registered| {
                let own = Deviation {
                    registered,
                    ..found[0].clone()
                };
                own.warning().text
            };
            let changed = "the analysis was changed after the study began";
            assert_eq!(said(false), format!("{changed}: {says}"));
            let deviates = "deviation from the preregistered analysis";
            assert_eq!(said(true), format!("{deviates}: {says}"));
        }
    }

    #[test]
    fn a_deviation_names_the_rules_that_it_affects() {
        let before = example::protocol(3, 3);
        let of = |change: &dyn Fn(&mut Protocol)| {
            let mut after = before.clone();
            change(&mut after);
            let found = deviations(&before, &after);
            assert_eq!(found.len(), 1, "{found:?}");
            found[0].affects
        };
        assert_eq!(
            of(&|p| p.analysis.realistic_from = Some(6.0)),
            [PreregisteredRule::RealisticFrom]
        );
        assert_eq!(
            of(&|p| p.analysis.equivalence_margin = Some(0.25)),
            [PreregisteredRule::Margin]
        );
        assert_eq!(
            of(&|p| p.analysis.equivalence_r = Some(0.5)),
            [PreregisteredRule::Margin]
        );
        assert_eq!(of(&|p| p.analysis.vaf = Some("other".to_owned())), []);
        assert_eq!(
            of(&|p| p.analysis.primary = study_base::text::QuestionId::new("other").unwrap()),
            PreregisteredRule::ALL
        );
    }
}
