//! Encoder, motor, guard, brake and watchdog of a board. **Never run on hardware**: this is
//! a template. Check each pin, sign and number against your board before there is a motor.
//!
//! | pin | |
//! |---|---|
//! | PA9, PA10 | USART1 to the host, 460,800 baud |
//! | PA6, PA7 | encoder, TIM3 |
//! | PA8 | PWM of the motor's current, TIM1: 50 % is no current |
//! | PA5 | brake or enable of the drive: high releases it; low after reset |
//! | PA0 | guard and emergency stop: closed to ground |

use super::registers::*;
use study_wire::estimate::{Estimator, Lever};
use study_wire::predict::Motion;

pub(crate) const SERIAL: &str = "stm32f4-1";
pub(crate) const SIMULATED: bool = false;
/// TIM2 counts microseconds.
pub(crate) const TICKS_PER_S: u32 = 1_000_000;
/// Mass of the handle at the lever arm, kg: weigh it, or 0.
pub(crate) const HANDLE_KG: f64 = 0.0;

/// Angle of one count of the encoder, rad: 1024 lines, four counts each.
const RAD_PER_COUNT: f32 = core::f32::consts::TAU / 4096.0;
/// Distance of the hand from the axis.
const LEVER: Lever = Lever { arm_mm: 70.0 };
/// Position at the start, mm: move the handle to its stop before power-up, or home it.
const START_MM: f32 = 0.0;
/// Corner of the speed's low-pass, Hz.
const SPEED_HZ: f64 = 200.0;
/// Torque of the motor at 100 % of the drive's current, N·m.
const FULL_N_M: f32 = 1.0;
/// Steps of half a PWM period: 168 MHz / 2 / 4200 = 20 kHz.
const PWM_HALF: u32 = 4200;

/// 8 MHz crystal, 168 MHz.
const CLOCK_HZ: u32 = 168_000_000;
const BAUD: u32 = 460_800;

const BRAKE: u32 = 1 << 5;
const GUARD: u32 = 1 << 0;

pub(crate) struct Mechanics {
    estimator: Option<Estimator<f32>>,
    last_count: u16,
    counts: i32,
}

impl Mechanics {
    pub(crate) const fn new() -> Self {
        Self {
            estimator: None,
            last_count: 0,
            counts: 0,
        }
    }

    pub(crate) fn begin(&mut self, servo_hz: f64) {
        self.estimator = Some(Estimator::new(SPEED_HZ, servo_hz));
        self.last_count = TIM3_CNT.read() as u16;
        // The independent watchdog: 32 kHz / 4, 64 counts are 8 ms. A program that hangs
        // is reset, and the reset applies the brake and stops the PWM.
        IWDG_KR.write(0x5555);
        IWDG_PR.write(0);
        IWDG_RLR.write(64);
        IWDG_KR.write(0xCCCC);
    }

    pub(crate) fn motion(&mut self) -> Motion<f32> {
        let count = TIM3_CNT.read() as u16;
        // The difference is right across the overflow of the counter.
        self.counts += i32::from(count.wrapping_sub(self.last_count) as i16);
        self.last_count = count;
        let x_mm = START_MM + LEVER.mm(self.counts as f32 * RAD_PER_COUNT);
        match &mut self.estimator {
            Some(estimator) => estimator.step(x_mm),
            None => Motion::at_rest(x_mm),
        }
    }

    /// `force_n` is the force that the hand applies: the motor pushes the other way.
    pub(crate) fn apply(&mut self, force_n: f32) {
        let share = -LEVER.torque_n_m(force_n) / FULL_N_M;
        let half = PWM_HALF as f32;
        // `as` turns what is not a number into 0 steps from the middle.
        let steps = (share.clamp(-0.95, 0.95) * half) as i32;
        TIM1_CCR1.write((PWM_HALF as i32 + steps) as u32);
    }

    /// The brake is released only while there is force.
    pub(crate) fn playing(&mut self, range_mm: Option<[f64; 2]>) {
        GPIOA_BSRR.write(match range_mm {
            Some(_) => BRAKE,
            None => BRAKE << 16,
        });
    }

    pub(crate) fn guard_open(&self) -> bool {
        GPIOA_IDR.is_set(GUARD)
    }

    pub(crate) fn feed_watchdog(&self) {
        IWDG_KR.write(0xAAAA);
    }
}

pub(crate) fn start_clock() -> u32 {
    // Five wait states, caches on.
    FLASH_ACR.write(5 | 0b111 << 8);
    RCC_CR.set(1 << 16);
    while !RCC_CR.is_set(1 << 17) {}
    // 8 MHz / 8 · 336 / 2, from the crystal; 48 MHz for USB.
    RCC_PLLCFGR.write(8 | 336 << 6 | 1 << 22 | 7 << 24);
    RCC_CR.set(1 << 24);
    while !RCC_CR.is_set(1 << 25) {}
    // Buses at 42 and 84 MHz, then the new clock.
    RCC_CFGR.write(0b101 << 10 | 0b100 << 13 | 0b10);
    while RCC_CFGR.read() & 0b1100 != 0b1000 {}
    CLOCK_HZ
}

pub(crate) fn start_port(clock_hz: u32) {
    RCC_AHB1ENR.set(1);
    RCC_APB1ENR.set(1 << 1 | 1);
    RCC_APB2ENR.set(1 << 4 | 1);
    // PA5 output; PA6, PA7, PA8, PA9, PA10 alternate functions; pull-up at PA0.
    GPIOA_BSRR.write(BRAKE << 16);
    GPIOA_AFRL.modify(0xFF << 24, 0x22 << 24);
    GPIOA_AFRH.modify(0xFFF, 0x771);
    GPIOA_PUPDR.modify(0b11, 0b01);
    GPIOA_MODER.modify(0x3F_FC03, 0x2A_A400);
    // TIM2 counts from 84 MHz.
    TIM2_PSC.write(83);
    TIM2_ARR.write(u32::MAX);
    TIM2_EGR.write(1);
    TIM2_CR1.write(1);
    // TIM3 counts both edges of both lines.
    TIM3_CCMR1.write(0x0101);
    TIM3_SMCR.write(3);
    TIM3_ARR.write(0xFFFF);
    TIM3_CR1.write(1);
    // TIM1, channel 1: center-aligned PWM at 50 %, output on.
    TIM1_PSC.write(0);
    TIM1_ARR.write(2 * PWM_HALF);
    TIM1_CCR1.write(PWM_HALF);
    TIM1_CCMR1.write(0b110 << 4 | 1 << 3);
    TIM1_CCER.write(1);
    TIM1_EGR.write(1);
    TIM1_BDTR.write(1 << 15);
    TIM1_CR1.write(1 << 5 | 1);
    // The port is on the bus of half the clock.
    let bus_hz = clock_hz / 2;
    USART1_BRR.write((bus_hz + BAUD / 2) / BAUD);
    USART1_CR1.write(1 << 13 | 1 << 5 | 1 << 3 | 1 << 2);
}

pub(crate) fn motor_off() {
    GPIOA_BSRR.write(BRAKE << 16);
    TIM1_BDTR.write(0);
}
