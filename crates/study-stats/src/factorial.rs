//! Factorial designs: every subject has a value in each cell of up to five crossed factors,
//! and may belong to one of several groups.
//!
//! A term is tested as in [`super::anova`], by orthonormal contrasts y = C·(row of the
//! subject): C is a Kronecker product of Helmert contrasts for the factors of the term and of
//! means for the others. With group means ȳg of ng subjects, N = Σ ng and G groups,
//!
//! * a term without the group is tested by the unweighted mean ŷ = Σ ȳg/G,
//!   SS = |ŷ|²·G²/Σ(1/ng);
//! * a term with the group by SS = Σ ng·|ȳg − ȳ|², ȳ the mean of all subjects, as in
//!   [`super::between`];
//! * the error of both is Σ|y − ȳg|², with q(N − G) degrees of freedom, where q is the number
//!   of contrasts: each term has an error of its own.
//!
//! These are type III sums of squares, which test what sum-to-zero contrasts test; with groups
//! of equal size all types agree. [`contrast`] compares cells one degree of freedom at a time,
//! with the weights of [`marginal_pairs`], [`simple_pairs`] and [`interaction_pairs`];
//! [`aligned_ranks`] is the analysis of aligned ranks.
//!
//! Compared with R 4.2.2 (afex 1.2.1, car 3.1.1, emmeans 1.8.4.1):
//! `crates/study-stats/tests/factorial.rs`.

mod aligned;
mod contrasts;
mod table;
#[cfg(test)]
mod tests;

pub use aligned::{AlignedPair, Level, aligned_pairs, aligned_ranks};
pub use contrasts::{
    Contrast, Pair, Weights, What, contrast, group_contrast, interaction_pairs, marginal_pairs,
    product, simple_pairs,
};

use super::anova::{f_test, ratio};
use super::between::between_groups;
use super::matrix::dot;
use std::cmp::Ordering;
use table::{Table, within_contrasts};

/// Most factors within subjects.
pub const MAX_FACTORS: usize = 5;

/// Most cells: the product of the numbers of levels.
pub const MAX_CELLS: usize = 300;

/// Why there is no analysis.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum FactorialError {
    /// Fewer than two subjects.
    #[error("fewer than two participants have a value in every cell")]
    TooFewParticipants,
    /// No factor, and fewer than two groups.
    #[error("there is neither a factor nor a second group")]
    NoTerm,
    /// More than [`MAX_FACTORS`].
    #[error("{0} factors are more than {MAX_FACTORS}")]
    TooManyFactors(usize),
    /// More than [`MAX_CELLS`].
    #[error("the factors have more than {MAX_CELLS} combinations of levels")]
    TooManyCells,
    /// A factor, counted from 0, has fewer than two levels.
    #[error("factor {} has fewer than two levels", .0 + 1)]
    OneLevel(usize),
    /// A row, counted from 0, has not one value for each cell.
    #[error("participant {} has {found} values, and the design {expected} cells", .row + 1)]
    RowLength {
        /// The row.
        row: usize,
        /// Its length.
        found: usize,
        /// The number of cells.
        expected: usize,
    },
    /// A row, counted from 0, has a value that is infinite or not a number.
    #[error("a value of participant {} is not a finite number", .0 + 1)]
    NotFinite(usize),
    /// Not one group for each row.
    #[error("{groups} participants have a group, and {rows} have values")]
    GroupsLength {
        /// Number of rows.
        rows: usize,
        /// Number of elements of `groups`.
        groups: usize,
    },
    /// No row is of this group, but one is of a later one, or all groups are one.
    #[error("no participant is in group {}", .0 + 1)]
    EmptyGroup(usize),
    /// Every subject has a group of their own.
    #[error("no group has two participants, so that nothing tells how much they differ")]
    NoError,
    /// The term has a factor, or the group, that the design has not, or a factor twice.
    #[error("the design has not all factors of the term")]
    UnknownTerm,
    /// A sum of squares exceeds the range of numbers.
    #[error("the values are too large for a sum of squares")]
    Overflow,
}

/// A main effect, or an interaction.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub struct Term {
    /// Places of its factors in the list of levels, ascending.
    pub factors: Vec<usize>,
    /// Whether the group of the subject belongs to it.
    pub group: bool,
}

impl Term {
    /// 1 for a main effect, 2 for an interaction of two, and so on.
    pub fn order(&self) -> usize {
        self.factors.len() + usize::from(self.group)
    }
}

/// In the order of [`terms`].
impl Ord for Term {
    fn cmp(&self, other: &Self) -> Ordering {
        let key = |term: &Self| (term.order(), term.group);
        (key(self).cmp(&key(other))).then_with(|| self.factors.cmp(&other.factors))
    }
}

impl PartialOrd for Term {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

/// All terms of so many factors, and of the group: the main effects, then the interactions of
/// two, and so on; among those of one order the ones with the group are the last.
///
/// ```
/// # use study_stats::factorial::terms;
/// let order: Vec<(Vec<usize>, bool)> =
///     (terms(2, true).into_iter().map(|t| (t.factors, t.group))).collect();
/// let main = [(vec![0], false), (vec![1], false), (vec![], true)];
/// let two = [(vec![0, 1], false), (vec![0], true), (vec![1], true)];
/// assert_eq!(order, [&main[..], &two[..], &[(vec![0, 1], true)]].concat());
/// ```
pub fn terms(factors: usize, group: bool) -> Vec<Term> {
    let factors = factors.min(MAX_FACTORS);
    let subsets = (0..1usize << factors).map(|set| {
        let of_set = (0..factors).filter(|f| set >> f & 1 == 1);
        of_set.collect::<Vec<usize>>()
    });
    let both = if group { &[false, true][..] } else { &[false] };
    let mut terms: Vec<Term> = subsets
        .flat_map(|factors| {
            both.iter().map(move |group| Term {
                factors: factors.clone(),
                group: *group,
            })
        })
        .filter(|term| term.order() > 0)
        .collect();
    terms.sort();
    terms
}

/// The test of one term; q is the number of its contrasts within subjects, N of the subjects,
/// G of the groups.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// What is tested.
    pub term: Term,
    /// Type III sum of squares.
    pub ss: f64,
    /// Sum of squares of its error.
    pub ss_error: f64,
    /// Degrees of freedom: q, times G − 1 with the group.
    pub df1: f64,
    /// Degrees of freedom of the error: q(N − G).
    pub df2: f64,
    /// The F statistic; `None` if the error variance is 0.
    pub f: Option<f64>,
    /// p of F, assuming sphericity.
    pub p: Option<f64>,
    /// Greenhouse & Geisser's (1959) ε from the covariance within groups; 1 if q is 1.
    pub eps_gg: Option<f64>,
    /// p of F with both degrees of freedom multiplied by `eps_gg`.
    pub p_gg: Option<f64>,
    /// Huynh & Feldt's (1976) ε, as Lecoutre (1991) corrected it for groups:
    /// ((N − G + 1)qε − 2)/(q(N − G − qε)) from ε = `eps_gg`; it can exceed 1, and is 1 if q
    /// is 1. `None` if the denominator is not above 0.
    pub eps_hf: Option<f64>,
    /// p of F with both degrees of freedom multiplied by min(`eps_hf`, 1).
    pub p_hf: Option<f64>,
    /// Partial η² = SS/(SS + error); `None` for 0/0.
    pub pes: Option<f64>,
    /// Generalized η² (Olejnik & Algina 2003) of manipulated factors: SS over itself and the
    /// sums of squares of all errors, which include that of the means of subjects.
    pub ges: Option<f64>,
}

impl Effect {
    /// The p to report: [`Self::p_gg`] where sphericity is an assumption, which is with more
    /// than one degree of freedom, and [`Self::p`] otherwise.
    pub fn p_corrected(&self) -> Option<f64> {
        if self.df1 > 1.0 { self.p_gg } else { self.p }
    }
}

/// The analysis of a design.
#[derive(Debug, Clone, PartialEq)]
pub struct Factorial {
    /// In the order of [`terms`].
    pub effects: Vec<Effect>,
    /// Number of subjects.
    pub participants: usize,
}

impl Factorial {
    /// The test of a term.
    pub fn effect(&self, term: &Term) -> Option<&Effect> {
        self.effects.iter().find(|effect| effect.term == *term)
    }
}

/// Analysis of variance of a table with a row for each subject: the means of the cells, where
/// the level of the last factor changes fastest. `levels` has the number of levels of each
/// factor; `groups` the group of each row, counted from 0, or nothing if there is one group.
///
/// ```
/// # use study_stats::factorial::analysis;
/// // Two factors of two levels: each F is the square of a t of differences.
/// let rows = [[1.0, 2.0, 3.0, 5.0], [2.0, 2.0, 4.0, 5.0], [1.0, 3.0, 2.0, 6.0]].map(Vec::from);
/// let found = analysis(&rows, &[2, 2], &[]).unwrap();
/// let f: Vec<String> = (found.effects.iter().map(|e| format!("{:.2}", e.f.unwrap()))).collect();
/// assert_eq!(f, ["196.00", "5.26", "16.00"]);
/// ```
pub fn analysis(
    rows: &[Vec<f64>],
    levels: &[usize],
    groups: &[usize],
) -> Result<Factorial, FactorialError> {
    let table = Table::new(rows, levels, groups)?;
    let effects = terms(levels.len(), table.has_groups()).into_iter();
    Ok(Factorial {
        effects: effects
            .map(|term| effect(&table, levels, term))
            .collect::<Result<_, _>>()?,
        participants: rows.len(),
    })
}

fn effect(table: &Table, levels: &[usize], term: Term) -> Result<Effect, FactorialError> {
    let contrasts = within_contrasts(&term.factors, levels);
    let q = contrasts.len() as f64;
    let (means, y) = table.centered(&contrasts);
    let (ss, df1) = if term.group {
        let groups = table.sizes.len() as f64;
        (between_groups(&means, &table.sizes), q * (groups - 1.0))
    } else {
        (of_unweighted_mean(&means, &table.sizes), q)
    };
    let df = table.df();
    let test = f_test(ss, df1, &y, df, table.least);
    // One contrast has no sphericity to lack.
    let (eps_hf, p_hf) = if contrasts.len() == 1 {
        (test.eps_gg, test.p)
    } else {
        (test.eps_hf, test.p_hf)
    };
    let in_units = |ss: f64| {
        let ss = ss * table.unit * table.unit;
        if ss.is_finite() {
            Ok(ss)
        } else {
            Err(FactorialError::Overflow)
        }
    };
    Ok(Effect {
        term,
        ss: in_units(ss)?,
        ss_error: in_units(test.ss_error)?,
        df1,
        df2: q * df,
        f: test.f,
        p: test.p,
        eps_gg: test.eps_gg,
        p_gg: test.p_gg,
        eps_hf,
        p_hf,
        pes: ratio(ss, ss + test.ss_error),
        ges: ratio(ss, ss + table.errors),
    })
}

/// |Σ ȳg/G|²·G²/Σ(1/ng): the sum of squares of a term that is the same in all groups.
fn of_unweighted_mean(means: &[Vec<f64>], sizes: &[usize]) -> f64 {
    let q = means.first().map_or(0, Vec::len);
    let sums: Vec<f64> = (0..q).map(|j| means.iter().map(|m| m[j]).sum()).collect();
    dot(&sums, &sums) / sizes.iter().map(|n| 1.0 / *n as f64).sum::<f64>()
}
