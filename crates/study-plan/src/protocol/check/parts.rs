//! Number of trials, duration, and doubtful designs of studies with parts.

use super::{Spans, adjustments, answers_s, counted_out, maps, pace};
use crate::procedure::{Rule, Staircase};
use crate::protocol::{
    DeviceKind, Identification, IntervalOrder, Magnitude, Method, Mushra, Order, Part, Protocol,
    Question, Role, Task, TrackRules,
};
use study_base::apa;
use study_base::diagnostic::Fault;
use study_base::text::{ModelId, PartId, counted};
use study_stats::level::rejects;
use study_stats::ranking::smallest_p;

/// Fewest levels of a magnitude estimation that need no warning.
const MAGNITUDE_LEVELS: usize = 5;
/// Fewest trials of an adaptive track that need no warning: the threshold is then known
/// to about half the standard deviation of the noise.
const TRACK_TRIALS: u32 = 30;
/// The same for each of the constant stimuli.
const TRIALS_OF_A_LEVEL: u32 = 20;
/// The same for the catch trials of a track.
const CATCH_TRIALS: f64 = 10.0;
/// The same for each axis of a search.
const PAIRS_OF_AN_AXIS: u32 = 10;
/// The same for the reversals of a staircase.
const REVERSALS: u32 = 6;

/// The most trials of a track, catch and easy trials included.
fn track_trials(track: &TrackRules) -> u32 {
    let ruled = f64::from(track.rule.most_trials());
    (ruled / (1.0 - track.catch - track.easy)).round() as u32
}

fn tracks<'p>(protocol: &'p Protocol, ids: &'p [PartId]) -> impl Iterator<Item = &'p TrackRules> {
    ids.iter().filter_map(|id| protocol.track(id))
}

/// The most trials of a part, practice included.
pub(super) fn trials(protocol: &Protocol, part: &Part) -> u32 {
    let all = |n: usize, repetitions: u32| {
        let n = u32::try_from(n).unwrap_or(u32::MAX);
        n.saturating_mul(repetitions)
    };
    match &part.task {
        Task::Rating(own)
        | Task::Magnitude(Magnitude {
            presentations: own, ..
        })
        | Task::Mushra(Mushra {
            presentations: own, ..
        }) => all(own.models.len(), own.repetitions) + all(own.practice.len(), 1),
        Task::Identification(Identification {
            presentations: own,
            criterion,
            ..
        }) => {
            let rounds = criterion.map_or(1, |c| c.rounds);
            all(own.models.len(), own.repetitions) + all(own.practice.len(), rounds)
        }
        Task::Pairs(own) => all(own.pairs.len(), own.repetitions),
        Task::Discrimination { tracks: ids } => tracks(protocol, ids).map(track_trials).sum(),
        Task::Search(own) => own.rule.trials,
        Task::Similarity(own) => {
            all(own.pairs().pairs.len(), own.repetitions).saturating_add(own.practice)
        }
        Task::Ranking(own) => own.repetitions.saturating_add(own.practice),
        Task::Adjustment(own) => all(2, own.repetitions).saturating_add(own.practice),
    }
}

/// Estimated duration of a part without breaks, s. `reference_s` is that of the reference
/// before each trial.
pub(super) fn seconds(protocol: &Protocol, part: &Part, reference_s: f64) -> f64 {
    let intervals = match &part.task {
        Task::Rating(_) | Task::Identification(_) => 1,
        Task::Magnitude(_) | Task::Mushra(_) => 1 + usize::from(part.task.reference().is_some()),
        Task::Pairs(_) | Task::Search(_) | Task::Similarity(_) => 2,
        Task::Ranking(own) => own.models.len(),
        Task::Discrimination { tracks: ids } => tracks(protocol, ids)
            .map(|track| track.method.sequences()[0].len())
            .max()
            .unwrap_or(1),
        // The first level, and those after each change.
        Task::Adjustment(own) => 1 + own.usual_changes() + usize::from(own.standard.is_some()),
    } as f64;
    let free_s = match &part.task {
        Task::Rating(_) => pace::EXPLORE_S,
        Task::Magnitude(_)
        | Task::Mushra(_)
        | Task::Identification(_)
        | Task::Pairs(_)
        | Task::Discrimination { .. }
        | Task::Search(_)
        | Task::Similarity(_)
        | Task::Ranking(_) => pace::COMPARE_S,
        Task::Adjustment(_) => pace::STEP_S,
    };
    let felt_s = part.exposure.max_s.map_or(free_s, |max| max.min(free_s));
    let load_s = match protocol.device.kind {
        DeviceKind::Manual => pace::MOUNT_S,
        DeviceKind::Simulated | DeviceKind::Serial | DeviceKind::Process => pace::LOAD_S,
    };
    // A level that was set is not asked.
    let set = usize::from(part.task.adjustment().is_some());
    let asked: Vec<Question> = (part.asks.iter().skip(set))
        .filter_map(|id| protocol.questions.iter().find(|q| q.id == *id).cloned())
        .collect();
    let gaps_s = (intervals - 1.0) * part.gap_s;
    let trial_s = reference_s + load_s + intervals * felt_s + gaps_s + answers_s(&asked);
    f64::from(trials(protocol, part)) * trial_s
}

/// All warnings about parts and tracks.
pub(super) fn warnings(protocol: &Protocol, spans: &Spans, faults: &mut Vec<Fault>) {
    for (i, model) in protocol.models.iter().enumerate() {
        if !presented(protocol, &model.id) {
            let what = format!("`{}` is never played: no part presents it", model.id);
            let place = spans.get(&format!("models[{i}].id")).cloned();
            faults.push(Fault::warning(what).at(place));
        }
    }
    for (i, part) in protocol.parts.iter().enumerate() {
        let place = spans.get(&format!("parts[{i}].id")).cloned();
        let doubts = [
            magnitudes(protocol, part),
            unsaid_modulus(protocol, part),
            few_names(protocol, part),
            counted_out::trials(part),
            counted_out::practice(part),
            one_order(part),
            few_pairs(protocol, part),
            few_rankers(protocol, part),
            one_ranked_order(part),
        ];
        let doubts = doubts.into_iter().flatten();
        let doubts = doubts.chain(maps::doubts(protocol, part));
        let doubts = doubts.chain(adjustments::doubts(part));
        faults.extend(doubts.map(|fault| fault.at(place.clone())));
    }
    for (i, track) in protocol.tracks.iter().enumerate() {
        let place = spans.get(&format!("tracks[{i}].id")).cloned();
        let doubts = [
            few_trials(track),
            target(track),
            one_side(protocol, track),
            catch(track),
        ];
        for fault in doubts.into_iter().flatten() {
            faults.push(fault.at(place.clone()));
        }
    }
}

fn presented(protocol: &Protocol, model: &ModelId) -> bool {
    let by_track = protocol.tracks.iter().any(|track| {
        let compared = protocol.comparison(track, 0);
        track.standard() == *model || compared.as_ref() == Some(model)
    });
    let by_part = protocol.parts.iter().any(|part| match &part.task {
        Task::Pairs(own) => own.pairs.iter().any(|pair| pair.contains(model)),
        Task::Similarity(own) => own.models.contains(model),
        Task::Ranking(own) => own.models.contains(model),
        task => {
            let own = task.presentations();
            own.is_some_and(|own| own.models.contains(model) || own.practice.contains(model))
                || task.reference() == Some(model)
        }
    });
    by_track || by_part
}

/// Whether realizations are rated or compared, so that their number matters. A study that confirms what a search found is
/// about those two.
pub fn is_about_realizations(protocol: &Protocol) -> bool {
    let about = |part: &Part| match &part.task {
        Task::Discrimination { .. } | Task::Identification(_) | Task::Search(_) => false,
        // A map has what distinguishes the realizations as its axes, whatever that is.
        Task::Similarity(_) | Task::Adjustment(_) => false,
        Task::Magnitude(own) => {
            let models = &own.presentations.models;
            models.iter().all(|m| protocol.level_of(m).is_none())
        }
        Task::Ranking(own) => own.models.iter().all(|m| protocol.level_of(m).is_none()),
        Task::Rating(_) | Task::Mushra(_) | Task::Pairs(_) => true,
    };
    let tested = protocol.models.iter().any(|m| m.role == Role::Test);
    let compares = protocol.parts.is_empty() || (protocol.parts.iter().any(about) && tested);
    compares && protocol.confirms.is_none() && !protocol.only_asks()
}

/// Too few levels for an exponent, or levels that it leaves out.
fn magnitudes(protocol: &Protocol, part: &Part) -> Option<Fault> {
    let Task::Magnitude(own) = &part.task else {
        return None;
    };
    let levels = &own.presentations.models;
    let levels: Vec<f64> = (levels.iter())
        .filter_map(|id| protocol.level_of(id))
        .collect();
    if levels.is_empty() {
        return None;
    }
    let id = &part.id;
    if levels.iter().any(|level| *level <= 0.0) {
        let what = format!("the exponent of the part `{id}` leaves out levels of 0 and less");
        return Some(Fault::warning(what).hint("take levels above 0"));
    }
    (levels.len() < MAGNITUDE_LEVELS).then(|| {
        Fault::warning(format!(
            "the part `{id}` has {} levels: an exponent of fewer than {MAGNITUDE_LEVELS} is uncertain",
            levels.len()
        ))
    })
}

/// A prompt that does not say the number of the standard.
fn unsaid_modulus(protocol: &Protocol, part: &Part) -> Option<Fault> {
    let Task::Magnitude(own) = &part.task else {
        return None;
    };
    let modulus = own.standard.as_ref()?.modulus.to_string();
    let asked = (protocol.questions.iter()).find(|q| Some(&q.id) == part.asks.first())?;
    let said = [Some(&asked.prompt), part.text.as_ref()];
    let numbers = |text: &String| {
        let digit = |c: char| !(c.is_ascii_digit() || c == '.' || c == ',');
        let mut words = text.split(digit);
        words.any(|word| word.trim_matches(['.', ',']).replace(',', ".") == modulus)
    };
    (!said.into_iter().flatten().any(numbers)).then(|| {
        let what = format!(
            "neither `prompt` nor `text` of the part `{}` says {modulus}, the number of the standard",
            part.id
        );
        Fault::warning(what).hint("participants have to know it")
    })
}

/// So few trials that information transfer is uncertain, although its bias is corrected.
fn few_names(protocol: &Protocol, part: &Part) -> Option<Fault> {
    let own = part.task.identification()?;
    let presented = &own.presentations;
    let of_each = presented.models.len() * presented.repetitions as usize;
    let trials = of_each.saturating_mul(protocol.design.participants as usize);
    let what = own.too_few(trials)?;
    let fault = Fault::warning(format!("the part `{}`: {what}", part.id));
    Some(fault.hint("raise repetitions or participants"))
}

/// Pairs whose trials do not have both orders equally often.
fn one_order(part: &Part) -> Option<Fault> {
    let Task::Pairs(own) = &part.task else {
        return None;
    };
    let uneven = own.interval_order == IntervalOrder::Balanced && own.repetitions % 2 == 1;
    uneven.then(|| {
        let what = format!(
            "`repetitions = {}`: nobody has both orders of a pair of `{}` equally often",
            own.repetitions, part.id
        );
        Fault::warning(what).hint("take an even number; the orders are balanced over two rows")
    })
}

/// A search that ends before its model has learned anything of the space.
fn few_pairs(protocol: &Protocol, part: &Part) -> Option<Fault> {
    let (space, rule) = protocol.searched(part)?;
    let least = PAIRS_OF_AN_AXIS * space.axes.len() as u32;
    (rule.trials < least).then(|| {
        Fault::warning(format!(
            "the search `{}` has {} trials: {least} and more are needed for {}",
            part.id,
            rule.trials,
            counted(space.axes.len(), "axis", "axes")
        ))
        .hint("docs/search.md shows how near the best point a search comes")
    })
}

/// So few participants and realizations that no agreement is beyond chance. One participant agrees with nobody.
fn few_rankers(protocol: &Protocol, part: &Part) -> Option<Fault> {
    let Task::Ranking(own) = &part.task else {
        return None;
    };
    let people = protocol.design.participants as usize;
    let least = smallest_p(own.models.len(), people);
    (people > 1 && !rejects(least, protocol.analysis.alpha())).then(|| {
        let what = format!(
            "the part `{}` has {people} participants who rank {} realizations: even if all rank alike, p {}",
            part.id,
            own.models.len(),
            apa::p(least)
        );
        Fault::warning(what).hint("add participants or realizations")
    })
}

/// Ranks of realizations that everybody feels in the same order may be due to it.
fn one_ranked_order(part: &Part) -> Option<Fault> {
    let Task::Ranking(own) = &part.task else {
        return None;
    };
    (own.order == Order::Fixed).then(|| {
        let what = format!(
            "everybody feels the realizations of `{}` in the same order: whether ranks follow it or them cannot be told",
            part.id
        );
        Fault::warning(what).hint("take \"blocked\", \"williams\" or \"latin-square\"")
    })
}

fn few_trials(track: &TrackRules) -> Option<Fault> {
    let id = &track.id;
    let trials = track.rule.most_trials();
    let what = match &track.rule {
        Rule::Staircase(rule) if rule.stop.reversals < REVERSALS => format!(
            "the track `{id}` stops after {} reversals: {REVERSALS} or more are usual",
            rule.stop.reversals
        ),
        Rule::Staircase(rule) if rule.stop.reversals < rule.estimate_last => format!(
            "the estimate of the track `{id}` is the mean of {} reversals, and it stops after {}",
            rule.estimate_last, rule.stop.reversals
        ),
        Rule::Staircase(rule) if rule.estimate_last % 2 == 1 => format!(
            "the estimate of the track `{id}` is the mean of an odd number of reversals, {}: the peaks or the valleys weigh more",
            rule.estimate_last
        ),
        Rule::QuestPlus(_) | Rule::Staircase(_) if trials < TRACK_TRIALS => format!(
            "the track `{id}` has at most {trials} trials: about 40 give a threshold to half the noise"
        ),
        // Of two realizations there is no curve to fit.
        Rule::Constant(rule)
            if rule.repetitions < TRIALS_OF_A_LEVEL && track.family().is_some() =>
        {
            format!(
                "the track `{id}` has {} trials of each level: 20 to 40 are usual",
                rule.repetitions
            )
        }
        Rule::Constant(_) | Rule::QuestPlus(_) | Rule::Staircase(_) => return None,
    };
    Some(Fault::warning(what))
}

/// A rule that settles near the share of correct answers by guessing.
fn target(track: &TrackRules) -> Option<Fault> {
    let (Rule::Staircase(rule), Some(guess)) = (&track.rule, track.method.guess_rate()) else {
        return None;
    };
    let target = Staircase::target(rule)?;
    (target < guess + 0.1).then(|| {
        Fault::warning(format!(
            "the track `{}` settles at {:.0} % correct, and guessing gives {:.0} %",
            track.id,
            100.0 * target,
            100.0 * guess
        ))
        .hint("such as up = 1, down = 3 for 79 %")
    })
}

/// Levels on both sides of the standard, where the share of correct answers does not rise
/// with the level.
fn one_side(protocol: &Protocol, track: &TrackRules) -> Option<Fault> {
    let standard = track.counted_standard()?;
    let below = protocol.ladder(track).first() < standard;
    let modeled = matches!(track.rule, Rule::QuestPlus(_));
    (below && modeled && track.method != Method::YesNo).then(|| {
        Fault::warning(format!(
            "levels below the standard of the track `{}`: its function rises with the level, and there the share of correct answers falls",
            track.id
        ))
        .hint("begin the family at the standard, or count levels from it: relative = \"increment\"")
    })
}

fn catch(track: &TrackRules) -> Option<Fault> {
    let planned = f64::from(track_trials(track)) * track.catch;
    let needed = !track.method.catch_sequences().is_empty();
    (needed && planned < CATCH_TRIALS).then(|| {
        Fault::warning(format!(
            "the track `{}` has {planned:.0} catch trials: fewer than 10 do not tell the share of false alarms",
            track.id
        ))
    })
}
