use super::*;
use crate::model::Elements;
use crate::model::coverage::{Coverage, Determined};
use proptest::prelude::*;
use study_wire::elements::Spring;

const SMALL: &str = r#"format = "study-model/1"
id = "a"
lookup = "floor"
direction = { rule = "play", delta_mm = 0.5 }
trained = { x_mm = [0, 2], v_mm_s = 100 }
x_mm = [0, 1, 2]
[provenance]
method = "by hand"
[vaf]
val = 0.5
[positive]
m_kg = [0, 0.1, 0]
b_n_s_per_mm = [0.01, 0.01, 0.01]
k_n_per_mm = [1, -1, 1]
f0_n = [-1, 0, 1e-3]
[negative]
m_kg = [0, 0, 0]
b_n_s_per_mm = [0, 0, 0]
k_n_per_mm = [0, 0, 0]
f0_n = [-2, -2, -2]
"#;

/// The faults of [`SMALL`] with one text replaced, as `line: message`.
fn faults(from: &str, to: &str) -> Vec<String> {
    assert!(SMALL.contains(from), "{from}");
    let text = SMALL.replacen(from, to, 1);
    let (realization, findings) = parse("a.toml", &text);
    assert_eq!(realization.is_some(), !findings.has_errors());
    findings
        .faults
        .iter()
        .map(|f| {
            let line = f
                .span
                .as_ref()
                .map_or(0, |s| findings.line_and_column(s.start).0);
            format!("{line}: {}", f.message)
        })
        .collect()
}

#[test]
fn a_model_file_is_read() {
    let (realization, findings) = parse("a.toml", SMALL);
    assert_eq!(findings.faults, []);
    let r = realization.unwrap();
    assert_eq!(r.id, "a");
    assert_eq!(r.lookup, Lookup::Floor);
    assert_eq!(r.direction, Direction::Play { delta_mm: 0.5 });
    assert_eq!(r.trained.x_mm, [0.0, 2.0]);
    assert_eq!(r.vaf["val"], 0.5);
    assert_eq!(r.positive.k_n_per_mm, [1.0, -1.0, 1.0]);
    assert_eq!(r.negative.f0_n, [-2.0; 3]);
}

/// m in kg·m², b in N·m·s/deg and so on: a turning handle in its own units is the same at its
/// lever arm, and a file in degrees says so in its keys.
#[test]
fn a_turning_handle_is_read_at_its_lever_arm() {
    let linear = parse("a.toml", SMALL).0.unwrap();
    let close = |a: f64, b: f64| (a - b).abs() <= 1e-12 * (1.0 + b.abs());
    for (units, x_key) in [(Units::Degrees, "x_deg = ["), (Units::Radians, "x_rad = [")] {
        let turned = linear.clone().turned(units, 20.0);
        let text = write(&turned);
        let [x, _] = units.names();
        let head = format!(
            "format = \"study-model/2\"\nkind = \"table\"\nunits = {{ x = \"{x}\", f = \"N·m\" }}\n"
        );
        assert!(text.starts_with(&head) && text.contains(x_key), "{text}");
        assert!(!text.contains("_mm") && !text.contains("m_kg ="), "{text}");
        let (read, findings) = parse("a.toml", &text);
        assert_eq!(findings.faults, []);
        assert_eq!(read, Some(turned.clone()));
        let back = turned.at_lever(20.0);
        assert_eq!((back.units, back.lookup), (Units::Linear, Lookup::Floor));
        let pairs = [
            (&back.x_mm, &linear.x_mm),
            (&back.positive.m_kg, &linear.positive.m_kg),
            (&back.positive.b_n_s_per_mm, &linear.positive.b_n_s_per_mm),
            (&back.positive.k_n_per_mm, &linear.positive.k_n_per_mm),
            (&back.negative.f0_n, &linear.negative.f0_n),
        ];
        for (one, other) in pairs {
            assert!(one.iter().zip(other).all(|(a, b)| close(*a, *b)), "{one:?}");
        }
        let delta = back.direction.delta_mm().unwrap();
        assert!(close(delta, 0.5) && close(back.trained.v_mm_s, 100.0));
    }
    // 0.1 kg at 20 mm are 4e-5 kg·m²; 1 N/mm is 400 N·mm per radian, 6.98e-3 N·m per degree
    let degrees = linear.turned(Units::Degrees, 20.0);
    assert!(close(degrees.positive.m_kg[1], 4e-5));
    assert!(close(
        degrees.positive.k_n_per_mm[0],
        0.4 * std::f64::consts::PI / 180.0
    ));
    // 100 mm/s at 20 mm are 5 rad/s.
    assert!(close(degrees.trained.v_mm_s, 5f64.to_degrees()));
    let mixed = write(&degrees).replace("f = \"N·m\"", "f = \"N\"");
    let (read, findings) = parse("a.toml", &mixed);
    assert!(read.is_none());
    let message = &findings.faults[0].message;
    assert!(message.contains("does not go with x"), "{message}");
}

#[test]
fn every_fault_has_its_line() {
    for (from, to, expected) in [
        (
            "[0, 0.1, 0]",
            "[0, nan, 0]",
            "12: `positive.m_kg[1]` has to be a finite number, not NaN",
        ),
        (
            "[0, 0.1, 0]",
            "[0,\n-inf, 0]",
            "13: `positive.m_kg[1]` has to be a finite number, not -inf",
        ),
        (
            "[0, 1, 2]",
            "[0, 2, 2]",
            "6: `x_mm[2]` is 2 after 2: positions have to ascend",
        ),
        (
            "[0, 1, 2]",
            "[0]",
            "6: `x_mm` has 1 nodes: a table has 2 to 20000",
        ),
        (
            "[1, -1, 1]",
            "[1, -1]",
            "14: `positive.k_n_per_mm` has 2 numbers where `x_mm` has 3",
        ),
        (
            "delta_mm = 0.5",
            "delta_mm = 0",
            "4: `direction.delta_mm` has to be a finite number above zero, not 0",
        ),
        (
            "delta_mm = 0.5",
            "delta = 0.5",
            "4: unknown key `delta` in [direction]",
        ),
        (", delta_mm = 0.5", "", "4: [direction] has no `delta_mm`"),
        (
            "\"play\", delta_mm = 0.5",
            "\"sign\", delta_mm = 0.5",
            "4: unknown key `delta_mm` in [direction]",
        ),
        (
            "val = 0.5",
            "val = 79",
            "10: the VAF on `val` is 79: it is at most 1",
        ),
        (
            "val = 0.5",
            "val = nan",
            "10: `vaf.val` has to be a finite number, not NaN",
        ),
        (
            "[0, 2], v",
            "[2, 0], v",
            "5: `trained.x_mm` has to ascend: lowest, then highest position",
        ),
        (
            "[0, 2], v",
            "[0, 1, 2], v",
            "5: `trained.x_mm` has to be two numbers, not 3",
        ),
        (
            "v_mm_s = 100",
            "v_mm_s = inf",
            "5: `trained.v_mm_s` has to be a finite number above zero, not inf",
        ),
        (
            "id = \"a\"",
            "id = \"../a\"",
            "2: `../a` is not a model id: use 1 to 32 of A-Z a-z 0-9 . _ -",
        ),
        ("\"floor\"", "\"flor\"", "3: `lookup` cannot be `flor`"),
        (
            "method = \"by hand\"",
            "lambda = 2",
            "8: `provenance.lambda` has to be above 0 and at most 1, not 2",
        ),
        (
            "[negative]",
            "[negatve]",
            "16: unknown key `negatve` at the top level",
        ),
        (
            "[0, 2], v",
            "[0, 1.5], v",
            "6: there are nodes outside `trained.x_mm`",
        ),
        (
            "\"a\"",
            "7",
            "2: `id` has to be text in quotes, not a whole number",
        ),
    ] {
        let found = faults(from, to);
        assert!(
            found.iter().any(|f| f == expected),
            "{expected}\n{found:#?}"
        );
    }
}

#[test]
fn a_node_is_outside_by_more_than_the_rounding_of_its_multiple() {
    assert!(faults("[0, 2], v", "[0, 1.9999999999999996], v").is_empty());
    assert_eq!(faults("[0, 2], v", "[0, 1.9999], v").len(), 1);
}

#[test]
fn a_newer_format_is_refused_without_further_faults() {
    let newer = "study-model/4\"\ncolor = \"red";
    assert_eq!(
        faults("study-model/1", newer),
        ["1: this is not a study-model/1 file"]
    );
    let (_, findings) = parse("a.toml", &SMALL.replacen("/1", "/4", 1));
    assert_eq!(findings.faults[0].label.as_deref(), Some("a newer format"));
}

/// [`SMALL`] as a file of version 3 with what its recordings carry.
fn third() -> String {
    let carried = r#"[coverage]
x_mm = [0, 2]
v_mm_s = [50, 100]
full_strokes = 3
partial_strokes = 0
held_mm = [[0, 0.5]]
[coverage.positive]
top_mm_s = 90.5
samples = [[0, 7], [1, 2]]
[coverage.negative]
top_mm_s = 100
samples = [[4, 5], [0, 0]]
[terms.m_kg]
value = 0.01
standard_error = 0.02
upper_bound = 0.06
[positive]"#;
    let format = "study-model/3\"\nkind = \"table";
    (SMALL.replacen("study-model/1", format, 1)).replacen("[positive]", carried, 1)
}

#[test]
fn what_the_recordings_carry_is_read_and_written_in_any_units() {
    let (read, findings) = parse("a.toml", &third());
    assert_eq!(findings.faults, []);
    let mut r = read.unwrap();
    let coverage = r.provenance.coverage.as_ref().unwrap();
    assert_eq!(coverage.v_mm_s, [50.0, 100.0]);
    assert_eq!(coverage.directions[0].samples, [[0, 7], [1, 2]]);
    assert_eq!(coverage.directions[0].top_mm_s, 90.5);
    assert!(coverage.gaps_mm().iter().all(Vec::is_empty));
    assert_eq!((coverage.full_strokes, coverage.partial_strokes), (3, 0));
    assert_eq!(coverage.held_mm, [[0.0, 0.5]]);
    let mass = r.provenance.terms["m_kg"];
    assert_eq!(
        (mass.standard_error, mass.upper_bound),
        (Some(0.02), Some(0.06))
    );
    // A bound alone is enough.
    let bound = Determined {
        upper_bound: Some(0.25),
        ..Determined::default()
    };
    (r.provenance.terms).insert("b_n_s_per_mm".to_owned(), bound);
    let turned = r.clone().turned(Units::Radians, 20.0);
    // 0.06 kg at 20 mm are 2.4e-5 kg·m², 0.5 mm are 0.025 rad.
    let (found, covered) = (&turned.provenance.terms, &turned.provenance.coverage);
    assert!((found["m_kg"].upper_bound.unwrap() - 2.4e-5).abs() < 1e-15);
    assert!((covered.as_ref().unwrap().held_mm[0][1] - 0.025).abs() < 1e-15);
    assert!(write(&turned).contains("[terms.b_nm_s_per_rad]"));
    for one in [r, turned] {
        let text = write(&one);
        assert!(
            text.starts_with("format = \"study-model/3\"\nkind = \"table\"\n"),
            "{text}"
        );
        let (back, findings) = parse("a.toml", &text);
        assert_eq!(findings.faults, []);
        assert_eq!(back, Some(one));
    }
}

#[test]
fn every_fault_of_what_the_recordings_carry_has_its_line() {
    for (from, to, expected) in [
        (
            "[50, 100]",
            "[100, 50]",
            "14: `coverage.v_mm_s` has to be speeds above 0 that ascend",
        ),
        (
            "[50, 100]",
            "[]",
            "14: `coverage.v_mm_s` has to be speeds above 0 that ascend",
        ),
        (
            "[[0, 7], [1, 2]]",
            "[[0, 7]]",
            "20: `coverage.positive.samples` has 1 rows: one for each class of `v_mm_s`",
        ),
        (
            "[[0, 7], [1, 2]]",
            "[[0, 7], [1]]",
            "20: `coverage.positive.samples` has to have the same number of places in each row",
        ),
        (
            "[[4, 5], [0, 0]]",
            "[[4], [0]]",
            "21: `coverage.negative` has another number of places than `positive`",
        ),
        (
            "[[4, 5], [0, 0]]",
            "[[4, -5], [0, 0]]",
            "23: `coverage.negative.samples[0][1]` has to be from 0 to 4294967295, not -5",
        ),
        (
            "[[0, 0.5]]",
            "[[0.5, 0]]",
            "17: `coverage.held_mm[0]` has to ascend: lowest, then highest position",
        ),
        (
            "full_strokes = 3",
            "full_stroke = 3",
            "15: unknown key `full_stroke` in [coverage]",
        ),
        (
            "terms.m_kg",
            "terms.mass",
            "24: unknown key `mass` in [terms]",
        ),
        (
            "standard_error = 0.02",
            "standard_error = -1",
            "26: `terms.m_kg.standard_error` has to be 0 or more, not -1",
        ),
    ] {
        let text = third();
        assert!(text.contains(from), "{from}");
        let (realization, findings) = parse("a.toml", &text.replacen(from, to, 1));
        assert!(realization.is_none(), "{to}");
        let line = |f: &Fault| {
            f.span
                .as_ref()
                .map_or(0, |s| findings.line_and_column(s.start).0)
        };
        let found: Vec<String> = (findings.faults.iter())
            .map(|f| format!("{}: {}", line(f), f.message))
            .collect();
        assert!(
            found.iter().any(|f| f == expected),
            "{expected}\n{found:#?}"
        );
    }
    // Older versions have none of it.
    for version in ["study-model/1\"\n#", "study-model/2\""] {
        let text = third().replacen("study-model/3\"\n", &format!("{version}\n"), 1);
        let (_, findings) = parse("a.toml", &text.replacen("#\nkind = \"table\"", "", 1));
        assert!(findings.has_errors(), "{version}");
        assert!(
            findings
                .faults
                .iter()
                .any(|f| f.message.contains("unknown key `coverage`"))
        );
    }
}

#[test]
fn invalid_toml_and_empty_text_are_faults() {
    for text in ["", "\0", "x_mm = [", "x_mm = 1\nx_mm = 2", "[[positive]]"] {
        let (realization, findings) = parse("a.toml", text);
        assert!(realization.is_none() && findings.has_errors(), "{text:?}");
    }
}

#[test]
fn names_of_recordings_may_contain_any_characters() {
    let (realization, _) = parse("a.toml", SMALL);
    let mut r = realization.unwrap();
    for name in ["a.b", "", "ü 1", "a\"b\\c\u{1b}\n", "\u{202e}x"] {
        r.vaf.insert(name.into(), 0.25);
        r.provenance.recordings.insert(name.into(), "ff".into());
    }
    r.provenance.note = Some("line\nline \"quoted\" \u{7f}".into());
    let text = write(&r);
    assert!(!text.contains(['\u{1b}', '\u{202e}', '\u{7f}']));
    let (back, findings) = parse("a.toml", &text);
    assert_eq!(findings.faults, []);
    assert_eq!(back, Some(r));
}

fn branches(nodes: usize) -> impl Strategy<Value = Branch> {
    let list = || {
        prop::collection::vec(
            prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO,
            nodes,
        )
    };
    (list(), list(), list(), list()).prop_map(|(m_kg, b_n_s_per_mm, k_n_per_mm, f0_n)| Branch {
        m_kg,
        b_n_s_per_mm,
        k_n_per_mm,
        f0_n,
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn every_realization_is_read_back_as_it_was_written(
        (x0, dx, positive, negative) in (2usize..20).prop_flat_map(|n| (
            -50.0f64..50.0,
            prop::collection::vec(1e-9f64..3.0, n),
            branches(n),
            branches(n),
        )),
        rule in 0usize..3,
        delta_mm in 1e-300f64..1e300,
        vaf in -1e300f64..=1.0,
    ) {
        let mut x_mm = vec![x0];
        x_mm.extend(dx[1..].iter().scan(x0, |x, dx| { *x += dx; Some(*x) }));
        let r = Realization {
            id: "p".into(),
            provenance: Provenance { method: "x".into(), ..Provenance::default() },
            vaf: [("v".to_owned(), vaf)].into(),
            lookup: [Lookup::Linear, Lookup::Floor, Lookup::Nearest][rule],
            direction: match rule {
                0 => Direction::Sign,
                1 => Direction::Play { delta_mm },
                _ => Direction::Dahl { delta_mm },
            },
            trained: Trained { x_mm: [x_mm[0], x_mm[x_mm.len() - 1]], v_mm_s: delta_mm },
            x_mm, positive, negative,
            mechanism: None,
            elements: None,
            units: Units::Linear,
        };
        let (back, findings) = parse("p.toml", &write(&r));
        prop_assert_eq!(&findings.faults, &[]);
        prop_assert_eq!(back, Some(r));
    }
}

/// Elements with every kind of spring.
fn with_elements() -> Realization {
    let elements = Elements {
        mass_kg: 0.02,
        x_mm: vec![1.0, 2.5, 4.0],
        force_n: vec![0.5, -0.25, 1.0],
        damping_n_s_per_mm: [vec![0.0, 0.001, 0.0], vec![0.002; 3]],
        springs: vec![
            Spring::Stop { slip_mm: 0.2 },
            Spring::Maxwell {
                slip_mm: 3.0,
                relaxation_s: 0.05,
            },
            Spring::Latch {
                rearm_mm: 1.5,
                break_mm: 3.0,
            },
        ],
        spring_n: vec![vec![0.3, 0.0, 0.1], vec![1.0; 3], vec![0.0, 2.0, 0.5]],
    };
    let provenance = Provenance {
        method: "elements".to_owned(),
        ..Provenance::default()
    };
    let trained = Trained {
        x_mm: [0.5, 4.25],
        v_mm_s: 80.0,
    };
    Realization::of_elements("e".into(), provenance, BTreeMap::new(), trained, elements)
}

#[test]
fn elements_are_written_and_read_in_any_units() {
    let linear = with_elements();
    // what they are in slow motion
    assert_eq!(linear.positive.f0_n, [0.5 + 0.3, -0.25 + 2.0, 1.0 + 0.1]);
    assert_eq!(linear.negative.f0_n, [0.5 - 0.3, -0.25, 1.0 - 0.1]);
    let turned = linear.clone().turned(Units::Radians, 20.0);
    for one in [linear, turned] {
        let text = write(&one);
        let head = "format = \"study-model/3\"\nkind = \"elements\"\n";
        assert!(text.starts_with(head), "{text}");
        let (back, findings) = parse("a.toml", &text);
        assert_eq!(findings.faults, []);
        assert_eq!(write(&back.unwrap()), text);
    }
}

/// The file as it was first written: later versions read it and write the same bytes.
#[test]
fn the_golden_file_of_elements_is_read_and_written_as_ever() {
    let golden = include_str!("../../../tests/data/elements.toml");
    let mut expected = with_elements();
    expected.provenance.coverage = Some(Coverage {
        full_strokes: 12,
        partial_strokes: 5,
        ..Coverage::empty(expected.trained.x_mm, 80.0, 3, 2)
    });
    for (x_mm, v_mm_s) in [(1.0, 30.0), (2.0, -70.0)] {
        let coverage = expected.provenance.coverage.as_mut().unwrap();
        coverage.add(x_mm, v_mm_s);
    }
    let (read, findings) = parse("elements.toml", golden);
    assert_eq!(findings.faults, []);
    assert_eq!(read, Some(expected.clone()));
    assert_eq!(write(&expected), golden);
}

#[test]
fn every_fault_of_elements_is_named() {
    let text = write(&with_elements());
    for (from, to, expected) in [
        (
            "0.3, 0.0, 0.1",
            "0.3, -0.5, 0.1",
            "with a negative value the element would not be passive",
        ),
        ("0.3, 0.0, 0.1", "0.3, 0.0", "has 2 numbers for 3 positions"),
        (
            "mass_kg = 0.02",
            "mass_kg = -0.02",
            "has to be 0 or more, not -0.02",
        ),
        (
            "break_mm = 3.0",
            "break_mm = 1.5",
            "has to break above the position where it holds again",
        ),
        (
            "slip_mm = 0.2",
            "slip_mm = 0.0",
            "has to be a finite number above zero",
        ),
        ("kind = \"stop\"", "kind = \"spring\"", "`spring`"),
        ("study-model/3", "study-model/2", "`elements`"),
    ] {
        assert!(text.contains(from), "{from}\n{text}");
        let (realization, findings) = parse("a.toml", &text.replacen(from, to, 1));
        assert!(realization.is_none(), "{to}");
        let named = findings
            .faults
            .iter()
            .any(|fault| fault.message.contains(expected));
        assert!(named, "{to}: {:?}", findings.faults);
    }
}
