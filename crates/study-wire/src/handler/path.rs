//! Probe mode: the motor moves the handle along a path while the force is measured.

use super::table::{Bounds, Refused, require};
use super::{Drive, Handler, Measured, Out};
use crate::message::{
    DeviceState, Fault, PathBegin, PathChunk, RecordedPoint, Refusal, UploadCrc, fixed,
};
use crate::real::Real;

/// Largest deviation from the path, mm.
const MAX_DEVIATION_MM: f64 = 5.0;
/// Mean speed of the approach to the first point, mm/s.
const APPROACH_MM_S: f64 = 20.0;
/// Shortest duration of the approach, s.
const MIN_APPROACH_S: f64 = 0.5;

/// A path with a capacity of `N` points.
#[derive(Debug, Clone)]
pub(super) struct PathBuffer<const N: usize> {
    x_nm: [i32; N],
    len: usize,
    begin: Option<PathBegin>,
    crc: UploadCrc,
    /// Why the first bad point cannot be followed.
    bad: Option<Refused>,
    /// Position of the handle at the start of the approach.
    from_mm: Option<f64>,
    /// Duration of the approach, servo periods.
    approach: u32,
    /// Servo periods since the start of the approach or of the path.
    ticks: u32,
}

impl<const N: usize> PathBuffer<N> {
    pub(super) const fn new() -> Self {
        Self {
            x_nm: [0; N],
            len: 0,
            begin: None,
            crc: UploadCrc::new(),
            bad: None,
            from_mm: None,
            approach: 0,
            ticks: 0,
        }
    }

    pub(super) fn clear(&mut self) {
        self.begin = None;
        self.len = 0;
        self.bad = None;
    }

    pub(super) fn begin(&mut self, begin: &PathBegin) -> Result<(), Refused> {
        self.clear();
        let fits = begin.points as usize <= N;
        require(fits, Refusal::TooMany, N as u32)?;
        self.crc = UploadCrc::of_path(begin);
        self.begin = Some(*begin);
        Ok(())
    }

    pub(super) fn chunk(&mut self, chunk: &PathChunk, bounds: &Bounds) -> Result<(), Refused> {
        let Some(begin) = self.begin else {
            return Err((Refusal::WrongState, 0));
        };
        let points = chunk.x_nm.as_slice();
        let next = chunk.first as usize == self.len;
        require(next, Refusal::Order, self.len as u32)?;
        let fits = self.len + points.len() <= begin.points as usize;
        require(fits, Refusal::TooMany, begin.points)?;
        for point in points {
            self.x_nm[self.len] = *point;
            self.crc.point(*point);
            self.bad = self.bad.or(self.check(self.len, &begin, bounds).err());
            self.len += 1;
        }
        Ok(())
    }

    /// Checks that a point is inside the stroke and can be reached from the one before.
    fn check(&self, point: usize, begin: &PathBegin, bounds: &Bounds) -> Result<(), Refused> {
        let [low, high] = bounds.stroke_mm;
        let x_mm = fixed::from_nm(self.x_nm[point]);
        let before_mm = fixed::from_nm(self.x_nm[point.saturating_sub(1)]);
        require((low..=high).contains(&x_mm), Refusal::Limit, 3)?;
        let slow = libm::fabs(x_mm - before_mm) * begin.rate_hz <= begin.velocity_mm_s;
        require(slow, Refusal::BadTable, point as u32)
    }

    /// Checks that the path is complete and within the bounds; its force limit, N.
    pub(super) fn validate(
        &self,
        crc: u32,
        bounds: &Bounds,
        servo_hz: f64,
    ) -> Result<f64, Refused> {
        let Some(begin) = &self.begin else {
            return Err((Refusal::WrongState, 0));
        };
        let (points, own_crc) = (self.len as u32, self.crc.value());
        require(points == begin.points, Refusal::Incomplete, points)?;
        require(own_crc == crc, Refusal::Checksum, own_crc)?;
        let within = |value: f64, most: f64| value.is_finite() && value > 0.0 && value <= most;
        let sampled = points >= 2 && within(begin.rate_hz, servo_hz);
        require(sampled, Refusal::BadTable, points)?;
        require(within(begin.force_n, bounds.force_n), Refusal::Limit, 1)?;
        let velocity = within(begin.velocity_mm_s, bounds.velocity_mm_s);
        require(velocity, Refusal::Limit, 2)?;
        self.bad.map_or(Ok(begin.force_n), Err)
    }

    pub(super) fn velocity_mm_s(&self) -> f64 {
        self.begin.map_or(0.0, |begin| begin.velocity_mm_s)
    }

    /// Starts again with the approach from the current position.
    pub(super) fn rewind(&mut self) {
        self.from_mm = None;
        self.ticks = 0;
    }

    /// Position, mm, and speed, mm/s, of the approach; `None` when it is over.
    fn approach(&mut self, x_mm: f64, servo_hz: f64) -> Option<(f64, f64)> {
        let first_mm = fixed::from_nm(self.x_nm.first().copied().unwrap_or_default());
        let from_mm = match self.from_mm {
            Some(from_mm) => from_mm,
            None => {
                let approach_s = libm::fabs(first_mm - x_mm) / APPROACH_MM_S;
                self.approach = libm::ceil(approach_s.max(MIN_APPROACH_S) * servo_hz) as u32;
                self.from_mm = Some(x_mm);
                x_mm
            }
        };
        if self.ticks >= self.approach {
            return None;
        }
        let phase = core::f64::consts::PI * f64::from(self.ticks) / f64::from(self.approach);
        let distance_mm = first_mm - from_mm;
        let rate = core::f64::consts::PI * servo_hz / f64::from(self.approach);
        Some((
            from_mm + distance_mm * (0.5 - 0.5 * libm::cos(phase)),
            distance_mm * 0.5 * libm::sin(phase) * rate,
        ))
    }

    /// Position, mm, and speed, mm/s, on the path, and whether a point has just been
    /// reached; `None` after the last point.
    fn along(&self, servo_hz: f64) -> Option<(f64, f64, bool)> {
        let rate_hz = self.begin?.rate_hz;
        // The small offset keeps rounding from delaying a point by one period.
        let at = |tick: u32| f64::from(tick) * rate_hz / servo_hz + 1e-9;
        let now = at(self.ticks);
        let point = now as usize;
        if point >= self.len {
            return None;
        }
        let reached = self.ticks == 0 || at(self.ticks - 1) as usize != point;
        let near = |offset: usize| {
            // Offset 1 is the point itself; the ends are repeated.
            let at = (point + offset).saturating_sub(1).min(self.len - 1);
            fixed::from_nm(self.x_nm[at])
        };
        let [before, x, next, after] = [near(0), near(1), near(2), near(3)];
        // A cubic with central differences as slopes, so that the speed is continuous.
        let (slope, next_slope) = (0.5 * (next - before), 0.5 * (after - x));
        let square = 3.0 * (next - x) - 2.0 * slope - next_slope;
        let cube = slope + next_slope - 2.0 * (next - x);
        let u = now - point as f64;
        Some((
            x + u * (slope + u * (square + u * cube)),
            (slope + u * (2.0 * square + u * 3.0 * cube)) * rate_hz,
            reached,
        ))
    }
}

impl<const NODES: usize, const POINTS: usize, R: Real> Handler<NODES, POINTS, R> {
    /// Runs one servo period of a recording.
    pub(super) fn follow(&mut self, measured: Measured<R>, now_ms: u32, out: Out<'_>) -> Drive<R> {
        let servo_hz = self.profile.servo.servo_hz;
        let motion = measured.motion.f64();
        let bounds = self.profile.bounds;
        let finite = motion.is_finite() && measured.force_n.is_none_or(R::is_finite);
        // With `<=` a limit that is NaN trips.
        let slow = libm::fabs(motion.v_mm_s) <= self.path.velocity_mm_s();
        let inside = motion.x_mm >= bounds.stroke_mm[0] && motion.x_mm <= bounds.stroke_mm[1];
        let fault = if !finite {
            Fault::NotANumber
        } else if !slow {
            Fault::Velocity
        } else if !inside {
            Fault::Stroke
        } else {
            Fault::None
        };
        if fault != Fault::None {
            self.trip(fault, now_ms, out);
            return Drive::Force(R::ZERO);
        }
        if self.state == DeviceState::Ramp {
            if let Some((x_mm, v_mm_s)) = self.path.approach(motion.x_mm, servo_hz) {
                self.path.ticks += 1;
                return self.drive_to(motion.x_mm, x_mm, v_mm_s, now_ms, out);
            }
            self.path.ticks = 0;
            self.state = DeviceState::Run;
        }
        let Some((x_mm, v_mm_s, reached)) = self.path.along(servo_hz) else {
            self.end();
            self.supervise(now_ms, out);
            return Drive::Force(R::ZERO);
        };
        self.path.ticks = self.path.ticks.saturating_add(1);
        self.run.ticks = self.path.ticks;
        if reached {
            let point = RecordedPoint {
                x_nm: fixed::nm(motion.x_mm),
                force_un: measured.force_n.map(fixed::un),
                a_um_s2: fixed::um_s2(motion.a_m_s2),
            };
            if self.run.add_point(point, now_ms) {
                self.flush(out);
            }
        }
        self.drive_to(motion.x_mm, x_mm, v_mm_s, now_ms, out)
    }

    /// Commands a position on the path, or trips if the handle is too far from it.
    fn drive_to(
        &mut self,
        actual_mm: f64,
        x_mm: f64,
        v_mm_s: f64,
        now_ms: u32,
        out: Out<'_>,
    ) -> Drive<R> {
        if libm::fabs(x_mm - actual_mm) > MAX_DEVIATION_MM {
            self.trip(Fault::Following, now_ms, out);
            return Drive::Force(R::ZERO);
        }
        Drive::Position {
            x_mm: R::of(x_mm),
            v_mm_s: R::of(v_mm_s),
            force_n: R::of(self.limit_n),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_of_more_points_than_the_device_holds_is_refused() {
        let begin = |points| PathBegin {
            points,
            rate_hz: 1000.0,
            force_n: 1.0,
            velocity_mm_s: 1.0,
        };
        let mut path = PathBuffer::<3>::new();
        assert_eq!(path.begin(&begin(3)), Ok(()));
        assert_eq!(path.begin(&begin(4)), Err((Refusal::TooMany, 3)));
    }
}
