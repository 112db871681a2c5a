//! A sum of many small terms.

use crate::real::Real;

/// A number to which small ones are added, with what the additions rounded away (Kahan's
/// compensated summation, with the exact error of Knuth's two-sum). A position that is moved
/// 10,000 times a second would otherwise drift by the roundings of single precision.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Sum<R> {
    /// The number.
    pub(crate) value: R,
    /// What is to be added to it: at most half a unit in its last place.
    pub(crate) rest: R,
}

impl<R: Real> Sum<R> {
    /// A number as it is.
    pub(crate) const fn of(value: R) -> Self {
        Self {
            value,
            rest: R::ZERO,
        }
    }

    /// The sum with another term.
    pub(crate) fn plus(self, term: R) -> Self {
        let term = term + self.rest;
        let value = self.value + term;
        let added = value - self.value;
        let rest = (self.value - (value - added)) + (term - added);
        Self { value, rest }
    }
}
