//! The same random sessions in typed lines, by replies of the browser and through a front: the
//! journals are equal but for the channel. Every page is checked against the schema of
//! docs/page.md, and none has the name of a realization.

use super::part_rig::{
    adjustment, beside_a_reference, identification, pairs, ranking, read, similarity, track,
};
use super::rig::{DeviceMood, Rig, StoreMood};
use super::search::searching;
use super::studies::{MODELS, PRACTICE, question, rich};
use crate::kinds::questions;
use serde_json::{Value, json};
use std::collections::BTreeSet;
use study::plain::dialogue::Dialogue;
use study_base::rng::Stream;
use study_plan::protocol::kinds::Draws;
use study_plan::protocol::phrases::Words;
use study_plan::protocol::{Control, Given, Pick, Protocol};
use study_session::outcome::Channel;
use study_session::page::front::Talk;
use study_session::page::reply::{Exchange, Outcome, Sent};
use study_session::page::{Does, page};
use study_session::session::{Input, Screen, View};

/// Sessions of each study.
const SESSIONS: u64 = 150;

/// Everything that can be asked: each kind of question in each form, then every kind of part.
fn studies() -> Vec<Protocol> {
    let every = |required| {
        let mut every = rich();
        every.design.repetitions = 1;
        let asked = questions(required).into_iter().enumerate();
        every.intake = asked
            .map(|(n, (_, asked))| question(&format!("q{n}"), asked.kind, required))
            .collect();
        every
    };
    let quest = r#"{ rule = "quest+", trials = 3, lapse = [0.02], slope = [2, 4] }"#;
    let magnitudes = r#"
[analysis]
primary = "strong"
[[parts]]
id = "strong"
kind = "magnitude"
prompt = "How strong?"
family = "damping"
levels = [1.0, 2.0, 3.0]
repetitions = 1
"#;
    vec![
        every(true),
        every(false),
        pairs("tie = true\nexposure = { replays = 2 }"),
        track("yes-no", quest, ""),
        track("3ifc", quest, ""),
        beside_a_reference(),
        read(magnitudes),
        identification(
            "practice = [\"KJW-3\", \"XQZ-7\"]\nfeedback = \"always\"\ncriterion = { correct = 2, of = 3, rounds = 3 }",
        ),
        similarity("identical = true\npractice = 2"),
        ranking("ties = true\npractice = 1\nrepetitions = 2\nexposure = { replays = 1 }"),
        adjustment("standard = 2.0\npractice = 1"),
        searching(r#"{ name = "preference-gp", trials = 5, start = 3 }"#),
    ]
}

/// What happens next, the same in every session of three.
#[derive(Debug, Clone, Copy)]
enum Act {
    /// What the page asks for.
    Go,
    /// An answer that is not accepted.
    Wrong,
    /// A reply to the page before.
    Old,
    /// One of the other things that may be on offer.
    Other(Does),
    Stop,
    /// The experimenter pauses.
    Pause,
    Wait,
    Fault,
    /// The next event is not on disk at once.
    Slow,
}

fn act(draws: &mut Stream) -> Act {
    const OTHER: [Does; 9] = [
        Does::Decline,
        Does::Back,
        Does::Replay,
        Does::RateStopped,
        Does::PlayAgain,
        Does::Refuse,
        Does::Lower,
        Does::Higher,
        Does::Compare,
    ];
    match draws.below(40) {
        0..=1 => Act::Wrong,
        2..=3 => Act::Old,
        4..=10 => Act::Other(OTHER[draws.below(9) as usize]),
        11..=12 => Act::Stop,
        13 => Act::Pause,
        14..=15 => Act::Wait,
        16 => Act::Fault,
        17..=19 => Act::Slow,
        // The pages on which they mean something are rare.
        20..=25 => Act::Other([Does::Lower, Does::Higher][draws.below(2) as usize]),
        _ => Act::Go,
    }
}

/// What the participant wants on a page.
struct Want {
    does: Does,
    /// To the questions in their order; `None` is left empty.
    answers: Vec<Option<Given>>,
}

/// Draws of a simulated participant.
struct Answers<'a>(&'a mut Stream);

impl Draws for Answers<'_> {
    fn position(&mut self) -> f64 {
        self.unit()
    }

    fn unit(&mut self) -> f64 {
        self.0.below(1001) as f64 / 1000.0
    }

    fn pick(&mut self, count: usize) -> usize {
        self.0.below(count.max(1) as u64) as usize
    }

    fn comment(&mut self) -> String {
        ["sägt \"gut\"", "<b>&amp;\u{202e}", "0"][self.pick(3)].to_owned()
    }
}

/// How the participant takes part.
enum How {
    Lines(Dialogue),
    Browser(Exchange, u32),
    Front(Talk, u32),
}

/// A session on one channel.
struct Sitting {
    rig: Rig,
    how: How,
    /// The page before the one that is shown.
    old: Option<Value>,
    shown: Value,
}

impl Sitting {
    fn new(protocol: Protocol, mut how: How) -> Self {
        let mut rig = Rig::new(protocol);
        // What leaves the session is.
        rig.watched = false;
        rig.session.set_channel(Some(match how {
            How::Lines(_) => Channel::Plain,
            How::Browser(..) | How::Front(..) => Channel::Page,
        }));
        if let How::Front(talk, _) = &mut how {
            let hello = json!({"format": "study-page/1", "front": "test", "new": 1});
            talk.hears(hello.to_string().as_bytes()).unwrap();
        }
        Self {
            rig,
            how,
            old: None,
            shown: Value::Null,
        }
    }

    /// Shows what there is to see; what became of the last reply.
    fn look(&mut self) -> Option<Value> {
        let view = self.rig.view();
        let mut settled = None;
        let page = match &mut self.how {
            How::Lines(dialogue) => {
                dialogue.follow(&view);
                return None;
            }
            How::Browser(exchange, key) => {
                exchange.show(&view);
                settled = exchange.outcome(&key.to_string()).map(|o| json!(o));
                exchange.page().map(|named| json!(named))
            }
            How::Front(talk, _) => {
                talk.show(&view);
                let mut page = None;
                for line in talk.says() {
                    assert!(line.ends_with('\n') && line.matches('\n').count() == 1);
                    for word in MODELS.iter().chain([&PRACTICE, &"0.918273", &"damping"]) {
                        assert!(!line.contains(word), "{word} is in {line}");
                    }
                    let line: Value = serde_json::from_str(&line).unwrap();
                    match line["say"].as_str().unwrap() {
                        "page" => page = Some(line),
                        "settled" => settled = Some(line),
                        other => assert_eq!(other, "hello"),
                    }
                }
                page
            }
        };
        if let Some(page) = page {
            if page["id"] != self.shown["id"] {
                self.old = Some(std::mem::replace(&mut self.shown, page));
            } else {
                self.shown = page;
            }
        }
        settled
    }

    /// Sends a reply that is made from the page alone.
    fn reply(&mut self, to: &Value, want: &Want) -> usize {
        let view = self.rig.view();
        let asked = to["questions"].as_array().into_iter().flatten();
        let answers = asked.zip(&want.answers).filter_map(|(asked, given)| {
            Some((asked["id"].as_str()?.to_owned(), json!(given.as_ref()?)))
        });
        let mut reply = json!({"page": to["id"], "shown_ms": 250, "does": want.does,
            "answers": answers.collect::<serde_json::Map<_, _>>()});
        if want.does == Does::Decline {
            reply["reason"] = json!("not said");
        }
        let input = match &mut self.how {
            How::Lines(_) => unreachable!("lines have no replies"),
            How::Browser(exchange, key) => {
                *key += 1;
                reply["key"] = json!(key.to_string());
                let sent = Sent::read(reply.to_string().as_bytes()).unwrap();
                assert!(exchange.arrive(sent));
                exchange.input(&view)
            }
            How::Front(talk, key) => {
                *key += 1;
                reply["key"] = json!(key.to_string());
                talk.hears(reply.to_string().as_bytes()).unwrap();
                talk.input(&view)
            }
        };
        let inputs = usize::from(input.is_some());
        input.map(|input| self.rig.send(input));
        inputs
    }

    /// Types lines; the number of inputs that they cause.
    fn types(&mut self, lines: &[String]) -> usize {
        let mut count = 0;
        for line in lines {
            self.look();
            let view = self.rig.view();
            let How::Lines(dialogue) = &mut self.how else {
                unreachable!("only lines are typed");
            };
            let (inputs, said) = dialogue.line(line, &view);
            count += inputs.len();
            for input in inputs {
                self.rig.send(input);
            }
            // Who is asked for another answer does not type the next one.
            if !said.is_empty() && !matches!(view.screen, Screen::Consent { .. }) {
                break;
            }
        }
        self.look();
        count
    }

    /// Does what the participant wants, as the channel does it; whether the session got it.
    fn take(&mut self, want: &Want, old: bool) -> bool {
        if let How::Lines(_) = self.how {
            // Lines have no earlier page to which they could reply.
            return !old && self.types(&lines(want)) > 0;
        }
        self.look();
        let to = match (old, &self.old) {
            (false, _) => self.shown.clone(),
            (true, Some(old)) => old.clone(),
            (true, None) => return false,
        };
        let inputs = self.reply(&to, want);
        let slow = self.rig.store == StoreMood::Slow && !self.rig.view().line.all_saved;
        let settled = self.look();
        if slow && inputs > 0 {
            assert_eq!(settled, None, "nothing is saved yet");
        } else if inputs == 0 {
            let outcome = if old { "stale" } else { "refused" };
            assert_eq!(settled.unwrap()["outcome"], outcome, "{to}");
        } else {
            assert_eq!(
                settled.unwrap()["outcome"],
                json!(Outcome::Saved)["outcome"]
            );
        }
        inputs > 0
    }

    fn journal(&self) -> Vec<Value> {
        let mut events: Vec<Value> = self.rig.journal.iter().map(|e| json!(e.event)).collect();
        let word = match self.how {
            How::Lines(_) => "plain",
            How::Browser(..) | How::Front(..) => "page",
        };
        for (event, entry) in events.iter_mut().zip(&self.rig.journal) {
            event["at"] = json!(entry.at.mono_ns);
            let channel = event.as_object_mut().unwrap().remove("channel");
            assert!(channel.is_none_or(|channel| channel == word));
        }
        events
    }
}

/// What is typed to say the same.
fn lines(want: &Want) -> Vec<String> {
    let typed = |given: &Option<Given>| match given {
        None => String::new(),
        Some(Given::Typed(text)) => text.clone(),
        Some(Given::Chosen(chosen)) => {
            let numbers: Vec<String> = chosen.iter().map(|at| (at + 1).to_string()).collect();
            numbers.join(" ")
        }
    };
    let answers = want.answers.iter().map(typed);
    match want.does {
        Does::Answer => answers.collect(),
        Does::Decline => std::iter::once("/decline not said".to_owned())
            .chain(answers.skip(1))
            .collect(),
        does => match does {
            Does::Agree => vec!["y"],
            Does::Refuse => vec!["n", "n"],
            Does::Back => vec!["/back"],
            Does::Replay => vec!["/replay"],
            Does::RateStopped => vec!["r"],
            Does::Compare => vec!["s"],
            Does::Lower => vec!["-"],
            Does::Higher => vec!["+"],
            _ => vec![""],
        }
        .into_iter()
        .map(str::to_owned)
        .collect(),
    }
}

/// What the participant can want on a page; `None` where it is the experimenter's or nobody's
/// turn, or the page does not offer it.
fn want(view: &View, act: Act, draws: &mut Stream) -> Option<Want> {
    let page = page(view);
    if page.is_of_experimenter(view) {
        return None;
    }
    let does = match (act, &view.screen) {
        (Act::Wrong, Screen::Form { .. }) => Does::Answer,
        (Act::Wrong, _) => return None,
        (Act::Other(Does::Refuse), Screen::Consent { .. }) if draws.below(4) > 0 => return None,
        (Act::Other(does), _) => does,
        (_, Screen::Form { .. }) => Does::Answer,
        (_, Screen::Consent { .. }) => Does::Agree,
        (_, Screen::Stopped { .. }) => Does::PlayAgain,
        (
            _,
            Screen::Message { .. }
            | Screen::Reference { .. }
            | Screen::Break { .. }
            | Screen::Playing { .. },
        ) => Does::Advance,
        _ => return None,
    };
    let mut answers = Vec::new();
    if let Screen::Form { questions, .. } = &view.screen {
        for (n, question) in questions.iter().enumerate() {
            let control = question.kind.control();
            let answer = question.kind.simulate(&mut Answers(draws));
            let left = !question.required && draws.below(3) == 0;
            let wrong = matches!(act, Act::Wrong) && n == 0;
            answers.push(match &control {
                _ if wrong => Some(bad(&control)?),
                // An Enter alone keeps what was given before a step back, a page sends it.
                _ if left && !view.can_go_back && view.correctable.is_empty() => None,
                _ => Some(control.given(&answer).unwrap()).filter(|given| !given.is_empty()),
            });
            // A required text that the simulated participant leaves empty.
            if answers[n].is_none() && (question.required || !view.correctable.is_empty()) {
                answers[n] = Some(match control {
                    Control::List { .. } => Given::Chosen(vec![0]),
                    _ => Given::Typed("words".to_owned()),
                });
            }
        }
    }
    page.offers(does).then_some(Want { does, answers })
}

/// What no question with this control accepts.
fn bad(control: &Control<'_>) -> Option<Given> {
    Some(match control {
        Control::List { options, pick } => Given::Chosen(match pick {
            Pick::One | Pick::Many => vec![options.len()],
        }),
        Control::Boxes { .. } | Control::Track { .. } | Control::Digits { .. } => {
            Given::Typed("1e9e".to_owned())
        }
        Control::Text => return None,
    })
}

/// One act in one session; whether the session got something from the participant.
fn perform(sitting: &mut Sitting, act: Act, mut draws: Stream) -> bool {
    sitting.look();
    let view = sitting.rig.view();
    match act {
        Act::Stop => {
            match &mut sitting.how {
                How::Lines(_) => drop(sitting.types(&["/stop".to_owned()])),
                How::Browser(exchange, _) => {
                    assert!(exchange.arrive(Sent::read(br#"{"does":"stop"}"#).unwrap()));
                    assert_eq!(exchange.input(&view), Some(Input::Stop));
                    sitting.rig.send(Input::Stop);
                }
                How::Front(talk, _) => {
                    talk.hears(br#"{"does":"stop","page":"any","key":7}"#)
                        .unwrap();
                    assert_eq!(talk.input(&view), Some(Input::Stop));
                    sitting.rig.send(Input::Stop);
                }
            }
            return true;
        }
        Act::Pause => drop(sitting.rig.send(Input::Pause)),
        Act::Wait => drop(sitting.rig.wait(1.5)),
        Act::Fault if view.armed => {
            sitting.rig.send(Input::DeviceFault("too hot".to_owned()));
        }
        Act::Fault => {}
        Act::Go | Act::Wrong | Act::Old | Act::Other(_) | Act::Slow => {
            // What the page makes everybody wait for.
            match view.screen {
                Screen::Reference { wait_s, .. } | Screen::Break { wait_s, .. } => {
                    sitting.rig.wait(wait_s);
                }
                Screen::Playing { .. } => {
                    sitting.rig.send(Input::DeviceProgress { strokes: 9 });
                    sitting.rig.wait(1.0);
                }
                _ => {}
            }
            let view = sitting.rig.view();
            let Some(want) = want(&view, act, &mut draws) else {
                if matches!(act, Act::Go | Act::Slow) {
                    sitting.rig.step();
                }
                return false;
            };
            if matches!(act, Act::Slow) {
                sitting.rig.store = StoreMood::Slow;
            }
            let got = sitting.take(&want, matches!(act, Act::Old));
            if matches!(act, Act::Slow) {
                sitting.rig.store = StoreMood::Prompt;
                let saved = sitting.rig.all_on_disk();
                sitting.rig.send(saved);
                sitting.look();
            }
            return got;
        }
    }
    false
}

#[test]
fn random_sessions_have_the_same_journal_in_lines_by_the_browser_and_through_a_front() {
    let schema = crate::front::schema();
    let mut sessions = 0;
    let mut fields = BTreeSet::new();
    let mut kinds = BTreeSet::new();
    let mut outcomes = BTreeSet::new();
    for (n, protocol) in studies().into_iter().enumerate() {
        for session in 0..SESSIONS {
            let words = Words::default();
            let mut sittings = [
                How::Lines(Dialogue::new(true, false)),
                How::Browser(Exchange::new("run".to_owned()), 0),
                How::Front(Talk::new("run".to_owned(), None, &words), 0),
            ]
            .map(|how| Sitting::new(protocol.clone(), how));
            let mut draws = Stream::new(session, &["interpreters", &n.to_string()]);
            for step in 0..400 {
                // Towards the end nothing gets in the way.
                let act = match step {
                    0..150 => act(&mut draws),
                    _ => Act::Go,
                };
                let seed = draws.next_u64();
                let got = sittings.each_mut().map(|sitting| {
                    sitting.rig.device = DeviceMood::Willing;
                    perform(sitting, act, Stream::new(seed, &[]))
                });
                assert_eq!(got, [got[0]; 3], "study {n} session {session}: {act:?}");
                outcomes.insert((format!("{act:?}"), got[0]));
                let page = &sittings[2].shown;
                kinds.insert(page["kind"].to_string());
                for asked in page["questions"].as_array().into_iter().flatten() {
                    fields.insert(asked["field"]["kind"].to_string());
                }
                if session % 20 == 0 && !page.is_null() {
                    crate::json_schema::check(&schema, &schema["$defs"]["page"], page, "page")
                        .unwrap();
                }
                if sittings[0].rig.ending.is_some() {
                    break;
                }
            }
            let journals = sittings.each_ref().map(Sitting::journal);
            assert!(journals[0].len() > 1);
            for other in [1, 2] {
                let both = journals[0].iter().zip(&journals[other]);
                if let Some((a, b)) = both.clone().find(|(a, b)| a != b) {
                    panic!("study {n} session {session}: {a}\n{b}");
                }
                assert_eq!(journals[other], journals[0], "study {n} session {session}");
            }
            assert!(
                sittings[2].rig.ending.is_some(),
                "study {n} session {session}"
            );
            sessions += 1;
        }
    }
    assert!(sessions >= 1000);
    assert_eq!(fields.len(), 5, "{fields:?}");
    // This device confirms every stop at once.
    let all = &schema["$defs"]["page"]["properties"]["kind"]["enum"];
    for kind in all
        .as_array()
        .unwrap()
        .iter()
        .filter(|kind| *kind != "stopping")
    {
        assert!(kinds.contains(&kind.to_string()), "{kind}");
    }
    for (act, got) in [
        ("Go", true),
        ("Wrong", false),
        ("Old", false),
        ("Slow", true),
    ] {
        assert!(outcomes.contains(&(act.to_owned(), got)), "{act}");
    }
    for does in [
        "Decline",
        "Back",
        "Replay",
        "RateStopped",
        "PlayAgain",
        "Refuse",
        "Lower",
        "Higher",
        "Compare",
    ] {
        assert!(
            outcomes.contains(&(format!("Other({does})"), true)),
            "{does}: {outcomes:?}"
        );
    }
}
