//! The maps of a search: utilities over the space, of all participants and of each.

use super::functions::{MAX_PANELS, cut, grid};
use super::{Canvas, Drawn, drawn, head};
use crate::apa::{digits, number};
use crate::chart::{Axis, ColorBar, Look, Mark, PALETTE, Panel, Scale, Shape, Span, shortened};
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::psychophysics::search::{Exploration, Explored};
use study_plan::protocol::{Axis as Dimension, SpaceRules};

/// Most levels of an axis whose values stand beside it.
const MAX_TICKS: usize = 5;

/// A map to draw: values of the certified points, the best one, and the points that were felt.
struct Map<'a> {
    title: String,
    values: &'a [f64],
    best: usize,
    felt: Vec<usize>,
    scale: Scale,
}

/// The maps of a part that searches. They have no p values: a search decides nothing.
pub(super) fn search_map(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let found = part.data.exploration.as_ref()?;
    found.searches.first()?;
    let space = &found.space;
    let maps = maps(found);
    let through = match space.axes.len() {
        0..=2 => "",
        _ => " Of the other axes each map is a cut through its best point, named above it.",
    };
    let border = match space.lattice.certified().len() < space.lattice.len() {
        true => " White: points that cannot be presented.",
        false => "",
    };
    let between = found.population.as_ref().map(|all| {
        let what = match found.people() {
            1 => "the sessions".to_owned(),
            n => format!("the maps of the {n} participants"),
        };
        let most = number(largest(&all.sd), 2);
        format!(" SD: the standard deviation between {what}, in colors from 0 to {most}.")
    });
    let between = between.unwrap_or_default();
    let most = number(extent(found), 2);
    let caption = format!(
        "What a search found: the utility of each point in units of the noise of one impression, from the mean of the map, \
         in colors from −{most} to {most}. Diamonds: the best point; dots: points that were felt.{between}{through}{border} A search decides nothing: its pairs \
         were chosen by the answers before them, and the best of many estimates is too good on average. The file has \
         all points of all participants.{}",
        cut(maps.len())
    );
    Some(drawn(name, caption, data(found), |c: Canvas| {
        let panels = maps.iter().take(MAX_PANELS).enumerate();
        let panels = panels
            .map(|(at, map)| panel(c, space, map, at == 0))
            .collect();
        grid(c, name, "Maps of a search", panels)
    }))
}

/// The largest utility of all searches, in either direction.
fn extent(found: &Exploration) -> f64 {
    let all = found.searches.iter().flat_map(|own| &own.mean);
    all.fold(1e-9, |most: f64, value| most.max(value.abs()))
}

/// The largest of some standard deviations.
fn largest(sd: &[f64]) -> f64 {
    sd.iter().copied().fold(1e-9, f64::max)
}

/// The map of all participants with its standard deviation, and that of each search.
fn maps(found: &Exploration) -> Vec<Map<'_>> {
    // One scale of utilities, so that maps can be compared.
    let scale = Scale::diverging(extent(found));
    let mut maps = Vec::new();
    if let Some(population) = &found.population {
        maps.push(Map {
            title: "all".to_owned(),
            values: &population.mean,
            best: population.best,
            felt: Vec::new(),
            scale,
        });
        maps.push(Map {
            title: "all: SD".to_owned(),
            values: &population.sd,
            best: population.best,
            felt: Vec::new(),
            scale: Scale::ascending(0.0, largest(&population.sd)),
        });
    }
    let several = |own: &Explored| {
        let same = |other: &&Explored| other.participant == own.participant;
        found.searches.iter().filter(same).count() > 1
    };
    maps.extend(found.searches.iter().map(|own| Map {
        title: match several(own) {
            true => format!("{}, session {}", own.participant, own.session),
            false => own.participant.to_string(),
        },
        values: &own.mean,
        best: own.best,
        felt: own.pairs.iter().flat_map(|pair| pair.points).collect(),
        scale,
    }));
    maps
}

/// The levels of an axis: all of them, or the first, the middle and the last.
fn axis(dimension: Option<&Dimension>) -> Axis {
    let Some(dimension) = dimension else {
        return Axis::of_names("", &[""]);
    };
    let levels = dimension.levels.levels();
    let last = levels.len() - 1;
    let shown = |at: usize| last < MAX_TICKS || at == 0 || at == last || at == last / 2;
    let names: Vec<String> = (levels.iter().enumerate())
        .map(|(at, level)| match shown(at) {
            true => digits(*level),
            false => String::new(),
        })
        .collect();
    Axis::of_names(dimension.vary.as_str(), &names)
}

/// The second axis from left to right, the first one downward, through the best point along all others.
fn panel(c: Canvas, space: &SpaceRules, map: &Map<'_>, is_first: bool) -> Panel {
    let lattice = &space.lattice;
    let certified = lattice.certified();
    let through = lattice.at(certified[map.best]);
    // Row and column of a point, if it lies in the cut.
    let place = |point: usize| -> Option<(f64, f64)> {
        let at = lattice.at(point);
        let within = at.iter().zip(&through).skip(2).all(|(a, b)| a == b);
        let column = at.get(1).copied().unwrap_or(0);
        within.then_some((column as f64, at[0] as f64))
    };
    let cells = certified
        .iter()
        .zip(map.values)
        .filter_map(|(point, value)| {
            let (x, y) = place(*point)?;
            let span = Span {
                x: (x - 0.5, x + 0.5),
                y: (y - 0.5, y + 0.5),
            };
            Some((span, *value))
        });
    let heat = Mark::Heat {
        cells: cells.collect(),
        scale: map.scale,
    };
    let others: Vec<String> = (space.axes.iter().zip(space.levels(certified[map.best])))
        .skip(2)
        .map(|(axis, level)| format!("{} {}", axis.vary.as_str(), digits(level)))
        .collect();
    let mut title = shortened(&map.title, 18);
    if !others.is_empty() {
        title = format!("{title} · {}", others.join(", "));
    }
    let mut panel = Panel::new(axis(space.axes.get(1)), axis(space.axes.first()).reversed());
    panel.title = title;
    let dots = map.felt.iter().filter_map(|point| place(*point)).collect();
    let best = Look {
        shape: Shape::Diamond,
        ..Look::plain(PALETTE[1]).size(9.0)
    };
    panel = panel
        .with(Look::plain(PALETTE[0]), heat)
        .with(Look::plain(PALETTE[6]).stroke(3.0), Mark::Dots(dots))
        .with(
            best,
            Mark::Points(place(certified[map.best]).into_iter().collect()),
        );
    if is_first && !c.narrow {
        panel.color_bar = Some(ColorBar {
            label: "utility".to_owned(),
            scale: map.scale,
        });
    }
    panel
}

/// All points of all maps; the participant of the map of all is empty.
fn data(found: &Exploration) -> Vec<Vec<String>> {
    let space = &found.space;
    let mut first = head(["participant", "session", "point"]);
    first.extend(space.axes.iter().map(|axis| axis.vary.as_str().to_owned()));
    first.extend(head(["mean", "sd", "best"]));
    let mut rows = vec![first];
    let mut add = |who: &str, session: String, (mean, sd): (&[f64], &[f64]), best: usize| {
        for (index, point) in space.lattice.certified().iter().enumerate() {
            let mut row = vec![who.to_owned(), session.clone(), (point + 1).to_string()];
            row.extend(space.levels(*point).into_iter().map(digits));
            row.extend([digits(mean[index]), digits(sd[index])]);
            row.push((index == best).to_string());
            rows.push(row);
        }
    };
    if let Some(all) = &found.population {
        add("", String::new(), (&all.mean, &all.sd), all.best);
    }
    for own in &found.searches {
        let session = own.session.to_string();
        add(
            own.participant.as_str(),
            session,
            (&own.mean, &own.sd),
            own.best,
        );
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::super::parts::of_part;
    use study_analysis::analyze::psychophysics::PartAnalysis;
    use study_analysis::analyze::psychophysics::search::{
        Exploration, Explored, ExploredPair, Population,
    };
    use study_analysis::preregister::complete_parts;
    use study_base::text::ParticipantId;

    /// A search in a space of so many axes with three levels each, of which the last point cannot be presented.
    fn part(axes: &str, dimensions: usize) -> PartAnalysis {
        let protocol = format!(
            r#"
format = "study-protocol/3"
study = {{ id = "example", title = "An example", seed = 1 }}
design = {{ participants = 10 }}
device = {{ kind = "simulated", limits = {{ force_n = 12.0, velocity_mm_s = 1000.0 }} }}
analysis = {{ primary = "better" }}

[[spaces]]
id = "switch"
from = "a.toml"
axes = {{ {axes} }}
grid = 3

[[parts]]
id = "better"
kind = "search"
prompt = "Which?"
space = "switch"
rule = {{ name = "sobol", trials = 10 }}
"#
        );
        let parsed = study_plan::protocol::file::parse("protocol.toml", &protocol);
        let protocol = parsed.protocol.unwrap();
        let mut part = complete_parts(&protocol, 4).remove(0);
        let mut space = protocol.spaces[0].clone();
        space.certify(|at| at != vec![2; dimensions]).unwrap();
        let points = space.lattice.certified().len();
        let own = |who: &str| Explored {
            participant: ParticipantId::new(who).unwrap(),
            session: 1,
            pilot: false,
            simulated: false,
            pairs: vec![ExploredPair {
                trial: 1,
                points: [0, 1],
                preferred: Some(1),
            }],
            left_out: Vec::new(),
            mean: (0..points)
                .map(|i| i as f64 / points as f64 - 0.5)
                .collect(),
            sd: vec![1.0; points],
            best: points - 1,
        };
        part.data.exploration = Some(Exploration {
            part: part.part.clone(),
            population: Some(Population {
                mean: own("P01").mean,
                sd: vec![0.5; points],
                best: points - 1,
            }),
            searches: vec![own("P01"), own("P02")],
            space,
            pilot: false,
            simulated: false,
            exclusions: Vec::new(),
        });
        part
    }

    #[test]
    fn a_search_has_a_map_of_all_and_one_of_each() {
        for (axes, dimensions) in [
            ("detent = [0.5, 1.5]", 1),
            ("detent = [0.5, 1.5], friction = [0.0, 1.0]", 2),
            (
                "detent = [0.5, 1.5], friction = [0.0, 1.0], b = [0.0, 2.0]",
                3,
            ),
        ] {
            let figures = of_part(1, &part(axes, dimensions));
            let figure = figures.iter().find(|f| f.name == "part-1-search").unwrap();
            let points = 3usize.pow(dimensions as u32) - 1;
            assert_eq!(figure.data.lines().count(), 1 + 3 * points);
            // The first utility is −0.5, and every SD is 0.5.
            for word in [
                "in colors from −0.50 to 0.50.",
                "between the maps of the 2 participants, in colors from 0 to 0.50.",
                "points that cannot be presented",
                "A search decides nothing",
            ] {
                assert!(figure.caption.contains(word), "{word}: {}", figure.caption);
            }
            assert!(!figure.caption.contains("p ="));
            for picture in [&figure.wide, &figure.narrow] {
                let svg = picture.to_svg();
                for text in ["all: SD", "P01", "P02"] {
                    assert!(svg.contains(text), "{text}");
                }
                // The cut through the best point has its level.
                assert_eq!(svg.contains("· b 1"), dimensions == 3);
            }
        }
    }

    #[test]
    fn without_a_search_there_is_no_map() {
        let mut part = part("detent = [0.5, 1.5]", 1);
        part.data.exploration = None;
        assert!(!of_part(1, &part).iter().any(|f| f.name.ends_with("search")));
    }
}
