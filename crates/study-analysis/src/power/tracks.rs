//! Tracks: a participant's threshold on a track is the assumed one times the participant's factor
//! and that of the condition (for levels without ratios, sums); the track is run by its own rule. Two
//! realizations have a d′ in place of a threshold.

use super::decide::{Outcome, is_lost, verdict};
use super::precision::{Compared, Precision};
use super::{Cell, STREAM, Settings, Test};
use crate::analyze::psychophysics::decided::{self, Estimated, NoModel};
use crate::analyze::psychophysics::results::CellName;
use crate::analyze::psychophysics::{Asked, TrialCount, TrialSettings};
use std::f64::consts::SQRT_2;
use study_base::rng::Stream;
use study_plan::procedure::{Answer, Ladder, Track};
use study_plan::protocol::conditions::by_condition;
use study_plan::protocol::parts::{Method, TrackRules};
use study_stats::detection::{
    rates_of_same_different, share_of_abx_by_differencing, share_of_choice, share_of_oddity,
};
use study_stats::distribution::normal_cdf;
use study_stats::psychometric::{Curve, Level};

/// Tracks of a part.
#[derive(Debug, Clone, PartialEq)]
pub struct TracksWorld {
    /// The tracks.
    pub tracks: Vec<TrackWorld>,
    /// Whether levels have ratios, as all but those of a blend.
    pub ratios: bool,
    /// Studies of each design, the first ones, whose thresholds are also learned together.
    pub pooled: u64,
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
    pub(super) fn asked(&self) -> Option<Asked> {
        let name = self.rules.method.as_str();
        Asked::NAMES.iter().find(|n| n.1 == name).map(|n| n.0)
    }
}

/// Decides simulated studies of tracks.
pub(super) struct TracksJudge<'a> {
    settings: &'a Settings,
    participants: usize,
    text: String,
    world: &'a TracksWorld,
    /// The tracks before their first trial; `None` of two realizations.
    fresh: Vec<Option<Track>>,
    /// The condition of each track.
    places: Vec<usize>,
    /// The first track of each condition, whose settings are those of all its tracks.
    conditions: Vec<&'a TrackWorld>,
}

/// What the participants of a study answered.
#[derive(Default)]
struct Answers {
    /// By participant and condition, of tracks with levels: the participant, the condition, the true
    /// threshold, and the answers.
    cells: Vec<AnsweredCell>,
    /// Of tracks of two realizations, by track.
    counts: Vec<Vec<TrialCount>>,
    /// Trials of each participant, catch trials included.
    trials: Vec<f64>,
}

/// The answers of a participant in a condition.
struct AnsweredCell {
    name: String,
    condition: usize,
    truth: f64,
    levels: Vec<Level>,
}

impl<'a> TracksJudge<'a> {
    pub(super) fn new(settings: &'a Settings, world: &'a TracksWorld, cell: &Cell) -> Self {
        let fresh = |track: &TrackWorld| match track.truth {
            // The order of constant stimuli changes no estimate.
            Truth::Function(_) => {
                let mut stream = Stream::new(settings.seed, &[STREAM, "track"]);
                Track::new(&track.rules.rule, &track.ladder, &mut stream).ok()
            }
            Truth::Sensitivity(_) => None,
        };
        let rules: Vec<&TrackRules> = world.tracks.iter().map(|t| &t.rules).collect();
        let conditions = by_condition(&rules);
        let place = |track: &TrackWorld| {
            let own = |all: &Vec<&TrackRules>| all[0].condition() == track.rules.condition();
            conditions.iter().position(own).unwrap_or(0)
        };
        let places: Vec<usize> = world.tracks.iter().map(place).collect();
        let first = |at: usize| places.iter().position(|place| *place == at);
        Self {
            settings,
            participants: cell.participants,
            text: cell.canonical(),
            fresh: world.tracks.iter().map(fresh).collect(),
            conditions: (0..conditions.len())
                .filter_map(|at| Some(&world.tracks[first(at)?]))
                .collect(),
            places,
            world,
        }
    }

    /// Draws and decides study k.
    pub(super) fn decide(&self, k: u64) -> Outcome {
        let (settings, ratios) = (self.settings, self.world.ratios);
        let answers = self.draw(k);
        let found: Vec<Option<Estimated>> = (answers.cells.iter())
            .map(|cell| {
                let track = self.conditions[cell.condition];
                decided::threshold(track.asked()?, &cell.levels, &track.settings)
            })
            .collect();
        let is_whole = self.is_possible() && found.iter().all(Option::is_some);
        let thresholds: Vec<(String, String, f64)> = (answers.cells.iter().zip(&found))
            .filter_map(|(cell, found)| {
                let id = self.conditions[cell.condition].rules.condition().as_str();
                Some((cell.name.clone(), id.to_owned(), (*found)?.value))
            })
            .collect();
        let ends = self.ends();
        let differing = ends.and_then(|ends| {
            let ids = ends.map(|at| self.conditions[at].rules.condition().as_str());
            decided::thresholds(&thresholds, (ratios, ids), settings.alpha)
        });
        let finding = differing.as_ref().and_then(|d| d.finding.as_ref());
        let one = |test: &Test| match test {
            Test::Thresholds => verdict(finding).filter(|_| is_whole),
            Test::ToldApart => told_apart(self.world, &answers.counts, settings.alpha),
            _ => None,
        };
        let mut outcome = Outcome::of_tests(settings.tests.iter().map(one));
        let of_first: Vec<f64> = (answers.cells.iter().zip(&found))
            .filter(|(cell, _)| cell.condition == 0)
            .filter_map(|(_, found)| Some((*found)?.value))
            .collect();
        let mean = decided::mean_threshold(&of_first, ratios);
        let scale = Compared { ratios };
        outcome.half_width = mean.map(|mean| scale.half(&mean));
        if answers.cells.is_empty() {
            return outcome;
        }
        let truths: Vec<f64> = answers.cells.iter().map(|cell| cell.truth).collect();
        let typical = self.typical(0);
        let contrast = ends.and_then(|[first, last]| {
            Some(scale.contrast(self.typical(last)?, self.typical(first)?))
        });
        let mut precision = Precision::default();
        precision.trials.add(mean_of(&answers.trials));
        let known: Vec<(Estimated, f64)> = (found.iter().zip(&truths))
            .filter_map(|(found, truth)| Some(((*found)?, *truth)))
            .collect();
        precision.alone.participant.add_all(scale, &known);
        precision.alone.mean.add_all(scale, &pair(mean, typical));
        let of_contrast = differing.and_then(|d| d.contrast);
        precision
            .alone
            .contrast
            .add_all(scale, &pair(of_contrast, contrast));
        if k < self.world.pooled {
            match self.together(&answers, k) {
                Err(NoModel) => {}
                Ok(None) => precision.not_converged += 1,
                Ok(Some(found)) => {
                    let known: Vec<(Estimated, f64)> =
                        found.cells.iter().copied().zip(truths).collect();
                    let own = &mut precision.together;
                    own.participant.add_all(scale, &known);
                    own.mean.add_all(scale, &pair(found.mean, typical));
                    own.contrast.add_all(scale, &pair(found.contrast, contrast));
                }
            }
        }
        outcome.precision = Some(Box::new(precision));
        outcome
    }

    /// Whether all rules can present their levels.
    fn is_possible(&self) -> bool {
        let tracks = self.world.tracks.iter().zip(&self.fresh);
        tracks.clone().all(|(track, fresh)| match track.truth {
            Truth::Function(_) => fresh.is_some(),
            Truth::Sensitivity(_) => true,
        })
    }

    /// The first and the last condition with levels; `None` with one.
    fn ends(&self) -> Option<[usize; 2]> {
        let has_levels = |at: &usize| matches!(self.conditions[*at].truth, Truth::Function(_));
        let mut all = (0..self.conditions.len()).filter(has_levels);
        let first = all.next()?;
        Some([first, all.next_back()?])
    }

    /// The threshold of the typical participant in a condition.
    fn typical(&self, condition: usize) -> Option<f64> {
        match self.conditions.get(condition)?.truth {
            Truth::Function(curve) => Some(curve.threshold),
            Truth::Sensitivity(_) => None,
        }
    }

    /// Draws what the participants of study k answer.
    fn draw(&self, k: u64) -> Answers {
        let (world, number) = (self.world, k.to_string());
        let path = [STREAM, &self.text, &number, "tracks"];
        let draws = &mut Stream::new(self.settings.seed, &path);
        let spread = &self.settings.assumptions.spread;
        let mut found = Answers {
            counts: vec![Vec::new(); world.tracks.len()],
            ..Answers::default()
        };
        for i in 0..self.participants {
            let name = format!("{i:06}");
            let level = spread.subject * draws.normal();
            let own: Vec<f64> = (self.conditions.iter())
                .map(|_| level + spread.interaction * draws.normal())
                .collect();
            if is_lost(self.settings, draws) {
                continue;
            }
            let mut answered: Vec<Vec<Level>> = vec![Vec::new(); self.conditions.len()];
            let mut trials = 0.0;
            for (t, track) in world.tracks.iter().enumerate() {
                let at = self.places[t];
                // A stream of its own: the number of trials depends on the answers.
                let path = [STREAM, &self.text, &number, "track", &name, &t.to_string()];
                let mut answers = Stream::new(self.settings.seed, &path);
                match (track.truth, &self.fresh[t]) {
                    (Truth::Sensitivity(d), _) => {
                        let d = (d + own[at]).max(0.0);
                        let counts = trials_of_two(track, &name, d, &mut answers);
                        found.counts[t].extend(counts);
                    }
                    (Truth::Function(typical), Some(fresh)) => {
                        let curve = of_participant(typical, own[at], world.ratios);
                        let own = run(track, fresh.clone(), &curve, &mut answers);
                        trials += own.len() as f64 / (1.0 - track.rules.catch);
                        answered[at].extend(own);
                    }
                    (Truth::Function(_), None) => {}
                }
            }
            found.trials.push(trials);
            // The tracks of a condition are fitted together.
            for (at, levels) in answered.into_iter().enumerate() {
                let Truth::Function(typical) = self.conditions[at].truth else {
                    continue;
                };
                if !levels.is_empty() {
                    found.cells.push(AnsweredCell {
                        name: name.clone(),
                        condition: at,
                        truth: of_participant(typical, own[at], world.ratios).threshold,
                        levels,
                    });
                }
            }
        }
        found
    }

    /// The pooled model of a study.
    fn together(&self, answers: &Answers, k: u64) -> Result<Option<decided::Together>, NoModel> {
        let id = |at: usize| self.conditions[at].rules.condition().as_str();
        let cells: Vec<decided::Answered> = (answers.cells.iter())
            .map(|cell| {
                (
                    CellName::of(&cell.name, id(cell.condition)),
                    cell.levels.clone(),
                )
            })
            .collect();
        let conditions: Vec<(&str, Asked, &TrialSettings)> = (0..self.conditions.len())
            .filter(|at| answers.cells.iter().any(|cell| cell.condition == *at))
            .filter_map(|at| {
                Some((
                    id(at),
                    self.conditions[at].asked()?,
                    &self.conditions[at].settings,
                ))
            })
            .collect();
        decided::together(&cells, &conditions, self.settings.seed.wrapping_add(k))
    }
}

/// An estimate and its truth, if both are known.
fn pair(found: Option<Estimated>, truth: Option<f64>) -> Vec<(Estimated, f64)> {
    found.zip(truth).into_iter().collect()
}

fn mean_of(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len().max(1) as f64
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
pub(super) fn of_participant(typical: Curve, own: f64, ratios: bool) -> Curve {
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
pub(super) fn run(
    track: &TrackWorld,
    mut state: Track,
    curve: &Curve,
    draws: &mut Stream,
) -> Vec<Level> {
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
fn trials_of_two(track: &TrackWorld, name: &str, d: f64, draws: &mut Stream) -> Vec<TrialCount> {
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
