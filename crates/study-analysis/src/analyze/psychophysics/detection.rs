//! Sensitivity of participants and conditions: `sdt/…`.

use crate::analyze::keys::CellName;
use crate::analyze::record::{Interval, Number, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::detection::{
    Answers, Sensitivity as Estimate, abx, forced_choice, oddity, same_different, two_alternative,
    yes_no,
};

statistics! {
    /// The sensitivity of a participant in a condition. Rates are (h + ½)/(n + 1) (Hautus 1995).
    pub struct Sensitivity {
        /// share of hits, of yes–no
        hit_rate_loglinear: Option<Stat>,
        /// share of false alarms, of yes–no
        false_alarm_rate_loglinear: Option<Stat>,
        /// d′
        d: Option<Stat>,
        /// its standard error
        d_se: Option<Stat>,
        /// of d′
        d_ci95: Option<Interval>,
        /// −(zH + zF)/2, of yes–no
        criterion: Option<Stat>,
        /// exp(d·criterion), of yes–no
        beta: Option<Stat>,
        /// d′ from raw rates, of yes–no
        d_uncorrected: Option<Stat>,
        /// A′ from raw rates, of yes–no
        a_prime: Option<Stat>,
        /// −(zH + zF)/√2, of 2IFC
        interval_bias: Option<Stat>,
        /// share of correct answers
        share_correct: Option<Stat>,
        /// Wilson's
        share_correct_ci95: Option<Interval>,
        /// √2 z of the share of correct answers, which a bias makes too small
        d_from_share_correct: Option<Stat>,
        /// from Wilson's limits
        d_from_share_correct_ci95: Option<Interval>,
        /// Φ((zH − zF)/2)
        share_unbiased: Option<Stat>,
        /// −(zH + zF)/2, of ABX
        bias: Option<Stat>,
        /// the criterion of differencing, of same–different
        tau_differencing: Option<Stat>,
        /// d′ of somebody who compares the intervals
        d_differencing: Option<Stat>,
        /// of d′ by differencing
        d_differencing_ci95: Option<Interval>,
        /// d′ of somebody who judges each interval by itself
        d_independent: Option<Stat>,
        /// of d′ by independent observations
        d_independent_ci95: Option<Interval>,
        /// the maximum of the likelihood, from raw rates
        d_differencing_ml: Option<Stat>,
    }
}

impl Sensitivity {
    /// d′ with its interval; where participants compare the intervals, that of differencing.
    pub fn d(&self) -> (Option<f64>, Option<(f64, f64)>) {
        let (d, ci95) = match &self.d_differencing {
            Some(_) => (&self.d_differencing, &self.d_differencing_ci95),
            None => (&self.d, &self.d_ci95),
        };
        (d.number(), ci95.as_ref().and_then(Interval::ends))
    }

    /// The bias of the answers.
    pub fn bias(&self) -> Option<f64> {
        let all = [&self.criterion, &self.interval_bias, &self.bias];
        all.into_iter().find_map(Number::number)
    }
}

/// How a trial is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Task {
    /// "Yes" to a signal or a catch trial.
    YesNo,
    /// "First" or "second".
    TwoAlternative,
    /// Which of m intervals.
    ForcedChoice(u32),
    /// Which of three is odd.
    Oddity,
    /// "X is A" or "X is B".
    Abx,
    /// "Different" or "same".
    SameDifferent,
}

/// The answers of one participant in one condition.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Participant. Untrusted.
    pub participant: String,
    /// Condition. Untrusted.
    pub condition: String,
    /// What was answered. Of a choice among several and of oddity, `hits` of `n_hits`
    /// are correct, and the rest is not used.
    pub answers: Answers,
    /// Whether rates are taken as they are, in ABX and same–different.
    pub raw: bool,
}

const NO_TRIALS: &str = "there are not trials of both kinds";
const PERFECT: &str = "every answer is correct";

/// Sensitivity and bias of every cell.
pub fn detection(task: Task, cells: &[Detection]) -> BTreeMap<CellName, Sensitivity> {
    let of_cell = |cell: &Detection| {
        let (answers, raw) = (&cell.answers, cell.raw);
        let found = match task {
            Task::YesNo => of_yes_no(answers),
            Task::TwoAlternative => of_two(answers),
            Task::ForcedChoice(m) => of_choice(Some(m), answers),
            Task::Oddity => of_choice(None, answers),
            Task::Abx => of_abx(answers, raw),
            Task::SameDifferent => of_same_different(answers, raw),
        };
        (CellName::of(&cell.participant, &cell.condition), found)
    };
    cells.iter().map(of_cell).collect()
}

fn of_yes_no(answers: &Answers) -> Sensitivity {
    let found = yes_no(answers);
    let stat = |x| Some(Stat::or(x, NO_TRIALS));
    let raw = found.and_then(|f| f.d_uncorrected);
    let a_prime = found.and_then(|f| f.a_prime);
    Sensitivity {
        hit_rate_loglinear: stat(found.map(|f| f.rates.hit)),
        false_alarm_rate_loglinear: stat(found.map(|f| f.rates.false_alarm)),
        d: stat(found.map(|f| f.d)),
        d_se: stat(found.map(|f| f.d_se)),
        d_ci95: Some(Interval::or(found.map(|f| f.d_ci95), NO_TRIALS)),
        criterion: stat(found.map(|f| f.criterion)),
        beta: stat(found.map(|f| f.beta)),
        d_uncorrected: Some(Stat::or(raw, "a rate is 0 or 1")),
        a_prime: Some(Stat::or(a_prime, "both rates are 0, or both are 1")),
        ..Sensitivity::undefined("")
    }
}

fn of_two(answers: &Answers) -> Sensitivity {
    let found = two_alternative(answers);
    let stat = |x| Some(Stat::or(x, NO_TRIALS));
    let interval = |ends| Some(Interval::or(ends, NO_TRIALS));
    Sensitivity {
        d: stat(found.map(|f| f.d)),
        d_se: stat(found.map(|f| f.d_se)),
        d_ci95: interval(found.map(|f| f.d_ci95)),
        interval_bias: stat(found.map(|f| f.interval_bias)),
        share_correct: stat(found.map(|f| f.share_correct)),
        share_correct_ci95: interval(found.map(|f| f.share_ci95)),
        d_from_share_correct: found.map(|f| Stat::or(f.d_from_share, PERFECT)),
        d_from_share_correct_ci95: found.map(|f| Interval {
            lo: Stat::or(f.d_from_share_ci95.0, "no answer is correct"),
            hi: Stat::or(f.d_from_share_ci95.1, PERFECT),
        }),
        ..Sensitivity::undefined("")
    }
}

fn of_choice(m: Option<u32>, answers: &Answers) -> Sensitivity {
    let (correct, trials) = (answers.hits, answers.n_hits);
    let found = match m {
        Some(m) => forced_choice(correct, trials, m),
        None => oddity(correct, trials),
    };
    let none = "there are no trials";
    Sensitivity {
        share_correct: Some(Stat::or(found.map(|f| f.share_correct), none)),
        share_correct_ci95: Some(Interval::or(found.map(|f| f.share_ci95), none)),
        d: found.map(|f| Stat::or(f.d, PERFECT)),
        d_se: found.map(|f| Stat::or(f.d_se, "d' is 0, or every answer is correct")),
        d_ci95: found.map(|f| Interval {
            lo: Stat::or(f.d_ci95.0, PERFECT),
            hi: Stat::or(f.d_ci95.1, PERFECT),
        }),
        ..Sensitivity::undefined("")
    }
}

/// d′ of a model with its interval.
fn model(found: Option<Estimate>) -> (Option<Stat>, Option<Interval>) {
    let ends = found.and_then(|s| s.ci95);
    let interval = Interval::or(ends, "d' is 0, or a limit has no d'");
    (Some(Stat::or(found.map(|s| s.d), RATES)), Some(interval))
}

const RATES: &str = "a rate is 0 or 1, or there are not trials of both kinds";

fn of_abx(answers: &Answers, raw: bool) -> Sensitivity {
    let found = abx(answers, raw);
    let (d_differencing, d_differencing_ci95) = model(found.map(|f| f.differencing));
    let (d_independent, d_independent_ci95) = model(found.map(|f| f.independent));
    Sensitivity {
        share_unbiased: Some(Stat::or(found.map(|f| f.share_unbiased), RATES)),
        bias: Some(Stat::or(found.map(|f| f.bias), RATES)),
        d_differencing,
        d_differencing_ci95,
        d_independent,
        d_independent_ci95,
        ..Sensitivity::undefined("")
    }
}

fn of_same_different(answers: &Answers, raw: bool) -> Sensitivity {
    let found = same_different(answers, raw);
    let (d_differencing, d_differencing_ci95) = model(found.map(|f| f.differencing));
    let (d_independent, d_independent_ci95) = model(found.map(|f| f.independent));
    let ml = found.and_then(|f| f.differencing_ml);
    Sensitivity {
        share_unbiased: Some(Stat::or(found.map(|f| f.share_unbiased), RATES)),
        tau_differencing: Some(Stat::or(found.map(|f| f.tau), RATES)),
        d_differencing,
        d_differencing_ci95,
        d_independent,
        d_independent_ci95,
        d_differencing_ml: Some(Stat::or(ml, "a raw rate is 0 or 1")),
        ..Sensitivity::undefined("")
    }
}
