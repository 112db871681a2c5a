//! The priority of the thread that sends heartbeats: on a computer that does other things
//! it must not wait for them.

/// How a thread is scheduled.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Priority {
    /// Before all ordinary threads (`SCHED_FIFO`).
    RealTime,
    /// An ordinary thread that gets more time than others (nice).
    Raised,
    /// Like every other thread: the system permits nothing else.
    #[default]
    Usual,
}

/// Priority of [`Priority::RealTime`]: the kernel's own threads have higher ones.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
const REAL_TIME: i32 = 10;

/// Asks for the best priority that the system permits for the current thread.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
#[allow(unsafe_code, reason = "no safe crate that is used here has the call")]
pub fn raise() -> Priority {
    let parameters = libc::sched_param {
        sched_priority: REAL_TIME,
    };
    // Programs and threads that this one starts are ordinary ones.
    let policy = libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK;
    // SAFETY: the pointer is valid during the call, which only reads; 0 is this thread.
    if unsafe { libc::sched_setscheduler(0, policy, &raw const parameters) } == 0 {
        return Priority::RealTime;
    }
    raise_nice()
}

/// Asks for more time for the current thread than others get, but not before them: for a
/// user interface, without which there are no heartbeats.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub fn raise_nice() -> Priority {
    // On Linux a thread has a nice value of its own.
    match rustix::process::setpriority_process(Some(rustix::thread::gettid()), -10) {
        Ok(()) => Priority::Raised,
        Err(_) => Priority::Usual,
    }
}

/// Asks for the best priority that the system permits for the current thread: none is
/// known here.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn raise() -> Priority {
    Priority::Usual
}

/// The same for a user interface.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub fn raise_nice() -> Priority {
    Priority::Usual
}
