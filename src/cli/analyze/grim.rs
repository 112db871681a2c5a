//! `study analyze --possible`: checks whether whole ratings can have a published mean
//! and SD (GRIM and GRIMMER).

use crate::cli::{Console, Failure};
use serde_json::{Value, json};
use std::fmt::Write as _;
use study_base::text::Untrusted;
use study_stats::grim::{
    MAX_COUNTED, MAX_N, MAX_SCALE, PrintedNumber, Published, SdCheck, SdOver, check, possible_sums,
};

/// Name and version of the JSON format.
const FORMAT: &str = "study-possible/1";

pub(super) fn run(given: &[String], as_json: bool, console: &mut Console) -> Result<(), Failure> {
    let published = parse(given)
        .map_err(|e| e.hint("for example: --possible mean=4.800 sd=0.997 n=30 scale=1..7"))?;
    let found = check(&published);
    if as_json {
        console.json(&document(&published, &found))
    } else {
        console.out(page(&published, &found))
    }
}

fn parse(given: &[String]) -> Result<Published, Failure> {
    let (mut mean, mut sd, mut n, mut scale, mut each) = (None, None, None, None, None);
    for pair in given {
        let shown = Untrusted(pair);
        let Some((key, value)) = pair.split_once('=') else {
            return Err(Failure::input(format!("`{shown}` is not KEY=VALUE")));
        };
        let bad = |what: &str| Failure::input(format!("`{shown}`: {what}"));
        let printed = || {
            value
                .parse::<PrintedNumber>()
                .map_err(|e| bad(&e.to_string()))
        };
        let count = |most: u32| {
            let n = value.parse().ok().filter(|n| (1..=most).contains(n));
            n.ok_or_else(|| bad(&format!("expected a whole number from 1 to {most}")))
        };
        let twice = match key {
            "mean" => mean.replace(printed()?).is_some(),
            "sd" => sd.replace(printed()?).is_some(),
            "n" => n.replace(count(MAX_N)?).is_some(),
            "each" => each.replace(count(MAX_N)?).is_some(),
            "scale" => {
                let ends = value.split_once("..").and_then(|(low, high)| {
                    let whole = |t: &str| {
                        let x = t.trim_start_matches('=').parse::<i128>().ok();
                        x.filter(|x| x.abs() <= MAX_SCALE)
                    };
                    Some((whole(low)?, whole(high)?)).filter(|(low, high)| low < high)
                });
                let wanted = "expected two whole numbers, lowest first, such as 1..7";
                scale.replace(ends.ok_or_else(|| bad(wanted))?).is_some()
            }
            _ => return Err(bad("unknown key; the keys are mean, sd, n, scale and each")),
        };
        if twice {
            return Err(bad("given twice"));
        }
    }
    let need = |key: &str| Failure::input(format!("--possible needs {key}=…"));
    let published = Published {
        mean: mean.ok_or_else(|| need("mean"))?,
        sd: sd.ok_or_else(|| need("sd"))?,
        n: n.ok_or_else(|| need("n"))?,
        scale: scale.ok_or_else(|| need("scale"))?,
        each,
    };
    if let Some(each) = each
        && !published.n.is_multiple_of(each)
    {
        let odd = format!("n={} is no multiple of each={each}", published.n);
        return Err(Failure::input(odd));
    }
    if published.sd.digits < 0 {
        return Err(Failure::input("sd must not be negative"));
    }
    Ok(published)
}

/// A number as it was given.
fn as_given(x: PrintedNumber) -> String {
    let digits = usize::try_from(x.decimals).unwrap_or(0);
    let sign = if x.digits < 0 { "-" } else { "" };
    let all = format!("{:0>width$}", x.digits.abs(), width = digits + 1);
    let (whole, decimals) = all.split_at(all.len() - digits);
    if decimals.is_empty() {
        format!("{sign}{whole}")
    } else {
        format!("{sign}{whole}.{decimals}")
    }
}

fn definition(f: &SdCheck) -> String {
    let divisor = if f.definition.n_minus_1 {
        format!("n − 1 = {}", f.n - 1)
    } else {
        format!("n = {}", f.n)
    };
    match f.definition.over {
        SdOver::Ratings => format!("over the {} ratings, divisor {divisor}", f.n),
        SdOver::SubjectMeans { each } => {
            format!("over {} subject means of {each}, divisor {divisor}", f.n)
        }
    }
}

fn page(q: &Published, found: &[SdCheck]) -> String {
    let mut out = format!(
        "mean {} and SD {} of {} whole ratings from {} to {}\n\n",
        as_given(q.mean),
        as_given(q.sd),
        q.n,
        q.scale.0,
        q.scale.1
    );
    // Writing to a String cannot fail.
    let all = possible_sums(q);
    let _ = match all[..] {
        [] => writeln!(
            out,
            "The mean is impossible: no whole sum divided by {} rounds to it.",
            q.n
        ),
        [one] => writeln!(out, "The mean is possible: the ratings sum to {one}."),
        [first, .., last] => writeln!(
            out,
            "The mean is possible: {} sums of the ratings, from {first} to {last}, round to it.",
            all.len()
        ),
    };
    if all.is_empty() {
        return out;
    }
    let _ = writeln!(
        out,
        "Of {} definitions of the SD, {} can give the published value.",
        found.len(),
        match found.iter().filter(|f| f.count > 0).count() {
            0 => "none".to_owned(),
            n => n.to_string(),
        }
    );
    out.push('\n');
    for f in found {
        let verdict = if f.count > 0 {
            "possible  "
        } else {
            "impossible"
        };
        let _ = writeln!(out, "{verdict}  SD {}", definition(f));
        let squares = match f.definition.over {
            SdOver::Ratings => "squares",
            SdOver::SubjectMeans { .. } => "squares of the subjects' sums",
        };
        for s in &f.sums {
            let _ = writeln!(
                out,
                "            sum {}, {squares} {}; squared deviations sum to {}/{}",
                s.sum, s.squares, s.deviations, f.n
            );
        }
        if f.count > f.sums.len() {
            let more = f.count - f.sums.len();
            let at_least = if f.count == MAX_COUNTED {
                "at least "
            } else {
                ""
            };
            let _ = writeln!(out, "            and {at_least}{more} more");
        }
        if f.count == 0 {
            let why = match f.unattainable.first() {
                None => "no whole sum of squares rounds to it".to_owned(),
                Some(s) if (s.squares - s.sum).rem_euclid(2) == 1 => format!(
                    "the {squares} would sum to {} and the ratings to {}, but one is odd and the other even",
                    s.squares, s.sum
                ),
                Some(s) => format!(
                    "no ratings on this scale have the sum {} and {squares} {}",
                    s.sum, s.squares
                ),
            };
            let _ = writeln!(out, "            {why}");
        }
    }
    out
}

fn document(q: &Published, found: &[SdCheck]) -> Value {
    let all = possible_sums(q);
    let definitions: Vec<_> = (found.iter())
        .map(|f| {
            let sums: Vec<_> = (f.sums.iter())
                .map(|s| {
                    json!({
                        "sum": s.sum.to_string(),
                        "squares": s.squares.to_string(),
                    })
                })
                .collect();
            json!({
                "over": match f.definition.over {
                    SdOver::Ratings => "ratings",
                    SdOver::SubjectMeans { .. } => "subject-means",
                },
                "each": match f.definition.over {
                    SdOver::Ratings => 1,
                    SdOver::SubjectMeans { each } => each,
                },
                "divisor": if f.definition.n_minus_1 { "n-1" } else { "n" },
                "n": f.n,
                "possible": f.count > 0,
                "count": f.count,
                "sums": sums,
            })
        })
        .collect();
    json!({
        "format": FORMAT,
        "mean": as_given(q.mean),
        "sd": as_given(q.sd),
        "n": q.n,
        "scale": [q.scale.0 as i64, q.scale.1 as i64],
        "mean_possible": !all.is_empty(),
        "definitions": definitions,
    })
}
