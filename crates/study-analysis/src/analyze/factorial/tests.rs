use crate::analyze::findings::Direction;
use crate::analyze::{Analysis, Question, Rules, TestKind, Verdict, analyze};
use study_base::text::QuestionId;
use study_plan::protocol::{Crossing, Factor};
use study_session::outcome::ratings::Ratings;

/// Nine participants rate each combination of friction (low, high) and grain (fine, medium,
/// coarse) twice; made with random numbers, so that no effect is exact.
pub(super) const RATINGS: [(&str, &str); 9] = [
    ("novices", "343233433555"),
    ("experts", "557555666677"),
    ("novices", "545454656767"),
    ("novices", "333332435454"),
    ("experts", "455666567777"),
    ("experts", "555445667777"),
    ("novices", "554454654776"),
    ("experts", "545566566777"),
    ("experts", "233433432566"),
];

pub(super) const FRICTION: [&str; 2] = ["low", "high"];
pub(super) const GRAIN: [&str; 3] = ["fine", "medium", "coarse"];

fn factor(id: &str, levels: &[&str]) -> Factor {
    Factor {
        id: QuestionId::new(id).unwrap(),
        levels: levels.iter().map(|l| (*l).to_owned()).collect(),
    }
}

pub(super) fn crossing(groups: &[&str], effects: &[&[usize]]) -> Crossing {
    let combinations = (0..2).flat_map(|a| (0..3).map(move |b| (a, b)));
    Crossing {
        factors: vec![factor("friction", &FRICTION), factor("grain", &GRAIN)],
        levels_of: combinations
            .map(|(a, b)| (format!("{}-{}", FRICTION[a], GRAIN[b]), vec![a, b]))
            .collect(),
        groups: groups.iter().map(|g| (*g).to_owned()).collect(),
        effects: effects.iter().map(|e| e.to_vec()).collect(),
    }
}

pub(super) const ALL: [&[usize]; 3] = [&[0], &[1], &[0, 1]];

/// The table without some cells; each a participant and the number of a rating.
fn table(missing: &[(usize, usize)]) -> Ratings {
    let mut csv = "subject,model,repetition,rating\n".to_owned();
    for (s, (_, ratings)) in RATINGS.iter().enumerate() {
        for (i, rating) in ratings.chars().enumerate() {
            if !missing.contains(&(s, i)) {
                let model = format!("{}-{}", FRICTION[i / 6], GRAIN[i / 2 % 3]);
                csv += &format!("P{s},{model},{},{rating}\n", i % 2 + 1);
            }
        }
    }
    let mut ratings = Ratings::read_csv("table.csv", csv.as_bytes(), None).unwrap();
    for (subject, (group, _)) in ratings.subjects.iter_mut().zip(RATINGS) {
        subject.group = Some(group.to_owned());
    }
    ratings
}

pub(super) fn analyzed(ratings: &Ratings, crossing: Crossing) -> Analysis {
    let rules = Rules {
        crossing: Some(crossing),
        ..Rules::default()
    };
    analyze(ratings, &rules)
}

fn close(a: &Analysis, id: &str, expected: f64) {
    let found = a.values.number(id).unwrap_or_else(|| panic!("{id}"));
    let apart = (found / expected - 1.0).abs();
    assert!(apart < 1e-9, "{id}: {found}, not {expected}");
}

/// R 4.2.2, afex 1.2.1: aov_ez over the cell means, ges and pes; contrasts: pairs(emmeans(…, model =
/// "multivariate")), whose printed digits are checked.
#[test]
fn effects_within_participants_agree_with_r() {
    let a = analyzed(&table(&[]), crossing(&[], &ALL));
    for (effect, numbers) in [
        (
            "friction",
            [
                24.671_296_296_3,
                1.120_370_370_37,
                0.956_560_761_084_2,
                0.287_231_175_551_12,
            ],
        ),
        (
            "grain",
            [
                5.064_814_814_8,
                4.268_518_518_52,
                0.542_658_730_158_7,
                0.076_407_319_458_02,
            ],
        ),
        (
            "friction:grain",
            [
                3.064_814_814_8,
                3.768_518_518_52,
                0.448_509_485_094_9,
                0.047_673_916_174_56,
            ],
        ),
    ] {
        for (name, number) in ["ss", "ss_error", "pes", "ges"].iter().zip(numbers) {
            close(&a, &format!("factorial/{effect}/{name}"), number);
        }
    }
    close(&a, "factorial/grain/eps_gg", 0.933_563_223_440_005);
    close(&a, "factorial/grain/p_gg", 0.002_508_585_468_024_4);
    close(&a, "factorial/grain/eps_hf", 1.206_949_555_839_836);
    close(&a, "factorial/friction:grain/p_hf", 0.009_075_317_741_465_5);
    // Holm's correction of these three p by hand.
    close(
        &a,
        "factorial/friction:grain/p_holm",
        0.014_571_714_022_800_5,
    );
    close(&a, "factorial/grain/p_holm", 2.0 * 0.002_508_585_468_024_4);
    let near = |id: &str, expected: f64, digits: f64| {
        let found = a.values.number(id).unwrap_or_else(|| panic!("{id}"));
        assert!((found - expected).abs() < digits, "{id}: {found}");
    };
    near(
        "factorial_contrast/friction=low|high@grain=coarse/t",
        -9.191,
        5e-4,
    );
    near(
        "factorial_contrast/friction=low|high@grain=fine/difference",
        -0.778,
        5e-4,
    );
    near("factorial_contrast/grain=fine|coarse/t", -3.928, 5e-4);
    near("factorial_contrast/grain=fine|coarse/p", 0.0044, 5e-5);
    near("factorial_mean/grain=medium/mean", 4.94, 5e-3);
    near("factorial_mean/grain=medium/ci95_hi", 5.84, 5e-3);
    near("factorial_mean/friction=low,grain=fine/n", 9.0, 1e-12);

    let finding = |effect: &str| a.finding(&Question::Effect(effect.to_owned())).unwrap();
    let interaction = finding("friction:grain");
    let test = interaction.test.as_ref().unwrap();
    let kind = TestKind::FactorialAnovaGreenhouseGeisser;
    assert_eq!(
        (test.kind, test.comparisons, interaction.is_yes()),
        (kind, 3, true)
    );
    // df with the correction: 2ε and 16ε.
    let df = &test.statistic.as_ref().unwrap().df;
    assert!((df[0] - 1.611_269_715_436).abs() < 1e-9 && (df[1] - 12.890_157_723_49).abs() < 1e-8);
    let friction = finding("friction");
    assert_eq!(
        friction.test.as_ref().unwrap().kind,
        TestKind::FactorialAnova
    );
    // High minus low, and a warning that this is a mean over what it depends on.
    assert_eq!(friction.direction, Some(Direction::Up));
    let estimate = friction.estimate.unwrap();
    assert!((estimate.value - (0.778 + 1.333 + 1.944) / 3.0).abs() < 1e-3);
    assert!(estimate.ci95.unwrap().0 > 0.0);
    assert!(friction.caveats.iter().any(|c| c.code == "interaction"));
    assert!(interaction.caveats.iter().all(|c| c.code != "interaction"));
    // The effects are the first findings.
    assert_eq!(
        a.findings[0].question,
        Question::Effect("friction".to_owned())
    );
}

/// The same with a factor between participants of unequal groups, type 3.
#[test]
fn effects_with_groups_agree_with_r() {
    let effects: [&[usize]; 7] = [&[0], &[1], &[2], &[0, 1], &[0, 2], &[1, 2], &[0, 1, 2]];
    let a = analyzed(&table(&[]), crossing(&["novices", "experts"], &effects));
    close(&a, "factorial/group/ss", 12.566_898_148_1);
    close(&a, "factorial/group/ss_error", 39.497_916_666_67);
    close(&a, "factorial/group/ges", 0.211_459_286_813_3);
    close(&a, "factorial/friction/ss", 24.450_231_481_5);
    close(&a, "factorial/grain:group/p_gg", 0.100_552_296_252_708_71);
    close(&a, "factorial/grain:group/ges", 0.024_920_527_887_5);
    close(&a, "factorial/friction:grain:group/ss", 0.589_351_851_9);
    close(
        &a,
        "factorial/friction:grain/p_gg",
        0.018_282_552_374_337_35,
    );
    close(&a, "factorial_mean/group=novices/n", 4.0);
    // 4 and 5 are about equal; 4 and 6 would not be.
    assert!(
        a.findings
            .iter()
            .all(|f| f.caveats.iter().all(|c| c.code != "unequal-groups"))
    );
    let three = [(0, 0), (0, 1)];
    let groups = crossing(&["novices", "experts"], &effects);
    let uneven = analyzed(&table(&three), groups);
    let warns = |effect: &str| {
        let found = uneven
            .finding(&Question::Effect(effect.to_owned()))
            .unwrap();
        found.caveats.iter().any(|c| c.code == "unequal-groups")
    };
    let alone = crossing(&["novices", "experts"], &[&[1, 2]]);
    let alone = analyzed(&table(&three), alone);
    assert!(
        alone.findings[0]
            .caveats
            .iter()
            .any(|c| c.code == "unequal-groups")
    );
    assert!(warns("grain:group") && warns("group") && !warns("grain"));
    // A group within a level has a mean of its own participants: P0 P2 P3 P6.
    close(
        &a,
        "factorial_mean/friction=low,group=novices/mean",
        89.0 / 24.0,
    );
}

/// Only what is stated is tested and corrected for.
#[test]
fn the_formula_says_how_many_effects_are_corrected_for() {
    let a = analyzed(&table(&[]), crossing(&[], &[&[0], &[1]]));
    close(&a, "factorial/grain/p_holm", 0.002_508_585_468_024_4);
    assert!(
        a.finding(&Question::Effect("friction:grain".to_owned()))
            .is_none()
    );
    assert_eq!(a.values.number("factorial/friction:grain/p_holm"), None);
    // It is computed all the same.
    close(&a, "factorial/friction:grain/p_gg", 0.014_571_714_022_800_5);
}

#[test]
fn what_cannot_be_analyzed_has_a_reason() {
    let reason = |ratings: &Ratings, crossing: Crossing| {
        let a = analyzed(ratings, crossing);
        let found = a.finding(&Question::Effect("grain".to_owned())).unwrap();
        assert_eq!(found.test, None);
        match &found.verdict {
            Verdict::Undefined(why) => why.clone(),
            other => panic!("{other:?}"),
        }
    };
    // Nobody felt high friction on coarse grain.
    let hole: Vec<(usize, usize)> = (0..9).flat_map(|s| [(s, 10), (s, 11)]).collect();
    let why = reason(&table(&hole), crossing(&[], &ALL));
    assert!(why.contains("friction = high, grain = coarse"), "{why}");
    // Experts alone rated everything.
    let novices: Vec<(usize, usize)> = [0, 2, 3, 6]
        .iter()
        .flat_map(|s| [(*s, 0), (*s, 1)])
        .collect();
    let why = reason(&table(&novices), crossing(&["novices", "experts"], &ALL));
    assert!(why.contains("of one group"), "{why}");
    // A realization that the protocol does not know.
    let mut unknown = crossing(&[], &ALL);
    unknown.levels_of.remove("low-fine");
    let why = reason(&table(&[]), unknown);
    assert!(why.contains("no levels"), "{why}");
}

/// Four of nine rated everything: all are compared within participants. R 4.2.2, clubSandwich 0.5.8:
/// vcovCR(lm(cell mean ~ participant + realization), cluster = participant, type = "CR2"),
/// Wald_test(test = "HTZ"), linear_contrast with Satterthwaite's degrees of freedom and p of t by pt.
#[test]
fn incomplete_designs_agree_with_r() {
    let missing = [(0, 0), (2, 4), (3, 6), (5, 8), (8, 10)];
    let missing: Vec<(usize, usize)> = missing
        .iter()
        .flat_map(|(s, i)| [(*s, *i), (*s, i + 1)])
        .collect();
    let a = analyzed(&table(&missing), crossing(&[], &ALL));
    close(&a, "factorial/friction/clustered/htz_F", 186.877_797_487_38);
    close(&a, "factorial/friction/clustered/df", 7.876_936_190_013_5);
    close(&a, "factorial/friction/clustered/p", 9.127_262_731_717_6e-7);
    close(&a, "factorial/grain/clustered/htz_F", 7.176_057_917_788);
    close(&a, "factorial/grain/clustered/htz_df1", 2.0);
    close(&a, "factorial/grain/clustered/htz_df2", 6.791_738_887_456);
    close(
        &a,
        "factorial/grain/clustered/htz_p",
        0.021_142_014_846_712_4,
    );
    close(
        &a,
        "factorial/friction:grain/clustered/htz_F",
        6.500_877_101_836_9,
    );
    // The clearest of three contrasts each: fine against coarse.
    close(&a, "factorial/grain/clustered/t", 3.803_803_049_654);
    close(
        &a,
        "factorial/grain/clustered/p",
        3.0 * 0.005_541_358_745_217_6,
    );
    close(&a, "factorial/friction:grain/clustered/n_contrasts", 3.0);
    close(
        &a,
        "factorial/friction:grain/clustered/p",
        3.0 * 0.005_548_643_815_613_2,
    );
    // Holm's correction over the effects by hand.
    close(&a, "factorial/grain/p_holm", 6.0 * 0.005_541_358_745_217_6);
    close(
        &a,
        "factorial/friction:grain/p_holm",
        6.0 * 0.005_541_358_745_217_6,
    );
    let simple = "factorial_contrast/friction=low|high@grain=coarse";
    close(&a, &format!("{simple}/difference"), -1.756_410_256_41);
    close(&a, &format!("{simple}/df"), 7.307_798_787_39);
    close(
        &a,
        &format!("{simple}/difference_ci95_lo"),
        -2.207_020_892_99,
    );
    close(
        &a,
        "factorial_contrast/grain=fine|coarse/difference",
        -0.743_589_743_59,
    );
    close(
        &a,
        "factorial_contrast/grain=fine|coarse/difference_ci95_hi",
        -0.290_122_558_999,
    );
    // Means differ by what the differences are.
    let mean = |level: &str| {
        a.values
            .number(&format!("factorial_mean/grain={level}/mean"))
            .unwrap()
    };
    assert!((mean("fine") - mean("coarse") + 0.743_589_743_59).abs() < 1e-9);
    let found = a.finding(&Question::Effect("grain".to_owned())).unwrap();
    let test = found.test.as_ref().unwrap();
    assert_eq!(
        (test.kind, found.participants),
        (TestKind::FactorialWithin, 9)
    );
    assert!(
        found
            .caveats
            .iter()
            .any(|c| c.code == "within-participants" && c.text.starts_with("4 of 9"))
    );
    // What the four say is beside it.
    close(&a, "factorial/grain/df2", 6.0);
}

/// The participants' differences by R 4.2.2: the larger of pt((d ± margin)/se, 8), p.adjust(…, "holm") over the three
/// pairs of grain, and d ± qt(.95, 8)·se. Of the incomplete table se and its degrees of freedom are those of clubSandwich
/// 0.5.8, linear_contrast(…, test = "Satterthwaite").
#[test]
fn levels_are_equivalent_as_r_says() {
    let with_margin = |ratings: &Ratings, margin: f64| {
        let rules = Rules {
            crossing: Some(crossing(&[], &ALL)),
            equivalence_margin: Some(margin),
            ..Rules::default()
        };
        analyze(ratings, &rules)
    };
    let a = with_margin(&table(&[]), 1.0);
    for (pair, p, p_holm, ci90, equivalent) in [
        (
            "fine|medium",
            0.003_778_790_369_974_8,
            0.007_557_580_739_949_59,
            (-0.709_394_226_038_905_2, -0.068_383_551_738_872_5),
            1.0,
        ),
        (
            "fine|coarse",
            0.113_391_019_747_65,
            0.113_391_019_747_65,
            (-1.105_063_318_349_663, -0.394_936_681_650_337),
            0.0,
        ),
        (
            "medium|coarse",
            0.001_429_116_176_860_32,
            0.004_287_348_530_580_95,
            (-0.641_664_752_007_503_7, -0.080_557_470_214_718_49),
            1.0,
        ),
    ] {
        let id = |name: &str| format!("factorial_contrast/grain={pair}/{name}");
        close(&a, &id("p_tost"), p);
        close(&a, &id("p_tost_holm"), p_holm);
        close(&a, &id("ci90_lo"), ci90.0);
        close(&a, &id("ci90_hi"), ci90.1);
        assert_eq!(a.values.number(&id("equivalent")), Some(equivalent));
    }
    // What differs can be equivalent, and what does not matter here is no verdict about differences.
    let b = with_margin(&table(&[]), 2.0);
    close(
        &b,
        "factorial_contrast/friction=low|high/p_tost",
        0.000_108_706_288_713_713,
    );
    assert!(
        b.finding(&Question::Effect("friction".to_owned()))
            .unwrap()
            .is_yes()
    );
    // Simple effects are a family of their own, and without a margin there are no such tests.
    assert!(
        b.values
            .number("factorial_contrast/friction=low|high@grain=fine/p_tost_holm")
            .is_some()
    );
    let without = analyzed(&table(&[]), crossing(&[], &ALL));
    assert!(without.values.iter().all(|(id, _)| !id.contains("tost")));

    let missing = [(0, 0), (2, 4), (3, 6), (5, 8), (8, 10)];
    let missing: Vec<(usize, usize)> = missing
        .iter()
        .flat_map(|(s, i)| [(*s, *i), (*s, i + 1)])
        .collect();
    let c = with_margin(&table(&missing), 1.5);
    let incomplete = "factorial_contrast/grain=fine|coarse";
    close(
        &c,
        &format!("{incomplete}/p_tost"),
        0.002_529_550_580_883_39,
    );
    close(&c, &format!("{incomplete}/ci90_lo"), -1.108_710_359_071_529);
    close(&c, &format!("{incomplete}/ci90_hi"), -0.378_469_128_107_959);
}

/// Participants who all differ alike leave no error, and equivalence with a reason.
#[test]
fn equivalence_without_an_error_has_a_reason() {
    let mut csv = "subject,model,rating\n".to_owned();
    for s in 0..4 {
        for (i, model) in ["low-fine", "low-medium", "low-coarse"].iter().enumerate() {
            let high = model.replace("low", "high");
            csv += &format!("P{s},{model},{}\nP{s},{high},{}\n", s + i, s + i);
        }
    }
    let ratings = Ratings::read_csv("t.csv", csv.as_bytes(), None).unwrap();
    let rules = Rules {
        crossing: Some(crossing(&[], &ALL)),
        equivalence_margin: Some(1.0),
        ..Rules::default()
    };
    let a = analyze(&ratings, &rules);
    let id = "factorial_contrast/friction=low|high/equivalent";
    assert_eq!(a.values.number(id), None);
    assert!(a.values.get(id).is_some(), "it is listed with its reason");
}

/// Who did not rate everything is left out, and the finding says so.
#[test]
fn incomplete_participants_are_named() {
    let groups = crossing(&["novices", "experts"], &ALL);
    let a = analyzed(&table(&[(8, 0), (8, 1)]), groups);
    let found = a.finding(&Question::Effect("friction".to_owned())).unwrap();
    assert_eq!(found.participants, 8);
    let caveat = found
        .caveats
        .iter()
        .find(|c| c.code == "complete-only")
        .unwrap();
    assert!(
        caveat.text.starts_with("8 of 9 participants"),
        "{}",
        caveat.text
    );
}

/// Everybody felt the realizations in one order: what differs may be practice.
#[test]
fn one_order_for_everybody_withdraws_the_verdict() {
    let mut ratings = table(&[]);
    let order: Vec<Option<u32>> = (0..ratings.len())
        .map(|i| {
            let repetition = ratings.repetition[i];
            ratings.model[i].map(|m| m + 1 + 6 * (repetition - 1))
        })
        .collect();
    ratings.trial_index = order;
    let a = analyzed(&ratings, crossing(&[], &ALL));
    let found = a.finding(&Question::Effect("grain".to_owned())).unwrap();
    assert!(found.reason().unwrap().contains("same order"), "{found:?}");
}
