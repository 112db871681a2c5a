//! Power over participants: a line for each number of realizations, a panel for each
//! number of repetitions, the ceiling dashed.

use super::{Report, deciding};
use crate::chart::{Axis, Dash, Figure, Look, Mark, Panel, Whisker};
use study_analysis::power::{Cell, PartWorld};
use study_base::sort::SmallSort as _;

/// Height of a panel, px.
const HEIGHT: f64 = 300.0;

/// What a line has a number of.
fn line(report: &Report) -> &'static str {
    match report.plan.settings.part {
        Some(PartWorld::Tracks(_)) => "tracks",
        None | Some(PartWorld::Factors(_) | PartWorld::Pairs(_) | PartWorld::Felt(_)) => {
            "realizations"
        }
    }
}

/// The figure; `None` without results or tests.
pub fn figure(report: &Report) -> Option<Figure> {
    report.plan.settings.tests.first()?;
    let mut shapes = report.plan.shapes();
    shapes.small_sort_by_key(|(q, r)| (*r, *q));
    let cells = report.shown();
    let most = cells.iter().map(|c| c.participants).max()? as f64;
    let repetitions: Vec<usize> = {
        let mut all: Vec<usize> = shapes.iter().map(|s| s.1).collect();
        all.dedup();
        all
    };
    let title = format!("Power of {} over participants", deciding(&report.plan));
    let width = 330.0 * repetitions.len() as f64;
    let mut figure = Figure::new("power", &title, width, HEIGHT);
    figure.columns = repetitions.len();
    for r in repetitions {
        let mut panel = Panel::new(
            Axis::new("participants", 0.0, most * 1.05),
            Axis::new("power", 0.0, 1.0),
        )
        .titled(&match r {
            1 => "1 repetition".to_owned(),
            r => format!("{r} repetitions"),
        });
        let lines = shapes.iter().filter(|s| s.1 == r).map(|s| s.0);
        for (i, q) in lines.enumerate() {
            let own: Vec<&Cell> = (cells.iter())
                .filter(|c| (c.realizations, c.repetitions) == (q, r))
                .collect();
            let power = |c: &Cell| report.result(c).and_then(|r| r.tests.first());
            let points: Vec<(f64, f64)> = (own.iter())
                .filter_map(|c| Some((c.participants as f64, power(c)?.power)))
                .collect();
            let whiskers = (own.iter())
                .filter_map(|c| {
                    let (low, high) = power(c)?.interval;
                    let at = c.participants as f64;
                    Some(Whisker { at, low, high })
                })
                .collect();
            let look = Look::nth(i);
            let solid = look.dashed(Dash::Solid);
            let ceiling = own
                .first()
                .and_then(|c| report.closed(c))
                .map(|e| e.ceiling);
            panel = panel
                .with(solid, Mark::ErrorBars(whiskers))
                .with(solid, Mark::Line(points.clone()))
                .named(&format!("{q} {}", line(report)), look, Mark::Points(points));
            if let Some(ceiling) = ceiling {
                let ends = vec![(0.0, ceiling), (most * 1.05, ceiling)];
                panel = panel.with(look.dashed(Dash::Dashed).stroke(1.0), Mark::Line(ends));
            }
        }
        figure = figure.with(panel);
    }
    (!report.results.is_empty()).then_some(figure)
}
