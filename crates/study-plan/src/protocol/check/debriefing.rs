//! What participants are told of the study before they come again.

use super::Spans;
use crate::protocol::Protocol;
use study_base::diagnostic::Fault;

/// A debriefing at the end of each session is read before the sessions that follow.
pub(super) fn warnings(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    if protocol.debriefing.is_none() || protocol.sessions.len() < 2 {
        return;
    }
    let place = ["debriefing.text", "debriefing.file"];
    let place = place.iter().find_map(|key| spans.get(*key)).cloned();
    faults.push(
        Fault::warning(
            "participants read the debriefing at the end of each session, and come again knowing what the study is about",
        )
        .at(place)
        .hint("say there only what does not change how they feel or answer, and hand out the rest after the last session"),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::{Debriefing, SessionPlan, example};
    use study_base::text::PartId;

    #[test]
    fn a_debriefing_between_sessions_is_a_warning() {
        let session = |id: &str| SessionPlan {
            id: PartId::new(id).unwrap(),
            parts: None,
            min_gap_h: 0.0,
            max_gap_h: None,
        };
        let warned = |sessions: &[&str], debriefed: bool| {
            let mut protocol = example::protocol(3, 2);
            protocol.sessions = sessions.iter().map(|id| session(id)).collect();
            protocol.debriefing = debriefed.then(|| Debriefing {
                file: None,
                text: Some("It was about friction.".to_owned()),
            });
            let mut faults = Vec::new();
            warnings(&protocol, &Spans::new(), &mut faults);
            faults.len()
        };
        let both = ["first", "second"];
        assert_eq!(warned(&both, true), 1);
        assert_eq!((warned(&both, false), warned(&[], true)), (0, 0));
        assert_eq!(warned(&both[..1], true), 0);
    }
}
