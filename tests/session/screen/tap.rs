//! How long it takes from a tap to "Saved.", beside the disk's own sync. Measured, not part of
//! the suite: `cargo test --release --test session -- --ignored tap --nocapture`.

use super::*;

/// Taps that are measured.
const TAPS: usize = 200;

/// The 99th percentile.
fn p99(times: &mut [Duration]) -> Duration {
    times.sort();
    times[times.len() * 99 / 100]
}

#[test]
#[ignore = "measures the machine"]
fn from_tap_to_saved_in_less_than_50_ms_more_than_the_sync() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("questions");
    let asked: String = (0..TAPS)
        .map(|n| {
            format!(
                "[[intake]]\nid = \"q{n}\"\nkind = \"rating\"\nprompt = \"How?\"\nfrom = 1\nto = 7\n\n"
            )
        })
        .collect();
    let with_intake = format!("{asked}[analysis]\n");
    let changes = [PATIENT, ("[analysis]\n", with_intake.as_str())];
    changed_protocol("turn-signal", &protocol, &changes);
    let mut session = Session::opened(folder.path(), &protocol, &[]);
    let browser = &mut session.browser;
    let mut taps = Vec::new();
    while taps.len() < TAPS {
        let page = browser.play("a question", |p| {
            let id = p["questions"][0]["id"].as_str().unwrap_or_default();
            id.starts_with('q')
        });
        let answer = json!({"answers": answers(&page)});
        let reply = browser.reply(&page, "answer", answer);
        let begin = Instant::now();
        if browser.post("/reply", &reply).status == 200 {
            taps.push(begin.elapsed());
        }
    }
    // The same disk, what an answer needs there: a line is appended, a new head takes the
    // place of the old one.
    let place = folder.path().join("syncs");
    fs::create_dir(&place).unwrap();
    let mut journal = fs::File::create(place.join("journal")).unwrap();
    let mut syncs: Vec<Duration> = (0..TAPS)
        .map(|_| {
            let begin = Instant::now();
            journal.write_all(&[b'x'; 400]).unwrap();
            journal.sync_data().unwrap();
            let mut head = fs::File::create(place.join("new")).unwrap();
            head.write_all(&[b'x'; 100]).unwrap();
            head.sync_data().unwrap();
            fs::rename(place.join("new"), place.join("head")).unwrap();
            fs::File::open(&place).unwrap().sync_all().unwrap();
            begin.elapsed()
        })
        .collect();
    let (tap, sync) = (p99(&mut taps), p99(&mut syncs));
    let resident = resident_kb(session.child.id());
    println!("p99 of {TAPS} taps: {tap:?}, of its syncs: {sync:?}; resident: {resident} kB");
    assert!(tap < sync + Duration::from_millis(50), "{tap:?} {sync:?}");
    assert!(resident < 30_000, "{resident} kB");
}

/// Memory of a process, kB; 0 where the system does not tell.
pub(super) fn resident_kb(process: u32) -> u64 {
    let status = fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmRSS:"));
    let number = line.and_then(|l| l.split_whitespace().next());
    number.and_then(|n| n.parse().ok()).unwrap_or(0)
}
