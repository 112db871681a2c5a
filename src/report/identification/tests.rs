//! Figures of small tables.

use super::*;
use study_haptics::model::{Provenance, Trained};
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
        units: study_haptics::model::Units::Linear,
    }
}

fn grid() -> Vec<GridCell> {
    let mut places = Vec::new();
    for lambda in [0.999, 0.9995] {
        for (dx_mm, vaf) in [(0.5, 0.95), (1.0, 0.9), (4.0, -11.0)] {
            places.push(GridCell {
                lambda,
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
    let drawing = surface(&grid(), Some(0), "a < b").unwrap();
    assert_eq!(drawing.csv.lines().count(), 7);
    assert_eq!(drawing.csv.lines().nth(1), Some("0.999,1.5,0.5,0.95"));
    let svg = drawing.figure.to_svg();
    assert!(svg.contains("a &lt; b"), "the name of a recording is text");
    assert!(svg.contains("-11"));
    // a white rim around the white letters of dark cells would hide them
    assert!(drawing.figure.panels[0].notes.iter().all(|note| !note.rim));
}

#[test]
fn a_line_is_no_surface() {
    assert!(surface(&grid()[..3], None, "r").is_none());
    assert!(map(&[(0.999, &realization(1.0))]).is_none());
}

#[test]
fn tables_beside_figures_have_their_units_in_the_heads() {
    let (one, two) = (realization(1.0), realization(2.0));
    let map = map(&[(0.9995, &two), (0.999, &one)]).unwrap();
    assert_eq!(
        map.csv.lines().take(2).collect::<Vec<_>>(),
        [
            "lambda,x_mm,m_kg,b_n_s_per_mm,k_n_per_mm,f0_n",
            "0.999,0,0.1,0.01,0,1"
        ]
    );
    assert_eq!(map.csv.lines().count(), 7);
    let five = parameters(&one);
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
    let drawing = force(&realization(1.0), &recording);
    let last = drawing.csv.lines().last().unwrap();
    let t: f64 = last.split(',').next().unwrap().parse().unwrap();
    assert!((3.9..=4.0).contains(&t), "{last}");
    assert!(drawing.csv.lines().count() <= MAX_POINTS + 1);
    let spectra = spectra(&realization(1.0), &recording);
    assert!(spectra.csv.lines().count() > 100);
}
