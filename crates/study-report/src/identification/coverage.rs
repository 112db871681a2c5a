//! Where the recordings of a realization were: positions by speed and direction, and where it is held.

use super::{Drawing, Shown};
use crate::chart::{Axis, Color, Figure, Look, Mark, PALETTE, Panel, Scale, Span};
use std::fmt::Write as _;
use study_haptics::recording::Recording;

/// Places of the map.
const PLACES: usize = 20;
/// Classes of speed, each twice as fast as the one before.
const CLASSES: i32 = 6;

/// Fewest samples of each shade, and its name.
const SHADES: [(u32, &str); 4] = [
    (1, "1 to 9 samples"),
    (10, "10 to 99"),
    (100, "100 to 999"),
    (1000, "1000 or more"),
];

/// The shade of a cell: 0 without a sample, up to 4.
pub(super) fn shade(samples: u32) -> usize {
    SHADES.iter().filter(|(least, _)| samples >= *least).count()
}

/// How many samples of the training were where.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// The range of the map, mm, which is divided into equal places.
    pub x_mm: [f64; 2],
    /// The highest speed of each class, mm/s, ascending.
    pub v_mm_s: Vec<f64>,
    /// Samples by direction (v > 0, v < 0), class of speed and place.
    pub samples: [Vec<Vec<u32>>; 2],
    /// Where a direction has no sample, so that a realization keeps the values beside, mm.
    pub held_mm: Vec<[f64; 2]>,
}

impl Coverage {
    /// Counts the samples of some recordings in motion; `None` if there is none.
    pub fn of(recordings: &[&Recording]) -> Option<Self> {
        let ranges = recordings.iter().map(|r| r.range_mm());
        let x_mm = ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])?;
        let top_mm_s = recordings
            .iter()
            .map(|r| r.top_speed_mm_s())
            .fold(0.0, f64::max);
        let v_mm_s: Vec<f64> = (0..CLASSES)
            .rev()
            .map(|n| top_mm_s * 0.5_f64.powi(n))
            .collect();
        let mut samples = [(); 2].map(|()| vec![vec![0_u32; PLACES]; v_mm_s.len()]);
        for recording in recordings {
            for (x, v) in recording.x_mm.iter().zip(&recording.v_mm_s) {
                let class = v_mm_s.partition_point(|top| *top < v.abs());
                let share = (x - x_mm[0]) / (x_mm[1] - x_mm[0]);
                // between 0 and the number of places, which is the last one's upper edge
                let place = ((share * PLACES as f64) as usize).min(PLACES - 1);
                if *v != 0.0 {
                    samples[usize::from(*v < 0.0)][class][place] += 1;
                }
            }
        }
        let edge = |i: usize| x_mm[0] + (x_mm[1] - x_mm[0]) * i as f64 / PLACES as f64;
        let is_empty = |place: &usize| {
            (samples.iter()).any(|side| side.iter().all(|class| class[*place] == 0))
        };
        let held = (0..PLACES).filter(is_empty);
        Some(Self {
            held_mm: held.map(|place| [edge(place), edge(place + 1)]).collect(),
            x_mm,
            v_mm_s,
            samples,
        })
    }
}

/// A row of the map.
pub(super) struct Row<'c> {
    /// 0 where the position increases, 1 where it decreases.
    pub(super) side: usize,
    /// The range of speeds, mm/s.
    pub(super) speeds_mm_s: [f64; 2],
    /// Number of samples by place.
    pub(super) samples: &'c [u32],
}

/// Rows from the fastest increasing to the fastest decreasing motion.
pub(super) fn rows(coverage: &Coverage) -> Vec<Row<'_>> {
    let of = |side: usize| {
        let classes = coverage.samples[side].iter().enumerate();
        classes.map(move |(class, samples)| {
            let below = class.checked_sub(1).map_or(0.0, |c| coverage.v_mm_s[c]);
            Row {
                side,
                speeds_mm_s: [below, coverage.v_mm_s[class]],
                samples,
            }
        })
    };
    let mut rows: Vec<Row<'_>> = of(0).collect();
    rows.reverse();
    rows.extend(of(1));
    rows
}

impl Row<'_> {
    /// The signed range of its velocities in shown units.
    pub(super) fn name(&self, shown: Shown) -> String {
        let sign = ['+', '−'][self.side];
        let [slow, fast] = (self.speeds_mm_s).map(|mm_s| significant(shown.length(mm_s)));
        match self.speeds_mm_s[0] {
            0.0 => format!("0 to {sign}{fast}"),
            _ => format!("{sign}{slow} to {sign}{fast}"),
        }
    }
}

/// Two significant digits.
fn significant(value: f64) -> String {
    let rounded: f64 = format!("{value:.1e}").parse().unwrap_or(value);
    if rounded >= 10.0 {
        format!("{rounded:.0}")
    } else {
        rounded.to_string()
    }
}

/// The map: a row for each class of speed, shaded by the number of samples.
pub fn coverage(coverage: &Coverage, shown: Shown) -> Drawing {
    let rows = rows(coverage);
    let names: Vec<String> = rows.iter().map(|row| row.name(shown)).collect();
    let [x_unit, _] = shown.units.names();
    let range = coverage.x_mm.map(|mm| shown.length(mm));
    let place = |i: usize, of: usize| range[0] + (range[1] - range[0]) * i as f64 / of as f64;
    let mut panel = Panel::new(
        Axis::new(&shown.position(), range[0], range[1]).without_grid(),
        Axis::of_names(&format!("velocity ({x_unit}/s)"), &names).reversed(),
    );
    let scale = Scale::ascending(0.0, SHADES.len() as f64);
    for (n, (_, name)) in SHADES.iter().enumerate() {
        let spans = rows
            .iter()
            .enumerate()
            .flat_map(|(row, Row { samples, .. })| {
                let of = samples.len();
                let shaded = (0..of).filter(move |i| shade(samples[*i]) == n + 1);
                shaded.map(move |i| Span {
                    x: (place(i, of), place(i + 1, of)),
                    y: (row as f64 - 0.5, row as f64 + 0.5),
                })
            });
        let look = Look::plain(scale.color((n + 1) as f64));
        panel = panel.named(name, look, Mark::Bars(spans.collect()));
    }
    let whole = (-0.5, rows.len() as f64 - 0.5);
    let held = coverage.held_mm.iter().map(|[from, to]| Span {
        x: (shown.length(*from), shown.length(*to)),
        y: whole,
    });
    let held: Vec<Span> = held.collect();
    if !held.is_empty() {
        let mut look = Look::plain(PALETTE[1]);
        look.opacity = 0.45;
        panel = panel.named("held at the value beside", look, Mark::Bars(held));
    }
    let middle = 0.5 * (whole.0 + whole.1);
    let rest = Mark::Line(vec![(range[0], middle), (range[1], middle)]);
    panel = panel.with(Look::plain(Color::INK).stroke(1.0), rest);
    Drawing {
        name: "coverage",
        figure: Figure::new(
            "coverage",
            "Coverage of the training: samples by position, speed and direction",
            820.0,
            150.0 + 20.0 * names.len() as f64,
        )
        .with(panel),
        csv: csv(&rows, place, shown),
    }
}

fn csv(rows: &[Row<'_>], place: impl Fn(usize, usize) -> f64, shown: Shown) -> String {
    let columns = ["from_x_mm", "to_x_mm", "from_v_mm_s", "to_v_mm_s"];
    let columns = columns.map(|key| shown.column(key));
    let mut csv = format!("direction,{},samples\n", columns.join(","));
    for row in rows {
        let direction = ["positive", "negative"][row.side];
        let [slow, fast] = row.speeds_mm_s.map(|mm_s| shown.length(mm_s));
        for (i, samples) in row.samples.iter().enumerate() {
            let [from, to] = [i, i + 1].map(|i| place(i, row.samples.len()));
            let _ = writeln!(csv, "{direction},{from},{to},{slow},{fast},{samples}");
        }
    }
    csv
}
