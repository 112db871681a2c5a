//! Do the sites of a pooled analysis agree?

use super::Answer;
use crate::{apa, sentences};
use study_analysis::analyze::{Analysis, Finding, Question, group_id};

pub(super) fn sites(a: &Analysis) -> Vec<Answer> {
    [realizations(a), vaf(a), level(a)]
        .into_iter()
        .flatten()
        .collect()
}

/// Verdict, result and test.
fn tested(f: &Finding, verdict: &str) -> String {
    let name = (f.test.as_ref()).map_or("", |t| sentences::test_name(t.kind));
    let result = sentences::result(f).unwrap_or_default();
    let n = sentences::participants(f.participants);
    format!("{verdict}, {result} ({name}, {n}).")
}

fn realizations(a: &Analysis) -> Option<Answer> {
    let f = a.finding(&Question::SiteRealizations)?;
    let question = "Do the differences between realizations depend on the site?";
    let mut answer = Answer::of(question, f, |verdict| tested(f, verdict));
    if let Some(effect) = f.effect {
        let share = apa::share(effect.value, 2);
        answer.main.push(format!("Partial η² = {share}."));
    }
    for site in &a.sites {
        let means: Vec<String> = (a.tested())
            .filter_map(|m| {
                let mean = a.about("site_mean", &[site, &m.id], "mean")?;
                Some(format!("{} {}", m.id, apa::two(mean)))
            })
            .collect();
        if !means.is_empty() {
            answer
                .more
                .push(format!("Means at {site}: {}.", means.join(", ")));
        }
    }
    Some(answer)
}

fn vaf(a: &Analysis) -> Option<Answer> {
    let f = a.finding(&Question::SiteVaf)?;
    let question = "Does the effect of VAF depend on the site?";
    let mut answer = Answer::of(question, f, |verdict| tested(f, verdict));
    for site in &a.sites {
        let get = |what: &str| a.about("site_vaf", &[site], what);
        let Some((r, p)) = get("r").zip(get("p_two_sided")) else {
            continue;
        };
        let per = |x: f64| apa::two(x / 100.0);
        let slope = get("slope").map_or_else(String::new, |slope| {
            let id = format!("{}/slope_ci95", group_id("site_vaf", &[site]));
            let ci = sentences::ci(a, &id, per);
            format!(
                "; the slopes of its participants have the mean {} per .01 of VAF{ci}",
                per(slope)
            )
        });
        answer.main.push(format!(
            "{site}: r = {}, permutation p {}{slope}.",
            apa::r(r),
            apa::p_beside(p, a.alpha)
        ));
    }
    answer.more.push(
        "Participants' slopes hold for these realizations only; more sites do not make more \
         realizations."
            .to_owned(),
    );
    Some(answer)
}

fn level(a: &Analysis) -> Option<Answer> {
    let f = a.finding(&Question::SiteLevel)?;
    let mut answer = Answer::of("Do the sites differ in their mean rating?", f, |verdict| {
        tested(f, verdict)
    });
    let means: Vec<String> = (a.sites.iter())
        .filter_map(|site| {
            let mean = a.about("site", &[site], "mean")?;
            let n = a.about("site", &[site], "n")?;
            let ci = sentences::ci(a, &format!("{}/ci95", group_id("site", &[site])), apa::two);
            Some(format!("{site} {}{ci} (n = {n})", apa::two(mean)))
        })
        .collect();
    if !means.is_empty() {
        answer.main.push(format!("Means: {}.", means.join("; ")));
    }
    if let Some(e) = f.estimate {
        answer.main.push(format!(
            "Difference: {}.",
            sentences::estimate(&e, apa::two)
        ));
    }
    Some(answer)
}
