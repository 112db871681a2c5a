//! The study that is run, who takes part, and its folder on one disk or two.

use crate::bugs::Bug;
use crate::disk::{Death, SimDisk};
use crate::memory::{Crash, Fault, MemoryDisk};
use crate::tables;
use crate::world::{self, Kept, model, question};
use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use study_base::text::ModelId;
use study_haptics::model::Realization;
use study_plan::protocol::{Breaks, Consent, Exposure, Question, QuestionKind, kinds};
use study_session::outcome::{Event, Moment};
use study_session::store::disk::Disk;
use study_session::store::{SeatKind, SessionData, StoreError, StudyFolder, layout};

/// As the protocol has it.
pub(crate) const LONGEST_PAUSE: Duration = Duration::from_secs(60);
/// Where the results and their mirror are, each on a disk of its own.
pub(crate) const ROOTS: [&str; 2] = ["results", "mirror"];

/// Somebody who takes part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Person {
    pub(crate) id: &'static str,
    pub(crate) kind: SeatKind,
}

/// Who may take part in a simulation.
pub(crate) const PEOPLE: [Person; 4] = [
    Person {
        id: "P01",
        kind: SeatKind::Real,
    },
    Person {
        id: "P02",
        kind: SeatKind::Real,
    },
    Person {
        id: "T01",
        kind: SeatKind::Pilot,
    },
    Person {
        id: "S01",
        kind: SeatKind::Simulated,
    },
];

fn text(id: &str) -> Question {
    Question {
        id: question(id),
        prompt: format!("What about {id}?"),
        kind: QuestionKind::Text(kinds::Text),
        required: false,
    }
}

/// Three realizations with a rating and a comment each, and every page that a session can have
/// around its trials.
pub(crate) fn kept() -> Kept {
    let some = |text: &str| Some(text.to_owned());
    let mut protocol = world::protocol();
    protocol.text.welcome = some("Welcome.");
    protocol.text.instructions = some("Feel, then rate.");
    protocol.text.end = some("Goodbye.");
    protocol.consent = Some(Consent {
        document: "Information".to_owned(),
        version: "1".to_owned(),
        file: None,
        text: None,
        initials: true,
    });
    protocol.design.breaks = Some(Breaks {
        every: 2,
        at_least_s: 2.0,
    });
    protocol.trial.reference_min_s = 0.3;
    protocol.trial.exposure = Exposure {
        min_s: 0.3,
        max_s: Some(3.0),
        replays: 0,
    };
    protocol.session.longest_pause_s = LONGEST_PAUSE.as_secs_f64();
    protocol.setup = vec![text("rig")];
    protocol.outro = vec![text("strategy")];
    Kept {
        protocol,
        files: world::files(),
        fingerprints: world::fingerprints(),
    }
}

/// The realizations of the study: friction of 1 N with more and more damping.
pub(crate) fn realizations() -> BTreeMap<ModelId, Realization> {
    let dampings = [("A", 0.01), ("B", 0.012), ("C", 0.015)];
    let table = |(id, damping): (&str, f64)| {
        let terms = [0.05, damping, 0.0];
        let table = tables::table(id, tables::coarse(), terms, |_, side| side, tables::PLAY);
        (model(id), table)
    };
    dampings.into_iter().map(table).collect()
}

/// One disk without a mirror, or two.
#[derive(Debug, Clone)]
pub(crate) struct Disks(pub(crate) Vec<MemoryDisk>);

impl Disks {
    pub(crate) fn new(mirrored: bool) -> Self {
        let count = 1 + usize::from(mirrored);
        // Clones of one would be the same disk.
        let disks = Self((0..count).map(|_| MemoryDisk::new()).collect());
        disks.mount();
        disks
    }

    /// A mirror is a folder that exists.
    pub(crate) fn mount(&self) {
        let mirror = Path::new(ROOTS[1]);
        if let Some(disk) = self.0.get(1)
            && disk.list(mirror).is_err()
        {
            disk.create_folder(mirror).unwrap();
            disk.sync_folder(Path::new(".")).unwrap();
        }
    }

    /// Opens the folder of the study, or creates it, as a process does.
    pub(crate) fn open(
        &self,
        kept: &Kept,
        death: &Death,
        bug: Option<Bug>,
        at: Moment,
    ) -> Result<StudyFolder, StoreError> {
        let side = |n: usize| -> Arc<dyn Disk> {
            Arc::new(SimDisk {
                disk: self.0[n].clone(),
                death: death.clone(),
                bug,
            })
        };
        let frozen = kept.frozen();
        if self.0.len() == 1 {
            return StudyFolder::open_or_create_on(side(0), Path::new(ROOTS[0]), &frozen, at);
        }
        let sides = [
            (side(0), Path::new(ROOTS[0])),
            (side(1), Path::new(ROOTS[1])),
        ];
        let (study, _) = StudyFolder::open_or_create_mirrored_on(sides, &frozen, at)?;
        Ok(study)
    }

    /// What somebody reads on one of the disks, before anything is repaired.
    pub(crate) fn read(&self, side: usize) -> Result<Vec<SessionData>, StoreError> {
        // The calls of the next process are counted from its own first one.
        let copy = Arc::new(self.0[side].after(Crash::Process));
        StudyFolder::open_on(copy, &study_path(side))?.sessions()
    }

    /// The journal of a person's session as a loss of power would leave it now, if nothing
    /// survived that is not synced.
    pub(crate) fn journal_on_medium(&self, side: usize, id: &str) -> String {
        let session = study_path(side).join(layout::SESSIONS).join(id).join("1");
        let is_segment = |name: &str| layout::segment_number(name).is_some();
        let segments = self.0[side].on_medium(&session, is_segment);
        String::from_utf8_lossy(&segments.concat()).into_owned()
    }

    /// Whether one of two disks has what a loss of power would not leave on the other: a record in
    /// the journal of a session, or a file of telemetry. Its removal would then be that of the only copy.
    pub(crate) fn is_ahead(&self, side: usize) -> bool {
        let other = 1 - side;
        let [own, copies] = [side, other].map(|side| study_path(side).join(layout::SESSIONS));
        let is_segment = |name: &str| layout::segment_number(name).is_some();
        let others = self.0[other].files();
        let is_alone = |(path, bytes): (&PathBuf, &Vec<u8>)| {
            let Ok(inside) = path.strip_prefix(&own) else {
                return false;
            };
            let copy = copies.join(inside);
            let folder = copy.parent().unwrap();
            let name = copy.file_name().unwrap().to_str().unwrap();
            if is_segment(name) {
                let journal = self.0[other].on_medium(folder, is_segment).join(&b'\n');
                let there: BTreeSet<&[u8]> = journal.split(|byte| *byte == b'\n').collect();
                let mut lines = bytes.split(|byte| *byte == b'\n');
                return lines.any(|line| !line.is_empty() && !there.contains(line));
            }
            folder.ends_with(layout::TELEMETRY) && !others.contains_key(&copy)
        };
        self.0[side].files().iter().any(is_alone)
    }
}

/// A record that is on one disk alone is seen there, also if the other one has it in its cache.
#[test]
fn a_disk_is_ahead_while_it_alone_has_a_record() {
    // Of a record the write fails, or its sync.
    for fails in [0, 1] {
        let (disks, kept) = (Disks::new(true), kept());
        let death = Death::default();
        let study = disks.open(&kept, &death, None, world::at(0)).unwrap();
        let mut claimed = study.claim(&world::real("P01")).unwrap();
        let mut journal = claimed.folder.journal().unwrap();
        let ahead = |disks: &Disks| [0, 1].map(|side| disks.is_ahead(side));
        assert_eq!(ahead(&disks), [false, false]);
        let mirror = &disks.0[1];
        mirror.plan(mirror.calls() + fails, Fault::Error(ErrorKind::Other));
        journal.append(world::at(1), &Event::Paused).unwrap();
        assert_eq!(ahead(&disks), [true, false], "call {fails}");
    }
}

/// The folder of the study on one of the disks.
pub(crate) fn study_path(side: usize) -> PathBuf {
    Path::new(ROOTS[side]).join("small")
}
