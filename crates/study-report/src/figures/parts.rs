//! The figures of a part that is no rating: psychometric functions with their data, tracks
//! with their reversals, preferences, thresholds and sensitivities of the participants.

use super::functions::{
    MAX_PANELS, cut, grid, level_axis, level_label, of_everybody, place, psychometric,
};
use super::identification::confusions;
use super::weber::webers_law;
use super::{Canvas, Drawn, MAX_DRAWN, cell, drawn, head, rows_height};
use crate::apa::digits;
use crate::chart::{Axis, Color, Dash, Look, Mark, PALETTE, Panel, Shape, Whisker};
use crate::chart::{Label, shortened};
use std::collections::BTreeMap;
use study_analysis::analyze::psychophysics::results::{
    At, CellName, ConditionName, GeometricMean, Sensitivity,
};
use study_analysis::analyze::psychophysics::{LevelData, PartAnalysis, TrackData, TrackTrial};
use study_analysis::analyze::results::{Interval, Number as _};
use study_stats::psychometric::Spacing;

/// What the files of these figures are called before the number of the part.
pub const PREFIX: &str = "part-";

/// All figures that the data allow, of the part with this number, from 1.
pub fn of_part(number: usize, part: &PartAnalysis) -> Vec<Drawn> {
    let name = |kind: &str| format!("{PREFIX}{number}-{kind}");
    let all = [
        psychometric(&name("psychometric"), part),
        of_everybody(&name("functions"), part),
        thresholds(&name("thresholds"), part),
        webers_law(&name("webers-law"), part),
        tracks(&name("tracks"), part),
        sensitivities(&name("sensitivities"), part),
        preferences(&name("preferences"), part),
        against_vaf(&name("preference-against-vaf"), part),
        magnitudes(&name("magnitudes"), part),
        confusions(&name("confusions"), part),
    ];
    let note = match (part.simulated, part.pilot) {
        (true, _) => Some("includes simulated data"),
        (false, true) => Some("includes pilot data"),
        (false, false) => None,
    };
    let all = all.into_iter().flatten();
    all.map(|drawn| drawn.noted(note)).collect()
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
    let label = level_label(part);
    // A label has the height of its row.
    let short = if label.chars().count() > 16 {
        "level"
    } else {
        label.as_str()
    };
    let drawn_tracks = tracks.iter().take(MAX_PANELS);
    let levels: Vec<f64> = drawn_tracks
        .flat_map(|t| t.trials.iter().map(|x| x.level))
        .collect();
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
        let x = Axis::new("trial", 0.0, track.trials.len() as f64 + 1.0);
        let mut panel = Panel::new(x, level_axis(spacing, short, levels.iter().copied()));
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
        for (shape, size, positive) in [(Shape::Disc, 4.0, true), (Shape::Ring, 7.0, false)] {
            let look = Look {
                shape,
                ..Look::plain(PALETTE[0]).size(size)
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
        "Tracks: the level presented in each trial ({label}). Filled: positive answer; open rings: not. Diamonds: \
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
    /// The same in the pooled model.
    together: Option<(f64, (f64, f64))>,
}

impl Row {
    /// Everything that has to be on the axis.
    fn ends(&self) -> impl Iterator<Item = f64> {
        let (low, high) = self.ci95.unwrap_or((self.value, self.value));
        let together = self.together.into_iter();
        [low, high, self.value]
            .into_iter()
            .chain(together.flat_map(|(value, (low, high))| [value, low, high]))
    }
}

/// Values with their intervals, one below the other, in a panel for each condition.
fn forest(
    name: &str,
    (title, caption, label): (&str, String, &str),
    panels: Vec<(String, Vec<Row>)>,
    (zero, spacing): (Option<f64>, Spacing),
) -> Option<Drawn> {
    let most = panels.iter().map(|p| p.1.len()).max()?;
    if most == 0 || most > MAX_DRAWN {
        return None;
    }
    let pooled = panels
        .iter()
        .any(|(_, rows)| rows.iter().any(|row| row.together.is_some()));
    let mut names = head(["condition", "name", "value", "ci95_lo", "ci95_hi"]);
    if pooled {
        names.extend(head(["together", "together_ci95_lo", "together_ci95_hi"]));
    }
    let mut data = vec![names];
    for (condition, rows) in &panels {
        for row in rows {
            let mut line = vec![
                condition.clone(),
                row.name.clone(),
                digits(row.value),
                cell(row.ci95.map(|e| e.0)),
                cell(row.ci95.map(|e| e.1)),
            ];
            if pooled {
                let ends = row.together.map(|t| t.1);
                line.push(cell(row.together.map(|t| t.0)));
                line.extend([cell(ends.map(|e| e.0)), cell(ends.map(|e| e.1))]);
            }
            data.push(line);
        }
    }
    let ends = panels
        .iter()
        .flat_map(|(_, rows)| rows.iter().flat_map(Row::ends));
    let ends: Vec<f64> = ends.chain(zero).collect();
    // A level without a place, such as 0 over logarithms, needs an axis of levels.
    let spacing = match ends.iter().all(|x| spacing.place(*x).is_some()) {
        true => spacing,
        false => Spacing::Lin,
    };
    // Two marks of a row, one below the other.
    let below = if pooled { 0.16 } else { 0.0 };
    let panel = |(condition, rows): &(String, Vec<Row>)| {
        let names: Vec<String> = rows.iter().map(|r| shortened(&r.name, 20)).collect();
        let mut axis = Axis::of_names("", &names).reversed();
        axis.columns = 20;
        let (low, high) = (axis.low, axis.high);
        let mut panel = Panel::new(level_axis(spacing, label, ends.iter().copied()), axis);
        panel.title = shortened(condition, 30);
        if let Some(zero) = zero {
            let line = Mark::Line(vec![(zero, low), (zero, high)]);
            panel = panel.with(Look::plain(Color::INK).stroke(1.0), line);
        }
        for mean in [false, true] {
            let own = rows.iter().enumerate().filter(|(_, r)| r.mean == mean);
            let color = PALETTE[usize::from(mean)];
            let bars = own.clone().filter_map(|(i, r)| {
                let (low, high) = r.ci95?;
                let (low, high) = (place(spacing, low), place(spacing, high));
                let at = i as f64 - below;
                Some(Whisker { at, low, high })
            });
            let look = Look {
                shape: if mean { Shape::Diamond } else { Shape::Disc },
                ..Look::plain(color)
                    .stroke(1.5)
                    .size(if mean { 10.0 } else { 7.0 })
            };
            panel = panel.with(look, Mark::ErrorBarsAcross(bars.collect()));
            let points = own.map(|(i, r)| (place(spacing, r.value), i as f64 - below));
            panel = panel.with(look, Mark::Points(points.collect()));
        }
        let open = Look {
            shape: Shape::Ring,
            ..Look::plain(PALETTE[6]).stroke(1.2).size(7.0)
        };
        let together =
            || (rows.iter().enumerate()).filter_map(|(i, r)| Some((i as f64 + 0.2, r.together?)));
        let bars = together().map(|(at, (_, (low, high)))| Whisker {
            at,
            low: place(spacing, low),
            high: place(spacing, high),
        });
        panel = panel.with(open, Mark::ErrorBarsAcross(bars.collect()));
        let points = together().map(|(at, (value, _))| (place(spacing, value), at));
        panel.with(open, Mark::Points(points.collect()))
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
            together: None,
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
    let mut caption =
        "Thresholds (posterior medians) with 95 % intervals. Diamond: geometric mean over \
                       participants with its t interval."
            .to_owned();
    let model = part.results.over.psy_population.as_ref();
    if let Some(model) = model.filter(|model| model.has_converged()) {
        caption += " Open rings: the same learned together, the mean that of the population.";
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
    let spacings = part.data.levels.iter().map(|cell| cell.spacing);
    let spacing = match spacings.clone().all(|s| s == Spacing::Log) {
        true => Spacing::Log,
        false => Spacing::Lin,
    };
    let label = format!("threshold, {}", level_label(part));
    let title = "Thresholds by participant";
    forest(name, (title, caption, &label), panels, (None, spacing))
}

fn sensitivities(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let panels = by_condition(&part.results.sdt, Sensitivity::d, |condition| {
        let found = part.results.over.sdt_group.get(condition)?;
        Some((found.d.mean.number(), found.d.ci95.ends()))
    });
    let caption = "Sensitivity d′ with 95 % intervals. Diamond: mean over participants with its t interval. \
                   Line: no sensitivity.";
    let title = "Sensitivity by participant";
    let text = (title, caption.to_owned(), "d′");
    forest(name, text, panels, (Some(0.0), Spacing::Lin))
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
                together: None,
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
        (Some(0.0), Spacing::Lin),
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
