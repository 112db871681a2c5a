//! What Windows tells of itself.

use crate::doctor::FileSystem;
use std::os::windows::ffi::OsStrExt as _;
use std::path::Path;
use std::time::Duration;
use windows_sys::Win32::Foundation::FILETIME;
use windows_sys::Win32::Storage::FileSystem::{
    GetDriveTypeW, GetVolumeInformationW, GetVolumePathNameW,
};
use windows_sys::Win32::System::Threading::GetSystemTimes;

/// Longest path, with the zero at its end.
const LONGEST: usize = 1024;
/// What `GetDriveTypeW` says of a network and of memory (DRIVE_REMOTE, DRIVE_RAMDISK).
const REMOTE: u32 = 4;
const IN_MEMORY: u32 = 6;
/// How long the processors are watched.
const WATCHED: Duration = Duration::from_millis(300);

/// Windows limits no priority in this way.
pub(super) fn permitted_priority() -> Option<u64> {
    None
}

/// How many processors were busy in a short time.
pub(super) fn busy_processors() -> Option<f64> {
    let [idle, all] = processor_times()?;
    std::thread::sleep(WATCHED);
    let [idle_later, all_later] = processor_times()?;
    let (idle, all) = (idle_later.checked_sub(idle)?, all_later.checked_sub(all)?);
    let processors = std::thread::available_parallelism().ok()?.get() as f64;
    (all > 0).then(|| processors * (1.0 - idle as f64 / all as f64).clamp(0.0, 1.0))
}

/// Idle time and all time of all processors.
#[allow(unsafe_code, reason = "a call of Windows")]
fn processor_times() -> Option<[u64; 2]> {
    let zero = FILETIME {
        dwLowDateTime: 0,
        dwHighDateTime: 0,
    };
    let (mut idle, mut kernel, mut user) = (zero, zero, zero);
    // SAFETY: the three numbers are written during the call.
    let done = unsafe { GetSystemTimes(&raw mut idle, &raw mut kernel, &raw mut user) };
    let number =
        |time: FILETIME| u64::from(time.dwHighDateTime) << 32 | u64::from(time.dwLowDateTime);
    // The time of the kernel contains that of idle processors.
    (done != 0).then(|| [number(idle), number(kernel) + number(user)])
}

/// The file system of a folder.
#[allow(unsafe_code, reason = "calls of Windows")]
pub(super) fn file_system(folder: &Path) -> Option<FileSystem> {
    let real = std::path::absolute(folder).ok()?;
    let wide: Vec<u16> = real.as_os_str().encode_wide().chain([0]).collect();
    let mut volume = [0u16; LONGEST];
    // SAFETY: the path ends with a zero, and the buffer is as long as is said.
    let found = unsafe { GetVolumePathNameW(wide.as_ptr(), volume.as_mut_ptr(), LONGEST as u32) };
    if found == 0 {
        return None;
    }
    let mut name = [0u16; 64];
    // SAFETY: the name of the volume ends with a zero, the buffer is as long as is said, and what
    // is not asked for may be null.
    let known = unsafe {
        GetVolumeInformationW(
            volume.as_ptr(),
            std::ptr::null_mut(),
            0,
            std::ptr::null_mut(),
            std::ptr::null_mut(),
            std::ptr::null_mut(),
            name.as_mut_ptr(),
            name.len() as u32,
        )
    };
    if known == 0 {
        return None;
    }
    // SAFETY: the name of the volume ends with a zero.
    let drive = unsafe { GetDriveTypeW(volume.as_ptr()) };
    let end = name.iter().position(|c| *c == 0).unwrap_or(name.len());
    Some(FileSystem {
        name: String::from_utf16_lossy(&name[..end]),
        options: Vec::new(),
        remote: drive == REMOTE,
        in_memory: drive == IN_MEMORY,
    })
}

/// Whether the console understands the sequences that position text.
pub(super) fn positions_text() -> bool {
    crossterm::ansi_support::supports_ansi()
}

/// A console of Windows is given UTF-16, whatever the environment says.
pub(super) fn shows_utf8(_var: impl Fn(&str) -> Option<String>) -> Option<bool> {
    None
}

/// Windows tells no latency timer of a port.
pub(super) fn adapter_latency_ms(_port: &str) -> Option<f64> {
    None
}
