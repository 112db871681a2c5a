//! Record the simulated turn-signal switch, identify a realization from the recording,
//! and validate it on another trajectory.

#![allow(clippy::print_stdout, reason = "an example prints its results")]

use std::error::Error;
use study_haptics::identify::resample::Resample;
use study_haptics::identify::signal::{Acceleration, Settings, prepare};
use study_haptics::identify::{Ewls, Method, Training, vaf};
use study_haptics::plant::{Parameters, Probe};
use study_haptics::recording::{self, Columns, Recording};
use study_haptics::trajectory;
use study_wire::predict::Lookup;

const TRAINING: &str = r#"{ kind = "sine", amplitude_mm = 12, frequency_hz = 0.5 },
    { kind = "sweep", shape = "triangular", amplitude_mm = 4, from_hz = 1, to_hz = 4, period_s = 20 }"#;
const VALIDATION: &str = r#"{ kind = "sine", amplitude_mm = 15, frequency_hz = 1.5 }"#;

/// Records a trajectory with these parts on switch A at 1 kHz, and filters at 30 Hz.
fn record(name: &str, parts: &str, seed: u64) -> Result<Recording, Box<dyn Error>> {
    let text = format!(
        "format = \"study-trajectory/1\"\noffset_mm = 17.5\nduration_s = 20\nramp_s = 0.5\nparts = [{parts}]"
    );
    let (trajectory, _) = trajectory::file::parse(name, &text);
    let trajectory = trajectory.ok_or("invalid trajectory")?;
    let signals = Probe::default().record(&trajectory, &Parameters::a(), 1000.0, seed)?;
    let columns = Columns {
        t_s: &signals.t_s,
        x_mm: &signals.x_mm,
        v_mm_s: None,
        a_m_s2: &signals.a_m_s2,
        f_n: &signals.f_n,
    };
    let mut csv = Vec::new();
    recording::write(&mut csv, "simulated, not measured", columns)?;
    let settings = Settings {
        filter_hz: Some(30.0),
        acceleration: Acceleration::Accelerometer,
    };
    Ok(prepare(recording::read(name, &csv[..])?, settings)?)
}

fn main() -> Result<(), Box<dyn Error>> {
    let training = record("training", TRAINING, 1)?;
    let validation = record("validation", VALIDATION, 2)?;
    let method = Method::Ewls(Ewls::paper(0.997, Resample::Point));
    let identified = Training::new(&training)?.identify(method, 0.5, Lookup::Linear)?;
    let realization = identified.realization;
    println!("VAF {:.4}", vaf::score(&realization, &validation).vaf);
    println!("passivity certificate: {}", realization.certificate());
    Ok(())
}
