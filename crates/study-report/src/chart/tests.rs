//! What every figure keeps to.

use super::*;

fn sample() -> Figure {
    let names = ["a", "b", "c"];
    Figure::new("fig", "three means", 400.0, 240.0).with(
        Panel::new(
            Axis::of_names("lambda", &names),
            Axis::new("rating", 1.0, 7.0),
        )
        .titled("means")
        .named(
            "mean",
            Look::nth(0),
            Mark::Points(vec![(0.0, 2.0), (1.0, f64::NAN), (2.0, 1e308)]),
        )
        .with(
            Look::nth(1),
            Mark::Bars(vec![Span {
                x: (0.0, 1.0),
                y: (1.0, 3.0),
            }]),
        )
        .note(Note::new((1.0, 4.0), "here")),
    )
}

#[test]
fn equal_figures_give_equal_bytes() {
    assert_eq!(sample().picture().to_svg(), sample().picture().to_svg());
}

#[test]
fn what_is_not_finite_is_not_drawn_and_what_is_far_out_stays_near() {
    let svg = sample().picture().to_svg();
    assert_eq!(svg.matches("h0").count(), 3, "two and the legend's");
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    assert!(!svg.split('"').any(|part| part.len() > 400), "{svg}");
}

#[test]
fn hostile_text_stays_text() {
    let evil = "</text><script>alert(1)</script>\" onload='x' \u{202e}]]>&\u{0}\u{ffff}";
    let mut figure = sample();
    figure.title = evil.to_owned();
    figure.panels[0].title = evil.to_owned();
    figure.panels[0].x.label = evil.to_owned();
    figure.panels[0].x.ticks = Ticks::At(vec![(0.0, evil.to_owned())]);
    figure.panels[0].series[0].name = Some(evil.to_owned());
    figure.panels[0].notes[0].text = evil.to_owned();
    let svg = figure.picture().to_svg();
    assert!(!svg.contains("<script") && !svg.contains("]]>"), "{svg}");
    assert!(!svg.contains("onload='"), "{svg}");
    assert!(
        !svg.chars()
            .any(|c| c != '\n' && study_base::text::is_unsafe(c))
    );
}

#[test]
fn ids_begin_with_the_figures_own_and_are_unique() {
    let mut figure = sample();
    figure.panels.push(figure.panels[0].clone());
    let svg = figure.picture().to_svg();
    let ids: Vec<&str> = svg
        .split(" id=\"")
        .skip(1)
        .filter_map(|rest| rest.split('"').next())
        .collect();
    let distinct: std::collections::BTreeSet<&&str> = ids.iter().collect();
    assert_eq!(ids.len(), distinct.len());
    assert!(ids.len() >= 3 && ids.iter().all(|id| id.starts_with("fig-")));
}

#[test]
fn an_isometric_panel_has_the_same_unit_on_both_axes() {
    for (x, y) in [((-30.0, 50.0), (0.0, 7.0)), ((0.0, 1.0), (-400.0, 900.0))] {
        let panel = Panel::new(Axis::new("x", x.0, x.1), Axis::new("y", y.0, y.1));
        let mut figure = Figure::new("f", "", 700.0, 300.0).with(panel.clone());
        figure = figure.with(panel);
        figure.columns = 2;
        let figure = figure.isometric();
        for (panel, frame) in figure.panels.iter().zip(frame::frames(&figure)) {
            let unit = |px: f64, axis: &Axis| px / (axis.high - axis.low);
            let across = unit(frame.right - frame.left, &panel.x);
            let up = unit(frame.bottom - frame.top, &panel.y);
            assert!((across / up - 1.0).abs() < 0.01, "{across} {up}");
            let has = |axis: &Axis, range: (f64, f64)| {
                axis.low <= range.0 + 1e-9 && axis.high >= range.1 - 1e-9
            };
            assert!(has(&panel.x, x) && has(&panel.y, y));
        }
    }
}

#[test]
fn scales_darken_all_the_way() {
    let luminances = |scale: Scale, from: f64, to: f64| -> Vec<f64> {
        let at = |i| from + (to - from) * f64::from(i) / 20.0;
        (0..=20).map(|i| scale.color(at(i)).luminance()).collect()
    };
    let diverging = Scale::diverging(4.0);
    for all in [
        luminances(Scale::ascending(2.0, 3.0), 2.0, 3.0),
        luminances(diverging, 0.0, 4.0),
        luminances(diverging, 0.0, -4.0),
    ] {
        assert!(all.windows(2).all(|w| w[1] < w[0]), "{all:?}");
    }
    assert_ne!(diverging.color(4.0), diverging.color(-4.0));
    assert_eq!(diverging.color(9.0), diverging.color(4.0));
}

#[test]
fn neighbors_in_the_palette_differ_in_gray() {
    for pair in PALETTE.windows(2) {
        let (a, b) = (pair[0].luminance() + 0.05, pair[1].luminance() + 0.05);
        assert!(a.max(b) / a.min(b) > 1.25, "{pair:?}: {a} {b}");
    }
    // Marks need a contrast of 3 to white paper (WCAG 2.1, 1.4.11); the lighter
    // ones are never text.
    for color in PALETTE {
        assert!(1.05 / (color.luminance() + 0.05) > 2.6, "{color:?}");
    }
}

#[test]
fn names_that_have_no_room_are_turned_and_thinned() {
    let names: Vec<String> = (0..100).map(|i| format!("realization-{i}")).collect();
    let panel = Panel::new(Axis::of_names("", &names), Axis::new("", 0.0, 1.0));
    let figure = Figure::new("f", "", 400.0, 200.0).with(panel);
    let shown = figure.picture().to_svg().matches("rotate(-90").count();
    assert!((10..=30).contains(&shown), "{shown}");
}

#[test]
fn what_stands_on_a_color_can_be_read() {
    let scales = [Scale::ascending(-1.0, 1.0), Scale::diverging(1.0)];
    let values = (-100..=100).map(|i| f64::from(i) / 100.0);
    for paper in values.flat_map(|v| scales.map(|scale| scale.color(v))) {
        let (a, b) = (paper.luminance() + 0.05, paper.text_on().luminance() + 0.05);
        assert!(a.max(b) / a.min(b) >= 4.5, "{paper:?}");
    }
}

#[test]
fn sixty_four_series_look_different() {
    let looks = (0..64).map(|n| {
        (
            Look::nth(n).color.hex(),
            format!("{:?}", Look::nth(n).shape),
        )
    });
    let distinct: std::collections::BTreeSet<_> = looks.collect();
    assert_eq!(distinct.len(), 64);
}

#[test]
fn a_text_is_measured_as_it_is_shown() {
    let wide = "\u{1b}[31m";
    assert_eq!(text_width(wide, 10.0), text_width("\\u{1b}[31m", 10.0));
    assert!(shortened(&"\u{202e}".repeat(20), 24).chars().count() <= 24);
}

#[test]
fn panels_that_are_compared_are_equally_high() {
    let panel = |label: &str| Panel::new(Axis::new(label, 0.0, 1.0), Axis::new("n", 0.0, 1.0));
    let mut figure = Figure::new("f", "", 400.0, 400.0);
    figure.columns = 2;
    figure.panels = ["", "", "x", "x"].map(panel).to_vec();
    let heights: Vec<f64> = (frame::frames(&figure).iter())
        .map(|f| f.bottom - f.top)
        .collect();
    assert!(heights.windows(2).all(|h| h[0] == h[1]), "{heights:?}");
}

#[test]
fn turned_names_are_whole_and_do_not_run_into_each_other() {
    for n in 4..40 {
        let names: Vec<String> = (0..n).map(|i| format!("lambda-0.{i:04}-dx-1")).collect();
        let panel = Panel::new(Axis::of_names("", &names), Axis::new("", 0.0, 1.0));
        let figure = Figure::new("f", "", 344.0, 300.0).with(panel);
        let frame = &frame::frames(&figure)[0];
        let apart = (frame.right - frame.left) / frame.x_ticks.len() as f64;
        assert!(frame.turned && apart >= 12.9, "{n} names: {apart}");
        assert!(frame.x_ticks.iter().all(|(_, l)| names.contains(l)));
    }
}

/// The texts of labels with their boxes.
fn crowd(n: usize, name: &str) -> (Figure, Vec<labels::Place>) {
    let mut panel = Panel::new(Axis::new("", 0.0, 1.0), Axis::new("", 1.0, 7.0));
    let at: Vec<(f64, f64)> = (0..n)
        .map(|i| (0.5 + 0.01 * (i % 7) as f64, 4.0 + 0.05 * (i % 5) as f64))
        .collect();
    panel.labels = (at.iter().enumerate())
        .map(|(i, at)| Label {
            at: *at,
            text: format!("{name}{i}"),
        })
        .collect();
    let panel = panel.with(Look::nth(0), Mark::Points(at));
    let figure = Figure::new("f", "", 378.0, 300.0).with(panel);
    let frame = frame::frames(&figure).remove(0);
    let places = labels::places(&figure.panels[0], &frame);
    (figure, places)
}

#[test]
fn labels_of_crowded_points_do_not_overlap() {
    for (n, name) in [(2, "m"), (6, "lambda-0.999"), (12, "model"), (35, "")] {
        let (figure, places) = crowd(n, name);
        assert!(figure.labels_fit(), "{n} {name}");
        assert_eq!(places.len(), n);
        for (i, a) in places.iter().enumerate() {
            assert!(
                places[i + 1..]
                    .iter()
                    .all(|b| !labels::overlap(&a.area, &b.area))
            );
        }
    }
    // What has no place is not drawn over others.
    let (figure, places) = crowd(60, "a name that is far too long");
    assert!(!figure.labels_fit());
    let free = places.iter().filter(|p| p.is_free).count();
    assert_eq!(figure.picture().to_svg().matches("a name").count(), free);
}

#[test]
fn names_that_begin_alike_stay_apart_when_cut() {
    let names = [
        "lambda-0.9995-dx-1",
        "lambda-0.99995-dx-1",
        "lambda-0.99998-dx-1",
    ];
    let cut = names.map(|n| shortened(n, 15));
    let distinct: std::collections::BTreeSet<_> = cut.iter().collect();
    assert_eq!(distinct.len(), 3, "{cut:?}");
    assert!(cut.iter().all(|c| c.chars().count() <= 15), "{cut:?}");
}

#[test]
fn dots_in_one_place_are_drawn_once() {
    // A probe that rests: 500 samples within a hundredth of the axis, and one apart.
    let mut points: Vec<(f64, f64)> = (0..500).map(|i| (0.5, 0.5 + 1e-6 * f64::from(i))).collect();
    points.push((0.9, 0.9));
    let panel = Panel::new(Axis::new("", 0.0, 1.0), Axis::new("", 0.0, 1.0));
    let panel = panel.with(Look::nth(0), Mark::Dots(points));
    let svg = Figure::new("f", "", 400.0, 200.0)
        .with(panel)
        .picture()
        .to_svg();
    assert_eq!(svg.matches("h0").count(), 2);
}

#[test]
fn a_note_about_the_data_is_in_the_picture() {
    let mut picture = sample().picture();
    assert!(!picture.to_svg().contains("<desc>"));
    picture.set_note("a < b \u{202e}");
    assert!(picture.to_svg().contains("<desc>a &lt; b \\u{202e}</desc>"));
}
