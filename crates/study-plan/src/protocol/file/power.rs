//! `[power]`: assumptions for `study power`.

use crate::protocol::keys::{Key, Kind, Word, Words, keys};
use crate::protocol::power::{
    PowerLink, PowerPlan, PowerScale, PowerSpread, PowerTest, PowerTrack, PowerVaf, effect,
};
use crate::protocol::section::Section;
use std::ops::Bound;
use study_base::diagnostic::Fault;
use study_base::text::Untrusted;

const SHARE: Kind = Kind::Number((Bound::Included(0.0), Bound::Excluded(1.0)), "");

pub(super) const POWER: &[Key] = keys! {
    /// How many studies are simulated for each design.
    "studies": Kind::Whole(10, 10_000_000), "40000", derived("10000; of pairs and of effects 2000, of ranking, adjustment and identification 1000, of tracks and similarity 200");
    /// The power that is wanted.
    "targets": Kind::NumberList, "[0.8, 0.9]";
    /// The tests whose power is simulated: `verdict`, `pearson`, `permutation`, `crossed`,
    /// `friedman`, `clmm`, `equivalence`, `reference-equivalence`; of pairs `preferred`,
    /// `preference-vaf`; of tracks `thresholds`, `told-apart`; of a factorial study `effect`; of ranking `ranked-alike`,
    /// `ranked-first`; of similarity `map-follows`; of adjustment `adjusted`; of identification `identified`. The first one decides about
    /// designs. Without it: the verdicts of the analysis.
    "tests": Kind::Texts(1), r#"["verdict", "crossed"]"#;
    /// Rating points per standard deviation of VAF (with the number of realizations as the
    /// denominator).
    "slope": Kind::ANY_NUMBER, "0.5";
    /// Instead of `slope`: the correlation of VAF with the means that endlessly many
    /// participants would give.
    "rho": Kind::Number((Bound::Excluded(-1.0), Bound::Excluded(1.0)), ""), "0.86";
    /// The smallest slope of interest: how wrong would a significant estimate of it be?
    "smallest": Kind::positive("points"), "0.3";
    /// The mean rating, before it is cut to the scale. Without it: the middle of the scale. Of adjustment it is the mean level that
    /// is set, of identification the share of correct answers.
    "mean": Kind::ANY_NUMBER, "4.5";
    /// Standard deviations of the random effects, in rating points; of pairs in logits, of
    /// tracks in natural logarithms of the threshold (in levels for a blend, in d′ for two
    /// realizations), of adjustment in levels, of identification in logits. Of ranking only their ratios count.
    "sd": Kind::Table(SD), "{ realization = 0.3, residual = 0.8 }";
    /// How a number becomes a rating. Without it: rounded for a rating, else continuous.
    "scale": Kind::WordOrTable(SCALES, ORDINAL), r#""continuous""#;
    /// Where VAF come from. Without it: those listed for as many realizations, else even
    /// steps over their range.
    "vaf": Kind::Word(PowerVaf::WORDS), r#""drawn""#;
    /// The share of participants who are lost whole.
    "dropout": SHARE, "0.1";
    /// The share of trials without a rating.
    "missing": SHARE, "0.02";
    /// The true mean of the hidden reference minus that of the realization with the highest
    /// VAF, for `reference-equivalence`. Without it 0: the two are alike.
    "reference": Kind::ANY_NUMBER, "0.2";
    /// Of a factorial study: effects and their sizes, in rating points. That of a factor is the difference of the means
    /// at its last and first level, with those between in even steps; that of an interaction is by how much this difference changes from the first to the last level of
    /// the other factor (of more factors likewise). Effects that are not named have the size 0. Without it: 0.5 for every effect that is tested.
    "effects": Kind::Texts(1), r#"["friction=0.5", "friction:detent=0.5"]"#;
    /// Pairs: the share of "no difference" between two realizations that are alike. Without
    /// it 0.2, if it is an answer.
    "ties": SHARE, "0.25";
    /// What is assumed of participants on tracks.
    "track": Kind::Table(TRACK), "{ threshold = 0.4, ratio = 1.5 }";
    /// A design is simulated no further once the interval of its power is ± this, checked
    /// after each thousand studies. Without it: all `studies`.
    "within": Kind::Number((Bound::Excluded(0.0), Bound::Excluded(1.0)), ""), "0.02";
    /// Designs with longer sessions are not proposed.
    "max_session_min": Kind::positive("min"), "45";
    /// The designs that are compared.
    "grid": Kind::Table(GRID), "{ participants = [10, 20, 40] }";
};

const SD: &[Key] = keys! {
    /// Levels of the participants. No test of VAF depends on it.
    "participant": Kind::not_negative("points"), "0.6";
    /// True means of the realizations about the line: what more participants cannot
    /// average away.
    "realization": Kind::not_negative("points"), "0.3";
    /// Participant × realization.
    "interaction": Kind::not_negative("points"), "0.4";
    /// Repetition to repetition. Not with the link `logit`, which has its own.
    "residual": Kind::not_negative("points"), "0.8";
    /// Slopes of the participants.
    "slope": Kind::not_negative("points"), "0.2";
};

const TRACK: &[Key] = keys! {
    /// The typical threshold on the first track. Without it: the middle of its ladder.
    "threshold": Kind::positive(""), "0.4";
    /// The typical threshold on the last track over that on the first; those between are in
    /// even steps. Without it 1.5.
    "ratio": Kind::positive(""), "1.3";
    /// Instead of `ratio`, for a blend: the difference. Without it a fifth of the ladder.
    "difference": Kind::ANY_NUMBER, "0.1";
    /// How far apart the levels with 5 and 95 % of the function are. Without it: the
    /// threshold, or a third of the ladder of a blend.
    "width": Kind::positive(""), "0.5";
    /// The share of trials that are answered without attention. Without it 0.02.
    "lapse": Kind::Number((Bound::Included(0.0), Bound::Excluded(0.5)), ""), "0.02";
    /// The share of "yes" without a signal, of `yes-no`. Without it 0.1.
    "guess": Kind::Number((Bound::Included(0.0), Bound::Excluded(0.5)), ""), "0.1";
    /// The mean d′ of two realizations. Without it 1.
    "d": Kind::not_negative(""), "0.8";
};

const SCALES: &[Word] = &[
    Word::new("continuous", "The number is the rating."),
    Word::new(
        "rounded",
        "It is rounded to the scale of the primary question.",
    ),
];

const ORDINAL: &[Key] = keys! {
    /// The distribution of the residual, which sets the unit of all standard deviations.
    "link": Kind::Word(PowerLink::WORDS), r#""logit""#, required;
    /// The rating is the lowest one plus the number of thresholds below the number: one
    /// fewer than levels, rising.
    "thresholds": Kind::NumberList, "[-2, -1, 0, 1]", required;
};

const GRID: &[Key] = keys! {
    /// Numbers of participants.
    "participants": Kind::WholeList(2, 10_000), "[10, 20, 40]";
    /// Numbers of realizations.
    "realizations": Kind::WholeList(3, 200), "[5, 8, 12]";
    /// Numbers of repetitions.
    "repetitions": Kind::WholeList(1, 100), "[1, 3]";
};

pub(super) fn read(mut section: Section<'_, '_>) -> Option<PowerPlan> {
    let tests = (section.texts("tests").into_iter())
        .filter_map(|(value, _)| value.word(PowerTest::VALUES))
        .collect();
    let targets = section.numbers("targets").unwrap_or_default();
    if targets.iter().any(|power| *power <= 0.0 || *power >= 1.0) {
        section.fault_at(
            "targets",
            Fault::error("a power that is wanted has to be between 0 and 1"),
        );
    }
    let mut plan = PowerPlan {
        studies: section.whole("studies"),
        targets,
        tests,
        slope: section.number("slope"),
        rho: section.number("rho"),
        smallest: section.number("smallest"),
        mean: section.number("mean"),
        scale: scale(&mut section),
        vaf: section.word("vaf"),
        dropout: section.number("dropout"),
        missing: section.number("missing"),
        reference: section.number("reference"),
        effects: effects(&mut section),
        ties: section.number("ties"),
        within: section.number("within"),
        max_session_min: section.number("max_session_min"),
        ..PowerPlan::default()
    };
    if let Some(mut sd) = section.section("sd") {
        plan.sd = PowerSpread {
            participant: sd.number("participant"),
            realization: sd.number("realization"),
            interaction: sd.number("interaction"),
            residual: sd.number("residual"),
            slope: sd.number("slope"),
        };
    }
    if let Some(mut track) = section.section("track") {
        plan.track = PowerTrack {
            threshold: track.number("threshold"),
            ratio: track.number("ratio"),
            difference: track.number("difference"),
            width: track.number("width"),
            lapse: track.number("lapse"),
            guess: track.number("guess"),
            d: track.number("d"),
        };
    }
    if let Some(mut grid) = section.section("grid") {
        plan.participants = grid.wholes("participants");
        plan.realizations = grid.wholes("realizations");
        plan.repetitions = grid.wholes("repetitions");
    }
    Some(plan)
}

fn effects(section: &mut Section<'_, '_>) -> Vec<(String, f64)> {
    let mut found: Vec<(String, f64)> = Vec::new();
    for (value, text) in section.texts("effects") {
        match effect(&text) {
            Ok((name, _)) if found.iter().any(|other| other.0 == name) => {
                let what = format!("the effect `{}` is there twice", Untrusted(&name));
                value.fault(Fault::error(what));
            }
            Ok(one) => found.push(one),
            Err(expected) => {
                let what = format!("`{}` is no effect with a size", Untrusted(&text));
                value.fault(Fault::error(what).hint(expected));
            }
        }
    }
    found
}

fn scale(section: &mut Section<'_, '_>) -> Option<PowerScale> {
    let value = section.value("scale")?;
    if !value.is_table() {
        return value.word(&[
            ("continuous", PowerScale::Continuous),
            ("rounded", PowerScale::Rounded),
        ]);
    }
    let mut table = section.section("scale")?;
    let (link, thresholds) = (table.word("link"), table.numbers("thresholds"));
    let thresholds = thresholds.unwrap_or_default();
    if !thresholds.is_sorted_by(|a, b| a < b) {
        table.fault_at("thresholds", Fault::error("the thresholds do not rise"));
    }
    Some(PowerScale::Ordinal {
        link: link?,
        thresholds,
    })
}
