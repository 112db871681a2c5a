//! Trials of adjustment: each change adds an interval to the attempt.

use super::Attempt;
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
