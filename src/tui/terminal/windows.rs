//! Console events on Windows.
//!
//! Ctrl-C, Ctrl-Break, the closing of the window, the end of the Windows session and a
//! shutdown set the same flag as a signal does on Unix, so that the session can stop the
//! device and close its journal first. After the last three Windows ends the process when
//! the handler returns, or after about five seconds: the handler does not return, and the
//! program ends by itself.
//!
//! A process that is killed leaves its console in raw mode, unlike on Unix, where handlers of
//! failures restore it: a new window is in order again.

use std::io;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;
use windows_sys::Win32::Foundation::{FALSE, TRUE};
use windows_sys::Win32::System::Console::{
    CTRL_BREAK_EVENT, CTRL_C_EVENT, CTRL_CLOSE_EVENT, CTRL_LOGOFF_EVENT, CTRL_SHUTDOWN_EVENT,
    SetConsoleCtrlHandler,
};
use windows_sys::core::BOOL;

/// The last console event, plus one; 0 for none.
static EVENT: AtomicU32 = AtomicU32::new(0);
/// Whether a session is open: without one, console events have their default effect.
static OPEN: AtomicBool = AtomicBool::new(false);

/// How long the handler of an event that ends the process waits for the program to end. Windows
/// itself waits about five seconds.
const LONGEST_WAIT: Duration = Duration::from_secs(60);

/// Console events while a terminal is open.
pub(crate) struct Signals;

impl Signals {
    #[allow(unsafe_code, reason = "the call of Windows that sets a handler")]
    pub(crate) fn register() -> io::Result<Self> {
        EVENT.store(0, Ordering::SeqCst);
        if !OPEN.swap(true, Ordering::SeqCst) {
            // SAFETY: the handler is a function of the program, so that it is there as long as
            // the process; it is removed when the session is over.
            if unsafe { SetConsoleCtrlHandler(Some(on_event), TRUE) } == FALSE {
                OPEN.store(false, Ordering::SeqCst);
                return Err(io::Error::last_os_error());
            }
        }
        Ok(Self)
    }

    /// The name of a console event that has arrived, once.
    pub(crate) fn take(&self) -> Option<&'static str> {
        name(EVENT.swap(0, Ordering::SeqCst).checked_sub(1)?)
    }

    /// Whether the program was stopped and continued since the last call: Windows does not
    /// tell.
    pub(crate) fn take_continued(&self) -> bool {
        false
    }
}

impl Drop for Signals {
    #[allow(unsafe_code, reason = "the call of Windows that removes a handler")]
    fn drop(&mut self) {
        OPEN.store(false, Ordering::SeqCst);
        // SAFETY: as in `register`. A handler that runs at this moment uses atomics only.
        unsafe { SetConsoleCtrlHandler(Some(on_event), FALSE) };
    }
}

fn name(event: u32) -> Option<&'static str> {
    Some(match event {
        CTRL_C_EVENT => "CTRL_C_EVENT",
        CTRL_BREAK_EVENT => "CTRL_BREAK_EVENT",
        CTRL_CLOSE_EVENT => "CTRL_CLOSE_EVENT",
        CTRL_LOGOFF_EVENT => "CTRL_LOGOFF_EVENT",
        CTRL_SHUTDOWN_EVENT => "CTRL_SHUTDOWN_EVENT",
        _ => return None,
    })
}

/// Runs in a thread of its own.
#[allow(unsafe_code, reason = "called by Windows")]
unsafe extern "system" fn on_event(event: u32) -> BOOL {
    if !OPEN.load(Ordering::SeqCst) || name(event).is_none() {
        return FALSE;
    }
    EVENT.store(event + 1, Ordering::SeqCst);
    if !matches!(event, CTRL_C_EVENT | CTRL_BREAK_EVENT) {
        std::thread::sleep(LONGEST_WAIT);
    }
    TRUE
}

/// Does nothing: see the head of this file.
pub(super) fn restore_on_failure(_taken: &'static AtomicBool) -> io::Result<()> {
    Ok(())
}

/// Does nothing: Windows has no job control. Ctrl-Z has paused the session.
pub(super) fn suspend() -> io::Result<()> {
    Ok(())
}

/// Never: a closed window is a console event.
pub(super) fn hung_up() -> bool {
    false
}

/// Whether the terminal can position text: every console of Windows can.
pub(super) fn positions_text() -> Result<(), String> {
    Ok(())
}

/// Does nothing: Windows has no such limit.
pub(crate) fn survive_file_size_limit() {}
