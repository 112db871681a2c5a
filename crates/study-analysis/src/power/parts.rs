//! Parts of pairs and of tracks: answers are drawn one by one, and decided by the analysis of
//! such parts.
//!
//! **Pairs.** The ability of a realization is slope·x + scatter + what a participant adds, in
//! logits; P(first preferred) follows from the difference (Bradley and Terry), with ties by
//! Davidson's model.
//!
//! **Tracks.** A participant's threshold on a track is the assumed one times the participant's
//! factor and that of the track (for levels without ratios, sums); the track is run by its own
//! rule. Two realizations have a d′ in place of a threshold.

use super::decide::{Outcome, UNDEFINED};
use super::draw::standardized;
use super::factors::{FactorsJudge, FactorsWorld};
use super::{Cell, STREAM, Settings, Test};
use crate::analyze::psychophysics::{
    Asked, Choice, PartFinding, Preference, TrialCount, TrialSettings, decided,
};
use std::f64::consts::SQRT_2;
use study_base::rng::Stream;
use study_plan::procedure::{Answer, Ladder, Track};
use study_plan::protocol::conditions::by_condition;
use study_plan::protocol::parts::{Method, TrackRules};
use study_stats::detection::{
    rates_of_same_different, share_of_abx_by_differencing, share_of_choice, share_of_oddity,
};
use study_stats::distribution::normal_cdf;
use study_stats::permutation::Decision;
use study_stats::psychometric::{Curve, Level};

/// A part that is no rating, or ratings of a factorial study, and what is assumed of it.
#[derive(Debug, Clone, PartialEq)]
pub enum PartWorld {
    /// Ratings, for the effects of factors.
    Factors(FactorsWorld),
    /// Comparisons of realizations.
    Pairs(PairsWorld),
    /// Tracks of levels, or of two realizations.
    Tracks(TracksWorld),
}

/// Comparisons of realizations.
#[derive(Debug, Clone, PartialEq)]
pub struct PairsWorld {
    /// VAF of each realization, where it has one.
    pub vaf: Vec<Option<f64>>,
    /// The pairs, by place.
    pub pairs: Vec<[usize; 2]>,
    /// Share of "no difference" between two that are alike; `None` if it is no answer.
    pub ties: Option<f64>,
    /// Whether the first of a pair is drawn for each trial, not each in turn.
    pub random_order: bool,
}

/// Tracks of a part.
#[derive(Debug, Clone, PartialEq)]
pub struct TracksWorld {
    /// The tracks.
    pub tracks: Vec<TrackWorld>,
    /// Whether levels have ratios, as all but those of a blend.
    pub ratios: bool,
}

/// A track and its participants.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackWorld {
    /// Rules of the track.
    pub rules: TrackRules,
    /// Its levels.
    pub ladder: Ladder,
    /// How its answers are fitted.
    pub settings: TrialSettings,
    /// What is true of participants.
    pub truth: Truth,
}

/// What is true of participants on a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Truth {
    /// The function of the typical participant.
    Function(Curve),
    /// The mean d′ of two realizations.
    Sensitivity(f64),
}

impl TrackWorld {
    fn asked(&self) -> Option<Asked> {
        let name = self.rules.method.as_str();
        Asked::NAMES.iter().find(|n| n.1 == name).map(|n| n.0)
    }
}

/// Decides simulated studies of a part.
pub(super) struct PartJudge<'a> {
    settings: &'a Settings,
    cell: Cell,
    text: String,
    task: Prepared<'a>,
}

/// What all studies of a cell share.
enum Prepared<'a> {
    Factors(FactorsJudge<'a>),
    Pairs {
        world: &'a PairsWorld,
        /// Standardized VAF, 0 where there is none.
        x: Vec<f64>,
        /// The permutation test over the realizations with a VAF.
        permutation: Option<Decision>,
        names: Vec<String>,
    },
    Tracks {
        world: &'a TracksWorld,
        /// The tracks before their first trial; `None` of two realizations.
        fresh: Vec<Option<Track>>,
    },
}

impl<'a> PartJudge<'a> {
    pub(super) fn new(settings: &'a Settings, part: &'a PartWorld, cell: &Cell) -> Self {
        let task = match part {
            PartWorld::Factors(world) => {
                Prepared::Factors(FactorsJudge::new(settings, world, cell))
            }
            PartWorld::Pairs(world) => {
                let known: Vec<f64> = world.vaf.iter().copied().flatten().collect();
                let mut standard = standardized(&known).0.into_iter();
                let x = world.vaf.iter().map(|vaf| match vaf {
                    Some(_) => standard.next().unwrap_or(0.0),
                    None => 0.0,
                });
                Prepared::Pairs {
                    world,
                    x: x.collect(),
                    permutation: Decision::new(&known, settings.alpha),
                    names: (0..world.vaf.len()).map(|i| format!("{i:06}")).collect(),
                }
            }
            PartWorld::Tracks(world) => {
                let fresh = |track: &TrackWorld| match track.truth {
                    // The order of constant stimuli changes no estimate.
                    Truth::Function(_) => {
                        let mut stream = Stream::new(settings.seed, &[STREAM, "track"]);
                        Track::new(&track.rules.rule, &track.ladder, &mut stream).ok()
                    }
                    Truth::Sensitivity(_) => None,
                };
                Prepared::Tracks {
                    world,
                    fresh: world.tracks.iter().map(fresh).collect(),
                }
            }
        };
        Self {
            settings,
            cell: *cell,
            text: cell.canonical(),
            task,
        }
    }

    /// Draws and decides study k.
    pub(super) fn decide(&self, k: u64) -> Outcome {
        let number = k.to_string();
        let stream = |of: &str| Stream::new(self.settings.seed, &[STREAM, &self.text, &number, of]);
        match &self.task {
            Prepared::Factors(judge) => judge.decide(k),
            Prepared::Pairs {
                world,
                x,
                permutation,
                names,
            } => {
                let chosen = self.choices(world, x, names, &mut stream("pairs"));
                self.of_choices(world, &chosen, permutation.as_ref(), stream("permutations"))
            }
            Prepared::Tracks { world, fresh } => {
                self.of_tracks(world, fresh, &mut stream("tracks"), &number)
            }
        }
    }

    /// Whether a participant is lost.
    fn is_lost(&self, draws: &mut Stream) -> bool {
        let dropout = self.settings.assumptions.dropout;
        dropout > 0.0 && draws.unit() < dropout
    }

    fn choices(
        &self,
        world: &PairsWorld,
        x: &[f64],
        names: &[String],
        draws: &mut Stream,
    ) -> Vec<Preference> {
        let a = &self.settings.assumptions;
        let mut chosen = Vec::new();
        let mean = |x: &f64| a.slope * x;
        let means: Vec<f64> = (x.iter())
            .map(|x| mean(x) + a.spread.realization * draws.normal())
            .collect();
        // ν of Davidson's model: two that are alike are tied with ν/(2 + ν).
        let nu = world.ties.map_or(0.0, |share| 2.0 * share / (1.0 - share));
        for i in 0..self.cell.participants {
            let own: Vec<f64> = (means.iter())
                .map(|m| m + a.spread.interaction * draws.normal())
                .collect();
            let lost = self.is_lost(draws);
            for (p, pair) in world.pairs.iter().enumerate() {
                for r in 0..self.cell.repetitions {
                    let turned = match world.random_order {
                        true => draws.unit() < 0.5,
                        false => (i + p + r) % 2 == 1,
                    };
                    let [first, second] = if turned { [pair[1], pair[0]] } else { *pair };
                    let (u, missing) = (draws.unit(), draws.unit() < a.missing);
                    if lost || missing {
                        continue;
                    }
                    let (up, down) = (libm::exp(own[first] / 2.0), libm::exp(own[second] / 2.0));
                    let [wins, ties, losses] = [up / down, nu, down / up];
                    let all = wins + ties + losses;
                    chosen.push(Preference {
                        participant: format!("{i:06}"),
                        first: names[first].clone(),
                        second: names[second].clone(),
                        choice: match u * all {
                            u if u < wins => Choice::First(1.0),
                            u if u < wins + ties => Choice::Tie(1.0),
                            _ => Choice::Second(1.0),
                        },
                    });
                }
            }
        }
        chosen
    }

    fn of_choices(
        &self,
        world: &PairsWorld,
        chosen: &[Preference],
        permutation: Option<&Decision>,
        permutations: Stream,
    ) -> Outcome {
        let found = decided::compared(chosen, world.ties.is_some(), self.settings.alpha);
        let mut permutations = super::draw::Draws(permutations);
        let mut of_vaf = || {
            let abilities = found.abilities.iter().zip(&world.vaf);
            let known: Vec<f64> = (abilities.filter(|(_, vaf)| vaf.is_some()))
                .map(|(ability, _)| *ability)
                .collect();
            let whole = found.abilities.len() == world.vaf.len();
            permutation
                .filter(|_| whole)?
                .rejects(&known, &mut permutations)
        };
        let one = |test: &Test| match test {
            Test::Preferred => verdict(found.preferred.as_ref()),
            Test::PreferenceVaf => of_vaf(),
            _ => None,
        };
        self.outcome(self.settings.tests.iter().map(one).collect(), None)
    }

    fn of_tracks(
        &self,
        world: &TracksWorld,
        fresh: &[Option<Track>],
        draws: &mut Stream,
        number: &str,
    ) -> Outcome {
        let settings = self.settings;
        let spread = &settings.assumptions.spread;
        let rules: Vec<&TrackRules> = world.tracks.iter().map(|t| &t.rules).collect();
        let conditions = by_condition(&rules);
        let place = |track: &TrackWorld| {
            let own = |all: &Vec<&TrackRules>| all[0].condition() == track.rules.condition();
            conditions.iter().position(own).unwrap_or(0)
        };
        let places: Vec<usize> = world.tracks.iter().map(place).collect();
        let mut found: Vec<(String, String, f64)> = Vec::new();
        let mut first: Vec<f64> = Vec::new();
        let mut counts: Vec<Vec<TrialCount>> = vec![Vec::new(); world.tracks.len()];
        let mut whole = true;
        for i in 0..self.cell.participants {
            let name = format!("{i:06}");
            let level = spread.subject * draws.normal();
            let own: Vec<f64> = (conditions.iter())
                .map(|_| level + spread.interaction * draws.normal())
                .collect();
            if self.is_lost(draws) {
                continue;
            }
            let mut answered: Vec<Vec<Level>> = vec![Vec::new(); conditions.len()];
            for (t, track) in world.tracks.iter().enumerate() {
                let at = places[t];
                // A stream of its own: the number of trials depends on the answers.
                let path = [STREAM, &self.text, number, "track", &name, &t.to_string()];
                let mut answers = Stream::new(settings.seed, &path);
                match (track.truth, &fresh[t]) {
                    (Truth::Sensitivity(d), _) => {
                        let d = (d + own[at]).max(0.0);
                        counts[t].extend(trials(track, &name, d, &mut answers));
                    }
                    (Truth::Function(typical), Some(fresh)) => {
                        let curve = of_participant(typical, own[at], world.ratios);
                        answered[at].extend(run(track, fresh.clone(), &curve, &mut answers));
                    }
                    (Truth::Function(_), None) => whole = false,
                }
            }
            // The tracks of a condition are fitted together.
            for (at, levels) in answered.iter().enumerate().filter(|a| !a.1.is_empty()) {
                let track = places.iter().position(|p| *p == at);
                let track = track.map(|t| &world.tracks[t]);
                let Some((track, asked)) = track.and_then(|t| Some((t, t.asked()?))) else {
                    continue;
                };
                match decided::threshold(asked, levels, &track.settings) {
                    Some(value) => {
                        if at == 0 {
                            first.push(value);
                        }
                        let id = track.rules.condition().as_str().to_owned();
                        found.push((name.clone(), id, value));
                    }
                    None => whole = false,
                }
            }
        }
        let one = |test: &Test| match test {
            Test::Thresholds => {
                let found = decided::thresholds(&found, world.ratios, settings.alpha);
                verdict(found.as_ref()).filter(|_| whole)
            }
            Test::ToldApart => told_apart(world, &counts, settings.alpha),
            _ => None,
        };
        let half_width = decided::threshold_half_width(&first, world.ratios);
        self.outcome(settings.tests.iter().map(one).collect(), half_width)
    }

    fn outcome(&self, tests: Vec<Option<bool>>, half_width: Option<f64>) -> Outcome {
        Outcome {
            tests: tests.into_iter().map(|t| t.ok_or(UNDEFINED)).collect(),
            slope: None,
            half_width,
            boundary: false,
        }
    }
}

fn verdict(finding: Option<&PartFinding>) -> Option<bool> {
    let finding = finding.filter(|f| f.reason().is_none())?;
    Some(finding.is_yes())
}

/// Whether the realizations of every track are told apart.
fn told_apart(world: &TracksWorld, counts: &[Vec<TrialCount>], alpha: f64) -> Option<bool> {
    let tracks: Vec<_> = (world.tracks.iter().zip(counts))
        .filter(|(track, _)| matches!(track.truth, Truth::Sensitivity(_)))
        .filter_map(|(track, counts)| {
            let asked = track.asked()?;
            Some((&track.rules, asked, counts.clone(), &track.settings))
        })
        .collect();
    let found: Option<Vec<bool>> = (decided::told_apart(&tracks, alpha)?.iter())
        .map(|finding| verdict(Some(finding)))
        .collect();
    found.map(|all| !all.is_empty() && all.into_iter().all(|yes| yes))
}

/// The function of a participant who differs by `own` from the typical one: in the natural
/// logarithm where levels have ratios.
fn of_participant(typical: Curve, own: f64, ratios: bool) -> Curve {
    let (factor, shift) = match ratios {
        true => (libm::exp(own), 0.0),
        false => (1.0, own),
    };
    Curve {
        threshold: typical.threshold * factor + shift,
        width: typical.width * factor,
        ..typical
    }
}

/// Runs a track by its rule; the answers by trial.
fn run(track: &TrackWorld, mut state: Track, curve: &Curve, draws: &mut Stream) -> Vec<Level> {
    let levels = track.ladder.levels();
    let mut answered = Vec::new();
    while let Some(proposal) = state.next() {
        // The shares of catch and easy trials are of all trials; catch trials say nothing of
        // the threshold.
        let share = track.rules.easy / (1.0 - track.rules.catch);
        let easy = share > 0.0 && draws.unit() < share;
        let step = if easy {
            levels.len() - 1
        } else {
            proposal.step
        };
        let level = levels[step];
        let positive = draws.unit() < curve.value(level);
        state.answer(&Answer {
            presented: level,
            positive,
            easy,
        });
        answered.push(Level {
            level,
            positive: f64::from(u8::from(positive)),
            trials: 1.0,
        });
    }
    answered
}

/// The answers of a participant with this d′ to the trials of two realizations.
fn trials(track: &TrackWorld, name: &str, d: f64, draws: &mut Stream) -> Vec<TrialCount> {
    let rules = &track.rules;
    let correct = |p: f64| (p, p);
    // Hits, and correct rejections.
    let (hit, rejection) = match rules.method {
        Method::TwoIntervals => correct(normal_cdf(d / SQRT_2)),
        Method::ThreeIntervals => correct(share_of_choice(3).map_or(0.0, |share| share(d))),
        Method::OddOneOut => correct(share_of_oddity()(d)),
        Method::Abx => correct(share_of_abx_by_differencing(d)),
        Method::YesNo => correct(normal_cdf(d / 2.0)),
        Method::SameDifferent => {
            let (hits, false_alarms) = rates_of_same_different(d);
            (hits, 1.0 - false_alarms)
        }
    };
    let ruled = f64::from(rules.rule.most_trials());
    let catches = (ruled / (1.0 - rules.catch - rules.easy) * rules.catch).round() as usize;
    // Of two intervals each is correct in turn; without a signal "no" and "same" are.
    let has_catch = !rules.method.catch_sequences().is_empty();
    let kinds = (0..ruled as usize).map(|k| (if has_catch { 0 } else { k % 2 }, hit));
    let kinds = kinds.chain((0..catches).map(|_| (1, rejection)));
    let mut found = [0usize, 1].map(|target| TrialCount {
        participant: name.to_owned(),
        condition: rules.id.as_str().to_owned(),
        level: None,
        target: Some(target),
        positive: 0.0,
        trials: 0.0,
    });
    for (target, share) in kinds {
        found[target].trials += 1.0;
        found[target].positive += f64::from(u8::from(draws.unit() < share));
    }
    found.into_iter().filter(|c| c.trials > 0.0).collect()
}

#[cfg(test)]
mod tests;
