//! Response times of the real binary in a pseudo-terminal: start to first frame, key to
//! "saved", memory of a session; run times of `analyze` and `rehearse`.
//!
//! Append and sync in the same folder are measured for comparison.
//! `cargo bench --bench terminal`.

#![allow(missing_docs, reason = "a bench")]
#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "a bench")]

#[path = "../tests/support/mod.rs"]
mod support;

use ::study::tui::pace::TYPED;
use std::fs;
use std::io::Write as _;
use std::path::Path;
use std::time::{Duration, Instant};
use study_base::text::ParticipantId;
use study_session::outcome::{Event, Moment};
use study_session::store::{ClaimRequest, Frozen, SeatKind, StudyFolder};
use support::player::{Did, play};
use support::{Terminal, repository, study};

const STARTS: usize = 30;
const PROCESSES: usize = 20;

fn main() {
    // `cargo test --benches` runs this too; there is nothing to test
    if !std::env::args().any(|a| a == "--bench") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    first_frame(folder.path());
    session(folder.path());
    processes(folder.path());
}

fn start(folder: &Path, id: &str) -> Terminal {
    let path = repository("protocols/turn-signal");
    let arguments = ["run", &path, "--participant", id, "--operator", "x"];
    Terminal::start(&arguments, folder, 24, 80)
}

/// Waits for a screen, reading it every 100 µs.
fn until(terminal: &Terminal, fine: impl Fn(&str) -> bool) {
    while !fine(&terminal.screen()) {
        std::thread::sleep(Duration::from_micros(100));
    }
}

fn first_frame(folder: &Path) {
    let times = (0..STARTS).map(|_| {
        let began = Instant::now();
        let terminal = start(folder, "P00");
        until(&terminal, |s| s.contains("Who takes part?"));
        began.elapsed()
    });
    show("start to first frame", times.collect());
}

fn session(folder: &Path) {
    let mut terminal = start(folder, "P01");
    let mut saved = Vec::new();
    let mut memory_kib = 0;
    loop {
        let screen = terminal.shown();
        if screen.text.contains("Enter: close") {
            break;
        }
        if screen.text.contains("Tab: comment") {
            terminal.keys("5");
            until(&terminal, |s| {
                s.contains("┃  5  ┃") && s.contains("Enter: ")
            });
            // An Enter that comes with the key before it counts as pasted.
            std::thread::sleep(2 * TYPED);
            let count = saved.len() + 1;
            let began = Instant::now();
            terminal.keys("\r");
            until(&terminal, |s| {
                s.contains(&format!("saved ✓ {count} of {count}"))
            });
            saved.push(began.elapsed());
            memory_kib = memory_kib.max(terminal.resident_kib());
        } else if play(&mut terminal, "P01", &screen) == Did::Waited {
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    show("key to `saved ✓`: three events written together", saved);
    show("append and sync of the disk, three times", disk(folder));
    show(
        "the journal's part: three events, head.json",
        journal(folder, None),
    );
    let mirror = folder.join("mirror");
    fs::create_dir(&mirror).unwrap();
    let mirrored = journal(folder, Some(&mirror));
    show("the same with a mirror on the same disk", mirrored);
    println!("{:<48} {memory_kib} KiB", "resident memory of the session");
}

fn disk(folder: &Path) -> Vec<Duration> {
    let mut file = fs::File::create(folder.join("probe")).unwrap();
    let line = [b'x'; 300];
    let times = (0..STARTS).map(|_| {
        let began = Instant::now();
        for _ in 0..3 {
            file.write_all(&line).unwrap();
            file.sync_data().unwrap();
        }
        began.elapsed()
    });
    times.collect()
}

/// The events of an answer in the journal, until they are acknowledged.
fn journal(folder: &Path, mirror: Option<&Path>) -> Vec<Duration> {
    let loaded =
        study_analysis::load::load(Path::new(&repository("protocols/turn-signal"))).unwrap();
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let at = Moment {
        wall: chrono::Local::now().fixed_offset(),
        mono_ns: 0,
    };
    let results = folder.join(if mirror.is_some() { "both" } else { "one" });
    let opened = match mirror {
        None => StudyFolder::open_or_create(&results, &frozen, at),
        Some(mirror) => StudyFolder::open_or_create_mirrored(&results, mirror, &frozen, at)
            .map(|(study, _)| study),
    };
    let request = ClaimRequest {
        participant: ParticipantId::new("P01").unwrap(),
        kind: SeatKind::Real,
        rows: None,
        plan: study_session::store::Plan::default(),
    };
    let mut claimed = opened.unwrap().claim(&request).unwrap();
    let mut journal = claimed.folder.journal().unwrap();
    let event = Event::Interrupted {
        reason: "x".repeat(150),
    };
    let times = (0..STARTS).map(|_| {
        let began = Instant::now();
        journal.append_all(&[(at, &event); 3]).unwrap();
        began.elapsed()
    });
    times.collect()
}

fn processes(folder: &Path) {
    let path = repository("protocols/turn-signal");
    let mut rehearsals = Vec::new();
    for i in 0..3 {
        let out = format!("r{i}");
        let began = Instant::now();
        let arguments = ["rehearse", &path, "--participants", "10", "--out", &out];
        assert_eq!(study(&arguments, folder).0, 0);
        rehearsals.push(began.elapsed());
    }
    show("rehearse, 10 participants, 150 trials", rehearsals);
    for (what, arguments) in [
        (
            "analyze, 150 trials, from journals to tables",
            ["analyze", "r0"],
        ),
        ("status", ["status", "r0"]),
        ("verify", ["verify", "r0"]),
    ] {
        let times = (0..PROCESSES).map(|_| {
            let began = Instant::now();
            assert_eq!(study(&arguments, folder).0, 0);
            began.elapsed()
        });
        show(what, times.collect());
    }
}

fn show(what: &str, mut times: Vec<Duration>) {
    times.sort_unstable();
    let ms = |d: Duration| d.as_secs_f64() * 1e3;
    println!(
        "{what:<48} median {:8.1} ms   max {:8.1} ms   n = {}",
        ms(times[times.len() / 2]),
        ms(times[times.len() - 1]),
        times.len()
    );
}
