//! `study stimulus`: bundles of a realization with its recordings, and catalogues of them.

use super::trajectory::write_file;
use super::{Console, Failure};
use std::fs;
use std::path::{Path, PathBuf};
use study_base::sort::SmallSort as _;
use study_base::text::{Untrusted, counted};
use study_haptics::archive::{Bundle, BundleError, MAX_BYTES, Stated};
use study_report::catalogue;
use study_session::store::disk::read_capped;

/// Arguments of `study stimulus`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, clap::Subcommand)]
enum What {
    /// Pack a model file and the recordings that it rests on into one file, whose address is its SHA-256
    Pack(Box<Pack>),
    /// Verify a bundle and write its files into a folder
    Unpack {
        /// The bundle
        bundle: PathBuf,
        /// Folder for the files; if it exists, it must be empty
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
    /// Verify bundles: every byte, the certificate, the license
    Verify {
        /// The bundles
        #[arg(required = true)]
        bundles: Vec<PathBuf>,
    },
    /// What differs between two bundles, fact by fact
    Diff {
        /// A bundle
        a: PathBuf,
        /// Another one
        b: PathBuf,
    },
    /// Write a catalogue of a folder of bundles: web pages with force-displacement plots
    Site {
        /// The folder; its files *.tar are bundles
        bundles: PathBuf,
        /// Folder for the pages; if it exists, it must be empty
        #[arg(long, value_name = "DIR")]
        out: PathBuf,
    },
}

#[derive(Debug, clap::Args)]
struct Pack {
    /// The model file
    model: PathBuf,

    /// Every recording that the model file names as its source, and others of which it has a VAF
    #[arg(value_name = "RECORDING", required = true)]
    recordings: Vec<PathBuf>,

    /// Terms of use, such as CC-BY-4.0 [default: `license:` in the recording's header]
    #[arg(
        long,
        value_name = "TEXT",
        default_value = "",
        hide_default_value = true
    )]
    license: String,

    /// Whom to credit [default: `credit:` in the recording's header]
    #[arg(
        long,
        value_name = "TEXT",
        default_value = "",
        hide_default_value = true
    )]
    credit: String,

    /// With what it was measured, and by whom [default: `instrument:` in the recording's header]
    #[arg(
        long,
        value_name = "TEXT",
        default_value = "",
        hide_default_value = true
    )]
    instrument: String,

    /// Day on which the recordings were published, such as 2024-05-17 [default: `published:` in the recording's header]
    #[arg(
        long,
        value_name = "DAY",
        default_value = "",
        hide_default_value = true
    )]
    published: String,

    /// Folder for the bundle, which is named by its address
    #[arg(short, long, value_name = "DIR", default_value = "bundles")]
    out: PathBuf,
}

/// Runs a subcommand of `study stimulus`.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    match &args.what {
        What::Pack(args) => pack(args, console),
        What::Unpack { bundle, out } => unpack(bundle, out, console),
        What::Verify { bundles } => verify(bundles, console),
        What::Diff { a, b } => diff(a, b, console),
        What::Site { bundles, out } => site(bundles, out, console),
    }
}

fn read(path: &Path) -> Result<Vec<u8>, Failure> {
    read_capped(path, MAX_BYTES).map_err(|e| Failure::input(format!("{}: {e}", path.display())))
}

fn open(path: &Path) -> Result<Bundle, Failure> {
    let opened = Bundle::open(&read(path)?);
    let bundle = opened.map_err(|e| Failure::input(format!("{}: refused: {e}", path.display())))?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let is_address = name.len() == 64 && name.chars().all(|c| c.is_ascii_hexdigit());
    match is_address && !name.eq_ignore_ascii_case(&bundle.sha256()) {
        true => Err(Failure::input(format!(
            "{}: refused: its name is an address, and it is the bundle sha256:{}",
            path.display(),
            bundle.sha256()
        ))
        .hint("get the bundle with the address of its name, or give this one another name")),
        false => Ok(bundle),
    }
}

fn pack(args: &Pack, console: &mut Console) -> Result<(), Failure> {
    let model = read(&args.model)?;
    let mut recordings = Vec::new();
    for path in &args.recordings {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        recordings.push((name.into_owned(), read(path)?));
    }
    let stated = Stated {
        license: args.license.clone(),
        credit: args.credit.clone(),
        instrument: args.instrument.clone(),
        published: args.published.clone(),
    };
    let packed = Bundle::pack(&model, recordings, stated);
    let bundle = packed.map_err(|e| {
        let failure = Failure::input(format!("{}: not packed: {e}", args.model.display()));
        match e {
            BundleError::NotStated(key) => failure.hint(format!(
                "say it with --{key}, or in the header of the recording: # {key}: …"
            )),
            BundleError::Other(_) => failure.hint(
                "every byte counts: a program that converts line ends or the encoding makes another recording of it; a recording that `study import force-curve` of version 0.2 made needs its --file-names now",
            ),
            BundleError::Absent(_) => failure.hint("name every recording after the model file"),
            _ => failure,
        }
    })?;
    fs::create_dir_all(&args.out).map_err(|e| Failure::file(&args.out, &e))?;
    let path = args.out.join(format!("{}.tar", bundle.sha256()));
    write_file(&path, |sink| sink.write_all(bundle.bytes()))?;
    console.say(format!("wrote {}", path.display()));
    console.out(format!("sha256:{}\n", bundle.sha256()))
}

fn unpack(path: &Path, out: &Path, console: &mut Console) -> Result<(), Failure> {
    let bundle = open(path)?;
    new_folder(out)?;
    for (name, content) in bundle.files() {
        write(out, name, content)?;
    }
    let number = counted(bundle.files().count(), "file", "files");
    console.say(format!("wrote {number} to {}", out.display()));
    Ok(())
}

fn verify(paths: &[PathBuf], console: &mut Console) -> Result<(), Failure> {
    let mut refused = 0;
    for path in paths {
        match open(path) {
            Ok(bundle) => {
                let (id, address) = (&bundle.realization.id, bundle.sha256());
                let path = path.display().to_string();
                console.out(format!("{}: {id}, sha256:{address}\n", Untrusted(&path)))?;
            }
            Err(failure) => {
                console.failure(&failure);
                refused += 1;
            }
        }
    }
    match refused {
        0 => Ok(()),
        n => Err(Failure::input(format!(
            "{} refused",
            counted(n, "bundle", "bundles")
        ))),
    }
}

fn diff(a: &Path, b: &Path, console: &mut Console) -> Result<(), Failure> {
    let (first, second) = (open(a)?, open(b)?);
    let differences = first.differences(&second);
    if differences.is_empty() {
        return console.out("no difference\n");
    }
    for (name, values) in differences {
        let [mine, theirs] = values.map(|value| Untrusted(value.unwrap_or("nothing")).to_string());
        console.out(format!("{}: {mine} → {theirs}\n", Untrusted(&name)))?;
    }
    Ok(())
}

fn site(folder: &Path, out: &Path, console: &mut Console) -> Result<(), Failure> {
    let failed = |e| Failure::file(folder, &e);
    let mut paths = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        paths.extend(Some(path).filter(|path| path.extension().is_some_and(|e| e == "tar")));
    }
    if paths.is_empty() {
        return Err(
            Failure::input(format!("{}: no file *.tar", folder.display()))
                .hint("`study stimulus pack` writes bundles"),
        );
    }
    paths.small_sort();
    let mut bundles = paths
        .iter()
        .map(|path| open(path))
        .collect::<Result<Vec<_>, _>>()?;
    // A copy is no second stimulus.
    bundles.sort_by_cached_key(Bundle::sha256);
    bundles.dedup_by_key(|bundle| bundle.sha256());
    new_folder(out)?;
    for (name, text) in catalogue::files(&bundles) {
        write(out, &name, text.as_bytes())?;
    }
    for bundle in &bundles {
        write(
            out,
            &format!("bundles/{}.tar", bundle.sha256()),
            bundle.bytes(),
        )?;
    }
    let number = counted(bundles.len(), "bundle", "bundles");
    console.say(format!(
        "wrote {number} and {}",
        out.join("index.html").display()
    ));
    Ok(())
}

/// Creates a folder that has nothing in it yet.
fn new_folder(path: &Path) -> Result<(), Failure> {
    let failed = |e| Failure::file(path, &e);
    fs::create_dir_all(path).map_err(failed)?;
    if path.is_symlink() || fs::read_dir(path).map_err(failed)?.next().is_some() {
        let what = format!(
            "{}: not an empty folder, and nothing is overwritten",
            path.display()
        );
        return Err(Failure::input(what).hint("name a new folder"));
    }
    Ok(())
}

/// Writes a file below a folder that [`new_folder`] made.
fn write(folder: &Path, name: &str, content: &[u8]) -> Result<(), Failure> {
    let path = folder.join(name);
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent).map_err(|e| Failure::file(parent, &e))?;
    }
    write_file(&path, |sink| sink.write_all(content))
}
