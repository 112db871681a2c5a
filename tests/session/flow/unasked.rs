//! A device that plays unasked.

use super::device::{failures, in_phase, screen};
use super::part_rig::pairs;
use super::rig::{DeviceMood, Rig};
use super::studies::plain;
use study_session::outcome::Failure;
use study_session::session::{Effect, Input};

#[test]
fn a_device_that_plays_unasked_is_made_limp_on_every_page() {
    for phase in ["Reference", "Loading", "Gap", "Stopping", "Stopped", "Form"] {
        let mut rig = match phase {
            "Loading" | "Stopping" => in_phase(phase),
            "Gap" => {
                let mut protocol = pairs("");
                protocol.parts[0].gap_s = 1.0;
                let mut rig = Rig::new(protocol);
                rig.until("Playing").send(Input::Advance);
                rig
            }
            "Stopped" => {
                let mut rig = Rig::new(plain());
                rig.until("Playing").send(Input::Stop);
                rig
            }
            _ => {
                let mut rig = Rig::new(plain());
                rig.until(phase);
                rig
            }
        };
        rig.device = DeviceMood::Silent;
        rig.effects.clear();
        let before = rig.journal.len();
        rig.send(Input::DeviceStarted);
        assert!(rig.effects.contains(&Effect::Limp), "{phase}");
        assert!(
            !rig.effects.contains(&Effect::Start) && screen(&rig) != "Playing",
            "{phase}: {:?}",
            rig.effects
        );
        // what was to be played is lost and comes again; elsewhere nothing has happened
        let lost = ["Loading", "Gap"].contains(&phase);
        let failed = [(1, 1, Failure::DeviceFault)];
        assert_eq!(failures(&rig), failed[usize::from(!lost)..], "{phase}");
        assert_eq!(rig.journal.len() > before, lost, "{phase}");
    }
}
