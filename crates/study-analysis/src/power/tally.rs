//! Counting what studies show: chunks, and the results of a cell.

use super::decide::{Judge, Outcome};
use super::draw::{Drawn, Draws};
use super::parts::PartJudge;
use super::precision::Precision;
use super::{Cell, STREAM, Settings, Test};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::ops::Range;
use study_base::rng::Stream;
use study_stats::proportion::clopper_pearson;

/// What a test shows in some studies.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Tally {
    /// Studies in which it rejects.
    pub rejected: u64,
    /// Of these, how many have the wrong sign.
    pub wrong_sign: u64,
    /// Sum over these of |estimate| over |slope|.
    pub exaggeration: f64,
    /// Studies in which it is undefined, by reason.
    pub undefined: BTreeMap<String, u64>,
}

/// The studies of a chunk.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Chunk {
    /// Number of studies.
    pub studies: u64,
    /// By test, in the order of the settings.
    pub tests: Vec<Tally>,
    /// Studies in which the crossed model has no scatter of the realizations.
    pub boundary: u64,
    /// Studies with an interval of the slope.
    pub intervals: u64,
    /// Sum of their half-widths.
    pub half_width: f64,
    /// Of tracks with levels, how far the thresholds are from the truth.
    #[serde(default)]
    pub precision: Precision,
}

/// Simulates a chunk of a cell: studies `index` · [`Settings::chunk`] to the next, or to the last one.
pub fn run_chunk(settings: &Settings, cell: &Cell, index: u64) -> Chunk {
    let mut chunk = Chunk {
        tests: vec![Tally::default(); settings.tests.len()],
        ..Chunk::default()
    };
    let from = index * settings.chunk();
    let studies = from..settings.studies.min(from + settings.chunk());
    match &settings.part {
        None => simulate(settings, cell, studies, &mut chunk),
        Some(part) => {
            let judge = PartJudge::new(settings, part, cell);
            for k in studies {
                chunk.add(judge.decide(k), None);
            }
        }
    }
    chunk
}

/// Simulates studies of ratings.
fn simulate(settings: &Settings, cell: &Cell, studies: Range<u64>, chunk: &mut Chunk) {
    let text = cell.canonical();
    let mut study = Drawn::new(cell, settings);
    let mut judge = Judge::new(settings, *cell);
    let mut world = settings.assumptions.clone();
    for k in studies {
        let number = k.to_string();
        let mut draws = Draws(Stream::new(settings.seed, &[STREAM, &text, &number]));
        if let Some(pilot) = &settings.pilot {
            pilot.parameters(settings.seed, k).apply(&mut world);
        }
        study.draw(cell, &world, &mut draws);
        if settings.tests.contains(&Test::ReferenceEquivalence) {
            let path = [STREAM, &text, &number, "reference"];
            study.compare(cell, &world, &mut Draws(Stream::new(settings.seed, &path)));
        }
        let permutations = || {
            let path = [STREAM, &text, &number, "permutations"];
            Draws(Stream::new(settings.seed, &path))
        };
        let outcome = judge.decide(&study, &permutations);
        chunk.add(outcome, Some(world.slope).filter(|slope| *slope != 0.0));
    }
}

impl Chunk {
    /// Counts a study; `slope` is the true one.
    fn add(&mut self, outcome: Outcome, slope: Option<f64>) {
        self.studies += 1;
        self.boundary += u64::from(outcome.boundary);
        if let Some(half_width) = outcome.half_width {
            self.intervals += 1;
            self.half_width += half_width;
        }
        if let Some(precision) = &outcome.precision {
            self.precision.merge(precision);
        }
        for (tally, test) in self.tests.iter_mut().zip(outcome.tests) {
            match test {
                Ok(true) => {
                    tally.rejected += 1;
                    if let Some((found, slope)) = outcome.slope.zip(slope) {
                        tally.wrong_sign += u64::from(found * slope < 0.0);
                        tally.exaggeration += found.abs() / slope.abs();
                    }
                }
                Ok(false) => {}
                Err(why) => *tally.undefined.entry(why.to_owned()).or_default() += 1,
            }
        }
    }
}

/// How many chunks of a cell, in order, are enough for an interval of the first test's power
/// of ± `within`; all of them if none are. It does not depend on how the chunks were made.
pub fn enough<'c>(chunks: impl IntoIterator<Item = &'c Chunk>, within: f64) -> (usize, bool) {
    let (mut rejected, mut studies, mut number) = (0, 0, 0);
    for chunk in chunks {
        number += 1;
        studies += chunk.studies;
        rejected += chunk.tests.first().map_or(0, |t| t.rejected);
        if let Some((low, high)) = clopper_pearson(rejected, studies, 0.95)
            && high - low <= 2.0 * within
        {
            return (number, true);
        }
    }
    (number, false)
}

/// The power of a test in a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct TestResult {
    /// The test.
    pub test: Test,
    /// Studies in which it rejects.
    pub rejected: u64,
    /// Studies. Those in which it is undefined count as not rejected.
    pub studies: u64,
    /// Rejected over studies.
    pub power: f64,
    /// Exact 95 % interval (Clopper and Pearson).
    pub interval: (f64, f64),
    /// Monte Carlo standard error.
    pub mcse: f64,
    /// Share of rejections with the wrong sign; `None` without rejections or slope.
    pub type_s: Option<f64>,
    /// Mean of |estimate| over |slope| among rejections.
    pub type_m: Option<f64>,
    /// Studies in which it is undefined, by reason.
    pub undefined: BTreeMap<String, u64>,
}

impl TestResult {
    /// Share of the studies in which it is undefined.
    pub fn undefined_share(&self) -> f64 {
        self.undefined.values().sum::<u64>() as f64 / self.studies.max(1) as f64
    }

    /// Rejected over the studies in which it is defined.
    pub fn power_if_defined(&self) -> Option<f64> {
        let defined = self.studies - self.undefined.values().sum::<u64>();
        (defined > 0).then(|| self.rejected as f64 / defined as f64)
    }
}

/// The results of a cell.
#[derive(Debug, Clone, PartialEq)]
pub struct CellResult {
    /// The design.
    pub cell: Cell,
    /// By test, in the order of the settings.
    pub tests: Vec<TestResult>,
    /// Share of the studies in which the crossed model has no scatter of the realizations.
    pub boundary_share: f64,
    /// Mean half-width of the interval of the slope over realizations; of tracks, of the mean threshold in
    /// the first condition.
    pub half_width: Option<f64>,
    /// Of tracks with levels, how far the thresholds are from the truth.
    pub precision: Option<Precision>,
}

/// The results of a cell from its chunks, in their order. `None` without studies.
pub fn merge<'c>(
    settings: &Settings,
    cell: Cell,
    chunks: impl IntoIterator<Item = &'c Chunk>,
) -> Option<CellResult> {
    let mut all = Chunk {
        tests: vec![Tally::default(); settings.tests.len()],
        ..Chunk::default()
    };
    for chunk in chunks {
        all.studies += chunk.studies;
        all.boundary += chunk.boundary;
        all.intervals += chunk.intervals;
        all.half_width += chunk.half_width;
        all.precision.merge(&chunk.precision);
        for (sum, own) in all.tests.iter_mut().zip(&chunk.tests) {
            sum.rejected += own.rejected;
            sum.wrong_sign += own.wrong_sign;
            sum.exaggeration += own.exaggeration;
            for (why, n) in &own.undefined {
                *sum.undefined.entry(why.clone()).or_default() += n;
            }
        }
    }
    let n = all.studies;
    let has_slope = settings.assumptions.slope != 0.0 || settings.pilot.is_some();
    let result = |(test, tally): (&Test, Tally)| {
        let power = tally.rejected as f64 / n as f64;
        // Equivalence claims no sign and no size, and parts have no slope of ratings.
        let claims = has_slope
            && settings.part.is_none()
            && !matches!(test, Test::Equivalence | Test::ReferenceEquivalence);
        let among = |sum: f64| {
            let some = tally.rejected > 0 && claims;
            some.then(|| sum / tally.rejected as f64)
        };
        Some(TestResult {
            test: *test,
            rejected: tally.rejected,
            studies: n,
            power,
            interval: clopper_pearson(tally.rejected, n, 0.95)?,
            mcse: (power * (1.0 - power) / n as f64).sqrt(),
            type_s: among(tally.wrong_sign as f64),
            type_m: among(tally.exaggeration),
            undefined: tally.undefined,
        })
    };
    Some(CellResult {
        cell,
        tests: (settings.tests.iter().zip(all.tests))
            .map(result)
            .collect::<Option<_>>()?,
        boundary_share: all.boundary as f64 / n as f64,
        half_width: (all.intervals > 0).then(|| all.half_width / all.intervals as f64),
        precision: Some(all.precision).filter(|p| p.trials.studies > 0),
    })
}

#[cfg(test)]
mod tests {
    use super::super::{Assumptions, Link, Reach, Scale, Vaf, closed};
    use super::*;
    use study_stats::power::covariate::Spread;

    const PAPER: [f64; 5] = [0.7672, 0.7851, 0.7904, 0.7798, 0.7425];
    const UNEVEN_8: [f64; 8] = [
        0.6, 0.642_857, 0.685_714, 0.728_571, 0.771_429, 0.814_286, 0.857_143, 0.9,
    ];
    const ROUNDED: Scale = Scale::Rounded(1, 7);

    fn settings(slope: f64, realization: f64, scale: Scale, listed: &[f64]) -> Settings {
        Settings {
            assumptions: Assumptions {
                slope,
                smallest: None,
                mean: 4.0,
                spread: Spread {
                    subject: 0.6,
                    realization,
                    interaction: 0.4,
                    residual: 0.8,
                    slope: 0.0,
                },
                scale,
                vaf: Vaf::Listed,
                dropout: 0.0,
                missing: 0.0,
                reference: 0.0,
            },
            part: None,
            pilot: None,
            listed: listed.to_vec(),
            tests: vec![Test::Pearson, Test::Permutation, Test::Crossed],
            alpha: 0.05,
            margin: None,
            seed: 2007,
            studies: 4000,
        }
    }

    fn result(settings: &Settings, participants: usize, repetitions: usize) -> CellResult {
        let cell = Cell {
            realizations: settings.listed.len(),
            repetitions,
            participants,
        };
        let chunks: Vec<Chunk> = (0..settings.chunks())
            .map(|i| run_chunk(settings, &cell, i))
            .collect();
        merge(settings, cell, &chunks).unwrap()
    }

    fn agrees(found: f64, expected: f64, mcse: f64, n: f64) {
        let allowed = 4.0 * (mcse * mcse + found * (1.0 - found) / n).sqrt();
        assert!((found - expected).abs() <= allowed, "{found}, {expected}");
    }

    /// Where simulation finds more participants necessary than the closed form, another simulated
    /// design bounds their number.
    #[test]
    fn the_smallest_design_is_bounded_by_another_one() {
        let settings = settings(0.5, 0.3, ROUNDED, &UNEVEN_8);
        let Some(Reach::Participants {
            participants: n, ..
        }) = super::super::reach(&settings, 8, 1, 0.8, 200)
        else {
            panic!("8 realizations are enough");
        };
        let made = |(participants, power): (usize, f64)| CellResult {
            cell: Cell {
                realizations: 8,
                repetitions: 1,
                participants,
            },
            tests: vec![TestResult {
                test: Test::Verdict,
                rejected: 0,
                studies: 1000,
                power,
                interval: (power - 0.03, power + 0.03),
                mcse: 0.01,
                type_s: None,
                type_m: None,
                undefined: BTreeMap::new(),
            }],
            boundary_share: 0.0,
            half_width: None,
            precision: None,
        };
        let reach = |cells: &[(usize, f64)]| {
            let results: Vec<CellResult> = cells.iter().copied().map(made).collect();
            let found = super::super::smallest(&settings, &results, &[(8, 1)], &[0.8], 200);
            found[0].reach.clone()
        };
        let few = [(n - 1, 0.7), (n, 0.78), (n + 1, 0.79)];
        let more = |enough| Reach::MoreThan {
            participants: n + 1,
            enough,
        };
        assert_eq!(reach(&few), more(None));
        let all = [&few[..], &[(n + 30, 0.95), (n + 10, 0.9)]].concat();
        assert_eq!(reach(&all), more(Some(n + 10)));
        let found = reach(&[(n, 0.81), (n + 10, 0.9)]);
        assert!(
            matches!(found, Reach::Participants { participants, sure: false, .. } if participants == n)
        );
    }

    /// Rates of 40 000 studies each, simulated in numpy with the closed forms of its own.
    #[test]
    fn rates_agree_with_an_independent_simulation() {
        let thresholds = vec![0.5, 2.0, 3.2, 4.0, 4.5, 4.9];
        let skewed = Scale::Ordinal {
            link: Link::Probit,
            thresholds,
            from: 1,
        };
        let even_4 = [0.6, 0.7, 0.8, 0.9];
        // slope, σ of the realizations, scale, VAF, n, R; rates of the three tests
        type Case<'a> = (f64, f64, Scale, &'a [f64], usize, usize, [f64; 3], f64);
        let cases: [Case<'_>; 6] = [
            (
                0.5,
                0.3,
                Scale::Continuous,
                &PAPER,
                10,
                3,
                [0.567_825, 0.553_55, 0.570_85],
                0.169_125,
            ),
            (
                0.5,
                0.3,
                Scale::Continuous,
                &PAPER,
                10,
                1,
                [0.460_075, 0.451_65, 0.479_275],
                0.294_725,
            ),
            (
                0.0,
                0.5,
                Scale::Continuous,
                &PAPER,
                10,
                3,
                [0.048_925, 0.0495, 0.0526],
                0.056_875,
            ),
            (
                1.0,
                0.3,
                Scale::Continuous,
                &even_4,
                20,
                3,
                [0.8409, 0.0, 0.8409],
                0.157_55,
            ),
            (
                0.5,
                0.5,
                ROUNDED,
                &UNEVEN_8,
                10,
                3,
                [0.595_275, 0.591_575, 0.595_275],
                0.009_975,
            ),
            (
                0.5,
                0.4,
                skewed,
                &UNEVEN_8,
                10,
                3,
                [0.746_475, 0.738_825, 0.7465],
                0.027_925,
            ),
        ];
        for (slope, realization, scale, vaf, n, r, rates, boundary) in cases {
            let continuous = scale == Scale::Continuous;
            let settings = settings(slope, realization, scale, vaf);
            let found = result(&settings, n, r);
            for (test, rate) in found.tests.iter().zip(rates) {
                agrees(test.power, rate, 0.0025, 4000.0);
            }
            agrees(found.boundary_share, boundary, 0.0025, 4000.0);
            if continuous {
                let closed = closed(&settings, &found.cell).unwrap();
                agrees(found.tests[0].power, closed.power, 0.0, 4000.0);
                assert!((found.half_width.unwrap() / closed.half_width - 1.0).abs() < 0.03);
                if let (Some(own), Some(m)) = (found.tests[0].type_m, closed.type_m) {
                    assert!((own - m).abs() < 0.02, "{own}, {m}");
                }
            }
        }
    }

    /// Standard logistic residuals; 40 000 studies in numpy.
    #[test]
    fn logit_thresholds_agree_with_an_independent_simulation() {
        let scale = Scale::Ordinal {
            link: Link::Logit,
            thresholds: vec![-3.2, -2.0, -1.1, -0.2, 1.0, 2.4],
            from: 1,
        };
        let mut settings = settings(0.8, 0.4, scale, &PAPER);
        settings.assumptions.mean = 0.0;
        settings.assumptions.spread.subject = 1.0;
        settings.assumptions.spread.interaction = 0.5;
        let found = result(&settings, 10, 3);
        for (test, rate) in found.tests.iter().zip([0.625_75, 0.6058, 0.634_15]) {
            agrees(test.power, rate, 0.0025, 4000.0);
        }
        agrees(found.boundary_share, 0.305_525, 0.0025, 4000.0);
    }

    /// With slopes of participants the size is the closed form's, not α.
    #[test]
    fn slopes_of_participants_raise_the_size() {
        let mut settings = settings(0.0, 0.3, Scale::Continuous, &PAPER);
        settings.assumptions.spread.slope = 0.4;
        let found = result(&settings, 10, 3);
        agrees(found.tests[0].power, 0.0882, 0.0014, 4000.0);
        agrees(found.tests[2].power, 0.097_125, 0.0015, 4000.0);
        assert_eq!(found.tests[0].type_s, None);
    }

    /// Two one-sided t tests of normal differences; rates of 200 000 studies in R 4.2.2.
    #[test]
    fn equivalence_with_the_reference_agrees_with_an_independent_simulation() {
        let mut settings = settings(0.5, 0.3, Scale::Continuous, &PAPER);
        settings.tests = vec![Test::ReferenceEquivalence];
        for (margin, reference, n, r, rate) in [
            (0.6, 0.0, 20, 3, 0.820_22),
            (0.6, 0.3, 20, 3, 0.439_71),
            (1.0, 0.0, 12, 1, 0.643_06),
        ] {
            settings.margin = Some(margin);
            settings.assumptions.reference = reference;
            let found = result(&settings, n, r);
            agrees(found.tests[0].power, rate, 0.001, 4000.0);
            assert_eq!(found.tests[0].type_m, None);
        }
    }

    /// A study has the same numbers in every cell list, chunk and number of studies, and
    /// the numbers do not depend on the slope.
    #[test]
    fn studies_are_numbered() {
        let all = settings(0.5, 0.3, Scale::Continuous, &PAPER);
        let fewer = Settings {
            studies: 1500,
            ..all.clone()
        };
        let cell = Cell {
            realizations: 5,
            repetitions: 3,
            participants: 10,
        };
        assert_eq!(run_chunk(&all, &cell, 0), run_chunk(&fewer, &cell, 0));
        assert_eq!(run_chunk(&fewer, &cell, 1).studies, 500);
        assert_ne!(run_chunk(&all, &cell, 0), run_chunk(&all, &cell, 1));
        // With common numbers power rises with the slope in every thousand studies.
        let mut last = 0;
        for slope in [0.3, 0.35, 0.4, 0.45, 0.5] {
            let mut settings = all.clone();
            settings.assumptions.slope = slope;
            let rejected = run_chunk(&settings, &cell, 0).tests[0].rejected;
            assert!(rejected > last, "{slope}");
            last = rejected;
        }
        let text = serde_json::to_string(&run_chunk(&all, &cell, 0)).unwrap();
        let read: Chunk = serde_json::from_str(&text).unwrap();
        assert_eq!(read, run_chunk(&all, &cell, 0));
    }

    /// Fewer studies where the power is clear, and never depending on what comes later.
    #[test]
    fn enough_studies_are_a_prefix() {
        let mut settings = settings(0.5, 0.3, Scale::Continuous, &PAPER);
        let chunks = |settings: &Settings, participants| -> Vec<Chunk> {
            let cell = Cell {
                realizations: 5,
                repetitions: 3,
                participants,
            };
            (0..settings.chunks())
                .map(|i| run_chunk(settings, &cell, i))
                .collect()
        };
        let middle = chunks(&settings, 10);
        let (n, reached) = enough(&middle, 0.02);
        assert!(reached && n == 3, "{n}");
        assert_eq!(enough(&middle[..3], 0.02), (3, true));
        assert_eq!(enough(&middle[..2], 0.02), (2, false));
        assert_eq!(enough(&middle, 0.001), (4, false));
        settings.assumptions.slope = 3.0;
        assert_eq!(enough(&chunks(&settings, 40), 0.02), (1, true));
    }

    #[test]
    fn undefined_studies_are_counted_with_their_reason() {
        let mut settings = settings(0.5, 0.3, ROUNDED, &PAPER);
        settings.assumptions.dropout = 0.9;
        settings.studies = 200;
        let found = result(&settings, 3, 3);
        let test = &found.tests[2];
        assert!(test.undefined_share() > 0.5 && test.undefined.len() == 1);
        assert!(test.power_if_defined().unwrap() > test.power);
    }
}
