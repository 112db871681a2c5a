//! The figures that are looked at first.

use super::realization;
use crate::chart::{Mark, Panel};
use crate::identification::{
    Bin, ByPosition, Compared, Coverage, Shown, coverage, displacement, methods, page, parameters,
    terminal,
};
use std::fmt::Write as _;
use study_haptics::model::Realization;
use study_haptics::recording::{Recording, read};

/// Up and down 2 mm twice at 1 mm/s, with the force of the model plus 0.25 N up and minus 0.5 N down.
/// Nothing is recorded from 1.0 to 1.2 mm on the way down.
fn recording(model: &Realization) -> Recording {
    let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
    for i in 0..1600 {
        let phase = f64::from(i % 800) / 400.0;
        let (x, v) = match phase < 1.0 {
            true => (2.0 * phase, 1.0),
            false => (2.0 * (2.0 - phase), -1.0),
        };
        if v < 0.0 && (1.0..1.21).contains(&x) {
            continue;
        }
        let branch = if v > 0.0 {
            &model.positive
        } else {
            &model.negative
        };
        // linear between the nodes at 0, 1 and 2 mm
        let at = |values: &[f64]| {
            let low = (x as usize).min(1);
            values[low] + (x - low as f64) * (values[low + 1] - values[low])
        };
        let force = at(&branch.b_n_s_per_mm) * v + at(&branch.k_n_per_mm) * x + at(&branch.f0_n);
        let error = if v > 0.0 { 0.25 } else { -0.5 };
        let _ = writeln!(text, "{},{x},{v},0,{}", f64::from(i) * 0.005, force + error);
    }
    read("r", text.as_bytes()).unwrap()
}

/// Slow presses of 4 mm with these forces at the end.
fn presses(tops: &[f64]) -> Recording {
    let mut text = String::from("# measured force curve: a test\nt_s,x_mm,f_n\n");
    let mut t = 0;
    for top in tops {
        for i in (0..400).chain((0..400).rev()) {
            let x = f64::from(i) / 100.0;
            let _ = writeln!(text, "{t},{x},{}", top * x / 4.0);
            t += 1;
        }
    }
    read("r", text.as_bytes()).unwrap()
}

#[test]
fn the_residual_by_position_is_what_the_model_lacks() {
    let model = realization(1.0);
    let found = ByPosition::of(&model, &[], &recording(&model), Some(0.1));
    assert!(!found.is_press);
    for (side, error) in [(0, 0.25), (1, -0.5)] {
        for bin in found.sides[side].iter().flatten() {
            assert!((bin.residual_n() - error).abs() < 1e-9, "{side} {bin:?}");
            assert!(bin.deviation_n.unwrap() < 1e-6, "{bin:?}");
            // that of single recordings times √2
            assert!((bin.difference_n.unwrap() - 0.1 * 2.0_f64.sqrt()).abs() < 1e-12);
        }
    }
    // 0.2 of 2 mm are a tenth of the bins
    let empty = |side: usize| found.sides[side].iter().filter(|bin| bin.is_none()).count();
    assert_eq!((empty(0), empty(1)), (0, 10));
    let drawing = displacement(&found, Shown::LINEAR);
    assert!(drawing.csv.starts_with(
        "x_mm,positive_n,negative_n,predicted_positive_n,predicted_negative_n,positive_residual_sd_n"
    ));
    let row = drawing
        .csv
        .lines()
        .find(|row| row.starts_with("1.09,"))
        .unwrap();
    assert_eq!(
        row.split(',').nth(2),
        Some(""),
        "no value where nothing was recorded: {row}"
    );
    // the line is interrupted there
    let interrupted = |panel: &Panel| {
        let lines = panel.series.iter().filter_map(|s| match &s.mark {
            Mark::Line(points) => Some(points.iter().filter(|p| p.1.is_nan()).count()),
            _ => None,
        });
        lines.filter(|count| *count > 0).count()
    };
    assert_eq!(
        drawing
            .figure
            .panels
            .iter()
            .map(interrupted)
            .collect::<Vec<_>>(),
        [2, 1]
    );
}

#[test]
fn a_press_is_compared_with_what_repetitions_differ_by() {
    let mut model = realization(1.0);
    model.x_mm = vec![0.0, 2.0, 4.0];
    for branch in [&mut model.positive, &mut model.negative] {
        branch.k_n_per_mm = vec![0.0; 3];
        branch.f0_n = vec![0.0, 0.3, 0.6];
    }
    let recording = presses(&[0.5, 0.6]);
    let found = ByPosition::of(&model, &[&recording], &recording, None);
    assert!(found.is_press);
    // the mean press has 0.55 N at the end, and the two differ by 0.1 N there
    for (x, bin) in found.x_mm.iter().zip(&found.sides[0]) {
        let bin = bin.unwrap();
        assert!(
            (bin.residual_n() + 0.05 * x / 4.0).abs() < 1e-3,
            "{x} {bin:?}"
        );
        assert!(
            (bin.difference_n.unwrap() - 0.1 * x / 4.0).abs() < 1e-3,
            "{x} {bin:?}"
        );
    }
    let residual = &displacement(&found, Shown::LINEAR).figure.panels[1];
    let names: Vec<&str> = residual
        .series
        .iter()
        .filter_map(|s| s.name.as_deref())
        .collect();
    assert_eq!(
        names,
        ["two repetitions differ by", "mean, press", "mean, release"]
    );
    // as far as 92 % of the travel, where two presses differ by 0.092 N
    assert!(
        (0.09..0.1).contains(&residual.y.high),
        "{}",
        residual.y.high
    );
    let text = terminal::displacement(&found, 80, Shown::LINEAR);
    assert!(text.contains("model: o press, + release"), "{text}");
    assert!(text.contains("two repetitions differ by 0.0"), "{text}");
    assert!(
        text.contains("0.596 │"),
        "three digits of a force below 1 N: {text}"
    );
    let widest = text.lines().map(|line| line.chars().count()).max();
    assert!(widest.unwrap() <= 80, "{text}");
}

/// Every mark of the model is in the row of its force.
#[test]
fn the_terminal_shows_both_directions_of_the_model() {
    let bin = |n: f64| {
        Some(Bin {
            measured_n: n,
            model_n: n,
            deviation_n: None,
            difference_n: None,
        })
    };
    let found = ByPosition {
        x_mm: (0..100).map(|i| 0.04 * (f64::from(i) + 0.5)).collect(),
        sides: [vec![bin(0.6); 100], vec![bin(0.2); 100]],
        samples: Vec::new(),
        is_press: true,
    };
    let text = terminal::displacement(&found, 120, Shown::LINEAR);
    let rows: Vec<&str> = text.lines().filter(|line| line.contains('│')).collect();
    assert!(rows[0].contains('o') && !rows[0].contains('+'), "{text}");
    assert!(rows[7].contains('+') && !rows[7].contains('o'), "{text}");
}

fn compared(method: &str, left_out: Option<[f64; 2]>, failed: Option<&str>) -> Compared {
    Compared {
        method: method.to_owned(),
        left_out,
        failed: failed.map(str::to_owned),
        is_recommended: method == "passive",
    }
}

#[test]
fn methods_that_fail_are_named_with_their_cause() {
    let all = [
        compared("friction", Some([0.34, 0.2]), None),
        compared("passive", Some([0.9889, 0.026]), None),
        compared("ewls", Some([-9.8, 1.5]), Some("worse than a constant")),
        compared("hat", Some([0.98, 0.03]), Some("its certificate fails")),
        compared("static", None, Some("parts do not determine it")),
    ];
    let drawing = methods(&all, Some(0.01), Shown::LINEAR).unwrap();
    let panel = &drawing.figure.panels[0];
    let of = |name: &str| {
        let series = panel
            .series
            .iter()
            .find(|s| s.name.as_deref() == Some(name));
        match &series.unwrap_or_else(|| panic!("{name}")).mark {
            Mark::Points(points) => points.clone(),
            _ => panic!("{name}"),
        }
    };
    assert_eq!(of("recommended"), [(0.026_f64.ln(), 1.0)]);
    assert_eq!(of("not recommended"), [(0.2_f64.ln(), 0.0)]);
    assert_eq!(of("failed: worse than a constant"), [(1.5_f64.ln(), 2.0)]);
    assert_eq!(of("failed: its certificate fails"), [(0.03_f64.ln(), 3.0)]);
    assert_eq!(of("failed: parts do not determine it"), []);
    let notes: Vec<&str> = panel.notes.iter().map(|note| note.text.as_str()).collect();
    assert_eq!(
        notes,
        ["VAF .3400", "VAF .9889", "VAF −9.8000", "VAF .9800", "none"]
    );
    assert_eq!(
        drawing.csv.lines().nth(3),
        Some("ewls,-9.8,1.5,false,worse than a constant")
    );
    assert!(methods(&all[4..], None, Shown::LINEAR).is_none());
}

/// A mass that is 0 everywhere has no scale, on which it would look like a measured one.
#[test]
fn a_parameter_that_was_left_out_has_no_scale() {
    let mut model = realization(1.0);
    model.positive.m_kg = vec![0.0; 3];
    model.negative.m_kg = vec![0.0; 3];
    let panels = parameters(&model, Shown::LINEAR).figure.panels;
    assert_eq!(panels[0].notes[0].text, "0 everywhere");
    assert!(panels[1].notes.is_empty());
}

#[test]
fn the_page_is_text_and_figures_in_two_widths() {
    let model = realization(1.0);
    let recording = presses(&[0.5, 0.6]);
    let found = ByPosition::of(&model, &[&recording], &recording, None);
    let drawings = [
        displacement(&found, Shown::LINEAR),
        parameters(&model, Shown::LINEAR),
    ];
    let text = page("<script>a\u{202e}", "VAF < 1\n\u{1b}[2J<b>", &drawings);
    assert!(!text.contains("<script") && !text.contains('\u{1b}') && !text.contains('\u{202e}'));
    assert!(text.contains("VAF &lt; 1\n"), "lines stay lines");
    assert_eq!(text.matches("<svg").count(), 4);
    let mut ids: Vec<&str> = (text.split(" id=\"").skip(1))
        .map(|rest| rest.split('"').next().unwrap())
        .collect();
    let count = ids.len();
    ids.sort_unstable();
    ids.dedup();
    assert_eq!(ids.len(), count, "an id is on the page once");
}

/// 40 samples a direction and place at 1 mm/s, nothing on the way down from 1.0 to 1.2 mm.
#[test]
fn coverage_counts_samples_by_position_speed_and_direction() {
    let recording = recording(&realization(1.0));
    let found = Coverage::of(&[&recording]).unwrap();
    assert_eq!(
        found.v_mm_s,
        [1.0, 2.0, 4.0, 8.0, 16.0, 32.0].map(|n| n / 32.0)
    );
    let all = |side: usize| found.samples[side].iter().flatten().sum::<u32>();
    assert_eq!(all(0) + all(1), u32::try_from(recording.len()).unwrap());
    // all in the class of the top speed
    assert_eq!(found.samples[0][5].iter().sum::<u32>(), 800);
    assert_eq!(found.samples[1][5][10], 0);
    assert_eq!(found.held_mm.len(), 2, "{:?}", found.held_mm);
    let drawing = coverage(&found, Shown::LINEAR);
    assert_eq!(drawing.csv.lines().count(), 1 + 2 * 6 * 20);
    assert!(
        drawing.csv.contains("\npositive,0,0.1,0.5,1,40\n"),
        "{}",
        drawing.csv
    );
    let names: Vec<&str> = (drawing.figure.panels[0].series.iter())
        .filter_map(|s| s.name.as_deref())
        .collect();
    assert!(names.contains(&"held at the value beside"), "{names:?}");
    let text = terminal::coverage(&found, 80, Shown::LINEAR);
    let rows: Vec<&str> = text.lines().filter(|line| line.contains('│')).collect();
    assert_eq!(rows.len(), 13, "{text}");
    assert!(
        rows[0].contains("+0.5 to +1 │░") && rows[0].contains('×'),
        "{text}"
    );
    assert!(
        rows[5].contains("0 to +0.031 │") && !rows[5].contains('░'),
        "{text}"
    );
    assert!(rows[11].trim_start().starts_with("−0.5 to −1 │"), "{text}");
    assert!(
        text.lines().all(|line| line.chars().count() <= 80),
        "{text}"
    );
}
