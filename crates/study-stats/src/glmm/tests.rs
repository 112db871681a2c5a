#![allow(clippy::unwrap_used)]

use super::adaptive::Adaptive;
use super::laplace::Laplace;
use super::*;

/// Six subjects, four realizations in two conditions, some cells missing.
fn observations(family: Family, factors: usize) -> Vec<Observation> {
    let mut all = Vec::new();
    for s in 0..6 {
        for m in (0..4).filter(|m| (s + 2 * m) % 5 != 4) {
            for r in 0..2 {
                let count = [3.0, 1.0, 4.0, 1.0, 5.0, 0.0, 2.0, 6.0][(3 * s + 2 * m + 5 * r) % 8];
                all.push(Observation {
                    y: match family {
                        Family::Gamma => count + 0.5,
                        Family::Poisson | Family::Binomial => count,
                    },
                    trials: if family == Family::Binomial { 7.0 } else { 1.0 },
                    x: vec![1.0, (m % 2) as f64],
                    levels: [s, m, 4 * s + m][..factors].to_vec(),
                });
            }
        }
    }
    all
}

const FAMILIES: [Family; 3] = [Family::Poisson, Family::Binomial, Family::Gamma];

/// The gradient is that of the value.
fn gradient_holds(at: &[f64], mut of: impl FnMut(&[f64]) -> Option<(f64, Vec<f64>)>) {
    let (_, gradient) = of(at).unwrap();
    assert_eq!(gradient.len(), at.len());
    for i in 0..at.len() {
        let mut value = |by: f64| {
            let mut moved = at.to_vec();
            moved[i] += by;
            of(&moved).unwrap().0
        };
        let difference = (value(1e-4) - value(-1e-4)) / 2e-4;
        assert!(
            (difference - gradient[i]).abs() < 1e-6 * (1.0 + difference.abs()),
            "{i}: {difference} {}",
            gradient[i]
        );
    }
}

fn parameters(family: Family, factors: usize) -> Vec<f64> {
    let sds = [0.7, -0.4, 0.3];
    let shape = (family == Family::Gamma).then_some(0.6);
    let beta = [0.4, -0.3];
    beta.into_iter()
        .chain(sds[..factors].iter().copied())
        .chain(shape)
        .collect()
}

/// Also with a negative θ, where the likelihood is that of the positive one, and of 0.
#[test]
fn the_gradients_are_those_of_the_likelihoods() {
    for family in FAMILIES {
        for factors in 1..=3 {
            let data = GlmmData::new(family, &observations(family, factors)).unwrap();
            let mut at = parameters(family, factors);
            gradient_holds(&at, |at| Laplace::new(&data).gradient(at));
            at[2] = 0.0;
            gradient_holds(&at, |at| Laplace::new(&data).gradient(at));
        }
        let data = GlmmData::new(family, &observations(family, 1)).unwrap();
        let at = parameters(family, 1);
        gradient_holds(&at, |at| Adaptive::new(&data).gradient(at));
    }
}

/// The definition, by a fine trapezoidal rule.
#[test]
fn the_quadrature_is_the_integral() {
    let all = observations(Family::Poisson, 1);
    let data = GlmmData::new(Family::Poisson, &all).unwrap();
    let (beta, sd) = ([0.4, -0.3], 0.7);
    let of_subject = |s: usize| {
        let density = |u: f64| {
            let own = all.iter().filter(|o| o.levels[0] == s);
            let logs = own.map(|o| {
                let eta = beta[0] + beta[1] * o.x[1] + sd * u;
                let product: f64 = (1..=o.y as u32).map(|k| f64::from(k).ln()).sum();
                o.y * eta - eta.exp() - product
            });
            (logs.sum::<f64>() - 0.5 * u * u).exp() / (2.0 * std::f64::consts::PI).sqrt()
        };
        let sum: f64 = (-8000..=8000).map(|i| density(f64::from(i) * 1e-3)).sum();
        (sum * 1e-3).ln()
    };
    let whole: f64 = (0..6).map(of_subject).sum();
    let at = [beta[0], beta[1], sd];
    let (value, _) = Adaptive::new(&data).gradient(&at).unwrap();
    assert!((value - whole).abs() < 1e-9, "{value} {whole}");
}

#[test]
fn names_and_order_do_not_matter_and_equal_rows_add_up() {
    let all = observations(Family::Poisson, 2);
    let renamed: Vec<Observation> = (all.iter().rev())
        .map(|o| Observation {
            levels: vec![90 - o.levels[0], o.levels[1] + 7],
            ..o.clone()
        })
        .collect();
    let fit = |all: &[Observation]| {
        glmm(
            &GlmmData::new(Family::Poisson, all).unwrap(),
            Integral::Laplace,
        )
    };
    let (a, b) = (fit(&all).unwrap(), fit(&renamed).unwrap());
    assert!((a.loglik - b.loglik).abs() < 1e-8);
    for (a, b) in a.beta.iter().zip(&b.beta) {
        assert!((a - b).abs() < 1e-6);
    }
    let (estimate, se) = a.contrast(&[0.0, 1.0]).unwrap();
    assert!((estimate - a.beta[1]).abs() < 1e-12 && (se - a.se[1]).abs() < 1e-12);
    assert_eq!(a.contrast(&[1.0]), None);
}

#[test]
fn what_has_no_estimate_has_a_reason() {
    let refused = |change: &dyn Fn(&mut Observation), family: Family| {
        let mut all = observations(family, 1);
        all.iter_mut().for_each(change);
        let data = GlmmData::new(family, &all);
        data.and_then(|data| glmm(&data, Integral::Laplace)).err()
    };
    let none = GlmmData::new(Family::Poisson, &[]);
    assert_eq!(none.err(), Some(GlmmError::NoData));
    let half = refused(&|o| o.y += 0.5, Family::Poisson);
    assert_eq!(half, Some(GlmmError::NotOfFamily));
    let many = refused(&|o| o.y = 8.0, Family::Binomial);
    assert_eq!(many, Some(GlmmError::NotOfFamily));
    let zero = refused(&|o| o.y -= 0.5, Family::Gamma);
    assert_eq!(zero, Some(GlmmError::NotOfFamily));
    let alone = refused(&|o| o.levels[0] = 3, Family::Poisson);
    assert_eq!(alone, Some(GlmmError::OneLevel));
    let same = refused(&|o| o.x[1] = 2.0, Family::Poisson);
    assert_eq!(same, Some(GlmmError::Collinear));
    let equal = refused(&|o| o.y = 2.5, Family::Gamma);
    assert_eq!(equal, Some(GlmmError::NoError));
    for family in [Family::Poisson, Family::Binomial] {
        let empty = |o: &mut Observation| o.y *= o.x[1];
        assert_eq!(refused(&empty, family), Some(GlmmError::Separated));
    }
}

/// Subjects who always succeed, and subjects who never do.
#[test]
fn subjects_that_never_overlap_have_no_standard_deviation() {
    let mut all = observations(Family::Binomial, 1);
    for o in &mut all {
        o.y = if o.levels[0] % 2 == 0 { 0.0 } else { o.trials };
    }
    let data = GlmmData::new(Family::Binomial, &all).unwrap();
    for integral in [Integral::Laplace, Integral::Adaptive] {
        let found = glmm(&data, integral);
        assert!(
            matches!(
                found,
                Err(GlmmError::InfiniteSd | GlmmError::NotConverged | GlmmError::Separated)
            ),
            "{found:?}"
        );
    }
}
