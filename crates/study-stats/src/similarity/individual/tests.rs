//! Reference values are those of `tests/reference/individual.py`.

use super::*;
use crate::random::SplitMix64;
use crate::similarity::pairs;

/// Ratings of five participants of seven stimuli, in the order of [`pairs`].
const RATINGS: [[f64; 21]; 5] = [
    [
        45., 25., 68., 31., 79., 12., 36., 25., 19., 28., 41., 50., 15., 62., 15., 31., 32., 54.,
        45., 27., 71.,
    ],
    [
        45., 47., 69., 40., 69., 31., 43., 35., 17., 30., 36., 36., 23., 67., 21., 38., 45., 54.,
        45., 22., 70.,
    ],
    [
        34., 59., 73., 36., 53., 40., 49., 50., 21., 20., 40., 29., 28., 68., 17., 37., 59., 53.,
        38., 21., 54.,
    ],
    [
        29., 61., 69., 34., 34., 36., 43., 57., 19., 11., 27., 23., 25., 61., 23., 35., 58., 34.,
        31., 13., 41.,
    ],
    [
        53., 62., 94., 47., 83., 38., 55., 54., 22., 34., 49., 45., 33., 76., 26., 43., 60., 66.,
        50., 26., 79.,
    ],
];

fn rated() -> Vec<Dissimilarities> {
    let of = |values: &[f64; 21]| Dissimilarities {
        objects: 7,
        values: values.iter().copied().map(Some).collect(),
    };
    RATINGS.iter().map(of).collect()
}

fn found(people: &[Dissimilarities]) -> Weighted {
    weighted(people, 2, 10, Precision::FINE, &mut SplitMix64::new(1)).unwrap()
}

#[test]
fn weights_agree_with_scipy() {
    let found = found(&rated());
    let coordinates = [
        [-0.498_856_508, -0.475_385_558],
        [0.175_045_298, -0.271_713_492],
        [-0.235_571_734, 0.478_801_895],
        [0.383_657_186, 0.548_829_345],
        [-0.027_927_853, 0.020_994_612],
        [0.599_971_909, -0.399_576_047],
        [-0.396_318_297, 0.098_049_246],
    ];
    for (object, expected) in coordinates.iter().enumerate() {
        for (x, expected) in found.map.point(object).iter().zip(expected) {
            assert!((x - expected).abs() < 1e-5, "{object}: {x} {expected}");
        }
    }
    let weights = [
        [0.989_527_290, 0.093_313_561],
        [0.885_898_814, 0.445_070_399],
        [0.523_042_645, 0.838_009_200],
        [0.217_490_441, 0.963_826_625],
        [0.825_768_852, 0.554_103_998],
    ];
    let fits = [
        0.987_884_027,
        0.982_957_103,
        0.975_891_651,
        0.976_291_893,
        0.988_986_636,
    ];
    for (person, expected) in weights.iter().enumerate() {
        for (w, expected) in found.weights[person].iter().zip(expected) {
            assert!((w - expected).abs() < 1e-5, "{person}: {w} {expected}");
        }
        assert!((found.fits[person] - fits[person]).abs() < 1e-6);
    }
    assert!((found.fit() - 0.982_402_262_246).abs() < 1e-8);
    let common = common_fit(&rated(), 2).unwrap();
    assert!((common - 0.815_709_359_296).abs() < 1e-7, "{common}");
}

/// Distances of a plane whose two properties are weighed: they come back whatever the axes of the start, and by hand: along a dimension
/// with the sum of squares S the scalar products have the length a·S.
#[test]
fn weights_without_noise_come_back() {
    let places = [
        [0.0, 0.0],
        [3.0, 1.0],
        [1.0, 4.0],
        [4.0, 5.0],
        [2.0, 2.5],
        [5.0, 1.5],
    ];
    let given: [[f64; 2]; 4] = [[1.0, 0.0], [0.6, 0.8], [0.1, 1.5], [2.0, 2.0]];
    let people: Vec<Dissimilarities> = (given.iter())
        .map(|[a, b]| {
            Dissimilarities::from_fn(6, |i, j| {
                let along = |k: usize| -> f64 { places[i][k] - places[j][k] };
                Some((a * along(0).powi(2) + b * along(1).powi(2)).sqrt())
            })
        })
        .collect();
    let found = found(&people);
    assert!((found.fit() - 1.0).abs() < 1e-9, "{}", found.fit());
    let extent = |k: usize| {
        let mean = places.iter().map(|p| p[k]).sum::<f64>() / 6.0;
        places.iter().map(|p| (p[k] - mean).powi(2)).sum::<f64>()
    };
    let parts = [extent(0), extent(1)];
    // The cosine of the two properties.
    let means = [0, 1].map(|k| places.iter().map(|p| p[k]).sum::<f64>() / 6.0);
    let product: f64 = places
        .iter()
        .map(|p| (p[0] - means[0]) * (p[1] - means[1]))
        .sum();
    let cosine = product / (parts[0] * parts[1]).sqrt();
    // Which dimension is the first one depends on the weights.
    let first = found.weights[0][0] < found.weights[0][1];
    for (own, [a, b]) in found.weights.iter().zip(given) {
        let (a, b) = (a * parts[0], b * parts[1]);
        let length = (a * a + b * b + 2.0 * a * b * cosine * cosine).sqrt();
        let expected = [a / length, b / length];
        for k in 0..2 {
            let w = own[if first { 1 - k } else { k }];
            assert!((w - expected[k]).abs() < 1e-4, "{w} {}", expected[k]);
        }
    }
}

#[test]
fn participants_with_weights_of_their_own_differ() {
    let found = differ(&rated(), 2, &mut SplitMix64::new(1)).unwrap();
    assert!(
        (found.gain - (0.982_402_262 - 0.815_709_359)).abs() < 1e-4,
        "{}",
        found.gain
    );
    assert!(
        found.p < 0.02 && found.by_chance < 0.5 * found.gain,
        "{found:?}"
    );
    // The ratings of one person, with noise that nobody else has.
    let mut random = SplitMix64::new(2);
    let alike: Vec<Dissimilarities> = (0..5)
        .map(|_| {
            let values = RATINGS[4].iter().map(|x| Some(x + 6.0 * random.normal()));
            Dissimilarities {
                objects: 7,
                values: values.collect(),
            }
        })
        .collect();
    let found = differ(&alike, 2, &mut SplitMix64::new(1)).unwrap();
    assert!(found.p > 0.05, "{found:?}");
    // Nobody differs from anybody: every deal is the observed one.
    let same = vec![rated().remove(0); 4];
    let found = differ(&same, 2, &mut SplitMix64::new(1)).unwrap();
    assert_eq!(found.p, 1.0);
}

/// A negative solution is no weight: of two that share a part, the other one takes its place.
#[test]
fn weights_are_not_negative() {
    let gram = SymmetricMatrix::from_fn(2, |i, j| if i == j { 1.0 } else { 0.8 });
    // Without the bound: (2.22, −1.27).
    let (weights, value) = nonnegative(&gram, &[1.2, 0.5]);
    assert!((weights[0] - 1.2).abs() < 1e-12 && weights[1] == 0.0);
    assert!((value - 1.44).abs() < 1e-12);
    assert_eq!(nonnegative(&gram, &[-1.0, -2.0]), (vec![0.0, 0.0], 0.0));
}

#[test]
fn what_has_no_weights_is_none() {
    let random = &mut SplitMix64::new(1);
    let mut of = |people: &[Dissimilarities], k| weighted(people, k, 1, Precision::COARSE, random);
    let people = rated();
    assert_eq!(of(&[], 2), None);
    assert_eq!(of(&people[..1], 2), None);
    assert_eq!(of(&people, 0), None);
    assert_eq!(of(&people, 6), None);
    let mut lacking = people.clone();
    lacking[2].values[3] = None;
    assert_eq!(of(&lacking, 2), None);
    lacking[2].values = vec![Some(0.0); pairs(7).count()];
    assert_eq!(of(&lacking, 2), None);
}
