use super::*;
use crate::anova::one_way;
use crate::paired::one_sample;
use crate::random::{RandomSource, SplitMix64};
use proptest::prelude::*;

/// Subject, realization, mean.
type Row = (usize, usize, f64);

/// What R says of a table.
struct Reference {
    name: &'static str,
    /// Realization and mean of each cell; a stroke ends a subject.
    rows: &'static str,
    /// Estimate, standard error, degrees of freedom, p, and interval of the contrasts last − first, of the line 0, 1, 2, …, and second − third.
    contrasts: &'static str,
    /// F, its degrees of freedom and p: of all realizations, and of the first three.
    tests: &'static str,
    /// F, ε of Greenhouse and Geisser and of Huynh and Feldt, degrees of freedom, and p with either of all differences.
    differences: &'static str,
}

/// R 4.2.2, clubSandwich 0.5.8: `fit <- lm(y ~ participant + realization)`, `vcovCR(fit, cluster = participant, type = "CR2")`,
/// `linear_contrast(fit, vcov, contrasts, test = "Satterthwaite")`, `Wald_test(fit, constraints, vcov, test = "HTZ")`. *thin*: two subjects
/// link two halves. *single*: some rated one realization. *chain*: nearly all rated two. *blocks*: a balanced incomplete block design.
/// *bridges*: six rated one half, six the other, three some of both.
/// The differences are computed from the covariance and its `adjustments` by N × N matrices, with the formulas of [`Clustered::differences`].
const REFERENCES: [Reference; 8] = [
    Reference {
        name: "sixteen",
        rows: "0 3.49, 1 5.09, 2 6.07 / 1 4.57, 2 3.51, 3 5.34 / 0 2.52, 3 6.78 / 0 5.49, 1 4.95, 2 5.95, 3 4.81 / \
            2 2.09, 3 3.66 / 0 2.35, 2 2.49",
        contrasts: "2.11421052631579 1.38462642119732 3.22243376402657 0.21805803698795 -2.1251147924391 6.35353584507068 / \
            3.19691280439906 1.99524125206976 3.37736527537649 0.197247098417837 -2.76974034747185 9.16356595626996 / \
            -0.0511940298507452 0.560476643292058 2.39722635273487 0.934298247728374 -2.11751552828968 2.01512746858819",
        tests: "0.399337577683243 3.0 1.27098747317391 0.781028002846092 / \
            0.688351093052418 2.0 1.86973195831139 0.597008672362224",
        differences: "1.81066004371488 0.499667413881777 1 3 6.6860003304079 0.282062261467309 0.236527552964502",
    },
    Reference {
        name: "thin",
        rows: "0 5.84, 1 6.68, 2 5.64 / 0 0.57, 1 2.27, 2 2.64 / 0 3.52, 1 2.25, 2 5.38 / 0 3.38, 1 4.14, 2 5.60 / \
            0 1.34, 1 2.04, 2 2.89 / 2 4.13, 3 4.46, 4 4.29 / 2 6.15, 4 5.17 / 3 4.34, 4 4.68 / 3 7.40, 4 6.96 / \
            3 3.88, 4 3.93 / 3 2.21, 4 3.57",
        contrasts: "1.26388888888889 0.784924752803857 2.11457596431011 0.241964579861346 -1.94393007528492 4.4717078530627 / \
            3.09205555555556 2.45918294393683 1.80415075316768 0.34704961530335 -8.6696101339995 14.8537212451106 / \
            -0.954000000000001 0.682602373274515 4.0 0.23476784053652 -2.84920801807442 0.941208018074422",
        tests: "1.27744562761026 4.0 1.74375528058515 0.500294909815898 / \
            5.08535697335077 2.0 3.0 0.108709602037933",
        differences: "2.59506378375259 0.713878877813504 1 4 8.85904272829019 0.144119634798502 0.109222084037159",
    },
    Reference {
        name: "single",
        rows: "0 2.28, 1 3.65, 2 6.88, 3 5.98 / 2 4.75 / 0 3.47, 1 4.04 / 1 2.81, 2 1.00, 3 2.82 / 0 3.73, 3 5.96 / \
            0 4.38, 1 4.20, 2 4.32, 3 6.59 / 1 3.55 / 1 4.68, 3 4.31 / 0 1.97, 2 4.28",
        contrasts: "2.43357142857143 0.400998308144789 3.97100488215113 0.00381216307777107 1.3170082427788 3.55013461436405 / \
            3.88583333333333 1.06312206657308 4.27642418510979 0.019294946708216 1.0078777424961 6.76378892417057 / \
            -0.470952380952381 1.17686202428509 3.24328833561797 0.713942688960373 -4.06222478722518 3.12032002532042",
        tests: "8.96351762032012 3.0 1.9694407949012 0.104371681028691 / \
            2.22218098274454 2.0 2.73228924784305 0.267328676016478",
        differences: "3.09234884616219 0.568089520369331 1 3 8.85501352123092 0.135061946354622 0.0832794699514792",
    },
    Reference {
        name: "blocks",
        rows: "0 4.14, 1 2.83, 2 3.11 / 0 6.49, 1 5.36, 3 5.05 / 0 0.26, 1 2.69, 4 3.06 / 0 2.32, 2 4.28, 3 5.59 / \
            0 3.53, 2 4.69, 4 2.70 / 0 3.36, 3 5.59, 4 5.22 / 1 3.34, 2 3.40, 3 3.05 / 1 5.35, 2 7.41, 4 7.66 / \
            1 6.73, 3 4.27, 4 6.14 / 2 7.03, 3 6.29, 4 6.59",
        contrasts: "1.034 0.79247467070166 5.73857598299681 0.24184606876688 -0.926731548808398 2.9947315488084 / \
            2.12533333333333 1.83562638953991 6.82335102350265 0.285851655583083 -2.23811749019577 6.48878415686243 / \
            -0.526000000000001 0.512502747960113 5.73857598299681 0.346035353366056 -1.79402829658476 0.742028296584756",
        tests: "0.797842981166697 4.0 4.22891566265061 0.581519389569718 / \
            1.58980686071332 2.0 5.17299631652484 0.289601874466163",
        differences: "0.774166438781023 0.708175308530671 1 4 16 0.525128927501824 0.557839795823683",
    },
    Reference {
        name: "chain",
        rows: "0 5.28, 1 3.74 / 0 2.63, 1 4.20 / 1 3.70, 2 4.22 / 1 3.48, 2 3.30 / 1 2.45, 2 3.63 / 2 4.42, 3 4.22 / \
            2 3.84, 3 4.47 / 3 1.83, 4 0.48 / 3 3.90, 4 2.42 / 0 4.88, 4 3.88 / 0 3.95, 1 3.15, 2 4.72, 3 5.68, 4 8.23",
        contrasts: "1.26416481069042 1.9717414338115 2.19513694908487 0.581930619266688 -6.5362926659187 9.06462228729955 / \
            4.44082405345211 4.80762129821364 2.13281311930659 0.447891691733162 -15.058045003167 23.9396931100712 / \
            -0.863363028953229 0.478097372289277 3.88767828626367 0.147316889066615 -2.20603674893924 0.479310691032785",
        tests: "0.551605927824277 4.0 1.33936574351582 0.738130472222009 / \
            1.26185145763875 2.0 3.09338802524252 0.397454181114017",
        differences: "0.675559909307614 0.430740216645398 1 4 8.92722038470156 0.539814628705173 0.625765899477659",
    },
    Reference {
        name: "uneven",
        rows: "0 4.02, 1 4.66, 2 5.31, 3 3.92, 4 5.51, 5 5.00 / 0 4.87, 1 5.07, 2 6.93, 3 3.97, 4 4.53, 5 4.09 / \
            0 3.88, 1 4.73, 2 4.87, 3 7.33, 4 6.95, 5 7.69 / 0 2.88, 1 1.85, 2 5.77, 3 7.29, 4 7.44, 5 8.03 / \
            0 2.97, 2 3.44, 4 4.15 / 0 4.57, 2 4.52, 4 6.30 / 0 2.52, 2 4.53, 4 3.72 / 0 1.92, 2 3.17, 4 2.42 / \
            0 4.77, 2 4.31, 4 2.86 / 1 3.96, 3 5.27, 5 6.78 / 1 2.45, 3 3.39, 5 3.65 / 1 5.11, 3 5.87, 5 6.70 / \
            1 3.54, 3 4.34, 5 4.76 / 0 4.79, 5 7.27 / 0 1.51, 1 3.05, 2 3.00",
        contrasts: "1.95269199126216 0.746235254689024 7.45823413280928 0.0327077972956821 0.209867639927613 3.69551634259671 / \
            6.78357985332917 2.78393907625881 10.3658513961552 0.0342551899762686 0.610124759535736 12.9570349471226 / \
            -1.10905727822066 0.513179735271789 7.09483115222442 0.066976892746448 -2.31925424638588 0.101139689944562",
        tests: "5.33567634486461 5.0 5.19546151048538 0.0420756611329131 / \
            6.68469761340585 2.0 7.46285691266679 0.0216976707700743",
        differences: "4.06096289785679 0.393359545751823 0.559706554694795 5 32.8887526517608 0.0433155520898392 0.024292665091359",
    },
    Reference {
        name: "complete",
        rows: "0 5.63, 1 5.84, 2 4.66, 3 4.06 / 0 4.76, 1 4.86, 2 6.30, 3 7.74 / 0 3.71, 1 3.66, 2 3.04, 3 4.41 / \
            0 4.63, 1 6.65, 2 6.30, 3 5.29 / 0 5.37, 1 7.58, 2 4.87, 3 7.38 / 0 3.80, 1 3.78, 2 3.80, 3 3.03 / \
            0 5.41, 1 6.25, 2 6.01, 3 6.55 / 0 3.03, 1 3.91, 2 5.79, 3 5.71 / 0 3.77, 1 5.44, 2 5.27, 3 4.07",
        contrasts: "0.903333333333334 0.501827216834196 8.0 0.109538214047614 -0.253882303844321 2.06054897051099 / \
            1.24777777777778 0.867130929780916 8.0 0.188110018902362 -0.751829732060447 3.247385287616 / \
            0.214444444444445 0.449141499329279 8.0 0.645810622412895 -0.821277710300673 1.25016659918956",
        tests: "2.4842996068438 3.0 6.0 0.157997836905972 / \
            4.00053951293299 2.0 7.0 0.0694087772716921",
        differences: "1.78896231782573 0.788112322614896 1 3 24 0.190569825977645 0.176166442231754",
    },
    Reference {
        name: "bridges",
        rows: "0 3.12, 1 4.26, 2 3.94 / 0 6.24, 1 6.74, 2 6.04 / 0 4.55, 1 4.27, 2 4.01 / 0 2.44, 1 3.57, 2 5.29 / \
            0 5.25, 1 4.96, 2 4.48 / 0 4.94, 1 4.74, 2 7.14 / 3 5.44, 4 5.18, 5 3.32 / 3 2.20, 4 3.46, 5 3.58 / \
            3 4.02, 4 3.21, 5 2.30 / 3 4.37, 4 1.75, 5 3.04 / 3 4.22, 4 5.52, 5 5.89 / 3 5.72, 4 7.42, 5 7.30 / \
            0 1.28, 1 1.17, 2 0.50, 3 0.89, 4 3.77, 5 0.98 / 1 3.96, 4 2.82 / 2 7.24, 3 6.11, 5 5.82",
        contrasts: "0.15125 0.760262522332227 3.07397379125937 0.854740918561152 -2.23563728018178 2.53813728018178 / \
            0.637500000000001 3.62126813774747 1.91818038634214 0.877080923299307 -15.5981009801449 16.8731009801449 / \
            -0.222857142857143 0.465129844696544 6.95101723091472 0.646552758820089 -1.32428757743999 0.878573291725702",
        tests: "0.402375740178639 5.0 3.4925757974684 0.826079319397358 / \
            1.03417317945318 2.0 5.52142204673238 0.41546231287263",
        differences: "0.436045204037847 0.630829003598563 1 5 18.3002367156909 0.740176113429518 0.817637766247448",
    },
];

impl Reference {
    fn rows(&self) -> Vec<Row> {
        let subjects = self.rows.split(" / ").enumerate();
        let cell = |text: &str| -> Option<(usize, f64)> {
            let (realization, mean) = text.split_once(' ')?;
            Some((realization.parse().ok()?, mean.parse().ok()?))
        };
        subjects
            .flat_map(|(s, own)| {
                own.split(", ").map(move |text| {
                    let (realization, mean) = cell(text).unwrap();
                    (s, realization, mean)
                })
            })
            .collect()
    }
}

/// The rows of numbers of a text.
fn numbers(text: &str) -> Vec<Vec<f64>> {
    let row = |row: &str| row.split(' ').map(|x| x.parse().unwrap()).collect();
    text.split(" / ").map(row).collect()
}

fn cells(rows: &[Row]) -> Vec<CellSummary> {
    let cell = |&(subject, realization, mean): &Row| CellSummary {
        subject,
        realization,
        x: 0.0,
        n: 1,
        mean,
        within: 0.0,
    };
    rows.iter().map(cell).collect()
}

fn clustered(rows: &[Row]) -> Clustered {
    Clustered::of(&cells(rows)).unwrap()
}

/// To 1e-9: p of R and ours differ by rounding only.
fn near(found: f64, expected: f64, what: &str) {
    assert!(
        (found - expected).abs() <= 1e-9 * expected.abs().max(1.0),
        "{what}: {found} instead of {expected}"
    );
}

/// The first realization against each of some others.
fn against_first(k: usize, others: std::ops::Range<usize>) -> Vec<Vec<f64>> {
    let one = |at: usize| {
        let mut weights = vec![0.0; k];
        (weights[0], weights[at]) = (-1.0, 1.0);
        weights
    };
    others.map(one).collect()
}

#[test]
fn contrasts_tests_and_differences_are_those_of_club_sandwich() {
    for table in &REFERENCES {
        let found = clustered(&table.rows());
        let k = found.realizations.len();
        let mut second = vec![0.0; k];
        (second[1], second[2]) = (1.0, -1.0);
        let line = (0..k).map(|i| i as f64 - (k as f64 - 1.0) / 2.0).collect();
        let all = [against_first(k, k - 1..k).remove(0), line, second];
        for (weights, expected) in all.iter().zip(numbers(table.contrasts)) {
            let t = found.contrast(weights).unwrap();
            let ends = t.ci95.unwrap();
            let numbers = [
                t.estimate,
                t.se,
                t.df.unwrap(),
                t.p.unwrap(),
                ends.0,
                ends.1,
            ];
            for (number, expected) in numbers.iter().zip(&expected) {
                near(*number, *expected, table.name);
            }
        }
        let f = found.differences().unwrap();
        let all = [
            f.f,
            f.epsilon_gg,
            f.epsilon_hf,
            f.df1,
            f.df2,
            f.p_gg.unwrap(),
            f.p_hf.unwrap(),
        ];
        for (number, expected) in all.iter().zip(&numbers(table.differences)[0]) {
            near(*number, *expected, table.name);
        }
        for (others, expected) in [1..k, 1..3].into_iter().zip(numbers(table.tests)) {
            let contrasts = against_first(k, others);
            // A contrast that follows from the others changes nothing.
            let mut more = contrasts.clone();
            more.push(
                (0..k)
                    .map(|j| contrasts[0][j] - 2.0 * contrasts[1][j])
                    .collect(),
            );
            for contrasts in [contrasts, more] {
                let f = found.test(&contrasts).unwrap();
                let numbers = [f.f, f.df1, f.df2.unwrap(), f.p.unwrap()];
                for (number, expected) in numbers.iter().zip(&expected) {
                    near(*number, *expected, table.name);
                }
            }
        }
    }
}

/// With so many subjects leverages are small and the roots are series. The same numbers come from eigenvectors.
#[test]
fn the_series_is_the_root() {
    let mut random = SplitMix64::new(11);
    let rows: Vec<Row> = (0..60 * 6)
        .filter(|_| random.below(4) > 0)
        .map(|i| (i / 6, i % 6, (i * i % 11) as f64))
        .collect();
    let found = clustered(&rows);
    let series = |pattern: &&Pattern| matches!(pattern.root, Root::Series(_));
    assert!(found.patterns.iter().filter(series).count() > 10);
    for pattern in found.patterns.iter().filter(series) {
        let v = centered(
            &(0..pattern.places.len())
                .map(|i| (i * i % 5) as f64)
                .collect::<Vec<_>>(),
        );
        let Root::Series(hat) = &pattern.root else {
            unreachable!()
        };
        // A(I − H)A v = v.
        let once = pattern.root.times(&v);
        let through: Vec<f64> = once
            .iter()
            .zip(hat.times(&once))
            .map(|(x, h)| x - h)
            .collect();
        for (back, v) in pattern.root.times(&through).iter().zip(&v) {
            assert!((back - v).abs() < 1e-13, "{back} {v}");
        }
    }
}

/// Ratings that are all higher by the same for one realization give the same as its mean moved by that.
#[test]
fn a_moved_mean_is_that_of_moved_ratings() {
    let mut random = SplitMix64::new(5);
    let all: Vec<Row> = (0..12 * 5)
        .map(|i| (i / 5, i % 5, random.normal()))
        .collect();
    let rows: Vec<Row> = (all.into_iter()).filter(|_| random.below(5) > 0).collect();
    let by = [0.0, 0.7, 0.0, -1.3, 0.2];
    let higher: Vec<Row> = rows.iter().map(|&(s, j, y)| (s, j, y + by[j])).collect();
    let contrast = centered(&[1.0, 2.0, 0.0, -1.0, 4.0]);
    let [found, expected] = [clustered(&rows).moved(&by), clustered(&higher)];
    let [t, f] = [
        [found.contrast(&contrast), expected.contrast(&contrast)].map(|t| t.unwrap().t.unwrap()),
        [found.differences(), expected.differences()].map(|d| d.unwrap().f),
    ];
    near(t[0], t[1], "t");
    near(f[0], f[1], "F");
    let vaf: Vec<Option<f64>> = (0..5).map(|j| Some(f64::from(j).sqrt())).collect();
    let [found, expected] = [
        Within::of(&cells(&rows)).unwrap().moved(&by),
        Within::of(&cells(&higher)).unwrap(),
    ];
    near(
        found.trend(&vaf).unwrap().t.unwrap(),
        expected.trend(&vaf).unwrap().t.unwrap(),
        "trend",
    );
    for (found, expected) in found.means.iter().zip(&expected.means) {
        near(*found, *expected, "mean");
    }
}

/// As many contrasts as subjects leave no degrees of freedom, whatever rounding makes of 0.
#[test]
fn as_many_contrasts_as_subjects_have_no_test() {
    for (seed, subjects) in (0..1000).flat_map(|seed| (3..6).map(move |n| (seed, n))) {
        let mut random = SplitMix64::new(seed);
        let k = subjects + 1;
        let rows: Vec<Row> = (0..subjects * k)
            .map(|i| (i / k, i % k, random.normal()))
            .collect();
        let found = clustered(&rows).test(&against_first(k, 1..k));
        assert_eq!(found, None, "seed {seed}, {subjects} subjects");
    }
}

proptest! {
    /// In complete tables a contrast is a paired t test and several are Hotelling's T² (with one contrast t²).
    #[test]
    fn in_complete_tables_a_contrast_is_a_paired_t_test(
        seed in 0u64..1000, subjects in 3usize..12, k in 2usize..6
    ) {
        let mut random = SplitMix64::new(seed);
        let rows: Vec<Row> = (0..subjects * k)
            .map(|i| (i / k, i % k, (random.normal() * (1.0 + (i % k) as f64)).round() + random.normal()))
            .collect();
        let found = clustered(&rows);
        let mut weights: Vec<f64> = (0..k).map(|_| random.normal()).collect();
        weights = centered(&weights);
        let scores: Vec<f64> = (rows.chunks(k))
            .map(|own| own.iter().map(|(_, j, y)| weights[*j] * y).sum())
            .collect();
        let expected = one_sample(&scores).unwrap();
        let t = found.contrast(&weights).unwrap();
        near(t.estimate, expected.mean, "mean");
        near(t.df.unwrap(), subjects as f64 - 1.0, "df");
        near(t.t.unwrap(), expected.t.unwrap(), "t");
        near(t.p.unwrap(), expected.p.unwrap(), "p");
        let f = found.test(&[weights]).unwrap();
        near(f.f, expected.t.unwrap().powi(2), "F");
        // T²(n − q)/(q(n − 1)), by the covariance of the scores.
        let contrasts = against_first(k, 1..k);
        let all = found.test(&contrasts);
        prop_assert_eq!(all.is_some(), subjects >= k);
        if let Some(f) = all {
            let n = subjects as f64;
            let q = k - 1;
            let score = |s: usize, a: usize| rows[s * k + a + 1].2 - rows[s * k].2;
            let mean = |a: usize| (0..subjects).map(|s| score(s, a)).sum::<f64>() / n;
            let covariance = SymmetricMatrix::from_fn(q, |a, b| {
                let products = (0..subjects).map(|s| (score(s, a) - mean(a)) * (score(s, b) - mean(b)));
                products.sum::<f64>() / (n - 1.0)
            });
            let means: Vec<f64> = (0..q).map(mean).collect();
            let t2 = n * dot(&means, &Cholesky::definite(&covariance).unwrap().solve(&means));
            let expected = t2 * (n - q as f64) / (q as f64 * (n - 1.0));
            // A nearly singular covariance has a large T², with fewer digits.
            near(1.0 / f.f, 1.0 / expected, "1/T²");
            near(f.df2.unwrap(), n - q as f64, "df2");
        }
    }

    /// In complete tables it is the analysis of variance with both corrections.
    #[test]
    fn in_complete_tables_differences_are_those_of_the_analysis_of_variance(
        seed in 0u64..1000, subjects in 3usize..12, k in 2usize..7
    ) {
        let mut random = SplitMix64::new(seed);
        let table: Vec<Vec<f64>> = (0..subjects)
            .map(|_| (0..k).map(|j| random.normal() * (1.0 + j as f64)).collect())
            .collect();
        let rows: Vec<Row> = (0..subjects * k).map(|i| (i / k, i % k, table[i / k][i % k])).collect();
        let expected = one_way(&table).unwrap().effect;
        let found = clustered(&rows).differences().unwrap();
        near(found.f, expected.f.unwrap(), "F");
        near(found.epsilon_gg, expected.eps_gg.unwrap(), "ε");
        near(found.epsilon_hf, expected.eps_hf.unwrap().min(1.0), "Huynh–Feldt's ε");
        near(found.df2, expected.df2, "df2");
        near(found.p_gg.unwrap(), expected.p_gg.unwrap(), "p, Greenhouse–Geisser");
        near(found.p_hf.unwrap(), expected.p_hf.unwrap(), "p, Huynh–Feldt");
        prop_assert_eq!(found.left_out, 0);
    }

    /// Levels of the subjects do not matter.
    #[test]
    fn severity_does_not_matter(seed in 0u64..100) {
        let mut random = SplitMix64::new(seed);
        let rows = REFERENCES[3].rows();
        let levels: Vec<f64> = (0..10).map(|_| 5.0 * random.normal()).collect();
        let shifted: Vec<Row> = rows.iter().map(|r| (r.0, r.1, r.2 + levels[r.0])).collect();
        let [plain, shifted] = [&rows, &shifted].map(|rows| clustered(rows).test(&against_first(5, 1..5)).unwrap());
        near(shifted.f, plain.f, "F");
        near(shifted.df2.unwrap(), plain.df2.unwrap(), "df2");
    }
}

#[test]
fn what_nobody_links_and_what_one_subject_determines_has_no_test() {
    // The halves 0, 1 and 2, 3; the last subject links them.
    let apart: Vec<Row> = (0..20)
        .map(|i| {
            let (s, j) = (i / 2, i % 2 + if i < 10 { 0 } else { 2 });
            (s, j, ((i * 5) % 7) as f64)
        })
        .collect();
    let found = clustered(&apart);
    assert_eq!(found.sets, [0, 0, 1, 1]);
    assert!(found.contrast(&[1.0, -1.0, 0.0, 0.0]).is_some());
    assert!(found.contrast(&[1.0, -1.0, 1.0, -1.0]).is_some());
    assert_eq!(found.contrast(&[1.0, 0.0, -1.0, 0.0]), None);
    assert!(found.test(&against_first(4, 1..2)).is_some());
    assert_eq!(found.test(&against_first(4, 1..3)), None);

    let of_sets = found.differences().unwrap();
    assert_eq!(of_sets.left_out, 0);

    let mut linked = apart.clone();
    linked.extend([(10, 1, 3.0), (10, 2, 4.5)]);
    let found = clustered(&linked);
    assert_eq!(found.sets, [0; 4]);
    assert!(found.contrast(&[1.0, -1.0, 0.0, 0.0]).is_some());
    // One subject more says nothing of how subjects vary.
    assert_eq!(found.contrast(&[0.0, 1.0, -1.0, 0.0]), None);
    assert_eq!(found.test(&against_first(4, 1..4)), None);
    let without_one = found.differences().unwrap();
    assert_eq!(without_one.left_out, 1);
    near(without_one.f, of_sets.f, "F of the halves");
    near(without_one.df2, of_sets.df2, "df2 of the halves");
    linked.extend([(11, 1, 3.0), (11, 2, 3.5)]);
    assert_eq!(clustered(&linked).differences().unwrap().left_out, 0);
    let found = clustered(&linked);
    let t = found.contrast(&[0.0, 1.0, -1.0, 0.0]).unwrap();
    near(t.estimate, -1.0, "mean of two");
    near(t.df.unwrap(), 1.0, "df of two");
}

#[test]
fn what_is_no_contrast_is_no_number() {
    let found = clustered(&REFERENCES[0].rows());
    for weights in [
        vec![0.0; 4],
        vec![1.0, 0.0, 0.0, 0.0],
        vec![1.0, -1.0, 0.0],
        vec![f64::NAN, 1.0, -1.0, 0.0],
        vec![f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0],
    ] {
        assert_eq!(found.contrast(&weights), None, "{weights:?}");
        assert_eq!(found.test(&[weights]), None);
    }
    assert_eq!(found.test(&[]), None);
    let same: Vec<Row> = (0..9).map(|i| (i / 3, i % 3, 4.0)).collect();
    assert_eq!(clustered(&same).contrast(&[1.0, -1.0, 0.0]), None);
    // Everybody has the same difference; the others vary.
    let constant: Vec<Row> = (0..9)
        .map(|i| (i / 3, i % 3, [1.0, 2.0, (i * i % 5) as f64][i % 3]))
        .collect();
    let t = clustered(&constant).contrast(&[1.0, -1.0, 0.0]).unwrap();
    assert_eq!((t.t, t.p), (None, None));
    assert_eq!(Clustered::of(&[]), Err(WithinError::NoData));
    let wide: Vec<Row> = (0..300)
        .map(|i| (i / 150, i % 150, (i * i % 7) as f64))
        .collect();
    let error = Clustered::of(&cells(&wide)).unwrap_err();
    assert_eq!(error, WithinError::TooManyClustered);
    assert!(error.to_string().contains("100 realizations"));
}

/// 120 subjects × 100 realizations with a fifth missing, so that everybody has a pattern of their own.
#[test]
fn a_large_table_is_computed() {
    let mut random = SplitMix64::new(3);
    let rows: Vec<Row> = (0..120 * 100)
        .filter(|_| random.below(5) > 0)
        .map(|i| (i / 100, i % 100, (i * i % 13) as f64))
        .collect();
    let found = clustered(&rows);
    assert!(
        found
            .patterns
            .iter()
            .all(|p| matches!(p.root, Root::Series(_)))
    );
    assert!(found.contrast(&against_first(100, 1..2)[0]).is_some());
    assert!(found.test(&against_first(100, 1..8)).is_some());
    assert_eq!(found.test(&against_first(100, 1..100)), None);
}

/// Of two realizations it is the contrast; where one subject alone links them there is no test.
#[test]
fn the_difference_of_two_realizations_is_their_contrast() {
    let mut rows: Vec<Row> = (0..12)
        .map(|i| (i / 2, i % 2, (i * i % 7) as f64))
        .collect();
    rows.extend([(6, 0, 3.0), (7, 1, 9.0)]);
    let found = clustered(&rows);
    let (f, t) = (
        found.differences().unwrap(),
        found.contrast(&[1.0, -1.0]).unwrap(),
    );
    near(f.f, t.t.unwrap().powi(2), "F");
    near(f.df2, t.df.unwrap(), "df2");
    near(f.p_gg.unwrap(), t.p.unwrap(), "p");
    near(f.p_hf.unwrap(), t.p.unwrap(), "p");
    let lone: [Row; 5] = [
        (0, 0, 1.0),
        (0, 1, 3.0),
        (0, 2, 4.0),
        (1, 1, 1.0),
        (1, 2, 5.0),
    ];
    let found = clustered(&lone);
    assert_eq!(found.differences().unwrap().left_out, 1);
    assert_eq!(clustered(&lone[..3]).differences(), None);
}
