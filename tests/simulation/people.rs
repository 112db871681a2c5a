//! The participant and the experimenter, and the way of what they do to the program.
//!
//! The participant sees the page that a browser shows or the one of the terminal, and answers
//! after a while. What they send by the page is lost, comes late or twice, and is sent again with
//! the same key until the page has heard what became of it; keys are typed twice.

use crate::bugs::Bug;
use crate::faults::Plan;
use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;
use study_base::rng::Stream;
use study_plan::protocol::Given;
use study_session::outcome::{Channel, Choice, FormId};
use study_session::page::reply::{self, Exchange, Outcome, Reply, Sent};
use study_session::page::{Does, Field, Kind, Page, page};
use study_session::session::{Input, Screen, View};

/// Acts of an experimenter before a page that does not change is left.
const PATIENCE: u32 = 25;

/// What people have answered, and what they were told of it. Every answer has a text that no
/// other one has.
#[derive(Debug, Default)]
pub(crate) struct Ledger {
    /// Each text, and the rating that was given with it.
    pub(crate) given: BTreeMap<String, Option<i64>>,
    /// Those that were shown as saved.
    pub(crate) told: BTreeSet<String>,
}

/// What is on its way to the program.
#[derive(Debug, Clone)]
enum Parcel {
    /// From the page.
    Page(Vec<u8>),
    /// From the terminal.
    Key(Input),
}

/// A reply of which the page has not heard what became of it.
#[derive(Debug, Clone)]
struct Waiting {
    key: String,
    json: Vec<u8>,
    texts: Vec<String>,
    again_at: Duration,
}

/// What somebody wants to do on a page.
struct Wish {
    does: Does,
    answers: BTreeMap<String, Given>,
    /// The texts among the answers that a journal will have.
    texts: Vec<String>,
}

/// Everybody who takes part in a sitting.
pub(crate) struct People {
    id: &'static str,
    chance: Stream,
    by_page: bool,
    loss: f64,
    bug: Option<Bug>,
    exchange: Exchange,
    /// The name of the page that is shown, and since when.
    shown: (String, Duration),
    post: BTreeMap<(Duration, u64), Parcel>,
    sent: u64,
    waiting: Vec<Waiting>,
    participant_at: Duration,
    experimenter_at: Duration,
    /// How often the experimenter has acted on a page that may not change.
    tries: u32,
    channel: Channel,
    /// Texts that the page shows as saved, until they are asked for.
    told: Vec<String>,
    /// The last answers that arrived.
    last: Option<Reply>,
    /// When a Stop arrived, until it is asked for.
    stop: Option<Duration>,
}

fn ms(ms: u64) -> Duration {
    Duration::from_millis(ms)
}

impl People {
    /// `left` is what a page sent to the program before and sends to this one, too.
    pub(crate) fn new(
        id: &'static str,
        chance: Stream,
        plan: &Plan,
        bug: Option<Bug>,
        (sitting, left): (u32, Vec<Vec<u8>>),
    ) -> Self {
        let mut people = Self {
            id,
            chance,
            by_page: plan.by_page,
            loss: plan.loss,
            bug,
            exchange: Exchange::new(format!("run{sitting}")),
            shown: (String::new(), Duration::ZERO),
            post: BTreeMap::new(),
            sent: u64::from(sitting) << 32,
            waiting: Vec::new(),
            participant_at: Duration::ZERO,
            experimenter_at: Duration::ZERO,
            tries: 0,
            channel: Channel::Terminal,
            told: Vec::new(),
            last: None,
            stop: None,
        };
        for json in left {
            people.send(ms(700), Parcel::Page(json));
        }
        people
    }

    /// The replies that are not settled.
    pub(crate) fn left(&self) -> Vec<Vec<u8>> {
        self.waiting.iter().map(|w| w.json.clone()).collect()
    }

    /// Texts that were shown as saved on the page since the last call.
    pub(crate) fn told(&mut self) -> Vec<String> {
        std::mem::take(&mut self.told)
    }

    /// When a Stop arrived since the last call.
    pub(crate) fn stop(&mut self) -> Option<Duration> {
        self.stop.take()
    }

    /// [`Bug::HiddenSuspension`].
    pub(crate) fn hide_suspensions(&self) -> bool {
        self.bug == Some(Bug::HiddenSuspension)
    }

    /// How the inputs that were taken last were entered.
    pub(crate) fn channel(&self) -> Channel {
        self.channel
    }

    fn send(&mut self, at: Duration, parcel: Parcel) {
        self.sent += 1;
        self.post.insert((at, self.sent), parcel);
    }

    /// A key of the experimenter.
    pub(crate) fn key(&mut self, at: Duration, input: Input) {
        self.send(at, Parcel::Key(input));
    }

    /// Stop on the page, or by key where there is none.
    pub(crate) fn press_stop(&mut self, at: Duration) {
        match self.by_page {
            true => self.send(at, Parcel::Page(br#"{"does":"stop"}"#.to_vec())),
            false => self.send(at, Parcel::Key(Input::Stop)),
        }
    }

    /// When something arrives or somebody acts next.
    pub(crate) fn next(&self) -> Duration {
        let arrives = self.post.first_key_value().map(|((at, _), _)| *at);
        let acts = self.participant_at.min(self.experimenter_at);
        arrives.map_or(acts, |at| at.min(acts))
    }

    /// Everybody looks at what is shown, and acts if it is time.
    pub(crate) fn look(&mut self, view: &View, now: Duration, ledger: &mut Ledger) {
        if self.by_page {
            self.exchange.show(view);
            let id = self.exchange.page().map(|named| named.id.to_owned());
            if let Some(id) = id.filter(|id| *id != self.shown.0) {
                self.shown = (id, now);
            }
            self.hear(now);
            self.double(view);
        }
        if now >= self.participant_at {
            let pause = [300, 700, 1500, 2500][self.chance.below(4) as usize];
            self.participant_at = now + ms(pause);
            self.participant(view, now, ledger);
        }
        if now >= self.experimenter_at {
            self.experimenter_at = now + ms(600 + self.chance.below(900));
            self.experimenter(view, now, ledger);
        }
    }

    /// The page hears what became of its replies, and sends those again that may be lost.
    fn hear(&mut self, now: Duration) {
        let mut again = Vec::new();
        let (exchange, told) = (&self.exchange, &mut self.told);
        self.waiting.retain_mut(|own| {
            match exchange.outcome(&own.key) {
                Some(Outcome::Saved) => told.append(&mut own.texts),
                Some(Outcome::Stale | Outcome::Refused(_)) => {}
                None => {
                    if now >= own.again_at {
                        own.again_at = now + ms(2000);
                        again.push(own.json.clone());
                    }
                    return true;
                }
            }
            false
        });
        for json in again {
            self.send(now, Parcel::Page(json));
        }
    }

    /// [`Bug::DoubledAnswer`].
    fn double(&mut self, view: &View) {
        let Screen::Form { questions, .. } = &view.screen else {
            return;
        };
        let same = |last: &mut Reply| {
            let asked: BTreeSet<&str> = questions.iter().map(|q| q.id.as_str()).collect();
            last.page != self.shown.0 && last.answers.keys().map(String::as_str).eq(asked)
        };
        if self.bug == Some(Bug::DoubledAnswer)
            && let Some(last) = self.last.take_if(same)
        {
            self.sent += 1;
            self.exchange.arrive(Sent::Reply(Reply {
                page: self.shown.0.clone(),
                key: self.sent.to_string(),
                shown_ms: 1000,
                ..last
            }));
        }
    }

    fn participant(&mut self, view: &View, now: Duration, ledger: &mut Ledger) {
        if !self.by_page {
            let own = page(view);
            let wish = (!is_of_experimenter(&own, view)).then(|| self.wish(&own, view, ledger));
            if let Some(input) = wish.flatten().and_then(|wish| typed(wish, &own, view)) {
                self.type_key(now, input);
            }
            return;
        }
        let Some(own) = self.exchange.page().map(|named| named.page.clone()) else {
            return;
        };
        let Some(wish) = self.wish(&own, view, ledger) else {
            return;
        };
        let shown_ms = now.saturating_sub(self.shown.1).as_millis();
        let taps = 1 + u64::from(self.chance.below(10) == 0);
        for tap in 0..taps {
            // A second tap is a reply of its own.
            self.sent += 1;
            let key = self.sent.to_string();
            let reply = serde_json::json!({
                "page": self.shown.0,
                "key": key,
                "shown_ms": u64::try_from(shown_ms).unwrap() + 80 * tap,
                "does": wish.does,
                "answers": wish.answers,
            });
            let json = reply.to_string().into_bytes();
            self.mail(now + ms(80 * tap), &json);
            self.waiting.push(Waiting {
                key,
                json,
                texts: wish.texts.clone(),
                again_at: now + ms(2000),
            });
        }
    }

    /// Sends by a network that loses, repeats and delays.
    fn mail(&mut self, at: Duration, json: &[u8]) {
        let travels = ms(1 + self.chance.below(40));
        let [lost, late, twice] = [(); 3].map(|()| self.chance.unit() < self.loss);
        if lost {
            return;
        }
        let at = at + travels + if late { ms(3000) } else { Duration::ZERO };
        self.send(at, Parcel::Page(json.to_vec()));
        if twice {
            self.send(at + travels, Parcel::Page(json.to_vec()));
        }
    }

    /// A key may be pressed twice.
    fn type_key(&mut self, at: Duration, input: Input) {
        if self.chance.unit() < self.loss {
            let again = at + ms(20 + self.chance.below(150));
            self.send(again, Parcel::Key(input.clone()));
        }
        self.send(at, Parcel::Key(input));
    }

    fn experimenter(&mut self, view: &View, now: Duration, ledger: &mut Ledger) {
        let own = page(view);
        if !is_of_experimenter(&own, view) {
            self.tries = 0;
            return;
        }
        self.tries += 1;
        let input = match own.kind {
            Kind::Who => match &view.screen {
                Screen::Who { claiming: true, .. } => return,
                _ if self.tries > 3 => Input::Quit,
                _ => Input::Identify {
                    participant: self.id.to_owned(),
                    operator: "lw".to_owned(),
                },
            },
            Kind::Resume => {
                let restart = own.offers(Does::RestartBlock) && self.chance.below(4) == 0;
                Input::Resume(match restart {
                    true => Choice::RestartBlock,
                    false => Choice::Continue,
                })
            }
            Kind::SaveTrouble if self.tries > 3 => Input::Quit,
            Kind::SaveTrouble => Input::RetrySave,
            _ if self.tries > PATIENCE => Input::Quit,
            _ => {
                let wish = self.wish(&own, view, ledger);
                match wish.and_then(|wish| typed(wish, &own, view)) {
                    Some(input) => input,
                    None => return,
                }
            }
        };
        self.type_key(now, input);
    }

    /// What somebody wants on a page who wants to get on.
    fn wish(&mut self, own: &Page, view: &View, ledger: &mut Ledger) -> Option<Wish> {
        let mut wish = Wish {
            does: Does::Advance,
            answers: BTreeMap::new(),
            texts: Vec::new(),
        };
        match own.kind {
            Kind::Consent => wish.does = Does::Agree,
            Kind::Stopped => {
                let rates = own.offers(Does::RateStopped) && self.chance.below(2) == 0;
                wish.does = match rates {
                    true => Does::RateStopped,
                    false => Does::PlayAgain,
                };
            }
            Kind::Questions => {
                wish.does = Does::Answer;
                let number = ledger.given.len() + 1;
                let text = format!("answer-{number:05}");
                let rating = 1 + i64::try_from(number % 7).unwrap();
                let mut rated = None;
                for asked in &own.questions {
                    let given = match asked.field {
                        Field::Text => text.clone(),
                        _ => {
                            rated = Some(rating);
                            rating.to_string()
                        }
                    };
                    wish.answers.insert(asked.id.clone(), Given::Typed(given));
                }
                // No journal has initials.
                let initials = matches!(
                    view.screen,
                    Screen::Form {
                        form: FormId::Consent,
                        ..
                    }
                );
                ledger.given.insert(text.clone(), rated);
                wish.texts.extend((!initials).then_some(text));
            }
            _ => {}
        }
        own.offers(wish.does).then_some(wish)
    }

    /// What has arrived, as inputs.
    pub(crate) fn take(&mut self, view: &View, now: Duration) -> Vec<Input> {
        let mut keys = Vec::new();
        while let Some(next) = self.post.first_entry()
            && next.key().0 <= now
        {
            match next.remove() {
                Parcel::Key(input) => keys.push(input),
                Parcel::Page(json) => self.arrive(&json, now),
            }
        }
        let input = match self.by_page {
            true => self.exchange.input(view),
            false => None,
        };
        if let Some(input) = input {
            // The terminal is asked next.
            for key in keys {
                self.send(now, Parcel::Key(key));
            }
            self.channel = Channel::Page;
            return vec![input];
        }
        self.channel = Channel::Terminal;
        if keys.contains(&Input::Stop) {
            self.stop = self.stop.or(Some(now));
        }
        keys
    }

    /// Something arrives from the page.
    fn arrive(&mut self, json: &[u8], now: Duration) {
        let mut sent = Sent::read(json).unwrap();
        if let (Some(Bug::OtherRating), Sent::Reply(reply)) = (self.bug, &mut sent) {
            change_ratings(reply);
        }
        match &sent {
            Sent::Stop => {
                self.stop = self.stop.or(Some(now));
                if self.bug == Some(Bug::LostStop) {
                    return;
                }
            }
            Sent::Reply(reply) => {
                if reply.does == Does::Answer {
                    self.last = Some(reply.clone());
                }
                if self.bug == Some(Bug::EarlySaved) {
                    let own = self.waiting.iter().find(|own| own.key == reply.key);
                    let texts = own.map(|own| own.texts.clone());
                    self.told.extend(texts.unwrap_or_default());
                }
            }
        }
        // It is sent again if too many wait.
        self.exchange.arrive(sent);
    }
}

/// [`Bug::OtherRating`]: the next one of the seven.
fn change_ratings(reply: &mut Reply) {
    for given in reply.answers.values_mut() {
        if let Given::Typed(text) = given
            && let Ok(rating) = text.parse::<i64>()
        {
            *text = (rating % 7 + 1).to_string();
        }
    }
}

/// Whether the experimenter has to do something.
fn is_of_experimenter(own: &Page, view: &View) -> bool {
    let faults = matches!(
        own.kind,
        Kind::DeviceTrouble | Kind::SaveTrouble | Kind::Paused | Kind::End
    );
    faults || own.is_of_experimenter(view)
}

/// The input of a wish at the terminal.
fn typed(wish: Wish, own: &Page, view: &View) -> Option<Input> {
    let reply = Reply {
        page: String::new(),
        key: String::new(),
        shown_ms: 0,
        does: wish.does,
        answers: wish.answers,
        reason: String::new(),
    };
    reply::input(&reply, own, view).ok()
}
