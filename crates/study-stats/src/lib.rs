//! Statistics for rating studies: subjects rate realizations, often several times.
//! (A realization is one of the things that are rated; other fields say item,
//! stimulus or condition.) Numbers in, estimates out: no files, no names.
//!
//! | question | module |
//! |---|---|
//! | Means, standard deviations, quantiles | [`describe`] |
//! | Do the realizations differ? | [`anova`], [`friedman`] (rank test), [`lmm`] (unbalanced data), [`clm`] and [`clmm`] (ordered categories) |
//! | The same of counts, shares and positive numbers, with random effects | [`glmm`] |
//! | Which factors of a crossed design have effects, and which interact? | [`factorial`] (also by aligned ranks, and with groups) |
//! | Do groups of subjects differ, or does a difference depend on the group? | [`between`] (equal variances), [`between::welch`] (variances of their own) |
//! | Do the ratings follow a given order? | [`friedman::page`] |
//! | The same where not everybody rated everything, within subjects | [`within`] (equal variances), [`within::Clustered`] (errors correlated within subjects) |
//! | How probable is it that one realization is above another, on an ordered scale? | [`ordinal_hierarchy`] |
//! | Which pairs differ? Are they equivalent? | [`paired`] |
//! | Are the ratings correlated with a covariate? | [`correlation`], [`permutation`] (exact p), [`bootstrap`] (interval), [`bayes`] |
//! | What is the slope on a covariate? | [`regression`], [`two_way_slope`] (beside two fixed factors), [`lmm`] (random effects) |
//! | Do the raters agree? | [`agreement`], [`disagreement`] (interaction of subject and realization) |
//! | Does a rating depend on the one before? | [`carry_over`] |
//! | Does an answer depend on the trial before? | [`sequential`] |
//! | How large an effect would be found? How many subjects and realizations does it take? | [`power`] |
//! | How large is a share of trials? | [`proportion`] |
//! | At which level is a stimulus felt? | [`psychometric`] |
//! | How well are two stimuli told apart? | [`detection`] |
//! | Which is preferred, in pairs? | [`pairs`] |
//! | Which is preferred, in rankings, and do participants agree? | [`ranking`] |
//! | Which is preferred in a space of stimuli, and which pair tells most? | [`preference_gp`] |
//! | Which components of an error decide what is preferred? | [`choice_weights`] |
//! | How do estimated magnitudes grow? | [`magnitude`] |
//! | How well are several stimuli identified, and which are confused? | [`identification`] |
//! | How different do stimuli seem, and along which dimensions? | [`similarity`] |
//! | At which level do two stimuli feel equal, as subjects set it? | [`adjustment`] |
//! | Who is screened in a MUSHRA test? | [`mushra`] |
//! | Does a test reject at its level? | [`level`] |
//! | Can a printed mean and standard deviation be right? | [`grim`] |
//! | Tail probabilities, quantiles, ranks | [`distribution`], [`rank`] |
//!
//! # Conventions
//!
//! * Columns are slices of `f64`; paired columns have to be equally long. A table is a
//!   slice of rows of equal length, one row for each subject (or target, or unit).
//! * A result that is not defined for its input is `None`: too few numbers, no variation,
//!   unequal lengths, an overflow. No function returns NaN, an infinity or an invented
//!   0 or 1. [`lmm`], [`glmm`], [`clm`] and [`clmm`] give the reason as an error. Input has to be
//!   finite.
//! * Estimates are in the units of the input, variances in their squares. p values are
//!   two-sided unless the name says otherwise; intervals are (lower, upper) with 95 %
//!   coverage, `ci90` with 90 %.
//! * Numbers that agree to 10⁻¹⁰ are tied ([`describe::rounded`]).
//! * Random numbers come from the caller ([`random`]).
//!
//! The formula and its source stand above each function; `docs/statistics.md` of the
//! repository collects them, and says what every result was compared with.
//! `examples/ratings.rs` is a short analysis.

pub mod adjustment;
pub mod agreement;
pub mod anova;
pub mod bayes;
pub mod between;
pub mod bootstrap;
pub mod carry_over;
pub mod choice_weights;
pub mod clm;
pub mod clmm;
pub mod correlation;
pub mod describe;
pub mod detection;
pub mod disagreement;
pub mod distribution;
pub mod factorial;
pub mod friedman;
pub mod glmm;
pub mod grim;
pub mod identification;
pub mod level;
pub mod lmm;
pub mod magnitude;
mod matrix;
pub mod mushra;
pub mod ordinal_hierarchy;
pub mod paired;
pub mod pairs;
pub mod permutation;
pub mod power;
pub mod preference_gp;
pub mod proportion;
pub mod psychometric;
mod quadrature;
pub mod questionnaire;
pub mod random;
pub mod rank;
pub mod ranking;
pub mod regression;
pub mod sequential;
pub mod similarity;
pub mod two_way_slope;
pub mod within;

/// The number, unless it is infinite or NaN.
pub(crate) fn finite(x: f64) -> Option<f64> {
    x.is_finite().then_some(x)
}

/// The rows of a table; `None` if there are none, or if they are empty or differ in
/// length.
pub(crate) fn rectangular<R: AsRef<[f64]>>(rows: &[R]) -> Option<Vec<&[f64]>> {
    let width = rows.first()?.as_ref().len();
    let rows: Vec<&[f64]> = rows.iter().map(AsRef::as_ref).collect();
    (width > 0 && rows.iter().all(|row| row.len() == width)).then_some(rows)
}
