//! `[device]`.

use super::models::DEVICES;
use super::reader::Reader;
use crate::protocol::{DeviceKind, DeviceRules, Uncertified};
use study_base::diagnostic::Fault;
use study_base::diagnostic::table::Table;
use study_base::limits::{Limit, Limits};

/// The section; `None` if a part of it is faulty.
pub(super) fn read<'d, 't>(
    reader: &Reader<'d, 't>,
    root: &mut Table<'d, 't>,
) -> Option<DeviceRules> {
    let mut table = reader.section(root, "device", "such as kind = \"simulated\"")?;
    let kind = reader
        .need(
            &mut table,
            "kind",
            "one of `simulated`, `serial`, `process`, `manual`",
        )
        .and_then(|v| v.word(&DEVICES));
    let value = if kind == Some(DeviceKind::Manual) {
        table.value("limits")
    } else {
        reader.need(
            &mut table,
            "limits",
            "such as limits = { force_n = 12.0, velocity_mm_s = 1000.0 }",
        )
    };
    let given = value.is_some();
    let limits = value.and_then(|v| v.table()).and_then(|mut limits| {
        let force_n = reader.need_limit(&mut limits, "force_n", "the largest force, N");
        let velocity_mm_s = reader.need_limit(
            &mut limits,
            "velocity_mm_s",
            "the speed at which the device trips, mm/s",
        );
        limits.finish();
        Some(Limits {
            force_n: force_n?,
            velocity_mm_s: velocity_mm_s?,
        })
    });
    let uncertified = table
        .table("uncertified")
        .map(|table| uncertified(reader, table, limits.as_ref()));
    table.finish();
    let limits = match limits {
        Some(limits) => limits,
        // A sample mounted by hand plays no table: nothing is ever held to these.
        None if !given && kind == Some(DeviceKind::Manual) => unplayed_limits()?,
        None => return None,
    };
    Some(DeviceRules {
        kind: kind?,
        limits,
        uncertified: match uncertified {
            Some(uncertified) => Some(uncertified?),
            None => None,
        },
    })
}

fn unplayed_limits() -> Option<Limits> {
    Some(Limits {
        force_n: Limit::new(12.0).ok()?,
        velocity_mm_s: Limit::new(1000.0).ok()?,
    })
}

fn uncertified<'d, 't>(
    reader: &Reader<'d, 't>,
    mut table: Table<'d, 't>,
    limits: Option<&Limits>,
) -> Option<Uncertified> {
    let play = reader
        .need(&mut table, "play", "true or false")
        .and_then(|v| v.bool());
    let force_n = reader.need_limit(&mut table, "force_n", "the largest force for them, N");
    let reason = reader.need_text(&mut table, "reason", "it stands in every session");
    table.finish();
    if let (Some(force), Some(limits)) = (force_n, limits)
        && force > limits.force_n
    {
        above_the_limit(reader, force, limits.force_n);
    }
    Some(Uncertified {
        play: play?,
        force_n: force_n?,
        reason: reason?,
    })
}

fn above_the_limit(reader: &Reader<'_, '_>, force: Limit, limit: Limit) {
    reader.document.fault(
        Fault::error(format!(
            "`device.uncertified.force_n` is {} N, above `device.limits.force_n`, {} N",
            force.get(),
            limit.get()
        ))
        .at(reader.document.span_of("device.uncertified.force_n")),
    );
}
