//! Properties of every estimator, and the purpose of each.

#![allow(clippy::unwrap_used, reason = "a test that fails says where")]

use study_base::rng::Stream;
use study_haptics::identify::method::{Delta, Sort, Start, State, Terms, Window};
use study_haptics::identify::resample::Resample;
use study_haptics::identify::{
    Elements, Ewls, Friction, Hat, Identified, IdentifyError, Method, Passive, Segments, Spring,
    Static, Training, TwoSided, Warning, Width, vaf,
};
use study_haptics::model::{Branch, Realization};
use study_haptics::recording::Recording;
use study_wire::predict::{Direction, DirectionState, Lookup, Motion};

/// Two sines over 0.1 to 29.9 mm at 1 kHz, without a force.
pub(crate) fn motion(name: &str, seconds: u32) -> Recording {
    let mut r = Recording {
        name: name.into(),
        t_s: Vec::new(),
        x_mm: Vec::new(),
        v_mm_s: Vec::new(),
        a_m_s2: Vec::new(),
        f_n: Vec::new(),
        header: Vec::new(),
        sha256: name.into(),
        warnings: Vec::new(),
    };
    for i in 0..seconds * 1000 {
        let t = f64::from(i) * 0.001;
        let (mut x, mut v, mut a) = (15.0, 0.0, 0.0);
        for (hz, mm) in [(0.5, 11.0), (2.3, 3.9)] {
            let w = hz * std::f64::consts::TAU;
            x += mm * (w * t).sin();
            v += mm * w * (w * t).cos();
            a -= mm * w * w * (w * t).sin() / 1000.0;
        }
        r.t_s.push(t);
        r.x_mm.push(x);
        r.v_mm_s.push(v);
        r.a_m_s2.push(a);
        r.f_n.push(0.0);
    }
    r
}

/// A target with a mass, damping, friction and a force that depends on x.
pub(crate) fn target(name: &str, seconds: u32, noise_n: f64) -> Recording {
    let mut r = motion(name, seconds);
    let mut noise = Stream::new(3, &[name]);
    for i in 0..r.len() {
        r.f_n[i] = 0.2 * r.a_m_s2[i]
            + 0.01 * r.v_mm_s[i]
            + 1.0f64.copysign(r.v_mm_s[i])
            + 4.0 * (0.5 * r.x_mm[i]).sin()
            + noise_n * noise.normal();
    }
    r
}

fn ewls(lambda: f64, change: impl Fn(&mut Ewls)) -> Method {
    let mut options = Ewls::paper(lambda, Resample::Hat);
    change(&mut options);
    Method::Ewls(options)
}

fn two_sided(window: Window, width: Width, bounded: bool) -> Method {
    Method::TwoSided(TwoSided {
        window,
        width,
        bounded,
        terms: Terms::default(),
    })
}

fn hat(state: State) -> Method {
    Method::Hat(Hat {
        state,
        ..Hat::default()
    })
}

/// At least one of each method.
fn every_method() -> Vec<Method> {
    vec![
        ewls(0.99, |o| o.resample = Resample::Point),
        ewls(0.99, |o| o.resample = Resample::Bin),
        ewls(0.99, |_| ()),
        ewls(0.99, |o| o.start = Start::Warm),
        ewls(0.99, |o| o.sort = Sort::Travel),
        ewls(0.99, |o| o.bounded = true),
        two_sided(Window::Exponential, Width::Lambda(0.99), false),
        two_sided(Window::Tricube, Width::Mm(0.5), true),
        hat(State::Sign),
        hat(State::Play(Delta::Mm(0.5))),
        hat(State::Dahl(Delta::Mm(0.5))),
        Method::Friction(Friction::default()),
        Method::Passive(Passive {
            huber: true,
            ..Passive::default()
        }),
        Elements::default().into(),
        Static.into(),
        Method::Segments(Segments::default()),
        Spring.into(),
    ]
}

pub(crate) fn identified(recording: &Recording, method: Method, dx_mm: f64) -> Identified {
    Training::new(recording)
        .unwrap()
        .identify(method, dx_mm, Lookup::Linear)
        .unwrap()
}

/// The static force at node `j`, N.
fn force(table: &Realization, branch: &Branch, j: usize) -> f64 {
    branch.k_n_per_mm[j] * table.x_mm[j] + branch.f0_n[j]
}

/// F = 0.2 a + 0.03 v + 1.5 z + 0.4 with Dahl's z: the friction model finds the parameters, and
/// is passive.
#[test]
fn the_friction_model_recovers_its_four_parameters() {
    let mut r = motion("r", 30);
    let rule = Direction::Dahl { delta_mm: 0.5 };
    let mut state = DirectionState::default();
    for i in 0..r.len() {
        let at = Motion {
            x_mm: r.x_mm[i],
            v_mm_s: r.v_mm_s[i],
            a_m_s2: r.a_m_s2[i],
        };
        r.f_n[i] = 0.2 * at.a_m_s2 + 0.03 * at.v_mm_s + 1.5 * state.step(rule, at) + 0.4;
    }
    let known = Method::Friction(Friction {
        state: State::Dahl(Delta::Mm(0.5)),
        ..Friction::default()
    });
    let table = identified(&r, known, 1.0).realization;
    for (branch, f0) in [(&table.positive, 1.9), (&table.negative, -1.1)] {
        assert!((branch.m_kg[0] - 0.2).abs() < 1e-9, "{branch:?}");
        assert!((branch.b_n_s_per_mm[1] - 0.03).abs() < 1e-9, "{branch:?}");
        assert!((branch.f0_n[0] - f0).abs() < 1e-9, "{branch:?}");
    }
    assert!(table.certificate().passes());
    let scanned = identified(&r, Method::Friction(Friction::default()), 1.0).realization;
    let delta = scanned.direction.delta_mm().unwrap();
    assert!((0.35..=0.55).contains(&delta), "{delta}");
}

/// One sample in fifty is wrong by 20 N: with Huber's weights the table is nearly that of the
/// clean recording, without them it is not.
#[test]
fn huber_weights_make_light_of_wrong_samples() {
    let mut clean = motion("r", 20);
    for i in 0..clean.len() {
        let detent = 3.0 * (clean.x_mm[i] / 2.0).sin();
        clean.f_n[i] = 0.1 * clean.a_m_s2[i] + 0.02 * clean.v_mm_s[i] + detent;
        clean.f_n[i] += 0.05 * (i as f64 * 1.7).sin();
    }
    let mut spoilt = clean.clone();
    for i in (0..spoilt.len()).step_by(50) {
        spoilt.f_n[i] += 20.0;
    }
    let left = |huber| {
        let method = Method::Passive(Passive {
            huber,
            ..Passive::default()
        });
        let table = identified(&spoilt, method, 0.5).realization;
        let score = vaf::score(&table, &clean);
        (score.residual_n.powi(2) + score.bias_n.powi(2)).sqrt()
    };
    let (plain, robust) = (left(false), left(true));
    assert!(robust < 0.4 * plain && robust < 0.25, "{robust} {plain}");
}

#[test]
fn a_hat_table_recovers_the_table_that_made_the_force() {
    for (state, scanned) in [
        (State::Play(Delta::Mm(0.6)), State::Play(Delta::Scan)),
        (State::Dahl(Delta::Mm(0.45)), State::Dahl(Delta::Scan)),
    ] {
        let mut r = motion("r", 30);
        let nodes = Training::new(&r).unwrap().nodes(1.0).unwrap();
        let branch = |friction: f64, phase: f64| Branch {
            // some are 0: the bound is met and not crossed
            m_kg: nodes
                .iter()
                .map(|x| (0.2 * (x + phase).sin()).max(0.0))
                .collect(),
            b_n_s_per_mm: nodes
                .iter()
                .map(|x| 0.01 + 0.01 * (x - phase).cos())
                .collect(),
            k_n_per_mm: vec![0.0; nodes.len()],
            f0_n: nodes
                .iter()
                .map(|x| friction + 5.0 * (0.5 * x).sin())
                .collect(),
        };
        // the same motion gives the table its shape
        r.f_n[0] = 1.0;
        let mut truth = identified(&r, hat(state), 1.0).realization;
        truth.positive = branch(1.0, 0.3);
        truth.negative = branch(-1.5, 0.9);
        r.f_n = vaf::predict(&truth, &r).collect();

        let options = |state| {
            Method::Hat(Hat {
                terms: Terms::default(),
                state,
                ridge_force: 0.0,
                ridge_dynamics: 0.0,
                bounded: true,
            })
        };
        let found = identified(&r, options(state), 1.0).realization;
        for (one, other) in [
            (&found.positive, &truth.positive),
            (&found.negative, &truth.negative),
        ] {
            for (p, q, tolerance) in [
                (&one.m_kg, &other.m_kg, 1e-6),
                (&one.b_n_s_per_mm, &other.b_n_s_per_mm, 1e-7),
                (&one.k_n_per_mm, &other.k_n_per_mm, 0.0),
                (&one.f0_n, &other.f0_n, 1e-5),
            ] {
                for (p, q) in p.iter().zip(q) {
                    assert!((p - q).abs() <= tolerance, "{state:?} {p} {q}");
                }
            }
        }
        let found = identified(&r, options(scanned), 1.0).realization;
        assert_eq!(found.direction, truth.direction);
    }
}

#[test]
fn a_best_delta_at_the_end_of_the_scan_gives_a_warning() {
    let r = target("r", 20, 0.0);
    // friction that changes at once requires no state
    let found = identified(&r, hat(State::Play(Delta::Scan)), 1.0);
    assert_eq!(
        found.realization.direction,
        Direction::Play { delta_mm: 0.3 }
    );
    assert!(
        found
            .warnings
            .contains(&Warning::DeltaAtEnd { delta_mm: 0.3 })
    );
}

#[test]
fn no_method_depends_on_the_origin_of_x() {
    let here = target("r", 20, 0.1);
    let probe = target("o", 7, 0.1);
    let moved = |r: &Recording, by: f64| {
        let mut r = r.clone();
        r.x_mm.iter_mut().for_each(|x| *x += by);
        r
    };
    for method in every_method() {
        let of = |by: f64| {
            let found = identified(&moved(&here, by), method, 0.5);
            vaf::score(&found.realization, &moved(&probe, by)).vaf
        };
        let at_home = of(0.0);
        for by in [-20.0, 100.0] {
            let there = of(by);
            // not zero: θ = 0 and P = 10⁶ I at the start are tied to the origin
            let tolerance = if matches!(method, Method::Ewls(_)) {
                1e-4
            } else {
                1e-8
            };
            assert!(
                (at_home - there).abs() < tolerance,
                "{method}: {at_home} {there}"
            );
        }
    }
}

#[test]
fn a_reversal_of_the_axis_swaps_the_directions_for_symmetric_methods() {
    let here = target("r", 20, 0.1);
    let mut there = here.clone();
    for column in [
        &mut there.x_mm,
        &mut there.v_mm_s,
        &mut there.a_m_s2,
        &mut there.f_n,
    ] {
        column.iter_mut().for_each(|p| *p = 0.0 - *p);
    }
    let differ = |method| {
        let (one, other) = (
            identified(&here, method, 1.0).realization,
            identified(&there, method, 1.0).realization,
        );
        let last = one.x_mm.len() - 1;
        let mut worst: f64 = 0.0;
        for j in 0..=last {
            assert!((one.x_mm[j] + other.x_mm[last - j]).abs() < 1e-9);
            for (p, q) in [
                (&one.positive, &other.negative),
                (&one.negative, &other.positive),
            ] {
                let sum = force(&one, p, j) + force(&other, q, last - j);
                worst = worst.max(sum.abs());
            }
        }
        worst
    };
    for method in [
        two_sided(Window::Exponential, Width::Lambda(0.99), false),
        two_sided(Window::Tricube, Width::Lambda(0.99), true),
        hat(State::Sign),
        Method::Segments(Segments::default()),
        Spring.into(),
    ] {
        let worst = differ(method);
        assert!(worst < 1e-6, "{method}: {worst} N");
    }
    // the paper's method lags upwards in both directions
    assert!(differ(ewls(0.99, |_| ())) > 0.01);
}

#[test]
fn bounded_tables_have_no_negative_mass_or_damping_and_free_ones_have() {
    let r = target("r", 20, 0.5);
    for (bounded, free) in [
        (ewls(0.98, |o| o.bounded = true), ewls(0.98, |_| ())),
        (
            two_sided(Window::Exponential, Width::Mm(0.1), true),
            two_sided(Window::Exponential, Width::Mm(0.1), false),
        ),
        (
            hat(State::Sign),
            Method::Hat(Hat {
                terms: Terms::default(),
                state: State::Sign,
                ridge_force: 0.0,
                ridge_dynamics: 0.0,
                bounded: false,
            }),
        ),
    ] {
        let negative = |method: Method| {
            let found = identified(&r, method, 0.1).realization.certificate();
            [found.negative_mass, found.negative_damping]
        };
        assert_eq!(negative(bounded), [0.0, 0.0]);
        let [m, b] = negative(free);
        assert!(m > 0.0 && b > 0.0, "{free} {m} {b}");
    }
}

#[test]
fn a_warm_start_improves_the_first_nodes() {
    let r = target("r", 20, 0.2);
    let worst = |start| {
        let found = identified(&r, ewls(0.99, |o| o.start = start), 0.02);
        let table = &found.realization;
        let off = |j: usize| {
            let truth = 1.0 + 4.0 * (0.5 * table.x_mm[j]).sin();
            (force(table, &table.positive, j) - truth).abs()
        };
        let told = found
            .warnings
            .iter()
            .any(|w| matches!(w, Warning::StartUp { .. }));
        ((0..5).map(off).fold(0.0, f64::max), told)
    };
    let (cold, cold_told) = worst(Start::Cold);
    let (warm, warm_told) = worst(Start::Warm);
    assert!(warm < 0.5 * cold, "{warm} {cold}");
    assert!(cold_told && !warm_told);
}

#[test]
fn sorted_by_travel_the_negative_direction_lags_downwards() {
    let r = target("r", 20, 0.0);
    // friction apart, the force is 4 sin(x/2): where it rises, a lag upwards (the
    // table follows what lay below) is too low and a lag downwards too high
    let at_node = |sort| {
        let found = identified(&r, ewls(0.999, |o| o.sort = sort), 1.0).realization;
        let j = found.x_mm.iter().position(|x| *x == 14.0).unwrap();
        [
            force(&found, &found.positive, j),
            force(&found, &found.negative, j),
        ]
    };
    let (up, travel) = (at_node(Sort::Ascending), at_node(Sort::Travel));
    assert_eq!(up[0], travel[0]);
    assert!((up[1] - travel[1]).abs() > 0.01, "{up:?} {travel:?}");
}

#[test]
fn positions_without_samples_give_a_warning_for_every_table() {
    let mut r = target("r", 20, 0.1);
    // no samples from 12 to 18 mm
    let keep: Vec<bool> = r.x_mm.iter().map(|x| !(12.0..18.0).contains(x)).collect();
    for column in [
        &mut r.t_s,
        &mut r.x_mm,
        &mut r.v_mm_s,
        &mut r.a_m_s2,
        &mut r.f_n,
    ] {
        let mut kept = keep.iter();
        column.retain(|_| *kept.next().unwrap());
    }
    for method in every_method() {
        if let Method::Spring(_)
        | Method::Friction(_)
        | Method::Ewls(Ewls {
            resample: Resample::Point,
            ..
        }) = method
        {
            // no bins or nodes to be empty
            continue;
        }
        let found = identified(&r, method, 0.5);
        let told = found
            .warnings
            .iter()
            .any(|w| matches!(w, Warning::Filled { .. }));
        assert!(told, "{method} {:?}", found.warnings);
    }
}

#[test]
fn every_method_refuses_impossible_arguments() {
    let r = target("r", 5, 0.1);
    let training = Training::new(&r).unwrap();
    for method in every_method() {
        if !method.has_dx() {
            assert!(training.identify(method, f64::NAN, Lookup::Linear).is_ok());
            continue;
        }
        for (dx_mm, begins) in [
            (100.0, "dx = 100 mm leaves"),
            (0.0, "dx has to be a length"),
            (f64::NAN, "dx has to be a length"),
            (1e-9, "dx = 0.000000001 mm gives more than"),
        ] {
            let error = training
                .identify(method, dx_mm, Lookup::Linear)
                .unwrap_err();
            assert!(error.to_string().starts_with(begins), "{method}: {error}");
        }
    }
    for lambda in [0.0, -1.0, 1.0001, f64::NAN] {
        for method in [
            ewls(lambda, |_| ()),
            two_sided(Window::Exponential, Width::Lambda(lambda), false),
        ] {
            let error = training.identify(method, 1.0, Lookup::Linear).unwrap_err();
            assert!(error.to_string().starts_with("lambda has to be"), "{error}");
        }
    }
    let narrow = two_sided(Window::Tricube, Width::Mm(1e-9), false);
    assert!(matches!(
        training.identify(narrow, 1.0, Lookup::Linear),
        Err(IdentifyError::Narrow { .. })
    ));
}

/// Without excitation P of a recursion grows by 1/λ per sample; it recovers with noise on
/// position and force.
#[test]
fn eight_seconds_at_one_position_ruin_no_table() {
    let mut r = target("r", 20, 0.05);
    let mut noise = Stream::new(5, &["dwell"]);
    let t = r.t_s[r.len() - 1];
    for i in 1..8000 {
        r.t_s.push(t + 0.001 * f64::from(i));
        r.x_mm.push(15.0 + 1e-4 * noise.normal());
        r.v_mm_s.push(0.02 * noise.normal());
        r.a_m_s2.push(0.05 * noise.normal());
        r.f_n.push(4.0 * 7.5f64.sin() + 0.05 * noise.normal());
    }
    let probe = target("o", 7, 0.0);
    for method in every_method() {
        if let Method::Spring(_) | Method::Friction(_) = method {
            // they have no detents
            continue;
        }
        let found = identified(&r, method, 1.0);
        let vaf = vaf::score(&found.realization, &probe).vaf;
        assert!(vaf > 0.97, "{method}: {vaf}");
    }
}

#[test]
fn odd_recordings_give_finite_tables_or_errors() {
    let mut draw = Stream::new(11, &["odd"]);
    let mut tables = 0;
    for round in 0..300 {
        let mut r = motion("odd", 1);
        let n = 3 + draw.below(60) as usize;
        for column in [
            &mut r.t_s,
            &mut r.x_mm,
            &mut r.v_mm_s,
            &mut r.a_m_s2,
            &mut r.f_n,
        ] {
            column.truncate(n);
        }
        let scale = [1.0, 1e-9, 1e12][round % 3];
        for i in 0..n {
            // coarse, so that positions repeat and speeds are 0
            r.x_mm[i] = draw.below(6) as f64 * 0.4;
            r.v_mm_s[i] = (draw.below(5) as f64 - 2.0) * scale;
            r.a_m_s2[i] = if round % 2 == 0 {
                0.0
            } else {
                draw.normal() * scale
            };
            r.f_n[i] = draw.normal() * scale;
        }
        let Ok(training) = Training::new(&r) else {
            continue;
        };
        for method in every_method() {
            for lookup in [Lookup::Linear, Lookup::Floor, Lookup::Nearest] {
                if let Ok(found) = training.identify(method, 0.3, lookup) {
                    tables += 1;
                    let table = &found.realization;
                    for branch in [&table.positive, &table.negative] {
                        for list in [
                            &branch.m_kg,
                            &branch.b_n_s_per_mm,
                            &branch.k_n_per_mm,
                            &branch.f0_n,
                        ] {
                            assert_eq!(list.len(), table.x_mm.len());
                            assert!(list.iter().all(|p| p.is_finite()), "{method} {list:?}");
                        }
                    }
                }
            }
        }
    }
    assert!(tables > 1000, "{tables}");
}
