//! Weber's law: increments over the standards of a part.

use super::{Canvas, Drawn, MAX_DRAWN, cell, drawn, head};
use crate::apa::{digits, interval, number};
use crate::chart::{Axis, Dash, Look, Mark, PALETTE, Panel, Whisker};
use std::collections::BTreeMap;
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::results::Number as _;

/// The increment of everybody at a standard: geometric mean and interval.
type Group = (f64, f64, Option<(f64, f64)>);

/// Increments of each participant and of all over the standards, both on logarithmic axes; `None` unless Weber's law is
/// tested.
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
    ])];
    for (who, points) in &people {
        for (standard, increment) in points {
            let row = vec![(*who).to_owned(), digits(*standard), digits(*increment)];
            data.push([row, vec![String::new(), String::new()]].concat());
        }
    }
    for (standard, mean, ci95) in &groups {
        data.push(vec![
            "(geometric mean)".to_owned(),
            digits(*standard),
            digits(*mean),
            cell(ci95.map(|e| e.0)),
            cell(ci95.map(|e| e.1)),
        ]);
    }
    let caption = "Weber's law: increments ΔI at threshold over the standards I, both axes logarithmic. Thin lines: participants. \
                   Points: geometric means with 95 % t intervals. Solid line: the mean exponent of the participants. Dashed line: Weber's law, \
                   ΔI proportional to I."
        .to_owned();
    let center = |of: fn(&Group) -> f64| {
        groups.iter().map(|g| of(g).ln()).sum::<f64>() / groups.len().max(1) as f64
    };
    let line = |exponent: f64| {
        let (x, y) = (center(|g| g.0), center(|g| g.1));
        let ends = groups.iter().map(|g| g.0.ln());
        let (low, high) = ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        [low, high].map(|at| (at, y + exponent * (at - x))).to_vec()
    };
    Some(drawn(name, caption, data, |c: Canvas| {
        let points = || people.values().flatten();
        let ends = groups.iter().flat_map(|(_, mean, ci95)| {
            let (low, high) = ci95.unwrap_or((*mean, *mean));
            [low, high]
        });
        let of = |quantity: &str| match &part.data.family {
            Some(family) => format!("{quantity}, {family}"),
            None => quantity.to_owned(),
        };
        let mut standards: Vec<f64> = points().map(|p| p.0).collect();
        standards.sort_by(f64::total_cmp);
        standards.dedup();
        let ticks = standards.iter().map(|s| (s.ln(), digits(*s))).collect();
        let x = Axis::of_logarithms(&of("standard"), standards.iter().copied()).at(ticks);
        let y = of("increment at threshold");
        let y = Axis::of_logarithms(&y, points().map(|p| p.1).chain(ends));
        let mut panel = Panel::new(x, y);
        for (i, own) in people.values().enumerate() {
            let mut own: Vec<(f64, f64)> = own.iter().map(|p| (p.0.ln(), p.1.ln())).collect();
            own.sort_by(|a, b| a.0.total_cmp(&b.0));
            let thin = Look::plain(PALETTE[6]).stroke(0.8);
            panel = match i {
                0 => panel.named("a participant", thin, Mark::Line(own)),
                _ => panel.with(thin, Mark::Line(own)),
            };
        }
        let look = Look::plain(PALETTE[0]).stroke(1.6);
        if groups.len() > 1 {
            let dashed = Look::plain(PALETTE[1]).dashed(Dash::Dashed).stroke(1.4);
            panel = panel.named("Weber's law: exponent 1", dashed, Mark::Line(line(1.0)));
            if let Some(exponent) = law.exponent.number() {
                let interval = law.exponent_ci95.ends().map_or(String::new(), |ends| {
                    format!(" {}", interval(ends, |x| number(x, 2)))
                });
                let name = format!("mean exponent {}{interval}", number(exponent, 2));
                panel = panel.named(&name, look, Mark::Line(line(exponent)));
            }
        }
        let bars = groups.iter().filter_map(|(standard, _, ci95)| {
            let (low, high) = (*ci95)?;
            let (at, low, high) = (standard.ln(), low.ln(), high.ln());
            Some(Whisker { at, low, high })
        });
        panel = panel.with(look, Mark::ErrorBars(bars.collect()));
        let means = groups
            .iter()
            .map(|(standard, mean, _)| (standard.ln(), mean.ln()));
        panel = panel.with(look.size(7.0), Mark::Points(means.collect()));
        c.figure(name, "Increments over standards", c.pick(320.0, 270.0))
            .with(panel)
    }))
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
                "standard, friction (N)",
                "increment at threshold, friction (N)",
                "exponent 1",
                "mean exponent",
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
