//! The methods that were compared: their residual on data left out, and which of them fail.

use super::{Drawing, Shown};
use crate::chart::{Anchor, Axis, Color, Dash, Figure, Look, Mark, Note, PALETTE, Panel, Shape};

/// A method of the comparison. Texts are untrusted.
#[derive(Debug, Clone, PartialEq)]
pub struct Compared {
    /// Its name.
    pub method: String,
    /// VAF and rms residual in N on data left out; `None` where parts of the data do not determine it.
    pub left_out: Option<[f64; 2]>,
    /// Why it is not recommended whatever the others do, in a few words.
    pub failed: Option<String>,
    /// Whether it is recommended.
    pub is_recommended: bool,
}

/// A row for each method with its residual, and its VAF beside it. `noise_n` is the standard deviation
/// of white noise of the force. `None` if no method has a residual.
pub fn methods(all: &[Compared], noise_n: Option<f64>, shown: Shown) -> Option<Drawing> {
    let residual = |c: &Compared| {
        (c.left_out)
            .map(|[_, n]| shown.force(n))
            .filter(|n| *n > 0.0)
    };
    let noise = noise_n.map(|n| shown.force(n)).filter(|n| *n > 0.0);
    if all.iter().all(|c| residual(c).is_none()) {
        return None;
    }
    let names: Vec<String> = all.iter().map(|c| c.method.clone()).collect();
    let label = shown.of_force("residual", "on data left out");
    let x = Axis::of_logarithms(&label, all.iter().filter_map(residual).chain(noise));
    let mut panel = Panel::new(x, Axis::of_names("", &names).reversed());
    let rows = || all.iter().enumerate().map(|(row, c)| (row as f64, c));
    if let Some(noise) = noise {
        let line = vec![(noise.ln(), -0.5), (noise.ln(), all.len() as f64 - 0.5)];
        let look = Look::plain(Color::GREY).dashed(Dash::Dashed).stroke(1.5);
        panel = panel.named("noise of the force", look, Mark::Line(line));
    }
    // the sound ones first in the legend
    let mut outcomes = [RECOMMENDED, NOT_RECOMMENDED].map(str::to_owned).to_vec();
    for outcome in all.iter().map(outcome) {
        if !outcomes.contains(&outcome) {
            outcomes.push(outcome);
        }
    }
    outcomes.retain(|name| all.iter().any(|c| outcome(c) == *name));
    let mut failures = [Shape::Cross, Shape::Plus, Shape::Down, Shape::Square]
        .into_iter()
        .cycle();
    for name in outcomes {
        let (color, shape) = match name.as_str() {
            RECOMMENDED => (PALETTE[0], Shape::Disc),
            NOT_RECOMMENDED => (PALETTE[0], Shape::Ring),
            _ => (PALETTE[1], failures.next().unwrap_or(Shape::Cross)),
        };
        let look = Look {
            shape,
            ..Look::plain(color).size(11.0)
        };
        let points = rows().filter(|(_, c)| outcome(c) == name);
        let points = points.filter_map(|(row, c)| Some((residual(c)?.ln(), row)));
        panel = panel.named(&name, look, Mark::Points(points.collect()));
    }
    let middle = 0.5 * (panel.x.low + panel.x.high);
    for (row, c) in rows() {
        let note = match residual(c).zip(c.left_out) {
            Some((n, [vaf, _])) => {
                let note = Note::new((n.ln(), row), &format!("VAF {}", vaf_of(vaf)));
                match n.ln() < middle {
                    true => note.moved(12.0, 0.0).anchored(Anchor::Start),
                    false => note.moved(-12.0, 0.0).anchored(Anchor::End),
                }
            }
            None => Note::new((panel.x.low, row), "none")
                .moved(6.0, 0.0)
                .anchored(Anchor::Start),
        };
        panel = panel.note(note);
    }
    let heads = [
        "method",
        "vaf_left_out",
        "residual_left_out_n",
        "recommended",
        "failed",
    ];
    let mut rows = vec![heads.map(|head| shown.column(head)).to_vec()];
    for c in all {
        let [vaf, n] = c
            .left_out
            .map_or([None; 2], |[vaf, n]| [Some(vaf), Some(shown.force(n))])
            .map(|number| number.map_or(String::new(), |number| number.to_string()));
        rows.push(vec![
            c.method.clone(),
            vaf,
            n,
            c.is_recommended.to_string(),
            c.failed.clone().unwrap_or_default(),
        ]);
    }
    Some(Drawing {
        name: "methods",
        figure: Figure::new(
            "methods",
            "Residual of each method on data left out, and which methods fail",
            820.0,
            130.0 + 30.0 * all.len() as f64,
        )
        .with(panel),
        csv: crate::csv::text(&rows),
    })
}

const RECOMMENDED: &str = "recommended";
const NOT_RECOMMENDED: &str = "not recommended";

/// What came of a method, as the legend says it.
fn outcome(c: &Compared) -> String {
    match &c.failed {
        _ if c.is_recommended => RECOMMENDED.to_owned(),
        Some(why) => format!("failed: {why}"),
        None => NOT_RECOMMENDED.to_owned(),
    }
}

/// A VAF without the leading zero, with as many digits as tell good ones apart.
fn vaf_of(vaf: f64) -> String {
    match vaf {
        ..=-10.0 => format!("{vaf:.0}"),
        _ => format!("{vaf:.4}").replacen("0.", ".", 1),
    }
    .replace('-', "−")
}
