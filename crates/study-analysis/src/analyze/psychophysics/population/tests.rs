use super::*;
use crate::analyze::record::{Field as _, Number as _};
use study_stats::psychometric::Curve;

fn fit(width: WidthPrior, experiment: Experiment) -> ConditionFit {
    let (spacing, low, high) = match width {
        WidthPrior::OfRatios => (Spacing::Log, (0.02f64).ln(), (0.6f64).ln()),
        _ => (Spacing::Lin, 0.02, 0.6),
    };
    let support = Support {
        low,
        high,
        least: 0.02,
    };
    ConditionFit {
        core: Core::Norm,
        spacing,
        experiment,
        priors: Priors::track(Some(support), width),
    }
}

const CHOICE: Experiment = Experiment::ForcedChoice(0.5);

/// The counts that are expected of a threshold, 20 trials at each of eight levels.
fn cell(participant: &str, condition: &str, threshold: f64) -> PopulationCell {
    let curve = Curve {
        core: Core::Norm,
        threshold: threshold.ln(),
        width: 1.5,
        gamma: 0.5,
        lambda: 0.02,
    };
    let level = |i: i32| {
        let level: f64 = 0.02 * 1.6f64.powi(i);
        Level {
            level,
            positive: (20.0 * curve.value(level.ln())).round(),
            trials: 20.0,
        }
    };
    PopulationCell {
        name: CellName::of(participant, condition),
        levels: (0..8).map(level).collect(),
    }
}

/// The track that is declared first comes last by name.
fn three() -> Vec<PopulationCell> {
    [("A", 0.1), ("B", 0.12), ("C", 0.15)]
        .into_iter()
        .flat_map(|(who, t)| [cell(who, "z", t), cell(who, "a", 1.5 * t)])
        .collect()
}

fn settings(width: WidthPrior, names: &[&str]) -> BTreeMap<String, ConditionFit> {
    (names.iter())
        .map(|name| ((*name).to_owned(), fit(width, CHOICE)))
        .collect()
}

#[test]
fn thresholds_are_levels_and_contrasts_those_of_their_names() {
    let settings = settings(WidthPrior::OfRatios, &["z", "a"]);
    let model = population(&three(), &settings, (1, "part"), Effort::ANALYSIS).unwrap();
    assert!(model.has_converged(), "{:?}", model.convergence);
    let values = model.values();
    let number = |id: &str| values.number(id).unwrap();
    let near = |id: &str, expected: f64| {
        let ratio = number(id) / expected;
        assert!(
            (0.85..1.18).contains(&ratio),
            "{id}: {} {expected}",
            number(id)
        );
    };
    let mean = (0.1f64 * 0.12 * 0.15).cbrt();
    near("threshold/z/median", mean);
    near("threshold/a/median", 1.5 * mean);
    near("a|z/ratio/median", 1.5);
    near("participant/C/z/median", 0.15);
    near("width/median", 1.5);
    assert!(number("a|z/first_larger") > 0.9);
    assert!(number("a|z/ratio/ci95_lo") < 1.5 && number("a|z/ratio/ci95_hi") > 1.5);
    assert_eq!(number("n_participants"), 3.0);
    assert_eq!(number("converged"), 1.0);
    assert_eq!(values.number("a|z/difference/median"), None);
    // The same seed gives the same numbers.
    let again = population(&three(), &settings, (1, "part"), Effort::ANALYSIS).unwrap();
    assert_eq!(again, model);
}

#[test]
fn levels_without_ratios_have_differences() {
    let settings = settings(WidthPrior::Even, &["a", "z"]);
    let values = population(&three(), &settings, (1, "part"), Effort::ANALYSIS)
        .unwrap()
        .values();
    let [a, z] = ["a", "z"].map(|c| values.number(&format!("threshold/{c}/median")).unwrap());
    let difference = values.number("a|z/difference/median").unwrap();
    assert!((difference - (a - z)).abs() < 0.02, "{difference} {a} {z}");
    assert_eq!(values.number("a|z/ratio/median"), None);
}

#[test]
fn not_every_study_has_a_population() {
    let mut settings = settings(WidthPrior::OfRatios, &["a", "z"]);
    let one = [cell("A", "a", 0.1), cell("A", "z", 0.2)];
    assert_eq!(
        population(&one, &settings, (1, "part"), Effort::ANALYSIS),
        None
    );
    assert_eq!(
        population(&[], &settings, (1, "part"), Effort::ANALYSIS),
        None
    );
    // Tracks over different scales are no conditions of one model.
    settings.insert("z".to_owned(), fit(WidthPrior::Even, CHOICE));
    let model = population(&three(), &settings, (1, "part"), Effort::ANALYSIS).unwrap();
    assert!(!model.has_converged());
    let reason = model.sd_participant.median.reason().unwrap().to_owned();
    assert!(reason.contains("scales"), "{reason}");
    let yes_no = fit(WidthPrior::OfRatios, Experiment::YesNo);
    settings.insert("z".to_owned(), yes_no);
    settings.insert("a".to_owned(), fit(WidthPrior::OfRatios, Experiment::YesNo));
    assert_eq!(
        population(&three(), &settings, (1, "part"), Effort::ANALYSIS),
        None
    );
}

/// Of draws that cannot be relied upon nothing is said but that.
#[test]
fn a_model_that_has_not_converged_decides_nothing() {
    let condition = |fit: &ConditionFit| Condition {
        core: fit.core,
        experiment: fit.experiment,
        support: fit.priors.support.unwrap(),
        width: fit.priors.width,
    };
    let conditions = [condition(&fit(WidthPrior::OfRatios, CHOICE))];
    let cells = [cell("A", "a", 0.1), cell("B", "a", 0.2)];
    let placed: Vec<Cell> = (cells.iter().enumerate())
        .map(|(participant, c)| Cell {
            participant,
            condition: 0,
            levels: Spacing::Log.places(&c.levels),
        })
        .collect();
    let priors = PopulationPriors::of(WidthPrior::OfRatios);
    let random = &mut Draws::new(1, "test");
    let mut found =
        partial_pooling(&conditions, &placed, &priors, Effort::SIMULATION, random).unwrap();
    let model = |found: &Population| {
        let scale = Scale {
            found,
            spacing: Spacing::Log,
            conditions: &conditions,
        };
        scale.model(&["a"], cells.iter().map(|c| &c.name), &placed)
    };
    assert!(model(&found).has_converged(), "{:?}", found.diagnostics);
    assert!(model(&found).threshold["a"].median.number().is_some());
    found.diagnostics.pareto_k = 0.9;
    let failed = model(&found);
    assert!(!failed.has_converged());
    let why = "the pooled model has not converged: a few draws have most of the weight (Pareto k above .7)";
    for stat in [
        &failed.threshold["a"].median,
        &failed.participant[&CellName::of("A", "a")].ci95.lo,
        &failed.sd_participant.median,
        &failed.lambda.ci95.hi,
    ] {
        assert_eq!(stat.reason(), Some(why));
    }
    assert_eq!(failed.convergence.pareto_k.number(), Some(0.9));
}
