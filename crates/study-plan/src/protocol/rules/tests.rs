use super::*;
use proptest::prelude::*;

/// Part of the fingerprints in results folders: do not change.
#[test]
fn the_serialized_form_never_changes() {
    let forms = [
        (
            Exclusion::ConstantRater,
            r#"{"rule":"constant-rater","parameters":{}}"#,
        ),
        (
            Exclusion::HiddenReferenceBelow(5.0),
            r#"{"rule":"hidden-reference-below","parameters":{"rating":5.0}}"#,
        ),
        (
            Exclusion::StrokesBelow(2.0),
            r#"{"rule":"strokes-below","parameters":{"strokes":2.0}}"#,
        ),
        (
            Exclusion::Inconsistent(1.5),
            r#"{"rule":"inconsistent","parameters":{"difference":1.5}}"#,
        ),
        (
            Exclusion::WrongForce,
            r#"{"rule":"wrong-force","parameters":{}}"#,
        ),
        (
            Exclusion::UnverifiedForce,
            r#"{"rule":"unverified-force","parameters":{}}"#,
        ),
    ];
    for (rule, form) in forms {
        assert_eq!(serde_json::to_string(&rule).unwrap(), form);
    }
    let names: Vec<&str> = forms.iter().map(|(rule, _)| rule.name()).collect();
    let declared: Vec<&str> = SHAPES.iter().map(|shape| shape.word.word).collect();
    assert_eq!(names, declared);
}

/// Every rule with parameters at which tenths are at the limit.
fn rules() -> Vec<Exclusion> {
    (RULES.iter())
        .flat_map(|rule| {
            let at = |value: f64| (rule.read)(&mut |_| Some(value)).unwrap();
            [at(0.2), at(0.3), at(2.0)]
        })
        .collect()
}

/// Realization 0, its hidden duplicate 1 and the hidden reference 2.
fn trials(trials: Vec<Trial<'static>>) -> Trials<'static> {
    let realization = |hidden_reference, duplicate_of| Realization {
        hidden_reference,
        duplicate_of,
    };
    Trials {
        answers: Answers::Points,
        of_a_part: false,
        participants: 3,
        realizations: vec![
            realization(false, None),
            realization(false, Some(0)),
            realization(true, None),
        ],
        trials,
    }
}

fn rated(participant: usize, realization: usize, rating: f64) -> Trial<'static> {
    Trial {
        participant,
        realization: Some(realization),
        answer: Some(Given::Number(rating)),
        strokes: None,
        force: None,
    }
}

prop_compose! {
    fn any_trial()(
        participant in 0..3usize,
        realization in prop::option::weighted(0.9, 0..3usize),
        rating in prop::option::weighted(0.9, 0..6u8),
        strokes in prop::option::of(0..4u32),
        force in prop::option::of(prop::sample::select(
            vec![Force::Right, Force::Unverified, Force::Wrong],
        )),
    ) -> Trial<'static> {
        let answer = rating.map(|tenths| Given::Number(f64::from(tenths) / 10.0));
        Trial { participant, realization, answer, strokes, force }
    }
}

fn in_two_orders() -> impl Strategy<Value = (Vec<Trial<'static>>, Vec<usize>)> {
    prop::collection::vec(any_trial(), 1..30).prop_flat_map(|trials| {
        let order: Vec<usize> = (0..trials.len()).collect();
        (Just(trials), Just(order).prop_shuffle())
    })
}

proptest! {
    #[test]
    fn no_rule_depends_on_the_order_of_the_trials((first, order) in in_two_orders()) {
        let shuffled = order.iter().map(|&i| first[i]).collect();
        let (first, second) = (trials(first), trials(shuffled));
        for rule in rules() {
            let before = rule.judge(&first).unwrap();
            let after = rule.judge(&second).unwrap();
            let expected: Vec<bool> = order.iter().map(|&i| before.excluded[i]).collect();
            prop_assert_eq!(after.excluded, expected, "{}", rule);
            prop_assert_eq!(after.problem, before.problem, "{}", rule);
        }
        let distances = first.repeat_distances();
        prop_assert_eq!(distances, second.repeat_distances());
    }
}

#[test]
fn a_mean_at_the_limit_is_not_below_it() {
    let rule = Exclusion::HiddenReferenceBelow(0.2);
    for ratings in [[0.1, 0.2, 0.3], [0.3, 0.2, 0.1]] {
        let trials = trials(ratings.map(|rating| rated(0, 2, rating)).to_vec());
        assert_eq!(rule.judge(&trials).unwrap().excluded, [false; 3]);
    }
    let below = trials(vec![rated(0, 2, 0.1), rated(0, 2, 0.2), rated(1, 2, 0.3)]);
    assert_eq!(rule.judge(&below).unwrap().excluded, [true, true, false]);
}

/// One duplicate is rated 2 higher, the other 2 lower.
#[test]
fn distances_of_two_duplicates_do_not_cancel() {
    let mut trials = trials(vec![
        rated(0, 0, 1.0),
        rated(0, 1, 3.0),
        rated(0, 2, 5.0),
        rated(0, 3, 3.0),
    ]);
    trials.realizations.push(Realization {
        hidden_reference: false,
        duplicate_of: Some(2),
    });
    assert_eq!(trials.repeat_distances()[0], Some(2.0));
    let judged = Exclusion::Inconsistent(1.5).judge(&trials).unwrap();
    assert_eq!(judged.excluded, [true; 4]);
}

#[test]
fn a_rule_says_why_it_can_judge_nothing() {
    let answers = |rule: Exclusion, answers, of_a_part| {
        let mut trials = trials(vec![rated(0, 0, 1.0)]);
        trials.realizations.truncate(1);
        (trials.answers, trials.of_a_part) = (answers, of_a_part);
        rule.judge(&trials).unwrap_err()
    };
    let reference = Exclusion::HiddenReferenceBelow(1.0);
    let said = answers(reference, Answers::Points, true);
    assert_eq!(said, "the part has no hidden reference");
    let said = answers(Exclusion::Inconsistent(1.0), Answers::Points, false);
    assert_eq!(said, "the design has no hidden duplicate");
    let said = answers(reference, Answers::Choices, true);
    assert!(said.contains("not points of a scale"), "{said}");
    for rule in [reference, Exclusion::ConstantRater] {
        let said = answers(rule, Answers::Secondary, false);
        assert!(said.contains("the primary question"), "{said}");
    }
}
