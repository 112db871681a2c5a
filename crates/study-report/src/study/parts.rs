//! What a report says of the parts of a study besides their analyses.

use crate::figures::of_part;
use crate::html::PartReport;
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_base::text::{ModelId, counted};
use study_plan::procedure::search::Acquire;
use study_plan::procedure::{Choose, Rule, SearchRule};
use study_plan::protocol::identification::{Criterion, Drawn, Feedback};
use study_plan::protocol::pairs::IntervalOrder;
use study_plan::protocol::parts::{Compared, Part, Task, TrackRules};
use study_plan::protocol::{Adjustment, Protocol, Relative};

/// Figures and sentences on the trials of each part.
pub(super) fn part_reports(protocol: &Protocol, parts: &[PartAnalysis]) -> Vec<PartReport> {
    let report = |(i, analysis): (usize, &PartAnalysis)| PartReport {
        trials: protocol
            .part(&analysis.part)
            .map_or_else(String::new, |part| trials(protocol, part)),
        figures: of_part(i + 1, analysis),
    };
    parts.iter().enumerate().map(report).collect()
}

/// What a level was set equal to.
fn equal_to(protocol: &Protocol, standard: &ModelId) -> String {
    let level = protocol.level_of(standard);
    level.map_or_else(|| standard.to_string(), |level| level.to_string())
}

/// Sentences on the trials of a part, for the methods.
fn trials(protocol: &Protocol, part: &Part) -> String {
    let mut text = Vec::new();
    match &part.task {
        Task::Rating(_) => {}
        Task::Magnitude(own) => {
            let presented = &own.presentations;
            let is_level = |model| protocol.level_of(model).is_some();
            let (one, many) = match presented.models.iter().any(is_level) {
                true => ("level", "levels"),
                false => ("realization", "realizations"),
            };
            let beside = match &own.standard {
                None => String::new(),
                Some(standard) => {
                    let level = protocol.level_of(&standard.model);
                    let felt = level.map_or(standard.model.to_string(), |level| level.to_string());
                    format!(" after the standard {felt}, whose number was {}", standard.modulus)
                }
            };
            text.push(format!(
                "In each trial one of {} was felt{beside} and given a number above 0, each {one} in {}.",
                counted(presented.models.len(), one, many),
                counted(presented.repetitions as usize, "trial", "trials")
            ));
        }
        Task::Mushra(own) => {
            let presented = &own.presentations;
            let reference = match &own.reference {
                Some(id) => format!("after {id} as the reference"),
                None => "beside a real reference".to_owned(),
            };
            text.push(format!(
                "In each trial one of {} was rated from 0 to 100 {reference}, each in {}; a hidden reference was among them \
                 (after ITU-R BS.1534-3, one at a time).",
                counted(presented.models.len(), "realization", "realizations"),
                counted(presented.repetitions as usize, "trial", "trials")
            ));
        }
        Task::Identification(own) => {
            let presented = &own.presentations;
            let told = match own.feedback {
                Feedback::Never => "participants were not told which label was correct",
                Feedback::Always => {
                    "participants were told after each trial which label was correct"
                }
                Feedback::Practice if presented.practice.is_empty() => {
                    "participants were not told which label was correct"
                }
                Feedback::Practice => {
                    "participants were told after each practice trial which label was correct"
                }
            };
            text.push(format!(
                "In each trial one of {} was felt and given one of {}, each in {}; {told}.",
                counted(presented.models.len(), "realization", "realizations"),
                counted(own.labels.len(), "label", "labels"),
                counted(presented.repetitions as usize, "trial", "trials")
            ));
            if let Some(Criterion {
                correct,
                of,
                rounds,
                draw,
            }) = own.criterion
            {
                let most = presented.practice.len() * rounds as usize;
                let drawn = match draw {
                    Drawn::Rounds => "each of its trials came once in a round",
                    Drawn::Independent => "its trials were drawn independently",
                };
                text.push(format!(
                    "Practice went on until {correct} of the last {of} answers were correct, for {} at most; {drawn}.",
                    counted(most, "trial", "trials")
                ));
            }
        }
        Task::Pairs(pairs) => {
            let order = match pairs.interval_order {
                IntervalOrder::Balanced => "each pair in both orders in turn",
                IntervalOrder::Random => "the order of a pair was drawn for each trial",
            };
            let tie = if pairs.tie {
                "“no difference” was an answer"
            } else {
                "there was no tie"
            };
            text.push(format!(
                "In each trial two realizations were felt one after the other and one was chosen: {}, {} each; \
                 {order}; {tie}.",
                counted(pairs.pairs.len(), "pair", "pairs"),
                counted(pairs.repetitions as usize, "trial", "trials")
            ));
        }
        Task::Discrimination { tracks } => {
            let tracks = tracks.iter().filter_map(|id| protocol.track(id));
            text.extend(tracks.map(|track| track_in_words(protocol, track)));
        }
        Task::Similarity(own) => {
            let identical = match own.identical {
                true => "each was also compared with itself",
                false => "none was compared with itself",
            };
            let practice = match own.practice {
                0 => String::new(),
                n => format!(
                    " {} with pairs that were drawn came before.",
                    counted(n as usize, "practice trial", "practice trials")
                ),
            };
            text.push(format!(
                "In each trial two of {} were felt one after the other, and how different they were was rated from 0 to 100: \
                 {}, {} each, in both orders in turn; {identical}.{practice}",
                counted(own.models.len(), "realization", "realizations"),
                match own.different.len() == own.possible() {
                    true => counted(own.possible(), "pair", "pairs"),
                    false => format!("{} of the {} pairs", own.different.len(), own.possible()),
                },
                counted(own.repetitions as usize, "trial", "trials")
            ));
        }
        Task::Ranking(own) => {
            let ties = match own.ties {
                true => "several could have the same rank",
                false => "no two had the same rank",
            };
            let practice = match own.practice {
                0 => String::new(),
                n => format!(
                    " {} came before.",
                    counted(n as usize, "practice trial", "practice trials")
                ),
            };
            text.push(format!(
                "In each of {} all of {} were felt one after another, and then each was given its rank; {ties}.{practice}",
                counted(own.repetitions as usize, "trial", "trials"),
                counted(own.models.len(), "realization", "realizations")
            ));
        }
        Task::Adjustment(own) => {
            let practice = match own.practice {
                0 => String::new(),
                n => format!(
                    " {} came before.",
                    counted(n as usize, "practice trial", "practice trials")
                ),
            };
            text.push(format!(
                "In each trial a level of {} was set, one step of its {} at a time, until it felt {}: {} from below and as many from \
                 above, in random order. The levels at which trials started were drawn.{practice}",
                own.family,
                counted(own.models.len(), "level", "levels"),
                match &own.standard {
                    Some(standard) => format!("equal to {}", equal_to(protocol, standard)),
                    None => "as it should".to_owned(),
                },
                counted(own.repetitions as usize, "setting", "settings")
            ));
        }
        Task::Search(own) => text.push(format!(
            "In each of {} two points of the space {} were felt one after the other and one was chosen; the pairs were {}. \
             Which of the two came first was drawn for each trial.",
            counted(own.rule.trials as usize, "trial", "trials"),
            own.space,
            search_rule(&own.rule)
        )),
    }
    if let Task::Adjustment(own) = &part.task {
        text.push(levels(part, own));
        return text.join(" ");
    }
    let exposure = &part.exposure;
    let mut felt = match part.gap_s > 0.0 {
        true => format!("Intervals were {} s apart.", part.gap_s),
        false => String::new(),
    };
    match (exposure.min_s > 0.0, exposure.max_s) {
        (true, Some(most)) => {
            felt += &format!(" Each was felt for {} to {most} s.", exposure.min_s);
        }
        (true, None) => felt += &format!(" Each was felt for at least {} s.", exposure.min_s),
        (false, Some(most)) => felt += &format!(" Each was felt for at most {most} s."),
        (false, None) => {}
    }
    felt += &match exposure.replays {
        0 => " Nothing could be felt again.".to_owned(),
        1 => " A trial could be felt again once.".to_owned(),
        n => format!(
            " A trial could be felt again {}.",
            counted(n as usize, "time", "times")
        ),
    };
    text.push(felt.trim_start().to_owned());
    text.join(" ")
}

/// How the levels that are set follow one another.
fn levels(part: &Part, own: &Adjustment) -> String {
    let exposure = &part.exposure;
    let mut text = format!("Levels were {} s apart. Each could be changed ", part.gap_s);
    text += &match exposure.min_s > 0.0 {
        true => format!("at once, and confirmed after {} s", exposure.min_s),
        false => "or confirmed at once".to_owned(),
    };
    if let Some(most) = exposure.max_s {
        text += &format!("; it was felt for at most {most} s at a time");
    }
    text += match own.standard {
        Some(_) => ". The standard could be felt again at any time.",
        None => ".",
    };
    text
}

/// How the pairs of a search are chosen.
pub fn search_rule(rule: &SearchRule) -> String {
    match rule.choose {
        Choose::PreferenceGp { start, acquire } => {
            let then = match acquire {
                Acquire::Challenger => {
                    "the best point so far and the one that may be better by most"
                }
                Acquire::Eubo => {
                    "those with the largest expected utility of the better point (EUBO)"
                }
            };
            format!(
                "the first {start} of a Sobol sequence, then {then}, by a Gaussian process of the participant's answers"
            )
        }
        Choose::Sobol => "those of a Sobol sequence".to_owned(),
        Choose::Random => "drawn at random".to_owned(),
    }
}

/// What a track compares, and by which rule.
pub fn track_in_words(protocol: &Protocol, track: &TrackRules) -> String {
    let compared = match &track.compared {
        Compared::Models { models } => format!("{} against the standard {}", models[1], models[0]),
        Compared::Levels { family, standard } => {
            let levels = protocol.ladder(track);
            let levels = levels.levels();
            let unit = protocol.family(family).and_then(|f| f.unit.clone());
            let unit = unit.map_or_else(String::new, |u| format!(" {u}"));
            let first = levels.first().copied().unwrap_or_default();
            let last = levels.last().copied().unwrap_or_default();
            let number = counted(levels.len(), "level", "levels");
            match track.relative {
                None => format!(
                    "{family} at {number} from {first} to {last}{unit} against the standard {standard}{unit}"
                ),
                Some(Relative::Increment) => format!(
                    "{family} at {number}, {first} to {last}{unit} above the standard {standard}{unit}"
                ),
                Some(Relative::Fraction) => format!(
                    "{family} at {number}, {first} to {last} of the standard {standard}{unit} above it"
                ),
            }
        }
    };
    let rule = match &track.rule {
        Rule::Staircase(rule) => format!(
            "a {}-up-{}-down staircase that stops after {} reversals, {} trials at most",
            rule.up, rule.down, rule.stop.reversals, rule.stop.max_trials
        ),
        Rule::QuestPlus(rule) => format!("QUEST+ with {} trials", rule.trials),
        Rule::Constant(rule) => format!("constant stimuli in {} trials", rule.trials()),
    };
    let share = |share: f64, what: &str| match share > 0.0 {
        true => format!(", {:.0} % {what} trials", 100.0 * share),
        false => String::new(),
    };
    format!(
        "Track {} ({}): {compared}, by {rule}{}{}; {} feedback.",
        track.id,
        track.method.as_str(),
        share(track.easy, "easy"),
        share(track.catch, "catch"),
        if track.feedback { "with" } else { "no" }
    )
}
