//! What is weighed in choices, as text, as a table, and as a file of weights.

use crate::part_answers::included;
use std::fmt::Write as _;
use study_analysis::analyze::psychophysics::perceptual::{Perceived, Verdict, Weighing};
use study_base::text::{Untrusted, counted};
use study_haptics::identify::perceptual::{Component, Weights, file};
use study_haptics::recording::Recording;
use study_stats::choice_weights::{FEWEST_PEOPLE, LeftOut, Penalty};

/// Everything for a terminal. `reference` is the recording with which realizations were compared.
pub fn text(weighings: &[Weighing], reference: &Recording) -> String {
    let mut out = String::new();
    for found in weighings {
        let _ = writeln!(
            out,
            "Part {}: what is weighed of the errors against {}",
            found.part,
            Untrusted(&reference.name)
        );
        if let Some(banner) = included(found.simulated, found.pilot) {
            let _ = writeln!(out, "{banner}");
        }
        for (n, what) in [
            (found.undecided, "without a preference"),
            (found.without_table, "with a realization without a table"),
        ] {
            if n > 0 {
                let trials = counted(n, "trial", "trials");
                let _ = writeln!(out, "Not counted: {trials} {what}");
            }
        }
        match &found.found {
            Ok(own) => weights(&mut out, own),
            Err(why) => {
                let _ = writeln!(out, "\nNo weights: {why}.\n");
            }
        }
    }
    out
}

fn weights(out: &mut String, own: &Perceived) {
    let weighed = &own.weighed;
    let _ = writeln!(
        out,
        "{} of {}. Errors are shares of the variance of the force, weights in units of the noise of one impression.\n",
        counted(weighed.choices, "choice", "choices"),
        counted(weighed.participants, "participant", "participants"),
    );
    let names: Vec<String> = own
        .groups
        .iter()
        .map(|group| group.join(" with "))
        .collect();
    let width = names.iter().map(String::len).max().unwrap_or(0).max(9);
    let _ = writeln!(
        out,
        "{:width$}  {:>9}  share  interval",
        "component", "weight"
    );
    for (i, name) in names.iter().enumerate() {
        let share = match &weighed.shares {
            Some(shares) => format!("{:5.2}", shares[i]),
            None => format!("{:>5}", "-"),
        };
        let (low, high) = weighed.shares_ci95[i];
        let _ = writeln!(
            out,
            "{name:width$}  {:>9.3}  {share}  {low:.2} to {high:.2}",
            weighed.weights[i]
        );
    }
    for name in &own.unvaried {
        let _ = writeln!(
            out,
            "{name:width$}  {:>9}  {:>5}  the compared realizations hardly differ in it",
            "-", "-"
        );
    }
    let _ = writeln!(
        out,
        "All intervals together hold with 95 %. {}",
        match weighed.penalty {
            Penalty::Equal => "Cross-validation chose equal weights.".to_owned(),
            Penalty::Unequal(lambda) =>
                format!("Cross-validation chose the penalty {lambda} of differences."),
            Penalty::Sparse(alpha) =>
                format!("Cross-validation chose the penalty {alpha} of small weights."),
        }
    );
    if !own.mixed.is_empty() {
        let mixed: Vec<&str> = own.mixed.iter().map(|i| names[*i].as_str()).collect();
        let _ = writeln!(
            out,
            "Hardly told from the others in these realizations: {}.",
            mixed.join(", ")
        );
    }
    if !weighed.over_participants {
        let _ = writeln!(
            out,
            "With fewer than {FEWEST_PEOPLE} participants all of this is of these participants only."
        );
    }
    predictions(out, own);
    let _ = writeln!(out, "\n{}\n", sentence(own, &names));
}

/// The choices that were left out, with weights and with equal ones.
fn predictions(out: &mut String, own: &Perceived) {
    let weighed = &own.weighed;
    let units = match weighed.over_participants {
        true => "participants",
        false => "choices",
    };
    let _ = writeln!(
        out,
        "\n{:12}  predicted  by equal   ln p  by equal  gain in ln p",
        "left out"
    );
    let mut row = |name: &str, found: &Option<LeftOut>| {
        let Some(found) = found else {
            let _ = writeln!(out, "{name:12}  nothing is left to predict from");
            return;
        };
        let interval = match found.gain_ci95 {
            Some((low, high)) => format!(" [{low:+.3}, {high:+.3}]"),
            None => String::new(),
        };
        let _ = writeln!(
            out,
            "{name:12}  {:>7.1} %  {:>6.1} %  {:>5.3}  {:>8.3}  {:+.3}{interval}",
            100.0 * found.right,
            100.0 * found.equal_right,
            found.score,
            found.equal_score,
            found.gain
        );
    };
    row(units, &weighed.left_out);
    row("realizations", &weighed.other_stimuli);
    let _ = writeln!(
        out,
        "ln p is {:.3} by guessing; equal weights are those of VAF.",
        0.5f64.ln()
    );
}

/// What follows, in words.
fn sentence(own: &Perceived, names: &[String]) -> String {
    match own.verdict {
        Verdict::Unequal => {
            let weights = own.weighed.weights.iter().enumerate();
            let most = weights.max_by(|a, b| a.1.total_cmp(b.1)).map_or(0, |m| m.0);
            format!(
                "These weights predict choices that were left out better than VAF does; the largest is that of {}.",
                names[most]
            )
        }
        Verdict::Equal => {
            "It was not shown that weights that differ predict left-out choices, also between left-out realizations, better than VAF does."
                .to_owned()
        }
        Verdict::Nothing if own.weighed.sensitivity_ci95.1 < 0.0 => {
            "Of two realizations that with the larger errors was preferred: what decides is something else than these errors."
                .to_owned()
        }
        Verdict::Nothing => {
            "These choices do not tell whether anything of the errors is weighed.".to_owned()
        }
    }
}

/// A table of the components: weight, share and its interval.
///
/// # Errors
/// If the writer of the table fails.
pub fn table(own: &Perceived) -> Result<Vec<u8>, csv::Error> {
    let mut rows = csv::Writer::from_writer(Vec::new());
    rows.write_record(["components", "weight", "share", "share_lo", "share_hi"])?;
    let weighed = &own.weighed;
    for (i, group) in own.groups.iter().enumerate() {
        let share = weighed.shares.as_ref().map(|shares| shares[i].to_string());
        let (low, high) = weighed.shares_ci95[i];
        rows.write_record([
            group.join("+"),
            weighed.weights[i].to_string(),
            share.unwrap_or_default(),
            low.to_string(),
            high.to_string(),
        ])?;
    }
    rows.into_inner().map_err(|e| e.into_error().into())
}

/// The file for `study identify --weights`; `None` unless the weights predict better than equal ones.
pub fn file_text(study: &str, found: &Weighing, reference: &Recording) -> Option<String> {
    let own = found.found.as_ref().ok()?;
    if own.verdict != Verdict::Unequal {
        return None;
    }
    let known = Component::ALL.map(|component| own.weight(component.as_str()));
    let sum: f64 = known.iter().flatten().sum();
    let who = match included(found.simulated, found.pilot) {
        Some(banner) => format!(" {banner}"),
        None => String::new(),
    };
    let note = format!(
        "study {study}, part {}: {} of {}, errors against {} ({}).{who}",
        found.part,
        counted(own.weighed.choices, "choice", "choices"),
        counted(own.weighed.participants, "participant", "participants"),
        reference.name,
        reference.sha256,
    );
    let weights = Weights::new(known.map(|w| Some(w? / sum)), Some(note))?;
    Some(file::write(&weights))
}

/// What to say of a study without comparisons.
pub fn none(study: &str) -> String {
    format!(
        "the study `{}` has no part of kind \"pairs\" or \"search\"",
        Untrusted(study)
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_analysis::analyze::psychophysics::perceptual::Unknown;
    use study_base::text::PartId;
    use study_stats::choice_weights::{NoWeights, Weighed};

    fn reference() -> Recording {
        let csv = "t_s,x_mm,f_n\n0,0,2\n0.5,4,3\n1,2,1\n";
        study_haptics::recording::read("r.csv", csv.as_bytes()).unwrap()
    }

    fn weighing(verdict: Verdict) -> Weighing {
        let left_out = LeftOut {
            choices: 400.0,
            score: -0.511,
            equal_score: -0.6926,
            right: 0.72,
            equal_right: 0.55,
            gain: 0.1816,
            gain_ci95: Some((0.1498, 0.2136)),
        };
        Weighing {
            part: PartId::new("better").unwrap(),
            pilot: false,
            simulated: true,
            undecided: 12,
            without_table: 0,
            found: Ok(Perceived {
                groups: vec![vec!["level", "detent"], vec!["direction"]],
                unvaried: vec!["fast"],
                mixed: vec![1],
                weighed: Weighed {
                    weights: vec![30.0, 10.0],
                    shares: Some(vec![0.75, 0.25]),
                    shares_ci95: vec![(0.5, 1.0), (0.0, 0.5)],
                    sensitivity_ci95: (20.0, 60.0),
                    penalty: Penalty::Unequal(0.1),
                    choices: 400,
                    participants: 4,
                    over_participants: false,
                    left_out: Some(left_out),
                    other_stimuli: None,
                },
                verdict,
            }),
        }
    }

    #[test]
    fn weights_are_told_with_what_they_predict() {
        let found = text(&[weighing(Verdict::Unequal)], &reference());
        let expected = "\
Part better: what is weighed of the errors against r.csv
SIMULATED participants are included.
Not counted: 12 trials without a preference
400 choices of 4 participants. Errors are shares of the variance of the force, weights in units of the noise of one impression.

component             weight  share  interval
level with detent     30.000   0.75  0.50 to 1.00
direction             10.000   0.25  0.00 to 0.50
fast                       -      -  the compared realizations hardly differ in it
All intervals together hold with 95 %. Cross-validation chose the penalty 0.1 of differences.
Hardly told from the others in these realizations: direction.
With fewer than 5 participants all of this is of these participants only.

left out      predicted  by equal   ln p  by equal  gain in ln p
choices          72.0 %    55.0 %  -0.511    -0.693  +0.182 [+0.150, +0.214]
realizations  nothing is left to predict from
ln p is -0.693 by guessing; equal weights are those of VAF.

These weights predict choices that were left out better than VAF does; the largest is that of level with detent.

";
        assert_eq!(found, expected);
        let csv = match &weighing(Verdict::Unequal).found {
            Ok(own) => String::from_utf8(table(own).unwrap()).unwrap(),
            Err(why) => panic!("{why}"),
        };
        assert_eq!(
            csv,
            "components,weight,share,share_lo,share_hi\nlevel+detent,30,0.75,0.5,1\ndirection,10,0.25,0,0.5\n"
        );
    }

    #[test]
    fn only_weights_that_predict_better_become_a_file() {
        let text = file_text("s", &weighing(Verdict::Unequal), &reference()).unwrap();
        let (read, findings) = file::parse("w.toml", &text);
        let read = read.unwrap_or_else(|| panic!("{findings:?}"));
        // Shares of the sum over components, of which level and detent have one weight.
        let known = Component::ALL.map(|component| read.known(component));
        let [level, direction] = [30.0 / 70.0, 10.0 / 70.0].map(Some);
        assert_eq!(known, [level, level, direction, None, None]);
        let note = read.note.unwrap();
        assert!(note.starts_with(
            "study s, part better: 400 choices of 4 participants, errors against r.csv ("
        ));
        assert!(note.ends_with("SIMULATED participants are included."));
        for verdict in [Verdict::Equal, Verdict::Nothing] {
            assert_eq!(file_text("s", &weighing(verdict), &reference()), None);
        }
        let unknown = Weighing {
            found: Err(Unknown::Choices(NoWeights::TooFew(3))),
            ..weighing(Verdict::Equal)
        };
        assert_eq!(file_text("s", &unknown, &reference()), None);
        let said = text_of(unknown);
        assert!(
            said.ends_with("\nNo weights: 3 choices are too few; 10 are needed.\n\n"),
            "{said}"
        );
    }

    /// Larger errors that are preferred are known, though nothing is weighed as an error.
    #[test]
    fn what_is_preferred_for_its_errors_is_told() {
        let mut found = weighing(Verdict::Nothing);
        assert!(text_of(found.clone()).contains("\nThese choices do not tell "));
        if let Ok(own) = &mut found.found {
            own.weighed.sensitivity_ci95 = (-60.0, -20.0);
        }
        let said = text_of(found);
        assert!(
            said.contains("\nOf two realizations that with the larger errors was preferred"),
            "{said}"
        );
    }

    fn text_of(found: Weighing) -> String {
        text(&[found], &reference())
    }
}
