//! The search finds what it is for and nothing in healthy realizations.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use super::*;
use crate::model::{Branch, Elements, Mechanism, Profile, Provenance, Trained, Units, file};
use std::collections::BTreeMap;
use study_base::rng::Stream;
use study_wire::mechanism::Scalars;
use study_wire::predict::{Direction, Lookup};

mod adversary;

/// A switch of detents with friction, of any size: from a key of 4 mm and 0.5 N to a lever of
/// 40 mm and 9 N.
fn mechanism(draw: &mut Stream) -> Realization {
    let mut log = |low: f64, high: f64| (low.ln() + draw.unit() * (high / low).ln()).exp();
    let travel = log(4.0, 40.0);
    let force = log(0.5, 8.0);
    let friction = force * log(0.05, 0.4);
    let contact = log(8.0, 40.0) * force / travel;
    let follower_kg = 1e-3 * log(2.0, 15.0) * force;
    let gap_mm = travel * log(0.002, 0.03);
    let slip = travel * log(0.001, 0.005);
    let detents = log(1.0, 4.0).round();
    let at = |i: usize| force * (TAU * detents * i as f64 / 64.0).sin();
    let scalars = Scalars {
        handle_kg: follower_kg,
        follower_kg,
        contact_n_per_mm: contact,
        contact_n_s_per_mm: log(0.2, 0.8) * (1e-3 * follower_kg * contact).sqrt(),
        gap_mm,
        follower_n_s_per_mm: 1e-3 * force * log(0.2, 2.0),
        slip_mm: slip,
        stribeck: log(0.05, 0.5),
        stribeck_mm_s: log(2.0, 20.0),
        handle_n: 0.2 * friction,
        handle_slip_mm: slip,
        handle_n_s_per_mm: 2e-4 * force,
        offset_n: 0.0,
    };
    let mechanism = Mechanism {
        scalars,
        detent: Profile {
            first_mm: 0.0,
            step_mm: travel / 64.0,
            n: (0..=64).map(at).collect(),
        },
        friction: Profile {
            first_mm: 0.0,
            step_mm: travel,
            n: vec![friction; 2],
        },
        recorded_hz: None,
    };
    let trained = Trained {
        x_mm: [0.0, travel],
        v_mm_s: 4.0 * travel,
    };
    Realization::of_mechanism(
        "m".into(),
        Provenance::default(),
        BTreeMap::new(),
        trained,
        mechanism,
    )
}

/// A table with the detents and the friction of the mechanism.
fn table(of: &Realization, direction: Direction) -> Realization {
    let own = of.mechanism.as_ref().unwrap();
    let branch = |sign: f64| Branch {
        m_kg: vec![2.0 * own.scalars.handle_kg; of.x_mm.len()],
        b_n_s_per_mm: vec![own.scalars.follower_n_s_per_mm; of.x_mm.len()],
        k_n_per_mm: vec![0.0; of.x_mm.len()],
        f0_n: (of.x_mm.iter())
            .map(|x| own.detent.view().spline_n(*x) + sign * own.friction.n[0])
            .collect(),
    };
    Realization {
        mechanism: None,
        elements: None,
        direction,
        lookup: Lookup::Linear,
        units: Units::Linear,
        positive: branch(1.0),
        negative: branch(-1.0),
        ..of.clone()
    }
}

/// A realization of elements of any size: a potential that rises, friction, a branch that relaxes
/// and a latch.
fn elements(draw: &mut Stream) -> Realization {
    let mut log = |low: f64, high: f64| (low.ln() + draw.unit() * (high / low).ln()).exp();
    let travel = log(4.0, 40.0);
    let force = log(0.5, 8.0);
    let relaxation_s = log(0.002, 0.008);
    let rearm_mm = travel * log(0.3, 0.5);
    let (friction, relaxes, breaks) = (
        force * log(0.05, 0.3),
        force * log(0.1, 0.5),
        force * log(0.1, 0.5),
    );
    let damping = 1e-3 * force * log(0.1, 1.0);
    let wave = log(0.01, 0.1);
    let x_mm: Vec<f64> = (0..=32).map(|i| travel * f64::from(i) / 32.0).collect();
    let of = |value: &dyn Fn(f64) -> f64| x_mm.iter().map(|x| value(x / travel)).collect();
    let own = Elements {
        mass_kg: 1e-3 * force,
        force_n: of(&|share| force * (share + wave * (3.0 * TAU * share).sin())),
        damping_n_s_per_mm: [of(&|_| damping), of(&|share| damping * share)],
        springs: vec![
            Spring::Stop {
                slip_mm: 0.02 * travel,
            },
            Spring::Maxwell {
                // what it reaches at twice the trained speed
                slip_mm: 8.0 * travel * relaxation_s,
                relaxation_s,
            },
            Spring::Latch {
                rearm_mm,
                break_mm: rearm_mm + 0.2 * travel,
            },
        ],
        spring_n: vec![
            of(&|share| friction * (1.0 + (TAU * share).cos())),
            of(&|share| relaxes * share),
            of(&|_| breaks),
        ],
        x_mm: x_mm.clone(),
    };
    let trained = Trained {
        x_mm: [0.0, travel],
        v_mm_s: 4.0 * travel,
    };
    let vaf = BTreeMap::new();
    Realization::of_elements("e".into(), Provenance::default(), vaf, trained, own)
}

#[test]
fn healthy_elements_raise_no_alarm() {
    let mut draw = Stream::new(4, &["healthy"]);
    for i in 0..50 {
        let what = elements(&mut draw);
        assert!(what.certificate().passes(), "{i}: {}", what.certificate());
        let found = search(&what, &Device::default());
        let words: Vec<String> = found.iter().map(Danger::to_string).collect();
        assert!(found.is_empty(), "{i}: {words:?} {:?}", what.elements);
    }
}

#[test]
fn a_hundred_healthy_realizations_raise_no_alarm() {
    let mut draw = Stream::new(3, &["healthy"]);
    let device = Device::default();
    for i in 0..50 {
        let whole = mechanism(&mut draw);
        let play = table(
            &whole,
            Direction::Play {
                delta_mm: 0.02 * whole.trained.x_mm[1],
            },
        );
        for (kind, what) in [("mechanism", &whole), ("table", &play)] {
            assert!(
                what.certificate().passes(),
                "{i} {kind}: {}",
                what.certificate()
            );
            let found = search(what, &device);
            let words: Vec<String> = found.iter().map(Danger::to_string).collect();
            assert!(
                found.is_empty(),
                "{i} {kind}: {words:?} {:?}",
                whole.mechanism
            );
        }
    }
}

/// A key, from a force curve of 0.3 mm/s, whose stop begins in the last percent of the travel:
/// the force there is that of the slow curve, and a hand is 700 times as fast.
#[test]
fn the_stop_of_a_key_is_no_alarm() {
    let mut draw = Stream::new(5, &["key"]);
    let mut what = table(&mechanism(&mut draw), Direction::Play { delta_mm: 0.1 });
    let at = |i: usize| 0.05 * i as f64;
    let branch = |sign: f64| Branch {
        m_kg: vec![0.0; 81],
        b_n_s_per_mm: vec![0.0; 81],
        k_n_per_mm: vec![0.0; 81],
        f0_n: (0..81)
            .map(|i| 0.5 + 0.05 * sign + if i == 80 { 0.8 } else { 0.0 })
            .collect(),
    };
    what.x_mm = (0..81).map(at).collect();
    what.trained = Trained {
        x_mm: [0.0, 4.0],
        v_mm_s: 0.3,
    };
    (what.positive, what.negative) = (branch(1.0), branch(-1.0));
    assert_eq!(search(&what, &Device::default()), []);
}

/// Friction by the sign of the speed passes the certificate; a chatter draws energy from it at
/// any step of the encoder.
#[test]
fn chatter_on_friction_by_sign_is_found() {
    let mut draw = Stream::new(4, &["chatter"]);
    let mut what = table(&mechanism(&mut draw), Direction::Sign);
    let n = what.x_mm.len();
    let of = |f0_n: f64| Branch {
        m_kg: vec![0.0; n],
        b_n_s_per_mm: vec![0.0; n],
        k_n_per_mm: vec![0.0; n],
        f0_n: vec![f0_n; n],
    };
    for (friction_n, is_found) in [(1.3, true), (0.0, false)] {
        (what.positive, what.negative) = (of(friction_n), of(-friction_n));
        assert!(what.certificate().passes());
        for encoder_mm in [0.001, 0.005, 0.1] {
            let device = Device {
                encoder_mm,
                ..Device::default()
            };
            let found = search(&what, &device);
            let chatters = found.iter().any(|d| matches!(d, Danger::Chatter { .. }));
            assert_eq!(
                chatters, is_found,
                "{friction_n} N, {encoder_mm} mm: {found:?}"
            );
        }
    }
}

/// The mechanism as it was shipped: detents of 33 N at an edge that no data reached.
#[test]
fn an_edge_that_no_data_reached_is_found() {
    let text = include_str!("../../tests/data/edge.toml");
    let what = file::parse("edge.toml", text).0.unwrap();
    assert!(what.certificate().passes());
    let found = search(&what, &Device::default());
    assert!(
        found.iter().any(|d| matches!(d, Danger::Force { .. })),
        "{found:?}"
    );
    assert!(
        found.iter().any(|d| matches!(d, Danger::Latched { .. })),
        "{found:?}"
    );
    assert_eq!(refusal(&what, &Device::default()), found.first().copied());
}
