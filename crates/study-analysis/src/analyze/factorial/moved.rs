//! The tests of effects within participants, repeated with other means of the realizations.

use super::Layout;
use crate::analyze::adjusted::Adjusted;
use crate::analyze::cells::Cells;
use crate::analyze::record::EffectName;
use study_plan::protocol::Crossing;
use study_stats::describe::mean;
use study_stats::distribution::t_two_sided;
use study_stats::within::Clustered;

/// An effect whose test can be repeated with means that are moved.
pub(in crate::analyze) struct Movable {
    pub(in crate::analyze) name: EffectName,
    /// What the effect adds to the mean of each realization: the mean at its levels of the factors, less what follows
    /// from fewer of them.
    pub(in crate::analyze) share: Vec<f64>,
    contrasts: Vec<Contrast>,
}

/// A contrast of the effect, whose precision does not depend on the means.
struct Contrast {
    /// By realization.
    weights: Vec<f64>,
    estimate: f64,
    se: f64,
    df: f64,
}

impl Movable {
    /// The size of t of the clearest contrast, and its p times their number, if the means were higher by
    /// these numbers.
    pub(in crate::analyze) fn tested(&self, by: &[f64]) -> Option<(f64, f64)> {
        let test = |contrast: &Contrast| {
            let moved = contrast.weights.iter().zip(by).map(|(w, by)| w * by);
            let t = (contrast.estimate + moved.sum::<f64>()) / contrast.se;
            Some((t_two_sided(t, contrast.df)?, t.abs()))
        };
        let tests: Vec<(f64, f64)> = self.contrasts.iter().map(test).collect::<Option<_>>()?;
        let (p, t) = tests.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some((t, (p * self.contrasts.len() as f64).min(1.0)))
    }
}

/// Those of the effects that are tested. None where the group is a factor: differences between groups are not compared
/// within participants.
pub(in crate::analyze) fn movable(
    cells: &Cells<'_>,
    adjusted: &Adjusted,
    crossing: &Crossing,
    clustered: &Clustered,
) -> Vec<Movable> {
    if !crossing.groups.is_empty() {
        return Vec::new();
    }
    let layout = Layout::of(cells, crossing, None, &adjusted.models);
    let (Ok(layout), Ok(means)) = (layout, adjusted.means.as_ref()) else {
        return Vec::new();
    };
    let one = |effect: &Vec<usize>| {
        let contrast = |weights: &Vec<f64>| {
            let weights = layout.over_realizations(weights, means.len());
            let found = clustered.contrast(&weights)?;
            // Without t there is no error to test by.
            found.t?;
            Some(Contrast {
                estimate: found.estimate,
                se: found.se,
                df: found.df?,
                weights,
            })
        };
        let contrasts: Option<Vec<Contrast>> =
            layout.contrasts_of(effect).iter().map(contrast).collect();
        Some(Movable {
            name: crossing.effect_name(effect).as_str().into(),
            share: share(&layout, means, effect),
            contrasts: contrasts?,
        })
    };
    crossing.effects.iter().filter_map(one).collect()
}

/// What an effect adds to the mean of each realization: over all choices of its factors the mean at these levels,
/// with a minus where their number is odd less.
fn share(layout: &Layout<'_>, means: &[f64], effect: &[usize]) -> Vec<f64> {
    let sizes = layout.crossing.sizes();
    let of_combination: Vec<f64> = (layout.columns.iter())
        .map(|own| own.iter().map(|j| means[*j]).sum::<f64>() / own.len() as f64)
        .collect();
    let mut all = vec![0.0; means.len()];
    for (combination, own) in layout.columns.iter().enumerate() {
        let levels = super::digits(&sizes, combination);
        let of_choice = |chosen: usize| {
            let chosen = (effect.iter().enumerate()).filter(|(i, _)| chosen >> i & 1 == 1);
            let at: Vec<(usize, usize)> = chosen.map(|(_, f)| (*f, levels[*f])).collect();
            let sign = match (effect.len() - at.len()) % 2 {
                0 => 1.0,
                _ => -1.0,
            };
            let there = layout.at(&at).into_iter().map(|c| of_combination[c]);
            sign * mean(&there.collect::<Vec<_>>()).unwrap_or(0.0)
        };
        let sum: f64 = (0..1_usize << effect.len()).map(of_choice).sum();
        for &j in own {
            all[j] = sum;
        }
    }
    all
}

#[cfg(test)]
mod tests {
    use super::super::tests::{ALL, FRICTION, GRAIN, RATINGS, analyzed, crossing};
    use crate::analyze::{Analysis, Question};
    use study_session::outcome::ratings::Ratings;
    use study_stats::paired::holm;

    /// The table with empty ratings of five cells, and ratings that are higher by a number of each realization.
    fn moved_table(higher: impl Fn(usize) -> f64) -> Ratings {
        let missing = [(0, 0), (2, 2), (3, 3), (5, 4), (8, 5)];
        let mut csv = "subject,model,repetition,rating\n".to_owned();
        for (s, (_, ratings)) in RATINGS.iter().enumerate() {
            for (i, rating) in ratings.chars().enumerate() {
                let model = i / 2;
                let name = format!("{}-{}", FRICTION[model / 3], GRAIN[model % 3]);
                let rating = match missing.contains(&(s, model)) {
                    true => String::new(),
                    false => (f64::from(rating.to_digit(10).unwrap()) + higher(model)).to_string(),
                };
                csv += &format!("P{s},{name},{},{rating}\n", i % 2 + 1);
            }
        }
        Ratings::read_csv("table.csv", csv.as_bytes(), None).unwrap()
    }

    /// A mean that is moved is that of ratings that are all moved by as much, and the other effects stay as they are.
    #[test]
    fn effects_are_tried_with_what_is_missing_moved_against_them() {
        let a = analyzed(&moved_table(|_| 0.0), crossing(&[], &ALL));
        let number =
            |a: &Analysis, id: &str| (a.values.number(id)).unwrap_or_else(|| panic!("{id}"));
        let of = |model: usize, id: &str| {
            let name = format!("{}-{}", FRICTION[model / 3], GRAIN[model % 3]);
            number(&a, &id.replace('M', &name))
        };
        let most =
            |model: usize| number(&a, "missing/sd") * of(model, "missing/realization/M/share");
        let mean = |model: usize| of(model, "adjusted/M/mean");
        let mean_of = |own: &[usize]| own.iter().map(|m| mean(*m)).sum::<f64>() / own.len() as f64;
        let all = mean_of(&[0, 1, 2, 3, 4, 5]);
        let friction = |model: usize| match model / 3 {
            0 => mean_of(&[0, 1, 2]) - all,
            _ => mean_of(&[3, 4, 5]) - all,
        };
        let grain = |model: usize| mean_of(&[model % 3, model % 3 + 3]) - all;
        let both = |model: usize| mean(model) - all - friction(model) - grain(model);
        let shares: [(&str, &dyn Fn(usize) -> f64); 3] = [
            ("friction", &friction),
            ("grain", &grain),
            ("friction:grain", &both),
        ];
        for (at, (effect, share)) in shares.iter().enumerate() {
            // All three are shown, so that every mean moves towards no effect, and no farther.
            let by = |model: usize| -share(model).signum() * most(model).min(share(model).abs());
            let moved = analyzed(&moved_table(by), crossing(&[], &ALL));
            let p =
                |a: &Analysis, effect: &str| number(a, &format!("factorial/{effect}/clustered/p"));
            let mut family: Vec<Option<f64>> =
                shares.iter().map(|(name, _)| Some(p(&a, name))).collect();
            let close = |id: &str, expected: f64| {
                let found = number(&a, &format!("missing/moved/effect/{effect}/{id}"));
                assert!(
                    (found / expected - 1.0).abs() < 1e-6,
                    "{effect} {id}: {found} {expected}"
                );
            };
            close("p", number(&a, &format!("factorial/{effect}/p_holm")));
            family[at] = Some(p(&moved, effect));
            close("p_moved", holm(&family)[at].unwrap());
            let finding = a.finding(&Question::Effect((*effect).to_owned())).unwrap();
            let turned = number(&a, &format!("missing/moved/effect/{effect}/p_moved")) > 0.05;
            let code = match turned {
                true => "missing-turns-it",
                false => "missing-does-not-turn-it",
            };
            let caveat = finding.caveats.iter().find(|c| c.code == code);
            let text = &caveat
                .unwrap_or_else(|| panic!("{effect}: {finding:?}"))
                .text;
            assert!(text.contains("always towards no effect"), "{text}");
        }
    }

    /// Where the group is a factor, and where nobody links the levels, no effect is tried.
    #[test]
    fn effects_that_are_not_compared_within_participants_are_not_moved() {
        let groups = crossing(&["novices", "experts"], &ALL);
        let mut ratings = moved_table(|_| 0.0);
        for (subject, (group, _)) in ratings.subjects.iter_mut().zip(RATINGS) {
            subject.group = Some(group.to_owned());
        }
        let a = analyzed(&ratings, groups);
        assert!(
            a.values
                .iter()
                .all(|(id, _)| !id.starts_with("missing/moved/effect"))
        );

        // Each participant felt one friction: a difference of frictions may be one of participants.
        let mut csv = "subject,model,rating\n".to_owned();
        for (s, (_, ratings)) in RATINGS.iter().enumerate() {
            for (grain, rating) in GRAIN.iter().zip(ratings.chars()) {
                csv += &format!("P{s},{}-{grain},{rating}\n", FRICTION[s % 2]);
            }
        }
        let ratings = Ratings::read_csv("t.csv", csv.as_bytes(), None).unwrap();
        let a = analyzed(&ratings, crossing(&[], &ALL));
        for (effect, is_told) in [("friction", false), ("friction:grain", true)] {
            let found = a.finding(&Question::Effect(effect.to_owned())).unwrap();
            assert_eq!(found.reason().is_none(), is_told, "{found:?}");
        }
        let friction = a.finding(&Question::Effect("friction".to_owned())).unwrap();
        assert!(friction.reason().unwrap().contains("no participants link"));
    }
}
