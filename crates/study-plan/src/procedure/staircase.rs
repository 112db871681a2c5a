//! Transformed and weighted up–down (Levitt 1971; Kaernbach 1991; García-Pérez 1998).

use super::{Ladder, ProcedureError, Summary, above_0, filled};
use serde::{Deserialize, Serialize};
use study_stats::describe;

/// How a step changes the level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Scale {
    /// x ± s.
    Lin,
    /// x · 10^(±s).
    Log,
    /// x · 10^(±s/20): amplitude.
    Db,
}

/// When a staircase stops.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// After so many reversals,
    pub reversals: u32,
    /// but not before so many trials,
    #[serde(default)]
    pub min_trials: u32,
    /// and in any case after so many.
    pub max_trials: u32,
}

/// An up–down rule: down after `down` positive answers in a row, up after `up` others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Staircase {
    /// Answers in a row that are not positive, until the level rises.
    pub up: u32,
    /// Positive answers in a row, until the level falls.
    pub down: u32,
    /// The first level.
    pub start: f64,
    /// Step sizes, downwards: number i after i reversals, then the last.
    pub steps: Vec<f64>,
    /// What a step does.
    pub scale: Scale,
    /// Size of a step up, where 1 is a step down.
    #[serde(default = "one")]
    pub step_up_factor: f64,
    /// The lowest level; without it that of the ladder.
    #[serde(default)]
    pub min_level: Option<f64>,
    /// The highest level; without it that of the ladder.
    #[serde(default)]
    pub max_level: Option<f64>,
    /// Until the first reversal, one positive answer is enough for a step down, and
    /// one other for a step up.
    #[serde(default = "yes")]
    pub initial_one_up_one_down: bool,
    /// When it stops.
    pub stop: Stop,
    /// Number of reversals that the estimate is the mean of.
    pub estimate_last: u32,
}

fn one() -> f64 {
    1.0
}

fn yes() -> bool {
    true
}

impl Staircase {
    /// The step up, where 1 is the step down, with which a 1-up-1-down rule settles at
    /// the share `target` of positive answers: target/(1 − target) (Kaernbach 1991).
    /// `None` unless 0 < target < 1.
    pub fn factor_for(target: f64) -> Option<f64> {
        (target > 0.0 && target < 1.0).then(|| target / (1.0 - target))
    }

    /// The share of positive answers at which steps up and down balance: with the
    /// factor f, (f/(1 + f))^(1/down) for one up, 1 − (1/(1 + f))^(1/up) for one down
    /// (García-Pérez 1998). `None` for other rules.
    pub fn target(&self) -> Option<f64> {
        let f = self.step_up_factor;
        match (self.up, self.down) {
            (1, n) => Some(libm::pow(f / (1.0 + f), 1.0 / f64::from(n))),
            (n, 1) => Some(1.0 - libm::pow(1.0 / (1.0 + f), 1.0 / f64::from(n))),
            _ => None,
        }
    }

    fn check(&self) -> Result<(), ProcedureError> {
        filled("steps", &self.steps)?;
        for step in &self.steps {
            above_0("a step", *step)?;
        }
        above_0("step_up_factor", self.step_up_factor)?;
        above_0("up", f64::from(self.up))?;
        above_0("down", f64::from(self.down))?;
        above_0("max_trials", f64::from(self.stop.max_trials))?;
        let finite = [
            ("start", Some(self.start)),
            ("min_level", self.min_level),
            ("max_level", self.max_level),
        ];
        for (what, value) in finite {
            if let Some(value) = value.filter(|v| !v.is_finite()) {
                return Err(ProcedureError::Range {
                    what: what.to_owned(),
                    value,
                    range: "finite",
                });
            }
        }
        if self.scale != Scale::Lin && self.start <= 0.0 {
            return Err(ProcedureError::NotPositive {
                what: "start",
                value: self.start,
            });
        }
        Ok(())
    }
}

/// A direction of the level.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Move {
    /// To a higher level.
    Up,
    /// To a lower level.
    Down,
}

/// A change of direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Reversal {
    /// The trial whose answer turned the direction, from 1.
    pub trial: u32,
    /// The rule's level in that trial.
    pub level: f64,
}

/// A staircase in progress.
#[derive(Debug, Clone)]
pub struct Progress {
    rule: Staircase,
    limits: (f64, f64),
    level: f64,
    /// Positive answers in a row since the last move, and others.
    runs: (u32, u32),
    direction: Option<Move>,
    reversals: Vec<Reversal>,
    trials: u32,
    held: u32,
}

impl Progress {
    /// A staircase before its first trial. Its limits are within the ladder, if there is
    /// one; its levels are not rounded.
    pub fn new(rule: &Staircase, ladder: Option<&Ladder>) -> Result<Self, ProcedureError> {
        rule.check()?;
        let (first, last) = ladder.map_or((f64::NEG_INFINITY, f64::INFINITY), |ladder| {
            (ladder.first(), ladder.last())
        });
        let min = rule.min_level.map_or(first, |m| m.max(first));
        let max = rule.max_level.map_or(last, |m| m.min(last));
        if min > max || rule.start < min || rule.start > max {
            return Err(ProcedureError::Range {
                what: "start".to_owned(),
                value: rule.start,
                range: "within the limits and the ladder",
            });
        }
        Ok(Self {
            rule: rule.clone(),
            limits: (min, max),
            level: rule.start,
            runs: (0, 0),
            direction: None,
            reversals: Vec::new(),
            trials: 0,
            held: 0,
        })
    }

    fn reversals(&self) -> u32 {
        u32::try_from(self.reversals.len()).unwrap_or(u32::MAX)
    }

    fn finished(&self) -> bool {
        let stop = &self.rule.stop;
        self.reversals() >= stop.reversals && self.trials >= stop.min_trials
    }

    /// The level of the next trial; `None` when the staircase has ended.
    pub fn next(&self) -> Option<f64> {
        let ended = self.finished() || self.trials >= self.rule.stop.max_trials;
        (!ended).then_some(self.level)
    }

    /// One answer: a move resets both runs; the step that makes a reversal already has
    /// the next size; a level that a limit holds back is a move all the same.
    pub fn answer(&mut self, positive: bool) {
        self.trials += 1;
        self.runs = match positive {
            true => (self.runs.0 + 1, 0),
            false => (0, self.runs.1 + 1),
        };
        let (up, down) = match self.reversals.is_empty() && self.rule.initial_one_up_one_down {
            true => (1, 1),
            false => (self.rule.up, self.rule.down),
        };
        let moves = if self.runs.0 >= down {
            Move::Down
        } else if self.runs.1 >= up {
            Move::Up
        } else {
            return;
        };
        if self.direction.is_some_and(|before| before != moves) {
            self.reversals.push(Reversal {
                trial: self.trials,
                level: self.level,
            });
        }
        self.direction = Some(moves);
        self.runs = (0, 0);
        let steps = &self.rule.steps;
        let step = steps[self.reversals.len().min(steps.len() - 1)];
        let step = match moves {
            Move::Up => step * self.rule.step_up_factor,
            Move::Down => -step,
        };
        let level = match self.rule.scale {
            Scale::Lin => self.level + step,
            Scale::Log => self.level * libm::pow(10.0, step),
            Scale::Db => self.level * libm::pow(10.0, step / 20.0),
        };
        self.level = level.max(self.limits.0).min(self.limits.1);
        self.held += u32::from(self.level != level);
    }

    /// How far it is.
    pub fn summary(&self) -> Summary {
        let (estimate, spread) = self.estimate();
        Summary {
            trials: self.trials,
            ended: self.next().is_none(),
            finished: self.finished(),
            reversals: self.reversals.clone(),
            estimate,
            spread,
            held: self.held,
            posterior: Vec::new(),
        }
    }

    /// Mean and standard deviation of the last reversals; under log and dB the
    /// geometric mean, and the deviation of log10.
    fn estimate(&self) -> (Option<f64>, Option<f64>) {
        let last = self.rule.estimate_last as usize;
        let Some(from) = self.reversals.len().checked_sub(last) else {
            return (None, None);
        };
        let scaled = |level: f64| match self.rule.scale {
            Scale::Lin => level,
            Scale::Log | Scale::Db => libm::log10(level),
        };
        let levels: Vec<f64> = (self.reversals[from..].iter())
            .map(|r| scaled(r.level))
            .collect();
        let mean = describe::mean(&levels).map(|m| match self.rule.scale {
            Scale::Lin => m,
            Scale::Log | Scale::Db => libm::pow(10.0, m),
        });
        (mean, describe::sd(&levels))
    }
}
