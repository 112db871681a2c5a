//! README and CHANGES of a data set.

use super::select::OLDEST;
use super::table::Table;
use super::{Job, author, word};
use study_base::text::{Untrusted, counted};
use study_plan::protocol::{Order, Protocol, Scale, Task};
use study_session::outcome::State;
use study_session::outcome::ratings::Origin;

/// The version of every data set.
pub(super) const VERSION: &str = "1.0.0";

/// Text for Markdown: nothing in it is markup.
pub(super) fn plain(text: &str) -> String {
    let one_line = text.split_whitespace().collect::<Vec<_>>().join(" ");
    let shown = Untrusted(&one_line).to_string();
    let mut out = String::with_capacity(shown.len());
    for c in shown.chars() {
        if "\\`*_{}[]()<>#+!|~&$".contains(c) {
            out.push('\\');
        }
        out.push(c);
    }
    out
}

/// What was done, in sentences of plain text.
pub(super) fn methods(job: &Job<'_>) -> String {
    let protocol = job.source.protocol;
    let n = job.selected.participants.len();
    let mut text = format!(
        "{} took part ({} planned).",
        counted(
            n,
            &format!("{} participant", word(job.options.whose)),
            &format!("{} participants", word(job.options.whose))
        ),
        protocol.design.participants
    );
    if protocol.only_asks() {
        text += " Nothing was presented.";
    } else if protocol.parts.is_empty() {
        let felt = protocol.scheduled_models().count();
        text += &format!(
            " Each felt {} {}, in an order that is {}.",
            counted(felt, "realization", "realizations"),
            counted(protocol.design.repetitions as usize, "time", "times"),
            order(&protocol.design.order)
        );
    }
    for part in &protocol.parts {
        let task = match &part.task {
            Task::Rating(p) => format!(
                "{} felt {} and rated",
                counted(p.models.len(), "realization was", "realizations were"),
                counted(p.repetitions as usize, "time", "times")
            ),
            Task::Magnitude(own) => {
                let p = &own.presentations;
                let felt = match p.models.iter().any(|m| protocol.level_of(m).is_some()) {
                    true => counted(p.models.len(), "level was", "levels were"),
                    false => counted(p.models.len(), "realization was", "realizations were"),
                };
                let times = counted(p.repetitions as usize, "time", "times");
                match &own.standard {
                    None => format!("{felt} felt {times} and given a number above 0"),
                    Some(standard) => format!(
                        "{felt} felt {times} and given a number above 0, each after {}, whose number was {}",
                        standard.model, standard.modulus
                    ),
                }
            }
            Task::Mushra(p) => format!(
                "{} rated from 0 to 100 beside a reference {}",
                counted(
                    p.presentations.models.len(),
                    "realization was",
                    "realizations were"
                ),
                counted(p.presentations.repetitions as usize, "time", "times")
            ),
            Task::Identification(p) => format!(
                "{} felt {} and given one of {}",
                counted(
                    p.presentations.models.len(),
                    "realization was",
                    "realizations were"
                ),
                counted(p.presentations.repetitions as usize, "time", "times"),
                counted(p.labels.len(), "label", "labels")
            ),
            Task::Pairs(p) => format!(
                "{} compared {}",
                counted(
                    p.pairs.len(),
                    "pair of realizations was",
                    "pairs of realizations were"
                ),
                counted(p.repetitions as usize, "time", "times")
            ),
            Task::Discrimination { tracks } => format!(
                "levels were told from a standard on {}",
                counted(tracks.len(), "track", "tracks")
            ),
            Task::Similarity(own) => format!(
                "{} rated {} for how different the two are, from 0 to 100",
                counted(
                    own.pairs().pairs.len(),
                    "pair of realizations was",
                    "pairs of realizations were"
                ),
                counted(own.repetitions as usize, "time", "times")
            ),
            Task::Ranking(own) => format!(
                "{} felt one after another and ranked {}",
                counted(own.models.len(), "realization was", "realizations were"),
                counted(own.repetitions as usize, "time", "times")
            ),
            Task::Adjustment(own) => format!(
                "a level of {} was set {} from below and as often from above, until it felt {}",
                own.family,
                counted(own.repetitions as usize, "time", "times"),
                match &own.standard {
                    Some(standard) => format!("equal to {standard}"),
                    None => "as it should".to_owned(),
                }
            ),
            Task::Search(own) => format!(
                "two points of the space {} were compared in {}, chosen from the answers before",
                own.space,
                counted(own.rule.trials as usize, "trial", "trials")
            ),
        };
        text += &format!(" Part {}: {task}.", part.id);
    }
    for question in protocol.questions.iter().chain(protocol.between()) {
        let scale = match question.kind.scale() {
            Scale::Levels { from, to, labels } => {
                let labels: Vec<String> =
                    labels.iter().map(|(v, l)| format!("{v} = {l}")).collect();
                let labels = match labels.is_empty() {
                    true => String::new(),
                    false => format!(": {}", labels.join(", ")),
                };
                format!("rated from {from} to {to}{labels}")
            }
            Scale::Interval { from, to, .. } => format!("a slider from {from} to {to}"),
            Scale::Names { options, .. } => format!("one of {}", options.join(", ")),
            Scale::Open { unit, .. } => match unit {
                Some(unit) => format!("a number, {unit}"),
                None => "a number".to_owned(),
            },
            Scale::Free => "free text".to_owned(),
        };
        text += &format!(" {}: {} ({scale}).", question.id, question.prompt);
    }
    text
}

fn order(order: &Order) -> &'static str {
    match order {
        Order::Blocked => "random in each repetition",
        Order::Shuffled => "random",
        Order::Williams => "a line of a Williams design",
        Order::LatinSquare => "a line of a Latin square",
        Order::Fixed => "fixed",
        Order::File(_) => "read from a file",
    }
}

/// README.md. `files` has each file or pattern with a few words; `notes` more sentences.
pub(super) fn readme(job: &Job<'_>, files: &[(String, &str)], notes: &[String]) -> String {
    let Protocol { study, .. } = job.source.protocol;
    let mut text = format!("# {}\n\n", plain(&job.title()));
    match job.options.whose {
        Origin::Real => {}
        Origin::Pilot => text += "**PILOT DATA. They are no result of the study.**\n\n",
        Origin::Simulated => {
            text += "**SIMULATED DATA. No person took part; the effects are built in.**\n\n";
        }
    }
    text += &format!("{}\n\n## Files\n\n", plain(&methods(job)));
    for (path, what) in files {
        text += &format!("* `{path}`: {what}\n");
    }
    let missing = job.options.format.missing;
    text += &format!("\n## Notes\n\n* Missing values: {missing}; the column `status` says why.\n");
    for note in notes.iter().chain(&common_notes(job)) {
        text += &format!("* {note}\n");
    }
    text += "\n## Who and how\n\n";
    let names: Vec<String> = study
        .authors
        .iter()
        .map(|a| plain(author::author(a).0))
        .collect();
    let facts = [
        ("Authors", Some(names.join(", ")).filter(|n| !n.is_empty())),
        ("License", study.license.as_deref().map(plain)),
        ("Ethics", study.ethics.as_deref().map(plain)),
        ("Funding", study.funding.as_deref().map(plain)),
        (
            "How to cite",
            author::doi(study).map(|doi| format!("https://doi.org/{doi}")),
        ),
    ];
    for (what, value) in facts {
        if let Some(value) = value {
            text += &format!("* {what}: {value}\n");
        }
    }
    let prints = job.source.fingerprints;
    text += &format!(
        "* Made by: study {}, `{}`\n* Fingerprints of the protocol: stimulus `{}`, wording `{}`, analysis `{}`\n",
        plain(job.source.tool_version),
        command(job),
        prints.stimulus,
        prints.wording,
        prints.analysis
    );
    text
}

/// The command without paths.
pub(super) fn command(job: &Job<'_>) -> String {
    let o = job.options;
    let mut words = vec!["study export --to".to_owned(), o.format.name.to_owned()];
    if o.whose != Origin::Real {
        words.push(format!("--include {}", word(o.whose)));
    }
    let flags = [
        (o.practice, "--with-practice"),
        (o.telemetry, "--with-telemetry"),
        (!o.comments, "--without-comments"),
        (o.profile_1, "--profile 1"),
        (o.dialect.bom, "--bom"),
        (o.dialect.decimal_comma, "--decimal ,"),
        (o.dialect.safe, "--spreadsheet-safe"),
    ];
    words.extend(
        flags
            .iter()
            .filter(|(on, _)| *on)
            .map(|(_, flag)| (*flag).to_owned()),
    );
    match o.dialect.separator {
        ',' => {}
        '\t' => words.push("--sep tab".to_owned()),
        other => words.push(format!("--sep '{other}'")),
    }
    let redacted = [(o.redact_ids, "ids"), (o.redact_times, "times")];
    let redacted: Vec<&str> = redacted
        .iter()
        .filter(|(on, _)| *on)
        .map(|(_, w)| *w)
        .collect();
    if !redacted.is_empty() {
        words.push(format!("--redact {}", redacted.join(",")));
    }
    words.join(" ")
}

/// What is true of every format.
fn common_notes(job: &Job<'_>) -> Vec<String> {
    let o = job.options;
    let mut notes = Vec::new();
    let mut note = |on: bool, text: &str| {
        if on {
            notes.push(text.to_owned());
        }
    };
    note(!o.practice, "Practice trials are left out.");
    note(
        !o.comments,
        "Columns of free text (comments, remarks, reasons, operator, device) are left out.",
    );
    note(
        o.redact_ids,
        "Participants have new numbers in random order; rows of the schedule are left out.",
    );
    note(
        o.redact_times,
        "Dates, times and the operator are left out.",
    );
    note(
        o.dialect.safe,
        "Texts that a spreadsheet could take for a formula begin with an apostrophe that nobody typed.",
    );
    note(
        o.format.sheets,
        "Import the tables into a spreadsheet, do not open them: it would change texts such as 3-4 or 1/2 into dates.",
    );
    if job.selected.ages_cut > 0 {
        notes.push(format!("Ages above {OLDEST} are written as {OLDEST}."));
    }
    let with = |state: State| {
        job.selected
            .participants
            .iter()
            .filter(|p| p.state == state)
            .count()
    };
    for (state, what) in [
        (
            State::Excluded,
            "excluded; their rows are here, and `participants` has the state",
        ),
        (
            State::DroppedOut,
            "ended early; trials that were not reached are `missing`",
        ),
        (
            State::Unfinished,
            "not finished yet; trials that were not reached are `missing`",
        ),
    ] {
        if with(state) > 0 {
            notes.push(format!(
                "{}: {what}.",
                counted(with(state), "participant", "participants")
            ));
        }
    }
    if let Some(_rows) = job
        .selected
        .interim(job.source.protocol.design.participants)
    {
        notes.push("Interim: fewer participants have finished than were planned.".to_owned());
    }
    for version in job.source.versions.iter().filter(|v| v.version > 1) {
        notes.push(format!(
            "The protocol was amended (version {}): {}",
            version.version,
            plain(&version.reason)
        ));
    }
    notes
}

/// The date of the last datum, `2026-11-22`; with dates left out that of the study.
pub(super) fn date(job: &Job<'_>) -> String {
    let created = job.source.versions.first().map(|v| v.at);
    let at = match job.options.redact_times {
        true => created,
        false => job.selected.last(job.source),
    };
    at.map_or_else(
        || "1970-01-01".to_owned(),
        |at| at.format("%Y-%m-%d").to_string(),
    )
}

/// The list of changes, in the form of CPAN.
pub(super) fn changes(job: &Job<'_>) -> String {
    format!("{VERSION} {}\n  - First export.\n", date(job))
}

/// What a table is, for a list of files.
pub(super) fn listed(table: &Table<'_>) -> (String, &'static str) {
    (format!("{}.csv", table.name), table.meaning)
}

#[cfg(test)]
mod tests {
    use super::plain;

    #[test]
    fn a_title_is_no_markup() {
        let hostile = "a\n# b <script>alert(1)</script> `x` [l](http://e) \u{202e}$x$";
        let shown = plain(hostile);
        assert_eq!(
            shown,
            "a \\# b \\<script\\>alert\\(1\\)\\</script\\> \\`x\\` \\[l\\]\\(http://e\\) \\\\u\\{202e\\}\\$x\\$"
        );
    }
}
