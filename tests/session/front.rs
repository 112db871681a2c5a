//! Fronts beside the real program: the example takes part in a whole session, and fronts that
//! vanish, flood, lie and hang stop the device and lose no answer.

use crate::json_schema::check;
use crate::plain::{find, segments, short};
use crate::support::{HURRY, PATIENCE, PATIENT, changed_protocol, repository, study};
use serde_json::{Value, json};
use std::fs::{self, File, OpenOptions};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// The schema of docs/page.md, which here allows nothing that it does not describe.
pub(crate) fn schema() -> Value {
    fn close(value: &mut Value) {
        if value.get("properties").is_some() && value.get("additionalProperties").is_none() {
            value["additionalProperties"] = json!(false);
        }
        match value {
            Value::Object(map) => map.values_mut().for_each(close),
            Value::Array(list) => list.iter_mut().for_each(close),
            _ => {}
        }
    }
    let text = fs::read_to_string(repository("docs/study-page-1.schema.json")).unwrap();
    let mut schema = serde_json::from_str(&text).unwrap();
    close(&mut schema);
    schema
}

/// `study run --plain --front`, with what it prints.
struct Session {
    child: Child,
    stdin: ChildStdin,
    said: Arc<Mutex<String>>,
}

impl Session {
    fn start(folder: &Path, protocol: &Path, front: &str) -> Self {
        let mut child = Command::new(crate::support::program())
            .arg("run")
            .arg(protocol)
            .args(["--plain", "--front", front])
            .env(HURRY.0, HURRY.1)
            .current_dir(folder)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::inherit())
            .spawn()
            .unwrap();
        let out = BufReader::new(child.stdout.take().unwrap());
        let said = Arc::new(Mutex::new(String::new()));
        let heard = said.clone();
        std::thread::spawn(move || {
            for line in out.lines().map_while(Result::ok) {
                *heard.lock().unwrap() += &(line + "\n");
            }
        });
        let mut stdin = child.stdin.take().unwrap();
        stdin.write_all(b"P01\nlw\n").unwrap();
        Self { child, stdin, said }
    }

    fn said(&self) -> String {
        self.said.lock().unwrap().clone()
    }

    fn wait_for(&self, words: &str) {
        self.wait_after(0, words);
    }

    /// Waits for words after so many bytes.
    fn wait_after(&self, bytes: usize, words: &str) {
        let begin = Instant::now();
        while !self.said()[bytes..].contains(words) {
            assert!(begin.elapsed() < PATIENCE, "{words}:\n{}", self.said());
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// The experimenter closes or leaves the session by typing.
    fn end(&mut self, lines: &[&str]) {
        for line in lines {
            writeln!(self.stdin, "{line}").unwrap();
        }
        assert!(self.child.wait().unwrap().success(), "{}", self.said());
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn journal(folder: &Path) -> Vec<Value> {
    let mut journals = Vec::new();
    find(&folder.join("results/turn-signal"), &mut journals);
    assert_eq!(journals.len(), 1, "{journals:?}");
    segments(&journals[0])
}

/// The example beside the tests' own binary, built if it is not there.
fn example() -> String {
    let own = std::env::current_exe().unwrap();
    let profile = own.ancestors().nth(2).unwrap();
    let name = format!("front{}", std::env::consts::EXE_SUFFIX);
    let example = profile.join("examples").join(name);
    let mut build = Command::new(env!("CARGO"));
    build.args(["build", "--quiet", "--example", "front"]);
    build.args(profile.ends_with("release").then_some("--release"));
    build.current_dir(repository("."));
    assert!(build.status().unwrap().success());
    example.to_str().unwrap().to_owned()
}

#[test]
fn the_example_takes_part_in_a_whole_session() {
    let folder = tempfile::tempdir().unwrap();
    let protocol = short(folder.path());
    let mut session = Session::start(folder.path(), &protocol, &example());
    session.wait_for("Press Enter to close");
    session.end(&[""]);
    let journal = journal(folder.path());
    assert_eq!(journal[0]["claim"]["seat"], json!({"simulated": 1}));
    assert_eq!(journal[1]["front"], "example 1");
    let ratings = folder.path().join("results/turn-signal/ratings.csv");
    assert!(fs::read_to_string(ratings).unwrap().contains(",example 1"));
    let rated = journal
        .iter()
        .filter(|e| e["event"] == "answered" && e["question"] == "realism");
    let channels: Vec<&Value> = rated.map(|e| &e["channel"]).collect();
    assert_eq!(channels, [&json!("page"); 5]);
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}");
}

#[test]
fn a_command_that_is_no_front_is_refused_before_the_session() {
    let folder = tempfile::tempdir().unwrap();
    let path = repository("protocols/turn-signal");
    for (command, why) in [
        ("no-such-program", "there is no such program"),
        ("true", "has ended with exit status 0"),
        ("echo hello", "its first line says who it is"),
        (
            r#"echo '{"format":"study-page/2","front":"x"}'"#,
            "supports study-page/1",
        ),
        (
            r#"echo '{"format":"study-page/1","front":""}'"#,
            "1 to 64 characters",
        ),
    ] {
        let run = ["run", path.as_str(), "--plain", "--front", command];
        let (code, _, err) = study(&run, folder.path());
        assert_eq!(code, 2, "{command}: {err}");
        assert!(
            err.contains(why) && err.contains("docs/page.md"),
            "{command}: {err}"
        );
    }
    let cloth = repository("protocols/cloth");
    let (code, _, err) = study(&["run", &cloth, "--front", "true"], folder.path());
    assert!(code != 0 && err.contains("run it without --front"), "{err}");
    assert!(!folder.path().join("results").exists());
}

/// A front whose lines the test writes and reads.
struct Relay {
    folder: PathBuf,
    /// The numbers of its two programs, by which they are killed.
    pids: String,
    input: BufReader<File>,
    output: File,
    schema: Value,
    replies: u32,
    page: Value,
}

/// Two programs of the shell that pass lines on. Each start has pipes of its own, so that one
/// that ends takes no line of the next, however late the test turns to it.
const SCRIPT: &str = "cd $(dirname $0)\nmkfifo in.$$ out.$$\ncat < out.$$ 2> /dev/null &\necho $$ $! > pids.new\nmv pids.new pids\nexec cat > in.$$\n";

impl Relay {
    fn command(folder: &Path) -> String {
        fs::write(folder.join("front.sh"), SCRIPT).unwrap();
        format!("sh {}", folder.join("front.sh").display())
    }

    /// Takes the place of the front once another one than `before` is started.
    fn open(folder: &Path, before: &str) -> Self {
        let begin = Instant::now();
        let pids = loop {
            match fs::read_to_string(folder.join("pids")) {
                Ok(pids) if pids != before => break pids,
                _ => assert!(begin.elapsed() < PATIENCE, "no front is started"),
            }
            std::thread::sleep(Duration::from_millis(5));
        };
        let own = pids.split(' ').next().unwrap();
        let input = File::open(folder.join(format!("in.{own}"))).unwrap();
        let output = OpenOptions::new()
            .write(true)
            .open(folder.join(format!("out.{own}")))
            .unwrap();
        let mut relay = Self {
            input: BufReader::new(input),
            output,
            folder: folder.to_owned(),
            pids,
            schema: schema(),
            replies: 0,
            page: Value::Null,
        };
        relay.writes(br#"{"format":"study-page/1","front":"relay"}"#);
        assert_eq!(relay.line()["say"], "hello");
        relay
    }

    /// Opens it again after it was lost.
    fn again(self) -> Self {
        Self::open(&self.folder, &self.pids)
    }

    fn writes(&mut self, line: &[u8]) {
        // A front that is killed while it writes is the matter of some tests.
        let _ = self.output.write_all(&[line, b"\n"].concat());
    }

    /// The next line but pings, which are answered.
    fn line(&mut self) -> Value {
        loop {
            let mut line = String::new();
            assert_ne!(
                self.input.read_line(&mut line).unwrap(),
                0,
                "the end of the lines"
            );
            let line: Value = serde_json::from_str(&line).unwrap();
            let at = format!("/{}", line["say"].as_str().unwrap());
            check(&self.schema, &self.schema["$defs"][&at[1..]], &line, &at).unwrap();
            match line["say"].as_str() {
                Some("ping") => self.writes(br#"{"does":"pong"}"#),
                _ => return line,
            }
        }
    }

    /// Reads on until a page is as wanted; replies on the way where something is asked.
    fn play(&mut self, fine: fn(&Value) -> bool) -> Value {
        while !fine(&self.page) {
            let before = self.page["id"].clone();
            let button = enabled(&self.page);
            if let Some(does) = button {
                self.reply(&does);
                if self.settled()["outcome"] == "saved" && self.page["id"] == before {
                    self.read();
                }
            } else {
                self.read();
            }
        }
        self.page.clone()
    }

    fn read(&mut self) {
        let line = self.line();
        if line["say"] == "page" {
            self.page = line;
        }
    }

    fn reply(&mut self, does: &str) {
        self.replies += 1;
        let asked = self.page["questions"].as_array().into_iter().flatten();
        let given = |q: &Value| match q["field"]["kind"].as_str().unwrap() {
            "text" => json!(""),
            "choice" => json!([0]),
            _ => json!("5"),
        };
        let answers: serde_json::Map<_, _> = asked
            .map(|q| (q["id"].as_str().unwrap().to_owned(), given(q)))
            .collect();
        let reply = json!({"page": self.page["id"], "key": self.replies.to_string(),
            "shown_ms": 500, "does": does, "answers": answers});
        let told = &self.schema["$defs"]["reply"];
        check(&self.schema, told, &reply, "reply").unwrap();
        self.writes(reply.to_string().as_bytes());
    }

    /// What became of the last reply; pages that come meanwhile are shown.
    fn settled(&mut self) -> Value {
        let key = json!(self.replies.to_string());
        loop {
            let line = self.line();
            match line["say"].as_str() {
                Some("settled") if line["key"] == key => return line,
                Some("page") => self.page = line,
                _ => {}
            }
        }
    }

    fn kill(&self) {
        let mut kill = Command::new("kill");
        kill.arg("-9").args(self.pids.split_whitespace());
        assert!(kill.status().unwrap().success());
    }
}

fn enabled(page: &Value) -> Option<String> {
    let mut buttons = page["buttons"].as_array().into_iter().flatten();
    let button = buttons.find(|b| b["enabled"] == true)?;
    Some(button["does"].as_str().unwrap().to_owned())
}

fn is_playing(page: &Value) -> bool {
    page["kind"] == "playing"
}

fn is_stopped(page: &Value) -> bool {
    page["kind"] == "stopped"
}

fn is_rating(page: &Value) -> bool {
    page["questions"][0]["id"] == "realism"
}

fn of(journal: &[Value], event: &str) -> usize {
    journal.iter().filter(|e| e["event"] == event).count()
}

/// A session with a front, of a study in which a playback lasts until somebody ends it.
fn patient() -> (TempDir, Session, Relay) {
    let folder = tempfile::tempdir().unwrap();
    let protocol = folder.path().join("patient");
    let once = ("repetitions = 3", "repetitions = 1");
    changed_protocol("turn-signal", &protocol, &[PATIENT, once]);
    let command = Relay::command(folder.path());
    let session = Session::start(folder.path(), &protocol, &command);
    let relay = Relay::open(folder.path(), "");
    (folder, session, relay)
}

/// Whatever a front does wrong in the middle of a playback, the device stops, the reason is
/// said, and the front that is started again goes on where the session is.
#[test]
fn a_front_that_is_lost_stops_the_device_and_no_answer_is_lost() {
    let (folder, mut session, mut relay) = patient();
    relay.play(is_rating);
    relay.reply("answer");
    assert_eq!(relay.settled()["outcome"], "saved");
    let flood = b"{\"does\":\"pong\"}\n".repeat(20_000);
    let taps: Vec<u8> = (0..20_000)
        .flat_map(|key| {
            format!("{{\"page\":\"1\",\"key\":\"f{key}\",\"shown_ms\":500,\"does\":\"advance\"}}\n")
                .into_bytes()
        })
        .collect();
    let long = format!("{{\"does\":\"{}\"}}", "x".repeat(300_000));
    let wrong: [(&[u8], &str); 9] = [
        (b"no json", "its line"),
        (b"\xff\xfe\"", "its line"),
        (br#"{"does":"jump"}"#, "unknown variant"),
        (
            br#"{"page":"1","key":"","shown_ms":500,"does":"advance"}"#,
            "1 to 64 bytes",
        ),
        (
            br#"{"page":"1","key":"a","shown_ms":500,"does":"advance","new":1}"#,
            "unknown field",
        ),
        (
            br#"{"page":"1","key":"a","shown_ms":500,"does":"quit"}"#,
            "unknown variant",
        ),
        (long.as_bytes(), "longer than"),
        (&flood, "it sends too much"),
        (&taps, "without waiting"),
    ];
    for (line, why) in wrong {
        relay.play(is_playing);
        let before = session.said().len();
        relay.writes(line);
        session.wait_after(before, why);
        relay = relay.again();
        relay.play(is_stopped);
        let journal = journal(folder.path());
        let last = journal
            .iter()
            .rev()
            .find(|e| e["event"] == "playback_ended");
        assert_eq!(last.unwrap()["stopped"], true, "{why}");
        assert_eq!(
            of(&journal, "answered") - 1,
            1,
            "{why}: the first rating and its comment"
        );
    }
    // Killed from outside.
    relay.play(is_playing);
    let before = of(&journal(folder.path()), "playback_ended");
    let said = session.said().len();
    relay.kill();
    session.wait_after(said, "the participant's front is lost: the program");
    relay = relay.again();
    relay.play(is_stopped);
    assert_eq!(of(&journal(folder.path()), "playback_ended"), before + 1);
    // The same keys as before: they are those of another front.
    relay.play(|page| page["kind"] == "end");
    session.end(&[""]);
    let journal = journal(folder.path());
    assert_eq!(of(&journal, "trial_done"), 5);
    let (code, out, err) = study(&["verify", "results"], folder.path());
    assert_eq!(code, 0, "{out}{err}{}", session.said());
}

#[test]
fn a_stop_is_taken_behind_a_flood_and_replies_to_other_pages_change_nothing() {
    let (folder, mut session, mut relay) = patient();
    relay.play(is_playing);
    // Stale replies, nearly as many as may wait, and a stop behind them.
    for key in 0..7 {
        let stale =
            json!({"page": "0.1", "key": format!("s{key}"), "shown_ms": 500, "does": "advance"});
        relay.writes(stale.to_string().as_bytes());
    }
    relay.writes(br#"{"does":"stop"}"#);
    relay.play(is_stopped);
    let page = relay.play(is_rating);
    // Before the page could be read, and to a page that is gone.
    for (id, shown_ms) in [(page["id"].clone(), 20), (json!("0.1"), 500)] {
        relay.replies += 1;
        let reply = json!({"page": id, "key": relay.replies.to_string(), "shown_ms": shown_ms,
            "does": "answer", "answers": {"realism": "5"}});
        relay.writes(reply.to_string().as_bytes());
        assert_eq!(relay.settled()["outcome"], "stale");
    }
    assert_eq!(of(&journal(folder.path()), "answered"), 0);
    let refused = json!({"page": page["id"], "key": "r", "shown_ms": 500, "does": "answer",
        "answers": {"realism": "9"}});
    relay.writes(refused.to_string().as_bytes());
    let line = loop {
        let line = relay.line();
        if line["say"] == "settled" && line["key"] == "r" {
            break line;
        }
    };
    assert_eq!(line["outcome"], "refused");
    assert!(line["why"].as_str().unwrap().contains('7'), "{line}");
    session.end(&["/quit", "y"]);
}

/// A front that is stopped and answers no ping.
#[test]
fn a_front_that_hangs_is_lost() {
    let (_folder, mut session, mut relay) = patient();
    relay.play(is_playing);
    session.wait_for("it has answered no ping for 5 s");
    relay = relay.again();
    relay.play(is_stopped);
    session.end(&["/quit", "y"]);
}
