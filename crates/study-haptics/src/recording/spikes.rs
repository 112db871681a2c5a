//! Samples that differ from their neighbors as no motion does, and snaps, which only look like it.

/// A sample is a spike if it differs from the median of its neighborhood by more than this
/// share of the range that most samples cover …
const SPIKE_SHARE: f64 = 0.2;
/// … and by this many times what is usual.
const SPIKE_RATIO: f64 = 50.0;
/// Samples on either side of a sample in its neighborhood.
const REACH: usize = 3;
/// Events at positions within this share of the travel are at the same place.
const SAME_PLACE: f64 = 0.03;
/// At least so many events at one place, and this share of all, recur.
const RECUR: usize = 3;
const RECUR_SHARE: f64 = 0.5;
/// Samples before and after an event whose medians are compared.
const LEVEL: usize = 5;
/// The force stays elsewhere if its medians differ by this share of the event.
const STAYS: f64 = 0.5;

/// Why a jump of the force is the target's own.
const RECURS: &str = "at the same place in several passes";
const REMAINS: &str = "and stays there";

/// What looks like spikes of the force.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Jumps {
    /// Samples that are no measurement.
    pub(super) spikes: Vec<usize>,
    /// The number of snaps, the sample of the first, and how they are known.
    pub(super) snaps: Option<(usize, usize, &'static str)>,
}

/// The samples of a column that differ from all their neighbors as no motion does.
pub(super) fn spikes(values: &[f64]) -> Vec<usize> {
    if values.len() < 20 * REACH {
        return Vec::new();
    }
    let mut around = Vec::with_capacity(2 * REACH + 1);
    let away: Vec<f64> = (0..values.len())
        .map(|i| {
            let (from, to) = (i.saturating_sub(REACH), (i + REACH + 1).min(values.len()));
            around.clear();
            around.extend_from_slice(&values[from..to]);
            (values[i] - median(&mut around)).abs()
        })
        .collect();
    let reach = usual_range(values);
    let mut usual = away.clone();
    usual.sort_by(f64::total_cmp);
    // of the larger ones, because most samples of a slow signal are their own median
    let usual = usual[(usual.len() - 1) * 9 / 10];
    let least = (SPIKE_SHARE * reach).max(SPIKE_RATIO * usual);
    (0..values.len()).filter(|i| away[*i] > least).collect()
}

/// The jumps of the force: a snap recurs at its place in the travel, or the force stays elsewhere behind
/// it; an error of the measurement does neither.
pub(super) fn jumps(x_mm: &[f64], f_n: &[f64]) -> Jumps {
    let found = spikes(f_n);
    let mut events: Vec<(usize, usize)> = Vec::new();
    for at in found.iter().copied() {
        match events.last_mut() {
            Some((_, last)) if at <= *last + REACH => *last = at,
            _ => events.push((at, at)),
        }
    }
    if events.is_empty() {
        return Jumps::default();
    }
    let travel_mm = usual_range(x_mm);
    let mut places: Vec<f64> = events.iter().map(|(first, _)| x_mm[*first]).collect();
    places.sort_by(f64::total_cmp);
    let below = |x: f64| places.partition_point(|place| *place < x);
    let recurs = |(first, _): &(usize, usize)| {
        let (at, reach) = (x_mm[*first], SAME_PLACE * travel_mm);
        let count = below(at + reach) - below(at - reach);
        count >= RECUR && count as f64 >= RECUR_SHARE * events.len() as f64
    };
    let remains = |(first, last): &(usize, usize)| {
        let (Some(from), to) = (first.checked_sub(LEVEL), last + 1 + LEVEL) else {
            return false;
        };
        if to > f_n.len() {
            return false;
        }
        let before = median(&mut f_n[from..*first].to_vec());
        let after = median(&mut f_n[last + 1..to].to_vec());
        let most = (*first..=*last)
            .map(|i| (f_n[i] - before).abs())
            .fold(0.0, f64::max);
        (after - before).abs() > STAYS * most
    };
    let mut jumps = Jumps::default();
    for event in &events {
        let why = match (recurs(event), remains(event)) {
            (true, _) => Some(RECURS),
            (false, true) => Some(REMAINS),
            (false, false) => None,
        };
        match (why, &mut jumps.snaps) {
            (None, _) => {
                let inside = |at: &&usize| (event.0..=event.1).contains(*at);
                jumps.spikes.extend(found.iter().filter(inside));
            }
            (Some(_), Some((count, ..))) => *count += 1,
            (Some(why), none) => *none = Some((1, event.0, why)),
        }
    }
    jumps
}

/// The range that most values cover, whatever a spike does.
fn usual_range(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
    at(0.99) - at(0.01)
}

fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ten strokes over 20 mm with a spring; `snap` adds a jump of two samples at 7 mm of each press.
    fn strokes(snap: bool) -> (Vec<f64>, Vec<f64>) {
        let x: Vec<f64> = (0..20_000)
            .map(|i| 10.0 - 10.0 * (3.15e-3 * f64::from(i)).cos())
            .collect();
        let mut f: Vec<f64> = x.iter().map(|x| 0.2 * x).collect();
        for i in 1..x.len() - 2 {
            if snap && x[i - 1] < 7.0 && x[i] >= 7.0 {
                f[i] -= 3.0;
                f[i + 1] += 2.0;
            }
        }
        (x, f)
    }

    #[test]
    fn a_jump_at_the_same_place_of_every_pass_is_a_snap_and_one_elsewhere_is_a_spike() {
        let (x, mut f) = strokes(true);
        f[777] = 60.0;
        let jumps = jumps(&x, &f);
        assert_eq!(jumps.spikes, [777]);
        let (count, first, why) = jumps.snaps.unwrap();
        assert_eq!((count, why), (10, RECURS));
        assert!((x[first] - 7.0).abs() < 0.1);
    }

    #[test]
    fn a_force_that_stays_elsewhere_behind_its_overshoot_is_a_snap() {
        let (x, mut f) = strokes(false);
        let from = 700;
        f[from] += 5.0;
        f[from + 1..].iter_mut().for_each(|f| *f += 3.0);
        let jumps = jumps(&x, &f);
        assert_eq!(jumps.spikes, [0_usize; 0]);
        assert_eq!(jumps.snaps, Some((1, from, REMAINS)));
    }

    #[test]
    fn spikes_at_random_places_are_spikes() {
        let (x, mut f) = strokes(false);
        let at = [1234, 5000, 5601, 9377, 15_801];
        for i in at {
            f[i] = -40.0;
        }
        let jumps = jumps(&x, &f);
        assert_eq!(jumps.spikes, at);
        assert_eq!(jumps.snaps, None);
    }
}
