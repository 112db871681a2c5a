//! A progress bar for analyses that take longer than a second.

use super::super::console::{PATIENCE, progress};
use std::io::IsTerminal as _;
use std::sync::atomic::Ordering;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::Duration;
use study_core::analyze::{Analysis, Progress, Rules, analyze_watched};
use study_core::outcome::ratings::Ratings;

/// Interval between two updates of the bar.
const LOOK: Duration = Duration::from_millis(200);

/// Runs the analysis, with a progress bar on a terminal.
pub(super) fn analyze(ratings: &Ratings, rules: &Rules) -> Analysis {
    let made = Progress::default();
    if !std::io::stderr().is_terminal() {
        return analyze_watched(ratings, rules, &made);
    }
    let (done, wait) = channel::<()>();
    let made = &made;
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let mut bar = None;
            let mut patience = PATIENCE;
            // Nothing is ever sent: the sender is dropped when the analysis has finished.
            while let Err(RecvTimeoutError::Timeout) = wait.recv_timeout(patience) {
                patience = LOOK;
                let groups = made.groups.load(Ordering::Relaxed);
                let bar = bar.get_or_insert_with(|| progress(groups, "groups of statistics"));
                bar.set_length(groups);
                bar.set_position(made.made.load(Ordering::Relaxed));
            }
            if let Some(bar) = bar {
                bar.finish_and_clear();
            }
        });
        let analysis = analyze_watched(ratings, rules, made);
        drop(done);
        analysis
    })
}
