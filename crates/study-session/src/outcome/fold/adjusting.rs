//! Trials of adjustment: each change adds an interval to the attempt.

use super::Attempt;
use crate::outcome::event::Failure;
use crate::outcome::fidelity::Verdict;
use study_base::text::ModelId;

impl Attempt {
    /// It is one of a trial of adjustment.
    pub(super) fn adjusts(&mut self, has_standard: bool) {
        // What is felt first.
        self.standards = Some(match has_standard {
            true => vec![1],
            false => Vec::new(),
        });
    }

    /// Something else is felt next.
    pub(super) fn adjusted(&mut self, to: &ModelId, standard: bool) {
        self.models.push(to.clone());
        self.ended = None;
        // What is answered is felt from now on.
        self.rated_earlier_s = 0.0;
        self.rating = None;
        let interval = self.intervals();
        let standards = self.standards.get_or_insert_default();
        if standard {
            standards.push(interval);
        }
    }

    /// What came next failed: it is taken back, so that what was felt before it is the last again.
    pub(super) fn step_failed(&mut self, failure: Failure) {
        if failure.counts() {
            let failing = self.failing(failure).cloned();
            self.failed_steps.extend(failing);
        }
        if self.interval().is_none() {
            return;
        }
        self.models.pop();
        let intervals = self.intervals();
        if let Some(standards) = &mut self.standards {
            standards.retain(|interval| *interval <= intervals);
        }
        if let Some((at, ended)) = self.presentations.last().and_then(|p| p.ended) {
            self.end(intervals, ended, at);
        }
    }

    /// What a failure of a step is about: the force of what was felt last, or what comes next.
    fn failing(&self, failure: Failure) -> Option<&ModelId> {
        if failure != Failure::Rendering {
            return self.models.last();
        }
        let interval = self.presentations.last()?.interval as usize;
        self.models.get(interval.checked_sub(1)?)
    }

    /// How often steps with what fails now were repeated already.
    pub fn repeated_steps(&self, failure: Failure) -> u32 {
        let failing = self.failing(failure);
        let same = |failed: &&ModelId| Some(*failed) == failing;
        let times = self.failed_steps.iter().filter(same).count();
        u32::try_from(times).unwrap_or(u32::MAX)
    }

    /// Whether a level was felt, and everything that was felt has a known end: what is set goes on from there.
    pub fn goes_on(&self) -> bool {
        let level = |interval| self.is_adjusted() && !self.is_standard(interval);
        self.presentations.iter().all(|p| p.ended.is_some())
            && self.presentations.iter().any(|p| level(p.interval))
    }

    /// Whether the force of what was felt last was that of its table, as far as that is known.
    pub fn is_right(&self) -> bool {
        let judged = self.presentations.last().and_then(|p| p.judged);
        let found = judged.and_then(|at| self.rendering.get(at));
        found.is_none_or(|found| found.verdict != Verdict::Fault)
    }

    /// Whether it is one of a trial of adjustment.
    pub fn is_adjusted(&self) -> bool {
        self.standards.is_some()
    }

    /// Whether its presentations have numbers: there are several, or may be.
    pub fn is_numbered(&self) -> bool {
        self.intervals() > 1 || self.is_adjusted()
    }

    /// Whether an interval of a trial of adjustment presents the standard.
    pub fn is_standard(&self, interval: u32) -> bool {
        let standards = self.standards.as_ref();
        standards.is_some_and(|all| all.contains(&interval))
    }

    /// Whether the standard is felt, comes next or was felt last in a trial of adjustment.
    pub fn is_at_standard(&self) -> bool {
        self.is_standard(self.interval().unwrap_or(self.intervals()))
    }

    /// The level of a trial of adjustment: the one that is felt or was felt last, but for the standard.
    pub fn set_to(&self) -> Option<&ModelId> {
        self.standards.as_ref()?;
        let numbered = (1..).zip(&self.models);
        let levels = numbered.filter(|(interval, _)| !self.is_standard(*interval));
        levels.last().map(|(_, model)| model)
    }
}
