//! A playback device on an STM32F405 or F407 (Cortex-M4F, 168 MHz): servo at 4 kHz in
//! single precision, serial port USART1 at 460,800 baud.
//!
//! `plant.rs` has a simulated handle with a hand in place of encoder and motor: with it
//! the image runs in an emulator (`firmware/emulate`), and all clauses of `study device
//! check` pass there. With the feature `hardware`, `hardware.rs` takes its place: clock
//! tree, encoder, PWM, guard, brake and watchdog. **That part has never run on hardware**;
//! it is a template for the board of a lab.

#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(all(target_os = "none", feature = "cost"))]
mod cost;
#[cfg(target_os = "none")]
#[cfg_attr(feature = "hardware", path = "hardware.rs")]
#[cfg_attr(not(feature = "hardware"), path = "plant.rs")]
mod mechanics;
#[cfg(target_os = "none")]
mod processor;
#[cfg(target_os = "none")]
mod registers;

#[cfg(target_os = "none")]
mod firmware {
    use super::mechanics::{self, Mechanics};
    use super::processor;
    use study_firmware::{Board, Priority, period};
    use study_wire::handler::{Bounds, Drive, Handler, Measured, Profile};
    use study_wire::message::{Features, Flags, Name};
    use study_wire::servo::ServoSettings;

    /// Servo periods per millisecond.
    const PERIODS_PER_MS: u32 = 4;

    /// What this device is. A lab enters its own numbers here.
    const PROFILE: Profile = Profile {
        firmware: Name::new(concat!("study stm32f4 ", env!("CARGO_PKG_VERSION"))),
        serial: Name::new(mechanics::SERIAL),
        flags: Flags {
            force_sensor: false,
            simulated: mechanics::SIMULATED,
            telemetry: true,
            probe: false,
        },
        features: Features {
            acceleration_from_speed: true,
            mechanism: true,
            elements: true,
            fade: true,
        },
        watchdog_ms: 30,
        longest_ms: 600_000,
        telemetry_hz: 1000.0,
        bounds: Bounds {
            force_n: 15.0,
            velocity_mm_s: 1000.0,
            stiffness_n_per_mm: 25.0,
            damping_n_s_per_mm: 0.2,
            stroke_mm: [-20.0, 60.0],
        },
        servo: ServoSettings {
            servo_hz: 1000.0 * PERIODS_PER_MS as f64,
            least_mass_kg: -mechanics::HANDLE_KG,
            ..ServoSettings::new()
        },
        rest_mm_s: 5.0,
        rest_s: 0.05,
    };

    /// Tables of up to 512 nodes: 20 KiB of memory.
    pub(super) type Device = Handler<512, 0, f32>;

    /// Everything that the servo's interrupt owns.
    pub(super) struct Servo {
        device: Device,
        board: Hardware,
    }

    struct Hardware {
        /// Servo periods since power-up.
        periods: u32,
        mechanics: Mechanics,
    }

    impl Servo {
        pub(super) const fn new() -> Self {
            Self {
                device: Handler::new(PROFILE),
                board: Hardware {
                    periods: 0,
                    mechanics: Mechanics::new(),
                },
            }
        }

        /// Before the first period.
        pub(super) fn begin(&mut self) {
            self.board.mechanics.begin(PROFILE.servo.servo_hz);
        }

        /// The timer's interrupt; whether there is force.
        pub(super) fn period(&mut self) -> bool {
            self.board.periods = self.board.periods.wrapping_add(1);
            period(&mut self.device, &mut self.board);
            let playing = self.device.state().applies_force();
            let range_mm = self.device.range_mm().filter(|_| playing);
            self.board.mechanics.playing(range_mm);
            playing
        }
    }

    impl Board<f32> for Hardware {
        fn clock_ms(&self) -> u32 {
            self.periods / PERIODS_PER_MS
        }

        fn received(&mut self, buffer: &mut [u8]) -> usize {
            processor::RECEIVED.pop_into(buffer)
        }

        fn send(&mut self, frame: &[u8], priority: Priority) {
            // A frame that does not fit is lost, as on the wire.
            processor::TO_SEND.push_frame(frame, priority);
        }

        fn measure(&mut self) -> Measured<f32> {
            Measured {
                motion: self.mechanics.motion(),
                force_n: None,
            }
        }

        fn drive(&mut self, drive: Drive<f32>) {
            match drive {
                Drive::Force(force_n) => self.mechanics.apply(force_n),
                // Only with a probe.
                Drive::Position { .. } => self.mechanics.apply(0.0),
            }
        }

        fn overrun(&mut self) -> bool {
            processor::missed_a_period()
        }

        fn guard_open(&mut self) -> bool {
            self.mechanics.guard_open()
        }

        fn feed_watchdog(&mut self) {
            self.mechanics.feed_watchdog();
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    // Built with the rest of the workspace, so that it always compiles; it runs on a
    // processor only: cargo build -p study-firmware --example stm32f4 --release
    // --target thumbv7em-none-eabihf
}
