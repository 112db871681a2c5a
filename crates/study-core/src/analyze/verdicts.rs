//! Verdicts: which test answers each question of the study, and its p.
//!
//! The report, the terminal page and the paragraphs take their verdicts from here, so
//! that they cannot disagree. docs/report.md states the rules.

use super::identifiers::{group_id, pair_id};
use super::values::Values;
use super::{Analysis, RealizationSummary};

pub use super::effects::MAX_PAIRED;

/// The level of significance of all tests, two-sided.
pub const ALPHA: f64 = 0.05;

/// Whether p is significant at [`ALPHA`].
pub fn significant(p: f64) -> bool {
    p < ALPHA
}

/// A test that can decide a question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TestKind {
    /// Repeated-measures analysis of variance with the Greenhouse–Geisser correction.
    Anova,
    /// Friedman's test with its exact distribution.
    FriedmanExact,
    /// Friedman's test with the χ² approximation.
    Friedman,
    /// Linear mixed model of all ratings with Satterthwaite's degrees of freedom.
    MixedModel,
    /// Wilcoxon's signed-rank test with its exact distribution.
    WilcoxonExact,
    /// Paired t test.
    PairedT,
    /// Permutation test over all orders of the realizations.
    PermutationExact,
    /// Permutation test over random orders of the realizations.
    PermutationMonteCarlo,
}

/// The test that decides a question.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DecidingTest {
    /// Which test.
    pub kind: TestKind,
    /// Its p, corrected for the number of pairs where several are compared.
    pub p: f64,
}

impl DecidingTest {
    /// Whether it is significant at [`ALPHA`].
    pub fn is_significant(self) -> bool {
        significant(self.p)
    }
}

/// The first of some tests that has a p.
fn first_defined(values: &Values, tests: &[(TestKind, &str)]) -> Option<DecidingTest> {
    tests.iter().find_map(|(kind, id)| {
        let p = values.number(id)?;
        Some(DecidingTest { kind: *kind, p })
    })
}

/// The pairs of realizations that were compared.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ComparedPairs {
    /// Names of both realizations, sorted.
    pub pairs: Vec<(String, String)>,
    /// The smallest p that Wilcoxon's exact test with Holm's correction can give for
    /// this number of participants and pairs; `None` without pairs.
    pub smallest_p: Option<f64>,
}

/// Whether the realizations were identified with a known forgetting factor.
pub(super) fn has_memory(values: &Values) -> bool {
    values.get("covariate/log10_memory/r").is_some()
}

/// Whether two means or VAF are equal but for rounding.
fn is_close(x: f64, y: f64) -> bool {
    (x - y).abs() <= 1e-9 * x.abs().max(1.0)
}

/// How many numbers have an equal among the others.
fn tied(mut numbers: Vec<f64>) -> usize {
    numbers.sort_by(f64::total_cmp);
    let groups = numbers.chunk_by(|x, y| is_close(*x, *y));
    groups.map(<[f64]>::len).filter(|n| *n > 1).sum()
}

impl Analysis {
    /// The realizations that take part in the tests.
    pub fn tested(&self) -> impl Iterator<Item = &RealizationSummary> {
        self.realizations.iter().filter(|m| m.tested)
    }

    /// A descriptive statistic of a realization, such as its `mean`.
    pub fn described(&self, model: &str, statistic: &str) -> Option<f64> {
        self.about("desc", &[model], statistic)
    }

    /// A statistic about something with a name, such as `realistic/M/share`.
    pub fn about(&self, group: &str, names: &[&str], statistic: &str) -> Option<f64> {
        let id = group_id(group, names);
        self.values.number(&format!("{id}/{statistic}"))
    }

    /// The participants that are listed one by one. Untrusted.
    pub fn listed_subjects(&self) -> impl Iterator<Item = &str> {
        let listed = |s: &&str| {
            let id = group_id("subject", &[s]);
            self.values.get(&format!("{id}/n")).is_some()
        };
        self.subjects.iter().map(String::as_str).filter(listed)
    }

    /// The finding that answers a question.
    pub fn finding(&self, question: &super::Question) -> Option<&super::Finding> {
        self.findings.iter().find(|f| f.question == *question)
    }

    /// Mean rating and name of the tested realizations, highest mean first, equal ones by name.
    pub fn ranked(&self) -> Vec<(f64, &str)> {
        let means = self.tested().map(|m| m.id.as_str());
        let mut ranked: Vec<(f64, &str)> = means
            .filter_map(|id| Some((self.described(id, "mean")?, id)))
            .collect();
        ranked.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(y.1)));
        ranked
    }

    /// Whether the realizations were identified with a known forgetting factor.
    pub fn has_memory(&self) -> bool {
        has_memory(&self.values)
    }

    /// The test of whether the realizations differ: the analysis of variance; where it
    /// is undefined Friedman's test, exact if possible; where too few participants
    /// rated every realization, the mixed model.
    pub fn difference_test(&self) -> Option<DecidingTest> {
        let tests = [
            (TestKind::Anova, "rmanova/p_gg"),
            (TestKind::FriedmanExact, "friedman/exact_p"),
            (TestKind::Friedman, "friedman/p"),
            (TestKind::MixedModel, "lmm_model/satterthwaite_p"),
        ];
        first_defined(&self.values, &tests)
    }

    /// The test of whether two realizations differ, with Holm's correction: Wilcoxon's
    /// exact test; where it is undefined the paired t test.
    pub fn pair_test(&self, a: &str, b: &str) -> Option<DecidingTest> {
        let id = pair_id("posthoc", a, b);
        let wilcoxon = format!("{id}/p_wilcoxon_exact_holm");
        let t = format!("{id}/p_t_holm");
        let tests = [
            (TestKind::WilcoxonExact, wilcoxon.as_str()),
            (TestKind::PairedT, t.as_str()),
        ];
        first_defined(&self.values, &tests)
    }

    /// A statistic of a pair: a minus b, or the other way round if the names sort so.
    pub fn paired(&self, a: &str, b: &str, statistic: &str) -> Option<f64> {
        let id = pair_id("posthoc", a, b);
        self.values.number(&format!("{id}/{statistic}"))
    }

    /// Why two realizations were not compared, if they were not.
    pub fn pair_reason(&self, a: &str, b: &str) -> Option<&str> {
        let id = pair_id("posthoc", a, b);
        self.values.reason(&format!("{id}/p_t"))
    }

    /// The permutation test of a correlation over realizations: `pearson`, `spearman`
    /// or `kendall`.
    pub fn permutation_test(&self, correlation: &str) -> Option<DecidingTest> {
        let exact = format!("corr/{correlation}/p_exact_two_sided");
        let random = format!("corr/{correlation}/p_monte_carlo_two_sided");
        let tests = [
            (TestKind::PermutationExact, exact.as_str()),
            (TestKind::PermutationMonteCarlo, random.as_str()),
        ];
        first_defined(&self.values, &tests)
    }

    /// The pairs that were compared; none with more than [`MAX_PAIRED`] realizations.
    pub fn compared_pairs(&self) -> ComparedPairs {
        let mut ids: Vec<&str> = self.tested().map(|m| m.id.as_str()).collect();
        ids.sort_unstable();
        let mut pairs = Vec::new();
        for (i, a) in ids.iter().enumerate().filter(|_| ids.len() <= MAX_PAIRED) {
            for b in &ids[i + 1..] {
                if self.paired(a, b, "mean_diff").is_some() {
                    pairs.push(((*a).to_owned(), (*b).to_owned()));
                }
            }
        }
        let subjects = self.values.number("design/n_subjects_complete");
        let smallest_p = subjects.filter(|_| !pairs.is_empty()).map(|n| {
            let single = 2.0 * 0.5f64.powf(n);
            (single * pairs.len() as f64).min(1.0)
        });
        ComparedPairs { pairs, smallest_p }
    }

    /// Name, mean over participants and VAF of the points of the correlation.
    fn points(&self) -> Vec<(&str, f64, f64)> {
        self.tested()
            .filter_map(|m| {
                Some((
                    m.id.as_str(),
                    self.described(&m.id, "subject_mean/mean")?,
                    m.vaf?,
                ))
            })
            .collect()
    }

    /// How many of the means in the correlation have an equal among the others.
    pub fn tied_means(&self) -> usize {
        tied(self.points().iter().map(|p| p.1).collect())
    }

    /// How many realizations in the correlation share their VAF with another one.
    pub fn tied_vaf(&self) -> usize {
        tied(self.points().iter().map(|p| p.2).collect())
    }

    /// The realization without which no correlation is defined, and what would all be
    /// equal without it: `means` or `VAF`.
    pub fn sole_influence(&self) -> Option<(&str, &'static str)> {
        self.values.number("corr/pearson/r")?;
        let points = self.points();
        let equal_without = |out: usize, of: fn(&(&str, f64, f64)) -> f64| {
            let mut rest = (points.iter().enumerate()).filter(|(i, _)| *i != out);
            let first = rest.next().map(|(_, p)| of(p));
            rest.all(|(_, p)| first.is_some_and(|first| is_close(first, of(p))))
        };
        let all = 0..points.len();
        let means = all.clone().find(|i| equal_without(*i, |p| p.1));
        let vaf = || all.clone().find(|i| equal_without(*i, |p| p.2));
        let (at, what) = means
            .map(|i| (i, "means"))
            .or_else(|| vaf().map(|i| (i, "VAF")))?;
        (points.len() >= 3).then(|| (points[at].0, what))
    }

    /// In the crossed mixed model with VAF: whether the variance between realizations is
    /// estimated as 0. `None` unless the fit is singular.
    pub fn no_variance_beside_vaf(&self) -> Option<bool> {
        let get = |id: &str| self.values.number(&format!("lmm_vaf_crossed/{id}"));
        get("singular").filter(|s| *s == 1.0)?;
        Some(get("var_model").is_none_or(|v| v <= 0.0))
    }
}
