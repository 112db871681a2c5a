//! Instructions of a servo period, for the emulator: with `-icount shift=3` one
//! instruction takes 8 ns of the timer. Prints once a second by semihosting.

#![allow(unsafe_code, reason = "semihosting is a breakpoint")]

use core::fmt::{self, Write as _};

const NS_PER_INSTRUCTION: f32 = 8.0;
const PERIODS: u32 = 4000;

/// Periods of one kind.
#[derive(Clone, Copy)]
struct Kind {
    periods: u32,
    sum: f32,
    most: f32,
}

pub(crate) struct Cost {
    kinds: [Kind; 2],
    periods: u32,
}

impl Cost {
    pub(crate) const fn new() -> Self {
        Self {
            kinds: [Kind {
                periods: 0,
                sum: 0.0,
                most: 0.0,
            }; 2],
            periods: 0,
        }
    }

    /// Adds a period with or without force.
    pub(crate) fn add(&mut self, ns: u32, playing: bool) {
        let instructions = ns as f32 / NS_PER_INSTRUCTION;
        let kind = &mut self.kinds[usize::from(playing)];
        kind.periods += 1;
        kind.sum += instructions;
        kind.most = kind.most.max(instructions);
        self.periods += 1;
        if self.periods < PERIODS {
            return;
        }
        let mut line = Line::new();
        for (name, kind) in ["without force", "with force"].iter().zip(self.kinds) {
            if kind.periods > 0 {
                let mean = kind.sum / kind.periods as f32;
                let (mean, most) = (mean as u32, kind.most as u32);
                let _ = writeln!(line, "{name}: mean {mean}, most {most} instructions");
            }
        }
        line.print();
        *self = Self::new();
    }
}

/// A text that ends with a zero.
struct Line {
    bytes: [u8; 160],
    len: usize,
}

impl Line {
    fn new() -> Self {
        Self {
            bytes: [0; 160],
            len: 0,
        }
    }

    fn print(&self) {
        // SAFETY: operation 4 of semihosting prints a text that ends with a zero.
        unsafe {
            core::arch::asm!("bkpt 0xAB", in("r0") 4, in("r1") self.bytes.as_ptr());
        }
    }
}

impl fmt::Write for Line {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        for byte in text.bytes().take(self.bytes.len() - 1 - self.len) {
            self.bytes[self.len] = byte;
            self.len += 1;
        }
        Ok(())
    }
}
