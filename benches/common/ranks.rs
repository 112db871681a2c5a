//! The picture of ranks.

use study_report::chart::{Axis, Color, Dash, Figure, Look, Mark, PALETTE, Panel, Span};

/// Classes of a histogram.
const CLASSES: usize = 20;

/// Histograms of the ranks of each parameter, from 0 to 1, with the range that holds a count of even ranks in
/// 99 % of histograms' bars (normal approximation).
pub(crate) fn picture(names: &[&str], ranks: &[Vec<f64>]) -> String {
    let n = ranks.len() as f64;
    let p = 1.0 / CLASSES as f64;
    let (mean, sd) = (n * p, (n * p * (1.0 - p)).sqrt());
    let (low, high) = (mean - 2.576 * sd, mean + 2.576 * sd);
    let mut figure = Figure::new(
        "ranks",
        "Ranks of parameters drawn from the prior",
        720.0,
        360.0,
    );
    figure.columns = 4;
    for (k, name) in names.iter().enumerate() {
        let mut counts = [0.0; CLASSES];
        for rank in ranks.iter().map(|r| r[k]).filter(|rank| rank.is_finite()) {
            counts[((rank * CLASSES as f64) as usize).min(CLASSES - 1)] += 1.0;
        }
        let bars = counts.iter().enumerate().map(|(i, count)| Span {
            x: (i as f64 * p, (i + 1) as f64 * p),
            y: (0.0, *count),
        });
        let line = |at: f64| Mark::Line(vec![(0.0, at), (1.0, at)]);
        let dashed = Look::plain(Color::INK).stroke(1.0).dashed(Dash::Dashed);
        let most = counts.iter().copied().fold(high, f64::max) * 1.1;
        let panel = Panel::new(
            Axis::new("rank", 0.0, 1.0),
            Axis::new("data sets", 0.0, most),
        );
        let panel = panel
            .titled(name)
            .with(Look::plain(PALETTE[0]), Mark::Bars(bars.collect()));
        figure = figure.with(
            panel
                .with(dashed, line(low.max(0.0)))
                .with(dashed, line(high)),
        );
    }
    figure.picture().to_svg()
}
