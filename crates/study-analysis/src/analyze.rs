//! The analysis of ratings: statistics, verdicts and warnings. No input or output.
//!
//! [`analyze`] decides which rows are included, computes every statistic that they
//! allow, and gives a reason for each one that is undefined. [`results`] has them as
//! records, whose declarations give each statistic the identifier of `docs/statistics.md`
//! (`corr/pearson/r`); `--json` prints them unrounded.
//!
//! Level of inference: VAF varies only between realizations, so "VAF predicts the
//! rating" is tested over the means of the realizations, whatever the number of
//! participants. Tests over participants hold for these realizations only.

mod adjusted;
mod agreement;
mod better;
mod cells;
mod checks;
mod correlation;
mod deciding;
mod describe;
mod design;
mod deviation;
mod disagreement;
mod draws;
mod effects;
mod exclude;
mod factorial;
pub mod findings;
mod flow;
mod headline;
mod identifiers;
mod influence;
mod keys;
mod measured;
mod memory;
mod missing;
mod mixed;
mod order;
mod ordinal;
mod outcome_model;
mod outcomes;
mod overflow;
mod pairs;
mod posterior;
pub mod psychophysics;
mod question;
mod range;
mod record;
mod reference;
mod rendering;
pub mod results;
mod same_order;
mod select;
mod sites;
mod subjects;
mod vaf;
mod values;
mod verdicts;
mod warning;
mod warnings;

pub use better::Better;
pub use deciding::{Deciding, all_findings, deciding};
pub use design::Design;
pub use deviation::{Deviation, PreregisteredRule, deviations};
pub use effects::MAX_PAIRED;
pub use exclude::Applied;
pub use findings::{Finding, Pair, Question, Test, TestKind, Verdict};
pub use flow::{Flow, Share};
pub use identifiers::{group_id, pair_id};
pub use outcomes::OutcomeAnswer;
pub use select::{Counts, Include, Reason};
pub use study_plan::protocol::{ALPHA, Exclusion};
pub use values::{Value, Values};
pub use warning::Warning;

use adjusted::Adjusted;
use cells::Cells;
use factorial::Margin;
use results::{Correlation, Evidence, LmmVafCrossed, Results};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use study_base::sort::SmallSort as _;
use study_plan::protocol::{
    BetterEnd, Crossing, OutcomeRules, Protocol, Role, Transform, Unfinished,
};
pub use study_session::outcome::ratings::Felt;
use study_session::outcome::ratings::{Practice, Ratings};
pub use study_stats::ordinal_hierarchy::OrdinalEffort;

/// The rules of the analysis, fixed before the data were seen.
#[derive(Debug, Clone, PartialEq)]
pub struct Rules {
    /// Planned number of participants; the analysis is interim until they have finished.
    pub planned: Option<u32>,
    /// Lowest rating that counts as realistic.
    pub realistic_from: Option<f64>,
    /// Lowest and highest rating of the scale.
    pub scale: Option<(f64, f64)>,
    /// Whether unfinished sessions are included.
    pub unfinished: Unfinished,
    /// Which sessions are included besides those of participants.
    pub include: Include,
    /// Seed of the permutation tests and the bootstrap.
    pub seed: u64,
    /// Whether the ratings answer the primary question.
    pub primary: bool,
    /// The preregistered exclusion rules.
    pub exclude: Vec<Exclusion>,
    /// Equivalence margin for differences between realizations or levels of a factor and from a
    /// hidden reference, and for the effect of VAF, in rating points.
    pub equivalence_margin: Option<f64>,
    /// Equivalence margin for the correlation with VAF.
    pub equivalence_r: Option<f64>,
    /// Changes to these rules after the study began.
    pub deviations: Vec<Deviation>,
    /// Level of significance of every test, two-sided.
    pub alpha: f64,
    /// What the ratings measure, as a noun; `None` if the study does not say.
    pub construct: Option<String>,
    /// Which ratings are better.
    pub better: Better,
    /// The factors of the realizations; `None` in a study without.
    pub crossing: Option<Crossing>,
    /// The measured outcomes.
    pub outcomes: Vec<OutcomeRules>,
    /// The draws of the ordinal hierarchical model, which takes seconds and decides nothing; `None`: it is left out.
    pub posterior: Option<OrdinalEffort>,
}

impl Default for Rules {
    fn default() -> Self {
        Self {
            planned: None,
            realistic_from: None,
            scale: None,
            unfinished: Unfinished::Include,
            include: Include::default(),
            seed: 2007,
            primary: true,
            exclude: Vec::new(),
            equivalence_margin: None,
            equivalence_r: None,
            deviations: Vec::new(),
            alpha: ALPHA,
            construct: None,
            better: Better::default(),
            crossing: None,
            outcomes: Vec::new(),
            posterior: None,
        }
    }
}

impl Rules {
    /// The rules of a protocol. `realistic_from`, the equivalence margin and the measured outcomes
    /// belong to the primary question only.
    pub fn of(protocol: &Protocol, question: &str, include: Include) -> Self {
        use study_plan::protocol::Scale;
        let primary = protocol.analysis.primary.as_str() == question;
        let asked = protocol
            .questions
            .iter()
            .find(|q| q.id.as_str() == question);
        let outcome = (protocol.outcomes.iter()).find(|outcome| outcome.id.as_str() == question);
        let construct = outcome.map(|outcome| match outcome.transform {
            Transform::Identity => outcome.measure.noun().into_owned(),
            Transform::Log => format!("logarithm of the {}", outcome.measure.noun()),
        });
        Self {
            planned: Some(protocol.design.participants),
            realistic_from: protocol.analysis.realistic_from.filter(|_| primary),
            scale: asked.and_then(|q| match q.kind.scale() {
                // The share of an answer.
                Scale::Names { .. } => protocol.analysis.share_of(&q.id).map(|_| (0.0, 1.0)),
                scale => scale.ends(),
            }),
            unfinished: protocol.analysis.unfinished,
            include,
            seed: protocol.study.seed,
            primary,
            exclude: protocol.analysis.exclude.clone(),
            equivalence_margin: protocol.analysis.equivalence_margin.filter(|_| primary),
            equivalence_r: protocol.analysis.equivalence_r.filter(|_| primary),
            deviations: Vec::new(),
            alpha: protocol.analysis.alpha(),
            construct: construct.or(protocol.analysis.construct.clone().filter(|_| primary)),
            better: match outcome.and_then(|outcome| outcome.better) {
                Some(BetterEnd::Lower) => Better::Lower,
                Some(BetterEnd::Higher) | None => Better::Higher,
            },
            crossing: protocol.crossing(),
            outcomes: match primary {
                true => protocol.outcomes.clone(),
                false => Vec::new(),
            },
            posterior: None,
        }
    }
}

/// A comment on a presentation.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Comment {
    /// Realization. Untrusted.
    pub model: String,
    /// Participant. Untrusted.
    pub subject: String,
    /// Repetition number, from 1.
    pub repetition: u32,
    /// Question, or `remarks`.
    pub question: String,
    /// As typed. Untrusted.
    pub text: String,
}

/// A realization of the design.
#[derive(Debug, Clone, PartialEq)]
pub struct RealizationSummary {
    /// Name, as in the identifiers of its statistics. Untrusted.
    pub id: String,
    /// Role in the design.
    pub role: Role,
    /// The realization of which this one is a hidden duplicate.
    pub duplicate_of: Option<String>,
    /// Whether it takes part in the tests: role `test` and no hidden duplicate.
    pub tested: bool,
    /// Its VAF, if all of its rows have the same one.
    pub vaf: Option<f64>,
}

/// A row of the ratings and whether it is included. [`Analysis::subject`] and
/// [`Analysis::model`] look its names up.
#[derive(Debug, Clone, PartialEq)]
pub struct RowDecision {
    subject: u32,
    model: Option<u32>,
    /// Repetition number, from 1; a foreign table may count from 0.
    pub repetition: u32,
    /// Position in the participant's session, from 1, if known.
    pub trial_index: Option<u32>,
    /// The rating, if there is one.
    pub rating: Option<f64>,
    /// The VAF, if there is one.
    pub vaf: Option<f64>,
    /// What was felt, if it is known.
    pub felt: Option<Felt>,
    /// Why the row is excluded; `None` if it is included.
    pub excluded: Option<Arc<Reason>>,
}

/// The results of an analysis.
#[derive(Debug, Clone, PartialEq)]
pub struct Analysis {
    /// The question whose answers were analyzed.
    pub question: String,
    /// Statistics.
    pub results: Results,
    /// Statistics by identifier.
    pub values: Values,
    /// Warnings for the reader.
    pub warnings: Vec<Warning>,
    /// Realizations, sorted by name.
    pub realizations: Vec<RealizationSummary>,
    /// Numbers of rows and participants included, excluded, corrected.
    pub counts: Counts,
    /// Who is left out and what is analyzed: of all participants, then of each group.
    pub flows: Vec<Flow>,
    /// Every row and whether it is included.
    pub rows: Vec<RowDecision>,
    /// Practice rows, which are never included.
    pub practice: Arc<Practice>,
    /// Names that the rows refer to.
    subjects: Vec<String>,
    models: Vec<String>,
    /// The effect of each preregistered exclusion rule, in the protocol's order.
    pub exclusions: Vec<Applied>,
    /// Changes to the rules after the study began.
    pub deviations: Vec<Deviation>,
    /// Comments of the included rows, by realization.
    pub comments: Vec<Comment>,
    /// Lowest rating that counts as realistic.
    pub realistic_from: Option<f64>,
    /// Lowest and highest rating of the scale.
    pub scale: Option<(f64, f64)>,
    /// Equivalence margin, in rating points.
    pub equivalence_margin: Option<f64>,
    /// Level of significance of every test, two-sided.
    pub alpha: f64,
    /// What the ratings measure, as a noun. Untrusted.
    pub construct: Option<String>,
    /// Which ratings are better.
    pub better: Better,
    /// Names of the covariates of the realizations. Untrusted.
    pub covariates: Vec<String>,
    /// Names of the sites; empty if there is only one. Untrusted.
    pub sites: Vec<String>,
    /// The factors of the realizations; `None` in a study without. Its levels are untrusted.
    pub crossing: Option<Crossing>,
    /// Who rated which realizations.
    pub design: Design,
    /// The answers to the questions of the study, in the order of a report.
    pub findings: Vec<Finding>,
    /// The comparisons of pairs of realizations on which the findings rest.
    pub pairs: Vec<Pair>,
    /// What is said of the measured outcomes, in the order of the protocol.
    pub outcomes: Vec<OutcomeAnswer>,
    /// The parts of the study that are not ratings; [`psychophysics::parts`] analyzes them.
    pub parts: Vec<psychophysics::PartAnalysis>,
}

impl Analysis {
    /// The participant of a row. Untrusted.
    pub fn subject(&self, row: &RowDecision) -> &str {
        self.subjects
            .get(row.subject as usize)
            .map_or("", String::as_str)
    }

    /// Whether a rule was changed after the study began, so that it must not be
    /// called preregistered.
    pub fn changed(&self, rule: PreregisteredRule) -> bool {
        self.deviations.iter().any(|d| d.affects.contains(&rule))
    }

    /// The realization of a row, empty if it has none. Untrusted.
    pub fn model(&self, row: &RowDecision) -> &str {
        row.model.map_or("", |m| &self.models[m as usize])
    }
}

/// Progress of an analysis, to be read from another thread.
#[derive(Debug, Default)]
pub struct Progress {
    /// Groups of statistics to compute; grows if a second analysis follows.
    pub groups: AtomicU64,
    /// Groups computed so far.
    pub done: AtomicU64,
}

/// Analyzes ratings under the given rules.
///
/// ```
/// # use study_analysis::analyze::{Rules, analyze};
/// # use study_session::outcome::ratings::{Ratings, RatingsError};
/// let table = "subject,model,rating\nP1,a,1\nP1,b,4\nP2,a,2\nP2,b,5\nP3,a,1\nP3,b,6\n";
/// let ratings = Ratings::read_csv("t.csv", table.as_bytes(), None)?;
/// let found = analyze(&ratings, &Rules::default());
/// // All three prefer b.
/// assert_eq!(found.values.number("desc/b/mean"), Some(5.0));
/// # Ok::<(), RatingsError>(())
/// ```
pub fn analyze(ratings: &Ratings, rules: &Rules) -> Analysis {
    analyze_with_progress(ratings, rules, &Progress::default())
}

/// [`analyze`] that reports its progress.
pub fn analyze_with_progress(ratings: &Ratings, rules: &Rules, progress: &Progress) -> Analysis {
    let (decisions, exclusions) = select::decide(ratings, rules);
    let used = rows(ratings, |i| decisions[i].is_none());
    let (cells, rows_decided) =
        rayon::join(|| Cells::of(&used), || row_decisions(ratings, &decisions));
    let (mut results, counts) = rayon::join(
        || statistics(&cells, rules, progress),
        || Counts::of(ratings, &used, &decisions, rules),
    );
    overflow::explain(&used, &mut results);
    if exclusions.iter().any(|e| e.rows > 0) {
        let all = rows(ratings, |i| {
            let reason = decisions[i].as_deref();
            matches!(reason, None | Some(Reason::Rule(_)))
        });
        let all = statistics(&Cells::of(&all), rules, progress);
        results.before_exclusion = Some(Box::new(all.before_exclusion()));
    }
    results.posterior = (rules.posterior).map(|effort| posterior::posterior(&cells, rules, effort));
    let (measured, outcomes) = outcomes::outcomes(&used, rules);
    results.outcomes = measured;
    let design = Design::of(&cells);
    let (findings, pairs) = findings::findings(&cells, design, rules, &results.evidence);
    results.finding = findings::numbers(&findings);
    let warnings = warnings::warnings(&cells, &counts, rules, &exclusions, &results, &findings);
    let warnings = range::before(warnings, &used, rules);
    Analysis {
        question: ratings.question.clone(),
        realizations: used
            .models
            .iter()
            .zip(&cells.vaf)
            .map(|(m, vaf)| RealizationSummary {
                id: m.id.clone(),
                role: m.role,
                duplicate_of: m.duplicate_of.clone(),
                tested: m.is_tested(),
                vaf: *vaf,
            })
            .collect(),
        flows: flow::flows(ratings, &decisions),
        rows: rows_decided,
        practice: Arc::clone(&ratings.practice),
        subjects: ratings.subjects.iter().map(|s| s.id.clone()).collect(),
        models: ratings.models.iter().map(|m| m.id.clone()).collect(),
        exclusions,
        deviations: rules.deviations.clone(),
        comments: comments(&used),
        realistic_from: rules.realistic_from,
        scale: rules.scale,
        equivalence_margin: rules.equivalence_margin,
        alpha: rules.alpha,
        construct: rules.construct.clone(),
        better: rules.better,
        covariates: memory::covariates(&used),
        sites: ratings.sites.clone(),
        crossing: rules.crossing.clone(),
        design,
        findings,
        pairs,
        outcomes,
        parts: Vec::new(),
        values: results.values(),
        results,
        warnings,
        counts,
    }
}

/// The rows to keep, without a copy if all are kept.
fn rows(ratings: &Ratings, keep: impl Fn(usize) -> bool) -> Cow<'_, Ratings> {
    if (0..ratings.len()).all(&keep) {
        Cow::Borrowed(ratings)
    } else {
        Cow::Owned(ratings.keep(keep))
    }
}

/// What the statistics are computed from.
struct Inputs<'a> {
    cells: &'a Cells<'a>,
    adjusted: &'a Adjusted,
    rules: &'a Rules,
}

impl Progress {
    /// Computes a group of statistics, and counts it.
    fn counted<T>(&self, group: impl FnOnce() -> T) -> T {
        let computed = group();
        self.done.fetch_add(1, Ordering::Relaxed);
        computed
    }
}

/// Groups of statistics that are computed beside each other.
const GROUPS: u64 = 9;

/// All statistics. Each group runs on one thread, so the number of threads changes
/// no bit of the result.
fn statistics(cells: &Cells<'_>, rules: &Rules, progress: &Progress) -> Results {
    progress.groups.fetch_add(GROUPS, Ordering::Relaxed);
    let adjusted = &Adjusted::of(cells);
    let inputs = Inputs {
        cells,
        adjusted,
        rules,
    };
    let mixed = || progress.counted(|| mixed::mixed(cells));
    let correlations = || progress.counted(|| vaf::correlations(cells, adjusted, rules));
    let over_participants = || progress.counted(|| vaf::over_participants(cells, rules));
    let ordinal = || progress.counted(|| ordinal::ordinal(cells));
    let agreement = || progress.counted(|| agreement::agreement(cells));
    let describe = || progress.counted(|| describe::describe(cells));
    let subjects = || progress.counted(|| subjects::subjects(cells));
    let posthoc = || progress.counted(|| effects::posthoc(cells));
    let checks =
        || progress.counted(|| (checks::ends(cells, rules.scale), checks::residuals(cells)));
    let slow = || rayon::join(over_participants, ordinal);
    let others = || rayon::join(|| rayon::join(subjects, posthoc), checks);
    let fast = || rayon::join(|| rayon::join(agreement, describe), others);
    let models = || rayon::join(mixed, correlations);
    let (
        (fitted, (mut corr, mut corr_adjusted)),
        (
            (over_participants, ordinal),
            ((agreement, descriptives), ((screening, posthoc), (ends, residuals))),
        ),
    ) = rayon::join(models, || rayon::join(slow, fast));
    headline::explain(&mut corr, rules.alpha);
    headline::explain(&mut corr_adjusted, rules.alpha);
    if let Some(share) = &mut corr.share {
        share.var_model_crossed = Some(fitted.variance.model_share_of_vaf.clone());
    }
    Results {
        mixed: fitted.mixed,
        realistic: (rules.realistic_from)
            .map_or_else(BTreeMap::new, |from| headline::realistic(cells, from)),
        sensitivity: headline::sensitivity(Design::of(cells), &corr_adjusted, rules.alpha),
        evidence: Evidence {
            lmm_variance: Some(fitted.variance),
            ..evidence(&inputs, corr, corr_adjusted, fitted.crossed)
        },
        descriptives,
        screening,
        posthoc,
        agreement,
        over_participants,
        ordinal,
        ends,
        residuals,
        finding: BTreeMap::new(),
        outcomes: BTreeMap::new(),
        posterior: None,
        before_exclusion: None,
    }
}

/// What the findings rest on.
fn evidence(
    inputs: &Inputs<'_>,
    corr: Correlation,
    corr_adjusted: Correlation,
    crossed: LmmVafCrossed,
) -> Evidence {
    let Inputs {
        cells,
        adjusted,
        rules,
    } = *inputs;
    let ((order, rendering), (differences, references)) = rayon::join(
        || {
            rayon::join(
                || order::order(cells),
                || rendering::rendering(cells, adjusted, rules),
            )
        },
        || {
            rayon::join(
                || effects::ranks_and_anova(cells),
                || reference::reference(cells, rules),
            )
        },
    );
    Evidence {
        equivalence: headline::equivalence_of_vaf(cells, &corr_adjusted, &crossed, rules),
        corr,
        corr_adjusted,
        crossed,
        rendering,
        order,
        differences,
        references,
        factorial: factorial::factorial(cells, adjusted, rules, Margin::of_ratings(rules)),
        cells: adjusted::adjusted(cells, adjusted),
        pairs: pairs::pairs(cells, adjusted, rules),
        sites: sites::sites(cells, rules),
        disagreement: disagreement::disagreement(cells),
        covariates: memory::memory(cells),
        influence: influence::influence(cells, adjusted),
        missing: missing::missing(cells, adjusted, rules),
        variance: headline::components(cells),
        lmm_variance: None,
    }
}

fn row_decisions(ratings: &Ratings, decisions: &[select::Decision]) -> Vec<RowDecision> {
    (decisions.iter().cloned().enumerate())
        .map(|(i, excluded)| RowDecision {
            subject: ratings.subject[i],
            model: ratings.model[i],
            repetition: ratings.repetition[i],
            trial_index: ratings.trial_index[i],
            rating: ratings.rating[i],
            vaf: ratings.vaf[i],
            felt: ratings.felt(i).copied(),
            excluded,
        })
        .collect()
}

fn model_name(ratings: &Ratings, row: usize) -> String {
    ratings.model[row].map_or_else(String::new, |m| ratings.models[m as usize].id.clone())
}

fn comments(used: &Ratings) -> Vec<Comment> {
    let mut comments: Vec<Comment> = (used.comments.iter())
        .map(|c| Comment {
            model: model_name(used, c.row),
            subject: used.subjects[used.subject[c.row] as usize].id.clone(),
            repetition: used.repetition[c.row],
            question: c.question.clone(),
            text: c.text.clone(),
        })
        .collect();
    comments.small_sort_by(|a, b| {
        (&a.model, &a.subject, a.repetition).cmp(&(&b.model, &b.subject, b.repetition))
    });
    comments
}
