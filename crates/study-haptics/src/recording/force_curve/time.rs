//! The times of the rows of a force curve: times of day in whole seconds, or numbers.

use super::{ForceCurveFault as Fault, number_in};
use crate::recording::names::linear;
use crate::recording::rows::shown;

/// Rows this many times as far apart as usual are no even rate.
const MOST_UNEVEN: f64 = 2.5;
const SECONDS_A_DAY: f64 = 86_400.0;

/// A column of the time: times of day, or numbers in a unit of so many seconds.
#[derive(Clone, Copy)]
pub(super) struct Time {
    pub(super) at: usize,
    pub(super) unit_s: f64,
}

/// A moment of a row.
#[derive(Clone, Copy)]
pub(super) enum Moment {
    /// Time of day, s.
    OfDay(f64),
    /// Time since some beginning, s.
    Since(f64),
}

/// The moment that a field says.
pub(super) fn moment(text: &str, unit_s: f64, separator: u8) -> Result<Moment, Fault> {
    let since = number_in(text, separator).filter(|value| value.is_finite());
    (seconds_of(text).map(Moment::OfDay))
        .or(since.map(|value| Moment::Since(unit_s * value)))
        .ok_or_else(|| Fault::Time(shown(text)))
}

/// The column of the time, and its unit.
pub(super) fn time_of(names: &[String]) -> Option<Time> {
    let unit = |name: &String| {
        let rest = name.strip_prefix("time").or(name.strip_prefix('t'))?;
        if rest.starts_with(char::is_alphanumeric) {
            return None;
        }
        let stated = rest.trim_matches(|c: char| !c.is_alphabetic());
        linear(0, if stated.is_empty() { "s" } else { stated })
    };
    (names.iter().enumerate()).find_map(|(at, name)| {
        let unit_s = unit(name)?;
        Some(Time { at, unit_s })
    })
}

/// Rows a second from the times of lines; `None` without times, or if all are in one second.
pub(super) fn rate(times: &[(usize, Moment)]) -> Result<Option<f64>, (usize, Fault)> {
    let of_day: Vec<f64> = (times.iter())
        .filter_map(|(_, moment)| match moment {
            Moment::OfDay(seconds) => Some(*seconds),
            Moment::Since(_) => None,
        })
        .collect();
    if of_day.len() == times.len() {
        if let Some(at) = goes_back(&of_day) {
            return Err((times[at].0, Fault::TimeBackwards));
        }
        return Ok(rate_of(&of_day));
    }
    let mut intervals = Vec::new();
    for pair in times.windows(2) {
        let [(_, Moment::Since(before)), (line, Moment::Since(now))] = *pair else {
            let (line, _) = pair[1];
            return Err((line, Fault::Time("a time of day beside numbers".to_owned())));
        };
        if now <= before {
            return Err((line, Fault::TimeBackwards));
        }
        intervals.push((now - before, line));
    }
    let total: f64 = intervals.iter().map(|(interval_s, _)| interval_s).sum();
    intervals.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (usual_s, _) = intervals[intervals.len() / 2];
    match intervals.last() {
        Some((longest_s, line)) if *longest_s > MOST_UNEVEN * usual_s => {
            let longest_s = *longest_s;
            Err((*line, Fault::Uneven { longest_s, usual_s }))
        }
        _ => Ok(Some(intervals.len() as f64 / total)),
    }
}

/// The time of day of `12:29:11 PM` or `12:29:11`, s.
pub(super) fn seconds_of(text: &str) -> Option<f64> {
    let upper = text.to_uppercase();
    let (clock, half) = match upper.rsplit_once(' ') {
        Some((clock, half @ ("AM" | "PM"))) => (clock, Some(half)),
        _ => (upper.as_str(), None),
    };
    let mut parts = clock.split(':').map(|part| part.trim().parse::<f64>().ok());
    let (hours, minutes, seconds) = (parts.next()??, parts.next()??, parts.next()??);
    let hours = match half {
        Some(half) => hours % 12.0 + if half == "PM" { 12.0 } else { 0.0 },
        None => hours,
    };
    Some(3600.0 * hours + 60.0 * minutes + seconds)
}

/// The first row whose time of day is before that of the row above it, unless it is past midnight.
fn goes_back(seconds: &[f64]) -> Option<usize> {
    (1..seconds.len())
        .find(|i| (seconds[*i] - seconds[i - 1]).rem_euclid(SECONDS_A_DAY) > 0.5 * SECONDS_A_DAY)
}

/// Rows a second from their times in whole seconds: between the first and the last time that
/// changes; `None` if there is no more than one.
pub(super) fn rate_of(seconds: &[f64]) -> Option<f64> {
    let changes: Vec<usize> = (1..seconds.len())
        .filter(|i| seconds[*i] != seconds[*i - 1])
        .collect();
    let (first, last) = (*changes.first()?, *changes.last()?);
    let elapsed = (seconds[last] - seconds[first]).rem_euclid(SECONDS_A_DAY);
    (elapsed > 0.0).then(|| (last - first) as f64 / elapsed)
}
