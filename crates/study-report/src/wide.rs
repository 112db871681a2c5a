//! `wide.csv`: one row for each participant, for programs with panels for repeated
//! measures.

use super::csv::{TableFile, number, table};
use std::collections::{BTreeMap, BTreeSet};
use study_analysis::analyze::{Analysis, MAX_PAIRED};

/// `wide.csv`.
pub fn file(analysis: &Analysis) -> TableFile {
    table("wide.csv", wide(analysis))
}

/// One row for each participant: the mean of each realization, then each rating. Only
/// the head for very many realizations.
fn wide(a: &Analysis) -> Vec<Vec<String>> {
    let mut cells: BTreeMap<(&str, &str), BTreeMap<u32, f64>> = BTreeMap::new();
    let mut repetitions: BTreeMap<&str, BTreeSet<u32>> = BTreeMap::new();
    let few = a.realizations.len() <= MAX_PAIRED;
    for row in a.rows.iter().filter(|r| few && r.excluded.is_none()) {
        if let Some(rating) = row.rating {
            let (subject, model) = (a.subject(row), a.model(row));
            let cell = cells.entry((subject, model)).or_default();
            cell.insert(row.repetition, rating);
            repetitions.entry(model).or_default().insert(row.repetition);
        }
    }
    let models = || a.realizations.iter().map(|m| m.id.as_str()).filter(|_| few);
    let single = |model: &str| repetitions.get(model).into_iter().flatten().copied();
    let mut head = vec!["subject".to_owned()];
    head.extend(models().map(|m| format!("mean_{m}")));
    head.extend(models().flat_map(|m| single(m).map(move |r| format!("rating_{m}_{r}"))));
    let mut rows = vec![head];
    let subjects: BTreeSet<&str> = cells.keys().map(|(subject, _)| *subject).collect();
    for subject in subjects {
        let cell = |model| cells.get(&(subject, model));
        let mut row = vec![subject.to_owned()];
        row.extend(
            models()
                .map(|m| number(cell(m).map(|all| all.values().sum::<f64>() / all.len() as f64))),
        );
        row.extend(models().flat_map(|m| {
            single(m).map(move |r| number(cell(m).and_then(|all| all.get(&r).copied())))
        }));
        rows.push(row);
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_analysis::analyze::{Rules, analyze};
    use study_session::outcome::ratings::Ratings;

    fn analysis(csv: &str) -> Analysis {
        let ratings = Ratings::read_csv("t.csv", csv.as_bytes(), None).unwrap();
        analyze(&ratings, &Rules::default())
    }

    #[test]
    fn a_wide_table_has_the_means_and_the_ratings_of_each_participant() {
        let csv =
            "subject,model,repetition,rating\nS1,a,1,2\nS1,a,2,5\nS1,b,1,3\nS2,b,1,7\nS2,a,2,\n";
        let rows = wide(&analysis(csv));
        let shown: Vec<String> = rows.iter().map(|r| r.join(",")).collect();
        assert_eq!(
            shown,
            [
                "subject,mean_a,mean_b,rating_a_1,rating_a_2,rating_b_1",
                "S1,3.5,3,2,5,3",
                "S2,,7,,,7",
            ]
        );
    }
}
