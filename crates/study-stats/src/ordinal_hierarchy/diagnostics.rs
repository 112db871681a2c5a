//! Whether chains agree, and how many independent draws they are worth.

use crate::describe::mean;

/// Whether draws can be relied upon.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Convergence {
    /// Draws of all chains.
    pub draws: usize,
    /// The largest split R̂ (Gelman et al. 2013, Bayesian Data Analysis, §11.4) of all numbers.
    pub r_hat: f64,
    /// The smallest effective number of draws (ibid., §11.5, with Geyer's 1992 initial monotone sequence).
    pub effective: f64,
}

impl Convergence {
    /// Why the model decides nothing; `None` if R̂ is at most 1.01 and there are 400 effective draws.
    pub fn problem(&self) -> Option<&'static str> {
        // Written so that a number that is not one is a problem.
        let [agree, enough] = [self.r_hat <= 1.01, self.effective >= 400.0];
        match (agree, enough) {
            (false, _) => Some("independent chains differ (R-hat above 1.01)"),
            (_, false) => Some("the effective number of draws is below 400"),
            _ => None,
        }
    }
}

/// Of all numbers, each by chain.
pub(super) fn convergence(traced: &[Vec<Vec<f64>>]) -> Convergence {
    let mut found = Convergence {
        draws: traced
            .first()
            .map_or(0, |chains| chains.iter().map(Vec::len).sum()),
        r_hat: 1.0,
        effective: f64::INFINITY,
    };
    for chains in traced {
        let halves: Vec<&[f64]> = (chains.iter())
            .flat_map(|chain| {
                let (first, second) = chain.split_at(chain.len() / 2);
                [first, &second[..first.len()]]
            })
            .collect();
        let (r_hat, effective) = of_halves(&halves);
        // A number that is not one stays.
        if r_hat > found.r_hat || r_hat.is_nan() {
            found.r_hat = r_hat;
        }
        if effective < found.effective || effective.is_nan() {
            found.effective = effective;
        }
    }
    found
}

fn of_halves(halves: &[&[f64]]) -> (f64, f64) {
    let (m, n) = (halves.len() as f64, halves.first().map_or(0, |h| h.len()));
    let means: Vec<f64> = halves.iter().map(|h| mean(h).unwrap_or(f64::NAN)).collect();
    // Autocovariances with denominator n, over the chains.
    let autocovariance = |lag: usize| {
        let of = |(half, mean): (&&[f64], &f64)| {
            let products = half.iter().zip(&half[lag..]);
            products.map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>() / n as f64
        };
        halves.iter().zip(&means).map(of).sum::<f64>() / m
    };
    let length = n as f64;
    let within = autocovariance(0) * length / (length - 1.0);
    let between = crate::describe::variance(&means).unwrap_or(f64::NAN);
    let total = within * (length - 1.0) / length + between;
    let r_hat = (total / within).sqrt();
    let correlation =
        |lag: usize| 1.0 - (within - autocovariance(lag) * length / (length - 1.0)) / total;
    // Sums of neighboring lags, as long as they are positive, and never larger than the ones before.
    let (mut sum, mut last) = (0.0, f64::INFINITY);
    for pair in 0..n / 2 {
        let two = correlation(2 * pair) + correlation(2 * pair + 1);
        if two.is_nan() || two <= 0.0 {
            break;
        }
        last = last.min(two);
        sum += last;
    }
    let time = (2.0 * sum - 1.0).max(1.0 / (m * length).log10());
    (r_hat, m * length / time)
}
