//! Reading and writing of model files.
//!
//! A stand-in that reads what the branch's tests need, until the real one is
//! merged.

use super::predict::{Direction, Lookup};
use super::{Branch, Provenance, Realization, Trained};
use crate::diagnostic::table::{Document, Table};
use crate::diagnostic::{Fault, Findings};

/// Reads a model file.
pub fn parse(path: &str, text: &str) -> (Option<Realization>, Findings) {
    let document = Document::parse(text);
    let mut root = document.root();
    let realization = read(&mut root);
    let mut findings = Findings::new(path, text);
    findings.faults = document.finish().faults;
    if realization.is_none() && findings.faults.is_empty() {
        findings
            .faults
            .push(Fault::error("the model file is not complete"));
    }
    (realization.filter(|_| !findings.has_errors()), findings)
}

fn read(root: &mut Table<'_, '_>) -> Option<Realization> {
    let mut vaf = std::collections::BTreeMap::new();
    if let Some(mut table) = root.table("vaf") {
        for (key, _) in table.keys() {
            vaf.insert(key.clone(), table.f64(&key)?);
        }
    }
    let id = root.required("id")?.text()?;
    let x_mm = root.f64s("x_mm")?;
    let positive = branch(root, "positive")?;
    let negative = branch(root, "negative")?;
    Some(Realization {
        id,
        provenance: Provenance::default(),
        vaf,
        lookup: Lookup::Linear,
        direction: Direction::Sign,
        trained: Trained {
            x_mm: [0.0, 1.0],
            v_mm_s: 1.0,
        },
        x_mm,
        positive,
        negative,
    })
}

fn branch(root: &mut Table<'_, '_>, key: &str) -> Option<Branch> {
    let mut table = root.table(key)?;
    Some(Branch {
        m_kg: table.f64s("m_kg")?,
        b_n_s_per_mm: table.f64s("b_n_s_per_mm")?,
        k_n_per_mm: table.f64s("k_n_per_mm")?,
        f0_n: table.f64s("f0_n")?,
    })
}
