//! `study run`: a session in the terminal.

mod desk;
mod ending;
mod hurry;
mod page;
mod people;
mod unrendered;
mod unsaved;

use super::console::shell_command;
use super::device::before;
use super::device_selection::{self, DeviceArgs, WaitDisplay};
use super::{Console, Failure, Kind, study_folder};
use crate::plain::Plain;
use crate::runner::beside::{Beside, Own};
use crate::runner::clock::{Clock, HurriedClock, RealClock};
use crate::runner::saver::Saving;
use crate::runner::{Operator, Runner, Setup};
use crate::screen::Address;
use crate::tui::{self, Tui};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::sync::Arc;
use study_analysis::load;
use study_base::text::{PartId, ParticipantId, Untrusted};
use study_session::session::{Config, Ending, MAX_OPERATOR};
use study_session::store::{Copies, Frozen, Plan, SeatKind, StudyFolder, check_new_id, layout};

/// Arguments of `study run`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// A protocol.toml or the folder that contains it [default: the working folder]
    protocol: Option<PathBuf>,
    /// Pseudonym of the participant; with --operator, the session begins without the first screen
    #[arg(long, value_name = "ID", add = super::completions::participants())]
    participant: Option<String>,
    /// Initials or code of the operator; asked on the first screen if omitted
    #[arg(long, value_name = "NAME")]
    operator: Option<String>,
    #[command(flatten)]
    device: DeviceArgs,
    /// Mark the session as a pilot: stored separately from real data, uses no row
    #[arg(long)]
    pilot: bool,
    /// Rows that may be assigned, such as 1-40: give each of two rigs its own range
    #[arg(long, value_name = "A-B", value_parser = super::schedule::parse_rows)]
    rows: Option<RangeInclusive<u32>>,
    /// Group of a new participant, where the protocol says that the experimenter gives it
    #[arg(long, value_name = "ID")]
    group: Option<PartId>,
    /// Folder for the results of all studies
    #[arg(long, value_name = "DIR", default_value = "results")]
    results: PathBuf,
    /// Existing folder, on a second disk, for a copy of everything that is written
    /// (default: mirror in device.toml)
    #[arg(long, value_name = "DIR")]
    mirror: Option<PathBuf>,
    /// Start although the device has not passed its check; the session records this
    #[arg(long)]
    unchecked: bool,
    /// Show whether telemetry arrives
    #[arg(long)]
    live: bool,
    /// Lines only, for screen readers; also with STUDY_PLAIN=1 and in a dumb terminal
    #[arg(long)]
    plain: bool,
    /// A page of the participant's own, in a browser on this computer or, at an address of
    /// this computer such as 192.168.1.20, on a tablet
    #[arg(long, value_name = "ADDR", num_args = 0..=1, require_equals = true,
          default_missing_value = "127.0.0.1")]
    screen: Option<Address>,
    /// A front of your own for the participant: a program and its arguments, quoted as for a
    /// shell, that shows the pages of docs/page.md
    #[arg(long, value_name = "COMMAND", conflicts_with = "screen")]
    front: Option<String>,
    /// Do not use the mouse
    #[arg(long)]
    no_mouse: bool,
}

/// Runs the command.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let protocol = match &args.protocol {
        Some(given) => given.clone(),
        None => protocol_here()?,
    };
    let loaded = load::load_for(&protocol, &args.results)?;
    console.warnings_in_short(&loaded.findings, &protocol);
    let kind = args.device.kind.unwrap_or(loaded.protocol.device.kind);
    // Checks come before the device, and the device before the terminal, so that an
    // error message stays on the screen.
    let participant = check_ids(args)?;
    loaded.check_playable(kind)?;
    page::can_present(&loaded.protocol, args.screen.is_some())?;
    let times = hurry::hurry(std::env::var(hurry::VARIABLE).ok(), kind)?;
    let clock: Box<dyn Clock> = match times {
        1 => Box::new(RealClock::default()),
        _ => Box::new(HurriedClock::new(times)),
    };
    let at = clock.now();
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    if args.results.exists() && !args.results.is_dir() {
        let shown = args.results.display();
        return Err(Failure::input(format!("{shown} is a file, not a folder"))
            .hint("--results names the folder for the results of all studies"));
    }
    let mirror = match &args.mirror {
        Some(mirror) => Some(mirror.clone()),
        None => device_selection::mirror()?,
    };
    let open = || {
        let results = &args.results;
        let opened = match &mirror {
            Some(mirror) => StudyFolder::open_or_create_mirrored(results, mirror, &frozen, at),
            None => StudyFolder::open_or_create(results, &frozen, at).map(|s| (s, Vec::new())),
        };
        opened.map_err(|error| study_folder::refused(error, &loaded))
    };
    let begun = args.results.join(loaded.protocol.study.id.as_str());
    let mut notices = Vec::new();
    let begun = match begun.join(layout::MANIFEST).symlink_metadata().is_ok() {
        true => {
            let (study, caught_up) = open()?;
            notices = caught_up;
            Some(study)
        }
        false => None,
    };
    let mut known = Vec::new();
    if let Some(study) = &begun {
        known = study.sessions()?;
    }
    match (&participant, &begun) {
        (Some(id), Some(study)) => study.check_id(id)?,
        (Some(id), None) => check_new_id(id)?,
        (None, _) => {}
    }
    let options = tui::Options {
        mouse: !args.no_mouse,
        live: args.live,
        color: tui::ColorDepth::detect(|name| std::env::var(name).ok()),
        hurry: times,
    };
    let address = &args.device.address;
    let plain = args.plain || wants_plain(|name| std::env::var(name).ok());
    let mut simulated = false;
    let mut front_name = None;
    let mut media = None;
    let own: Option<Box<dyn Own>> = match (args.screen, &args.front) {
        (Some(at), _) => {
            let screen = page::open(at, &loaded, plain, console)?;
            media = screen.shows();
            Some(Box::new(screen))
        }
        (None, Some(command)) => {
            let front = page::start(command, &loaded.protocol)?;
            simulated = front.hello().is_some_and(|hello| hello.simulated);
            front_name = front.hello().map(|hello| hello.front.clone());
            Some(Box::new(front))
        }
        (None, None) => None,
    };
    let mut waiting = match plain {
        true => WaitDisplay::in_a_line(console),
        false => WaitDisplay::on_screen(options),
    };
    let opened = device_selection::open(address, kind, &loaded.protocol, &mut waiting);
    drop(waiting);
    let Some(mut device) = opened? else {
        return console.out("Nothing was recorded.\n");
    };
    unrendered::refuse_unrendered(&device.identity(), kind, &loaded)?;
    let (deliveries, said) = load::deliveries(&loaded)?;
    for notice in said {
        console.say(format!("warning: {}", Untrusted(&notice)));
    }
    let asked = before::Asked::of(&loaded.protocol.device, kind, args.unchecked);
    let examined = before::examined(&mut *device, &args.results, asked, console, &*clock)?;
    let device_check = match times {
        1 => examined.check,
        _ => Some(hurry::mark(times)),
    };
    // A person feels nothing on the simulated device: such data are never real.
    let overridden = kind != loaded.protocol.device.kind;
    let seats = if simulated {
        SeatKind::Simulated
    } else if args.pilot || overridden || device.identity().simulated || times > 1 {
        SeatKind::Pilot
    } else {
        SeatKind::Real
    };
    tui::survive_file_size_limit();
    // The terminal comes before the folder: without a terminal nothing is created.
    let terminal = match plain {
        true => At::Lines(Box::new(Plain::open(args.live, times).map_err(unusable)?)),
        false => At::Screen(Box::new(Tui::open(options).map_err(unusable)?)),
    };
    let study = match begun {
        Some(study) => study,
        None => {
            let (study, caught_up) = open()?;
            notices = caught_up;
            study
        }
    };
    let folder = study.path().to_owned();
    // After a kill the tables may be older than the journals: update them first.
    study.refresh(&loaded.protocol)?;
    let models = loaded.tables();
    let protocol = Arc::new(loaded.protocol);
    let plan = Plan::of(&protocol, args.group.clone(), at.wall);
    let rig = people::Rig {
        kind: seats,
        rows: args.rows.as_ref(),
        plan: &plan,
    };
    let mut roster = people::roster(&known, &rig);
    let within_h = protocol.session.resume_within_h;
    if let Some(session) = people::interrupted(&known, &rig, within_h, |s| study.is_open(s)) {
        let goes_on = people::goes_on(&session.history, &protocol);
        let left = people::left(&session.history, at.wall);
        roster.interrupted(session.participant.clone(), left, goes_on);
    }
    let mut operator: Box<dyn Operator> = match (terminal, &own) {
        (At::Lines(lines), _) => lines,
        (At::Screen(screen), None) => screen,
        (At::Screen(screen), Some(_)) => {
            let desk = desk::desk(&known, seats, &plan, &roster, &protocol);
            desk::measure(desk.free.clone(), &args.results);
            Box::new(screen.with_desk(desk))
        }
    };
    if let Some(own) = own {
        operator = Box::new(Beside::new(own, operator));
    }
    let setup = Setup {
        protocol: protocol.clone(),
        orders: loaded.orders.map(Arc::new),
        models,
        deliveries,
        fingerprints: loaded.fingerprints,
        study,
        kind: seats,
        rows: args.rows.clone(),
        group: args.group.clone(),
        device_kind: kind,
        device_check,
        self_weighed: examined.self_weighed,
        device,
        clock,
        saving: Saving::Thread,
    };
    let config = Config {
        participant: args.participant.clone().unwrap_or_default(),
        operator: args.operator.clone().unwrap_or_default(),
        front: front_name,
        roster: Some(Arc::new(roster)),
        media,
        auto_identify: args.participant.is_some() && args.operator.is_some(),
    };
    let study = setup.study.clone();
    let mut runner = Runner::new(setup, config);
    let ended = runner.run(&mut *operator);
    let participant = runner.view().line.participant;
    drop(runner);
    let resume = resume_command(args, &participant);
    // While the terminal is open, a signal does not end the program.
    let failure = ended.unsaved.map(|unsaved| {
        let places = unsaved::places();
        let kept = unsaved::keep(&unsaved, &participant, &folder, &places);
        let copy = unsaved::keep_copy(&unsaved, &participant, &folder, &places);
        unsaved::failure(&unsaved, &kept, copy.as_ref(), &folder, &resume)
    });
    drop(operator);
    for notice in notices {
        console.say(notice);
    }
    say_behind(&study, console);
    if let Some(failure) = failure {
        return Err(failure);
    }
    if let Some(receipt) = &ended.receipt {
        console.out(format!(
            "Receipt: {} records, {}\n",
            receipt.seq, receipt.hash
        ))?;
    }
    finish(
        console,
        &study,
        &protocol,
        &participant,
        &ended.ending,
        &resume,
    )
}

/// How the experimenter sits at the terminal.
enum At {
    /// Reading and typing lines.
    Lines(Box<Plain>),
    /// Before pages.
    Screen(Box<Tui>),
}

/// The protocol of the working folder.
fn protocol_here() -> Result<PathBuf, Failure> {
    let file = PathBuf::from("protocol.toml");
    if file.is_file() {
        return Ok(file);
    }
    Err(
        Failure::usage("no protocol is given, and the working folder has no protocol.toml").hint(
            "study run PROTOCOL, with a protocol.toml or the folder that contains it; \
             `study new my-study` writes one",
        ),
    )
}

/// Says which of results folder and mirror was left behind.
fn say_behind(study: &StudyFolder, console: &mut Console) {
    let Some(Copies { results, mirror }) = study.copies() else {
        return;
    };
    for (folder, other, why) in [
        ("results folder", "mirror", results),
        ("mirror", "results folder", mirror),
    ] {
        if let Some(why) = why {
            console.say(format!(
                "warning: the {folder} was left behind: {why}; the {other} has everything that was saved, and the next `study run` brings the {folder} up to date"
            ));
        }
    }
}

/// Whether the environment asks for lines: `STUDY_PLAIN`, or a terminal that cannot
/// position text.
pub(super) fn wants_plain(var: impl Fn(&str) -> Option<String>) -> bool {
    let asked = var("STUDY_PLAIN").is_some_and(|value| !value.is_empty() && value != "0");
    asked || var("TERM").is_some_and(|term| term == "dumb")
}

fn unusable(error: tui::TuiError) -> Failure {
    Failure::new(Kind::Usage, &error).hint(error.hint())
}

/// Checks the participant and the operator given as arguments.
fn check_ids(args: &Args) -> Result<Option<ParticipantId>, Failure> {
    if let Some(operator) = &args.operator
        && operator.chars().count() > MAX_OPERATOR
    {
        return Err(Failure::input(format!(
            "--operator: at most {MAX_OPERATOR} characters"
        )));
    }
    let id = args.participant.as_deref().map(str::trim);
    let id = id.map(ParticipantId::new).transpose();
    id.map_err(|why| Failure::input(why).hint("use a pseudonym, such as P01"))
}

/// The command line that resumes the session.
fn resume_command(args: &Args, participant: &str) -> String {
    let mut command = vec!["study".to_owned(), "run".to_owned()];
    let path = |path: &std::path::Path| path.display().to_string();
    command.extend(args.protocol.as_deref().map(path));
    let mut option = |name: &str, value: Option<String>| match value {
        Some(value) if value.starts_with('-') => command.push(format!("--{name}={value}")),
        Some(value) => command.extend([format!("--{name}"), value]),
        None => {}
    };
    let results = Some(path(&args.results)).filter(|p| p != "results");
    option("results", results);
    option("device", args.device.kind.map(|k| k.as_str().to_owned()));
    let serial = &args.device.address.serial;
    option("port", serial.shown_port());
    option("baud", serial.baud.map(|b| b.to_string()));
    option("command", args.device.address.command.clone());
    option(
        "rows",
        args.rows
            .as_ref()
            .map(|r| format!("{}-{}", r.start(), r.end())),
    );
    option("mirror", args.mirror.as_deref().map(path));
    option("operator", args.operator.clone());
    option(
        "group",
        args.group.as_ref().map(|group| group.as_str().to_owned()),
    );
    option(
        "participant",
        Some(participant.to_owned()).filter(|p| !p.is_empty()),
    );
    for (flag, given) in [
        ("--pilot", args.pilot),
        ("--live", args.live),
        ("--plain", args.plain),
        ("--no-mouse", args.no_mouse),
    ] {
        if given {
            command.push(flag.to_owned());
        }
    }
    command.extend(args.screen.map(|at| format!("--screen={at}")));
    let front = args.front.iter();
    command.extend(front.flat_map(|front| ["--front".to_owned(), front.clone()]));
    shell_command(&command)
}

/// After a session of which everything is saved: writes the derived tables and prints
/// the next step, even if the tables cannot be written.
fn finish(
    console: &mut Console,
    study: &StudyFolder,
    protocol: &study_plan::protocol::Protocol,
    participant: &str,
    how: &Ending,
    resume: &str,
) -> Result<(), Failure> {
    let written = match how {
        Ending::Nothing => Ok(None),
        _ => study.refresh(protocol).map(Some),
    };
    let folder = study.saved_in();
    let shown = folder.display();
    let include = match &written {
        Ok(Some(derived)) => ending::included(derived),
        _ => "",
    };
    match how {
        Ending::Finished => console.out(format!(
            "The session is finished and saved in {shown}.\nNext: study status {shown} · study analyze {shown}{include}\n"
        )),
        Ending::Interrupted => console.out(format!(
            "The session is not finished; all answers are saved in {shown}.\nResume it with: {resume}\n"
        )),
        Ending::DroppedOut => console.out(format!(
            "The participant has dropped out; the answers are kept in {shown}.\n"
        )),
        Ending::Nothing => console.out("Nothing was recorded.\n"),
    }?;
    let derived = written.map_err(|e| ending::unwritten(&e, &folder))?;
    let warning = derived.and_then(|d| ending::wrong_forces(d.wrong_forces(participant)));
    if let Some(warning) = warning {
        console.say(warning);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::RefCell;
    use std::path::Path;
    use std::rc::Rc;
    use study_session::store::StoreError;

    #[derive(Clone, Default)]
    struct Written(Rc<RefCell<Vec<u8>>>);

    impl std::io::Write for Written {
        fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
            self.0.borrow_mut().extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> std::io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn a_session_whose_tables_cannot_be_written_still_says_how_to_resume() {
        let results = tempfile::tempdir().unwrap();
        let loaded = load::load(Path::new("protocols/turn-signal")).unwrap();
        let frozen = Frozen {
            protocol: &loaded.protocol,
            files: &loaded.files,
            fingerprints: &loaded.fingerprints,
        };
        let at = RealClock::default().now();
        let study = StudyFolder::open_or_create(results.path(), &frozen, at).unwrap();
        std::fs::create_dir(study.path().join("ratings.csv")).unwrap();
        let (out, err) = (Written::default(), Written::default());
        let mut console = Console::to(out.clone(), err);
        let ending = Ending::Interrupted;
        let failure = finish(
            &mut console,
            &study,
            &loaded.protocol,
            "P01",
            &ending,
            "study run X",
        )
        .unwrap_err();
        assert_eq!(failure.exit_code(), 4);
        assert!(
            failure.message.starts_with(
                "the answers are safe in the journals; the tables could not be written: "
            ),
            "{}",
            failure.message
        );
        assert!(failure.hint.unwrap().contains("--rebuild"));
        let text = String::from_utf8(out.0.borrow().clone()).unwrap();
        assert!(text.contains("Resume it with: study run X"), "{text}");
    }

    #[test]
    fn a_full_disk_gets_a_hint_to_free_space() {
        let full = StoreError::Io {
            path: "results/x/.ratings.csv.tmp".into(),
            source: std::io::ErrorKind::StorageFull.into(),
        };
        let hint = ending::unwritten(&full, Path::new("results/x"))
            .hint
            .unwrap();
        assert_eq!(
            hint,
            "free some disk space, then run `study verify results/x --rebuild`"
        );
    }
}
