//! Labels that can be counted out: each comes once in a block, and the right one is told after each trial.

use crate::protocol::{Drawn, Feedback, Identification, Order, Part};
use std::collections::BTreeMap;
use study_base::diagnostic::Fault;

/// More than guesses by so much is worth a warning.
const MORE: f64 = 0.15;

/// Most trials whose share of correct answers is computed.
const MOST_TRIALS: usize = 40;

/// A part that tells the right label after each trial.
pub(super) fn trials(part: &Part) -> Option<Fault> {
    let own = part.task.identification()?;
    let presented = &own.presentations;
    if own.feedback != Feedback::Always {
        return None;
    }
    let block: Vec<usize> = own.labels.iter().map(|l| l.models.len()).collect();
    let all: Vec<usize> = (block.iter())
        .map(|n| n.saturating_mul(presented.repetitions as usize))
        .collect();
    let (each, within, instead) = match presented.order {
        Order::Shuffled => (all, "the part", "raise repetitions".to_owned()),
        Order::Blocked | Order::Williams | Order::LatinSquare | Order::Fixed | Order::File(_) => {
            let less = by_counting(&all).map_or_else(String::new, percent);
            (block, "a block", format!("take order = \"shuffled\"{less}"))
        }
    };
    let share = worth_a_warning(&each)?;
    let what = format!(
        "`{}` tells the right label after each trial, and how often each comes in {within} is known: who counts is right in \
         {:.0} % of the trials without feeling anything",
        part.id,
        100.0 * share
    );
    let hint = format!("{instead}, or feedback = \"practice\"");
    Some(Fault::warning(what).hint(hint))
}

/// Practice to a criterion that comes in rounds, and tells the right label after each trial.
pub(super) fn practice(part: &Part) -> Option<Fault> {
    let own = part.task.identification()?;
    let criterion = own.criterion?;
    if own.feedback == Feedback::Never || criterion.draw != Drawn::Rounds {
        return None;
    }
    let share = worth_a_warning(&practiced(own))?;
    let what = format!(
        "the practice of `{}` tells the right label after each trial, and each of its trials comes once in a round: who counts is \
         right in {:.0} % of them without feeling anything",
        part.id,
        100.0 * share
    );
    Some(Fault::warning(what).hint("add draw = \"independent\" to the criterion"))
}

/// How often each label comes in a round of practice.
fn practiced(own: &Identification) -> Vec<usize> {
    let of_label = |label: &crate::protocol::Label| {
        let practice = own.presentations.practice.iter();
        practice
            .filter(|model| label.models.contains(model))
            .count()
    };
    own.labels.iter().map(of_label).collect()
}

fn percent(share: f64) -> String {
    format!(" ({:.0} %)", 100.0 * share)
}

/// The share by counting, if it is well above that of guesses.
fn worth_a_warning(each: &[usize]) -> Option<f64> {
    let n: usize = each.iter().sum();
    let guesses = *each.iter().max()? as f64 / n as f64;
    by_counting(each).filter(|share| *share >= guesses + MORE)
}

/// The share of correct answers of somebody who always gives a label of which most are left, of trials in random order among which
/// each label is right so often. `None` of no trials, and of too many.
fn by_counting(each: &[usize]) -> Option<f64> {
    let n: usize = each.iter().sum();
    let known = &mut BTreeMap::new();
    (1..=MOST_TRIALS)
        .contains(&n)
        .then(|| expected(each.to_vec(), known) / n as f64)
}

/// The expected number of correct answers, of what is left of each label.
fn expected(mut left: Vec<usize>, known: &mut BTreeMap<Vec<usize>, f64>) -> f64 {
    left.retain(|n| *n > 0);
    left.sort_unstable();
    let Some(most) = left.last() else {
        return 0.0;
    };
    if let Some(found) = known.get(&left) {
        return *found;
    }
    let n = left.iter().sum::<usize>() as f64;
    let mut sum = *most as f64 / n;
    for at in 0..left.len() {
        let mut after = left.clone();
        after[at] -= 1;
        sum += left[at] as f64 / n * expected(after, known);
    }
    known.insert(left, sum);
    sum
}

#[cfg(test)]
mod tests {
    use super::by_counting;
    use crate::protocol::check::warnings;
    use crate::protocol::file::parse;

    #[test]
    fn the_last_label_of_a_block_is_known() {
        let close = |each: &[usize], share: f64| {
            let found = by_counting(each).unwrap();
            assert!((found - share).abs() < 1e-12, "{each:?}: {found}");
        };
        // (1/4 + 1/3 + 1/2 + 1)/4
        close(&[1, 1, 1, 1], 25.0 / 48.0);
        close(&[2, 2], 17.0 / 24.0);
        close(&[3], 1.0);
        assert_eq!(by_counting(&[]), None);
        assert_eq!(by_counting(&[20, 21]), None);
    }

    fn warned(order: &str, feedback: &str, criterion: &str) -> Vec<String> {
        warned_of(6, order, feedback, criterion)
    }

    fn warned_of(repetitions: u32, order: &str, feedback: &str, criterion: &str) -> Vec<String> {
        let text = format!(
            r#"
format = "study-protocol/3"
study = {{ id = "s", title = "t", seed = 1 }}
design = {{ participants = 8 }}
device = {{ kind = "simulated", limits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }} }}
analysis = {{ primary = "which" }}
models = [{{ id = "a", file = "a.toml" }}, {{ id = "b", file = "b.toml" }}, {{ id = "c", file = "c.toml" }}, {{ id = "d", file = "d.toml" }}]

[[parts]]
id = "which"
kind = "identification"
prompt = "Which?"
answers = [{{ label = "1", models = ["a"] }}, {{ label = "2", models = ["b"] }}, {{ label = "3", models = ["c"] }}, {{ label = "4", models = ["d"] }}]
repetitions = {repetitions}
order = "{order}"
feedback = "{feedback}"
practice = ["a", "b", "c", "d"]
{criterion}
"#
        );
        let parsed = parse("p", &text);
        let shown = parsed.findings.render(false);
        let protocol = parsed.protocol.unwrap_or_else(|| panic!("{shown}"));
        let faults = warnings(&protocol, &parsed.spans, &[]);
        let own = faults.iter().filter(|f| f.message.contains("who counts"));
        own.map(|f| format!("{} {:?}", f.message, f.hint)).collect()
    }

    #[test]
    fn labels_that_can_be_counted_out_are_a_warning() {
        let found = warned("blocked", "always", "");
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains("in a block") && found[0].contains(" 52 %"));
        assert!(found[0].contains("\"shuffled\\\" (40 %)"), "{found:?}");
        // Six repetitions of four: .40, by guessing .25.
        assert!(warned("shuffled", "always", "").is_empty());
        let few = warned_of(2, "shuffled", "always", "");
        assert!(few[0].contains("in the part") && few[0].contains("raise repetitions"));
        assert!(warned("blocked", "practice", "").is_empty());
        let rounds = "criterion = { correct = 7, of = 8, rounds = 6 }";
        let found = warned("blocked", "practice", rounds);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].contains("once in a round") && found[0].contains(" 52 %"));
        assert!(warned("blocked", "never", rounds).is_empty());
        let independent = rounds.replace("6 }", "6, draw = \"independent\" }");
        assert!(warned("blocked", "practice", &independent).is_empty());
        assert_eq!(warned("blocked", "always", rounds).len(), 2);
    }
}
