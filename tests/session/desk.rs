//! The experimenter's desk: everything in one page, in the experimenter's language, and blind.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::blinding::{PROTOCOLS, device, pages_on, realizations, without_strokes};
use crate::support::{Terminal, repository};
use crate::views::{comment, drawn, form, picture, pilot, realism, screens, view};
use crossterm::event::{
    Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use std::cell::RefCell;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use study::tui::desk::{Desk, FreeSpace, Language, Say, Visit, covers};
use study::tui::{ColorDepth, Surface};
use study_base::limits::Limits;
use study_base::text::{ModelId, QuestionId};
use study_device::faults::InjectedFault;
use study_device::virtual_device::Options;
use study_device::{Device, DeviceError, Identity, Report, Stimulus};
use study_plan::protocol::phrases::Words;
use study_plan::protocol::{Answer, Entry, Exposure};
use study_session::session::view::{Course, DeviceState, Mirror, Telemetry, View};
use study_session::session::{Input, Screen};

fn visit(participant: &str, what: &str) -> Visit {
    Visit {
        participant: participant.to_owned(),
        what: what.to_owned(),
    }
}

/// A desk in English, with a disk of 12 GB.
pub(crate) fn at_hand() -> Desk {
    let free = FreeSpace::default();
    free.set(Some(12_300_000_000));
    Desk {
        language: Language::English,
        words: None,
        next: ["S01", "S03", "S04", "S05"].map(str::to_owned).to_vec(),
        overdue: vec![visit("S01", "two 2026-03-08 10:12")],
        due: vec![
            visit("S03", "two 2026-03-09 10:12"),
            visit("S02", "two 2026-03-10 09:00"),
        ],
        free,
    }
}

/// The same in a language, with the sentences of a session in it.
fn in_language(language: Language) -> Desk {
    let words = Words::new(Some(language.tag()), &Default::default());
    Desk {
        language,
        words: Some(Arc::new(words)),
        ..at_hand()
    }
}

fn at_desk(desk: Desk) -> Surface {
    Surface::new(ColorDepth::None).with_desk(desk)
}

/// A view in the middle of a session of repeated sessions and of parts.
fn under_way(screen: Screen) -> View {
    let mut view = view(screen);
    view.course = Course {
        session: 2,
        part: Some((2, 3)),
        done: 6,
        total: Some(15),
        minimum_strokes: 3,
        left_s: Some(821.0),
    };
    view.line.mirror = Some(Mirror::InStep);
    view
}

fn playing(since_s: f64, keep_exploring: bool) -> View {
    under_way(Screen::Playing {
        since_s,
        keep_exploring,
        exposure: Exposure {
            min_s: 5.0,
            max_s: Some(30.0),
            replays: 0,
        },
        interval: None,
    })
}

fn look(surface: &mut Surface, view: &View, columns: u16, rows: u16) -> String {
    let view = surface.translated(view);
    picture(&drawn(surface, &view, columns, rows))
}

const SIZES: [(u16, u16); 2] = [(80, 24), (60, 20)];

#[test]
fn the_desk_at_both_sizes_and_in_other_languages() {
    for (columns, rows) in SIZES {
        for (name, view) in [
            ("playing", playing(7.0, true)),
            ("rating", under_way(form(vec![realism(), comment()]))),
            ("pilot", pilot(Screen::Loading { interval: None })),
        ] {
            let shown = look(&mut at_desk(at_hand()), &view, columns, rows);
            insta::assert_snapshot!(format!("desk_{name}_{columns}x{rows}"), shown);
        }
    }
    for language in [Language::German, Language::Arabic, Language::Japanese] {
        let shown = look(
            &mut at_desk(in_language(language)),
            &playing(7.0, true),
            80,
            24,
        );
        insta::assert_snapshot!(format!("desk_playing_{}_80x24", language.tag()), shown);
    }
}

/// At 60 × 20 as at 80 × 24, in every language, every row is there whole, whatever the
/// participant does; what asks the experimenter for something stays as it was.
#[test]
fn everything_is_on_one_page_at_every_screen_in_every_language() {
    for language in Language::ALL {
        for (name, mut view) in screens() {
            view.course = under_way(Screen::Saving).course;
            view.entry = Entry::Participant;
            for (columns, rows) in SIZES {
                let what = format!("{name} in {language:?} at {columns}×{rows}");
                let mut desk = at_desk(in_language(language));
                let shown = look(&mut desk, &view, columns, rows);
                if !covers(&view.screen) {
                    let translated = desk.translated(&view);
                    let mut plain = Surface::new(ColorDepth::None).with_live(true);
                    let body = |page: &str| {
                        let lines: Vec<&str> = page.lines().collect();
                        lines[..lines.len() - 1].join("\n")
                    };
                    let mirrored = picture(&drawn(&mut plain, &translated, columns, rows));
                    assert_eq!(body(&shown), body(&mirrored), "{what}");
                    continue;
                }
                let at = |label: Say| {
                    let label = label.get(language);
                    let starts = |line: &&str| line.trim_start().starts_with(label);
                    shown
                        .lines()
                        .find(starts)
                        .unwrap_or_else(|| panic!("{what}: {label}\n{shown}"))
                };
                for label in Say::LABELS {
                    let words = at(label).trim().len();
                    let text = label == Say::Course || words > label.get(language).len();
                    assert!(text, "{what}: {label:?} says nothing\n{shown}");
                }
                assert!(at(Say::Participant).contains("S03"), "{what}\n{shown}");
                assert!(at(Say::Disk).contains("12 GB"), "{what}\n{shown}");
                assert!(
                    at(Say::Overdue).contains("S01 two 2026-03-08 10:12"),
                    "{what}\n{shown}"
                );
                // The participant of the session is not the next one, nor comes again.
                assert!(at(Say::Next).contains("S01, S04, S05"), "{what}\n{shown}");
                assert!(
                    at(Say::Due).contains("S02 two 2026-03-10 09:00"),
                    "{what}\n{shown}"
                );
                assert!(at(Say::Notes).contains("the motor hums"), "{what}\n{shown}");
                assert!(
                    !shown.contains('…') || columns == 60 || name == "saving",
                    "{what}: something is cut\n{shown}"
                );
            }
        }
    }
}

#[test]
fn the_rows_say_what_the_session_knows() {
    let shown = |view: &View| look(&mut at_desk(at_hand()), view, 80, 24);
    let page = shown(&playing(7.0, true));
    for line in [
        "Participant  S03 · session 2",
        "Trial        trial 7 of 15 · 6 of 15 done · part 2 of 3",
        "Page         feels · 0:07",
        "Time         12:41 so far · about 14 min left",
        "Device       running · telemetry arrives",
        "Exposure     0:07 · at least 0:05 · at most 0:30 · more needed",
        "Strokes      at least 3 · more needed",
        "Saved        6 / 6 · mirror in step",
    ] {
        assert!(page.contains(line), "{line}\n{page}");
    }
    assert!(shown(&playing(7.0, false)).contains("Strokes      at least 3 · enough"));
    // Before the least time nobody knows whether strokes are missing.
    let early = shown(&playing(2.0, true));
    assert!(early.contains("Strokes      at least 3\n"), "{early}");
    let mut view = playing(7.0, false);
    view.line.device = DeviceState::Running(Telemetry::Silent);
    view.line.mirror = Some(Mirror::OnlyResults);
    view.course = Course {
        part: Some((1, 1)),
        total: None,
        left_s: None,
        ..view.course
    };
    let page = shown(&view);
    for line in [
        "running · NO TELEMETRY",
        "MIRROR LEFT BEHIND",
        "time left not known yet",
        "trial 7 of 15\n",
    ] {
        assert!(page.contains(line), "{line}\n{page}");
    }
    let desk = at_hand();
    desk.free.set(Some(900_000_000));
    let page = look(&mut at_desk(desk), &view, 80, 24);
    assert!(page.contains("ALMOST FULL: 900 MB free"), "{page}");
}

#[test]
fn what_people_type_does_not_steer_the_desk() {
    let mut view = playing(7.0, false);
    view.remarks = vec!["\u{1b}[2J hums\u{202e}".to_owned(), "x".repeat(300)];
    let mut desk = at_hand();
    desk.overdue = vec![visit("\u{1b}]0;x\u{7}", "\u{9b}31m")];
    let mut surface = at_desk(desk);
    let shown = look(&mut surface, &view, 80, 24);
    let unsafe_ones = ['\u{1b}', '\u{7}', '\u{9b}', '\u{202e}'];
    assert!(!shown.contains(unsafe_ones), "{shown}");
    assert!(
        shown
            .lines()
            .all(|line| study::tui::wrap::width(line) <= 80),
        "{shown}"
    );
}

/// A strip of the session's course: what the participant does, a cell for five seconds.
#[test]
fn the_strip_follows_the_course_of_the_session() {
    let mut surface = at_desk(at_hand());
    let mut shown = String::new();
    for (at, view) in [
        (
            0.0,
            under_way(Screen::Reference {
                prompt: String::new(),
                wait_s: 0.0,
            }),
        ),
        (6.0, playing(0.0, true)),
        (16.0, under_way(form(vec![realism()]))),
        (26.0, under_way(Screen::Paused { since_s: 1.0 })),
        (36.0, under_way(Screen::Saving)),
    ] {
        let mut view = view;
        view.line.elapsed_s = at;
        shown = look(&mut surface, &view, 80, 24);
    }
    let strip = shown.lines().find(|line| line.contains("Course")).unwrap();
    assert_eq!(strip.trim(), "Course       ·███▄▄──", "{shown}");
}

fn key(code: KeyCode) -> Event {
    Event::Key(KeyEvent::new(code, KeyModifiers::NONE))
}

#[test]
fn at_the_desk_no_key_acts_on_the_page_and_stop_works() {
    let answer = || under_way(form(vec![realism(), comment()]));
    let mut surface = at_desk(at_hand());
    let asked = answer();
    look(&mut surface, &asked, 80, 24);
    for code in [
        KeyCode::Char('5'),
        KeyCode::Enter,
        KeyCode::Tab,
        KeyCode::Char('y'),
        // Neither are questions declined there, nor is anything felt again.
        KeyCode::F(6),
        KeyCode::F(7),
    ] {
        assert_eq!(surface.event(&key(code), &asked), [], "{code:?}");
        let shown = look(&mut surface, &asked, 80, 24);
        assert!(shown.contains("F9 shows the participant’s page"), "{shown}");
    }
    for row in 1..20 {
        let click = Event::Mouse(MouseEvent {
            kind: MouseEventKind::Down(MouseButton::Left),
            column: 40,
            row,
            modifiers: KeyModifiers::NONE,
        });
        assert_eq!(surface.event(&click, &asked), []);
    }
    assert_eq!(surface.event(&key(KeyCode::Esc), &asked), [Input::Stop]);
    assert_eq!(surface.event(&key(KeyCode::F(5)), &asked), [Input::Pause]);
    // Space is no text there.
    let armed = playing(7.0, false);
    assert_eq!(
        surface.event(&key(KeyCode::Char(' ')), &armed),
        [Input::Stop]
    );
    assert_eq!(surface.event(&key(KeyCode::Enter), &armed), []);
    // Nothing of what was typed at the desk is on the page.
    assert_eq!(surface.event(&key(KeyCode::F(9)), &asked), []);
    let shown = look(&mut surface, &asked, 80, 24);
    assert!(
        shown.contains("How realistic did it feel?") && shown.contains("F9: desk"),
        "{shown}"
    );
    assert_eq!(surface.event(&key(KeyCode::Enter), &asked), []);
    surface.event(&key(KeyCode::Char('5')), &asked);
    let id = QuestionId::new("realism").unwrap();
    let inputs = surface.event(&key(KeyCode::Enter), &asked);
    assert!(
        matches!(&inputs[..], [Input::Answer(all)] if all.first() == Some(&(id.clone(), Answer::Rating(5)))),
        "{inputs:?}"
    );
    // Back at the desk.
    surface.event(&key(KeyCode::F(9)), &asked);
    assert!(look(&mut surface, &asked, 80, 24).contains("Overdue"));
}

#[test]
fn remarks_and_leaving_work_at_the_desk_and_the_key_of_a_hint_can_be_clicked() {
    let asked = under_way(form(vec![realism()]));
    for (columns, rows) in SIZES {
        let mut surface = at_desk(at_hand());
        look(&mut surface, &asked, columns, rows);
        surface.event(&key(KeyCode::F(2)), &asked);
        for c in "hums".chars() {
            surface.event(&key(KeyCode::Char(c)), &asked);
        }
        assert!(look(&mut surface, &asked, columns, rows).contains("hums"));
        let inputs = surface.event(&key(KeyCode::Enter), &asked);
        assert!(
            matches!(&inputs[..], [Input::Remark { text, .. }] if text == "hums"),
            "{inputs:?}"
        );
        surface.event(&key(KeyCode::F(10)), &asked);
        assert_eq!(
            surface.event(&key(KeyCode::Char('y')), &asked),
            [Input::Quit]
        );
        let shown = look(&mut surface, &asked, columns, rows);
        let (row, line) = shown
            .lines()
            .enumerate()
            .find(|(_, l)| l.contains("F5: pause"))
            .unwrap();
        let before = line.split("F5: pause").next().unwrap();
        let click = Event::Mouse(MouseEvent {
            kind: MouseEventKind::Down(MouseButton::Left),
            column: u16::try_from(study::tui::wrap::width(before)).unwrap(),
            row: u16::try_from(row).unwrap(),
            modifiers: KeyModifiers::NONE,
        });
        assert_eq!(surface.event(&click, &asked), [Input::Pause]);
    }
}

/// A page that has no room says so, and F9 leads back to the desk, which has.
#[test]
fn the_desk_has_room_where_the_page_has_none() {
    let asked = under_way(form(vec![realism()]));
    let mut surface = at_desk(at_hand());
    assert!(look(&mut surface, &asked, 60, 20).contains("Overdue"));
    surface.event(&key(KeyCode::F(9)), &asked);
    assert!(look(&mut surface, &asked, 60, 20).contains("80 × 24 are needed"));
    surface.event(&key(KeyCode::F(9)), &asked);
    assert!(look(&mut surface, &asked, 60, 20).contains("Overdue"));
    assert!(look(&mut surface, &asked, 59, 20).contains("60 × 20 are needed"));
}

/// The desk of a session in which `first` is felt first.
fn looks(name: &str, first: &ModelId, fault: Option<InjectedFault>) -> Vec<String> {
    let surface = at_desk(at_hand());
    pages_on(
        surface,
        name,
        first,
        Entry::Participant,
        without_strokes,
        fault,
        device,
    )
}

/// With the same hand at the same times, all realizations of the shipped protocols have the same desk, at
/// every look, also with a fault of the device.
#[test]
fn the_same_hand_gives_the_same_desk_for_every_realization() {
    for fault in [None, Some(InjectedFault::Trip), Some(InjectedFault::Unplug)] {
        for name in PROTOCOLS {
            let all = realizations(name);
            let expected = looks(name, &all[0], fault);
            let strip = expected.iter().any(|page| page.contains("Course       ·"));
            assert!(strip, "{name}");
            for id in &all[1..] {
                let shown = looks(name, id, fault);
                for (n, (one, other)) in expected.iter().zip(&shown).enumerate() {
                    assert_eq!(one, other, "{name}: {id} differs at look {n}");
                }
                assert_eq!(expected.len(), shown.len(), "{name}: {id}");
            }
        }
    }
}

thread_local! {
    /// Positions that the device of this thread has reported, mm.
    static REPORTED: RefCell<Vec<f64>> = const { RefCell::new(Vec::new()) };
}

/// A device whose positions are kept.
struct Kept(Box<dyn Device>);

fn kept(options: Options) -> Box<dyn Device> {
    Box::new(Kept(device(options)))
}

impl Device for Kept {
    fn identity(&self) -> Identity {
        self.0.identity()
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        self.0.load(what, limits, at)
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.0.start(at)
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.0.stop(at)
    }

    fn limp(&mut self, at: Duration) {
        self.0.limp(at);
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        let reports = self.0.poll(at);
        for report in &reports {
            if let Report::Telemetry(samples) = report {
                let places = samples.iter().map(|sample| sample.x_mm);
                REPORTED.with_borrow_mut(|all| all.extend(places));
            }
        }
        reports
    }
}

/// The positions in the first playback of a realization, as shares of their range: what a strip of the
/// position without a scale would draw.
fn places(name: &str, first: &ModelId) -> Vec<f64> {
    REPORTED.with_borrow_mut(Vec::clear);
    let surface = at_desk(at_hand());
    pages_on(
        surface,
        name,
        first,
        Entry::Participant,
        without_strokes,
        None,
        kept,
    );
    let mut all = REPORTED.with_borrow(Clone::clone);
    // 50 samples a second while it is felt for three seconds, the first of which is in every one.
    all.truncate(150);
    let least = all.iter().copied().fold(f64::INFINITY, f64::min);
    let most = all.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    all.iter().map(|x| (x - least) / (most - least)).collect()
}

/// Why there is no strip of the position on the desk: the same hand moves the handle in another way on
/// another realization, so that the shape would tell them apart.
#[test]
fn a_strip_of_the_position_would_tell_realizations_apart() {
    let name = "protocols/turn-signal-extended";
    let all = realizations(name);
    let one = places(name, &all[0]);
    assert!(one.len() > 100, "{} samples", one.len());
    let apart = |other: &[f64]| {
        let gaps = one.iter().zip(other).map(|(a, b)| (a - b).abs());
        gaps.fold(0.0, f64::max)
    };
    // The same realization gives the same strip.
    assert_eq!(apart(&places(name, &all[0])), 0.0);
    // A twentieth of the range is a row of a strip of twenty.
    let most = all[1..]
        .iter()
        .map(|id| apart(&places(name, id)))
        .fold(0.0, f64::max);
    assert!(most > 0.05, "{most}");
}

/// The program itself: beside a page the terminal is the desk, in the language of the environment.
#[test]
fn beside_a_page_the_terminal_is_the_desk_in_the_experimenters_language() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = repository("protocols/turn-signal");
    let words = [
        "run",
        &protocol,
        "--screen",
        "--participant",
        "P01",
        "--operator",
        "lw",
    ];
    let language = ("STUDY_LANG", Path::new("de_DE.UTF-8"));
    let mut terminal = Terminal::start_with(&words, folder.path(), 24, 80, &[language]);
    terminal.wait_for("press Enter to begin without it");
    terminal.keys("\r");
    terminal.wait_for("vor dem nächsten Durchgang");
    let shown = terminal.screen();
    for what in [
        "Verlauf",
        "Überfällig",
        "kein Spiegel",
        "P02",
        "F9: Seite der Person",
    ] {
        assert!(shown.contains(what), "{what}\n{shown}");
    }
    // The disk is measured in a thread of its own.
    terminal.wait_for(" frei");
    // F9: what the participant reads, and back.
    terminal.keys("\u{1b}[20~");
    terminal.wait_for("Operate the real switch.");
    terminal.keys("\u{1b}[20~");
    terminal.wait_for("Verlauf");
    // F10 and yes: the session can be resumed.
    terminal.keys("\u{1b}[21~");
    terminal.wait_for("Sind Sie sicher?");
    terminal.keys("y");
    assert_eq!(terminal.exit_code(), 0, "{}", terminal.screen());
}
