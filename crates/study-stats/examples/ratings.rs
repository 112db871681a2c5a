//! Six subjects rate three realizations: means, Friedman's test and a mixed model.
#![allow(clippy::print_stdout)]

use study_stats::describe::{mean, sd};
use study_stats::friedman::friedman;
use study_stats::lmm::{
    CellSummary, Criterion, FixedEffects, LmmData, LmmError, RandomEffects, fit,
};

/// One row for each subject; each cell is the mean of the subject's ratings.
const RATINGS: [[f64; 3]; 6] = [
    [3.0, 5.0, 6.0],
    [2.0, 4.0, 4.0],
    [4.0, 4.0, 7.0],
    [1.0, 3.0, 5.0],
    [3.0, 6.0, 6.0],
    [2.0, 2.0, 5.0],
];

fn main() -> Result<(), LmmError> {
    for j in 0..3 {
        let column = RATINGS.map(|row| row[j]);
        if let (Some(mean), Some(sd)) = (mean(&column), sd(&column)) {
            println!("realization {j}: mean {mean:.2}, SD {sd:.2}");
        }
    }

    if let Some(test) = friedman(&RATINGS)
        && let (Some(chi2), Some(p)) = (test.chi2, test.exact_p)
    {
        println!("Friedman: χ²({}) = {chi2:.2}, exact p = {p:.5}", test.df);
    }

    // rating ~ realization + (1 | subject)
    let mut cells = Vec::new();
    for (subject, row) in RATINGS.iter().enumerate() {
        for (realization, &mean) in row.iter().enumerate() {
            cells.push(CellSummary {
                subject,
                realization,
                x: 0.0,
                n: 1,
                mean,
                within: 0.0,
            });
        }
    }
    let data = LmmData::new(&cells, FixedEffects::Realizations)?;
    let model = fit(&data, RandomEffects::default(), Criterion::Reml)?;
    let v = model.variances;
    println!(
        "variance of subjects {:.2}, of error {:.2}",
        v.intercept, v.error
    );
    if let Some(test) = model.f_test()
        && let (Some(df2), Some(p)) = (test.df2, test.p)
    {
        println!("F({}, {df2:.1}) = {:.2}, p = {p:.5}", test.df1, test.f);
    }
    Ok(())
}
