//! Tables of a factorial design: effects, means, differences between levels.

use crate::apa::{self, bare_p, three, two, whole};
use crate::table::{Builder, Table, page, report};
use study_analysis::analyze::Analysis;
use study_analysis::analyze::results::{ContrastName, FactorialEffect, LevelsName};
use study_base::sort::SmallSort as _;

/// The name of an effect, as in a paper.
fn effect_name(name: &str) -> String {
    name.replace(':', " × ")
}

/// Levels in words, in the order of the factors.
fn levels(name: &LevelsName) -> String {
    let one = |(factor, level): &(String, String)| {
        format!("{} = {}", apa::name(factor), apa::name(level))
    };
    let all: Vec<String> = name.0.iter().map(one).collect();
    all.join(", ")
}

/// The analysis of variance.
pub(crate) fn effects(a: &Analysis) -> Table {
    let tests = a.results.evidence.factorial.as_ref();
    let crossing = a.crossing.as_ref();
    // Those that are tested first, in their order.
    let mut all: Vec<(usize, String, &FactorialEffect)> = (tests.iter())
        .flat_map(|tests| &tests.effects)
        .map(|(name, effect)| {
            let order = crossing.and_then(|c| {
                let mut effects = c.effects.iter();
                effects.position(|e| c.effect_name(e) == name.as_str())
            });
            let name = effect_name(name.as_str());
            (order.unwrap_or(usize::MAX), name, effect)
        })
        .collect();
    all.small_sort_by(|x, y| (x.0, x.1.len(), &x.1).cmp(&(y.0, y.1.len(), &y.1)));
    let note = "Analysis of variance of the participants’ means in each combination of levels, over the \
                participants who rated every realization. Degrees of freedom are uncorrected; p has the \
                Greenhouse–Geisser correction, p (Holm) also that over the tested effects. p (ranks): aligned \
                rank transform. η²G: generalized η².";
    let is_empty = all.is_empty();
    let clustered = all.iter().any(|e| e.2.clustered.is_some());
    let within = clustered.then(|| {
        "t, df and p (within): all participants, compared within each, with standard errors clustered by participant; t is that of \
         the clearest contrast, p is corrected over the contrasts of the effect, and p (Holm) over the effects as well."
            .to_owned()
    });
    Builder::new("Effects of the factors", &all)
        .apart(&|e| e.2.p_holm.is_none())
        .text(page("effect").file("effect"), &|e| e.1.clone())
        .field(page("df1").file("df1"), whole, |e| &e.2.df1)
        .field(page("df2").file("df2"), whole, |e| &e.2.df2)
        .field(page("F").file("F"), two, |e| &e.2.f)
        .field(page("ε").file("eps_gg").droppable(0), two, |e| &e.2.eps_gg)
        .field(page("p").file("p_gg").droppable(2), bare_p, |e| &e.2.p_gg)
        .field(page("p (Holm)").file("p_holm"), bare_p, |e| &e.2.p_holm)
        .field(page("p (ranks)").file("art_p").droppable(1), bare_p, |e| {
            &e.2.art_p
        })
        .field(page("η²G").file("ges"), two, |e| &e.2.ges)
        .field(
            page("t (within)").file("clustered_t").when(clustered),
            two,
            |e| e.2.clustered.as_ref().map(|c| &c.t),
        )
        .field(
            report("df").file("clustered_df").when(clustered),
            two,
            |e| e.2.clustered.as_ref().map(|c| &c.df),
        )
        .field(
            page("p (within)").file("clustered_p").when(clustered),
            bare_p,
            |e| e.2.clustered.as_ref().map(|c| &c.p),
        )
        .notes(
            (!is_empty)
                .then(|| note.to_owned())
                .into_iter()
                .chain(within),
        )
}

/// The means at the levels of the factors that are tested and in every combination.
pub(crate) fn means(a: &Analysis) -> Table {
    let tests = a.results.evidence.factorial.as_ref();
    let place = |name: &LevelsName| -> Vec<usize> {
        let Some(crossing) = a.crossing.as_ref() else {
            return Vec::new();
        };
        let group = crossing.factors.len();
        let of = |(factor, level): &(String, String)| {
            let at = (0..=group)
                .find(|at| crossing.name(*at) == factor)
                .unwrap_or(group);
            let level = crossing.levels(at).iter().position(|l| l == level);
            [at, level.unwrap_or(0)]
        };
        let (factors, levels): (Vec<usize>, Vec<usize>) =
            name.0.iter().map(of).map(|[at, level]| (at, level)).unzip();
        [vec![name.0.len()], factors, levels].concat()
    };
    let mut all: Vec<_> = tests.iter().flat_map(|tests| &tests.means).collect();
    all.small_sort_by_key(|(name, _)| place(name));
    Builder::new("Means at the levels of the factors", all)
        .text(report("levels").file("levels"), &|m| levels(m.0))
        .field(report("n").file("n"), whole, |m| &m.1.n)
        .field(report("mean").file("mean"), three, |m| &m.1.mean)
        .field(report("SD").file("sd"), three, |m| m.1.sd.as_ref())
        .ends(report("95 % CI").file("ci95"), two, &|m| {
            m.1.ci95.as_ref()?.ends()
        })
        .done()
}

/// The differences between levels.
pub(crate) fn contrasts(a: &Analysis) -> Table {
    let tests = a.results.evidence.factorial.as_ref();
    let all = tests.iter().flat_map(|tests| &tests.contrasts);
    let name = |name: &ContrastName| {
        let [first, second] = &name.levels;
        format!(
            "{}: {} − {}",
            apa::name(&name.factor),
            apa::name(first),
            apa::name(second)
        )
    };
    let at = |name: &ContrastName| match name.at.0.is_empty() {
        true => "all levels".to_owned(),
        false => levels(&name.at),
    };
    let any = all.clone().next().is_some();
    let has_margin = all.clone().any(|(_, c)| c.equivalence.is_some());
    let equivalence = a.equivalence_margin.filter(|_| has_margin).map(|margin| {
        format!(
            "p (equivalence): two one-sided t tests that the difference is smaller than {margin} points, corrected as p (Holm)."
        )
    });
    let note = "t tests over participants, or within them where many did not rate everything. p (Holm) is corrected over the pairs of levels of a factor; of simple \
                effects over all of a factor in one interaction.";
    Builder::new("Differences between levels", all)
        .text(report("difference").file("contrast"), &|c| name(c.0))
        .text(report("at").file("at"), &|c| at(c.0))
        .field(report("mean").file("difference"), three, |c| {
            &c.1.difference
        })
        .ends(report("95 % CI").file("difference_ci95"), two, &|c| {
            c.1.difference_ci95.ends()
        })
        .field(report("t").file("t"), two, |c| &c.1.t)
        .field(report("df").file("df"), whole, |c| &c.1.df)
        .field(report("p (Holm)").file("p_holm"), bare_p, |c| &c.1.p_holm)
        .field(report("dz").file("dz"), two, |c| c.1.dz.as_ref())
        .ends(report("90 % CI").file("ci90").when(has_margin), two, &|c| {
            c.1.equivalence.as_ref()?.ci90.ends()
        })
        .field(
            report("p (equivalence)")
                .file("p_tost_holm")
                .when(has_margin),
            bare_p,
            |c| c.1.equivalence.as_ref().map(|e| &e.p_tost_holm),
        )
        .notes(any.then(|| note.to_owned()).into_iter().chain(equivalence))
}
