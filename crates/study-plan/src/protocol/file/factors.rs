//! `[[factors]]`, and the `levels` of realizations.

use super::agree::{at, collision, unknown};
use super::models::PartialModel;
use crate::protocol::factors::{
    self, Factor, GROUP, MAX_COMBINATIONS, MAX_FACTORS, is_crossed, is_factor,
};
use crate::protocol::keys::{Id, Key, Kind, keys};
use crate::protocol::section::Section;
use crate::protocol::{AnalysisRules, Groups};
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::Document;
use study_base::text::{ModelId, Untrusted};

pub(super) const FACTORS: &[Key] = keys! {
    /// The name of the factor. It becomes a column of the results.
    "id": Kind::Id(Id::Question), r#""friction""#, required;
    /// Its levels, in their order; at least two.
    "levels": Kind::Texts(2), r#"["low", "high"]"#, required;
};

pub(super) fn read(mut section: Section<'_, '_>) -> Option<Factor> {
    let id = section.question_id("id");
    let given = section.texts("levels");
    let mut levels: Vec<String> = Vec::new();
    for (value, level) in given {
        if levels.contains(&level) {
            let what = format!("the level `{}` is there twice", Untrusted(&level));
            value.fault(Fault::error(what));
        }
        levels.push(level);
    }
    Some(Factor { id: id?, levels })
}

/// Checks that the realizations under study are a full crossing of the factors, and that the
/// formula of `[analysis]` names them.
pub(super) fn agree(
    factors: &[Factor],
    models: &[PartialModel],
    groups: Option<&Groups>,
    analysis: Option<&AnalysisRules>,
    document: &Document<'_>,
) {
    let fault = |place: &str, key: &str, fault: Fault| {
        document.fault(fault.at(at(document, place, key)));
    };
    if factors.is_empty() {
        for model in models.iter().filter(|m| !m.levels.is_empty()) {
            let what = format!("`{}` has levels, and there are no [[factors]]", model.path);
            let hint = "declare each factor with its levels: [[factors]] id = \"friction\", levels = [\"low\", \"high\"]";
            fault(&model.path, "levels", Fault::error(what).hint(hint));
        }
        if analysis.is_some_and(|a| a.model.is_some()) {
            let what = "`analysis.model` names effects, and there are no [[factors]]";
            fault("analysis", "model", Fault::error(what));
        }
        return;
    }
    for (i, factor) in factors.iter().enumerate() {
        let place = format!("factors[{i}]");
        let id = factor.id.as_str();
        if id.eq_ignore_ascii_case(GROUP) {
            let what = "`group` is the factor between participants that [groups] declares";
            fault(
                &place,
                "id",
                Fault::error(what).label("choose another name"),
            );
        }
        let same = |other: &&Factor| other.id.as_str().eq_ignore_ascii_case(id);
        if let Some(other) = factors[..i].iter().find(same) {
            fault(&place, "id", collision(id, other.id.as_str()));
        }
    }
    let combinations = (factors.iter()).fold(1_usize, |n, f| n.saturating_mul(f.levels.len()));
    if factors.len() > MAX_FACTORS || combinations > MAX_COMBINATIONS {
        let what = format!(
            "{} factors with {combinations} combinations of levels are more than {MAX_FACTORS} factors or {MAX_COMBINATIONS} combinations",
            factors.len()
        );
        return fault("factors[0]", "id", Fault::error(what));
    }
    let mut faulty = false;
    for model in models {
        faulty |= !levels(model, factors, &fault);
    }
    if !faulty {
        missing(factors, models, &fault);
    }
    let Some((analysis, formula)) = analysis.and_then(|a| Some((a, a.model.as_deref()?))) else {
        return;
    };
    let mut names: Vec<&str> = factors.iter().map(|f| f.id.as_str()).collect();
    let crossed = (models.iter())
        .filter(|m| is_crossed(m.role, m.duplicate_of.is_some()))
        .filter_map(|m| m.id.as_ref().map(ModelId::as_str));
    let group = groups.filter(|groups| is_factor(groups, crossed.clone()));
    names.extend(group.map(|_| GROUP));
    if let Err(why) = factors::effects(formula, analysis.primary.as_str(), &names) {
        let fault_of = Fault::error(format!("`analysis.model` cannot be read: {why}"));
        fault("analysis", "model", fault_of);
    }
}

/// Whether the levels of a realization are those of the factors.
fn levels(model: &PartialModel, factors: &[Factor], fault: &impl Fn(&str, &str, Fault)) -> bool {
    let place = &model.path;
    if !is_crossed(model.role, model.duplicate_of.is_some()) {
        if model.levels.is_empty() {
            return true;
        }
        let what = format!("`{place}` has levels, and does not take part in the tests");
        let hint = "only realizations of role \"test\" that repeat no other have levels";
        fault(place, "levels", Fault::error(what).hint(hint));
        return false;
    }
    let mut right = true;
    for (name, level) in &model.levels {
        let key = format!("levels.{name}");
        let known = factors.iter().find(|f| f.id.as_str() == name);
        let Some(factor) = known else {
            let ids = factors.iter().map(|f| f.id.as_str());
            fault(place, &key, unknown("factor", name, ids));
            right = false;
            continue;
        };
        if !factor.levels.contains(level) {
            let of = format!("level of `{name}`");
            let levels = factor.levels.iter().map(String::as_str);
            fault(place, &key, unknown(&of, level, levels));
            right = false;
        }
    }
    for factor in factors {
        if !model.levels.contains_key(factor.id.as_str()) {
            let what = format!("`{place}` has no level of the factor `{}`", factor.id);
            let example = factor.levels.first().map_or("", String::as_str);
            let hint = format!(
                "levels = {{ {} = \"{}\", … }}",
                factor.id,
                Untrusted(example)
            );
            fault(place, "levels", Fault::error(what).hint(hint));
            right = false;
        }
    }
    right
}

/// Reports the combinations of levels that no realization has.
fn missing(factors: &[Factor], models: &[PartialModel], fault: &impl Fn(&str, &str, Fault)) {
    let mut combinations: Vec<Vec<&str>> = vec![Vec::new()];
    for factor in factors {
        let longer = combinations.iter().flat_map(|start| {
            factor.levels.iter().map(move |level| {
                let mut one = start.clone();
                one.push(level.as_str());
                one
            })
        });
        combinations = longer.collect();
    }
    let has = |combination: &Vec<&str>, model: &PartialModel| {
        let same = |(factor, level): (&Factor, &&str)| {
            (model.levels.get(factor.id.as_str())).is_some_and(|own| own == level)
        };
        is_crossed(model.role, model.duplicate_of.is_some())
            && factors.iter().zip(combination).all(same)
    };
    combinations.retain(|combination| !models.iter().any(|model| has(combination, model)));
    let Some(first) = combinations.first() else {
        return;
    };
    let named = |(factor, level): (&Factor, &&str)| format!("{} = {}", factor.id, Untrusted(level));
    let first: Vec<String> = factors.iter().zip(first).map(named).collect();
    let more = match combinations.len() - 1 {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    let what = format!(
        "no realization under study has {}{more}: a factorial design crosses every level with every other",
        first.join(", ")
    );
    let hint = "give each combination a realization, or leave the levels that are not crossed out of [[factors]]";
    fault("factors[0]", "levels", Fault::error(what).hint(hint));
}
