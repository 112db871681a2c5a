//! The C interface of `study-wire`: `include/study_device.h` describes it.
//!
//! A device lives in memory of the caller, so that the library needs no allocator. Every
//! function does nothing, or reports zero force, for a null pointer and for memory that
//! [`study_device_init`] has not initialized.

#![cfg_attr(target_os = "none", no_std)]
#![allow(unsafe_code, reason = "a C interface takes pointers")]

mod settings;

pub use settings::{StudyMotion, StudySettings};

use core::ffi::c_void;
use study_wire::handler::{Drive, Handler, Measured};
use study_wire::message::Fault;
use study_wire::predict::Motion;
use study_wire::real::Real;

/// The precision of the servo.
#[cfg(not(feature = "single"))]
pub type Number = f64;
/// The precision of the servo.
#[cfg(feature = "single")]
pub type Number = f32;

/// Largest number of nodes of a table; `STUDY_NODES` in the header.
pub const NODES: usize = 512;

/// Receives each frame for the host; `stream` is 1 for TELEMETRY and EVENT, which a full
/// queue drops first, and 0 for a reply.
pub type StudySend =
    Option<unsafe extern "C" fn(context: *mut c_void, frame: *const u8, len: usize, stream: i32)>;

/// A device in memory of the caller.
#[repr(C, align(8))]
pub struct StudyDevice {
    /// [`INITIALISED`] after [`study_device_init`].
    mark: u32,
    send: StudySend,
    context: *mut c_void,
    handler: Handler<NODES, 0, Number>,
}

const INITIALISED: u32 = 0x5754_5544;

/// Bytes that a device needs; at most `STUDY_DEVICE_SIZE` of the header.
#[unsafe(no_mangle)]
pub extern "C" fn study_device_size() -> usize {
    size_of::<StudyDevice>()
}

/// `STUDY_DEVICE_SIZE` of the header.
pub const DEVICE_SIZE: usize = 45_056;
const _: () = assert!(size_of::<StudyDevice>() <= DEVICE_SIZE);

/// The device at this address, if there is one.
///
/// # Safety
/// `device` is null or points to [`DEVICE_SIZE`] bytes, aligned to 8, that nothing else
/// uses during the call.
unsafe fn at<'a>(device: *mut c_void) -> Option<&'a mut StudyDevice> {
    let device = device.cast::<StudyDevice>();
    if device.is_null() || !device.is_aligned() {
        return None;
    }
    // SAFETY: the mark is the first field; any bytes are a number.
    let mark = unsafe { (&raw const (*device).mark).read() };
    // SAFETY: only `study_device_init` writes the mark, after all other fields.
    (mark == INITIALISED).then(|| unsafe { &mut *device })
}

impl StudyDevice {
    /// Calls the handler with the function that sends.
    fn with<T>(
        &mut self,
        call: impl FnOnce(&mut Handler<NODES, 0, Number>, &mut dyn FnMut(&[u8])) -> T,
    ) -> T {
        let (send, context) = (self.send, self.context);
        call(&mut self.handler, &mut |frame| {
            if let Some(send) = send {
                let stream = i32::from(study_wire::frame::is_stream(frame));
                // SAFETY: the caller of `study_device_init` gave both for this purpose.
                unsafe { send(context, frame.as_ptr(), frame.len(), stream) };
            }
        })
    }
}

/// Makes a device in `memory` that has just been powered up; 0, or −1 for a null pointer,
/// memory that is too small or not aligned, or settings that are not valid.
///
/// # Safety
/// `memory` points to `size` bytes that nothing else uses; `settings` to valid settings
/// whose texts end with a zero. `send` may be called with `context` during every later
/// call with this memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn study_device_init(
    memory: *mut c_void,
    size: usize,
    settings: *const StudySettings,
    send: StudySend,
    context: *mut c_void,
) -> i32 {
    let device = memory.cast::<StudyDevice>();
    let fits = !device.is_null() && device.is_aligned() && size >= size_of::<StudyDevice>();
    if !fits || settings.is_null() || send.is_none() {
        return -1;
    }
    // SAFETY: not null; valid by the contract of this function.
    let Some(profile) = (unsafe { settings::profile(&*settings) }) else {
        return -1;
    };
    // SAFETY: `device` is aligned and large enough.
    unsafe {
        (&raw mut (*device).send).write(send);
        (&raw mut (*device).context).write(context);
        (&raw mut (*device).handler).write(Handler::new(profile));
        (&raw mut (*device).mark).write(INITIALISED);
    }
    0
}

/// Runs one servo period and returns the force to apply until the next, N.
///
/// # Safety
/// As for [`study_device_init`]; `motion` is null or valid. A null `motion` is a
/// measurement that failed, and trips.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn study_device_servo(
    device: *mut c_void,
    motion: *const StudyMotion,
    now_ms: u32,
) -> f64 {
    // SAFETY: by the contract of this function.
    let (Some(device), motion) = (unsafe { (at(device), motion.as_ref()) }) else {
        return 0.0;
    };
    let failed = StudyMotion {
        x_mm: f64::NAN,
        v_mm_s: f64::NAN,
        a_m_s2: f64::NAN,
        force_n: f64::NAN,
        has_force: 0,
    };
    let motion = motion.unwrap_or(&failed);
    let measured = Measured {
        motion: Motion {
            x_mm: motion.x_mm as Number,
            v_mm_s: motion.v_mm_s as Number,
            a_m_s2: motion.a_m_s2 as Number,
        },
        force_n: (motion.has_force != 0).then_some(motion.force_n as Number),
    };
    match device.with(|handler, out| handler.servo(measured, now_ms, out)) {
        Drive::Force(force_n) => force_n.f64(),
        // Only with a probe, which this interface does not have.
        Drive::Position { .. } => 0.0,
    }
}

/// Processes bytes that the serial port received.
///
/// # Safety
/// As for [`study_device_init`]; `bytes` points to `len` bytes, or `len` is 0.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn study_device_receive(
    device: *mut c_void,
    bytes: *const u8,
    len: usize,
    now_ms: u32,
) {
    // SAFETY: by the contract of this function.
    let Some(device) = (unsafe { at(device) }) else {
        return;
    };
    if bytes.is_null() || len == 0 {
        return;
    }
    // SAFETY: not null; by the contract of this function.
    let bytes = unsafe { core::slice::from_raw_parts(bytes, len) };
    device.with(|handler, out| handler.receive(bytes, now_ms, out));
}

/// Reports a missed servo period; a fault only while there is force.
///
/// # Safety
/// As for [`study_device_init`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn study_device_overrun(device: *mut c_void, now_ms: u32) {
    // SAFETY: by the contract of this function.
    if let Some(device) = unsafe { at(device) } {
        device.with(|handler, out| handler.overrun(now_ms, out));
    }
}

/// Reports an open guard, a pressed button or a fault of the drive.
///
/// # Safety
/// As for [`study_device_init`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn study_device_trip(device: *mut c_void, now_ms: u32) {
    // SAFETY: by the contract of this function.
    if let Some(device) = unsafe { at(device) } {
        device.with(|handler, out| handler.trip(Fault::External, now_ms, out));
    }
}

/// The state of docs/wire.md, chapter 5, from 0 to 7; −1 without a device.
///
/// # Safety
/// As for [`study_device_init`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn study_device_state(device: *mut c_void) -> i32 {
    // SAFETY: by the contract of this function.
    unsafe { at(device) }.map_or(-1, |device| i32::from(device.handler.state().code()))
}

/// Whether the motor may apply force: 1 or 0.
///
/// # Safety
/// As for [`study_device_init`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn study_device_applies_force(device: *mut c_void) -> i32 {
    // SAFETY: by the contract of this function.
    unsafe { at(device) }.map_or(0, |device| {
        i32::from(device.handler.state().applies_force())
    })
}

/// On a processor without an operating system, what the C program has to define for a
/// program error: it switches the motor off and does not return.
#[cfg(all(target_os = "none", not(test)))]
#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    unsafe extern "C" {
        fn study_device_panic() -> !;
    }
    // SAFETY: the program defines it.
    unsafe { study_device_panic() }
}

#[cfg(test)]
mod tests;
