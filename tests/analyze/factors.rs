//! A factorial study, from its template to the report.
#![allow(clippy::unwrap_used)]

use crate::parts::study;

/// A factorial study from its template to the report: the effects come first, on the page and in the
/// tables, and the rows have a column for each factor.
#[test]
fn a_factorial_study_answers_by_its_factors() {
    let home = tempfile::tempdir().unwrap();
    for arguments in [
        &["new", "x", "--kind", "factorial", "--seed", "5"][..],
        &["check", "x"],
        &["rehearse", "x", "--participants", "12", "--seed", "3"],
        &["analyze", "rehearsal/x"],
    ] {
        let (code, out, err) = study(arguments, home.path());
        assert_eq!(code, 0, "{arguments:?}: {out}{err}");
        if arguments[0] == "check" {
            assert!(out.contains("0 warnings"), "{out}{err}");
        }
        if arguments[0] == "analyze" {
            let asked = [
                "Does friction matter?",
                "Does detent matter?",
                "Does the effect of friction depend on detent?",
                "Do the realizations differ?",
            ];
            let places: Vec<usize> = asked.iter().map(|ask| out.find(ask).unwrap()).collect();
            assert!(places.is_sorted(), "{out}");
            assert!(
                out.contains("Holm's\n") || out.contains("Holm's correction over 3 effects"),
                "{out}"
            );
        }
    }
    let read =
        |name: &str| std::fs::read_to_string(home.path().join("rehearsal/x").join(name)).unwrap();
    let ratings = read("ratings.csv");
    let header = ratings.lines().next().unwrap();
    assert!(header.ends_with(",friction,detent"), "{header}");
    let rows: Vec<csv::StringRecord> = csv::Reader::from_reader(ratings.as_bytes())
        .records()
        .map(Result::unwrap)
        .collect();
    let place = |name: &str| header.split(',').position(|n| n == name).unwrap();
    for row in &rows {
        let levels = format!("{}-{}", &row[place("friction")], &row[place("detent")]);
        assert_eq!(row[place("model")], levels);
    }
    let effects = read("analysis/factors.csv");
    assert!(
        effects.starts_with("effect,df1,df2,F,eps_gg,p_gg,p_holm,art_p,ges\r\nfriction,1,11,"),
        "{effects}"
    );
    let page = read("analysis/report.html");
    for told in [
        "The factors were friction (low, high) and detent (soft, crisp)",
        "Simple effects of friction",
        "figures/factors.pdf",
        "Effects of the factors",
    ] {
        assert!(page.contains(told), "{told}");
    }
    assert!(
        home.path()
            .join("rehearsal/x/analysis/figures/factors.svg")
            .is_file()
    );
}
