//! Whether strokes are alike.
//!
//! Where all strokes have the same speed at the same place, velocity and acceleration are functions of position and direction, as with a single stroke: a force that depends on
//! these alone explains any mass. What noise and the shape between two nodes leave of the acceleration would bound it by hundreds of kilograms or by too little.

use crate::identify::folds::strokes;
use crate::recording::Recording;

/// Bins of the range in which speeds are compared.
const BINS: usize = 20;
/// Speeds in a bin that differ by less than this share of their mean, rms over all bins, are alike. The acceleration, which goes with the square of the speed, then differs
/// by a fifth, which is 4 % of its squares.
const LEAST_DIFFERENCE: f64 = 0.1;

/// Whether all strokes within `range_mm` are alike; false if no place is passed twice in one direction.
pub(super) fn are_alike(recordings: &[&Recording], [low, high]: [f64; 2]) -> bool {
    // the speeds of all strokes by direction and bin, mm/s
    let mut speeds = vec![Vec::new(); 2 * BINS];
    for recording in recordings {
        let (x, t) = (&recording.x_mm, &recording.t_s);
        let strokes = strokes(recording);
        let mut from = 0;
        for stroke in strokes.chunk_by(|a, b| a == b) {
            // way, mm, and time, s, of the stroke in each bin
            let mut passed = [(0.0, 0.0); BINS];
            for i in from + 1..from + stroke.len() {
                let share = (x[i - 1] - low) / (high - low);
                let (way, time) =
                    &mut passed[((share.max(0.0) * BINS as f64) as usize).min(BINS - 1)];
                *way += x[i] - x[i - 1];
                *time += t[i] - t[i - 1];
            }
            for (bin, (way, time)) in passed.into_iter().enumerate() {
                if way != 0.0 && time > 0.0 {
                    speeds[bin + usize::from(way > 0.0) * BINS].push(way.abs() / time);
                }
            }
            from += stroke.len();
        }
    }
    let (mut differences, mut squares, mut freedom, mut count) = (0.0, 0.0, 0.0, 0.0);
    for of in speeds.iter().filter(|of| of.len() > 1) {
        let mean = of.iter().sum::<f64>() / of.len() as f64;
        differences += of.iter().map(|speed| (speed - mean).powi(2)).sum::<f64>();
        freedom += of.len() as f64 - 1.0;
        squares += of.len() as f64 * mean * mean;
        count += of.len() as f64;
    }
    // false for NaN
    differences / freedom < LEAST_DIFFERENCE.powi(2) * squares / count
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::read;

    /// Presses and releases of 4 mm at 100 Hz by an encoder of 5 µm, in 9 s each, each faster than the one before by a share.
    fn alike(rows: u32, faster: f64) -> bool {
        let mut text = String::from("t_s,x_mm,f_n\n");
        let mut phase: f64 = 0.0;
        for i in 0..rows {
            let cycle = (phase / std::f64::consts::TAU).floor();
            phase += 0.007 * (1.0 + faster * cycle);
            let x = ((2.0 - 2.0 * phase.cos()) / 0.005).round() * 0.005;
            text += &format!("{},{x},{x}\n", 0.01 * f64::from(i));
        }
        let recording = read("r", text.as_bytes()).unwrap();
        are_alike(&[&recording], recording.range_mm())
    }

    #[test]
    fn the_same_speed_at_every_place_is_alike_and_another_is_not() {
        assert!(alike(3600, 0.0));
        assert!(alike(3600, 0.01));
        assert!(!alike(3600, 0.3));
        // a single press and release are like no others
        assert!(!alike(890, 0.0));
    }
}
