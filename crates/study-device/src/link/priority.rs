//! The priority of the thread that sends heartbeats: on a computer that does other things
//! it must not wait for them.

/// How a thread is scheduled.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Priority {
    /// Before all ordinary threads (`SCHED_FIFO`, on Windows time-critical).
    RealTime,
    /// An ordinary thread that gets more time than others (nice, on Windows above normal).
    Raised,
    /// Like every other thread: the system permits nothing else.
    #[default]
    Usual,
}

/// Asks for the best priority that the system permits for the current thread.
pub fn raise() -> Priority {
    system::raise()
}

/// Asks for more time for the current thread than others get, but not before them: for a
/// user interface, without which there are no heartbeats.
pub fn raise_nice() -> Priority {
    system::raise_nice()
}

#[cfg(target_os = "linux")]
mod system {
    use super::Priority;

    /// Priority of [`Priority::RealTime`]: the kernel's own threads have higher ones.
    const REAL_TIME: i32 = 10;

    #[allow(unsafe_code, reason = "no safe crate that is used here has the call")]
    pub(super) fn raise() -> Priority {
        // Programs and threads that this one starts are ordinary ones.
        let policy = libc::SCHED_FIFO | libc::SCHED_RESET_ON_FORK;
        // The kernel's `struct sched_param`. The C library's own function does nothing in musl.
        let parameters: [libc::c_int; 1] = [REAL_TIME];
        // SAFETY: the pointer is valid during the call, which only reads; 0 is this thread.
        let set = unsafe {
            libc::syscall(
                libc::SYS_sched_setscheduler,
                0 as libc::c_long,
                libc::c_long::from(policy),
                parameters.as_ptr(),
            )
        };
        match set {
            0 => Priority::RealTime,
            _ => raise_nice(),
        }
    }

    pub(super) fn raise_nice() -> Priority {
        // On Linux a thread has a nice value of its own.
        match rustix::process::setpriority_process(Some(rustix::thread::gettid()), -10) {
            Ok(()) => Priority::Raised,
            Err(_) => Priority::Usual,
        }
    }
}

#[cfg(target_os = "macos")]
mod system {
    use super::Priority;

    #[allow(unsafe_code, reason = "no safe crate that is used here has the call")]
    pub(super) fn raise() -> Priority {
        // SAFETY: the two numbers are only read; the parameters are valid during the call.
        let set = unsafe {
            let highest = libc::sched_get_priority_max(libc::SCHED_RR);
            let mut parameters: libc::sched_param = std::mem::zeroed();
            parameters.sched_priority = highest;
            libc::pthread_setschedparam(libc::pthread_self(), libc::SCHED_RR, &raw const parameters)
        };
        match set {
            0 => Priority::RealTime,
            _ => Priority::Usual,
        }
    }

    /// Nothing: the nice value is that of the whole process.
    pub(super) fn raise_nice() -> Priority {
        Priority::Usual
    }
}

#[cfg(windows)]
mod system {
    use super::Priority;
    use windows_sys::Win32::Media::timeBeginPeriod;
    use windows_sys::Win32::System::Threading::{
        GetCurrentThread, SetThreadPriority, THREAD_PRIORITY, THREAD_PRIORITY_ABOVE_NORMAL,
        THREAD_PRIORITY_TIME_CRITICAL,
    };

    /// Before all ordinary threads, and waits as short as a millisecond: without a request
    /// they are rounded up to the next tick of 15.6 ms.
    #[allow(unsafe_code, reason = "a call of Windows")]
    pub(super) fn raise() -> Priority {
        // SAFETY: takes a number. The resolution is given back when the process ends.
        unsafe { timeBeginPeriod(1) };
        match set(THREAD_PRIORITY_TIME_CRITICAL) {
            true => Priority::RealTime,
            false => raise_nice(),
        }
    }

    pub(super) fn raise_nice() -> Priority {
        match set(THREAD_PRIORITY_ABOVE_NORMAL) {
            true => Priority::Raised,
            false => Priority::Usual,
        }
    }

    #[allow(unsafe_code, reason = "a call of Windows")]
    fn set(priority: THREAD_PRIORITY) -> bool {
        // SAFETY: the handle of the current thread is always valid, and a number is set.
        unsafe { SetThreadPriority(GetCurrentThread(), priority) != 0 }
    }
}

#[cfg(not(any(target_os = "linux", target_os = "macos", windows)))]
mod system {
    use super::Priority;

    pub(super) fn raise() -> Priority {
        Priority::Usual
    }

    pub(super) fn raise_nice() -> Priority {
        Priority::Usual
    }
}
