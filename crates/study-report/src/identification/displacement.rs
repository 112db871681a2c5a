//! Force over position in both directions, measured and of the model, and the residual beside what
//! repetitions differ by.

use super::position::{Bin, ByPosition};
use super::{Drawing, Shown, letter, zero_line};
use crate::chart::{Axis, Color, Dash, Figure, Look, Mark, PALETTE, Panel};
use std::fmt::Write as _;

/// Force over position, and the residual below it.
pub fn displacement(found: &ByPosition, shown: Shown) -> Drawing {
    let x: Vec<f64> = (found.x_mm.iter()).map(|mm| shown.length(*mm)).collect();
    let position = || Axis::around(&shown.position(), x.iter().copied());
    let line = |side: usize, of: fn(&Bin) -> f64| {
        let values = found.column(side, of).into_iter();
        // a bin without samples interrupts the line
        let forces = values.map(|n| n.map_or(f64::NAN, |n| shown.force(n)));
        Mark::Line(x.iter().copied().zip(forces).collect())
    };
    let area = |side: usize, edges: &dyn Fn(&Bin) -> Option<[f64; 2]>| {
        let bins = x.iter().zip(&found.sides[side]);
        let edges: Vec<(f64, f64, f64)> = bins
            .filter_map(|(x, bin)| {
                let [low, high] = edges(bin.as_ref()?)?.map(|n| shown.force(n));
                Some((*x, low, high))
            })
            .collect();
        (!edges.is_empty()).then_some(Mark::Area(edges))
    };
    let bins = || found.sides.iter().flatten().flatten();
    let forces = (bins().flat_map(|bin| [bin.measured_n, bin.model_n]))
        .chain(found.samples.iter().map(|(_, n)| *n))
        .chain([0.0]);
    let mut force = Panel::new(
        position(),
        Axis::around(&shown.of_force("", "F"), forces.map(|n| shown.force(n))),
    )
    .titled(&letter(0));
    if !found.samples.is_empty() {
        let dots = (found.samples.iter()).map(|(mm, n)| (shown.length(*mm), shown.force(*n)));
        let mut look = Look::plain(Color::GREY).stroke(1.5);
        look.opacity = 0.4;
        force = force.named("samples", look, Mark::Dots(dots.collect()));
    }
    let names = found.directions();
    for (side, look) in sides().into_iter().enumerate() {
        let mut pale = look.stroke(5.0).dashed(Dash::Solid);
        pale.opacity = 0.35;
        let name = format!("measured, {}", names[side]);
        force = force.named(&name, pale, line(side, |bin| bin.measured_n));
    }
    for (side, look) in sides().into_iter().enumerate() {
        let name = format!("model, {}", names[side]);
        force = force.named(&name, look, line(side, |bin| bin.model_n));
    }
    zero_line(&mut force);

    let extent = |bin: &Bin| bin.residual_n().abs() + bin.deviation_n.unwrap_or(0.0);
    // where the probe first touches and where it meets the stop, a residual may leave the axis
    let most = (found.inner()).map(|bin| extent(bin).max(bin.difference_n.unwrap_or(0.0)));
    let most = shown.force(1.05 * most.fold(0.0, f64::max));
    let mut residual = Panel::new(
        position(),
        Axis::new(&shown.of_force("residual", ""), -most, most),
    )
    .titled(&letter(1));
    let mut named = false;
    for side in [0, 1] {
        let band = |bin: &Bin| bin.difference_n.map(|n| [-n, n]);
        if let Some(mark) = area(side, &band) {
            let mut look = Look::plain(Color::GREY);
            look.opacity = 0.22;
            residual = match named {
                false => residual.named("two repetitions differ by", look, mark),
                true => residual.with(look, mark),
            };
            named = true;
        }
    }
    for (side, mut look) in sides().into_iter().enumerate() {
        let spread = |bin: &Bin| {
            let (middle, deviation) = (bin.residual_n(), bin.deviation_n?);
            Some([middle - deviation, middle + deviation])
        };
        look.opacity = 0.18;
        if let Some(mark) = area(side, &spread) {
            let name = format!("standard deviation, {}", names[side]);
            residual = residual.named(&name, look, mark);
        }
    }
    for (side, look) in sides().into_iter().enumerate() {
        let name = format!("mean, {}", names[side]);
        residual = residual.named(&name, look, line(side, Bin::residual_n));
    }
    zero_line(&mut residual);
    residual.share = 0.75;
    Drawing {
        name: "force-displacement",
        figure: Figure::new(
            "displacement",
            "Force over position in both directions, measured and of the model, and the residual",
            820.0,
            700.0,
        )
        .with(force)
        .with(residual),
        csv: csv(found, shown),
    }
}

/// The appearance of increasing and decreasing position.
fn sides() -> [Look; 2] {
    [
        Look::plain(PALETTE[0]).stroke(1.8),
        Look::plain(PALETTE[1]).dashed(Dash::Dashed).stroke(1.8),
    ]
}

fn csv(found: &ByPosition, shown: Shown) -> String {
    let [first, second] = match found.is_press {
        true => ["press", "release"],
        false => ["positive", "negative"],
    };
    let model = if found.is_press {
        "played"
    } else {
        "predicted"
    };
    type Column = (&'static str, fn(&Bin) -> Option<f64>);
    let columns: [Column; 2] = [
        ("residual_sd", |bin| bin.deviation_n),
        ("difference", |bin| bin.difference_n),
    ];
    let mut heads = vec![
        "x_mm".to_owned(),
        format!("{first}_n"),
        format!("{second}_n"),
        format!("{model}_{first}_n"),
        format!("{model}_{second}_n"),
    ];
    let bins = || found.sides.iter().flatten().flatten();
    let columns = columns
        .into_iter()
        .filter(|(_, of)| bins().any(|bin| of(bin).is_some()));
    let columns: Vec<Column> = columns.collect();
    for (what, _) in &columns {
        heads.extend([first, second].map(|side| format!("{side}_{what}_n")));
    }
    let heads: Vec<String> = heads.iter().map(|key| shown.column(key)).collect();
    let mut csv = heads.join(",") + "\n";
    for (i, mm) in found.x_mm.iter().enumerate() {
        let _ = write!(csv, "{}", shown.length(*mm));
        let both = |of: &dyn Fn(&Bin) -> Option<f64>| {
            [0, 1].map(|side| found.sides[side][i].as_ref().and_then(of))
        };
        let mut cells = both(&|bin| Some(bin.measured_n)).to_vec();
        cells.extend(both(&|bin| Some(bin.model_n)));
        for (_, of) in &columns {
            cells.extend(both(of));
        }
        for cell in cells {
            let cell = cell.map_or(String::new(), |n| shown.force(n).to_string());
            let _ = write!(csv, ",{cell}");
        }
        csv.push('\n');
    }
    csv
}
