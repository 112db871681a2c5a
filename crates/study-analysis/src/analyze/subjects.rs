//! Screening of participants: `subject/*` and `screen/*`. Nobody is excluded here.

use super::cells::{Cells, CompleteTable, within};
use super::describe::{NO_REPETITION, ONE};
use super::exclude::{pairs, trials};
use super::record::{ParticipantName, Stat, statistics};
use std::collections::BTreeMap;
use study_base::sort::SmallSort as _;
use study_plan::protocol::Role;
use study_stats::correlation::pearson;
use study_stats::describe::{mean, sd};

/// Largest number of participants that are listed one by one.
pub(super) const MAX_LISTED: usize = 5000;

statistics! {
    /// The ratings of a participant. They flag participants; they never exclude them.
    pub struct Screened {
        /// their number
        n: Stat,
        /// their mean
        mean: Stat,
        /// n − 1
        sd: Stat,
        /// the longest run of equal ratings in the order of the trials
        longest_run: Stat,
        /// different ratings
        distinct: Stat,
        /// √(Σ within-cell squares/df)
        within_cell_sd: Stat,
        /// correlation of the cells with the mean of the others
        leave_one_out_r: Stat,
        /// mean of the cells of hidden references
        hidden_reference_mean: Option<Stat>,
        /// mean of the cells of low anchors
        low_anchor_mean: Option<Stat>,
        /// mean distance of the cells of hidden duplicates from those of their originals
        repeat_distance: Option<Stat>,
    }

    /// Screening of all participants.
    pub struct Screen {
        /// 0: too many to list one by one
        listed: Stat,
        /// participants who always gave the same rating
        n_constant: Stat,
        /// participants whose mean of the hidden references is not above that of the anchors
        n_reference_not_above_anchor: Option<Stat>,
    }

    /// Screening of participants.
    pub struct Screening {
        /// one by one
        subject: BTreeMap<ParticipantName, Screened>,
        /// together
        screen: Screen,
    }
}

pub(super) fn subjects(cells: &Cells<'_>) -> Screening {
    let r = cells.ratings;
    let n = r.subjects.len();
    let listed = n <= MAX_LISTED;
    let screens = Screens::of(cells);
    let mut constant = 0;
    let mut subject = BTreeMap::new();
    let table = cells.table(&cells.tested());
    let others = leave_one_out(&table);
    let mut own_cells = cells
        .cells
        .chunk_by(|a, b| a.subject == b.subject)
        .peekable();
    let mut x = Vec::new();
    for rows in cells.all.chunk_by(|&a, &b| r.subject[a] == r.subject[b]) {
        let s = r.subject[rows[0]] as usize;
        let own = own_cells.next_if(|own| own[0].subject == s).unwrap_or(&[]);
        let mut rows = rows.to_vec();
        rows.retain(|&i| r.rating[i].is_some());
        rows.sort_unstable();
        x.clear();
        x.extend(rows.iter().filter_map(|&i| r.rating[i]));
        if x.len() > 1 && x.iter().all(|v| *v == x[0]) {
            constant += 1;
        }
        if !listed {
            continue;
        }
        let ordered = rows.iter().all(|&i| r.trial_index[i].is_some());
        let (mean, sd) = (mean(&x), sd(&x));
        rows.small_sort_by_key(|&i| r.trial_index[i]);
        let run = rows
            .chunk_by(|&a, &b| r.rating[a] == r.rating[b])
            .map(<[usize]>::len)
            .max();
        let run = run.filter(|_| ordered).map(|n| n as f64);
        let n = Stat::count(x.len());
        x.sort_by(f64::total_cmp);
        x.dedup();
        let (squares, df) = within(own);
        let within_sd = (df > 0).then(|| (squares / df as f64).sqrt());
        let alone = table.subjects.binary_search(&s).ok();
        let why = "not all realizations rated, or a constant rater, or nobody else";
        let of = |screen: &Option<Vec<Option<f64>>>| {
            let by_subject = screen.as_ref()?;
            Some(Stat::or(by_subject[s], "none of these was rated"))
        };
        let screened = Screened {
            n,
            mean: Stat::or(mean, "no ratings"),
            sd: Stat::or(sd, ONE),
            longest_run: Stat::or(run, "the order of the trials is not known"),
            distinct: Stat::count(x.len()),
            within_cell_sd: Stat::or(within_sd, NO_REPETITION),
            leave_one_out_r: Stat::or(alone.and_then(|i| others[i]), why),
            hidden_reference_mean: of(&screens.reference),
            low_anchor_mean: of(&screens.anchor),
            repeat_distance: of(&screens.repeat),
        };
        subject.insert(cells.subject_name(s).into(), screened);
    }
    let both = screens.reference.as_ref().zip(screens.anchor.as_ref());
    let below = both.map(|(high, low)| {
        let both = high.iter().zip(low).filter_map(|(h, l)| h.zip(*l));
        Stat::count(both.filter(|(h, l)| h <= l).count())
    });
    let screen = Screen {
        listed: Stat::flag(listed),
        n_constant: Stat::count(constant),
        n_reference_not_above_anchor: below,
    };
    Screening { subject, screen }
}

/// Screening statistics of designs with hidden references, anchors or repeats, by subject.
struct Screens {
    reference: Option<Vec<Option<f64>>>,
    anchor: Option<Vec<Option<f64>>>,
    repeat: Option<Vec<Option<f64>>>,
}

impl Screens {
    fn of(cells: &Cells<'_>) -> Self {
        let r = cells.ratings;
        let role = |role: Role| {
            let has = r.models.iter().any(|m| m.role == role);
            has.then(|| means(cells, role))
        };
        Self {
            reference: role(Role::HiddenReference),
            anchor: role(Role::LowAnchor),
            repeat: (!pairs(r).is_empty()).then(|| trials(r, 0..r.len(), true).repeat_distances()),
        }
    }
}

/// Mean over each subject's cells of the realizations with a role.
fn means(cells: &Cells<'_>, role: Role) -> Vec<Option<f64>> {
    let r = cells.ratings;
    let mut sums = vec![(0.0, 0.0); r.subjects.len()];
    for cell in &cells.cells {
        if r.models[cell.model].role == role {
            sums[cell.subject].0 += cell.mean;
            sums[cell.subject].1 += 1.0;
        }
    }
    (sums.iter())
        .map(|(sum, n)| (*n > 0.0).then(|| sum / n + cells.offset))
        .collect()
}

/// Correlation of each subject's cells with the mean of all others.
fn leave_one_out(table: &CompleteTable) -> Vec<Option<f64>> {
    let m = table.models.len();
    if table.rows.len() < 2 || table.rows.len() > MAX_LISTED {
        return vec![None; table.rows.len()];
    }
    let sums: Vec<f64> = (0..m).map(|j| table.column(j).iter().sum()).collect();
    let others = table.rows.len() as f64 - 1.0;
    table
        .rows
        .iter()
        .map(|row| {
            let rest: Vec<f64> = (0..m).map(|j| (sums[j] - row[j]) / others).collect();
            pearson(row, &rest)
        })
        .collect()
}
