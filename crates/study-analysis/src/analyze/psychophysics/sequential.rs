//! Whether answers depend on the trial before: `sequential/*`.

use crate::analyze::record::{Interval, Number as _, Stat, statistics};
use crate::analyze::warning::Warning;
use study_base::apa;
use study_stats::describe::mean;
use study_stats::level::rejects;
use study_stats::paired::one_sample;
use study_stats::sequential::{Answered, Sequential, sequential};

statistics! {
    /// By how much more often the first of two words is the answer, after one trial than after another; the mean over participants of their coefficients, which are shares.
    pub struct SequentialEffect {
        /// mean over participants
        mean: Stat,
        /// t interval of it
        ci95: Interval,
        /// t of the test that it is 0
        t: Stat,
        /// participants less one
        df: Stat,
        /// of `t`, two-sided
        p: Stat,
    }

    /// Whether answers depend on the trial before, of trials with two answers of which one is right. For each participant with 15 trials or more after another one of the same session: answer ~ what is right + what is right × level + answer before + what was right before, by least squares, with a correction for the mean that is estimated (Marriott & Pope 1954).
    pub struct SequentialResult {
        /// participants with enough trials
        n: Stat,
        /// after the first word was the answer, less after the second was: above 0 whoever says the same again
        after_answer: SequentialEffect,
        /// after the first word was right, less after the second was
        after_right: SequentialEffect,
        /// as `after_answer`, after correct answers: to stay with what won
        after_correct: SequentialEffect,
        /// as `after_answer`, after wrong answers
        after_wrong: SequentialEffect,
    }
}

impl SequentialEffect {
    fn of(participants: &[f64]) -> Self {
        let found = one_sample(participants);
        let few = "fewer than two participants have enough trials";
        let why = found.map_or(few, |_| "it is the same for all participants");
        Self {
            mean: Stat::or(mean(participants), few),
            ci95: Interval::or(found.map(|f| f.ci95), few),
            t: Stat::or(found.and_then(|f| f.t), why),
            df: Stat::or(found.map(|f| f.n as f64 - 1.0), few),
            p: Stat::or(found.and_then(|f| f.p), why),
        }
    }
}

/// Of the trials of participants, each with sessions of trials that followed each other. `None` if nobody has enough trials.
pub(super) fn sequential_effects(participants: &[Vec<Vec<Answered>>]) -> Option<SequentialResult> {
    let found: Vec<Sequential> = (participants.iter())
        .filter_map(|sessions| sequential(sessions))
        .collect();
    let effect = |of: fn(&Sequential) -> f64| {
        SequentialEffect::of(&found.iter().map(of).collect::<Vec<f64>>())
    };
    (!found.is_empty()).then(|| SequentialResult {
        n: Stat::count(found.len()),
        after_answer: effect(|s| s.after_answer),
        after_right: effect(|s| s.after_right),
        after_correct: effect(Sequential::after_correct),
        after_wrong: effect(Sequential::after_wrong),
    })
}

/// What to know of it: thresholds take trials as independent. `word` is the first of the two.
pub(super) fn warning(word: &str, found: &SequentialResult, alpha: f64) -> Option<Warning> {
    let shown = |effect: &SequentialEffect| {
        let p = effect.p.number().filter(|p| rejects(*p, alpha))?;
        let change = effect.mean.number()?;
        Some(format!(
            "{} percentage points {} often (p {})",
            apa::number(100.0 * change.abs(), 0),
            if change > 0.0 { "more" } else { "less" },
            apa::p(p)
        ))
    };
    let after_answer = shown(&found.after_answer).map(|more| {
        format!("after the answer “{word}” it is given again {more} than after the other")
    });
    let after_right = shown(&found.after_right).map(|more| {
        format!("after trials in which “{word}” was right it is given {more} than after others")
    });
    let all: Vec<String> = after_answer.into_iter().chain(after_right).collect();
    (!all.is_empty()).then(|| Warning {
        code: "sequential",
        text: format!(
            "answers depend on the trial before: {}; thresholds and their intervals take trials as independent",
            all.join(", and ")
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(participants: &[f64]) -> SequentialResult {
        let effect = || SequentialEffect::of(participants);
        SequentialResult {
            n: Stat::count(participants.len()),
            after_answer: effect(),
            after_right: SequentialEffect::of(&[]),
            after_correct: effect(),
            after_wrong: effect(),
        }
    }

    #[test]
    fn what_is_shown_is_said() {
        let said = warning("first", &result(&[-0.1, -0.12, -0.08, -0.11]), 0.05);
        let said = said.unwrap().text;
        assert!(
            said.contains("after the answer “first” it is given again 10 percentage points less often (p = .001)"),
            "{said}"
        );
        assert_eq!(warning("first", &result(&[-0.1, 0.12]), 0.05), None);
        assert_eq!(warning("yes", &result(&[0.3]), 0.05), None);
    }
}
