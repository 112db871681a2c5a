//! Fig. 5 of a mechanism: its detents, its friction and the loop of force and position.

use super::{Drawing, MAX_POINTS, SHOWN_S, Shown, both, letter, zero_line};
use crate::chart::{Axis, Figure, Look, Mark, Panel};
use std::fmt::Write as _;
use study_haptics::identify::vaf;
use study_haptics::model::{Mechanism, Realization};
use study_haptics::recording::Recording;

/// Points between two nodes of a profile.
const BETWEEN: usize = 8;

/// Fig. 5 of a realization that is a mechanism: the detent force D and the friction F_c of the
/// follower over its position, and the measured and the predicted force over the position of
/// the handle in the first seconds of a recording. `None` for a table.
pub fn mechanism(
    realization: &Realization,
    recording: &Recording,
    shown: Shown,
) -> Option<Drawing> {
    let m = realization.mechanism.as_ref()?;
    let rows = profiles(m);
    let column = |of: fn(&[f64; 3]) -> f64| rows.iter().map(of).collect::<Vec<f64>>();
    let x: Vec<f64> = column(|r| r[0])
        .into_iter()
        .map(|mm| shown.length(mm))
        .collect();
    let mut figure = Figure::new(
        "fig5",
        "Detents and friction of the mechanism, and force over position",
        820.0,
        820.0,
    );
    let profile = |n: usize, name: &str, values: Vec<f64>| {
        let values: Vec<f64> = values.into_iter().map(|f| shown.force(f)).collect();
        let position = shown.position().replacen(" x ", " of the follower y ", 1);
        let position = position.replacen(" θ ", " of the follower y ", 1);
        let mut panel = Panel::new(
            Axis::around(&position, x.iter().copied()),
            Axis::around(
                &shown.of_force(name, ""),
                values.iter().copied().chain([0.0]),
            ),
        )
        .titled(&letter(n))
        .with(both()[0], super::points(&x, &values));
        zero_line(&mut panel);
        panel
    };
    figure = figure
        .with(profile(0, "detent", column(|r| r[1])))
        .with(profile(1, "friction", column(|r| r[2])));
    let start = recording.t_s[0];
    let samples = recording.t_s.partition_point(|t| t - start <= SHOWN_S);
    let stride = samples.div_ceil(MAX_POINTS).max(1);
    let forces: Vec<(f64, [f64; 2])> = vaf::predict(realization, recording)
        .enumerate()
        .take(samples)
        .step_by(stride)
        .map(|(i, predicted)| {
            let x = shown.length(recording.x_mm[i]);
            (x, [recording.f_n[i], predicted].map(|n| shown.force(n)))
        })
        .collect();
    let line = |i: usize| Mark::Line(forces.iter().map(|(x, f)| (*x, f[i])).collect());
    let [measured, predicted] = both();
    let thin = |look: Look| look.stroke(1.2);
    let mut panel = Panel::new(
        Axis::around(&shown.position(), forces.iter().map(|(x, _)| *x)),
        Axis::around(
            &shown.of_force("", "F"),
            forces.iter().flat_map(|(_, f)| *f),
        ),
    )
    .titled(&format!(
        "{}  first {SHOWN_S} s of the recording",
        letter(2)
    ))
    .named("measured", thin(measured), line(0))
    .named("predicted", thin(predicted), line(1));
    zero_line(&mut panel);
    panel.share = 1.6;
    figure = figure.with(panel);
    let heads = ["y_mm", "detent_n", "friction_n"].map(|key| shown.column(key));
    let mut csv = heads.join(",") + "\n";
    for [y, detent, friction] in &rows {
        let [detent, friction] = [*detent, *friction].map(|n| shown.force(n));
        let _ = writeln!(csv, "{},{detent},{friction}", shown.length(*y));
    }
    Some(Drawing {
        name: "fig5-mechanism",
        figure,
        csv,
    })
}

/// Position of the follower in mm, D and F_c there in N.
fn profiles(m: &Mechanism) -> Vec<[f64; 3]> {
    let view = m.view();
    let last = (m.detent.n.len().saturating_sub(1)) * BETWEEN;
    (0..=last)
        .map(|i| {
            let y = m.detent.first_mm + m.detent.step_mm * i as f64 / BETWEEN as f64;
            [y, view.detent.spline_n(y), view.friction.linear_n(y)]
        })
        .collect()
}
