//! Reference values are those of `tests/reference/ranking.R`; of levels, of `ranking_levels.py`.

use super::*;
use crate::random::SplitMix64;

/// Each row so often, of a participant of its own; 0 is not ranked.
fn rankings<const K: usize>(rows: &[([u8; K], usize)]) -> Vec<Ranking> {
    let each = rows.iter().flat_map(|(row, n)| vec![*row; *n]);
    let rank = |r: u8| (r > 0).then_some(f64::from(r));
    each.enumerate()
        .map(|(cluster, row)| Ranking {
            ranks: row.map(rank).to_vec(),
            cluster,
        })
        .collect()
}

/// Salad dressings ranked by tartness by 32 judges, 1 the most tart: Vargo (1989) in Critchlow & Fligner (1991),
/// Psychometrika 56, 517–533.
const SALAD: [([u8; 4], usize); 12] = [
    ([4, 3, 2, 1], 1),
    ([3, 4, 2, 1], 1),
    ([4, 3, 1, 2], 1),
    ([4, 1, 3, 2], 6),
    ([3, 1, 4, 2], 1),
    ([4, 2, 1, 3], 3),
    ([4, 1, 2, 3], 11),
    ([2, 1, 4, 3], 2),
    ([2, 3, 1, 4], 1),
    ([3, 1, 2, 4], 2),
    ([2, 1, 3, 4], 1),
    ([1, 2, 3, 4], 2),
];

/// Four judges rank five items twice each, with ties of two and of three.
const TIED: [[u8; 5]; 8] = [
    [1, 2, 2, 4, 5],
    [2, 1, 3, 3, 5],
    [1, 1, 3, 5, 4],
    [1, 2, 2, 2, 5],
    [2, 1, 4, 3, 4],
    [1, 3, 2, 5, 4],
    [3, 1, 2, 4, 5],
    [1, 2, 4, 3, 5],
];

fn tied() -> Vec<Ranking> {
    let mut all = rankings(&TIED.map(|row| (row, 1)));
    for ranking in &mut all {
        ranking.cluster /= 2;
    }
    all
}

fn close(found: &[f64], expected: &[f64], within: f64) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() < within, "{found} {expected}");
    }
}

fn numbers(rankings: &[Ranking]) -> Vec<Vec<f64>> {
    let row = |own: &Ranking| own.ranks.iter().copied().flatten().collect();
    rankings.iter().map(row).collect()
}

#[test]
fn salads_agree_with_r() {
    let data = rankings(&SALAD);
    let found = worths(4, &data).unwrap();
    let worths = [-1.329_572_098, 1.400_341_881, 0.231_966_413, -0.302_736_195];
    close(&found.abilities.abilities, &worths, 1e-6);
    let ses = [0.265_286_664, 0.252_124_869, 0.206_213_660, 0.205_329_717];
    close(&found.abilities.ses, &ses, 1e-6);
    assert!(found.ties.is_empty());
    assert!((found.log_likelihood + 76.415_289_204).abs() < 1e-6);
    assert!((found.abilities.deviance + 2.0 * found.log_likelihood).abs() < 1e-9);
    // Three choices of a ranking, from four, three and two.
    assert_eq!(found.abilities.df, 32 * (3 + 2 + 1) - 3);
    let difference = found.abilities.difference(0, 1);
    let clustered = difference.clustered.unwrap();
    close(
        &[
            difference.effect.estimate,
            difference.effect.se,
            clustered.se,
        ],
        &[-2.729_913_980, 0.448_072_566, 0.554_871_119],
        1e-6,
    );
    assert!(difference.participants > 16.0 && difference.participants < 32.0 + 1e-9);
    let agreed = concordance(&numbers(&data), &mut SplitMix64::new(1)).unwrap();
    let own = &agreed.friedman;
    close(
        &[own.kendall_w.unwrap(), own.chi2.unwrap()],
        &[0.428_125, 41.1],
        1e-9,
    );
    assert!((own.p.unwrap() / 6.227_518_021e-9 - 1.0).abs() < 1e-6);
    assert_eq!(own.mean_ranks, [3.4375, 1.4375, 2.3125, 2.8125]);
    // The second was above the first in all rankings but four.
    let expected = Shares {
        above: 4.0,
        below: 28.0,
        tied: 0.0,
    };
    assert_eq!(shares(&data, 0, 1), expected);
}

/// Davidson's (1970) chocolate puddings: his likelihood, maximized by SciPy. Turner et al. (2020, §2.1) print values within 2.1e-5 of these
/// from the package `PlackettLuce`.
#[test]
fn pairs_are_rankings_of_two() {
    let counts: [(usize, usize, [usize; 3]); 15] = [
        (0, 1, [19, 22, 16]),
        (0, 2, [16, 19, 12]),
        (1, 2, [19, 19, 10]),
        (0, 3, [18, 23, 13]),
        (1, 3, [23, 19, 9]),
        (2, 3, [19, 20, 15]),
        (0, 4, [13, 19, 18]),
        (1, 4, [16, 20, 12]),
        (2, 4, [16, 15, 17]),
        (3, 4, [17, 14, 16]),
        (0, 5, [18, 21, 12]),
        (1, 5, [22, 20, 12]),
        (2, 5, [13, 18, 10]),
        (3, 5, [14, 19, 18]),
        (4, 5, [11, 21, 12]),
    ];
    let mut rows = Vec::new();
    for (a, b, [first, second, both]) in counts {
        for (ranks, n) in [([1, 2], first), ([2, 1], second), ([1, 1], both)] {
            let mut row = [0u8; 6];
            (row[a], row[b]) = (ranks[0], ranks[1]);
            rows.push((row, n));
        }
    }
    let found = worths(6, &rankings(&rows)).unwrap();
    let first = [
        0.138_803_37,
        0.173_001_50,
        0.161_747_43,
        0.165_372_95,
        0.158_685_40,
        0.202_389_34,
    ];
    close(&found.first(), &first, 2e-8);
    let (size, delta) = found.ties[0];
    assert_eq!((size, found.ties.len()), (2, 1));
    assert!((delta.estimate.exp() - 0.746_822_98).abs() < 2e-8);
    assert!((delta.se - 0.082_499).abs() < 1e-5, "{}", delta.se);
}

/// The rankings of the tests of `PlackettLuce`, some of which are of two of three items.
#[test]
fn some_items_can_be_left_out() {
    let rows = [
        [1, 2, 0],
        [3, 1, 2],
        [2, 1, 1],
        [1, 2, 3],
        [2, 1, 1],
        [1, 0, 2],
    ];
    let found = worths(3, &rankings(&rows.map(|row| (row, 1)))).unwrap();
    let worths = [0.070_505_147, 0.414_554_099, -0.485_059_247];
    close(&found.abilities.abilities, &worths, 1e-6);
    let ses = [0.594_561_883, 0.634_711_850, 0.651_869_698];
    close(&found.abilities.ses, &ses, 1e-5);
    let (_, delta) = found.ties[0];
    close(
        &[delta.estimate, delta.se],
        &[-0.734_645_129, 0.833_500_428],
        1e-5,
    );
    assert!((found.log_likelihood + 10.724_537_989).abs() < 1e-7);
}

#[test]
fn ties_of_two_and_three_have_a_parameter_each() {
    let data = tied();
    let found = worths(5, &data).unwrap();
    let worths_ = [
        2.185_681_858,
        1.595_708_171,
        -0.245_204_681,
        -1.274_055_686,
        -2.262_129_663,
    ];
    close(&found.abilities.abilities, &worths_, 1e-6);
    let ses = [
        0.656_057_349,
        0.622_968_721,
        0.560_757_608,
        0.610_425_994,
        0.713_248_037,
    ];
    close(&found.abilities.ses, &ses, 1e-6);
    let sizes: Vec<usize> = found.ties.iter().map(|t| t.0).collect();
    assert_eq!(sizes, [2, 3]);
    let deltas: Vec<f64> = (found.ties.iter())
        .flat_map(|(_, e)| [e.estimate, e.se])
        .collect();
    close(
        &deltas,
        &[-1.373_636_297, 0.588_811_159, -2.066_204_886, 1.094_512_642],
        1e-6,
    );
    assert!((found.log_likelihood + 36.207_602_488).abs() < 1e-7);
    let difference = found.abilities.difference(0, 1);
    close(
        &[
            difference.effect.estimate,
            difference.effect.se,
            difference.clustered.unwrap().se,
        ],
        &[0.589_973_687, 0.793_268_389, 0.610_453_327],
        1e-6,
    );
    // W of eight rankings, and of the mean ranks of four judges.
    let w = |rows: &[Vec<f64>]| {
        let found = concordance(rows, &mut SplitMix64::new(1)).unwrap().friedman;
        (found.kendall_w.unwrap(), found.chi2.unwrap())
    };
    let rows = numbers(&data);
    let (all, chi2) = w(&rows);
    close(&[all, chi2], &[0.720_394_737, 23.052_631_579], 1e-8);
    let mid: Vec<Vec<f64>> = rows.iter().map(|r| crate::rank::mid_ranks(r)).collect();
    let judges: Vec<Vec<f64>> = (mid.chunks(2))
        .map(|two| (0..5).map(|i| (two[0][i] + two[1][i]) / 2.0).collect())
        .collect();
    let (of_judges, chi2) = w(&judges);
    close(&[of_judges, chi2], &[0.9625, 15.4], 1e-9);
}

/// Only the order of ranks counts, not how ties are numbered.
#[test]
fn ranks_can_skip_numbers() {
    let skipped = worths(5, &tied()).unwrap();
    let dense: Vec<Ranking> = (tied().into_iter())
        .map(|mut own| {
            for rank in own.ranks.iter_mut().flatten() {
                *rank = 10.0 * *rank + 3.0;
            }
            own
        })
        .collect();
    let dense = worths(5, &dense).unwrap();
    assert_eq!(dense.abilities.abilities, skipped.abilities.abilities);
}

#[test]
fn what_has_no_maximum_has_a_reason() {
    let reason = |rows: &[([u8; 3], usize)]| worths(3, &rankings(rows)).unwrap_err();
    assert_eq!(reason(&[([1, 1, 1], 5)]), NoAbilities::AllTied);
    // The first and the second are above the third, but nothing says which of them is the higher one.
    let apart = reason(&[([1, 0, 2], 2), ([0, 1, 2], 3)]);
    assert_eq!(apart, NoAbilities::Unbounded(vec![0]));
    // Two items at the top each time, or two or three.
    let two = [([1, 1, 2], 1), ([2, 1, 1], 1), ([1, 2, 1], 1)];
    assert_eq!(reason(&two), NoAbilities::AlwaysTied);
    let more = [&two[..], &[([1, 1, 1], 2)]].concat();
    assert_eq!(reason(&more), NoAbilities::AlwaysTied);
    // At the bottom there was a choice before, of a single item.
    let below = [([1, 2, 2], 1), ([2, 1, 2], 1), ([2, 2, 1], 1)];
    assert!(worths(3, &rankings(&below)).is_ok());
    assert_eq!(
        reason(&[]),
        NoAbilities::Disconnected(vec![vec![0], vec![1], vec![2]])
    );
    assert_eq!(worths(1, &[]).unwrap_err(), NoAbilities::NoPairs);
    // Of 30 items ties of up to eight are too many sets.
    let mut long = Ranking {
        ranks: (0..30).map(|i| Some(f64::from(i))).collect(),
        cluster: 0,
    };
    long.ranks[..8].fill(Some(1.0));
    let mut reversed = long.clone();
    for rank in reversed.ranks.iter_mut().flatten() {
        *rank = -*rank;
    }
    let many = worths(30, &[long, reversed]);
    assert_eq!(many.unwrap_err(), NoAbilities::TooManySets);
}

/// Three participants rank six items three times each: one is above all others every time, and two are below all others. The
/// program has the likelihood of all items with the levels e⁶⁰ apart.
#[test]
fn worths_of_levels_are_the_limit_of_the_likelihood() {
    let rows = [
        [2, 3, 5, 1, 4, 6],
        [3, 2, 6, 1, 4, 5],
        [2, 2, 5, 1, 4, 6],
        [4, 2, 5, 1, 3, 5],
        [2, 4, 5, 1, 3, 6],
        [2, 3, 5, 1, 3, 6],
        [2, 3, 5, 1, 4, 6],
        [3, 4, 5, 1, 2, 5],
        [2, 3, 6, 1, 4, 5],
    ];
    let mut data = rankings(&rows.map(|row| (row, 1)));
    for ranking in &mut data {
        ranking.cluster /= 3;
    }
    let found = worths(6, &data).unwrap();
    assert_eq!(found.levels, [vec![3], vec![0, 1, 4], vec![2, 5]]);
    assert_eq!([0, 3, 5].map(|item| found.level(item)), [1, 0, 2]);
    assert_eq!(found.first(), [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]);
    let worths = [
        0.851_328_56,
        -0.061_491_58,
        0.401_951_21,
        0.0,
        -0.789_836_98,
        -0.401_951_21,
    ];
    close(&found.abilities.abilities, &worths, 1e-6);
    let ses = [
        0.451_817_69,
        0.412_732_85,
        0.383_011_05,
        0.0,
        0.461_900_82,
        0.383_011_05,
    ];
    close(&found.abilities.ses, &ses, 1e-6);
    let (size, delta) = found.ties[0];
    assert_eq!((size, found.ties.len()), (2, 1));
    close(
        &[delta.estimate, delta.se, found.log_likelihood],
        &[-1.160_200_73, 0.557_750_04, -28.277_127_61],
        1e-6,
    );
    let difference = found.abilities.difference(0, 4);
    close(
        &[
            difference.effect.estimate,
            difference.effect.se,
            difference.clustered.unwrap().se,
        ],
        &[1.641_165_55, 0.815_251_35, 0.635_903_21],
        1e-6,
    );
}

/// A dressing that everybody puts last changes nothing of the others.
#[test]
fn what_is_always_last_leaves_the_worths_of_the_others() {
    let five = SALAD.map(|(row, n)| {
        let mut all = [5; 5];
        // The last one is not the last by its number.
        all[..2].copy_from_slice(&row[..2]);
        all[3..].copy_from_slice(&row[2..]);
        (all, n)
    });
    let (four, found) = (
        worths(4, &rankings(&SALAD)).unwrap(),
        worths(5, &rankings(&five)).unwrap(),
    );
    assert_eq!(found.levels, [vec![0, 1, 3, 4], vec![2]]);
    let others = [0, 1, 3, 4];
    close(
        &others.map(|i| found.abilities.abilities[i]),
        &four.abilities.abilities,
        1e-9,
    );
    close(
        &others.map(|i| found.abilities.ses[i]),
        &four.abilities.ses,
        1e-9,
    );
    close(&others.map(|i| found.first()[i]), &four.first(), 1e-9);
    assert!((found.log_likelihood - four.log_likelihood).abs() < 1e-9);
    let (own, known) = (
        found.abilities.difference(0, 3),
        four.abilities.difference(0, 2),
    );
    assert!((own.clustered.unwrap().se - known.clustered.unwrap().se).abs() < 1e-9);
    assert!((own.participants - known.participants).abs() < 1e-9);
}

/// Everybody gives the same order: each level is one item, and no number is left to estimate.
#[test]
fn one_order_is_a_level_for_each_item() {
    let found = worths(3, &rankings(&[([2, 1, 3], 4)])).unwrap();
    assert_eq!(found.levels, [[1], [0], [2]]);
    assert_eq!(found.first(), [0.0, 1.0, 0.0]);
    assert!(found.log_likelihood.abs() < 1e-12);
    assert!(found.ties.is_empty());
}

/// SciPy's `binomtest(n, n)`: its p, and the logit of the lower end of its exact interval.
#[test]
fn what_is_always_above_has_a_lower_bound() {
    for (times, at_least, p) in [
        (1, -3.663_561_646, 1.0),
        (5, -0.087_350_499, 0.0625),
        (6, 0.163_329_618, 0.031_25),
        (10, 0.807_154_865, 0.001_953_125),
        (20, 1.596_770_465, 1.907_348_633e-6),
    ] {
        let found = always_above(times, 1).unwrap();
        close(&[found.at_least, found.p], &[at_least, p], 1e-8);
        // Sets of tied items weaken a bound below zero only.
        let tied = always_above(times, 3).unwrap().at_least;
        close(
            &[tied],
            &[at_least * if at_least < 0.0 { 3.0 } else { 1.0 }],
            1e-7,
        );
    }
    assert_eq!(always_above(0, 1), None);
}

/// By hand: three participants who agree on three items are one of 36 relative orders, and tied ones tell nothing.
#[test]
fn agreement_is_held_against_all_orders() {
    let mut random = SplitMix64::new(1);
    let same = concordance(&[[1.0, 2.0, 3.0]; 3], &mut random).unwrap();
    assert_eq!((same.p, same.exact), (Some(1.0 / 36.0), true));
    assert!((same.smallest_p - 1.0 / 36.0).abs() < 1e-15);
    assert_eq!(same.friedman.kendall_w, Some(1.0));
    let tied = concordance(&[[2.0; 3]; 4], &mut random).unwrap();
    assert_eq!((tied.p, tied.friedman.kendall_w), (None, None));
    assert_eq!(concordance(&[[1.0, 2.0, 3.0]], &mut random), None);
    assert_eq!(concordance(&[[1.0], [1.0]], &mut random), None);
}

/// Nine items are too many to enumerate: orders are drawn, and those of the same seed are the same.
#[test]
fn agreement_of_many_items_is_held_against_random_orders() {
    let row = |shift: usize| {
        (0..9)
            .map(|i| ((i + shift) % 9) as f64)
            .collect::<Vec<f64>>()
    };
    let p = |rows: &[Vec<f64>]| {
        let found = concordance(rows, &mut SplitMix64::new(5)).unwrap();
        assert!(!found.exact);
        (found.p.unwrap(), found.smallest_p)
    };
    let alike = vec![row(0); 5];
    assert_eq!(p(&alike), (1e-4, 1e-4));
    // Every item has every rank.
    let rotated: Vec<Vec<f64>> = (0..9).map(row).collect();
    assert_eq!(p(&rotated).0, 1.0);
    assert_eq!(p(&[row(0), row(2), row(1)]), p(&[row(0), row(2), row(1)]));
}
