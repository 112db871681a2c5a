use super::*;
use crate::correlation::pearson;

/// Subject, realization, mean, ratings, squares about the mean.
type Row = (usize, usize, f64, usize, f64);

/// Sixteen of the cells of six subjects and four realizations.
const ROWS: [Row; 16] = [
    (0, 0, 3.0, 3, 2.0),
    (0, 1, 4.0, 3, 2.0 / 3.0),
    (0, 2, 5.5, 2, 0.5),
    (1, 1, 2.0, 3, 2.0),
    (1, 2, 10.0 / 3.0, 3, 2.0 / 3.0),
    (1, 3, 4.0, 1, 0.0),
    (2, 0, 4.5, 2, 0.5),
    (2, 3, 6.0, 3, 2.0),
    (3, 0, 2.0, 3, 0.0),
    (3, 1, 11.0 / 3.0, 3, 2.0 / 3.0),
    (3, 2, 3.0, 3, 2.0),
    (3, 3, 5.0, 3, 2.0),
    (4, 2, 6.0, 1, 0.0),
    (4, 3, 6.5, 2, 0.5),
    (5, 0, 1.0, 3, 0.0),
    (5, 2, 3.0, 3, 2.0),
];

fn cells(rows: &[Row]) -> Vec<CellSummary> {
    let cell = |&(subject, realization, mean, n, within): &Row| CellSummary {
        subject,
        realization,
        x: 0.0,
        n,
        mean,
        within,
    };
    rows.iter().map(cell).collect()
}

fn near(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-9 * expected.abs().max(1.0),
        "{found} instead of {expected}"
    );
}

/// R 4.2: `anova(lm(y ~ s), lm(y ~ s + m))`, `vcov`, `confint`, and the mean of `predict` over the
/// subjects; to 1e-9.
#[test]
fn means_differences_and_f_are_those_of_two_fixed_factors() {
    let found = Within::of(&cells(&ROWS)).unwrap();
    assert!(found.is_connected());
    let effect = found.effect.unwrap();
    near(effect.f, 10.849_710_324_85);
    near(effect.p.unwrap(), 0.005_042_590_821_161_81);
    assert_eq!((effect.df1, effect.df2), (3.0, Some(7.0)));
    near(found.error.unwrap().0, 0.334_792_204_391_576);
    let means = [
        2.668_041_372_086_93,
        3.643_034_825_870_65,
        4.436_567_164_179_10,
        5.132_953_652_788_69,
    ];
    (found.means.iter().zip(means)).for_each(|(found, mean)| near(*found, mean));
    let first = found.difference(1, 0).unwrap();
    near(first.estimate, 0.974_993_453_783_714);
    near(first.se, 0.487_593_246_682_636);
    let ends = first.ci95.unwrap();
    near(ends.0, -0.177_981_362_234_911);
    near(ends.1, 2.127_968_269_802_34);
    let second = found.difference(1, 2).unwrap();
    near(second.estimate, -0.793_532_338_308_457);
    near(second.se, 0.447_074_873_953_283);
    near(second.p.unwrap(), 0.119_172_566_955_806);
}

/// A program in Python (numpy, scipy) with the formulas of [`Within::trend`] by matrices: of the first
/// covariate the realizations lie on the line, of the second they do not; to 1e-6, which is
/// what its search for the variance leaves.
#[test]
fn a_trend_weighs_means_by_their_precision() {
    let found = Within::of(&cells(&ROWS)).unwrap();
    let of = |x: [f64; 4]| found.trend(&x.map(Some)).unwrap();
    let close = |found: f64, expected: f64| {
        assert!(
            (found - expected).abs() <= 1e-6 * expected.abs(),
            "{found} instead of {expected}"
        );
    };
    let line = of([0.70, 0.80, 0.85, 0.95]);
    assert_eq!((line.sd, line.df), (0.0, 2.0));
    close(line.slope, 10.330_575_979_378_5);
    close(line.se, 1.062_970_163_392_405_8);
    close(line.t.unwrap(), 9.718_594_496_019_609);
    close(line.p.unwrap(), 0.010_422_262_144_335_868);
    let other = of([0.70, 0.95, 0.80, 0.85]);
    close(other.sd.powi(2), 1.278_904_571_576_79);
    close(other.slope, 4.329_469_038_829_699);
    close(other.se, 6.511_744_097_184_124);
    close(other.p.unwrap(), 0.574_539_011_405_584_9);
}

/// Rounding is no scatter: Pearson's t is not defined either.
#[test]
fn means_on_a_line_have_no_test() {
    let rows: Vec<Row> = (0..9)
        .map(|i| {
            (
                i / 3,
                i % 3,
                (i % 3) as f64 + [0.0, 1.0 / 3.0, 0.1][i / 3],
                1 + usize::from(i == 4),
                0.0,
            )
        })
        .collect();
    let mut rows = rows;
    rows[0].2 += 0.5;
    rows[3].2 -= 0.5;
    let found = Within::of(&cells(&rows)).unwrap();
    let line = found.trend(&[0.1, 0.2, 0.3].map(Some)).unwrap();
    assert!((line.slope - 10.0).abs() < 1e-9);
    assert_eq!((line.t, line.p), (None, None));
}

/// By hand: of differences with variances 1/9 + 1/10 and 2/10 about the same unit, and with cells of 1 and 2 ratings.
#[test]
fn the_design_says_how_unlike_the_precision_is() {
    let all: Vec<Row> = (0..30)
        .map(|i| (i / 3, i % 3, (i * i % 7) as f64, 1, 0.0))
        .collect();
    near(
        Within::of(&cells(&all)).unwrap().precision_ratio(|_| true),
        1.0,
    );
    let mut lost = all.clone();
    lost.pop();
    let ratio = Within::of(&cells(&lost)).unwrap().precision_ratio(|_| true);
    assert!((1.05..1.15).contains(&ratio), "{ratio}");
    let twice: Vec<Row> = (all.iter())
        .map(|r| (r.0, r.1, r.2, 1 + usize::from(r.1 == 0), 1.0))
        .collect();
    // (2 + 2) / (1.5 + 2)
    near(
        Within::of(&cells(&twice))
            .unwrap()
            .precision_ratio(|_| true),
        4.0 / 3.5,
    );
}

/// Of equally precise means it is the t test of Pearson's correlation.
#[test]
fn in_a_complete_table_the_trend_is_that_of_the_correlation() {
    let rows: Vec<Row> = (0..24)
        .map(|i| (i / 4, i % 4, ((i * i + 3 * i) % 7) as f64, 2, 1.0))
        .collect();
    let found = Within::of(&cells(&rows)).unwrap();
    let x = [0.7, 0.75, 0.9, 0.85];
    let means: Vec<f64> = (0..4)
        .map(|j| rows.iter().filter(|r| r.1 == j).map(|r| r.2).sum::<f64>() / 6.0)
        .collect();
    (found.means.iter().zip(&means)).for_each(|(found, mean)| near(*found, *mean));
    let r = pearson(&x, &means).unwrap();
    near(found.trend(&x.map(Some)).unwrap().r.unwrap(), r);
    // without one of them: of the three others
    let three = found
        .trend(&[Some(0.7), None, Some(0.9), Some(0.85)])
        .unwrap();
    let r = pearson(&[0.7, 0.9, 0.85], &[means[0], means[2], means[3]]).unwrap();
    near(three.r.unwrap(), r);
}

/// Severe subjects rate some realizations, lenient ones others.
#[test]
fn severity_does_not_matter_and_what_nobody_links_is_not_compared() {
    let shifted: Vec<Row> = (ROWS.iter())
        .map(|r| (r.0, r.1, r.2 + 10.0 * r.0 as f64, r.3, r.4))
        .collect();
    let [plain, shifted] = [&ROWS[..], &shifted].map(|rows| Within::of(&cells(rows)).unwrap());
    near(shifted.effect.unwrap().f, plain.effect.unwrap().f);
    near(
        shifted.difference(3, 0).unwrap().estimate,
        plain.difference(3, 0).unwrap().estimate,
    );

    let apart: Vec<Row> = (0..16)
        .map(|i| {
            let (s, j) = (i / 2, i % 2 + if i < 8 { 0 } else { 2 });
            (s, j, ((i * 5) % 7) as f64, 1, 0.0)
        })
        .collect();
    let found = Within::of(&cells(&apart)).unwrap();
    assert_eq!(found.sets, [0, 0, 1, 1]);
    assert!(!found.is_connected());
    assert!(found.difference(0, 1).is_some() && found.difference(3, 2).is_some());
    assert_eq!(found.difference(1, 2), None);
    assert_eq!(found.effect.unwrap().df1, 2.0);
    assert_eq!(found.trend(&[0.7, 0.8, 0.9, 1.0].map(Some)), None);
}

#[test]
fn what_cannot_be_compared_is_no_number() {
    let same: Vec<Row> = (0..6).map(|i| (i / 3, i % 3, 4.0, 1, 0.0)).collect();
    let found = Within::of(&cells(&same)).unwrap();
    assert_eq!((found.effect, found.error), (None, None));
    assert_eq!(found.difference(0, 1), None);
    assert_eq!(Within::of(&[]), Err(WithinError::NoData));
    assert_eq!(
        Within::of(&cells(&[(0, 3, 1.0, 1, 0.0)])),
        Err(WithinError::OneRealization)
    );
    let huge = [
        (0, 0, 1e308, 1, 0.0),
        (0, 1, -1e308, 1, 0.0),
        (1, 0, 1e308, 1, 0.0),
    ];
    assert_eq!(Within::of(&cells(&huge)), Err(WithinError::Overflow));
    // one rating of each: nothing is left for the error
    let few = [(0, 0, 1.0, 1, 0.0), (0, 1, 2.0, 1, 0.0)];
    assert_eq!(Within::of(&cells(&few)).unwrap().effect, None);
}
