//! The answers that stand beside the three: the target, the forgetting factor, the
//! variance; and what `VAF predicts` leaves unsaid.

use super::super::apa;
use super::answers::{p, r};
use super::layout::{Paint, number, wrap};
use super::listed;
use study_base::text::Untrusted;
use study_core::analyze::{Analysis, PreregisteredRule};
use study_core::outcome::Role;

pub(super) fn headline(a: &Analysis, width: usize, paint: Paint) -> String {
    let mut out = String::new();
    for (question, sentences) in [
        ("Do they feel like the target?", target(a)),
        ("Does the forgetting factor matter?", memory(a)),
        ("Whose is the variance?", variance(a)),
    ] {
        if sentences.is_empty() {
            continue;
        }
        out += &paint.strong(question);
        out.push('\n');
        for s in sentences {
            out += &wrap(&s, width, "  ", "  ");
        }
        out.push('\n');
    }
    out
}

fn percent(x: f64) -> String {
    format!("{:.0} %", 100.0 * x)
}

fn target(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    let mut said = Vec::new();
    let best = listed(a)
        .0
        .iter()
        .filter_map(|m| Some((v.number(&format!("desc/{}/mean", m.id))?, m.id.as_str())))
        .max_by(|x, y| x.0.total_cmp(&y.0).then(y.1.cmp(x.1)))
        .map(|best| best.1);
    let Some(best) = best else {
        return said;
    };
    let get = |name: &str| v.number(&format!("realistic/{best}/{name}"));
    if let (Some(from), Some(share)) = (a.realistic_from, get("share")) {
        let ends = get("ci95_lo").zip(get("ci95_hi"));
        let ends = ends.map_or_else(String::new, |(low, high)| {
            format!(" [{}, {}]", percent(low), percent(high))
        });
        said.push(format!(
            "{}: {}{ends} of its ratings are {from} or higher{}.",
            Untrusted(best),
            percent(share),
            if a.changed(PreregisteredRule::RealisticFrom) {
                ", a bound changed after the study began"
            } else {
                ""
            }
        ));
    }
    for reference in a
        .realizations
        .iter()
        .filter(|m| m.role == Role::HiddenReference)
    {
        let get = |name: &str| v.number(&format!("reference/{}/{best}/{name}", reference.id));
        let Some(mean) = get("mean_diff") else {
            continue;
        };
        let ends = get("ci95_lo").zip(get("ci95_hi"));
        let ends = ends.map_or_else(String::new, |(low, high)| {
            format!(" [{}, {}]", number(low, 2), number(high, 2))
        });
        let within = match (get("margin"), get("p_tost")) {
            (Some(margin), Some(tost)) => {
                let later = match a.changed(PreregisteredRule::Margin) {
                    true => ", a margin changed after the study began",
                    false => "",
                };
                let verdict = if tost < 0.05 {
                    "equivalent"
                } else {
                    "not shown to be equivalent"
                };
                format!(
                    "; {verdict} within ±{margin}{later} (two one-sided t tests, p {})",
                    p(tost)
                )
            }
            _ => {
                let id = format!("reference/{}/{best}", reference.id);
                super::super::no_equivalence(a, &id)
                    .map_or_else(String::new, |why| format!("; {why}"))
            }
        };
        said.push(format!(
            "{} minus {}: {}{ends}{within}.",
            Untrusted(best),
            Untrusted(&reference.id),
            number(mean, 2)
        ));
    }
    said
}

fn memory(a: &Analysis) -> Vec<String> {
    let get = |name: &str| a.values.number(&format!("covariate/log10_memory/{name}"));
    let (Some(found), Some(df), Some(n)) = (get("r"), get("df"), get("n_models")) else {
        return Vec::new();
    };
    let unit = if get("in_mm") == Some(1.0) {
        "mm"
    } else {
        "samples"
    };
    let mut said = format!(
        "{}: mean rating against log10 of the memory ({unit}), r = {} over {n} realizations",
        apa::memory_verdict(found, get("p"), get("quadratic/p")),
        r(found)
    );
    if let Some(value) = get("p") {
        said += &format!(", t test with {df} df: p {}", p(value));
    }
    if let (Some(value), Some(df)) = (get("quadratic/p"), get("quadratic/df")) {
        said += &format!("; a curve beside the line, {df} df: p {}", p(value));
        said += " (two tests, each held against .025: the verdict goes by them)";
        if let (Some(f), Some(both)) = (get("quadratic/F"), get("quadratic/p_F")) {
            said += &format!(
                "; line and curve together, F(2, {df}) = {}, p {}",
                number(f, 2),
                p(both)
            );
        }
    }
    vec![format!("{said}.")]
}

fn variance(a: &Analysis) -> Vec<String> {
    let get = |name: &str| a.values.number(&format!("variance/share/{name}"));
    let (Some(subject), Some(model), Some(rest)) =
        (get("subject"), get("model"), get("interaction_and_noise"))
    else {
        return Vec::new();
    };
    let rest = match (get("interaction"), get("noise")) {
        (Some(i), Some(n)) => format!("their interaction {}, noise {}", percent(i), percent(n)),
        _ => format!("interaction and noise {}", percent(rest)),
    };
    vec![format!(
        "Participants {}, realizations {}, {rest}.",
        percent(subject),
        percent(model)
    )]
}
