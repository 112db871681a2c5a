//! The second opinion of the ordinal hierarchical model, in sentences.

use crate::apa;
use study_analysis::analyze::Analysis;
use study_analysis::analyze::results::{Number as _, Probability};

/// A probability, and its range over the other priors.
fn probability(p: &Probability) -> Option<String> {
    let others = [&p.p_narrow, &p.p_wide].map(|p| p.number());
    let [Some(narrow), Some(wide)] = others else {
        return None;
    };
    Some(format!(
        "{} ({} and {} with effects half and twice as large before the ratings)",
        share(p.p.number()?),
        share(narrow),
        share(wide)
    ))
}

/// A probability with two decimals; 0 and 1 are never reached.
pub(crate) fn share(p: f64) -> String {
    match p {
        p if p < 0.005 => "< .01".to_owned(),
        p if p > 0.995 => "> .99".to_owned(),
        p => apa::share(p, 2),
    }
}

/// Which realization is probably the best.
pub(super) fn best(a: &Analysis) -> Option<String> {
    let model = a.results.posterior.as_ref()?;
    let found = model.realization.iter();
    let (name, of) = found.max_by(|x, y| {
        let p = |of: &Probability| of.p.number().unwrap_or(0.0);
        p(&x.1.best).total_cmp(&p(&y.1.best))
    })?;
    Some(format!(
        "Second opinion, which decides nothing: the posterior probability that {} is the best is {}.",
        name.as_str(),
        probability(&of.best)?
    ))
}

/// Whether the rating probably rises with VAF.
pub(super) fn vaf(a: &Analysis) -> Option<String> {
    let slope = a.results.posterior.as_ref()?.vaf.as_ref()?;
    Some(format!(
        "Second opinion, which decides nothing: the posterior probability that the rating rises with VAF is {}.",
        probability(&slope.above)?
    ))
}

/// Why there is no second opinion, if one was asked for.
pub(super) fn missing(a: &Analysis) -> Option<String> {
    let model = a.results.posterior.as_ref()?;
    let why = model.sd_participant.reason()?;
    Some(format!(
        "There is no second opinion by the ordinal model: {why}."
    ))
}

#[cfg(test)]
mod tests {
    use super::share;

    #[test]
    fn a_probability_is_never_0_or_1() {
        let found = [0.0, 0.004, 0.3, 0.996, 1.0].map(share);
        assert_eq!(found, ["< .01", "< .01", ".30", "> .99", "> .99"]);
    }
}
