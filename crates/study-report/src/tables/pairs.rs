//! Tables of differences: pairs of realizations, from references, from hidden duplicates.

use crate::apa::{self, bare_p, three, two, whole};
use crate::sentences;
use crate::table::{Builder, Table, file, none, report};
use study_analysis::analyze::{Analysis, MAX_PAIRED, Pair, RealizationSummary, pair_id};
use study_base::text::counted;
use study_session::outcome::Role;

/// A number; what cancelling thirds leave of 0 is 0.
fn cancelled(x: f64) -> f64 {
    if x.abs() < 1e-9 { 0.0 } else { x }
}

/// The comparisons that decide which pairs differ.
pub(crate) fn pairs(a: &Analysis) -> Table {
    let wilcoxon = |first: &str, second: &str| {
        let id = pair_id("posthoc", first, second);
        a.values.number(&format!("{id}/p_wilcoxon_exact_holm"))
    };
    let any = (a.pairs.iter()).any(|p| wilcoxon(&p.first, &p.second).is_some());
    let note = a.pairs.iter().find_map(|p| p.test.as_ref()).map(|test| {
        let means = match a.design.uses_complete() {
            true => "cell means over participants",
            false => "adjusted means",
        };
        format!(
            "Differences of {means}; the intervals are not corrected for the number of pairs, p ({}) has \
             Holm's correction over {}.",
            sentences::test_name(test.kind),
            counted(test.comparisons, "pair", "pairs")
        )
    });
    let t = |p: &Pair| Some(cancelled(p.test.as_ref()?.statistic.as_ref()?.value));
    Builder::new("Pairs of realizations", &a.pairs, &none)
        .text(report("pair (a − b)"), &|p| {
            format!("{} − {}", apa::name(&p.first), apa::name(&p.second))
        })
        .number(report("difference"), three, &|p| {
            Some(cancelled(p.difference.value))
        })
        .ends(report("95 % CI"), two, &|p| p.difference.ci95)
        .number(report("dz"), two, &|p| p.dz.map(cancelled))
        .number(report("t"), two, &t)
        .text(report("p (Holm)"), &|p| {
            let p = p.test.as_ref().map(|t| apa::p_beside(t.p, t.level));
            p.map_or_else(|| "–".to_owned(), |p| p.trim_start_matches("= ").to_owned())
        })
        .number(report("p (Wilcoxon, Holm)").when(any), bare_p, &|p| {
            wilcoxon(&p.first, &p.second)
        })
        .notes(note)
}

/// `pairs.csv`: all tests of every pair of realizations, a minus b, whatever decides.
pub(crate) fn posthoc(a: &Analysis) -> Table {
    let names: Vec<&str> = a.tested().map(|m| m.id.as_str()).collect();
    let few = names.len() <= MAX_PAIRED;
    let get = |(first, second): (&str, &str), what: &str| {
        let id = pair_id("posthoc", first, second);
        a.values.number(&format!("{id}/{what}"))
    };
    let all = names.iter().enumerate().filter(|_| few);
    let all = all.flat_map(|(i, first)| names[i + 1..].iter().map(move |second| (*first, *second)));
    let defined = all.filter(|pair| get(*pair, "mean_diff").is_some());
    Builder::new("", defined, &get)
        .text(file("pair"), &|p| format!("{}|{}", p.0, p.1))
        .in_file("mean_diff")
        .in_file("t")
        .in_file("p_t")
        .in_file("p_t_holm")
        .in_file("dz")
        .in_file("d_av")
        .in_file("wilcoxon_n")
        .in_file("wilcoxon_Wplus")
        .in_file("p_wilcoxon_exact")
        .in_file("p_wilcoxon_exact_holm")
        .in_file("p_wilcoxon_normal")
        .in_file("rank_biserial")
        .text(file("first"), &|p| p.0.to_owned())
        .text(file("second"), &|p| p.1.to_owned())
        .done()
}

/// Each tested realization minus each reference, anchor and physical sample.
pub(crate) fn against_references(a: &Analysis) -> Vec<Table> {
    let roles = [
        Role::HiddenReference,
        Role::Physical,
        Role::LowAnchor,
        Role::MidAnchor,
    ];
    let references = a.realizations.iter().filter(|m| roles.contains(&m.role));
    references.map(|r| against(a, r)).collect()
}

fn against(a: &Analysis, r: &RealizationSummary) -> Table {
    let role = r.role.as_str().replace('-', " ");
    let caption = format!("Differences from {} ({role})", apa::name(&r.id));
    let get = |t: &RealizationSummary, what: &str| a.about("reference", &[&r.id, &t.id], what);
    let equivalence = a.tested().any(|t| get(t, "p_tost").is_some());
    let compared = a.tested().filter(|t| get(t, "mean_diff").is_some());
    Builder::new(&caption, compared, &get)
        .name("realization", "model", &|t| t.id.clone())
        .stat("n", "n", whole)
        .stat("difference", "mean_diff", three)
        .interval(report("95 % CI"), "ci95", two)
        .stat("p (t, Holm)", "p_t_holm", bare_p)
        .stat_as(
            report("p (equivalence)").when(equivalence),
            "p_tost",
            bare_p,
        )
        .done()
}

/// Each hidden duplicate minus its original.
pub(crate) fn repeats(a: &Analysis) -> Table {
    let get = |(id, _): (&str, &str), what: &str| a.about("duplicate", &[id], what);
    let all = a.realizations.iter();
    let all = all.filter_map(|m| Some((m.id.as_str(), m.duplicate_of.as_deref()?)));
    let compared = all.filter(|m| get(*m, "mean_diff").is_some());
    let caption = "Hidden duplicates minus their originals, over participants";
    Builder::new(caption, compared, &get)
        .name("duplicate", "duplicate", &|m| m.0.to_owned())
        .name("of", "of", &|m| m.1.to_owned())
        .stat("n", "n", whole)
        .stat("difference", "mean_diff", three)
        .interval(report("95 % CI"), "ci95", two)
        .stat("mean |difference|", "mean_absolute_diff", three)
        .done()
}
