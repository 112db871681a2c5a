//! The tables of similarity.

use super::{column, count};
use crate::apa::{one, or_dash, percent, two};
use crate::table::{Builder, Table, file};
use study_analysis::analyze::psychophysics::results::{PartResults, Similarities};
use study_analysis::analyze::results::Number as _;
use study_base::sort::SmallSort as _;

fn found(results: &PartResults) -> Option<&Similarities> {
    results.over.similarity.as_ref()
}

/// Maps of one dimension and more.
pub(super) fn dimensions(results: &PartResults) -> Table {
    let maps = found(results).into_iter().flat_map(|own| &own.dimensions);
    let note = "Stress: Kruskal's stress 1 of the order of the dissimilarities; in proportion: of ratio scaling. Classical: share of the \
                eigenvalues. Predicted: mean correlation of a participant's ratings with the map of all others, by which the number of \
                dimensions is chosen.";
    Builder::new("Dimensions", maps)
        .name("dimensions", "dimensions", &|m| m.0.as_str().to_owned())
        .field(
            column("stress", "stress").explained(note.to_owned()),
            two,
            |m| &m.1.stress,
        )
        .field(column("in proportion", "ratio_stress"), two, |m| {
            &m.1.ratio_stress
        })
        .field(column("classical", "classical"), two, |m| &m.1.classical)
        .field(column("predicted", "predicted"), two, |m| &m.1.predicted)
        .field(column("SE", "predicted_se"), two, |m| &m.1.predicted_se)
        .done()
}

/// Where the realizations lie.
pub(super) fn map(results: &PartResults) -> Table {
    let own = found(results);
    let dimensions = own
        .and_then(|own| own.map_dimensions.number())
        .unwrap_or(0.0);
    let places = own.into_iter().flat_map(|own| &own.map);
    let note = "Points of the scale, on the longest axes; SE over participants, by the bootstrap.";
    let shown = |of: f64, head: &str, name: &str| match dimensions >= of {
        true => column(head, name),
        false => file(name),
    };
    Builder::new("Map", places)
        .name("realization", "realization", &|p| p.0.as_str().to_owned())
        .field(column("1", "x").explained(note.to_owned()), one, |p| &p.1.x)
        .field(column("SE", "x_se"), one, |p| &p.1.x_se)
        .field(shown(2.0, "2", "y"), one, |p| &p.1.y)
        .field(shown(2.0, "SE", "y_se"), one, |p| &p.1.y_se)
        .field(shown(3.0, "3", "z"), one, |p| &p.1.z)
        .field(shown(3.0, "SE", "z_se"), one, |p| &p.1.z_se)
        .done()
}

/// What the map follows.
pub(super) fn follows(results: &PartResults) -> Table {
    let properties = found(results).into_iter().flat_map(|own| &own.follows);
    let note = "r: correlation of map and properties after Procrustes' rotation; p over the orders of the realizations.";
    Builder::new("Properties of the realizations", properties)
        .name("property", "property", &|p| p.0.as_str().to_owned())
        .field(column("number", "properties").droppable(1), count, |p| {
            &p.1.properties
        })
        .field(column("r", "r").explained(note.to_owned()), two, |p| &p.1.r)
        .ends(column("95 %", "ci95"), two, &|p| p.1.ci95.ends())
        .field(column("p", "p"), crate::apa::bare_p, |p| &p.1.p)
        .field(file("smallest_p"), crate::apa::bare_p, |p| &p.1.smallest_p)
        .done()
}

/// How participants weigh the dimensions of the map that they share.
pub(super) fn weights(results: &PartResults) -> Table {
    let own = found(results).map(|own| &own.weights);
    let participants = own.into_iter().flat_map(|own| &own.participants);
    let note = "Weights of the dimensions of a map that participants share (INDSCAL); a squared weight is about the share of the participant's \
                scalar products for which the dimension accounts. Fit: the share for which the map accounts.";
    let is_third = own.and_then(|own| own.dimensions.number()) > Some(2.0);
    let fit = own.and_then(|own| {
        Some(format!(
            "The map accounts for {} of everybody's scalar products, one whose dimensions all weigh alike for {}; p {} by dealing the \
             ratings of each pair to the participants at random.",
            percent(own.fit.number()?),
            percent(own.common_fit.number()?),
            crate::apa::p(own.p.number()?)
        ))
    });
    Builder::new("Weights of the dimensions", participants)
        .name("participant", "participant", &|p| p.0.as_str().to_owned())
        .field(column("1", "x").explained(note.to_owned()), two, |p| &p.1.x)
        .field(column("2", "y"), two, |p| &p.1.y)
        .field(column("3", "z").when(is_third), two, |p| &p.1.z)
        .field(column("fit", "fit"), two, |p| &p.1.fit)
        .notes(fit)
}

/// The map that participants share.
pub(super) fn weighted_map(results: &PartResults) -> Table {
    let own = found(results).map(|own| &own.weights);
    let places = own.into_iter().flat_map(|own| &own.map);
    let note = "The sum of squares of each dimension is 1. As far as participants weigh these dimensions differently, they cannot be turned.";
    let is_third = own.and_then(|own| own.dimensions.number()) > Some(2.0);
    Builder::new("Map with weights", places)
        .name("realization", "realization", &|p| p.0.as_str().to_owned())
        .field(column("1", "x").explained(note.to_owned()), two, |p| &p.1.x)
        .field(column("2", "y"), two, |p| &p.1.y)
        .field(column("3", "z").when(is_third), two, |p| &p.1.z)
        .done()
}

/// Pairs of realizations, the most similar first.
pub(super) fn pairs(results: &PartResults) -> Table {
    let mut pairs: Vec<_> = found(results)
        .into_iter()
        .flat_map(|own| &own.pairs)
        .collect();
    pairs.small_sort_by(|a, b| {
        let mean = [a, b].map(|p| p.1.rescaled.number().unwrap_or(f64::INFINITY));
        mean[0].total_cmp(&mean[1])
    });
    let note = "Rescaled: after the participants' ratings were brought to the same mean, in points of the scale. Distance: in the map.";
    let notes = found(results).and_then(|own| {
        let identical = own.identical.as_ref()?;
        Some(format!(
            "Identical pairs: {} on average, {} of different ones.",
            one(identical.mean.number()?),
            or_dash(identical.share.number(), percent)
        ))
    });
    Builder::new("Pairs of realizations", pairs)
        .name("realizations", "realizations", &|p| p.0.names().join(" | "))
        .field(column("ratings", "n"), count, |p| &p.1.n)
        .field(column("mean", "mean"), one, |p| &p.1.mean)
        .field(column("SD", "sd"), one, |p| &p.1.sd)
        .field(
            column("rescaled", "rescaled").explained(note.to_owned()),
            one,
            |p| &p.1.rescaled,
        )
        .field(column("distance", "distance"), one, |p| &p.1.distance)
        .notes(notes)
}

/// Participants.
pub(super) fn participants(results: &PartResults) -> Table {
    let participants = found(results).into_iter().flat_map(|own| &own.participants);
    let note = "With others: correlation of the ratings with the mean of all other participants.";
    Builder::new("Differences by participant", participants)
        .name("participant", "participant", &|p| p.0.as_str().to_owned())
        .field(column("ratings", "n"), count, |p| &p.1.n)
        .field(column("mean", "mean"), one, |p| &p.1.mean)
        .field(column("identical", "identical"), one, |p| &p.1.identical)
        .field(
            column("with others", "with_others").explained(note.to_owned()),
            two,
            |p| &p.1.with_others,
        )
        .done()
}
