//! What a report looks up in an analysis, besides its findings.

use super::results::{
    AdjustedCells, AdjustedMean, Correlation, Described, Number as _, Realistic, ReferenceTest,
};
use super::{Analysis, Better, Finding, Pair, Question, RealizationSummary};
use study_base::sort::SmallSort as _;

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

/// Adjusted mean and name of realizations, the best first, equal ones by name.
pub(super) fn ranked<'a>(
    names: impl Iterator<Item = &'a str>,
    cells: &AdjustedCells,
    better: Better,
) -> Vec<(f64, &'a str)> {
    let mean = |name: &str| cells.means.get(name)?.mean.number();
    let mut ranked: Vec<(f64, &str)> = names.filter_map(|name| Some((mean(name)?, name))).collect();
    ranked.small_sort_by(|x, y| better.best_first(x.0, y.0).then(x.1.cmp(y.1)));
    ranked
}

impl Analysis {
    /// The realizations that take part in the tests.
    pub fn tested(&self) -> impl Iterator<Item = &RealizationSummary> {
        self.realizations.iter().filter(|m| m.tested)
    }

    /// The ratings of a realization.
    pub fn described(&self, model: &str) -> Option<&Described> {
        self.results.descriptives.desc.get(model)
    }

    /// The share of the ratings of a realization that count as realistic.
    pub fn realistic(&self, model: &str) -> Option<&Realistic> {
        self.results.realistic.get(model)
    }

    /// The mean of a realization on which verdicts rest.
    pub fn adjusted(&self, model: &str) -> Option<&AdjustedMean> {
        self.results.evidence.cells.means.get(model)
    }

    /// A realization minus a reference, anchor or physical sample.
    pub fn against(&self, reference: &str, model: &str) -> Option<&ReferenceTest> {
        let references = &self.results.evidence.references.reference;
        references.get(reference)?.get(model)
    }

    /// The finding that answers a question.
    pub fn finding(&self, question: &Question) -> Option<&Finding> {
        self.findings.iter().find(|f| f.question == *question)
    }

    /// The mean on which verdicts rest and the name of the tested realizations, the best
    /// first, equal ones by name: the adjusted mean if cells are missing, else the mean over
    /// participants.
    pub fn ranked(&self) -> Vec<(f64, &str)> {
        ranked(
            self.tested().map(|m| m.id.as_str()),
            &self.results.evidence.cells,
            self.better,
        )
    }

    /// The comparison of two realizations, the first minus the second.
    pub fn pair(&self, first: &str, second: &str) -> Option<Pair> {
        let (a, b) = (first.min(second), first.max(second));
        let found = self.pairs.iter().find(|p| p.first == a && p.second == b);
        found.map(|p| p.seen_from(first))
    }

    /// The pairs that differ, the higher mean first.
    pub fn different_pairs(&self) -> Vec<Pair> {
        let different = self
            .pairs
            .iter()
            .filter(|p| p.verdict == super::Verdict::Yes);
        let higher_first = |p: &Pair| {
            let higher = if p.difference.value < 0.0 {
                &p.second
            } else {
                &p.first
            };
            p.seen_from(higher)
        };
        different.map(higher_first).collect()
    }

    /// Whether the realizations were identified with a known forgetting factor.
    pub fn has_memory(&self) -> bool {
        self.results.evidence.covariates.log10_memory.is_some()
    }

    /// The correlation over realizations of VAF with the means on which verdicts rest.
    pub fn correlation(&self) -> &Correlation {
        &self.results.evidence.corr_adjusted
    }

    /// Name, mean and VAF of the points of the correlation.
    fn points(&self) -> Vec<(&str, f64, f64)> {
        let means = &self.results.evidence.cells.means;
        let point = |m: &RealizationSummary| means.get(m.id.as_str())?.mean.number().zip(m.vaf);
        let points = self.tested().map(|m| (m.id.as_str(), point(m)));
        points
            .filter_map(|(name, point)| point.map(|(mean, vaf)| (name, mean, vaf)))
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
        self.correlation().pearson.r.number()?;
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
        let model = &self.results.evidence.crossed;
        let variance = model.var_model.number();
        (model.singular.is_set()).then(|| variance.is_none_or(|v| v <= 0.0))
    }
}
