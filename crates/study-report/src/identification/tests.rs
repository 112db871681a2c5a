//! Figures of small tables.

mod first;

use super::*;
use crate::chart::Mark;
use study_haptics::model::{Branch, Provenance, Trained};
use study_wire::predict::{Direction, Lookup};

fn realization(scale: f64) -> Realization {
    let branch = |f: f64| Branch {
        m_kg: vec![0.1 * scale; 3],
        b_n_s_per_mm: vec![0.01, 0.02, 0.03],
        k_n_per_mm: vec![0.0, 1.0, -1.0],
        f0_n: vec![f, 0.0, -f],
    };
    Realization {
        id: "r".into(),
        provenance: Provenance::default(),
        vaf: std::collections::BTreeMap::new(),
        lookup: Lookup::Linear,
        direction: Direction::Sign,
        trained: Trained {
            x_mm: [0.0, 2.0],
            v_mm_s: 50.0,
        },
        x_mm: vec![0.0, 1.0, 2.0],
        positive: branch(scale),
        negative: branch(-1.0),
        mechanism: None,
        elements: None,
        units: Units::Linear,
    }
}

fn grid() -> Vec<GridCell> {
    let mut places = Vec::new();
    for lambda in [0.999, 0.9995] {
        for (dx_mm, vaf) in [(0.5, 0.95), (1.0, 0.9), (4.0, -11.0)] {
            places.push(GridCell {
                value: lambda,
                memory_mm: Some(1.5),
                dx_mm,
                vaf,
            });
        }
    }
    places
}

#[test]
fn the_surface_has_a_box_and_a_row_for_every_cell() {
    let drawing = surface(Row::Lambda, &grid(), Some(0), "a < b", Shown::LINEAR).unwrap();
    assert_eq!(drawing.csv.lines().count(), 7);
    assert_eq!(drawing.csv.lines().nth(1), Some("0.999,1.5,0.5,0.95"));
    let svg = drawing.figure.picture().to_svg();
    assert!(svg.contains("a &lt; b"), "the name of a recording is text");
    assert!(svg.contains("-11"));
    assert!(svg.contains("VAF; all below 0.45 in one color"), "{svg}");
    // a white rim around the white letters of dark cells would hide them
    assert!(drawing.figure.panels[0].notes.iter().all(|note| !note.rim));
}

#[test]
fn a_line_is_no_surface() {
    assert!(surface(Row::Lambda, &grid()[..3], None, "r", Shown::LINEAR).is_none());
    assert!(map(&[(0.999, &realization(1.0))], Shown::LINEAR).is_none());
}

#[test]
fn tables_beside_figures_have_their_units_in_the_heads() {
    let (one, two) = (realization(1.0), realization(2.0));
    let map = map(&[(0.9995, &two), (0.999, &one)], Shown::LINEAR).unwrap();
    assert_eq!(
        map.csv.lines().take(2).collect::<Vec<_>>(),
        [
            "lambda,x_mm,m_kg,b_n_s_per_mm,k_n_per_mm,f0_n",
            "0.999,0,0.1,0.01,0,1"
        ]
    );
    assert_eq!(map.csv.lines().count(), 7);
    let five = parameters(&one, Shown::LINEAR);
    assert!(five.csv.starts_with(
        "x_mm,positive_m_kg,positive_b_n_s_per_mm,positive_k_n_per_mm,positive_f0_n,negative_m_kg"
    ));
    assert_eq!(
        five.csv.lines().nth(1),
        Some("0,0.1,0.01,0,1,0.1,0.01,0,-1")
    );
}

#[test]
fn force_over_time_shows_some_seconds_and_its_prediction() {
    let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
    for i in 0..6000 {
        let t = f64::from(i) * 0.001;
        let _ = writeln!(text, "{},{},5,0,{}", 10.0 + t, 1.0 + t.sin(), t.cos());
    }
    let recording = study_haptics::recording::read("r", text.as_bytes()).unwrap();
    let drawing = force(&realization(1.0), &recording, Shown::LINEAR);
    let last = drawing.csv.lines().last().unwrap();
    let t: f64 = last.split(',').next().unwrap().parse().unwrap();
    assert!((3.9..=4.0).contains(&t), "{last}");
    assert!(drawing.csv.lines().count() <= MAX_POINTS + 1);
    let spectra = spectra(&realization(1.0), &recording, Shown::LINEAR).unwrap();
    assert!(spectra.csv.lines().count() > 100);
}

/// Degrees at a lever arm: labels, values and heads of the tables.
#[test]
fn a_turning_handle_is_drawn_in_its_units() {
    let shown = Shown {
        units: Units::Degrees,
        lever_mm: 180.0 / std::f64::consts::PI,
    };
    // 1 mm is 1 degree at this lever, and 1 N is 0.0573 N·m
    let five = parameters(&realization(1.0), shown);
    assert!(
        five.csv
            .starts_with("x_deg,positive_m_kg_m2,positive_b_nm_s_per_deg")
    );
    let row: Vec<f64> = (five.csv.lines().nth(2).unwrap().split(','))
        .map(|n| n.parse().unwrap())
        .collect();
    assert!((row[0] - 1.0).abs() < 1e-9, "{row:?}");
    assert!((row[3] - 0.057_295_78).abs() < 1e-6, "{row:?}");
    let svg = five.figure.picture().to_svg();
    assert!(
        svg.contains("angle θ (deg)") && svg.contains("stiffness k (N·m/deg)"),
        "{svg}"
    );
    assert!(!svg.contains("(mm)") && !svg.contains("/mm"), "{svg}");
    let cells: Vec<GridCell> = (grid().into_iter())
        .map(|cell| GridCell {
            value: cell.value - 0.9,
            ..cell
        })
        .collect();
    let four = surface(Row::Delta, &cells, None, "r", shown).unwrap();
    assert!(
        four.csv.starts_with("delta_deg,dx_deg,vaf\n"),
        "{}",
        four.csv
    );
    assert!(four.figure.picture().to_svg().contains("δ (deg)"));
}

/// A table without stiffness shows the slope of its offset; where 0 lies within an axis, a
/// line is there; one legend serves all.
#[test]
fn a_hat_table_shows_its_slope() {
    let mut table = realization(1.0);
    for branch in [&mut table.positive, &mut table.negative] {
        branch.k_n_per_mm = vec![0.0; 3];
    }
    table.negative.m_kg = vec![0.2; 3];
    let figure = parameters(&table, Shown::LINEAR).figure;
    assert_eq!(
        figure.panels[2].y.label,
        "slope of the offset dF0/dx (N/mm)"
    );
    let Mark::Line(slopes) = &figure.panels[2].series[1].mark else {
        panic!("no line");
    };
    assert_eq!(slopes, &[(0.5, -1.0), (1.5, -1.0)]);
    let named = |p: &Panel| p.series.iter().filter(|s| s.name.is_some()).count();
    let legends: Vec<usize> = figure.panels.iter().map(named).collect();
    assert_eq!(legends, [2, 0, 0, 0]);
    let masses = figure.panels[0].series.iter().filter_map(|s| {
        let Mark::Line(points) = &s.mark else {
            return None;
        };
        Some((s.name.as_deref()?, points[0].1))
    });
    let masses: Vec<(&str, f64)> = masses.collect();
    assert_eq!(masses, [("v > 0", 0.1), ("v < 0", 0.2)]);
    let titles: Vec<&str> = figure.panels.iter().map(|p| p.title.as_str()).collect();
    assert_eq!(titles, ["a", "b", "c", "d"]);
    let Mark::Line(zero) = &figure.panels[3].series[0].mark else {
        panic!("no line");
    };
    assert!(zero.iter().all(|(_, y)| *y == 0.0));
}

#[test]
fn a_mechanism_shows_its_detents_its_friction_and_the_loop() {
    let profile = |n: [f64; 3]| study_haptics::model::Profile {
        first_mm: 0.0,
        step_mm: 1.0,
        n: n.to_vec(),
    };
    let mut scalars = study_wire::mechanism::Scalars::from_array([0.1; 13]);
    scalars.contact_n_per_mm = 10.0;
    let mut r = realization(1.0);
    r.mechanism = Some(study_haptics::model::Mechanism {
        scalars,
        detent: profile([0.0, 2.0, -1.0]),
        friction: profile([1.0, 1.0, 1.0]),
        recorded_hz: None,
    });
    let mut text = String::from("t_s,x_mm,f_n\n");
    for i in 0..500 {
        let t = f64::from(i) * 0.002;
        let _ = writeln!(text, "{t},{},{}", 1.0 + (6.0 * t).sin(), (6.0 * t).cos());
    }
    let recording = study_haptics::recording::read("r", text.as_bytes()).unwrap();
    let drawing = mechanism(&r, &recording, Shown::LINEAR).unwrap();
    assert_eq!(drawing.csv.lines().next(), Some("y_mm,detent_n,friction_n"));
    // at its nodes the spline has the values of the file
    let rows: Vec<&str> = drawing.csv.lines().skip(1).collect();
    assert_eq!([rows[0], rows[8], rows[16]], ["0,0,1", "1,2,1", "2,-1,1"]);
    let labels: Vec<&str> = (drawing.figure.panels.iter())
        .map(|p| p.y.label.as_str())
        .collect();
    assert_eq!(
        labels,
        ["detent force (N)", "friction force (N)", "force F (N)"]
    );
    let Mark::Line(measured) = &drawing.figure.panels[2].series[1].mark else {
        panic!("no line");
    };
    assert_eq!(measured.len(), 500);
    assert_eq!(measured[0], (1.0, 1.0));
    assert!(mechanism(&realization(1.0), &recording, Shown::LINEAR).is_none());
}
