//! The table of participants.

use crate::apa::{self, two, whole};
use crate::table::{Builder, Head, Table, file, report};
use study_analysis::analyze::Analysis;

/// Columns of designs with a reference, an anchor or a repeat.
const EXTRA: [(&str, &str); 3] = [
    ("hidden_reference_mean", "mean of the references"),
    ("low_anchor_mean", "mean of the anchors"),
    ("repeat_distance", "mean |difference| of duplicates"),
];

/// The included participants; empty if there are too many to list.
pub(crate) fn subjects(a: &Analysis) -> Table {
    let get = |s: &str, what: &str| a.about("subject", &[s], what);
    let any = |what: &str| a.listed_subjects().any(|s| get(s, what).is_some());
    let has_vaf = a.realizations.iter().any(|m| m.vaf.is_some());
    // A correlation of two points is always ±1, so the report leaves it out.
    let enough = a.tested().count() > 2;
    let caption = "Screening of participants (nobody is excluded by it)";
    let vaf = |what: &'static str| move |s: &str| a.about("subject_corr", &[s], what);
    let mut table = Builder::new(caption, a.listed_subjects(), &get)
        .name("participant", "subject", &str::to_owned)
        .stat("n", "n", whole)
        .stat("mean", "mean", two)
        .stat("SD", "sd", two)
        .stat("distinct", "distinct", whole)
        .stat("longest run", "longest_run", whole)
        .stat("SD within cells", "within_cell_sd", two)
        .number(report("r with the others"), of_means, &|s| {
            get(s, "leave_one_out_r").filter(|_| enough)
        })
        .in_file("leave_one_out_r")
        .number(report("r with VAF").when(has_vaf), of_means, &|s| {
            vaf("r")(s).filter(|_| enough)
        });
    for (id, what) in EXTRA {
        let head = if any(id) {
            report(what)
        } else {
            Head::default()
        };
        table = table.stat_as(head.file(id), id, two);
    }
    let about = (a.listed_subjects().next().is_some()).then(|| {
        "Over all ratings of a participant. Distinct: number of different ratings; longest run: number of \
         consecutive trials with the same rating; SD within cells: of the repetitions; r with the others: \
         correlation of the participant's means with those of all others, over realizations."
            .to_owned()
    });
    table
        .number(file("r_with_vaf"), of_means, &vaf("r"))
        .number(file("slope_on_vaf"), two, &vaf("slope"))
        .notes(about)
}

fn of_means(r: f64) -> String {
    apa::share(r, 2)
}
