//! Contrasts with other realizations: `reference/*` compares each tested realization
//! with each reference, anchor and physical sample over subjects; `duplicate/*` is
//! a hidden duplicate minus its original.

use super::Rules;
use super::cells::Cells;
use super::exclude;
use super::identifiers::group_id;
use super::values::Values;
use crate::protocol::Role;
use study_stats::describe::{is_constant, mean, rounded};
use study_stats::level::rejects;
use study_stats::paired::{equivalence, holm, one_sample};

pub(super) fn reference(cells: &Cells<'_>, rules: &Rules, values: &mut Values) {
    duplicates(cells, values);
    let tests = cells.tested();
    for (m, model) in cells.ratings.models.iter().enumerate() {
        match model.role {
            Role::Test | Role::Practice => {}
            Role::HiddenReference | Role::LowAnchor | Role::MidAnchor | Role::Physical => {
                contrasts(cells, m, &tests, rules, values);
            }
        }
    }
}

/// Tested realization minus reference, over the subjects who rated both.
fn contrasts(cells: &Cells<'_>, r: usize, tests: &[usize], rules: &Rules, values: &mut Values) {
    let found: Vec<(usize, Vec<f64>)> = (tests.iter())
        .map(|&t| {
            let pair = cells.table(&[t, r]);
            (t, differences(&pair.rows))
        })
        .collect();
    let p: Vec<Option<f64>> = (found.iter())
        .map(|(_, d)| one_sample(d).and_then(|t| t.p))
        .collect();
    let p_holm = holm(&p);
    for ((t, differences), p_holm) in found.iter().zip(p_holm) {
        let (r, t) = (cells.model_name(r), cells.model_name(*t));
        let test = one_sample(differences);
        let mut g = values.group(
            group_id("reference", &[r, t]),
            if differences.len() < 2 {
                "fewer than two subjects rated both"
            } else {
                "all differences are equal"
            },
        );
        g.put("n", differences.len() as f64);
        g.put_or("mean_diff", mean(differences), "nobody rated both");
        g.interval("ci95", test.map(|t| t.ci95));
        g.maybe("t", test.and_then(|t| t.t));
        g.maybe("p_t", test.and_then(|t| t.p));
        g.maybe("p_t_holm", p_holm);
        let Some(margin) = rules.equivalence_margin else {
            g.put_or("p_tost", None, "no equivalence margin was preregistered");
            continue;
        };
        let e = equivalence(differences, margin);
        g.put("margin", margin);
        g.maybe("t_lower", e.map(|e| e.t_lower));
        g.maybe("t_upper", e.map(|e| e.t_upper));
        g.maybe("p_tost", e.map(|e| e.p));
        g.interval("ci90", e.map(|e| e.ci90));
        g.maybe(
            "equivalent",
            e.map(|e| f64::from(u8::from(rejects(e.p, rules.alpha)))),
        );
    }
}

/// First minus second of each row; equal numbers if they differ by rounding only.
fn differences(rows: &[Vec<f64>]) -> Vec<f64> {
    let exact: Vec<f64> = rows.iter().map(|r| r[0] - r[1]).collect();
    let equal: Vec<f64> = exact.iter().map(|d| rounded(*d)).collect();
    if is_constant(&equal) { equal } else { exact }
}

/// Hidden duplicate minus original, over subjects.
fn duplicates(cells: &Cells<'_>, values: &mut Values) {
    for (d, o) in exclude::pairs(cells.ratings) {
        let pair = cells.table(&[d, o]);
        let differences = differences(&pair.rows);
        let sizes: Vec<f64> = differences.iter().map(|v| v.abs()).collect();
        let test = one_sample(&differences);
        let id = group_id("duplicate", &[cells.model_name(d)]);
        let mut g = values.group(id, "fewer than two subjects");
        g.put("n", differences.len() as f64);
        g.maybe("mean_diff", test.map(|t| t.mean));
        g.interval("ci95", test.map(|t| t.ci95));
        let why = match test {
            Some(_) => "all differences are equal",
            None => "fewer than two subjects",
        };
        g.put_or("t", test.and_then(|t| t.t), why);
        g.put_or("p_t", test.and_then(|t| t.p), why);
        g.maybe("mean_absolute_diff", mean(&sizes));
    }
}
