use super::*;
use crate::outcome::FormId;
use crate::session::view::{DeviceState, StatusLine};
use std::sync::Arc;
use study_plan::protocol::kinds::{QuestionKind, Rating};
use study_plan::protocol::{DeviceKind, Entry, Exposure, Question, example};

fn view(screen: Screen) -> View {
    View {
        screen,
        progress: None,
        line: StatusLine {
            participant: "P01".to_owned(),
            operator: "lw".to_owned(),
            device: DeviceState::Limp,
            elapsed_s: 60.0,
            trials_saved: 3,
            trials_answered: 3,
            all_saved: true,
            mirror: None,
        },
        device: DeviceKind::Simulated,
        banner: None,
        notice: None,
        entry: Entry::Participant,
        correctable: Vec::new(),
        can_mark_bad: None,
        armed: false,
        unsaved: Vec::new(),
        can_replay: false,
        can_go_back: false,
        force: true,
        has_reference: false,
        remarks: Vec::new(),
        can_advance: true,
        words: Arc::new(Words::default()),
    }
}

fn asks(to_experimenter: bool, kind: QuestionKind) -> View {
    let question = Question {
        kind,
        ..example::protocol(2, 1).questions[0].clone()
    };
    view(Screen::Form {
        form: FormId::Intake,
        questions: vec![question],
        page: 1,
        pages: 1,
        to_experimenter,
    })
}

fn rating(to: i64) -> QuestionKind {
    let labels = Default::default();
    QuestionKind::Rating(Rating {
        from: 1,
        to,
        labels,
    })
}

/// "Next" while another interval follows, "Answer" after the last one.
#[test]
fn the_button_of_an_interval_says_what_follows() {
    let button = |interval| {
        let playing = view(Screen::Playing {
            since_s: 1.0,
            keep_exploring: false,
            exposure: Exposure::default(),
            interval,
        });
        participant(&playing).unwrap().buttons[0].label.clone()
    };
    assert_eq!(button(None), "Rate");
    assert_eq!(button(Some((1, 2))), "Next");
    assert_eq!(button(Some((2, 2))), "Answer");
    assert_eq!(button(Some((2, 3))), "Next");
    assert_eq!(button(Some((3, 3))), "Answer");
}

/// 21 boxes are the most that a page draws; a longer scale is typed.
#[test]
fn a_scale_of_more_than_21_points_is_typed() {
    let field = |to| {
        let page = participant(&asks(false, rating(to))).unwrap();
        page.questions[0].field.clone()
    };
    let Field::Boxes { boxes } = field(21) else {
        panic!("21 points are boxes");
    };
    assert_eq!(boxes.len(), 21);
    assert!(matches!(field(22), Field::Number { .. }));
}

/// What only the experimenter may read or do does not leave the terminal.
#[test]
fn a_participants_page_has_nothing_of_the_experimenters() {
    let secret = || "code-K7".to_owned();
    let pages = [
        view(Screen::Mount { code: secret() }),
        view(Screen::DeviceTrouble {
            what: secret(),
            can_go_on: true,
        }),
        view(Screen::SaveTrouble { what: secret() }),
        view(Screen::ResumeChoice {
            gap_h: 1.0,
            done: 3,
            total: Some(9),
        }),
        asks(true, rating(7)),
    ];
    for view in pages {
        assert_ne!(page(&view).kind, Kind::Wait);
        let own = participant(&view).unwrap();
        assert_eq!((own.kind, own.title.as_str()), (Kind::Wait, "One moment."));
        assert!(own.buttons.is_empty() && own.questions.is_empty());
        let json = serde_json::to_string(&own).unwrap();
        assert!(!json.contains("K7"), "{json}");
    }
}

/// A page that asks for what only the experimenter decides is not even read.
#[test]
fn no_page_can_request_what_the_experimenter_decides() {
    let read = |word: &str| serde_json::from_str::<Does>(&format!("\"{word}\""));
    assert_eq!(read("advance").unwrap(), Does::Advance);
    for word in [
        "drop-out",
        "restart-block",
        "continue",
        "retry-save",
        "quit",
    ] {
        assert!(read(word).is_err(), "{word}");
    }
}

#[test]
fn a_clock_shows_any_number() {
    assert_eq!(clock(0.0), "0:00");
    assert_eq!(clock(761.9), "12:41");
    assert_eq!(clock(3600.0), "1:00:00");
    assert_eq!(clock(f64::NAN), "0:00");
    assert_eq!(clock(-1.0), "0:00");
}
