//! `[[tracks]]` and their procedures.

use super::grids::LAPSES;
use crate::procedure::{Function, Parameter, QuestPlus, Scale, Staircase, Stop};
use crate::protocol::keys::{Id, Key, Kind, Shape, Variants, Word, Words, keys};
use crate::protocol::section::{Section, Variant, shapes};
use crate::protocol::{Compared, FitRules, Method, Relative};
use std::ops::Bound;
use study_base::diagnostic::Fault;
use study_base::text::{ModelId, PartId};
use study_stats::psychometric::{Core, Spacing};

/// A share below one.
const SHARE: Kind = Kind::Number((Bound::Included(0.0), Bound::Excluded(1.0)), "");

pub(super) const TRACKS: &[Key] = keys! {
    /// The name of the track.
    "id": Kind::Id(Id::Part), r#""damping-up""#, required;
    /// The kind of trial.
    "method": Kind::Word(Method::WORDS), r#""2ifc""#, required;
    /// One of `[[families]]`: the comparison is one of its levels.
    "family": Kind::Id(Id::Part), r#""damping""#, derived("`models` are compared");
    /// The level of the other intervals. It need not be a level of the ladder, but has to pass
    /// the certificate, too.
    "standard": Kind::ANY_NUMBER, "1.0", derived("`models` are compared");
    /// How the track counts levels. With this key, all levels of the `procedure` and all
    /// thresholds are counted from the standard, and only levels above it are presented; "do
    /// thresholds differ?" compares them as they are counted. Without it they are levels of the
    /// family. Needs the format `study-protocol/3`.
    "relative": Kind::Word(Relative::WORDS), r#""increment""#;
    /// Two realizations instead of levels of a family: the standard and the comparison.
    "models": Kind::ModelIds, r#"["lambda-0.9991", "lambda-0.9995"]"#;
    /// The rule by which the next level is chosen.
    "procedure": Kind::Variant(&PROCEDURE), "", required;
    /// Whether the participant is told after each answer if it was correct.
    "feedback": Kind::Flag, "true", default("false");
    /// The share of trials without a signal, in the methods `yes-no` and `same-different`. They
    /// come in addition to those of the rule, which is not told of them.
    "catch": SHARE, "0.1", derived("0.2 in `yes-no`, 0.5 in `same-different`, else 0");
    /// The share of trials at the top of the ladder, which show lapses. They move no staircase;
    /// QUEST+ learns from them.
    "easy": SHARE, "0.1", default("0");
    /// The condition that the track measures. Tracks with the same one are fitted, compared and
    /// tested as one, such as two interleaved staircases from above and from below. They have
    /// the same method, family, standard and fit. It can be changed while a study runs. Needs
    /// the format `study-protocol/3`.
    "condition": Kind::Id(Id::Part), r#""damping""#, derived("one of its own, with the `id` of the track");
    /// How its psychometric functions are fitted. It can be changed while a study runs.
    "fit": Kind::Table(FIT), "{ core = \"logistic\" }";
};

const FIT: &[Key] = keys! {
    /// The scale of the levels over which a function is fitted. Over logarithms the threshold is
    /// a level all the same, and the width is the logarithm of a ratio.
    "scale": Kind::Word(Spacing::WORDS), r#""log""#, derived("`log` with `relative`, else the `scale` of the family");
    /// The shape of the function.
    "core": Kind::Word(Core::WORDS), r#""logistic""#, derived("`norm`; over logarithms `gumbel`");
    /// The lapse rate of the fit by maximum likelihood. The posterior estimates it.
    "lapse": Kind::Number((Bound::Included(0.0), Bound::Excluded(0.5)), ""), "0.01", default("0.02");
};

impl Words for Core {
    const VALUES: &'static [(&'static str, Self)] = &[
        ("norm", Self::Norm),
        ("logistic", Self::Logistic),
        ("gumbel", Self::Gumbel),
        ("rgumbel", Self::ReversedGumbel),
    ];
    const WORDS: &'static [Word] = &[
        Word::new("norm", "The cumulative normal."),
        Word::new("logistic", "The logistic function."),
        Word::new(
            "gumbel",
            "1 − exp(−exp(…)); over logarithms it is the Weibull function of the level.",
        ),
        Word::new("rgumbel", "exp(−exp(−…)), its mirror image."),
    ];
}

static PROCEDURE: Variants = Variants {
    tag: "rule",
    effect: "The rule",
    common: &[],
    shapes: &SHAPES,
};

static SHAPES: [Shape; RULES.len()] = shapes(&RULES);

const STOP: &[Key] = keys! {
    /// It stops after so many reversals,
    "reversals": Kind::COUNT, "8", required;
    /// but not before so many trials,
    "min_trials": Kind::Whole(0, u32::MAX as i64), "20", default("0");
    /// and in any case after so many.
    "max_trials": Kind::Whole(1, 10_000), "80", required;
};

/// Keys of both kinds of staircase.
macro_rules! staircase_keys {
    ($($own:tt)*) => {
        keys! {
            $($own)*
            /// The first level.
            "start": Kind::ANY_NUMBER, "2.0", required;
            /// The sizes of a step down: number i after i reversals, then the last.
            "steps": Kind::NumberList, "[0.2, 0.1, 0.05]", required;
            /// What a step does to the level.
            "scale": Kind::Word(Scale::WORDS), r#""log""#, default(r#""lin""#);
            /// When the track stops.
            "stop": Kind::Table(STOP), "{ reversals = 8, max_trials = 80 }", required;
            /// The estimate is the mean of so many last reversals.
            "estimate_last": Kind::COUNT, "8", default("6");
        }
    };
}

const RULES: [Variant<RawRule>; 4] = [
    Variant::new(
        "staircase",
        "Down after `down` correct answers in a row, up after `up` others (Levitt 1971). Never below the standard.",
        staircase_keys! {
            /// Answers in a row that are not correct, until the level rises.
            "up": Kind::COUNT, "1", required;
            /// Correct answers in a row, until the level falls.
            "down": Kind::COUNT, "3", required;
            /// Size of a step up, where 1 is a step down.
            "step_up_factor": Kind::positive(""), "1.5", default("1");
            /// Whether one answer is enough for a step until the first reversal.
            "initial_one_up_one_down": Kind::Flag, "false", default("true");
        },
        staircase,
    ),
    Variant::new(
        "weighted",
        "One up, one down, with a larger step up, so that it settles at `target` (Kaernbach 1991).",
        staircase_keys! {
            /// The share of correct answers at which it settles.
            "target": Kind::Number((Bound::Excluded(0.0), Bound::Excluded(1.0)), ""), "0.75", required;
        },
        weighted,
    ),
    Variant::new(
        "constant",
        "The method of constant stimuli: each level equally often, in random order.",
        keys! {
            /// Levels of the ladder.
            "levels": Kind::NumberList, "[0.5, 1.0, 2.0]", derived("all levels of the ladder");
            /// Trials of each level.
            "repetitions": Kind::Whole(1, 10_000), "20", required;
        },
        constant,
    ),
    Variant::new(
        "quest+",
        "QUEST+ (Watson 2017): the level whose answer is expected to tell most about the function.",
        keys! {
            /// The psychometric function, the probability of a correct answer: `weibull`,
            /// `weibull-db`, `weibull-log10`, `normal`, `normal-symmetric`, `logistic`, or a
            /// formula of `intensity` and the names of `parameters`.
            "function": Kind::Text, r#""normal""#, default(r#""weibull""#);
            /// Number of trials, or the most.
            "trials": Kind::Whole(1, 10_000), "40", required;
            /// The least number of trials, if the posterior may stop the track.
            "min_trials": Kind::Whole(0, 10_000), "20", default("0");
            /// Stops when the entropy of the posterior is below this.
            "entropy_below": Kind::positive("nat"), "2.5";
            /// Stops when the posterior standard deviation of the threshold is below this.
            "sd_below": Kind::positive("levels"), "0.05";
            /// The grid of thresholds (`mean` of `normal`).
            "threshold": Kind::NumberList, "[1.1, 1.2, 1.4]", derived("the levels of the ladder above 0, of many levels 60");
            /// The grid of slopes (`sd` of `normal`).
            "slope": Kind::NumberList, "[1, 2, 4, 8]", derived("six values, from shallow to steep; steeper ones for a standard above 0");
            /// The grid of guess rates, `gamma`.
            "guess": Kind::NumberList, "[0.5]", derived("that of the method; four values in `yes-no` and `same-different`");
            /// The grid of lapse rates, `lambda`.
            "lapse": Kind::NumberList, "[0.02]", default("[0.01, 0.03, 0.06]");
            /// Parameters of a formula, the one to estimate first; instead of the four grids.
            "parameters": Kind::Tables(PARAMETERS), "";
        },
        quest,
    ),
];

const PARAMETERS: &[Key] = keys! {
    /// Its name in the formula.
    "name": Kind::Text, r#""threshold""#, required;
    /// The grid.
    "values": Kind::NumberList, "[0.5, 1.0, 1.5]", required;
    /// A weight for each value.
    "prior": Kind::NumberList, "[1, 2, 1]", derived("equal weights");
};

impl Words for Scale {
    const VALUES: &'static [(&'static str, Self)] =
        &[("lin", Self::Lin), ("log", Self::Log), ("db", Self::Db)];
    const WORDS: &'static [Word] = &[
        Word::new("lin", "It is added."),
        Word::new(
            "log",
            "It is a power of ten by which the level is multiplied.",
        ),
        Word::new("db", "It is in decibels of amplitude."),
    ];
}

/// A track as it was read; its ids are not looked up yet.
#[derive(Debug)]
pub(super) struct RawTrack {
    /// Such as `tracks[0]`.
    pub(super) path: String,
    pub(super) id: Option<PartId>,
    pub(super) method: Option<Method>,
    pub(super) compared: Option<Compared>,
    pub(super) relative: Option<Relative>,
    pub(super) rule: Option<RawRule>,
    pub(super) feedback: bool,
    pub(super) catch: Option<f64>,
    pub(super) easy: f64,
    pub(super) fit: FitRules,
    pub(super) measures: Option<PartId>,
}

/// A rule whose defaults depend on family and method.
#[derive(Debug, Clone)]
pub(super) enum RawRule {
    Staircase(Staircase),
    Constant {
        levels: Option<Vec<f64>>,
        repetitions: u32,
    },
    QuestPlus {
        /// Without parameters, if they are to be made of the grids.
        rule: QuestPlus,
        threshold: Option<Vec<f64>>,
        slope: Option<Vec<f64>>,
        guess: Option<Vec<f64>>,
        lapse: Vec<f64>,
    },
}

pub(super) fn read(mut section: Section<'_, '_>) -> RawTrack {
    let (id, method) = (section.part_id("id"), section.word::<Method>("method"));
    let compared = compared(&mut section);
    let relative = section.word("relative");
    if relative.is_some() && matches!(compared, Some(Compared::Models { .. })) {
        let what = format!(
            "`{}` compares two models, which have no levels",
            section.path()
        );
        section.fault_at("relative", Fault::error(what).hint("leave `relative` out"));
    }
    if let (Some(Relative::Fraction), Some(Compared::Levels { standard, .. })) =
        (relative, &compared)
        && *standard <= 0.0
    {
        let what = format!("there are no fractions of the standard {standard}");
        let hint = "relative = \"increment\", or a standard above 0";
        section.fault_at("relative", Fault::error(what).hint(hint));
    }
    let rule = section.variant("procedure", &RULES);
    if rule.is_none() && section.value("procedure").is_none() {
        let hint = "such as procedure = { rule = \"quest+\", trials = 40 }";
        section.report_missing("procedure", hint.to_owned());
    }
    let rule = rule.and_then(|(mut section, rule)| (rule?.read)(&mut section));
    let catch = section.number("catch");
    if let (Some(catch), Some(method)) = (catch, method)
        && catch > 0.0
        && method.catch_sequences().is_empty()
    {
        let what = format!("the method `{}` has no catch trials", method.as_str());
        let hint = "leave `catch` out; `easy` trials show lapses";
        section.fault_at("catch", Fault::error(what).hint(hint));
    }
    let easy = section.number("easy").unwrap_or(0.0);
    if let Some(catch) = catch
        && catch + easy >= 1.0
    {
        let what = "`catch` and `easy` leave no other trials";
        section.fault_at("easy", Fault::error(what));
    }
    let fitted = section.section("fit").map(fit).unwrap_or_default();
    if section.value("fit").is_some()
        && (matches!(compared, Some(Compared::Models { .. }))
            || method == Some(Method::SameDifferent))
    {
        let what = format!(
            "`{}.fit`: this track has no psychometric function",
            section.path()
        );
        let hint = "leave `fit` out; its result is a d′";
        section.fault_at("fit", Fault::error(what).hint(hint));
    }
    RawTrack {
        path: section.path().to_owned(),
        id,
        method,
        compared,
        relative,
        rule,
        feedback: section.flag("feedback").unwrap_or(false),
        catch,
        easy,
        fit: fitted,
        measures: section.part_id("condition"),
    }
}

fn fit(mut section: Section<'_, '_>) -> FitRules {
    let usual = FitRules::default();
    FitRules {
        scale: section.word("scale"),
        core: section.word("core"),
        lapse: section.number("lapse").unwrap_or(usual.lapse),
    }
}

fn compared(section: &mut Section<'_, '_>) -> Option<Compared> {
    let (family, standard) = (section.part_id("family"), section.number("standard"));
    let models: Option<Vec<ModelId>> = section.ids("models");
    let path = section.path().to_owned();
    match (family, standard, models) {
        (Some(family), Some(standard), None) => Some(Compared::Levels { family, standard }),
        (None, None, Some(models)) => match <[ModelId; 2]>::try_from(models) {
            Ok(models) if models[0] != models[1] => Some(Compared::Models { models }),
            _ => {
                let what = format!("`{path}.models` has to be two different realizations");
                section.fault_at("models", Fault::error(what));
                None
            }
        },
        (None, None, None) => {
            let hint =
                "such as family = \"damping\" with standard = 1.0, or models = [\"a\", \"b\"]";
            section.report_missing("family", hint.to_owned());
            None
        }
        (_, _, Some(_)) => {
            let what = format!("`{path}` compares levels of a family, or two models, not both");
            section.fault_at("models", Fault::error(what));
            None
        }
        (Some(_), None, None) => {
            section.report_missing("standard", section.key("standard").such_as());
            None
        }
        (None, Some(_), None) => {
            section.report_missing("family", section.key("family").such_as());
            None
        }
    }
}

fn stop(mut section: Section<'_, '_>) -> Option<Stop> {
    let reversals = section.whole("reversals");
    let (min_trials, max_trials) = (section.whole("min_trials"), section.whole("max_trials"));
    Some(Stop {
        reversals: reversals?,
        min_trials: min_trials?,
        max_trials: max_trials?,
    })
}

/// What both kinds of staircase have; one up, one down.
fn common(section: &mut Section<'_, '_>) -> Option<Staircase> {
    let (start, steps) = (section.number("start"), section.numbers("steps"));
    let (scale, estimate_last) = (section.word("scale"), section.whole("estimate_last"));
    let stop = match section.section("stop") {
        Some(inside) => stop(inside),
        None => None,
    };
    Some(Staircase {
        up: 1,
        down: 1,
        start: start?,
        steps: steps?,
        scale: scale?,
        step_up_factor: 1.0,
        min_level: None,
        max_level: None,
        initial_one_up_one_down: false,
        stop: stop?,
        estimate_last: estimate_last?,
    })
}

fn staircase(section: &mut Section<'_, '_>) -> Option<RawRule> {
    let (up, down) = (section.whole("up"), section.whole("down"));
    let factor = section.number("step_up_factor");
    let initial = section.flag("initial_one_up_one_down");
    let common = common(section);
    Some(RawRule::Staircase(Staircase {
        up: up?,
        down: down?,
        step_up_factor: factor?,
        initial_one_up_one_down: initial?,
        ..common?
    }))
}

fn weighted(section: &mut Section<'_, '_>) -> Option<RawRule> {
    let factor = section.number("target").and_then(Staircase::factor_for);
    let common = common(section);
    Some(RawRule::Staircase(Staircase {
        step_up_factor: factor?,
        ..common?
    }))
}

fn constant(section: &mut Section<'_, '_>) -> Option<RawRule> {
    let (levels, repetitions) = (section.numbers("levels"), section.whole("repetitions"));
    Some(RawRule::Constant {
        levels,
        repetitions: repetitions?,
    })
}

fn quest(section: &mut Section<'_, '_>) -> Option<RawRule> {
    let function = section.text("function");
    let function = Function::parse(function.as_deref().unwrap_or("weibull"));
    let (trials, min_trials) = (section.whole("trials"), section.whole("min_trials"));
    let (entropy_below, sd_below) = (section.number("entropy_below"), section.number("sd_below"));
    let threshold = section.numbers("threshold");
    let (slope, guess) = (section.numbers("slope"), section.numbers("guess"));
    let lapse = section.numbers("lapse");
    let parameters: Option<Vec<Parameter>> = (section.sections("parameters").into_iter())
        .map(parameter)
        .collect();
    let parameters = parameters?;
    let grids = threshold.is_some() || slope.is_some() || guess.is_some() || lapse.is_some();
    if grids && !parameters.is_empty() {
        let what = format!("`{}` has grids and `parameters`", section.path());
        section.fault_at(
            "parameters",
            Fault::error(what).hint("leave one of them out"),
        );
    }
    if matches!(function, Function::Formula(_)) && parameters.is_empty() {
        let what = "a formula needs its `parameters`";
        let hint = "such as parameters = [{ name = \"threshold\", values = [0.5, 1.0] }]; \
                    the functions are weibull, weibull-db, weibull-log10, normal, normal-symmetric, logistic";
        section.fault_at("function", Fault::error(what).hint(hint));
        return None;
    }
    Some(RawRule::QuestPlus {
        rule: QuestPlus {
            function,
            parameters,
            trials: trials?,
            min_trials: min_trials?,
            entropy_below,
            sd_below,
        },
        threshold,
        slope,
        guess,
        lapse: lapse.unwrap_or_else(|| LAPSES.to_vec()),
    })
}

fn parameter(mut section: Section<'_, '_>) -> Option<Parameter> {
    let (name, values) = (section.text("name"), section.numbers("values"));
    let prior = section.numbers("prior");
    Some(Parameter {
        name: name?,
        values: values?,
        prior,
    })
}
