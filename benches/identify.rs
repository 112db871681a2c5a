//! How long the grid of Fig. 4 takes: `cargo bench --bench identify`.
//!
//! `ns per sample and lambda` is the recursion alone, 10 λ and one table, on one
//! thread; `naive` is the same with one estimate a sample. `fig4` is everything from
//! the sorted samples to VAFs, 10 λ × 11 dx, on one thread.
//!
//! Above the table stand the same as processor time (Linux), the least of 20: what
//! other programs on the machine take does not count.

use std::fmt::Write as _;
use study_haptics::identify::grid::{self, Plan};
use study_haptics::identify::lanes::Processor;
use study_haptics::identify::resample::Resample;
use study_haptics::identify::{Ewls, Training, vaf};
use study_haptics::recording::{self, Recording};
use study_wire::predict::Lookup;

const LAMBDAS: [f64; 10] = [
    0.999, 0.9991, 0.9992, 0.9993, 0.9994, 0.9995, 0.9996, 0.9997, 0.9998, 0.9999,
];
const DX_MM: [f64; 11] = [0.05, 0.1, 0.2, 0.3, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0];

fn main() {
    if std::env::args().any(|argument| argument == "--bench") {
        processor_time();
    }
    divan::main();
}

/// Seconds that this thread has run, without those it waited; `None` where nobody
/// counts them.
fn ran_s() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split(' ').next()?.parse::<f64>().ok()? * 1e-9)
}

/// Prints the processor time of a whole Fig. 4 and of one sample and λ, sums of the
/// table included.
#[allow(clippy::print_stdout, reason = "a bench talks to whoever runs it")]
fn processor_time() {
    let twelve: Vec<f64> = (0..12).map(|i| 0.9988 + 1e-4 * f64::from(i)).collect();
    for (rate, lambdas, dx_mm, validated) in [
        (1000, &LAMBDAS[..], &DX_MM[..], true),
        (10_000, &LAMBDAS, &DX_MM, true),
        (10_000, &LAMBDAS, &[0.5], false),
        (10_000, &twelve, &[0.5], false),
    ] {
        let (train, validation) = pair(rate);
        let training = Training::new(&train).expect("both directions are there");
        let plan = Plan::ewls(lambdas, dx_mm, Resample::Bin);
        let validations: &[&Recording] = if validated { &[&validation] } else { &[] };
        let least = (0..20)
            .filter_map(|_| {
                // inside of it there is one thread, and only that is asked
                alone().install(|| {
                    let before = ran_s()?;
                    let cells = grid::run(&training, &plan, Lookup::Linear, validations, || ());
                    divan::black_box(cells).expect("the plan suits the recording");
                    Some(ran_s()? - before)
                })
            })
            .fold(f64::INFINITY, f64::min);
        println!(
            "{} λ × {} dx of {} samples{}: {:.1} ms, {:.2} ns per sample and λ",
            lambdas.len(),
            dx_mm.len(),
            train.len(),
            if validated { " and their VAFs" } else { "" },
            1e3 * least,
            1e9 * least / (train.len() * lambdas.len()) as f64
        );
    }
}

/// The paper's training or validation motion on a made-up switch, at a rate in Hz.
fn recording(name: &str, seconds: u32, rate: u32, sines: &[(f64, f64)]) -> Recording {
    let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
    for i in 0..seconds * rate {
        let t = f64::from(i) / f64::from(rate);
        let (mut x, mut v, mut a) = (17.5, 0.0, 0.0);
        for (hz, mm) in sines {
            let w = hz * std::f64::consts::TAU;
            x += mm * (w * t).sin();
            v += mm * w * (w * t).cos();
            a -= mm * w * w * (w * t).sin() / 1000.0;
        }
        let f = 0.2 * a + 0.01 * v + 6.0 * (x / 2.0).sin() + 0.8 * v.signum();
        // writing to a String cannot fail
        let _ = writeln!(text, "{t},{x},{v},{a},{f}");
    }
    recording::read(name, text.as_bytes()).expect("the recording is whole")
}

fn pair(rate: u32) -> (Recording, Recording) {
    (
        recording("training", 60, rate, &[(0.5, 12.0), (2.37, 4.0)]),
        recording("validation", 20, rate, &[(1.5, 15.0)]),
    )
}

/// One thread.
fn alone() -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new()
        .num_threads(1)
        .build()
        .expect("a thread can be started")
}

fn fig4(bencher: divan::Bencher<'_, '_>, rate: u32, processor: Processor) {
    let (train, validation) = pair(rate);
    let training = Training::new(&train).expect("both directions are there");
    let plan = Plan::ewls(&LAMBDAS, &DX_MM, Resample::Bin);
    let pool = alone();
    bencher.bench_local(|| {
        pool.install(|| {
            grid::run_on(
                processor,
                &training,
                &plan,
                Lookup::Linear,
                &[&validation],
                || (),
            )
        })
    });
}

#[divan::bench(sample_count = 20, args = [1000, 10_000])]
fn fig4_10_lambda_11_dx(bencher: divan::Bencher<'_, '_>, rate: u32) {
    fig4(bencher, rate, Processor::best());
}

#[divan::bench(sample_count = 3, args = [1000])]
fn fig4_portable(bencher: divan::Bencher<'_, '_>, rate: u32) {
    fig4(bencher, rate, Processor::Portable);
}

/// One estimate a sample, one λ after the other, one table after the other.
#[divan::bench(sample_count = 3, args = [1000, 10_000])]
fn fig4_naive(bencher: divan::Bencher<'_, '_>, rate: u32) {
    let (train, validation) = pair(rate);
    let training = Training::new(&train).expect("both directions are there");
    bencher.bench_local(|| {
        for lambda in LAMBDAS {
            let estimates = training
                .estimates(Ewls::paper(lambda, Resample::Point))
                .expect("λ is in range");
            for dx in DX_MM {
                let found = training
                    .ewls(&estimates, dx, Resample::Bin, Lookup::Linear)
                    .expect("dx suits the recording");
                divan::black_box(vaf::score(&found.realization, &validation));
            }
        }
    });
}

/// Items are samples times λ: read the time of one.
mod per_sample_and_lambda {
    use super::*;

    fn recursion(bencher: divan::Bencher<'_, '_>, lambdas: &[f64], processor: Processor) {
        let (train, _) = pair(10_000);
        let training = Training::new(&train).expect("both directions are there");
        let plan = Plan::ewls(lambdas, &[0.5], Resample::Bin);
        let pool = alone();
        bencher
            .counter(divan::counter::ItemsCount::new(train.len() * lambdas.len()))
            .bench_local(|| {
                pool.install(|| {
                    grid::run_on(processor, &training, &plan, Lookup::Linear, &[], || ())
                })
            });
    }

    #[divan::bench(sample_count = 20)]
    fn lanes_10(bencher: divan::Bencher<'_, '_>) {
        recursion(bencher, &LAMBDAS, Processor::best());
    }

    #[divan::bench(sample_count = 20)]
    fn lanes_12(bencher: divan::Bencher<'_, '_>) {
        let twelve: Vec<f64> = (0..12).map(|i| 0.9988 + 1e-4 * f64::from(i)).collect();
        recursion(bencher, &twelve, Processor::best());
    }

    #[divan::bench(sample_count = 3)]
    fn naive(bencher: divan::Bencher<'_, '_>) {
        let (train, _) = pair(10_000);
        let training = Training::new(&train).expect("both directions are there");
        bencher
            .counter(divan::counter::ItemsCount::new(train.len() * LAMBDAS.len()))
            .bench_local(|| {
                for lambda in LAMBDAS {
                    divan::black_box(training.estimates(Ewls::paper(lambda, Resample::Point)))
                        .expect("λ is in range");
                }
            });
    }
}
