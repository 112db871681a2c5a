//! How long orders take: `cargo bench --bench schedule`.

#[path = "../tests/support/designs.rs"]
mod designs;

use designs::{constrained, design};
use study_plan::protocol::Order::{Blocked, Shuffled, Williams};
use study_plan::protocol::{Protocol, Seat};
use study_plan::schedule::Planner;

fn main() {
    divan::main();
}

/// A planner and the orders of 10,000 rows.
fn rows(bencher: divan::Bencher<'_, '_>, protocol: &Protocol) {
    bencher.bench(|| {
        let planner = Planner::new(protocol, None).expect("the design is feasible");
        for row in 1..=10_000 {
            divan::black_box(planner.plan(Seat::Row(row)).expect("rows are feasible"));
        }
    });
}

/// The size of the extended design.
#[divan::bench(sample_count = 10)]
fn blocked_12_by_3_max_run_1(bencher: divan::Bencher<'_, '_>) {
    rows(bencher, &constrained(12, 3, Blocked, Some(1), None));
}

#[divan::bench(sample_count = 10)]
fn shuffled_12_by_3_max_run_1(bencher: divan::Bencher<'_, '_>) {
    rows(bencher, &constrained(12, 3, Shuffled, Some(1), None));
}

#[divan::bench(sample_count = 10)]
fn shuffled_10_by_5_max_run_1(bencher: divan::Bencher<'_, '_>) {
    rows(bencher, &constrained(10, 5, Shuffled, Some(1), None));
}

#[divan::bench(sample_count = 10)]
fn williams_12_by_3(bencher: divan::Bencher<'_, '_>) {
    rows(bencher, &design(12, 3, Williams));
}

/// What a session waits for: counting, and one order.
#[divan::bench(sample_count = 20, args = [1, 2])]
fn one_row_shuffled_10_by_5_max_run(bencher: divan::Bencher<'_, '_>, max_run: u32) {
    let protocol = constrained(10, 5, Shuffled, Some(max_run), None);
    bencher.bench(|| study_plan::schedule::plan(&protocol, None, Seat::Row(1)));
}

/// Near the most that is counted by states.
#[divan::bench(sample_count = 3, sample_size = 1)]
fn one_row_shuffled_20_by_5_max_run_1(bencher: divan::Bencher<'_, '_>) {
    let protocol = constrained(20, 5, Shuffled, Some(1), None);
    bencher.bench(|| study_plan::schedule::plan(&protocol, None, Seat::Row(1)));
}

/// Too many states: counted by inclusion and exclusion.
#[divan::bench(sample_count = 3, sample_size = 1, args = [(30, 10), (20, 20)])]
fn one_row_shuffled_max_run_1(
    bencher: divan::Bencher<'_, '_>,
    (models, repetitions): (usize, u32),
) {
    let protocol = constrained(models, repetitions, Shuffled, Some(1), None);
    bencher.bench(|| study_plan::schedule::plan(&protocol, None, Seat::Row(1)));
}
