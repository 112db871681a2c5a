//! Renders what `study power` found: terminal page, JSON, figure, paragraph.
//!
//! Nothing is simulated here, and no test is decided.

mod felt;
mod figure;
mod json;
mod page;
mod paragraph;
mod part;
mod precision;
mod procedures;
mod searches;

pub use figure::figure;
pub use json::{document, own_design};
pub(super) use page::sensitivity_sentences;
pub use page::{head, results};
pub use paragraph::paragraph;
pub use precision::{About, Wanted};
pub use procedures::{Compared, compared, compared_document};
pub use searches::{SearchReport, search_document, search_page};

use super::apa;
use study_analysis::power::{
    self, Cell, CellResult, LeftOut, Plan, Reach, Scale, Smallest, Test, TestResult, Vaf,
};
use study_base::text::{PartId, counted};
use study_stats::power::covariate::Expected;
use study_stats::power::detectable_correlation;

/// Columns of a bar.
const BAR: usize = 20;

/// What is known of a study that is planned.
#[derive(Debug, Clone)]
pub struct Report {
    /// Title of the study. Untrusted.
    pub title: String,
    /// Id of the study.
    pub study: String,
    /// What was simulated.
    pub plan: Plan,
    /// The results by design; only some of them if a merge was partial.
    pub results: Vec<CellResult>,
    /// Units (design and chunk) that are missing from a partial merge.
    pub missing_units: usize,
    /// Precisions of thresholds that are wanted.
    pub wanted: Vec<Wanted>,
}

impl Report {
    fn closed(&self, cell: &Cell) -> Option<Expected> {
        power::closed(&self.plan.settings, cell)
    }

    fn result(&self, cell: &Cell) -> Option<&CellResult> {
        self.results.iter().find(|r| r.cell == *cell)
    }

    /// The designs of the grid and the study's own, which are shown.
    fn shown(&self) -> Vec<Cell> {
        let mut cells = self.plan.grid.clone();
        cells.push(self.plan.own);
        cells.sort_unstable();
        cells.dedup();
        cells
    }

    fn smallest(&self) -> Vec<Smallest> {
        let plan = &self.plan;
        let most = plan.most_participants();
        power::smallest(
            &plan.settings,
            &self.results,
            &plan.proposed(),
            &plan.targets,
            most,
        )
    }

    /// Power in closed form over 1,000 worlds that the pilot allows: 10 % and 90 % quantile.
    fn pilot_range(&self, cell: &Cell) -> Option<(f64, f64)> {
        const WORLDS: u64 = 1000;
        let settings = &self.plan.settings;
        let pilot = settings.pilot.as_ref()?;
        let mut found: Vec<f64> = (0..WORLDS)
            .filter_map(|k| {
                let world = pilot.parameters(settings.seed, k);
                let mut design = power::design(settings, cell);
                design.slope = world.slope;
                let slope = design.spread.slope;
                design.spread = world.spread;
                design.spread.slope = slope;
                design.power(settings.alpha)
            })
            .collect();
        found.sort_by(f64::total_cmp);
        let at = |share: f64| found.get((share * found.len() as f64) as usize).copied();
        at(0.1).zip(at(0.9))
    }

    /// What decides such a study: the requirement of its number of realizations. Of a part
    /// that is no rating, what is simulated.
    pub fn ceiling_sentence(&self) -> String {
        let (plan, settings) = (&self.plan, &self.plan.settings);
        if settings.part.is_some() {
            return part::summary(self);
        }
        let q = plan.own.realizations;
        let target = plan.targets.first().copied().unwrap_or(0.8);
        let Some(needed) = detectable_correlation(q, target, settings.alpha) else {
            return format!("{q} realizations allow no test of VAF.");
        };
        let start = format!(
            "With {q} realizations, VAF and the true mean ratings have to correlate at {} or more \
             for {} power, even with endlessly many participants",
            apa::r(needed),
            percent(target)
        );
        let Some(e) = self.closed(&plan.own) else {
            return format!("{start}.");
        };
        match e.rho_true {
            Some(rho) if rho.abs() < 1.0 => format!(
                "{start}; assumed is {}, for which the ceiling is {}.",
                apa::r(rho.abs()),
                percent(e.ceiling)
            ),
            _ => format!("{start}; assumed is no scatter of the realizations, and so no ceiling."),
        }
    }

    /// What a reader has to know.
    pub fn warnings(&self) -> Vec<String> {
        let (plan, settings) = (&self.plan, &self.plan.settings);
        let mut found = Vec::new();
        if self.missing_units > 0 {
            found.push(format!(
                "partial: {} units of work are missing, and so some studies",
                self.missing_units
            ));
        }
        if !plan.defaults.is_empty() {
            found.push(format!(
                "nobody stated {}: these are defaults, not knowledge",
                plan.defaults.join(", ")
            ));
        }
        match settings.part {
            Some(_) => found.extend(part::warnings(self)),
            None => self.warnings_of_ratings(&mut found),
        }
        if plan.exclusions > 0 {
            found.push(
                "the protocol's exclusion rules are not simulated; state their loss as dropout"
                    .to_owned(),
            );
        }
        found.extend(left_out(&plan.left_out));
        if let Some(most) = plan.max_session_min {
            for shape in plan.shapes() {
                if let Some(minutes) = plan.too_long(shape) {
                    found.push(format!(
                        "{} realizations × {} take about {} min, more than {most}: not proposed",
                        shape.0,
                        counted(shape.1, "repetition", "repetitions"),
                        apa::number(minutes, 0)
                    ));
                }
            }
        }
        if let Some(pilot) = &settings.pilot {
            found.push(format!(
                "from a pilot of {} participants: the scatter rests on {} degrees of freedom",
                pilot.participants,
                pilot.scatter_df()
            ));
        }
        for result in &self.results {
            let tests = result.tests.iter().enumerate();
            for (at, test) in tests.filter(|(_, t)| t.undefined_share() > 0.01) {
                let among = test.power_if_defined().map_or(String::new(), |p| {
                    format!("; among the others the power is {}", apa::share(p, 3))
                });
                found.push(format!(
                    "{}: {} is undefined in {} of the studies{among}",
                    design(&result.cell),
                    settings.test_name(at),
                    percent(test.undefined_share()),
                ));
            }
        }
        found
    }

    fn warnings_of_ratings(&self, found: &mut Vec<String>) {
        let (plan, settings) = (&self.plan, &self.plan.settings);
        let a = &settings.assumptions;
        if let Some(floor) = power::floor(&settings.vaf(plan.own.realizations), settings.alpha)
            && !floor.can_reject
        {
            found.push(format!(
                "with these VAF no p of the permutation test is below {}: its power is 0 whatever \
                 the ratings",
                apa::bare_p(floor.smallest_p)
            ));
        }
        let permuted = |t: &&TestResult| matches!(t.test, Test::Verdict | Test::Permutation);
        let deciding = self.result(&plan.own).and_then(|r| r.tests.first());
        if let Some(own) = deciding.filter(permuted)
            && let Some(closed) = self.closed(&plan.own)
            && closed.power > own.interval.1 + 0.05
        {
            found.push(format!(
                "the permutation test, which decides, has {} and Pearson's t {}: it has less power where \
                 one VAF lies far from the others, and where ratings are lost",
                apa::share(own.power, 3),
                apa::share(closed.power, 3)
            ));
        }
        if plan.own.realizations == 3 {
            found.push("three realizations leave one degree of freedom".to_owned());
        }
        if a.spread.slope > 0.0
            && let Some(e) = self.closed(&plan.own)
        {
            found.push(format!(
                "participants differ in their slopes: without any effect the test rejects in {} of \
                 the studies, not {}; a claim about other participants needs (1 + VAF | participant)",
                percent(e.size),
                percent(settings.alpha)
            ));
        }
        if a.vaf == Vaf::Listed
            && plan
                .grid
                .iter()
                .any(|c| c.realizations != plan.own.realizations)
        {
            found.push(
                "other numbers of realizations have VAF in even steps over the listed range"
                    .to_owned(),
            );
        }
    }
}

/// What of the protocol is not simulated.
fn left_out(left: &LeftOut) -> Vec<String> {
    let mut found = Vec::new();
    let what = match (left.groups, left.sessions) {
        (true, true) => Some("groups and sessions are"),
        (true, false) => Some("groups are"),
        (false, true) => Some("several sessions are"),
        (false, false) => None,
    };
    if let Some(what) = what {
        found.push(format!(
            "{what} not simulated: this is the power of all participants as one group in one session, \
             and not that of a difference between them"
        ));
    }
    let ids = |parts: &[PartId]| {
        let ids: Vec<&str> = parts.iter().map(PartId::as_str).collect();
        ids.join(", ")
    };
    if !left.parts.is_empty() {
        found.push(format!(
            "not simulated here: part {}; --part names the one to simulate",
            ids(&left.parts)
        ));
    }
    if !left.never.is_empty() {
        found.push(format!(
            "the power of magnitude estimation and MUSHRA is not computed: part {}",
            ids(&left.never)
        ));
    }
    found
}

/// A bar up to the power, with a mark at the ceiling.
fn bar(power: f64, ceiling: Option<f64>) -> String {
    // Between 0 and the number of columns, so the casts are exact.
    let at = |x: f64| (x.clamp(0.0, 1.0) * BAR as f64).round() as usize;
    (0..BAR)
        .map(|i| match i {
            i if i < at(power) => '█',
            i if ceiling.is_some_and(|c| i + 1 == at(c).max(1)) => '┆',
            _ => '·',
        })
        .collect()
}

/// `10 × 5 × 3`: participants, realizations, repetitions.
fn design(cell: &Cell) -> String {
    format!(
        "{} × {} × {}",
        cell.participants, cell.realizations, cell.repetitions
    )
}

fn percent(x: f64) -> String {
    let decimals = if x < 0.1 || x > 0.99 && x < 1.0 { 1 } else { 0 };
    format!("{} %", apa::number(100.0 * x, decimals))
}

fn name_of(scale: &Scale) -> String {
    match scale {
        Scale::Continuous => "continuous".to_owned(),
        Scale::Rounded(from, to) => format!("rounded to {from} … {to}"),
        Scale::Ordinal {
            link, thresholds, ..
        } => format!("{} with {} thresholds", link.as_str(), thresholds.len()),
    }
}

/// How a target is reached.
fn reached(reach: &Reach) -> String {
    match reach {
        Reach::Participants {
            participants,
            power,
            sure,
        } => format!(
            "{participants} participants (simulated {}{})",
            apa::share(*power, 3),
            if *sure { ", sure" } else { "" }
        ),
        Reach::MoreThan {
            participants,
            enough: Some(enough),
        } if *enough > participants + 1 => format!("{} to {enough} participants", participants + 1),
        Reach::MoreThan {
            enough: Some(enough),
            ..
        } => format!("{enough} participants"),
        Reach::MoreThan { participants, .. } => format!("more than {participants} participants"),
        Reach::Ceiling(ceiling) => format!("not reachable: the ceiling is {}", percent(*ceiling)),
        Reach::Limit(most) => format!("more than {most} participants"),
        Reach::NoSmallP(p) => format!("not reachable: the smallest p is {}", apa::bare_p(*p)),
    }
}

/// The test that decides.
fn deciding(plan: &Plan) -> String {
    plan.settings.test_name(0)
}
