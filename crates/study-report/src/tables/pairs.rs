//! Tables of differences: pairs of realizations, from references, from hidden duplicates.

use crate::apa::{self, bare_p, three, two, whole};
use crate::sentences;
use crate::table::{Builder, Table, file, page, report};
use study_analysis::analyze::results::{Number as _, PairName, Posthoc, ReferenceTest, Stat};
use study_analysis::analyze::{Analysis, MAX_PAIRED, Pair, RealizationSummary};
use study_base::text::counted;
use study_session::outcome::Role;

/// A number; what cancelling thirds leave of 0 is 0.
fn cancelled(x: f64) -> f64 {
    if x.abs() < 1e-9 { 0.0 } else { x }
}

/// The comparisons that decide which pairs differ.
pub(crate) fn pairs(a: &Analysis) -> Table {
    let wilcoxon = |p: &Pair| {
        let posthoc = a.results.posthoc.get(&PairName::of(&p.first, &p.second))?;
        posthoc.p_wilcoxon_exact_holm.number()
    };
    let any = a.pairs.iter().any(|p| wilcoxon(p).is_some());
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
    Builder::new("Pairs of realizations", &a.pairs)
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
        .number(report("p (Wilcoxon, Holm)").when(any), bare_p, &wilcoxon)
        .notes(note)
}

/// `pairs.csv`: all tests of every pair of realizations, a minus b, whatever decides.
pub(crate) fn posthoc(a: &Analysis) -> Table {
    let names: Vec<&str> = a.tested().map(|m| m.id.as_str()).collect();
    let few = names.len() <= MAX_PAIRED;
    let all = names.iter().enumerate().filter(|_| few);
    let all = all.flat_map(|(i, first)| names[i + 1..].iter().map(move |second| (*first, *second)));
    let tests = all.filter_map(|(first, second)| {
        let posthoc = a.results.posthoc.get(&PairName::of(first, second))?;
        posthoc.mean_diff.number()?;
        Some((first, second, posthoc))
    });
    type Column = (&'static str, fn(&Posthoc) -> &Stat);
    let columns: [Column; 12] = [
        ("mean_diff", |p| &p.mean_diff),
        ("t", |p| &p.t),
        ("p_t", |p| &p.p_t),
        ("p_t_holm", |p| &p.p_t_holm),
        ("dz", |p| &p.dz),
        ("d_av", |p| &p.d_av),
        ("wilcoxon_n", |p| &p.wilcoxon_n),
        ("wilcoxon_Wplus", |p| &p.wilcoxon_w_plus),
        ("p_wilcoxon_exact", |p| &p.p_wilcoxon_exact),
        ("p_wilcoxon_exact_holm", |p| &p.p_wilcoxon_exact_holm),
        ("p_wilcoxon_normal", |p| &p.p_wilcoxon_normal),
        ("rank_biserial", |p| &p.rank_biserial),
    ];
    let mut table = Builder::new("", tests).text(file("pair"), &|p| format!("{}|{}", p.0, p.1));
    for (name, of) in columns {
        table = table.field(file(name), two, |p| of(p.2));
    }
    table
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
    let tests: Vec<(&str, &ReferenceTest)> = (a.tested())
        .filter_map(|t| Some((t.id.as_str(), a.against(&r.id, &t.id)?)))
        .filter(|(_, test)| test.mean_diff.number().is_some())
        .collect();
    let equivalence = tests.iter().any(|(_, test)| test.p_tost.number().is_some());
    let equivalence = report("p (equivalence)").when(equivalence);
    Builder::new(&caption, tests)
        .name("realization", "model", &|(name, _)| name.to_owned())
        .field(page("n"), whole, |(_, t)| &t.n)
        .field(page("difference"), three, |(_, t)| &t.mean_diff)
        .ends(report("95 % CI"), two, &|(_, t)| t.ci95.ends())
        .field(page("p (t, Holm)"), bare_p, |(_, t)| &t.p_t_holm)
        .field(equivalence, bare_p, |(_, t)| &t.p_tost)
        .done()
}

/// Each hidden duplicate minus its original.
pub(crate) fn repeats(a: &Analysis) -> Table {
    let tests = &a.results.evidence.references.duplicate;
    let all = a.realizations.iter().filter_map(|m| {
        let test = tests.get(m.id.as_str())?;
        Some((m.id.as_str(), m.duplicate_of.as_deref()?, test))
    });
    let compared = all.filter(|(_, _, test)| test.mean_diff.number().is_some());
    let caption = "Hidden duplicates minus their originals, over participants";
    Builder::new(caption, compared)
        .name("duplicate", "duplicate", &|m| m.0.to_owned())
        .name("of", "of", &|m| m.1.to_owned())
        .field(page("n"), whole, |(_, _, t)| &t.n)
        .field(page("difference"), three, |(_, _, t)| &t.mean_diff)
        .ends(report("95 % CI"), two, &|(_, _, t)| t.ci95.ends())
        .field(page("mean |difference|"), three, |(_, _, t)| {
            &t.mean_absolute_diff
        })
        .done()
}
