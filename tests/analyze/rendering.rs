//! What a report says of the force that was felt.
#![allow(clippy::unwrap_used)]

use crate::report_support::{html, words};
use study_analysis::analyze::{Analysis, Exclusion, Question, Rules, Verdict, analyze};
use study_session::outcome::ratings::Ratings;

const DELIVERED: [f64; 6] = [0.71, 0.80, 0.78, 0.88, 0.93, 0.95];

/// Three participants, six realizations. The force of P2's last trial was wrong, that of
/// P3's last could not be judged.
fn analysis(delivered: bool, rules: &Rules) -> Analysis {
    let mut text = String::from(
        "study,participant,session,row,trial,block,position,planned_position,model,role,repetition,\
         practice,pilot,simulated,protocol_version,realism,corrected,attempt,status,vaf,rendering,\
         rendered_vaf,delivered_vaf,rendered_gain\n",
    );
    let people = [
        ("P1", [2, 3, 3, 5, 5, 6]),
        ("P2", [1, 2, 4, 4, 6, 7]),
        ("P3", [3, 2, 4, 3, 6, 6]),
    ];
    for (shift, (who, ratings)) in people.into_iter().enumerate() {
        for (i, rating) in ratings.iter().enumerate() {
            let n = i + 1;
            let place = (i + shift) % 6 + 1;
            let (verdict, vaf, gain) = match (who, n) {
                ("P2", 6) => ("flag", "0.75", "0.5"),
                ("P3", 6) => ("too-little", "", ""),
                _ => ("ok", "0.999", "1"),
            };
            let own = match delivered {
                true => DELIVERED[i].to_string(),
                false => String::new(),
            };
            text += &format!(
                "s,{who},1,1,{place},1,{place},{place},M{n},test,1,false,false,false,1,{rating},false,1,ok,0.9{n},\
                 {verdict},{vaf},{own},{gain}\n"
            );
        }
    }
    analyze(
        &Ratings::read_csv("r.csv", text.as_bytes(), None).unwrap(),
        rules,
    )
}

/// r, interval and exact p from R 4.2.2 (`cor`, Fisher's z, all 720 orders), 1e-12.
#[test]
fn the_delivered_vaf_is_correlated_with_the_ratings() {
    let a = analysis(true, &Rules::default());
    let f = a.finding(&Question::Delivered).unwrap();
    assert_eq!((f.verdict.clone(), f.realizations), (Verdict::Yes, 6));
    let near = |found: f64, expected: f64| {
        assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    };
    let estimate = f.estimate.unwrap();
    near(estimate.value, 0.925_101_064_305_031_8);
    let (low, high) = estimate.ci95.unwrap();
    near(low, 0.455_573_612_687_266_1);
    near(high, 0.991_938_512_950_288_7);
    near(f.test.as_ref().unwrap().p, 10.0 / 720.0);
    near(
        a.values.number("corr_delivered/pearson/p_t").unwrap(),
        0.008_204_689_933_874_017,
    );
    let text = words(&html(&a));
    for said in [
        "Does the VAF of what was delivered predict realism?",
        "Was the force that of the realization?",
        "The force was judged in 17 trials that count: right in 16, marked in 1 (6",
        "In 1 trial, too little was felt or reported for a verdict.",
        "figures/rendering.pdf",
        "Realizations of which more was delivered",
    ] {
        assert!(text.contains(said), "{said}:\n{text}");
    }
    assert!(a.warnings.iter().any(|w| w.code == "wrong-force"));
}

#[test]
fn counts_are_by_realization_and_by_participant() {
    let a = analysis(true, &Rules::default());
    let get = |id: &str| a.values.number(id);
    assert_eq!(get("rendering/n_ok"), Some(16.0));
    assert_eq!(get("rendering/share_wrong"), Some(1.0 / 17.0));
    assert_eq!(get("rendering/M6/n_flag"), Some(1.0));
    assert_eq!(get("rendering/M6/n_too_little"), Some(1.0));
    assert_eq!(get("rendering/M6/rendered_vaf/min"), Some(0.75));
    assert_eq!(get("rendering/M6/gain/mean"), Some(0.75));
    assert_eq!(get("rendering/M1/delivered_vaf/mean"), Some(0.71));
    assert_eq!(get("rendering_subject/P2/n_flag"), Some(1.0));
    assert_eq!(get("rendering_subject/P1/n_flag"), Some(0.0));
}

/// Without a validation recording there is a reason and no number.
#[test]
fn without_a_recording_there_is_a_reason() {
    let a = analysis(false, &Rules::default());
    let f = a.finding(&Question::Delivered).unwrap();
    let why = "no playback has a delivered VAF: it needs the validation recording in the folder of \
               the protocol";
    assert_eq!(f.reason(), Some(why));
    assert_eq!(
        a.values.reason("rendering/M1/delivered_vaf/mean"),
        Some(why)
    );
    let text = words(&html(&a));
    assert!(text.contains(why), "{text}");
    assert!(
        !text.contains("Does the VAF of what was delivered"),
        "{text}"
    );
}

#[test]
fn rules_exclude_trials_by_their_force() {
    let lost = |rule: Exclusion| {
        let rules = Rules {
            exclude: vec![rule],
            ..Rules::default()
        };
        let a = analysis(true, &rules);
        let gone = a.rows.iter().filter(|row| row.excluded.is_some());
        gone.map(|row| format!("{} {}", a.subject(row), a.model(row)))
            .collect::<Vec<_>>()
    };
    assert_eq!(lost(Exclusion::WrongForce), ["P2 M6"]);
    assert_eq!(lost(Exclusion::UnverifiedForce), ["P2 M6", "P3 M6"]);
}

/// A table that says nothing of the force has nothing about it in its report.
#[test]
fn a_table_without_the_columns_has_no_section() {
    let csv = "subject,model,rating,vaf\nS1,A,1,0.5\nS1,B,2,0.6\nS2,A,2,0.5\nS2,B,3,0.6\n";
    let ratings = Ratings::read_csv("r.csv", csv.as_bytes(), None).unwrap();
    let a = analyze(&ratings, &Rules::default());
    assert!(a.finding(&Question::Delivered).is_none());
    assert!(a.values.iter().all(|(id, _)| !id.starts_with("rendering")));
    assert!(!words(&html(&a)).contains("Was the force"));
}
