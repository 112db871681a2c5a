//! Answers to the study's questions, for the terminal page and the report: the findings
//! of the analysis, in sentences.

mod conditional;
mod factors;
mod outcomes;
mod pairs;
mod posterior;
mod sites;
mod target;
mod vaf;

pub(super) use conditional::conditional;
pub(super) use posterior::share;

use super::{apa, sentences, wording};
use study_analysis::analyze::results::Number;
use study_analysis::analyze::{Analysis, Finding, Question};
use study_base::text::sentence;

/// The answer to a question. Names in it are untrusted.
pub(super) struct Answer {
    pub(super) question: String,
    /// The verdict, in one sentence.
    pub(super) short: String,
    /// Results on the terminal page and in the report.
    pub(super) main: Vec<String>,
    /// Results in the report only.
    pub(super) more: Vec<String>,
}

impl Answer {
    pub(super) fn new(question: &str, short: String) -> Self {
        Self {
            question: question.to_owned(),
            short,
            main: Vec::new(),
            more: Vec::new(),
        }
    }

    /// The answer to a question with its caveats, and the finding.
    fn to<'a>(a: &'a Analysis, question: &Question) -> Option<(Self, &'a Finding)> {
        let f = a.finding(question)?;
        let words = wording::of_ratings(a, f);
        let mut answer = Self::new(&words.ask(), words.answer()?);
        answer.main = f.caveats.iter().map(sentences::caveat).collect();
        Some((answer, f))
    }
}

/// All questions that the data allow an answer to.
pub(super) fn answers(a: &Analysis) -> Vec<Answer> {
    let all = [
        target::target(a),
        vaf::predicts(a),
        vaf::delivered(a),
        vaf::covariates(a),
        pairs::best_two(a),
        differ(a),
        pairs::which(a),
        disagreement(a),
        variance(a),
        order(a),
        carry_over(a),
    ];
    let mut answers = factors::factors(a);
    answers.extend(all.into_iter().flatten());
    answers.extend(target::repeats(a));
    answers.extend(sites::sites(a));
    answers.extend(outcomes::outcomes(a));
    answers
}

/// Whether the realizations differ.
fn differ(a: &Analysis) -> Option<Answer> {
    let (mut answer, _) = Answer::to(a, &Question::Differ)?;
    let friedman = sentences::friedman(a).map(|s| format!("{s}."));
    answer.main.extend(friedman);
    answer.more.extend(residuals(a));
    Some(answer)
}

/// The shape of what the analysis of variance leaves unexplained.
fn residuals(a: &Analysis) -> Option<String> {
    let found = &a.results.residuals;
    let (skewness, kurtosis) = (found.skewness.number()?, found.excess_kurtosis.number()?);
    Some(format!(
        "Residuals of the cell means: skewness {}, excess kurtosis {} (0 if normally distributed); the \
         largest is {} standard deviations.",
        apa::two(skewness),
        apa::two(kurtosis),
        apa::two(found.largest.number()?)
    ))
}

/// Whether participants differ in how they rate the realizations.
fn disagreement(a: &Analysis) -> Option<Answer> {
    let (mut answer, f) = Answer::to(a, &Question::Disagreement)?;
    if let Some(share) = f.effect {
        answer.main.push(format!(
            "Participants × realizations are {} of the variance.",
            apa::percent(share.value)
        ));
    }
    let slopes = &a.results.mixed.slope_variance;
    if let [Some(sd), Some(slope), Some(chi2), Some(p)] =
        [&slopes.sd, &slopes.slope, &slopes.chi2, &slopes.p].map(Number::number)
    {
        answer.more.push(format!(
            "The slopes of the participants on VAF have the mean {} and the standard deviation {} per .01 \
             of VAF (mixed model with random slopes and realizations; of the variance, χ² = {}, p {}).",
            apa::two(slope / 100.0),
            apa::two(sd / 100.0),
            apa::two(chi2),
            apa::p(p)
        ));
    }
    Some(answer)
}

/// The variance components.
fn variance(a: &Analysis) -> Option<Answer> {
    let shares = variance_shares(a);
    let all: Vec<String> = (shares.iter())
        .map(|(name, share)| format!("{name} {}", apa::percent(*share)))
        .collect();
    let mut answer = Answer::new("Variance components", sentence(&all.join(", ")));
    answer.more.push(
        "The share of the realizations is the least precise: it rests on as many values as there \
         are realizations."
            .to_owned(),
    );
    (!shares.is_empty()).then_some(answer)
}

/// Name and share of each variance component: by expected mean squares, else of the
/// mixed model with crossed random effects.
pub(super) fn variance_shares(a: &Analysis) -> Vec<(&'static str, f64)> {
    let evidence = &a.results.evidence;
    let shares = evidence.variance.share.as_ref();
    if let Some(found) = shares.filter(|_| a.design.uses_complete())
        && let (Some(model), Some(subject)) = (found.model.number(), found.subject.number())
    {
        let mut shares = vec![("realizations", model), ("participants", subject)];
        match found.interaction.number().zip(found.noise.number()) {
            Some((interaction, noise)) => {
                shares.push(("participants × realizations", interaction));
                shares.push(("within cells", noise));
            }
            None => shares.extend(
                (found.interaction_and_noise.number())
                    .map(|x| ("participants × realizations and noise", x)),
            ),
        }
        return shares;
    }
    let Some(model) = &evidence.lmm_variance else {
        return Vec::new();
    };
    let all = [
        ("realizations", &model.share_model),
        ("participants", &model.share_subject),
        ("participants × realizations", &model.share_subject_model),
        ("within cells", &model.share_error),
    ];
    all.into_iter()
        .filter_map(|(name, x)| Some((name, x.number()?)))
        .collect()
}

/// Whether ratings drift over the session.
fn order(a: &Analysis) -> Option<Answer> {
    let (mut answer, _) = Answer::to(a, &Question::Order)?;
    (answer.more)
        .push("The change per trial is adjusted for participants and realizations.".to_owned());
    Some(answer)
}

/// Whether a rating depends on the one before it.
fn carry_over(a: &Analysis) -> Option<Answer> {
    let (mut answer, _) = Answer::to(a, &Question::CarryOver)?;
    answer.more.push(
        "Neighboring ratings are compared with all orders of the trials of a block, over \
         participants."
            .to_owned(),
    );
    Some(answer)
}
