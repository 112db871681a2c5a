//! The power of a part that is no rating, and of the effects of factors: page, document and paragraph. There is no closed
//! form, so that the designs are those of the grid.

use super::{Report, bar, felt, name_of, percent, precision};
use crate::apa;
use crate::text::Page;
use crate::text::layout::{Paint, wrap};
use serde_json::{Value, json};
use study_analysis::power::{Cell, PartWorld, Test, TestResult, Truth};
use study_base::text::{Untrusted, counted};
use study_plan::protocol::Factor;
use study_stats::power::detectable_correlation;

/// The fewest participants of the grid with a target power of the first test; of factors, of every effect that is
/// not 0.
struct Fewest {
    target: f64,
    repetitions: usize,
    reached: Option<(usize, TestResult)>,
}

fn world(report: &Report) -> Option<&PartWorld> {
    report.plan.settings.part.as_ref()
}

fn id(report: &Report) -> String {
    report
        .plan
        .part
        .as_ref()
        .map_or("", |p| p.as_str())
        .to_owned()
}

/// What is simulated, and for a correlation with VAF what decides about it.
pub(super) fn summary(report: &Report) -> String {
    let settings = &report.plan.settings;
    let own = &report.plan.own;
    match world(report) {
        None => String::new(),
        Some(PartWorld::Factors(world)) => {
            let factor = |f: &Factor| format!("{} ({})", f.id, f.levels.join(", "));
            let mut all: Vec<String> = world.crossing.factors.iter().map(factor).collect();
            if !world.crossing.groups.is_empty() {
                all.push(format!("group ({})", world.crossing.groups.join(", ")));
            }
            format!(
                "Effects of {}: {} realizations, {} each.",
                all.join(" × "),
                own.realizations,
                counted(own.repetitions, "rating", "ratings")
            )
        }
        Some(PartWorld::Pairs(pairs)) => {
            let mut text = format!(
                "Part {}: {} of {} realizations, {} each.",
                id(report),
                counted(pairs.pairs.len(), "pair", "pairs"),
                own.realizations,
                counted(own.repetitions, "trial", "trials"),
            );
            let known = pairs.vaf.iter().flatten().count();
            let target = report.plan.targets.first().copied().unwrap_or(0.8);
            if settings.tests.contains(&Test::PreferenceVaf)
                && let Some(needed) = detectable_correlation(known, target, settings.alpha)
            {
                text += &format!(
                    " With {known} VAF these and the true abilities have to correlate at {} or more \
                     for {} power of preference-vaf, even with endlessly many participants.",
                    apa::r(needed),
                    percent(target)
                );
            }
            text
        }
        Some(PartWorld::Tracks(tracks)) => {
            let one = |t: &study_analysis::power::TrackWorld| match t.truth {
                Truth::Function(curve) => {
                    format!("{} {}", t.rules.id, apa::number(curve.threshold, 3))
                }
                Truth::Sensitivity(d) => format!("{} d′ {}", t.rules.id, apa::number(d, 2)),
            };
            let all: Vec<String> = tracks.tracks.iter().map(one).collect();
            format!("Part {}: assumed is {}.", id(report), all.join(", "))
        }
        Some(PartWorld::Felt(world)) => felt::summary(world, &id(report), own),
    }
}

/// What is assumed, in words.
fn assumed(report: &Report) -> String {
    let a = &report.plan.settings.assumptions;
    let number = |x: f64| apa::number(x, 2);
    match world(report) {
        None => String::new(),
        Some(PartWorld::Factors(world)) => {
            let names = world.names();
            let size = |(name, size): (&String, &f64)| format!("{name} {}", number(*size));
            let sizes: Vec<String> = names.iter().zip(&world.sizes).map(size).collect();
            let s = &a.spread;
            format!(
                "effects {} points; mean {}; SD of participants {}, realizations {}, interaction {}, residual {}; ratings {}",
                sizes.join(", "),
                number(a.mean),
                number(s.subject),
                number(s.realization),
                number(s.interaction),
                number(s.residual),
                name_of(&a.scale)
            )
        }
        Some(PartWorld::Pairs(pairs)) => format!(
            "slope {} per SD of VAF, SD of realizations {}, of participants' tastes {} (logits){}",
            number(a.slope),
            number(a.spread.realization),
            number(a.spread.interaction),
            pairs.ties.map_or(String::new(), |share| format!(
                "; {} ties between two that are alike",
                percent(share)
            ))
        ),
        Some(PartWorld::Tracks(tracks)) => {
            let unit = match (tracks.ratios, tracks.tracks.first().map(|t| t.truth)) {
                (true, _) => "natural logarithms",
                (false, Some(Truth::Sensitivity(_))) => "d′",
                (false, _) => "levels",
            };
            let curve = tracks.tracks.iter().find_map(|t| match t.truth {
                Truth::Function(curve) => Some(curve),
                Truth::Sensitivity(_) => None,
            });
            format!(
                "SD of participants {}, of participant × track {} ({unit}){}",
                number(a.spread.subject),
                number(a.spread.interaction),
                curve.map_or(String::new(), |c| format!(
                    "; width {} on the first track, {} lapses",
                    apa::number(c.width, 3),
                    percent(c.lambda)
                ))
            )
        }
        Some(PartWorld::Felt(world)) => felt::assumed(world, a),
    }
}

/// What is known before the simulation.
pub(super) fn head(report: &Report, page: Page) -> String {
    let (width, paint) = (page.width.clamp(60, 100), Paint(page.color));
    let settings = &report.plan.settings;
    let mut out = paint.strong(&wrap(&summary(report), width, "", ""));
    out.push('\n');
    let text = format!(
        "{}: {}; {} dropout, {} missing trials; α {}.",
        Untrusted(&report.title),
        assumed(report),
        percent(settings.assumptions.dropout),
        percent(settings.assumptions.missing),
        apa::share(settings.alpha, 3),
    );
    out + &wrap(&text, width, "", "")
}

/// The tables of the tests, the smallest designs of the grid, and warnings.
pub(super) fn results(report: &Report, page: Page) -> String {
    let (width, paint) = (page.width.clamp(60, 100), Paint(page.color));
    let plan = &report.plan;
    let mut out = String::new();
    let share = |x: f64| apa::share(x, 3);
    for at in 0..plan.settings.tests.len() {
        let head = format!(
            "\n{:<24} {:>5} {:>8} {:>6} {:>13}\n",
            Untrusted(&plan.settings.test_name(at)).to_string(),
            "reps",
            "partic.",
            "power",
            "95 % CI"
        );
        out += &paint.dim(&head);
        for cell in report.shown() {
            let Some(found) = report.result(&cell).and_then(|r| r.tests.get(at)) else {
                continue;
            };
            let line = format!(
                "{:<24} {:>5} {:>7}{} {:>6} {:>13}  {}",
                "",
                cell.repetitions,
                cell.participants,
                if cell == plan.own { "*" } else { " " },
                share(found.power),
                format!("[{}, {}]", share(found.interval.0), share(found.interval.1)),
                bar(found.power, None),
            );
            out += &(line.trim_end().to_owned() + "\n");
        }
    }
    out += &precision::table(report, paint);
    let studies = format!(
        "* this protocol. {} simulated studies{}.",
        plan.settings.studies,
        plan.within.map_or(String::new(), |within| format!(
            " at most, until the interval is ± {within}"
        ))
    );
    out += &paint.dim(&wrap(&studies, width, "", ""));
    if let Some(legend) = precision::legend(report) {
        out += &paint.dim(&wrap(&legend, width, "", ""));
    }
    if let Some(ratios) = precision::has_ratios(report) {
        let candidates = precision::candidates(report);
        for sentence in precision::sentences(&report.wanted, ratios, &candidates) {
            out += &wrap(&sentence, width, "  ", "    ");
        }
    }
    for fewest in smallest(report) {
        let reps = counted(fewest.repetitions, "repetition", "repetitions");
        let line = match fewest.reached {
            Some((n, test)) => format!(
                "{} with {reps}: {n} participants of those compared (simulated {}{})",
                percent(fewest.target),
                share(test.power),
                if test.interval.0 >= fewest.target {
                    ", sure"
                } else {
                    ""
                }
            ),
            None => format!(
                "{} with {reps}: not reached by the numbers of participants compared",
                percent(fewest.target)
            ),
        };
        out += &wrap(&line, width, "  ", "    ");
    }
    out.push('\n');
    for warning in report.warnings() {
        out += &paint.warn(&wrap(&Untrusted(&warning).to_string(), width, "! ", "  "));
    }
    out.push('\n');
    out + &paint.dim(&wrap(&paragraph(report), width, "", ""))
}

fn smallest(report: &Report) -> Vec<Fewest> {
    let shown = report.shown();
    let mut repetitions: Vec<usize> = shown.iter().map(|c| c.repetitions).collect();
    repetitions.sort_unstable();
    repetitions.dedup();
    let of = |target: f64, repetitions: usize| {
        let first = |cell: &Cell| {
            let tests = &report.result(cell)?.tests;
            let test = match world(report) {
                Some(PartWorld::Factors(world)) => (tests.iter().zip(&world.sizes))
                    .filter(|(_, size)| **size != 0.0)
                    .map(|(test, _)| test)
                    .min_by(|a, b| a.power.total_cmp(&b.power))?,
                _ => tests.first()?,
            };
            (test.power >= target).then(|| (cell.participants, test.clone()))
        };
        let own = shown.iter().filter(|c| c.repetitions == repetitions);
        Fewest {
            target,
            repetitions,
            reached: own.filter_map(first).min_by_key(|found| found.0),
        }
    };
    if report.plan.settings.tests.is_empty() || report.results.is_empty() {
        return Vec::new();
    }
    let targets = report.plan.targets.iter();
    targets
        .flat_map(|target| repetitions.iter().map(move |r| (*target, *r)))
        .map(|(target, r)| of(target, r))
        .collect()
}

/// What a reader of the power of a part has to know.
pub(super) fn warnings(report: &Report) -> Vec<String> {
    let mut found = Vec::new();
    match world(report) {
        Some(PartWorld::Pairs(pairs)) => {
            if report.plan.own.participants < 10 {
                found.push(
                    "with fewer than 10 participants the analysis takes all answers for independent: \
                     tastes then make it reject too often"
                        .to_owned(),
                );
            }
            if report.plan.settings.tests.contains(&Test::PreferenceVaf) {
                let known: Vec<f64> = pairs.vaf.iter().flatten().copied().collect();
                let floor = study_analysis::power::floor(&known, report.plan.settings.alpha);
                if let Some(floor) = floor.filter(|f| !f.can_reject) {
                    found.push(format!(
                        "with these VAF no p of preference-vaf is below {}: its power is 0 whatever \
                         the answers",
                        apa::bare_p(floor.smallest_p)
                    ));
                }
            }
        }
        Some(PartWorld::Tracks(_)) if report.plan.settings.tests.is_empty() => {
            found.push(
                "one track of levels is compared with nothing: only its precision is shown"
                    .to_owned(),
            );
        }
        Some(PartWorld::Factors(world)) => {
            if world.sizes.iter().all(|size| *size == 0.0) {
                found.push(
                    "no effect is assumed: this is how often the tests say yes without one"
                        .to_owned(),
                );
            }
        }
        Some(PartWorld::Felt(world)) => {
            found.extend(felt::warnings(world, &report.plan.settings.assumptions));
        }
        Some(PartWorld::Tracks(_)) | None => {}
    }
    found
}

/// The sentences of a preregistration.
pub(super) fn paragraph(report: &Report) -> String {
    let settings = &report.plan.settings;
    let mut text = format!(
        "Power was determined with study {} for {}{}. Assumed were {}; {} dropout, {} missing \
         trials.",
        env!("CARGO_PKG_VERSION"),
        counted(report.plan.own.participants, "participant", "participants"),
        match &report.plan.part {
            Some(part) => format!(" in part {part}"),
            None => String::new(),
        },
        assumed(report),
        percent(settings.assumptions.dropout),
        percent(settings.assumptions.missing),
    );
    let own = report.result(&report.plan.own);
    for (at, test) in own.iter().flat_map(|r| &r.tests).enumerate() {
        text += &format!(
            " In {} simulated studies (seed {}), `{}` at α = {} was a yes in {} (95 % CI {} to {}).",
            test.studies,
            settings.seed,
            settings.test_name(at),
            apa::share(settings.alpha, 3),
            apa::share(test.power, 3),
            apa::share(test.interval.0, 3),
            apa::share(test.interval.1, 3),
        );
    }
    text
}

/// What is assumed, for the document.
pub(super) fn assumptions(report: &Report) -> Value {
    let (plan, settings) = (&report.plan, &report.plan.settings);
    let a = &settings.assumptions;
    let mut value = json!({
        "dropout": a.dropout,
        "missing": a.missing,
        "alpha": settings.alpha,
        "tests": (0..settings.tests.len()).map(|at| settings.test_name(at)).collect::<Vec<_>>(),
        "targets": plan.targets,
        "studies": settings.studies,
        "within": plan.within,
        "seed": settings.seed,
        "defaults": plan.defaults,
    });
    match world(report) {
        None => {}
        Some(PartWorld::Factors(world)) => {
            value["mean"] = json!(a.mean);
            value["sd"] = json!({
                "participant": a.spread.subject, "realization": a.spread.realization,
                "interaction": a.spread.interaction, "residual": a.spread.residual,
            });
            value["scale"] = json!(name_of(&a.scale));
            let sizes = world.names().into_iter().zip(&world.sizes);
            value["effects"] = sizes
                .map(|(name, size)| json!({ "effect": name, "size": size }))
                .collect();
        }
        Some(PartWorld::Pairs(pairs)) => {
            value["slope"] = json!(a.slope);
            value["sd"] =
                json!({ "realization": a.spread.realization, "interaction": a.spread.interaction });
            value["ties"] = json!(pairs.ties);
            value["vaf"] = json!(pairs.vaf);
        }
        Some(PartWorld::Tracks(tracks)) => {
            value["sd"] =
                json!({ "participant": a.spread.subject, "interaction": a.spread.interaction });
            value["ratios"] = json!(tracks.ratios);
            let one = |t: &study_analysis::power::TrackWorld| match t.truth {
                Truth::Function(c) => json!({
                    "track": t.rules.id.as_str(), "threshold": c.threshold, "width": c.width,
                    "guess": c.gamma, "lapse": c.lambda,
                }),
                Truth::Sensitivity(d) => json!({ "track": t.rules.id.as_str(), "d": d }),
            };
            value["tracks"] = tracks.tracks.iter().map(one).collect();
        }
        Some(PartWorld::Felt(world)) => felt::assumptions(world, a, &mut value),
    }
    value
}

/// The fewest participants, for the document.
pub(super) fn smallest_values(report: &Report) -> Vec<Value> {
    let one = |fewest: &Fewest| {
        json!({
            "target": fewest.target,
            "repetitions": fewest.repetitions,
            "participants": fewest.reached.as_ref().map(|r| r.0),
            "power": fewest.reached.as_ref().map(|r| r.1.power),
            "sure": fewest.reached.as_ref().map(|r| r.1.interval.0 >= fewest.target),
        })
    };
    smallest(report).iter().map(one).collect()
}
