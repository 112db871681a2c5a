//! The disk of the results.

use super::finding::{About, Finding, Fit, Use, ms, size};
use super::{Disk, FileSystem, Spread};
use study_session::store::{Broken, LEAST_FREE_BYTES};

/// What an hour of playback with telemetry at 1 kHz takes, bytes: 40 bytes a sample.
const HOUR_BYTES: u64 = 140 << 20;
/// A page that waits longer for "saved" is noticed, ms.
const NOTICED_MS: f64 = 200.0;
/// One that waits longer stops the participant after every answer, ms.
const STOPS_MS: f64 = 2000.0;
/// No medium confirms a record faster, ms: what is faster has not waited for it.
const TOO_FAST_MS: f64 = 0.01;

/// File systems in memory.
const MEMORY: [&str; 2] = ["tmpfs", "ramfs"];
/// File systems of another computer, or of the one around a virtual machine.
const NETWORK: [&str; 16] = [
    "nfs",
    "nfs4",
    "cifs",
    "smb2",
    "smb3",
    "smbfs",
    "9p",
    "afs",
    "ceph",
    "lustre",
    "gpfs",
    "beegfs",
    "glusterfs",
    "virtiofs",
    "vboxsf",
    "davfs",
];
/// File systems that may lose names when power fails.
const SIMPLE: [&str; 5] = ["vfat", "msdos", "exfat", "fat", "fat32"];

/// How far a file system can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Trust {
    /// Nothing outlives a restart.
    Memory,
    /// Another computer has the data.
    Network,
    /// Names can get lost.
    Simple,
    /// A program has it.
    Program,
    /// Mounted so that a sync does not wait.
    Unsynced,
    /// Nothing speaks against it.
    Usual,
}

fn trust(system: &FileSystem) -> Trust {
    let name = system.name.to_lowercase();
    let inner = name.strip_prefix("fuse.").unwrap_or(&name);
    let unsynced = ["nobarrier", "barrier=0", "sync=disabled"];
    if system.in_memory || MEMORY.contains(&name.as_str()) {
        Trust::Memory
    } else if system.remote || NETWORK.contains(&inner) || inner == "sshfs" {
        Trust::Network
    } else if SIMPLE.contains(&inner) {
        Trust::Simple
    } else if name.starts_with("fuse") {
        Trust::Program
    } else if (system.options.iter()).any(|o| unsynced.contains(&o.as_str())) {
        Trust::Unsynced
    } else {
        Trust::Usual
    }
}

/// Everything about the disk.
pub(super) fn judge(disk: &Disk) -> Vec<Finding> {
    let mut findings = Vec::new();
    if let Some(why) = &disk.failure {
        let says = format!("Nothing can be saved in {}: {why}.", disk.folder);
        findings.push(
            finding("folder", &Use::ALL, Fit::NotFit, says).advice(
                "Use another folder (`study run --results DIR`), or correct what is named.",
            ),
        );
    }
    if let Some(s) = disk.hung_s {
        let says = format!(
            "The disk of {} did not answer for {s:.0} s, so that the measurement was given up.",
            disk.folder
        );
        findings.push(
            finding("hung", &Use::ALL, Fit::NotFit, says)
                .advice("Use another disk; a network file system may have lost its connection."),
        );
    }
    findings.extend(disk.broken.iter().map(|broken| word(*broken)));
    findings.extend(disk.file_system.as_ref().map(file_system));
    findings.extend(disk.free_bytes.map(free));
    findings.extend(disk.record.map(saving));
    let in_memory = (disk.file_system.as_ref()).is_some_and(|s| trust(s) == Trust::Memory);
    findings.extend(disk.journal.filter(|_| !in_memory).and_then(too_fast));
    if let Some(left) = &disk.left {
        let says = format!("Something could not be removed again: {left}.");
        findings
            .push(finding("left", &Use::ALL, Fit::WithLimits, says).advice("Remove it by hand."));
    }
    findings
}

fn finding(id: &'static str, uses: &[Use], fit: Fit, says: String) -> Finding {
    Finding::new(About::Disk, id, uses, fit, says)
}

fn word(broken: Broken) -> Finding {
    let says = format!(
        "The file system does not keep its word: {}.",
        broken.as_str()
    );
    match broken {
        Broken::Locks => finding("locks", &Use::SESSIONS, Fit::WithLimits, says).advice(
            "Start no two sessions of a participant at once, and give two computers separate `--rows`, or use a local disk.",
        ),
        Broken::Journal | Broken::Head | Broken::Names => {
            finding("word", &Use::ALL, Fit::NotFit, says).advice("Use a local disk.")
        }
    }
}

fn file_system(system: &FileSystem) -> Finding {
    let name = &system.name;
    let (fit, says, advice) = match trust(system) {
        Trust::Memory => (
            Fit::NotFit,
            format!("The folder is in memory ({name}): a restart loses everything that was saved."),
            "Use a folder on a disk.",
        ),
        Trust::Network => (
            Fit::WithLimits,
            format!(
                "The folder is on another computer ({name}): \"saved\" depends on that one and the connection, and locks may not hold between computers."
            ),
            "Save on a local disk, with `study run --mirror DIR` to this one.",
        ),
        Trust::Simple => (
            Fit::WithLimits,
            format!("The file system ({name}) has no journal: a power failure can lose files."),
            "Save on another file system, with `study run --mirror DIR` to this one.",
        ),
        Trust::Program => (
            Fit::WithLimits,
            format!(
                "The file system ({name}) is a program, and a sync is worth what it makes of it."
            ),
            "Save on a file system of the operating system.",
        ),
        Trust::Unsynced => (
            Fit::WithLimits,
            format!(
                "The file system ({name}) is mounted so that a sync does not wait for the medium ({}).",
                system.options.join(",")
            ),
            "Mount it with barriers.",
        ),
        Trust::Usual => (Fit::Fit, format!("The file system is {name}."), ""),
    };
    // A rehearsal can be repeated.
    finding("file-system", &Use::SESSIONS, fit, says).advice(advice)
}

fn free(bytes: u64) -> Finding {
    let fit = match bytes {
        b if b < LEAST_FREE_BYTES => Fit::NotFit,
        b if b < HOUR_BYTES => Fit::WithLimits,
        _ => Fit::Fit,
    };
    let says = format!(
        "{} are free; no session starts below {}, and an hour of playback with telemetry at 1 kHz takes {}.",
        size(bytes),
        size(LEAST_FREE_BYTES),
        size(HOUR_BYTES)
    );
    finding("free", &Use::ALL, fit, says).advice("Free some space.")
}

fn saving(record: Spread) -> Finding {
    let fit = match record.p99_ms {
        t if t >= STOPS_MS => Fit::NotFit,
        t if t >= NOTICED_MS || record.largest_ms >= STOPS_MS => Fit::WithLimits,
        _ => Fit::Fit,
    };
    let says = format!(
        "A record is saved within {} in half, {} in 99 % and {} in all of {} cases.",
        ms(record.median_ms),
        ms(record.p99_ms),
        ms(record.largest_ms),
        record.n
    );
    let what = match fit {
        Fit::NotFit => "A page would wait that long after every answer: use another disk.",
        _ => {
            "Pages wait noticeably for \"saved\": use a faster disk, or end what else writes to it."
        }
    };
    finding("saving", &Use::SESSIONS, fit, says).advice(what)
}

fn too_fast(journal: Spread) -> Option<Finding> {
    (journal.median_ms < TOO_FAST_MS).then(|| {
        let says = format!(
            "A sync usually takes {:.1} µs, which is faster than a medium: it does not wait for one.",
            1e3 * journal.median_ms
        );
        finding("too-fast", &Use::SESSIONS, Fit::WithLimits, says).advice(
            "A power failure can lose what was shown as saved: use another disk, or an uninterruptible supply.",
        )
    })
}
