//! Memory, order, references and hidden duplicates.

use super::{Direction, Estimate, Facts, Finding, Question, Test, TestKind, Verdict};
use crate::analyze::exclude;
use crate::analyze::results::{Number as _, Stat};
use study_base::apa;
use study_plan::protocol::Role;
use study_stats::level::rejects;

/// Whether the memory matters: a linear and a quadratic term, each at half the level.
pub(super) fn memory(facts: &Facts<'_>) -> Option<Finding> {
    let memory = facts.evidence.covariates.log10_memory.as_ref()?;
    let (line, square) = (&memory.line, &memory.quadratic);
    let curve = square.p.number();
    let curve = curve.map(|p| (p, square.t.number(), square.df.number()));
    let level = facts.rules.alpha / if curve.is_some() { 2.0 } else { 1.0 };
    let tested = |p: f64, t: Option<f64>, df: Option<f64>| Test {
        comparisons: 1 + usize::from(curve.is_some()),
        ..Test::single(TestKind::SlopeT, p, level).with("t", t, &[df])
    };
    let linear = line.p.number();
    let linear = linear.map(|p| tested(p, line.t.number(), line.df.number()));
    let curved = curve.map(|(p, t, df)| tested(p, t, df));
    let r = line.r.number();
    let yes = |test: &Option<Test>| test.as_ref().is_some_and(Test::is_significant);
    let (test, direction) = match (linear, curved) {
        (linear, _) if yes(&linear) => (linear, r.map(Direction::of)),
        (Some(_), curved) if yes(&curved) => (curved, Some(Direction::Curved)),
        (linear, _) => (linear, None),
    };
    let mut found = match test {
        Some(test) => Finding::decided(Question::Memory, test, facts.design),
        None => {
            let why = line.r.reason().or_else(|| line.p.reason());
            let why = why.unwrap_or("there is no test");
            Finding::undefined(Question::Memory, why, facts.design)
        }
    };
    found.realizations = line.n_models.number().unwrap_or(0.0) as usize;
    found.direction = direction;
    found.estimate = r.and_then(|r| Estimate::of("r", r));
    Some(found)
}

/// Whether participants differ in how they rate the realizations: by the interaction if
/// cells repeat, else by their slopes on VAF.
pub(super) fn disagreement(facts: &Facts<'_>) -> Option<Finding> {
    let d = facts.design;
    if d.participants < 2 || d.realizations < 2 {
        return None;
    }
    let disagree = &facts.evidence.disagreement;
    let (found, kind) = if d.repeated {
        (&disagree.interaction, TestKind::Interaction)
    } else {
        (&disagree.slopes, TestKind::SlopesDiffer)
    };
    let (df1, df2) = (found.df1.number(), found.df2.number());
    let Some(p) = found.p.number() else {
        let why = found.p.reason().unwrap_or("there is no test");
        let no_vaf = facts.cells.vaf.iter().all(Option::is_none);
        let why = match (d.repeated, no_vaf) {
            (true, _) => why.to_owned(),
            (false, true) => "no cell has two ratings".to_owned(),
            (false, false) => format!("no cell has two ratings, and {why}"),
        };
        return Some(Finding::undefined(Question::Disagreement, why, d));
    };
    let test = Test::single(kind, p, facts.rules.alpha);
    let test = test.with("F", found.f.number(), &[df1, df2]);
    let mut found = Finding::decided(Question::Disagreement, test, d);
    if !d.repeated {
        found.participants = df1.map_or(0, |df| df as usize + 1);
    }
    let shares = facts.evidence.variance.share.as_ref();
    let share = shares
        .and_then(|s| s.interaction.number())
        .or_else(|| {
            let model = facts.evidence.lmm_variance.as_ref();
            model?.share_subject_model.number()
        })
        .filter(|_| d.repeated);
    found.effect = share.and_then(|x| Estimate::of("share of the variance", x));
    let n = |n: &Stat| n.number().unwrap_or(0.0);
    let (rising, falling) = (n(&disagree.n_rising), n(&disagree.n_falling));
    if found.is_yes() && rising > 0.0 && falling > 0.0 {
        found.caveat(
            "opposed",
            format!(
                "realizations with a higher VAF are rated higher by {rising} and lower by {falling} \
                 of the participants who rated them all"
            ),
        );
    }
    Some(found)
}

/// Where participants disagree, a question about means that shows nothing says so, and so
/// does an effect of VAF that is opposite for some of them.
pub(super) fn disagreement_as_caveat(found: &mut [Finding]) {
    let disagree = |f: &Finding| f.question == Question::Disagreement && f.is_yes();
    if !found.iter().any(disagree) {
        return;
    }
    let opposed = (found.iter()).any(|f| f.caveats.iter().any(|c| c.code == "opposed"));
    let about_means = [Question::Vaf, Question::Differ];
    for finding in found.iter_mut() {
        if about_means.contains(&finding.question) && finding.verdict == Verdict::NotShown {
            finding.caveat(
                "disagreement",
                "participants disagree about the realizations, and means hide how they differ",
            );
        }
        if opposed && finding.question == Question::Vaf && finding.is_yes() {
            finding.caveat(
                "these-participants",
                "participants disagree, and the effect of VAF is opposite for some of them: the test takes \
                 these participants as given, and with others it could be another one",
            );
        }
    }
}

/// Whether ratings drift over the session.
pub(super) fn order(facts: &Facts<'_>) -> Option<Finding> {
    let order = &facts.evidence.order;
    let (slope, p) = (order.trial.slope.number()?, order.trial.p.number()?);
    let test = Test::single(TestKind::SlopeT, p, facts.rules.alpha);
    let test = test.with("t", order.trial.t.number(), &[order.trial.df.number()]);
    let direction = Some(Direction::of(slope)).filter(|_| test.is_significant());
    let mut found = Finding {
        direction,
        estimate: Estimate::of("slope", slope),
        ..Finding::decided(Question::Order, test, facts.design)
    };
    for (_, name) in &facts.ranked {
        let drift = order.drift.get(*name);
        let drift = drift.and_then(|d| d.slope.slope.number().zip(d.p_holm.number()));
        let Some((slope, p)) = drift else {
            continue;
        };
        if rejects(p, facts.rules.alpha) {
            let shown = apa::number(slope, 3);
            let p = apa::p_beside(p, facts.rules.alpha);
            found.caveat(
                "drift",
                format!(
                    "the rating of {name} changes by {shown} per trial (p {p}, Holm's correction)"
                ),
            );
        }
    }
    Some(found)
}

/// Whether a rating depends on the one before it.
pub(super) fn carry_over(facts: &Facts<'_>) -> Option<Finding> {
    let found = &facts.evidence.order.carry_over;
    let (slope, p) = (found.slope.number()?, found.p.number()?);
    let test = Test::single(TestKind::SlopeT, p, facts.rules.alpha);
    let test = test.with("t", found.t.number(), &[found.df.number()]);
    Some(Finding {
        direction: Some(Direction::of(slope)).filter(|_| test.is_significant()),
        estimate: Some(Estimate {
            name: "slope",
            value: slope,
            ci95: found.ci95.ends(),
        }),
        ..Finding::decided(Question::CarryOver, test, facts.design)
    })
}

/// The best-rated realization against each reference, anchor and physical
/// sample: a difference, and equivalence within the stated margin.
pub(super) fn against_references(facts: &Facts<'_>) -> Vec<Finding> {
    let Some(&(_, best)) = facts.ranked.first() else {
        return Vec::new();
    };
    let mut found = Vec::new();
    for model in &facts.cells.ratings.models {
        let reference = match model.role {
            Role::HiddenReference | Role::Physical | Role::LowAnchor | Role::MidAnchor => &model.id,
            Role::Test | Role::Practice => continue,
        };
        let tests = facts.evidence.references.reference.get(reference.as_str());
        let Some(tested) = tests.and_then(|tests| tests.get(best)) else {
            continue;
        };
        let Some(difference) = tested.mean_diff.number() else {
            continue;
        };
        let n = tested.n.number().unwrap_or(0.0);
        let why = |p: &Stat| p.reason().unwrap_or("there is no test").to_owned();
        let put = |found: Finding| Finding {
            names: vec![best.to_owned(), reference.clone()],
            participants: n as usize,
            realizations: 2,
            estimate: Some(Estimate {
                name: "difference",
                value: difference,
                ci95: tested.ci95.ends(),
            }),
            ..found
        };
        let question = Question::Reference(reference.clone());
        let test = tested.p_t_holm.number().map(|p| Test {
            comparisons: facts.design.realizations,
            ..Test::single(TestKind::PairedT, p, facts.rules.alpha).with(
                "t",
                tested.t.number(),
                &[Some(n - 1.0)],
            )
        });
        let differs = match test {
            Some(test) => Finding {
                direction: Some(Direction::of(difference)).filter(|_| test.is_significant()),
                ..Finding::decided(question, test, facts.design)
            },
            None => Finding::undefined(question, why(&tested.p_t), facts.design),
        };
        found.push(put(differs));
        if matches!(model.role, Role::LowAnchor | Role::MidAnchor) || tested.equivalence.is_none() {
            continue;
        }
        let question = Question::Equivalence(reference.clone());
        let equivalent = match tested.p_tost.number() {
            Some(p) => {
                let test = Test::single(TestKind::Equivalence, p, facts.rules.alpha);
                Finding::decided(question, test, facts.design)
            }
            None => Finding::undefined(question, why(&tested.p_tost), facts.design),
        };
        found.push(put(equivalent));
    }
    found
}

/// Each hidden duplicate against its original.
pub(super) fn repeats(facts: &Facts<'_>) -> Vec<Finding> {
    let name = |m: usize| facts.cells.model_name(m).to_owned();
    let pairs = exclude::pairs(facts.cells.ratings).into_iter();
    pairs
        .filter_map(|(duplicate, original)| {
            let tests = &facts.evidence.references.duplicate;
            let own = tests.get(name(duplicate).as_str())?;
            let difference = own.mean_diff.number()?;
            let n = own.n.number()?;
            let question = Question::Repeat(name(duplicate));
            let found = match own.p_t.number() {
                Some(p) => {
                    let test = Test::single(TestKind::PairedT, p, facts.rules.alpha);
                    let test = test.with("t", own.t.number(), &[Some(n - 1.0)]);
                    Finding::decided(question, test, facts.design)
                }
                None => {
                    let why = own.p_t.reason();
                    Finding::undefined(question, why.unwrap_or("there is no test"), facts.design)
                }
            };
            Some(Finding {
                names: vec![name(duplicate), name(original)],
                participants: n as usize,
                realizations: 2,
                estimate: Some(Estimate {
                    name: "difference",
                    value: difference,
                    ci95: own.ci95.ends(),
                }),
                ..found
            })
        })
        .collect()
}
