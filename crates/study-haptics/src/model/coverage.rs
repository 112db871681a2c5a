//! What the recordings of a realization carry: where they went, and how well they determine its
//! parameters.

/// Where the recordings of a realization went: a map over positions, speeds and directions.
#[derive(Debug, Clone, PartialEq)]
pub struct Coverage {
    /// The range of the map, mm, which is divided into equal places.
    pub x_mm: [f64; 2],
    /// The highest speed of each class of speeds, mm/s, ascending. A class begins where the one
    /// before it ends, the first one at 0.
    pub v_mm_s: Vec<f64>,
    /// For v > 0 and v < 0.
    pub directions: [Covered; 2],
    /// Strokes from the outer fifth of the range at one side to that at the other.
    pub full_strokes: u32,
    /// Strokes that began or ended between these.
    pub partial_strokes: u32,
    /// Where no recording went and the realization keeps the values of the nearest place where
    /// one did, mm.
    pub held_mm: Vec<[f64; 2]>,
}

/// The map of one direction.
#[derive(Debug, Clone, PartialEq)]
pub struct Covered {
    /// Highest speed in this direction, mm/s. The trained speed is that of either direction: [`Trained`](super::Trained).
    pub top_mm_s: f64,
    /// Number of samples by class of speeds, and in each by place.
    pub samples: Vec<Vec<u32>>,
}

/// What recordings say about one parameter, in its unit. Whatever is not known is `None`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Determined {
    /// Its estimate, of a parameter that varies with the position a mean one.
    pub value: Option<f64>,
    /// Standard error of the estimate.
    pub standard_error: Option<f64>,
    /// What it is at most, with a confidence of 99 %.
    pub upper_bound: Option<f64>,
    /// What it is known from.
    pub origin: Origin,
}

study_base::named! {
    /// What a parameter is known from.
    #[derive(Default)]
    Origin {
        /// The recordings that the force by position is from as well.
        #[default]
        Training = "training",
        /// Dynamic recordings, beside the force by position of others.
        Dynamic = "dynamic",
        /// The experimenter, who stated it: it was not identified.
        Stated = "stated",
    }
}

/// Most places and most classes of speeds of a map.
pub const MOST_CELLS: usize = 1000;

impl Coverage {
    /// An empty map of a range with equal places, and with classes of speeds that double up to
    /// the highest.
    pub fn empty(x_mm: [f64; 2], top_mm_s: f64, places: usize, classes: usize) -> Self {
        let halvings = (0..classes).rev();
        let covered = Covered {
            top_mm_s: 0.0,
            samples: vec![vec![0; places]; classes],
        };
        Self {
            x_mm,
            v_mm_s: halvings.map(|n| top_mm_s * 0.5f64.powi(n as i32)).collect(),
            directions: [covered.clone(), covered],
            full_strokes: 0,
            partial_strokes: 0,
            held_mm: Vec::new(),
        }
    }

    /// Adds a sample. One that rests, or lies beyond the map, belongs to no cell.
    pub fn add(&mut self, x_mm: f64, v_mm_s: f64) {
        let speed = v_mm_s.abs();
        let class = self.v_mm_s.partition_point(|top| *top < speed);
        let (Some(place), true) = (self.place(x_mm), speed > 0.0) else {
            return;
        };
        let covered = &mut self.directions[usize::from(v_mm_s < 0.0)];
        let Some(cell) = (covered.samples.get_mut(class)).and_then(|row| row.get_mut(place)) else {
            return;
        };
        *cell = cell.saturating_add(1);
        covered.top_mm_s = covered.top_mm_s.max(speed);
    }

    /// Number of places.
    pub fn places(&self) -> usize {
        self.directions[0].samples.first().map_or(0, Vec::len)
    }

    /// The place of a position; `None` beyond the map.
    fn place(&self, x_mm: f64) -> Option<usize> {
        let [low, high] = self.x_mm;
        let places = self.places();
        let share = (x_mm - low) / (high - low);
        let inside = (0.0..=1.0).contains(&share) && places > 0;
        inside.then(|| ((share * places as f64) as usize).min(places - 1))
    }

    /// The stretches of the map that no sample of a direction reached, mm: of v > 0 and v < 0.
    pub fn gaps_mm(&self) -> [Vec<[f64; 2]>; 2] {
        let [low, high] = self.x_mm;
        let places = self.places();
        let edge = |place: usize| low + (high - low) * place as f64 / places as f64;
        [0, 1].map(|direction| {
            let samples = &self.directions[direction].samples;
            let mut gaps: Vec<[f64; 2]> = Vec::new();
            for place in (0..places).filter(|place| samples.iter().all(|row| row[*place] == 0)) {
                match gaps.last_mut().filter(|gap| gap[1] == edge(place)) {
                    Some(gap) => gap[1] = edge(place + 1),
                    None => gaps.push([edge(place), edge(place + 1)]),
                }
            }
            gaps
        })
    }

    /// The same in another unit of length.
    pub(super) fn rescale(&mut self, by: f64) {
        let tops = self.directions.iter_mut().map(|of| &mut of.top_mm_s);
        let lengths = self.x_mm.iter_mut().chain(&mut self.v_mm_s).chain(tops);
        lengths.for_each(|length| *length *= by);
        self.held_mm
            .as_flattened_mut()
            .iter_mut()
            .for_each(|x| *x *= by);
    }

    /// The same at positions counted from elsewhere.
    pub(super) fn shift(&mut self, by_mm: f64) {
        let held = self.held_mm.as_flattened_mut().iter_mut();
        self.x_mm.iter_mut().chain(held).for_each(|x| *x += by_mm);
    }
}

impl Determined {
    /// The same in another unit.
    pub(super) fn rescale(&mut self, by: f64) {
        for known in [
            &mut self.value,
            &mut self.standard_error,
            &mut self.upper_bound,
        ] {
            *known = known.map(|number| number * by);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 10 mm in five places and speeds up to 80 mm/s in the classes 20, 40 and 80 mm/s.
    fn map() -> Coverage {
        Coverage::empty([0.0, 10.0], 80.0, 5, 3)
    }

    #[test]
    fn a_sample_counts_in_its_place_class_and_direction() {
        let mut map = map();
        assert_eq!(map.v_mm_s, [20.0, 40.0, 80.0]);
        for (x_mm, v_mm_s) in [(0.0, 20.0), (1.9, 20.1), (10.0, -79.0), (5.0, -10.0)] {
            map.add(x_mm, v_mm_s);
        }
        // at rest, beyond the range, too fast
        for (x_mm, v_mm_s) in [(5.0, 0.0), (10.1, 10.0), (5.0, 80.1)] {
            map.add(x_mm, v_mm_s);
        }
        let [positive, negative] = &map.directions;
        assert_eq!(positive.samples, [[1, 0, 0, 0, 0], [1, 0, 0, 0, 0], [0; 5]]);
        assert_eq!(negative.samples, [[0, 0, 1, 0, 0], [0; 5], [0, 0, 0, 0, 1]]);
        assert_eq!((positive.top_mm_s, negative.top_mm_s), (20.1, 79.0));
    }

    #[test]
    fn gaps_are_the_places_without_samples() {
        let mut map = map();
        for x_mm in [3.0, 7.0] {
            map.add(x_mm, 10.0);
        }
        for x_mm in [1.0, 3.0, 5.0, 7.0] {
            map.add(x_mm, -10.0);
        }
        let [positive, negative] = map.gaps_mm();
        assert_eq!(positive, [[0.0, 2.0], [4.0, 6.0], [8.0, 10.0]]);
        assert_eq!(negative, [[8.0, 10.0]]);
    }
}
