//! Tables of measured outcomes.

use crate::apa::{self, bare_p, plain, two, whole};
use crate::table::{Builder, Table, file, report};
use study_analysis::analyze::results::{
    Interval, MeasuredOutcome, Number as _, OutcomeMean, OutcomeModelTest, RealizationName, Stat,
};
use study_analysis::analyze::{Analysis, Finding, OutcomeAnswer};
use study_plan::protocol::Transform;

/// An outcome with its statistics.
fn all(a: &Analysis) -> impl Iterator<Item = (&OutcomeAnswer, &MeasuredOutcome)> {
    let record = |o: &OutcomeAnswer| a.results.outcomes.get(o.rules.id.as_str());
    (a.outcomes.iter()).filter_map(move |outcome| Some((outcome, record(outcome)?)))
}

fn name(outcome: &OutcomeAnswer) -> String {
    format!("{} ({})", outcome.rules.id, outcome.rules.measure.unit())
}

/// The outcomes by realization.
pub(crate) fn means(a: &Analysis) -> Table {
    type Row<'a> = (&'a OutcomeAnswer, &'a RealizationName, &'a OutcomeMean);
    let rows: Vec<Row<'_>> = all(a)
        .flat_map(|(outcome, record)| {
            (record.means.iter()).map(move |(model, mean)| (outcome, model, mean))
        })
        .collect();
    let geometric = all(a).any(|(o, _)| o.rules.transform == Transform::Log);
    let note = "n: trials in which it was measured. Mean, SD and median are over these trials. Compared: mean over \
                participants, geometric where the logarithm is analyzed, with its 95 % interval; adjusted where cells are missing.";
    let any = !rows.is_empty();
    Builder::new("Measured outcomes", &rows)
        .apart(&|r| r.2.center.is_none())
        .text(report("outcome"), &|r| name(r.0))
        .text(file("outcome"), &|r| r.0.rules.id.to_string())
        .text(file("unit"), &|r| r.0.rules.measure.unit().to_owned())
        .text(report("realization"), &|r| apa::name(r.1.as_str()))
        .text(file("model"), &|r| r.1.as_str().to_owned())
        .field(report("n").file("n"), whole, |r| &r.2.n)
        .field(report("mean").file("mean"), plain, |r| &r.2.mean)
        .field(report("SD").file("sd"), plain, |r| &r.2.sd)
        .field(report("median").file("median"), plain, |r| &r.2.median)
        .field(
            report("geometric mean")
                .file("geometric_mean")
                .when(geometric),
            plain,
            |r| r.2.geometric_mean.as_ref(),
        )
        .field(file("n_participants"), whole, |r| &r.2.n_participants)
        .field(report("compared").file("center"), plain, |r| {
            r.2.center.as_ref()
        })
        .ends(report("95 % CI").file("center_ci95"), plain, &|r| {
            r.2.center_ci95.as_ref().and_then(Interval::ends)
        })
        .notes(any.then(|| note.to_owned()))
}

/// What the generalized mixed model of an outcome says of the effect that a finding is about.
fn by_model<'a>(record: &'a MeasuredOutcome, f: &Finding) -> Option<&'a OutcomeModelTest> {
    let model = record.model.as_ref()?;
    match f.names.is_empty() {
        true => model.differ.as_ref(),
        false => model.effects.get(f.names.join(":").as_str()),
    }
}

/// The tests of the outcomes.
pub(crate) fn tests(a: &Analysis) -> Table {
    let rows: Vec<(&OutcomeAnswer, &MeasuredOutcome, &Finding)> = all(a)
        .flat_map(|(outcome, record)| outcome.findings.iter().map(move |f| (outcome, record, f)))
        .collect();
    let df = |f: &Finding, at: usize| -> Option<f64> {
        let statistic = f.test.as_ref()?.statistic.as_ref()?;
        statistic.df.get(at).copied()
    };
    let effect = |f: &Finding| match f.names.is_empty() {
        true => "realizations".to_owned(),
        false => f.names.join(" × "),
    };
    let p = |record: &MeasuredOutcome, f: &Finding| -> Option<f64> {
        let effects = record.factorial.as_ref().map(|tests| &tests.effects);
        match effects.and_then(|effects| effects.get(f.names.join(":").as_str())) {
            Some(own) => match &own.clustered {
                Some(clustered) => clustered.p.number(),
                None => own.p_gg.number(),
            },
            None => record.differ.as_ref().map(|d| &d.p).and_then(Stat::number),
        }
    };
    let note = "p (Holm) is corrected over the tests of all measured outcomes together. They decide no question of the study.";
    let any = !rows.is_empty();
    let modeled = rows.iter().any(|r| r.1.model.is_some());
    let model_note = "χ² and p (model) are the likelihood ratio of a generalized mixed model of the single trials, a second \
                      opinion that decides nothing; p is of this test alone.";
    Builder::new("Tests of the measured outcomes", &rows)
        .text(report("outcome"), &|r| name(r.0))
        .text(file("outcome"), &|r| r.0.rules.id.to_string())
        .text(report("effect").file("effect"), &|r| effect(r.2))
        .text(report("statistic").file("symbol"), &|r| {
            let statistic = r.2.test.as_ref().and_then(|t| t.statistic.as_ref());
            statistic.map_or_else(String::new, |s| s.symbol.to_owned())
        })
        .number(report("value").file("statistic"), two, &|r| {
            Some(r.2.test.as_ref()?.statistic.as_ref()?.value)
        })
        .number(report("df1").file("df1"), two, &|r| df(r.2, 0))
        .number(report("df2").file("df2"), two, &|r| df(r.2, 1))
        .number(report("p").file("p"), bare_p, &|r| p(r.1, r.2))
        .number(report("p (Holm)").file("p_holm"), bare_p, &|r| {
            r.2.test.as_ref().map(|t| t.p)
        })
        .number(report("η²G").file("effect_size"), two, &|r| {
            r.2.effect.as_ref().map(|e| e.value)
        })
        .number(
            report("χ² (model)")
                .file("model_chi2")
                .explained(model_note.to_owned())
                .when(modeled),
            two,
            &|r| by_model(r.1, r.2)?.chi2.number(),
        )
        .number(file("model_df").when(modeled), whole, &|r| {
            by_model(r.1, r.2)?.df.number()
        })
        .number(
            report("p (model)").file("model_p").when(modeled),
            bare_p,
            &|r| by_model(r.1, r.2)?.p.number(),
        )
        .notes(any.then(|| note.to_owned()))
}
