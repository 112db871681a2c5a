//! How often the analysis of a factorial design finds an effect, in studies without one and
//! with one.
//!
//! `cargo bench --bench factors -- --studies 10000 --power 2000` simulates this many studies
//! without an effect in each design, and so many with one; `--missing 2000` so many with missing cells, lost at random or
//! because they would have been low, each of which takes the whole analysis. The seed is fixed: the same numbers
//! of studies print the same tables for any number of threads. docs/calibration.md has the
//! results.
#![allow(clippy::print_stdout)]

use rayon::prelude::*;
use std::fmt::Write as _;
use study_analysis::analyze::{Finding, Question, Rules, all_findings};
use study_analysis::study::factor;
use study_base::rng::Stream;
use study_plan::protocol::Crossing;
use study_session::outcome::ratings::Ratings;
use study_stats::factorial::{Effect, Factorial, Term, aligned_ranks, analysis};
use study_stats::level::rejects;
use study_stats::paired::holm;

const PARTICIPANTS: [usize; 5] = [4, 8, 12, 20, 40];

/// How the values of a participant differ.
#[derive(Clone, Copy, PartialEq)]
enum Errors {
    /// Normal, with the same variance in all cells.
    Normal,
    /// Normal; the standard deviation rises from 0.4 to 1.6 over the levels of the last
    /// factor, and neighboring cells are correlated by 0.7.
    NotSpherical,
    /// The normal ones rounded to 1 to 7, about 4.
    Ratings,
    /// The same about 6, near the end of the scale.
    HighRatings,
    /// The normal ones; the standard deviations of the second group are twice as large.
    UnlikeGroups,
}

impl Errors {
    fn name(self) -> &'static str {
        match self {
            Self::Normal => "normal",
            Self::NotSpherical => "not spherical",
            Self::Ratings => "ratings",
            Self::HighRatings => "ratings about 6",
            Self::UnlikeGroups => "unlike groups",
        }
    }
}

#[derive(Clone, Copy)]
struct Design {
    name: &'static str,
    levels: &'static [usize],
    /// One of so many participants is in the second group, if there is one.
    second: Option<usize>,
}

const DESIGNS: [Design; 4] = [
    Design {
        name: "2 × 2",
        levels: &[2, 2],
        second: None,
    },
    Design {
        name: "2 × 3",
        levels: &[2, 3],
        second: None,
    },
    Design {
        name: "2 × 2 × 2",
        levels: &[2, 2, 2],
        second: None,
    },
    Design {
        name: "2 (groups) × 3",
        levels: &[3],
        second: Some(2),
    },
];
const UNEQUAL: Design = Design {
    name: "2 (groups, 3 : 1) × 3",
    levels: &[3],
    second: Some(4),
};

impl Design {
    fn groups(&self, participants: usize) -> Vec<usize> {
        match self.second {
            Some(every) => (0..participants)
                .map(|p| usize::from(p % every == every - 1))
                .collect(),
            None => Vec::new(),
        }
    }

    /// The interaction that has an effect: of the first factor, or the group, and the last.
    fn interaction(&self) -> Term {
        let last = self.levels.len() - 1;
        Term {
            factors: if last > 0 { vec![0, last] } else { vec![last] },
            group: self.second.is_some(),
        }
    }

    fn main_effect(&self) -> Term {
        Term {
            factors: vec![self.levels.len() - 1],
            group: false,
        }
    }
}

/// The term that has an effect: half a rating between neighboring levels of the last factor,
/// of an interaction half of that upwards and downwards.
fn effect_of(design: &Design, term: Option<&Term>, cell: usize, group: usize) -> f64 {
    let last = design.levels[design.levels.len() - 1];
    let along = 0.5 * ((cell % last) as f64 - (last - 1) as f64 / 2.0);
    match term {
        None => 0.0,
        Some(term) if *term == design.main_effect() => along,
        Some(_) => {
            let rest: usize = design.levels[1..].iter().product();
            let first = if design.second.is_some() {
                group
            } else {
                cell / rest
            };
            if first == 0 { along } else { -along }
        }
    }
}

/// The table of one study.
fn study(
    design: &Design,
    errors: Errors,
    participants: usize,
    term: Option<&Term>,
    number: u32,
) -> Vec<Vec<f64>> {
    let place = [participants.to_string(), number.to_string()];
    let effect = term.map_or(0, Term::order).to_string();
    let path = [
        "factors",
        design.name,
        errors.name(),
        &effect,
        &place[0],
        &place[1],
    ];
    let mut noise = Stream::new(2011, &path);
    let cells: usize = design.levels.iter().product();
    let last = design.levels[design.levels.len() - 1];
    let groups = design.groups(participants);
    let row = |p: usize| {
        let group = groups.get(p).copied().unwrap_or(0);
        let center = if errors == Errors::HighRatings {
            6.0
        } else {
            4.0
        };
        let spread = if errors == Errors::UnlikeGroups && group == 1 {
            2.0
        } else {
            1.0
        };
        let level = center + 0.7 * spread * noise.normal();
        let mut before = noise.normal();
        let value = |cell: usize| {
            let error = match errors {
                Errors::NotSpherical => {
                    before = 0.7 * before + (1.0f64 - 0.49).sqrt() * noise.normal();
                    let along = (cell % last) as f64 / (last - 1) as f64;
                    (0.4 + 1.2 * along) * before
                }
                _ => 0.8 * spread * noise.normal(),
            };
            let x = level + effect_of(design, term, cell, group) + error;
            match errors {
                Errors::Ratings | Errors::HighRatings => x.round().clamp(1.0, 7.0),
                _ => x,
            }
        };
        (0..cells).map(value).collect()
    };
    (0..participants).map(row).collect()
}

/// Whether any term of one study is significant: corrected by Holm over all terms, and for a
/// lack of sphericity or not.
fn family(found: &Factorial, p: fn(&Effect) -> Option<f64>) -> Vec<bool> {
    let p: Vec<Option<f64>> = found.effects.iter().map(p).collect();
    let yes = |p: &Option<f64>| p.is_some_and(|p| rejects(p, 0.05));
    holm(&p).iter().map(yes).collect()
}

fn any(yes: &[bool]) -> bool {
    yes.contains(&true)
}

const FAMILIES: [&str; 5] = [
    "analysis of variance, Greenhouse–Geisser",
    "the same, Huynh–Feldt",
    "the same, sphericity assumed",
    "the same, Greenhouse–Geisser, any term without Holm's correction",
    "aligned ranks, Greenhouse–Geisser",
];

/// Shares of studies in which any term is significant.
fn null(design: &Design, errors: Errors, participants: usize, studies: u32) -> [f64; 5] {
    let of_study = |number: u32| {
        let rows = study(design, errors, participants, None, number);
        let groups = design.groups(participants);
        let found = analysis(&rows, design.levels, &groups).expect("the design is valid");
        let ranks = aligned_ranks(&rows, design.levels, &groups).expect("the design is valid");
        let hf = |e: &Effect| if e.df1 > 1.0 { e.p_hf } else { e.p };
        let uncorrected =
            (found.effects.iter()).any(|e| e.p_corrected().is_some_and(|p| rejects(p, 0.05)));
        [
            any(&family(&found, Effect::p_corrected)),
            any(&family(&found, hf)),
            any(&family(&found, |e| e.p)),
            uncorrected,
            any(&family(&ranks, Effect::p_corrected)),
        ]
    };
    shares(studies, of_study)
}

/// Shares of studies in which the term that has an effect is significant: by Holm over all
/// terms, of aligned ranks, and by the oracle, who knows which term it is and that sphericity
/// holds.
fn power(design: &Design, term: &Term, participants: usize, studies: u32) -> [f64; 3] {
    let of_study = |number: u32| {
        let rows = study(design, Errors::Normal, participants, Some(term), number);
        let groups = design.groups(participants);
        let found = analysis(&rows, design.levels, &groups).expect("the design is valid");
        let ranks = aligned_ranks(&rows, design.levels, &groups).expect("the design is valid");
        let place = (found.effects.iter().position(|e| e.term == *term)).expect("a term");
        [
            family(&found, Effect::p_corrected)[place],
            family(&ranks, Effect::p_corrected)[place],
            found.effects[place].p.is_some_and(|p| rejects(p, 0.05)),
        ]
    };
    shares(studies, of_study)
}

/// Which cells are missing.
#[derive(Clone, Copy, PartialEq)]
enum Lost {
    /// Every fifth, at random.
    AtRandom,
    /// Two fifths of what is below the participant's mean in the second half of the combinations, and nothing else: what
    /// is missing would have been low, and depends on the levels.
    LowAtLevels,
}

impl Lost {
    fn name(self) -> &'static str {
        match self {
            Self::AtRandom => "every fifth cell missing at random",
            Self::LowAtLevels => "two fifths of the low cells of half of the combinations missing",
        }
    }

    fn is_lost(self, row: &[f64], cell: usize, noise: &mut Stream) -> bool {
        let drawn = noise.below(5);
        let mean = row.iter().sum::<f64>() / row.len() as f64;
        match self {
            Self::AtRandom => drawn == 0,
            Self::LowAtLevels => drawn < 2 && cell >= row.len() / 2 && row[cell] < mean,
        }
    }
}

/// Shares of studies in which `study analyze` finds any effect, in which it finds one and does not say that missing ratings turn it,
/// and in which one has no test.
fn null_with_missing(
    design: &Design,
    errors: Errors,
    lost: Lost,
    participants: usize,
    studies: u32,
) -> [f64; 3] {
    let factors = (design.levels.iter().enumerate()).map(|(i, levels)| {
        let levels: Vec<String> = (0..*levels).map(|level| format!("l{level}")).collect();
        factor(&format!("f{i}={}", levels.join(","))).expect("a factor")
    });
    let cells: usize = design.levels.iter().product();
    let levels_of = (0..cells).map(|cell| {
        let digit =
            |i: usize| cell / design.levels[i + 1..].iter().product::<usize>() % design.levels[i];
        let levels = (0..design.levels.len()).map(digit).collect();
        (format!("m{cell}"), levels)
    });
    let rules = Rules {
        crossing: Some(Crossing::full(factors.collect(), levels_of.collect())),
        ..Rules::default()
    };
    let of_study = |number: u32| {
        let rows = study(design, errors, participants, None, number);
        let place = [
            design.name,
            errors.name(),
            &participants.to_string(),
            &number.to_string(),
        ];
        let mut noise = Stream::new(2012, &[&["factors", "missing"], &place[..]].concat());
        let mut csv = "subject,model,rating\n".to_owned();
        for (p, row) in rows.iter().enumerate() {
            for (cell, rating) in row.iter().enumerate() {
                // An empty rating: the presentation was planned.
                let rating = match lost.is_lost(row, cell, &mut noise) {
                    true => String::new(),
                    false => rating.to_string(),
                };
                let _ = writeln!(csv, "P{p:02},m{cell},{rating}");
            }
        }
        let ratings = Ratings::read_csv("study.csv", csv.as_bytes(), None).expect("a table");
        let (findings, _) = all_findings(&ratings, &rules);
        let effects = || (findings.iter()).filter(|f| matches!(f.question, Question::Effect(_)));
        let turns = |f: &Finding| f.caveats.iter().any(|c| c.code == "missing-turns-it");
        [
            effects().any(Finding::is_yes),
            effects().any(|f| f.is_yes() && !turns(f)),
            effects().any(|f| f.reason().is_some()),
        ]
    };
    shares(studies, of_study)
}

fn shares<const N: usize>(studies: u32, of: impl Fn(u32) -> [bool; N] + Sync) -> [f64; N] {
    let count = (0..studies)
        .into_par_iter()
        .map(|number| of(number).map(u32::from))
        .reduce(|| [0; N], |a, b| std::array::from_fn(|i| a[i] + b[i]));
    count.map(|n| f64::from(n) / f64::from(studies))
}

fn head(what: &str) {
    let numbers = PARTICIPANTS.map(|n| n.to_string()).join(" | ");
    println!("| {what} | {numbers} |\n|---|---|---|---|---|---|---|");
}

/// What follows a name on the command line.
fn argument(name: &str, default: u32) -> u32 {
    let mut arguments = std::env::args().skip_while(|a| a != name);
    (arguments.nth(1))
        .and_then(|n| n.parse().ok())
        .unwrap_or(default)
}

fn main() {
    let (studies, with_effect) = (argument("--studies", 10_000), argument("--power", 2000));
    let usual = [
        Errors::Normal,
        Errors::NotSpherical,
        Errors::Ratings,
        Errors::HighRatings,
    ];
    let mut worlds: Vec<(Design, Errors)> = (DESIGNS.iter())
        .flat_map(|design| usual.map(|errors| (*design, errors)))
        .collect();
    worlds.push((UNEQUAL, Errors::Normal));
    worlds.push((UNEQUAL, Errors::UnlikeGroups));
    let found: Vec<Vec<[f64; 5]>> = (worlds.iter())
        .map(|(design, errors)| {
            let of = |n: &usize| null(design, *errors, *n, studies);
            PARTICIPANTS.iter().map(of).collect()
        })
        .collect();
    for (i, family) in FAMILIES.iter().enumerate() {
        println!("\n**No effect: {family}** ({studies} studies each)\n");
        head("design | errors");
        for ((design, errors), rates) in worlds.iter().zip(&found) {
            let cells: Vec<String> = rates.iter().map(|r| format!("{:.4}", r[i])).collect();
            println!(
                "| {} | {} | {} |",
                design.name,
                errors.name(),
                cells.join(" | ")
            );
        }
    }
    let of_analysis = argument("--missing", 2000);
    for lost in [Lost::AtRandom, Lost::LowAtLevels] {
        println!(
            "\n**No effect: {}, as `study analyze` decides / of these not said to turn / no test** ({of_analysis} studies each)\n",
            lost.name()
        );
        head("design | errors");
        for design in DESIGNS.iter().filter(|d| d.second.is_none()) {
            for errors in [Errors::Normal, Errors::NotSpherical, Errors::Ratings] {
                let cell = |n: usize| {
                    let [any, holds, none] =
                        null_with_missing(design, errors, lost, n, of_analysis);
                    format!("{any:.4} / {holds:.4} / {none:.3}")
                };
                let cells = PARTICIPANTS.map(cell).join(" | ");
                println!("| {} | {} | {cells} |", design.name, errors.name());
            }
        }
    }
    println!(
        "\n**Power: Holm over all terms / aligned ranks / oracle** ({with_effect} studies each)\n"
    );
    head("design | effect");
    for design in &DESIGNS {
        for (name, term) in [
            ("last factor", design.main_effect()),
            ("interaction", design.interaction()),
        ] {
            let cell = |n: usize| {
                let [holm, ranks, oracle] = power(design, &term, n, with_effect);
                format!("{holm:.3} / {ranks:.3} / {oracle:.3}")
            };
            let cells = PARTICIPANTS.map(cell).join(" | ");
            println!("| {} | {name} | {cells} |", design.name);
        }
    }
}
