//! The grids of a QUEST+ track whose function has a name.

use crate::procedure::{Function, Ladder, Parameter};
use crate::protocol::Method;

/// Most thresholds of a grid that is not given: more take time and tell nothing.
const MOST_THRESHOLDS: usize = 60;

/// Lapse rates of a grid that is not given.
pub(super) const LAPSES: [f64; 3] = [0.01, 0.03, 0.06];

/// The parameters of a named function whose grids are not given.
pub(in crate::protocol) fn usual_grids(
    function: &Function,
    method: Method,
    ladder: &Ladder,
    standard: Option<f64>,
) -> Vec<Parameter> {
    let grids = Grids {
        threshold: None,
        slope: None,
        guess: None,
        lapse: LAPSES.to_vec(),
    };
    grids.parameters(function, method, ladder, standard)
}

/// The grids of a QUEST+ track.
pub(super) struct Grids {
    pub(super) threshold: Option<Vec<f64>>,
    pub(super) slope: Option<Vec<f64>>,
    pub(super) guess: Option<Vec<f64>>,
    pub(super) lapse: Vec<f64>,
}

impl Grids {
    /// The parameters of a named function.
    pub(super) fn parameters(
        self,
        function: &Function,
        method: Method,
        ladder: &Ladder,
        standard: Option<f64>,
    ) -> Vec<Parameter> {
        let span = ladder.last() - ladder.first();
        let linear = *function == Function::Weibull;
        let threshold = self.threshold.unwrap_or_else(|| {
            let levels = ladder.levels().iter().copied();
            thinned(levels.filter(|level| !linear || *level > 0.0).collect())
        });
        let (location, width, slopes) = match function {
            Function::Normal | Function::NormalSymmetric => {
                let parts = [0.5, 0.3, 0.2, 0.12, 0.07, 0.04];
                ("mean", "sd", parts.map(|part| part * span))
            }
            Function::Logistic => {
                let steps = [2.0, 4.0, 7.0, 12.0, 20.0, 35.0];
                ("threshold", "slope", steps.map(|step| step / span))
            }
            function => {
                let slopes = [0.8, 1.3, 2.0, 3.0, 5.0, 8.0];
                let steeper = match function {
                    Function::Weibull => steepness(ladder, standard),
                    _ => 1.0,
                };
                ("threshold", "slope", slopes.map(|slope| slope * steeper))
            }
        };
        let guess = self.guess.unwrap_or_else(|| match method.guess_rate() {
            Some(rate) => vec![rate],
            None => vec![0.02, 0.08, 0.16, 0.3],
        });
        let mut parameters = vec![
            Parameter::new(location, threshold),
            Parameter::new(width, self.slope.unwrap_or_else(|| slopes.to_vec())),
        ];
        if *function != Function::NormalSymmetric {
            parameters.push(Parameter::new("gamma", guess));
        }
        parameters.push(Parameter::new("lambda", self.lapse));
        parameters
    }
}

/// Equally spaced ones of many values, both ends among them.
fn thinned(values: Vec<f64>) -> Vec<f64> {
    let last = values.len().saturating_sub(1);
    if last < MOST_THRESHOLDS {
        return values;
    }
    let steps = MOST_THRESHOLDS - 1;
    (0..=steps)
        .map(|i| values[(i * last + steps / 2) / steps])
        .collect()
}

/// How much steeper a Weibull function is over the level than over its distance from the
/// standard, at the middle of the ladder.
fn steepness(ladder: &Ladder, standard: Option<f64>) -> f64 {
    let center = 0.5 * (ladder.first() + ladder.last());
    let below = standard.filter(|s| *s > 0.0 && *s < center);
    below.map_or(1.0, |s| (center / (center - s)).min(10.0))
}
