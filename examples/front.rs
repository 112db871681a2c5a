//! A front that takes part by itself: `study run STUDY --front target/debug/examples/front`.
//! It prints each page to standard error, and answers as soon as somebody could have read it.
//! docs/page.md specifies the lines. A front for people shows Stop whenever `stop` is not null.
#![allow(clippy::print_stderr, reason = "an example prints")]

use serde_json::{Value, json};
use std::io::{BufRead as _, Write as _};
use std::time::{Duration, Instant};

/// The shortest time in which a page is read.
const READ: Duration = Duration::from_millis(300);

#[derive(Default)]
struct Front {
    page: Value,
    since: Option<Instant>,
    replies: u32,
    /// The page of the last reply, and whether it is not settled yet.
    replied: Value,
    waits: bool,
}

fn main() -> std::io::Result<()> {
    say(&json!({"format": "study-page/1", "front": "example 1", "simulated": true}))?;
    let mut front = Front::default();
    // The end of the input is the end of the session.
    for line in std::io::stdin().lock().lines() {
        let line: Value = serde_json::from_str(&line?)?;
        match line["say"].as_str() {
            Some("ping") => say(&json!({"does": "pong"}))?,
            Some("page") => front.show(line)?,
            Some("settled") => front.settled(&line)?,
            _ => {} // Lines of a later minor version.
        }
    }
    Ok(())
}

impl Front {
    fn show(&mut self, page: Value) -> std::io::Result<()> {
        if page["id"] != self.page["id"] {
            self.since = Some(Instant::now());
            eprintln!("{} {}", page["title"], page["text"]);
        }
        self.page = page;
        self.act()
    }

    fn settled(&mut self, line: &Value) -> std::io::Result<()> {
        self.waits = false;
        if line["outcome"] != "saved" {
            eprintln!("{}: {}", line["outcome"], line["why"]);
            self.replied = Value::Null;
        }
        self.act()
    }

    /// Replies to the page, if it asks for something.
    fn act(&mut self) -> std::io::Result<()> {
        let mut buttons = self.page["buttons"].as_array().into_iter().flatten();
        let enabled = buttons.find(|button| button["enabled"] == true);
        let asks = !self.waits && self.replied != self.page["id"];
        let Some(button) = enabled.filter(|_| asks) else {
            return Ok(());
        };
        let shown = |since: Option<Instant>| since.map_or(READ, |since| since.elapsed());
        std::thread::sleep(READ.saturating_sub(shown(self.since)));
        self.replies += 1;
        self.waits = true;
        self.replied = self.page["id"].clone();
        let questions = self.page["questions"].as_array().into_iter().flatten();
        let given = |q: &Value| Some((q["id"].as_str()?.to_owned(), answer(q, self.replies)));
        say(&json!({
            "page": self.page["id"], "key": self.replies.to_string(),
            "shown_ms": shown(self.since).as_millis() as u64, "does": button["does"],
            "answers": questions.filter_map(given).collect::<serde_json::Map<_, _>>(),
        }))
    }
}

/// Any answer to a question; another one each time.
fn answer(question: &Value, n: u32) -> Value {
    let field = &question["field"];
    let pick = |list: &Value| n as usize % list.as_array().map_or(1, Vec::len);
    match field["kind"].as_str() {
        Some("boxes") => json!(field["boxes"][pick(&field["boxes"])][0].to_string()),
        Some("slider") => json!(field["from"].to_string()),
        Some("choice") => json!([pick(&field["options"])]),
        Some("number") => json!((n * 7 % 60).to_string()),
        _ => json!(format!("reply {n}")),
    }
}

fn say(line: &Value) -> std::io::Result<()> {
    let mut out = std::io::stdout().lock();
    writeln!(out, "{line}")?;
    out.flush()
}
