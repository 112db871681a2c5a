//! Small tables with known answers.

use super::*;

const RANGE: Range = Range {
    x_mm: [0.0, 2.0],
    v_mm_s: 100.0,
};

/// Three nodes at 0, 1, 2 mm; one array of m, b, k, F0 for each direction.
struct Table([[[f64; 3]; 4]; 2]);

impl Table {
    fn certify(&self, lookup: Lookup, direction: Direction) -> Certificate {
        let branch = |[m, b, k, f0]: &'_ [[f64; 3]; 4]| -> [[f64; 3]; 4] { [*m, *b, *k, *f0] };
        let (plus, minus) = (branch(&self.0[0]), branch(&self.0[1]));
        let view = |t: &'static [[f64; 3]; 4]| BranchView {
            m_kg: &t[0],
            b_n_s_per_mm: &t[1],
            k_n_per_mm: &t[2],
            f0_n: &t[3],
        };
        certify(
            &TableView {
                x_mm: &[0.0, 1.0, 2.0],
                positive: view(Box::leak(Box::new(plus))),
                negative: view(Box::leak(Box::new(minus))),
                lookup,
            },
            direction,
            RANGE,
        )
    }

    fn linear(&self) -> Certificate {
        self.certify(Lookup::Linear, Direction::Sign)
    }
}

/// m, b and a hysteresis of 2 N, all constant.
fn plain() -> Table {
    let of = |f0: f64| [[0.1; 3], [0.01; 3], [0.0; 3], [f0; 3]];
    Table([of(1.0), of(-1.0)])
}

#[test]
fn a_constant_table_passes_with_its_own_numbers_as_margins() {
    let c = plain().linear();
    assert!(c.passes());
    assert_eq!(c.mass.value, 0.1);
    assert_eq!(c.damping.value, 0.01);
    assert_eq!(c.hysteresis.value, 2.0);
    assert_eq!((c.negative_mass, c.negative_damping), (0.0, 0.0));
    assert_eq!(c.stiffness_n_per_mm, 0.0);
}

#[test]
fn a_negative_mass_or_damping_fails_where_it_is_and_is_counted() {
    let mut t = plain();
    t.0[1][0][2] = -0.05;
    t.0[0][1][0] = -0.002;
    let c = t.linear();
    assert!(!c.passes());
    assert_eq!((c.mass.value, c.mass.at_mm), (-0.05, 2.0));
    assert_eq!((c.damping.value, c.damping.at_mm), (-0.002, 0.0));
    assert!((c.negative_mass - 1.0 / 6.0).abs() < 1e-15);
    assert!((c.negative_damping - 1.0 / 6.0).abs() < 1e-15);
    assert_eq!(
        c.to_string(),
        "FAIL: least m -0.0500 kg at 2.00 mm, b less what m needs -0.00200 N·s/mm at 0.00 mm"
    );
}

#[test]
fn only_a_rounding_error_below_zero_passes() {
    for (b, passes) in [(-1e-10, true), (-1e-8, false), (-1e-4, false)] {
        let mut t = plain();
        t.0[0][1] = [b; 3];
        assert_eq!(t.linear().passes(), passes, "{b}");
    }
}

#[test]
fn a_negative_stiffness_is_no_fault() {
    let mut t = plain();
    t.0[0][2] = [-3.0; 3];
    t.0[1][2] = [-3.0; 3];
    let c = t.linear();
    assert!(c.passes());
    assert!((c.stiffness_n_per_mm - 3.0).abs() < 1e-12);
}

#[test]
fn a_mass_that_grows_along_the_motion_needs_damping_on_both_sides_of_a_node() {
    // +0.3 kg between 0 and 1 mm: ½ · 0.3 kg/mm · 100 mm/s = 15 N·s/m
    let mut t = plain();
    t.0[0][0] = [0.1, 0.4, 0.4];
    let c = t.linear();
    assert!((c.damping.value - (0.01 - 0.015)).abs() < 1e-15, "{c:?}");
    // in the other direction of travel the same slope is a falling mass
    let mut t = plain();
    t.0[1][0] = [0.1, 0.4, 0.4];
    assert!(t.linear().passes());
    t.0[1][0] = [0.4, 0.1, 0.1];
    let c = t.linear();
    assert!((c.damping.value - (0.01 - 0.015)).abs() < 1e-15);
    // the last node sees only the slope on its left, the first only that on its right
    t.0[1][0] = [0.1, 0.1, 0.4];
    assert!(t.linear().passes());
}

#[test]
fn a_direction_state_adds_the_difference_of_the_masses_over_delta() {
    let mut t = plain();
    t.0[0][0] = [0.15; 3];
    assert!(t.linear().passes());
    // ½ · (0.05/0.5) kg/mm · 100 mm/s = 5 N·s/m
    let c = t.certify(Lookup::Linear, Direction::Play { delta_mm: 0.5 });
    assert!((c.damping.value - 0.005).abs() < 1e-15, "{c:?}");
    let c = t.certify(Lookup::Linear, Direction::Dahl { delta_mm: 0.1 });
    assert!((c.damping.value - (0.01 - 0.025)).abs() < 1e-15);
    assert!(!c.passes());
}

#[test]
fn springs_that_cross_between_nodes_are_found_at_the_vertex() {
    // + : k 0 → 4, F0 0 → −3, so S = 4t² − 3t at x = t, 0 at the left node and 1
    // at the right; least at t = 3/8: −9/16. − : zero.
    let t = Table([
        [[0.0; 3], [0.0; 3], [0.0, 4.0, 4.0], [0.0, -3.0, -3.0]],
        [[0.0; 3]; 4],
    ]);
    let c = t.linear();
    assert!((c.hysteresis.value + 9.0 / 16.0).abs() < 1e-12, "{c:?}");
    assert!((c.hysteresis.at_mm - 0.375).abs() < 1e-12);
    assert!(!c.passes());
    // dS/dx = 8t − 3: steepest at the right end, 5; the nodes alone say 1
    assert!((c.stiffness_n_per_mm - 5.0).abs() < 1e-12);
}

#[test]
fn the_minimum_between_nodes_agrees_with_a_fine_search() {
    // deterministic pseudo-random tables
    let mut state = 1_u64;
    let mut next = || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    for _ in 0..200 {
        let mut column = |scale: f64| [scale * next(), scale * next(), scale * next()];
        let mut branch = || [[0.0; 3], [0.0; 3], column(8.0), column(20.0)];
        let t = Table([branch(), branch()]);
        let c = t.linear();
        let (mut least, mut steepest) = (f64::INFINITY, 0.0_f64);
        let at = |p: &[f64; 3], x: f64| {
            let i = if x < 1.0 { 0 } else { 1 };
            p[i] + (x - i as f64) * (p[i + 1] - p[i])
        };
        let s = |d: usize, x: f64| at(&t.0[d][2], x) * x + at(&t.0[d][3], x);
        let n = 20_000;
        for i in 0..=n {
            let x = 2.0 * f64::from(i) / f64::from(n);
            least = least.min(s(0, x) - s(1, x));
            for d in 0..2 {
                let step = 2.0 / f64::from(n);
                if i < n && i != n / 2 - 1 {
                    steepest = steepest.max((s(d, x + step) - s(d, x)).abs() / step);
                }
            }
        }
        assert!((least - c.hysteresis.value).abs() < 2e-3, "{least} {c:?}");
        assert!(
            (steepest - c.stiffness_n_per_mm).abs() < 5e-3,
            "{steepest} {c:?}"
        );
    }
}

#[test]
fn parameters_that_jump_have_no_slope_that_damping_can_pay_for() {
    let mut t = plain();
    t.0[0][0] = [0.1, 0.11, 0.11];
    let c = t.certify(Lookup::Floor, Direction::Sign);
    assert_eq!(c.damping.value, f64::NEG_INFINITY);
    assert!(!c.passes());
    // without a mass there is nothing to pay for; the force still jumps
    let mut t = plain();
    for d in 0..2 {
        t.0[d][0] = [0.0; 3];
        t.0[d][3][1] += 0.25;
    }
    let c = t.certify(Lookup::Nearest, Direction::Sign);
    assert!(c.passes());
    assert_eq!(c.stiffness_n_per_mm, f64::INFINITY);
}

#[test]
fn outside_the_nodes_the_edge_parameters_count_up_to_where_it_was_trained() {
    // beyond 2 mm the branches close by 1 N/mm
    let mut t = plain();
    t.0[0][2][2] = -1.0;
    t.0[0][3][2] = 3.0;
    assert!(t.linear().passes());
    let view = |t: &'static [[f64; 3]; 4]| BranchView {
        m_kg: &t[0],
        b_n_s_per_mm: &t[1],
        k_n_per_mm: &t[2],
        f0_n: &t[3],
    };
    let c = certify(
        &TableView {
            x_mm: &[0.0, 1.0, 2.0],
            positive: view(Box::leak(Box::new(t.0[0]))),
            negative: view(Box::leak(Box::new(t.0[1]))),
            lookup: Lookup::Linear,
        },
        Direction::Sign,
        Range {
            x_mm: [0.0, 4.5],
            ..RANGE
        },
    );
    assert!((c.hysteresis.value + 0.5).abs() < 1e-12, "{c:?}");
    assert_eq!(c.hysteresis.at_mm, 4.5);
}

#[test]
fn a_sampled_spring_needs_the_damping_of_colgate_and_schenkel() {
    // 5 N/mm wants 2.5, 0.63 and 0.25 N·s/m at 1, 4 and 10 kHz
    for (rate, needed) in SERVO_RATES_HZ.into_iter().zip([2.5, 0.625, 0.25]) {
        assert!((spring_damping_n_s_per_m(5.0, rate, 0.0) - needed).abs() < 1e-12);
    }
    // one period of delay triples it
    assert!((spring_damping_n_s_per_m(5.0, 1000.0, 1.0) - 7.5).abs() < 1e-12);
}

/// F⁺ − F⁻ = 2 N over δ = 0.5 mm is 4 N/mm to the device, whatever K is.
#[test]
fn the_change_over_the_direction_state_is_a_stiffness() {
    for rule in [
        Direction::Play { delta_mm: 0.5 },
        Direction::Dahl { delta_mm: 0.5 },
    ] {
        let c = plain().certify(Lookup::Linear, rule);
        assert_eq!(c.state_n_per_mm, Some(4.0));
        assert_eq!(c.rendered_n_per_mm(), 4.0);
        // K T/2 + |B| at 1 kHz: 2 + 10 N·s/m
        assert!((c.device_damping_n_s_per_m(1000.0, 0.0) - 12.0).abs() < 1e-9);
    }
    assert_eq!(plain().linear().state_n_per_mm, None);
    // k x: the gap is widest between the nodes, 2 + 2·0.25 N at 0.5 mm
    let mut t = plain();
    t.0[0][2] = [1.0, 0.0, 0.0];
    let c = t.certify(Lookup::Linear, Direction::Play { delta_mm: 0.5 });
    assert!((c.state_n_per_mm.unwrap() - 4.5).abs() < 1e-9, "{c:?}");
}
