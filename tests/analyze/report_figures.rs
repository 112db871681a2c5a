//! The figures of a report: what they show, and in which order.

#![allow(clippy::unwrap_used)]

use super::report_support::{FIVE, analysis_of, ratings};
use std::collections::BTreeSet;
use study_analysis::analyze::{Analysis, Exclusion, Rules, analyze};
use study_report::figures::{self, Drawn};
use study_session::outcome::ratings::Ratings;

fn figure(a: &Analysis, name: &str) -> Option<Drawn> {
    figures::all(a, &[]).into_iter().find(|f| f.name == name)
}

/// A column of a figure's data.
fn column(drawn: &Drawn, name: &str) -> Vec<String> {
    let mut lines = drawn.data.lines();
    let head: Vec<&str> = lines.next().unwrap().split(',').collect();
    let at = head.iter().position(|h| *h == name).unwrap();
    lines
        .map(|l| l.split(',').nth(at).unwrap().to_owned())
        .collect()
}

fn numbers(drawn: &Drawn, name: &str) -> Vec<f64> {
    let all = column(drawn, name);
    all.iter().map(|x| x.parse().unwrap()).collect()
}

/// Thirty realizations with names of 18 letters.
fn thirty() -> Analysis {
    let names: Vec<String> = (0..30)
        .map(|i| format!("lambda-0.99{i:02}-dx-0.5"))
        .collect();
    let models: Vec<(&str, f64)> = (names.iter().enumerate())
        .map(|(i, n)| (n.as_str(), 0.9 + 0.001 * ((7 * i) % 30) as f64))
        .collect();
    analysis_of(&ratings(8, &models, |s, m, k| {
        (1 + (s + m + k + s * m) % 7) as f64
    }))
}

#[test]
fn realizations_are_in_the_order_of_vaf_or_of_their_means() {
    let mut models = FIVE;
    (models[0].1, models[4].1) = (models[4].1, models[0].1);
    let rate = |s: usize, m: usize, k: usize| (2 + m % 3 + (s * k) % 3) as f64;
    let csv = ratings(6, &models, rate);
    let means = figure(&analysis_of(&csv), "fig10-means").unwrap();
    assert_eq!(column(&means, "model"), ["e", "b", "c", "d", "a"]);
    assert!(means.caption.contains("in the order of VAF"));
    // Without VAF.
    let bare: String = (csv.lines())
        .map(|l| format!("{}\n", l.rsplit_once(',').unwrap().0))
        .collect();
    let means = figure(&analysis_of(&bare), "fig10-means").unwrap();
    let drawn = numbers(&means, "mean_drawn");
    assert!(drawn.windows(2).all(|w| w[0] <= w[1]), "{drawn:?}");
    assert!(means.caption.contains("in the order of the means"));
    assert!(!means.wide.to_svg().contains("VAF"));
}

#[test]
fn the_bars_of_means_are_within_participants_or_of_adjusted_means() {
    // Participants differ much more than realizations.
    let rate = |s: usize, m: usize, k: usize| (s + m % 3 + (s * m * k) % 2) as f64;
    let csv = ratings(6, &FIVE, rate);
    let a = analysis_of(&csv);
    let means = figure(&a, "fig10-means").unwrap();
    let half = a.values.number("desc/a/cousineau_morey/ci95_half").unwrap();
    let (low, high) = (numbers(&means, "bar_lo"), numbers(&means, "bar_hi"));
    assert!((high[0] - low[0] - 2.0 * half).abs() < 1e-12);
    assert!(means.caption.contains("Cousineau–Morey"));
    // The severest participant leaves out a realization: its raw mean is too high.
    let part: String = (csv.lines())
        .filter(|l| !l.starts_with("S0,e,"))
        .map(|l| format!("{l}\n"))
        .collect();
    let a = analysis_of(&part);
    let means = figure(&a, "fig10-means").unwrap();
    let drawn = numbers(&means, "mean_drawn");
    assert_eq!(Some(drawn[4]), a.values.number("adjusted/e/mean"));
    assert!(drawn[4] < a.values.number("desc/e/subject_mean/mean").unwrap() - 0.2);
    let low = numbers(&means, "bar_lo");
    assert_eq!(Some(low[4]), a.values.number("adjusted/e/ci95_lo"));
    assert!(means.caption.starts_with("Adjusted mean"));
    let against = figure(&a, "rating-against-vaf").unwrap();
    assert_eq!(numbers(&against, "mean"), drawn);
}

#[test]
fn every_name_is_whole_in_every_figure() {
    let a = thirty();
    let all = figures::all(&a, &[]).into_iter();
    for drawn in all.filter(|drawn| drawn.name != "participants") {
        for figure in [&drawn.wide, &drawn.narrow] {
            let svg = figure.to_svg();
            assert!(!svg.contains('…'), "{}: a name is cut", drawn.name);
            let named = a.realizations.iter().filter(|m| svg.contains(&m.id));
            assert_eq!(named.count(), 30, "{}", drawn.name);
            if drawn.name == "rating-against-vaf" {
                // A label without a free place is not drawn.
                let labels = svg.matches("paint-order=\"stroke\"").count();
                assert_eq!(labels, 30, "{}", drawn.name);
            }
        }
    }
}

#[test]
fn the_line_through_the_means_is_that_of_least_squares() {
    // Means 2, 3, 4, 5, 7 at VAF .70 to .90: slope 24, and 3 degrees of freedom.
    let means = [2.0, 3.0, 4.0, 5.0, 7.0];
    let a = analysis_of(&ratings(4, &FIVE, |s, m, _| {
        means[m] + if s % 2 == 0 { 0.5 } else { -0.5 }
    }));
    let against = figure(&a, "rating-against-vaf").unwrap();
    let line = numbers(&against, "line");
    for (drawn, expected) in line.iter().zip([1.8, 3.0, 4.2, 5.4, 6.6]) {
        assert!((drawn - expected).abs() < 1e-9, "{line:?}");
    }
    // R: predict(lm(y ~ x), interval = "confidence") at .80: half width
    // t(.975, 3) √(0.4/3) √(1/5) = 0.5197.
    let half = numbers(&against, "band_hi")[2] - line[2];
    assert!((half - 0.519_7).abs() < 1e-4, "{half}");
}

#[test]
fn pairs_are_those_of_the_analysis_the_higher_mean_first() {
    let rate = |s: usize, m: usize, k: usize| (1 + (s + 2 * m + s * k * m) % 7) as f64;
    let a = analysis_of(&ratings(9, &FIVE, rate));
    let pairs = figure(&a, "pairs").unwrap();
    let differences = numbers(&pairs, "difference");
    assert_eq!(differences.len(), 10);
    assert!(differences.windows(2).all(|w| w[0] >= w[1]) && differences[9] >= 0.0);
    let (higher, lower) = (column(&pairs, "higher"), column(&pairs, "lower"));
    let (low, high) = (numbers(&pairs, "ci95_lo"), numbers(&pairs, "ci95_hi"));
    for i in 0..10 {
        assert!(low[i] < differences[i] && differences[i] < high[i]);
        let mean = |m: &str| a.values.number(&format!("adjusted/{m}/mean")).unwrap();
        let expected = mean(&higher[i]) - mean(&lower[i]);
        assert!((differences[i] - expected).abs() < 1e-9);
    }
    let thirty = figure(&thirty(), "pairs").unwrap();
    let best: BTreeSet<String> = column(&thirty, "higher").into_iter().collect();
    assert_eq!((best.len(), column(&thirty, "lower").len()), (1, 29));
}

#[test]
fn ratings_of_a_slider_are_strips_and_not_bars() {
    let rate = |s: usize, m: usize, k: usize| 10.0 * m as f64 + 1.7 * s as f64 + 0.3 * k as f64;
    let a = analysis_of(&ratings(120, &FIVE, rate));
    assert!(figure(&a, "histograms").is_none());
    let strips = figure(&a, "strips").unwrap();
    let models = column(&strips, "model");
    let dots = models.iter().filter(|m| *m == "a").count();
    assert!((100..=200).contains(&dots), "{dots}");
    assert!(strips.caption.contains("left out evenly"));
    // A short scale of whole numbers has bars.
    let whole = analysis_of(&ratings(6, &FIVE, |s, m, _| (1 + (s + m) % 5) as f64));
    assert!(figure(&whole, "strips").is_none() && figure(&whole, "histograms").is_some());
}

#[test]
fn files_of_figures_say_what_the_data_are() {
    let mut a = analysis_of(&ratings(4, &FIVE, |s, m, _| (1 + (s + m) % 5) as f64));
    let said = |a: &Analysis| {
        let all: BTreeSet<Option<String>> = (figures::all(a, &[]).into_iter())
            .flat_map(|f| [&f.wide, &f.narrow].map(|p| p.note().map(str::to_owned)))
            .collect();
        assert_eq!(all.len(), 1);
        all.into_iter().next().unwrap().unwrap_or_default()
    };
    assert_eq!(said(&a), "");
    a.counts.simulated = 1;
    assert_eq!(said(&a), "includes pilot or simulated data");
    a.counts.simulated = a.counts.participants;
    assert_eq!(said(&a), "simulated data, no participants");
    (a.counts.pilots, a.counts.simulated) = (a.counts.participants, 0);
    assert_eq!(said(&a), "pilot data, no participants");
}

/// Counted by hand; the sum of what is left out, without a rating and analyzed is what is on record.
#[test]
fn the_flow_of_participants_says_who_is_left_out() {
    let csv = "subject,model,repetition,rating,vaf\n\
               S1,a,1,2,0.5\nS1,b,1,4,0.6\nS1,c,1,6,0.7\n\
               S2,a,1,1,0.5\nS2,b,1,,0.6\nS2,c,1,7,0.7\n\
               S3,a,1,4,0.5\nS3,b,1,4,0.6\nS3,c,1,4,0.7\n";
    let ratings = Ratings::read_csv("data.csv", csv.as_bytes(), None).unwrap();
    let rules = Rules {
        exclude: vec![Exclusion::ConstantRater],
        ..Rules::default()
    };
    let flow = figure(&analyze(&ratings, &rules), "participants").unwrap();
    let rule = Exclusion::ConstantRater.to_string();
    let expected = format!(
        "group,step,reason,participants,trials\n,recorded,,3,9\n,participants left out,rule {rule},1,3\n\
         ,without a rating,,1,1\n,analyzed,,2,5\n"
    );
    assert_eq!(flow.data.replace("\r\n", "\n"), expected);
    for picture in [flow.wide.to_svg(), flow.narrow.to_svg()] {
        let words: Vec<&str> = picture.split(['<', '>']).collect();
        for line in ["On record", "Analyzed"] {
            assert!(words.contains(&line), "{picture}");
        }
    }
    // Long reasons and group names are broken, not cut.
    let mut grouped = ratings.clone();
    for (i, subject) in grouped.subjects.iter_mut().enumerate() {
        subject.group = Some(format!("{}{}", "x".repeat(90), i % 2));
    }
    let flow = figure(&analyze(&grouped, &Rules::default()), "participants").unwrap();
    let svg = flow.narrow.to_svg();
    let letters = svg.matches('x').count();
    assert!(letters >= 2 * 2 * 90, "{svg}");
}
