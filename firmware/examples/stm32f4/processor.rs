//! Start, interrupts and serial port of the processor.
//!
//! The servo runs in the SysTick exception. The serial port's interrupt, which may
//! interrupt the servo, only moves bytes into [`RECEIVED`]; `main` only moves bytes from
//! [`TO_SEND`] to the port.

#![allow(unsafe_code, reason = "vectors, and what the servo's exception owns")]

use super::firmware::Servo;
use super::mechanics;
use super::registers::*;
use core::cell::UnsafeCell;
use core::panic::PanicInfo;
use core::sync::atomic::{AtomicBool, Ordering};
use study_firmware::ring::Ring;

/// Bytes from the host: several frames.
pub(crate) static RECEIVED: Ring<1024> = Ring::new();
/// Bytes for the host: telemetry of 40 ms.
pub(crate) static TO_SEND: Ring<4096> = Ring::new();

const SERVO_HZ: u32 = 4000;

/// What only the SysTick exception touches once interrupts are on.
struct Owned<T>(UnsafeCell<T>);
// SAFETY: `main` uses it before it starts SysTick, then only SysTick does, which does not
// interrupt itself.
unsafe impl<T> Sync for Owned<T> {}
static SERVO: Owned<Servo> = Owned(UnsafeCell::new(Servo::new()));
#[cfg(feature = "cost")]
static COST: Owned<super::cost::Cost> = Owned(UnsafeCell::new(super::cost::Cost::new()));

const RXNE: u32 = 1 << 5;
const TXE: u32 = 1 << 7;

core::arch::global_asm!(
    // The first vectors: stack, start, then the handlers of this file.
    ".section .vectors, \"a\"",
    ".word _stack",
    ".word start",
    ".rept 13",
    ".word stuck",
    ".endr",
    ".word systick",
    ".rept 37",
    ".word stuck",
    ".endr",
    ".word usart1",
    ".rept 44",
    ".word stuck",
    ".endr",
    ".section .text.start, \"ax\"",
    ".thumb_func",
    ".global start",
    "start:",
    // The floating-point unit on, before any code of the compiler.
    "ldr r0, =0xE000ED88",
    "ldr r1, [r0]",
    "orr r1, r1, #0xF00000",
    "str r1, [r0]",
    "dsb",
    "isb",
    "ldr r0, =_data",
    "ldr r1, =_data_end",
    "ldr r2, =_data_load",
    "1: cmp r0, r1",
    "itt lo",
    "ldrlo r3, [r2], #4",
    "strlo r3, [r0], #4",
    "blo 1b",
    "ldr r0, =_bss",
    "ldr r1, =_bss_end",
    "movs r3, #0",
    "2: cmp r0, r1",
    "it lo",
    "strlo r3, [r0], #4",
    "blo 2b",
    "bl main",
    ".thumb_func",
    // A fault of the processor: the motor's output is off after the hardware watchdog.
    "stuck: b stuck",
);

#[unsafe(no_mangle)]
extern "C" fn main() -> ! {
    let clock_hz = mechanics::start_clock();
    mechanics::start_port(clock_hz);
    // SAFETY: SysTick is not running, see `Owned`.
    unsafe { (*SERVO.0.get()).begin() };
    // The serial port may interrupt the servo, so that no byte is lost.
    SHPR3.modify(0xFF << 24, 0x80 << 24);
    NVIC_IPR9.modify(0xFF << 8, 0x40 << 8);
    NVIC_ISER1.write(1 << 5);
    SYST_RVR.write(clock_hz / SERVO_HZ - 1);
    SYST_CVR.write(0);
    // On, with the exception, from the processor's clock.
    SYST_CSR.write(0b111);
    loop {
        // In the emulator the port takes every byte at once.
        while USART1_SR.is_set(TXE) {
            let Some(byte) = TO_SEND.pop() else { break };
            USART1_DR.write(u32::from(byte));
        }
        // SAFETY: waits for the next interrupt.
        unsafe { core::arch::asm!("wfi", options(nomem, nostack)) };
    }
}

/// Whether the servo's calculation took longer than a period.
static LATE: AtomicBool = AtomicBool::new(false);

/// Whether a period was missed since the last call.
pub(crate) fn missed_a_period() -> bool {
    let late = LATE.load(Ordering::Relaxed);
    LATE.store(false, Ordering::Relaxed);
    late
}

#[unsafe(no_mangle)]
extern "C" fn systick() {
    let begin = TIM2_CNT.read();
    // SAFETY: see `Owned`.
    let _playing = unsafe { (*SERVO.0.get()).period() };
    let ticks = TIM2_CNT.read().wrapping_sub(begin);
    if ticks > mechanics::TICKS_PER_S / SERVO_HZ {
        LATE.store(true, Ordering::Relaxed);
    }
    // SAFETY: see `Owned`; only this exception uses it.
    #[cfg(feature = "cost")]
    unsafe {
        (*COST.0.get()).add(ticks, _playing)
    };
}

#[unsafe(no_mangle)]
extern "C" fn usart1() {
    while USART1_SR.is_set(RXNE) {
        RECEIVED.push(&[USART1_DR.read() as u8]);
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    mechanics::motor_off();
    // The hardware watchdog resets the processor.
    loop {
        core::hint::spin_loop();
    }
}
