//! The numbers that R has to come to: identifier, value, tolerance.

use crate::analyze::Analysis;
use crate::analyze::psychophysics::PartAnalysis;
use crate::analyze::psychophysics::results::{
    Adjusted, Identified, Preferences, Rankings, Similarities,
};
use crate::analyze::results::{Correlation, Field, Key, Number as _};
use std::collections::BTreeMap;
use study_base::sort::SmallSort as _;
use study_plan::protocol::OutcomeFamily;

/// Most realizations with a VAF of which R goes through every permutation.
const MAX_PERMUTED: usize = 8;

/// An identifier, its value if it has one, and the tolerance.
type Number = (String, Option<f64>, &'static str);

/// The tolerance, relative to a value above 1, of closed forms, of the linear mixed model,
/// of abilities, and of the ordinal model.
const CLOSED: &str = "1e-9";
const LINEAR: &str = "2e-5";
/// Of a likelihood that both maximize by Newton's method.
const FITTED: &str = "1e-6";
const ORDINAL: &str = "2e-3";
/// Of a generalized mixed model, whose maximum R's optimizers miss by a little.
const GENERALIZED: &str = "1e-3";

/// Of the analysis of ratings.
pub(super) fn of_ratings(analysis: &Analysis) -> Vec<Number> {
    let (results, evidence) = (&analysis.results, &analysis.results.evidence);
    let mut numbers = Numbers(Vec::new());
    let described = ["n", "mean", "sd"];
    numbers.each("desc", &results.descriptives.desc, &described, CLOSED);
    if let Some(tests) = &evidence.factorial {
        numbers.each(
            "factorial",
            &tests.effects,
            &["F", "df1", "df2", "p_gg"],
            CLOSED,
        );
        // Those of levels over all others, where they are over the participants who rated everything.
        let is_complete = tests.effects.values().all(|e| e.clustered.is_none());
        let pairs: BTreeMap<_, _> = (tests.contrasts.iter())
            .filter(|(name, _)| is_complete && name.at.0.is_empty())
            .map(|(name, contrast)| (name.clone(), contrast.clone()))
            .collect();
        let compared = ["difference", "t", "df", "p", "p_tost"];
        numbers.each("factorial_contrast", &pairs, &compared, CLOSED);
    }
    let correlation = ["n_models", "pearson/r", "pearson/p_t"];
    numbers.add("corr", &evidence.corr, &correlation, CLOSED);
    if evidence.corr.n() <= MAX_PERMUTED {
        let exact = ["p_exact_two_sided"];
        numbers.add("corr/pearson", &evidence.corr.pearson, &exact, CLOSED);
    }
    let linear = [
        "slope",
        "slope_se",
        "slope_satterthwaite_df",
        "slope_satterthwaite_p",
        "var_subject",
        "var_model",
        "sigma2",
    ];
    numbers.add("lmm_vaf_crossed", &evidence.crossed, &linear, LINEAR);
    let ordinal = [
        "beta/vaf",
        "se/vaf",
        "sd_subject",
        "sd_model",
        "loglik",
        "lrt_chi2",
    ];
    let crossed = &results.ordinal.clmm_vaf_crossed;
    numbers.add("clmm_vaf_crossed", crossed, &ordinal, ORDINAL);
    for outcome in &analysis.outcomes {
        // R's glmer does not maximize the likelihood of gamma.
        if outcome.rules.model == Some(OutcomeFamily::Gamma) {
            continue;
        }
        let id = outcome.rules.id.as_str();
        if let Some(model) = results.outcomes.get(id).and_then(|own| own.model.as_ref()) {
            let (id, ratio) = (format!("outcomes/{id}/model"), ["chi2", "df", "p"]);
            numbers.add(&format!("{id}/differ"), &model.differ, &ratio, GENERALIZED);
            numbers.each(&format!("{id}/effect"), &model.effects, &ratio, GENERALIZED);
        }
    }
    numbers.0
}

/// Of a part, with the part's id before each identifier.
pub(super) fn of_part(part: &PartAnalysis) -> Vec<Number> {
    let (results, over) = (&part.results, &part.results.over);
    let mut numbers = Numbers(Vec::new());
    if let Some(pairs) = &results.pairs {
        numbers.of_preferences(pairs);
    }
    if let Some(magnitude) = &over.magnitude {
        let law = ["exponent", "log10_coefficient"];
        numbers.add("magnitude", &magnitude.law, &law, CLOSED);
        let means = &magnitude.realizations;
        numbers.each("magnitude/realization", means, &["geometric_mean"], CLOSED);
        numbers.of_vaf("magnitude/vaf", magnitude.vaf.as_ref(), CLOSED);
    }
    for (group, model) in [
        ("magnitude_mixed", &results.magnitude_mixed),
        ("psy_mixed", &over.psy_mixed),
        ("sessions", &over.again.sessions),
    ] {
        numbers.add(
            group,
            &model.as_ref().map(|m| m.test.clone()),
            &TEST,
            LINEAR,
        );
    }
    if let Some(mushra) = &over.mushra {
        numbers.each("mushra", &mushra.conditions, &["median", "mean"], CLOSED);
    }
    if let Some(found) = &over.identification {
        numbers.of_identification(found);
    }
    if let Some(found) = &over.similarity {
        numbers.of_similarity(found);
    }
    if let Some(found) = &over.ranking {
        numbers.of_rankings(found);
    }
    if let Some(found) = &over.adjustment {
        numbers.of_adjustment(found);
    }
    for (name, group) in &over.sdt_group {
        let id = format!("sdt_group/{}/above_chance", name.part());
        numbers.add(&id, &group.above_chance, &["t", "p"], CLOSED);
    }
    if let Some(own) = &over.again.groups {
        numbers.add("groups", &own.test, &TEST, CLOSED);
        let center = ["mean", "sd", "geometric_mean", "geometric_sd"];
        numbers.each("groups", &own.groups, &center, CLOSED);
        let contrast = ["difference", "ratio", "t", "df", "p"];
        numbers.each("groups", &own.pairs, &contrast, CLOSED);
    }
    let interaction = ["F", "df1", "df2", "p", "eps_gg", "p_gg"];
    let profiles = &over.again.groups_conditions;
    numbers.add("groups_conditions", profiles, &interaction, CLOSED);
    if let Some(own) = &over.again.groups_sessions {
        numbers.add("groups_sessions", own, &interaction, CLOSED);
        let change = ["difference", "ratio", "t", "df", "p"];
        numbers.each("groups_sessions", &own.changes, &change, CLOSED);
    }
    let retest = ["icc_agreement", "icc_consistency", "sem"];
    numbers.add("retest", &over.again.retest, &retest, CLOSED);
    let mut all = numbers.0;
    all.small_sort_by(|a, b| a.0.cmp(&b.0));
    let named = |(id, value, tolerance)| (format!("{}:{id}", part.part), value, tolerance);
    all.into_iter().map(named).collect()
}

const TEST: [&str; 4] = ["F", "df1", "df2", "p"];

struct Numbers(Vec<Number>);

impl Numbers {
    /// Adds those of a record's own fields that R computes.
    fn add(&mut self, id: &str, record: &impl Field, fields: &[&str], tolerance: &'static str) {
        let values = record.values();
        let own = fields.iter().filter(|field| values.get(field).is_some());
        let number = |field: &&str| (format!("{id}/{field}"), values.number(field), tolerance);
        self.0.extend(own.map(number));
    }

    /// The same of every record of a map.
    fn each<K: Key, R: Field>(
        &mut self,
        id: &str,
        records: &BTreeMap<K, R>,
        fields: &[&str],
        tolerance: &'static str,
    ) {
        for (name, record) in records {
            self.add(&format!("{id}/{}", name.part()), record, fields, tolerance);
        }
    }

    fn of_vaf(&mut self, id: &str, vaf: Option<&Correlation>, tolerance: &'static str) {
        let Some(vaf) = vaf else {
            return;
        };
        let all = ["r", "p_exact_two_sided"];
        let fields = if vaf.n() <= MAX_PERMUTED {
            &all[..]
        } else {
            &all[..1]
        };
        self.add(&format!("{id}/pearson"), &vaf.pearson, fields, tolerance);
    }

    fn of_identification(&mut self, found: &Identified) {
        let id = "identification";
        self.add(id, found, &["n", "correct", "by_guessing"], CLOSED);
        let above = ["mean", "se", "t", "df", "p"];
        self.add(
            &format!("{id}/above_guessing"),
            &found.above_guessing,
            &above,
            CLOSED,
        );
        let bits = [
            "transmitted",
            "corrected",
            "corrected_ci95_lo",
            "corrected_ci95_hi",
            "stimulus",
            "items",
        ];
        self.add(
            &format!("{id}/information"),
            &found.information,
            &bits,
            CLOSED,
        );
        let recall = ["n", "correct"];
        self.each(
            &format!("{id}/realization"),
            &found.realizations,
            &recall,
            CLOSED,
        );
        self.each(&format!("{id}/pair"), &found.pairs, &["d"], CLOSED);
        self.each(&format!("{id}/pair"), &found.pairs, &["similarity"], FITTED);
        self.each(&format!("{id}/label"), &found.labels, &["bias"], FITTED);
    }

    /// What R computes without random starts.
    fn of_similarity(&mut self, found: &Similarities) {
        let id = "similarity";
        self.add(id, found, &["n", "mean", "n_participants"], CLOSED);
        let agreed = ["mean_correlation", "kendall_w"];
        self.add(
            &format!("{id}/agreement"),
            &found.agreement,
            &agreed,
            CLOSED,
        );
        self.add(&format!("{id}/order"), &found.order, &["rms"], CLOSED);
        let identical = ["n", "mean", "share"];
        self.add(
            &format!("{id}/identical"),
            &found.identical,
            &identical,
            CLOSED,
        );
        self.each(
            &format!("{id}/dimensions"),
            &found.dimensions,
            &["classical"],
            CLOSED,
        );
        let pair = ["n", "mean", "sd", "rescaled"];
        self.each(&format!("{id}/pair"), &found.pairs, &pair, CLOSED);
    }

    fn of_rankings(&mut self, found: &Rankings) {
        let id = "ranking";
        self.add(id, found, &["n", "n_participants"], CLOSED);
        let agreed = ["n", "w", "chi2", "df", "p_chi2"];
        let agreement = format!("{id}/agreement");
        self.add(&agreement, &found.agreement, &agreed, CLOSED);
        let of_item = format!("{id}/realization");
        let described = ["n", "mean_rank", "sd", "first", "level"];
        self.each(&of_item, &found.items, &described, CLOSED);
        let fitted = ["worth", "log_worth", "log_worth_se"];
        self.each(&of_item, &found.items, &fitted, FITTED);
        let tie = ["log_delta", "log_delta_se"];
        self.each(&format!("{id}/ties"), &found.ties, &tie, FITTED);
        let of_pair = format!("{id}/pair");
        self.each(&of_pair, &found.pairs, &["n", "above", "tied"], CLOSED);
        self.each(&of_pair, &found.pairs, &["difference", "se"], FITTED);
    }

    /// What R computes without draws.
    fn of_adjustment(&mut self, found: &Adjusted) {
        let id = "adjustment";
        let of_all = [
            "n",
            "n_participants",
            "changes",
            "pse",
            "pse_ci95_lo",
            "pse_ci95_hi",
            "pse_sd",
        ];
        self.add(id, found, &of_all, CLOSED);
        let tested = ["ci95_lo", "ci95_hi", "t", "df", "p"];
        let error = [&["standard", "mean", "relative"][..], &tested[..]].concat();
        self.add(&format!("{id}/error"), &found.error, &error, CLOSED);
        let start = [&["ascending", "descending", "difference"][..], &tested[..]].concat();
        self.add(&format!("{id}/start"), &found.start, &start, CLOSED);
        let spread = ["sd", "df", "relative"];
        self.add(&format!("{id}/spread"), &found.spread, &spread, CLOSED);
        let own = ["n", "pse", "ascending", "descending", "sd"];
        self.each(
            &format!("{id}/participant"),
            &found.participants,
            &own,
            CLOSED,
        );
    }

    fn of_preferences(&mut self, pairs: &Preferences) {
        self.add("pairs", &pairs.order, &["order", "order_se"], FITTED);
        let ties = ["tie_log_nu", "tie_log_nu_se"];
        self.add("pairs", &pairs.ties, &ties, FITTED);
        for (name, item) in &pairs.items.0 {
            for (what, of) in [("ability", &item.ability), ("ability_se", &item.ability_se)] {
                let id = format!("pairs/{what}/{}", name.part());
                self.0.push((id, of.number(), FITTED));
            }
        }
        self.each("pairs", &pairs.pairs, &["difference", "se"], FITTED);
        self.of_vaf("pairs/vaf", pairs.vaf.as_ref(), FITTED);
    }
}
