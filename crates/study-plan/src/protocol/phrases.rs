//! The fixed sentences that a participant reads, in several languages.
//!
//! English is in this file, the others are in `phrases/*.toml` under the same keys. A
//! protocol chooses a language by `[text] lang` and may replace single sentences by key
//! in `[text.words]`. What only the experimenter reads is English, but for the desk beside a page of the
//! participant's own, whose sentences the program has.

use super::ScaleDirection;
use std::collections::BTreeMap;

/// Declares the sentences: variant, key, English.
macro_rules! phrases {
    ($($variant:ident $key:literal $english:literal;)*) => {
        /// A fixed sentence. Its documentation is its English text.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
        pub enum Phrase {
            $(#[doc = $english] $variant,)*
        }

        impl Phrase {
            /// All sentences.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The key in a protocol and in the files of the languages.
            pub fn key(self) -> &'static str {
                match self { $(Self::$variant => $key,)* }
            }

            /// The sentence in English. Words in braces are replaced.
            pub fn english(self) -> &'static str {
                match self { $(Self::$variant => $english,)* }
            }
        }
    };
}

phrases! {
    Continue "continue" "continue";
    Ready "ready" "when ready";
    ReadOn "read-on" "read on";
    Scroll "scroll" "scroll";
    Close "close" "close";
    Save "save" "save";
    Next "next" "next";
    Comment "comment" "comment";
    Back "back" "back";
    Choose "choose" "choose";
    Move "move" "move";
    Mark "mark" "mark";
    NewLine "new-line" "new line";
    Optional "optional" "optional";
    DeclineTitle "decline-title" "Decline this question";
    DeclineWhy "decline-why" "Why is the question declined? The reason is stored.";
    Decline "decline" "decline";
    Stop "stop" "stop";
    Rate "rate" "rate";
    Mounted "mounted" "mounted";
    Begin "begin" "begin";
    OtherField "other-field" "other field";
    TryAgain "try-again" "try again";
    Quit "quit" "quit";
    Help "help" "help";
    Yes "yes" "yes";
    Sure "sure" "Are you sure?";
    AgreeQuestion "agree-question" "Do you agree to take part?";
    Agree "agree" "yes, I agree";
    Refuse "refuse" "no";
    Version "version" "{document}, version {version}";
    RefuseSure "refuse-sure" "You do not agree to take part? The session then ends, and nothing more is asked.";
    RefuseConfirm "refuse-confirm" "I do not agree";
    Initials "initials" "Please type your initials in place of a signature.";
    ChooseYesOrNo "choose-yes-or-no" "Choose y or n.";
    AtLeisure "at-leisure" "Take as long as you like.";
    WaitSecond "wait-second" "You can continue in 1 second.";
    WaitSeconds "wait-seconds" "You can continue in {seconds} seconds.";
    WaitClock "wait-clock" "You can continue in {time}.";
    OneMoment "one-moment" "One moment.";
    Preparing "preparing" "Preparing the device.";
    FeelDevice "feel-device" "Feel the device.";
    FeelSample "feel-sample" "Feel the sample.";
    Playing "playing" "playing";
    Exploring "exploring" "exploring";
    KeepExploring "keep-exploring" "Keep exploring, from end to end.";
    Stopping "stopping" "Stopping.";
    StoppedDevice "stopped-device" "The device is stopped.";
    StoppedSample "stopped-sample" "Stopped.";
    NoForce "no-force" "It produces no force. This trial is not lost.";
    LetGo "let-go" "Let go of the sample. This trial is not lost.";
    PlayAgain "play-again" "play it again";
    FeelAgain "feel-again" "feel it again";
    RateFelt "rate-felt" "rate what you felt";
    Saving "saving" "Saving …";
    Break "break" "Break";
    BreakText "break-text" "Time for a break.";
    Paused "paused" "Paused";
    PausedFor "paused-for" "for {time}.";
    PausedNoForce "paused-no-force" "for {time}. The device produces no force.";
    Complete "complete" "That was all. Thank you.";
    NoMore "no-more" "Nothing more is asked. Thank you.";
    ReferenceText "reference" "Ready for the next one?";
    Practice "practice" "Practice";
    TrialOf "trial-of" "trial {n} of {total}";
    PracticeOf "practice-of" "practice {n} of {total}";
    TrialNumber "trial-number" "trial {n}";
    PracticeNumber "practice-number" "practice {n}";
    First "first" "first";
    Second "second" "second";
    Third "third" "third";
    NumberedInterval "numbered-interval" "number {n}";
    ReferenceInterval "reference-interval" "reference";
    ToRate "to-rate" "rate this one";
    Tie "tie" "no difference";
    Same "same" "the same";
    Different "different" "different";
    Answer "answer" "answer";
    Correct "correct" "That was correct.";
    NotCorrect "not-correct" "That was not correct.";
    ItWas "it-was" "It was: {label}";
    PageOf "page-of" "page {n} of {total}";
    NumberFirst "number-first" "Choose a number from {from} to {to} first.";
    SliderFirst "slider-first" "Choose a number from {from} to {to} first.";
    OptionFirst "option-first" "Choose from the list first.";
    TypeNumberFirst "type-number-first" "Type a number first.";
    TypeAnswerFirst "type-answer-first" "Type an answer first.";
    NumberLike "number-like" "Type a number, such as 12.5.";
    OffScale "off-scale" "The scale goes from {from} to {to}.";
    RankTaken "rank-taken" "{rank} is given already. Choose another rank, or go back and change the earlier one.";
    Range "range" "Type a number from {from} to {to}.";
    RangeFrom "range-from" "Type a number from {from} up.";
    RangeTo "range-to" "Type a number up to {to}.";
    RangeAbove "range-above" "Type a number above {above}.";
    PlainRange "plain-range" "Type a number from {from} to {to}, then press Enter.";
    PlainNumber "plain-number" "Type a number, then press Enter.";
    PlainOption "plain-option" "Type the number of one of them, then press Enter.";
    PlainOptions "plain-options" "Type the numbers of all that apply, such as 1 2, then press Enter.";
    PlainText "plain-text" "Type your answer, then press Enter.";
    PlainOptional "plain-optional" "Enter alone leaves it empty.";
    PlainLabel "plain-label" "{value} means: {label}";
    PlainNeeded "plain-needed" "An answer is needed.";
    PlainNoAnswer "plain-no-answer" "That is not an answer here.";
    PlainContinue "plain-continue" "Press Enter to continue.";
    PlainReady "plain-ready" "Press Enter when ready.";
    PlainClose "plain-close" "Press Enter to close.";
    PlainPlays "plain-plays" "The device plays. Feel the device.";
    PlainRate "plain-rate" "Press Enter to go on. Esc or Space stops.";
    PlainEnterAlone "plain-enter-alone" "Enter alone";
    PlainType "plain-type" "Type {key}";
    Saved "saved" "Saved.";
    PracticeEnd "practice-end" "The practice is over. From now on, every answer counts.";
    TimeLeft "time-left" "{time} left";
    DoneOf "done-of" "{n} of {total} done";
    Attend "attend" "Please attend to what is played.";
    Longer "longer" "A little longer, please.";
    NotLost "not-lost" "This trial is not lost.";
    RateIt "rate-it" "rate it";
    SelectFirst "select-first" "Select an entry first, with ↑ and ↓.";
    ListHas "list-has" "The list has {total} entries.";
    PlainKept "plain-kept" "Your answer so far: {answer}. Enter alone keeps it.";
    PlainHelp "plain-help" "Type /help at any time for the list of commands.";
    PlainSaved "plain-saved" "Trials saved: {n}.";
    PlainSavedBoth "plain-saved-both" "Trials saved in both places: {n}.";
    PlainYesNo "plain-yes-no" "Type y or n.";
    PlainNotAsked "plain-not-asked" "Nothing is asked here. Type /help for what can be typed.";
    PlainNoCommand "plain-no-command" "{command} is no command. Type /help for a list. An answer that begins with a slash needs two.";
    PlainLeave "plain-leave" "Leave the session? It can be resumed later.";
    PlainUnpause "plain-unpause" "Press Enter to continue, or type /quit.";
    PlainNoReplay "plain-no-replay" "This cannot be presented again now. A trial can be, before its first answer, as often as the study allows.";
    NeverReplay "never-replay" "In this study nothing is presented again on request.";
    PlainNoBack "plain-no-back" "There is no question before this one.";
    CommandStop "command-stop" "stops the device at once";
    CommandRemark "command-remark" "keeps a remark of the experimenter";
    CommandSays "command-says" "keeps a remark of the participant";
    CommandCorrect "command-correct" "changes an earlier answer, with a reason";
    CommandDecline "command-decline" "declines the question";
    CommandBad "command-bad" "marks the trial as bad; it is repeated";
    CommandPause "command-pause" "pauses";
    CommandAgain "command-again" "says the page again";
    CommandReplay "command-replay" "presents the trial again, where that is possible";
    CommandBack "command-back" "goes back to the question before";
    CommandQuit "command-quit" "leaves; the session can be resumed";
    SavedCount "saved-count" "saved {mark} {n} of {total}";
    SavingCount "saving-count" "saving … {n} of {total}";
    Pilot "pilot" "PILOT — not analyzed with real data";
    Simulated "simulated" "SIMULATED — not analyzed with real data";
    Declined "declined" "declined";
    Empty "empty" "empty";
    PlainOneLine "plain-one-line" "Type {command} and your text in one line.";
    PlainNoQuestion "plain-no-question" "There is no question here.";
    TextCut "text-cut" "The text is too long: at most {kib} KiB are stored, the rest was removed.";
    PageLost "page-lost" "The connection is lost. Trying again …";
    PageClosed "page-closed" "This page is closed. Please tell the experimenter.";
    PageMedia "page-media" "Pictures and sounds are being loaded.";
    PageTap "page-tap" "Tap the page once, so that sounds can be played.";
    PageMoving "page-moving" "Videos are played in this study, also where less motion is asked for.";
    OnceMore "once-more" "The pause was long: once more, please.";
    CorrectTitle "correct-title" "Correct an answer";
    CorrectIt "correct-it" "correct";
    Select "select" "select";
    Author "author" "author";
    By "by" "By";
    Experimenter "experimenter" "experimenter";
    Participant "participant" "participant";
    NewAnswer "new-answer" "The new answer:";
    BothKept "both-kept" "Why? Both answers are kept.";
    Slip "slip" "a slip of the key";
    AlreadyAnswer "already-answer" "That is already the answer.";
    NewAnswerFirst "new-answer-first" "Enter the new answer first, or press Esc.";
    ReasonFirst "reason-first" "Type a reason first, or press Esc.";
    FinishFirst "finish-first" "Finish this first, or press Esc.";
    NothingToCorrect "nothing-to-correct" "There is no earlier answer to correct.";
    WhichCorrect "which-correct" "Type the number of the answer to correct. Enter alone: none.";
    WhichOfList "which-of-list" "Type a number of the list.";
    PlainWhy "plain-why" "Type the reason, then press Enter.";
    PlainDeclineIt "plain-decline-it" "Type /decline to decline it.";
    NothingCorrected "nothing-corrected" "Nothing is corrected.";
    FormSetup "form-setup" "set-up";
    FormIntake "form-intake" "intake";
    FormOutro "form-outro" "closing questions";
    Debriefing "debriefing" "About this study";
    Remark "remark" "remark";
}

impl Phrase {
    /// What is shown for one of the answers that parts have of their own.
    pub fn of_answer(word: &str) -> Option<Self> {
        Some(match word {
            "first" => Self::First,
            "second" => Self::Second,
            "third" => Self::Third,
            "tie" => Self::Tie,
            "same" => Self::Same,
            "different" => Self::Different,
            "yes" => Self::Yes,
            "no" => Self::Refuse,
            _ => return None,
        })
    }
}

/// The shipped languages besides English: BCP 47 tag and file.
const SHIPPED: [(&str, &str); 6] = [
    ("de", include_str!("phrases/de.toml")),
    ("fr", include_str!("phrases/fr.toml")),
    ("es", include_str!("phrases/es.toml")),
    ("ja", include_str!("phrases/ja.toml")),
    ("zh-Hans", include_str!("phrases/zh-Hans.toml")),
    ("ar", include_str!("phrases/ar.toml")),
];

/// The sentences of a study.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Words {
    /// What is not English.
    other: BTreeMap<&'static str, String>,
    scales_from_right: bool,
}

impl Words {
    /// The sentences in a language, with a study's own ones by key. A tag that is not
    /// shipped gives English.
    pub fn new(lang: Option<&str>, own: &BTreeMap<String, String>) -> Self {
        let shipped = lang.and_then(shipped).unwrap_or_default();
        let mut other = BTreeMap::new();
        for phrase in Phrase::ALL {
            let key = phrase.key();
            if let Some(text) = own.get(key).or_else(|| shipped.get(key)) {
                other.insert(key, text.clone());
            }
        }
        Self {
            other,
            scales_from_right: lang.is_some_and(is_right_to_left),
        }
    }

    /// The same, with scales in this direction.
    #[must_use]
    pub fn with_scales(mut self, direction: ScaleDirection) -> Self {
        self.scales_from_right = direction == ScaleDirection::RightToLeft;
        self
    }

    /// Whether the smallest number of a scale is on its right.
    pub fn scales_from_right(&self) -> bool {
        self.scales_from_right
    }

    /// A sentence.
    pub fn get(&self, phrase: Phrase) -> &str {
        match self.other.get(phrase.key()) {
            Some(text) => text,
            None => phrase.english(),
        }
    }

    /// A sentence with its words in braces replaced.
    pub fn fill(&self, phrase: Phrase, values: &[(&str, &dyn std::fmt::Display)]) -> String {
        let text = self.get(phrase).to_owned();
        let put = |text: String, (name, value): &(&str, &dyn std::fmt::Display)| {
            text.replace(&format!("{{{name}}}"), &value.to_string())
        };
        values.iter().fold(text, put)
    }

    /// How long must be waited, in words.
    ///
    /// ```
    /// # use study_plan::protocol::phrases::Words;
    /// # use std::collections::BTreeMap;
    /// assert!(Words::new(None, &BTreeMap::new()).wait(125.0).contains("2:05"));
    /// ```
    pub fn wait(&self, seconds: f64) -> String {
        match seconds.ceil() {
            whole if whole <= 1.0 => self.get(Phrase::WaitSecond).to_owned(),
            whole if whole < 100.0 => self.fill(Phrase::WaitSeconds, &[("seconds", &whole)]),
            whole => {
                let (minutes, rest) = ((whole / 60.0).floor(), whole % 60.0);
                let time = format!("{minutes}:{rest:02}");
                self.fill(Phrase::WaitClock, &[("time", &time)])
            }
        }
    }
}

/// Whether the fixed sentences exist in a language. Regions do not matter: `de-CH` is
/// `de`; `zh` and its regions without a script are not, since they may be read in
/// traditional characters.
///
/// ```
/// # use study_plan::protocol::phrases::is_shipped;
/// assert!(is_shipped("de-CH") && !is_shipped("tlh"));
/// ```
pub fn is_shipped(lang: &str) -> bool {
    primary(lang) == "en" || shipped(lang).is_some()
}

/// The tags of the shipped languages.
pub fn languages() -> impl Iterator<Item = &'static str> {
    std::iter::once("en").chain(SHIPPED.iter().map(|(tag, _)| *tag))
}

/// Whether a language is written from right to left.
pub fn is_right_to_left(lang: &str) -> bool {
    ["ar", "fa", "he", "ur"].contains(&primary(lang).as_str())
}

/// The placeholders of a sentence, such as `{n}`, in alphabetical order.
pub fn placeholders(text: &str) -> Vec<&str> {
    let mut names: Vec<&str> = text
        .split('{')
        .skip(1)
        .filter_map(|part| Some(part.split_once('}')?.0))
        .collect();
    names.sort_unstable();
    names
}

fn primary(lang: &str) -> String {
    let first = lang.split('-').next().unwrap_or_default();
    first.to_ascii_lowercase()
}

fn shipped(lang: &str) -> Option<BTreeMap<String, String>> {
    let lower = lang.to_ascii_lowercase();
    let known = |tag: &str| {
        let tag = tag.to_ascii_lowercase();
        lower == tag || lower.starts_with(&format!("{tag}-"))
    };
    let simplified = ["zh-cn", "zh-sg"].contains(&lower.as_str());
    let (_, text) = SHIPPED
        .iter()
        .find(|(tag, _)| known(tag) || (simplified && *tag == "zh-Hans"))?;
    Some(text.lines().filter_map(entry).collect())
}

/// A line of a file of sentences: `key = "text"`, without escapes.
fn entry(line: &str) -> Option<(String, String)> {
    let (key, text) = line.split_once(" = ")?;
    let text = text.strip_prefix('"')?.strip_suffix('"')?;
    Some((key.to_owned(), text.to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::Method;
    use crate::protocol::keys::Words as _;

    #[test]
    fn every_language_has_every_sentence_with_the_same_placeholders() {
        for tag in languages().filter(|tag| *tag != "en") {
            let mut texts = shipped(tag).unwrap_or_else(|| panic!("{tag} is not readable"));
            for phrase in Phrase::ALL {
                let key = phrase.key();
                let text = texts.remove(key).unwrap_or_else(|| panic!("{tag}: {key}"));
                assert!(!text.trim().is_empty(), "{tag}: {key}");
                let (own, english) = (placeholders(&text), placeholders(phrase.english()));
                assert_eq!(own, english, "{tag}: {key}");
                assert!(!text.chars().any(char::is_control), "{tag}: {key}");
            }
            assert!(texts.is_empty(), "{tag} has unknown keys: {texts:?}");
            let (_, file) = SHIPPED.iter().find(|(t, _)| *t == tag).unwrap();
            assert_eq!(file.lines().count(), Phrase::ALL.len(), "{tag}");
            assert!(!file.contains('\\'), "{tag} has an escape");
        }
    }

    #[test]
    fn the_answers_of_a_trial_differ_in_every_language() {
        for tag in languages() {
            let words = Words::new(Some(tag), &BTreeMap::new());
            let ways = Method::VALUES.iter().map(|(_, method)| method.answers());
            for answers in ways.chain([&["first", "second", "tie"][..]]) {
                let shown = answers
                    .iter()
                    .map(|a| words.get(Phrase::of_answer(a).unwrap()));
                let mut shown: Vec<&str> = shown.collect();
                shown.sort_unstable();
                shown.dedup();
                assert_eq!(shown.len(), answers.len(), "{tag}: {shown:?}");
            }
        }
    }

    #[test]
    fn keys_are_unique() {
        let mut keys: Vec<&str> = Phrase::ALL.iter().map(|p| p.key()).collect();
        let count = keys.len();
        keys.sort_unstable();
        keys.dedup();
        assert_eq!(keys.len(), count);
    }

    #[test]
    fn a_study_replaces_single_sentences() {
        let own = BTreeMap::from([("rate".to_owned(), "weiter".to_owned())]);
        let words = Words::new(Some("de-CH"), &own);
        assert_eq!(words.get(Phrase::Rate), "weiter");
        assert_eq!(words.get(Phrase::Yes), "ja");
        let english = Words::new(Some("nl"), &BTreeMap::new());
        assert_eq!(english, Words::default());
        assert_eq!(english.get(Phrase::Yes), "yes");
    }

    #[test]
    fn tags_find_their_language() {
        for tag in [
            "en",
            "en-GB",
            "DE",
            "fr-CA",
            "zh-Hans",
            "zh-Hans-SG",
            "zh-CN",
            "ar-EG",
        ] {
            assert!(is_shipped(tag), "{tag}");
        }
        for tag in ["nl", "zh-Hant", "zh-TW", "zh", "", "den"] {
            assert!(!is_shipped(tag), "{tag}");
        }
        assert!(is_right_to_left("ar-EG") && !is_right_to_left("de"));
    }

    #[test]
    fn waits_are_said_in_seconds_and_then_in_minutes() {
        let words = Words::default();
        assert_eq!(words.wait(0.2), "You can continue in 1 second.");
        assert_eq!(words.wait(59.5), "You can continue in 60 seconds.");
        assert_eq!(words.wait(125.0), "You can continue in 2:05.");
    }
}
