//! Pictures, videos and sounds of realizations.

use super::{LEAST, good, messages};
use crate::protocol::file::{Content, parse};
use crate::protocol::{MEDIA_WITHIN_MS, Medium, Protocol, fingerprint};
use std::collections::BTreeMap;

/// [`LEAST`] in the newest format, with keys of its first realization and more at its end.
fn with(keys: &str, more: &str) -> String {
    let model = "id = \"a\"\nfile = \"a.toml\"\n";
    assert!(LEAST.contains(model));
    let text = LEAST.replacen(model, &format!("{model}{keys}\n"), 1);
    text.replacen("study-protocol/1", "study-protocol/3", 1) + more
}

const PICTURE: &str = "picture = \"media/a.png\"\nalt = \"wood\"";

#[test]
fn the_files_of_media_are_named_after_all_others() {
    let all = "picture = \"a.png\"\nvideo = \"a.webm\"\nsound = \"a.wav\"\nalt = \"wood\"\ncaption = \"a click\"";
    let text = with(all, "[trial]\nmedia_within_ms = 40\n");
    let protocol = good(&text);
    let media = &protocol.models[0].media;
    let files: Vec<(Medium, &str)> = media.files().map(|(m, f)| (m, f.file.as_str())).collect();
    assert_eq!(
        files,
        [
            (Medium::Picture, "a.png"),
            (Medium::Video, "a.webm"),
            (Medium::Sound, "a.wav")
        ]
    );
    assert_eq!(media.alt.as_deref(), Some("wood"));
    assert_eq!(media.caption.as_deref(), Some("a click"));
    assert_eq!(protocol.trial.media_within_ms, 40.0);
    assert!(protocol.has_media() && protocol.models[1].media.is_empty());
    let named = parse("p", &text).named;
    let kinds: Vec<&Content> = named.iter().map(|named| &named.content).collect();
    assert_eq!(
        kinds,
        [
            &Content::Model,
            &Content::Model,
            &Content::Media(Medium::Picture),
            &Content::Media(Medium::Video),
            &Content::Media(Medium::Sound),
        ]
    );
    assert_eq!(named[2].place, "models[0].picture");
}

#[test]
fn without_a_bound_it_is_the_documented_one() {
    let protocol = good(&with(PICTURE, ""));
    assert_eq!(protocol.trial.media_within_ms, MEDIA_WITHIN_MS);
    let stated = format!("[trial]\nmedia_within_ms = {MEDIA_WITHIN_MS:?}\n");
    assert_eq!(good(&with(PICTURE, &stated)), protocol);
    assert!(!good(LEAST).has_media());
}

#[test]
fn earlier_formats_know_no_media() {
    let text = with(PICTURE, "").replacen("study-protocol/3", "study-protocol/1", 1);
    assert_eq!(
        messages(&text),
        [
            "`models[0].picture` needs the format `study-protocol/3`",
            "`models[0].alt` needs the format `study-protocol/3`",
        ]
    );
}

#[test]
fn media_that_nobody_could_present_see_or_hear_are_refused() {
    for (keys, more, message) in [
        (
            "picture = \"a.png\"",
            "",
            "`models[0]` has a picture and no `alt`",
        ),
        (
            "video = \"a.webm\"",
            "",
            "`models[0]` has a video and no `alt`",
        ),
        (
            "sound = \"a.wav\"\nalt = \"wood\"",
            "",
            "`models[0].alt` has no effect: nothing is seen",
        ),
        (
            "caption = \"a click\"",
            "",
            "`models[0].caption` has no effect: it has no media",
        ),
        (
            "",
            "[trial]\nmedia_within_ms = 40\n",
            "`trial.media_within_ms` has no effect: no realization has media",
        ),
        (
            PICTURE,
            "[session]\nentry = \"experimenter\"\n",
            "only the participant's page shows and plays media, and in this study the experimenter types the answers",
        ),
        (
            "picture = \"../a.png\"\nalt = \"wood\"",
            "",
            "`models[0].picture` cannot be `../a.png`",
        ),
    ] {
        let found = messages(&with(keys, more));
        assert_eq!(
            found.first().map(String::as_str),
            Some(message),
            "{found:?}"
        );
    }
}

#[test]
fn a_hidden_duplicate_looks_and_sounds_like_its_original() {
    let duplicate = |keys: &str| {
        let more = format!("[[models]]\nid = \"c\"\nduplicate_of = \"a\"\n{keys}\n");
        with(PICTURE, &more)
    };
    let protocol = good(&duplicate(""));
    assert!(!protocol.models[2].media.is_empty());
    assert_eq!(protocol.models[2].media, protocol.models[0].media);
    good(&duplicate(PICTURE));
    for other in [
        "picture = \"media/b.png\"\nalt = \"wood\"",
        "picture = \"media/a.png\"\nalt = \"stone\"",
        "sound = \"a.wav\"",
    ] {
        assert_eq!(
            messages(&duplicate(other)),
            ["a duplicate of `a` has to have the same media"],
            "{other}"
        );
    }
}

/// What differs in the fingerprints of two studies: stimulus, wording, analysis.
fn differ(a: &Protocol, b: &Protocol) -> [bool; 3] {
    let of = |p: &Protocol| fingerprint::parts(p, &BTreeMap::new(), None).fingerprints();
    let (a, b) = (of(a), of(b));
    [
        a.stimulus != b.stimulus,
        a.wording != b.wording,
        a.analysis != b.analysis,
    ]
}

#[test]
fn the_content_of_media_is_stimulus_and_their_texts_are_wording() {
    let pinned = |keys: &str, more: &str, hash: &str| {
        let mut protocol = good(&with(keys, more));
        for file in protocol.models.iter_mut().flat_map(|m| m.media.files_mut()) {
            file.sha256 = Some(hash.to_owned());
        }
        protocol
    };
    let first = pinned(PICTURE, "", "00");
    let other = pinned(PICTURE, "", "01");
    assert_eq!(differ(&first, &other), [true, false, false]);
    let moved = pinned("picture = \"b.png\"\nalt = \"wood\"", "", "00");
    assert_eq!(differ(&first, &moved), [false, false, false]);
    let texts = pinned("picture = \"media/a.png\"\nalt = \"stone\"", "", "00");
    assert_eq!(differ(&first, &texts), [false, true, false]);
    let bound = pinned(PICTURE, "[trial]\nmedia_within_ms = 40\n", "00");
    assert_eq!(differ(&first, &bound), [true, false, false]);
    let video = pinned("video = \"media/a.png\"\nalt = \"wood\"", "", "00");
    assert_eq!(differ(&first, &video), [true, false, false]);
}
