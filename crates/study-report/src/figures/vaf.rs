//! The mean rating of each realization against its VAF.

use super::{Canvas, Drawn, Scene, cell, drawn, head};
use crate::apa;
use crate::apa::digits;
use crate::chart::{Axis, Color, Dash, Figure, Label, Look, Mark, PALETTE, Panel, Whisker};
use crate::chart::{MAX_LABEL, SMALL, shortened, text_width};
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Question, TestKind};
use study_stats::distribution::t_quantile;
use study_stats::regression::{Line, line};

/// Points of the band around the line.
const BAND: usize = 41;

/// Realizations whose VAF lie within this share of all of them are crowded, if they are
/// at least half of all and at least three.
const CROWDED: f64 = 0.25;

/// A realization as a point.
struct Dot {
    /// Index of the realization.
    nth: usize,
    vaf: f64,
    mean: f64,
    ci95: Option<(f64, f64)>,
}

/// The least-squares line through the tested realizations.
struct Fit {
    line: Line,
    t: f64,
    n: f64,
    center: f64,
    /// Sum of squares of VAF about its mean.
    squares: f64,
    /// Lowest and highest VAF.
    ends: (f64, f64),
}

impl Fit {
    fn of(scene: &Scene<'_>, dots: &[Dot]) -> Option<Self> {
        let tested: Vec<&Dot> = (dots.iter())
            .filter(|d| scene.models[d.nth].tested)
            .collect();
        let x: Vec<f64> = tested.iter().map(|d| d.vaf).collect();
        let y: Vec<f64> = tested.iter().map(|d| d.mean).collect();
        let n = x.len() as f64;
        let center = x.iter().sum::<f64>() / n;
        Some(Self {
            line: line(&x, &y)?,
            t: t_quantile(0.975, n - 2.0)?,
            n,
            center,
            squares: x.iter().map(|x| (x - center) * (x - center)).sum(),
            ends: range(x.iter().copied()),
        })
    }

    /// The line at a VAF, and half the width of its 95 % band.
    fn at(&self, vaf: f64) -> (f64, f64) {
        let y = self.line.intercept + self.line.slope * vaf;
        let from = vaf - self.center;
        let variance = 1.0 / self.n + from * from / self.squares;
        (y, self.t * self.line.residual_sd * variance.sqrt())
    }

    /// The band between two VAF: VAF, lower edge, upper edge.
    fn band(&self, (low, high): (f64, f64)) -> Vec<(f64, f64, f64)> {
        let at = |i: usize| low + (high - low) * i as f64 / (BAND - 1) as f64;
        (0..BAND)
            .map(|i| {
                let (y, half) = self.at(at(i));
                (at(i), y - half, y + half)
            })
            .collect()
    }
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
        (low.min(v), high.max(v))
    })
}

pub(super) fn against_vaf(scene: &Scene<'_>) -> Option<Drawn> {
    let each = scene.models.iter().enumerate();
    let dots: Vec<Dot> = each
        .filter_map(|(nth, m)| {
            let adjusted = scene
                .a
                .adjusted(&m.id)
                .filter(|_| !scene.a.design.is_complete());
            let described = || scene.a.described(&m.id)?.subject_mean.ci95.ends();
            Some(Dot {
                nth,
                vaf: m.vaf?,
                mean: scene.mean(&m.id)?,
                ci95: (adjusted.and_then(|m| m.ci95.ends())).or_else(described),
            })
        })
        .collect();
    if !scene.drawable() || dots.len() < 2 {
        return None;
    }
    let fit = Fit::of(scene, &dots);
    let mut data = vec![head([
        "model", "vaf", "mean", "ci95_lo", "ci95_hi", "line", "band_lo", "band_hi",
    ])];
    for d in &dots {
        let drawn = fit.as_ref().map(|f| f.at(d.vaf));
        data.push(vec![
            scene.models[d.nth].id.clone(),
            digits(d.vaf),
            digits(d.mean),
            cell(d.ci95.map(|e| e.0)),
            cell(d.ci95.map(|e| e.1)),
            cell(drawn.map(|(y, _)| y)),
            cell(drawn.map(|(y, half)| y - half)),
            cell(drawn.map(|(y, half)| y + half)),
        ]);
    }
    let decided = scene
        .a
        .finding(&Question::Vaf)
        .and_then(|f| f.test.as_ref());
    let r = scene.a.correlation().pearson.r.number();
    let found = r.map_or_else(String::new, |r| {
        let p = decided.map_or_else(String::new, |t| {
            let how = match t.kind {
                TestKind::WeightedTrend => "unweighted; weighted by their precision p",
                _ => "permutation p",
            };
            format!(", {how} {}", apa::p(t.p))
        });
        format!(" r = {}{p}.", apa::r(r))
    });
    let bars = match (dots.iter().any(|d| d.ci95.is_some()), scene.adjusted()) {
        (false, _) => "",
        (true, "") => {
            " Error bars: 95 % t intervals over participants; they do not generalize to other \
             realizations."
        }
        (true, _) => {
            " Error bars: 95 % intervals of the mixed model; they do not generalize to other \
             realizations."
        }
    };
    let line = if fit.is_some() {
        " Line: least squares over the tested realizations, unweighted, with its 95 % band."
    } else {
        ""
    };
    let caption = format!(
        "{} {} over participants against VAF (variance accounted for).{bars}{line}{found}",
        if scene.adjusted().is_empty() {
            "Mean"
        } else {
            "Adjusted mean"
        },
        scene.asked
    );
    let title = format!("Mean {} against VAF", scene.asked);
    Some(drawn("rating-against-vaf", caption, data, |c: Canvas| {
        let plane = Plane {
            scene,
            dots: &dots,
            fit: fit.as_ref(),
            title: &title,
        };
        let mut figure = plane.figure(c, false, 0.0);
        // If names have no room: a higher figure, or numbers.
        for (numbered, more) in [(false, 80.0), (true, 0.0), (true, 160.0)] {
            if figure.labels_fit() {
                break;
            }
            figure = plane.figure(c, numbered, more);
        }
        figure
    }))
}

struct Plane<'a> {
    scene: &'a Scene<'a>,
    dots: &'a [Dot],
    fit: Option<&'a Fit>,
    title: &'a str,
}

impl Plane<'_> {
    /// The dots that crowd within a small part of the VAF.
    fn crowd(&self) -> Option<(f64, f64)> {
        let mut vaf: Vec<f64> = self.dots.iter().map(|d| d.vaf).collect();
        vaf.sort_by(f64::total_cmp);
        let (n, whole) = (vaf.len(), vaf[vaf.len() - 1] - vaf[0]);
        (n.div_ceil(2).max(3)..n).rev().find_map(|k| {
            let windows = vaf.windows(k).map(|w| (w[0], w[k - 1]));
            let narrowest = windows.min_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))?;
            let width = narrowest.1 - narrowest.0;
            (width > 0.0 && width <= CROWDED * whole).then_some(narrowest)
        })
    }

    /// With names at the dots, or with numbers that a legend explains.
    fn figure(&self, c: Canvas, numbered: bool, more: f64) -> Figure {
        let crowd = self.crowd();
        let inside = |d: &Dot| crowd.is_some_and(|(low, high)| low <= d.vaf && d.vaf <= high);
        let mut main = self.panel("VAF", self.dots, numbered, |d| !inside(d));
        let mut height = c.pick(300.0, 240.0) + more;
        let names = || self.dots.iter().map(|d| self.name(d));
        if numbered {
            let widths = names().map(|n| text_width(&shortened(&n, MAX_LABEL), SMALL) + 60.0);
            let room = if crowd.is_some() {
                c.pick(0.45, 0.8)
            } else {
                0.85
            } * c.width;
            height += 18.0 * (widths.sum::<f64>() / room).ceil();
            let point = |d: &Dot| Mark::Points(vec![(d.vaf, d.mean)]);
            for (i, d) in self.dots.iter().enumerate() {
                let name = format!("{} {}", i + 1, self.name(d));
                main = main.named(&name, Look::plain(PALETTE[0]).size(8.0), point(d));
            }
        }
        let Some(crowd) = crowd else {
            return c
                .figure("rating-against-vaf", self.title, height)
                .with(main);
        };
        let dots: Vec<&Dot> = self.dots.iter().filter(|d| inside(d)).collect();
        let (low, high) = range(dots.iter().flat_map(|d| {
            let (low, high) = d.ci95.unwrap_or((d.mean, d.mean));
            [low, high]
        }));
        let room = 0.03 * (main.x.high - main.x.low);
        let corners = [
            (crowd.0 - room, low),
            (crowd.1 + room, low),
            (crowd.1 + room, high),
            (crowd.0 - room, high),
            (crowd.0 - room, low),
        ];
        let thin = Look::plain(Color::GREY).stroke(1.0).dashed(Dash::Dashed);
        let main = main.with(thin, Mark::Line(corners.to_vec()));
        let detail = self.panel("VAF, enlarged", self.dots, numbered, inside);
        let mut figure = c.figure("rating-against-vaf", self.title, height);
        if c.narrow {
            figure.height += 225.0 + more;
        } else {
            figure.columns = 2;
        }
        figure.with(main).with(detail)
    }

    fn name(&self, d: &Dot) -> String {
        super::name(self.scene.models[d.nth])
    }

    /// The dots on axes around those that are labeled.
    fn panel(
        &self,
        x: &str,
        dots: &[Dot],
        numbered: bool,
        labeled: impl Fn(&Dot) -> bool,
    ) -> Panel {
        let ends = |d: &Dot| d.ci95.unwrap_or((d.mean, d.mean));
        let all: Vec<f64> = dots.iter().flat_map(|d| [ends(d).0, ends(d).1]).collect();
        let enlarged = x != "VAF";
        let shown = |d: &&Dot| !enlarged || labeled(d);
        let with = dots.iter().any(|d| d.ci95.is_some());
        let y = format!(
            "{}, {}mean{}",
            self.scene.asked,
            self.scene.adjusted(),
            if with { " and 95 % CI" } else { "" }
        );
        let axis = Axis::around(x, dots.iter().filter(shown).map(|d| d.vaf));
        let (low, high) = (axis.low, axis.high);
        let mut panel = Panel::new(axis, self.scene.ratings(&y, &all));
        let look = Look::plain(PALETTE[0]).stroke(1.5).size(8.0);
        if let Some(fit) = self.fit {
            let span = (low.max(fit.ends.0), high.min(fit.ends.1));
            let mut pale = Look::plain(PALETTE[1]);
            pale.opacity = 0.15;
            let line = [span.0, span.1].map(|x| (x, fit.at(x).0));
            panel = panel.with(pale, Mark::Area(fit.band(span))).with(
                Look::plain(PALETTE[1]).stroke(1.5),
                Mark::Line(line.to_vec()),
            );
        }
        let bars = dots.iter().filter(shown).filter_map(|d| {
            let ((low, high), at) = (d.ci95?, d.vaf);
            Some(Whisker { at, low, high })
        });
        let points = dots.iter().filter(shown).map(|d| (d.vaf, d.mean));
        panel = panel
            .with(look, Mark::ErrorBars(bars.collect()))
            .with(look, Mark::Points(points.collect()));
        let named = dots.iter().enumerate().filter(|(_, d)| labeled(d));
        panel.labels = named
            .map(|(i, d)| Label {
                at: (d.vaf, d.mean),
                text: if numbered {
                    (i + 1).to_string()
                } else {
                    self.name(d)
                },
            })
            .collect();
        panel
    }
}
