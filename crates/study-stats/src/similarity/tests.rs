use super::dimensions::{chosen, complete, most, predicted, structure};
use super::fit::{around, followed, procrustes, resampled};
use super::scaling::{Map, Precision, Scale, classical, smacof, smacof_from};
use super::*;
use crate::random::SplitMix64;

/// Similarities of 14 colors (Ekman 1954), row by row of the upper triangle; the same as in tests/reference/similarity.R.
const EKMAN: [f64; 91] = [
    0.86, 0.42, 0.42, 0.18, 0.06, 0.07, 0.04, 0.02, 0.07, 0.09, 0.12, 0.13, 0.16, 0.50, 0.44, 0.22,
    0.09, 0.07, 0.07, 0.02, 0.04, 0.07, 0.11, 0.13, 0.14, 0.81, 0.47, 0.17, 0.10, 0.08, 0.02, 0.01,
    0.02, 0.01, 0.05, 0.03, 0.54, 0.25, 0.10, 0.09, 0.02, 0.01, 0.00, 0.01, 0.02, 0.04, 0.61, 0.31,
    0.26, 0.07, 0.02, 0.02, 0.01, 0.02, 0.00, 0.62, 0.45, 0.14, 0.08, 0.02, 0.02, 0.02, 0.01, 0.73,
    0.22, 0.14, 0.05, 0.02, 0.02, 0.00, 0.33, 0.19, 0.04, 0.03, 0.02, 0.02, 0.58, 0.37, 0.27, 0.20,
    0.23, 0.74, 0.50, 0.41, 0.28, 0.76, 0.62, 0.55, 0.85, 0.68, 0.76,
];

/// Dissimilarities in the order of [`pairs`].
fn of(objects: usize, values: impl IntoIterator<Item = Option<f64>>) -> Dissimilarities {
    let values: Vec<Option<f64>> = values.into_iter().collect();
    assert_eq!(values.len(), pairs(objects).count());
    Dissimilarities { objects, values }
}

fn ekman() -> Dissimilarities {
    of(14, EKMAN.map(|s| Some(1.0 - s)))
}

fn close(found: f64, expected: f64, tolerance: f64) {
    let difference = (found - expected).abs() / expected.abs().max(1.0);
    assert!(difference < tolerance, "{found} instead of {expected}");
}

fn fine(all: &Dissimilarities, dimensions: usize, scale: Scale, starts: usize) -> f64 {
    let random = &mut SplitMix64::new(1);
    let found = smacof(all, dimensions, scale, starts, Precision::FINE, random);
    found.unwrap().stress
}

#[test]
fn places_of_pairs_are_their_order() {
    let of_places = |n: usize| of(n, (0..pairs(n).count()).map(|at| Some(at as f64)));
    for n in [2, 3, 7] {
        let all = of_places(n);
        for (at, (a, b)) in pairs(n).enumerate() {
            assert_eq!(all.get(a, b), Some(at as f64));
            assert_eq!(all.get(b, a), Some(at as f64));
        }
        assert_eq!((all.get(1, 1), all.get(0, n)), (None, None));
    }
}

/// R 4.2.2 `cmdscale`, tests/reference/similarity.R.
#[test]
fn classical_scaling_agrees_with_r() {
    for (k, share) in [
        (1, 0.437_642_569_544),
        (2, 0.724_527_005_946),
        (3, 0.821_880_222_347),
    ] {
        close(classical(&ekman(), k).unwrap().share, share, 1e-11);
    }
    let found = classical(&ekman(), 2).unwrap();
    for (at, value) in [
        (0, 1.982_134_024_583_7),
        (1, 1.299_332_930_766_6),
        (2, 0.440_924_023_531_9),
        (13, -0.047_432_355_098_7),
    ] {
        close(found.eigenvalues[at], value, 1e-11);
    }
    for (a, b, distance) in [
        (0, 1, 0.043_208_097_355_5),
        (0, 7, 0.907_123_967_403_9),
        (3, 12, 0.903_832_467_986_0),
    ] {
        close(found.map.distance(a, b), distance, 1e-11);
    }
    // Distances on the surface of a ball are not Euclidean; those of points are kept.
    let points: Vec<[f64; 2]> = (0..6)
        .map(|i| [f64::from(i * i % 5), f64::from(i * 7 % 4)])
        .collect();
    let distance =
        |a: usize, b: usize| Some((points[a][0] - points[b][0]).hypot(points[a][1] - points[b][1]));
    let exact = Dissimilarities::from_fn(6, distance);
    let map = classical(&exact, 2).unwrap().map;
    for (a, b) in pairs(6) {
        close(map.distance(a, b), distance(a, b).unwrap(), 1e-12);
    }
}

/// `vegan::monoMDS` with the primary approach to ties, best of 201 starts, in the same file (one dimension has many local minima). Mair, Groenen & de Leeuw (2022),
/// J. Stat. Softw. 102(10), print 0.023 for two dimensions. Our stress may be lower, and in one dimension it is.
#[test]
fn ordinal_stress_agrees_with_vegan() {
    for (k, stress, tolerance, starts) in [
        (1, 0.256_394_793_2, 2e-2, 200),
        (2, 0.023_102_506_1, 5e-5, 60),
        (3, 0.012_444_091_0, 2e-4, 60),
    ] {
        let found = fine(&ekman(), k, Scale::Ordinal, starts);
        assert!(found < stress + tolerance, "{k}: {found}");
        assert!(found > stress - 20.0 * tolerance, "{k}: {found}");
    }
}

/// Rothkopf (1957), J. Exp. Psychol. 53: how often two of 36 Morse codes were called the same. `cmdscale` and `vegan::monoMDS`, in the same
/// file; `MASS::isoMDS` stops at a stress of 0.1969.
#[test]
fn the_morse_codes_of_rothkopf_agree_with_r() {
    let same: Vec<f64> = include_str!("../../tests/reference/morse.txt")
        .split_whitespace()
        .map(|percent| percent.parse().unwrap())
        .collect();
    assert_eq!(same.len(), 36 * 36);
    let apart = |a: usize, b: usize| 1.0 - (same[36 * a + b] + same[36 * b + a]) / 200.0;
    let morse = Dissimilarities::from_fn(36, |a, b| Some(apart(a, b)));
    let share = classical(&morse, 2).unwrap().share;
    close(share, 0.276_551_254_981, 1e-11);
    for (k, stress) in [(2, 0.190_624_164_6), (3, 0.129_443_511_9)] {
        close(fine(&morse, k, Scale::Ordinal, 0), stress, 1e-6);
    }
}

/// scikit-learn 1.9.1 and SciPy 1.17.1, tests/reference/similarity.py; the `smacof` paper prints 0.131.
#[test]
fn ratio_stress_agrees_with_scikit_learn_and_scipy() {
    close(fine(&ekman(), 2, Scale::Ratio, 20), 0.131_199_263_56, 1e-8);
    close(fine(&ekman(), 3, Scale::Ratio, 20), 0.073_346_799_81, 1e-8);
    // One dimension has many local minima.
    let line = fine(&ekman(), 1, Scale::Ratio, 300);
    assert!((0.39..0.4265).contains(&line), "{line}");
}

/// A third of the pairs is missing; SciPy minimizes the weighted stress.
#[test]
fn missing_pairs_have_no_weight() {
    let kept = |at: usize, s: f64| (at % 3 != 2).then_some(1.0 - s);
    let some = of(14, EKMAN.iter().enumerate().map(|(at, s)| kept(at, *s)));
    let random = &mut SplitMix64::new(1);
    let found = smacof(&some, 2, Scale::Ratio, 40, Precision::FINE, random).unwrap();
    close(found.stress, 0.112_712_522_471, 1e-8);
    close(found.map.distance(0, 1), 0.089_992_022_861, 1e-4);
    close(found.map.distance(0, 3), 0.337_281_407_718, 1e-4);
    // What a missing pair had does not matter, and a map needs pairs that connect all.
    assert_eq!(classical(&some, 2), None);
    let apart = Dissimilarities::from_fn(6, |a, b| ((a < 3) == (b < 3)).then_some(1.0));
    assert_eq!(
        smacof(&apart, 1, Scale::Ratio, 3, Precision::COARSE, random),
        None
    );
}

#[test]
fn what_has_no_map_is_none_and_what_is_perfect_has_no_stress() {
    let random = &mut SplitMix64::new(1);
    let mut map =
        |all: &Dissimilarities, k| smacof(all, k, Scale::Ordinal, 3, Precision::FINE, random);
    let equal = Dissimilarities::from_fn(5, |_, _| Some(0.0));
    assert_eq!(map(&equal, 1), None);
    let line = Dissimilarities::from_fn(5, |a, b| Some(2.0 * (b - a) as f64));
    assert_eq!(map(&line, 4), None);
    assert_eq!(map(&line, 0), None);
    let found = map(&line, 1).unwrap();
    assert!(found.stress < 1e-4);
    assert_eq!(classical(&line, 5), None);
    // An axis that the objects do not need is there all the same.
    let flat = map(&line, 2).unwrap();
    assert!(flat.stress < 1e-3 && flat.map.dimensions() == 2);
    // Units are those of the dissimilarities.
    let ratio = smacof(
        &line,
        1,
        Scale::Ratio,
        0,
        Precision::FINE,
        &mut SplitMix64::new(2),
    );
    close(ratio.unwrap().map.distance(0, 4), 8.0, 1e-6);
    let again = smacof_from(&found.map, &line, Scale::Ratio, Precision::FINE).unwrap();
    close(again.map.distance(1, 3), 4.0, 1e-6);
}

/// Of tied dissimilarities any order fits: the distances of a line are no stress although all but one are equal.
#[test]
fn ties_are_in_any_order() {
    let tied = Dissimilarities::from_fn(4, |a, b| Some(if (a, b) == (0, 1) { 1.0 } else { 2.0 }));
    assert!(fine(&tied, 1, Scale::Ordinal, 10) < 1e-3);
}

/// `vegan::protest` and `procrustes`, in the same file.
#[test]
fn procrustes_agrees_with_vegan() {
    let map = classical(&ekman(), 2).unwrap().map;
    let wavelength = [
        434.0, 445.0, 465.0, 472.0, 490.0, 504.0, 537.0, 555.0, 584.0, 600.0, 610.0, 628.0, 651.0,
        674.0,
    ];
    close(
        procrustes(&map, &[wavelength.to_vec()]).unwrap(),
        0.713_992_614_286,
        1e-11,
    );
    let angle = (0..14).map(|i| f64::from(i) * std::f64::consts::PI / 8.0);
    let two = [
        angle.clone().map(libm::cos).collect(),
        angle.map(|a| 3.0 * libm::sin(a)).collect(),
    ];
    close(procrustes(&map, &two).unwrap(), 0.959_668_222_707, 1e-11);
    assert_eq!(procrustes(&map, &[vec![1.0; 14]]), None);
    assert_eq!(procrustes(&map, &[vec![1.0; 13]]), None);
    assert_eq!(procrustes(&map, &[]), None);
    let six = Dissimilarities::from_fn(6, |a, b| ekman().get(a, b));
    let map = classical(&six, 2).unwrap().map;
    let property = vec![1.0, 3.0, 2.0, 5.0, 4.0, 6.0];
    let found = followed(
        &map,
        std::slice::from_ref(&property),
        &mut SplitMix64::new(1),
    )
    .unwrap();
    close(found.r, 0.677_125_066_181, 1e-11);
    close(found.p, 0.077_777_777_777_8, 1e-11);
    // The mirrored order is as extreme.
    assert_eq!((found.exact, found.smallest), (true, 2.0 / 720.0));
    let all = followed(
        &classical(&ekman(), 2).unwrap().map,
        &[wavelength.to_vec()],
        &mut SplitMix64::new(1),
    );
    let all = all.unwrap();
    assert!(!all.exact && all.p < 0.01, "{all:?}");
}

const PEOPLE: [[f64; 10]; 4] = [
    [1.0, 3.0, 6.0, 9.0, 2.0, 5.0, 8.0, 3.0, 7.0, 4.0],
    [2.0, 2.0, 5.0, 8.0, 1.0, 6.0, 7.0, 4.0, 6.0, 3.0],
    [0.0, 4.0, 4.0, 7.0, 3.0, 3.0, 9.0, 2.0, 8.0, 5.0],
    [3.0, 1.0, 9.0, 6.0, 2.0, 7.0, 5.0, 5.0, 4.0, 1.0],
];

/// Base R, in the same file.
#[test]
fn agreement_agrees_with_r() {
    let people = PEOPLE.map(|own| of(5, own.map(Some)));
    let found = agreement(&people);
    close(found.mean_correlation.unwrap(), 0.635_039_812_329, 1e-11);
    close(found.kendall_w.unwrap(), 0.713_246_554_364, 1e-11);
    assert_eq!(found.complete, 4);
    let expected = [
        0.960_191_283_681,
        0.933_409_395_143,
        0.615_624_935_003,
        0.453_186_327_962,
    ];
    for (found, expected) in with_the_others(&people).iter().zip(expected) {
        close(found.unwrap(), expected, 1e-11);
    }
    // Somebody without a pair counts for the others.
    let mut some = people.to_vec();
    some[0].values[3] = None;
    let found = agreement(&some);
    assert_eq!(found.complete, 3);
    assert!(found.mean_correlation.is_some());
    // A pair that nobody rates is missing to nobody.
    let mut fewer = people.to_vec();
    fewer.iter_mut().for_each(|own| own.values[3] = None);
    let found = agreement(&fewer);
    assert_eq!(found.complete, 4);
    assert!(found.kendall_w.is_some());
    let alone = agreement(&people[..1]);
    assert_eq!((alone.mean_correlation, alone.kendall_w), (None, None));
}

#[test]
fn rescaled_dissimilarities_have_the_mean_one() {
    let own = of(3, [Some(0.0), None, Some(4.0)]);
    assert_eq!(
        own.rescaled().unwrap().values(),
        [Some(0.0), None, Some(2.0)]
    );
    assert_eq!(of(3, [Some(0.0); 3]).rescaled(), None);
    let other = of(3, [Some(2.0), Some(3.0), None]);
    let mean = Dissimilarities::mean([own, other].iter()).unwrap();
    assert_eq!(mean.values(), [Some(1.0), Some(3.0), Some(4.0)]);
}

/// Who rated only some pairs does not count more, nor less: base R, in the same file.
#[test]
fn what_participants_have_in_common_does_not_depend_on_who_rated_what() {
    let mut people = PEOPLE.map(|own| of(5, own.map(Some)));
    let whole = Dissimilarities::in_common(people.iter());
    assert_eq!(whole, Dissimilarities::mean(people.iter()));
    people[0].values[7..].fill(None);
    people[1].values[..2].fill(None);
    let people = people.map(|own| own.rescaled().unwrap());
    let found = Dissimilarities::in_common(people.iter()).unwrap();
    let expected = [
        0.224_902_061_504,
        0.433_863_937_097,
        1.0,
        1.238_223_257_832,
        0.330_713_686_815,
        0.875_606_810_850,
        1.196_286_971_907,
        0.624_343_866_471,
        1.010_177_657_294,
        0.502_526_677_079,
    ];
    let found = found.known();
    for (own, expected) in found.iter().zip(expected) {
        close(own / found[2], expected, 1e-10);
    }
    assert_eq!(Dissimilarities::in_common([].iter()), None);
}

/// All 2⁹ choices of signs, in the same file; four standard errors of the drawn ones.
#[test]
fn asymmetry_agrees_with_all_choices_of_signs() {
    let differences = [[4.0, 1.0, -1.0], [3.0, -2.0, 2.0], [5.0, 0.0, 1.0]];
    let differences = differences.map(|own| own.map(Some).to_vec());
    let found = asymmetry(&differences, &mut SplitMix64::new(1)).unwrap();
    close(found.rms, 2.349_152_723_54, 1e-11);
    assert!((found.p - 0.218_75).abs() < 0.017, "{}", found.p);
    assert_eq!((found.pairs, found.differences), (3, 9));
    let some = [vec![Some(1.0), None], vec![None, None]];
    let found = asymmetry(&some, &mut SplitMix64::new(1)).unwrap();
    assert_eq!((found.rms, found.pairs, found.p), (1.0, 1, 1.0));
    assert_eq!(asymmetry(&[vec![None]], &mut SplitMix64::new(1)), None);
}

/// Participants who perceive points of a plane, or of a line, or nothing in common.
fn simulated(objects: usize, dimensions: usize, people: usize, seed: u64) -> Vec<Dissimilarities> {
    let mut random = SplitMix64::new(seed);
    let place = |object: usize| {
        let turn = 2.4 * object as f64;
        let out = [object as f64 % 4.0, (object * 5 % 7) as f64, turn];
        out[..dimensions].to_vec()
    };
    (0..people)
        .map(|_| {
            let rated = pairs(objects).map(|(a, b)| {
                let between = place(a).into_iter().zip(place(b));
                let distance: f64 = between.map(|(x, y)| (x - y) * (x - y)).sum();
                Some((distance.sqrt() + 0.8 * random.normal()).max(0.0))
            });
            let rated: Vec<Option<f64>> = rated.collect();
            of(objects, rated)
        })
        .collect()
}

#[test]
fn dimensions_are_those_that_predict_others() {
    let choice = |dimensions: usize| {
        let people = simulated(9, dimensions, 12, 5);
        let random = &mut SplitMix64::new(2);
        let of = |k: usize| predicted(&people, k, random);
        let predictions: Vec<_> = (1..=most(9)).map(of).collect();
        assert_eq!(complete(&predictions)[0].len(), 12);
        chosen(&predictions)
    };
    assert_eq!((choice(1), choice(2)), (Some(1), Some(2)));
    assert_eq!([3, 4, 5, 6, 8, 30].map(most), [0, 1, 1, 2, 3, 3]);
    assert_eq!(chosen(&[]), None);
    assert!(predicted(&simulated(6, 2, 1, 1), 1, &mut SplitMix64::new(1)).is_empty());
}

#[test]
fn structure_is_found_where_it_is() {
    let random = &mut SplitMix64::new(3);
    let found = structure(&simulated(7, 2, 8, 6), random).unwrap();
    assert!(found.dimensions == 2 && found.p < 0.02, "{found:?}");
    assert!(found.stress < found.by_chance, "{found:?}");
    let nothing = simulated(7, 0, 8, 7);
    assert!(structure(&nothing, random).unwrap().p > 0.01);
    assert_eq!(structure(&simulated(3, 2, 8, 6), random), None);
    assert_eq!(structure(&[], random), None);
    assert_eq!(
        structure(&simulated(5, 2, 8, 6), random)
            .unwrap()
            .dimensions,
        1
    );
}

/// Base R, in the same file. A correlation is at least 0, and its interval has it.
#[test]
fn the_interval_of_a_correlation_is_that_of_its_z() {
    let (low, high) = around(0.8, &[0.78, 0.8, 0.82], 3).unwrap();
    close(low, 0.666_751_686_363, 1e-9);
    close(high, 0.883_687_401_802, 1e-9);
    let (low, high) = around(0.8, &[0.7, 0.8, 0.9], 3).unwrap();
    assert_eq!(low, 0.0);
    close(high, 0.991_133_687_216, 1e-9);
    assert_eq!(around(1.0, &[1.0, 1.0, 1.0], 3).unwrap().1, 1.0);
    assert_eq!(around(0.8, &[0.7, 0.8], 1), None);
}

#[test]
fn participants_are_resampled() {
    let people = simulated(7, 2, 10, 8);
    let mean = Dissimilarities::mean(people.iter()).unwrap();
    let random = &mut SplitMix64::new(4);
    let map = smacof(&mean, 2, Scale::Ordinal, 10, Precision::FINE, random).unwrap();
    let property: Vec<f64> = (0..7).map(|object| map.map.point(object)[0]).collect();
    let r = procrustes(&map.map, std::slice::from_ref(&property)).unwrap();
    let found = resampled(&people, (&map.map, Scale::Ordinal), &[property], random).unwrap();
    let (low, high) = found.r_ci95.unwrap();
    assert!(low < r && r < high + 0.02 && low > 0.5, "{low} {r} {high}");
    // The errors of means of ten ratings with the noise 0.8.
    let errors: Vec<f64> = found.errors.concat();
    assert!(errors.iter().all(|e| (0.02..0.9).contains(e)), "{errors:?}");
    assert_eq!(
        resampled(&people[..1], (&map.map, Scale::Ordinal), &[], random),
        None
    );
    let without = resampled(&people, (&map.map, Scale::Ratio), &[], random).unwrap();
    assert_eq!(without.r_ci95, None);
}

#[test]
fn maps_are_on_principal_axes() {
    let map = Map::new(2, vec![0.0, 1.0, 1.0, 3.0, 2.0, 5.0, 3.0, 9.0]);
    let sum = |k: usize| (0..4).map(|o| map.point(o)[k]).sum::<f64>();
    assert!(sum(0).abs() < 1e-12 && sum(1).abs() < 1e-12);
    let found = classical(&map.distances(), 2).unwrap().map;
    let squares = |k: usize| (0..4).map(|o| found.point(o)[k].powi(2)).sum::<f64>();
    assert!(squares(0) > squares(1));
    let products: f64 = (0..4).map(|o| found.point(o)[0] * found.point(o)[1]).sum();
    assert!(products.abs() < 1e-9);
    // The object that is farthest out is on the positive side.
    assert!(found.point(3)[0] > 0.0);
}

/// How often there is said to be a structure, and a second dimension, and how often the number of dimensions is found: participants ×
/// objects, dimensions, structure, second dimension, number (`--ignored --nocapture`).
#[test]
#[ignore = "minutes without optimization"]
fn tests_keep_their_level() {
    const SETS: u64 = 200;
    for (objects, people) in [(6, 8), (8, 12)] {
        for truth in 0..=2 {
            let (mut structures, mut seconds, mut found) = (0, 0, 0);
            for set in 0..SETS {
                let people = simulated(objects, truth, people, 1000 + set);
                let random = &mut SplitMix64::new(set);
                structures += u64::from(structure(&people, random).unwrap().p <= 0.05);
                let predictions: Vec<_> = (1..=most(objects))
                    .map(|k| predicted(&people, k, random))
                    .collect();
                found += u64::from(chosen(&predictions) == Some(truth.max(1)));
                let known = complete(&predictions);
                let differences: Vec<f64> = (known[1].iter().zip(&known[0]))
                    .map(|(two, one)| two - one)
                    .collect();
                let test = crate::paired::one_sample(&differences).unwrap();
                seconds += u64::from(test.mean > 0.0 && test.p.is_some_and(|p| p <= 0.05));
            }
            let share = |n: u64| n as f64 / SETS as f64;
            let (structures, seconds, found) = (share(structures), share(seconds), share(found));
            println!(
                "| {people} × {objects} | {truth} | {structures:.3} | {seconds:.3} | {found:.3} |"
            );
            let error = (0.05 * 0.95 / SETS as f64).sqrt();
            assert!(truth > 0 || structures <= 0.05 + 4.0 * error);
            assert!(truth > 1 || seconds <= 0.05 + 4.0 * error);
        }
    }
}
