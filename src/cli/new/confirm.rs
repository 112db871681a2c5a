//! `study new --from RESULTS --confirm`: a study that confirms on other participants what a search found.

use super::{Files, following, with_values};
use crate::cli::{Console, Failure, study_folder};
use std::collections::BTreeSet;
use std::path::Path;
use study_analysis::analyze::Include;
use study_analysis::analyze::psychophysics::search::Exploration;
use study_analysis::load::{self, Loaded};
use study_analysis::study::Study;
use study_base::hex::sha256;
use study_base::text::{PartId, Untrusted, counted};
use study_haptics::model::{Realization, file};
use study_plan::protocol::{Part, Protocol, Seat, SpaceRules};
use study_report::explore;
use study_session::store::SessionData;

/// The study, after its comment and before the device and the search.
const PROTOCOL: &str = include_str!("confirm.toml");

/// The same with ratings of both in place of ABX and pairs.
const RATINGS: &str = include_str!("confirm-ratings.toml");

/// What the template asks of pairs.
const PROMPT: &str = "\"Which one felt more like a real switch?\"";

/// How the intervals of the template are felt.
const INTERVALS: [&str; 2] = ["gap_s = 1.0", "exposure = { min_s = 1, max_s = 6 }"];

/// How a switch is felt that is rated.
const RATED: &str = "exposure = { min_s = 2 }";

/// What is to be confirmed, and the seed and the day of the confirmation.
#[derive(Debug)]
pub(super) struct Asked<'a> {
    /// Whose answers count besides those of real participants.
    pub(super) include: Include,
    /// The part that searched, if there are several.
    pub(super) part: Option<&'a PartId>,
    /// Whether the two are rated, and not compared.
    pub(super) ratings: bool,
    /// The day.
    pub(super) today: &'a str,
    /// The seed.
    pub(super) seed: u64,
}

/// What the search asked, as a text of TOML.
fn prompt(protocol: &Protocol, part: Option<&Part>) -> String {
    let asked = part.and_then(|part| part.asks.first());
    let question = asked.and_then(|id| protocol.questions.iter().find(|q| q.id == *id));
    question.map_or_else(
        || PROMPT.to_owned(),
        |q| toml::Value::String(q.prompt.clone()).to_string(),
    )
}

/// Gap and exposure of the search, as in a file.
fn intervals(part: &Part) -> [String; 2] {
    let exposure = &part.exposure;
    let mut own = vec![format!("min_s = {}", exposure.min_s)];
    own.extend(exposure.max_s.map(|s| format!("max_s = {s}")));
    own.extend((exposure.replays > 0).then(|| format!("replays = {}", exposure.replays)));
    [
        format!("gap_s = {}", part.gap_s),
        format!("exposure = {{ {} }}", own.join(", ")),
    ]
}

/// The files of a confirmation of the search in a results folder: its protocol, the table with which the search began and that
/// which it found to be best. What is damaged in the folder is said.
///
/// # Errors
/// [`Failure`] if the folder has no such search or no answer to one that counts, if answers of pilots or simulated participants
/// are not asked for, if the best point is where the search began or the table there cannot be played, or a file cannot be read.
pub(super) fn confirmation(
    results: &Path,
    asked: &Asked<'_>,
    console: &mut Console,
) -> Result<Files, Failure> {
    let study = Study::open(results)?;
    let protocol = &study.loaded.protocol;
    let own = &protocol.study;
    let found = study.explore(asked.include);
    let search = chosen(&found, asked.part, &own.id)?;
    study_folder::warn(&study.folder, &study.damage()?, console);
    study_folder::whole(&study.folder, &study.sessions)?;
    let Some(index) = search.best() else {
        let what = format!(
            "the search `{}` has no answer of a participant who counts",
            search.part
        );
        return Err(Failure::input(what)
            .hint("`study explore` shows who took part; --include pilot or simulated adds those"));
    };
    refuse_unasked(search, asked.include)?;
    let space = &search.space;
    let point = space.lattice.certified()[index];
    let best = space.realization(point);
    let (Some(table), Some(start), Some(reference)) = (
        study.loaded.levels.get(&best),
        study.loaded.start_of(space),
        bytes(&study, &space.from),
    ) else {
        return Err(Failure::results(format!(
            "the tables of the space `{}` cannot be read",
            space.id
        )));
    };
    if table.is_alike(&start) {
        let what = format!(
            "the best point of the search `{}` is where it began: there is nothing to confirm",
            search.part
        );
        return Err(Failure::input(what));
    }
    refuse_unplayable(&study.loaded, space, &start)?;
    let pairs = explore::pairs_csv(search).map_err(Failure::input)?;
    let (confirmed, seed) = following((own.id.as_str(), own.seed), "confirmation", asked.seed);
    let template = if asked.ratings { RATINGS } else { PROTOCOL };
    let text = with_values(template, &confirmed, seed)?;
    let part = protocol.part(&search.part);
    // What a search asks of two is no question about one.
    let mut text = text.replacen(PROMPT, &prompt(protocol, part), 1);
    if let Some([gap, exposure]) = part.map(intervals) {
        text = text.replace(INTERVALS[0], &gap);
        text = text.replace(INTERVALS[1], &exposure);
        text = text.replace(RATED, &exposure);
    }
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
        comment(search, asked.today),
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

/// The search of a part; without a name, the only one.
fn chosen<'a>(
    found: &'a [Exploration],
    part: Option<&PartId>,
    study: &str,
) -> Result<&'a Exploration, Failure> {
    let names: Vec<&str> = found.iter().map(|search| search.part.as_str()).collect();
    let names = names.join(", ");
    match (part, found) {
        (_, []) => Err(Failure::input(explore::none(study))
            .hint("--confirm takes the results of a study with a search; without it, --from begins a replication")),
        (None, [only]) => Ok(only),
        (None, _) => Err(Failure::input(format!(
            "the study `{}` has {} searches, and each is confirmed by itself",
            Untrusted(study),
            found.len()
        ))
        .hint(format!("name one with --part: {names}"))),
        (Some(part), _) => {
            let search = found.iter().find(|search| search.part == *part);
            search.ok_or_else(|| {
                Failure::input(format!("the part `{part}` of the study `{}` is no search", Untrusted(study)))
                    .hint(format!("its searches: {names}"))
            })
        }
    }
}

/// Refuses to confirm what was found with pilots or simulated participants, unless they are asked for by name. Without real
/// ones their answers are shown unasked.
fn refuse_unasked(search: &Exploration, include: Include) -> Result<(), Failure> {
    let (who, word) = match (search.simulated, search.pilot) {
        (true, _) if !include.simulated => ("simulated participants", "simulated"),
        (_, true) if !include.pilot => ("pilots", "pilot"),
        _ => return Ok(()),
    };
    let what = format!("only {who} have searched in `{}`", search.part);
    Err(Failure::input(what).hint(format!(
        "--include {word} confirms what they found, and the confirmation says so wherever it is shown"
    )))
}

/// Refuses a start that `study check` would refuse as a realization of the confirmation.
fn refuse_unplayable(
    loaded: &Loaded,
    space: &SpaceRules,
    start: &Realization,
) -> Result<(), Failure> {
    let Some(why) = loaded.refusal(start) else {
        return Ok(());
    };
    Err(Failure::input(format!(
        "the table with which the search began, {}, cannot be compared with its best point: it {why}",
        Untrusted(&space.from)
    ))
    .hint("compare the best point with a table that passes: `study new DIR --kind abx`, with both as its realizations, and name the search in its `[confirms]`"))
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
    let people = study.sessions.iter().filter(|s| searched(s));
    let people: BTreeSet<String> = people.map(|s| format!("\"{}\"", s.participant)).collect();
    let people: Vec<String> = people.into_iter().collect();
    let included = [(search.pilot, "pilot"), (search.simulated, "simulated")];
    let included: Vec<&str> = (included.iter().filter(|(is, _)| *is))
        .map(|(_, word)| *word)
        .collect();
    let option = match included.is_empty() {
        true => String::new(),
        false => format!(" --include {}", included.join(",")),
    };
    let mut section = format!(
        "[confirms]\nstudy = \"{}\"\npart = \"{}\"\npairs_sha256 = \"{hash}\"   # of {}-pairs.csv, which study explore{option} --out writes\n\
         best = \"{best}\"\nsearchers = [{}]   # they cannot take part\n",
        study.loaded.protocol.study.id,
        search.part,
        search.part,
        people.join(", ")
    );
    for word in included {
        section += &format!("{word} = true   # their answers are among those of the search\n");
    }
    section
}

/// Whether somebody may have searched in a session: not simulated ones, and none that did not start. Of those whose data were
/// erased the id remains, and so it does of damaged journals.
fn searched(session: &SessionData) -> bool {
    let simulated = session.seat.is_some_and(Seat::is_simulated);
    let started = session.history.start().is_some();
    !simulated && (started || session.tombstone.is_some() || !session.damage.is_empty())
}

/// What the protocol says of itself.
fn comment(search: &Exploration, today: &str) -> String {
    let who = counted(search.people(), "participant", "participants");
    let who = match (search.simulated, search.pilot) {
        (true, true) => format!("{who}, simulated ones and pilots among them"),
        (true, false) => format!("{who}, simulated ones among them"),
        (false, true) => format!("{who}, pilots among them"),
        (false, false) => who,
    };
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

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    /// The template, whose table is changed to one that can put energy into a hand.
    #[test]
    fn a_start_that_cannot_be_played_is_refused_with_words() {
        let folder = tempfile::tempdir().unwrap();
        let table = "protocols/turn-signal-extended/models/static.toml";
        fs::create_dir(folder.path().join("models")).unwrap();
        fs::copy(table, folder.path().join("models/static.toml")).unwrap();
        let text = include_str!("search.toml");
        fs::write(folder.path().join("protocol.toml"), text).unwrap();
        let mut loaded = load::load(folder.path()).unwrap();
        let space = &loaded.protocol.spaces[0];
        let start = loaded.start_of(space).unwrap();
        assert!(refuse_unplayable(&loaded, space, &start).is_ok());
        // With detent 1 and without friction a point is the start, and no other one.
        let alike = loaded
            .levels
            .values()
            .filter(|level| level.is_alike(&start));
        assert_eq!(alike.count(), 1);
        let mut active = start.clone();
        active.positive.f0_n.iter_mut().for_each(|n| *n -= 100.0);
        let refused = refuse_unplayable(&loaded, space, &active).unwrap_err();
        let words = "models/static.toml, cannot be compared with its best point: it can put energy into a hand";
        assert!(refused.message.contains(words), "{}", refused.message);
        let mut rough = start;
        rough.positive.f0_n.iter_mut().for_each(|n| *n += 10.0);
        let refused = refuse_unplayable(&loaded, space, &rough).unwrap_err();
        assert!(
            refused.message.contains("it is not safe to play"),
            "{}",
            refused.message
        );
        // Where such tables may be played, it is.
        let space = space.clone();
        let permitted = text.replacen(
            "[device]\n",
            "[device]\nuncertified = { play = true, force_n = 9.0, reason = \"r\" }\n",
            1,
        );
        fs::write(folder.path().join("protocol.toml"), permitted).unwrap();
        loaded = load::load(folder.path()).unwrap();
        assert!(refuse_unplayable(&loaded, &space, &active).is_ok());
    }
}
