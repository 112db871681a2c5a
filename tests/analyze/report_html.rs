//! The report: whole, self-contained, the same bytes everywhere, and text from
//! the data stays text.

#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use study_analysis::analyze::{
    Analysis, Comment, Deviation, Exclusion, PreregisteredRule, Rules, analyze,
};
use study_report::Source;
use study_report::figures::{self, Trace};
use study_report::html::{Details, document};
use study_report::picture::png::Painter;
use study_session::outcome::ratings::Ratings;

const EVIL: &str = "</p><script>alert(1)</script>\"' onerror=\u{202e}x]]>&amp;\u{0}";

fn source(title: &str) -> Source {
    Source {
        title: title.to_owned(),
        study: Some("a-study".to_owned()),
        protocol_version: Some(1),
        path: "results/a-study".to_owned(),
        ..Source::default()
    }
}

fn analysis_of(csv: &str) -> Analysis {
    let rules = Rules {
        realistic_from: Some(5.0),
        scale: Some((1.0, 7.0)),
        ..Rules::default()
    };
    let ratings = Ratings::read_csv("data.csv", csv.as_bytes(), None).unwrap();
    analyze(&ratings, &rules)
}

fn golden() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/data");
    let sets = fs::read_dir(root)
        .unwrap()
        .map(|e| e.unwrap().path().join("data.csv"));
    let mut sets: Vec<PathBuf> = sets.filter(|p| p.exists()).collect();
    // Its 15,000 ratings take a minute unoptimized and draw nothing that others do not.
    sets.retain(|p| !p.to_string_lossy().contains("sim_large"));
    sets.sort();
    assert!(sets.len() > 5, "the data sets were not found");
    sets
}

/// The report, with plain spaces.
fn report(a: &Analysis, traces: &[Trace]) -> String {
    document(
        &source("A study"),
        &Details::default(),
        a,
        &figures::all(a, traces),
    )
    .replace('\u{a0}', " ")
}

/// Nothing that a browser would fetch or run.
fn is_self_contained(page: &str) {
    let lower = page.to_lowercase();
    for bad in [
        "<script",
        "<link",
        "<iframe",
        "<img",
        "<object",
        "<use",
        "@import",
        "href=",
        " src=",
        "https://",
        "javascript:",
    ] {
        assert!(!lower.contains(bad), "{bad}");
    }
    let own = "http://www.w3.org/2000/svg";
    assert!(!lower.replace(own, "").contains("http://"));
    for (at, _) in lower.match_indices("url(") {
        assert!(lower[at..].starts_with("url(#"), "{}", &lower[at..at + 40]);
    }
    assert!(
        page.contains("content=\"default-src 'none'; style-src 'unsafe-inline'; img-src data:\"")
    );
}

#[test]
fn every_golden_set_gives_a_whole_report_without_a_nan() {
    for path in golden() {
        let a = analysis_of(&fs::read_to_string(&path).unwrap());
        let page = report(&a, &[]);
        is_self_contained(&page);
        assert!(page.starts_with("<!DOCTYPE html>") && page.ends_with("</html>\n"));
        for bad in [">NaN", ">inf<", ">inf ", "−inf", "=\"NaN", "\"inf\""] {
            assert!(!page.contains(bad), "{}: {bad}", path.display());
        }
        let ids: Vec<&str> = page
            .split(" id=\"")
            .skip(1)
            .filter_map(|rest| rest.split('"').next())
            .collect();
        let distinct: BTreeSet<&&str> = ids.iter().collect();
        assert_eq!(ids.len(), distinct.len(), "{}", path.display());
    }
}

#[test]
fn the_answers_hold_the_numbers_of_the_analysis() {
    let path = golden()
        .into_iter()
        .find(|p| p.to_string_lossy().contains("sim_paper"))
        .unwrap();
    let a = analysis_of(&fs::read_to_string(path).unwrap());
    let page = report(&a, &[]);
    let r = format!("{:.3}", a.values.number("corr/pearson/r").unwrap());
    let shown = r.trim_start_matches('0');
    assert!(page.contains(&format!("r = {shown}")), "{shown}");
    assert!(page.contains("For these realizations only"));
    assert!(page.contains("Does VAF predict the rating?"));
    let share = a.values.number("realistic/0.9995/share").unwrap();
    assert!(page.contains(&format!(
        "{:.0} % of its ratings are 5 or higher",
        100.0 * share
    )));
    for name in [
        "fig10-means",
        "rating-against-vaf",
        "pairs",
        "histograms",
        "order",
    ] {
        assert!(page.contains(&format!("figures/{name}")), "{name}");
    }
}

#[test]
fn absent_results_are_left_out() {
    let a = analysis_of("subject,model,repetition,rating,vaf\nS1,a,1,4,\nS2,a,1,5,\n");
    let page = report(&a, &[]);
    assert!(!page.contains("Does VAF predict"));
    assert!(!page.contains("For these realizations only"));
    let nothing = analysis_of("subject,model,repetition,rating,vaf\nS1,a,1,,\n");
    let page = report(&nothing, &[]);
    assert!(page.contains("there is nothing to analyze"));
}

#[test]
fn rules_and_their_changes_are_reported() {
    let csv = "subject,model,repetition,rating,vaf\n\
               S1,a,1,4,0.5\nS1,b,1,4,0.6\nS1,c,1,4,0.7\nS2,a,1,5,0.5\nS2,b,1,3,0.6\nS2,c,1,6,0.7\n\
               S3,a,1,2,0.5\nS3,b,1,3,0.6\nS3,c,1,5,0.7\n";
    let ratings = Ratings::read_csv("data.csv", csv.as_bytes(), None).unwrap();
    let rules = Rules {
        exclude: vec![Exclusion::ConstantRater, Exclusion::Inconsistent(1.0)],
        deviations: vec![Deviation {
            text: "protocol 2 of 2026-01-02, because \"typo\": vaf: a → b".to_owned(),
            affects: &[],
            track: None,
            registered: true,
        }],
        ..Rules::default()
    };
    let page = report(&analyze(&ratings, &rules), &[]);
    let row = "<td><code>constant-rater</code></td>\
               <td class=\"text\">participants whose ratings never change</td><td>3</td><td>1</td>";
    assert!(page.contains(row), "{page}");
    assert!(page.contains("the design has no hidden duplicate"));
    assert!(page.contains("Deviations from the preregistered analysis"));
    assert!(page.contains("because &quot;typo&quot;: vaf: a → b"));
    let neither = report(&analyze(&ratings, &Rules::default()), &[]);
    assert!(neither.contains("No exclusion rule was set in advance."));
    assert!(neither.contains("No analysis rule was changed"));
}

#[test]
fn hostile_names_and_comments_stay_text() {
    let quoted = EVIL.replace('"', "\"\"");
    let mut csv = "subject,model,repetition,rating,vaf\n".to_owned();
    for (i, subject) in ["S1", &quoted, "S3"].iter().enumerate() {
        for (j, model) in ["a", &quoted, "c"].iter().enumerate() {
            for k in 1..=2 {
                let rating = 1 + (i + 2 * j + k) % 6;
                csv += &format!("\"{subject}\",\"{model}\",{k},{rating},0.{j}5\n");
            }
        }
    }
    let mut a = analysis_of(&csv);
    a.comments.push(Comment {
        model: EVIL.to_owned(),
        subject: EVIL.to_owned(),
        repetition: 3,
        question: EVIL.to_owned(),
        text: format!("first\n{EVIL}"),
    });
    let trace = Trace {
        model: EVIL.to_owned(),
        label: EVIL.to_owned(),
        measured: true,
        points: vec![(0.0, 1.0), (1.0, 2.0), (f64::NAN, 1e308)],
    };
    let details = Details {
        lang: Some(EVIL.to_owned()),
        authors: vec![EVIL.to_owned()],
        prompt: Some(EVIL.to_owned()),
        reference: Some(EVIL.to_owned()),
        facts: vec![(EVIL.to_owned(), EVIL.to_owned())],
        fingerprints: vec![(EVIL.to_owned(), EVIL.to_owned())],
        versions: vec![(1, EVIL.to_owned(), EVIL.to_owned())],
        ..Details::default()
    };
    a.deviations.push(Deviation {
        text: EVIL.to_owned(),
        affects: &[],
        track: None,
        registered: true,
    });
    let figures = figures::all(&a, &[trace]);
    assert!(figures.iter().any(|f| f.name == "telemetry"));
    let page = document(&source(EVIL), &details, &a, &figures);
    is_self_contained(&page);
    assert!(page.contains("&lt;script&gt;alert(1)"));
    assert!(page.contains("\\u{202e}"));
    assert!(page.contains(", repetition 3,"));
    assert!(!page.contains('\u{202e}') && !page.contains('\u{0}'));
    let inside_tags = page.split('<').skip(1).filter_map(|t| t.split('>').next());
    for tag in inside_tags {
        assert!(!tag.contains(" onerror="), "{tag}");
    }
    for f in &figures {
        let svg = f.wide.to_svg();
        assert!(
            !svg.contains("<script") && !svg.contains("]]>"),
            "{}",
            f.name
        );
        Painter::default().png(&f.wide).unwrap();
        assert!(f.wide.to_pdf().starts_with(b"%PDF-"));
    }
}

#[test]
fn the_command_writes_the_same_bytes_whatever_the_locale_and_the_threads() {
    let data = golden()
        .into_iter()
        .find(|p| p.to_string_lossy().contains("sim_paper"))
        .unwrap();
    let dir = tempfile::tempdir().unwrap();
    let run = |name: &str, locale: &str, threads: &str| -> Vec<(PathBuf, Vec<u8>)> {
        let out = dir.path().join(name);
        assert_cmd::Command::cargo_bin("study")
            .unwrap()
            .args([
                "analyze".as_ref(),
                data.as_os_str(),
                "--out".as_ref(),
                out.as_os_str(),
            ])
            .env("LC_ALL", locale)
            .env("RAYON_NUM_THREADS", threads)
            .assert()
            .success();
        let mut files = Vec::new();
        for folder in [out.clone(), out.join("figures")] {
            for item in fs::read_dir(folder).unwrap() {
                let path = item.unwrap().path();
                if path.is_file() {
                    let name = path.strip_prefix(&out).unwrap().to_owned();
                    files.push((name, fs::read(path).unwrap()));
                }
            }
        }
        files.sort();
        files
    };
    let first = run("a", "C", "1");
    assert_eq!(first, run("b", "de_DE.UTF-8", "7"));
    let bytes = |name: &str| &first.iter().find(|f| f.0 == Path::new(name)).unwrap().1;
    assert!(bytes("report.html").starts_with(b"<!DOCTYPE html>"));
    for stem in ["fig10-means", "histograms", "subject-lines"] {
        assert!(bytes(&format!("figures/{stem}.png")).starts_with(b"\x89PNG"));
        assert!(bytes(&format!("figures/{stem}.svg")).starts_with(b"<svg "));
        assert!(bytes(&format!("figures/{stem}.csv")).contains(&b','));
    }
}

#[test]
fn rules_changed_after_the_study_began_are_not_said_to_be_set_in_advance() {
    let csv = "subject,model,repetition,rating,vaf\n\
               S1,a,1,4,0.5\nS1,b,1,4,0.6\nS1,c,1,4,0.7\nS2,a,1,5,0.5\nS2,b,1,3,0.6\nS2,c,1,6,0.7\n\
               S3,a,1,2,0.5\nS3,b,1,3,0.6\nS3,c,1,5,0.7\n";
    let ratings = Ratings::read_csv("data.csv", csv.as_bytes(), None).unwrap();
    let because = "protocol 2 of 2026-01-02, because \"a look\": ";
    let mut rules = Rules {
        exclude: vec![Exclusion::ConstantRater],
        realistic_from: Some(4.0),
        deviations: vec![
            Deviation {
                text: format!("{because}exclusion rules: none → constant-rater"),
                affects: &[PreregisteredRule::Exclusions],
                track: None,
                registered: true,
            },
            Deviation {
                text: format!("{because}realistic_from: 5 → 4"),
                affects: &[PreregisteredRule::RealisticFrom],
                track: None,
                registered: true,
            },
        ],
        ..Rules::default()
    };
    let told = |rules: &Rules| {
        let a = analyze(&ratings, rules);
        let page = study_report::text::page(
            &source("A study"),
            &a,
            study_report::text::Page {
                width: 100,
                color: false,
            },
        );
        // The heading of the changes themselves, and their warnings.
        let html = report(&a, &[]).replace("Deviations from the preregistered analysis", "");
        format!("{html}{page}")
            .replace('\u{a0}', " ")
            .replace("eviation from the preregistered analysis", "")
    };
    let changed = told(&rules);
    for bad in ["beforehand", "in advance", "preregistered"] {
        assert!(!changed.contains(bad), "{bad}: {changed}");
    }
    for said in [
        "The exclusion rules were changed after the study began (see Deviations)",
        "counts as realistic; this threshold was changed after the study began",
        "Exclusion rules, changed after the study began: see Deviations",
        "ratings are 4 or higher, a threshold changed after the study began",
    ] {
        assert!(changed.contains(said), "{said}: {changed}");
    }
    rules.deviations.clear();
    let stated = told(&rules);
    for said in [
        "The rules that were set in advance exclude",
        "counts as realistic, a threshold that was set in advance",
        "Exclusion rules, set in advance",
    ] {
        assert!(stated.contains(said), "{said}: {stated}");
    }
    // Nobody knows whether it was registered anywhere.
    assert!(!stated.contains("preregistered"), "{stated}");
}
