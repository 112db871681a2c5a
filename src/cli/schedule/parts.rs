//! The orders of a study with parts, part by part, and their balance. Levels of tracks are
//! not known before the answers.

use super::table::{Codes, headline, legend, orders, rows_shown, section};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use study_base::text::{ModelId, PartId, Untrusted, counted};
use study_plan::procedure::{Rule, Staircase};
use study_plan::protocol::{
    Adjustment, Identification, Interval, IntervalOrder, Magnitude, Mushra, Pairs, Part,
    PartsOrder, Protocol, Ranking, SearchTask, Stimuli, Task, TrackRules, Trial,
};
use study_report::study::search_rule;

/// The orders of some rows.
type Plans = [(u32, Vec<Trial>)];

/// The text of `study schedule`: the orders of each part, and how balanced they are.
pub(super) fn render(protocol: &Protocol, plans: &Plans, width: usize) -> String {
    let mut out = format!("{}\n", Untrusted(&protocol.study.title));
    let most = if protocol.is_adaptive() {
        " at most"
    } else {
        ""
    };
    let trials = plans.iter().map(|(_, plan)| plan.len()).max().unwrap_or(0);
    let parts = counted(protocol.parts.len(), "part", "parts");
    let order = match protocol.design.parts_order {
        PartsOrder::Fixed => "",
        PartsOrder::Williams => ", in the lines of a Williams design by row",
    };
    let trials = counted(trials, "trial", "trials");
    let _ = writeln!(out, "{parts}{order}, {trials}{most}");
    if protocol.design.parts_order == PartsOrder::Williams {
        for (row, plan) in plans {
            let mut ids: Vec<&str> = plan
                .iter()
                .filter_map(|t| Some(t.part.as_ref()?.as_str()))
                .collect();
            ids.dedup();
            let _ = writeln!(out, "row {row}: {}", ids.join(", "));
        }
    }
    for part in &protocol.parts {
        let own = of_part(&part.id, plans);
        let _ = writeln!(out, "\nPart {}", part.id);
        match &part.task {
            Task::Rating(task)
            | Task::Magnitude(Magnitude {
                presentations: task,
                ..
            })
            | Task::Mushra(Mushra {
                presentations: task,
                ..
            })
            | Task::Identification(Identification {
                presentations: task,
                ..
            }) => {
                let design = protocol.design_of(Some(&part.id));
                if let Some(reference) = part.task.reference() {
                    let _ = writeln!(out, "{reference} is felt first in each trial");
                }
                let named = part.task.identification();
                let criterion = named.and_then(|own| own.criterion);
                section(
                    &mut out,
                    protocol,
                    (&design, criterion),
                    &task.models,
                    &own,
                    width,
                );
            }
            Task::Pairs(task) => pairs(&mut out, protocol, part, task, &own, width),
            Task::Discrimination { tracks: ids } => {
                let rules = ids.iter().filter_map(|id| protocol.track(id));
                tracks(&mut out, &rules.collect::<Vec<_>>(), &own, width);
            }
            Task::Search(task) => search(&mut out, task, &own, width),
            Task::Similarity(task) => {
                if task.practice > 0 {
                    let trials = counted(task.practice as usize, "pair", "pairs");
                    let _ = writeln!(out, "Practice, before every order: {trials}, drawn");
                }
                pairs(&mut out, protocol, part, &task.pairs(), &own, width);
            }
            Task::Ranking(task) => ranking(&mut out, protocol, part, task, &own, width),
            Task::Adjustment(task) => adjustment(&mut out, protocol, task, &own, width),
        }
    }
    out
}

/// The trials of a part, with blocks and positions that count from 1.
fn of_part(part: &PartId, plans: &Plans) -> Vec<(u32, Vec<Trial>)> {
    let own = |(row, plan): &(u32, Vec<Trial>)| {
        let mut trials: Vec<Trial> = (plan.iter())
            .filter(|t| t.part.as_ref() == Some(part))
            .cloned()
            .collect();
        let counted = || trials.iter().filter(|t| !t.practice);
        let block = counted().map(|t| t.block).min().unwrap_or(1) - 1;
        let position = counted().map(|t| t.position).min().unwrap_or(1) - 1;
        for trial in trials.iter_mut().filter(|t| !t.practice) {
            trial.block -= block;
            trial.position -= position;
        }
        (*row, trials)
    };
    // A group can be without it.
    let all = plans.iter().map(own);
    all.filter(|(_, trials)| !trials.is_empty()).collect()
}

/// The order of pairs, and how often each one comes in both orders.
fn pairs(
    out: &mut String,
    protocol: &Protocol,
    part: &Part,
    task: &Pairs,
    plans: &Plans,
    width: usize,
) {
    let mut models: Vec<ModelId> = Vec::new();
    for model in task.pairs.iter().flatten() {
        if !models.contains(model) {
            models.push(model.clone());
        }
    }
    let codes = Codes::of(&models);
    let design = protocol.design_of(Some(&part.id));
    let headline = headline(&design, task.pairs.len(), "pairs");
    let order = task.interval_order.as_str();
    let _ = writeln!(out, "{headline}, order of the two {order}");
    legend(out, protocol, &models, &codes);
    let named = |[a, b]: &[ModelId; 2]| format!("{}-{}", codes.of_model(a), codes.of_model(b));
    let code = |trial: &Trial| match &trial.stimuli {
        Stimuli::Pair { pair } => named(pair),
        _ => String::new(),
    };
    orders(out, plans, 2 * codes.width() + 1, width, code);
    let Some(rows) = rows_shown(plans) else {
        return;
    };
    let mut times: BTreeMap<String, u32> = BTreeMap::new();
    let trials = plans.iter().flat_map(|(_, plan)| plan);
    for trial in trials.filter(|t| !t.practice) {
        *times.entry(code(trial)).or_default() += 1;
    }
    let _ = writeln!(out, "\nOccurrences of each pair in both orders, {rows}");
    let mut uneven = 0;
    for [a, b] in &task.pairs {
        if a == b {
            let there = named(&[a.clone(), b.clone()]);
            let n = times.get(&there).copied().unwrap_or(0);
            let _ = writeln!(out, "  {there} {n}");
            continue;
        }
        let there = [
            named(&[a.clone(), b.clone()]),
            named(&[b.clone(), a.clone()]),
        ];
        let [first, second] = there
            .clone()
            .map(|pair| times.get(&pair).copied().unwrap_or(0));
        uneven += u32::from(first != second);
        let _ = writeln!(out, "  {} {first}   {} {second}", there[0], there[1]);
    }
    let words = match (uneven, task.interval_order) {
        (0, _) => "Order of the two: balanced over these rows.".to_owned(),
        (n, IntervalOrder::Random) => {
            format!(
                "Order of the two: drawn for each trial; {n} of {} pairs are not balanced over these rows.",
                task.pairs.len()
            )
        }
        (n, IntervalOrder::Balanced) => {
            format!(
                "Order of the two: {n} of {} pairs are not balanced over these rows; an even number of repetitions or of rows balances them.",
                task.pairs.len()
            )
        }
    };
    let _ = writeln!(out, "\n{words}");
}

/// The order within each trial, and how balanced it is: a trial is a block of what is felt in it.
fn ranking(
    out: &mut String,
    protocol: &Protocol,
    part: &Part,
    task: &Ranking,
    plans: &Plans,
    width: usize,
) {
    let trials = counted(task.repetitions as usize, "trial", "trials");
    let _ = writeln!(
        out,
        "{trials}, in each of which all are felt: a block below"
    );
    if task.practice > 0 {
        let trials = counted(task.practice as usize, "trial", "trials");
        let _ = writeln!(
            out,
            "Practice, before every order: {trials}, in orders that are drawn"
        );
    }
    let felt = |(row, plan): &(u32, Vec<Trial>)| {
        let mut felt: Vec<Trial> = Vec::new();
        for trial in plan.iter().filter(|t| !t.practice) {
            let Stimuli::Set { set } = &trial.stimuli else {
                continue;
            };
            for model in set {
                felt.push(Trial {
                    position: u32::try_from(felt.len() + 1).unwrap_or(u32::MAX),
                    stimuli: Stimuli::One {
                        model: model.clone(),
                    },
                    ..trial.clone()
                });
            }
        }
        (*row, felt)
    };
    let felt: Vec<(u32, Vec<Trial>)> = plans.iter().map(felt).collect();
    let design = protocol.design_of(Some(&part.id));
    section(out, protocol, (&design, None), &task.models, &felt, width);
}

/// Which point of each pair comes first; the pairs themselves follow from the answers.
fn search(out: &mut String, task: &SearchTask, plans: &Plans, width: usize) {
    let trials = counted(task.rule.trials as usize, "pair", "pairs");
    let _ = writeln!(
        out,
        "{trials} of the space {}: {}",
        task.space,
        search_rule(&task.rule)
    );
    out.push_str("1 the point with the lower number comes first, 2 the other\n\n");
    let code = |trial: &Trial| match &trial.stimuli {
        Stimuli::Search { swapped, .. } => if *swapped { "2" } else { "1" }.to_owned(),
        _ => String::new(),
    };
    orders(out, plans, 1, width, code);
    out.push_str("\nPairs follow from the answers; docs/search.md says how.\n");
}

/// At which level each setting starts; the others follow from the participant.
fn adjustment(
    out: &mut String,
    protocol: &Protocol,
    task: &Adjustment,
    plans: &Plans,
    width: usize,
) {
    let settings = counted(task.repetitions as usize, "setting", "settings");
    let _ = writeln!(
        out,
        "{settings} of {} from below, and as many from above",
        task.family
    );
    if let Some(standard) = &task.standard {
        let _ = writeln!(out, "{standard} is felt first in each trial");
    }
    if task.practice > 0 {
        let trials = counted(task.practice as usize, "trial", "trials");
        let _ = writeln!(out, "Practice, before every order: {trials}, drawn");
    }
    let starts: Vec<ModelId> = task.below.iter().chain(&task.above).cloned().collect();
    let codes = Codes::of(&starts);
    legend(out, protocol, &starts, &codes);
    let code = |trial: &Trial| match &trial.stimuli {
        Stimuli::Adjusted { start, .. } => codes.of_model(start).to_owned(),
        _ => String::new(),
    };
    orders(out, plans, codes.width(), width, code);
    out.push_str("\nEach trial starts at this level; what follows is set by the participant.\n");
}

/// The order of tracks and of the intervals of their trials, and how often each sequence
/// of intervals comes.
fn tracks(out: &mut String, tracks: &[&TrackRules], plans: &Plans, width: usize) {
    let names: Vec<String> = (0..tracks.len()).map(track_code).collect();
    for (name, track) in names.iter().zip(tracks) {
        let _ = writeln!(
            out,
            "{name}  {}: {}, {}",
            track.id,
            track.method.as_str(),
            rule(&track.rule)
        );
    }
    out.push_str("S standard, C comparison, * an easy trial\n\n");
    let at = |track: &PartId| tracks.iter().position(|t| t.id == *track);
    let code = |trial: &Trial| match &trial.stimuli {
        Stimuli::Track {
            track,
            easy,
            intervals: all,
        } => {
            let name = at(track).map_or("", |at| names[at].as_str());
            format!("{name}{}{}", intervals(all), if *easy { "*" } else { "" })
        }
        _ => String::new(),
    };
    let all = || plans.iter().flat_map(|(_, plan)| plan);
    let cell = all().map(|trial| code(trial).len()).max().unwrap_or(1);
    orders(out, plans, cell, width, code);
    let Some(rows) = rows_shown(plans) else {
        return;
    };
    let _ = writeln!(
        out,
        "\nTrials of each track and sequence of intervals at most, {rows}"
    );
    for (name, track) in names.iter().zip(tracks) {
        let mut sequences: BTreeMap<String, u32> = BTreeMap::new();
        let (mut trials, mut easy_trials, mut catch) = (0, 0, 0);
        for trial in all() {
            let Stimuli::Track {
                track: of,
                easy,
                intervals: own,
            } = &trial.stimuli
            else {
                continue;
            };
            if *of == track.id {
                *sequences.entry(intervals(own)).or_default() += 1;
                trials += 1;
                easy_trials += u32::from(*easy);
                catch += u32::from(track.method.is_catch(own));
            }
        }
        let of_each: Vec<String> = sequences.iter().map(|(s, n)| format!("{s} {n}")).collect();
        let _ = writeln!(
            out,
            "  {name}  {trials}: {}; easy {easy_trials}, catch {catch}",
            of_each.join(", ")
        );
    }
    out.push_str("\nLevels follow from the answers; --answers FILE replays a track.\n");
}

/// The code of a track: a to z, then numbers.
fn track_code(at: usize) -> String {
    let letter = u8::try_from(at).ok().filter(|at| *at < 26);
    letter.map_or_else(
        || format!("{}:", at + 1),
        |at| char::from(b'a' + at).to_string(),
    )
}

/// A rule in a few words.
fn rule(rule: &Rule) -> String {
    let most = counted(rule.most_trials() as usize, "trial", "trials");
    match rule {
        Rule::Staircase(rule) => {
            let target = Staircase::target(rule)
                .map_or_else(String::new, |p| format!(" (settles at {:.1} %)", 100.0 * p));
            format!(
                "{} up, {} down{target} from {}, {most} at most",
                rule.up, rule.down, rule.start
            )
        }
        Rule::QuestPlus(rule) if rule.entropy_below.is_some() || rule.sd_below.is_some() => {
            format!("QUEST+, {most} at most")
        }
        Rule::QuestPlus(_) => format!("QUEST+, {most}"),
        Rule::Constant(rule) => format!(
            "{} levels × {} repetitions",
            rule.levels.len(),
            rule.repetitions
        ),
    }
}

/// The intervals as letters: `S` standard, `C` comparison.
pub(super) fn intervals(intervals: &[Interval]) -> String {
    let letter = |interval: &Interval| match interval {
        Interval::Standard => 'S',
        Interval::Comparison => 'C',
    };
    intervals.iter().map(letter).collect()
}
