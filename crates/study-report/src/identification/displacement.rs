//! Force over displacement of a slow press and release: measured, repeated and played.

use super::{Drawing, Shown, both, points, zero_line};
use crate::chart::{Axis, Figure, Look, Mark, PALETTE, Panel};
use std::fmt::Write as _;
use study_haptics::identify::repetition::{Curve, Loops};
use study_haptics::model::Realization;
use study_haptics::recording::Recording;

/// The mean force of all loops of the force curves over the displacement, that of the realization
/// moved in the same way, and a band of one rms difference of two repetitions around the mean. `None`
/// if no recording is a force curve.
pub fn displacement(
    realization: &Realization,
    recordings: &[&Recording],
    shown: Shown,
) -> Option<Drawing> {
    let loops = Loops::of(recordings)?;
    let (mean, difference) = loops.mean(loops.range_mm)?;
    let played = loops.played(realization, loops.range_mm)?;
    let x: Vec<f64> = (Loops::positions(loops.range_mm).into_iter())
        .map(|mm| shown.length(mm))
        .collect();
    let sides = |curve: &Curve| {
        (curve.0.clone()).map(|side| {
            side.into_iter()
                .map(|n| shown.force(n))
                .collect::<Vec<f64>>()
        })
    };
    let (mean, played) = (sides(&mean), sides(&played));
    let band = difference.as_ref().map(sides);
    let all = (mean.iter().chain(&played)).flatten().copied();
    let mut panel = Panel::new(
        Axis::around(&shown.position(), x.iter().copied()),
        Axis::around(&shown.of_force("", "F"), all.chain([0.0])),
    );
    for (side, band) in band.iter().flatten().enumerate() {
        let edges = (x.iter().zip(&mean[side]).zip(band)).map(|((x, f), d)| (*x, f - d, f + d));
        let mut look = Look::plain(PALETTE[0]);
        look.opacity = 0.2;
        let mark = Mark::Area(edges.collect());
        panel = match side {
            0 => panel.named("two repetitions differ by", look, mark),
            _ => panel.with(look, mark),
        };
    }
    let [measured, other] = both();
    panel = panel
        .named("measured", measured, points(&x, &mean[0]))
        .with(measured, points(&x, &mean[1]))
        .named("played", other, points(&x, &played[0]))
        .with(other, points(&x, &played[1]));
    zero_line(&mut panel);
    let columns = ["press_n", "release_n", "played_press_n", "played_release_n"];
    let mut heads: Vec<String> = [&["x_mm"][..], &columns[..]]
        .concat()
        .into_iter()
        .map(|key| shown.column(key))
        .collect();
    if band.is_some() {
        let of_band = ["press_difference_n", "release_difference_n"];
        heads.extend(of_band.map(|key| shown.column(key)));
    }
    let mut csv = heads.join(",") + "\n";
    for (i, x) in x.iter().enumerate() {
        let _ = write!(csv, "{x}");
        for side in mean.iter().chain(&played).chain(band.iter().flatten()) {
            let _ = write!(csv, ",{}", side[i]);
        }
        csv.push('\n');
    }
    Some(Drawing {
        name: "force-displacement",
        figure: Figure::new(
            "displacement",
            "Force over displacement, measured and played, press above release",
            820.0,
            480.0,
        )
        .with(panel),
        csv,
    })
}
