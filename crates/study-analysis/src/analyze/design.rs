//! The design as it was rated: who rated which realizations. Every rule that chooses a
//! test looks only at this and never at a rating.

use super::cells::Cells;

/// The largest share of participants that an analysis of complete participants may
/// leave out.
const MAX_LEFT_OUT: f64 = 0.1;

/// The part of the design that the tests use: the tested realizations that somebody
/// rated, and the participants who rated at least one of them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Design {
    /// Participants who rated at least one of the realizations.
    pub participants: usize,
    /// Participants who rated all of them.
    pub complete: usize,
    /// Tested realizations that somebody rated.
    pub realizations: usize,
    /// Participant × realization cells that hold a rating.
    pub cells: usize,
    /// Whether a cell holds two ratings.
    pub repeated: bool,
}

impl Design {
    pub(super) fn of(cells: &Cells<'_>) -> Self {
        let models = cells.tested();
        let own = || (cells.cells.iter()).filter(|c| models.binary_search(&c.model).is_ok());
        let mut participants: Vec<usize> = own().map(|c| c.subject).collect();
        participants.dedup();
        Self {
            participants: participants.len(),
            complete: cells.table(&models).subjects.len(),
            realizations: models.len(),
            cells: own().count(),
            repeated: own().any(|c| c.rows.len() > 1),
        }
    }

    /// Whether every participant rated every realization.
    pub fn is_complete(self) -> bool {
        self.cells == self.participants * self.realizations
    }

    /// Whether tests use the participants who rated everything: those who did not are at
    /// most one in ten. Otherwise all cells are compared within participants.
    pub fn uses_complete(self) -> bool {
        let left_out = self.participants - self.complete;
        left_out as f64 <= MAX_LEFT_OUT * self.participants as f64
    }

    /// Whether differences between more than two realizations are corrected as Greenhouse and Geisser do. With no more participants than
    /// realizations Huynh and Feldt's correction decides.
    pub(super) fn corrects_by_greenhouse_geisser(self) -> bool {
        self.participants > self.realizations
    }

    /// The participants on whom a test of differences rests.
    pub fn analyzed(self) -> usize {
        if self.uses_complete() {
            self.complete
        } else {
            self.participants
        }
    }
}
