//! Checks of what the tests assume: `ends/*` (ratings at the ends of the scale) and
//! `residuals/*` (the shape of what participants and realizations leave unexplained).

use super::cells::Cells;
use super::record::{RealizationName, Stat, statistics};
use std::collections::BTreeMap;
use study_stats::describe::{Sum, mean, shape};

statistics! {
    /// Ratings of a realization at the ends of the stated scale. A warning names realizations with more than half of their ratings at one end.
    pub struct Ends {
        /// share at the lowest end
        share_low: Stat,
        /// share at the highest end
        share_high: Stat,
        /// of the mean from the lowest end
        distance_low: Stat,
        /// of the mean from the highest end
        distance_high: Stat,
    }

    /// The shape of the residuals of the complete table: cell mean less the means of its row and column plus the grand mean; mᵣ are their central moments.
    pub struct Residuals {
        /// m₃/m₂^1.5
        skewness: Stat,
        /// m₄/m₂² − 3
        excess_kurtosis: Stat,
        /// the largest in units of √m₂
        largest: Stat,
    }
}

/// The ratings of a realization.
#[derive(Clone, Copy, Default)]
struct Rated {
    n: f64,
    low: f64,
    high: f64,
    sum: Sum,
}

/// By realization; empty without a scale.
pub(super) fn ends(
    cells: &Cells<'_>,
    scale: Option<(f64, f64)>,
) -> BTreeMap<RealizationName, Ends> {
    let Some((low, high)) = scale else {
        return BTreeMap::new();
    };
    let r = cells.ratings;
    let mut rated = vec![Rated::default(); r.models.len()];
    for &i in &cells.order {
        if let (Some(m), Some(rating)) = (r.model[i], r.rating[i]) {
            let own = &mut rated[m as usize];
            own.n += 1.0;
            own.low += f64::from(u8::from(rating <= low));
            own.high += f64::from(u8::from(rating >= high));
            own.sum.add(rating);
        }
    }
    let ends = rated.iter().enumerate().map(|(m, own)| {
        let or = |x: Option<f64>| Stat::or(x, "no ratings");
        let of = |x: f64| (own.n > 0.0).then(|| x / own.n);
        let mean = of(own.sum.get());
        let ends = Ends {
            share_low: or(of(own.low)),
            share_high: or(of(own.high)),
            distance_low: or(mean.map(|mean| mean - low)),
            distance_high: or(mean.map(|mean| high - mean)),
        };
        (cells.model_name(m).into(), ends)
    });
    ends.collect()
}

/// The residuals of the complete table: cell mean less the means of its row and column.
pub(super) fn residuals(cells: &Cells<'_>) -> Residuals {
    let table = cells.table(&cells.tested());
    let columns: Vec<f64> = (0..table.models.len())
        .filter_map(|j| mean(&table.column(j)))
        .collect();
    let center = mean(&columns).unwrap_or(0.0);
    let residuals: Vec<f64> = (table.rows.iter())
        .filter_map(|row| Some((row, mean(row)?)))
        .flat_map(|(row, own)| {
            row.iter()
                .zip(&columns)
                .map(move |(x, c)| x - own - c + center)
        })
        .collect();
    let size = residuals.iter().fold(0.0f64, |size, x| size.max(x.abs()));
    let varies = table.rows.len() > 1 && table.models.len() > 1 && size > 1e-12;
    let found = shape(&residuals).filter(|_| varies);
    let why = "fewer than two complete participants or realizations, or no residuals";
    Residuals {
        skewness: Stat::or(found.map(|f| f.skewness), why),
        excess_kurtosis: Stat::or(found.map(|f| f.excess_kurtosis), why),
        largest: Stat::or(found.map(|f| f.largest), why),
    }
}
