//! Power: closed forms, and rates of simulated studies.

use super::GoldenError;
use rayon::prelude::*;
use serde_json::{Map, Value, json};
use study_analysis::power::{
    Assumptions, Cell, CellResult, Link, Scale, Settings, Test, Vaf, floor, merge, run_chunk,
};
use study_stats::power::covariate::{self, Design, Spread, Values};
use study_stats::power::{detectable_correlation, two_conditions};
use study_stats::proportion::clopper_pearson;

/// Studies of each simulated case.
const STUDIES: u64 = 20_000;

/// The cases of a file, each with its values.
pub(super) fn values(document: &Value) -> Result<Map<String, Value>, GoldenError> {
    let mut values = Map::new();
    for case in document["cases"].as_array().into_iter().flatten() {
        let id = case["id"].as_str().unwrap_or_default();
        let found = of_case(case).ok_or_else(|| GoldenError::Case {
            case: id.to_owned(),
            what: format!("kind {} has no result for this input", case["kind"]),
        })?;
        flatten(id, &found, &mut values);
    }
    Ok(values)
}

fn flatten(path: &str, value: &Value, into: &mut Map<String, Value>) {
    match value {
        Value::Object(entries) => {
            for (key, value) in entries {
                flatten(&format!("{path}/{key}"), value, into);
            }
        }
        Value::Array(items) => {
            for (i, value) in items.iter().enumerate() {
                flatten(&format!("{path}/{i}"), value, into);
            }
        }
        value => {
            into.insert(path.to_owned(), value.clone());
        }
    }
}

fn of_case(case: &Value) -> Option<Value> {
    let number = |key: &str| case[key].as_f64();
    let count = |key: &str| usize::try_from(case[key].as_u64()?).ok();
    let alpha = number("alpha");
    Some(match case["kind"].as_str()? {
        "two-conditions" => {
            let v = |key: &str| case["variances"][key].as_f64();
            let variances = two_conditions::Variances {
                residual: v("residual")?,
                realization: v("realization")?,
                subject: v("participant")?,
                interaction: v("participant_x_realization")?,
                realization_slope: v("realization_slope")?,
                subject_slope: v("participant_slope")?,
            };
            let design = match case["design"].as_str()? {
                "crossed" => two_conditions::Design::Crossed,
                "counterbalanced" => two_conditions::Design::Counterbalanced,
                "realizations-within-condition" => two_conditions::Design::RealizationsWithin,
                "participants-within-condition" => two_conditions::Design::SubjectsWithin,
                "both-within-condition" => two_conditions::Design::BothWithin,
                _ => return None,
            };
            let (p, q) = (count("participants")?, count("realizations")?);
            let d = number("effect_d")?;
            let e = two_conditions::expected(design, d, &variances, p, q, alpha?)?;
            json!({
                "ncp": e.ncp, "df": e.df, "power": e.power,
                "df_published": e.df_published, "power_published": e.power_published,
            })
        }
        "covariate" => {
            let vaf = list(&case["vaf"])?;
            let design = Design {
                slope: number("slope_per_sd")?,
                spread: spread(&case["sd"])?,
                subjects: Some(count("participants")?),
                realizations: vaf.len(),
                repetitions: count("repetitions")?,
                values: Values::Fixed,
            };
            let e = design.expected(alpha?)?;
            let mean = vaf.iter().sum::<f64>() / vaf.len() as f64;
            let squares: f64 = vaf.iter().map(|v| (v - mean).powi(2)).sum();
            json!({
                "vaf_sd": (squares / vaf.len() as f64).sqrt(),
                "df": e.df, "ncp": e.ncp, "slope_inflation": e.slope_inflation,
                "power": e.power, "size": e.size, "rho_observed": e.rho_observed,
                "reliability": e.reliability, "ci_half_width_per_sd": e.half_width,
                "rho_true": e.rho_true, "power_ceiling": e.ceiling,
                "type_s": e.type_s, "type_m": e.type_m,
            })
        }
        "least-realizations" => {
            let of = |values| {
                covariate::least_realizations(
                    number("rho_true")?,
                    number("target")?,
                    alpha?,
                    values,
                )
            };
            json!({ "fixed": of(Values::Fixed), "random": of(Values::Drawn) })
        }
        "random-vaf" => {
            let power = |values| {
                let design =
                    covariate::limit(number("rho_observed")?, count("realizations")?, values);
                Some(design.expected(alpha?)?.power)
            };
            json!({ "power": power(Values::Drawn), "power_fixed": power(Values::Fixed) })
        }
        "sensitivity" => json!({
            "rho_observed": detectable_correlation(count("realizations")?, number("target")?, alpha?),
        }),
        "clopper-pearson" => {
            let (x, n) = (case["successes"].as_u64()?, case["studies"].as_u64()?);
            let (low, high) = clopper_pearson(x, n, number("level")?)?;
            let p = x as f64 / n as f64;
            json!({ "low": low, "high": high, "mcse": (p * (1.0 - p) / n as f64).sqrt() })
        }
        "permutation-floor" => {
            let floor = floor(&list(&case["vaf"])?, alpha?)?;
            json!({ "smallest_p": floor.smallest_p, "can_reject": u8::from(floor.can_reject) })
        }
        "least-participants" => least_participants(case, alpha?)?,
        "simulated-covariate" => simulated(case)?,
        _ => return None,
    })
}

fn list(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

fn spread(sd: &Value) -> Option<Spread> {
    let of = |key: &str| sd[key].as_f64();
    Some(Spread {
        subject: of("participant")?,
        realization: of("realization")?,
        interaction: of("interaction")?,
        residual: of("residual")?,
        slope: of("slope_per_sd")?,
    })
}

/// The rows of `expected` say which designs are meant.
fn least_participants(case: &Value, alpha: f64) -> Option<Value> {
    let range = list(&case["participants"])?;
    let (first, last) = (*range.first()? as usize, *range.last()? as usize);
    let rows = case["expected"].as_array()?.iter().map(|row| {
        let design = Design {
            slope: case["slope_per_sd"].as_f64()?,
            spread: spread(&case["sd"])?,
            subjects: Some(first),
            realizations: usize::try_from(row["realizations"].as_u64()?).ok()?,
            repetitions: usize::try_from(row["repetitions"].as_u64()?).ok()?,
            values: Values::Fixed,
        };
        let least = |target| design.least_subjects(target, alpha, first..=last);
        Some(json!({
            "realizations": design.realizations, "repetitions": design.repetitions,
            "ceiling": design.expected(alpha)?.ceiling,
            "participants_for_0.8": least(0.8), "participants_for_0.9": least(0.9),
        }))
    });
    rows.collect::<Option<Vec<Value>>>().map(Value::Array)
}

fn simulated(case: &Value) -> Option<Value> {
    let number = |key: &str| case[key].as_f64();
    let count = |key: &str| usize::try_from(case[key].as_u64()?).ok();
    let listed = list(&case["vaf"])?;
    let ordinal = &case["ordinal"];
    let scale = match ordinal["link"].as_str() {
        None => Scale::Continuous,
        Some(link) => Scale::Ordinal {
            link: if link == "logit" {
                Link::Logit
            } else {
                Link::Probit
            },
            thresholds: list(&ordinal["thresholds"])?,
            from: 1,
        },
    };
    let cell = Cell {
        realizations: listed.len(),
        repetitions: count("repetitions")?,
        participants: count("participants")?,
    };
    let settings = Settings {
        assumptions: Assumptions {
            slope: number("slope_per_sd")?,
            smallest: None,
            mean: number("mean")?,
            spread: spread(&case["sd"])?,
            scale,
            vaf: Vaf::Listed,
            dropout: 0.0,
            missing: 0.0,
            reference: 0.0,
        },
        part: None,
        pilot: None,
        listed,
        margin: None,
        tests: vec![Test::Pearson, Test::Permutation, Test::Crossed],
        alpha: number("alpha")?,
        seed: 2007,
        studies: STUDIES,
    };
    let chunks: Vec<_> = (0..settings.chunks())
        .into_par_iter()
        .map(|i| run_chunk(&settings, &cell, i))
        .collect();
    let CellResult {
        tests,
        boundary_share,
        half_width,
        ..
    } = merge(&settings, cell, &chunks)?;
    let mut found = json!({
        "studies": STUDIES,
        "undefined": tests.iter().flat_map(|t| t.undefined.values()).max().unwrap_or(&0),
        "boundary_share": boundary_share,
        "mean_ci_half_width_per_sd": half_width,
    });
    for test in &tests {
        found[test.test.as_str()] = json!({ "rate": test.power, "mcse": test.mcse });
    }
    let pearson = tests.first()?;
    found["type_s"] = json!(pearson.type_s);
    found["type_m"] = json!(pearson.type_m);
    if settings.assumptions.scale == Scale::Continuous {
        let closed = study_analysis::power::closed(&settings, &cell)?;
        found["pearson_closed"] = json!(closed.power);
    }
    Some(found)
}
