//! How the psychometric functions of tracks are fitted.

use super::parts::{PARTS, good};
use crate::protocol::difference::changes;
use crate::protocol::file::parse;
use crate::protocol::fingerprint;
use std::collections::BTreeMap;
use study_stats::psychometric::{Core, Spacing};

/// The scale of the ladder is that of the fit, unless the track says otherwise.
#[test]
fn functions_are_fitted_over_the_scale_of_the_ladder() {
    let fits = |text: &str| {
        let p = good(text);
        [0, 1].map(|at| p.fit(&p.tracks[at]))
    };
    assert_eq!(fits(PARTS), [(Spacing::Lin, Core::Norm); 2]);
    let log = PARTS.replace("steps = 41", "steps = 41\nscale = \"log\"");
    assert_eq!(fits(&log), [(Spacing::Log, Core::Gumbel); 2]);
    let rule = "procedure = { rule = \"quest+\"";
    let fit = |keys: &str| log.replace(rule, &format!("fit = {{ {keys} }}\n{rule}"));
    let own = fits(&fit("scale = \"lin\", core = \"logistic\""));
    assert_eq!(own[1], (Spacing::Lin, Core::Logistic));
    assert_eq!(own[0], (Spacing::Log, Core::Gumbel));
    assert_eq!(good(&fit("lapse = 0.05")).tracks[1].fit.lapse, 0.05);

    // It belongs to the analysis, and without it nothing changes.
    let prints = |text: &str| fingerprint::parts(&good(text), &BTreeMap::new(), None);
    let (before, after) = (prints(&log), prints(&fit("core = \"norm\"")));
    assert_eq!(before.stimulus, after.stimulus);
    assert_eq!(before.analysis["tracks"], serde_json::Value::Null);
    assert_eq!(after.analysis["tracks"][1]["fit"]["core"], "norm");
    let changes = changes(&before, &after);
    assert!(
        changes
            .iter()
            .all(|c| !c.fixed && c.key.starts_with("tracks")),
        "{changes:?}"
    );

    let faults = |text: &str| -> Vec<String> {
        let faults = parse("protocol.toml", text).findings.faults;
        faults.into_iter().map(|f| f.message).collect()
    };
    let from_0 = PARTS.replace("range = [1.0, 3.0]", "range = [0.0, 3.0]");
    let from_0 = from_0.replace(rule, &format!("fit = {{ scale = \"log\" }}\n{rule}"));
    assert!(faults(&from_0)[0].contains("the level 0 has no logarithm"));
    let same = fit("scale = \"lin\"").replace("\"2ifc\"", "\"same-different\"");
    assert!(faults(&same)[0].contains("no psychometric function"));
    assert!(faults(&fit("shape = 1"))[0].contains("shape"));
}
