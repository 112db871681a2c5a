//! Screening of participants: `subject/*` and `screen/*`. Nobody is excluded here.

use super::cells::{Cells, CompleteTable, within};
use super::describe::{NO_REPETITION, ONE};
use super::exclude::{pairs, trials};
use super::identifiers::group_id;
use super::values::Values;
use study_plan::protocol::Role;
use study_stats::correlation::pearson;
use study_stats::describe::{mean, sd};

/// Largest number of participants that are listed one by one.
pub(super) const MAX_LISTED: usize = 5000;

pub(super) fn subjects(cells: &Cells<'_>, values: &mut Values) {
    let r = cells.ratings;
    let n = r.subjects.len();
    let listed = n <= MAX_LISTED;
    let screens = Screens::of(cells);
    let mut constant = 0.0;
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
            constant += 1.0;
        }
        if !listed {
            continue;
        }
        let ordered = rows.iter().all(|&i| r.trial_index[i].is_some());
        let mut g = values.group(group_id("subject", &[cells.subject_name(s)]), "no ratings");
        g.put("n", x.len() as f64);
        g.maybe("mean", mean(&x));
        g.put_or("sd", sd(&x), ONE);
        rows.sort_by_key(|&i| r.trial_index[i]);
        let run = rows
            .chunk_by(|&a, &b| r.rating[a] == r.rating[b])
            .map(<[usize]>::len)
            .max();
        let run = run.filter(|_| ordered).map(|n| n as f64);
        g.put_or("longest_run", run, "the order of the trials is not known");
        x.sort_by(f64::total_cmp);
        x.dedup();
        g.put("distinct", x.len() as f64);
        let (squares, df) = within(own);
        let within_sd = (df > 0).then(|| (squares / df as f64).sqrt());
        g.put_or("within_cell_sd", within_sd, NO_REPETITION);
        let alone = table.subjects.binary_search(&s).ok();
        let why = "not all realizations rated, or a constant rater, or nobody else";
        g.put_or("leave_one_out_r", alone.and_then(|i| others[i]), why);
        for (name, by_subject) in screens.named() {
            g.put_or(name, by_subject[s], "none of these was rated");
        }
    }
    let mut g = values.group("screen", "");
    g.put("listed", f64::from(u8::from(listed)));
    g.put("n_constant", constant);
    if let (Some(high), Some(low)) = (&screens.reference, &screens.anchor) {
        let both = high.iter().zip(low).filter_map(|(h, l)| h.zip(*l));
        let below = both.filter(|(h, l)| h <= l).count();
        g.put("n_reference_not_above_anchor", below as f64);
    }
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

    fn named(&self) -> impl Iterator<Item = (&'static str, &Vec<Option<f64>>)> {
        [
            ("hidden_reference_mean", &self.reference),
            ("low_anchor_mean", &self.anchor),
            ("repeat_distance", &self.repeat),
        ]
        .into_iter()
        .filter_map(|(name, screen)| Some((name, screen.as_ref()?)))
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
