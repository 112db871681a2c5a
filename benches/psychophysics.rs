//! How long the next level of a track and a fit take: `cargo bench --bench psychophysics`.

use study_base::rng::Stream;
use study_plan::procedure::{Answer, Ladder, QuestPlus, Rule, Track};
use study_stats::psychometric::{Core, Experiment, Level, Priors, maximum_likelihood, posterior};

fn main() {
    divan::main();
}

/// 41 levels; `means` × `sds` cells of parameters.
fn track(means: u32, sds: u32) -> Track {
    let ladder = Ladder::new((0..41).map(f64::from).collect()).expect("levels rise");
    let mean = (0..means).map(|i| f64::from(i) * 40.0 / f64::from(means));
    let sd = (1..=sds).map(|i| f64::from(i) * 8.0 / f64::from(sds));
    let rule = QuestPlus::psi(mean.collect(), sd.collect(), 0.5, 0.02, u32::MAX);
    let mut stream = Stream::new(1, &["bench"]);
    Track::new(&Rule::QuestPlus(rule), &ladder, &mut stream).expect("the rule is good")
}

/// One answer and the level that follows it.
fn next_level(bencher: divan::Bencher<'_, '_>, means: u32, sds: u32) {
    let track = track(means, sds);
    let answer = Answer {
        presented: 20.0,
        positive: true,
        easy: false,
    };
    bencher.with_inputs(|| track.clone()).bench_refs(|track| {
        track.answer(divan::black_box(&answer));
        track.next()
    });
}

#[divan::bench]
fn quest_plus_41_levels_20_cells(bencher: divan::Bencher<'_, '_>) {
    next_level(bencher, 10, 2);
}

#[divan::bench]
fn quest_plus_41_levels_2000_cells(bencher: divan::Bencher<'_, '_>) {
    next_level(bencher, 100, 20);
}

/// The table of a track, once at its start.
#[divan::bench]
fn table_of_41_levels_2000_cells() -> Track {
    track(100, 20)
}

/// 13 levels of 90 trials (Schütt et al. 2016).
fn levels() -> Vec<Level> {
    let x = [
        1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5, 5.0, 6.0, 7.0, 8.0, 10.0,
    ];
    let k = [45, 50, 44, 44, 52, 53, 62, 64, 76, 79, 88, 90, 90];
    (x.into_iter().zip(k))
        .map(|(level, positive)| Level {
            level,
            positive: f64::from(positive),
            trials: 90.0,
        })
        .collect()
}

#[divan::bench]
fn fit_by_maximum_likelihood() {
    divan::black_box(maximum_likelihood(Core::Norm, &levels(), 0.5, 0.02)).ok();
}

#[divan::bench]
fn posterior_of_a_forced_choice() {
    let experiment = Experiment::ForcedChoice(0.5);
    divan::black_box(posterior(
        Core::Norm,
        &levels(),
        experiment,
        &Priors::schuett(None),
    ))
    .ok();
}

/// With a guess rate of its own: five dimensions instead of four.
#[divan::bench]
fn posterior_of_yes_and_no() {
    divan::black_box(posterior(
        Core::Norm,
        &levels(),
        Experiment::YesNo,
        &Priors::schuett(None),
    ))
    .ok();
}
