//! Questionnaires whose score would not be what it is called.

use super::Spans;
use crate::protocol::questionnaires::item_id;
use crate::protocol::{Inventory, Protocol};
use study_base::diagnostic::Fault;

/// The Task Load Index rates success from perfect to failure, so that all its ratings count as load. With the
/// labels of the other scales, such as "low" and "high", the highest answer says success and counts as load.
pub(super) fn warnings(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    for (i, own) in protocol.questionnaires.iter().enumerate() {
        if !matches!(own.kind, Inventory::NasaTlx | Inventory::NasaTlxWeighted) {
            continue;
        }
        let labels = |name: &str| {
            let id = item_id(&own.id, name);
            let mut all = protocol.outro.iter().chain(&own.questions);
            let item = all.find(|q| q.id == id)?;
            Some(item.kind.scale().labels())
        };
        if labels("performance").is_none_or(|own| labels("mental") != Some(own)) {
            continue;
        }
        faults.push(
            Fault::warning(format!(
                "`{}` has the labels of the other scales, and its highest answer counts as load: of the source it says failure",
                item_id(&own.id, "performance")
            ))
            .at(spans.get(&format!("questionnaires[{i}].labels")).cloned())
            .hint("write two texts for each item in `labels`, 12 in all; those of the fourth are such as \"perfect\" and \"failure\""),
        );
    }
}
