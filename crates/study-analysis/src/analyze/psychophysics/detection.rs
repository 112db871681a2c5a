//! Sensitivity of participants and conditions: `sdt/…`.

use crate::analyze::identifiers::group_id;
use crate::analyze::values::Values;
use study_stats::detection::{
    Answers, Sensitivity, abx, forced_choice, oddity, same_different, two_alternative, yes_no,
};

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
pub fn detection(task: Task, cells: &[Detection]) -> Values {
    let mut values = Values::default();
    for cell in cells {
        let prefix = group_id("sdt", &[&cell.participant, &cell.condition]);
        match task {
            Task::YesNo => of_yes_no(&prefix, &cell.answers, &mut values),
            Task::TwoAlternative => of_two(&prefix, &cell.answers, &mut values),
            Task::ForcedChoice(m) => of_choice(&prefix, Some(m), &cell.answers, &mut values),
            Task::Oddity => of_choice(&prefix, None, &cell.answers, &mut values),
            Task::Abx => of_abx(&prefix, cell, &mut values),
            Task::SameDifferent => of_same_different(&prefix, cell, &mut values),
        }
    }
    values
}

fn of_yes_no(prefix: &str, answers: &Answers, values: &mut Values) {
    let found = yes_no(answers);
    let mut group = values.group(prefix, NO_TRIALS);
    group.maybe("hit_rate_loglinear", found.map(|f| f.rates.hit));
    let rate = found.map(|f| f.rates.false_alarm);
    group.maybe("false_alarm_rate_loglinear", rate);
    group.maybe("d", found.map(|f| f.d));
    group.maybe("d_se", found.map(|f| f.d_se));
    group.interval("d_ci95", found.map(|f| f.d_ci95));
    group.maybe("criterion", found.map(|f| f.criterion));
    group.maybe("beta", found.map(|f| f.beta));
    let raw = found.and_then(|f| f.d_uncorrected);
    group.put_or("d_uncorrected", raw, "a rate is 0 or 1");
    let a_prime = found.and_then(|f| f.a_prime);
    group.put_or("a_prime", a_prime, "both rates are 0, or both are 1");
}

fn of_two(prefix: &str, answers: &Answers, values: &mut Values) {
    let found = two_alternative(answers);
    let mut group = values.group(prefix, NO_TRIALS);
    group.maybe("d", found.map(|f| f.d));
    group.maybe("d_se", found.map(|f| f.d_se));
    group.interval("d_ci95", found.map(|f| f.d_ci95));
    group.maybe("interval_bias", found.map(|f| f.interval_bias));
    group.maybe("share_correct", found.map(|f| f.share_correct));
    group.interval("share_correct_ci95", found.map(|f| f.share_ci95));
    let Some(found) = found else {
        return;
    };
    group.put_or("d_from_share_correct", found.d_from_share, PERFECT);
    let (low, high) = found.d_from_share_ci95;
    group.put_or("d_from_share_correct_ci95_lo", low, "no answer is correct");
    group.put_or("d_from_share_correct_ci95_hi", high, PERFECT);
}

fn of_choice(prefix: &str, m: Option<u32>, answers: &Answers, values: &mut Values) {
    let (correct, trials) = (answers.hits, answers.n_hits);
    let found = match m {
        Some(m) => forced_choice(correct, trials, m),
        None => oddity(correct, trials),
    };
    let mut group = values.group(prefix, "there are no trials");
    group.maybe("share_correct", found.map(|f| f.share_correct));
    group.interval("share_correct_ci95", found.map(|f| f.share_ci95));
    let Some(found) = found else {
        return;
    };
    group.put_or("d", found.d, PERFECT);
    let at_chance = "d' is 0, or every answer is correct";
    group.put_or("d_se", found.d_se, at_chance);
    group.put_or("d_ci95_lo", found.d_ci95.0, PERFECT);
    group.put_or("d_ci95_hi", found.d_ci95.1, PERFECT);
}

/// `d_MODEL` with its interval.
fn model(group: &mut crate::analyze::values::Group<'_>, name: &str, found: Option<Sensitivity>) {
    group.maybe(&format!("d_{name}"), found.map(|s| s.d));
    let interval = found.and_then(|s| s.ci95);
    let why = "d' is 0, or a limit has no d'";
    for (end, value) in [("lo", interval.map(|i| i.0)), ("hi", interval.map(|i| i.1))] {
        group.put_or(&format!("d_{name}_ci95_{end}"), value, why);
    }
}

const RATES: &str = "a rate is 0 or 1, or there are not trials of both kinds";

fn of_abx(prefix: &str, cell: &Detection, values: &mut Values) {
    let found = abx(&cell.answers, cell.raw);
    let mut group = values.group(prefix, RATES);
    group.maybe("share_unbiased", found.map(|f| f.share_unbiased));
    group.maybe("bias", found.map(|f| f.bias));
    model(&mut group, "differencing", found.map(|f| f.differencing));
    model(&mut group, "independent", found.map(|f| f.independent));
}

fn of_same_different(prefix: &str, cell: &Detection, values: &mut Values) {
    let found = same_different(&cell.answers, cell.raw);
    let mut group = values.group(prefix, RATES);
    group.maybe("share_unbiased", found.map(|f| f.share_unbiased));
    group.maybe("tau_differencing", found.map(|f| f.tau));
    model(&mut group, "differencing", found.map(|f| f.differencing));
    model(&mut group, "independent", found.map(|f| f.independent));
    let ml = found.and_then(|f| f.differencing_ml);
    group.put_or("d_differencing_ml", ml, "a raw rate is 0 or 1");
}
