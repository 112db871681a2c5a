//! The terminal page.

use super::{BAR, Report, bar, deciding, design, name_of, percent, reached};
use crate::apa;
use crate::text::Page;
use crate::text::layout::{Paint, pad, wrap};
use study_analysis::power::{Cell, Reach, design as closed_design, floor};
use study_base::text::{Untrusted, counted};
use study_stats::power::detectable_correlation;

/// What is known at once: the sentence, and what is assumed.
pub fn head(report: &Report, page: Page) -> String {
    if report.plan.settings.part.is_some() {
        return super::part::head(report, page);
    }
    let (width, paint) = (page.width.clamp(60, 100), Paint(page.color));
    let settings = &report.plan.settings;
    let a = &settings.assumptions;
    let mut out = paint.strong(&wrap(&report.ceiling_sentence(), width, "", ""));
    let s = &a.spread;
    let number = |x: f64| apa::number(x, 2);
    let assumed = format!(
        "{}: slope {} per SD of VAF, mean {}; SD of participants {}, realizations {}, interaction \
         {}, residual {}, slopes {}; ratings {}; α {}.",
        Untrusted(&report.title),
        number(a.slope),
        number(a.mean),
        number(s.subject),
        number(s.realization),
        number(s.interaction),
        number(s.residual),
        number(s.slope),
        name_of(&a.scale),
        apa::share(settings.alpha, 3),
    );
    out.push('\n');
    out += &wrap(&assumed, width, "", "");
    out
}

/// The table, the smallest designs, this design, and warnings.
pub fn results(report: &Report, page: Page) -> String {
    if report.plan.settings.part.is_some() {
        return super::part::results(report, page);
    }
    let (width, paint) = (page.width.clamp(60, 100), Paint(page.color));
    let mut out = format!("\n{}", table(report, paint));
    out += &smallest(report, width, paint);
    out += &own(report, width, paint);
    out.push('\n');
    for warning in report.warnings() {
        out += &paint.warn(&wrap(&Untrusted(&warning).to_string(), width, "! ", "  "));
    }
    out.push('\n');
    out += &paint.dim(&wrap(&super::paragraph(report), width, "", ""));
    out
}

fn table(report: &Report, paint: Paint) -> String {
    let plan = &report.plan;
    let simulated = !report.results.is_empty();
    let heads = ["realiz.", "reps", "partic."];
    let mut out = format!("{:>7} {:>6} {:>7}  ", heads[0], heads[1], heads[2]);
    if simulated {
        out += &format!("{:>7} {:>12} ", "power", "95 % CI");
    }
    out += &format!("{:>6} {:>7}  {}", "closed", "ceiling", pad("", BAR));
    if simulated {
        out += &format!("  {:>6} {:>6}", "type S", "type M");
    }
    out = paint.dim(out.trim_end()) + "\n";
    let share = |x: f64| apa::share(x, 3);
    let maybe = |x: Option<f64>, f: fn(f64) -> String| x.map_or("–".to_owned(), f);
    let mut last: Option<Cell> = None;
    for cell in report.shown() {
        if last.is_some_and(|l| {
            (l.realizations, l.repetitions) != (cell.realizations, cell.repetitions)
        }) {
            out.push('\n');
        }
        last = Some(cell);
        let closed = report.closed(&cell);
        let test = report.result(&cell).and_then(|r| r.tests.first());
        out += &format!(
            "{:>7} {:>6} {:>7}{} ",
            cell.realizations,
            cell.repetitions,
            cell.participants,
            if cell == plan.own { "*" } else { " " }
        );
        if simulated {
            let interval =
                test.map(|t| format!("[{}, {}]", share(t.interval.0), share(t.interval.1)));
            let power = test.map(|t| share(t.power));
            out += &format!(
                "{:>7} {:>12} ",
                power.unwrap_or_default(),
                interval.unwrap_or_default()
            );
        }
        let ceiling = closed.map_or(1.0, |c| c.ceiling);
        let height = test
            .map(|t| t.power)
            .or(closed.map(|c| c.power))
            .unwrap_or(0.0);
        out += &format!(
            "{:>6} {:>7}  {}",
            maybe(closed.map(|c| c.power), |x| apa::share(x, 3)),
            maybe(closed.map(|c| c.ceiling), |x| apa::share(x, 3)),
            bar(height, Some(ceiling))
        );
        if simulated {
            out += &format!(
                "  {:>6} {:>6}",
                maybe(test.and_then(|t| t.type_s), |x| apa::share(x, 3)),
                maybe(test.and_then(|t| t.type_m), |x| apa::number(x, 2))
            );
        }
        out = out.trim_end().to_owned() + "\n";
    }
    let what = if simulated {
        let until = plan.within.map_or_else(
            || "studies each".to_owned(),
            |within| format!("studies at most, until the interval is ± {within}"),
        );
        format!(
            "* this protocol. Power of {} in {} {until}; closed: Pearson's t. ┆ the ceiling.",
            deciding(plan),
            plan.settings.studies
        )
    } else {
        "* this protocol. Closed form of Pearson's t; ┆ the ceiling.".to_owned()
    };
    out + &paint.dim(&what) + "\n"
}

fn smallest(report: &Report, width: usize, paint: Paint) -> String {
    let all = report.smallest();
    let mut out = String::new();
    for target in &report.plan.targets {
        out += &format!(
            "\n{}\n",
            paint.strong(&format!("Smallest designs for {}", percent(*target)))
        );
        let own: Vec<_> = all.iter().filter(|s| s.target == *target).collect();
        for s in &own {
            let text = if report.results.is_empty()
                && let Reach::Participants { participants, .. } = s.reach
            {
                format!("{participants} participants (closed form)")
            } else {
                reached(&s.reach)
            };
            let line = format!(
                "{} realizations × {}: {text}",
                s.realizations,
                counted(s.repetitions, "repetition", "repetitions")
            );
            out += &wrap(&line, width, "  ", "    ");
        }
        let ratings = |s: &&&study_analysis::power::Smallest| match s.reach {
            Reach::Participants { participants, .. } => {
                (participants * s.realizations * s.repetitions, participants)
            }
            _ => (usize::MAX, usize::MAX),
        };
        if let Some(best) = own.iter().min_by_key(ratings)
            && let Reach::Participants { participants, .. } = best.reach
        {
            let line = format!(
                "fewest ratings: {participants} × {} × {} = {}",
                best.realizations,
                best.repetitions,
                participants * best.realizations * best.repetitions
            );
            out += &wrap(&line, width, "  ", "    ");
        }
    }
    out
}

/// The smallest effects that the study's own design finds.
pub(crate) fn sensitivity_sentences(report: &Report) -> Vec<String> {
    let (plan, settings) = (&report.plan, &report.plan.settings);
    if plan.settings.part.is_some() {
        return Vec::new();
    }
    let world = closed_design(settings, &plan.own);
    let one = |target: &f64| {
        let slope = world.detectable_slope(*target, settings.alpha)?;
        let rho = detectable_correlation(plan.own.realizations, *target, settings.alpha)?;
        Some(format!(
            "finds with {}: a slope of {} points per SD of VAF, a correlation of {} with the \
             observed means",
            percent(*target),
            apa::number(slope, 2),
            apa::r(rho)
        ))
    };
    plan.targets.iter().filter_map(one).collect()
}

fn own(report: &Report, width: usize, paint: Paint) -> String {
    let (plan, settings) = (&report.plan, &report.plan.settings);
    let mut out = format!(
        "\n{}\n",
        paint.strong(&format!("This protocol: {}", design(&plan.own)))
    );
    let world = closed_design(settings, &plan.own);
    for line in sensitivity_sentences(report) {
        out += &wrap(&line, width, "  ", "    ");
    }
    let endless = study_stats::power::covariate::Design {
        subjects: None,
        ..world
    };
    if let Some(e) = world.expected(settings.alpha) {
        let least = endless.expected(settings.alpha).map_or(String::new(), |e| {
            format!(
                ", ± {} with endlessly many participants",
                apa::number(e.half_width, 2)
            )
        });
        let line = format!(
            "interval of the slope: ± {}{least}",
            apa::number(e.half_width, 2)
        );
        out += &wrap(&line, width, "  ", "    ");
    }
    if let Some(f) = floor(&settings.vaf(plan.own.realizations), settings.alpha) {
        let line = format!(
            "smallest p of the permutation test: {}",
            apa::bare_p(f.smallest_p)
        );
        out += &wrap(&line, width, "  ", "    ");
    }
    if let Some((low, high)) = report.pilot_range(&plan.own) {
        let plug_in = world.power(settings.alpha).unwrap_or(0.0);
        let line = format!(
            "from the pilot: plugged in {}, 10 to 90 % of the worlds that it allows {} to {}; the \
             simulated power is the mean over these (assurance)",
            apa::share(plug_in, 2),
            apa::share(low, 2),
            apa::share(high, 2)
        );
        out += &wrap(&line, width, "  ", "    ");
    }
    out
}
