//! From a view to its page.

use super::question::asked;
use super::{
    Asked, Button, Dialog, Does, Interval, Kind, Page, PlaybackWords, Progress, clock,
    unsaved_lines,
};
use crate::session::view::{self, Adjusting, Banner, MessageKind};
use crate::session::{Screen, View};
use std::fmt::Display;
use study_base::text::{Untrusted, counted};
use study_plan::protocol::phrases::{Phrase, Words};
use study_plan::protocol::{DeviceKind, Entry, Exposure, Question};

/// Columns for the name of something that is not saved.
const UNSAVED_COLUMNS: usize = 40;

/// The page of a view, as the experimenter's terminal shows it. Its texts may contain
/// characters that are not safe to print.
pub fn page(view: &View) -> Page {
    let words = &view.words;
    let mut page = Page::new(view);
    match &view.screen {
        Screen::Who { .. } => page.title = words.get(Phrase::OneMoment).to_owned(),
        Screen::ResumeChoice {
            gap_h,
            done,
            total,
            restart,
        } => page.resume(*gap_h, (*done, *total), *restart),
        Screen::Consent { document, version } => {
            page.instruction = read_by_experimenter(view, "Ask the participant");
            page.title = words.get(Phrase::AgreeQuestion).to_owned();
            page.text = match version.is_empty() {
                true => document.clone(),
                false => {
                    let values = [("document", document as &dyn Display), ("version", version)];
                    words.fill(Phrase::Version, &values)
                }
            };
            page.button(Does::Agree, Phrase::Agree, true, words);
            page.refuse = Some(Dialog {
                open: words.get(Phrase::Refuse).to_owned(),
                title: words.get(Phrase::RefuseSure).to_owned(),
                confirm: words.get(Phrase::RefuseConfirm).to_owned(),
                back: words.get(Phrase::Back).to_owned(),
            });
        }
        Screen::Message { kind, text } => {
            match kind {
                MessageKind::Welcome | MessageKind::Instructions | MessageKind::Part => {
                    page.instruction = read_by_experimenter(view, "Read out");
                }
                MessageKind::Practice => page.title = words.get(Phrase::Practice).to_owned(),
                MessageKind::Debriefing => {
                    page.instruction = read_by_experimenter(view, "Read out");
                    page.title = words.get(Phrase::Debriefing).to_owned();
                }
                MessageKind::PracticeOver | MessageKind::Feedback => {}
            }
            page.text.clone_from(text);
            page.button(Does::Advance, Phrase::Continue, true, words);
        }
        Screen::Form { .. } => page.form(view),
        Screen::Reference { prompt, wait_s } => {
            page.instruction = read_by_experimenter(view, "Tell the participant");
            page.title.clone_from(prompt);
            if *wait_s <= 0.0 {
                words.get(Phrase::AtLeisure).clone_into(&mut page.text);
            }
            page.waits(*wait_s, words);
            if view.awaits_page {
                page.wait = Some(words.get(Phrase::PageMedia).to_owned());
            }
            page.button(Does::Advance, Phrase::Ready, view.can_advance, words);
        }
        Screen::Loading { interval: None } => {
            page.title = words.get(Phrase::OneMoment).to_owned();
            page.text = words.get(Phrase::Preparing).to_owned();
        }
        Screen::Loading { interval } => {
            page.interval = interval.map(|(at, of)| Interval::new(view, at, of));
            page.text = words.get(Phrase::OneMoment).to_owned();
        }
        Screen::Mount { code } => {
            page.instruction = Some("For the experimenter");
            page.title = format!("Mount sample {code}.");
            page.text = "Press Enter when the sample is mounted.".to_owned();
            page.button(Does::Advance, Phrase::Mounted, true, words);
        }
        Screen::Playing { .. } => page.playing(view),
        Screen::Stopping => page.title = words.get(Phrase::Stopping).to_owned(),
        Screen::Stopped { can_rate } => {
            let stopped = Stopped::of(view);
            page.title = words.get(stopped.title).to_owned();
            page.text = words.get(stopped.body).to_owned();
            page.button(Does::PlayAgain, stopped.again, true, words);
            match &view.adjusting {
                _ if !can_rate => {}
                Some(own) => {
                    let label = Untrusted(&own.words.confirm).to_string();
                    page.labeled(Does::RateStopped, &label, true);
                }
                None => page.button(Does::RateStopped, stopped.rate, true, words),
            }
        }
        Screen::DeviceTrouble { what, can_go_on } => {
            page.title = "DEVICE TROUBLE".to_owned();
            page.text.clone_from(what);
            page.advice = Some(device_advice(view.device, *can_go_on).to_owned());
            page.button(Does::Advance, Phrase::Continue, *can_go_on, words);
            page.button(Does::Quit, Phrase::Quit, true, words);
        }
        Screen::Saving => page.title = words.get(Phrase::Saving).to_owned(),
        Screen::SaveTrouble { what } => {
            page.title = "NOT SAVED".to_owned();
            page.text.clone_from(what);
            page.advice = Some(format!(
                "In memory only: {}. Do not close this window. Free space on the disk or \
                 reconnect it, then press Enter to try again.",
                unsaved_lines(&view.unsaved, 4, UNSAVED_COLUMNS).join("; ")
            ));
            page.button(Does::RetrySave, Phrase::TryAgain, true, words);
        }
        Screen::Break {
            text,
            wait_s,
            done,
            total,
        } => {
            page.title = words.get(Phrase::Break).to_owned();
            page.text.clone_from(text);
            page.done = total.map(|total| Progress::new(words, Phrase::DoneOf, *done, Some(total)));
            page.waits(*wait_s, words);
            page.button(Does::Advance, Phrase::Ready, view.can_advance, words);
        }
        Screen::Paused { since_s } => {
            page.title = words.get(Phrase::Paused).to_owned();
            let phrase = match view.device == DeviceKind::Manual || !view.force {
                true => Phrase::PausedFor,
                false => Phrase::PausedNoForce,
            };
            page.clock = Some(words.fill(phrase, &[("time", &clock(*since_s))]));
            page.button(Does::Advance, Phrase::Continue, true, words);
            page.button(Does::Quit, Phrase::Quit, true, words);
        }
        Screen::End { text } => {
            page.text.clone_from(text);
            page.over = true;
            page.button(Does::Advance, Phrase::Close, true, words);
        }
    }
    page
}

impl Page {
    fn new(view: &View) -> Self {
        let words = &view.words;
        let progress = |p: view::Progress| {
            let phrase = match (p.practice, p.total) {
                (true, Some(_)) => Phrase::PracticeOf,
                (true, None) => Phrase::PracticeNumber,
                (false, Some(_)) => Phrase::TrialOf,
                (false, None) => Phrase::TrialNumber,
            };
            Progress::new(words, phrase, p.current, p.total)
        };
        Self {
            kind: Kind::of(&view.screen),
            instruction: None,
            progress: view.progress.map(progress),
            sheet: None,
            done: None,
            interval: None,
            banner: view.banner.map(|banner| {
                words
                    .get(match banner {
                        Banner::Pilot => Phrase::Pilot,
                        Banner::Simulated => Phrase::Simulated,
                    })
                    .to_owned()
            }),
            title: String::new(),
            text: String::new(),
            advice: None,
            wait: None,
            wait_clock: None,
            clock: None,
            playback: None,
            media: view.cue.clone(),
            questions: Vec::new(),
            buttons: Vec::new(),
            // A sample felt by hand cannot be stopped, but the attempt can.
            stop: view.armed.then(|| words.get(Phrase::Stop).to_owned()),
            decline: None,
            refuse: None,
            scales: match words.scales_from_right() {
                true => "rtl",
                false => "ltr",
            },
            over: false,
        }
    }

    fn button(&mut self, does: Does, phrase: Phrase, enabled: bool, words: &Words) {
        self.labeled(does, words.get(phrase), enabled);
    }

    fn labeled(&mut self, does: Does, label: &str, enabled: bool) {
        self.buttons.push(Button {
            does,
            label: label.to_owned(),
            note: "",
            enabled,
        });
    }

    fn waits(&mut self, wait_s: f64, words: &Words) {
        self.wait = (wait_s > 0.0).then(|| words.wait(wait_s));
        self.wait_clock = (wait_s > 0.0).then(|| clock(wait_s.ceil()));
    }

    fn resume(&mut self, gap_h: f64, (done, total): (u32, Option<u32>), restart: bool) {
        let done = match total {
            Some(total) => format!("{done} of {total} trials are done."),
            None => format!("{} done.", counted(done as usize, "trial is", "trials are")),
        };
        self.title = "This session was not finished.".to_owned();
        self.text = format!("{done} The last one was {} ago.", ago(gap_h));
        let choices = [
            (
                Does::RestartBlock,
                "restart the block",
                "the trials of the block are repeated",
            ),
            (
                Does::Continue,
                "continue where it stopped",
                "later trials are flagged",
            ),
            (Does::DropOut, "drop out", "the participant does not return"),
        ];
        let offered = choices.into_iter();
        let offered = offered.filter(|(does, ..)| restart || *does != Does::RestartBlock);
        let button = |(does, label, note): (_, &str, _)| Button {
            does,
            label: label.to_owned(),
            note,
            enabled: true,
        };
        self.buttons = offered.map(button).collect();
    }

    fn form(&mut self, view: &View) {
        let Screen::Form {
            form,
            questions,
            page,
            pages,
            to_experimenter,
        } = &view.screen
        else {
            return;
        };
        let words = &view.words;
        self.instruction = match to_experimenter {
            true => Some("For the experimenter"),
            false => read_by_experimenter(view, "Ask the participant"),
        };
        if *pages > 1 {
            self.sheet = Some(Progress::new(words, Phrase::PageOf, *page, Some(*pages)));
        }
        let ask = |question: &Question| Asked {
            given: (view.given(*form, &question.id))
                .and_then(|given| question.kind.control().given(given)),
            ..asked(question, words)
        };
        self.questions = questions.iter().map(ask).collect();
        self.button(Does::Answer, Phrase::Save, true, words);
        if view.can_replay {
            // What is not a force is not felt.
            let again = match view.force || view.device == DeviceKind::Manual {
                true => Phrase::FeelAgain,
                false => Phrase::PlayAgain,
            };
            self.button(Does::Replay, again, true, words);
        }
        if view.can_go_back {
            self.button(Does::Back, Phrase::Back, true, words);
        }
        // Initials are no answer.
        self.decline = form.can_be_declined().then(|| Dialog {
            open: words.get(Phrase::DeclineTitle).to_owned(),
            title: words.get(Phrase::DeclineWhy).to_owned(),
            confirm: words.get(Phrase::Decline).to_owned(),
            back: words.get(Phrase::Back).to_owned(),
        });
    }

    fn playing(&mut self, view: &View) {
        let Screen::Playing {
            since_s,
            keep_exploring,
            exposure,
            interval,
        } = &view.screen
        else {
            return;
        };
        let words = &view.words;
        let (feel, more) = attending(view);
        self.interval = interval.map(|(at, of)| Interval::new(view, at, of));
        let attend = match interval {
            Some(_) => &mut self.text,
            None => &mut self.title,
        };
        words.get(feel).clone_into(attend);
        self.wait = keep_exploring.then(|| words.get(more).to_owned());
        let playback = PlaybackWords::new(view, *since_s, exposure);
        self.clock = Some(playback.left.as_ref().unwrap_or(&playback.time).clone());
        self.playback = Some(playback);
        if let Some(own) = view.adjusting.as_ref().filter(|own| !own.at_standard) {
            return self.adjusting(view, own);
        }
        let on = match interval {
            None => Phrase::Rate,
            Some((at, of)) if at == of => Phrase::Answer,
            Some(_) => Phrase::Next,
        };
        self.button(Does::Advance, on, view.can_advance, words);
    }
}

impl Page {
    /// A level is felt, and changed until it is confirmed.
    fn adjusting(&mut self, view: &View, own: &Adjusting) {
        let words = &view.words;
        self.text = std::mem::replace(&mut self.title, own.prompt.clone());
        for (does, label, enabled) in [
            (Does::Advance, &own.words.confirm, view.can_advance),
            (Does::Lower, &own.words.lower, own.can_lower),
            (Does::Higher, &own.words.higher, own.can_higher),
        ] {
            self.labeled(does, &Untrusted(label).to_string(), enabled);
        }
        if own.has_standard {
            self.button(Does::Compare, Phrase::ReferenceInterval, true, words);
        }
    }
}

impl Progress {
    fn new(words: &Words, phrase: Phrase, at: u32, of: Option<u32>) -> Self {
        let total = of.unwrap_or(at);
        let values = [("n", &at as &dyn Display), ("total", &total)];
        Self {
            words: words.fill(phrase, &values),
            at,
            of,
        }
    }
}

impl Kind {
    fn of(screen: &Screen) -> Self {
        match screen {
            Screen::Who { .. } => Self::Who,
            Screen::ResumeChoice { .. } => Self::Resume,
            Screen::Consent { .. } => Self::Consent,
            Screen::Message { .. } => Self::Message,
            Screen::Form { .. } => Self::Questions,
            Screen::Reference { .. } => Self::Reference,
            Screen::Loading { .. } => Self::Loading,
            Screen::Mount { .. } => Self::Mount,
            Screen::Playing { .. } => Self::Playing,
            Screen::Stopping => Self::Stopping,
            Screen::Stopped { .. } => Self::Stopped,
            Screen::DeviceTrouble { .. } => Self::DeviceTrouble,
            Screen::Saving => Self::Saving,
            Screen::SaveTrouble { .. } => Self::SaveTrouble,
            Screen::Break { .. } => Self::Break,
            Screen::Paused { .. } => Self::Paused,
            Screen::End { .. } => Self::End,
        }
    }
}

impl Interval {
    fn new(view: &View, at: u32, of: u32) -> Self {
        Self {
            name: view.interval_name(at),
            at,
            of,
        }
    }
}

impl PlaybackWords {
    fn new(view: &View, since_s: f64, exposure: &Exposure) -> Self {
        let words = &view.words;
        let state = match view.device == DeviceKind::Manual {
            true => Phrase::Exploring,
            false => Phrase::Playing,
        };
        let left = |s: f64| words.fill(Phrase::TimeLeft, &[("time", &clock(s.ceil()))]);
        let left_s = exposure.left_s(since_s);
        Self {
            state: words.get(state).to_owned(),
            time: clock(left_s.map_or(since_s, f64::ceil)),
            left: left_s.map(left),
            whole: exposure.max_s.map(left),
            part: match exposure.max_s {
                Some(max_s) => Some(since_s / max_s),
                None => (exposure.min_s > 0.0).then_some(since_s / exposure.min_s),
            },
        }
    }
}

/// The sentences of a stopped trial, by what was presented.
struct Stopped {
    /// What is stopped.
    title: Phrase,
    /// What that means.
    body: Phrase,
    /// Present it again.
    again: Phrase,
    /// Rate it.
    rate: Phrase,
}

impl Stopped {
    fn of(view: &View) -> Self {
        let (title, body, again, rate) = match (view.device, view.force) {
            (DeviceKind::Manual, _) => (
                Phrase::StoppedSample,
                Phrase::LetGo,
                Phrase::FeelAgain,
                Phrase::RateFelt,
            ),
            (_, true) => (
                Phrase::StoppedDevice,
                Phrase::NoForce,
                Phrase::PlayAgain,
                Phrase::RateFelt,
            ),
            (_, false) => (
                Phrase::StoppedSample,
                Phrase::NotLost,
                Phrase::PlayAgain,
                Phrase::RateIt,
            ),
        };
        Self {
            title,
            body,
            again,
            rate,
        }
    }
}

/// What the participant does while it plays: the sentence, and, where more is needed, how
/// to go on.
pub fn attending(view: &View) -> (Phrase, Phrase) {
    match (view.device, view.force) {
        (DeviceKind::Manual, _) => (Phrase::FeelSample, Phrase::Longer),
        (_, true) => (Phrase::FeelDevice, Phrase::KeepExploring),
        (_, false) => (Phrase::Attend, Phrase::Longer),
    }
}

fn device_advice(device: DeviceKind, can_go_on: bool) -> &'static str {
    match (can_go_on, device) {
        (true, _) => {
            "The device produces no force. Check the device, then press Enter: an \
             interrupted trial is repeated later. No answer is lost."
        }
        (false, DeviceKind::Process) => {
            "Let go of the device: the state of its motor is unknown while its \
             program does not run. The program is restarted every second, and the \
             session continues when it answers. If it never does, start it by hand \
             to see why. F10 quits: the session can be resumed later, and no answer \
             is lost."
        }
        (false, _) => {
            "The device should produce no force: use its emergency switch if it does. Check \
             its power and its cable; the session continues when it answers again. F10 quits: \
             the session can be resumed later, and no answer is lost."
        }
    }
}

/// What an experimenter does who has the participant's page before the eyes.
fn read_by_experimenter(view: &View, what: &'static str) -> Option<&'static str> {
    (view.entry == Entry::Experimenter).then_some(what)
}

/// A time in h in words, such as "20 minutes"; "some time" if it is negative or not finite.
///
/// ```
/// # use study_session::page::ago;
/// assert_eq!((ago(1.0 / 3.0), ago(-1.0)), ("20 minutes".into(), "some time".into()));
/// ```
pub fn ago(gap_h: f64) -> String {
    if !gap_h.is_finite() || gap_h < 0.0 {
        return "some time".to_owned();
    }
    let (count, unit) = match gap_h {
        h if h < 1.0 / 60.0 => (h * 3600.0, "second"),
        h if h < 1.0 => (h * 60.0, "minute"),
        h if h < 48.0 => (h, "hour"),
        h => (h / 24.0, "day"),
    };
    let count = count.floor().max(1.0);
    let plural = if count > 1.0 { "s" } else { "" };
    format!("{count} {unit}{plural}")
}
