//! Views of every screen, and how to draw them.
#![allow(dead_code)]
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use std::collections::BTreeMap;
use study::tui::{ColorDepth, Surface};
use study_base::text::QuestionId;
use study_plan::protocol::{Answer, DeviceKind, Entry, Question, QuestionKind, kinds};
use study_session::outcome::FormId;
use study_session::session::view::{
    Banner, Correctable, DeviceState, MessageKind, Progress, Screen, StatusLine, Telemetry, View,
};

pub(crate) fn question(id: &str, prompt: &str, kind: QuestionKind) -> Question {
    let required = kind != QuestionKind::Text(kinds::Text);
    Question {
        id: QuestionId::new(id).unwrap(),
        prompt: prompt.to_owned(),
        kind,
        required,
    }
}

pub(crate) fn rating(from: i64, to: i64, labels: &[(i64, &str)]) -> QuestionKind {
    QuestionKind::Rating(kinds::Rating {
        from,
        to,
        labels: labels.iter().map(|(n, l)| (*n, (*l).to_owned())).collect(),
    })
}

pub(crate) fn realism() -> Question {
    let labels = [(1, "not at all realistic"), (7, "very realistic")];
    question(
        "realism",
        "How realistic did it feel?",
        rating(1, 7, &labels),
    )
}

pub(crate) fn comment() -> Question {
    question("comment", "Comment", QuestionKind::Text(kinds::Text))
}

pub(crate) fn slider() -> Question {
    let ends = [("0", "no effort"), ("100", "the most I can imagine")];
    question(
        "effort",
        "How much effort did it take?",
        QuestionKind::Slider(kinds::Slider {
            from: 0.0,
            to: 100.0,
            step: 1.0,
            labels: BTreeMap::from(ends.map(|(n, l)| (n.to_owned(), l.to_owned()))),
        }),
    )
}

pub(crate) fn choice(multiple: bool) -> Question {
    let options = [
        "right-handed",
        "left-handed",
        "both",
        "I would rather not say",
    ];
    question(
        "handedness",
        "Which hand do you write with?",
        QuestionKind::Choice(kinds::Choice {
            options: options.map(str::to_owned).to_vec(),
            multiple,
        }),
    )
}

pub(crate) fn number() -> Question {
    question(
        "age",
        "How old are you?",
        QuestionKind::Number(kinds::Number {
            unit: Some("years".to_owned()),
            min: Some(18.0),
            max: Some(120.0),
            above: None,
        }),
    )
}

pub(crate) const TRIAL: FormId = FormId::Trial {
    trial: 7,
    attempt: 1,
};

pub(crate) fn form(questions: Vec<Question>) -> Screen {
    Screen::Form {
        form: TRIAL,
        questions,
        page: 1,
        pages: 1,
        to_experimenter: false,
    }
}

/// A study with samples that are mounted by hand.
fn by_hand(screen: Screen, state: DeviceState) -> View {
    let mut view = view(screen);
    view.device = DeviceKind::Manual;
    view.line.device = state;
    view
}

pub(crate) fn view(screen: Screen) -> View {
    let armed = matches!(
        screen,
        Screen::Playing { .. } | Screen::Loading { .. } | Screen::Mount { .. }
    );
    let device = match screen {
        Screen::Playing { .. } => DeviceState::Running(Telemetry::Arrives),
        Screen::Loading { .. } => DeviceState::Loading,
        Screen::Stopping => DeviceState::Stopping,
        Screen::DeviceTrouble { .. } => DeviceState::Fault,
        Screen::Who { .. } => DeviceState::Unknown,
        _ => DeviceState::Limp,
    };
    let before = !matches!(screen, Screen::Who { .. } | Screen::Consent { .. });
    let can_advance = match &screen {
        Screen::Reference { wait_s, .. } | Screen::Break { wait_s, .. } => *wait_s <= 0.0,
        Screen::Playing { keep_exploring, .. } => !keep_exploring,
        Screen::Message { .. } | Screen::Paused { .. } | Screen::End { .. } => true,
        Screen::Mount { .. } => true,
        Screen::DeviceTrouble { can_go_on, .. } => *can_go_on,
        _ => false,
    };
    View {
        can_replay: false,
        has_replays: false,
        can_go_back: false,
        remarks: vec!["the motor hums".to_owned()],
        force: true,
        has_reference: false,
        numbered: false,
        adjusting: None,
        cue: None,
        awaits_page: false,
        progress: before.then_some(Progress {
            practice: false,
            current: 7,
            total: Some(15),
            block: Some(5),
        }),
        line: StatusLine {
            participant: if device == DeviceState::Unknown {
                ""
            } else {
                "S03"
            }
            .to_owned(),
            operator: if device == DeviceState::Unknown {
                ""
            } else {
                "lw"
            }
            .to_owned(),
            device,
            elapsed_s: 761.0,
            trials_saved: 6,
            trials_answered: 6,
            mirror: None,
            all_saved: !matches!(screen, Screen::Saving | Screen::SaveTrouble { .. }),
        },
        words: Default::default(),
        course: Default::default(),
        banner: None,
        notice: None,
        entry: Entry::Participant,
        device: DeviceKind::Simulated,
        correctable: vec![
            Correctable {
                form: FormId::Trial {
                    trial: 6,
                    attempt: 1,
                },
                title: "trial 6".to_owned(),
                question: realism(),
                answer: Answer::Rating(3),
            },
            Correctable {
                form: FormId::Trial {
                    trial: 6,
                    attempt: 1,
                },
                title: "trial 6".to_owned(),
                question: comment(),
                answer: Answer::Text("crisp, but the middle detent comes late".to_owned()),
            },
            Correctable {
                form: FormId::Intake,
                title: "intake".to_owned(),
                question: choice(false),
                answer: Answer::Choice(vec!["left-handed".to_owned()]),
            },
        ],
        can_mark_bad: Some("trial 7".to_owned()),
        armed,
        unsaved: match screen {
            Screen::SaveTrouble { .. } => vec![
                "trial 7: realism = 5".to_owned(),
                "trial 7: comment = crisp, but the middle detent comes late".to_owned(),
                "1 record of the course of the session".to_owned(),
            ],
            _ => Vec::new(),
        },
        can_advance,
        screen,
    }
}

pub(crate) fn pilot(screen: Screen) -> View {
    View {
        can_replay: false,
        banner: Some(Banner::Pilot),
        ..view(screen)
    }
}

pub(crate) fn asked(screen: Screen) -> View {
    View {
        can_replay: false,
        entry: Entry::Experimenter,
        ..view(screen)
    }
}

/// One view of every screen, with its name.
pub(crate) fn screens() -> Vec<(&'static str, View)> {
    let text = |s: &str| s.to_owned();
    vec![
        (
            "who",
            view(Screen::Who {
                participant: text("S03"),
                operator: String::new(),
                roster: None,
                claiming: false,
            }),
        ),
        (
            "resume",
            view(Screen::ResumeChoice {
                gap_h: 19.25,
                done: 6,
                total: Some(15),
                restart: true,
            }),
        ),
        (
            "consent",
            view(Screen::Consent {
                document: text("Information and consent, turn-signal study"),
                version: text("2"),
            }),
        ),
        (
            "instructions",
            view(Screen::Message {
                kind: MessageKind::Instructions,
                text: text(
                    "You will feel several versions of a turn-signal switch, one after the other.\n\n\
                 Before each one, operate the real switch. Then feel the device for as long as \
                 you like, and say how realistic it felt, from 1 (not at all) to 7 (very).\n\n\
                 There is no right or wrong answer. You may stop at any time with Esc.",
                ),
            }),
        ),
        (
            "practice_over",
            view(Screen::Message {
                kind: MessageKind::PracticeOver,
                text: text("That was the practice. From now on it counts."),
            }),
        ),
        (
            "reference",
            view(Screen::Reference {
                prompt: text("Operate the real switch."),
                wait_s: 0.0,
            }),
        ),
        (
            "reference_wait",
            view(Screen::Reference {
                prompt: text("Operate the real switch, then press Enter."),
                wait_s: 4.2,
            }),
        ),
        ("loading", view(Screen::Loading { interval: None })),
        (
            "mount",
            view(Screen::Mount {
                code: "417".to_owned(),
            }),
        ),
        (
            "playing",
            view(Screen::Playing {
                since_s: 14.3,
                keep_exploring: false,
                exposure: Default::default(),
                interval: None,
            }),
        ),
        (
            "playing_strokes",
            pilot(Screen::Playing {
                since_s: 3.0,
                keep_exploring: true,
                exposure: Default::default(),
                interval: None,
            }),
        ),
        (
            "playing_by_hand",
            by_hand(
                Screen::Playing {
                    since_s: 14.3,
                    keep_exploring: false,
                    exposure: Default::default(),
                    interval: None,
                },
                DeviceState::Felt,
            ),
        ),
        (
            "stopped_by_hand",
            by_hand(Screen::Stopped { can_rate: true }, DeviceState::ByHand),
        ),
        ("stopping", view(Screen::Stopping)),
        ("stopped", view(Screen::Stopped { can_rate: true })),
        (
            "device_trouble",
            view(Screen::DeviceTrouble {
                what: text("overspeed: 1240 mm/s at 3.2 mm"),
                can_go_on: true,
            }),
        ),
        (
            "device_lost",
            view(Screen::DeviceTrouble {
                what: text("no answer for 200 ms"),
                can_go_on: false,
            }),
        ),
        (
            "program_lost",
            View {
                device: DeviceKind::Process,
                ..view(Screen::DeviceTrouble {
                    what: text(
                        "the program `python3 controller.py` has ended with exit status 1; \
                         its last words: OSError: [Errno 5] encoder",
                    ),
                    can_go_on: false,
                })
            },
        ),
        ("saving", view(Screen::Saving)),
        (
            "save_trouble",
            view(Screen::SaveTrouble {
                what: text(
                    "results/turn-signal/sessions/S03/1/journal.jsonl: no space left on device",
                ),
            }),
        ),
        (
            "break",
            view(Screen::Break {
                text: text("Take a rest."),
                wait_s: 42.0,
                done: 6,
                total: Some(15),
            }),
        ),
        ("paused", view(Screen::Paused { since_s: 65.0 })),
        (
            "end",
            view(Screen::End {
                text: text("Thank you for taking part!"),
            }),
        ),
        ("rating", view(form(vec![realism(), comment()]))),
        ("rating_pilot", pilot(form(vec![realism(), comment()]))),
        ("rating_asked", asked(form(vec![realism(), comment()]))),
        (
            "reference_asked",
            asked(Screen::Reference {
                prompt: text("Operate the real switch."),
                wait_s: 0.0,
            }),
        ),
        (
            "rating_eleven",
            view(form(vec![
                question(
                    "liking",
                    "Wie sehr gefällt dir der Schalter, verglichen mit dem echten?",
                    rating(0, 10, &[(0, "gar nicht"), (5, "mittel"), (10, "sehr")]),
                ),
                comment(),
            ])),
        ),
        (
            "rating_signed",
            view(form(vec![question(
                "force",
                "力は本物と比べてどうでしたか。",
                rating(-3, 3, &[(-3, "ずっと弱い"), (0, "同じ"), (3, "ずっと強い")]),
            )])),
        ),
        (
            "rating_long",
            view(form(vec![question(
                "percent",
                "How sure are you?",
                rating(0, 100, &[(0, "not at all"), (100, "completely")]),
            )])),
        ),
        (
            "rating_all_labels",
            view(form(vec![question(
                "agree",
                "The detents were crisp.",
                rating(
                    1,
                    5,
                    &[
                        (1, "strongly disagree"),
                        (2, "disagree"),
                        (3, "neither agree nor disagree"),
                        (4, "agree"),
                        (5, "strongly agree"),
                    ],
                ),
            )])),
        ),
        ("slider", view(form(vec![slider(), comment()]))),
        ("choice", view(form(vec![choice(false)]))),
        ("choice_several", view(form(vec![choice(true)]))),
        ("number", view(form(vec![number()]))),
        (
            "text",
            view(form(vec![question(
                "strategy",
                "How did you decide?",
                QuestionKind::Text(kinds::Text),
            )])),
        ),
        (
            "setup",
            View {
                progress: None,
                ..view(Screen::Form {
                    form: FormId::Setup,
                    questions: vec![question(
                        "room",
                        "Temperature of the room",
                        QuestionKind::Number(kinds::Number {
                            unit: Some("°C".to_owned()),
                            min: None,
                            max: None,
                            above: None,
                        }),
                    )],
                    page: 1,
                    pages: 2,
                    to_experimenter: true,
                })
            },
        ),
    ]
}

/// Draws a view into a buffer.
pub(crate) fn drawn(surface: &mut Surface, view: &View, w: u16, h: u16) -> Buffer {
    let area = Rect::new(0, 0, w, h);
    let mut buf = Buffer::empty(area);
    surface.follow(view, area);
    surface.draw(view, area, &mut buf);
    buf
}

/// The characters of a buffer.
pub(crate) fn picture(buf: &Buffer) -> String {
    let area = buf.area;
    let mut out = String::new();
    for y in area.top()..area.bottom() {
        let mut line = String::new();
        let mut x = area.left();
        while x < area.right() {
            let symbol = buf[(x, y)].symbol();
            line.push_str(symbol);
            let width = study::tui::wrap::width(symbol).max(1);
            x += u16::try_from(width).unwrap_or(1);
        }
        out.push_str(line.trim_end());
        out.push('\n');
    }
    out
}

/// The text of a view without any input.
pub(crate) fn fresh(view: &View, w: u16, h: u16) -> String {
    picture(&drawn(&mut Surface::new(ColorDepth::None), view, w, h))
}
