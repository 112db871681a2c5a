//! Repeated-measures analysis of variance, one-way and two-way, balanced.
//!
//! An effect is tested by orthonormal contrasts C (Helmert contrasts, and Kronecker
//! products of them). With yₛ = C·(row of subject s) and S subjects, SS = S·|ȳ|², its
//! error is Σ|yₛ − ȳ|², and sphericity depends only on the covariance Σ of y. Subtract
//! the grand mean from the numbers beforehand to keep their digits.

use super::distribution::{chi2_upper, f_upper};
use super::matrix::{Cholesky, SymmetricMatrix, dot};
use super::{finite, rectangular};

/// The test of one effect; q is its number of contrasts, S the number of subjects.
#[derive(Debug, Clone, PartialEq)]
pub struct Effect {
    /// Sum of squares of the effect.
    pub ss: f64,
    /// Sum of squares of its interaction with subjects.
    pub ss_error: f64,
    /// Degrees of freedom of the effect: q.
    pub df1: f64,
    /// Degrees of freedom of the error: q(S − 1).
    pub df2: f64,
    /// The F statistic; `None` if the error variance is 0.
    pub f: Option<f64>,
    /// p of F, assuming sphericity.
    pub p: Option<f64>,
    /// Greenhouse & Geisser's (1959) ε = (tr Σ)²/(q tr Σ²).
    pub eps_gg: Option<f64>,
    /// p of F with both degrees of freedom multiplied by `eps_gg`.
    pub p_gg: Option<f64>,
    /// Huynh & Feldt's (1976) ε = (S q ε − 2)/(q(S − 1 − qε)) from `eps_gg`; it can
    /// exceed 1.
    pub eps_hf: Option<f64>,
    /// p of F with both degrees of freedom multiplied by min(`eps_hf`, 1).
    pub p_hf: Option<f64>,
    /// Mauchly's test of sphericity; one-way only. `None` if q < 2, S − 1 < q or the
    /// covariance is singular.
    pub mauchly: Option<Mauchly>,
}

/// Mauchly's test of sphericity (1940): W = det Σ/(tr Σ/q)^q.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mauchly {
    /// W.
    pub w: f64,
    /// p with Box's second-order term (Anderson 1958, §10.7.4).
    pub p: Option<f64>,
    /// p as printed by R. That its second-order term has 3(q + 1) for 3q was inferred
    /// from a printed value, not read in its source; it reproduces all data sets tried.
    pub p_as_r: Option<f64>,
}

/// A one-way analysis: subjects × realizations.
#[derive(Debug, Clone, PartialEq)]
pub struct OneWay {
    /// The effect of the realizations.
    pub effect: Effect,
    /// Sum of squares between subjects.
    pub ss_subject: f64,
    /// Generalized η² = SSm/(SSm + SSs + SSe) (Olejnik & Algina 2003); `None` for 0/0.
    pub ges: Option<f64>,
    /// Partial η² = SSm/(SSm + SSe); `None` for 0/0.
    pub pes: Option<f64>,
}

/// A two-way analysis: subjects × realizations × repetitions.
#[derive(Debug, Clone, PartialEq)]
pub struct TwoWay {
    /// Realizations, repetitions and their interaction, each with its generalized η²:
    /// its sum of squares over itself plus those of all subject terms.
    pub effects: [(Effect, Option<f64>); 3],
}

/// One-way analysis of a table with a row for each subject and a column for each
/// realization. `None` for fewer than two rows or columns.
///
/// ```
/// # use study_stats::anova::one_way;
/// // With two realizations F is the square of the paired t.
/// let found = one_way(&[[4.0, 5.0], [2.0, 4.0], [3.0, 6.0]]).unwrap();
/// assert_eq!(format!("{:.3}", found.effect.f.unwrap()), "12.000");
/// ```
pub fn one_way<R: AsRef<[f64]>>(rows: &[R]) -> Option<OneWay> {
    let rows = &rectangular(rows)?;
    let k = rows[0].len();
    if rows.len() < 2 || k < 2 {
        return None;
    }
    let effect = effect(rows, &helmert(k), true);
    let ss_subject = effect_sums(rows, &[unit(k)]).1;
    let total = effect.ss + ss_subject + effect.ss_error;
    Some(OneWay {
        ges: ratio(effect.ss, total),
        pes: ratio(effect.ss, effect.ss + effect.ss_error),
        ss_subject,
        effect,
    })
}

/// Two-way analysis of a table with a row for each subject: the `repetitions` ratings of
/// the first realization, then those of the second, and so on. `None` for fewer than two
/// subjects, realizations or repetitions.
pub fn two_way<R: AsRef<[f64]>>(rows: &[R], repetitions: usize) -> Option<TwoWay> {
    let rows = &rectangular(rows)?;
    let width = rows[0].len();
    let whole = repetitions >= 2 && width.is_multiple_of(repetitions);
    if rows.len() < 2 || !whole || width < 2 * repetitions {
        return None;
    }
    let models = width / repetitions;
    let (hm, hr) = (helmert(models), helmert(repetitions));
    let (um, ur) = ([unit(models)], [unit(repetitions)]);
    let effects = [
        effect(rows, &kronecker(&hm, &ur), false),
        effect(rows, &kronecker(&um, &hr), false),
        effect(rows, &kronecker(&hm, &hr), false),
    ];
    let subjects = effect_sums(rows, &[unit(width)]).1;
    let errors: f64 = effects.iter().map(|e| e.ss_error).sum::<f64>() + subjects;
    Some(TwoWay {
        effects: effects.map(|e| {
            let ges = ratio(e.ss, e.ss + errors);
            (e, ges)
        }),
    })
}

pub(super) fn ratio(a: f64, b: f64) -> Option<f64> {
    if b > 0.0 { finite(a / b) } else { None }
}

/// q = k − 1 orthonormal contrasts: the j-th compares the first j columns with the next.
pub(super) fn helmert(k: usize) -> Vec<Vec<f64>> {
    (1..k)
        .map(|j| {
            let scale = 1.0 / ((j * (j + 1)) as f64).sqrt();
            let mut row = vec![0.0; k];
            row[..j].fill(scale);
            row[j] = -(j as f64) * scale;
            row
        })
        .collect()
}

/// The contrast of the mean, of norm 1.
pub(super) fn unit(k: usize) -> Vec<f64> {
    vec![1.0 / (k as f64).sqrt(); k]
}

/// The products of each row of `a` with each of `b`; the elements of `b` change fastest.
pub(super) fn kronecker(a: &[Vec<f64>], b: &[Vec<f64>]) -> Vec<Vec<f64>> {
    a.iter()
        .flat_map(|x| {
            b.iter().map(move |y| {
                x.iter()
                    .flat_map(|u| y.iter().map(move |v| u * v))
                    .collect()
            })
        })
        .collect()
}

/// Sum of squares of the effect and of its error, and the centered contrasts by subject.
fn effect_sums(rows: &[&[f64]], contrasts: &[Vec<f64>]) -> (f64, f64, Vec<Vec<f64>>) {
    let n = rows.len() as f64;
    let mut y: Vec<Vec<f64>> = rows
        .iter()
        .map(|row| contrasts.iter().map(|c| dot(c, row)).collect())
        .collect();
    let mut ss = 0.0;
    for j in 0..contrasts.len() {
        let mean = y.iter().map(|v| v[j]).sum::<f64>() / n;
        ss += n * mean * mean;
        for v in &mut y {
            v[j] -= mean;
        }
    }
    let error = y.iter().map(|v| dot(v, v)).sum();
    (ss, error, y)
}

fn effect(rows: &[&[f64]], contrasts: &[Vec<f64>], with_mauchly: bool) -> Effect {
    let df = rows.len() as f64 - 1.0;
    let q = contrasts.len() as f64;
    let (ss, _, y) = effect_sums(rows, contrasts);
    let size: f64 = rows.iter().map(|r| dot(r, r)).sum();
    // A smaller error is due to rounding.
    let test = f_test(ss, q, &y, df, 1e-24 * size);
    Effect {
        ss,
        ss_error: test.ss_error,
        df1: q,
        df2: q * df,
        f: test.f,
        p: test.p,
        eps_gg: test.eps_gg,
        p_gg: test.p_gg,
        eps_hf: test.eps_hf,
        p_hf: test.p_hf,
        mauchly: test
            .covariance
            .filter(|_| with_mauchly)
            .and_then(|s| mauchly(&s, df)),
    }
}

/// F of an effect, with its corrections for a lack of sphericity: the fields of [`Effect`].
pub(super) struct FTest {
    pub(super) ss_error: f64,
    pub(super) f: Option<f64>,
    pub(super) p: Option<f64>,
    pub(super) eps_gg: Option<f64>,
    pub(super) p_gg: Option<f64>,
    pub(super) eps_hf: Option<f64>,
    pub(super) p_hf: Option<f64>,
    /// That of the contrasts, but for a factor where `df` is not the number of rows − 1.
    covariance: Option<SymmetricMatrix>,
}

/// Tests a sum of squares with `df1` degrees of freedom by the errors `y`, a row for each
/// subject with q contrasts, less the means that were fitted to them, which leave each
/// contrast `df` degrees of freedom. With S − 1 = `df`, ε of Huynh and Feldt is that of
/// several groups as Lecoutre (1991) corrected it. Errors whose sum of squares is not above
/// `least` are 0 but for rounding.
pub(super) fn f_test(ss: f64, df1: f64, y: &[Vec<f64>], df: f64, least: f64) -> FTest {
    let q = y.first().map_or(0, Vec::len) as f64;
    let ss_error: f64 = y.iter().map(|v| dot(v, v)).sum();
    let df2 = q * df;
    let defined = ss_error > least && ss_error.is_finite();
    let f = if defined {
        finite((ss / df1) / (ss_error / df2))
    } else {
        None
    };
    let covariance = defined.then(|| covariance(y));
    let eps_gg = covariance.as_ref().and_then(greenhouse_geisser);
    let eps_hf = eps_gg.and_then(|e| {
        let denominator = q * (df - q * e);
        (denominator > 0.0).then(|| ((df + 1.0) * q * e - 2.0) / denominator)
    });
    let corrected_p = |eps: Option<f64>| {
        let (f, e) = (f?, eps?);
        (e > 0.0).then(|| f_upper(f, df1 * e, df2 * e)).flatten()
    };
    FTest {
        ss_error,
        f,
        p: f.and_then(|f| f_upper(f, df1, df2)),
        eps_gg,
        p_gg: corrected_p(eps_gg),
        eps_hf,
        p_hf: corrected_p(eps_hf.map(|e| e.min(1.0))),
        covariance,
    }
}

/// Covariance matrix of centered columns.
fn covariance(y: &[Vec<f64>]) -> SymmetricMatrix {
    let q = y.first().map_or(0, Vec::len);
    let df = y.len() as f64 - 1.0;
    let mut s = SymmetricMatrix::zero(q);
    for v in y {
        for i in 0..q {
            for j in 0..=i {
                s.add(i, j, v[i] * v[j] / df);
            }
        }
    }
    s
}

/// Greenhouse & Geisser's ε of a covariance matrix of contrasts.
fn greenhouse_geisser(s: &SymmetricMatrix) -> Option<f64> {
    let size = s.size();
    let squares = |i: usize| (0..size).map(|j| s.get(i, j) * s.get(i, j)).sum::<f64>();
    let (trace, squares) = (trace(s), (0..size).map(squares).sum::<f64>());
    finite(trace * trace / (size as f64 * squares))
}

fn trace(s: &SymmetricMatrix) -> f64 {
    (0..s.size()).map(|i| s.get(i, i)).sum()
}

fn mauchly(s: &SymmetricMatrix, df: f64) -> Option<Mauchly> {
    let q = s.size() as f64;
    if df < q || s.size() < 2 {
        return None;
    }
    let log_determinant = finite(Cholesky::definite(s)?.log_determinant())?;
    let log_w = log_determinant - q * (trace(s) / q).ln();
    let w = finite(log_w.exp())?;
    let rho = 1.0 - (2.0 * q * q + q + 2.0) / (6.0 * df * q);
    let z = -df * rho * log_w;
    let f = q * (q + 1.0) / 2.0 - 1.0;
    let first = chi2_upper(z, f);
    let second = chi2_upper(z, f + 4.0);
    let p = |linear: f64| {
        let (first, second) = (first?, second?);
        let w2 = (q + 2.0) * (q - 1.0) * (q - 2.0) * (2.0 * q.powi(3) + 6.0 * q * q + linear + 2.0)
            / (288.0 * (df * q * rho).powi(2));
        finite(first + w2 * (second - first)).map(|p| p.clamp(0.0, 1.0))
    };
    Some(Mauchly {
        w,
        p: p(3.0 * q),
        p_as_r: p(3.0 * (q + 1.0)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By hand: rows (1,2), (2,4), (3,6): the difference has mean 2, variance 1.
    #[test]
    fn two_realizations_give_the_square_of_the_paired_t() {
        let a = one_way(&[vec![1.0, 2.0], vec![2.0, 4.0], vec![3.0, 6.0]]).unwrap();
        let t = 2.0 / (1.0f64 / 3.0).sqrt();
        assert!((a.effect.f.unwrap() - t * t).abs() < 1e-12);
        assert_eq!(a.effect.mauchly, None);
        assert!((a.effect.eps_gg.unwrap() - 1.0).abs() < 1e-12);
        // SSm = 6, SSs = 9, SSe = 1.
        assert!((a.ges.unwrap() - 6.0 / 16.0).abs() < 1e-12);
        assert!((a.pes.unwrap() - 6.0 / 7.0).abs() < 1e-12);
    }

    #[test]
    fn rows_of_different_lengths_have_no_analysis() {
        assert_eq!(one_way(&[vec![1.0, 2.0], vec![2.0]]), None);
        assert_eq!(two_way(&[[1.0; 5], [2.0; 5]], 2), None);
    }

    #[test]
    fn a_constant_table_has_no_f() {
        let a = one_way(&vec![vec![0.0; 4]; 5]).unwrap();
        assert_eq!((a.effect.f, a.effect.p, a.ges), (None, None, None));
    }
}
