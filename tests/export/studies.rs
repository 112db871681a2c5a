//! Studies to export: rehearsed, then recorded again as if real people had taken part.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use crate::support::{changed_protocol, copy_folder, study};
use crate::world::real;
use std::fs;
use std::path::{Path, PathBuf};
use study_plan::protocol::Answer;
use study_session::outcome::{Event, FormId};
use study_session::store::{Frozen, StudyFolder};

/// Text with everything that a format may take for its own.
pub(crate) const HOSTILE: &str = "=HYPERLINK(\"http://e\",\"x\")\tTab\r\nnew line, \"quoted\"; 'a' \u{202e}RTL\u{202c} \
    </script><script>alert(1)</script> \u{0}\u{1b}[2J ../../etc/passwd `r quit(status = 0)` $(id) よかった 😀";

/// A title that is R, HTML, a formula and a path.
pub(crate) const TITLE: &str =
    "=1+1 \"); quit(status = 0); (\" </script> `r quit()` ../x \u{202e}RTL\tTab # 研究";

/// Ids that programs take for something else.
pub(crate) const IDS: [&str; 5] = ["NA", "1e5", "TRUE", "001", "0-x_"];

/// The folder of a study in `home/results` whose sessions are those of a rehearsal of the
/// protocol, by real participants with these ids. `change` sees every event and says
/// whether it happened.
pub(crate) fn real_study(
    protocol: &Path,
    ids: &[&str],
    home: &Path,
    mut change: impl FnMut(usize, &mut Event) -> bool,
) -> PathBuf {
    let rehearsal = rehearsed(protocol, ids.len(), home, &[]);
    let loaded = study_analysis::load::load(protocol).unwrap();
    let frozen = Frozen {
        protocol: &loaded.protocol,
        files: &loaded.files,
        fingerprints: &loaded.fingerprints,
    };
    let sessions = StudyFolder::open(&rehearsal).unwrap().sessions().unwrap();
    let begin = sessions[0].entries[0].at;
    let folder = StudyFolder::open_or_create(&home.join("results"), &frozen, begin).unwrap();
    for ((who, id), session) in ids.iter().enumerate().zip(&sessions) {
        let mut claimed = folder.claim(&real(id)).unwrap();
        let mut journal = claimed.folder.journal().unwrap();
        for entry in &session.entries {
            let mut event = entry.event.clone();
            if let Event::SessionStarted(start) = &mut event {
                start.participant = study_base::text::ParticipantId::new(*id).unwrap();
                start.seat = claimed.seat;
                start.operator = "Okafor".to_owned();
            }
            if change(who, &mut event) {
                journal.append(entry.at, &event).unwrap();
            }
        }
        let telemetry = session.path.join("telemetry");
        copy_folder(&telemetry, &claimed.folder.path().join("telemetry"));
    }
    folder.refresh(&loaded.protocol).unwrap();
    folder.path().to_owned()
}

/// The folder of a rehearsal of a protocol.
pub(crate) fn rehearsed(
    protocol: &Path,
    participants: usize,
    home: &Path,
    more: &[&str],
) -> PathBuf {
    let n = participants.to_string();
    let protocol = protocol.to_str().unwrap();
    let arguments = [
        "rehearse",
        protocol,
        "--participants",
        &n,
        "--telemetry",
        "20",
    ];
    let out = ["--out", "rehearsal"];
    let (code, _, err) = study(&[&arguments[..], &out, more].concat(), home);
    assert_eq!(code, 0, "{err}");
    let mut found = fs::read_dir(home.join("rehearsal")).unwrap();
    found.next().unwrap().unwrap().path()
}

/// A protocol whose every text is hostile, with ids that programs take for numbers.
pub(crate) fn hostile_protocol(home: &Path) -> PathBuf {
    let folder = home.join("hostile");
    let title = format!(
        "title = {}\nauthors = [{}, \"B. (0000-0002-1825-0097)\"]\nlicense = \"CC-BY-4.0\"\nethics = \"=1\"\nfunding = \"@f\"\ndoi = \"10.1000/182\"",
        quoted(TITLE),
        quoted(TITLE)
    );
    let prompt = format!(
        "prompt = {}",
        quoted("How <b>real</b>? =1+1 \"); quit(status = 0) #")
    );
    let label = format!("labels = {{ 1 = {}, 7", quoted("=not \"at\" all, ever"));
    changed_protocol(
        "turn-signal",
        &folder,
        &[
            (
                "title = \"Realism of identified turn-signal switch models\"",
                &title,
            ),
            ("prompt = \"How realistic did it feel?\"", &prompt),
            ("labels = { 1 = \"not at all realistic\", 7", &label),
            ("id = \"lambda-0.9991\"", "id = \"NA\""),
            ("id = \"lambda-0.9993\"", "id = \"-1\""),
            ("id = \"lambda-0.9995\"", "id = \"1e5\""),
            ("id = \"lambda-0.9997\"", "id = \"..\""),
            ("id = \"lambda-0.9999\"", "id = \"TRUE\""),
        ],
    );
    folder
}

/// A text in TOML.
pub(crate) fn quoted(text: &str) -> String {
    let mut out = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => out.push_str(&format!("\\u{:04x}", u32::from(c))),
            c => out.push(c),
        }
    }
    out + "\""
}

/// A study with hostile texts, declined and missing answers, and an unfinished session.
pub(crate) fn hostile(home: &Path) -> PathBuf {
    let protocol = hostile_protocol(home);
    let mut stopped = false;
    real_study(&protocol, &IDS, home, |who, event| {
        if let Event::Answered {
            form: FormId::Trial { trial, .. },
            question,
            answer,
            ..
        } = event
        {
            match (question.as_str(), *trial, who) {
                ("comment", 1..=3, _) => *answer = Answer::Text(HOSTILE.to_owned()),
                ("realism", 5, 0) => {
                    *answer = Answer::Declined {
                        reason: HOSTILE.to_owned(),
                    };
                }
                _ => {}
            }
        }
        // The last one did not come to the end.
        stopped |= who == 4 && matches!(event, Event::AttemptStarted { trial: 14.., .. });
        !stopped
    })
}

/// A study in Japanese, with questions before the session.
pub(crate) fn japanese(home: &Path) -> PathBuf {
    let folder = home.join("japanese");
    let intake = "\n[[intake]]\nid = \"age\"\nkind = \"number\"\nprompt = \"年齢\"\nunit = \"歳\"\nmin = 18\n\n\
        [[intake]]\nid = \"sex\"\nkind = \"choice\"\nprompt = \"性別\"\noptions = [\"女性\", \"男性\", \"その他\"]\n\n\
        [[intake]]\nid = \"handedness\"\nkind = \"choice\"\nprompt = \"利き手\"\noptions = [\"左\", \"右\", \"両手\"]\n\n[analysis]\n";
    changed_protocol(
        "turn-signal",
        &folder,
        &[
            (
                "title = \"Realism of identified turn-signal switch models\"",
                "title = \"方向指示器の模型の現実感\"\nauthors = [\"山田 花子\", \"B. Researcher\"]\nlicense = \"CC0-1.0\"",
            ),
            (
                "[session]",
                "[text]\nlang = \"ja\"\ninstructions = \"触って評価してください。\"\n\n[session]",
            ),
            (
                "prompt = \"How realistic did it feel?\"",
                "prompt = \"どのくらい本物らしく感じましたか。\"",
            ),
            (
                "1 = \"not at all realistic\", 7 = \"very realistic\"",
                "1 = \"全く感じない\", 7 = \"非常に感じる\"",
            ),
            ("prompt = \"Comment\"", "prompt = \"コメント\""),
            ("\n[analysis]\n", intake),
        ],
    );
    real_study(&folder, &["P01", "P02", "P03", "P04"], home, |_, event| {
        if let Event::Answered {
            answer: Answer::Text(text),
            ..
        } = event
        {
            *text = "中央の山が遅れて来た。".to_owned();
        }
        true
    })
}

/// The folder of a rehearsal of a study with two groups, of which the second rates fewer
/// realizations, in two sessions.
pub(crate) fn grouped(participants: usize, home: &Path) -> PathBuf {
    let folder = home.join("grouped");
    let parts = "[[parts]]\nid = \"real\"\nkind = \"rating\"\nrepetitions = 2\n\n\
        [groups]\n[[groups.list]]\nid = \"all\"\n[[groups.list]]\nid = \"few\"\n\
        models = [\"lambda-0.9991\", \"lambda-0.9993\", \"lambda-0.9995\"]\n\n\
        [[sessions]]\nid = \"one\"\n[[sessions]]\nid = \"two\"\n\n# Asked after";
    let changes = [
        ("study-protocol/1", "study-protocol/2"),
        ("repetitions = 3\n", ""),
        ("order = \"blocked\"\n", ""),
        ("# Asked after", parts),
    ];
    changed_protocol("turn-signal", &folder, &changes);
    rehearsed(&folder, participants, home, &[])
}

/// A new study of a kind, with two groups and two sessions.
pub(crate) fn of_groups_and_sessions(kind: &str, home: &Path) -> PathBuf {
    let folder = new(kind, home);
    let protocol = folder.join("protocol.toml");
    let more = "\n[groups]\n[[groups.list]]\nid = \"young\"\n[[groups.list]]\nid = \"old\"\n\n\
        [[sessions]]\nid = \"one\"\n[[sessions]]\nid = \"two\"\n";
    let text = fs::read_to_string(&protocol).unwrap() + more;
    // So that a rehearsal takes seconds.
    fs::write(
        protocol,
        text.replace("repetitions = 40", "repetitions = 6"),
    )
    .unwrap();
    folder
}

/// A new factorial study of 2 × 3 levels whose groups are a factor between participants.
pub(crate) fn factorial_with_groups(home: &Path) -> PathBuf {
    let folder = new("factorial", home);
    let protocol = folder.join("protocol.toml");
    let text = fs::read_to_string(&protocol).unwrap();
    let third = |friction: &str| {
        format!(
            "\n[[models]]\nid = \"{friction}-none\"\nfile = \"models/{friction}-soft.toml\"\n\
             levels = {{ friction = \"{friction}\", detent = \"none\" }}\n"
        )
    };
    let changed = [
        ("repetitions = 3\n", ""),
        (
            "levels = [\"soft\", \"crisp\"]",
            "levels = [\"none\", \"soft\", \"crisp\"]",
        ),
        ("friction * detent\"", "friction * detent * group\""),
    ];
    let mut text = changed.iter().fold(text, |text, (old, new)| {
        assert!(text.contains(old), "{old}");
        text.replace(old, new)
    });
    let order = text.lines().find(|l| l.starts_with("order = ")).unwrap();
    text = text.replace(&format!("{order}\n"), "");
    text += &(third("low") + &third("high"));
    text += "\n[[parts]]\nid = \"rating\"\nkind = \"rating\"\nrepetitions = 2\norder = \"blocked\"\n\
             [groups]\n[[groups.list]]\nid = \"novices\"\n[[groups.list]]\nid = \"experts\"\nshare = 2\n";
    // Full strokes are counted, and R fits their model too.
    text += "\n[[outcomes]]\nid = \"presses\"\nfrom = \"telemetry\"\nmeasure = \"strokes\"\nmodel = \"poisson\"\n";
    fs::write(protocol, text).unwrap();
    folder
}

/// A new study of a kind.
pub(crate) fn new(kind: &str, home: &Path) -> PathBuf {
    let (code, _, err) = study(&["new", "--seed", "20261123", kind, "--kind", kind], home);
    assert_eq!(code, 0, "{err}");
    home.join(kind)
}

/// Exports a study into `home/name`; returns the folder and what was said.
pub(crate) fn export(
    study_folder: &Path,
    to: &str,
    home: &Path,
    name: &str,
    more: &[&str],
) -> (PathBuf, String) {
    let results = study_folder.to_str().unwrap();
    let arguments = ["export", results, "--to", to, "--out", name];
    let (code, out, err) = study(&[&arguments[..], more].concat(), home);
    assert_eq!(code, 0, "{to}: {out}{err}");
    (home.join(name), err)
}

/// Every file below a folder: path and bytes.
pub(crate) fn files(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for item in fs::read_dir(&next).unwrap() {
            let path = item.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                let name = path
                    .strip_prefix(folder)
                    .unwrap()
                    .to_str()
                    .unwrap()
                    .to_owned();
                found.push((name, fs::read(&path).unwrap()));
            }
        }
    }
    found.sort();
    found
}
