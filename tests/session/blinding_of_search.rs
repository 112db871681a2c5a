//! Every pair of a space is played in the same place with the same hand: nothing on a screen, in lines or in the messages of the
//! participant's page tells where in the space the two points lie, for participant and experimenter.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::blinding::{LOOK, inputs, session};
use crate::support::repository;
use crate::views::{drawn, picture};
use std::collections::BTreeSet;
use std::path::Path;
use study::plain::dialogue::Dialogue;
use study::tui::{ColorDepth, Surface};
use study_analysis::load::load;
use study_device::Device;
use study_device::virtual_device::{Options, VirtualDevice};
use study_plan::protocol::{Answer, Entry, QuestionKind, kinds};
use study_session::session::{Input, Screen};

/// Points of the space: 3 × 3.
const POINTS: usize = 9;

fn device(options: Options) -> Box<dyn Device> {
    Box::new(VirtualDevice::new(options))
}

/// A device that says a tenth of a second late that it has stopped, if it has played a point with friction.
struct Late {
    device: VirtualDevice,
    has_friction: bool,
    waiting: Vec<(std::time::Duration, study_device::Report)>,
}

impl Device for Late {
    fn identity(&self) -> study_device::Identity {
        self.device.identity()
    }

    fn load(
        &mut self,
        what: &study_device::Stimulus<'_>,
        limits: study_base::limits::Limits,
        at: std::time::Duration,
    ) -> Result<(), study_device::DeviceError> {
        let number = what.model.rsplit('.').next().and_then(|n| n.parse().ok());
        let point = number.map_or(0, |number: usize| number - 1);
        self.has_friction = !point.is_multiple_of(3);
        self.device.load(what, limits, at)
    }

    fn start(&mut self, at: std::time::Duration) -> Result<(), study_device::DeviceError> {
        self.device.start(at)
    }

    fn stop(&mut self, at: std::time::Duration) -> Result<(), study_device::DeviceError> {
        self.device.stop(at)
    }

    fn limp(&mut self, at: std::time::Duration) {
        self.device.limp(at);
    }

    fn poll(&mut self, at: std::time::Duration) -> Vec<study_device::Report> {
        for report in self.device.poll(at) {
            let stopped = matches!(report, study_device::Report::Stopped(_));
            let late = if stopped && self.has_friction { 105 } else { 0 };
            let due = at + std::time::Duration::from_millis(late);
            self.waiting.push((due, report));
        }
        let (due, waiting): (Vec<_>, Vec<_>) =
            self.waiting.drain(..).partition(|(due, _)| *due <= at);
        self.waiting = waiting;
        due.into_iter().map(|(_, report)| report).collect()
    }
}

/// A folder with the table that is varied.
fn folder_of_a_space() -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let models = folder.path().join("models");
    std::fs::create_dir(&models).unwrap();
    let table = repository("protocols/turn-signal-extended/models/static.toml");
    std::fs::copy(table, models.join("static.toml")).unwrap();
    folder
}

/// What a session showed.
struct Shown {
    /// One for each look: the terminal, the lines so far, and the message of the participant's page.
    pages: Vec<String>,
    /// The points that were felt, by interval.
    felt: Vec<String>,
}

/// A session of two trials in which only two points of the space may be presented. The seed decides which of them comes first; the
/// participant gives the answer number `answer`.
fn looks(
    folder: &Path,
    pair: [usize; 2],
    (seed, answer, entry): (usize, usize, Entry),
    device: fn(Options) -> Box<dyn Device>,
) -> Shown {
    let template = std::fs::read_to_string(repository("src/cli/new/search.toml")).unwrap();
    let rule = "{ name = \"preference-gp\", trials = 40, start = 8 }";
    assert!(template.contains(rule));
    let text = template
        .replace("grid = 9 ", "grid = 3 ")
        .replace("seed = 1 ", &format!("seed = {seed} "))
        .replace(rule, "{ name = \"random\", trials = 2 }");
    std::fs::write(folder.join("protocol.toml"), text).unwrap();
    let mut loaded = load(folder).unwrap();
    loaded.protocol.session.entry = entry;
    let space = &mut loaded.protocol.spaces[0];
    let lattice = space.lattice.clone();
    assert_eq!(lattice.certified().len(), POINTS);
    space
        .certify(|at| pair.contains(&lattice.point(at)))
        .unwrap();
    let (mut runner, clock) = session(loaded, None, None, device);
    let mut surface = Surface::new(ColorDepth::None).with_live(true);
    let mut dialogue = Dialogue::new(true, true);
    let mut shown = Shown {
        pages: Vec::new(),
        felt: Vec::new(),
    };
    for _ in 0..20_000 {
        let view = runner.view();
        let lines = dialogue.follow(&view).lines.join("\n");
        let own = serde_json::to_string(&study_session::page::participant(&view)).unwrap();
        let screen = picture(&drawn(&mut surface, &view, 80, 24));
        shown.pages.push(format!("{screen}\n{lines}\n{own}"));
        if matches!(view.screen, Screen::Playing { .. }) {
            let felt = runner.felt().unwrap().as_str();
            if shown.felt.last().map(String::as_str) != Some(felt) {
                shown.felt.push(felt.to_owned());
            }
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
            return shown;
        }
        clock.advance(LOOK);
    }
    panic!("no end:\n{}", shown.pages.last().unwrap())
}

fn assert_alike(expected: &Shown, found: &Shown, what: &str) {
    for (n, (one, other)) in expected.pages.iter().zip(&found.pages).enumerate() {
        assert_eq!(one, other, "{what}: look {n}");
    }
    assert_eq!(expected.pages.len(), found.pages.len(), "{what}");
}

#[test]
fn where_in_its_space_a_stimulus_lies_is_on_no_screen_and_takes_no_time() {
    let folder = folder_of_a_space();
    for entry in [Entry::Participant, Entry::Experimenter] {
        let expected = looks(folder.path(), [0, 1], (1, 0, entry), device);
        let text = expected.pages.concat().to_lowercase();
        // All of it was there to be looked at.
        for seen in ["second", "trial 2 of 2"] {
            assert!(text.contains(seen), "{seen}");
        }
        for secret in ["switch.", "detent", "friction"] {
            assert!(!text.contains(secret), "{secret} is shown");
        }
        let (mut points, mut orders) = (BTreeSet::new(), BTreeSet::new());
        for point in 0..POINTS {
            let other = (point + 4) % POINTS;
            let seed = 100 + 37 * point;
            // Who enters the answers sees them.
            let answer = match entry {
                Entry::Participant => point % 2,
                Entry::Experimenter => 0,
            };
            let found = looks(folder.path(), [point, other], (seed, answer, entry), device);
            let what = format!("points {point} and {other}, seed {seed}, answer {answer}");
            assert_alike(&expected, &found, &what);
            let number = |felt: &String| felt.rsplit('.').next().unwrap().to_owned();
            let felt: Vec<String> = found.felt.iter().map(number).collect();
            orders.insert(felt[0] < felt[1]);
            points.extend(felt);
        }
        assert_eq!(points.len(), POINTS, "{points:?}");
        assert_eq!(
            orders.len(),
            2,
            "either point came first: {orders:?} {points:?}"
        );
    }
}

/// The comparison above finds a stop that is a tenth of a second late where there is friction.
#[test]
fn a_planted_delay_of_a_point_is_found() {
    let folder = folder_of_a_space();
    let late = |options| -> Box<dyn Device> {
        Box::new(Late {
            device: VirtualDevice::new(options),
            has_friction: false,
            waiting: Vec::new(),
        })
    };
    let [without, with] = [[0, 3], [1, 4]].map(|pair| {
        let shown = looks(folder.path(), pair, (1, 0, Entry::Participant), late);
        shown.pages
    });
    assert_ne!(without, with, "not noticed");
}
