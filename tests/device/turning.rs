//! A whole session with a device that turns wrong in its midst.

use crate::support::{repository, study};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use study::rater::{Effect, Percepts, Rater};
use study::runner::Setup;
use study::runner::clock::{Clock as _, VirtualClock};
use study::runner::rehearsal::{first_day, run_one};
use study::runner::saver::Saving;
use study_analysis::load;
use study_device::firmware::{Wrong, WrongLoads};
use study_device::virtual_device::{Options, VirtualDevice};
use study_plan::protocol::DeviceKind;
use study_session::outcome::{
    AttemptEvent, AttemptRow, Failure, RatingRow, SelfWeighed, Status, Verdict,
};
use study_session::store::{Derived, Frozen, SeatKind, StudyFolder};

/// The results folder and the tables of a rehearsal of the study of the paper on a device that is wrong at some loads.
fn rehearsed(home: &Path, wrong: Wrong, loads: [u32; 2]) -> (PathBuf, Derived) {
    session(home, Some(WrongLoads { wrong, loads }), None)
}

/// The same, and what the motor told of itself.
fn session(
    home: &Path,
    wrong: Option<WrongLoads>,
    self_weighed: Option<SelfWeighed>,
) -> (PathBuf, Derived) {
    let loaded = load::load(Path::new(&repository("protocols/turn-signal"))).unwrap();
    let clock = VirtualClock::starting_at(first_day());
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let opened = StudyFolder::open_or_create(home, &frozen, clock.now()).unwrap();
    let folder = opened.path().to_owned();
    let mut options = Options::seeded(11);
    options.device.wrong = wrong;
    let percepts = Percepts::of(&loaded.protocol, &loaded.models);
    let protocol = Arc::new(loaded.protocol);
    let setup = Setup {
        protocol: protocol.clone(),
        orders: None,
        models: loaded.models,
        fingerprints: loaded.fingerprints,
        study: opened,
        kind: SeatKind::Simulated,
        rows: None,
        group: None,
        device_kind: DeviceKind::Simulated,
        device: Box::new(VirtualDevice::new(options)),
        deliveries: Default::default(),
        device_check: None,
        self_weighed,
        clock: Box::new(clock.clone()),
        saving: Saving::Loop,
    };
    let mut rater = Rater::new(3, 1, Effect::BuiltIn);
    run_one(setup, "SIM001", &clock, &mut rater, &percepts).unwrap();
    (
        folder.clone(),
        StudyFolder::open(&folder)
            .unwrap()
            .refresh(&protocol)
            .unwrap(),
    )
}

/// A row of attempts.csv, and not a word in the ratings.
#[test]
fn what_the_motor_told_of_itself_is_a_row() {
    let [home, without] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let weighed = SelfWeighed {
        commissioning: "20260301-090000-commission".to_owned(),
        ok: false,
        gain: Some(0.851),
        lag_ms: Some(0.26),
        apparent_kg: Some(0.7049),
        why: Some("its motor gives 85 % of the force of its commissioning".to_owned()),
    };
    let (folder, with) = session(home.path(), None, Some(weighed));
    let (_, without) = session(without.path(), None, None);
    let is_own = |row: &&AttemptRow| row.what == AttemptEvent::SelfWeighed;
    let own: Vec<&AttemptRow> = with.attempts.iter().filter(is_own).collect();
    let [own] = &own[..] else { panic!("{own:?}") };
    assert_eq!((own.trial, own.attempt, &own.model), (None, None, &None));
    assert_eq!(
        own.text,
        "gain 0.851, lag 0.3 ms, apparent mass 0.705 kg, against 20260301-090000-commission, \
         its motor gives 85 % of the force of its commissioning"
    );
    assert_eq!(with.attempts.len(), without.attempts.len() + 1);
    let answers = |derived: &Derived| -> Vec<_> {
        let rows = derived.rows.iter();
        rows.map(|row| (row.trial, row.model.clone(), row.answers.clone()))
            .collect()
    };
    assert_eq!(answers(&with), answers(&without));
    let (code, out, err) = study(&["verify", folder.to_str().unwrap()], &folder);
    assert_eq!(code, 0, "{out}{err}");
}

fn verdict(row: &RatingRow) -> Option<Verdict> {
    row.fidelity.as_ref().map(|found| found.verdict)
}

fn failed(derived: &Derived) -> Vec<&AttemptRow> {
    derived
        .attempts
        .iter()
        .filter(|a| a.failure.is_some())
        .collect()
}

fn status(folder: &Path) -> String {
    let (code, out, err) = study(&["status", folder.to_str().unwrap()], folder);
    assert_eq!(code, 0, "{out}{err}");
    out
}

/// The table of another trial instead of its own, although the two hardly differ: the
/// attempt fails, its trial comes again, and the files say so.
#[test]
fn another_table_in_the_seventh_trial_fails_the_attempt() {
    let home = tempfile::tempdir().unwrap();
    let (folder, derived) = rehearsed(home.path(), Wrong::FirstTable, [7, 7]);
    let failed = failed(&derived);
    let [failed] = &failed[..] else {
        panic!("{failed:?}");
    };
    assert_eq!(failed.trial, Some(7));
    assert_eq!(failed.failure, Some(Failure::Rendering));
    assert_eq!(failed.text, "other-table");
    assert_eq!(derived.rows.len(), 15);
    for row in &derived.rows {
        assert_eq!((row.status, verdict(row)), (Status::Ok, Some(Verdict::Ok)));
        assert_eq!(row.attempt, Some(if row.trial == 7 { 2 } else { 1 }));
        let felt = row.fidelity.as_ref().unwrap();
        assert!(felt.rendered_vaf.unwrap() > 0.99, "{row:?}");
    }
    let said = "Force of the playbacks: 15 ok, 1 fault\n";
    let status = status(&folder);
    assert!(status.contains(said), "{status}");
}

/// Half of the force: the trial is rated and marked.
#[test]
fn half_of_the_force_from_the_seventh_trial_on_marks_the_trials() {
    let home = tempfile::tempdir().unwrap();
    let (folder, derived) = rehearsed(home.path(), Wrong::HalfForce, [7, u32::MAX]);
    assert_eq!(failed(&derived).len(), 0);
    for row in &derived.rows {
        let expected = if row.trial < 7 {
            Verdict::Ok
        } else {
            Verdict::Flag
        };
        assert_eq!((row.status, verdict(row)), (Status::Ok, Some(expected)));
    }
    assert_eq!(derived.wrong_forces("SIM001"), [9, 15]);
    assert_eq!(derived.wrong_forces("SIM002"), [0, 0]);
    let said = "Force of the playbacks: 6 ok, 9 flag\n";
    let status = status(&folder);
    assert!(status.contains(said), "{status}");
}

/// A reversed force drives the handle away: the device trips before anything is judged.
#[test]
fn a_reversed_force_trips_the_device() {
    let home = tempfile::tempdir().unwrap();
    let (_, derived) = rehearsed(home.path(), Wrong::Reversed, [7, 7]);
    let failed = failed(&derived);
    let [failed] = &failed[..] else {
        panic!("{failed:?}");
    };
    assert_eq!((failed.trial, failed.attempt), (Some(7), Some(1)));
    let why = failed.failure.unwrap();
    assert!(
        matches!(why, Failure::DeviceFault | Failure::Rendering),
        "{why:?}"
    );
    for row in &derived.rows {
        assert_eq!((row.status, verdict(row)), (Status::Ok, Some(Verdict::Ok)));
    }
}
