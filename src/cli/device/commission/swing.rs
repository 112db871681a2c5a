//! The motor weighs itself: the free handle swings on weak springs.

use super::rig::{Rig, Stop};
use super::steps::by_hand;
use super::{Bench, Made, failed, judged, left_out};
use study_device::commission::{
    LONGEST_LAG_S, NoSelfWeighing, SWINGS, SelfWeighing, SwingNumbers, SwingPlan, SwingSpring,
};
use study_session::outcome::Sample;

/// The mass from which the search begins where the device does not tell one, kg.
const FIRST_KG: f64 = 0.3;
/// The mass of the plan is right if the one that is found is within this factor.
const NEAR: f64 = 1.25;
/// How often the swings are begun, with a plan that is made anew or for another reason.
const PLANS: usize = 6;
/// Largest lag of a motor, s.
const LAG_S: f64 = 0.01;

/// What came of the swings.
pub(super) enum Swung {
    /// The motor weighed itself.
    Weighed(SelfWeighing),
    /// It cannot, or something touched the handle.
    Not(NoSelfWeighing),
    /// The device gave up.
    Trouble(String),
}

impl Swung {
    /// Of what ended the swings: a handle that was moved is asked for again.
    fn of(why: String) -> Self {
        match by_hand(&why) {
            true => Self::Not(NoSelfWeighing::Moved(why)),
            false => Self::Trouble(why),
        }
    }
}

/// All swings of a plan, one after the other; the handle is free.
pub(super) fn swing(rig: &mut Rig<'_>, plan: SwingPlan, stroke_mm: [f64; 2]) -> Swung {
    let mut swings: Vec<(SwingSpring, Vec<Sample>)> = Vec::new();
    for nth in 0..SWINGS {
        let at_mm = match rig.position_mm(Some(stroke_mm)) {
            Ok(at_mm) => at_mm,
            Err(why) => return Swung::of(why),
        };
        let spring = match plan.spring(nth, at_mm, stroke_mm, rig.limits) {
            Ok(spring) => spring,
            Err(why) => return Swung::Not(why),
        };
        match rig.swing(&spring) {
            Ok(samples) => swings.push((spring, samples)),
            Err(why) => return Swung::of(why),
        }
    }
    match SelfWeighing::of(&swings, rig.servo()) {
        Ok(found) => Swung::Weighed(found),
        Err(why) => Swung::Not(why),
    }
}

/// The step of a commissioning.
pub(super) fn step(rig: &mut Rig<'_>, bench: &mut Bench) -> Result<Made, Stop> {
    let what = "self-weighing";
    let required = &format!(
        "the lag of the force is below {:.0} ms; a handle with too much friction has none",
        1e3 * LAG_S
    );
    let Some(stroke_mm) = bench.numbers.stroke_mm else {
        let why = "the stops are not known".to_owned();
        return Ok(left_out(what, required).seen(why));
    };
    if let Some(why) = bench.bar() {
        return Ok(left_out(what, required).seen(format!("not done, because {why}")));
    }
    let friction_n = bench.numbers.friction_n.unwrap_or(0.0);
    let guess_kg = rig.told_mass_kg().unwrap_or(FIRST_KG);
    let mut plan = SwingPlan::first(guess_kg, friction_n, stroke_mm);
    rig.say("\nSelf-weighing. The free handle swings on weak springs, by itself, and its apparent mass is found.")?;
    let mut last = "it was heavier or lighter each time".to_owned();
    let mut again = String::new();
    for _ in 0..PLANS {
        if !rig.may_go(&format!(
            "{again}The handle will move by itself, {SWINGS} times, by about 10 mm to each side. Let it go, and take \
             away everything that hangs at it."
        ))? {
            return Ok(left_out(what, required));
        }
        let found = match swing(rig, plan, stroke_mm) {
            Swung::Weighed(found) => found,
            Swung::Not(why @ NoSelfWeighing::Friction { .. }) => {
                return Ok(judged(what, required, true, format!("not possible: {why}")));
            }
            Swung::Not(why) => {
                last = why.to_string();
                again = format!("{last}. Once more: ");
                continue;
            }
            Swung::Trouble(why) => return Ok(failed(what, required, why)),
        };
        rig.ended()?;
        let ratio = found.apparent_kg / plan.mass_kg;
        if !(1.0 / NEAR..=NEAR).contains(&ratio) {
            plan.mass_kg = found.apparent_kg;
            again = format!(
                "About {:.2} kg; the springs are chosen for it. Once more: ",
                found.apparent_kg
            );
            continue;
        }
        bench.numbers.swing = Some(SwingNumbers { plan, found });
        return Ok(judged(
            what,
            required,
            found.lag_s < LAG_S.min(LONGEST_LAG_S),
            format!(
                "apparent mass {:.3} kg, damping {:.4} N·s/mm, friction {:.2} N, lag {:.1} ms",
                found.apparent_kg,
                found.damping_n_s_per_mm,
                found.friction_n,
                1e3 * found.lag_s
            ),
        ));
    }
    let why = format!("no swing told a mass: {last}");
    Ok(failed(what, required, why))
}
