use super::*;
use crate::random::SplitMix64;

fn levels(rows: &[(f64, f64, f64)]) -> Vec<Level> {
    (rows.iter())
        .map(|(level, positive, trials)| Level {
            level: *level,
            positive: *positive,
            trials: *trials,
        })
        .collect()
}

fn close(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance, "{a} is not {b}");
}

/// The 13 levels of the example of psignifit 4 (Schütt et al. 2016).
fn example() -> Vec<Level> {
    let x = [
        1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 10.0,
    ];
    let k = [
        45.0, 50.0, 44.0, 44.0, 52.0, 53.0, 62.0, 64.0, 76.0, 79.0, 88.0, 90.0, 90.0,
    ];
    let rows: Vec<(f64, f64, f64)> = (x.iter().zip(k))
        .map(|(x, k)| (x / 1000.0, k, 90.0))
        .collect();
    levels(&rows)
}

/// Maximum likelihood: R 4.2, optim with numDeriv. MAP: psignifit 4.3 stops at
/// .00464644 and .00466315; its grid interval is half a cell low. Posterior: quadrature
/// by numpy.
#[test]
fn the_example_of_psignifit_agrees() {
    let fit = maximum_likelihood(Core::Norm, &example(), 0.5, 0.0).unwrap();
    close(fit.curve.threshold, 0.004_647_817_02, 1e-9);
    close(fit.curve.width, 0.004_659_071_99, 1e-9);
    close(fit.threshold_se.unwrap(), 0.000_149_098_97, 1e-8);
    close(fit.width_se.unwrap(), 0.000_533_953_39, 1e-7);
    close(fit.deviance, 5.932_813_05, 1e-6);
    assert_eq!(fit.df, 11);
    let experiment = Experiment::ForcedChoice(0.5);
    let mode = map(Core::Norm, &example(), experiment, &Priors::schuett(None)).unwrap();
    close(mode.curve.threshold, 0.004_647_817, 5e-6);
    close(mode.curve.width, 0.004_659_072, 1.4e-5);
    assert!(mode.curve.lambda < 1e-4 && mode.eta < 1e-3);
    close(mode.log_kernel, -565.955_165, 1e-4);
    let found = posterior(Core::Norm, &example(), experiment, &Priors::schuett(None)).unwrap();
    close(found.threshold.mean, 0.004_619_997, 7e-6);
    close(found.threshold.ci95.0, 0.004_279_277, 1e-5);
    close(found.threshold.ci95.1, 0.004_961_878, 1e-5);
    close(found.width.mean, 0.004_681_166, 2.5e-5);
    close(found.width.ci95.0, 0.003_507_510, 4e-5);
    close(found.width.ci95.1, 0.006_034_591, 4e-5);
}

/// Every core: its inverse, its definition of a width, its derivatives.
#[test]
fn cores_are_defined_by_threshold_and_width() {
    for (core, name) in Core::NAMES {
        assert_eq!(Core::named(name), Some(core));
        close(core.value(0.0), 0.5, 1e-14);
        let u = |s| core.inverse(s).unwrap();
        close(u(0.95) - u(0.05), 1.0, 1e-13);
        for at in [-1.1f64, -0.4, 0.0, 0.3, 0.9] {
            if at.abs() < 0.8 {
                close(u(core.value(at)), at, 1e-9);
            }
            let (h, (s, slope, curvature)) = (1e-5, core.derivatives(at));
            close(s, core.value(at), 0.0);
            let (up, down) = (core.value(at + h), core.value(at - h));
            close(slope, (up - down) / (2.0 * h), 1e-8);
            close(curvature, (up - 2.0 * s + down) / (h * h), 1e-4);
        }
        assert_eq!(core.derivatives(-1e6).1, 0.0);
        assert_eq!(core.derivatives(1e6).1, 0.0);
        assert_eq!(core.inverse(1.0), None);
    }
    let curve = Curve {
        core: Core::Norm,
        threshold: 2.0,
        width: 3.289_707_253_902_944,
        gamma: 0.0,
        lambda: 0.0,
    };
    // the difference threshold of a normal is .67449 standard deviations
    close(curve.jnd(), 0.674_489_75, 1e-7);
    close(curve.level_at(0.841_344_746).unwrap(), 3.0, 1e-7);
    assert_eq!(
        Curve {
            gamma: 0.5,
            ..curve
        }
        .level_at(0.5),
        None
    );
}

/// Each kind of data from which no threshold follows.
#[test]
fn data_without_a_maximum_are_refused() {
    let reason = |rows: &[(f64, f64, f64)]| {
        maximum_likelihood(Core::Norm, &levels(rows), 0.5, 0.02).unwrap_err()
    };
    assert_eq!(
        reason(&[(1.0, 15.0, 20.0), (1.0, 3.0, 9.0)]),
        NoThreshold::OneLevel
    );
    assert_eq!(reason(&[]), NoThreshold::OneLevel);
    let rising = [
        (1.0, 10.0, 20.0),
        (2.0, 10.0, 20.0),
        (3.0, 20.0, 20.0),
        (4.0, 20.0, 20.0),
    ];
    assert_eq!(reason(&rising), NoThreshold::Step);
    // one level in between does not make it a curve
    let between = [
        (1.0, 10.0, 20.0),
        (2.0, 14.0, 20.0),
        (3.0, 20.0, 20.0),
        (4.0, 20.0, 20.0),
    ];
    assert_eq!(reason(&between), NoThreshold::Step);
    let flat = [(1.0, 10.0, 20.0), (2.0, 9.0, 20.0), (3.0, 10.0, 20.0)];
    assert_eq!(reason(&flat), NoThreshold::NoneAboveGuess);
    let falling = [
        (1.0, 19.0, 20.0),
        (2.0, 15.0, 20.0),
        (3.0, 12.0, 20.0),
        (4.0, 10.0, 20.0),
    ];
    assert_eq!(reason(&falling), NoThreshold::NotRising);
    assert_eq!(
        reason(&[(1.0, 9.0, 9.0), (2.0, 9.0, 9.0)]),
        NoThreshold::AllPositive
    );
    assert_eq!(
        reason(&[(1.0, 9.0, 8.0), (2.0, 9.0, 9.0)]),
        NoThreshold::Invalid
    );
    // The posterior has an answer to separated data, between the levels.
    let found = posterior(
        Core::Norm,
        &levels(&rising),
        Experiment::ForcedChoice(0.5),
        &Priors::schuett(None),
    )
    .unwrap();
    let (low, high) = found.threshold.ci95;
    assert!(
        low > 1.0 && high < 3.2 && found.threshold.mean > 2.0,
        "{found:?}"
    );
}

/// A lapse at the top: with λ = 0 it wrecks the width, a free λ takes it.
#[test]
fn a_free_lapse_rate_takes_the_slips() {
    let rows = levels(&[
        (1.0, 20.0, 40.0),
        (2.0, 23.0, 40.0),
        (3.0, 33.0, 40.0),
        (4.0, 39.0, 40.0),
        (5.0, 39.0, 40.0),
        (6.0, 38.0, 40.0),
    ]);
    let experiment = Experiment::ForcedChoice(0.5);
    let fixed = maximum_likelihood(Core::Norm, &rows, 0.5, 0.0).unwrap();
    let free = free_lapse(Core::Norm, &rows, experiment, 0.5, 0.06).unwrap();
    assert!(free.curve.width < 0.7 * fixed.curve.width);
    assert!(free.curve.lambda > 0.02 && free.curve.lambda < 0.05);
    assert!(free.log_likelihood > fixed.log_likelihood);
    // at the bound
    let bounded = free_lapse(Core::Norm, &rows, experiment, 0.5, 0.01).unwrap();
    assert_eq!(bounded.curve.lambda, 0.01);
}

/// A curve that made the data is not rejected, a wrong one is.
#[test]
fn the_bootstrap_finds_a_wrong_curve() {
    let fit = maximum_likelihood(Core::Norm, &example(), 0.5, 0.0).unwrap();
    let p = deviance_p(&fit, &example(), 1000, &mut SplitMix64::new(7));
    // 10 000 repeats by numpy: .849
    close(p, 0.849, 0.04);
    let wrong = levels(&[
        (1.0, 20.0, 40.0),
        (2.0, 38.0, 40.0),
        (3.0, 22.0, 40.0),
        (4.0, 38.0, 40.0),
        (5.0, 30.0, 40.0),
        (6.0, 40.0, 40.0),
    ]);
    let fit = maximum_likelihood(Core::Norm, &wrong, 0.5, 0.0).unwrap();
    assert!(deviance_p(&fit, &wrong, 999, &mut SplitMix64::new(7)) < 0.01);
}

/// A curve passes through any two levels: no data set deviates, all are "at least as large".
#[test]
fn data_that_deviate_as_much_count_in_the_bootstrap() {
    let two = levels(&[(1.0, 12.0, 20.0), (2.0, 16.0, 20.0)]);
    let fit = maximum_likelihood(Core::Norm, &two, 0.5, 0.0).unwrap();
    assert_eq!(deviance_p(&fit, &two, 99, &mut SplitMix64::new(7)), 1.0);
}

#[test]
fn thresholds_are_summed_up_on_logarithms() {
    let found = group(&[1.0, 2.0, 4.0]).unwrap();
    close(found.geometric_mean, 2.0, 1e-14);
    close(found.geometric_sd.unwrap(), 2.0, 1e-14);
    // t(.975, 2) = 4.302653
    let factor = (4.302_652_73 * 2f64.ln() / 3f64.sqrt()).exp();
    close(found.ci95.unwrap().1, 2.0 * factor, 1e-6);
    assert_eq!(group(&[1.0, 0.0]), None);
    assert_eq!(group(&[3.0]).unwrap().ci95, None);
}

/// The range of the ladder, not of the levels that a track happened to present.
#[test]
fn the_support_can_be_given() {
    let narrow = levels(&[(1.0, 6.0, 10.0), (1.1, 9.0, 10.0)]);
    let experiment = Experiment::ForcedChoice(0.5);
    let ladder = Support::of((0..=20).map(|i| f64::from(i) / 10.0)).unwrap();
    let own = posterior(Core::Norm, &narrow, experiment, &Priors::schuett(None)).unwrap();
    let given = posterior(
        Core::Norm,
        &narrow,
        experiment,
        &Priors::schuett(Some(ladder)),
    )
    .unwrap();
    let width = |p: &Posterior| p.threshold.ci95.1 - p.threshold.ci95.0;
    assert!(width(&given) > 2.0 * width(&own));
    assert_eq!(Support::of([1.0, 1.0]), None);
}

/// Counts that follow a function of the logarithm: fitted there, the levels can be in any
/// unit, and levels of 0 have no place.
#[test]
fn logarithms_are_a_scale_of_their_own() {
    let rows = levels(&[
        (0.0, 20.0, 40.0),
        (0.05, 22.0, 40.0),
        (0.1, 27.0, 40.0),
        (0.2, 35.0, 40.0),
        (0.4, 40.0, 40.0),
    ]);
    let placed = Spacing::Log.places(&rows);
    assert_eq!(placed.len(), 4);
    close(Spacing::Log.level(placed[2].level), 0.2, 1e-15);
    assert_eq!(Spacing::Lin.places(&rows), rows);
    let thousandfold: Vec<Level> = (rows.iter())
        .map(|l| Level {
            level: l.level * 1000.0,
            ..*l
        })
        .collect();
    let experiment = Experiment::ForcedChoice(0.5);
    let of = |rows: &[Level]| {
        let rows = Spacing::Log.places(rows);
        posterior(Core::Norm, &rows, experiment, &Priors::schuett(None)).unwrap()
    };
    let (one, other) = (of(&rows), of(&thousandfold));
    let level = |p: &Posterior| p.threshold_level(Spacing::Log);
    close(level(&other).mean / level(&one).mean, 1000.0, 1e-6);
    close(level(&other).ci95.0 / level(&one).ci95.0, 1000.0, 1e-6);
    // The mean of the level is above the level of the mean, by Jensen's inequality.
    let ratio = level(&one).mean / Spacing::Log.level(one.threshold.mean);
    assert!((1.01..1.2).contains(&ratio), "{ratio}");
    close(one.width.mean, other.width.mean, 1e-9);
    // R 4.2.2: optim and optimHess of the same likelihood over log(level).
    let fit = maximum_likelihood(Core::Norm, &placed, 0.5, 0.02).unwrap();
    close(Spacing::Log.level(fit.curve.threshold), 0.122_554_572, 1e-6);
    close(fit.curve.width, 1.736_495_7, 1e-5);
    close(fit.covariance.unwrap(), -0.050_302_6, 1e-5);
}

/// Many trials at few levels: the posterior is far narrower than the distance of the first nodes.
/// Data: `menarche` of R's MASS. Reference: four chains of 40 000 steps of random-walk Metropolis in
/// numpy.
#[test]
fn a_narrow_posterior_is_found() {
    let ages = [
        9.21, 10.21, 10.58, 10.83, 11.08, 11.33, 11.58, 11.83, 12.08, 12.33, 12.58, 12.83, 13.08,
        13.33, 13.58, 13.83, 14.08, 14.33, 14.58, 14.83, 15.08, 15.33, 15.58, 15.83, 17.58,
    ];
    let girls = [
        376, 200, 93, 120, 90, 88, 105, 111, 100, 93, 100, 108, 99, 106, 105, 117, 98, 97, 120,
        102, 122, 111, 94, 114, 1049,
    ];
    let yes = [
        0, 0, 0, 2, 2, 5, 10, 17, 16, 29, 39, 51, 47, 67, 81, 88, 79, 90, 113, 95, 117, 107, 92,
        112, 1049,
    ];
    let rows: Vec<(f64, f64, f64)> = (ages.into_iter().zip(yes).zip(girls))
        .map(|((age, yes), all)| (age, f64::from(yes), f64::from(all)))
        .collect();
    let priors = Priors::schuett(None);
    let found = posterior(Core::Norm, &levels(&rows), Experiment::YesNo, &priors).unwrap();
    // Tolerances: four Monte Carlo errors of the reference.
    close(found.threshold.mean, 13.0078, 0.0035);
    close(found.threshold.median, 13.0083, 0.004);
    close(found.threshold.ci95.0, 12.9076, 0.013);
    close(found.threshold.ci95.1, 13.1032, 0.007);
    close(found.width.mean, 3.5606, 0.011);
    close(found.lambda, 0.004_338, 0.000_2);
    close(found.gamma.unwrap(), 0.002_000, 0.000_17);
    close(found.eta, 0.0574, 0.0025);
}

/// Both priors of tracks. Reference: quadrature by numpy over 601 × 500 × 24 × 24 nodes.
#[test]
fn tracks_have_priors_of_their_own() {
    let rows = levels(&[
        (0.05, 22.0, 40.0),
        (0.1, 27.0, 40.0),
        (0.2, 35.0, 40.0),
        (0.4, 40.0, 40.0),
    ]);
    let experiment = Experiment::ForcedChoice(0.5);
    let priors = Priors::track(None, WidthPrior::OfRatios);
    let placed = Spacing::Log.places(&rows);
    let found = posterior(Core::Gumbel, &placed, experiment, &priors).unwrap();
    close(found.threshold.mean, -2.011_305, 0.003);
    close(found.threshold.median, -1.998_982, 0.003);
    close(found.threshold.ci95.0, -2.443_412, 0.01);
    close(found.threshold.ci95.1, -1.649_928, 0.006);
    close(found.width.mean, 2.012_33, 0.01);
    close(found.lambda, 0.017_801, 0.000_3);
    close(found.eta, 0.076_480, 0.001);
    let priors = Priors::track(None, WidthPrior::FromOrigin(0.0));
    let found = posterior(Core::Norm, &rows, experiment, &priors).unwrap();
    close(found.threshold.mean, 0.143_753, 0.000_5);
    close(found.threshold.median, 0.142_474, 0.000_5);
    close(found.threshold.ci95.0, 0.093_777, 0.001);
    close(found.threshold.ci95.1, 0.200_689, 0.001);
    close(found.width.mean, 0.279_808, 0.002);
    close(found.lambda, 0.016_835, 0.000_3);
    close(found.eta, 0.077_184, 0.001);
}
