//! Reading and writing plant files: the parameters of a target.
//!
//! TOML with `format = "study-plant/1"`. `like = "a"` (or `"b"`) starts from a built-in
//! target, of which the other keys override parameters; without `like` every key is
//! required. Reading is strict and reports every fault with its line;
//! [`Parameters::check`] rejects parameters that cannot be simulated.

use super::parameters::{Extremum, Parameters};
use std::fmt::Write as _;
use study_base::diagnostic::table::{self, Table, Value};
use study_base::diagnostic::{Fault, Findings};
use study_base::text::Untrusted;

/// The `format` of a plant file.
pub const FORMAT: &str = "study-plant/1";
/// Most valleys, and most crests.
const MAX_EXTREMA: usize = 100;

/// The numbers of a target by key.
fn numbers(p: &mut Parameters) -> [(&'static str, &mut f64); 21] {
    [
        ("slope", &mut p.slope),
        ("preload_n", &mut p.preload_n),
        ("preload_at_mm", &mut p.preload_at_mm),
        ("spring_n_per_mm", &mut p.spring_n_per_mm),
        ("ripple_n", &mut p.ripple_n),
        ("ripple_mm", &mut p.ripple_mm),
        ("friction", &mut p.friction),
        ("stribeck", &mut p.stribeck),
        ("stribeck_mm_s", &mut p.stribeck_mm_s),
        ("presliding_mm", &mut p.presliding_mm),
        ("bristle_n_s_per_m", &mut p.bristle_n_s_per_m),
        ("follower_n_s_per_m", &mut p.follower_n_s_per_m),
        ("pivot_n", &mut p.pivot_n),
        ("pivot_n_s_per_m", &mut p.pivot_n_s_per_m),
        ("handle_kg", &mut p.handle_kg),
        ("follower_kg", &mut p.follower_kg),
        ("backlash_mm", &mut p.backlash_mm),
        ("contact_n_per_mm", &mut p.contact_n_per_mm),
        ("contact_n_s_per_m", &mut p.contact_n_s_per_m),
        ("stop_n_per_mm", &mut p.stop_n_per_mm),
        ("stop_n_s_per_m", &mut p.stop_n_s_per_m),
    ]
}

/// Reads a plant file; `path` is for messages. `None` if and only if the findings
/// contain an error.
pub fn parse(path: &str, text: &str) -> (Option<Parameters>, Findings) {
    let (parameters, mut findings) = table::parse(path, text, read);
    if let Some(Err(bad)) = parameters.as_ref().map(Parameters::check) {
        findings.faults.push(Fault::error(bad.to_string()));
        return (None, findings);
    }
    (parameters, findings)
}

fn read(mut root: Table<'_, '_>) -> Option<Parameters> {
    if !root.has_format(FORMAT, "a plant file") {
        return None;
    }
    let like = root.value("like").map(|value| {
        let named = value.text().map(|name| (Parameters::named(&name), name));
        if let Some((None, name)) = &named {
            value.fault(
                Fault::error(format!("there is no built-in target `{}`", Untrusted(name)))
                    .hint("the built-in targets are `a` and `b`"),
            );
        }
        named.and_then(|(parameters, _)| parameters)
    });
    // without a built-in target every key is required
    let whole = like.is_none();
    let mut parameters = like.flatten().unwrap_or_else(Parameters::a);
    for (key, parameter) in numbers(&mut parameters) {
        if let Some(number) = value(&mut root, key, whole).and_then(|value| value.f64()) {
            *parameter = number;
        }
    }
    if let Some(stops) = value(&mut root, "stops_mm", whole).and_then(|v| pair(&v)) {
        parameters.stops_mm = stops;
    }
    if let Some(valleys) = value(&mut root, "valleys", whole).and_then(extrema) {
        parameters.valleys = valleys;
    }
    if let Some(crests) = value(&mut root, "crests", whole).and_then(extrema) {
        parameters.crests = crests;
    }
    root.finish();
    Some(parameters)
}

/// The value of a key, which may be `required`.
fn value<'d, 't>(root: &mut Table<'d, 't>, key: &str, required: bool) -> Option<Value<'d, 't>> {
    if required {
        root.required(key)
    } else {
        root.value(key)
    }
}

fn pair(value: &Value<'_, '_>) -> Option<[f64; 2]> {
    let numbers: Vec<f64> = value.array()?.iter().filter_map(Value::f64).collect();
    let pair = <[f64; 2]>::try_from(numbers).ok();
    pair.or_else(|| value.refuse("has to be two numbers"))
}

/// `[{ at_mm = 5, width_mm = 1.5 }, …]`
fn extrema(value: Value<'_, '_>) -> Option<Vec<Extremum>> {
    let all = value.array()?;
    if all.len() > MAX_EXTREMA {
        let n = all.len();
        return value.refuse(format_args!(
            "has {n} entries: at most {MAX_EXTREMA} are allowed"
        ));
    }
    all.into_iter()
        .map(|value| {
            let mut table = value.table()?;
            let at_mm = table.required("at_mm").and_then(|v| v.f64());
            let width_mm = table.required("width_mm").and_then(|v| v.f64());
            table.finish();
            Some(Extremum {
                at_mm: at_mm?,
                width_mm: width_mm?,
            })
        })
        .collect()
}

/// The text of a plant file, with every parameter.
pub fn write(parameters: &Parameters) -> String {
    let mut p = parameters.clone();
    let mut out = format!("format = \"{FORMAT}\"\n");
    for (key, extrema) in [("valleys", &p.valleys), ("crests", &p.crests)] {
        let extrema: Vec<String> = extrema
            .iter()
            .map(|e| format!("{{ at_mm = {:?}, width_mm = {:?} }}", e.at_mm, e.width_mm))
            .collect();
        // writing to a String cannot fail
        let _ = writeln!(out, "{key} = [{}]", extrema.join(", "));
    }
    let _ = writeln!(out, "stops_mm = {:?}", p.stops_mm);
    for (key, number) in numbers(&mut p) {
        let _ = writeln!(out, "{key} = {number:?}");
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn messages(text: &str) -> Vec<String> {
        let (parameters, findings) = parse("p.toml", text);
        assert_eq!(parameters.is_none(), findings.has_errors());
        findings.faults.iter().map(|f| f.message.clone()).collect()
    }

    #[test]
    fn a_written_plant_is_read_back() {
        for plant in [Parameters::a(), Parameters::b()] {
            let (read, findings) = parse("p.toml", &write(&plant));
            assert!(findings.faults.is_empty(), "{findings:?}");
            assert_eq!(read, Some(plant));
        }
    }

    #[test]
    fn keys_override_the_parameters_of_a_built_in_target() {
        let text = "format = \"study-plant/1\"\nlike = \"a\"\nslope = 0.4\ncrests = [{ at_mm = 12, width_mm = 0.5 }]\n";
        let plant = parse("p.toml", text).0.unwrap();
        let expected = Parameters {
            slope: 0.4,
            crests: vec![Extremum {
                at_mm: 12.0,
                width_mm: 0.5,
            }],
            ..Parameters::a()
        };
        assert_eq!(plant, expected);
    }

    #[test]
    fn all_faults_are_reported_at_once() {
        let text = "format = \"study-plant/1\"\nlike = \"c\"\nslop = 1\nfriction = \"x\"\nvalleys = [{ at_mm = 1 }]\nstops_mm = [1]\n";
        assert_eq!(
            messages(text),
            [
                "there is no built-in target `c`",
                "unknown key `slop` at the top level",
                "`friction` has to be a number, not text",
                "[valleys[0]] has no `width_mm`",
                "`stops_mm` has to be two numbers",
            ]
        );
        let physics = "format = \"study-plant/1\"\nlike = \"a\"\nfollower_kg = nan\n";
        assert_eq!(
            messages(physics),
            ["a target's follower mass has to be finite and above zero"]
        );
        assert!(messages("format = \"study-plant/1\"\n").len() >= 24);
        assert_eq!(
            messages("format = \"study-model/1\"\nx = 1\n"),
            ["this is not a study-plant/1 file"]
        );
    }
}
