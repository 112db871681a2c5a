//! What the trials of a part are, in a sentence.

use crate::study::search_rule;
use serde_json::json;
use study_base::text::counted;
use study_plan::protocol::pairs::IntervalOrder;
use study_plan::protocol::parts::{Part, Task, TrackRules};
use study_plan::protocol::presentations::{Presentations, Standard};
use study_plan::protocol::{Drawn, Feedback, Identification, Order, Protocol};

/// How an order is made.
pub(super) fn order(order: &Order) -> String {
    match order {
        Order::File(_) => "a prepared file".to_owned(),
        order => json!(order).as_str().unwrap_or_default().to_owned(),
    }
}

/// The practice of an identification, after a comma.
fn practice(own: &Identification) -> String {
    let n = own.presentations.practice.len();
    match own.criterion {
        None if n == 0 => String::new(),
        None => format!(
            ", after {}",
            counted(n, "practice trial", "practice trials")
        ),
        Some(c) => {
            let rounds = c.rounds as usize;
            let most = match c.draw {
                Drawn::Rounds => format!(
                    "{} of {}",
                    counted(rounds, "round", "rounds"),
                    counted(n, "trial", "trials")
                ),
                Drawn::Independent => format!(
                    "{}, each drawn on its own",
                    counted(n * rounds, "trial", "trials")
                ),
            };
            format!(
                ", after practice until {} of the last {} answers are correct (at most {most})",
                c.correct, c.of
            )
        }
    }
}

/// What the trials of a part are.
pub(super) fn trials(p: &Protocol, part: &Part) -> String {
    let each = |own: &Presentations, what: &str| {
        format!(
            "{what} of {}, {} each, order {}",
            match own.models.iter().all(|m| p.level_of(m).is_some()) {
                true => counted(own.models.len(), "level", "levels"),
                false => counted(own.models.len(), "realization", "realizations"),
            },
            counted(own.repetitions as usize, "trial", "trials"),
            order(&own.order)
        )
    };
    match &part.task {
        Task::Rating(own) => each(own, "rating"),
        Task::Magnitude(own) => {
            let of = each(&own.presentations, "magnitude estimation");
            match &own.standard {
                None => of,
                Some(standard) => {
                    let Standard { model, modulus } = standard;
                    format!(
                        "{of}; {model} is felt first in each trial and has the number {modulus}"
                    )
                }
            }
        }
        Task::Mushra(own) => each(&own.presentations, "rating beside a reference"),
        Task::Identification(own) => format!(
            "{}, each is given one of {}{}, {}",
            each(&own.presentations, "identification"),
            counted(own.labels.len(), "label", "labels"),
            practice(own),
            match own.feedback {
                Feedback::Practice if own.presentations.practice.is_empty() =>
                    "the right label is never told",
                Feedback::Practice => "the right label is told after each practice trial",
                Feedback::Always => "the right label is told after each trial",
                Feedback::Never => "the right label is never told",
            }
        ),
        Task::Pairs(pairs) => format!(
            "{}, {} each, {}, {}",
            counted(
                pairs.pairs.len(),
                "pair of realizations",
                "pairs of realizations"
            ),
            counted(pairs.repetitions as usize, "trial", "trials"),
            match pairs.interval_order {
                IntervalOrder::Balanced => "in both orders in turn",
                IntervalOrder::Random => "their order drawn for each trial",
            },
            if pairs.tie {
                "“no difference” is an answer"
            } else {
                "no ties"
            }
        ),
        Task::Discrimination { tracks } => {
            let ids: Vec<String> = tracks.iter().map(|id| format!("`{id}`")).collect();
            let joined = |own: &Vec<&TrackRules>| {
                let ids: Vec<String> = own.iter().map(|t| format!("`{}`", t.id)).collect();
                let together = (ids.len() > 1).then(|| ids.join(" and "))?;
                let condition = own[0].condition();
                Some(format!(
                    "; {together} measure the condition `{condition}` and are fitted as one"
                ))
            };
            let conditions = p.conditions(part);
            let joined: String = conditions.iter().filter_map(joined).collect();
            format!(
                "{} {}{joined}",
                if ids.len() == 1 { "track" } else { "tracks" },
                ids.join(", ")
            )
        }
        Task::Similarity(own) => format!(
            "ratings of difference from 0 to 100 of {} of {}{}, {} each, in both orders in turn, order {}",
            match own.different.len() == own.possible() {
                true => format!("all {}", counted(own.possible(), "pair", "pairs")),
                false => format!("{} of the {} pairs", own.different.len(), own.possible()),
            },
            match own.models.iter().all(|m| p.level_of(m).is_some()) {
                true => counted(own.models.len(), "level", "levels"),
                false => counted(own.models.len(), "realization", "realizations"),
            },
            match own.identical {
                true => " and of each with itself",
                false => "",
            },
            counted(own.repetitions as usize, "trial", "trials"),
            order(&own.order)
        ),
        Task::Ranking(own) => format!(
            "rankings of {}, all felt one after another, {}, order {}, {}",
            match own.models.iter().all(|m| p.level_of(m).is_some()) {
                true => counted(own.models.len(), "level", "levels"),
                false => counted(own.models.len(), "realization", "realizations"),
            },
            counted(own.repetitions as usize, "trial", "trials"),
            order(&own.order),
            match own.ties {
                true => "several can have the same rank",
                false => "no ties",
            }
        ),
        Task::Adjustment(own) => format!(
            "a level of `{}` is set {} from below and as often from above, one step of its {} at a time, until it feels {}; where it \
             starts is drawn",
            own.family,
            counted(own.repetitions as usize, "time", "times"),
            counted(own.models.len(), "level", "levels"),
            match &own.standard {
                Some(standard) => match p.level_of(standard) {
                    Some(level) => format!("equal to {level}"),
                    None => format!("equal to `{standard}`"),
                },
                None => "as it should".to_owned(),
            }
        ),
        Task::Search(own) => format!(
            "search in the space `{}`, {}, {}; it decides nothing",
            own.space,
            counted(own.rule.trials as usize, "pair", "pairs"),
            search_rule(&own.rule)
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tracks_of_a_condition_are_declared_as_one() {
        let track = |id: &str, condition: &str| {
            format!(
                "[[tracks]]\nid = \"{id}\"\nmethod = \"2ifc\"\nfamily = \"friction\"\nstandard = 0.0\n\
                 procedure = {{ rule = \"quest+\", trials = 40 }}\n{condition}\n"
            )
        };
        let protocol = |condition: &str| {
            let text = format!(
                r#"
format = "study-protocol/3"
study = {{ id = "example", title = "An example", seed = 1 }}
design = {{ participants = 10 }}
device = {{ kind = "simulated", limits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }} }}
analysis = {{ primary = "more" }}
families = [{{ id = "friction", from = "static.toml", vary = "friction", range = [0.02, 0.6], steps = 30 }}]
parts = [{{ id = "more", kind = "discrimination", prompt = "Which?", tracks = ["up", "down"] }}]

{}{}"#,
                track("up", condition),
                track("down", condition)
            );
            let parsed = study_plan::protocol::file::parse("protocol.toml", &text);
            let shown = parsed.findings.render(false);
            parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
        };
        for (condition, says) in [
            ("", "tracks `up`, `down`"),
            (
                "condition = \"all\"",
                "tracks `up`, `down`; `up` and `down` measure the condition `all` and are fitted as one",
            ),
        ] {
            let p = protocol(condition);
            assert_eq!(trials(&p, &p.parts[0]), says);
        }
    }
}
