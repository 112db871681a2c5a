//! The uploaded mechanism and the checks before it may be played.

use super::table::{Asked, Bounds, Refused, ordered, positive, require};
use crate::mechanism::{Certifier, FASTER_THAN_TRAINED, MechanismView, Profile};
use crate::message::{MechanismBegin, MechanismChunk, Refusal, UploadCrc};
use crate::real::Real;

/// A mechanism with a capacity of `N` values.
#[derive(Debug, Clone)]
pub(super) struct MechanismBuffer<const N: usize, R> {
    /// Detents, then frictions, N.
    values_n: [f64; N],
    len: usize,
    pub(super) begin: Option<MechanismBegin>,
    crc: UploadCrc,
    /// The first value that is not finite, or a friction below 0.
    bad: Option<usize>,
    certifier: Certifier,
    /// After COMMIT: the mechanism in the servo's precision, without its values.
    rendered: Option<MechanismView<'static, R>>,
}

impl<const N: usize, R: Real> MechanismBuffer<N, R> {
    pub(super) const fn new() -> Self {
        Self {
            values_n: [0.0; N],
            len: 0,
            begin: None,
            crc: UploadCrc::new(),
            bad: None,
            certifier: Certifier::new(),
            rendered: None,
        }
    }

    /// Begins a new upload in place of the old one.
    pub(super) fn begin(&mut self, begin: &MechanismBegin) -> Result<(), Refused> {
        self.clear();
        let values = usize::from(begin.detents) + usize::from(begin.frictions);
        require(values <= N, Refusal::TooMany, N as u32)?;
        self.crc = UploadCrc::of_mechanism(begin);
        self.begin = Some(*begin);
        Ok(())
    }

    pub(super) fn clear(&mut self) {
        self.begin = None;
        self.len = 0;
        self.bad = None;
        self.certifier = Certifier::new();
        self.rendered = None;
    }

    pub(super) fn chunk(&mut self, chunk: &MechanismChunk) -> Result<(), Refused> {
        let Some(begin) = &self.begin else {
            return Err((Refusal::WrongState, 0));
        };
        let (values, all) = (chunk.values.as_slice(), values(begin));
        let next = usize::from(chunk.first) == self.len;
        require(next, Refusal::Order, self.len as u32)?;
        let fits = self.len + values.len() <= all;
        require(fits, Refusal::TooMany, all as u32)?;
        let detents = usize::from(begin.detents);
        for value in values {
            let friction = self.len >= detents;
            if !value.is_finite() || (friction && *value < 0.0) {
                self.bad = self.bad.or(Some(self.len));
            }
            self.values_n[self.len] = *value;
            self.crc.value_n(*value);
            self.len += 1;
        }
        Ok(())
    }

    pub(super) fn crc(&self) -> u32 {
        self.crc.value()
    }

    /// The mechanism, once it has been accepted.
    pub(super) fn view(&self) -> Option<MechanismView<'_, R>> {
        let (begin, mut view) = (self.begin?, self.rendered?);
        let detents = usize::from(begin.detents);
        view.detent.n = &self.values_n[..detents];
        view.friction.n = &self.values_n[detents..self.len];
        Some(view)
    }

    /// The mechanism in double precision, as the host certifies it.
    fn as_received(&self, begin: &MechanismBegin) -> MechanismView<'_> {
        let detents = usize::from(begin.detents).min(self.len);
        let profile = |[first_mm, step_mm]: [f64; 2], n| Profile {
            first_mm,
            step_mm,
            n,
        };
        MechanismView::with_slope(
            begin.scalars,
            profile(begin.detent_mm, &self.values_n[..detents]),
            profile(begin.friction_mm, &self.values_n[detents..self.len]),
            self.certifier.steepest_n_per_mm(),
        )
    }

    /// Received values whose certificate has not been computed.
    pub(super) fn unjudged(&self) -> usize {
        match self.bad {
            None => self.len.saturating_sub(self.certifier.judged() + 2),
            Some(_) => 0,
        }
    }

    /// Judges the next interval of a profile; false if it needs values that have not
    /// arrived, or if there is none.
    pub(super) fn judge(&mut self) -> bool {
        let Some(begin) = self.begin else {
            return false;
        };
        let detents = usize::from(begin.detents);
        // an interval of the spline needs two values to its right
        let known = self.len == values(&begin)
            || (self.certifier.judged() + 3 <= self.len && self.len <= detents);
        if !known || self.bad.is_some() {
            return false;
        }
        let mut certifier = self.certifier;
        let top_mm_s = FASTER_THAN_TRAINED * begin.trained_mm_s;
        let more = certifier.step(&self.as_received(&begin), top_mm_s);
        self.certifier = certifier;
        more
    }

    /// Checks that the mechanism is complete and may be played; its force limit, N.
    pub(super) fn validate(&mut self, crc: u32, bounds: &Bounds) -> Result<f64, Refused> {
        let Some(begin) = self.begin else {
            return Err((Refusal::WrongState, 0));
        };
        let complete = self.len == values(&begin);
        require(complete, Refusal::Incomplete, self.len as u32)?;
        require(self.crc() == crc, Refusal::Checksum, self.crc())?;
        self.check_evaluable(&begin)?;
        let asked = Asked {
            range_mm: begin.range_mm,
            force_n: begin.force_n,
            velocity_mm_s: begin.velocity_mm_s,
            uncertified_n: begin.uncertified_n,
        };
        asked.check_limits(bounds)?;
        while self.judge() {}
        let view = self.as_received(&begin);
        let limit_n = asked.permit(&self.certifier.finish(&view), bounds, true)?;
        let profile = |[first_mm, step_mm]: [f64; 2]| Profile {
            first_mm,
            step_mm,
            n: &[],
        };
        let without_values = MechanismView::with_slope(
            begin.scalars,
            profile(begin.detent_mm),
            profile(begin.friction_mm),
            view.steepest_n_per_mm(),
        );
        self.rendered = Some(without_values.of());
        Ok(limit_n)
    }

    /// Checks that the force is defined at every position and in every state.
    fn check_evaluable(&self, begin: &MechanismBegin) -> Result<(), Refused> {
        let bad = |value: usize| Err((Refusal::BadTable, value as u32));
        if let Some(value) = self.bad {
            return bad(value);
        }
        let spaced = |[first_mm, step_mm]: [f64; 2]| first_mm.is_finite() && positive(step_mm);
        let profiles = begin.detents >= 2
            && begin.frictions >= 2
            && spaced(begin.detent_mm)
            && spaced(begin.friction_mm);
        let known = begin.scalars.check().is_ok();
        if profiles && known && ordered(begin.range_mm) && positive(begin.trained_mm_s) {
            Ok(())
        } else {
            bad(self.len)
        }
    }
}

fn values(begin: &MechanismBegin) -> usize {
    usize::from(begin.detents) + usize::from(begin.frictions)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanism::Scalars;
    use crate::message::FixedVec;
    use proptest::prelude::*;

    proptest! {
        /// A mechanism that is judged while it arrives has the certificate of the whole.
        #[test]
        fn judging_value_by_value_gives_the_same_certificate(
            detent in proptest::collection::vec(-3.0..3.0, 2..20),
            friction in proptest::collection::vec(0.0..2.0, 2..8),
            judged in proptest::array::uniform10(0..9),
        ) {
            let begin = MechanismBegin {
                detents: detent.len() as u16,
                frictions: friction.len() as u16,
                detent_mm: [1.0, 0.5],
                friction_mm: [2.0, 4.0],
                range_mm: [1.0, 11.0],
                trained_mm_s: 100.0,
                force_n: 1.0,
                velocity_mm_s: 100.0,
                uncertified_n: None,
                scalars: Scalars {
                    follower_kg: 0.1,
                    slip_mm: 0.1,
                    stribeck_mm_s: 1.0,
                    handle_slip_mm: 0.1,
                    ..Scalars::default()
                },
            };
            let all = [&detent[..], &friction].concat();
            let mut buffer = MechanismBuffer::<32, f64>::new();
            buffer.begin(&begin).unwrap();
            for (at, (some, judged)) in all.chunks(3).zip(judged).enumerate() {
                let first = (3 * at) as u16;
                let values = FixedVec::of(some);
                buffer.chunk(&MechanismChunk { first, values }).unwrap();
                for _ in 0..judged {
                    buffer.judge();
                }
            }
            while buffer.judge() {}
            let profile = |n, [first_mm, step_mm]: [f64; 2]| Profile { first_mm, step_mm, n };
            let whole = MechanismView::new(
                begin.scalars,
                profile(&detent[..], begin.detent_mm),
                profile(&friction[..], begin.friction_mm),
            );
            let found = buffer.certifier.finish(&whole);
            let expected = whole.certificate(begin.trained_mm_s);
            prop_assert_eq!(found, expected);
            prop_assert_eq!(buffer.certifier.steepest_n_per_mm(), whole.steepest_n_per_mm());
        }
    }
}
