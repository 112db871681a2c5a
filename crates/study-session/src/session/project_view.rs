//! The view of a session. Nothing in it identifies a realization.

use super::failures::title;
use super::flow::Overlay;
use super::phase::{Form, Phase, TELEMETRY_WITHIN_S, Told};
use super::view::{
    Banner, Correctable, DeviceState, MessageKind, Progress, Screen, StatusLine, Telemetry, View,
};
use super::{Ending, Session};
use crate::outcome::fold::GivenAnswer;
use crate::outcome::{FormId, Moment};
use std::collections::BTreeMap;
use study_base::text::Untrusted;
use study_plan::protocol::phrases::Phrase;
use study_plan::protocol::{DeviceKind, Seat, Stimuli, TrackRules};

impl Session {
    /// What the screen shows at this moment.
    pub fn view(&self, at: Moment) -> View {
        let screen = self.screen(at);
        let awaits_page = matches!(screen, Screen::Reference { .. }) && self.waits_for_media(at);
        View {
            progress: self.progress(),
            line: self.line(at),
            course: self.course(),
            device: self.current_device(),
            banner: self.claim.as_ref().and_then(|c| banner(c.seat)),
            notice: self.notice.clone().or_else(|| self.problem_in_form()),
            entry: self.protocol.session.entry,
            correctable: self.correctable(),
            can_mark_bad: self
                .markable()
                .filter(|_| self.overlay().is_none())
                .map(|(_, _, title)| title),
            armed: self.phase.armed(),
            unsaved: match &self.saves.trouble {
                Some(_) => self.unsaved_names(),
                None => Vec::new(),
            },
            can_replay: self.can_replay(),
            has_replays: self.has_replays(),
            can_go_back: self.can_go_back(),
            remarks: self.remarks.iter().rev().take(3).cloned().collect(),
            force: self.presents_force(),
            has_reference: self.has_reference(),
            numbered: self.is_numbered(),
            adjusting: self.shown_adjustment(),
            cue: self.cue(),
            awaits_page,
            can_advance: can_advance(&screen) && !awaits_page,
            words: self.words.clone(),
            screen,
        }
    }

    fn screen(&self, at: Moment) -> Screen {
        let ended = matches!(self.phase, Phase::Over(_));
        match self.overlay().filter(|_| !ended) {
            Some(Overlay::Disk) if self.saves.retrying => Screen::Saving,
            Some(Overlay::Disk) => Screen::SaveTrouble {
                what: self.sanitized(self.saves.trouble.as_deref().unwrap_or_default()),
            },
            Some(Overlay::Pause) if self.phase.under_way() => Screen::Paused {
                since_s: self.paused.map_or(0.0, |since| at.seconds_since(&since)),
            },
            Some(Overlay::Device) if self.phase.under_way() => Screen::DeviceTrouble {
                what: self
                    .device_problem
                    .as_ref()
                    .map_or(String::new(), |t| t.what.clone()),
                can_go_on: self.can_continue(),
            },
            _ => self.phase_screen(at),
        }
    }

    fn phase_screen(&self, at: Moment) -> Screen {
        match &self.phase {
            Phase::Identify | Phase::Claiming => Screen::Who {
                participant: self.participant.clone(),
                operator: self.operator.clone(),
                roster: self.roster.clone(),
                claiming: matches!(self.phase, Phase::Claiming),
            },
            Phase::ResumeChoice { gap_s } => Screen::ResumeChoice {
                gap_h: gap_s / 3600.0,
                done: self.history.closed(false),
                total: self.total(false),
                restart: self.can_restart(),
            },
            Phase::Consent => match &self.protocol.consent {
                Some(consent) => self.consent_screen(consent),
                None => Screen::Saving,
            },
            Phase::Message(kind) => Screen::Message {
                kind: *kind,
                text: self.message(*kind).unwrap_or_default().to_owned(),
            },
            Phase::Feedback(told) => Screen::Message {
                kind: MessageKind::Feedback,
                text: self.feedback_text(told),
            },
            Phase::Form(form) => self.form_screen(form),
            Phase::Reference { .. } => Screen::Reference {
                prompt: self
                    .protocol
                    .trial
                    .reference
                    .clone()
                    .unwrap_or_else(|| self.words.get(Phrase::ReferenceText).to_owned()),
                wait_s: self.reference_wait_s(at),
            },
            Phase::Loading { .. } | Phase::Gap { .. } | Phase::Ready { .. } => Screen::Loading {
                interval: self.interval_of(),
            },
            Phase::Mounting { code } => Screen::Mount { code: code.clone() },
            Phase::Playing { since, strokes, .. } => Screen::Playing {
                since_s: at.seconds_since(since),
                keep_exploring: self.too_little(at.seconds_since(since), *strokes),
                exposure: self.exposure(),
                interval: self.interval_of(),
            },
            Phase::Stopping { .. } => Screen::Stopping,
            Phase::Stopped { since } => Screen::Stopped {
                can_rate: self.can_rate() && !self.is_forgotten(at.seconds_since(since)),
            },
            Phase::Break { .. } => Screen::Break {
                text: (self.protocol.text.rest.clone())
                    .unwrap_or_else(|| self.words.get(Phrase::BreakText).to_owned()),
                wait_s: self.break_wait_s(at),
                done: self.history.closed(false),
                total: self.total(false),
            },
            Phase::Saving | Phase::Leaving { .. } => Screen::Saving,
            Phase::End | Phase::Over(_) => Screen::End {
                text: self.end_text(),
            },
        }
    }

    fn form_screen(&self, form: &Form) -> Screen {
        let questions = form.pages.get(form.at).into_iter().flatten();
        Screen::Form {
            form: form.id,
            questions: questions.map(|q| self.shown(q)).collect(),
            page: number(form.at + 1),
            pages: number(form.pages.len()),
            to_experimenter: form.id == FormId::Setup,
        }
    }

    fn feedback_text(&self, told: &Told) -> String {
        let phrase = match told.correct {
            true => Phrase::Correct,
            false => Phrase::NotCorrect,
        };
        let said = self.words.get(phrase);
        let missed = told.label.as_ref().filter(|_| !told.correct);
        missed.map_or_else(
            || said.to_owned(),
            |label| {
                format!(
                    "{said} {}",
                    self.words.fill(Phrase::ItWas, &[("label", label)])
                )
            },
        )
    }

    fn end_text(&self) -> String {
        let finished =
            self.history.finished() && !matches!(self.phase, Phase::Over(Ending::Nothing));
        let own = self.protocol.text.end.clone().filter(|_| finished);
        own.unwrap_or_else(|| {
            let phrase = if finished {
                Phrase::Complete
            } else {
                Phrase::NoMore
            };
            self.words.get(phrase).to_owned()
        })
    }

    /// Whether the first interval of the trial under way is a reference.
    fn has_reference(&self) -> bool {
        let open = self.history.open();
        open.is_some_and(|open| match &open.trial.stimuli {
            Stimuli::Rated { .. } => true,
            Stimuli::Adjusted { standard, .. } => standard.is_some(),
            Stimuli::One { .. }
            | Stimuli::Pair { .. }
            | Stimuli::Track { .. }
            | Stimuli::Search { .. }
            | Stimuli::Set { .. } => false,
        })
    }

    /// Whether the intervals of the trial under way have numbers for names, by which they are asked about.
    fn is_numbered(&self) -> bool {
        let open = self.history.open();
        open.is_some_and(|open| matches!(open.trial.stimuli, Stimuli::Set { .. }))
    }

    /// The interval under way and their number, if there are several.
    fn interval_of(&self) -> Option<(u32, u32)> {
        let attempt = self.history.open()?.attempt;
        // How often a level was changed is not shown.
        if attempt.is_adjusted() {
            return attempt.is_at_standard().then_some((1, 2));
        }
        Some((self.interval()?, self.intervals()?))
    }

    /// Number of trials that count, or of practice trials; `None` if it depends on the
    /// answers.
    pub(super) fn total(&self, practice: bool) -> Option<u32> {
        let known = match practice {
            true => !self.protocol.practices_to_a_criterion(),
            false => !self.protocol.is_adaptive(),
        };
        known.then(|| self.history.planned_total(practice))
    }

    /// Counts closed trials, so that a repeated trial looks like any other.
    fn progress(&self) -> Option<Progress> {
        let rating = matches!(&self.phase, Phase::Form(f) if matches!(f.id, FormId::Trial { .. }));
        let prompt = matches!(self.phase, Phase::Reference { .. } | Phase::Stopped { .. });
        if !(rating || prompt || self.phase.armed()) {
            return None;
        }
        let trial = match self.history.open() {
            Some(open) => open.trial,
            None => self.history.next_trial()?,
        };
        let most = self.history.planned_total(trial.practice);
        Some(Progress {
            practice: trial.practice,
            current: (self.history.closed(trial.practice) + 1).min(most),
            total: self.total(trial.practice),
            block: self.block_length().filter(|_| !trial.practice),
        })
    }

    /// The length of the blocks of trials that count.
    fn block_length(&self) -> Option<u32> {
        let counted = self.history.schedule().iter().filter(|t| !t.practice);
        let mut blocks: BTreeMap<u32, u32> = BTreeMap::new();
        for trial in counted {
            *blocks.entry(trial.block).or_default() += 1;
        }
        let first = *blocks.values().next()?;
        (blocks.len() > 1 && blocks.values().all(|n| *n == first)).then_some(first)
    }

    fn line(&self, at: Moment) -> StatusLine {
        StatusLine {
            participant: self.participant.clone(),
            operator: self.operator.clone(),
            device: self.device_state(at),
            elapsed_s: self.opened.map_or(0.0, |opened| at.seconds_since(&opened)),
            trials_saved: count(
                self.history
                    .completed()
                    .filter(|t| self.saves.has_trial(*t)),
            ),
            trials_answered: count(self.history.completed()),
            all_saved: self.saves.all_saved(),
            mirror: self.mirror,
        }
    }

    fn device_state(&self, at: Moment) -> DeviceState {
        if self.claim.is_none() {
            return DeviceState::Unknown;
        }
        if self.device_lost {
            return DeviceState::Lost;
        }
        if self.device_problem.as_ref().is_some_and(|t| t.fault) {
            return DeviceState::Fault;
        }
        let none = self.claim.as_ref().map(|c| c.device_kind) == Some(DeviceKind::Manual);
        match self.phase {
            Phase::Playing { .. } if self.current_device() == DeviceKind::Manual => {
                DeviceState::Felt
            }
            _ if none => DeviceState::ByHand,
            _ if self.current_device() == DeviceKind::Manual => DeviceState::Limp,
            Phase::Loading { .. } | Phase::Gap { .. } => DeviceState::Loading,
            Phase::Ready { .. } => DeviceState::Ready,
            Phase::Playing { telemetry, .. } => DeviceState::Running(match telemetry {
                None => Telemetry::None,
                Some(last) if at.seconds_since(&last) > TELEMETRY_WITHIN_S => Telemetry::Silent,
                Some(_) => Telemetry::Arrives,
            }),
            Phase::Stopping { .. } => DeviceState::Stopping,
            _ => DeviceState::Limp,
        }
    }

    /// The device of the trial under way; between trials, that of the study.
    fn current_device(&self) -> DeviceKind {
        let under_way = self
            .playing_model()
            .filter(|_| self.phase.armed() || matches!(self.phase, Phase::Stopped { .. }));
        let own = under_way.and_then(|model| self.protocol.model(model)?.device);
        let claimed = self.claim.as_ref().map(|c| c.device_kind);
        own.or(claimed).unwrap_or(self.protocol.device.kind)
    }

    /// Whether the study plays tables of force. A program of the laboratory may present
    /// sounds or pictures, which have none.
    pub(super) fn presents_force(&self) -> bool {
        let protocol = &self.protocol;
        self.current_device() != DeviceKind::Process
            || protocol.models.iter().any(|m| m.file.is_some())
            || !protocol.families.is_empty()
            || !protocol.spaces.is_empty()
    }

    /// A device problem does not hide a form; it is shown as a notice while it lasts.
    fn problem_in_form(&self) -> Option<String> {
        let problem = self.device_problem.as_ref().filter(|_| self.in_form())?;
        Some(format!("device: {}", problem.what))
    }

    fn correctable(&self) -> Vec<Correctable> {
        let given = self.history.answers.iter().rev();
        let mut forms: Vec<(FormId, Vec<&GivenAnswer>)> = Vec::new();
        for answer in given.filter(|g| self.history.is_current(g.form)) {
            // Those of one form are together, but for what a resumed form was asked later.
            match forms.iter_mut().rfind(|(form, _)| *form == answer.form) {
                Some((_, answers)) => answers.push(answer),
                None => forms.push((answer.form, vec![answer])),
            }
        }
        let mut items = Vec::new();
        for (form, answers) in forms {
            let title = self.shown_title(form);
            let set = self.set_in(form);
            let questions = self.questions(form).into_iter();
            for question in questions.filter(|q| Some(&q.id) != set) {
                let given = answers.iter().find(|g| g.question == question.id);
                items.extend(given.map(|given| Correctable {
                    form,
                    title: title.clone(),
                    question: self.shown(question),
                    answer: self.shown_answer(question, &given.answer),
                }));
            }
        }
        items
    }

    /// The title of a form for the participant.
    fn shown_title(&self, form: FormId) -> String {
        let phrase = match form {
            FormId::Setup => Phrase::FormSetup,
            FormId::Intake => Phrase::FormIntake,
            FormId::Outro => Phrase::FormOutro,
            FormId::Consent => Phrase::AgreeQuestion,
            FormId::Trial { trial, .. } | FormId::After { trial, .. } => {
                let (practice, number) = self.shown_number(trial);
                let phrase = match practice {
                    true => Phrase::PracticeNumber,
                    false => Phrase::TrialNumber,
                };
                return self.words.fill(phrase, &[("n", &number)]);
            }
        };
        self.words.get(phrase).to_owned()
    }

    /// Whether a trial is practice, and its number on the screen.
    fn shown_number(&self, trial: u32) -> (bool, u32) {
        let practice = self.history.planned(trial).is_some_and(|t| t.practice);
        let now = || self.history.closed(practice) + 1;
        let done = self.history.completion(trial);
        (practice, done.map_or_else(now, |(_, done)| done.number))
    }

    /// The title of a form for the experimenter.
    pub(super) fn form_title(&self, form: FormId) -> String {
        match form {
            FormId::Setup => "set-up".to_owned(),
            FormId::Intake => "intake".to_owned(),
            FormId::Outro => "closing questions".to_owned(),
            FormId::Consent => "consent".to_owned(),
            FormId::Trial { trial, .. } | FormId::After { trial, .. } => {
                let (practice, number) = self.shown_number(trial);
                title(practice, number)
            }
        }
    }

    /// Text of a device or store, blinded and safe to print on a terminal.
    pub(super) fn sanitized(&self, foreign: &str) -> String {
        Untrusted(&self.blinded(foreign)).to_string()
    }

    /// The text with every word that names a realization replaced by "…".
    pub(super) fn blinded(&self, foreign: &str) -> String {
        let mut blinded = String::with_capacity(foreign.len());
        let in_name = |c: char| c.is_ascii_alphanumeric() || "._-/\\".contains(c);
        let mut rest = foreign;
        while !rest.is_empty() {
            let name_end = rest.find(|c| !in_name(c)).unwrap_or(rest.len());
            let (name, after) = rest.split_at(name_end);
            blinded.push_str(if self.names_a_realization(name) {
                "…"
            } else {
                name
            });
            let other_end = after.find(in_name).unwrap_or(after.len());
            let (other, next) = after.split_at(other_end);
            blinded.push_str(other);
            rest = next;
        }
        blinded
    }

    fn names_a_realization(&self, name: &str) -> bool {
        let of_family = self.protocol.families.iter().any(|family| {
            let files = [Some(&family.from), family.to.as_ref()];
            name.contains(&format!("{}.", family.id))
                || files
                    .into_iter()
                    .flatten()
                    .any(|file| name.contains(file.as_str()))
        });
        let of_space = self.protocol.spaces.iter().any(|space| {
            name.contains(&format!("{}.", space.id)) || name.contains(space.from.as_str())
        });
        let standard = |t: &TrackRules| name.contains(&format!("{}.standard", t.id));
        if of_family || of_space || self.protocol.tracks.iter().any(standard) {
            return true;
        }
        self.protocol.models.iter().any(|model| {
            let id = model.id.as_str();
            let id_in = name.trim_end_matches('.') == id || (id.len() > 3 && name.contains(id));
            id_in
                || model
                    .file
                    .as_deref()
                    .is_some_and(|file| name.contains(file))
        })
    }
}

fn count<T>(items: impl Iterator<Item = T>) -> u32 {
    number(items.count())
}

fn number(n: usize) -> u32 {
    u32::try_from(n).unwrap_or(u32::MAX)
}

fn banner(seat: Seat) -> Option<Banner> {
    match seat {
        Seat::Row(_) => None,
        Seat::Pilot(_) => Some(Banner::Pilot),
        Seat::Simulated(_) => Some(Banner::Simulated),
    }
}

/// Whether Enter does anything on a screen.
pub(super) fn can_advance(screen: &Screen) -> bool {
    match screen {
        Screen::Message { .. } | Screen::SaveTrouble { .. } | Screen::Paused { .. } => true,
        Screen::End { .. } | Screen::Mount { .. } => true,
        Screen::Reference { wait_s, .. } | Screen::Break { wait_s, .. } => *wait_s <= 0.0,
        Screen::Playing { keep_exploring, .. } => !keep_exploring,
        Screen::DeviceTrouble { can_go_on, .. } => *can_go_on,
        _ => false,
    }
}
