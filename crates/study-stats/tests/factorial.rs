//! Factorial designs, against R.
//!
//! `reference/factorial.R` writes `reference/factorial/*.txt`: three published tables and
//! nine simulated ones, with the values of R 4.2.2. Lines `effect` are of afex 1.2.1 (`aov_ez`,
//! type 3, with the corrections of car 3.1.1; where there are more contrasts than degrees of
//! freedom car has none, and they are those of the eigenvalues of the covariance), `contrast`
//! and `group_contrast` of emmeans 1.8.4.1 (`model = "multivariate"`), `art` and `pair` the
//! same of aligned ranks, which a program in Python computed from the definition. Its ranks of
//! `higgins` are those that are published with ARTool, and its contrasts agree with the three
//! sets that are published as results of ARTool.exe and JMP to all printed digits.
//! Tolerance: 10⁻⁹ of the value, 10⁻⁷ of p.
#![allow(clippy::unwrap_used)]

use study_stats::factorial::{
    AlignedPair, Contrast, Effect, Factorial, Level, Term, Weights, aligned_pairs, aligned_ranks,
    analysis, contrast, group_contrast, interaction_pairs, marginal_pairs, simple_pairs,
};

macro_rules! designs {
    ($($name:literal),*) => {
        [$(($name, include_str!(concat!("reference/factorial/", $name, ".txt")))),*]
    };
}

/// Name and text of each file.
const DESIGNS: [(&str, &str); 12] = designs![
    "obrien_kaiser",
    "maxwell_delaney",
    "higgins",
    "two_by_two",
    "two_by_three_ratings",
    "two_by_two_by_two",
    "three_by_three",
    "groups_of_five_and_eight",
    "two_groups_by_two_by_two",
    "three_groups_by_three_by_two",
    "four_factors",
    "few_participants"
];

struct Design {
    name: &'static str,
    levels: Vec<usize>,
    groups: Vec<usize>,
    rows: Vec<Vec<f64>>,
    /// The other lines: a key and what follows.
    expected: Vec<(&'static str, &'static str)>,
}

impl Design {
    fn read((name, text): (&'static str, &'static str)) -> Self {
        let mut design = Self {
            name,
            levels: Vec::new(),
            groups: Vec::new(),
            rows: Vec::new(),
            expected: Vec::new(),
        };
        let whole = |rest: &str| rest.split(' ').map(|w| w.parse().unwrap()).collect();
        for line in text.lines() {
            let (key, rest) = line.split_once(' ').unwrap();
            match key {
                "source" => {}
                "levels" => design.levels = whole(rest),
                "groups" => design.groups = whole(rest),
                "row" => design.rows.push(numbers(rest)),
                _ => design.expected.push((key, rest)),
            }
        }
        design
    }

    fn of(&self, key: &str) -> Vec<&'static str> {
        let lines = self.expected.iter().filter(|(k, _)| *k == key);
        lines.map(|(_, rest)| *rest).collect()
    }
}

fn designs() -> impl Iterator<Item = Design> {
    DESIGNS.into_iter().map(Design::read)
}

/// NaN where there is none.
fn numbers(text: &str) -> Vec<f64> {
    let number = |word: &str| {
        if word == "-" {
            f64::NAN
        } else {
            word.parse().unwrap()
        }
    };
    text.split_whitespace().map(number).collect()
}

fn close(found: f64, expected: f64, relative: f64, what: &str) {
    // Estimates that are 0 in theory have rounding errors.
    let near = (found - expected).abs() <= relative * expected.abs() + 1e-13;
    assert!(near, "{what}: {found} is not {expected}");
}

/// `g:f0:f1`.
fn term(name: &str) -> Term {
    let mut factors: Vec<usize> = (name.split(':'))
        .filter_map(|part| part.strip_prefix('f'))
        .map(|digit| digit.parse().unwrap())
        .collect();
    factors.sort_unstable();
    Term {
        factors,
        group: name.split(':').any(|part| part == "g"),
    }
}

fn compare_effects(found: &Factorial, lines: &[&str], design: &str) {
    assert_eq!(found.effects.len(), lines.len(), "{design}");
    for line in lines {
        let (name, rest) = line.split_once(' ').unwrap();
        let what = format!("{design}: {name}");
        let e = numbers(rest);
        let effect: &Effect = found.effect(&term(name)).unwrap();
        close(effect.ss, e[0], 1e-9, &what);
        close(effect.ss_error, e[1], 1e-9, &what);
        assert_eq!((effect.df1, effect.df2), (e[2], e[3]), "{what}");
        close(effect.f.unwrap(), e[4], 1e-9, &what);
        close(effect.p.unwrap(), e[5], 1e-7, &what);
        // Of one contrast R prints no correction, or 0.
        let one = term(name).factors.is_empty() || e[6].is_nan() || e[6] <= 0.0;
        if one {
            assert_eq!(
                (effect.eps_gg, effect.p_gg),
                (Some(1.0), effect.p),
                "{what}"
            );
            assert_eq!(
                (effect.eps_hf, effect.p_hf),
                (Some(1.0), effect.p),
                "{what}"
            );
        } else {
            close(effect.eps_gg.unwrap(), e[6], 1e-9, &what);
            close(effect.p_gg.unwrap(), e[7], 1e-7, &what);
            close(effect.eps_hf.unwrap(), e[8], 1e-9, &what);
            close(effect.p_hf.unwrap(), e[9], 1e-7, &what);
        }
        close(effect.pes.unwrap(), e[10], 1e-9, &what);
        close(effect.ges.unwrap(), e[11], 1e-9, &what);
    }
}

#[test]
fn effects_agree_with_afex() {
    let mut compared = 0;
    for d in designs() {
        let found = analysis(&d.rows, &d.levels, &d.groups).unwrap();
        let lines = d.of("effect");
        compared += lines.len();
        compare_effects(&found, &lines, d.name);
    }
    assert_eq!(compared, 64);
}

/// F of the books: Maxwell & Delaney (2004, ch. 12), and of ARTool's page on Higgins' table.
#[test]
fn published_analyses_agree() {
    let f = |found: Factorial| -> Vec<String> {
        let of = |e: &Effect| format!("{:.2}", e.f.unwrap());
        found.effects.iter().map(of).collect()
    };
    let d = Design::read(DESIGNS[1]);
    let found = analysis(&d.rows, &d.levels, &[]).unwrap();
    assert_eq!(f(found), ["33.77", "40.72", "45.31"]);
    let d = Design::read(DESIGNS[2]);
    let found = aligned_ranks(&d.rows, &d.levels, &d.groups).unwrap();
    assert_eq!(f(found), ["122.40", "23.83", "5.12"]);
    // ARTool.exe and JMP: contrasts of moisture with a grouping term.
    let found = aligned_pairs(&d.rows, &d.levels, &d.groups, &term("g")).unwrap();
    let published = [
        -5.606_839_446,
        -8.197_725_544,
        -3.683_916_17,
        -2.590_886_098,
        1.922_923_275_6,
        4.513_809_373_3,
    ];
    for (pair, t) in found.iter().zip(published) {
        close(pair.contrast.t.unwrap(), t, 1e-9, "Higgins");
    }
}

fn compare_contrast(found: &Contrast, e: &[f64], what: &str) {
    close(found.estimate, e[0], 1e-9, what);
    close(found.se, e[1], 1e-9, what);
    assert_eq!(found.df, e[2], "{what}");
    close(found.t.unwrap(), e[3], 1e-9, what);
    close(found.p.unwrap(), e[4], 1e-7, what);
    close(found.ci95.0, e[5], 1e-9, what);
    close(found.ci95.1, e[6], 1e-9, what);
}

#[test]
fn contrasts_agree_with_emmeans() {
    let mut compared = 0;
    for d in designs() {
        // What is left of the contrasts that the crate makes.
        let mut made: Vec<(String, Weights)> = Vec::new();
        let k = d.levels.len();
        for f in 0..k {
            made.extend(
                marginal_pairs(&d.levels, f)
                    .into_iter()
                    .map(|w| (format!("marginal{f}"), w)),
            );
            if k > 1 {
                made.extend(
                    simple_pairs(&d.levels, f)
                        .into_iter()
                        .map(|w| (format!("simple{f}"), w)),
                );
            }
            for g in f + 1..k {
                let crossed = interaction_pairs(&d.levels, (f, g)).into_iter();
                made.extend(crossed.map(|w| (format!("interaction{f}{g}"), w)));
            }
        }
        for line in d.of("contrast") {
            let (kind, rest) = line.split_once(' ').unwrap();
            let (values, weights) = rest.split_once(" : ").unwrap();
            let (e, weights) = (numbers(values), numbers(weights));
            let what = format!("{}: {kind} {weights:?}", d.name);
            if kind != "free" {
                let same = |w: &Weights| {
                    w.weights
                        .iter()
                        .zip(&weights)
                        .all(|(a, b)| (a - b).abs() < 1e-12)
                };
                let place = made.iter().position(|(k, w)| k == kind && same(w));
                made.remove(place.expect(&what));
            }
            let found = contrast(&d.rows, &d.groups, &weights).unwrap();
            compare_contrast(&found, &e, &what);
            close(found.dz.unwrap(), e[7], 1e-9, &what);
            compared += 1;
        }
        let compares = !d.of("contrast").is_empty();
        assert!(made.is_empty() || !compares, "{}: {made:?}", d.name);
        for line in d.of("group_contrast") {
            let (values, weights) = line.split_once(" : ").unwrap();
            let weights: Vec<Vec<f64>> = (numbers(weights).chunks(d.rows[0].len()))
                .map(<[f64]>::to_vec)
                .collect();
            let found = group_contrast(&d.rows, &d.groups, &weights).unwrap();
            compare_contrast(&found, &numbers(values), d.name);
            compared += 1;
        }
    }
    assert_eq!(compared, 240);
}

#[test]
fn aligned_ranks_agree_with_an_independent_program() {
    for d in designs() {
        let found = aligned_ranks(&d.rows, &d.levels, &d.groups).unwrap();
        compare_effects(&found, &d.of("art"), d.name);
    }
}

#[test]
fn contrasts_of_aligned_ranks_agree_with_an_independent_program() {
    let mut compared = 0;
    for d in designs() {
        let lines = d.of("pair");
        let mut names: Vec<&str> = lines.iter().map(|l| l.split(' ').next().unwrap()).collect();
        names.dedup();
        for name in names {
            let term = term(name);
            let found = aligned_pairs(&d.rows, &d.levels, &d.groups, &term).unwrap();
            let own = lines.iter().filter(|l| l.split(' ').next() == Some(name));
            assert_eq!(own.clone().count(), found.len());
            for line in own {
                let mut words = line.splitn(4, ' ').skip(1);
                let mut level = || level(name, words.next().unwrap());
                let (a, b) = (level(), level());
                let what = format!("{}: {line}", d.name);
                let is = |p: &&AlignedPair| {
                    (p.first == a && p.second == b) || (p.first == b && p.second == a)
                };
                let pair = found.iter().find(is).expect(&what);
                let mut e = numbers(line.splitn(4, ' ').nth(3).unwrap());
                if pair.first == b {
                    // The other direction.
                    e = vec![-e[0], e[1], e[2], -e[3], e[4], -e[6], -e[5]];
                }
                compare_contrast(&pair.contrast, &e, &what);
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 303);
}

/// `0:2` of `f0:g`: level 0 in group 2.
fn level(name: &str, levels: &str) -> Level {
    let mut found = Level {
        levels: Vec::new(),
        group: None,
    };
    for (part, level) in name.split(':').zip(levels.split(':')) {
        let level = level.parse().unwrap();
        if part == "g" {
            found.group = Some(level);
        } else {
            found.levels.push(level);
        }
    }
    found
}
