//! What the swing of a free handle on a virtual spring tells of its motor.
//!
//! A motor that gives the share g of the commanded force u, after a lag τ, moves a handle of mass M
//! with damping c, Coulomb friction f and a constant force o as
//!
//! M a = −g u(t − τ) − c v − f sign(v) − o.
//!
//! The motion alone tells M/g, the *apparent mass*, and c/g, f/g, o/g, τ: a weak motor has a heavy
//! handle. Integrated twice, with s for the sign of v,
//!
//! x(t) = x₀ + v₀ t − (g/M) ∬ u(t − τ) − (c/M) ∫ x − (f/M) ∬ s − (o/M) t²/2,
//!
//! which is linear in all but τ, so that for each τ there is one least-squares problem, in which the
//! noise of the position is not differentiated; τ is the one with the smallest residual.
//!
//! At a single frequency a lag is the same as a negative damping, −K τ with the stiffness K. Two
//! swings on springs of different stiffness tell them apart.
//!
//! ```
//! use study_haptics::swing::{Point, estimate};
//!
//! // 0.5 kg on 100 and on 300 N/m, without losses: x = 10 cos ωt from its rest.
//! let swing = |n_per_mm: f64| -> Vec<Point> {
//!     let omega = (1e3 * n_per_mm / 0.5).sqrt();
//!     let sample = |i| {
//!         let t_s = 1e-3 * f64::from(i);
//!         let x_mm = 10.0 * (omega * t_s).cos();
//!         Point { t_s, x_mm, command_n: n_per_mm * x_mm }
//!     };
//!     (0..1500).map(sample).collect()
//! };
//! let found = estimate(&[&swing(0.1), &swing(0.3)])?;
//! assert!((found.apparent_kg - 0.5).abs() < 1e-3, "{found:?}");
//! # Ok::<(), study_haptics::swing::NoSwing>(())
//! ```

/// Lags that are tried, s: from the first to the last in these steps.
const LAGS_S: [f64; 3] = [-0.01, 0.045, 0.001];
/// Samples on each side of one from which its direction is taken, least and most: one for each
/// [`STEP_MM`] of the encoder's steps. Over fewer a coarse encoder tells none while the handle turns;
/// over more it turns at another time, since friction brakes it before and after.
const APART: [usize; 2] = [4, 12];
/// See [`APART`], mm.
const STEP_MM: f64 = 0.004;
/// A handle that has moved less than this has not begun to swing, mm.
const BEGUN_MM: f64 = 0.2;
/// A smaller travel is no swing, mm.
const LEAST_MM: f64 = 1.0;
/// Below this speed, as a share of the fastest, a handle that stays so for [`STUCK_S`] has stopped.
const SLOW: f64 = 0.03;
/// See [`SLOW`], s.
const STUCK_S: f64 = 0.01;
/// The end of a swing below this speed, as a share of the fastest, is left out: where a handle creeps,
/// an encoder does not tell when it stopped, and friction does not act afterwards.
const CREEPS: f64 = 0.25;
/// A little of each column is added as a row of its own, so that a friction is zero where a swing
/// that never turns does not tell it from a constant force.
const RIDGE: f64 = 1e-5;
/// Fewer samples tell nothing.
const LEAST_SAMPLES: usize = 100;
/// Longest time without a sample, s.
const GAP_S: f64 = 0.02;

/// A sample of telemetry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// Time since the start, s.
    pub t_s: f64,
    /// Position, mm.
    pub x_mm: f64,
    /// Commanded force, which the hand would have to apply, N.
    pub command_n: f64,
}

/// What a swing told. All are over the gain of the motor, but the lag.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Swing {
    /// Apparent mass, kg.
    pub apparent_kg: f64,
    /// Damping, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// Coulomb friction, N.
    pub friction_n: f64,
    /// Constant force, N.
    pub offset_n: f64,
    /// Lag of the force behind the command, s.
    pub lag_s: f64,
    /// Root mean square of what is left, mm.
    pub residual_mm: f64,
    /// Largest travel from where it began, mm.
    pub travel_mm: f64,
}

/// Why there is no swing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum NoSwing {
    #[error("too few samples, or too many were lost")]
    Samples,
    #[error("the handle did not swing")]
    Rests,
    #[error("the motion does not determine a mass")]
    NotDetermined,
}

/// The moving part of a swing.
struct Moving {
    /// Time from its beginning, s.
    t_s: Vec<f64>,
    x_mm: Vec<f64>,
    /// 1, −1 or 0.
    side: Vec<f64>,
    /// When it began, in the time of the commands.
    from_s: f64,
    travel_mm: f64,
}

/// Estimates from one swing, or better from two on springs of different stiffness.
///
/// # Errors
/// [`NoSwing`] if the handle rested, samples are missing, or the motion is no swing.
pub fn estimate(swings: &[&[Point]]) -> Result<Swing, NoSwing> {
    let moving: Vec<Moving> = (swings.iter())
        .map(|all| moving(all))
        .collect::<Result<_, _>>()?;
    let [first_s, last_s, step_s] = LAGS_S;
    let steps = ((last_s - first_s) / step_s).round() as usize;
    let of = |lag_s: f64| fit(swings, &moving, lag_s);
    let tried: Vec<Fit> = (0..=steps)
        .filter_map(|i| of(first_s + step_s * i as f64))
        .collect();
    let best = (0..tried.len()).min_by(|a, b| tried[*a].sum.total_cmp(&tried[*b].sum));
    let best = best.ok_or(NoSwing::NotDetermined)?;
    // between the neighbours of the best, where the sum is a parabola
    let lag_s = match (tried.get(best.wrapping_sub(1)), tried.get(best + 1)) {
        (Some(before), Some(after)) => {
            let curve = before.sum - 2.0 * tried[best].sum + after.sum;
            let shift = 0.5 * (before.sum - after.sum) / curve;
            tried[best].lag_s
                + step_s
                    * if shift.is_finite() {
                        shift.clamp(-1.0, 1.0)
                    } else {
                        0.0
                    }
        }
        _ => tried[best].lag_s,
    };
    let fit = of(lag_s).ok_or(NoSwing::NotDetermined)?;
    let apparent_kg = fit.apparent_kg()?;
    let [mobility, damping, friction, offset] = fit.shared;
    let samples: usize = moving.iter().map(|m| m.t_s.len()).sum();
    Ok(Swing {
        apparent_kg,
        damping_n_s_per_mm: damping / mobility,
        friction_n: friction / mobility,
        offset_n: offset / mobility,
        lag_s,
        residual_mm: (fit.sum / samples as f64).sqrt(),
        travel_mm: moving.iter().map(|m| m.travel_mm).fold(f64::MAX, f64::min),
    })
}

/// The apparent mass, kg, with a lag that is known, s: one swing alone does not tell both well.
///
/// # Errors
/// As those of [`estimate`].
pub fn apparent_kg(swings: &[&[Point]], lag_s: f64) -> Result<f64, NoSwing> {
    let moving: Vec<Moving> = (swings.iter())
        .map(|all| moving(all))
        .collect::<Result<_, _>>()?;
    let fit = fit(swings, &moving, lag_s).ok_or(NoSwing::NotDetermined)?;
    fit.apparent_kg()
}

/// The part of a recording from the beginning of the motion until the handle creeps to its stop.
fn moving(all: &[Point]) -> Result<Moving, NoSwing> {
    let first = all.first().ok_or(NoSwing::Samples)?;
    let finite = |p: &Point| p.t_s.is_finite() && p.x_mm.is_finite() && p.command_n.is_finite();
    let in_order = |pair: &[Point]| pair[1].t_s > pair[0].t_s && pair[1].t_s - pair[0].t_s < GAP_S;
    if all.len() < LEAST_SAMPLES || !all.iter().all(finite) || !all.windows(2).all(in_order) {
        return Err(NoSwing::Samples);
    }
    let begun = (all.iter()).position(|p| (p.x_mm - first.x_mm).abs() > BEGUN_MM);
    let apart = apart(all);
    let begun = begun.ok_or(NoSwing::Rests)?.max(apart);
    let last = all.len().saturating_sub(apart + 1);
    let speed = |i: usize| {
        let (before, after) = (all[i - apart], all[i + apart]);
        (after.x_mm - before.x_mm) / (after.t_s - before.t_s)
    };
    let speeds: Vec<f64> = (begun..last).map(speed).collect();
    let fastest = speeds.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let fast = |v: &f64| v.abs() >= CREEPS * fastest;
    let mut slow_since = None;
    let mut end = speeds.len();
    // it begins slowly as well
    let under_way = speeds.iter().position(fast).unwrap_or(end);
    for (i, v) in speeds.iter().enumerate().skip(under_way) {
        let at_s = all[begun + i].t_s;
        let since = *slow_since.get_or_insert((i, at_s));
        if v.abs() > SLOW * fastest {
            slow_since = None;
        } else if at_s - since.1 > STUCK_S {
            end = since.0;
            break;
        }
    }
    let end = speeds[..end].iter().rposition(fast).map_or(0, |at| at + 1);
    let own = &all[begun..begun + end];
    let travel_mm = own
        .iter()
        .map(|p| (p.x_mm - first.x_mm).abs())
        .fold(0.0, f64::max);
    if end < LEAST_SAMPLES || travel_mm < LEAST_MM {
        return Err(NoSwing::Rests);
    }
    // where an encoder does not move, the direction is that of before
    let mut side: Vec<f64> = Vec::with_capacity(end);
    for v in &speeds[..end] {
        side.push(match (*v == 0.0, side.last()) {
            (true, last) => last.copied().unwrap_or(0.0),
            (false, _) => v.signum(),
        });
    }
    let from_s = own[0].t_s;
    Ok(Moving {
        t_s: own.iter().map(|p| p.t_s - from_s).collect(),
        x_mm: own.iter().map(|p| p.x_mm).collect(),
        side,
        from_s,
        travel_mm,
    })
}

/// See [`APART`].
fn apart(all: &[Point]) -> usize {
    let steps_mm = all
        .windows(2)
        .map(|pair| (pair[1].x_mm - pair[0].x_mm).abs());
    let step_mm = steps_mm.filter(|mm| *mm > 1e-9).fold(f64::MAX, f64::min);
    let [least, most] = APART;
    ((step_mm / STEP_MM).ceil() as usize).clamp(least, most)
}

/// A least-squares problem with its lag.
struct Fit {
    lag_s: f64,
    /// g/M, c/M, f/M and o/M, in mm/s² per N, 1/s, mm/s² and mm/s².
    shared: [f64; 4],
    /// Sum of squares that is left, mm².
    sum: f64,
}

impl Fit {
    fn apparent_kg(&self) -> Result<f64, NoSwing> {
        // 1 kg moved by 1 N: 1 m/s², which is 1000 mm/s²
        let kg = 1e3 / self.shared[0];
        let is_mass = kg.is_finite() && kg > 0.0;
        is_mass.then_some(kg).ok_or(NoSwing::NotDetermined)
    }
}

/// The command at a time, N: between its samples; zero before the first.
fn command_n(all: &[Point], t_s: f64) -> f64 {
    let after = all.partition_point(|p| p.t_s < t_s);
    match (after.checked_sub(1).map(|i| all[i]), all.get(after)) {
        (None, _) => 0.0,
        (Some(last), None) => last.command_n,
        (Some(before), Some(next)) => {
            let share = (t_s - before.t_s) / (next.t_s - before.t_s);
            before.command_n + share * (next.command_n - before.command_n)
        }
    }
}

/// The integral from the beginning, by the trapezoid rule.
fn integral(t_s: &[f64], of: &[f64]) -> Vec<f64> {
    let mut sum = 0.0;
    let mut all = vec![0.0];
    for i in 1..t_s.len() {
        sum += 0.5 * (t_s[i] - t_s[i - 1]) * (of[i] + of[i - 1]);
        all.push(sum);
    }
    all
}

/// Columns that all swings share.
const SHARED: usize = 4;

/// The problem for one lag.
fn fit(swings: &[&[Point]], moving: &[Moving], lag_s: f64) -> Option<Fit> {
    let rows: usize = moving.iter().map(|m| m.t_s.len()).sum();
    let mut columns = vec![vec![0.0; rows]; SHARED + 2 * moving.len()];
    let mut right = Vec::with_capacity(rows);
    let mut from = 0;
    for (n, (own, all)) in moving.iter().zip(swings).enumerate() {
        let twice = |of: &[f64]| integral(&own.t_s, &integral(&own.t_s, of));
        let commands: Vec<f64> = (own.t_s.iter())
            .map(|t_s| command_n(all, own.from_s + t_s - lag_s))
            .collect();
        let start_mm = own.x_mm[0];
        let way_mm: Vec<f64> = own.x_mm.iter().map(|x| x - start_mm).collect();
        let parts = [
            twice(&commands),
            integral(&own.t_s, &way_mm),
            twice(&own.side),
            own.t_s.iter().map(|t| 0.5 * t * t).collect(),
        ];
        for (column, part) in columns.iter_mut().zip(&parts) {
            for (value, to) in part.iter().zip(&mut column[from..]) {
                *to = -value;
            }
        }
        for (i, t_s) in own.t_s.iter().enumerate() {
            columns[SHARED + 2 * n][from + i] = 1.0;
            columns[SHARED + 2 * n + 1][from + i] = *t_s;
        }
        right.extend(way_mm);
        from += own.t_s.len();
    }
    for at in 0..columns.len() {
        let size = columns[at].iter().map(|x| x * x).sum::<f64>().sqrt();
        for (n, column) in columns.iter_mut().enumerate() {
            column.push(if n == at { RIDGE * size } else { 0.0 });
        }
        right.push(0.0);
    }
    let (solution, sum) = least_squares(columns, right)?;
    Some(Fit {
        lag_s,
        shared: std::array::from_fn(|i| solution[i]),
        sum,
    })
}

/// Solves by orthogonalization (modified Gram-Schmidt, with the right side as a last column);
/// also the sum of squares that is left. `None` if a column depends on those before it.
fn least_squares(mut columns: Vec<Vec<f64>>, mut right: Vec<f64>) -> Option<(Vec<f64>, f64)> {
    const DEPENDENT: f64 = 1e-9;
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let n = columns.len();
    let mut r = vec![vec![0.0; n]; n];
    let mut q_right = vec![0.0; n];
    for j in 0..n {
        let before = dot(&columns[j], &columns[j]).sqrt();
        let (done, rest) = columns.split_at_mut(j);
        let own = &mut rest[0];
        for (i, q) in done.iter().enumerate() {
            r[i][j] = dot(q, own);
            own.iter_mut().zip(q).for_each(|(x, q)| *x -= r[i][j] * q);
        }
        let norm = dot(own, own).sqrt();
        if norm.is_nan() || norm <= DEPENDENT * before {
            return None;
        }
        own.iter_mut().for_each(|x| *x /= norm);
        r[j][j] = norm;
        q_right[j] = dot(own, &right);
        right
            .iter_mut()
            .zip(&*own)
            .for_each(|(x, q)| *x -= q_right[j] * q);
    }
    let mut solution = vec![0.0; n];
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| r[i][j] * solution[j]).sum();
        solution[i] = (q_right[i] - known) / r[i][i];
    }
    Some((solution, dot(&right, &right)))
}

#[cfg(test)]
mod tests;
