//! The factors of a table from elsewhere: a column for each.

use std::collections::BTreeMap;
use std::io::{self, BufRead};
use study_plan::protocol::factors::{MAX_COMBINATIONS, MAX_FACTORS};
use study_plan::protocol::{Crossing, Factor};
use study_session::outcome::ratings::RatingsError;

/// The column of the realizations.
const MODEL: &str = "model";

/// A table of ratings whose realizations have levels of factors, and their crossing. A table without a column
/// `model` gets one: its realizations are the combinations of levels. A table that is no CSV stays as it
/// is, so that reading it says what is wrong.
///
/// # Errors
/// If the input cannot be read, if the table lacks the column of a factor, or if a cell holds another level
/// than those of the factor, or another one than the realization had before.
pub(super) fn with_factors(
    name: &str,
    mut input: impl BufRead,
    factors: &[Factor],
) -> Result<(Vec<u8>, Crossing), RatingsError> {
    let mut bytes = Vec::new();
    let failed = |source: io::Error| RatingsError::Csv {
        name: name.to_owned(),
        source: source.into(),
    };
    input.read_to_end(&mut bytes).map_err(failed)?;
    let mut levels_of = BTreeMap::new();
    let changed = rows(name, &bytes, factors, &mut levels_of)?;
    let crossing = Crossing::full(factors.to_vec(), levels_of);
    Ok((changed.unwrap_or(bytes), crossing))
}

/// The rows with their realization; `None` if the table has that, or is no CSV.
fn rows(
    name: &str,
    bytes: &[u8],
    factors: &[Factor],
    levels_of: &mut BTreeMap<String, Vec<usize>>,
) -> Result<Option<Vec<u8>>, RatingsError> {
    let mut reader = csv::ReaderBuilder::new().flexible(true).from_reader(bytes);
    let Ok(header) = reader.headers().cloned() else {
        return Ok(None);
    };
    let named = |column: &str| {
        let same = |h: &str| h.trim_start_matches('\u{feff}').trim() == column;
        header.iter().position(same)
    };
    let mut places = Vec::new();
    for factor in factors {
        let column = factor.id.as_str();
        let near = |h: &&str| h.trim().eq_ignore_ascii_case(column);
        places.push(named(column).ok_or_else(|| RatingsError::NoColumn {
            name: name.to_owned(),
            column: column.to_owned(),
            near: header.iter().find(near).map(str::to_owned),
            expected: "subject,rating and a column for each factor; model is optional",
        })?);
    }
    let model = named(MODEL);
    let mut writer = csv::Writer::from_writer(Vec::new());
    let mut put = |record: &csv::StringRecord, model: &str| {
        writer.write_record(record.iter().chain([model])).is_ok()
    };
    let mut whole = put(&header, MODEL);
    for record in reader.records() {
        let Ok(record) = record else {
            return Ok(None);
        };
        let line = record.position().map_or(0, csv::Position::line);
        let refused = |at: usize, wanted: String| RatingsError::Field {
            name: name.to_owned(),
            line,
            column: header.get(at).unwrap_or_default().to_owned(),
            field: record.get(at).unwrap_or_default().to_owned(),
            wanted,
        };
        let mut levels = Vec::new();
        for (factor, &at) in factors.iter().zip(&places) {
            let given = record.get(at).unwrap_or_default().trim();
            let found = factor.levels.iter().position(|level| level == given);
            levels.push(found.ok_or_else(|| {
                refused(
                    at,
                    format!("one of the levels {}", factor.levels.join(", ")),
                )
            })?);
        }
        let own = match model {
            Some(at) => record.get(at).unwrap_or_default().trim().to_owned(),
            None => {
                let names = factors.iter().zip(&levels);
                let names: Vec<&str> = names.map(|(f, l)| f.levels[*l].as_str()).collect();
                names.join(", ")
            }
        };
        if let Some(before) = levels_of.get(&own).filter(|before| **before != levels) {
            let differs = (0..factors.len())
                .find(|i| before[*i] != levels[*i])
                .unwrap_or(0);
            let level = &factors[differs].levels[before[differs]];
            return Err(refused(
                places[differs],
                format!("`{level}`, as for the same model before"),
            ));
        }
        whole &= put(&record, &own);
        if !own.is_empty() {
            levels_of.insert(own, levels);
        }
    }
    let written = writer
        .into_inner()
        .ok()
        .filter(|_| whole && model.is_none());
    Ok(written)
}

/// Reads a factor as it is given to a command: `friction=low,high`.
///
/// # Errors
/// What is wrong with it, in words.
///
/// ```
/// # use study_analysis::study::factor;
/// let found = factor("friction=low,high").unwrap();
/// assert_eq!(found.levels, ["low", "high"]);
/// assert!(factor("friction=low").is_err());
/// ```
pub fn factor(text: &str) -> Result<Factor, String> {
    let Some((id, levels)) = text.split_once('=') else {
        return Err(
            "name the column and its levels in their order, such as friction=low,high".to_owned(),
        );
    };
    let levels: Vec<String> = levels.split(',').map(|l| l.trim().to_owned()).collect();
    let id = id.trim().parse().map_err(|bad| format!("{bad}"))?;
    if levels.len() < 2 || levels.iter().any(String::is_empty) {
        return Err(format!(
            "`{id}` needs two levels or more, such as {id}=low,high"
        ));
    }
    let twice = (levels.iter().enumerate()).find(|(i, level)| levels[..*i].contains(level));
    if let Some((_, level)) = twice {
        return Err(format!("the level `{level}` of `{id}` is there twice"));
    }
    Ok(Factor { id, levels })
}

/// Refuses more factors or combinations than are analyzed, and a factor that is there twice.
///
/// # Errors
/// What is wrong, in words.
pub fn check_factors(factors: &[Factor]) -> Result<(), String> {
    let combinations = (factors.iter()).fold(1_usize, |n, f| n.saturating_mul(f.levels.len()));
    let twice =
        (factors.iter().enumerate()).find(|(i, f)| factors[..*i].iter().any(|o| o.id == f.id));
    if let Some((_, factor)) = twice {
        return Err(format!("the factor `{}` is there twice", factor.id));
    }
    if factors.len() > MAX_FACTORS || combinations > MAX_COMBINATIONS {
        return Err(format!(
            "{} factors with {combinations} combinations of levels are more than {MAX_FACTORS} factors or {MAX_COMBINATIONS} combinations",
            factors.len()
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two() -> Vec<Factor> {
        ["friction=low,high", "detent=soft,crisp"]
            .map(|f| factor(f).unwrap())
            .to_vec()
    }

    #[test]
    fn realizations_are_the_combinations_where_no_column_names_them() {
        let table = "subject,friction,detent,rating\nP1,low,crisp,4\nP1,high,\"soft\",5\n";
        let (bytes, crossing) = with_factors("t.csv", table.as_bytes(), &two()).unwrap();
        let text = String::from_utf8(bytes).unwrap();
        assert_eq!(
            text,
            "subject,friction,detent,rating,model\nP1,low,crisp,4,\"low, crisp\"\nP1,high,soft,5,\"high, soft\"\n"
        );
        assert_eq!(crossing.levels_of["low, crisp"], [0, 1]);
        assert_eq!(crossing.effects.len(), 3);
    }

    #[test]
    fn a_column_of_realizations_stays() {
        let table = "subject,model,friction,detent,rating\nP1,m1,low,crisp,4\nP2,m1,low,crisp,4\n";
        let (bytes, crossing) = with_factors("t.csv", table.as_bytes(), &two()).unwrap();
        assert_eq!(bytes, table.as_bytes());
        assert_eq!(crossing.levels_of["m1"], [0, 1]);
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        for (table, told) in [
            (
                "subject,Friction,detent,rating\n",
                "no column `friction` (rename `Friction`)",
            ),
            (
                "subject,friction,detent,rating\nP1,low,crisp,4\nP1,lo,crisp,4\n",
                "line 3: `lo` in column `friction` is not one of the levels low, high",
            ),
            (
                "subject,model,friction,detent,rating\nP1,m,low,crisp,4\nP2,m,high,crisp,4\n",
                "line 3: `high` in column `friction` is not `low`",
            ),
        ] {
            let error = with_factors("t.csv", table.as_bytes(), &two()).unwrap_err();
            assert!(error.to_string().contains(told), "{error}");
        }
    }

    #[test]
    fn a_factor_has_two_levels_and_a_name() {
        for (text, told) in [
            ("friction", "such as friction=low,high"),
            ("friction=low", "two levels or more"),
            ("friction=low,,high", "two levels or more"),
            (
                "friction=low,high,low",
                "`low` of `friction` is there twice",
            ),
            ("a b=low,high", "a b"),
        ] {
            assert!(factor(text).unwrap_err().contains(told), "{text}");
        }
        let twice = [two(), two()].concat();
        assert!(check_factors(&twice).unwrap_err().contains("twice"));
        let many: Vec<Factor> = (0..6)
            .map(|i| factor(&format!("f{i}=a,b")).unwrap())
            .collect();
        assert!(check_factors(&many).unwrap_err().contains("6 factors"));
    }
}
