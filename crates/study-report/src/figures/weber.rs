//! Weber's law: increments over the standards of a part.

use super::forest::alone;
use super::{Canvas, Drawn, MAX_DRAWN, cell, drawn, head};
use crate::apa::{digits, interval, number};
use crate::chart::{Axis, Dash, Look, Mark, PALETTE, Panel, Whisker};
use std::collections::BTreeMap;
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::results::Number as _;
use study_base::sort::SmallSort as _;

/// The increment of everybody at a standard: geometric mean and interval.
type Group = (f64, f64, Option<(f64, f64)>);

/// Increments and Weber fractions of each participant and of all over the standards, on logarithmic axes; `None` unless
/// Weber's law is tested.
pub(super) fn webers_law(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let law = part.results.over.webers_law.as_ref()?;
    let mut people: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    let mut groups: BTreeMap<&str, Group> = BTreeMap::new();
    for (cell, function) in &part.results.psy {
        let Some(above) = &function.above_standard else {
            continue;
        };
        let found = above.standard.number().zip(above.increment.number());
        let Some((standard, increment)) = found.filter(|(_, increment)| *increment > 0.0) else {
            continue;
        };
        let own = people.entry(cell.participant.as_str()).or_default();
        own.push((standard, increment));
        // Thresholds are increments, or parts of the standard.
        let threshold = function.posterior.threshold.median.as_ref();
        let unit = threshold.and_then(|t| t.number()).map(|t| increment / t);
        let all = part.results.over.psy_group.get(cell.condition.as_str());
        let mean = all.map(|all| &all.posterior_threshold);
        if let Some((mean, unit)) = mean.zip(unit)
            && let Some(middle) = mean.geometric_mean.number()
        {
            let ends = mean.ci95.ends();
            let ends = ends.map(|(low, high)| (low * unit, high * unit));
            groups.insert(cell.condition.as_str(), (standard, middle * unit, ends));
        }
    }
    let groups: Vec<Group> = groups.into_values().collect();
    if people.is_empty() || people.len() > MAX_DRAWN {
        return None;
    }
    let mut data = vec![head([
        "participant",
        "standard",
        "increment",
        "ci95_lo",
        "ci95_hi",
        "weber_fraction",
    ])];
    for (who, points) in &people {
        for (standard, increment) in points {
            data.push(vec![
                (*who).to_owned(),
                digits(*standard),
                digits(*increment),
                String::new(),
                String::new(),
                digits(increment / standard),
            ]);
        }
    }
    for (standard, mean, ci95) in &groups {
        data.push(vec![
            "(geometric mean)".to_owned(),
            digits(*standard),
            digits(*mean),
            cell(ci95.map(|e| e.0)),
            cell(ci95.map(|e| e.1)),
            digits(mean / standard),
        ]);
    }
    let caption = "Weber's law: increments ΔI at threshold and Weber fractions ΔI/I over the standards I; all axes are logarithmic. Pale: the participants. \
                   Diamonds: geometric means with 95 % t intervals. Solid line: the mean exponent of the participants. Dashed line: Weber's law, \
                   ΔI proportional to I."
        .to_owned();
    let of = |quantity: &str| match &part.data.family {
        Some(family) => format!("{quantity}, {family}"),
        None => quantity.to_owned(),
    };
    let (standard, increment) = (of("standard I"), of("ΔI at threshold"));
    let exponent = law.exponent.number().map(|exponent| {
        let ends = law.exponent_ci95.ends();
        let ends = ends.map(|ends| format!(" {}", interval(ends, |x| number(x, 2))));
        let ends = ends.unwrap_or_default();
        (exponent, format!("exponent {}{ends}", number(exponent, 2)))
    });
    let drawing = Drawing {
        people: people.into_values().collect(),
        groups,
        exponent,
        standard,
    };
    Some(drawn(name, caption, data, |c: Canvas| {
        let mut figure = c.figure(name, "Increments over standards", c.pick(320.0, 540.0));
        figure.columns = c.pick(2, 1);
        // The marks are named beside the first axes, the lines beside the second ones.
        figure
            .with(drawing.panel(&increment, false))
            .with(drawing.panel("Weber fraction ΔI/I", true))
    }))
}

/// What both panels show.
struct Drawing {
    /// Standards and increments of each participant.
    people: Vec<Vec<(f64, f64)>>,
    groups: Vec<Group>,
    /// The mean exponent, and in words.
    exponent: Option<(f64, String)>,
    /// What the standards are.
    standard: String,
}

impl Drawing {
    /// Increments over standards or, with `fractions`, Weber fractions, whose lines have a slope less by 1.
    fn panel(&self, label: &str, fractions: bool) -> Panel {
        let place = |standard: f64, increment: f64| {
            let from = if fractions { standard.ln() } else { 0.0 };
            (standard.ln(), increment.ln() - from)
        };
        let people: Vec<Vec<(f64, f64)>> = (self.people.iter())
            .map(|own| {
                let mut own: Vec<_> = own.iter().map(|p| place(p.0, p.1)).collect();
                own.small_sort_by(|a, b| a.0.total_cmp(&b.0));
                own
            })
            .collect();
        let means: Vec<(f64, f64)> = self.groups.iter().map(|g| place(g.0, g.1)).collect();
        let bars: Vec<Whisker> = (self.groups.iter())
            .filter_map(|(standard, _, ci95)| {
                let (low, high) = (*ci95)?;
                let (at, low) = place(*standard, low);
                let high = place(*standard, high).1;
                Some(Whisker { at, low, high })
            })
            .collect();
        let own = people.iter().flatten().map(|p| p.1);
        let heights = own.chain(bars.iter().flat_map(|bar| [bar.low, bar.high]));
        let y = Axis::of_logarithms(label, heights.map(f64::exp));
        let mut panel = Panel::new(self.standards(), y);
        let pale = alone(false, true);
        for own in &people {
            panel = panel.with(pale.stroke(0.9), Mark::Line(own.clone()));
        }
        let points = Mark::Points(people.concat());
        panel = match fractions {
            false => panel.named("a participant", pale, points),
            true => panel.with(pale, points),
        };
        let look = alone(true, false);
        if means.len() > 1 {
            let solid = look.stroke(1.8);
            let dashed = Look::plain(PALETTE[1]).dashed(Dash::Dashed).stroke(1.8);
            let less = if fractions { 1.0 } else { 0.0 };
            let law = Mark::Line(line(&means, 1.0 - less));
            let own = self.exponent.as_ref().map(|(exponent, words)| {
                let own = Mark::Line(line(&means, exponent - less));
                (words, own)
            });
            if fractions {
                panel = panel.named("Weber's law", dashed, law);
                if let Some((words, own)) = own {
                    panel = panel.named(words, solid, own);
                }
            } else {
                panel = panel.with(dashed, law);
                if let Some((_, own)) = own {
                    panel = panel.with(solid, own);
                }
            }
        }
        panel = panel.with(look, Mark::ErrorBars(bars));
        match fractions {
            false => panel.named("mean, 95 % CI", look, Mark::Points(means)),
            true => panel.with(look, Mark::Points(means)),
        }
    }

    /// The axis of the standards, with a tick at each that has room for its label.
    fn standards(&self) -> Axis {
        let mut all: Vec<f64> = self.people.iter().flatten().map(|p| p.0).collect();
        all.sort_by(f64::total_cmp);
        all.dedup();
        let axis = Axis::of_logarithms(&self.standard, all.iter().copied());
        let apart = (axis.high - axis.low) * 0.12;
        let mut last = f64::NEG_INFINITY;
        let ticks = all.iter().map(|standard| {
            let at = standard.ln();
            let has_room = at - last >= apart;
            last = if has_room { at } else { last };
            (
                at,
                if has_room {
                    digits(*standard)
                } else {
                    String::new()
                },
            )
        });
        let ticks = ticks.collect();
        axis.at(ticks)
    }
}

/// The line of this slope through the middle of some points, as far as they reach.
fn line(points: &[(f64, f64)], slope: f64) -> Vec<(f64, f64)> {
    let center = |of: fn(&(f64, f64)) -> f64| {
        points.iter().map(of).sum::<f64>() / points.len().max(1) as f64
    };
    let (x, y) = (center(|p| p.0), center(|p| p.1));
    let ends = points.iter().map(|p| p.0);
    let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    [low, high].map(|at| (at, y + slope * (at - x))).to_vec()
}

#[cfg(test)]
mod tests {
    use super::super::parts::of_part;
    use study_analysis::preregister::complete_parts;

    /// Three standards, levels counted from them.
    const PROTOCOL: &str = r#"
format = "study-protocol/3"
study = { id = "example", title = "An example", seed = 1 }
design = { participants = 10 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "more" }

[[families]]
id = "friction"
from = "static.toml"
vary = "friction"
range = [0.02, 1.6]
steps = 80
unit = "N"

[[parts]]
id = "more"
kind = "discrimination"
prompt = "Which one had more friction?"
tracks = ["low", "middle", "high"]
"#;

    /// The standards are on the axis, with their unit; what the lines are stands beside them.
    #[test]
    fn the_figure_names_its_standards_and_lines() {
        let mut text = PROTOCOL.to_owned();
        for (id, standard) in [("low", 0.2), ("middle", 0.4), ("high", 0.8)] {
            text += &format!(
                "[[tracks]]\nid = \"{id}\"\nmethod = \"2ifc\"\nfamily = \"friction\"\nstandard = {standard}\n\
                 relative = \"fraction\"\nprocedure = {{ rule = \"quest+\", trials = 40 }}\n"
            );
        }
        let parsed = study_plan::protocol::file::parse("protocol.toml", &text);
        let part = complete_parts(&parsed.protocol.unwrap(), 4).remove(0);
        let figures = of_part(1, &part);
        let figure = |name: &str| figures.iter().find(|f| f.name == name).unwrap();
        let weber = figure("part-1-webers-law");
        for picture in [&weber.wide, &weber.narrow] {
            let svg = picture.to_svg();
            for text in [
                ">0.2<",
                ">0.4<",
                ">0.8<",
                ">standard I, friction (N)<",
                ">ΔI at threshold, friction (N)<",
                ">Weber fraction ΔI/I<",
                ">a participant<",
                ">mean, 95 % CI<",
                ">Weber&#39;s law<",
                ">exponent ",
            ] {
                assert!(svg.contains(text), "{text}");
            }
        }
        // Functions of everybody, and thresholds on their scale beside those learned together.
        let functions = figure("part-1-functions");
        assert_eq!(functions.wide.to_svg().matches(">high<").count(), 1);
        let thresholds = figure("part-1-thresholds");
        assert!(
            thresholds
                .data
                .starts_with("condition,name,value,ci95_lo,ci95_hi")
        );
        assert!(functions.data.lines().count() > 10);
    }
}
