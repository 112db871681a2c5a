//! `[confirms]`: which search a study confirms.

use crate::protocol::Confirms;
use crate::protocol::keys::{Id, Key, Kind, keys};
use crate::protocol::section::Section;
use study_base::diagnostic::Fault;

pub(super) const CONFIRMS: &[Key] = keys! {
    /// The id of the study that searched.
    "study": Kind::Id(Id::Study), r#""my-search""#, required;
    /// Its part of kind `search`.
    "part": Kind::Id(Id::Part), r#""better""#, required;
    /// The SHA-256 of `PART-pairs.csv`, which `study explore --out` writes: every pair that was presented, with its answer, of
    /// the sessions that count; with `pilot` or `simulated`, of those that count with this word in `--include`.
    "pairs_sha256": Kind::Text, r#""9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08""#, required;
    /// The point that was found to be best.
    "best": Kind::Id(Id::Model), r#""switch.41""#, required;
    /// The ids of all who took part in the search. They cannot take part in this study.
    "searchers": Kind::Ids(Id::Participant), r#"["P01", "P02"]"#, required;
    /// Whether answers of pilots are among those from which the point follows. Every report and the preregistration say so.
    "pilot": Kind::Flag, "true", default("false");
    /// The same of simulated participants, whose answers say nothing about people.
    "simulated": Kind::Flag, "true", default("false");
};

pub(super) fn read(mut section: Section<'_, '_>) -> Option<Confirms> {
    let (study, part) = (section.study_id("study"), section.part_id("part"));
    let (hash, best) = (section.text("pairs_sha256"), section.model_id("best"));
    let searchers = section.ids("searchers");
    let (pilot, simulated) = (section.flag("pilot"), section.flag("simulated"));
    let hash = hash.filter(|hash| {
        let digit = |b: u8| matches!(b, b'0'..=b'9' | b'a'..=b'f');
        let good = hash.len() == 64 && hash.bytes().all(digit);
        if !good {
            let what = "`confirms.pairs_sha256` is not 64 hexadecimal digits in lower case";
            let hint = "`study new --from RESULTS --confirm` writes this section";
            section.fault_at("pairs_sha256", Fault::error(what).hint(hint));
        }
        good
    });
    Some(Confirms {
        study: study?,
        part: part?,
        pairs_sha256: hash?,
        best: best?,
        searchers: searchers?,
        pilot: pilot?,
        simulated: simulated?,
    })
}
