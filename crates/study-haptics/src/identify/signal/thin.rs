//! Dwells: stretches of time at one place.
//!
//! The recursion along x forgets with every sample, also with those that come from
//! one place and say nothing new: a long rest blows its covariance up and wipes
//! out what was known. So of every stretch that stays within a few encoder counts
//! only a few samples are kept, spread evenly over it.

use crate::recording::Recording;

/// What a dwell is and how much of it is kept.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dwell {
    /// A stretch lasts as long as x stays this near to where it began, mm.
    pub within_mm: f64,
    /// Most samples that are kept of it.
    pub keep: usize,
}

impl Default for Dwell {
    /// Two counts of a 5 µm encoder; eight samples.
    fn default() -> Self {
        Self {
            within_mm: 0.01,
            keep: 8,
        }
    }
}

/// The recording without most of its dwells, and how many samples went. At least
/// one sample of a stretch is kept; time then has gaps, so filter before.
pub fn thin(recording: &Recording, dwell: Dwell) -> (Recording, usize) {
    let x = &recording.x_mm;
    let most = dwell.keep.max(1);
    let mut kept: Vec<usize> = Vec::with_capacity(x.len());
    let mut from = 0;
    while from < x.len() {
        let length = x[from..]
            .iter()
            .take_while(|there| (*there - x[from]).abs() <= dwell.within_mm)
            .count()
            .max(1);
        let few = length.min(most);
        kept.extend((0..few).map(|i| from + i * length / few));
        from += length;
    }
    let gone = x.len() - kept.len();
    let pick = |column: &[f64]| kept.iter().map(|i| column[*i]).collect();
    let thinned = Recording {
        t_s: pick(&recording.t_s),
        x_mm: pick(&recording.x_mm),
        v_mm_s: pick(&recording.v_mm_s),
        a_m_s2: pick(&recording.a_m_s2),
        f_n: pick(&recording.f_n),
        ..recording.clone()
    };
    (thinned, gone)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Up, a rest of `rest` samples with a flickering count, down.
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
    fn a_rest_is_thinned_and_a_motion_is_not() {
        let (thinned, gone) = thin(&recording(1000), Dwell::default());
        assert_eq!(gone, 992);
        assert_eq!(thinned.len(), 208);
        let rest: Vec<f64> = thinned.t_s[100..108].to_vec();
        assert_eq!(
            rest,
            [100.0, 225.0, 350.0, 475.0, 600.0, 725.0, 850.0, 975.0]
        );
        assert_eq!(thinned.f_n, thinned.t_s);
    }

    #[test]
    fn without_a_rest_nothing_goes() {
        let moving = recording(3);
        let (thinned, gone) = thin(&moving, Dwell::default());
        assert_eq!((gone, thinned), (0, moving));
    }
}
