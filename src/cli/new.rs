//! `study new`: a commented protocol to start from, a replication of a study, or the confirmation of a search.

mod confirm;

use super::console::shell_command;
use super::include::{Who, include};
use super::{Console, Failure, schema};
use confirm::Asked;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use study_analysis::load;
use study_base::sort::SmallSort as _;
use study_base::text::{PartId, Untrusted, counted};
use study_plan::protocol::file;

/// The files of a new study: a commented protocol and three of the paper's realizations.
const PROTOCOL: &str = include_str!("new/protocol.toml");
const MODELS: [(&str, &str); 3] = [
    (
        "models/lambda-0.9991.toml",
        include_str!("../../protocols/turn-signal/models/lambda-0.9991.toml"),
    ),
    (
        "models/lambda-0.9995.toml",
        include_str!("../../protocols/turn-signal/models/lambda-0.9995.toml"),
    ),
    (
        "models/lambda-0.9999.toml",
        include_str!("../../protocols/turn-signal/models/lambda-0.9999.toml"),
    ),
];

/// The table that families vary: it passes its certificate.
const STATIC: (&str, &str) = (
    "models/static.toml",
    include_str!("../../protocols/turn-signal-extended/models/static.toml"),
);

/// Three realizations with a hidden reference and an anchor.
const WITH_ANCHORS: [(&str, &str); 5] = [
    STATIC,
    (
        "models/spring.toml",
        include_str!("../../protocols/turn-signal-extended/models/spring.toml"),
    ),
    MODELS[0],
    MODELS[1],
    MODELS[2],
];

/// Realizations that are ranked.
const RANKED: [(&str, &str); 4] = [WITH_ANCHORS[1], MODELS[0], MODELS[1], MODELS[2]];

/// Two factors with two levels each.
const CROSSED: [(&str, &str); 4] = [
    (
        "models/low-soft.toml",
        include_str!("new/factorial/low-soft.toml"),
    ),
    (
        "models/low-crisp.toml",
        include_str!("new/factorial/low-crisp.toml"),
    ),
    (
        "models/high-soft.toml",
        include_str!("new/factorial/high-soft.toml"),
    ),
    (
        "models/high-crisp.toml",
        include_str!("new/factorial/high-crisp.toml"),
    ),
];

/// What a trial of a new study is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TrialKind {
    /// One realization is rated
    Rating,
    /// One realization of a factorial design is rated
    Factorial,
    /// Two realizations, one is chosen
    Pairs,
    /// Two-interval forced choice with constant stimuli
    #[value(name = "2ifc")]
    TwoIntervals,
    /// A threshold by staircases
    Staircase,
    /// A threshold by QUEST+
    #[value(name = "questplus")]
    QuestPlus,
    /// A search for the best point of a space, by pairs
    Search,
    /// A positive number for each level
    Magnitude,
    /// Ratings from 0 to 100 beside a reference
    Mushra,
    /// One of several labels for each realization
    Identification,
    /// How different two realizations are, for a map
    Similarity,
    /// Ranks of several realizations
    Ranking,
    /// A level that is set until it feels equal to a standard
    Adjustment,
    /// Yes or no, with catch trials
    #[value(name = "yesno")]
    YesNo,
    /// Which of two realizations is the third?
    Abx,
}

impl TrialKind {
    /// The commented protocol and its model files.
    fn files(self) -> (&'static str, &'static [(&'static str, &'static str)]) {
        match self {
            Self::Rating => (PROTOCOL, &MODELS),
            Self::Factorial => (include_str!("new/factorial.toml"), &CROSSED),
            Self::Pairs => (include_str!("new/pairs.toml"), &MODELS),
            Self::TwoIntervals => (include_str!("new/constant.toml"), &[STATIC]),
            Self::Staircase => (include_str!("new/staircase.toml"), &[STATIC]),
            Self::QuestPlus => (include_str!("new/questplus.toml"), &[STATIC]),
            Self::Search => (include_str!("new/search.toml"), &[STATIC]),
            Self::Magnitude => (include_str!("new/magnitude.toml"), &[STATIC]),
            Self::Mushra => (include_str!("new/mushra.toml"), &WITH_ANCHORS),
            Self::Identification => (include_str!("new/identification.toml"), &CROSSED),
            Self::Similarity => (include_str!("new/similarity.toml"), &[STATIC]),
            Self::Ranking => (include_str!("new/ranking.toml"), &RANKED),
            Self::Adjustment => (include_str!("new/adjustment.toml"), &[STATIC]),
            Self::YesNo => (include_str!("new/yesno.toml"), &[STATIC]),
            Self::Abx => (include_str!("new/abx.toml"), &[MODELS[0], MODELS[2]]),
        }
    }
}

/// Arguments of `study new`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The folder to create; if it exists, it must be empty
    dir: PathBuf,
    /// Start a replication of the study in this results folder
    #[arg(long, value_name = "RESULTS")]
    from: Option<PathBuf>,
    /// Instead of a replication, confirm what the search in that folder found, on other participants
    #[arg(long, requires = "from")]
    confirm: bool,
    /// Confirm by ratings of the two, with a margin of equivalence, in place of ABX and pairs
    #[arg(long, requires = "confirm")]
    ratings: bool,
    /// Also include these sessions of the search
    #[arg(long, value_name = "WHO", value_delimiter = ',', requires = "confirm")]
    include: Vec<Who>,
    /// The part whose search is confirmed, in a study with several
    #[arg(long, value_name = "NAME", requires = "confirm")]
    part: Option<PartId>,
    /// What a trial is
    #[arg(long, value_enum, default_value_t = TrialKind::Rating, conflicts_with = "from")]
    kind: TrialKind,
    /// The seed of the orders; otherwise today's date, as 20260131
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(..=MAX_SEED))]
    seed: Option<u64>,
}

/// The longest id of a study.
const MAX_ID: usize = 64;

/// The largest integer of TOML.
const MAX_SEED: u64 = i64::MAX as u64;

/// Runs `study new`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let dir = &args.dir;
    refuse_unless_empty(dir)?;
    let today = chrono::Local::now().date_naive();
    let of_today = || today.format("%Y%m%d").to_string().parse().unwrap_or(1);
    let seed = args.seed.unwrap_or_else(of_today);
    let mut files = match &args.from {
        Some(results) if args.confirm => {
            let asked = Asked {
                include: include(&args.include),
                part: args.part.as_ref(),
                ratings: args.ratings,
                today: &today.to_string(),
                seed,
            };
            confirm::confirmation(results, &asked, console)?
        }
        Some(results) => replication(results, &today.to_string(), seed)?,
        None => starter(dir, seed, args.kind)?,
    };
    add_schema(&mut files);
    write(dir, &files)?;
    let shown = dir.display().to_string();
    let word = shell_command(std::slice::from_ref(&shown));
    let (shown, word) = (Untrusted(&shown), Untrusted(&word));
    console.out(format!(
        "wrote {shown}: {} and {} beside it\nnext: study check {word}; study run {word} --pilot\n",
        load::FILE_NAME,
        counted(files.len() - 1, "file", "files")
    ))
}

/// Relative path, with `/`, and bytes.
type Files = Vec<(String, Vec<u8>)>;

fn starter(dir: &Path, seed: u64, kind: TrialKind) -> Result<Files, Failure> {
    let name = std::path::absolute(dir).map_err(|e| Failure::file(dir, &e))?;
    let name = name.file_name().unwrap_or_default().to_string_lossy();
    let (text, models) = kind.files();
    let text = with_values(text, &study_id(&name), seed)?;
    let mut files = vec![(load::FILE_NAME.to_owned(), text.into_bytes())];
    for (path, text) in models {
        files.push(((*path).to_owned(), text.as_bytes().to_vec()));
    }
    Ok(files)
}

/// Adds the JSON Schema, which the first line of the protocol names for editors.
fn add_schema(files: &mut Files) {
    if let Some((_, protocol)) = files.first_mut() {
        *protocol = schema::with_schema(&String::from_utf8_lossy(protocol)).into_bytes();
    }
    files.push((
        schema::FILE_NAME.to_owned(),
        schema::document().into_bytes(),
    ));
}

/// The newest frozen protocol of a study, with a new id and a new seed, which make it
/// another study.
fn replication(results: &Path, today: &str, seed: u64) -> Result<Files, Failure> {
    let (folder, version) = frozen(results)?;
    let loaded = load::load_frozen(&folder.join(load::FILE_NAME))?;
    let study = &loaded.protocol.study;
    let (id, seed) = following((study.id.as_str(), study.seed), "replication", seed);
    let mut files = loaded.files;
    let Some((_, bytes)) = files.first_mut() else {
        return Err(Failure::input("the frozen protocol is empty"));
    };
    let text = String::from_utf8_lossy(bytes);
    let text = with_values(&text, &id, seed)?;
    let origin = format!(
        "# A replication of the study `{}`, version {version} of its protocol, made on {today}.\n\
         # Stimulus fingerprint of the original: {}\n\
         # Its seed was {}; a replication has orders of its own.\n\n",
        study.id, loaded.fingerprints.stimulus, study.seed
    );
    *bytes = (origin + &text).into_bytes();
    Ok(files)
}

/// Id and seed of a study that follows another one, of which neither is that of the other.
fn following((id, own_seed): (&str, u64), what: &str, seed: u64) -> (String, u64) {
    let named = |most: usize, end: &str| {
        // Ids are ASCII.
        let begin = id.get(..most - end.len()).unwrap_or(id);
        format!("{}{end}", begin.trim_end_matches('-'))
    };
    let next = named(MAX_ID, &format!("-{what}"));
    let next = match next == id {
        true => named(MAX_ID, &format!("-{what}-2")),
        false => next,
    };
    let seed = match seed == own_seed {
        true if seed == MAX_SEED => seed - 1,
        true => seed + 1,
        false => seed,
    };
    (next, seed)
}

/// The folder of a study's newest frozen protocol, and its version.
fn frozen(results: &Path) -> Result<(PathBuf, u32), Failure> {
    let studies: Vec<PathBuf> = if results.join("protocol").is_dir() {
        vec![results.to_owned()]
    } else {
        subfolders(results)?
            .into_iter()
            .filter(|folder| folder.join("protocol").is_dir())
            .collect()
    };
    let [study] = studies.as_slice() else {
        let shown = results.display();
        return Err(match studies.len() {
            0 => Failure::results(format!("{shown}: there is no study in this folder"))
                .hint("--from takes a results folder, such as results/turn-signal"),
            n => Failure::results(format!("{shown}: there are {n} studies in this folder"))
                .hint("name the folder of one of them"),
        });
    };
    let versions = subfolders(&study.join("protocol"))?;
    versions
        .into_iter()
        .filter_map(|folder| {
            let version = folder.file_name()?.to_str()?.parse::<u32>().ok()?;
            Some((folder, version))
        })
        .max_by_key(|(_, version)| *version)
        .ok_or_else(|| {
            Failure::results(format!(
                "{}: the folder contains no protocol",
                study.join("protocol").display()
            ))
        })
}

fn subfolders(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let mut folders = Vec::new();
    for entry in fs::read_dir(folder).map_err(|e| Failure::file(folder, &e))? {
        let path = entry.map_err(|e| Failure::file(folder, &e))?.path();
        if path.is_dir() {
            folders.push(path);
        }
    }
    folders.small_sort();
    Ok(folders)
}

/// The text of a protocol with another id and seed, otherwise unchanged.
fn with_values(text: &str, id: &str, seed: u64) -> Result<String, Failure> {
    let spans = file::parse(load::FILE_NAME, text).spans;
    let mut edits = Vec::new();
    for (key, value) in [
        ("study.id", format!("\"{id}\"")),
        ("study.seed", seed.to_string()),
    ] {
        let span = spans
            .get(key)
            .ok_or_else(|| Failure::input(format!("the protocol has no `{key}`")))?;
        edits.push((span.clone(), value));
    }
    // from the end, so that the earlier span stays valid
    edits.small_sort_by_key(|(span, _)| std::cmp::Reverse(span.start));
    let mut text = text.to_owned();
    for (span, value) in edits {
        text.replace_range(span, &value);
    }
    Ok(text)
}

/// A study id from the name of a folder.
fn study_id(name: &str) -> String {
    let mut id = String::new();
    for c in name.chars() {
        if c.is_ascii_alphanumeric() {
            id.push(c.to_ascii_lowercase());
        } else if !id.ends_with('-') && !id.is_empty() {
            id.push('-');
        }
    }
    id.truncate(MAX_ID);
    let id = id.trim_end_matches('-');
    if id.is_empty() {
        "my-study".to_owned()
    } else {
        id.to_owned()
    }
}

fn refuse_unless_empty(dir: &Path) -> Result<(), Failure> {
    let full = match fs::read_dir(dir) {
        Ok(mut entries) => entries.next().is_some(),
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => false,
        Err(e) => return Err(Failure::file(dir, &e)),
    };
    if full {
        return Err(
            Failure::input(format!("{}: the folder is not empty", dir.display()))
                .hint("files are never overwritten; name a new folder"),
        );
    }
    Ok(())
}

fn write(dir: &Path, files: &Files) -> Result<(), Failure> {
    for (file, bytes) in files {
        let path = dir.join(file);
        let parent = path.parent().unwrap_or(dir);
        fs::create_dir_all(parent).map_err(|e| Failure::file(parent, &e))?;
        fs::File::create_new(&path)
            .and_then(|mut out| out.write_all(bytes))
            .map_err(|e| Failure::file(&path, &e))?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_plan::protocol::check;

    #[test]
    fn a_folder_name_becomes_a_study_id() {
        assert_eq!(study_id("Turn signal (v2)"), "turn-signal-v2");
        assert_eq!(study_id("…"), "my-study");
        assert!(study_id(&"x".repeat(100)).len() == 64);
    }

    #[test]
    fn a_study_that_follows_another_has_an_id_and_a_seed_of_its_own() {
        let next = |id: &str, own, seed| following((id, own), "replication", seed);
        assert_eq!(next("s", 1, 7), ("s-replication".to_owned(), 7));
        assert_eq!(next("s", 7, 7).1, 8);
        assert_eq!(next("s", MAX_SEED, MAX_SEED).1, MAX_SEED - 1);
        let long = "x".repeat(64);
        let (once, _) = next(&long, 1, 2);
        assert_eq!(once, format!("{}-replication", "x".repeat(52)));
        let (twice, _) = next(&once, 1, 2);
        assert_eq!(twice, format!("{}-replication-2", "x".repeat(50)));
        assert!(once.len() == 64 && twice.len() == 64);
        assert_eq!(next(&format!("{}-y", "x".repeat(51)), 1, 2).0.len(), 63);
    }

    /// Nobody rates what was not felt, in any study that this program writes or ships.
    #[test]
    fn new_and_shipped_studies_have_a_least_exposure() {
        use clap::ValueEnum as _;
        let new = TrialKind::value_variants()
            .iter()
            .map(|kind| kind.files().0);
        let mut texts: Vec<String> = new.map(str::to_owned).collect();
        for folder in subfolders(&Path::new(env!("CARGO_MANIFEST_DIR")).join("protocols")).unwrap()
        {
            // A folder has a study, or designs of a file each.
            let study = folder.join(load::FILE_NAME);
            let designs = fs::read_dir(&folder).unwrap().map(|f| f.unwrap().path());
            let files: Vec<PathBuf> = match study.exists() {
                true => vec![study],
                false => designs.collect(),
            };
            texts.extend(files.iter().map(|file| fs::read_to_string(file).unwrap()));
        }
        assert!(texts.len() > 20, "{}", texts.len());
        for text in texts {
            let parsed = file::parse(load::FILE_NAME, &text);
            let shown = parsed.findings.render(false);
            let protocol = parsed.protocol.unwrap_or_else(|| panic!("{shown}"));
            let found = check::warnings(&protocol, &parsed.spans, &[]);
            let unfelt = found
                .iter()
                .find(|fault| fault.message.contains("before anything was felt"));
            assert!(unfelt.is_none(), "{}: {unfelt:?}", protocol.study.id);
        }
    }

    #[test]
    fn id_and_seed_change_and_nothing_else() {
        let text = with_values(PROTOCOL, "other", 42).unwrap();
        let changed: Vec<(&str, &str)> = PROTOCOL
            .lines()
            .zip(text.lines())
            .filter(|(before, after)| before != after)
            .collect();
        assert_eq!(changed.len(), 2, "{changed:?}");
        assert!(changed[0].1.starts_with("id = \"other\""));
        assert!(changed[1].1.starts_with("seed = 42"));
    }
}
