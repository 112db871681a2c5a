use super::*;
use crate::{anova, between, paired};

fn close(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-10 * expected.abs().max(1e-3),
        "{found} is not {expected}"
    );
}

fn rows(n: usize, cells: usize) -> Vec<Vec<f64>> {
    let value = |i: usize| ((i * i * 7919 + i * 104_729) % 1009) as f64 / 100.0;
    (0..n)
        .map(|s| (0..cells).map(|c| value(1 + s * cells + c)).collect())
        .collect()
}

#[test]
fn one_factor_is_the_one_way_analysis() {
    let rows = rows(7, 4);
    let known = anova::one_way(&rows).unwrap();
    let found = analysis(&rows, &[4], &[]).unwrap();
    let [effect] = &found.effects[..] else {
        panic!("{found:?}")
    };
    close(effect.ss, known.effect.ss);
    close(effect.ss_error, known.effect.ss_error);
    close(effect.p_hf.unwrap(), known.effect.p_hf.unwrap());
    close(effect.p_gg.unwrap(), known.effect.p_gg.unwrap());
    close(effect.ges.unwrap(), known.ges.unwrap());
    close(effect.pes.unwrap(), known.pes.unwrap());
}

#[test]
fn groups_are_compared_as_between_does() {
    let rows = rows(9, 3);
    let groups = [0, 1, 1, 0, 2, 1, 2, 0, 1];
    let by_group: Vec<Vec<&Vec<f64>>> = (0..3)
        .map(|g| (rows.iter().zip(groups)).filter(move |(_, of)| *of == g))
        .map(|of| of.map(|(row, _)| row).collect())
        .collect();
    let found = analysis(&rows, &[3], &groups).unwrap();
    let term = |factors: &[usize], group| Term {
        factors: factors.to_vec(),
        group,
    };
    for (term, known) in [
        (term(&[], true), between::levels(&by_group).unwrap()),
        (term(&[0], true), between::profiles(&by_group).unwrap()),
    ] {
        let effect = found.effect(&term).unwrap();
        close(effect.ss, known.ss);
        close(effect.ss_error, known.ss_error);
        assert_eq!((effect.df1, effect.df2), (known.df1, known.df2));
        close(effect.p_gg.unwrap(), known.p_gg.unwrap());
    }
}

#[test]
fn a_contrast_is_the_paired_t() {
    let rows = rows(8, 4);
    let columns = |j: usize| rows.iter().map(|r| r[j]).collect::<Vec<f64>>();
    let known = paired::paired(&columns(1), &columns(3)).unwrap();
    let found = contrast(&rows, &[], &[0.0, 1.0, 0.0, -1.0]).unwrap();
    close(found.estimate, known.mean_diff);
    close(found.t.unwrap(), known.t.unwrap());
    close(found.p.unwrap(), known.p_t.unwrap());
    close(found.dz.unwrap(), known.dz.unwrap());
    // The mean of one cell.
    let known = paired::one_sample(&columns(2)).unwrap();
    let found = contrast(&rows, &[], &[0.0, 0.0, 1.0, 0.0]).unwrap();
    close(found.estimate, known.mean);
    close(found.ci95.0, known.ci95.0);
    close(found.ci95.1, known.ci95.1);
}

#[test]
fn groups_of_one_contrast_are_compared_as_student_does() {
    let rows = rows(9, 2);
    let groups = [0, 1, 1, 0, 0, 1, 1, 0, 1];
    let of = |g: usize| -> Vec<f64> {
        let own = rows.iter().zip(groups).filter(|(_, of)| *of == g);
        own.map(|(row, _)| row[0] - row[1]).collect()
    };
    let known = between::difference(&of(0), &of(1)).unwrap();
    let found = group_contrast(&rows, &groups, &[vec![1.0, -1.0], vec![-1.0, 1.0]]).unwrap();
    close(found.estimate, known.difference);
    close(found.t.unwrap(), known.t);
    close(found.ci95.1, known.ci95.1);
    assert_eq!(found.df, known.df);
}

#[test]
fn a_contrast_with_one_degree_of_freedom_is_its_term() {
    let (rows, levels) = (rows(8, 12), [2, 3, 2]);
    for groups in [&[][..], &[0, 0, 0, 1, 1, 0, 1, 0]] {
        let found = analysis(&rows, &levels, groups).unwrap();
        let pair = &interaction_pairs(&levels, (0, 2))[0];
        let t = contrast(&rows, groups, &pair.weights).unwrap();
        let term = Term {
            factors: vec![0, 2],
            group: false,
        };
        let effect = found.effect(&term).unwrap();
        close(t.t.unwrap().powi(2), effect.f.unwrap());
        close(t.p.unwrap(), effect.p.unwrap());
        assert_eq!((effect.eps_hf, effect.p_hf), (Some(1.0), effect.p));
    }
}

#[test]
fn pairs_compare_what_they_say() {
    let levels = [2, 3];
    assert_eq!(marginal_pairs(&levels, 1).len(), 3);
    let simple = simple_pairs(&levels, 1);
    assert_eq!(simple.len(), 6);
    let pair = Pair {
        factor: 1,
        first: 0,
        second: 2,
    };
    let at = vec![(0, 1)];
    assert_eq!(simple[4].what, What::Pair { pair, at });
    assert_eq!(simple[4].weights, [0.0, 0.0, 0.0, 1.0, 0.0, -1.0]);
    let crossed = interaction_pairs(&levels, (0, 1));
    assert_eq!(crossed[1].weights, [1.0, 0.0, -1.0, -1.0, 0.0, 1.0]);
    assert!(interaction_pairs(&levels, (1, 1)).is_empty());
    assert!(marginal_pairs(&levels, 2).is_empty());
    assert!(simple_pairs(&[400, 3], 1).is_empty());
    assert_eq!(simple_pairs(&[3], 0).len(), 3);
}

#[test]
fn what_cannot_be_analyzed_has_a_reason() {
    let good = rows(4, 4);
    let error = |rows: &[Vec<f64>], levels: &[usize], groups: &[usize]| {
        let error = analysis(rows, levels, groups).unwrap_err();
        assert_eq!(aligned_ranks(rows, levels, groups), Err(error.clone()));
        error
    };
    type E = FactorialError;
    assert_eq!(error(&good[..1], &[2, 2], &[]), E::TooFewParticipants);
    assert_eq!(error(&[], &[2, 2], &[]), E::TooFewParticipants);
    assert_eq!(error(&good, &[], &[]), E::NoTerm);
    assert_eq!(error(&good, &[2; 6], &[]), E::TooManyFactors(6));
    assert_eq!(error(&good, &[4, 1], &[]), E::OneLevel(1));
    assert_eq!(error(&good, &[7, 7, 7], &[]), E::TooManyCells);
    assert_eq!(error(&good, &[usize::MAX, 2], &[]), E::TooManyCells);
    let expected = E::RowLength {
        row: 0,
        found: 4,
        expected: 6,
    };
    assert_eq!(error(&good, &[2, 3], &[]), expected);
    let mut bad = good.clone();
    bad[2][1] = f64::NAN;
    assert_eq!(error(&bad, &[4], &[]), E::NotFinite(2));
    let expected = E::GroupsLength { rows: 4, groups: 3 };
    assert_eq!(error(&good, &[4], &[0, 0, 1]), expected);
    assert_eq!(error(&good, &[4], &[0, 0, 2, 2]), E::EmptyGroup(1));
    assert_eq!(error(&good, &[4], &[0, 0, 0, usize::MAX]), E::EmptyGroup(1));
    assert_eq!(error(&good, &[4], &[0, 1, 2, 3]), E::NoError);
    let mut large = good.clone();
    large[0][0] = 1e200;
    assert_eq!(analysis(&large, &[4], &[]), Err(E::Overflow));
    assert_eq!(
        aligned_pairs(&good, &[4], &[], &terms(2, false)[1]),
        Err(E::UnknownTerm)
    );
    assert_eq!(contrast(&good, &[], &[1.0, -1.0]), None);
    assert_eq!(contrast(&good, &[], &[f64::INFINITY; 4]), None);
    assert_eq!(contrast(&[], &[], &[]), None);
}

/// Rounding errors are no variance, whatever the offset; scale and offset change nothing else.
#[test]
fn an_offset_and_a_unit_change_no_test() {
    let plain = rows(6, 6);
    let known = analysis(&plain, &[2, 3], &[]).unwrap();
    let ranks = aligned_ranks(&plain, &[2, 3], &[]).unwrap();
    for (factor, offset) in [(1.0, 1e6), (1e-120, 0.0), (1e120, 0.0), (-3.0, 4.0)] {
        let other: Vec<Vec<f64>> = (plain.iter())
            .map(|row| row.iter().map(|x| x * factor + offset).collect())
            .collect();
        let found = analysis(&other, &[2, 3], &[]).unwrap();
        for (a, b) in found.effects.iter().zip(&known.effects) {
            assert!((a.p_gg.unwrap() - b.p_gg.unwrap()).abs() < 1e-8);
            assert!((a.ges.unwrap() - b.ges.unwrap()).abs() < 1e-8);
        }
        if factor > 0.0 && offset == 0.0 {
            let found = aligned_ranks(&other, &[2, 3], &[]).unwrap();
            for (a, b) in found.effects.iter().zip(&ranks.effects) {
                close(a.f.unwrap(), b.f.unwrap());
            }
        }
    }
    // Everybody has the same differences: there is an effect, and no error.
    let alike: Vec<Vec<f64>> = [1e9, 2.0, 0.1]
        .map(|level| [0.0, 0.1, 0.3, 0.7].map(|x| x + level).to_vec())
        .into();
    // Their own differences are small beside the offset, which rounds them.
    let far = [0.123_456_789, 0.377_777_7, 1.171_171_7]
        .map(|level| [0.0, 0.1, 0.3, 0.7].map(|x| 1e9 + (level + x)).to_vec());
    for rows in [&alike, &alike[1..], &far[..]] {
        let found = analysis(rows, &[2, 2], &[]).unwrap();
        for effect in &found.effects {
            assert_eq!((effect.f, effect.p, effect.p_gg), (None, None, None));
        }
        let found = contrast(rows, &[], &[1.0, -1.0, 0.0, 0.0]).unwrap();
        assert_eq!((found.t, found.dz, found.se), (None, None, 0.0));
    }
}

#[test]
fn a_table_without_variation_has_no_effect_size() {
    let found = analysis(&vec![vec![3.0; 4]; 5], &[2, 2], &[]).unwrap();
    for effect in &found.effects {
        assert_eq!((effect.ss, effect.pes, effect.ges), (0.0, None, None));
    }
}

#[test]
fn terms_are_ordered_by_order() {
    assert_eq!(terms(5, true).len(), 63);
    assert_eq!(terms(0, true).len(), 1);
    assert!(terms(0, false).is_empty());
    let first: Vec<Vec<usize>> = (terms(3, false).into_iter()).map(|t| t.factors).collect();
    let two = [vec![0, 1], vec![0, 2], vec![1, 2]];
    assert_eq!(first[3..6], two);
    assert_eq!(first[6], [0, 1, 2]);
}
