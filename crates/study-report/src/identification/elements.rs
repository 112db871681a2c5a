//! Elements as text and as JSON.

use super::printed::Printed;
use serde_json::{Value, json};
use std::fmt::Write as _;
use study_haptics::model::{Elements, Realization};
use study_wire::elements::Spring;

/// The springs of a realization of elements, a line each; empty for another one.
pub(super) fn in_detail(realization: &Realization, p: Printed) -> String {
    let Some(elements) = &realization.elements else {
        return String::new();
    };
    if elements.springs.is_empty() {
        return "no spring that slips, relaxes or breaks is worth it\n".to_owned();
    }
    let mut out = String::new();
    let x = p.x();
    for (spring, force_n) in elements.springs.iter().zip(&elements.spring_n) {
        let what = match *spring {
            Spring::Stop { slip_mm } => {
                format!("slips when it is deflected by {:.3} {x}", p.length(slip_mm))
            }
            Spring::Maxwell { relaxation_s, .. } => format!("relaxes within {relaxation_s:.3} s"),
            Spring::Latch { rearm_mm, break_mm } => format!(
                "breaks above {:.3} {x} and holds again below {:.3} {x}",
                p.length(break_mm),
                p.length(rearm_mm)
            ),
        };
        let most = p.force(force_n.iter().copied().fold(0.0, f64::max));
        let decimals = p.decimals() - 1;
        let _ = writeln!(out, "a spring of up to {most:.decimals$} {} {what}", p.f());
    }
    out
}

/// Elements with the keys of a model file in mm and N.
pub(super) fn json(elements: &Elements) -> Value {
    let springs = elements.springs.iter().zip(&elements.spring_n);
    let springs: Vec<Value> = springs
        .map(|(spring, n)| match *spring {
            Spring::Stop { slip_mm } => json!({ "kind": "stop", "slip_mm": slip_mm, "n": n }),
            Spring::Maxwell {
                slip_mm,
                relaxation_s,
            } => json!({ "kind": "maxwell", "slip_mm": slip_mm, "relaxation_s": relaxation_s, "n": n }),
            Spring::Latch { rearm_mm, break_mm } => {
                json!({ "kind": "latch", "rearm_mm": rearm_mm, "break_mm": break_mm, "n": n })
            }
        })
        .collect();
    let [forwards, backwards] = &elements.damping_n_s_per_mm;
    json!({
        "mass_kg": elements.mass_kg,
        "x_mm": elements.x_mm,
        "force_n": elements.force_n,
        "forwards_n_s_per_mm": forwards,
        "backwards_n_s_per_mm": backwards,
        "springs": springs,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_haptics::model::{Provenance, Trained, Units};

    fn with_every_spring() -> Elements {
        Elements {
            springs: vec![
                Spring::Stop { slip_mm: 0.2 },
                Spring::Maxwell {
                    slip_mm: 10.0,
                    relaxation_s: 0.07,
                },
                Spring::Latch {
                    rearm_mm: 5.0,
                    break_mm: 6.2,
                },
            ],
            spring_n: vec![vec![0.1, 0.12], vec![14.0, 14.0], vec![0.0, 3.5]],
            ..Elements::default()
        }
    }

    #[test]
    fn the_document_has_every_number() {
        let elements = Elements {
            mass_kg: 0.02,
            x_mm: vec![0.0, 10.0],
            force_n: vec![0.5, -0.5],
            damping_n_s_per_mm: [vec![0.01, 0.02], vec![0.03, 0.0]],
            ..with_every_spring()
        };
        assert_eq!(
            json(&elements),
            json!({
                "mass_kg": 0.02,
                "x_mm": [0.0, 10.0],
                "force_n": [0.5, -0.5],
                "forwards_n_s_per_mm": [0.01, 0.02],
                "backwards_n_s_per_mm": [0.03, 0.0],
                "springs": [
                    { "kind": "stop", "slip_mm": 0.2, "n": [0.1, 0.12] },
                    { "kind": "maxwell", "slip_mm": 10.0, "relaxation_s": 0.07, "n": [14.0, 14.0] },
                    { "kind": "latch", "rearm_mm": 5.0, "break_mm": 6.2, "n": [0.0, 3.5] },
                ],
            })
        );
    }

    #[test]
    fn every_spring_has_a_line_in_the_units_of_the_handle() {
        let elements = Elements {
            x_mm: vec![0.0, 10.0],
            force_n: vec![0.0; 2],
            damping_n_s_per_mm: [vec![0.0; 2], vec![0.0; 2]],
            ..with_every_spring()
        };
        let trained = Trained {
            x_mm: [0.0, 10.0],
            v_mm_s: 50.0,
        };
        let of = |elements: Elements| {
            let (provenance, vaf) = (Provenance::default(), Default::default());
            Realization::of_elements("e".into(), provenance, vaf, trained, elements)
        };
        let linear = Printed {
            units: Units::Linear,
            lever_mm: 1.0,
        };
        assert_eq!(
            in_detail(&of(elements.clone()), linear),
            "a spring of up to 0.120 N slips when it is deflected by 0.200 mm\n\
             a spring of up to 14.000 N relaxes within 0.070 s\n\
             a spring of up to 3.500 N breaks above 6.200 mm and holds again below 5.000 mm\n"
        );
        let turned = Printed {
            units: Units::Radians,
            lever_mm: 20.0,
        };
        let text = in_detail(&of(elements.clone()), turned);
        let last = "a spring of up to 0.07000 N·m breaks above 0.310 rad and holds again below 0.250 rad\n";
        assert!(text.ends_with(last), "{text}");
        let none = Elements {
            springs: Vec::new(),
            spring_n: Vec::new(),
            ..elements
        };
        assert!(in_detail(&of(none), linear).starts_with("no spring"));
    }
}
