//! How many answers a search needs: page and document.

use crate::apa;
use crate::text::Page;
use crate::text::layout::{Paint, wrap};
use serde_json::{Value, json};
use study_analysis::power::{Regret, SearchPlan, SearchResult};
use study_base::text::{Untrusted, counted};

/// What is known of a search that is planned.
#[derive(Debug, Clone)]
pub struct SearchReport {
    /// Title of the study. Untrusted.
    pub title: String,
    /// Id of the study.
    pub study: String,
    /// What was simulated.
    pub plan: SearchPlan,
    /// The results by kind of perceiver.
    pub results: Vec<SearchResult>,
}

/// The page of a terminal.
pub fn search_page(report: &SearchReport, page: Page) -> String {
    let (width, paint) = (page.width.clamp(60, 100), Paint(page.color));
    let plan = &report.plan;
    let mut out = paint.strong(&Untrusted(&report.title).to_string()) + "\n\n";
    let points = plan.lattice.certified().len();
    let assumed = format!(
        "Part {}: {} of each kind search in the space {}, of which {} can be presented, up to {}. The utility of the \
         best point is about {} times the noise of one impression. Regret is the utility of the best point minus that of the \
         recommended one, and is not noticed below {}.",
        plan.part,
        counted(plan.perceivers as usize, "perceiver", "perceivers"),
        plan.space,
        counted(points, "point", "points"),
        counted(plan.rule.trials as usize, "answer", "answers"),
        apa::number(plan.best, 2),
        apa::number(plan.jnd, 2)
    );
    out += &wrap(&assumed, width, "", "");
    out += &paint.dim(&format!(
        "\n{:<11}{:>8}  {:<15}{:>9}  {}\n",
        "perceivers", "answers", "regret", "unnoticed", "95 % CI"
    ));
    for result in &report.results {
        for regret in &result.regrets {
            out += &line(result, regret);
        }
    }
    out.push('\n');
    for result in &report.results {
        out += &wrap(&sentence(plan, result), width, "", "");
    }
    out + &wrap(&what_it_is_not(), width, "", "")
}

fn line(result: &SearchResult, regret: &Regret) -> String {
    let mean = format!(
        "{} ± {}",
        apa::number(regret.mean, 2),
        apa::number(regret.mcse, 2)
    );
    format!(
        "{:<11}{:>8}  {mean:<15}{:>9}  {}\n",
        result.likes.as_str(),
        regret.answers,
        apa::share(regret.share, 2),
        apa::interval(regret.interval, |x| apa::share(x, 2)),
    )
}

/// How many answers are enough.
fn sentence(plan: &SearchPlan, result: &SearchResult) -> String {
    let (who, share) = (result.likes.as_str(), apa::percent(plan.target));
    match (result.enough(plan.target), result.regrets.last()) {
        (Some(answers), _) => format!(
            "{who}: with {} at least {share} of the simulated perceivers do not notice their regret.",
            counted(answers as usize, "answer", "answers")
        ),
        (None, Some(last)) => format!(
            "{who}: {} are not enough for {share}; --trials compares more.",
            counted(last.answers as usize, "answer", "answers")
        ),
        (None, None) => format!("{who}: nothing was simulated."),
    }
}

fn what_it_is_not() -> String {
    "Nobody knows how people's utilities lie in the space; these are three examples. What a search finds is to be confirmed.".to_owned()
}

/// The document, `study-power-search/1`.
pub fn search_document(report: &SearchReport) -> Value {
    let plan = &report.plan;
    let regret = |r: &Regret| {
        json!({
            "answers": r.answers,
            "regret": r.mean,
            "mcse": r.mcse,
            "below": r.below,
            "share": r.share,
            "low": r.interval.0,
            "high": r.interval.1,
        })
    };
    let result = |r: &SearchResult| {
        json!({
            "perceivers": r.likes.as_str(),
            "regrets": r.regrets.iter().map(regret).collect::<Vec<_>>(),
            "enough": r.enough(plan.target),
        })
    };
    json!({
        "format": "study-power-search/1",
        "study": report.study,
        "title": report.title,
        "version": env!("CARGO_PKG_VERSION"),
        "part": plan.part.as_str(),
        "space": plan.space.as_str(),
        "points": plan.lattice.certified().len(),
        "rule": plan.rule,
        "assumptions": {
            "perceivers": plan.perceivers,
            "best": plan.best,
            "jnd": plan.jnd,
            "target": plan.target,
            "seed": plan.seed,
        },
        "results": report.results.iter().map(result).collect::<Vec<_>>(),
    })
}
