//! Which rows of a study are analyzed, and what is reported about the others.
#![allow(clippy::unwrap_used)]

use crate::report_support::html;
use chrono::DateTime;
use std::collections::BTreeMap;
use study_analysis::analyze::{Analysis, Exclusion, Include, Rules, analyze};
use study_base::text::{ModelId, ParticipantId, QuestionId};
use study_plan::protocol::columns::UsedColumn;
use study_plan::protocol::{Answer, Role, Unfinished};
use study_report::text::{Page, comments, page};
use study_report::{Source, csv};
use study_session::outcome::ratings::Ratings;
use study_session::outcome::{ParticipantRow, RatingRow, State, Status};

fn id(text: &str) -> QuestionId {
    QuestionId::new(text).unwrap()
}

fn row(who: &str, model: &str, repetition: u32, rating: i64) -> RatingRow {
    let participant = ParticipantId::new(who).unwrap();
    let asked = (id("realism"), Answer::Rating(rating));
    RatingRow {
        row: Some(1),
        block: repetition,
        model: Some(ModelId::new(model).unwrap()),
        repetition,
        vaf: Some(match model {
            "A" => 0.7,
            "B" => 0.8,
            _ => 0.9,
        }),
        ..RatingRow::answered(participant, 1, 1, asked)
    }
}

fn participant(who: &str, state: State, reason: &str) -> ParticipantRow {
    ParticipantRow {
        participant: ParticipantId::new(who).unwrap(),
        session: 1,
        state,
        reason: reason.to_owned(),
        row: Some(1),
        pilot: false,
        simulated: false,
        erased: false,
        consent_version: None,
        protocol_version: Some(1),
        trials_done: 3,
        trials_planned: 3,
        started_at: DateTime::parse_from_rfc3339("2026-11-20T10:00:00+01:00").ok(),
        answers: BTreeMap::new(),
        group: None,
        session_id: None,
        gap_h: None,
    }
}

/// Two participants who rate A, B, C as 2, 4, 6 and 3, 4, 7.
fn two() -> Vec<RatingRow> {
    let mut rows = Vec::new();
    for (who, ratings) in [("P01", [2, 4, 6]), ("P02", [3, 4, 7])] {
        for (model, rating) in ["A", "B", "C"].iter().zip(ratings) {
            rows.push(row(who, model, 1, rating));
        }
    }
    rows
}

fn ratings(rows: &[RatingRow], participants: &[ParticipantRow]) -> Ratings {
    let mut ratings = Ratings::from_rows(rows, &id("realism"), None);
    ratings.set_states(participants);
    ratings
}

fn source() -> Source {
    Source {
        title: "An example".to_owned(),
        study: Some("example".to_owned()),
        protocol_version: Some(1),
        path: "results/example".to_owned(),
        ..Source::default()
    }
}

fn printed(a: &Analysis) -> String {
    let set = Page {
        width: 100,
        color: false,
    };
    page(&source(), a, set)
}

#[test]
fn only_real_participants_are_analyzed_unless_others_are_included() {
    let mut rows = two();
    for (who, pilot) in [("T01", true), ("SIM001", false)] {
        let mut other = row(who, "A", 1, 7);
        (other.pilot, other.simulated) = (pilot, !pilot);
        rows.push(other);
    }
    let all = ratings(&rows, &[]);
    let n = |include| {
        let rules = Rules {
            include,
            ..Rules::default()
        };
        let a = analyze(&all, &rules);
        (
            a.values.number("desc/A/n").unwrap(),
            a.counts.excluded.len(),
        )
    };
    let with = |pilot, simulated| Include { pilot, simulated };
    assert_eq!(n(with(false, false)), (2.0, 2));
    assert_eq!(n(with(true, false)), (3.0, 1));
    assert_eq!(n(with(true, true)), (4.0, 0));
    let a = analyze(&all, &Rules::default());
    let text = printed(&a);
    assert!(text.contains("1 row excluded (pilot)"), "{text}");
    assert!(text.contains("1 row excluded (simulated)"), "{text}");
}

#[test]
fn an_analysis_of_simulated_participants_alone_says_so_in_a_banner() {
    let mut rows = two();
    rows.iter_mut().for_each(|r| r.simulated = true);
    let a = analyze(&ratings(&rows, &[]), &Rules::default());
    assert_eq!(a.counts.rated, 6);
    let text = printed(&a);
    assert!(
        text.contains("*** NO PARTICIPANTS: only 2 simulated"),
        "{text}"
    );
}

/// Each reason for a rating that is missing is counted by itself.
#[test]
fn failed_and_declined_trials_are_told_apart() {
    let mut rows = two();
    for (row, status) in (rows.iter_mut()).zip([Status::Failed, Status::Declined, Status::Failed]) {
        row.answers.clear();
        row.status = status;
    }
    let a = analyze(&ratings(&rows, &[]), &Rules::default());
    assert_eq!((a.counts.failed, a.counts.declined), (2, 1));
    let text = printed(&a);
    assert!(
        text.contains("2 trials failed · 1 rating declined"),
        "{text}"
    );
    let files = csv::tables(&source(), &a);
    let used = files.iter().find(|f| f.name == "ratings_used.csv").unwrap();
    assert!(
        used.content.contains("P01,A,1,1,,0.7,false,no rating\r\n"),
        "{}",
        used.content
    );
}

#[test]
fn the_banner_of_the_report_says_who_is_included() {
    let banners = |pilots: usize, simulated: usize, planned| {
        let mut rows = two();
        rows.extend(["P03", "P04"].map(|who| row(who, "A", 1, 5)));
        let who = ["P01", "P02", "P03", "P04"];
        for row in &mut rows {
            let at = who
                .iter()
                .position(|w| *w == row.participant.as_str())
                .unwrap();
            row.pilot = at < pilots;
            row.simulated = !row.pilot && at < pilots + simulated;
        }
        let rules = Rules {
            planned: Some(planned),
            include: Include {
                pilot: true,
                simulated: true,
            },
            ..Rules::default()
        };
        let page = html(&analyze(&ratings(&rows, &[]), &rules));
        let banners = page
            .split("<div class=\"banner\" role=\"note\"><b>")
            .skip(1);
        banners
            .map(|b| b.split('<').next().unwrap().to_owned())
            .collect::<Vec<_>>()
    };
    const MIXED: &str = "INCLUDES PILOT OR SIMULATED DATA";
    assert_eq!(banners(0, 0, 4), [""; 0]);
    assert_eq!(banners(0, 0, 9), ["INTERIM ANALYSIS"]);
    assert_eq!(banners(1, 0, 3), [MIXED]);
    assert_eq!(banners(0, 1, 9), [MIXED, "INTERIM ANALYSIS"]);
    assert_eq!(banners(4, 0, 4), ["NO PARTICIPANTS"]);
    assert_eq!(banners(0, 4, 4), ["SIMULATED DATA – NO PARTICIPANTS"]);
}

#[test]
fn pilots_and_simulated_participants_are_not_mixed() {
    let mut rows = two();
    for row in &mut rows {
        row.pilot = row.participant.as_str() == "P01";
        row.simulated = !row.pilot;
    }
    let counts = |simulated| {
        let rules = Rules {
            include: Include {
                pilot: false,
                simulated,
            },
            ..Rules::default()
        };
        let a = analyze(&ratings(&rows, &[]), &rules);
        (a.counts.pilots, a.counts.simulated)
    };
    assert_eq!(counts(false), (1, 0));
    assert_eq!(counts(true), (1, 1));
}

#[test]
fn participants_are_excluded_by_state_with_the_reason() {
    let people = [
        participant("P01", State::Excluded, "fell asleep"),
        participant("P02", State::Unfinished, ""),
    ];
    let all = ratings(&two(), &people);
    let a = analyze(&all, &Rules::default());
    assert_eq!(a.counts.rated, 3);
    assert!(printed(&a).contains("3 rows excluded (excluded: fell asleep)"));
    let files = csv::tables(&source(), &a);
    let excluded = files.iter().find(|f| f.name == "excluded.csv").unwrap();
    assert!(
        excluded
            .content
            .contains("P01,A,1,2,excluded: fell asleep\r\n")
    );
    let without = Rules {
        unfinished: Unfinished::Exclude,
        ..Rules::default()
    };
    let a = analyze(&all, &without);
    assert_eq!(a.counts.rated, 0);
    assert_eq!(a.counts.excluded["unfinished"], 3);
    // No rating is left: the page is printed all the same.
    assert!(printed(&a).contains("0 ratings"));
}

#[test]
fn an_analysis_before_the_planned_number_of_participants_is_interim() {
    let people = [
        participant("P01", State::Done, ""),
        participant("P02", State::Done, ""),
    ];
    let all = ratings(&two(), &people);
    let code = |planned| {
        let rules = Rules {
            planned: Some(planned),
            ..Rules::default()
        };
        let a = analyze(&all, &rules);
        a.warnings.iter().any(|w| w.code == "interim")
    };
    assert!(code(10));
    assert!(!code(2));
}

#[test]
fn pilots_do_not_count_as_planned_participants() {
    let mut rows = two();
    for row in &mut rows {
        row.pilot = row.participant.as_str() == "P01";
    }
    let people = [
        participant("P01", State::Done, ""),
        participant("P02", State::Done, ""),
    ];
    let rules = Rules {
        planned: Some(2),
        include: Include {
            pilot: true,
            simulated: false,
        },
        ..Rules::default()
    };
    let a = analyze(&ratings(&rows, &people), &rules);
    assert_eq!((a.counts.participants, a.counts.finished), (2, 1));
    let interim = a.warnings.iter().find(|w| w.code == "interim").unwrap();
    assert!(
        interim
            .text
            .contains("1 of 2 planned participants has finished"),
        "{}",
        interim.text
    );
    for row in &mut rows {
        row.pilot = true;
    }
    let a = analyze(&ratings(&rows, &people), &rules);
    let codes: Vec<&str> = a.warnings.iter().map(|w| w.code).collect();
    assert!(
        codes.contains(&"no-participants") && !codes.contains(&"interim"),
        "{codes:?}"
    );
}

#[test]
fn failed_declined_missing_corrected_and_repeated_trials_are_counted() {
    let mut rows = two();
    rows[0].status = Status::Failed;
    rows[1].status = Status::Declined;
    let why = "no idea".to_owned();
    rows[1]
        .answers
        .insert(id("realism"), Answer::Declined { reason: why });
    rows[2].status = Status::Missing;
    rows[2].answers.clear();
    rows[3].corrected = true;
    rows[4].attempt = Some(2);
    let mut practice = row("P02", "Z", 0, 1);
    practice.practice = true;
    rows.push(practice);
    let a = analyze(&ratings(&rows, &[]), &Rules::default());
    let c = &a.counts;
    assert_eq!((c.failed, c.declined, c.missing), (1, 1, 1));
    assert_eq!((c.corrected, c.repeated, c.practice, c.rated), (1, 1, 1, 3));
    // A failed trial's rating does not count.
    assert_eq!(a.values.number("desc/A/n"), Some(1.0));
    assert!(a.values.get("desc/Z/n").is_none());
    let text = printed(&a).replace('\n', " ");
    for part in [
        "1 trial failed",
        "1 rating declined",
        "1 trial corrected",
        "1 practice trial",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
}

#[test]
fn references_anchors_and_repeats_are_not_in_the_correlation() {
    let mut rows = two();
    for who in ["P01", "P02"] {
        rows.push(row(who, "D", 1, 5));
        let mut target = row(who, "target", 1, 7);
        target.role = Role::HiddenReference;
        rows.push(target);
        rows.push(row(who, "C2", 1, 5));
    }
    let mut all = ratings(&rows, &[]);
    all.set_duplicates([("C2", "C")]);
    let rules = Rules {
        realistic_from: Some(5.0),
        ..Rules::default()
    };
    let a = analyze(&all, &rules);
    assert_eq!(a.values.number("corr/n_models"), Some(4.0));
    assert_eq!(a.values.number("desc/target/mean"), Some(7.0));
    // C was rated 6 and 7, its repeat 5 and 5.
    assert_eq!(a.values.number("duplicate/C2/mean_diff"), Some(-1.5));
    assert_eq!(a.values.number("realistic/C/share"), Some(1.0));
    let text = printed(&a);
    assert!(text.contains("target (hidden-reference)"), "{text}");
    assert!(text.contains("C2 (duplicate of C)"), "{text}");
}

#[test]
fn comments_are_listed_by_realization_as_text() {
    let mut rows = two();
    let text = "=1+1 \u{1b}[2J\n\"crisp\" 👍🏽 よかった";
    rows[2]
        .answers
        .insert(id("comment"), Answer::Text(text.to_owned()));
    rows[0].remarks = "phone rang".to_owned();
    let a = analyze(&ratings(&rows, &[]), &Rules::default());
    let set = Page {
        width: 80,
        color: true,
    };
    let said = comments(&a, set);
    assert!(
        said.contains("\\u{1b}[2J\\n\"crisp\" 👍🏽 よかった"),
        "{said}"
    );
    assert!(said.contains("[remarks] phone rang"), "{said}");
    let files = csv::tables(&source(), &a);
    let table = files.iter().find(|f| f.name == "comments.csv").unwrap();
    // Stored as typed: only quotes are doubled.
    assert!(
        table
            .content
            .contains("\"=1+1 \u{1b}[2J\n\"\"crisp\"\" 👍🏽 よかった\"")
    );
}

#[test]
fn practice_is_listed_and_not_analyzed() {
    let mut with_practice = two();
    let mut practice = row("P09", "Z", 0, 7);
    practice.practice = true;
    practice.position = None;
    with_practice.insert(2, practice);
    let a = analyze(&ratings(&with_practice, &[]), &Rules::default());
    let without = analyze(&ratings(&two(), &[]), &Rules::default());
    assert_eq!(a.values, without.values);
    assert_eq!(a.counts.practice, 1);
    let files = csv::tables(&source(), &a);
    let used = files.iter().find(|f| f.name == "ratings_used.csv").unwrap();
    let header: Vec<&str> = UsedColumn::ALL.iter().map(|c| c.name()).collect();
    assert!(used.content.starts_with(&(header.join(",") + "\r\n")));
    assert_eq!(used.content.lines().count(), 1 + 6 + 1);
    assert!(
        used.content.contains("P01,A,1,1,2,0.7,true,\r\n"),
        "{}",
        used.content
    );
    assert!(
        used.content.ends_with("P09,Z,0,,7,0.9,false,practice\r\n"),
        "{}",
        used.content
    );
}

#[test]
fn a_rule_that_cannot_be_applied_is_reported() {
    let rules = Rules {
        exclude: vec![Exclusion::HiddenReferenceBelow(5.0)],
        ..Rules::default()
    };
    let a = analyze(&ratings(&two(), &[]), &rules);
    assert!(printed(&a).contains("the design has no hidden reference"));
}
