//! The means of a factorial design: levels of one factor along the axis, a line for each level of
//! another, a panel for each combination of the rest.

use super::{Canvas, Drawn, Scene, cell, drawn, head};
use crate::chart::{Axis, Look, Mark, Panel, SMALL, Whisker, text_width};
use study_analysis::analyze::results::{
    FactorialMean, FactorialTests, Interval, LevelsName, Number as _,
};
use study_plan::protocol::Crossing;

/// Most panels, and most lines of a panel.
const MAX_PANELS: usize = 6;
const MAX_LINES: usize = 8;

/// Levels, as places of a factor and of a level.
type Levels = Vec<(usize, usize)>;

/// The factors by what they are in the figure.
struct Layout<'a> {
    crossing: &'a Crossing,
    tests: &'a FactorialTests,
    /// Along the axis: the one with the most levels.
    along: usize,
    /// The lines.
    lines: Option<usize>,
    /// The panels.
    panels: Vec<usize>,
}

impl<'a> Layout<'a> {
    fn of(scene: &Scene<'a>) -> Option<Self> {
        let (crossing, tests) = (
            scene.a.crossing.as_ref()?,
            scene.a.results.evidence.factorial.as_ref()?,
        );
        if tests.means.is_empty() {
            return None;
        }
        let groups = usize::from(!crossing.groups.is_empty());
        let mut rest: Vec<usize> = (0..crossing.factors.len() + groups).collect();
        let most = |at: &usize| (crossing.levels(*at).len(), usize::MAX - at);
        let along = *rest[..crossing.factors.len()]
            .iter()
            .max_by_key(|at| most(at))?;
        rest.retain(|at| *at != along);
        // A group is a set of lines where it is the only other factor, else one of panels.
        let lines = rest
            .iter()
            .copied()
            .find(|at| crossing.levels(*at).len() <= MAX_LINES);
        rest.retain(|at| Some(*at) != lines);
        Some(Self {
            crossing,
            tests,
            along,
            lines,
            panels: rest,
        })
    }

    /// Every combination of the levels of some factors.
    fn combinations(&self, factors: &[usize]) -> Vec<Levels> {
        let mut all: Vec<Levels> = vec![Vec::new()];
        for &factor in factors {
            let levels = 0..self.crossing.levels(factor).len();
            all = (all.iter())
                .flat_map(|start| {
                    let one = |level| start.iter().copied().chain([(factor, level)]).collect();
                    levels.clone().map(one).collect::<Vec<Levels>>()
                })
                .collect();
        }
        all
    }

    fn mean(&self, levels: &Levels) -> Option<&FactorialMean> {
        let mut levels = levels.clone();
        levels.sort_unstable();
        let name = |(factor, level): &(usize, usize)| {
            let of = self.crossing.levels(*factor);
            (self.crossing.name(*factor).to_owned(), of[*level].clone())
        };
        self.tests
            .means
            .get(&LevelsName(levels.iter().map(name).collect()))
    }

    /// Levels in words.
    fn named(&self, levels: &Levels) -> String {
        let name = |(factor, level): &(usize, usize)| {
            let of = self.crossing.levels(*factor);
            format!("{} = {}", self.crossing.name(*factor), of[*level])
        };
        levels.iter().map(name).collect::<Vec<_>>().join(", ")
    }
}

/// The means with their intervals.
pub(super) fn interaction(scene: &Scene<'_>) -> Option<Drawn> {
    let layout = Layout::of(scene)?;
    let panels = layout.combinations(&layout.panels);
    if panels.len() > MAX_PANELS {
        return None;
    }
    let factors = layout.lines.map_or_else(Vec::new, |at| vec![at]);
    let lines = layout.combinations(&factors);
    let along = layout.crossing.levels(layout.along);
    let at = |panel: &Levels, line: &Levels, level: usize| {
        let all = [panel.clone(), line.clone(), vec![(layout.along, level)]].concat();
        layout.mean(&all)
    };
    let mut data = vec![head(["levels", "n", "mean", "ci95_lo", "ci95_hi"])];
    let mut ends = Vec::new();
    for panel in &panels {
        for line in &lines {
            for level in 0..along.len() {
                let Some(found) = at(panel, line, level) else {
                    continue;
                };
                let all = [panel.clone(), line.clone(), vec![(layout.along, level)]].concat();
                let ci = found.ci95.as_ref().and_then(Interval::ends);
                ends.extend(found.mean.number());
                ends.extend(ci.iter().flat_map(|ci| [ci.0, ci.1]));
                data.push(vec![
                    layout.named(&all),
                    cell(found.n.number()),
                    cell(found.mean.number()),
                    cell(ci.map(|ci| ci.0)),
                    cell(ci.map(|ci| ci.1)),
                ]);
            }
        }
    }
    let name = layout.crossing.name(layout.along);
    let of_lines = layout.lines.map_or_else(String::new, |at| {
        format!("; lines: {}", layout.crossing.name(at))
    });
    let bars = match ends.len() > data.len() - 1 {
        true => {
            " Bars are 95 % intervals of the mean over participants: they show how precise each mean is, and not \
                 whether two means of the same participants differ."
        }
        false => {
            " Means are what a mean participant would rate, by comparisons within participants."
        }
    };
    let caption = format!("Mean {} by {name}{of_lines}.{bars}", scene.asked);
    let title = format!("{} by {name}{of_lines}", scene.asked);
    Some(drawn("factors", caption, data, |c: Canvas| {
        let columns = c.pick(panels.len().min(3), 1);
        let rows = panels.len().div_ceil(columns);
        let legend: f64 = (lines.iter())
            .map(|line| text_width(&layout.named(line), SMALL) + 40.0)
            .sum();
        let room = c.width / columns as f64 - 80.0;
        let legend_lines = (legend / room.max(60.0)).ceil().max(1.0);
        let height = rows as f64 * (c.pick(250.0, 210.0) + 18.0 * (legend_lines - 1.0));
        let mut figure = c.figure("factors", &title, height);
        figure.columns = columns;
        for panel in &panels {
            let mut x = Axis::of_names(name, along);
            x = x.without_grid();
            let y = scene.ratings(&format!("{}, mean", scene.asked), &ends);
            let mut drawn = Panel::new(x, y).titled(&layout.named(panel));
            for (i, line) in lines.iter().enumerate() {
                let look = Look::nth(i);
                // Side by side, so that intervals do not cover each other.
                let aside = (i as f64 - (lines.len() as f64 - 1.0) / 2.0) * 0.08;
                let found = |level: usize| at(panel, line, level);
                let points: Vec<(f64, f64)> = (0..along.len())
                    .map(|level| {
                        let mean = found(level).and_then(|m| m.mean.number());
                        (level as f64 + aside, mean.unwrap_or(f64::NAN))
                    })
                    .collect();
                let bars = (0..along.len()).filter_map(|level| {
                    let (low, high) = found(level)?.ci95.as_ref()?.ends()?;
                    let at = level as f64 + aside;
                    Some(Whisker { at, low, high })
                });
                drawn = drawn
                    .with(look, Mark::ErrorBars(bars.collect()))
                    .with(look, Mark::Line(points.clone()));
                drawn = match layout.lines {
                    Some(_) => drawn.named(&layout.named(line), look, Mark::Points(points)),
                    None => drawn.with(look, Mark::Points(points)),
                };
            }
            figure = figure.with(drawn);
        }
        figure
    }))
}
