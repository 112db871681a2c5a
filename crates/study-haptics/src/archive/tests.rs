use super::*;
use crate::model::coverage::{Determined, Origin};
use crate::recording::force_curve::{self, Source, Stated as OfCurve};

/// A model file of an earlier release, so that the address of its bundle is that of then.
const MODEL_FILE: &str = include_str!("../../tests/data/akko-blue.toml");
const CURVE: &[u8] = include_bytes!("../../../../tests/data/switches/Akko_Blue_V2.csv");

/// The recording of which protocols/keyboard/identify.sh made the model file then, with the name of the curve's file in its header.
fn recording() -> Vec<u8> {
    let curve = force_curve::read(&String::from_utf8_lossy(CURVE)).unwrap();
    let source = Source {
        curve: &curve,
        file: "Akko_Blue_V2.csv",
        sha256: &sha256(CURVE),
    };
    let stated = OfCurve {
        credit: Some("measured by ThereminGoat (theremingoat.com)"),
        file_names: true,
        ..OfCurve::default()
    };
    force_curve::join(&[source], stated)
}

fn stated() -> Stated {
    Stated {
        license: "any use, with credit".to_owned(),
        instrument: "force tester".to_owned(),
        published: "2024-05-17".to_owned(),
        ..Stated::default()
    }
}

fn packed() -> Bundle {
    let recordings = vec![("akko-blue".to_owned(), recording())];
    Bundle::pack(MODEL_FILE.as_bytes(), recordings, stated()).unwrap()
}

/// A bundle with other files.
fn with(change: impl FnOnce(&mut Vec<(String, Vec<u8>)>)) -> Vec<u8> {
    let mut files = packed().files;
    change(&mut files);
    files.sort();
    tar::write(&files).unwrap()
}

/// A bundle in which a text of a file is another one.
fn changed(file: &str, old: &str, new: &str) -> Vec<u8> {
    with(|files| {
        let (_, content) = files.iter_mut().find(|(name, _)| name == file).unwrap();
        let text = String::from_utf8(content.clone()).unwrap();
        assert!(text.contains(old), "{file} has no {old}");
        *content = text.replacen(old, new, 1).into_bytes();
    })
}

/// A bundle with another byte.
fn byte(at: usize, to: u8) -> Vec<u8> {
    let mut bytes = packed().bytes;
    assert_ne!(bytes[at], to);
    bytes[at] = to;
    bytes
}

/// A bundle whose first header has another name or kind, with a checksum that is right.
fn first_header(change: impl FnOnce(&mut [u8])) -> Vec<u8> {
    let mut bytes = packed().bytes;
    change(&mut bytes[..512]);
    bytes[148..156].copy_from_slice(b"        ");
    let sum: u32 = bytes[..512].iter().map(|b| u32::from(*b)).sum();
    bytes[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
    bytes
}

fn named(name: &str) -> Vec<u8> {
    first_header(|header| {
        header[..100].fill(0);
        header[..name.len()].copy_from_slice(name.as_bytes());
    })
}

/// The same bundle, of another model file, which is consistent in itself but for one text.
fn of_model(old: &str, new: &str) -> Result<Bundle, BundleError> {
    assert!(MODEL_FILE.contains(old), "{old}");
    let model = MODEL_FILE.replacen(old, new, 1);
    let recordings = vec![("akko-blue".to_owned(), recording())];
    Bundle::pack(model.as_bytes(), recordings, stated())
}

#[test]
fn equal_recordings_give_equal_bytes_and_come_back() {
    let bundle = packed();
    let elsewhere = Bundle::pack(
        MODEL_FILE.as_bytes(),
        // The name of a file and copies of it do not matter, and the header has the credit already.
        vec![("b".to_owned(), recording()), ("a".to_owned(), recording())],
        Stated {
            credit: "measured by ThereminGoat (theremingoat.com)".to_owned(),
            ..stated()
        },
    );
    assert_eq!(elsewhere.unwrap().bytes, bundle.bytes);
    let opened = Bundle::open(&bundle.bytes).unwrap();
    assert_eq!(opened, bundle);
    assert_eq!(opened.model(), MODEL_FILE.as_bytes());
    assert_eq!(opened.recordings[0].bytes, recording());
    assert!(bundle.differences(&opened).is_empty());
    // A change of this value makes bundles of earlier versions unreadable.
    assert_eq!(
        bundle.sha256(),
        "07de16834344205020052fe5e553772858fd0a7f24566cedb0fe872d8f964da3"
    );
}

#[test]
fn every_wrong_bundle_is_refused_with_its_cause() {
    let bundle = packed();
    let end = bundle.bytes.len();
    let at = |text: &str| {
        let found = bundle
            .bytes
            .windows(text.len())
            .position(|w| w == text.as_bytes());
        found.unwrap()
    };
    let manifest = |old, new| changed(MANIFEST, old, new);
    let cases: Vec<(Vec<u8>, &str)> = vec![
        (b"no archive".to_vec(), "it is not a tar archive"),
        (bundle.bytes[..end / 2].to_vec(), "the copy is not complete"),
        (
            bundle.bytes[..end - 512].to_vec(),
            "the copy is not complete",
        ),
        ([&bundle.bytes[..], &[0]].concat(), "bytes follow the end"),
        // a byte of a recording, the model, a document, a header, the filling of a block
        (
            byte(at("t_s,x_mm") + 1000, b'!'),
            "recordings/01.csv was changed",
        ),
        (
            byte(at("delta_mm = 0.1") + 13, b'2'),
            "model.toml was changed",
        ),
        (
            byte(at("CreateAction"), b'K'),
            "ro-crate-metadata.json was changed",
        ),
        (
            byte(at("commentChar"), b'k'),
            "datapackage.json was changed",
        ),
        (
            byte(100, b'1'),
            "the header of `datapackage.json` was changed",
        ),
        (
            byte(at("model.toml\0") + 137, b'7'),
            "the header of `model.toml` was changed",
        ),
        (byte(end - 1025, 1), "was changed"),
        // names, links, sizes
        (named(""), "a file in it has no name"),
        (
            named("../../.bashrc"),
            "`../../.bashrc` could lead out of a folder",
        ),
        (
            named("/etc/passwd"),
            "`/etc/passwd` could lead out of a folder",
        ),
        (
            named("a\u{1b}[2Jb"),
            "`a\\u{1b}[2Jb` could lead out of a folder",
        ),
        (
            first_header(|h| h[156] = b'2'),
            "`datapackage.json` is a link",
        ),
        (
            first_header(|h| h[156] = b'5'),
            "`datapackage.json` is a folder",
        ),
        (first_header(|h| h[124..135].fill(b'7')), "bytes, more than"),
        (
            named("zzz"),
            "`model.toml` is not in the order of the names, or occurs twice",
        ),
        // files that are not there, or too many
        (
            with(|files| files.retain(|(n, _)| n != MANIFEST)),
            "there is no file `stimulus.toml`",
        ),
        (
            with(|files| files.retain(|(n, _)| n != &path(0))),
            "there is no file `recordings/01.csv`",
        ),
        (
            with(|files| files.push(("notes.txt".to_owned(), vec![1]))),
            "has no file `notes.txt`",
        ),
        (
            with(|files| files.extend((0..99).map(|i| (format!("n{i}"), vec![])))),
            "more than 100 files",
        ),
        // what it says of itself
        (
            manifest("stimulus/1", "stimulus/2"),
            "a newer version of study may read it",
        ),
        (
            manifest("license = \"any use, with credit\"\n", ""),
            "the license is not stated",
        ),
        (
            manifest("\"any use, with credit\"", "\" \""),
            "the license is not stated",
        ),
        (
            manifest("\"any use, with credit\"", "\"CC0-1.0\""),
            "datapackage.json was changed",
        ),
        (
            manifest("2024-05-17", "2024-17-05"),
            "`2024-17-05` is not a date",
        ),
        (
            manifest("2024-05-17", "2023-02-29"),
            "`2023-02-29` is not a date",
        ),
        (
            manifest("measured by ThereminGoat", "measured by us"),
            "the credit is stated as `measured by us (theremingoat.com)`, and the recording `akko-blue` has",
        ),
        (
            manifest("force tester", "force\\u0007tester"),
            "the instrument has control characters",
        ),
        (
            manifest("[coverage]", "\n[coverage]"),
            "line 16 was changed",
        ),
        (
            manifest("passes = true", "passes = false"),
            "the certificate does not belong to the model: certificate: passes is stated as false, and the model has true",
        ),
        (
            manifest(
                &format!("model = \"{}", sha256(MODEL_FILE)),
                &format!("model = \"{}", sha256("another")),
            ),
            "the certificate does not belong to the model: certificate: model is stated as",
        ),
        (
            manifest("[certificate]", "[certificat]"),
            "the certificate does not belong",
        ),
        (
            manifest("x_mm = [-0.035, 3.525]", "x_mm = [-0.035, 30.0]"),
            "states coverage: x_mm as [-0.035, 30.0], which model and recordings do not give: [-0.035, 3.525]",
        ),
        (
            manifest("use = \"training\"", "use = \"validation\""),
            "states recordings 1: use as",
        ),
        (
            manifest("rows = ", "rows = 1"),
            "states recordings 1: rows as",
        ),
    ];
    assert!(cases.len() >= 15);
    for (bytes, cause) in cases {
        let found = match Bundle::open(&bytes) {
            Ok(_) => panic!("not refused: {cause}"),
            Err(error) => error.to_string(),
        };
        assert!(found.contains(cause), "{found} instead of {cause}");
    }
}

#[test]
fn what_cannot_be_packed_is_named() {
    let hash = sha256(recording());
    for (result, cause) in [
        (
            of_model(&hash, &sha256("x")),
            "from another recording `akko-blue`",
        ),
        (
            of_model("akko-blue = \"f59", "sibling = \"aa\"\nakko-blue = \"f59"),
            "the recording `sibling`, from which the model was identified, is not among",
        ),
        (
            of_model(&format!("akko-blue = \"{hash}\""), ""),
            "names no recording",
        ),
        (
            of_model("delta_mm = 0.1", "delta_mm = nan"),
            "model.toml: `direction.delta_mm` has to be",
        ),
    ] {
        let found = result.unwrap_err().to_string();
        assert!(found.contains(cause), "{found} instead of {cause}");
    }
    let pack = |recordings, stated| {
        let result = Bundle::pack(MODEL_FILE.as_bytes(), recordings, stated);
        result.unwrap_err().to_string()
    };
    let own = || vec![("akko-blue".to_owned(), recording())];
    let stranger = (
        "x\u{202e}".to_owned(),
        b"t_s,x_mm,f_n\n0,1,1\n1,2,2\n2,1,1\n".to_vec(),
    );
    assert_eq!(
        pack(vec![stranger], stated()),
        "the model file does not name the recording `x\\u{202e}`, neither as its source nor with a VAF"
    );
    for (key, missing) in [
        (
            "license",
            Stated {
                license: String::new(),
                ..stated()
            },
        ),
        (
            "instrument",
            Stated {
                instrument: "\u{a0}".to_owned(),
                ..stated()
            },
        ),
        (
            "day",
            Stated {
                published: "17.5.2024".to_owned(),
                ..stated()
            },
        ),
    ] {
        let found = pack(own(), missing);
        assert!(found.contains(key), "{found}");
    }
}

/// A model of another switch, or in other units, that names a recording as its source.
#[test]
fn a_model_that_has_nothing_to_do_with_its_recording_is_refused() {
    let mut other = realization(MODEL_FILE.as_bytes()).unwrap();
    for branch in [&mut other.positive, &mut other.negative] {
        let numbers = branch.k_n_per_mm.iter_mut().chain(&mut branch.f0_n);
        numbers.for_each(|number| *number *= 20.0);
    }
    let model = file::write(&other);
    let recordings = vec![("akko-blue".to_owned(), recording())];
    let packed = Bundle::pack(model.as_bytes(), recordings, stated());
    let found = packed.unwrap_err().to_string();
    assert!(
        found.contains("`akko-blue`, but predicts its force worse than a constant (VAF -3"),
        "{found}"
    );
}

/// Such a model would pass every check of its own: 5 N more everywhere, and coverage that no recording has.
#[test]
fn a_model_that_says_more_than_its_recording_is_refused() {
    let changed = |change: &dyn Fn(&mut Realization)| {
        let mut other = realization(MODEL_FILE.as_bytes()).unwrap();
        change(&mut other);
        let recordings = vec![("akko-blue".to_owned(), recording())];
        let packed = Bundle::pack(file::write(&other).as_bytes(), recordings, stated());
        packed.map(|_| ()).map_err(|e| e.to_string())
    };
    assert_eq!(changed(&|_| {}), Ok(()));
    let stronger = changed(&|other| {
        for branch in [&mut other.positive, &mut other.negative] {
            branch.f0_n.iter_mut().for_each(|force_n| *force_n += 5.0);
        }
    });
    let said = stronger.unwrap_err();
    assert!(
        said.contains("worse than a constant") && said.contains("+5.0"),
        "{said}"
    );
    for (what, change) in [
        (
            "wider",
            (|other| other.trained.x_mm = [-10.0, 30.0]) as fn(&mut Realization),
        ),
        ("faster", |other| other.trained.v_mm_s = 200.0),
    ] {
        let said = changed(&change).unwrap_err();
        assert!(
            said.contains("and its recordings go from"),
            "{what}: {said}"
        );
    }
}

#[test]
fn days_are_those_of_the_calendar() {
    for day in ["2024-02-29", "2000-02-29", "2024-04-30", "2023-12-31"] {
        assert!(is_day(day), "{day}");
    }
    for none in ["2023-02-29", "1900-02-29", "2024-04-31", "2024-13-01"] {
        assert!(!is_day(none), "{none}");
    }
}

/// What a person stated of a model is told apart from what recordings say.
#[test]
fn a_stated_mass_is_a_fact_of_the_bundle() {
    let mut weighed = realization(MODEL_FILE.as_bytes()).unwrap();
    let mass = Determined {
        value: Some(0.002),
        origin: Origin::Stated,
        ..Determined::default()
    };
    (weighed.provenance.terms).insert("m_kg".to_owned(), mass);
    let model = file::write(&weighed);
    let recordings = vec![("akko-blue".to_owned(), recording())];
    let bundle = Bundle::pack(model.as_bytes(), recordings, stated()).unwrap();
    let stated = (bundle.facts().iter()).find(|fact| fact.section == "terms");
    let stated = stated.map(|fact| (fact.key.as_str(), fact.value.as_str()));
    assert_eq!(stated, Some(("m_kg", "\"stated\"")));
    assert_eq!(Bundle::open(&bundle.bytes).unwrap(), bundle);
    let of_recordings = (packed().facts.iter()).any(|fact| fact.section == "terms");
    assert!(!of_recordings);
}

/// A recording with which the model was only validated goes by its name, which may have anything.
#[test]
fn validation_recordings_are_kept_apart() {
    let name = "a = \"b\"] = [\u{7}";
    let model = format!("{MODEL_FILE}\n[vaf]\n\"a = \\\"b\\\"] = [\\u0007\" = 0.5\n");
    let other = b"# credit: measured by ThereminGoat (theremingoat.com)\nt_s;x_mm;f_n;note\n0;1,5;1;9\n1;2;2;9\n2;1;1;9\n";
    let recordings = vec![
        (name.to_owned(), other.to_vec()),
        ("z".to_owned(), recording()),
    ];
    let bundle = Bundle::pack(model.as_bytes(), recordings, stated()).unwrap();
    let opened = Bundle::open(&bundle.bytes).unwrap();
    let kept: Vec<_> = opened
        .recordings
        .iter()
        .map(|k| (k.recording.name.as_str(), k.purpose))
        .collect();
    assert_eq!(
        kept,
        [
            ("akko-blue", Purpose::Training),
            (name, Purpose::Validation)
        ]
    );
    let own = packed();
    let differences = own.differences(&opened);
    let names: Vec<&str> = differences.iter().map(|(name, _)| name.as_str()).collect();
    assert_eq!(names[..2], ["fingerprint", "certificate: model"]);
    assert!(
        names.iter().any(|name| name.starts_with("validation: ")),
        "{names:?}"
    );
    let package = opened
        .files()
        .find(|(name, _)| *name == "datapackage.json")
        .unwrap()
        .1;
    let package: serde_json::Value = serde_json::from_slice(package).unwrap();
    assert_eq!(package["resources"][1]["dialect"]["delimiter"], ";");
    assert_eq!(
        package["resources"][1]["schema"]["fields"][1]["decimalChar"],
        ","
    );
    assert_eq!(
        package["resources"][1]["schema"]["fields"][3]["type"],
        "any"
    );
}

#[test]
fn what_a_hand_finds_first() {
    let bundle = packed();
    let feel = Feel::of(&bundle.realization);
    assert!((feel.travel - 3.56).abs() < 1e-9, "{feel:?}");
    // 8.1 gf of the protocol's covariates, on the nodes of the table
    assert!((feel.tactility / 0.00980665 - 8.1).abs() < 1.5, "{feel:?}");
    assert!((0.05..0.3).contains(&feel.tactility_share), "{feel:?}");
    let mut spring = bundle.realization;
    for (f0, x) in spring.positive.f0_n.iter_mut().zip(&spring.x_mm) {
        *f0 = 0.5 * x;
    }
    assert_eq!(Feel::of(&spring).tactility, 0.0);
}
