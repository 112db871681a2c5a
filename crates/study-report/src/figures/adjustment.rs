//! Points of subjective equality of the participants, with both sides from which they were set.

use super::{Canvas, Drawn, MAX_DRAWN, cell, drawn, head, rows_height};
use crate::chart::{Axis, Dash, Look, Mark, PALETTE, Panel, Shape, Whisker, shortened};
use study_analysis::analyze::psychophysics::PartAnalysis;
use study_analysis::analyze::results::Number as _;

/// A participant: the mean of both sides, and that of each.
struct Person {
    name: String,
    pse: f64,
    sides: [Option<f64>; 2],
}

/// The settings of a part of adjustment.
pub(super) fn settings(name: &str, part: &PartAnalysis) -> Option<Drawn> {
    let found = part.results.over.adjustment.as_ref()?;
    let people: Vec<Person> = (found.participants.iter())
        .filter_map(|(name, own)| {
            Some(Person {
                name: name.as_str().to_owned(),
                pse: own.pse.number()?,
                sides: [own.ascending.number(), own.descending.number()],
            })
        })
        .collect();
    if people.is_empty() || people.len() > MAX_DRAWN {
        return None;
    }
    let mut data = vec![head(["participant", "pse", "from_below", "from_above"])];
    for person in &people {
        let [below, above] = person.sides.map(cell);
        data.push(vec![
            person.name.clone(),
            cell(Some(person.pse)),
            below,
            above,
        ]);
    }
    let center = found.pse.number()?;
    let ci95 = found.pse_ci95.ends();
    data.push(vec![
        "mean".to_owned(),
        cell(Some(center)),
        String::new(),
        String::new(),
    ]);
    let standard = found.error.as_ref().and_then(|e| e.standard.number());
    let caption = format!(
        "Points of subjective equality (rings: mean settings from below and from above). Diamond: mean over participants with its 95 % t \
         interval.{}",
        match standard {
            Some(_) => " Dashed: the standard.",
            None => "",
        }
    );
    let label = part.data.dimension.clone();
    let label = label.unwrap_or_else(|| "level".to_owned());
    let title = "Settings by participant";
    Some(drawn(name, caption, data, |c: Canvas| {
        let mut names: Vec<String> = people.iter().map(|p| shortened(&p.name, 20)).collect();
        names.push("mean".to_owned());
        let sides = people.iter().flat_map(|p| p.sides).flatten();
        let ends = ci95.into_iter().flat_map(|(low, high)| [low, high]);
        let shown = people.iter().map(|p| p.pse).chain(sides).chain(ends);
        let x = Axis::around(&label, shown.chain(standard).chain([center]));
        let y = Axis::of_names("", &names).reversed();
        let mut panel = Panel::new(x, y);
        if let Some(standard) = standard {
            let dashed = Look::plain(PALETTE[1]).stroke(1.2).dashed(Dash::Dashed);
            let last = names.len() as f64 - 0.5;
            panel = panel.with(dashed, Mark::Line(vec![(standard, -0.5), (standard, last)]));
        }
        let all = || people.iter().enumerate();
        let between = all().filter_map(|(at, p)| {
            let [below, above] = p.sides;
            Some((at as f64, below?, above?))
        });
        let thin = Look::plain(PALETTE[0]).stroke(1.0).pale();
        for (at, below, above) in between {
            panel = panel.with(thin, Mark::Line(vec![(below, at), (above, at)]));
        }
        let rings =
            all().flat_map(|(at, p)| p.sides.into_iter().flatten().map(move |x| (x, at as f64)));
        let ring = Look::plain(PALETTE[0])
            .shaped(Shape::Ring)
            .stroke(1.3)
            .size(6.0);
        panel = panel.with(ring, Mark::Points(rings.collect()));
        let points = all().map(|(at, p)| (p.pse, at as f64)).collect();
        panel = panel.with(Look::plain(PALETTE[0]).size(6.0), Mark::Points(points));
        let at = people.len() as f64;
        let look = Look::plain(PALETTE[0])
            .shaped(Shape::Diamond)
            .stroke(2.2)
            .size(9.0);
        let bar = ci95.map(|(low, high)| Whisker { at, low, high });
        panel = panel.with(look, Mark::ErrorBarsAcross(bar.into_iter().collect()));
        panel = panel.with(look, Mark::Points(vec![(center, at)]));
        c.figure(name, title, 56.0 + rows_height(names.len()))
            .with(panel)
    }))
}

#[cfg(test)]
mod tests {
    use super::super::parts::of_part;
    use study_analysis::preregister::complete_parts;

    const PROTOCOL: &str = r#"
format = "study-protocol/3"
study = { id = "example", title = "An example", seed = 1 }
design = { participants = 10 }
device = { kind = "simulated", limits = { force_n = 12.0, velocity_mm_s = 1000.0 } }
analysis = { primary = "equal" }

[[families]]
id = "detent"
from = "static.toml"
vary = "detent"
range = [0.5, 1.5]
steps = 21
unit = "×"

[[parts]]
id = "equal"
kind = "adjustment"
prompt = "Until both feel equal."
lower = "weaker"
higher = "stronger"
confirm = "equal"
family = "detent"
standard = 1.0
repetitions = 3
"#;

    /// A row for each participant and one for the mean, with the standard.
    #[test]
    fn settings_are_drawn_beside_the_standard() {
        let parsed = study_plan::protocol::file::parse("protocol.toml", PROTOCOL);
        let part = complete_parts(&parsed.protocol.unwrap(), 4).remove(0);
        let people = part.results.over.adjustment.as_ref().unwrap();
        let people = people.participants.len();
        assert!(people > 1);
        let figures = of_part(1, &part);
        let figure = figures
            .iter()
            .find(|f| f.name == "part-1-settings")
            .unwrap();
        assert_eq!(figure.data.lines().count(), 2 + people);
        for picture in [&figure.wide, &figure.narrow] {
            let svg = picture.to_svg();
            assert!(
                svg.contains(">mean<") && svg.contains("detent (×)"),
                "{svg}"
            );
        }
        assert!(figure.caption.contains("Dashed: the standard."));
    }
}
