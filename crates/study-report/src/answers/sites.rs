//! Do the sites of a pooled analysis agree?

use super::Answer;
use crate::{apa, sentences};
use study_analysis::analyze::results::Number as _;
use study_analysis::analyze::{Analysis, Question};

pub(super) fn sites(a: &Analysis) -> Vec<Answer> {
    [realizations(a), vaf(a), level(a)]
        .into_iter()
        .flatten()
        .collect()
}

fn realizations(a: &Analysis) -> Option<Answer> {
    let (mut answer, f) = Answer::to(a, &Question::SiteRealizations)?;
    if let Some(effect) = f.effect {
        let share = apa::share(effect.value, 2);
        answer.main.push(format!("Partial η² = {share}."));
    }
    for site in &a.sites {
        let means = (a.results.evidence.sites.as_ref()?)
            .site_mean
            .get(site.as_str());
        let means: Vec<String> = (a.tested())
            .filter_map(|m| {
                let mean = means?.get(m.id.as_str())?.mean.number()?;
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
    let (mut answer, _) = Answer::to(a, &Question::SiteVaf)?;
    for site in &a.sites {
        let of_site =
            (a.results.evidence.sites.as_ref()).and_then(|s| s.vaf.by_site.get(site.as_str()));
        let Some((of_site, (r, p))) =
            of_site.and_then(|s| Some((s, s.r.number().zip(s.p_two_sided.number())?)))
        else {
            continue;
        };
        let per = |x: f64| apa::two(x / 100.0);
        let slope = of_site.slope.number().map_or_else(String::new, |slope| {
            let ci = sentences::ci(&of_site.slope_ci95, per);
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
    let (mut answer, f) = Answer::to(a, &Question::SiteLevel)?;
    let means: Vec<String> = (a.sites.iter())
        .filter_map(|site| {
            let found = (a.results.evidence.sites.as_ref()?)
                .site
                .get(site.as_str())?;
            let (mean, n) = (found.mean.number()?, found.n.number()?);
            let ci = sentences::ci(&found.ci95, apa::two);
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
