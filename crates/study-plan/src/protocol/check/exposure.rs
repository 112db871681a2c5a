//! Trials that can be answered before anything was felt.

use super::{Spans, first_line};
use crate::protocol::Protocol;
use study_base::diagnostic::Fault;

/// A warning where neither a least time nor strokes are required.
pub(super) fn warnings(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    if protocol.trial.minimum_strokes > 0 {
        return;
    }
    let without = protocol.parts.iter().filter(|p| p.exposure.min_s <= 0.0);
    let parts: Vec<String> = without.map(|part| format!("`{}`", part.id)).collect();
    let has_trials = protocol.parts.is_empty() && !protocol.only_asks();
    let whole = has_trials && protocol.trial.exposure.min_s <= 0.0;
    let of = match (whole, &parts[..]) {
        (true, _) => "a trial".to_owned(),
        (false, []) => return,
        (false, parts) => format!("a trial of {}", parts.join(", ")),
    };
    faults.push(
        Fault::warning(format!("{of} can be answered before anything was felt"))
            .at(spans.get("trial").cloned().map(first_line))
            .hint("a least time, exposure = { min_s = 2 } in [trial], or minimum_strokes = 1 for a device with telemetry"),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::example;

    fn found_in(protocol: &Protocol) -> Vec<Fault> {
        let mut found = Vec::new();
        warnings(protocol, &Spans::new(), &mut found);
        found
    }

    #[test]
    fn a_trial_without_a_least_exposure_gives_a_warning() {
        let mut protocol = example::protocol(8, 1);
        let warned = |protocol: &Protocol| {
            let found = found_in(protocol);
            let about = |f: &Fault| f.message.contains("before anything was felt");
            found.iter().any(about)
        };
        assert!(warned(&protocol));
        protocol.trial.exposure.min_s = 2.0;
        assert!(!warned(&protocol));
        protocol.trial.exposure.min_s = 0.0;
        protocol.trial.minimum_strokes = 1;
        assert!(!warned(&protocol));
    }
}
