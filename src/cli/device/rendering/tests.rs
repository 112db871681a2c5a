//! The check of simulated devices, right and wrong.

use super::*;
use study_device::Identity;
use study_device::firmware::{Wrong, WrongLoads};
use study_device::virtual_device::{Options, VirtualDevice};

fn checked(wrong: Option<Wrong>) -> Vec<Rendered> {
    let mut options = Options::seeded(5);
    options.device.wrong = wrong.map(|wrong| WrongLoads {
        wrong,
        loads: [1, u32::MAX],
    });
    let mut device = VirtualDevice::new(options);
    let pace = Pace::Virtual(Duration::ZERO);
    check(&mut device, 17.5, pace, &mut |_| Ok(())).unwrap()
}

fn failed(all: &[Rendered]) -> Vec<&str> {
    let failed = all.iter().filter(|r| r.result == "fail");
    failed.map(|r| r.what.as_str()).collect()
}

#[test]
fn the_right_device_passes_every_line() {
    let all = checked(None);
    let open: Vec<_> = all.iter().filter(|r| r.result != "pass").collect();
    assert!(open.is_empty(), "{open:?}");
    assert_eq!(tally(&all), [15, 0, 0]);
}

/// A device that tells no constants, as a controller program.
struct Program {
    device: VirtualDevice,
    /// It counts so many strokes for each.
    strokes: u32,
    tells: bool,
}

impl Device for Program {
    fn identity(&self) -> Identity {
        Identity {
            servo: self.device.identity().servo.filter(|_| self.tells),
            firmware: None,
            ..self.device.identity()
        }
    }

    fn load(
        &mut self,
        what: &Stimulus<'_>,
        limits: Limits,
        at: Duration,
    ) -> Result<(), DeviceError> {
        self.device.load(what, limits, at)
    }

    fn start(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.device.start(at)
    }

    fn stop(&mut self, at: Duration) -> Result<(), DeviceError> {
        self.device.stop(at)
    }

    fn limp(&mut self, at: Duration) {
        self.device.limp(at);
    }

    fn poll(&mut self, at: Duration) -> Vec<Report> {
        let mut reports = self.device.poll(at);
        for report in &mut reports {
            if let Report::Stopped(playback) = report {
                playback.strokes *= self.strokes;
            }
        }
        reports
    }
}

/// A program with the usual constants passes; of another force nothing is known, as in a session.
#[test]
fn a_program_that_tells_no_constants_is_judged_by_the_usual_ones() {
    for wrong in [None, Some("half-force")] {
        let mut options = Options::seeded(5);
        options.device.wrong = wrong.map(|name| WrongLoads {
            wrong: Wrong::named(name).unwrap(),
            loads: [1, u32::MAX],
        });
        // the constants of a device that tells none
        options.device.least_mass_kg = 0.0;
        let mut device = Program {
            device: VirtualDevice::new(options),
            strokes: 1,
            tells: false,
        };
        let pace = Pace::Virtual(Duration::ZERO);
        let all = check(&mut device, 17.5, pace, &mut |_| Ok(())).unwrap();
        assert_eq!(all.len(), 14);
        let [passes, fails, _] = tally(&all);
        match wrong {
            None => assert_eq!(passes, 14, "{all:#?}"),
            // the trip is right; other constants might explain the rest
            Some(_) => {
                assert_eq!([passes, fails], [1, 0], "{all:#?}");
                assert!(all[0].seen.contains("constants"), "{all:#?}");
            }
        }
    }
}

/// `minimum_strokes` of a protocol would be reached with a third of them.
#[test]
fn a_device_that_counts_too_many_strokes_fails() {
    let mut device = Program {
        device: VirtualDevice::new(Options::seeded(5)),
        strokes: 3,
        tells: true,
    };
    let pace = Pace::Virtual(Duration::ZERO);
    let all = check(&mut device, 17.5, pace, &mut |_| Ok(())).unwrap();
    let [passed, failed, _] = tally(&all);
    assert_eq!([passed, failed], [2, 13], "{all:#?}");
    assert!(all[0].seen.contains("full strokes"), "{all:#?}");
}

/// A wrong device fails in the line that names what is wrong.
#[test]
fn a_wrong_device_fails_where_it_is_wrong() {
    for (wrong, where_) in [
        ("no-mass", "mass alone"),
        ("no-damping", "damping alone"),
        ("no-stiffness", "stiffness alone"),
        ("half-force", "offset alone"),
        ("floor", "all terms, look-up linear, direction sign"),
        ("dahl-rule", "all terms, look-up linear, direction sign"),
        ("late", "stiffness alone"),
    ] {
        let all = checked(Wrong::named(wrong));
        let failed = failed(&all);
        assert!(failed.contains(&where_), "{wrong}: {failed:?} {all:#?}");
    }
    // What is ignored is not missed where it is not asked for.
    let all = checked(Wrong::named("no-mass"));
    assert!(!failed(&all).contains(&"stiffness alone"), "{all:#?}");
}
