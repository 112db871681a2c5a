//! The heat map of a confusion matrix.

use super::{Canvas, Drawn, cell, drawn, head};
use crate::apa::{self, digits};
use crate::chart::{
    Axis, ColorBar, Look, Mark, Note, PALETTE, Panel, SMALL, Scale, Span, shortened, text_width,
    widest,
};
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_stats::identification::Confusions;

/// Largest number of labels that are drawn.
const MAX_LABELS: usize = 30;

/// Columns of a label beside its row, at two widths.
const NAME: (usize, usize) = (28, 16);

/// Width of the color bar with its label, and of the margins, px.
const BAR: f64 = 70.0;
const MARGINS: f64 = 40.0;

/// How often each label was given where another one was right, over all participants.
pub(super) fn confusions(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let labels = &part.data.labels;
    let sum = Confusions::sum(part.data.confusions.iter().map(|own| &own.1))?;
    if !(2..=MAX_LABELS).contains(&labels.len()) {
        return None;
    }
    let share = |right: usize, given: usize| {
        let n = sum.right(right);
        (n > 0.0).then(|| sum.count(right, given) / n)
    };
    let title = format!(
        "Confusion matrix of {} labels, {} correct",
        labels.len(),
        apa::percent(sum.correct() / sum.trials())
    );
    let clipped = (labels.iter()).any(|l| shortened(l, NAME.1) != shortened(l, 1000));
    let all: Vec<String> = (labels.iter().enumerate())
        .map(|(i, label)| format!("{} = {label}", i + 1))
        .collect();
    let all = match clipped {
        true => format!(" Labels: {}.", all.join("; ")),
        false => String::new(),
    };
    let caption = format!(
        "Confusion matrix: how often each label was given (columns, by number) when each of them was \
         right (rows), over all participants. Darker is a larger share of the row. The file has the matrix of each \
         participant, too.{all}"
    );
    Some(drawn(name, caption, data(part, &sum), |c: Canvas| {
        let most = c.pick(NAME.0, NAME.1);
        let row = |(i, label): (usize, &String)| format!("{} {}", i + 1, shortened(label, most));
        let rows: Vec<String> = labels.iter().enumerate().map(row).collect();
        let numbers: Vec<String> = (1..=labels.len()).map(|n| n.to_string()).collect();
        let mut y = Axis::of_names("label that was right", &rows).reversed();
        y.columns = most + 3;
        let scale = Scale::ascending(0.0, 1.0);
        let cells = || {
            let each = move |right: usize| (0..labels.len()).map(move |given| (right, given));
            (0..labels.len()).flat_map(each)
        };
        let boxes = cells().filter_map(|(right, given)| {
            let (x, y) = (given as f64, right as f64);
            let span = Span {
                x: (x - 0.5, x + 0.5),
                y: (y - 0.5, y + 0.5),
            };
            Some((span, share(right, given)?))
        });
        let heat = Mark::Heat {
            cells: boxes.collect(),
            scale,
        };
        let mut panel = Panel::new(Axis::of_names("label that was given", &numbers), y);
        panel = panel.with(Look::plain(PALETTE[0]), heat);
        let room = c.width - widest(&rows, most + 3) - MARGINS - c.pick(BAR, 0.0);
        if !c.narrow {
            panel.color_bar = Some(ColorBar {
                label: "share of the row".to_owned(),
                scale,
            });
        }
        let noted = cells().filter_map(|(right, given)| {
            let text = digits(sum.count(right, given));
            Some((right, given, text, share(right, given)?))
        });
        let noted: Vec<(usize, usize, String, f64)> = noted.collect();
        let widest = noted.iter().map(|n| text_width(&n.2, SMALL));
        // A number that is wider than its cell would overprint the next one.
        if widest.fold(0.0, f64::max) + 4.0 <= room / labels.len() as f64 {
            panel.notes = (noted.iter())
                .map(|(right, given, text, share)| {
                    Note::new((*given as f64, *right as f64), text).on(scale.color(*share))
                })
                .collect();
        }
        let height = 66.0 + 22.0 * labels.len().max(4) as f64;
        c.figure(name, &title, height).with(panel)
    }))
}

/// The matrix of everybody, whose participant is empty, and of each participant.
fn data(part: &PartAnalysis, sum: &Confusions) -> Vec<Vec<String>> {
    let labels = &part.data.labels;
    let mut rows = vec![head(["participant", "right", "given", "n", "share"])];
    let own = part.data.confusions.iter();
    let all = std::iter::once(("", sum)).chain(own.map(|(who, own)| (who.as_str(), own)));
    for (who, found) in all {
        for (right, a) in labels.iter().enumerate() {
            for (given, b) in labels.iter().enumerate() {
                let (n, of) = (found.count(right, given), found.right(right));
                rows.push(vec![
                    who.to_owned(),
                    a.clone(),
                    b.clone(),
                    digits(n),
                    cell((of > 0.0).then(|| n / of)),
                ]);
            }
        }
    }
    rows
}
