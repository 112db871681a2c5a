//! The table of participants.

use crate::apa::{self, two, whole};
use crate::table::{Builder, Table, file, page, report};
use study_analysis::analyze::Analysis;
use study_analysis::analyze::results::{Number as _, ParticipantName, Screened, Stat};

/// The included participants; empty if there are too many to list.
pub(crate) fn subjects(a: &Analysis) -> Table {
    type Row<'a> = (&'a ParticipantName, &'a Screened);
    let all = &a.results.screening.subject;
    let with_vaf = &a.results.over_participants.subject_corr.by_subject;
    let with_vaf = |(name, _): Row<'_>| with_vaf.get(name.as_str());
    let has_vaf = a.realizations.iter().any(|m| m.vaf.is_some());
    // A correlation of two points is always ±1, so the report leaves it out.
    let enough = a.tested().count() > 2;
    let caption = "Screening of participants (nobody is excluded by it)";
    let column = |head: &str, name: &str| page(head).file(name);
    let mut table = Builder::new(caption, all)
        .name("participant", "subject", &|s: Row<'_>| {
            s.0.as_str().to_owned()
        })
        .field(column("n", "n"), whole, |(_, s)| &s.n)
        .field(column("mean", "mean"), two, |(_, s)| &s.mean)
        .field(column("SD", "sd"), two, |(_, s)| &s.sd)
        .field(column("distinct", "distinct"), whole, |(_, s)| &s.distinct)
        .field(column("longest run", "longest_run"), whole, |(_, s)| {
            &s.longest_run
        })
        .field(
            column("SD within cells", "within_cell_sd"),
            two,
            |(_, s)| &s.within_cell_sd,
        )
        .number(report("r with the others"), of_means, &|(_, s)| {
            s.leave_one_out_r.number().filter(|_| enough)
        })
        .field(file("leave_one_out_r"), of_means, |(_, s)| {
            &s.leave_one_out_r
        })
        .number(report("r with VAF").when(has_vaf), of_means, &|s| {
            with_vaf(s)?.r.number().filter(|_| enough)
        });
    // Columns of designs with a reference, an anchor or a repeat.
    type Extra = (&'static str, &'static str, fn(&Screened) -> &Option<Stat>);
    let extra: [Extra; 3] = [
        ("hidden_reference_mean", "mean of the references", |s| {
            &s.hidden_reference_mean
        }),
        ("low_anchor_mean", "mean of the anchors", |s| {
            &s.low_anchor_mean
        }),
        ("repeat_distance", "mean |difference| of duplicates", |s| {
            &s.repeat_distance
        }),
    ];
    for (name, what, of) in extra {
        let known = all.values().any(|s| of(s).number().is_some());
        let head = report(what).when(known).file(name);
        table = table.field(head, two, |(_, s)| of(s).as_ref());
    }
    let about = (!all.is_empty()).then(|| {
        "Over all ratings of a participant. Distinct: number of different ratings; longest run: number of \
         consecutive trials with the same rating; SD within cells: of the repetitions; r with the others: \
         correlation of the participant's means with those of all others, over realizations."
            .to_owned()
    });
    table
        .field(file("r_with_vaf"), of_means, |s| with_vaf(s).map(|v| &v.r))
        .field(file("slope_on_vaf"), two, |s| with_vaf(s).map(|v| &v.slope))
        .notes(about)
}

fn of_means(r: f64) -> String {
    apa::share(r, 2)
}
