//! The force of each playback against that of its table: VAF, gain and largest error in just
//! noticeable differences, by verdict.

use super::{Along, Canvas, Drawn, Scene, cell, drawn, head, jitter, rows_height};
use crate::chart::{Axis, Color, Look, Mark, PALETTE};
use study_session::outcome::Verdict;

/// Largest number of playbacks that are drawn.
const MAX_PLAYBACKS: usize = 20_000;

/// A playback.
struct Playback {
    /// Place of the realization on its axis, and beside it.
    at: f64,
    vaf: f64,
    gain: f64,
    /// Largest error, in just noticeable differences; earlier releases did not compute it.
    error_jnd: Option<f64>,
    verdict: Verdict,
}

impl Playback {
    fn is_wrong(&self) -> bool {
        matches!(self.verdict, Verdict::Flag | Verdict::Fault)
    }
}

pub(super) fn rendering(scene: &Scene<'_>) -> Option<Drawn> {
    let mut all = Vec::new();
    let mut data = vec![head([
        "subject",
        "model",
        "repetition",
        "verdict",
        "rendered_vaf",
        "gain",
        "delivered_vaf",
        "judged_share",
        "error_jnd",
    ])];
    for row in scene.a.rows.iter().filter(|r| r.excluded.is_none()) {
        let (Some(felt), model) = (row.felt, scene.a.model(row)) else {
            continue;
        };
        data.push(vec![
            scene.a.subject(row).to_owned(),
            model.to_owned(),
            row.repetition.to_string(),
            felt.verdict.as_str().to_owned(),
            cell(felt.rendered_vaf),
            cell(felt.gain),
            cell(felt.delivered_vaf),
            cell(felt.judged_share),
            cell(felt.error_jnd),
        ]);
        let place = scene.models.iter().position(|m| m.id == model);
        let judged = matches!(felt.verdict, Verdict::Ok | Verdict::Flag | Verdict::Fault);
        if let (Some(place), Some(vaf), Some(gain), true) =
            (place, felt.rendered_vaf, felt.gain, judged)
        {
            all.push(Playback {
                at: place as f64 + 0.6 * jitter(all.len()),
                vaf,
                gain,
                error_jnd: felt.error_jnd,
                verdict: felt.verdict,
            });
        }
    }
    if !scene.drawable() || all.is_empty() || all.len() > MAX_PLAYBACKS {
        return None;
    }
    let points = |wrong: bool, of: fn(&Playback) -> Option<f64>| -> Vec<(f64, f64)> {
        (all.iter().filter(|p| p.is_wrong() == wrong))
            .filter_map(|p| Some((p.at, of(p)?)))
            .collect()
    };
    let has_errors = all.iter().any(|p| p.error_jnd.is_some());
    let any_wrong = all.iter().any(Playback::is_wrong);
    let caption = format!(
        "The force that the device commanded against the force of the table for the same motion, one dot \
         for each trial: share of the variance (VAF, 1 is right) and slope (gain, 1 is right){}.{}",
        match has_errors {
            true =>
                ", and the largest difference that lasted 20 ms, in just noticeable differences of a force",
            false => "",
        },
        match any_wrong {
            true => " Crosses: not within the limits of the protocol.",
            false => " All are within the limits of the protocol.",
        }
    );
    let title = "Rendered force against the force of the table";
    Some(drawn("rendering", caption, data, |c: Canvas| {
        let across = scene.across(c);
        let names = Axis::of_names(&scene.realizations(), &scene.names());
        let right = Look::plain(PALETTE[0]).stroke(4.0);
        let wrong = Look {
            color: PALETTE[1],
            ..Look::nth(6).size(6.0)
        };
        let one = Look::plain(Color::INK).stroke(1.0);
        let panel = |label: &str, names: Axis, of: fn(&Playback) -> Option<f64>| {
            let values = all.iter().filter_map(of).chain([1.0]);
            let ends = [(-0.5, 1.0), (scene.models.len() as f64 - 0.5, 1.0)];
            Along::new(across, names, Axis::around(label, values))
                .with(None, one, Mark::Line(ends.to_vec()))
                .with(None, right, Mark::Dots(points(false, of)))
                .with(None, wrong, Mark::Points(points(true, of)))
                .panel
        };
        let mut above = names.clone();
        if !across {
            above = above.bare();
            above.label.clear();
        }
        let names = if across { names.bare() } else { names };
        let mut panels = vec![
            panel("rendered VAF", above.clone(), |p| Some(p.vaf)),
            panel("gain", names.clone(), |p| Some(p.gain)),
        ];
        if has_errors {
            // The last one has the names below.
            panels[1] = panel("gain", if across { names.clone() } else { above }, |p| {
                Some(p.gain)
            });
            panels.push(panel("largest error, JND", names, |p| p.error_jnd));
        }
        let height = if across {
            for (panel, breadth) in panels
                .iter_mut()
                .zip([1.0, c.pick(0.6, 0.7), c.pick(0.6, 0.7)])
            {
                panel.breadth = breadth;
            }
            rows_height(scene.models.len()) + 52.0
        } else {
            panels.iter_mut().for_each(|panel| panel.share = 1.0);
            0.5 * panels.len() as f64 * c.pick(340.0, 320.0)
        };
        let mut figure = c.figure("rendering", title, height);
        figure.columns = if across { panels.len() } else { 1 };
        panels
            .into_iter()
            .fold(figure, |figure, panel| figure.with(panel))
    }))
}
