//! The servo in single precision against the one in double precision.

use study_base::rng::Stream;
use study_haptics::model::{Elements, Realization};
use study_haptics::plant::{Hand, HandParameters};
use study_wire::elements::{ElementsView, MAX_SPRINGS};
use study_wire::predict::{BranchView, Motion, TableView};
use study_wire::servo::{Law, Rendering, Servo, ServoSettings, ServoState};

/// Largest difference that is allowed, N.
const MOST_N: f64 = 1e-3;

/// A table in single precision.
struct Single {
    x_mm: Vec<f32>,
    parameters: Vec<Vec<f32>>,
}

impl Single {
    fn of(table: &TableView<'_>) -> Self {
        let single = |values: &[f64]| values.iter().map(|value| *value as f32).collect();
        let of = |branch: &BranchView<'_>| {
            [
                branch.m_kg,
                branch.b_n_s_per_mm,
                branch.k_n_per_mm,
                branch.f0_n,
            ]
            .map(single)
        };
        Self {
            x_mm: single(table.x_mm),
            parameters: [of(&table.positive), of(&table.negative)].concat(),
        }
    }

    fn of_elements(own: &Elements) -> Self {
        let single = |values: &Vec<f64>| values.iter().map(|value| *value as f32).collect();
        let [forwards, backwards] = &own.damping_n_s_per_mm;
        let profiles = [&own.force_n, forwards, backwards];
        Self {
            x_mm: single(&own.x_mm),
            parameters: (profiles.into_iter().chain(&own.spring_n))
                .map(single)
                .collect(),
        }
    }

    fn elements<'a>(&'a self, own: &'a Elements) -> ElementsView<'a, f32> {
        let mut spring_n: [&[f32]; MAX_SPRINGS] = [&[]; MAX_SPRINGS];
        for (slice, profile) in spring_n.iter_mut().zip(&self.parameters[3..]) {
            *slice = profile;
        }
        ElementsView {
            x_mm: &self.x_mm,
            mass_kg: own.mass_kg as f32,
            force_n: &self.parameters[0],
            damping_n_s_per_mm: [&self.parameters[1], &self.parameters[2]],
            springs: &own.springs,
            spring_n,
        }
    }

    fn branch(&self, first: usize) -> BranchView<'_, f32> {
        BranchView {
            m_kg: &self.parameters[first],
            b_n_s_per_mm: &self.parameters[first + 1],
            k_n_per_mm: &self.parameters[first + 2],
            f0_n: &self.parameters[first + 3],
        }
    }
}

/// Largest difference of the forces of both servos, N, while a hand of this vigour plays
/// the table for half a minute against the force in double precision.
fn difference_n(realization: &Realization, seed: u64, servo_hz: f64) -> f64 {
    let hand = HandParameters::default();
    let settings = ServoSettings {
        servo_hz,
        force_n: 12.0,
        least_mass_kg: -hand.slider_kg,
        ..ServoSettings::default()
    };
    let (table, rule) = (realization.table(), realization.direction);
    let copy = Single::of(&table);
    // The damping of the wall sets in at once at an edge, which both have at the same place.
    let range_mm = (realization.trained.x_mm).map(|x_mm| f64::from(x_mm as f32));
    let mechanism = realization.mechanism.as_ref().map(|own| own.view());
    let elements = realization.elements.as_ref();
    let narrow = elements.map(Single::of_elements);
    let double = Rendering {
        law: match (&mechanism, elements) {
            (Some(view), _) => Law::Mechanism(*view),
            (None, Some(own)) => Law::Elements(own.view()),
            (None, None) => Law::Table { table, rule },
        },
        range_mm,
        trained_mm_s: realization.trained.v_mm_s,
    };
    let single = Rendering {
        law: match (&mechanism, elements.zip(narrow.as_ref())) {
            (Some(view), _) => Law::Mechanism(view.of()),
            (None, Some((own, narrow))) => Law::Elements(narrow.elements(own)),
            (None, None) => Law::Table {
                table: TableView {
                    x_mm: &copy.x_mm,
                    positive: copy.branch(0),
                    negative: copy.branch(4),
                    lookup: table.lookup,
                },
                rule,
            },
        },
        range_mm,
        trained_mm_s: double.trained_mm_s,
    };
    let mut servos = (Servo::<f64>::new(settings), Servo::<f32>::new(settings));
    servos.0.start();
    servos.1.start();
    let [low, high] = range_mm;
    let margin = (0.1 * (high - low)).min(1.5);
    let ends = [low + margin, high - margin];
    let mut hand = Hand::new(hand, ends, Stream::new(seed, &["precision"]));
    let mut worst_n = 0.0_f64;
    let mut force_n = 0.0;
    for _ in 0..(30.0 * servo_hz) as usize {
        // What an encoder of 1 µm reads: both see the same single-precision numbers.
        let motion = hand.step(force_n, 1.0 / servo_hz);
        let [x, v, a] = [motion.x_mm, motion.v_mm_s, motion.a_m_s2]
            .map(|value| ((value * 1e3).round() / 1e3) as f32);
        force_n = servos.0.step(
            &double,
            Motion {
                x_mm: f64::from(x),
                v_mm_s: f64::from(v),
                a_m_s2: f64::from(a),
            },
        );
        let other_n = servos.1.step(
            &single,
            Motion {
                x_mm: x,
                v_mm_s: v,
                a_m_s2: a,
            },
        );
        assert_eq!(servos.0.state(), ServoState::Playing);
        assert_eq!(servos.1.state(), ServoState::Playing);
        worst_n = worst_n.max((f64::from(other_n) - force_n).abs());
    }
    let (double, single) = (servos.0.tally(), servos.1.tally());
    assert!(double.peak_force_n > 1.0, "nothing was felt: {double:?}");
    assert_eq!(double.strokes, single.strokes);
    assert!(
        (double.energy_j - single.energy_j).abs() < 1e-4,
        "{double:?} {single:?}"
    );
    worst_n
}

/// A floor or nearest look-up jumps at a node. There both precisions may be one period
/// apart, which the shipped tables, with the same single-precision positions, never are.
#[test]
fn single_precision_renders_every_shipped_realization_within_1_mn() {
    let mut worst = (0.0, String::new());
    let keyboard = super::shipped::of_protocol("keyboard");
    for (name, realization) in super::shipped::shipped().into_iter().chain(keyboard) {
        let rates_hz = [4000.0, 1000.0, 10_000.0, 10_000.0];
        // A mechanism's follower multiplies roundings where it snaps, in some motions 1,000-fold.
        let motions = if realization.mechanism.is_some() {
            24
        } else {
            3
        };
        for (seed, servo_hz) in (1..=motions).zip(rates_hz.into_iter().cycle()) {
            let error_n = difference_n(&realization, seed, servo_hz);
            assert!(
                error_n < MOST_N,
                "{name} at {servo_hz} Hz, motion {seed}: {error_n} N"
            );
            if error_n > worst.0 {
                worst = (error_n, format!("{name} at {servo_hz} Hz, motion {seed}"));
            }
        }
    }
    eprintln!("largest difference {:.4} mN: {}", 1e3 * worst.0, worst.1);
}

#[test]
fn single_precision_renders_elements_within_1_mn() {
    let (realization, mut worst_n) = (crate::tables::elements(), 0.0_f64);
    assert!(
        realization.certificate().passes(),
        "{}",
        realization.certificate()
    );
    for (seed, servo_hz) in (1..=12).zip([4000.0, 1000.0, 10_000.0].into_iter().cycle()) {
        let error_n = difference_n(&realization, seed, servo_hz);
        assert!(
            error_n < MOST_N,
            "at {servo_hz} Hz, motion {seed}: {error_n} N"
        );
        worst_n = worst_n.max(error_n);
    }
    eprintln!("largest difference {:.4} mN", 1e3 * worst_n);
}
