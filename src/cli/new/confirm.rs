//! `study new --from RESULTS --confirm`: a study that confirms on other participants what a search found.

use super::{Files, with_values};
use crate::cli::Failure;
use std::collections::BTreeSet;
use std::path::Path;
use study_analysis::analyze::Include;
use study_analysis::analyze::psychophysics::search::Exploration;
use study_analysis::load;
use study_analysis::study::Study;
use study_base::hex::sha256;
use study_base::text::{Untrusted, counted};
use study_haptics::model::file;
use study_plan::protocol::{Axis, SpaceRules, Vary};
use study_report::explore;

/// The study, after its comment and before the device and the search.
const PROTOCOL: &str = include_str!("confirm.toml");

/// What the template asks of pairs.
const PROMPT: &str = "\"Which one felt more like a real switch?\"";

/// What the search asked, as a text of TOML.
fn prompt(study: &Study, search: &Exploration) -> String {
    let protocol = &study.loaded.protocol;
    let asked = protocol
        .part(&search.part)
        .and_then(|part| part.asks.first());
    let question = asked.and_then(|id| protocol.questions.iter().find(|q| q.id == *id));
    question.map_or_else(
        || PROMPT.to_owned(),
        |q| toml::Value::String(q.prompt.clone()).to_string(),
    )
}

/// The files of a confirmation of the search in a results folder: its protocol, the table with which the search began and that
/// which it found to be best.
///
/// # Errors
/// [`Failure`] if the folder has no search or no answer to one that counts, if the best point is where the search began, or a file
/// cannot be read.
pub(super) fn confirmation(
    results: &Path,
    include: Include,
    (today, seed): (&str, u64),
) -> Result<Files, Failure> {
    let study = Study::open(results)?;
    let id = &study.loaded.protocol.study.id;
    let found = study.explore(include);
    let Some(search) = found.first() else {
        return Err(Failure::input(explore::none(id))
            .hint("--confirm takes the results of a study with a search; without it, --from begins a replication"));
    };
    let Some(index) = best(search) else {
        let what = format!(
            "the search `{}` has no answer of a participant who counts",
            search.part
        );
        return Err(Failure::input(what)
            .hint("`study explore` shows who took part; --include pilot or simulated adds those"));
    };
    let space = &search.space;
    let point = space.lattice.certified()[index];
    if is_start(space, point) {
        let what = format!(
            "the best point of the search `{}` is where it began: there is nothing to confirm",
            search.part
        );
        return Err(Failure::input(what));
    }
    let best = space.realization(point);
    let (Some(table), Some(reference)) =
        (study.loaded.levels.get(&best), bytes(&study, &space.from))
    else {
        return Err(Failure::results(format!(
            "the tables of the space `{}` cannot be read",
            space.id
        )));
    };
    let pairs = explore::pairs_csv(search).map_err(Failure::input)?;
    let mut confirmed = format!("{id}-confirmation");
    confirmed.truncate(64);
    let seed = if seed == study.loaded.protocol.study.seed {
        seed + 1
    } else {
        seed
    };
    let text = with_values(PROTOCOL, &confirmed, seed)?;
    let text = text.replacen(PROMPT, &prompt(&study, search), 1);
    let sections = format!(
        "{}\n{}",
        device(&study)?,
        section(&study, search, &sha256(&pairs), best.as_str())
    );
    let design = "\n[[models]]";
    let Some(at) = text.find(design) else {
        return Err(Failure::input("the template has no realizations"));
    };
    let text = format!(
        "{}{}\n{}{}",
        comment(search, today),
        &text[..at],
        sections,
        &text[at..]
    );
    Ok(vec![
        (load::FILE_NAME.to_owned(), text.into_bytes()),
        ("models/reference.toml".to_owned(), reference.to_vec()),
        (
            "models/best.toml".to_owned(),
            file::write(table).into_bytes(),
        ),
    ])
}

/// The point with the largest mean, of all participants together if there are several.
fn best(search: &Exploration) -> Option<usize> {
    let of_all = search.population.as_ref().map(|all| all.best);
    of_all.or_else(|| search.participants.first().map(|own| own.best))
}

/// Whether every axis has the level that changes nothing.
fn is_start(space: &SpaceRules, point: usize) -> bool {
    let unchanged = |(axis, level): (&Axis, f64)| match axis.vary {
        Vary::Friction => level == 0.0,
        Vary::Detent | Vary::Damping | Vary::Mass => level == 1.0,
        Vary::Blend => false,
    };
    space.axes.iter().zip(space.levels(point)).all(unchanged)
}

/// A file of the frozen protocol.
fn bytes<'a>(study: &'a Study, path: &str) -> Option<&'a [u8]> {
    let mut files = study.loaded.files.iter();
    files
        .find(|(name, _)| name == path)
        .map(|(_, bytes)| bytes.as_slice())
}

/// The section `[device]` of the search: the confirmation has the same device and the same limits.
fn device(study: &Study) -> Result<String, Failure> {
    let unread = || Failure::results("the frozen protocol of the search has no section [device]");
    let text = bytes(study, load::FILE_NAME).map(String::from_utf8_lossy);
    let whole: toml::Table = text.ok_or_else(unread)?.parse().map_err(|_| unread())?;
    let own = whole.get("device").ok_or_else(unread)?.clone();
    let alone = toml::Table::from_iter([("device".to_owned(), own)]);
    toml::to_string(&alone).map_err(|_| unread())
}

/// The section `[confirms]`. All of its texts are identifiers, which need no escaping.
fn section(study: &Study, search: &Exploration, hash: &str, best: &str) -> String {
    let people = study.sessions.iter().filter(|s| {
        let seat = s.history.start().map(|start| start.seat);
        seat.is_some_and(|seat| !seat.is_simulated())
    });
    let people: BTreeSet<String> = people.map(|s| format!("\"{}\"", s.participant)).collect();
    let people: Vec<String> = people.into_iter().collect();
    format!(
        "[confirms]\nstudy = \"{}\"\npart = \"{}\"\npairs_sha256 = \"{hash}\"   # of {}-pairs.csv, which study explore --out writes\n\
         best = \"{best}\"\nsearchers = [{}]   # they cannot take part\n",
        study.loaded.protocol.study.id,
        search.part,
        search.part,
        people.join(", ")
    )
}

/// What the protocol says of itself.
fn comment(search: &Exploration, today: &str) -> String {
    let who = counted(search.participants.len(), "participant", "participants");
    format!(
        "# A confirmation of the search `{}`, made on {today} from the answers of {who}. Preregister it before the first session:\n\
         #\n\
         #     study check .\n\
         #     study preregister .\n\
         #     study run .\n\
         #\n\
         # Its stimuli are known, its orders follow from seed and row alone, and who searched cannot take part.\n",
        Untrusted(search.part.as_str())
    )
}
