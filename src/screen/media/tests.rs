use super::*;
use study_base::text::ModelId;
use study_plan::protocol::{MediaFile, example};

const PNG: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x01";
const WAV: &[u8] = b"RIFF\x24\0\0\0WAVEfmt ";

/// A and B show the same picture from two files, C plays a sound, D has nothing.
fn gallery() -> Gallery {
    let mut protocol = example::protocol(4, 1);
    let file = |file: &str, bytes: &[u8]| {
        let file = file.to_owned();
        let sha256 = Some(sha256(bytes));
        Some(MediaFile { file, sha256 })
    };
    for (model, name) in protocol.models[..2].iter_mut().zip(["m/a.png", "m/b.png"]) {
        model.media.picture = file(name, PNG);
        model.media.alt = Some("a drawer".to_owned());
    }
    protocol.models[2].media.sound = file("m/c.wav", WAV);
    let files = [("m/a.png", PNG), ("m/b.png", PNG), ("m/c.wav", WAV)];
    let files = files.map(|(name, bytes)| (name.to_owned(), bytes.to_vec()));
    Gallery::of(&protocol, &files).unwrap()
}

fn of(gallery: &Gallery, id: &str) -> Vec<Shown> {
    let id = ModelId::new(id).unwrap();
    gallery.shows.get(&id).cloned().unwrap_or_default()
}

#[test]
fn what_looks_the_same_has_the_same_name_and_no_name_tells_anything() {
    let first = gallery();
    assert_eq!(of(&first, "A"), of(&first, "B"));
    assert_eq!(of(&first, "A")[0].alt.as_deref(), Some("a drawer"));
    assert!(of(&first, "D").is_empty());
    assert_eq!(first.shows.len(), 3);
    let stage = Stage::new(first);
    let list = stage.list();
    assert_eq!(list.matches("\"id\"").count(), 2, "{list}");
    for word in ["m/", "png", "wav", &sha256(PNG)[..8], "A", "drawer"] {
        assert!(!list.contains(word), "{word}: {list}");
    }
    let id = of(&stage.gallery, "A")[0].id.clone();
    assert_eq!(id.len(), NAME);
    let (content_type, bytes) = stage.file(&id).unwrap();
    assert_eq!((content_type, &*bytes), ("image/png", PNG));
    assert!(stage.file("m/a.png").is_none() && stage.file("").is_none());
    // Another run has other names.
    assert_ne!(of(&gallery(), "A")[0].id, id);
}

#[test]
fn a_study_without_media_has_no_stage() {
    let stage = Stage::new(Gallery::of(&example::protocol(2, 1), &[]).unwrap());
    assert!(!stage.is_needed() && stage.shows().is_none());
    assert_eq!(stage.notice(), None);
    assert!(stage.inputs().is_empty());
}

fn here(stage: &Stage, tab: &str, first: bool, state: &str) -> Result<String, u16> {
    let body = serde_json::json!({ "tab": tab, "first": first, "state": state });
    stage.here(body.to_string().as_bytes(), Instant::now())
}

#[test]
fn the_tab_that_was_opened_last_presents() {
    let stage = Stage::new(gallery());
    assert_eq!(here(&stage, "a", false, "ready"), Err(409), "never opened");
    assert!(here(&stage, "a", true, "loading").is_ok());
    let ready = |ready| Input::Media(MediaReport::Here { ready });
    assert!(stage.notice().unwrap().contains("loading"));
    assert!(here(&stage, "a", false, "ready").is_ok());
    assert_eq!(stage.inputs(), [ready(true)], "the last one counts");
    assert_eq!(stage.notice(), None);
    assert!(here(&stage, "b", true, "locked").is_ok());
    assert_eq!(here(&stage, "a", false, "ready"), Err(409));
    assert_eq!(stage.inputs(), [ready(false)]);
    assert!(stage.notice().unwrap().contains("touched once"));
    for body in [
        &b"{}"[..],
        b"[]",
        br#"{"tab":"","first":true,"state":"ready"}"#,
        br#"{"tab":"a","first":true,"state":"fine"}"#,
        br#"{"tab":"a","first":true,"state":"ready","more":1}"#,
    ] {
        assert_eq!(stage.here(body, Instant::now()), Err(400));
    }
    let long = "x".repeat(MOST_TAB + 1);
    assert_eq!(here(&stage, &long, true, "ready"), Err(400));
}

#[test]
fn an_onset_by_the_clock_of_this_program_is_so_long_ago() {
    let stage = Stage::new(gallery());
    let times = here(&stage, "a", true, "ready").unwrap();
    let times: serde_json::Value = serde_json::from_str(&times).unwrap();
    let (arrived, left) = (&times["arrived_ms"], &times["left_ms"]);
    let arrived = arrived.as_f64().unwrap();
    assert!(left.as_f64().unwrap() >= arrived);
    let began = Instant::now();
    let onset = |tab: &str| {
        let body = serde_json::json!({
            "says": "onset", "tab": tab, "cue": 3, "medium": "picture",
            "at_ms": arrived - 40.0, "uncertainty_ms": 1.5,
        });
        stage.told(body.to_string().as_bytes())
    };
    assert_eq!(onset("b"), Err(409), "another tab presents");
    assert_eq!(onset("a"), Ok(()));
    let inputs = stage.inputs();
    let most = began.elapsed().as_secs_f64() + 0.5;
    let [
        Input::Media(MediaReport::Here { ready: true }),
        Input::Media(MediaReport::Onset {
            cue: 3,
            medium: Medium::Picture,
            ago_s,
            uncertainty_s,
        }),
    ] = inputs[..]
    else {
        panic!("{inputs:?}");
    };
    assert!((0.04..=0.04 + most).contains(&ago_s), "{ago_s}");
    assert!((uncertainty_s - 0.0015).abs() < 1e-12);
}

#[test]
fn what_the_page_says_is_bounded_and_cannot_put_words_into_a_journal() {
    let stage = Stage::new(gallery());
    assert!(here(&stage, "a", true, "ready").is_ok());
    let lost = br#"{"says":"lost","tab":"a","cue":1,"why":"hidden"}"#;
    let taken = (0..1000).filter(|_| stage.told(lost).is_ok()).count();
    assert_eq!(taken, WAITING - 1);
    assert_eq!(stage.told(lost), Err(503));
    assert_eq!(stage.inputs().len(), WAITING);
    for body in [
        &b"{}"[..],
        br#"{"says":"lost","tab":"a","cue":1,"why":"=1+1"}"#,
        br#"{"says":"lost","tab":"a","cue":-1,"why":"hidden"}"#,
        br#"{"says":"onset","tab":"a","cue":1,"medium":"smell","at_ms":1,"uncertainty_ms":1}"#,
        br#"{"says":"onset","tab":"a","cue":1,"medium":"sound","at_ms":null,"uncertainty_ms":1}"#,
        br#"{"says":"onset","tab":"a","cue":1,"medium":"sound","at_ms":1}"#,
    ] {
        assert_eq!(stage.told(body), Err(400));
    }
}
