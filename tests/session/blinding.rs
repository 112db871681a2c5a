//! Every realization of both protocols, anchors included, is played in the same place with
//! the same hand: no page, notice or duration of a page tells them apart, for participant
//! and experimenter.

use crate::memory::MemoryDisk;
use crate::support::{keyboard_of_bundles, repository};
use crate::views::{drawn, picture};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;
use study::runner::clock::{Clock, VirtualClock};
use study::runner::rehearsal::first_day;
use study::runner::saver::Saving;
use study::runner::{Runner, Setup};
use study::tui::{ColorDepth, Surface};
use study_analysis::load::{Loaded, load};
use study_base::limits::Limits;
use study_base::text::ModelId;
use study_device::faults::{FaultPlan, InjectedFault};
use study_device::link::memory::Pace;
use study_device::virtual_device::{Options, VirtualDevice};
use study_device::{Device, DeviceError, Identity, Report, Stimulus};
use study_plan::protocol::{
    Answer, Control, Entry, FileOrders, Order, Protocol, QuestionKind, Role, kinds,
};
use study_session::session::{Config, Input, Screen, View};
use study_session::store::{Frozen, SeatKind, StudyFolder};

/// Time between two looks at the screen.
pub(crate) const LOOK: Duration = Duration::from_millis(20);
/// How long the hand explores, s.
const EXPLORES_S: f64 = 3.0;

/// What the participant does at a page.
pub(crate) fn inputs(view: &View) -> Vec<Input> {
    match &view.screen {
        Screen::Consent { .. } => vec![Input::Consent(true)],
        Screen::Message { .. } => vec![Input::Advance],
        Screen::Reference { wait_s, .. } if *wait_s <= 0.0 => vec![Input::Advance],
        Screen::Playing { since_s, .. } if *since_s > EXPLORES_S && view.can_advance => {
            vec![Input::Advance]
        }
        Screen::DeviceTrouble {
            can_go_on: true, ..
        } if view.line.elapsed_s > 8.0 => vec![Input::Advance],
        Screen::Form { questions, .. } => {
            let answer = |kind: &QuestionKind| match kind.control() {
                Control::Boxes { from, .. } => Answer::Rating(from),
                Control::Track { from, .. } => Answer::Number(from),
                Control::Digits { min, .. } => Answer::Number(min.unwrap_or(1.0)),
                Control::List { options, .. } => Answer::Choice(vec![options[0].clone()]),
                Control::Text => Answer::Text("something".to_owned()),
            };
            let given = questions.iter().map(|q| (q.id.clone(), answer(&q.kind)));
            vec![Input::Answer(given.collect())]
        }
        _ => Vec::new(),
    }
}

/// The simulated device on which a session is played, with its own faults or another one.
pub(crate) fn device(options: Options) -> Box<dyn Device> {
    Box::new(VirtualDevice::new(options))
}

/// A session of P01 on a simulated device and a virtual clock.
pub(crate) fn session(
    loaded: Loaded,
    orders: Option<FileOrders>,
    fault: Option<InjectedFault>,
    device: fn(Options) -> Box<dyn Device>,
) -> (Runner, VirtualClock) {
    session_by(|clock| Box::new(clock), loaded, orders, fault, device)
}

/// The same by a clock that reads the virtual one.
pub(crate) fn session_by(
    reads: fn(VirtualClock) -> Box<dyn Clock>,
    loaded: Loaded,
    orders: Option<FileOrders>,
    fault: Option<InjectedFault>,
    device: fn(Options) -> Box<dyn Device>,
) -> (Runner, VirtualClock) {
    let clock = VirtualClock::starting_at(first_day());
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let disk = Arc::new(MemoryDisk::new());
    let now = clock.now();
    let study = StudyFolder::open_or_create_on(disk, Path::new("results"), &frozen, now).unwrap();
    let mut options = Options::default();
    options.device.telemetry_hz = 50.0;
    options.device.servo_hz = 2000.0;
    if let Some(fault) = fault {
        options.faults = FaultPlan::default().with(1, fault);
    }
    let models = loaded.tables();
    let setup = Setup {
        protocol: Arc::new(loaded.protocol),
        orders: orders.map(Arc::new),
        models,
        fingerprints: loaded.fingerprints,
        study,
        kind: SeatKind::Real,
        rows: None,
        group: None,
        device_kind: study_plan::protocol::DeviceKind::Simulated,
        device: device(options),
        device_check: None,
        self_weighed: None,
        deliveries: Default::default(),
        clock: reads(clock.clone()),
        saving: Saving::Loop,
    };
    let config = Config {
        participant: "P01".to_owned(),
        operator: "lw".to_owned(),
        auto_identify: true,
        ..Config::default()
    };
    (Runner::new(setup, config), clock)
}

/// The pages of a session, one for each look, up to the trial after `first`; without a fault
/// until it is felt, since how long it takes to load may tell what came before it.
fn pages(
    name: &str,
    first: &ModelId,
    entry: Entry,
    change: fn(&mut Protocol),
    fault: Option<InjectedFault>,
    device: fn(Options) -> Box<dyn Device>,
) -> Vec<String> {
    let surface = Surface::new(ColorDepth::None).with_live(true);
    pages_on(surface, name, first, entry, change, fault, device)
}

/// The same on this terminal.
pub(crate) fn pages_on(
    mut surface: Surface,
    name: &str,
    first: &ModelId,
    entry: Entry,
    change: fn(&mut Protocol),
    fault: Option<InjectedFault>,
    device: fn(Options) -> Box<dyn Device>,
) -> Vec<String> {
    let mut loaded = load(Path::new(&repository(name))).unwrap();
    let protocol = &mut loaded.protocol;
    protocol.session.entry = entry;
    protocol.design.practice.clear();
    // The realizations of parts, too, are rated here in the order of the test.
    protocol.parts.clear();
    for model in &mut protocol.models {
        if model.role == Role::Practice {
            model.role = Role::Test;
        }
    }
    protocol.design.repetitions = 1;
    protocol.design.order = Order::File("orders.csv".to_owned());
    change(protocol);
    let mut order: Vec<ModelId> = protocol.models.iter().map(|m| m.id.clone()).collect();
    order.retain(|id| id != first);
    order.insert(0, first.clone());
    let orders = BTreeMap::from([(1, order)]);
    let (mut runner, clock) = session(loaded, Some(orders), fault, device);
    let mut pages = Vec::new();
    let (mut played, mut over) = (false, false);
    for _ in 0..20_000 {
        let view = runner.view();
        // What the participant's own page shows has to be as blind.
        let own = serde_json::to_string(&study_session::page::participant(&view)).unwrap();
        pages.push(picture(&drawn(&mut surface, &view, 80, 24)) + &own);
        match &view.screen {
            Screen::Playing { .. } if over => return pages,
            Screen::Playing { .. } => {
                assert_eq!(runner.felt(), Some(first));
                played = true;
            }
            Screen::DeviceTrouble { .. } => played = true,
            Screen::Reference { .. } if played && fault.is_some() => return pages,
            Screen::Reference { .. } => over = played,
            _ => {}
        }
        if runner.step(inputs(&view)).is_some() {
            return pages;
        }
        clock.advance(LOOK);
    }
    panic!("no second trial:\n{}", pages.last().unwrap())
}

/// Protocols whose realizations are compared. Without optimization all would take minutes, so that they are two;
/// `.ci/run --all` compares all.
pub(crate) const PROTOCOLS: &[&str] = match cfg!(debug_assertions) {
    true => &["protocols/keyboard", "protocols/turn-signal"],
    false => &[
        "protocols/keyboard",
        "protocols/turn-signal",
        "protocols/turn-signal-extended",
        "protocols/turn-signal-passive",
    ],
};

pub(crate) fn realizations(name: &str) -> Vec<ModelId> {
    let loaded = load(Path::new(&repository(name))).unwrap();
    loaded.protocol.models.into_iter().map(|m| m.id).collect()
}

/// Compares the pages of all realizations of a protocol with those of its first.
fn compare(
    entry: Entry,
    change: fn(&mut Protocol),
    fault: Option<InjectedFault>,
    reduce: fn(Vec<String>) -> Vec<String>,
) {
    compare_on(device, entry, change, fault, reduce);
}

/// The same on another device.
fn compare_on(
    device: fn(Options) -> Box<dyn Device>,
    entry: Entry,
    change: fn(&mut Protocol),
    fault: Option<InjectedFault>,
    reduce: fn(Vec<String>) -> Vec<String>,
) {
    for name in PROTOCOLS {
        let all = realizations(name);
        let of = |id: &ModelId| reduce(pages(name, id, entry, change, fault, device));
        let expected = of(&all[0]);
        let seen = match fault {
            Some(_) => "DEVICE TROUBLE",
            None => "Feel the device",
        };
        assert!(expected.iter().any(|page| page.contains(seen)), "{name}");
        for id in &all[1..] {
            let shown = of(id);
            for (n, (one, other)) in expected.iter().zip(&shown).enumerate() {
                assert_eq!(one, other, "{name}: {id} differs at look {n}");
            }
            assert_eq!(expected.len(), shown.len(), "{name}: {id}");
        }
    }
}

pub(crate) fn without_strokes(protocol: &mut Protocol) {
    protocol.trial.minimum_strokes = 0;
}

#[test]
fn pages_and_their_durations_do_not_tell_realizations_apart() {
    for entry in [Entry::Participant, Entry::Experimenter] {
        compare(entry, without_strokes, None, |pages| pages);
    }
}

/// A line of 115,200 baud over an adapter with its latency timer: a load of the finest table takes
/// twice as long as that of the coarsest.
fn on_a_slow_line(mut options: Options) -> Box<dyn Device> {
    options.pace = Pace {
        byte_time: Duration::from_secs(10) / 115_200,
        adapter: Duration::from_millis(4),
    };
    options.device.watchdog_ms = 200;
    device(options)
}

#[test]
fn pages_and_their_durations_are_the_same_on_a_slow_line() {
    compare_on(
        on_a_slow_line,
        Entry::Participant,
        without_strokes,
        None,
        |pages| pages,
    );
}

/// A realization from a bundle is as blind as one from a model file: nothing that identifies it or its
/// bundle is on a page, each page is that of the model file, and all realizations have the same ones.
#[test]
fn bundles_are_as_blind_as_model_files() {
    let folder = tempfile::tempdir().unwrap();
    let addresses = keyboard_of_bundles(folder.path());
    let own = folder.path().to_str().unwrap();
    let of = |name: &str, id: &ModelId| {
        pages(name, id, Entry::Experimenter, without_strokes, None, device)
    };
    let all = realizations(own);
    assert_eq!(all.len(), 8);
    let expected = of("protocols/keyboard", &all[0]);
    for id in &all {
        let shown = of(own, id);
        assert!(shown == expected, "{id}: the pages differ");
    }
    let text = expected.concat();
    for (id, address) in &addresses {
        let hash = address.trim_start_matches("sha256:");
        for secret in [id.as_str(), &hash[..8], "CC-BY", "bundle", "gf"] {
            assert!(!text.contains(secret), "{secret} is on a page");
        }
    }
}

/// The participant's page can play no sound and shake no tablet. (Every session in a terminal
/// that the tests play is watched for the bell, see `Terminal::shown`.)
#[test]
fn the_page_of_the_participant_makes_no_sound() {
    let script = include_str!("../../src/screen/page.js").to_lowercase();
    for sound in ["audio", "oscillator", "vibrate", "speech", "<video"] {
        assert!(!script.contains(sound), "{sound}");
    }
}

/// Where strokes are required, only how long the hand must keep exploring may depend on
/// what it feels.
#[test]
fn required_strokes_show_no_count() {
    let strokes = |protocol: &mut Protocol| protocol.trial.minimum_strokes = 3;
    compare(Entry::Participant, strokes, None, |pages| {
        let mut pages: Vec<String> = pages
            .iter()
            .map(|page| without_numbers_of_time(page))
            .collect();
        pages.dedup();
        assert!(pages.iter().any(|page| page.contains("Keep exploring")));
        pages
    });
}

/// A page without the digits of its times: those before and after a colon, and the large ones.
/// Every other number stays.
fn without_numbers_of_time(page: &str) -> String {
    let is_large = |c: char| ('\u{2580}'..='\u{259f}').contains(&c);
    let lines = page.split('\n').filter(|line| !line.contains(is_large));
    let mut words: Vec<String> = Vec::new();
    for part in lines.collect::<Vec<_>>().join("\n").split(':') {
        let digit = |c: char| c.is_ascii_digit();
        match part.get(..2) {
            Some(seconds) if !words.is_empty() && seconds.chars().all(digit) => {
                let minutes = words.last_mut().unwrap();
                minutes.truncate(minutes.trim_end_matches(digit).len());
                words.push(part[2..].to_owned());
            }
            _ => words.push(part.to_owned()),
        }
    }
    words.join(":")
}

/// The same fault of the device has the same words.
#[test]
fn a_fault_does_not_tell_realizations_apart() {
    for fault in [
        InjectedFault::RefuseLoad,
        InjectedFault::Trip,
        InjectedFault::LosePlayback,
        InjectedFault::Unplug,
    ] {
        compare(Entry::Experimenter, without_strokes, Some(fault), |pages| {
            pages
        });
    }
}

/// Levels of the ladder of the track below.
const LEVELS: [f64; 6] = [0.1, 0.2, 0.4, 0.8, 1.4, 2.0];

/// A folder with a static table, for [`looks_at_a_track`].
fn folder_of_a_track() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let models = folder.path().join("models");
    std::fs::create_dir(&models).unwrap();
    let table = repository("protocols/turn-signal-extended/models/static.toml");
    std::fs::copy(table, models.join("static.toml")).unwrap();
    folder
}

/// The pages of a session with two trials of a track at one level, one for each look, and the
/// order of the intervals. The seed decides which of them has the level; the participant gives the
/// answer number `answer`.
fn looks_at_a_track(
    folder: &Path,
    level: f64,
    seed: u64,
    answer: usize,
    device: fn(Options) -> Box<dyn Device>,
) -> (Vec<String>, String) {
    let template = std::fs::read_to_string(repository("src/cli/new/constant.toml")).unwrap();
    let text = template
        .replace("range = [0.02, 0.6] ", &format!("levels = {LEVELS:?} #"))
        .replace("steps = 30", "")
        .replace("seed = 1 ", &format!("seed = {seed} "))
        .replace(
            "levels = [0.04, 0.08, 0.12, 0.2, 0.4], repetitions = 20",
            &format!("levels = [{level:?}], repetitions = 2"),
        )
        .replace("easy = 0.1", "easy = 0.0");
    std::fs::write(folder.join("protocol.toml"), text).unwrap();
    let loaded = load(folder).unwrap();
    let (mut runner, clock) = session(loaded, None, None, device);
    let mut surface = Surface::new(ColorDepth::None).with_live(true);
    let mut desk = Surface::new(ColorDepth::None).with_desk(crate::desk::at_hand());
    let (mut pages, mut felt) = (Vec::new(), String::new());
    for _ in 0..20_000 {
        let view = runner.view();
        let own = serde_json::to_string(&study_session::page::participant(&view)).unwrap();
        let desk = picture(&drawn(&mut desk, &view, 80, 24));
        pages.push(picture(&drawn(&mut surface, &view, 80, 24)) + &own + &desk);
        if matches!(view.screen, Screen::Playing { .. }) {
            let model = runner.felt().unwrap().as_str();
            felt.push(if model.ends_with("standard") {
                'S'
            } else {
                'C'
            });
        }
        let given = match &view.screen {
            Screen::Form { questions, .. } => {
                let QuestionKind::Choice(kinds::Choice { options, .. }) = &questions[0].kind else {
                    panic!()
                };
                let chosen = Answer::Choice(vec![options[answer].clone()]);
                vec![Input::Answer(vec![(questions[0].id.clone(), chosen)])]
            }
            _ => inputs(&view),
        };
        let over = matches!(view.screen, Screen::End { .. });
        if runner.step(given).is_some() || over {
            // Which interval had the level, each of them once.
            let mut order: Vec<char> = felt.chars().collect();
            order.dedup();
            return (pages, order.into_iter().collect());
        }
        clock.advance(LOOK);
    }
    panic!("no end:\n{}", pages.last().unwrap())
}

/// No level, no order of the intervals and no answer changes what a screen shows or for how long,
/// for participant and experimenter, the desk included: at each look the pages are the same.
#[test]
fn levels_orders_and_answers_leave_nothing_on_a_screen_and_take_the_same_time() {
    let folder = folder_of_a_track();
    let (expected, first) = looks_at_a_track(folder.path(), LEVELS[0], 1, 0, device);
    assert!(expected.iter().any(|page| page.contains("Second")));
    let mut orders = std::collections::BTreeSet::from([first]);
    for (n, level) in LEVELS.iter().enumerate() {
        for (seed, answer) in [(1, 0), (1 + n as u64, 1)] {
            let (shown, order) = looks_at_a_track(folder.path(), *level, seed, answer, device);
            let what = format!("level {level}, {order}, answer {answer}");
            orders.insert(order);
            for (n, (one, other)) in expected.iter().zip(&shown).enumerate() {
                assert_eq!(one, other, "{what}: look {n}");
            }
            assert_eq!(expected.len(), shown.len(), "{what}");
        }
    }
    assert!(orders.len() > 1, "{orders:?}");
}

/// A device whose reports of one kind come later the more friction it renders.
struct Late {
    device: VirtualDevice,
    /// Which reports, and how late they are at 2 N.
    late: fn(&Report) -> Duration,
    /// Friction of the table that is loaded, as a share of 2 N.
    share: f64,
    waiting: Vec<(Duration, Report)>,
}

impl Late {
    fn of(options: Options, late: fn(&Report) -> Duration) -> Box<dyn Device> {
        Box::new(Self {
            device: VirtualDevice::new(options),
            late,
            share: 0.0,
            waiting: Vec::new(),
        })
    }
}

impl Device for Late {
    fn identity(&self) -> Identity {
        self.device.identity()
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        let level = what
            .model
            .rsplit('.')
            .next()
            .and_then(|index| index.parse::<usize>().ok());
        self.share = level.map_or(0.0, |index| LEVELS[index - 1] / 2.0);
        self.device.load(what, limits, at)
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.device.start(at)
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.device.stop(at)
    }

    fn limp(&mut self, at: Duration) {
        self.device.limp(at);
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        for report in self.device.poll(at) {
            let due = at + (self.late)(&report).mul_f64(self.share);
            self.waiting.push((due, report));
        }
        let (due, waiting) = self.waiting.drain(..).partition(|(due, _)| *due <= at);
        self.waiting = waiting;
        let due: Vec<(Duration, Report)> = due;
        due.into_iter().map(|(_, report)| report).collect()
    }
}

/// The comparison above finds a delay of 0.1 s that depends on the level, and a load that takes
/// that much longer does not show.
#[test]
fn a_planted_delay_of_a_level_is_found_and_that_of_a_load_is_hidden() {
    let folder = folder_of_a_track();
    let looks = |device| {
        [LEVELS[0], LEVELS[5]].map(|level| looks_at_a_track(folder.path(), level, 1, 0, device).0)
    };
    for late in [
        |options| Late::of(options, |r| ms_if(matches!(r, Report::Stopped(_)))),
        |options| Late::of(options, |r| ms_if(matches!(r, Report::Started))),
    ] as [fn(Options) -> Box<dyn Device>; 2]
    {
        let [least, most] = looks(late);
        assert_ne!(least, most, "not noticed");
    }
    let [least, most] = looks(|options| Late::of(options, |r| ms_if(matches!(r, Report::Loaded))));
    assert_eq!(least, most, "a load");
}

/// The planted delay, or none.
fn ms_if(late: bool) -> Duration {
    Duration::from_millis(if late { 105 } else { 0 })
}
