//! Thresholds: of each participant, and of each condition.

use super::forest::{Rows, alone, by_condition, forest, have_pooled, scale, table, together};
use super::functions::{level_axis, level_label, place};
use super::{Canvas, Drawn, MAX_DRAWN, drawn};
use crate::chart::{Axis, Look, Mark, PALETTE, Panel, Whisker, shortened};
use std::collections::BTreeMap;
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::psychophysics::results::CellName;
use study_analysis::analyze::results::{Interval, Number as _};
use study_base::sort::SmallSort as _;
use study_stats::psychometric::Spacing;

/// How far means stand beside the participants, of the distance of two conditions.
const BESIDE: f64 = 0.1;

/// Thresholds by participant, and those of the pooled model beside them if it has converged.
fn rows(part: &PartAnalysis) -> Rows {
    let mut panels = by_condition(
        &part.results.psy,
        |function| {
            let found = &function.posterior.threshold;
            let ci95 = found.ci95.as_ref().and_then(Interval::ends);
            (found.median.as_ref().and_then(|m| m.number()), ci95)
        },
        |condition| {
            let found = &part.results.over.psy_group.get(condition)?;
            let found = &found.posterior_threshold;
            Some((found.geometric_mean.number(), found.ci95.ends()))
        },
    );
    let model = part.results.over.psy_population.as_ref();
    if let Some(model) = model.filter(|model| model.has_converged()) {
        for (condition, rows) in &mut panels {
            for row in rows {
                let found = if row.mean {
                    model.threshold.get(condition.as_str())
                } else {
                    model.participant.get(&CellName::of(&row.name, condition))
                };
                row.together =
                    found.and_then(|found| Some((found.median.number()?, found.ci95.ends()?)));
            }
        }
    }
    panels
}

/// Over logarithms if all functions are.
fn spacing(part: &PartAnalysis) -> Spacing {
    let mut spacings = part.data.levels.iter().map(|cell| cell.spacing);
    match spacings.all(|s| s == Spacing::Log) {
        true => Spacing::Log,
        false => Spacing::Lin,
    }
}

fn label(part: &PartAnalysis) -> String {
    format!("threshold, {}", level_label(part))
}

/// What rings are.
fn of_rings(panels: &Rows) -> &'static str {
    match have_pooled(panels) {
        true => " Open rings: the same learned together, the mean that of the population.",
        false => "",
    }
}

pub(super) fn by_participant(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let panels = rows(part);
    let caption = format!(
        "Thresholds (posterior medians) with 95 % intervals. Diamond and shade: geometric mean over participants \
         with its t interval.{}",
        of_rings(&panels)
    );
    let title = "Thresholds by participant";
    let label = label(part);
    let text = (title, caption, label.as_str());
    forest(name, text, panels, (None, spacing(part)))
}

/// The conditions beside each other: participants pale, their means in front. Nothing with one condition;
/// conditions that are standards are drawn with Weber's law.
pub(super) fn by_conditions(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let mut panels = rows(part);
    panels.retain(|(_, rows)| rows.iter().any(|row| row.mean));
    // In the order of the tracks.
    let levels = &part.data.levels;
    panels
        .small_sort_by_key(|(condition, _)| levels.iter().position(|c| c.condition == *condition));
    let most = panels.iter().map(|(_, rows)| rows.len()).max()?;
    let is_law = part.results.over.webers_law.is_some();
    if panels.len() < 2 || panels.len().max(most) > MAX_DRAWN || is_law {
        return None;
    }
    let (spacing, _) = scale(&panels, None, spacing(part));
    let pooled = have_pooled(&panels);
    // Intervals of single participants are in the other figure.
    let shown = panels.iter().flat_map(|(_, rows)| rows).flat_map(|row| {
        let own = row.ci95.filter(|_| row.mean);
        let pooled = row.together.filter(|_| row.mean).map(|t| t.1);
        let ends = [own, pooled].into_iter().flatten();
        ends.flat_map(|(low, high)| [low, high]).chain([row.value])
    });
    let shown: Vec<f64> = shown.collect();
    let mut people: BTreeMap<&str, Vec<(f64, f64)>> = BTreeMap::new();
    for (i, (_, rows)) in panels.iter().enumerate() {
        for row in rows.iter().filter(|row| !row.mean) {
            let at = (i as f64 - BESIDE, place(spacing, row.value));
            people.entry(row.name.as_str()).or_default().push(at);
        }
    }
    let means = || {
        let all = panels.iter().enumerate();
        all.filter_map(|(i, (_, rows))| Some((i as f64, rows.iter().find(|row| row.mean)?)))
    };
    let caption = format!(
        "Thresholds by condition. Pale: the participants (posterior medians), with a line for each. Diamonds: geometric means over \
         participants with their 95 % t intervals.{}",
        match pooled {
            true =>
                " Open rings: the thresholds of the population, learned together, with 95 % intervals.",
            false => "",
        }
    );
    let label = label(part);
    Some(drawn(name, caption, table(&panels), |c: Canvas| {
        let names: Vec<String> = panels.iter().map(|p| shortened(&p.0, 20)).collect();
        let below = crate::chart::for_names(&names, c.width - 80.0);
        let y = level_axis(spacing, &label, shown.iter().copied());
        let mut panel = Panel::new(Axis::of_names("", &names), y);
        let line = Look::plain(PALETTE[0]).stroke(0.9).pale();
        for own in people.values() {
            panel = panel.with(line, Mark::Line(own.clone()));
        }
        let points = people.values().flatten().copied().collect();
        panel = panel.named("a participant", alone(false, true), Mark::Points(points));
        let look = alone(true, false);
        let bars = means().filter_map(|(i, row)| {
            let (low, high) = row.ci95?;
            let (low, high) = (place(spacing, low), place(spacing, high));
            Some(Whisker {
                at: i + BESIDE,
                low,
                high,
            })
        });
        panel = panel.with(look, Mark::ErrorBars(bars.collect()));
        let points = means().map(|(i, row)| (i + BESIDE, place(spacing, row.value)));
        panel = panel.named("mean, 95 % CI", look, Mark::Points(points.collect()));
        if pooled {
            let look = together(true);
            let found = || means().filter_map(|(i, row)| Some((i + 2.5 * BESIDE, row.together?)));
            let bars = found().map(|(at, (_, (low, high)))| Whisker {
                at,
                low: place(spacing, low),
                high: place(spacing, high),
            });
            panel = panel.with(look, Mark::ErrorBars(bars.collect()));
            let points = found().map(|(at, (value, _))| (at, place(spacing, value)));
            panel = panel.named("learned together", look, Mark::Points(points.collect()));
        }
        let height = c.pick(310.0, 300.0) + below;
        c.figure(name, "Thresholds by condition", height)
            .with(panel)
    }))
}

#[cfg(test)]
mod tests {
    use super::super::parts::of_part;
    use super::*;
    use study_analysis::preregister::complete_parts;

    /// A part of tracks with these names.
    fn part(tracks: &[&str]) -> PartAnalysis {
        let mut text = format!(
            r#"
format = "study-protocol/3"
study = {{ id = "example", title = "An example", seed = 1 }}
design = {{ participants = 10 }}
device = {{ kind = "simulated", limits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }} }}
analysis = {{ primary = "more" }}

[[families]]
id = "friction"
from = "static.toml"
vary = "friction"
range = [0.02, 0.6]
steps = 30
scale = "log"
unit = "N"

[[parts]]
id = "more"
kind = "discrimination"
prompt = "Which one had more friction?"
tracks = {tracks:?}
"#
        );
        for id in tracks {
            text += &format!(
                "[[tracks]]\nid = \"{id}\"\nmethod = \"2ifc\"\nfamily = \"friction\"\nstandard = 0.0\n\
                 procedure = {{ rule = \"quest+\", trials = 40 }}\n"
            );
        }
        let parsed = study_plan::protocol::file::parse("protocol.toml", &text);
        complete_parts(&parsed.protocol.unwrap(), 4).remove(0)
    }

    /// In the order of the tracks, each with its participants and their mean; the means are drawn last, over pale marks.
    #[test]
    fn conditions_stand_beside_each_other_with_their_means_in_front() {
        let part = part(&["right", "left"]);
        let figures = of_part(1, &part);
        let figure = figures
            .iter()
            .find(|f| f.name == "part-1-thresholds-by-condition");
        let figure = figure.unwrap();
        let own = part.results.psy.len() + part.results.over.psy_group.len();
        assert_eq!(figure.data.lines().count(), 1 + own);
        for picture in [&figure.wide, &figure.narrow] {
            let svg = picture.to_svg();
            for text in [
                ">right<",
                ">left<",
                ">threshold, friction (N)<",
                ">mean, 95 % CI<",
            ] {
                assert!(svg.contains(text), "{text}");
            }
            assert!(svg.find(">right<") < svg.find(">left<"));
            let [pale, mean] = [alone(false, true), alone(true, false)].map(|look| look.color);
            assert_ne!(pale, mean);
            let last = |color: crate::chart::Color| svg.rfind(&color.hex()).unwrap();
            let axes = svg.find(">right<").unwrap();
            let drawn = |color: crate::chart::Color| svg[..axes].rfind(&color.hex()).unwrap();
            assert!(drawn(pale) < drawn(mean) && last(pale) < last(mean));
        }
    }

    #[test]
    fn one_condition_has_no_figure_of_conditions() {
        let figures = of_part(1, &part(&["only"]));
        let names: Vec<&str> = figures.iter().map(|f| f.name.as_str()).collect();
        assert!(names.contains(&"part-1-thresholds"), "{names:?}");
        assert!(
            !names.iter().any(|name| name.ends_with("by-condition")),
            "{names:?}"
        );
    }
}
