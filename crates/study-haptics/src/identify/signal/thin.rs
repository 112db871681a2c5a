//! Thinning of dwells: intervals in which the position does not change.
//!
//! The recursion along x forgets with every sample, also with samples of a dwell that
//! carry no new information: a long dwell inflates the covariance and erases earlier
//! estimates. Of every interval within a few encoder counts, only a few samples are
//! therefore kept, evenly spaced in time.

use crate::recording::Recording;

/// A dwell lasts as long as x stays this close to its first position, mm: two counts of a
/// 5 µm encoder.
const WITHIN_MM: f64 = 0.01;
/// Most samples kept of a dwell.
const KEEP: usize = 8;

/// The recording without most samples of its dwells, and the number of samples removed.
/// Filter first: the result has gaps in time.
pub fn thin(recording: &Recording) -> (Recording, usize) {
    let x = &recording.x_mm;
    let mut kept: Vec<usize> = Vec::with_capacity(x.len());
    let mut from = 0;
    while from < x.len() {
        let length = x[from..]
            .iter()
            .take_while(|later| (*later - x[from]).abs() <= WITHIN_MM)
            .count()
            .max(1);
        let few = length.min(KEEP);
        kept.extend((0..few).map(|i| from + i * length / few));
        from += length;
    }
    (recording.select(&kept), x.len() - kept.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up, a dwell of `rest` samples with a flickering count, down.
    fn recording(rest: usize) -> Recording {
        let up = (0..100).map(f64::from);
        let still = (0..rest).map(|i| 100.0 + if i % 2 == 0 { 0.0 } else { 0.005 });
        let down = (0..100).rev().map(f64::from);
        let mut text = String::from("t_s,x_mm,v_mm_s,a_m_s2,f_n\n");
        for (i, x) in up.chain(still).chain(down).enumerate() {
            text += &format!("{i},{x},{},{},{i}\n", i as f64 - 50.0, i % 3);
        }
        crate::recording::read("r", text.as_bytes()).unwrap()
    }

    #[test]
    fn a_dwell_is_thinned_and_a_motion_is_not() {
        let (thinned, removed) = thin(&recording(1000));
        assert_eq!(removed, 992);
        assert_eq!(thinned.len(), 208);
        let rest: Vec<f64> = thinned.t_s[100..108].to_vec();
        assert_eq!(
            rest,
            [100.0, 225.0, 350.0, 475.0, 600.0, 725.0, 850.0, 975.0]
        );
        assert_eq!(thinned.f_n, thinned.t_s);
    }

    #[test]
    fn without_a_dwell_nothing_is_removed() {
        let moving = recording(3);
        let (thinned, removed) = thin(&moving);
        assert_eq!((removed, thinned), (0, moving));
    }
}
