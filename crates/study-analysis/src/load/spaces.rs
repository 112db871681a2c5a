//! The tables of spaces: every point is built and certified before the session, and only those that pass can be presented.

use super::families::strongest_at_rest_n;
use super::{Loaded, OtherFiles};
use std::collections::BTreeMap;
use study_base::diagnostic::{Fault, Findings};
use study_base::text::ModelId;
use study_haptics::family::{self, Family, FamilyError};
use study_haptics::model::{Realization, Units};
use study_haptics::safe_play;
use study_plan::protocol::check::Spans;
use study_plan::protocol::fingerprint::family_file;
use study_plan::protocol::{Axis, Protocol, SpaceRules, Vary};

/// A space of which less than this share of the points can be presented is refused.
const LEAST_SHARE: f64 = 0.25;

impl Loaded {
    /// The table that a space varies, as it is; `None` if its file cannot be read.
    pub fn start_of(&self, space: &SpaceRules) -> Option<Realization> {
        let (_, bytes) = self.files.iter().find(|(name, _)| *name == space.from)?;
        let text = std::str::from_utf8(bytes).ok()?;
        let table = study_haptics::model::file::parse(&space.from, text).0?;
        match table.units {
            Units::Linear => Some(table),
            _ => Some(table.at_lever(self.protocol.device.lever_mm?)),
        }
    }

    /// Why `study check` would refuse a table as a realization, in words after "it"; `None` if it would not, as where
    /// uncertified tables may be played.
    pub fn refusal(&self, table: &Realization) -> Option<String> {
        if self
            .protocol
            .device
            .uncertified
            .as_ref()
            .is_some_and(|u| u.play)
        {
            return None;
        }
        let certificate = table.certificate();
        if !certificate.passes() {
            return Some(format!("can put energy into a hand: {certificate}"));
        }
        let danger = safe_play::refusal(table, &safe_play::Device::default())?;
        Some(format!("is not safe to play: {danger}"))
    }
}

/// By which rule points pass. A study keeps the one with which it began, so that its journals read as they did.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Judged {
    /// The certificate, safe play, and the force over the trained range and speeds.
    Now,
    /// The certificate, safe play, and the force at rest at the nodes.
    AtNodes,
    /// The certificate, and the force at rest at the nodes.
    WithoutSafePlay,
}

impl Judged {
    /// The rules of earlier releases, the last one first.
    pub(super) const EARLIER: [Self; 2] = [Self::AtNodes, Self::WithoutSafePlay];
}

/// What becomes of a point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Point {
    Good,
    /// It can put energy into a hand: it fails its certificate, or would be refused as a realization of its own.
    Active,
    /// It needs more force than the device has.
    Strong,
}

/// The realizations of all points that can be presented, which the lattices of the protocol then have. Spaces of which
/// too few can, or which these do not connect, are reported if they are to be played, which is by the rule of now.
pub(super) fn realizations(
    protocol: &mut Protocol,
    others: &OtherFiles<'_>,
    spans: &Spans,
    data: Option<Judged>,
    findings: &mut Findings,
) -> BTreeMap<ModelId, Realization> {
    let limit_n = protocol.device.limits.force_n.get();
    let mut levels = BTreeMap::new();
    for (i, space) in protocol.spaces.iter_mut().enumerate() {
        let path = format!("spaces[{i}]");
        let place = || {
            let span = spans.get(&format!("{path}.axes"));
            span.or_else(|| spans.get(&path)).cloned()
        };
        let file = family_file(&space.id, "from");
        let Some(from) = file.and_then(|id| others.realization(&id)) else {
            continue;
        };
        let tables = match built(from, &space.axes) {
            Ok(tables) => tables,
            Err(why) => {
                let fault = Fault::error(why.to_string());
                findings.faults.push(fault.at(place()));
                continue;
            }
        };
        let rule = data.unwrap_or(Judged::Now);
        let points = tables.iter().map(|table| judged(table, limit_n, rule));
        let points: Vec<Point> = points.collect();
        let full = space.lattice.clone();
        // Of a space with fewer than two good points the lattice stays; it is refused below.
        let _ = space.certify(|at| points[full.point(at)] == Point::Good);
        if data.is_none() {
            let fault =
                refused(space, &points, limit_n).or_else(|| partial(space, &points, limit_n));
            findings.faults.extend(fault.map(|fault| fault.at(place())));
            for axis in idle(space, &tables) {
                let own = spans.get(&format!("{path}.axes.{}", axis.vary.as_str()));
                let fault = changes_nothing(space, axis).at(own.cloned().or_else(place));
                findings.faults.push(fault);
            }
        }
        let tables = tables.into_iter().enumerate();
        levels.extend(
            tables
                .filter(|(point, _)| points[*point] == Point::Good)
                .map(|(point, table)| (space.realization(point), table)),
        );
    }
    levels
}

/// The table of every point, in their order.
fn built(from: &Realization, axes: &[Axis]) -> Result<Vec<Realization>, FamilyError> {
    axes.iter().try_fold(vec![from.clone()], |tables, axis| {
        let mut longer = Vec::with_capacity(tables.len() * axis.levels.levels().len());
        for table in tables {
            let vary = match axis.vary {
                // No axis: the reader has none.
                Vary::Blend => return Err(FamilyError::Elements),
                Vary::Damping => family::Vary::Damping,
                Vary::Mass => family::Vary::Mass,
                Vary::Detent => family::Vary::Elastic,
                Vary::Friction => family::Vary::Friction,
            };
            let family = Family::of_points(table, vary)?;
            longer.extend(axis.levels.levels().iter().map(|level| family.at(*level)));
        }
        Ok(longer)
    })
}

fn judged(table: &Realization, limit_n: f64, rule: Judged) -> Point {
    let is_unsafe = || {
        let judged = rule != Judged::WithoutSafePlay;
        judged && safe_play::refusal(table, &safe_play::Device::default()).is_some()
    };
    let strongest_n = || match rule {
        Judged::Now => table.strongest_n(),
        Judged::AtNodes | Judged::WithoutSafePlay => strongest_at_rest_n(table),
    };
    if !table.certificate().passes() || is_unsafe() {
        Point::Active
    } else if strongest_n() > limit_n {
        Point::Strong
    } else {
        Point::Good
    }
}

/// The fault of a space in which there is nothing to search.
fn refused(space: &SpaceRules, points: &[Point], limit_n: f64) -> Option<Fault> {
    let id = &space.id;
    let (all, good) = (points.len(), count(points, Point::Good));
    if good < 2 || (good as f64) < LEAST_SHARE * all as f64 {
        let only = if good == 0 { "none" } else { "only a few" };
        let what = format!(
            "{only} of the {all} points of the space `{id}` can be presented: {good}; {}",
            why(points, limit_n)
        );
        return Some(
            Fault::error(what).hint(format!("take smaller ranges: {}", map(space, points))),
        );
    }
    let groups = space.lattice.groups();
    (groups.len() > 1).then(|| {
        let sizes: Vec<String> = groups.iter().map(|g| g.len().to_string()).collect();
        let what = format!(
            "the points of the space `{id}` that can be presented are in {} groups that no step along an axis joins: {}",
            groups.len(),
            sizes.join(", ")
        );
        Fault::error(what).hint(format!("take ranges around one of them: {}", map(space, points)))
    })
}

/// The warning of a space of which some points are left out.
fn partial(space: &SpaceRules, points: &[Point], limit_n: f64) -> Option<Fault> {
    let (all, good) = (points.len(), count(points, Point::Good));
    (good < all).then(|| {
        let what = format!(
            "{} of the {all} points of the space `{}` are never presented: {}",
            all - good,
            space.id,
            why(points, limit_n)
        );
        Fault::warning(what).hint(map(space, points))
    })
}

/// The axes of which all levels have the same table, whatever the others are.
fn idle<'a>(space: &'a SpaceRules, tables: &[Realization]) -> Vec<&'a Axis> {
    let lattice = &space.lattice;
    let same = |axis: usize| {
        tables.iter().enumerate().all(|(point, table)| {
            let mut at = lattice.at(point);
            at[axis] = 0;
            table.is_alike(&tables[lattice.point(&at)])
        })
    };
    let axes = space.axes.iter().enumerate();
    axes.filter(|(axis, _)| same(*axis))
        .map(|(_, axis)| axis)
        .collect()
}

/// The warning of an axis that nobody can feel.
fn changes_nothing(space: &SpaceRules, axis: &Axis) -> Fault {
    let what = format!(
        "the axis `{}` of the space `{}` changes nothing: all of its levels have the same table",
        axis.vary.as_str(),
        space.id
    );
    let has_none = match axis.vary {
        Vary::Damping => "its table has no damping",
        Vary::Mass => "its table has no mass",
        _ => "its table has nothing that it would change",
    };
    Fault::warning(what).hint(format!("take it out: {has_none}"))
}

fn count(points: &[Point], which: Point) -> usize {
    points.iter().filter(|point| **point == which).count()
}

fn why(points: &[Point], limit_n: f64) -> String {
    let (active, strong) = (count(points, Point::Active), count(points, Point::Strong));
    let mut reasons = Vec::new();
    if active > 0 {
        reasons.push(format!("{active} can put energy into a hand"));
    }
    if strong > 0 {
        reasons.push(format!(
            "{strong} need more than {limit_n} N, at rest or up to their trained speed"
        ));
    }
    reasons.join(", ")
}

/// The first two axes as rows of signs: whether all points, some or none there can be presented.
fn map(space: &SpaceRules, points: &[Point]) -> String {
    let steps = space.lattice.steps();
    let (rows, columns) = (steps[0], steps.get(1).copied().unwrap_or(1));
    let sign = |row: usize, column: usize| {
        let here = points.iter().enumerate().filter(|(point, _)| {
            let at = space.lattice.at(*point);
            at[0] == row && at.get(1).copied().unwrap_or(0) == column
        });
        let good: Vec<bool> = here.map(|(_, point)| *point == Point::Good).collect();
        match (good.iter().all(|g| *g), good.contains(&true)) {
            (true, _) => '#',
            (false, true) => '+',
            (false, false) => '.',
        }
    };
    let lines: Vec<String> = (0..rows)
        .map(|row| (0..columns).map(|column| sign(row, column)).collect())
        .collect();
    let name = |axis: usize| {
        let axis = space.axes.get(axis)?;
        let (first, last) = (axis.levels.first(), axis.levels.last());
        Some(format!("{} {first} to {last}", axis.vary.as_str()))
    };
    let across = name(1).map_or_else(String::new, |name| format!(", {name} within a row"));
    format!(
        "{}{across} (# all, + some, . none): {}",
        name(0).map_or_else(String::new, |name| format!("rows from {name}")),
        lines.join(" ")
    )
}

#[cfg(test)]
mod tests {
    use super::Judged;
    use crate::load::{Purpose, load_begun, load_frozen, open};
    use std::fs;

    /// The detents and the friction of a mechanism are searched as those of a table.
    #[test]
    fn a_mechanism_is_varied_point_by_point() {
        let folder = tempfile::tempdir().unwrap();
        let repository = concat!(env!("CARGO_MANIFEST_DIR"), "/../../");
        fs::create_dir(folder.path().join("models")).unwrap();
        let file = "models/mechanism.toml";
        let from = format!("{repository}protocols/turn-signal-passive/{file}");
        fs::copy(from, folder.path().join(file)).unwrap();
        let text = fs::read_to_string(format!("{repository}src/cli/new/search.toml")).unwrap();
        let axes = "detent = [0.4, 1.2], friction = [0.0, 1.6]";
        assert!(text.contains(axes));
        let text = text
            .replace(axes, "detent = [0.8, 1.0], friction = [0.0, 0.2]")
            .replace("models/static.toml", file)
            .replace("grid = 9", "grid = 3");
        let path = folder.path().join("protocol.toml");
        fs::write(&path, text).unwrap();
        let loaded = load_frozen(&path).unwrap();
        let space = &loaded.protocol.spaces[0];
        let start = loaded.start_of(space).unwrap();
        // Of detent 0.8, 0.9, 1 and friction 0, 0.1, 0.2: the last detent without friction.
        let same = &loaded.levels[&space.realization(6)];
        assert!(same.is_alike(&start));
        let before = start.mechanism.as_ref().unwrap();
        assert!(space.lattice.certified().len() >= 3);
        for point in space.lattice.certified() {
            let table = &loaded.levels[&space.realization(*point)];
            let levels = space.levels(*point);
            let varied = table.mechanism.as_ref().unwrap();
            let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a}, {b}");
            near(varied.detent.n[7], levels[0] * before.detent.n[7]);
            near(varied.friction.n[7], levels[1] + before.friction.n[7]);
            assert_eq!(varied.scalars.handle_kg, before.scalars.handle_kg);
        }
    }

    /// With damping, the strongest points of the template need more than 12 N in motion, and none does at rest.
    #[test]
    fn a_study_that_has_begun_keeps_its_points() {
        let folder = tempfile::tempdir().unwrap();
        let repository = concat!(env!("CARGO_MANIFEST_DIR"), "/../../");
        let read = |path: &str| fs::read_to_string(format!("{repository}{path}")).unwrap();
        let table = read("protocols/turn-signal-extended/models/static.toml");
        let mut damped = String::new();
        for (i, piece) in table.split("b_n_s_per_mm = [").enumerate() {
            let (values, rest) = piece.split_at(if i == 0 { 0 } else { piece.find(']').unwrap() });
            let key = if i == 0 { "" } else { "b_n_s_per_mm = [" };
            damped += &format!("{key}{}{rest}", values.replace("0.0", "0.03"));
        }
        fs::create_dir(folder.path().join("models")).unwrap();
        fs::write(folder.path().join("models/static.toml"), damped).unwrap();
        let path = folder.path().join("protocol.toml");
        fs::write(&path, read("src/cli/new/search.toml")).unwrap();
        let of = |loaded: &crate::load::Loaded| loaded.protocol.spaces[0].lattice.certified().len();
        let now = load_frozen(&path).unwrap();
        let before = open(&path, Purpose::Data(Judged::AtNodes)).0.unwrap();
        assert_eq!(of(&before), 81);
        assert!(of(&now) < 81, "{}", of(&now));
        assert_ne!(now.fingerprints, before.fingerprints);
        for begun in [now, before] {
            let again = load_begun(&path, &begun.fingerprints).unwrap();
            assert_eq!(of(&again), of(&begun));
            assert_eq!(again.fingerprints, begun.fingerprints);
        }
    }
}
