//! The figures of a part that is no rating: psychometric functions with their data, tracks
//! with their reversals, preferences, thresholds and sensitivities of the participants.

use super::identification::confusions;
use super::similarity::map;
use super::weber::webers_law;
use super::{Canvas, Drawn, MAX_DRAWN, cell, drawn, head, rows_height};
use crate::apa::digits;
use crate::chart::{Axis, Color, Dash, Figure, Look, Mark, PALETTE, Panel, Shape, Whisker};
use crate::chart::{Label, shortened};
use std::collections::BTreeMap;
use study_analysis::analyze::psychophysics::results::{
    At, CellName, ConditionName, Function, GeometricMean, Sensitivity,
};
use study_analysis::analyze::psychophysics::{LevelData, PartAnalysis, TrackData, TrackTrial};
use study_analysis::analyze::results::{Interval, Number as _};
use study_stats::psychometric::{Curve, Spacing};

/// What the files of these figures are called before the number of the part.
pub const PREFIX: &str = "part-";

/// Largest number of panels of a figure.
const MAX_PANELS: usize = 12;

/// Height of a row of panels, px.
const ROW: f64 = 168.0;

/// All figures that the data allow, of the part with this number, from 1.
pub fn of_part(number: usize, part: &PartAnalysis) -> Vec<Drawn> {
    let name = |kind: &str| format!("{PREFIX}{number}-{kind}");
    let all = [
        psychometric(&name("psychometric"), part),
        thresholds(&name("thresholds"), part),
        webers_law(&name("webers-law"), part),
        tracks(&name("tracks"), part),
        sensitivities(&name("sensitivities"), part),
        preferences(&name("preferences"), part),
        against_vaf(&name("preference-against-vaf"), part),
        magnitudes(&name("magnitudes"), part),
        confusions(&name("confusions"), part),
        map(&name("map"), part),
    ];
    let note = match (part.simulated, part.pilot) {
        (true, _) => Some("includes simulated data"),
        (false, true) => Some("includes pilot data"),
        (false, false) => None,
    };
    let all = all.into_iter().flatten();
    all.map(|drawn| drawn.noted(note)).collect()
}

/// A grid of panels, with as many columns as there is room for.
fn grid(c: Canvas, name: &str, title: &str, panels: Vec<Panel>) -> Figure {
    let columns = c.pick(3, 2).min(panels.len().max(1));
    let rows = panels.len().div_ceil(columns);
    let mut figure = c.figure(name, title, ROW * rows as f64 + 24.0);
    figure.columns = columns;
    figure.panels = panels;
    figure
}

/// "; the first 12 of 30 are drawn".
fn cut(all: usize) -> String {
    match all > MAX_PANELS {
        true => format!(" The first {MAX_PANELS} of {all} are drawn; the file has all data."),
        false => String::new(),
    }
}

fn level_label(part: &PartAnalysis) -> String {
    part.data
        .dimension
        .clone()
        .unwrap_or_else(|| "level".to_owned())
}

/// An axis of levels on the scale of their functions.
fn level_axis(spacing: Spacing, label: &str, levels: impl IntoIterator<Item = f64>) -> Axis {
    match spacing {
        Spacing::Lin => Axis::around(label, levels),
        Spacing::Log => Axis::of_logarithms(label, levels),
    }
}

/// Where a level is on such an axis.
fn place(spacing: Spacing, level: f64) -> f64 {
    spacing.place(level).unwrap_or(f64::NAN)
}

/// What was fitted to a cell.
fn fitted<'a>(part: &'a PartAnalysis, cell: &LevelData) -> Option<&'a Function> {
    let name = CellName::of(&cell.participant, &cell.condition);
    part.results.psy.get(&name)
}

/// The function of a cell, of the posterior, on its scale.
fn curve(part: &PartAnalysis, cell: &LevelData) -> Option<Curve> {
    let means = &fitted(part, cell)?.posterior;
    let gamma = means.gamma.as_ref();
    Some(Curve {
        core: cell.core,
        threshold: cell
            .spacing
            .place(means.threshold.median.as_ref()?.number()?)?,
        width: means.width.mean.number()?,
        gamma: part.data.guess.or_else(|| gamma?.mean.number())?,
        lambda: means.lambda.mean.number()?,
    })
}

fn psychometric(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let cells = &part.data.levels;
    if cells.is_empty() {
        return None;
    }
    let mut data = vec![head([
        "participant",
        "condition",
        "level",
        "positive",
        "trials",
        "fitted",
    ])];
    for cell in cells {
        let curve = curve(part, cell);
        for l in &cell.levels {
            data.push(vec![
                cell.participant.clone(),
                cell.condition.clone(),
                digits(l.level),
                digits(l.positive),
                digits(l.trials),
                self::cell(curve.map(|c| c.value(place(cell.spacing, l.level)))),
            ]);
        }
    }
    let shares = match part.data.guess {
        Some(_) => "share correct",
        None => "share of “yes”",
    };
    let all = cells.iter().flat_map(|c| c.levels.iter().map(|l| l.level));
    let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| {
        (a.min(x), b.max(x))
    });
    let panel = |cell: &LevelData| {
        let spacing = cell.spacing;
        let x = level_axis(spacing, &level_label(part), [low, high]);
        let (from, to) = (x.low, x.high);
        let mut panel = Panel::new(x, Axis::new(shares, -0.04, 1.04));
        panel.title = format!(
            "{} · {}",
            shortened(&cell.participant, 14),
            shortened(&cell.condition, 18)
        );
        let curve = curve(part, cell);
        if let Some(curve) = curve {
            let at = |i: u32| from + (to - from) * f64::from(i) / 120.0;
            let line = (0..=120).map(|i| (at(i), curve.value(at(i)))).collect();
            panel = panel.with(Look::plain(PALETTE[1]).stroke(1.8), Mark::Line(line));
            let ci95 = fitted(part, cell).and_then(|f| f.posterior.threshold.ci95.as_ref());
            if let Some((low, high)) = ci95.and_then(Interval::ends) {
                let at = curve.value(curve.threshold);
                let (low, high) = (place(spacing, low), place(spacing, high));
                let bar = Mark::ErrorBarsAcross(vec![Whisker { at, low, high }]);
                panel = panel.with(Look::plain(PALETTE[1]).stroke(1.8), bar);
            }
        }
        // Larger points rest on more trials.
        for (size, least, most) in [(4.0, 0.0, 2.5), (6.5, 2.5, 7.5), (9.0, 7.5, f64::INFINITY)] {
            let own = cell
                .levels
                .iter()
                .filter(|l| least <= l.trials && l.trials < most);
            let points = own.map(|l| (place(spacing, l.level), l.positive / l.trials));
            let points = points.collect();
            panel = panel.with(Look::plain(PALETTE[0]).size(size), Mark::Points(points));
        }
        panel
    };
    let caption = format!(
        "Psychometric functions. Points: {shares} by level, larger with more trials (up to 2, 7, more). \
         Line: the function of the posterior medians of the threshold and means of the rest. Bar: threshold with its 95 % interval.{}",
        cut(cells.len())
    );
    let title = "Psychometric functions by participant and condition";
    Some(drawn(name, caption, data, |c: Canvas| {
        grid(
            c,
            name,
            title,
            cells.iter().take(MAX_PANELS).map(panel).collect(),
        )
    }))
}

fn tracks(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let tracks = &part.data.tracks;
    // A track of two realizations has one level.
    let moves = |t: &&TrackData| t.trials.iter().any(|x| x.level != t.trials[0].level);
    tracks.iter().find(moves)?;
    let mut data = vec![head([
        "participant",
        "track",
        "trial",
        "level",
        "positive",
        "easy",
        "reversal",
    ])];
    for track in tracks {
        for (i, trial) in track.trials.iter().enumerate() {
            data.push(vec![
                track.participant.clone(),
                track.track.clone(),
                (i + 1).to_string(),
                digits(trial.level),
                trial.positive.to_string(),
                trial.easy.to_string(),
                track.reversals.contains(&i).to_string(),
            ]);
        }
    }
    let panel = |track: &TrackData| {
        // Of a track without a function, such as same-different, the level itself.
        let of_track = |cell: &&LevelData| cell.condition == track.condition;
        let spacing = part.data.levels.iter().find(of_track);
        let spacing = spacing.map_or_else(Spacing::default, |cell| cell.spacing);
        let points = |keep: &dyn Fn(usize) -> bool| -> Vec<(f64, f64)> {
            let all = track.trials.iter().enumerate().filter(|(i, _)| keep(*i));
            let at = |(i, t): (usize, &TrackTrial)| ((i + 1) as f64, place(spacing, t.level));
            all.map(at).collect()
        };
        let levels = track.trials.iter().map(|t| t.level);
        let x = Axis::new("trial", 0.0, track.trials.len() as f64 + 1.0);
        let mut panel = Panel::new(x, level_axis(spacing, &level_label(part), levels));
        panel.title = format!(
            "{} · {}",
            shortened(&track.participant, 14),
            shortened(&track.track, 18)
        );
        let moved = |i: usize| !track.trials[i].easy;
        let thin = Look::plain(PALETTE[6]).stroke(1.0);
        panel = panel.with(thin, Mark::Line(points(&moved)));
        if let Some(estimate) = track.estimate {
            let estimate = place(spacing, estimate);
            let across = vec![(0.0, estimate), (track.trials.len() as f64 + 1.0, estimate)];
            let dashed = Look::plain(PALETTE[1]).stroke(1.2).dashed(Dash::Dashed);
            panel = panel.with(dashed, Mark::Line(across));
        }
        for (shape, positive) in [(Shape::Disc, true), (Shape::Ring, false)] {
            let look = Look {
                shape,
                ..Look::plain(PALETTE[0]).size(4.5).stroke(1.2)
            };
            let own = |i: usize| track.trials[i].positive == positive;
            panel = panel.with(look, Mark::Points(points(&own)));
        }
        let look = Look {
            shape: Shape::Diamond,
            ..Look::plain(PALETTE[1]).size(8.0)
        };
        let turned = |i: usize| track.reversals.contains(&i);
        panel.with(look, Mark::Points(points(&turned)))
    };
    let caption = format!(
        "Tracks: the level presented in each trial. Filled: positive answer; open: not. Diamonds: \
         reversals. The line joins the trials that the rule proposed, so that easy trials stand off it. \
         Dashed: the estimate of the rule.{}",
        cut(tracks.len())
    );
    Some(drawn(name, caption, data, |c: Canvas| {
        grid(
            c,
            name,
            "Tracks by participant",
            tracks.iter().take(MAX_PANELS).map(panel).collect(),
        )
    }))
}

/// A value with its interval.
struct Row {
    name: String,
    value: f64,
    ci95: Option<(f64, f64)>,
    /// Over participants.
    mean: bool,
}

/// Values with their intervals, one below the other, in a panel for each condition.
fn forest(
    name: &str,
    (title, caption, label): (&str, String, &str),
    panels: Vec<(String, Vec<Row>)>,
    zero: Option<f64>,
) -> Option<Drawn> {
    let most = panels.iter().map(|p| p.1.len()).max()?;
    if most == 0 || most > MAX_DRAWN {
        return None;
    }
    let mut data = vec![head(["condition", "name", "value", "ci95_lo", "ci95_hi"])];
    for (condition, rows) in &panels {
        for row in rows {
            data.push(vec![
                condition.clone(),
                row.name.clone(),
                digits(row.value),
                cell(row.ci95.map(|e| e.0)),
                cell(row.ci95.map(|e| e.1)),
            ]);
        }
    }
    let ends = panels.iter().flat_map(|(_, rows)| rows);
    let ends = ends.flat_map(|row| {
        let (low, high) = row.ci95.unwrap_or((row.value, row.value));
        [low, high, row.value]
    });
    let ends: Vec<f64> = ends.chain(zero).collect();
    let panel = |(condition, rows): &(String, Vec<Row>)| {
        let names: Vec<String> = rows.iter().map(|r| shortened(&r.name, 20)).collect();
        let mut axis = Axis::of_names("", &names).reversed();
        axis.columns = 20;
        let (low, high) = (axis.low, axis.high);
        let mut panel = Panel::new(Axis::around(label, ends.iter().copied()), axis);
        panel.title = shortened(condition, 30);
        if let Some(zero) = zero {
            let line = Mark::Line(vec![(zero, low), (zero, high)]);
            panel = panel.with(Look::plain(Color::INK).stroke(1.0), line);
        }
        for mean in [false, true] {
            let own = rows.iter().enumerate().filter(|(_, r)| r.mean == mean);
            let color = PALETTE[usize::from(mean)];
            let bars = own.clone().filter_map(|(i, r)| {
                let ((low, high), at) = (r.ci95?, i as f64);
                Some(Whisker { at, low, high })
            });
            let look = Look {
                shape: if mean { Shape::Diamond } else { Shape::Disc },
                ..Look::plain(color)
                    .stroke(1.5)
                    .size(if mean { 10.0 } else { 7.0 })
            };
            panel = panel.with(look, Mark::ErrorBarsAcross(bars.collect()));
            let points = own.map(|(i, r)| (r.value, i as f64)).collect();
            panel = panel.with(look, Mark::Points(points));
        }
        panel
    };
    Some(drawn(name, caption, data, |c: Canvas| {
        let columns = c.pick(2, 1).min(panels.len());
        let rows = panels.len().div_ceil(columns) as f64;
        let mut figure = c.figure(name, title, rows * (rows_height(most) + 70.0));
        figure.columns = columns;
        figure.panels = panels.iter().map(panel).collect();
        figure
    }))
}

/// A number, and its interval.
type Estimated = (Option<f64>, Option<(f64, f64)>);

/// Participants of a condition with a value, then the mean.
fn by_condition<R>(
    cells: &BTreeMap<CellName, R>,
    value: impl Fn(&R) -> Estimated,
    mean: impl Fn(&ConditionName) -> Option<Estimated>,
) -> Vec<(String, Vec<Row>)> {
    let mut cells: Vec<(&CellName, &R)> = cells.iter().collect();
    cells.sort_by_key(|(name, _)| &name.condition);
    let row = |name: &str, (value, ci95): Estimated, mean: bool| {
        Some(Row {
            name: name.to_owned(),
            value: value?,
            ci95,
            mean,
        })
    };
    let conditions = cells.chunk_by(|a, b| a.0.condition == b.0.condition);
    let rows = conditions.map(|own| {
        let condition = &own[0].0.condition;
        let of_cell =
            |(cell, found): &(&CellName, &R)| row(cell.participant.as_str(), value(found), false);
        let mut rows: Vec<Row> = own.iter().filter_map(of_cell).collect();
        if rows.len() > 1 {
            rows.extend(mean(condition).and_then(|mean| row("mean", mean, true)));
        }
        (condition.as_str().to_owned(), rows)
    });
    rows.filter(|(_, rows)| !rows.is_empty()).collect()
}

fn thresholds(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let panels = by_condition(
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
    let caption = "Thresholds (posterior medians) with 95 % intervals. Diamond: geometric mean over \
                   participants with its t interval.";
    let label = format!("threshold, {}", level_label(part));
    let title = "Thresholds by participant";
    forest(name, (title, caption.to_owned(), &label), panels, None)
}

fn sensitivities(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let panels = by_condition(&part.results.sdt, Sensitivity::d, |condition| {
        let found = part.results.over.sdt_group.get(condition)?;
        Some((found.d.mean.number(), found.d.ci95.ends()))
    });
    let caption = "Sensitivity d′ with 95 % intervals. Diamond: mean over participants with its t interval. \
                   Line: no sensitivity.";
    let title = "Sensitivity by participant";
    forest(name, (title, caption.to_owned(), "d′"), panels, Some(0.0))
}

/// Realization, ability and interval, the most preferred first.
fn abilities(part: &PartAnalysis) -> Vec<Row> {
    let items = part.results.pairs.iter().flat_map(|p| &p.items.0);
    let mut rows: Vec<Row> = items
        .filter_map(|(name, item)| {
            Some(Row {
                name: name.as_str().to_owned(),
                value: item.ability.number()?,
                ci95: item.ability_ci95.ends(),
                mean: false,
            })
        })
        .collect();
    rows.sort_by(|a, b| b.value.total_cmp(&a.value));
    rows
}

fn preferences(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let rows = abilities(part);
    let caption = "Preference: abilities (logarithms of odds, their sum is 0) with 95 % intervals, the most \
                   preferred realization first. A difference of 1.1 means that the higher one is preferred in \
                   three of four comparisons."
        .to_owned();
    let title = "Preferences for the realizations";
    forest(
        name,
        (title, caption, "ability"),
        vec![(String::new(), rows)],
        Some(0.0),
    )
}

/// Abilities against VAF.
fn against_vaf(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let rows = abilities(part);
    let with: Vec<(&Row, f64)> = rows
        .iter()
        .filter_map(|r| Some((r, *part.data.vaf.get(&r.name)?)))
        .collect();
    if with.len() < 2 || with.len() > MAX_DRAWN {
        return None;
    }
    let mut data = vec![head([
        "realization",
        "vaf",
        "ability",
        "ci95_lo",
        "ci95_hi",
    ])];
    for (row, vaf) in &with {
        data.push(vec![
            row.name.clone(),
            digits(*vaf),
            digits(row.value),
            cell(row.ci95.map(|e| e.0)),
            cell(row.ci95.map(|e| e.1)),
        ]);
    }
    let caption = "Preference against VAF, by realization, with 95 % intervals.".to_owned();
    Some(drawn(name, caption, data, |c: Canvas| {
        let ends = with.iter().flat_map(|(r, _)| {
            let (low, high) = r.ci95.unwrap_or((r.value, r.value));
            [low, high]
        });
        let x = Axis::around("VAF", with.iter().map(|w| w.1));
        let mut panel = Panel::new(x, Axis::around("ability", ends));
        let look = Look::plain(PALETTE[0]);
        let bars = with.iter().filter_map(|(r, at)| {
            let (low, high) = r.ci95?;
            Some(Whisker { at: *at, low, high })
        });
        panel = panel.with(look, Mark::ErrorBars(bars.collect()));
        let points = with.iter().map(|(r, vaf)| (*vaf, r.value)).collect();
        panel = panel.with(look, Mark::Points(points));
        panel.labels = (with.iter())
            .map(|(r, vaf)| Label {
                at: (*vaf, r.value),
                text: shortened(&r.name, 20),
            })
            .collect();
        c.figure(name, "Preference against VAF", c.pick(300.0, 260.0))
            .with(panel)
    }))
}

/// A level, what it was estimated as, and its interval.
type Estimate = (f64, f64, Option<(f64, f64)>);

/// Estimated magnitudes of levels over the levels, both on logarithmic axes.
fn magnitudes(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let found = part.results.over.magnitude.as_ref()?;
    let estimate = |(level, mean): (&At, &GeometricMean)| {
        Some((level.0, mean.geometric_mean.number()?, mean.ci95.ends()))
    };
    let rows: Vec<Estimate> = found.levels.iter().filter_map(estimate).collect();
    if rows.len() < 2 || rows.iter().any(|row| row.0 <= 0.0) {
        return None;
    }
    let mut data = vec![head(["level", "geometric_mean", "ci95_lo", "ci95_hi"])];
    for (level, mean, ci95) in &rows {
        data.push(vec![
            digits(*level),
            digits(*mean),
            cell(ci95.map(|e| e.0)),
            cell(ci95.map(|e| e.1)),
        ]);
    }
    let caption = "Estimated magnitudes: geometric means with 95 % intervals over participants, after their own means \
                   were made equal. Line: the power function fitted to the means. Both axes are logarithmic."
        .to_owned();
    let line = || {
        let law = found.law.as_ref()?;
        let exponent = law.exponent.number()?;
        let at_1 = law.log10_coefficient.number()? * std::f64::consts::LN_10;
        let point = |row: &Estimate| (row.0.ln(), at_1 + exponent * row.0.ln());
        Some(vec![point(rows.first()?), point(rows.last()?)])
    };
    Some(drawn(name, caption, data, |c: Canvas| {
        let ends = rows.iter().flat_map(|(_, mean, ci95)| {
            let (low, high) = ci95.unwrap_or((*mean, *mean));
            [low, high, *mean]
        });
        let x = Axis::of_logarithms(&level_label(part), rows.iter().map(|row| row.0));
        let mut panel = Panel::new(x, Axis::of_logarithms("estimate", ends));
        if let Some(line) = line() {
            panel = panel.with(Look::plain(PALETTE[1]).stroke(1.8), Mark::Line(line));
        }
        let look = Look::plain(PALETTE[0]).stroke(1.5);
        let bars = rows.iter().filter_map(|(level, _, ci95)| {
            let ((low, high), at) = ((*ci95)?, level.ln());
            let (low, high) = (low.ln(), high.ln());
            Some(Whisker { at, low, high })
        });
        panel = panel.with(look, Mark::ErrorBars(bars.collect()));
        let points = rows.iter().map(|(level, mean, _)| (level.ln(), mean.ln()));
        panel = panel.with(look.size(7.0), Mark::Points(points.collect()));
        c.figure(name, "Estimated magnitudes by level", c.pick(300.0, 260.0))
            .with(panel)
    }))
}
