use super::super::{Cell, CellResult, Overrides, merge, run_chunk};
use super::*;
use study_plan::protocol::power::PowerPlan;

/// Two tracks of 25 trials at each of eight levels by equal ratios.
const PROTOCOL: &str = r#"
format = "study-protocol/3"
study = { id = "example", title = "An example", seed = 1 }
design = { participants = 8 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "more" }

[[families]]
id = "friction"
from = "static.toml"
vary = "friction"
range = [0.04, 0.25]
steps = 8
scale = "log"

[[parts]]
id = "more"
kind = "discrimination"
prompt = "Which one had more friction?"
tracks = ["one", "two"]

[[tracks]]
id = "one"
method = "2ifc"
family = "friction"
standard = 0.0
procedure = { rule = "constant", repetitions = 25 }

[[tracks]]
id = "two"
method = "2ifc"
family = "friction"
standard = 0.0
procedure = { rule = "constant", repetitions = 25 }

[power]
sd = { participant = 0.3, interaction = 0.1 }
track = { threshold = 0.1, ratio = 1.2, width = 0.1 }
"#;

fn protocol(text: &str) -> Protocol {
    let parsed = study_plan::protocol::file::parse("protocol.toml", text);
    let shown = parsed.findings.render(false);
    parsed.protocol.unwrap_or_else(|| panic!("{shown}"))
}

fn flags(studies: u64, pooled: u64) -> Overrides {
    Overrides {
        plan: PowerPlan {
            studies: Some(studies),
            ..PowerPlan::default()
        },
        pooled,
        ..Overrides::default()
    }
}

fn result(plan: &Plan, participants: usize) -> CellResult {
    let cell = Cell {
        participants,
        ..plan.own
    };
    let chunks: Vec<_> = (0..plan.settings.chunks())
        .map(|i| run_chunk(&plan.settings, &cell, i))
        .collect();
    merge(&plan.settings, cell, &chunks).unwrap()
}

/// With thresholds that are known well, the mean of n participants has the variance (σ² + τ²)/n of its
/// logarithm and a t interval of half the length t s/√n, where E s = c₄ √(σ² + τ²); a contrast has the
/// variance 2τ²/n. c₄(8) = .965030, t(7) = 2.364624; what 200 trials leave open of a threshold is added.
#[test]
fn precision_is_that_of_the_formulas() {
    let protocol = protocol(PROTOCOL);
    let found = alternatives(&protocol, &flags(40, 0), &[Procedure::Own], &[]).unwrap();
    let precision = result(&found[0].plan, 8).precision.unwrap();
    assert_eq!(precision.trials.mean(), Some(400.0));
    let alone = &precision.alone;
    let open = alone.participant.square.mean().unwrap();
    assert!((0.001..0.02).contains(&open), "{open}");
    let variance = 0.3f64.powi(2) + 0.1f64.powi(2) + open;
    let near = |found: &super::super::Moments, expected: f64| {
        let (mean, error) = (found.mean().unwrap(), found.error().unwrap());
        assert!(
            (mean - expected).abs() < 4.0 * error,
            "{mean} ± {error}, {expected}"
        );
    };
    near(&alone.mean.square, variance / 8.0);
    near(
        &alone.mean.half,
        2.364_624 * 0.965_030 * (variance / 8.0).sqrt(),
    );
    let of_contrast = 2.0 * (0.1f64.powi(2) + open) / 8.0;
    near(&alone.contrast.square, of_contrast);
    near(
        &alone.contrast.half,
        2.364_624 * 0.965_030 * of_contrast.sqrt(),
    );
    near(&alone.mean.holds, 0.95);
    near(&alone.contrast.holds, 0.95);
    assert_eq!(precision.together.participant.square.studies, 0);
}

/// Few trials: learned together, thresholds are nearer to the truth; nothing depends on how many studies
/// there are.
#[test]
fn thresholds_learned_together_are_nearer() {
    let protocol = protocol(PROTOCOL);
    let found = alternatives(&protocol, &flags(4, 3), &[Procedure::Own], &[30]).unwrap();
    let precision = result(&found[0].plan, 8).precision.unwrap();
    let (alone, together) = (&precision.alone, &precision.together);
    assert_eq!(
        together.participant.square.studies + precision.not_converged,
        3
    );
    assert_eq!(alone.participant.square.studies, 4);
    assert!(together.participant.square.mean() < alone.participant.square.mean());
    assert!(together.participant.half.mean() < alone.participant.half.mean());
    for quality in [&together.mean, &together.contrast] {
        let half = quality.half.mean().unwrap();
        assert!((0.02..0.6).contains(&half), "{half}");
        assert!(quality.error.mean().unwrap().abs() < 0.4);
    }
    assert_eq!(precision.trials.mean(), Some(64.0));
    // The minutes are those of study check for the part.
    let minutes = found[0].minutes(64.0);
    let all = check::minutes(
        &protocol
            .with_procedure(&protocol.parts[0], Procedure::Own, Some(30))
            .unwrap(),
    );
    assert!(
        minutes > 0.8 * all - 2.0 && minutes < all,
        "{minutes} {all}"
    );
}

/// Other procedures have other answers of the same participants.
#[test]
fn procedures_are_compared_with_the_same_participants() {
    let protocol = protocol(PROTOCOL);
    let all = [Procedure::Staircase, Procedure::Constant];
    let found = alternatives(&protocol, &flags(3, 0), &all, &[20, 40]).unwrap();
    let asked: Vec<_> = found.iter().map(|f| (f.procedure, f.asked)).collect();
    let expected = [20, 40].map(|n| all.map(|p| (p, Some(n))));
    assert_eq!(asked, expected.concat());
    let trials: Vec<_> = (found.iter())
        .map(|f| result(&f.plan, 2).precision.unwrap().trials.mean().unwrap())
        .collect();
    // Eight levels: 20 trials are 24 here, the nearest number that gives each level equally many.
    assert_eq!(trials, [40.0, 48.0, 80.0, 80.0]);
}

/// Without a number of studies tracks have few: each takes many fits. One condition has nothing to compare.
#[test]
fn tracks_have_few_studies_unless_more_are_asked_for() {
    let two = protocol(PROTOCOL);
    let studies = |protocol: &Protocol| {
        let plan = Plan::of(protocol, &Overrides::default());
        plan.unwrap().settings.studies
    };
    assert_eq!(studies(&two), 200);
    let one = PROTOCOL.replace("method =", "condition = \"friction\"\nmethod =");
    assert_eq!(studies(&protocol(&one)), 40);
    let asked = PROTOCOL.replace("[power]", "[power]\nstudies = 90");
    assert_eq!(studies(&protocol(&asked)), 90);
}

#[test]
fn only_tracks_with_levels_have_procedures() {
    let mut protocol = protocol(PROTOCOL);
    let other = Overrides {
        part: Some(study_base::text::PartId::new("other").unwrap()),
        ..flags(1, 0)
    };
    let of = |protocol: &Protocol, flags: &Overrides| {
        alternatives(protocol, flags, &[Procedure::Own], &[]).unwrap_err()
    };
    assert!(matches!(of(&protocol, &other), PlanError::NoPart(_)));
    protocol.tracks.clear();
    assert!(matches!(
        of(&protocol, &flags(1, 0)),
        PlanError::NoThresholds(_)
    ));
}
