//! Values at equally spaced positions: the detent force and the friction of a mechanism.

use crate::real::Real;

/// Values at equally spaced positions, at least two. The values are those of the wire,
/// in double precision; `R` is the precision of the servo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile<'a, R = f64> {
    /// Position of the first value, mm.
    pub first_mm: R,
    /// Distance of two values, mm, above 0.
    pub step_mm: R,
    /// The values, N.
    pub n: &'a [f64],
}

/// The four values around a position, their weights and the derivatives of the weights.
#[derive(Debug, Clone, Copy)]
pub struct Around<R = f64> {
    /// Indices; at the ends some are equal.
    pub at: [usize; 4],
    /// Weight of each.
    pub weight: [R; 4],
    /// Derivative of each weight, 1/mm.
    pub slope: [R; 4],
}

impl<R: Real> Profile<'_, R> {
    /// The interval of a position and the share of it, in [0, 1]; beyond the ends,
    /// where the profile is constant, the index of the end.
    fn interval(&self, x_mm: R) -> Result<(usize, R), usize> {
        let last = self.n.len() - 1;
        let place = (x_mm - self.first_mm) / self.step_mm;
        // false for NaN, which uses the first value
        let inside = place > R::ZERO;
        if !inside {
            return Err(0);
        }
        // `last` is at most 65,535
        if place >= R::of(last as f64) {
            return Err(last);
        }
        let left = place.to_i32();
        Ok((left as usize, place - R::of(f64::from(left))))
    }

    /// The weights of linear interpolation: index of the left value, weight of the right
    /// one, and its derivative, 1/mm.
    pub fn linear(&self, x_mm: R) -> (usize, R, R) {
        match self.interval(x_mm) {
            Ok((left, t)) => (left, t, R::ONE / self.step_mm),
            Err(0) => (0, R::ZERO, R::ZERO),
            Err(last) => (last - 1, R::ONE, R::ZERO),
        }
    }

    /// The weights of a Catmull–Rom spline: once continuously differentiable, so that it is
    /// the gradient of a potential, and each value reaches two intervals to either side.
    pub fn spline(&self, x_mm: R) -> Around<R> {
        self.around(self.interval(x_mm))
    }

    fn around(&self, interval: Result<(usize, R), usize>) -> Around<R> {
        let (left, t) = match interval {
            Ok(place) => place,
            Err(end) => {
                return Around {
                    at: [end; 4],
                    weight: [R::ONE, R::ZERO, R::ZERO, R::ZERO],
                    slope: [R::ZERO; 4],
                };
            }
        };
        let last = self.n.len() - 1;
        let (t2, t3) = (t * t, t * t * t);
        let [two, three, four, five] = [2.0, 3.0, 4.0, 5.0].map(R::of);
        let [eight, nine, ten] = [8.0, 9.0, 10.0].map(R::of);
        let per = R::HALF / self.step_mm;
        Around {
            at: [left.saturating_sub(1), left, left + 1, (left + 2).min(last)],
            weight: [
                R::HALF * (two * t2 - t - t3),
                R::HALF * (two - five * t2 + three * t3),
                R::HALF * (t + four * t2 - three * t3),
                R::HALF * (t3 - t2),
            ],
            slope: [
                per * (four * t - three * t2 - R::ONE),
                per * (nine * t2 - ten * t),
                per * (R::ONE + eight * t - nine * t2),
                per * (three * t2 - two * t),
            ],
        }
    }

    /// The value of the spline at x − behind, N. The share of the interval is taken from its
    /// own end, so that neither the position nor its place among the values rounds it.
    pub fn spline_behind_n(&self, x_mm: R, behind_mm: R) -> R {
        let mut around = self.interval(x_mm - behind_mm);
        if let Ok((left, share)) = &mut around {
            // `left` is at most 65,535
            let end_mm = self.first_mm + R::of(*left as f64) * self.step_mm;
            *share = ((x_mm - end_mm) - behind_mm) / self.step_mm;
        }
        self.value_n(&self.around(around))
    }

    /// The value of the spline, N.
    pub fn spline_n(&self, x_mm: R) -> R {
        self.value_n(&self.spline(x_mm))
    }

    fn value_n(&self, around: &Around<R>) -> R {
        let mut sum = R::ZERO;
        for (i, weight) in around.at.iter().zip(around.weight) {
            sum += weight * R::of(self.n[*i]);
        }
        sum
    }

    /// The value by linear interpolation, N.
    ///
    /// ```
    /// # use study_wire::mechanism::Profile;
    /// let detent = Profile { first_mm: 0.0, step_mm: 2.0, n: &[0.0, 3.0, -1.0] };
    /// assert_eq!(detent.linear_n(1.0), 1.5);
    /// // Constant beyond the ends.
    /// assert_eq!(detent.linear_n(9.0), -1.0);
    /// ```
    pub fn linear_n(&self, x_mm: R) -> R {
        let (left, t, _) = self.linear(x_mm);
        let [from, to] = [self.n[left], self.n[left + 1]].map(R::of);
        from + t * (to - from)
    }
}

impl Profile<'_> {
    /// Least and largest slope of the spline in the interval right of a value, N/mm.
    pub(super) fn slopes_n_per_mm(&self, left: usize) -> [f64; 2] {
        let last = self.n.len() - 1;
        let p = |i: usize| self.n[i.min(last)];
        let (a, b, c, d) = (p(left.saturating_sub(1)), p(left), p(left + 1), p(left + 2));
        // D'(t) = q0 + q1 t + q2 t²
        let q0 = 0.5 * (c - a);
        let q1 = 2.0 * a - 5.0 * b + 4.0 * c - d;
        let q2 = 1.5 * (-a + 3.0 * b - 3.0 * c + d);
        let vertex = (-q1 / (2.0 * q2)).clamp(0.0, 1.0);
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for t in [0.0, 1.0, if vertex.is_nan() { 0.0 } else { vertex }] {
            let slope = (q0 + (q1 + q2 * t) * t) / self.step_mm;
            range = [range[0].min(slope), range[1].max(slope)];
        }
        range
    }
}
