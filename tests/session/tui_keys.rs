//! Effects of keys, clicks and pasted text.

// A helper that unwraps is an assertion here.
#![allow(clippy::unwrap_used)]

use crate::views::*;
use crossterm::event::{
    Event, KeyCode, KeyEvent, KeyModifiers, MouseButton, MouseEvent, MouseEventKind,
};
use study::tui::{ColorDepth, Surface};
use study_plan::protocol::answer::MAX_TEXT_BYTES;
use study_plan::protocol::{Answer, Entry, QuestionKind, kinds};
use study_session::outcome::{Author, Choice, FormId};
use study_session::session::view::{DeviceState, Telemetry, View};
use study_session::session::{Input, Screen};

struct Desk {
    surface: Surface,
    view: View,
}

impl Desk {
    fn with(screen: Screen) -> Self {
        Self::at(view(screen))
    }

    fn at(view: View) -> Self {
        let mut desk = Self {
            surface: Surface::new(ColorDepth::Full),
            view,
        };
        desk.look();
        desk
    }

    fn goes_to(&mut self, screen: Screen) {
        self.view = view(screen);
        self.look();
    }

    fn look(&mut self) -> String {
        picture(&drawn(&mut self.surface, &self.view, 80, 24))
    }

    fn press(&mut self, code: KeyCode) -> Vec<Input> {
        let event = Event::Key(KeyEvent::new(code, KeyModifiers::NONE));
        self.surface.event(&event, &self.view)
    }

    fn control(&mut self, c: char) -> Vec<Input> {
        let event = Event::Key(KeyEvent::new(KeyCode::Char(c), KeyModifiers::CONTROL));
        self.surface.event(&event, &self.view)
    }

    fn types(&mut self, text: &str) -> Vec<Input> {
        let press = |c| self.press(KeyCode::Char(c));
        text.chars().flat_map(press).collect()
    }

    fn enter(&mut self) -> Vec<Input> {
        self.press(KeyCode::Enter)
    }

    fn click(&mut self, x: u16, y: u16) -> Vec<Input> {
        let event = Event::Mouse(MouseEvent {
            kind: MouseEventKind::Down(MouseButton::Left),
            column: x,
            row: y,
            modifiers: KeyModifiers::NONE,
        });
        self.surface.event(&event, &self.view)
    }

    /// Column and row of a text on the screen.
    fn find(&mut self, text: &str) -> (u16, u16) {
        let look = self.look();
        let (y, line) = look
            .lines()
            .enumerate()
            .find(|(_, line)| line.contains(text))
            .unwrap();
        let x = line[..line.find(text).unwrap()].chars().count();
        (u16::try_from(x).unwrap(), u16::try_from(y).unwrap())
    }
}

fn playing() -> Screen {
    exploring(false)
}

fn exploring(keep_exploring: bool) -> Screen {
    Screen::Playing {
        since_s: 3.0,
        keep_exploring,
        exposure: Default::default(),
        interval: None,
    }
}

fn rate() -> Screen {
    form(vec![realism(), comment()])
}

/// The question and comment of the first attempt at a trial, on the first of so many pages.
fn rate_trial(trial: u32, pages: u32) -> Screen {
    Screen::Form {
        form: FormId::Trial { trial, attempt: 1 },
        questions: vec![realism(), comment()],
        page: 1,
        pages,
        to_experimenter: false,
    }
}

fn remark(by: Author, text: &str) -> [Input; 1] {
    let text = text.to_owned();
    [Input::Remark { by, text }]
}

/// The experimenter corrects the rating of trial 6.
fn corrected(n: i64, reason: &str) -> [Input; 1] {
    [Input::Correct {
        form: FormId::Trial {
            trial: 6,
            attempt: 1,
        },
        question: realism().id,
        answer: Answer::Rating(n),
        reason: reason.to_owned(),
        by: Author::Experimenter,
    }]
}

fn rating(n: i64) -> Vec<Input> {
    answers(vec![("realism", Answer::Rating(n))])
}

fn rating_with(n: i64, comment: &str) -> Vec<Input> {
    answers(vec![
        ("realism", Answer::Rating(n)),
        ("comment", Answer::Text(comment.to_owned())),
    ])
}

fn answers(list: Vec<(&str, Answer)>) -> Vec<Input> {
    let list = list.into_iter();
    vec![Input::Answer(
        list.map(|(id, a)| (study_base::text::QuestionId::new(id).unwrap(), a))
            .collect(),
    )]
}

#[test]
fn a_rating_and_its_comment_are_sent_together() {
    let mut desk = Desk::with(rate());
    assert_eq!(desk.types("5"), []);
    assert_eq!(desk.press(KeyCode::Tab), []);
    assert_eq!(desk.types("crisp, but late "), []);
    assert_eq!(desk.enter(), rating_with(5, "crisp, but late "));
}

#[test]
fn an_empty_comment_is_not_sent() {
    let mut desk = Desk::with(rate());
    desk.types("2");
    assert_eq!(desk.enter(), rating(2));
}

#[test]
fn without_a_choice_enter_sends_nothing_and_shows_a_notice() {
    let mut desk = Desk::with(rate());
    assert_eq!(desk.enter(), []);
    assert!(desk.look().contains("Choose a number from 1 to 7 first."));
    // The focus returns from the comment to the missing answer.
    desk.press(KeyCode::Tab);
    desk.types("so so");
    assert_eq!(desk.enter(), []);
    desk.types("4");
    assert!(matches!(desk.enter()[..], [Input::Answer(_)]));
}

#[test]
fn esc_stops_the_device_on_every_screen_and_in_every_dialog() {
    for (name, view) in screens() {
        let mut desk = Desk::at(view);
        assert_eq!(desk.press(KeyCode::Esc), [Input::Stop], "{name}");
        for dialog in [1, 2, 3, 4, 6, 10] {
            desk.press(KeyCode::F(dialog));
            let sent = desk.press(KeyCode::Esc);
            assert_eq!(sent, [Input::Stop], "{name}, F{dialog}");
        }
    }
}

#[test]
fn esc_works_where_the_terminal_is_too_small_to_draw() {
    let mut desk = Desk::with(playing());
    drawn(&mut desk.surface, &desk.view, 12, 3);
    assert_eq!(desk.press(KeyCode::Esc), [Input::Stop]);
    assert_eq!(desk.types(" "), [Input::Stop]);
    // No answer and no quitting unseen; Space is not taken for text.
    assert_eq!(desk.enter(), []);
    assert_eq!(desk.press(KeyCode::F(2)), []);
    assert_eq!(desk.types("x "), [Input::Stop]);
    assert_eq!(desk.types("y"), []);
    desk.control('c');
    let small = picture(&drawn(&mut desk.surface, &desk.view, 60, 20));
    assert!(small.contains("y: yes"), "{small}");
    assert_eq!(desk.types("y"), [Input::Quit]);
}

#[test]
fn space_stops_a_loaded_device_and_never_advances() {
    for (name, view) in screens() {
        let armed = view.armed;
        let mut desk = Desk::at(view);
        let want: &[Input] = if armed { &[Input::Stop] } else { &[] };
        assert_eq!(desk.types(" "), want, "{name}");
    }
}

#[test]
fn space_in_a_text_is_a_character_even_while_the_device_plays() {
    let mut desk = Desk::with(playing());
    desk.press(KeyCode::F(2));
    assert_eq!(desk.types("it squeaks"), []);
    assert_eq!(desk.enter(), remark(Author::Experimenter, "it squeaks"));
    assert_eq!(desk.types(" "), [Input::Stop]);
}

#[test]
fn a_remark_can_be_canceled_without_stopping_the_device() {
    let mut desk = Desk::with(playing());
    desk.press(KeyCode::F(2));
    desk.types("no");
    assert_eq!(desk.control('r'), []);
    assert!(desk.look().contains("The text is not saved yet"));
    desk.control('u');
    assert_eq!(desk.control('r'), []);
    assert_eq!(desk.enter(), [Input::Advance]);
}

#[test]
fn a_remark_has_an_author() {
    let mut desk = Desk::with(playing());
    desk.control('r');
    desk.press(KeyCode::Tab);
    desk.types("x");
    assert_eq!(desk.enter(), remark(Author::Participant, "x"));
}

#[test]
fn a_remark_survives_the_end_of_the_playback_and_a_fault() {
    let mut desk = Desk::with(playing());
    desk.press(KeyCode::F(2));
    desk.types("half a");
    desk.goes_to(Screen::DeviceTrouble {
        what: "overspeed".to_owned(),
        can_go_on: true,
    });
    assert!(desk.look().contains("DEVICE TROUBLE"));
    assert!(!desk.look().contains("half a"));
    desk.goes_to(rate());
    desk.types(" word");
    assert_eq!(desk.enter(), remark(Author::Experimenter, "half a word"));
}

#[test]
fn what_is_typed_into_a_form_survives_a_pause() {
    let mut desk = Desk::with(rate());
    desk.types("6");
    assert_eq!(desk.press(KeyCode::F(5)), [Input::Pause]);
    desk.goes_to(Screen::Paused { since_s: 1.0 });
    assert_eq!(desk.enter(), [Input::Advance]);
    desk.goes_to(rate());
    assert_eq!(desk.enter(), rating(6));
}

#[test]
fn the_next_trial_starts_without_a_choice() {
    let mut desk = Desk::with(rate());
    desk.types("6");
    desk.enter();
    desk.goes_to(rate_trial(8, 1));
    assert_eq!(desk.enter(), []);
}

#[test]
fn an_earlier_answer_is_corrected_with_a_reason() {
    let mut desk = Desk::with(rate());
    desk.press(KeyCode::F(3));
    desk.enter();
    assert_eq!(desk.types("3"), []);
    assert_eq!(desk.enter(), []);
    assert!(desk.look().contains("That is already the answer."));
    desk.types("6");
    desk.enter();
    desk.types("typed wrong");
    assert_eq!(desk.enter(), corrected(6, "typed wrong"));
}

#[test]
fn a_slip_is_mended_with_four_keys() {
    let mut desk = Desk::with(rate());
    desk.press(KeyCode::F(3));
    assert_eq!(desk.types("6"), []);
    assert_eq!(desk.enter(), []);
    assert!(desk.look().contains("trial 6: 3  →  6"), "{}", desk.look());
    assert_eq!(desk.enter(), corrected(6, "a slip of the key"));
}

#[test]
fn shift_tab_goes_back_to_the_question_before_with_its_answer() {
    let mut view = view(rate_trial(6, 2));
    // It holds what was answered before, and sends it as it is.
    let mut desk = Desk::at(view.clone());
    let sent = rating_with(3, "crisp, but the middle detent comes late");
    assert_eq!(desk.enter(), sent);
    assert_eq!(desk.press(KeyCode::BackTab), []);
    assert!(!desk.look().contains("Shift-Tab"));
    view.can_go_back = true;
    let mut desk = Desk::at(view);
    assert!(desk.look().contains("Shift-Tab: back"), "{}", desk.look());
    assert_eq!(desk.press(KeyCode::BackTab), [Input::Back]);
    desk.press(KeyCode::Tab);
    assert_eq!(desk.press(KeyCode::BackTab), [], "to the rating first");
    assert_eq!(desk.press(KeyCode::BackTab), [Input::Back]);
}

#[test]
fn a_click_on_the_hint_of_a_key_is_that_key() {
    let mut desk = Desk::with(rate());
    desk.types("5");
    let (x, y) = desk.find("Enter: save");
    assert_eq!(desk.click(x, y), rating(5));
    let (x, y) = desk.find("Tab: comment");
    assert_eq!(desk.click(x + 5, y), []);
    assert!(desk.look().contains("Tab: back"));
    let mut desk = Desk::with(playing());
    let (x, y) = desk.find("Esc: stop");
    assert_eq!(desk.click(x, y), [Input::Stop]);
    let (x, y) = desk.find("Enter: rate");
    assert_eq!(desk.click(x, y), [Input::Advance]);
    assert_eq!(desk.click(1, y), []);
}

#[test]
fn an_earlier_answer_can_be_declined_afterwards() {
    let mut desk = Desk::with(rate());
    desk.control('e');
    desk.enter();
    desk.control('d');
    desk.types("was not asked");
    assert!(matches!(
        &desk.enter()[..],
        [Input::Correct { answer: Answer::Declined { reason }, .. }] if reason == "was not asked"
    ));
}

#[test]
fn a_question_is_declined_with_a_reason_and_its_comment_goes_with_it() {
    let mut desk = Desk::with(rate());
    desk.press(KeyCode::Tab);
    desk.types("numb fingers");
    desk.press(KeyCode::F(6));
    assert_eq!(desk.enter(), []);
    desk.types("felt nothing");
    let declined = Answer::Declined {
        reason: "felt nothing".to_owned(),
    };
    let sent = answers(vec![
        ("realism", declined),
        ("comment", Answer::Text("numb fingers".to_owned())),
    ]);
    assert_eq!(desk.enter(), sent);
}

#[test]
fn a_trial_is_marked_bad_only_with_a_reason_and_only_if_there_is_one() {
    let mut desk = Desk::with(rate());
    desk.press(KeyCode::F(4));
    assert_eq!(desk.enter(), []);
    desk.types("phone");
    let reason = "phone".to_owned();
    assert_eq!(desk.enter(), [Input::MarkBad { reason }]);
    desk.view.can_mark_bad = None;
    desk.control('b');
    assert!(desk.look().contains("There is no trial to mark as bad."));
}

#[test]
fn quitting_is_confirmed() {
    let mut desk = Desk::with(playing());
    assert_eq!(desk.press(KeyCode::F(10)), []);
    assert_eq!(desk.enter(), []);
    assert_eq!(desk.types("n"), []);
    assert_eq!(desk.control('c'), []);
    assert_eq!(desk.types("y"), [Input::Quit]);
}

#[test]
fn consent_and_drop_out_are_confirmed() {
    let mut desk = Desk::with(Screen::Consent {
        document: "Information".to_owned(),
        version: "1".to_owned(),
    });
    assert_eq!(desk.enter(), []);
    assert_eq!(desk.types("n"), []);
    assert_eq!(desk.types("n"), []);
    assert_eq!(desk.enter(), [Input::Consent(false)]);
    assert_eq!(desk.types("ny"), [], "y is not the answer to a refusal");
    assert_eq!(desk.types("y"), [Input::Consent(true)]);

    let old = Screen::ResumeChoice {
        gap_h: 5.0,
        done: 1,
        total: Some(15),
        restart: true,
    };
    let mut desk = Desk::with(old);
    assert_eq!(desk.types("b"), [Input::Resume(Choice::RestartBlock)]);
    assert_eq!(desk.types("c"), [Input::Resume(Choice::Continue)]);
    assert_eq!(desk.types("d"), []);
    assert_eq!(desk.types("y"), [Input::Resume(Choice::DropOut)]);
}

#[test]
fn a_stopped_trial_is_played_again_or_rated() {
    let mut desk = Desk::with(Screen::Stopped { can_rate: true });
    assert_eq!(desk.enter(), [Input::PlayAgain]);
    assert_eq!(desk.types("r"), [Input::RateStopped]);
    let mut desk = Desk::with(Screen::Stopped { can_rate: false });
    assert_eq!(desk.types("r"), []);
}

#[test]
fn enter_advances_only_when_the_session_allows_it() {
    let mut desk = Desk::with(exploring(true));
    assert_eq!(desk.enter(), []);
    let mut desk = Desk::with(Screen::SaveTrouble {
        what: "no space".to_owned(),
    });
    assert_eq!(desk.enter(), [Input::RetrySave]);
}

#[test]
fn the_first_screen_asks_for_both_and_sends_what_was_typed() {
    let mut desk = Desk::with(Screen::Who {
        participant: String::new(),
        operator: String::new(),
        roster: None,
        claiming: false,
    });
    assert_eq!(desk.enter(), []);
    desk.types("../../x?");
    assert_eq!(desk.enter(), []);
    desk.types("lw");
    let want = Input::Identify {
        participant: "../../x?".to_owned(),
        operator: "lw".to_owned(),
    };
    assert_eq!(desk.enter(), [want]);
}

#[test]
fn a_click_on_a_box_chooses_it() {
    let mut desk = Desk::with(rate());
    let (x, y) = desk.find("│  6  │");
    assert_eq!(desk.click(x + 3, y - 1), []);
    assert_eq!(desk.enter(), rating(6));
    // A click between the boxes has no effect; the comment is below them.
    desk.click(x - 1, y);
    let (cx, cy) = desk.find("Comment");
    desk.click(cx + 4, cy + 1);
    desk.types("7");
    assert_eq!(desk.enter(), rating_with(6, "7"));
}

#[test]
fn a_click_sets_a_slider_and_marks_a_list() {
    let mut desk = Desk::with(form(vec![slider()]));
    let (x, y) = desk.find("├──");
    desk.click(x, y);
    assert_eq!(desk.enter(), answers(vec![("effort", Answer::Number(0.0))]));
    let mut desk = Desk::with(form(vec![choice(false)]));
    let (x, y) = desk.find("both");
    desk.click(x, y);
    let both = Answer::Choice(vec!["both".to_owned()]);
    assert_eq!(desk.enter(), answers(vec![("handedness", both)]));
}

#[test]
fn a_pasted_megabyte_is_cut_with_a_notice_before_it_is_sent() {
    let mut desk = Desk::with(rate());
    desk.types("1");
    desk.press(KeyCode::Tab);
    let paste = Event::Paste("日本\n".repeat(150_000));
    assert_eq!(desk.surface.event(&paste, &desk.view), []);
    assert!(desk.look().contains("The text is too long"));
    let sent = desk.enter();
    let [Input::Answer(sent)] = &sent[..] else {
        panic!("{sent:?}");
    };
    assert!(comment().accepts(&sent[1].1).is_ok());
    assert!(matches!(&sent[1].1, Answer::Text(t) if t.len() > MAX_TEXT_BYTES - 4));
}

#[test]
fn pasting_where_there_is_no_text_does_nothing() {
    let mut desk = Desk::with(playing());
    let paste = Event::Paste(" 5\n".to_owned());
    assert_eq!(desk.surface.event(&paste, &desk.view), []);
}

#[test]
fn a_question_mark_is_help_or_text() {
    let mut desk = Desk::with(rate());
    desk.types("?");
    assert!(desk.look().contains("stops the device at once"));
    desk.enter();
    desk.press(KeyCode::Tab);
    desk.types("why?");
    assert!(desk.look().contains("why?"));
}

#[test]
fn a_long_text_is_read_to_its_end_before_enter_advances() {
    let lines: Vec<String> = (1..=60).map(|n| format!("line {n}")).collect();
    let mut desk = Desk::with(Screen::Message {
        kind: study_session::session::view::MessageKind::Instructions,
        text: lines.join("\n\n"),
    });
    let mut presses = 0;
    while desk.enter().is_empty() {
        presses += 1;
        assert!(presses < 10);
    }
    assert!(presses >= 2);
    assert!(desk.look().contains("line 60"));
}

#[test]
fn ctrl_z_pauses_before_it_suspends() {
    let mut desk = Desk::with(playing());
    assert_eq!(desk.control('z'), [Input::Pause]);
    assert!(desk.surface.take_suspend());
    assert!(!desk.surface.take_suspend());
}

#[test]
fn several_questions_are_answered_page_by_page() {
    let mut desk = Desk::with(form(vec![number()]));
    desk.types("27");
    assert_eq!(desk.enter(), answers(vec![("age", Answer::Number(27.0))]));
    desk.goes_to(form(vec![choice(true)]));
    desk.types("13");
    let both = ["right-handed", "both"].map(str::to_owned).to_vec();
    assert_eq!(
        desk.enter(),
        answers(vec![("handedness", Answer::Choice(both))])
    );
    let mut strategy = question("strategy", "How?", QuestionKind::Text(kinds::Text));
    strategy.required = true;
    desk.goes_to(form(vec![strategy]));
    assert_eq!(desk.enter(), []);
    desk.types("by ear");
    let text = Answer::Text("by ear".to_owned());
    assert_eq!(desk.enter(), answers(vec![("strategy", text)]));
}

#[test]
fn the_screen_shows_nothing_but_the_view_during_playback() {
    // Every word on the screen is fixed or comes from the view.
    let mut desk = Desk::with(playing());
    desk.view.line.device = DeviceState::Running(Telemetry::Arrives);
    let known = "trial 7 of 15 Feel the device. ● playing Enter: rate · Esc: stop \
                 S03 · lw running · 12:41 · saved ✓ 6 of 6 ? help";
    let known: Vec<&str> = known.split_whitespace().collect();
    // Frames, the bar of the trials and the digits of the clock are drawn.
    let drawn = |word: &str| word.chars().all(|c| ('\u{2500}'..='\u{259f}').contains(&c));
    for word in desk.look().split_whitespace() {
        assert!(known.contains(&word) || drawn(word), "{word}");
    }
}

#[test]
fn a_long_question_is_shown_whole() {
    let words: Vec<String> = (1..=80).map(|n| format!("word{n}")).collect();
    let mut long = realism();
    long.prompt = words.join(" ");
    for entry in [Entry::Participant, Entry::Experimenter] {
        let screen = form(vec![long.clone(), comment()]);
        let mut desk = Desk::at(View {
            entry,
            ..view(screen)
        });
        let look = desk.look();
        assert!(look.contains("word80") && look.contains("┌"), "{look}");
    }
}
