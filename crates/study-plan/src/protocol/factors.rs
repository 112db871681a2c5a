//! Factors of a design: `[[factors]]`, the levels of each realization, and the effects that
//! are tested.
//!
//! A design is a full crossing: every combination of levels has at least one realization
//! under study. Where every group of participants rates all of them, the group is a factor
//! between participants, by the name [`GROUP`].

use super::{Groups, ModelEntry, Protocol, Role};
use serde::Serialize;
use std::collections::{BTreeMap, BTreeSet};
use study_base::sort::SmallSort as _;
use study_base::text::{QuestionId, Untrusted};

/// The name of the factor between participants: their group.
pub const GROUP: &str = "group";

/// Most factors within participants.
pub const MAX_FACTORS: usize = 5;

/// Most combinations of levels.
pub const MAX_COMBINATIONS: usize = 300;

/// One of `[[factors]]`: what the experimenter varies within participants.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Factor {
    /// Its name, also of its column in `ratings.csv`.
    pub id: QuestionId,
    /// Its levels, in their order; at least two.
    pub levels: Vec<String>,
}

/// A factorial design, as the analysis needs it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Crossing {
    /// The factors within participants.
    pub factors: Vec<Factor>,
    /// Realization → the place of its level in each factor.
    pub levels_of: BTreeMap<String, Vec<usize>>,
    /// The groups of participants, as the levels of one more factor; none if it is no factor.
    pub groups: Vec<String>,
    /// The effects that are tested: each the places of its factors in ascending order, where the
    /// number of factors stands for the group. Main effects come first.
    pub effects: Vec<Vec<usize>>,
}

impl Crossing {
    /// The full crossing of factors within participants: every effect is tested.
    pub fn full(factors: Vec<Factor>, levels_of: BTreeMap<String, Vec<usize>>) -> Self {
        let places: Vec<usize> = (0..factors.len()).collect();
        Self {
            effects: crossed(&places),
            groups: Vec::new(),
            factors,
            levels_of,
        }
    }

    /// The name of an effect: its factors, joined by `:`.
    pub fn effect_name(&self, effect: &[usize]) -> String {
        let names: Vec<&str> = effect.iter().map(|place| self.name(*place)).collect();
        names.join(":")
    }

    /// The levels of a factor by its place, of the last one the groups.
    pub fn levels(&self, place: usize) -> &[String] {
        (self.factors.get(place)).map_or(&self.groups, |factor| &factor.levels)
    }

    /// The name of a factor by its place.
    pub fn name(&self, place: usize) -> &str {
        (self.factors.get(place)).map_or(GROUP, |factor| factor.id.as_str())
    }

    /// The number of levels of each factor.
    pub fn sizes(&self) -> Vec<usize> {
        self.factors.iter().map(|f| f.levels.len()).collect()
    }

    /// The place of a combination of levels, the last factor fastest.
    pub fn place(&self, levels: &[usize]) -> usize {
        let digits = self.factors.iter().zip(levels);
        digits.fold(0, |at, (factor, level)| at * factor.levels.len() + level)
    }
}

impl Protocol {
    /// The factorial design; `None` if there are no factors.
    pub fn crossing(&self) -> Option<Crossing> {
        if self.factors.is_empty() {
            return None;
        }
        let place = |factor: &Factor, model: &ModelEntry| {
            let level = model.levels.get(factor.id.as_str())?;
            factor.levels.iter().position(|l| l == level)
        };
        let levels_of: BTreeMap<String, Vec<usize>> = (self.models.iter())
            .filter_map(|model| {
                let levels = self.factors.iter().map(|factor| place(factor, model));
                Some((model.id.to_string(), levels.collect::<Option<_>>()?))
            })
            .collect();
        let groups = self.groups.as_ref().filter(|groups| {
            let models = levels_of.keys().map(String::as_str);
            is_factor(groups, models)
        });
        let groups: Vec<String> = (groups.iter().flat_map(|groups| &groups.list))
            .map(|group| group.id.to_string())
            .collect();
        let mut names: Vec<&str> = self.factors.iter().map(|f| f.id.as_str()).collect();
        names.extend((!groups.is_empty()).then_some(GROUP));
        let primary = self.analysis.primary.as_str();
        let stated = (self.analysis.model.as_deref())
            .and_then(|formula| effects(formula, primary, &names).ok());
        Some(Crossing {
            factors: self.factors.clone(),
            levels_of,
            groups,
            effects: stated.unwrap_or_else(|| crossed(&(0..names.len()).collect::<Vec<_>>())),
        })
    }
}

/// Whether the group of a participant is a factor: every group rates all of these realizations.
pub(super) fn is_factor<'a>(
    groups: &Groups,
    models: impl Iterator<Item = &'a str> + Clone,
) -> bool {
    groups.list.iter().all(|group| {
        let rates = |model: &str| {
            let listed = group.models.as_ref();
            listed.is_none_or(|own| own.iter().any(|m| m.as_str() == model))
        };
        models.clone().all(rates)
    })
}

/// Whether a realization belongs to the crossing: one under study that repeats no other.
pub(super) fn is_crossed(role: Role, is_duplicate: bool) -> bool {
    role == Role::Test && !is_duplicate
}

/// All effects of some factors: main effects, then interactions, in the order of the factors.
fn crossed(places: &[usize]) -> Vec<Vec<usize>> {
    let subsets = (1_usize..1 << places.len()).map(|chosen| {
        let inside = places
            .iter()
            .enumerate()
            .filter(|(i, _)| chosen >> i & 1 == 1);
        inside.map(|(_, place)| *place).collect()
    });
    sorted(subsets.collect())
}

fn sorted(effects: BTreeSet<Vec<usize>>) -> Vec<Vec<usize>> {
    let mut effects: Vec<Vec<usize>> = effects.into_iter().collect();
    effects.small_sort_by_key(Vec::len);
    effects
}

/// The effects of a formula such as `realism ~ friction * detent`: `a * b` stands for both main
/// effects and their interaction, `a:b` for the interaction alone, `+` adds effects.
///
/// # Errors
/// What is wrong with it, in words.
///
/// ```
/// # use study_plan::protocol::factors::effects;
/// let names = ["friction", "detent"];
/// let found = effects("realism ~ friction * detent", "realism", &names);
/// assert_eq!(found.unwrap(), [vec![0], vec![1], vec![0, 1]]);
/// assert_eq!(effects("realism ~ detent", "realism", &names).unwrap(), [vec![1]]);
/// assert!(effects("realism ~ frictoin", "realism", &names).is_err());
/// ```
pub fn effects(formula: &str, primary: &str, names: &[&str]) -> Result<Vec<Vec<usize>>, String> {
    let Some((response, sum)) = formula.split_once('~') else {
        return Err(format!(
            "it has no `~`: write `{primary} ~ {}`",
            names.join(" * ")
        ));
    };
    if response.trim() != primary {
        return Err(format!(
            "what stands before `~` has to be the primary question `{primary}`, not `{}`",
            Untrusted(response.trim())
        ));
    }
    let place = |name: &str| {
        let found = names.iter().position(|known| *known == name.trim());
        found.ok_or_else(|| match name.trim() {
            "" => "a name is missing between `~`, `+`, `*` and `:`".to_owned(),
            name => format!(
                "there is no factor `{}`; there are `{}`",
                Untrusted(name),
                names.join("`, `")
            ),
        })
    };
    let mut found = BTreeSet::new();
    for term in sum.split('+') {
        let is_product = term.contains('*');
        if is_product && term.contains(':') {
            return Err(format!(
                "`{}` mixes `*` and `:`; write a sum of both",
                Untrusted(term.trim())
            ));
        }
        let places: Result<BTreeSet<usize>, String> = term.split(['*', ':']).map(place).collect();
        let places: Vec<usize> = places?.into_iter().collect();
        if places.len() < term.split(['*', ':']).count() {
            return Err(format!("`{}` names a factor twice", Untrusted(term.trim())));
        }
        match is_product {
            true => found.extend(crossed(&places)),
            false => {
                found.insert(places);
            }
        }
    }
    Ok(sorted(found))
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 3] = ["a", "b", "group"];

    #[test]
    fn a_formula_names_the_effects_that_are_tested() {
        let of = |formula: &str| effects(formula, "y", &NAMES).unwrap();
        assert_eq!(of("y ~ a*b*group").len(), 7);
        assert_eq!(of("y~b + a"), [vec![0], vec![1]]);
        assert_eq!(of("y ~ group:a"), [vec![0, 2]]);
        // The order of the formula changes nothing, and no effect is there twice.
        let expected = [vec![0], vec![1], vec![2], vec![0, 1]];
        assert_eq!(of("y ~ group + b * a + a"), expected);
    }

    #[test]
    fn a_faulty_formula_is_refused_in_words() {
        for (formula, part) in [
            ("a * b", "no `~`"),
            ("x ~ a", "primary question `y`, not `x`"),
            ("y ~ c", "no factor `c`"),
            ("y ~ a + ", "a name is missing"),
            ("y ~ a * b : group", "mixes"),
            ("y ~ a * a", "twice"),
            ("y ~ a - b", "no factor `a - b`"),
            ("y ~ (a + b)", "no factor `(a`"),
        ] {
            let why = effects(formula, "y", &NAMES).unwrap_err();
            assert!(why.contains(part), "{formula}: {why}");
        }
    }

    #[test]
    fn combinations_are_numbered_with_the_last_factor_fastest() {
        let factor = |id: &str, levels: &[&str]| Factor {
            id: QuestionId::new(id).unwrap(),
            levels: levels.iter().map(|l| (*l).to_owned()).collect(),
        };
        let crossing = Crossing {
            factors: vec![factor("a", &["1", "2"]), factor("b", &["x", "y", "z"])],
            levels_of: BTreeMap::new(),
            groups: Vec::new(),
            effects: Vec::new(),
        };
        let all: Vec<usize> = [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]
            .iter()
            .map(|levels| crossing.place(levels))
            .collect();
        assert_eq!(all, [0, 1, 2, 3, 4, 5]);
        assert_eq!((crossing.name(1), crossing.name(2)), ("b", GROUP));
    }
}
