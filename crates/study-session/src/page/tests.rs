use super::*;
use crate::outcome::FormId;
use crate::session::Input;
use crate::session::view::{Adjusting, Correctable, DeviceState, MessageKind, StatusLine};
use std::sync::Arc;
use study_plan::protocol::kinds::{QuestionKind, Rating};
use study_plan::protocol::{
    AdjustmentWords, Answer, DeviceKind, Entry, Exposure, Given, Question, example,
};

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
        course: Default::default(),
        banner: None,
        notice: None,
        entry: Entry::Participant,
        correctable: Vec::new(),
        can_mark_bad: None,
        armed: false,
        unsaved: Vec::new(),
        can_replay: false,
        has_replays: false,
        can_go_back: false,
        force: true,
        has_reference: false,
        numbered: false,
        adjusting: None,
        cue: None,
        awaits_page: false,
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
            restart: true,
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

/// A playback is one page however long it lasts, and is told again only when its clock moves.
#[test]
fn a_playback_is_one_page() {
    let mut exchange = reply::Exchange::new("run".to_owned());
    let mut shown = |since_s| {
        exchange.show(&view(Screen::Playing {
            since_s,
            keep_exploring: since_s < 1.5,
            exposure: Exposure::default(),
            interval: None,
        }));
        let page = exchange.page().unwrap();
        (page.id.to_owned(), page.revision)
    };
    assert_eq!(shown(0.1), ("run.1".to_owned(), 1));
    assert_eq!(shown(0.9), ("run.1".to_owned(), 1));
    assert_eq!(shown(1.1), ("run.1".to_owned(), 2));
    assert_eq!(shown(1.6), ("run.1".to_owned(), 3));
}

/// A front that was lost comes back under its name, is told the page again, and may use keys that
/// the one before has used; what that one sent last counts no more.
#[test]
fn a_front_begins_again() {
    let message = view(Screen::Message {
        kind: MessageKind::Welcome,
        text: "Hello.".to_owned(),
    });
    let hello = br#"{"format":"study-page/1","front":"a 1"}"#;
    let advance = br#"{"page":"run.1","key":"1","shown_ms":300,"does":"advance"}"#;
    let mut talk = front::Talk::new("run".to_owned(), Some("ar"), &Words::default());
    talk.show(&message);
    assert_eq!(talk.says(), [""; 0], "nobody has said who it is");
    talk.hears(hello).unwrap();
    let said = talk.says();
    assert!(
        said[0].contains(r#""dir":"rtl""#) && said[1].contains("run.1"),
        "{said:?}"
    );
    assert_eq!(talk.says(), [""; 0]);
    talk.hears(advance).unwrap();
    talk.begin_again();
    assert_eq!(talk.input(&message), None);
    let other = br#"{"format":"study-page/1","front":"a 1","simulated":true}"#;
    assert!(talk.hears(other).is_err() && !talk.is_open());
    talk.hears(hello).unwrap();
    assert_eq!(talk.says(), said);
    talk.hears(advance).unwrap();
    assert_eq!(talk.input(&message), Some(Input::Advance));
    // Not before everything is on disk.
    let mut unsaved = message.clone();
    unsaved.line.all_saved = false;
    talk.show(&unsaved);
    assert_eq!(talk.says(), [""; 0]);
    talk.show(&message);
    assert_eq!(
        talk.says(),
        ["{\"say\":\"settled\",\"key\":\"1\",\"outcome\":\"saved\"}\n"]
    );
}

/// Whatever else it says, a request to stop is taken, before all replies.
#[test]
fn a_stop_is_always_taken() {
    use reply::Sent;
    let view = asks(false, rating(7));
    let mut exchange = reply::Exchange::new("run".to_owned());
    exchange.show(&view);
    for key in 0..9 {
        let tap = format!(r#"{{"page":"run.1","key":"{key}","shown_ms":300,"does":"answer"}}"#);
        assert_eq!(
            exchange.arrive(Sent::read(tap.as_bytes()).unwrap()),
            key < 8
        );
    }
    for stop in [
        r#"{"does":"stop"}"#,
        r#"{"page":5,"key":"","does":"stop","shown_ms":-1,"new":[]}"#,
    ] {
        assert!(exchange.arrive(Sent::read(stop.as_bytes()).unwrap()));
        assert_eq!(exchange.input(&view), Some(Input::Stop));
    }
    for wrong in ["{}", "[]", "stop", r#"{"does":"go"}"#, "\"stop\""] {
        assert!(Sent::read(wrong.as_bytes()).is_err(), "{wrong}");
    }
}

/// A page says what was answered before a step back, on which side its scales begin, and of a
/// pause only what is known of the device.
#[test]
fn a_page_says_what_its_view_says() {
    let mut form = asks(false, rating(7));
    form.correctable = vec![Correctable {
        form: FormId::Intake,
        title: "intake".to_owned(),
        question: example::protocol(2, 1).questions[0].clone(),
        answer: Answer::Rating(5),
    }];
    let asked = &participant(&form).unwrap().questions[0];
    assert_eq!(asked.given, Some(Given::Typed("5".to_owned())));
    for (lang, scales) in [("en", "ltr"), ("ar", "rtl")] {
        form.words = Arc::new(Words::new(Some(lang), &Default::default()));
        assert_eq!(participant(&form).unwrap().scales, scales);
    }
    for (device, force, no_force) in [
        (DeviceKind::Simulated, true, true),
        (DeviceKind::Simulated, false, false),
        (DeviceKind::Manual, true, false),
    ] {
        let mut paused = view(Screen::Paused { since_s: 61.0 });
        (paused.device, paused.force) = (device, force);
        let clock = page(&paused).clock.unwrap();
        assert_eq!(clock.contains("no force"), no_force, "{device:?}: {clock}");
    }
}

/// A reply counts once, on its own page, with everything that was given.
#[test]
fn a_reply_counts_once_and_on_its_own_page() {
    use reply::{Exchange, Outcome, Sent};
    let send = |exchange: &mut Exchange, page: &str, key: &str, rest: &str| {
        let json = format!(r#"{{"page":"{page}","key":"{key}","shown_ms":300,{rest}}}"#);
        assert!(exchange.arrive(Sent::read(json.as_bytes()).unwrap()));
    };
    let mut exchange = Exchange::new("run".to_owned());
    // The text below a prompt comes when the wait is over: that is no other page.
    for wait_s in [2.0, 0.0] {
        let prompt = "Feel the reference.".to_owned();
        exchange.show(&view(Screen::Reference { prompt, wait_s }));
        assert_eq!(exchange.page().unwrap().id, "run.1");
    }
    let message = view(Screen::Message {
        kind: MessageKind::Welcome,
        text: "Hello.".to_owned(),
    });
    exchange.show(&message);
    send(&mut exchange, "run.2", "1", r#""does":"advance""#);
    assert_eq!(exchange.input(&message), Some(Input::Advance));
    exchange.show(&message);
    assert_eq!(exchange.outcome("1"), Some(&Outcome::Saved));
    send(&mut exchange, "run.2", "1", r#""does":"advance""#);
    assert_eq!(exchange.input(&message), None);

    let mut form = asks(false, rating(7));
    exchange.show(&form);
    let Screen::Form { page, .. } = &mut form.screen else {
        panic!("a form");
    };
    *page = 2;
    exchange.show(&form);
    let decline = r#""does":"decline","reason":"too loud""#;
    send(&mut exchange, "run.3", "2", decline);
    assert_eq!(exchange.input(&form), None);
    assert_eq!(exchange.outcome("2"), Some(&Outcome::Stale));
    send(&mut exchange, "run.4", "3", decline);
    let Some(Input::Answer(answers)) = exchange.input(&form) else {
        panic!("an answer");
    };
    let reason = "too loud".to_owned();
    assert_eq!(answers[0].1, Answer::Declined { reason });
}

/// A level that is confirmed is an answer: its reply is settled once the device has stopped and the level is on disk, and
/// is refused if it was not taken.
#[test]
fn a_confirmed_level_is_saved_only_after_the_stop() {
    use reply::{Exchange, Outcome, Sent};
    let setting = |screen: Screen| View {
        adjusting: Some(Adjusting {
            prompt: "Until both feel equal.".to_owned(),
            words: AdjustmentWords {
                lower: "weaker".to_owned(),
                higher: "stronger".to_owned(),
                confirm: "equal".to_owned(),
            },
            can_lower: true,
            can_higher: true,
            has_standard: false,
            at_standard: false,
        }),
        ..view(screen)
    };
    let playing = setting(Screen::Playing {
        since_s: 3.0,
        keep_exploring: false,
        exposure: Exposure::default(),
        interval: None,
    });
    let stopping = setting(Screen::Stopping);
    let reference = view(Screen::Reference {
        prompt: "Feel the reference.".to_owned(),
        wait_s: 0.0,
    });
    let stopped = setting(Screen::Stopped { can_rate: true });
    let trouble = view(Screen::DeviceTrouble {
        what: "no bus".to_owned(),
        can_go_on: false,
    });
    let refused = Outcome::Refused(String::new());
    for (then, outcome) in [
        (&reference, &Outcome::Saved),
        (&stopped, &refused),
        (&trouble, &refused),
    ] {
        let mut exchange = Exchange::new("run".to_owned());
        exchange.show(&playing);
        let confirm = br#"{"page":"run.1","key":"1","shown_ms":3000,"does":"advance"}"#;
        assert!(exchange.arrive(Sent::read(confirm).unwrap()));
        assert_eq!(exchange.input(&playing), Some(Input::Advance));
        // Nothing is recorded yet, and so everything is on disk.
        exchange.show(&stopping);
        assert_eq!(exchange.outcome("1"), None);
        // Nor is it if the program is left meanwhile.
        exchange.show(&view(Screen::Saving));
        assert_eq!(exchange.outcome("1"), None);
        let mut unsaved = then.clone();
        unsaved.line.all_saved = false;
        exchange.show(&unsaved);
        assert_eq!(exchange.outcome("1"), None);
        exchange.show(then);
        assert_eq!(exchange.outcome("1"), Some(outcome), "{:?}", then.screen);
    }
}

/// Answers that come as the session leaves their page, such as after a standstill of the program,
/// are not recorded, and the page does not say that they are saved.
#[test]
fn answers_that_the_session_does_not_have_are_not_saved() {
    use reply::{Exchange, Outcome, Sent};
    let form = asks(false, rating(7));
    let Screen::Form { questions, .. } = &form.screen else {
        panic!("a form");
    };
    let reference = view(Screen::Reference {
        prompt: "Feel the reference.".to_owned(),
        wait_s: 0.0,
    });
    let mut recorded = reference.clone();
    recorded.correctable = vec![Correctable {
        form: FormId::Intake,
        title: "intake".to_owned(),
        question: questions[0].clone(),
        answer: Answer::Rating(5),
    }];
    for (then, outcome) in [(&recorded, Outcome::Saved), (&reference, Outcome::Stale)] {
        let mut exchange = Exchange::new("run".to_owned());
        exchange.show(&form);
        let answers = format!(r#"{{"{}":"5"}}"#, questions[0].id);
        let reply = format!(
            r#"{{"page":"run.1","key":"1","shown_ms":300,"does":"answer","answers":{answers}}}"#
        );
        assert!(exchange.arrive(Sent::read(reply.as_bytes()).unwrap()));
        assert!(matches!(exchange.input(&form), Some(Input::Answer(_))));
        exchange.show(then);
        assert_eq!(exchange.outcome("1"), Some(&outcome));
    }
}
