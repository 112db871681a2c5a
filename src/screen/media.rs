//! The media of the participant's page: their files under names that tell nothing, and what the page says of them.
//!
//! The page loads every file before the first trial. A name is made of the content and of a secret of this run, so that
//! realizations that look or sound the same have the same one. The page tells when it showed and played what by the clock
//! of this program, to which it relates its own by the times of a request and its answer, as NTP does.

use super::{ScreenError, access};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use study_base::hex::sha256;
use study_plan::protocol::{MediaFormat, Medium, Protocol};
use study_session::session::Input;
use study_session::session::cue::{Loss, MediaReport, Shown, Shows};

/// Digits of a name: 128 bits.
const NAME: usize = 32;
/// Longest name that a tab of the browser gives itself, bytes.
const MOST_TAB: usize = 64;
/// Reports that wait for the session.
const WAITING: usize = 64;
/// The page speaks four times as often; after this time it is silent.
const SILENT: Duration = Duration::from_secs(2);

/// The media of a study for one run of the page.
#[derive(Debug, Default)]
pub struct Gallery {
    shows: Arc<Shows>,
    files: BTreeMap<String, File>,
}

#[derive(Debug)]
struct File {
    medium: Medium,
    content_type: &'static str,
    bytes: Arc<[u8]>,
}

impl Gallery {
    /// Those of a protocol with its files: paths in the folder of the protocol, and bytes.
    ///
    /// # Errors
    /// [`ScreenError::Random`].
    pub fn of(protocol: &Protocol, files: &[(String, Vec<u8>)]) -> Result<Self, ScreenError> {
        let secret = access::secret()?;
        let mut shows = Shows::new();
        let mut served = BTreeMap::new();
        for model in protocol.models.iter().filter(|m| !m.media.is_empty()) {
            let mut own = Vec::new();
            for (medium, file) in model.media.files() {
                let hash = file.sha256.as_deref().unwrap_or_default();
                let mut id = sha256(format!("{secret} {hash}"));
                id.truncate(NAME);
                let bytes = files.iter().find(|(name, _)| *name == file.file);
                if let Some((_, bytes)) = bytes
                    && let Some(format) = MediaFormat::of(bytes)
                {
                    served.entry(id.clone()).or_insert_with(|| File {
                        medium,
                        content_type: format.content_type(),
                        bytes: bytes.as_slice().into(),
                    });
                }
                let seen = medium != Medium::Sound;
                let heard = medium != Medium::Picture;
                own.push(Shown {
                    medium,
                    id,
                    alt: model.media.alt.clone().filter(|_| seen),
                    caption: model.media.caption.clone().filter(|_| heard),
                });
            }
            shows.insert(model.id.clone(), own);
        }
        Ok(Self {
            shows: Arc::new(shows),
            files: served,
        })
    }
}

/// What the page is told of a file.
#[derive(Debug, Serialize)]
struct Listed<'a> {
    id: &'a str,
    medium: Medium,
}

/// The page is there: a sign of life, and a round trip for the clocks.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Here {
    tab: String,
    /// Whether this is the tab's first one: it then presents the media from now on.
    first: bool,
    state: State,
}

/// What keeps the page from showing and playing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum State {
    /// Nothing.
    Ready,
    /// It has not loaded everything, or does not know the clock.
    Loading,
    /// The browser plays no sound before the page was touched.
    Locked,
    /// It is out of sight.
    Hidden,
    /// The browser cannot read a file.
    Broken,
}

/// When a request had arrived and its answer left, ms, by the clock of this program.
#[derive(Debug, Serialize)]
struct Times {
    arrived_ms: f64,
    left_ms: f64,
}

/// What the page says of a presentation.
#[derive(Debug, Deserialize)]
#[serde(tag = "says", rename_all = "kebab-case", deny_unknown_fields)]
enum Told {
    Onset {
        tab: String,
        cue: u64,
        medium: Medium,
        /// By the clock of this program.
        at_ms: f64,
        uncertainty_ms: f64,
    },
    Lost {
        tab: String,
        cue: u64,
        why: Why,
    },
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Why {
    Hidden,
    Asleep,
    NotPlayed,
}

impl Why {
    fn loss(self) -> Loss {
        match self {
            Self::Hidden => Loss::Hidden,
            Self::Asleep => Loss::Asleep,
            Self::NotPlayed => Loss::NotPlayed,
        }
    }
}

/// What was heard of the page.
#[derive(Debug, Default)]
struct Heard {
    /// The tab that presents the media: the one that was opened last.
    tab: Option<String>,
    /// What it said last, and when.
    state: Option<(State, Instant)>,
    /// What the session has not been told.
    news: Vec<News>,
}

#[derive(Debug)]
enum News {
    Here { ready: bool },
    Onset(u64, Medium, f64, f64),
    Lost(u64, Loss),
}

/// Media and what is heard of them.
#[derive(Debug)]
pub(super) struct Stage {
    gallery: Gallery,
    begun: Instant,
    heard: Mutex<Heard>,
}

impl Stage {
    pub(super) fn new(gallery: Gallery) -> Self {
        Self {
            gallery,
            begun: Instant::now(),
            heard: Mutex::default(),
        }
    }

    /// Whether the study has media.
    pub(super) fn is_needed(&self) -> bool {
        !self.gallery.shows.is_empty()
    }

    /// What the session has to know of them.
    pub(super) fn shows(&self) -> Option<Arc<Shows>> {
        self.is_needed().then(|| self.gallery.shows.clone())
    }

    fn heard(&self) -> MutexGuard<'_, Heard> {
        // Whole between any two statements that change it.
        self.heard.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn ms(&self, at: Instant) -> f64 {
        at.saturating_duration_since(self.begun).as_secs_f64() * 1e3
    }

    /// All files as JSON, in an order that depends on nothing but their names.
    pub(super) fn list(&self) -> String {
        let all = self.gallery.files.iter();
        let listed = all.map(|(id, file)| Listed {
            id,
            medium: file.medium,
        });
        let listed: Vec<Listed<'_>> = listed.collect();
        serde_json::to_string(&listed).unwrap_or_default()
    }

    /// The file with a name: its media type and content.
    pub(super) fn file(&self, id: &str) -> Option<(&'static str, Arc<[u8]>)> {
        let file = self.gallery.files.get(id)?;
        Some((file.content_type, file.bytes.clone()))
    }

    /// A sign of life, which arrived then: the answer.
    ///
    /// # Errors
    /// The status with which it is refused.
    pub(super) fn here(&self, body: &[u8], arrived: Instant) -> Result<String, u16> {
        let here: Here = serde_json::from_slice(body).map_err(|_| 400_u16)?;
        if here.tab.is_empty() || here.tab.len() > MOST_TAB {
            return Err(400);
        }
        let mut heard = self.heard();
        if here.first {
            heard.tab = Some(here.tab.clone());
        }
        if heard.tab.as_ref() != Some(&here.tab) {
            return Err(409);
        }
        heard.state = Some((here.state, arrived));
        let ready = here.state == State::Ready;
        // The last one counts.
        heard.news.retain(|news| !matches!(news, News::Here { .. }));
        heard.tell(News::Here { ready });
        drop(heard);
        let times = Times {
            arrived_ms: self.ms(arrived),
            left_ms: self.ms(Instant::now()),
        };
        serde_json::to_string(&times).map_err(|_| 400)
    }

    /// What the page says of a presentation.
    ///
    /// # Errors
    /// The status with which it is refused.
    pub(super) fn told(&self, body: &[u8]) -> Result<(), u16> {
        let told: Told = serde_json::from_slice(body).map_err(|_| 400_u16)?;
        let (tab, news) = match told {
            Told::Onset {
                tab,
                cue,
                medium,
                at_ms,
                uncertainty_ms,
            } => (tab, News::Onset(cue, medium, at_ms, uncertainty_ms)),
            Told::Lost { tab, cue, why } => (tab, News::Lost(cue, why.loss())),
        };
        let mut heard = self.heard();
        if heard.tab.as_ref() != Some(&tab) {
            return Err(409);
        }
        match heard.tell(news) {
            true => Ok(()),
            false => Err(503),
        }
    }

    /// What the session has to be told.
    pub(super) fn inputs(&self) -> Vec<Input> {
        let news = std::mem::take(&mut self.heard().news);
        let now_ms = self.ms(Instant::now());
        let report = |news| match news {
            News::Here { ready } => MediaReport::Here { ready },
            News::Onset(cue, medium, at_ms, uncertainty_ms) => MediaReport::Onset {
                cue,
                medium,
                ago_s: (now_ms - at_ms) * 1e-3,
                uncertainty_s: uncertainty_ms * 1e-3,
            },
            News::Lost(cue, why) => MediaReport::Lost { cue, why },
        };
        news.into_iter().map(report).map(Input::Media).collect()
    }

    /// What the experimenter has to know.
    pub(super) fn notice(&self) -> Option<String> {
        let heard = self.heard();
        let (state, at) = heard.state?;
        if at.elapsed() > SILENT {
            return Some("the participant's page gives no sign of life".to_owned());
        }
        let what = match state {
            State::Ready => return None,
            State::Loading => "the participant's page is loading its pictures and sounds",
            State::Locked => {
                "the participant's page has to be touched once, so that sounds can be played"
            }
            State::Hidden => "the participant's page is out of sight",
            State::Broken => "the participant's browser cannot show or play a file of this study",
        };
        Some(what.to_owned())
    }
}

impl Heard {
    /// Keeps news for the session; false if too much waits.
    fn tell(&mut self, news: News) -> bool {
        let room = self.news.len() < WAITING;
        if room {
            self.news.push(news);
        }
        room
    }
}

#[cfg(test)]
mod tests;
