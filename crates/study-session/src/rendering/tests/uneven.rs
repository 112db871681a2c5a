//! Programs whose loops do not keep their period: the right one is not accused, and a wrong one
//! is found.

use super::*;
use study_base::rng::Stream;

/// How long the turns of a loop take, ms.
#[derive(Debug, Clone, Copy)]
enum Turns {
    /// Uniform between both.
    Between(f64, f64),
    /// At least so much, and more with this mean, as where a system wakes a program late.
    AtLeast(f64, f64),
    /// The first, but one of so many takes up to the second.
    Stalls(f64, usize, f64),
}

impl Turns {
    fn next_s(self, i: usize, random: &mut Stream) -> f64 {
        let share = random.unit();
        1e-3 * match self {
            Self::Between(least, most) => least + share * (most - least),
            Self::AtLeast(least, more) => least - more * (1.0 - share).ln(),
            Self::Stalls(usual, one_of, most) if i % one_of == one_of / 2 => {
                usual + share * (most - usual)
            }
            Self::Stalls(usual, ..) => usual * (0.95 + 0.1 * share),
        }
    }
}

/// A controller that does what docs/wire.md 7 says in periods of any length, written apart from
/// the servo of this project: `gain` times the force of [`table`].
struct Loop {
    before: Option<[f64; 4]>,
    filter: [f64; 2],
    slewed_n: f64,
    sign: f64,
}

impl Loop {
    /// The sample at a time at which the handle is at a position.
    fn turn(&mut self, t_s: f64, x_mm: f64, gain: f64) -> Sample {
        let [dt_s, v_mm_s, a_m_s2] = match self.before {
            None => [1e-3, 0.0, 0.0],
            Some([then_s, then_mm, then_mm_s, _]) => {
                let dt_s = t_s - then_s;
                let part = 1.0 - (-std::f64::consts::TAU * 200.0 * dt_s).exp();
                let v = then_mm_s + part * ((x_mm - then_mm) / dt_s - then_mm_s);
                [dt_s, v, 1e-3 * (v - then_mm_s) / dt_s]
            }
        };
        self.before = Some([t_s, x_mm, v_mm_s, a_m_s2]);
        // A Butterworth filter of 20 Hz as two integrators with the trapezoidal rule.
        let g = (std::f64::consts::PI * 20.0 * dt_s).tan();
        let [one, two] = self.filter;
        let r = std::f64::consts::SQRT_2;
        let high = (a_m_s2 - (r + g) * one - two) / (1.0 + r * g + g * g);
        let band = g * high + one;
        let low = g * band + two;
        self.filter = [g * high + band, g * band + low];
        if v_mm_s != 0.0 {
            self.sign = v_mm_s.signum();
        }
        let table_n = 0.1 * low
            + 0.01 * v_mm_s.clamp(-200.0, 200.0)
            + 0.2 * (x_mm - CENTER_MM)
            + 0.5 * self.sign;
        let wanted_n = (gain * table_n + 0.002 * v_mm_s).clamp(-LIMIT_N, LIMIT_N);
        let most_n = 2000.0 * dt_s;
        self.slewed_n += (wanted_n - self.slewed_n).clamp(-most_n, most_n);
        Sample {
            t_s,
            x_mm,
            v_mm_s,
            force_command_n: self.slewed_n
                * (0.5 - 0.5 * (std::f64::consts::PI * (t_s / 0.4).min(1.0)).cos()),
            force_measured_n: None,
        }
    }
}

/// Five seconds of strokes at so many Hz.
fn played_in(turns: Turns, strokes_hz: f64, gain: f64, seed: u64) -> Vec<Sample> {
    let mut random = Stream::new(seed, &["turns"]);
    let mut program = Loop {
        before: None,
        filter: [0.0; 2],
        slewed_n: 0.0,
        sign: 1.0,
    };
    let w = std::f64::consts::TAU * strokes_hz;
    let (mut t_s, mut i, mut samples) = (0.0, 0, Vec::new());
    while t_s < 5.0 {
        let x_mm = CENTER_MM - AMPLITUDE_MM * (w * t_s).cos();
        samples.push(program.turn(t_s, x_mm, gain));
        t_s += turns.next_s(i, &mut random);
        i += 1;
    }
    samples
}

fn of_a_program(samples: &[Sample]) -> Fidelity {
    verdict(
        samples,
        |played| {
            played.numbered = false;
            played.servo.servo_hz = 1000.0;
        },
        |_| (),
    )
}

const EVEN_ENOUGH: [Turns; 6] = [
    Turns::Between(1.0, 1.0),
    Turns::Between(0.5, 1.5),
    Turns::Between(0.2, 2.2),
    Turns::AtLeast(1.0, 0.3),
    Turns::AtLeast(0.5, 0.8),
    Turns::Stalls(1.0, 400, 25.0),
];

#[test]
fn a_right_program_is_not_accused_of_its_uneven_turns() {
    for turns in EVEN_ENOUGH {
        for (seed, strokes_hz) in [0.4, 0.7, 1.0, 1.6, 2.3].into_iter().enumerate() {
            let found = of_a_program(&played_in(turns, strokes_hz, 1.0, seed as u64));
            // what follows a long turn is not judged, which may leave too little
            let unjudged = matches!(turns, Turns::AtLeast(least, _) if least < 1.0)
                && found.verdict == Verdict::TooLittle;
            assert!(
                found.verdict == Verdict::Ok || unjudged,
                "{turns:?} {strokes_hz} Hz: {found:?}"
            );
            assert!(
                found.defects.is_empty(),
                "{turns:?} {strokes_hz} Hz: {found:?}"
            );
        }
    }
}

/// Where half of the time is missing there is no verdict, and no accusation either.
#[test]
fn the_turns_that_a_program_misses_count_as_lost() {
    let busy = played_in(Turns::Stalls(1.0, 12, 20.0), 1.0, 1.0, 1);
    let found = of_a_program(&busy);
    assert_eq!(found.verdict, Verdict::TooLittle, "{found:?}");
    assert!(
        found.lost_share.is_some_and(|share| share > 0.2),
        "{found:?}"
    );
    // The same of a device that numbers its samples and says that none was lost.
    assert_eq!(verdict_of(&busy).defects.last(), Some(&Defect::Samples));
}

/// The force is predicted with the speed that a program tells, which has to be that of the position.
#[test]
fn a_speed_that_comes_late_is_found() {
    let right = played_in(Turns::Between(0.5, 1.5), 1.0, 1.0, 4);
    for (late, expected) in [(0, None), (2, None), (30, Some(Defect::Speed))] {
        let samples: Vec<Sample> = (right.iter().skip(late).zip(&right))
            .map(|(now, before)| Sample {
                v_mm_s: before.v_mm_s,
                ..*now
            })
            .collect();
        let found = of_a_program(&samples);
        let speed = found.defects.iter().find(|d| **d == Defect::Speed);
        assert_eq!(speed, expected.as_ref(), "{late}: {found:?}");
    }
}

/// A device with a clock of its own, whose state the program reads at a time that it knows to a
/// quarter of a millisecond: positions seem to tremble, and speeds do not.
#[test]
fn times_that_are_uncertain_accuse_nobody() {
    let mut random = Stream::new(5, &["times"]);
    let what = Table {
        m_kg: [0.3; 2],
        b_n_s_per_mm: [0.0; 2],
        k_n_per_mm: [0.0; 2],
        f0_n: [[0.0; 2]; 2],
        ..table()
    };
    let w = std::f64::consts::TAU * 0.7;
    let mut servo = Servo::new(ServoSettings {
        servo_hz: 1000.0,
        ..servo()
    });
    servo.start();
    let samples: Vec<Sample> = (0..6000)
        .map(|i| {
            let t_s = 1e-3 * f64::from(i);
            let x_mm = CENTER_MM - AMPLITUDE_MM * (w * t_s).cos();
            let v_mm_s = AMPLITUDE_MM * w * (w * t_s).sin();
            let a_m_s2 = 1e-3 * AMPLITUDE_MM * w * w * (w * t_s).cos();
            Sample {
                t_s: t_s + 2.5e-4 * (random.unit() - 0.5),
                x_mm,
                v_mm_s,
                force_command_n: servo.step(
                    &what.what(),
                    Motion {
                        x_mm,
                        v_mm_s,
                        a_m_s2,
                    },
                ),
                force_measured_n: None,
            }
        })
        .collect();
    let judged = |samples: &[Sample]| {
        let change = |played: &mut Played<'_>| {
            played.numbered = false;
            played.servo.servo_hz = 1000.0;
        };
        verdict_about(&what, samples, change, |_| ())
    };
    let found = judged(&samples);
    assert_eq!(found.verdict, Verdict::Ok, "{found:?}");
    let weak = forced(&samples, |s| 0.8 * s.force_command_n);
    let found = judged(&weak);
    assert_eq!(found.verdict, Verdict::Flag, "{found:?}");
}

#[test]
fn a_wrong_program_is_found_in_spite_of_its_uneven_turns() {
    for turns in EVEN_ENOUGH {
        for gain in [0.85, 1.15, -1.0] {
            let found = of_a_program(&played_in(turns, 1.0, gain, 3));
            assert!(
                matches!(found.verdict, Verdict::Flag | Verdict::Fault),
                "{turns:?} {gain}: {found:?}"
            );
        }
    }
}
