use super::*;
use std::collections::BTreeMap;
use study_base::text::QuestionId;
use study_plan::protocol::{QuestionKind, kinds};

fn question(kind: QuestionKind) -> Question {
    Question {
        id: QuestionId::new("q").unwrap(),
        prompt: String::new(),
        kind,
        required: true,
    }
}

fn scale(from: i64, to: i64) -> Question {
    question(QuestionKind::Rating(kinds::Rating {
        from,
        to,
        labels: BTreeMap::new(),
    }))
}

fn after(question: &Question, keys: &[Key]) -> Option<f64> {
    let mut field = Field::new(question);
    for key in keys {
        field.key(question, *key, &Words::default());
    }
    let answer = field.answer(question).ok().flatten();
    answer.and_then(|a| a.number())
}

fn digits(text: &str) -> Vec<Key> {
    text.chars().map(Key::Char).collect()
}

#[test]
fn a_digit_chooses_and_another_one_chooses_anew() {
    assert_eq!(after(&scale(1, 7), &digits("5")), Some(5.0));
    assert_eq!(after(&scale(1, 7), &digits("53")), Some(3.0));
    assert_eq!(after(&scale(1, 7), &digits("58")), Some(5.0));
    assert_eq!(after(&scale(1, 7), &digits("0")), None);
}

#[test]
fn numbers_of_several_digits_are_typed() {
    assert_eq!(after(&scale(1, 10), &digits("1")), Some(1.0));
    assert_eq!(after(&scale(1, 10), &digits("10")), Some(10.0));
    assert_eq!(after(&scale(1, 10), &digits("15")), Some(5.0));
    assert_eq!(after(&scale(0, 100), &digits("37")), Some(37.0));
    assert_eq!(after(&scale(-3, 3), &digits("-2")), Some(-2.0));
    assert_eq!(after(&scale(1000, 2000), &digits("1500")), Some(1500.0));
    assert_eq!(after(&scale(-120, -100), &digits("-115")), Some(-115.0));
    assert_eq!(after(&scale(0, 10), &digits("0")), Some(0.0));
}

#[test]
fn backspace_takes_the_last_digit_back_and_then_the_choice() {
    let keys = |text: &str| -> Vec<Key> {
        let key = |c| {
            if c == '<' {
                Key::Backspace
            } else {
                Key::Char(c)
            }
        };
        text.chars().map(key).collect()
    };
    let percent = scale(0, 100);
    assert_eq!(after(&percent, &keys("57<")), Some(5.0));
    assert_eq!(after(&percent, &keys("57<8")), Some(58.0));
    assert_eq!(after(&percent, &keys("57<<")), None);
    assert_eq!(after(&scale(1, 7), &keys("5<")), None);
    let slider = question(QuestionKind::Slider(kinds::Slider {
        from: 0.0,
        to: 100.0,
        step: 1.0,
        labels: BTreeMap::new(),
    }));
    assert_eq!(after(&slider, &keys("57<")), Some(5.0));
    assert_eq!(after(&slider, &keys("5<")), None);
}

#[test]
fn arrows_start_at_an_end_and_stay_on_the_scale() {
    let scale = scale(1, 7);
    assert_eq!(after(&scale, &[Key::Right]), Some(1.0));
    assert_eq!(after(&scale, &[Key::Left]), Some(7.0));
    assert_eq!(after(&scale, &[Key::End, Key::Right]), Some(7.0));
    assert_eq!(after(&scale, &[Key::Home, Key::Left]), Some(1.0));
}

/// A tenth of a long scale; on a short one a single step.
#[test]
fn pages_move_by_a_tenth_of_the_scale() {
    let (percent, seven) = (scale(0, 100), scale(1, 7));
    assert_eq!(after(&percent, &[Key::Home, Key::PageUp]), Some(10.0));
    assert_eq!(after(&percent, &[Key::End, Key::PageDown]), Some(90.0));
    assert_eq!(after(&percent, &[Key::End, Key::PageUp]), Some(100.0));
    assert_eq!(after(&seven, &[Key::Home, Key::PageUp]), Some(2.0));
    assert_eq!(after(&seven, &[Key::End, Key::PageDown]), Some(6.0));
}

#[test]
fn extreme_scales_do_not_overflow() {
    let scale = scale(i64::MIN, i64::MAX);
    assert!(after(&scale, &digits("-9")).is_some());
    assert_eq!(
        after(&scale, &[Key::End, Key::Right]),
        Some(i64::MAX as f64)
    );
}

#[test]
fn a_slider_has_no_mark_until_it_is_moved() {
    let slider = question(QuestionKind::Slider(kinds::Slider {
        from: 0.0,
        to: 1.0,
        step: 0.1,
        labels: BTreeMap::new(),
    }));
    assert_eq!(after(&slider, &[]), None);
    assert_eq!(after(&slider, &[Key::Right]), Some(0.5));
    assert_eq!(
        after(&slider, &[Key::Home, Key::Right, Key::Right, Key::Right]),
        Some(0.3)
    );
    assert_eq!(after(&slider, &[Key::Home, Key::PageUp]), Some(1.0));
    assert_eq!(after(&slider, &[Key::End, Key::PageDown]), Some(0.0));
    assert_eq!(after(&slider, &digits("0.75")), Some(0.75));
    assert_eq!(after(&slider, &digits("2")), None);
}

#[test]
fn one_or_several_of_a_list() {
    let options: Vec<String> = ["a", "b", "c"].map(str::to_owned).to_vec();
    for (multiple, keys, want) in [
        (false, vec![Key::Down, Key::Down], vec!["b"]),
        (false, digits("31"), vec!["a"]),
        (
            true,
            vec![Key::Down, Key::Char(' '), Key::End, Key::Char('x')],
            vec!["a", "c"],
        ),
        (true, digits("323"), vec!["b"]),
    ] {
        let question = question(QuestionKind::Choice(kinds::Choice {
            options: options.clone(),
            multiple,
        }));
        let mut field = Field::new(&question);
        for key in keys {
            field.key(&question, key, &Words::default());
        }
        let want = want.into_iter().map(str::to_owned).collect();
        assert_eq!(field.answer(&question), Ok(Some(Answer::Choice(want))));
    }
}

#[test]
fn a_number_may_have_a_comma_and_must_be_in_range() {
    let number = question(QuestionKind::Number(kinds::Number {
        unit: None,
        min: Some(0.0),
        max: Some(120.0),
        above: None,
    }));
    assert_eq!(after(&number, &digits("12,5")), Some(12.5));
    let mut field = Field::new(&number);
    for key in digits("121") {
        field.key(&number, key, &Words::default());
    }
    assert_eq!(
        field.answer(&number).map_err(|why| why.to_string()),
        Err("Type a number from 0 to 120.".to_owned())
    );
    // Letters are no part of a number: "nan" and "inf" cannot be typed.
    assert_eq!(
        field.key(&number, Key::Char('n'), &Words::default()),
        Handled::No
    );
}

#[test]
fn an_empty_optional_text_is_no_answer() {
    let mut text = question(QuestionKind::Text(kinds::Text));
    text.required = false;
    let mut field = Field::new(&text);
    field.key(&text, Key::Char(' '), &Words::default());
    assert_eq!(field.answer(&text), Ok(None));
}

#[test]
fn options_after_the_ninth_have_letters() {
    let options = (1..=30).map(|n| format!("option {n}")).collect();
    let list = question(QuestionKind::Choice(kinds::Choice {
        options,
        multiple: false,
    }));
    let chosen = |keys: &str| {
        let mut field = Field::new(&list);
        let handled = digits(keys)
            .into_iter()
            .map(|key| field.key(&list, key, &Words::default()))
            .last();
        (field.answer(&list).ok().flatten(), handled)
    };
    let option = |n: u32| Some(Answer::Choice(vec![format!("option {n}")]));
    for (key, n) in [("1", 1), ("9", 9), ("a", 10), ("B", 11), ("u", 30)] {
        assert_eq!(chosen(key).0, option(n), "{key}");
    }
    assert_eq!(chosen("v"), (None, Some(Handled::No)));
    // x marks the option at the cursor, and is the key of none.
    assert_eq!(chosen("cx").0, option(12));
    let keys = [8, 31, 32, 33, 34].map(key_of);
    assert_eq!(keys, [Some('9'), Some('w'), Some('y'), Some('z'), None]);
}
