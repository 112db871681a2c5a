//! The paragraph for a preregistration.

use super::{Report, deciding, design, name_of, percent};
use crate::apa;
use study_analysis::power::Vaf;

/// What was assumed and found, in sentences. Its words are the program's and the protocol's
/// numbers.
pub fn paragraph(report: &Report) -> String {
    if report.plan.settings.part.is_some() {
        return super::part::paragraph(report);
    }
    let (plan, settings) = (&report.plan, &report.plan.settings);
    let a = &settings.assumptions;
    let s = &a.spread;
    let number = |x: f64| apa::number(x, 2);
    let vaf = match a.vaf {
        Vaf::Listed => "the listed VAF",
        Vaf::Spread => "VAF in even steps over the listed range",
        Vaf::Drawn => "VAF drawn from a normal distribution",
    };
    let source = match &settings.pilot {
        Some(pilot) => format!(
            "drawn for each study from what a pilot of {} participants and {} realizations allows",
            pilot.participants, pilot.realizations
        ),
        None => format!(
            "a slope of {} rating points per standard deviation of VAF, standard deviations of {} \
             between participants, {} between realizations about the line, {} of the interaction, \
             {} between repetitions and {} of participants' slopes",
            number(a.slope),
            number(s.subject),
            number(s.realization),
            number(s.interaction),
            number(s.residual),
            number(s.slope)
        ),
    };
    let mut text = format!(
        "Power was determined with study {} for {} (participants × realizations × repetitions) with \
         {vaf}. Assumed were {source}; ratings {}; {} dropout, {} missing trials.",
        env!("CARGO_PKG_VERSION"),
        design(&plan.own),
        name_of(&a.scale),
        percent(a.dropout),
        percent(a.missing),
    );
    if let Some(test) = report.result(&plan.own).and_then(|r| r.tests.first()) {
        text += &format!(
            " In {} simulated studies (seed {}), the test `{}` at α = {} was significant in {} \
             (95 % CI {} to {}).",
            test.studies,
            settings.seed,
            deciding(plan),
            apa::share(settings.alpha, 3),
            apa::share(test.power, 3),
            apa::share(test.interval.0, 3),
            apa::share(test.interval.1, 3),
        );
    } else if let Some(e) = report.closed(&plan.own) {
        text += &format!(
            " The closed form of Pearson's t test at α = {} gives a power of {}.",
            apa::share(settings.alpha, 3),
            apa::share(e.power, 3)
        );
    }
    if let Some(e) = report.closed(&plan.own) {
        text += &format!(
            " With endlessly many participants it would be {}.",
            apa::share(e.ceiling, 3)
        );
    }
    text
}
