//! Means of the realizations with the participants' means, and VAF: Fig. 10 and 11 of the
//! paper in one.

use super::{Along, Canvas, Drawn, Scene, cell, drawn, head, jitter, rows_height};
use crate::chart::{Axis, Look, Mark, PALETTE, Whisker};
use study_analysis::analyze::results::{Described, Number as _, Stat};

/// What the error bars of the means are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Bars {
    /// Within participants, if nobody left anything out.
    Within,
    /// Of the means that are adjusted for missing cells.
    Adjusted,
    /// Standard deviations of the ratings, where there is no interval.
    Deviation,
}

impl Bars {
    fn of(scene: &Scene<'_>) -> Self {
        let any = |what: Self| {
            scene
                .models
                .iter()
                .any(|m| what.ends(scene, &m.id).is_some())
        };
        if scene.a.design.is_complete() && any(Self::Within) {
            Self::Within
        } else if any(Self::Adjusted) {
            Self::Adjusted
        } else {
            Self::Deviation
        }
    }

    /// The ends of the bar of a realization.
    fn ends(self, scene: &Scene<'_>, model: &str) -> Option<(f64, f64)> {
        let around = |mean: f64, half: f64| (mean - half, mean + half);
        match self {
            Self::Within => Some(around(
                scene.mean(model)?,
                (scene.a.described(model)?.cousineau_morey.as_ref())
                    .map(|c| &c.ci95_half)
                    .number()?,
            )),
            Self::Adjusted => scene.a.adjusted(model)?.ci95.ends(),
            Self::Deviation => Some(around(scene.mean(model)?, scene.number(model, |d| &d.sd)?)),
        }
    }

    fn label(self) -> &'static str {
        match self {
            Self::Within | Self::Adjusted => "mean and 95 % CI",
            Self::Deviation => "mean ± SD",
        }
    }

    fn explained(self) -> &'static str {
        match self {
            Self::Within => "95 % within-participant intervals (Cousineau–Morey)",
            Self::Adjusted => "95 % intervals of a mixed model about the adjusted means",
            Self::Deviation => "± 1 standard deviation over all ratings of a realization (n − 1)",
        }
    }
}

/// The figures of the paper that this one reproduces, if the realizations are of that kind.
fn as_in(scene: &Scene<'_>, figures: &str) -> String {
    if scene.a.has_memory() {
        format!(", as in {figures} of Colton & Hollerbach (World Haptics 2007)")
    } else {
        String::new()
    }
}

pub(super) fn fig10(scene: &Scene<'_>) -> Option<Drawn> {
    let means: Vec<(f64, f64)> = (scene.models.iter().enumerate())
        .filter_map(|(i, m)| Some((i as f64, scene.mean(&m.id)?)))
        .collect();
    if !scene.drawable() || means.is_empty() {
        return None;
    }
    let bars = Bars::of(scene);
    let whiskers: Vec<Whisker> = (scene.models.iter().enumerate())
        .filter_map(|(i, m)| {
            let (low, high) = bars.ends(scene, &m.id).filter(|(low, high)| low < high)?;
            let at = i as f64;
            Some(Whisker { at, low, high })
        })
        .collect();
    let mut dots = Vec::new();
    if scene.with_subjects() && scene.subjects.len() > 1 {
        for (j, m) in scene.models.iter().enumerate() {
            for (i, s) in scene.subjects.iter().enumerate() {
                let beside = j as f64 + 0.5 * jitter(i);
                dots.extend(scene.cell(s, &m.id).map(|mean| (beside, mean)));
            }
        }
    }
    let vaf: Vec<(f64, f64)> = (scene.models.iter().enumerate())
        .filter_map(|(i, m)| Some((i as f64, m.vaf?)))
        .collect();
    let mut data = vec![head([
        "model",
        "n",
        "mean",
        "sd",
        "mean_drawn",
        "bar_lo",
        "bar_hi",
        "vaf",
    ])];
    for m in &scene.models {
        let ends = bars.ends(scene, &m.id);
        let mut row = vec![m.id.clone()];
        let fields: [fn(&Described) -> &Stat; 3] = [|d| &d.n, |d| &d.mean, |d| &d.sd];
        row.extend(fields.map(|field| cell(scene.number(&m.id, field))));
        row.push(cell(scene.mean(&m.id)));
        row.extend([ends.map(|e| e.0), ends.map(|e| e.1), m.vaf].map(cell));
        data.push(row);
    }
    let (mean, reproduced) = match (scene.adjusted(), vaf.is_empty()) {
        ("", true) => ("Mean", as_in(scene, "Fig. 10")),
        ("", false) => ("Mean", as_in(scene, "Fig. 10 and 11")),
        (_, true) => ("Adjusted mean", as_in(scene, "Fig. 10")),
        (_, false) => ("Adjusted mean", as_in(scene, "Fig. 10 and 11")),
    };
    let and_vaf = if vaf.is_empty() {
        ""
    } else if scene.a.has_memory() {
        " and its variance accounted for (VAF) on the validation recording"
    } else {
        " and its variance accounted for (VAF)"
    };
    let small = if dots.is_empty() {
        ""
    } else {
        " Small dots: means of the participants."
    };
    let caption = format!(
        "{mean} {} of each realization{and_vaf}, in the order of {}{reproduced}. Error bars: \
         {}.{small}",
        scene.asked,
        scene.order(),
        bars.explained(),
    );
    let title = format!("Mean {} by realization", scene.asked);
    let mut all: Vec<f64> = means.iter().chain(&dots).map(|p| p.1).collect();
    all.extend(whiskers.iter().flat_map(|w| [w.low, w.high]));
    Some(drawn("fig10-means", caption, data, |c: Canvas| {
        let across = scene.across(c);
        let names = Axis::of_names(&scene.realizations(), &scene.names());
        let mut above = names.clone();
        if !across && !vaf.is_empty() {
            above = above.bare();
            above.label.clear();
        }
        let values = scene.ratings(&format!("{}, {}", scene.asked, bars.label()), &all);
        let mut faint = Look::plain(PALETTE[5]).stroke(4.5);
        faint.opacity = 0.6;
        let look = Look::plain(PALETTE[0]).stroke(2.0).size(8.0);
        let rating = Along::new(across, above, values)
            .with(None, faint, Mark::Dots(dots.clone()))
            .with(None, look, Mark::ErrorBars(whiskers.clone()))
            .with(None, look, Mark::Points(means.clone()));
        let mut height = if across {
            rows_height(scene.models.len()) + 52.0
        } else {
            c.pick(250.0, 230.0)
        };
        let mut rating = rating.panel;
        if vaf.is_empty() {
            return c.figure("fig10-means", &title, height).with(rating);
        }
        let axis = Axis::around("VAF", vaf.iter().map(|v| v.1));
        let names = if across { names.bare() } else { names };
        let mark = Look::nth(1).size(7.0);
        let mut second = Along::new(across, names, axis)
            .with(None, mark, Mark::Points(vaf.clone()))
            .panel;
        if across {
            (rating.breadth, second.breadth) = (1.0, c.pick(0.6, 0.7));
        } else {
            (rating.share, second.share) = (1.5, 1.0);
            height += 140.0;
        }
        let mut figure = c.figure("fig10-means", &title, height);
        figure.columns = if across { 2 } else { 1 };
        figure.with(rating).with(second)
    }))
}
