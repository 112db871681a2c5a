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

/// A table from elsewhere with a column for each factor, and without one for realizations.
#[test]
fn a_table_has_factors_where_they_are_named() {
    let home = tempfile::tempdir().unwrap();
    let mut table = "subject,friction,detent,rating\n".to_owned();
    for (subject, ratings) in ["2434", "3455", "1324", "2546", "3344"].iter().enumerate() {
        for (i, rating) in ratings.chars().enumerate() {
            let (friction, detent) = (["low", "high"][i / 2], ["soft", "crisp"][i % 2]);
            table += &format!("P{subject},{friction},{detent},{rating}\n");
        }
    }
    std::fs::write(home.path().join("t.csv"), table).unwrap();
    let factors = [
        "--factor",
        "friction=low,high",
        "--factor",
        "detent=soft,crisp",
    ];
    let (code, out, err) = study(&[&["analyze", "t.csv"][..], &factors].concat(), home.path());
    assert_eq!(code, 0, "{err}");
    assert!(
        out.contains("Does the effect of friction depend on detent?"),
        "{out}"
    );
    let (code, _, err) = study(
        &["analyze", "t.csv", "--factor", "friction=low,hi"],
        home.path(),
    );
    assert_eq!(code, 1);
    assert!(
        err.contains("t.csv, line 4: `high` in column `friction` is not one of the levels low, hi"),
        "{err}"
    );
    let (code, _, err) = study(&["analyze", "t.csv", "--factor", "friction"], home.path());
    assert_eq!(code, 2);
    assert!(err.contains("such as friction=low,high"), "{err}");
}

/// Power of the effects of the template: each effect has its row, sizes can be stated, and what is not tested is refused.
#[test]
fn the_power_of_effects_is_simulated() {
    let home = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| study(arguments, home.path());
    assert_eq!(run(&["new", "x", "--kind", "factorial"]).0, 0);
    let asked = [
        "power",
        "x",
        "--effect",
        "friction=1.5,detent:friction=0",
        "--participants",
        "4,24",
        "--studies",
        "100",
        "--json",
    ];
    let (code, out, err) = run(&asked);
    assert_eq!(code, 0, "{err}");
    let document: serde_json::Value = serde_json::from_str(&out).unwrap();
    let power = |participants: u64, effect: &str| {
        let cells = document["cells"].as_array().unwrap();
        let cell = cells.iter().find(|c| c["participants"] == participants);
        cell.unwrap()["tests"][effect]["power"].as_f64().unwrap()
    };
    assert!(
        power(24, "friction") > 0.95 && power(4, "friction") < 0.9,
        "{out}"
    );
    for nothing in ["detent", "friction:detent"] {
        assert!(power(24, nothing) < 0.15, "{nothing}: {out}");
    }
    let fewest = &document["smallest"][0];
    let participants = fewest["participants"].as_u64().unwrap();
    assert!(
        fewest["target"] == 0.8 && [12, 24].contains(&participants),
        "{fewest}"
    );
    let (code, out, err) = run(&["power", "x", "--studies", "20", "--participants", "6"]);
    assert_eq!(code, 0, "{err}");
    for told in [
        "friction:detent",
        "effect friction = 0.5",
        "Effects of friction (low, high) × detent",
    ] {
        assert!(out.contains(told), "{told}: {out}");
    }
    let (code, _, err) = run(&["power", "x", "--effect", "grain=1"]);
    assert_eq!(code, 1, "{err}");
    assert!(
        err.contains("no effect `grain` is tested; there are friction, detent, friction:detent"),
        "{err}"
    );
    let (code, _, err) = run(&["power", "x", "--slope", "0.4"]);
    assert_eq!(code, 1, "{err}");
    assert!(
        err.contains("`--slope` does not apply to effects of factors"),
        "{err}"
    );
}
