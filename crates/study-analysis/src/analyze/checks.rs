//! Checks of what the tests assume: `ends/*` (ratings at the ends of the scale) and
//! `residuals/*` (the shape of what participants and realizations leave unexplained).

use super::Rules;
use super::cells::Cells;
use super::identifiers::group_id;
use super::values::Values;
use study_stats::describe::{Sum, mean, shape};

pub(super) fn checks(cells: &Cells<'_>, rules: &Rules, values: &mut Values) {
    if let Some(scale) = rules.scale {
        ends(cells, scale, values);
    }
    residuals(cells, values);
}

/// The ratings of a realization.
#[derive(Clone, Copy, Default)]
struct Rated {
    n: f64,
    low: f64,
    high: f64,
    sum: Sum,
}

fn ends(cells: &Cells<'_>, (low, high): (f64, f64), values: &mut Values) {
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
    for (m, own) in rated.iter().enumerate() {
        let of = |x: f64| (own.n > 0.0).then(|| x / own.n);
        let mut g = values.group(group_id("ends", &[cells.model_name(m)]), "no ratings");
        g.maybe("share_low", of(own.low));
        g.maybe("share_high", of(own.high));
        let mean = of(own.sum.get());
        g.maybe("distance_low", mean.map(|mean| mean - low));
        g.maybe("distance_high", mean.map(|mean| high - mean));
    }
}

/// The residuals of the complete table: cell mean less the means of its row and column.
fn residuals(cells: &Cells<'_>, values: &mut Values) {
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
    let mut g = values.group("residuals", why);
    g.maybe("skewness", found.map(|f| f.skewness));
    g.maybe("excess_kurtosis", found.map(|f| f.excess_kurtosis));
    g.maybe("largest", found.map(|f| f.largest));
}
