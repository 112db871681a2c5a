//! The figures of a part that is no rating: psychometric functions with their data, tracks
//! with their reversals, preferences, thresholds and sensitivities of the participants.

use super::adjustment::settings;
use super::forest::{Row, by_condition, forest};
use super::functions::{
    MAX_PANELS, cut, grid, level_axis, level_label, of_everybody, place, psychometric,
};
use super::identification::confusions;
use super::rankings::worths;
use super::searches::search_map;
use super::similarity::{map, weights};
use super::thresholds::{by_conditions, by_participant};
use super::weber::webers_law;
use super::{Canvas, Drawn, MAX_DRAWN, cell, drawn, head};
use crate::apa::digits;
use crate::chart::{Axis, Dash, Label, Look, Mark, PALETTE, Panel, Shape, Whisker, shortened};
use study_analysis::analyze::psychophysics::results::{At, GeometricMean, Sensitivity};
use study_analysis::analyze::psychophysics::{LevelData, PartAnalysis, TrackData, TrackTrial};
use study_analysis::analyze::results::Number as _;
use study_base::sort::SmallSort as _;
use study_stats::psychometric::Spacing;

/// What the files of these figures are called before the number of the part.
pub const PREFIX: &str = "part-";

/// All figures that the data allow, of the part with this number, from 1.
pub fn of_part(number: usize, part: &PartAnalysis) -> Vec<Drawn> {
    let name = |kind: &str| format!("{PREFIX}{number}-{kind}");
    let all = [
        psychometric(&name("psychometric"), part),
        of_everybody(&name("functions"), part),
        by_participant(&name("thresholds"), part),
        by_conditions(&name("thresholds-by-condition"), part),
        webers_law(&name("webers-law"), part),
        tracks(&name("tracks"), part),
        sensitivities(&name("sensitivities"), part),
        preferences(&name("preferences"), part),
        against_vaf(&name("preference-against-vaf"), part),
        magnitudes(&name("magnitudes"), part),
        confusions(&name("confusions"), part),
        map(&name("map"), part),
        weights(&name("weights"), part),
        worths(&name("worths"), part),
        settings(&name("settings"), part),
        search_map(&name("search"), part),
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

fn sensitivities(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let panels = by_condition(&part.results.sdt, Sensitivity::d, |condition| {
        let found = part.results.over.sdt_group.get(condition)?;
        Some((found.d.mean.number(), found.d.ci95.ends()))
    });
    let caption = "Sensitivity d′ with 95 % intervals. Diamond and shade: mean over participants with its t \
                   interval. Line: no sensitivity.";
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
    rows.small_sort_by(|a, b| b.value.total_cmp(&a.value));
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
