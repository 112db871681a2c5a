//! The flow diagram of participants and trials: boxes from what is on record to what is analyzed, with what is left
//! out on the way at their side.

use super::{Canvas, Drawn, NARROW, WIDE, head};
use crate::picture::{Anchor, Color, Path, Pen, Picture, Text, text_width};
use std::collections::BTreeMap;
use study_analysis::analyze::{Analysis, Flow, Share};
use study_base::text::{Untrusted, counted};

/// Size of the letters, px.
const SIZE: f64 = 12.0;
/// Height of a line, px.
const LINE: f64 = 16.0;
/// Between a box and its text, px.
const PADDING: f64 = 8.0;
/// Least length of an arrow, px.
const ARROW: f64 = 26.0;
/// Width of the boxes, and of the gap between those on the way and those at their side, as shares of the figure's.
const WIDTHS: [f64; 3] = [0.42, 0.06, 0.52];

/// A box on the way, and the one at its side below it, where there is something left out.
struct Step {
    /// The first line is bold.
    lines: Vec<String>,
    side: Vec<String>,
}

/// Nothing if nothing is on record.
pub(super) fn participants(a: &Analysis) -> Option<Drawn> {
    let all = a.flows.first()?;
    if all.recorded.trials == 0 {
        return None;
    }
    let steps = steps(a, all);
    let caption = "Flow of participants and trials, without practice: on record, left out with the reason, and analyzed. A \
                   participant of whom no trial counts is left out with the reason of most of the trials.";
    let draw = |c: Canvas| picture(&steps, c);
    Some(Drawn {
        name: "participants".to_owned(),
        caption: caption.to_owned(),
        wide: draw(WIDE),
        narrow: draw(NARROW),
        data: crate::csv::text(&data(&a.flows)),
    })
}

fn of(share: Share, what: [&str; 2]) -> String {
    let people = counted(share.participants, "participant", "participants");
    format!("{people}, {}", counted(share.trials, what[0], what[1]))
}

const TRIALS: [&str; 2] = ["trial", "trials"];
const RATINGS: [&str; 2] = ["rating", "ratings"];

fn steps(a: &Analysis, all: &Flow) -> Vec<Step> {
    let groups = |what: [&str; 2], share: fn(&Flow) -> Share| {
        let named = a.flows.iter().filter_map(move |flow| {
            let group = flow.group.as_ref()?;
            Some(format!("{}: {}", Untrusted(group), of(share(flow), what)))
        });
        named.collect::<Vec<String>>()
    };
    let mut recorded = vec!["On record".to_owned(), of(all.recorded, TRIALS)];
    if let Some(planned) = a.counts.planned {
        let planned = counted(planned as usize, "participant", "participants");
        recorded.push(format!("planned: {planned}"));
    }
    recorded.extend(groups(TRIALS, |flow| flow.recorded));
    let participants = reasons("Participants left out", &all.left_out);
    let mut trials = reasons("Trials left out", &all.trials_left_out);
    if all.without_rating.trials > 0 {
        if trials.is_empty() {
            trials.push("Trials left out".to_owned());
        }
        trials.push(format!(
            "without a rating: {}",
            of(all.without_rating, TRIALS)
        ));
    }
    let mut analyzed = vec!["Analyzed".to_owned(), of(all.analyzed, RATINGS)];
    analyzed.extend(groups(RATINGS, |flow| flow.analyzed));
    let mut steps = vec![Step {
        lines: recorded,
        side: participants,
    }];
    // Between both, who stays with all trials; without either it is the first or the last one.
    if !all.left_out.is_empty() && !trials.is_empty() {
        let staying = of(all.staying, TRIALS);
        steps.push(Step {
            lines: vec!["Of participants who stay".to_owned(), staying],
            side: trials,
        });
    } else if !trials.is_empty() {
        steps[0].side = trials;
    }
    steps.push(Step {
        lines: analyzed,
        side: Vec::new(),
    });
    steps
}

/// A title and a line for each reason; nothing without reasons.
fn reasons(title: &str, all: &BTreeMap<String, Share>) -> Vec<String> {
    let mut lines = Vec::new();
    for (reason, share) in all {
        if lines.is_empty() {
            lines.push(title.to_owned());
        }
        lines.push(format!("{}: {}", Untrusted(reason), of(*share, TRIALS)));
    }
    lines
}

/// Lines that are no wider than this, px. A word that is wider is broken.
fn wrapped(lines: &[String], width: f64) -> Vec<(String, bool)> {
    let mut out = Vec::new();
    for (i, line) in lines.iter().enumerate() {
        let mut current = String::new();
        for word in line.split_inclusive(' ') {
            let together = format!("{current}{}", word.trim_end());
            // Bold letters are a little wider.
            if !current.is_empty() && text_width(&together, SIZE) > 0.97 * width {
                out.push((current.trim_end().to_owned(), i == 0));
                current.clear();
            }
            for letter in word.chars() {
                current.push(letter);
                if text_width(current.trim_end(), SIZE) > 0.97 * width {
                    current.pop();
                    out.push((std::mem::take(&mut current), i == 0));
                    current.push(letter);
                }
            }
        }
        out.push((current.trim_end().to_owned(), i == 0));
    }
    out
}

fn picture(steps: &[Step], c: Canvas) -> Picture {
    // A pen's width of room at the edges.
    let width = c.width - 2.0;
    let [way, gap, side] = WIDTHS.map(|share| share * width);
    let laid: Vec<[Vec<(String, bool)>; 2]> = (steps.iter())
        .map(|step| {
            [
                wrapped(&step.lines, way - 2.0 * PADDING),
                wrapped(&step.side, side - 2.0 * PADDING),
            ]
        })
        .collect();
    let height = |lines: &[(String, bool)]| LINE * lines.len() as f64 + 2.0 * PADDING;
    let between = |side: &[(String, bool)]| match side {
        [] => ARROW,
        side => height(side) + ARROW,
    };
    let last = laid.len() - 1;
    let total: f64 = (laid.iter().enumerate())
        .map(|(i, [lines, side])| {
            let below = if i < last { between(side) } else { 0.0 };
            height(lines) + below
        })
        .sum();
    let id = c.pick("participants", "participants-n");
    let title = "Flow of participants and trials from what is on record to what is analyzed";
    let mut out = Picture::new(id, title, c.width, total + 2.0);
    let mut y = 1.0;
    let middle = 1.0 + way / 2.0;
    for (i, [lines, aside]) in laid.iter().enumerate() {
        boxed(&mut out, (1.0, y), way, lines);
        y += height(lines);
        if i == last {
            break;
        }
        let next = y + between(aside);
        arrow(&mut out, (middle, y), (middle, next));
        if !aside.is_empty() {
            let left = 1.0 + way + gap;
            let at = y + (next - y) / 2.0;
            arrow(&mut out, (middle, at), (left, at));
            boxed(&mut out, (left, at - height(aside) / 2.0), side, aside);
        }
        y = next;
    }
    out
}

fn boxed(out: &mut Picture, (x, y): (f64, f64), width: f64, lines: &[(String, bool)]) {
    let bottom = y + LINE * lines.len() as f64 + 2.0 * PADDING;
    let mut frame = Path::drawn(Pen::new(Color::INK, 1.0));
    frame.rectangle((x, y), (x + width, bottom));
    out.path(frame);
    for (i, (line, bold)) in lines.iter().enumerate() {
        let base = y + PADDING + LINE * (i as f64 + 0.75);
        let mut text = Text::new((x + PADDING, base), line, SIZE, Anchor::Start);
        text.bold = *bold;
        out.text(text);
    }
}

/// A line with a head at its end, straight down or to the right.
fn arrow(out: &mut Picture, from: (f64, f64), to: (f64, f64)) {
    let mut line = Path::drawn(Pen::new(Color::INK, 1.0));
    line.segment(from, to);
    out.path(line);
    let mut tip = Path::filled(Color::INK);
    let (x, y) = to;
    if from.0 == to.0 {
        tip.polygon(&[(x, y), (x - 4.0, y - 8.0), (x + 4.0, y - 8.0)]);
    } else {
        tip.polygon(&[(x, y), (x - 8.0, y - 4.0), (x - 8.0, y + 4.0)]);
    }
    out.path(tip);
}

fn data(flows: &[Flow]) -> Vec<Vec<String>> {
    let mut rows = vec![head(["group", "step", "reason", "participants", "trials"])];
    for flow in flows {
        let mut row = |step: &str, reason: &str, share: Share| {
            rows.push(vec![
                flow.group.clone().unwrap_or_default(),
                step.to_owned(),
                reason.to_owned(),
                share.participants.to_string(),
                share.trials.to_string(),
            ]);
        };
        row("recorded", "", flow.recorded);
        for (reason, share) in &flow.left_out {
            row("participants left out", reason, *share);
        }
        for (reason, share) in &flow.trials_left_out {
            row("trials left out", reason, *share);
        }
        row("without a rating", "", flow.without_rating);
        row("analyzed", "", flow.analyzed);
    }
    rows
}
