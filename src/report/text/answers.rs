//! The study's questions and their answers, in words with numbers.

use super::super::{MAX_PAIRED, apa, pairs, permuted, tied};
use super::layout::{Paint, number, wrap};
use super::{asked, listed};
use study_base::text::Untrusted;
use study_core::analyze::{Analysis, Value};
use study_stats::permutation::DRAWS;

pub(super) fn answers(a: &Analysis, width: usize, paint: Paint) -> String {
    let mut out = String::new();
    let mut answer = |question: String, sentences: Vec<String>| {
        if !sentences.is_empty() {
            out += &paint.strong(&question);
            out.push('\n');
            for s in sentences {
                out += &wrap(&s, width, "  ", "  ");
            }
            out.push('\n');
        }
    };
    answer("Which feels most real?".to_owned(), best(a));
    answer("Do the realizations differ?".to_owned(), differ(a));
    answer(format!("Does VAF predict {}?", asked(a)), predicts(a));
    answer("For these realizations only:".to_owned(), only_these(a));
    answer("Do order and learning matter?".to_owned(), order(a));
    out
}

/// A correlation: three decimals, no zero before the point.
pub(super) fn r(x: f64) -> String {
    let shown = format!("{x:.3}");
    match shown.strip_prefix("-0.") {
        Some("000") => ".000".to_owned(),
        Some(rest) => format!("−.{rest}"),
        None => shown
            .strip_prefix('0')
            .map_or(shown.clone(), str::to_owned)
            .replace('-', "−"),
    }
}

/// A probability with its sign.
pub(super) fn p(x: f64) -> String {
    if x < 0.00005 {
        "< .0001".to_owned()
    } else if x >= 0.99995 {
        "= 1".to_owned()
    } else {
        format!("= {}", format!("{x:.4}").trim_start_matches('0'))
    }
}

fn best(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    let mut ranked: Vec<(f64, &str)> = listed(a)
        .0
        .iter()
        .filter_map(|m| Some((v.number(&format!("desc/{}/mean", m.id))?, m.id.as_str())))
        .collect();
    ranked.sort_by(|x, y| y.0.total_cmp(&x.0).then(x.1.cmp(y.1)));
    let [(mean, first), (next_mean, second), ..] = ranked[..] else {
        return Vec::new();
    };
    if mean == next_mean {
        let best = ranked.iter().take_while(|(m, _)| *m == mean);
        let best: Vec<String> = best.map(|(_, id)| Untrusted(id).to_string()).collect();
        return vec![format!(
            "{} share the highest mean, {}.",
            apa::listing(&best),
            number(mean, 3)
        )];
    }
    let mut said = vec![format!(
        "{}: mean {}; next {} with {}.",
        Untrusted(first),
        number(mean, 3),
        Untrusted(second),
        number(next_mean, 3)
    )];
    let (low, high) = if first < second {
        (first, second)
    } else {
        (second, first)
    };
    let pair = format!("posthoc/{low}|{high}");
    let (pairs, least) = pairs(a);
    let over = match pairs.len() {
        1 => String::new(),
        n => format!(", Holm over {n} pairs"),
    };
    if let Some(holm) = v.number(&format!("{pair}/p_wilcoxon_exact_holm")) {
        let verdict = if holm < 0.05 {
            "These two differ"
        } else {
            "These data do not tell the two apart"
        };
        said.push(format!("{verdict} (Wilcoxon, exact{over}: p {}).", p(holm)));
        if let Some(least) = least.filter(|l| *l >= 0.05) {
            said.push(format!(
                "With so few participants that p cannot be below {}.",
                p(least).trim_start_matches("= ")
            ));
        }
    } else if pairs.is_empty() && ranked.len() > MAX_PAIRED {
        said.push("Pairs are tested of eight realizations at most.".to_owned());
    } else if v.number(&format!("{pair}/p_t")).is_none() {
        let why = super::super::no_pairs(a, low, high);
        said.push(format!("{}.", apa::capital(&Untrusted(&why).to_string())));
    }
    said
}

fn differ(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    let mut parts = Vec::new();
    let decides = v.number("rmanova/p_gg").or_else(|| v.number("friedman/p"));
    let verdict = match decides {
        Some(p) if p < 0.05 => "Yes: ",
        Some(_) => "Not shown: ",
        None => "",
    };
    if let (Some(f), Some(pg), Some(e)) = (
        v.number("rmanova/F"),
        v.number("rmanova/p_gg"),
        v.number("rmanova/eps_gg"),
    ) && let (Some(df1), Some(df2)) = (v.number("rmanova/df1"), v.number("rmanova/df2"))
    {
        parts.push(format!(
            "F({:.1}, {:.1}) = {}, p {} (Greenhouse–Geisser)",
            df1 * e,
            df2 * e,
            number(f, 2),
            p(pg)
        ));
    }
    if let (Some(chi2), Some(df)) = (v.number("friedman/chi2"), v.number("friedman/df")) {
        let exact = v.number("friedman/exact_p");
        let kind = if exact.is_some() { "exact p" } else { "p" };
        if let Some(value) = exact.or_else(|| v.number("friedman/p")) {
            // Closer than that of χ² where there is no exact one.
            let better = v
                .number("friedman/iman_davenport_p")
                .filter(|_| exact.is_none())
                .map_or_else(String::new, |x| format!(" (Iman–Davenport p {})", p(x)));
            let w = v
                .number("friedman/kendall_W")
                .map_or_else(String::new, |w| format!(", Kendall's W = {}", r(w)));
            parts.push(format!(
                "Friedman χ²({df}) = {}, {kind} {}{better}{w}",
                number(chi2, 2),
                p(value)
            ));
        }
    }
    if parts.is_empty()
        && let Some(m) = super::super::mixed_f(a)
    {
        let verdict = if m.p < 0.05 { "Yes" } else { "Not shown" };
        return vec![format!(
            "{verdict}: F({}, {}) = {}, p {} (linear mixed model of all ratings, Satterthwaite); {} \
             rated every realization.",
            number(m.df1, 0),
            number(m.df2, 1),
            number(m.f, 2),
            p(m.p),
            super::super::complete(a)
        )];
    }
    if parts.is_empty() {
        return Vec::new();
    }
    vec![format!("{verdict}{}.", parts.join("; "))]
}

fn predicts(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    let Some(pearson) = v.number("corr/pearson/r") else {
        // Without any VAF it is no question.
        let asked = a.realizations.iter().any(|m| m.vaf.is_some());
        return match v.get("corr/pearson/r") {
            Some(Value::Undefined(why)) if asked => vec![format!("Not to be said: {why}.")],
            _ => Vec::new(),
        };
    };
    let n = v.number("corr/n_models").unwrap_or(0.0);
    let decides = permuted(a, "pearson").map(|found| found.1);
    let verdict = match decides {
        Some(p) if p < 0.05 && pearson > 0.0 => "Those with a higher VAF are rated higher: ",
        Some(p) if p < 0.05 => "Those with a higher VAF are rated lower: ",
        Some(_) => "Not shown: ",
        None => "",
    };
    let needed = v
        .number("corr/pearson/critical_r")
        .map_or_else(String::new, |x| {
            format!("; a t test needs |r| above {}", r(x))
        });
    let mut said = vec![format!(
        "{verdict}r = {} over {n} realizations{}{}{needed}.",
        r(pearson),
        interval(a, "corr/pearson/ci95"),
        with_p(a, "pearson")
    )];
    if permuted(a, "pearson").is_some_and(|found| found.0 == "exact p") {
        said.extend(super::super::shared_vaf(a).map(|s| format!("{s}.")));
    }
    let tied = tied(a);
    if tied > 1 {
        said.push(format!(
            "{} of the {n} means have an equal among them: p cannot become so small then.",
            apa::capital(&apa::count(tied))
        ));
    }
    said.extend(crossed(a));
    if let Some(rho) = v.number("corr/spearman/rho") {
        said.push(format!(
            "By ranks: Spearman's rho = {}{}.",
            r(rho),
            with_p(a, "spearman")
        ));
    }
    let ends = v
        .number("corr/leave_one_out/pearson_min")
        .zip(v.number("corr/leave_one_out/pearson_max"));
    if let Some((low, high)) = ends {
        let care = if n < 8.0 {
            format!(
                " {} points: read with care.",
                apa::capital(&apa::count(n as usize))
            )
        } else {
            String::new()
        };
        said.push(format!(
            "Leave one out: r from {} to {}.{care}",
            r(low),
            r(high)
        ));
    } else if n < 8.0 {
        said.push(format!(
            "{} points: read with care.",
            apa::capital(&apa::count(n as usize))
        ));
    }
    said.extend(super::super::hangs_on(a).map(|s| Untrusted(&s).to_string()));
    said.extend(beside(a));
    said
}

/// The slope of the mixed model with subjects and realizations crossed.
fn crossed(a: &Analysis) -> Option<String> {
    let get = |id: &str| a.values.number(&format!("lmm_vaf_crossed/{id}"));
    let (slope, se) = get("slope").zip(get("slope_se"))?;
    let test = get("slope_satterthwaite_df").zip(get("slope_satterthwaite_p"));
    let test = test.map_or_else(String::new, |(df, value)| {
        format!(", {} df: p {}", number(df, 1), p(value))
    });
    let singular = match get("singular") {
        Some(1.0) if get("var_model").is_none_or(|v| v <= 0.0) => {
            " (no variance of the realizations is left: p is too small)"
        }
        _ => "",
    };
    Some(format!(
        "Crossed mixed model: slope {} per unit of VAF (SE {}){test}{singular}.",
        number(slope, apa::decimals(se, 2)),
        number(se, apa::decimals(se, 2))
    ))
}

/// Drift over the session and carry-over from the trial before.
fn order(a: &Analysis) -> Vec<String> {
    let effect = |id: &str, what: &str| {
        let get = |name: &str| a.values.number(&format!("{id}/{name}"));
        let (slope, se, value) = (get("slope")?, get("se")?, get("p")?);
        let digits = apa::decimals(se, 3);
        Some((
            value,
            format!("{} per {what}, p {}", number(slope, digits), p(value)),
        ))
    };
    let Some((drift, shown)) = effect("order_trial", "trial") else {
        return Vec::new();
    };
    let verdict = if drift < 0.05 {
        "Ratings drift"
    } else {
        "No drift shown"
    };
    let before = effect("order_previous_rating", "point of the rating before")
        .map_or_else(String::new, |(_, shown)| format!("; carry-over {shown}"));
    vec![format!("{verdict}: {shown}{before}.")]
}

/// What VAF goes along with over the realizations.
fn beside(a: &Analysis) -> Option<String> {
    let with = |id: &str, what: &str| {
        let found = a.values.number(&format!("covariate/{id}/r_with_vaf"))?;
        Some(format!("{what} at r = {}", r(found)))
    };
    let all: Vec<String> = [
        with("log10_memory", "log10 of the memory"),
        with("least_energy_j", "the least energy put in (activeness)"),
    ]
    .into_iter()
    .flatten()
    .collect();
    (!all.is_empty()).then(|| {
        format!(
            "VAF goes along with {}: what is said of one may be the other's.",
            all.join(" and with ")
        )
    })
}

fn interval(a: &Analysis, id: &str) -> String {
    let low = a.values.number(&format!("{id}_lo"));
    let high = a.values.number(&format!("{id}_hi"));
    low.zip(high).map_or_else(String::new, |(low, high)| {
        format!(", 95 % [{}, {}]", r(low), r(high))
    })
}

fn with_p(a: &Analysis, name: &str) -> String {
    let least = format!("corr/{name}/smallest_p_two_sided");
    let least = a.values.number(&least);
    let n = a.values.number("corr/n_models").unwrap_or(0.0);
    match (permuted(a, name), least) {
        (Some(("exact p", exact)), Some(least)) => format!(
            ", exact p {} (the smallest possible with {n} is {})",
            p(exact),
            apa::of_orders(least, n)
        ),
        (Some((kind, found)), _) if kind != "exact p" => {
            let smallest = DRAWS + 1;
            format!(
                ", {kind} {} (the smallest possible is 1/{smallest})",
                p(found)
            )
        }
        (Some((kind, found)), _) => format!(", {kind} {}", p(found)),
        (None, _) => String::new(),
    }
}

fn only_these(a: &Analysis) -> Vec<String> {
    let v = &a.values;
    let mut parts = Vec::new();
    if let Some(x) = v.number("rmcorr_cells/r") {
        let ends = interval(a, "rmcorr_cells/ci95");
        parts.push(format!(
            "rating and VAF within participants correlate at r = {}{ends}",
            r(x)
        ));
    }
    if let Some(x) = v.number("subject_corr/r_back") {
        parts.push(format!("on average over participants at r = {}", r(x)));
    }
    let ends = v
        .number("bootstrap/percentile_lo")
        .zip(v.number("bootstrap/percentile_hi"));
    if let Some((low, high)) = ends {
        parts.push(format!(
            "with participants drawn anew from these, 95 % of r are from {} to {} (bootstrap)",
            r(low),
            r(high)
        ));
    }
    if parts.is_empty() {
        return Vec::new();
    }
    vec![apa::capital(&format!(
        "{}. This says nothing about other realizations.",
        parts.join("; ")
    ))]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_and_probabilities_read_as_in_print() {
        assert_eq!(r(0.97436), ".974");
        assert_eq!(r(-0.5), "−.500");
        assert_eq!(r(1.0), "1.000");
        assert_eq!(r(-1.0), "−1.000");
        assert_eq!(r(-0.0001), ".000");
        assert_eq!(p(1.0 / 120.0), "= .0083");
        assert_eq!(p(1e-9), "< .0001");
        assert_eq!(apa::of_orders(2.0 / 120.0, 5.0), "2/120");
    }
}
