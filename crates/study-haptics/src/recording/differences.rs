//! Velocity and acceleration as differences of the position.

/// The central difference at row `i`, one-sided at the ends, mm/s.
pub(crate) fn velocity(t: &[f64], x: &[f64], i: usize) -> f64 {
    let before = i.saturating_sub(1);
    let after = (i + 1).min(t.len() - 1);
    (x[after] - x[before]) / (t[after] - t[before])
}

/// The second central difference at row `i`, at the ends that of the neighbor, m/s².
pub(crate) fn acceleration(t: &[f64], x: &[f64], i: usize) -> f64 {
    let i = i.clamp(1, t.len() - 2);
    let before = (x[i] - x[i - 1]) / (t[i] - t[i - 1]);
    let after = (x[i + 1] - x[i]) / (t[i + 1] - t[i]);
    (after - before) / (0.5 * (t[i + 1] - t[i - 1])) / 1000.0
}
