//! What Unix, above all Linux, tells of itself.

use crate::doctor::FileSystem;
use std::path::{Path, PathBuf};

/// The largest real-time priority that this user may have; `None` where that is not limited in
/// this way.
#[cfg(target_os = "linux")]
pub(super) fn permitted_priority() -> Option<u64> {
    use rustix::process::{Resource, getrlimit};
    // Without a limit every priority is permitted, of which 99 is the highest.
    Some(getrlimit(Resource::Rtprio).current.unwrap_or(99))
}

/// The same.
#[cfg(not(target_os = "linux"))]
pub(super) fn permitted_priority() -> Option<u64> {
    None
}

/// How many processors were busy in the last minute (its load), where the system has a file for
/// it.
pub(super) fn busy_processors() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/loadavg").ok()?;
    let load: f64 = text.split_whitespace().next()?.parse().ok()?;
    load.is_finite().then_some(load)
}

/// The file system of a folder, from the table of mounts of Linux.
pub(super) fn file_system(folder: &Path) -> Option<FileSystem> {
    let real = folder.canonicalize().ok()?;
    let table = std::fs::read_to_string("/proc/self/mountinfo").ok()?;
    mounted(&table, &real)
}

/// The file system of a path in a table of mounts (proc_pid_mountinfo(5)): the last one of those
/// with the longest way.
fn mounted(table: &str, path: &Path) -> Option<FileSystem> {
    let mut found: Option<(usize, FileSystem)> = None;
    for line in table.lines() {
        let Some((own, source)) = line.split_once(" - ") else {
            continue;
        };
        let mut own = own.split(' ').skip(4);
        let (Some(at), Some(options)) = (own.next(), own.next()) else {
            continue;
        };
        let at = unescaped(at);
        let depth = at.components().count();
        if !path.starts_with(&at) || found.as_ref().is_some_and(|(best, _)| *best > depth) {
            continue;
        }
        let mut source = source.split(' ');
        let (Some(name), further) = (source.next(), source.nth(1)) else {
            continue;
        };
        let all = options
            .split(',')
            .chain(further.unwrap_or_default().split(','));
        let mut options: Vec<String> = Vec::new();
        for option in all.filter(|option| !option.is_empty()) {
            if !options.iter().any(|known| known == option) {
                options.push(option.to_owned());
            }
        }
        let system = FileSystem {
            name: name.to_owned(),
            options,
            ..FileSystem::default()
        };
        found = Some((depth, system));
    }
    found.map(|(_, system)| system)
}

/// A path in which space, tab, line end and backslash are octal numbers.
fn unescaped(text: &str) -> PathBuf {
    let mut out = text.to_owned();
    for (octal, plain) in [
        ("\\040", " "),
        ("\\011", "\t"),
        ("\\012", "\n"),
        ("\\134", "\\"),
    ] {
        out = out.replace(octal, plain);
    }
    out.into()
}

/// Whether the terminal can position text.
pub(super) fn positions_text() -> bool {
    let term = std::env::var("TERM").unwrap_or_default();
    !term.is_empty() && term != "dumb"
}

/// Whether the environment says that characters are UTF-8: the first of these variables that is
/// set decides.
pub(super) fn shows_utf8(var: impl Fn(&str) -> Option<String>) -> Option<bool> {
    let set = |name| var(name).filter(|value: &String| !value.is_empty());
    let locale = ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().find_map(set);
    let name = locale.unwrap_or_default().to_lowercase().replace('-', "");
    Some(name.contains("utf8"))
}

/// The latency timer of the USB adapter of a port, ms, if the system tells one.
pub(super) fn adapter_latency_ms(port: &str) -> Option<f64> {
    // A port may be named by a link, such as those of /dev/serial/by-id.
    let real = Path::new(port).canonicalize().ok()?;
    let name = real.file_name()?.to_str()?;
    let file = Path::new("/sys/bus/usb-serial/devices")
        .join(name)
        .join("latency_timer");
    let text = std::fs::read_to_string(file).ok()?;
    let ms: f64 = text.trim().parse().ok()?;
    ms.is_finite().then_some(ms)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TABLE: &str = "\
22 1 254:0 / / rw,relatime shared:1 - ext4 /dev/vda rw,barrier=0
23 22 0:21 / /proc rw,nosuid - proc proc rw
30 22 0:40 / /home rw,noatime shared:7 master:2 - nfs4 server:/home rw,vers=4.2
31 30 0:41 / /home/my\\040data rw - tmpfs tmpfs rw,size=1k
";

    #[test]
    fn the_innermost_mount_has_a_folder() {
        let of = |path: &str| mounted(TABLE, Path::new(path)).unwrap();
        assert_eq!(of("/srv").name, "ext4");
        assert_eq!(of("/srv").options, ["rw", "relatime", "barrier=0"]);
        assert_eq!(of("/home/ann").name, "nfs4");
        assert_eq!(of("/homes").name, "ext4", "a name that begins like another");
        assert_eq!(of("/home/my data/x").name, "tmpfs");
        assert_eq!(mounted("nonsense\n1 2 - x\n", Path::new("/")), None);
    }

    #[test]
    fn the_first_variable_of_the_locale_decides() {
        let of = |all: &[(&str, &str)]| {
            let found = |name: &str| all.iter().find(|(n, _)| *n == name);
            shows_utf8(|name| found(name).map(|(_, value)| (*value).to_owned())).unwrap()
        };
        assert!(of(&[("LANG", "de_DE.UTF-8")]));
        assert!(of(&[("LC_CTYPE", "C.utf8"), ("LANG", "C")]));
        assert!(of(&[("LC_ALL", ""), ("LANG", "en_US.UTF-8")]));
        assert!(!of(&[("LC_ALL", "C"), ("LANG", "de_DE.UTF-8")]));
        assert!(!of(&[]));
    }

    #[test]
    fn a_port_without_a_timer_tells_none() {
        assert_eq!(adapter_latency_ms("tcp://127.0.0.1:5000"), None);
        assert_eq!(adapter_latency_ms("/dev/null"), None);
    }
}
