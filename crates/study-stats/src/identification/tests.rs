use super::*;
use crate::random::{RandomSource as _, SplitMix64};

fn matrix<const K: usize>(rows: [[u32; K]; K]) -> Confusions {
    let mut found = Confusions::new(K);
    for (right, row) in rows.iter().enumerate() {
        for (given, n) in row.iter().enumerate() {
            (0..*n).for_each(|_| found.add(right, given));
        }
    }
    found
}

/// The participants of tests/reference/identification.R.
fn participants() -> [Confusions; 3] {
    [
        [[8, 2, 0, 0], [1, 7, 2, 0], [0, 3, 6, 1], [0, 0, 2, 8]],
        [[6, 3, 1, 0], [2, 6, 1, 1], [1, 2, 6, 1], [0, 1, 3, 6]],
        [[10, 0, 0, 0], [0, 9, 1, 0], [0, 4, 5, 1], [0, 0, 0, 10]],
    ]
    .map(matrix)
}

fn close(found: f64, expected: f64, tolerance: f64) {
    let difference = (found - expected).abs() / expected.abs().max(1.0);
    assert!(difference < tolerance, "{found} instead of {expected}");
}

/// R 4.2.2, tests/reference/identification.R.
#[test]
fn information_and_its_error_agree_with_r() {
    let all = participants();
    let sum = Confusions::sum(all.iter()).unwrap();
    let found = information(&sum).unwrap();
    close(found.transmitted, 0.888_227_768_251_354_6, 1e-12);
    close(found.corrected, 0.838_116_281_970_735_1, 1e-12);
    close(found.stimulus, 2.0, 1e-12);
    close(found.response, 1.987_360_489_592_596_7, 1e-12);
    let of_all = transfer(&all).unwrap();
    assert_eq!(of_all.estimate, found.corrected);
    close(of_all.se.unwrap(), 0.301_717_119_766_114_65, 1e-12);
    let ends = |all: &[Confusions], low: f64, high: f64| {
        let found = transfer(all).unwrap().ci95.unwrap();
        close(found.0, low, 1e-10);
        close(found.1, high, 1e-10);
    };
    ends(&all, 0.0, 1.619_879_568_707_869_8);
    let rare = [
        [[10, 0, 0], [0, 10, 0], [0, 0, 10]],
        [[10, 0, 0], [0, 10, 0], [0, 0, 10]],
        [[9, 1, 0], [0, 10, 0], [1, 0, 9]],
    ];
    ends(&rare.map(matrix), 0.0, 1.581_898_084_621_069_7);
    let chance = [[[5, 5], [5, 5]], [[6, 4], [4, 6]], [[4, 6], [5, 5]]].map(matrix);
    assert!(transfer(&chance).unwrap().estimate < 0.0);
    ends(&chance, 0.0, 0.015_036_180_240_916_02);
    let alone = transfer(&all[..1]).unwrap();
    assert_eq!((alone.se, alone.ci95), (None, None));
    assert_eq!(transfer(&[]), None);
}

/// Nobody tells from participants who are alike how much others differ: of information, of d′ and of similarities.
#[test]
fn participants_who_are_alike_have_no_interval() {
    let perfect = vec![matrix([[6, 0, 0], [0, 6, 0], [0, 0, 6]]); 5];
    let some = vec![matrix([[5, 1], [2, 4]]); 3];
    for alike in [perfect, some] {
        let found = transfer(&alike).unwrap();
        assert_eq!(found.ci95, None);
        assert!(found.se.unwrap() < 1e-12);
        let similarity = |m: &Confusions| Some(biased_choice(m)?.log_similarity(0, 1));
        let found = pooled(&alike, |m| vec![sensitivity(m, 0, 1), similarity(m)]);
        assert!(found.iter().all(|of| of.unwrap().ci95.is_none()));
    }
}

/// R's `glm` of quasi-symmetry, in the same file.
#[test]
fn the_biased_choice_model_agrees_with_quasi_symmetry_in_r() {
    let all = participants();
    let sum = Confusions::sum(all.iter()).unwrap();
    let found = biased_choice(&sum).unwrap();
    let similarities = [
        (0, 1, 0.176_951_846_775_844_5, 0.655_416_083_093_932_6),
        (0, 2, 0.061_079_115_504_857, 1.118_034_758_338_683_8),
        (0, 3, 0.010_196_882_916_306_25, 0.133_823_440_283_678_4),
        (1, 2, 0.330_074_293_484_573_6, 0.097_320_790_061_914_9),
        (1, 3, 0.049_619_344_528_762_26, 1.169_948_233_933_038_7),
        (2, 3, 0.206_470_454_786_615, 0.322_235_128_839_709_7),
    ];
    for (a, b, similarity, se) in similarities {
        close(libm::exp(found.log_similarity(a, b)), similarity, 1e-9);
        let log = |m: &Confusions| biased_choice(m).map(|c| c.log_similarity(b, a));
        let over = pooled(&all, |m| vec![log(m)])[0].unwrap();
        close(over.se.unwrap(), se, 1e-7);
    }
    let biases = [
        0.255_183_625_786_991_05,
        0.317_003_314_528_378_04,
        0.207_809_516_569_999_4,
        0.220_003_543_114_631_5,
    ];
    for (found, expected) in found.biases.iter().zip(biases) {
        close(*found, expected, 1e-9);
    }
}

/// R 4.2.2, tests/reference/identification.R.
#[test]
fn sensitivities_of_pairs_agree_with_r() {
    let all = participants();
    for (a, b, d, se) in [
        (0, 1, 2.007_570_535_605_975, 0.660_893_874_841_566_7),
        (0, 3, 4.107_497_821_263_644, 0.120_203_519_842_550_3),
        (1, 2, 1.347_747_207_865_332_5, 0.138_225_626_848_399_5),
        (2, 3, 1.870_156_357_745_566_2, 0.309_479_399_155_566_7),
    ] {
        let found = pooled(&all, |m| vec![sensitivity(m, a, b)])[0].unwrap();
        close(found.estimate, d, 1e-12);
        close(found.se.unwrap(), se, 1e-11);
    }
    assert_eq!(sensitivity(&Confusions::new(3), 0, 1), None);
}

/// R 4.2.2, tests/reference/identification.R.
#[test]
fn participants_are_compared_with_guesses_as_in_r() {
    let found = above_guessing(&participants()).unwrap();
    close(found.mean, 0.475, 1e-14);
    close(found.se, 0.072_168_783_648_703_2, 1e-12);
    close(found.t, 6.581_793_068_761_733, 1e-12);
    close(found.p, 0.022_314_276_802_048_48, 1e-11);
    // Everybody is right, which is not certain: half the error of guesses.
    let perfect = matrix([[6, 0, 0], [0, 6, 0], [0, 0, 6]]);
    let found = above_guessing(&vec![perfect; 5]).unwrap();
    close(found.mean, 2.0 / 3.0, 1e-14);
    close(found.se, 0.025_565_499_628_245_68, 1e-12);
    close(found.p, 1.284_954_030_822_589_5e-5, 1e-11);
    // Whoever always gives the same label does as well as by guessing.
    let same = matrix([[6, 0], [6, 0]]);
    assert_eq!(above_guessing(&[same.clone(), same]), None);
    assert_eq!(above_guessing(&participants()[..1]), None);
}

/// All 720 ways to deal six answers to six trials.
#[test]
fn guesses_have_the_mean_and_the_variance_of_all_deals() {
    let right = [0, 0, 0, 1, 1, 2];
    let given = [0, 0, 1, 1, 2, 2];
    let mut found = Confusions::new(3);
    right.iter().zip(given).for_each(|(r, g)| found.add(*r, g));
    let mut order: Vec<usize> = (0..6).collect();
    let mut shares = Vec::new();
    fn deal(at: usize, order: &mut Vec<usize>, each: &mut dyn FnMut(&[usize])) {
        if at == order.len() {
            return each(order);
        }
        for i in at..order.len() {
            order.swap(at, i);
            deal(at + 1, order, each);
            order.swap(at, i);
        }
    }
    deal(0, &mut order, &mut |order| {
        let hits = right.iter().zip(order).filter(|(r, o)| **r == given[**o]);
        shares.push(hits.count() as f64 / 6.0);
    });
    assert_eq!(shares.len(), 720);
    let mean = describe::mean(&shares).unwrap();
    close(found.by_guessing().unwrap(), mean, 1e-14);
    let variance = describe::sum_of_squares(&shares).unwrap() / 720.0;
    close(found.guessing_variance().unwrap(), variance, 1e-14);
}

#[test]
fn perfect_answers_transmit_their_entropy() {
    let found = information(&matrix([[3, 0], [0, 3]])).unwrap();
    assert_eq!((found.transmitted, found.corrected), (1.0, 1.0));
}

/// Single matrices with fixed numbers of answers to each of four labels, from near perfect to chance. The correction is never
/// negative, and at least as large as Miller's for drawn presentations, which is negative near perfect answers.
#[test]
fn the_bias_of_fixed_presentations_is_corrected() {
    let mut random = SplitMix64::new(1955);
    let (labels, repetitions, studies) = (4, 100, 2000);
    for error in [0.02, 0.05, 0.3, 0.75] {
        let share = |right: usize, given: usize| match right == given {
            true => 1.0 - error,
            false => error / 3.0,
        };
        let joint = (0..labels).map(|given| share(0, given) * libm::log2(4.0 * share(0, given)));
        let truth: f64 = joint.sum();
        let (mut raw, mut drawn, mut fixed) = (0.0, 0.0, 0.0);
        for _ in 0..studies {
            let mut found = Confusions::new(labels);
            for trial in 0..labels * repetitions {
                let right = trial % labels;
                let u = random.below(1 << 30) as f64 / f64::from(1 << 30);
                let other = (u / error * 3.0) as usize;
                let given = match u < error {
                    true => (right + 1 + other.min(2)) % labels,
                    false => right,
                };
                found.add(right, given);
            }
            let own = information(&found).unwrap();
            assert!(own.corrected <= own.transmitted);
            let filled = |x: &f64| *x > 0.0;
            let cells = found.counts.iter().filter(|x| filled(x)).count() as f64;
            let columns = (0..labels).filter(|l| filled(&found.given(*l))).count() as f64;
            let miller = (cells - 4.0 - columns + 1.0) / (2.0 * found.trials() * LN_2);
            raw += (own.transmitted - truth) / f64::from(studies);
            drawn += (own.transmitted - miller - truth) / f64::from(studies);
            fixed += (own.corrected - truth) / f64::from(studies);
        }
        // In 20,000 studies .0232, .0240, .0192, .0163; .0180, .0118, .0029, .0001; .0129, .0071, .0009, .0000.
        assert!((0.012..0.03).contains(&raw), "{error}: {raw}");
        assert!(fixed.abs() < 0.7 * raw, "{error}: {raw} {fixed}");
        assert!(fixed <= drawn, "{error}: {fixed} {drawn}");
    }
    let near = information(&matrix([[5, 0, 0], [0, 5, 0], [0, 1, 4]])).unwrap();
    let miller = (4.0 - 3.0 - 3.0 + 1.0) / (2.0 * 15.0 * LN_2);
    assert!(miller < 0.0 && near.corrected < near.transmitted);
}

/// The interval holds the truth near perfect answers as well as at chance.
#[test]
fn the_interval_of_information_holds_the_truth() {
    let mut random = SplitMix64::new(6);
    let (studies, people, labels) = (400, 8, 4);
    for wrong in [0.04, 0.3, 0.75] {
        // Participants err 0 to 2 times as often.
        let share = |given: usize| if given == 0 { 1.0 - wrong } else { wrong / 3.0 };
        let truth: f64 = (0..labels)
            .map(|g| share(g) * libm::log2(4.0 * share(g)))
            .sum();
        let (mut held, mut defined) = (0, 0);
        for _ in 0..studies {
            let all: Vec<Confusions> = (0..people)
                .map(|_| {
                    let spread = if wrong < 0.5 {
                        random.below(1 << 20) as f64 / f64::from(1 << 19)
                    } else {
                        1.0
                    };
                    let own = (wrong * spread * f64::from(1 << 20)) as u64;
                    let mut found = Confusions::new(labels);
                    for trial in 0..labels * 6 {
                        let err = random.below(1 << 20) < own;
                        let other = if err { 1 + random.below(3) as usize } else { 0 };
                        found.add(trial % labels, (trial + other) % labels);
                    }
                    found
                })
                .collect();
            if let Some((low, high)) = transfer(&all).unwrap().ci95 {
                assert!((0.0..=high).contains(&low) && high <= 2.0);
                defined += 1;
                held += u32::from((low..=high).contains(&truth));
            }
        }
        let share = f64::from(held) / f64::from(defined);
        // Binomial: three errors of .011 below .95.
        assert!(
            defined > 390 && share > 0.917,
            "{wrong}: {share} of {defined}"
        );
    }
}

#[test]
fn nothing_is_defined_without_answers() {
    let empty = Confusions::new(2);
    assert_eq!(information(&empty), None);
    assert_eq!(empty.by_guessing(), None);
    // One label was never right.
    assert_eq!(biased_choice(&matrix([[3, 1], [0, 0]])), None);
    assert!(pooled(&[], |m| vec![sensitivity(m, 0, 1)]).is_empty());
}

/// A participant who guesses, with preferences of their own for some labels.
fn guesser(random: &mut SplitMix64, labels: usize, repetitions: usize) -> Confusions {
    let weights: Vec<f64> = (0..labels).map(|_| libm::exp(random.normal())).collect();
    let sum: f64 = weights.iter().sum();
    let mut found = Confusions::new(labels);
    for trial in 0..labels * repetitions {
        let mut left = sum * (random.below(1 << 30) as f64 / f64::from(1 << 30));
        let given = weights.iter().position(|w| {
            left -= w;
            left < 0.0
        });
        found.add(trial % labels, given.unwrap_or(labels - 1));
    }
    found
}

/// Eight participants who guess with preferences of their own: the information that they transmit by
/// chance is corrected, and few of them are above guessing.
#[test]
fn guesses_transmit_nothing_and_keep_the_level() {
    let mut random = SplitMix64::new(28);
    let (studies, labels) = (400, 5);
    let (mut raw, mut corrected, mut yes) = (0.0, 0.0, 0);
    for _ in 0..studies {
        let all: Vec<Confusions> = (0..8).map(|_| guesser(&mut random, labels, 4)).collect();
        let sum = Confusions::sum(all.iter()).unwrap();
        let found = information(&sum).unwrap();
        raw += found.transmitted / f64::from(studies);
        corrected += found.corrected / f64::from(studies);
        let above = above_guessing(&all).unwrap();
        yes += u32::from(above.p <= 0.05);
    }
    // (K − R − C + 1)/(2N ln 2) of 160 trials is 16/222 if no cell is empty.
    assert!((0.06..0.075).contains(&raw), "{raw}");
    assert!(corrected.abs() < 0.01, "{corrected}");
    // Binomial: 20 ± 3 · 4.4 of 400 at the level .05.
    assert!((7..=33).contains(&yes), "{yes}");
}

/// Answers by the model give back its parameters.
#[test]
fn similarities_and_biases_are_recovered() {
    let (similarity, biases) = ([0.5, 0.1, 0.2], [0.5, 0.3, 0.2]);
    let of = |a: usize, b: usize| match a + b {
        _ if a == b => 1.0,
        pair => similarity[pair - 1],
    };
    let mut found = Confusions::new(3);
    for right in 0..3 {
        let weights: Vec<f64> = (0..3).map(|g| of(right, g) * biases[g]).collect();
        let sum: f64 = weights.iter().sum();
        for (given, weight) in weights.iter().enumerate() {
            let n = (1e5 * weight / sum).round() as u32;
            (0..n).for_each(|_| found.add(right, given));
        }
    }
    let fit = biased_choice(&found).unwrap();
    for (a, b) in [(0, 1), (0, 2), (1, 2)] {
        close(libm::exp(fit.log_similarity(a, b)), of(a, b), 1e-3);
    }
    for (found, expected) in fit.biases.iter().zip(biases) {
        close(*found, expected, 1e-3);
    }
}
