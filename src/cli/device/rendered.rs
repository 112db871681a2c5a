//! Comparison of the rendered force with each table of a study.
//!
//! Somebody strokes the handle while the device plays. Position and force are filtered
//! like recordings, and speed and acceleration are differences of the position. The
//! VAF of the rendered force is therefore comparable with that of the identification.

use super::single_playback::{self, Pace};
use crate::cli::device_selection::SerialPortArgs;
use crate::cli::{Console, Failure};
use crate::runner::playback_limits;
use serde::Serialize;
use std::path::Path;
use std::time::Duration;
use study_analysis::load::{self, Loaded};
use study_device::host::HostSettings;
use study_device::{Device, Report, Stimulus};
use study_haptics::identify::signal::{LowPass, difference};
use study_haptics::identify::vaf::{self, Score};
use study_haptics::model::Realization;
use study_haptics::recording::{self, Columns};
use study_plan::protocol::DeviceKind;
use study_session::outcome::{Sample, Verdict};

/// Duration of each playback.
const PLAYBACK: Duration = Duration::from_secs(8);
/// The ramp and the start of the filter are not compared, s.
const SKIPPED_S: f64 = 0.6;
/// Corner frequency of the filter, as for the recordings in the documentation, Hz.
const FILTER_HZ: f64 = 30.0;
/// Samples needed for a comparison.
const MIN_SAMPLES: usize = 2001;

/// Why a table could not be compared.
#[derive(Debug, thiserror::Error)]
enum CompareError {
    #[error("it sent {0} samples; at least {MIN_SAMPLES} are needed")]
    TooFewSamples(usize),
    #[error("the playback ended before the force had risen")]
    TooShort,
    #[error("the samples cannot be filtered or compared: {0}")]
    Signal(String),
}

/// Comparison of one table.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Rendered {
    model: String,
    /// VAF of the table for the measured force, or for the commanded one without a sensor.
    vaf: f64,
    bias_n: f64,
    residual_n: f64,
    /// VAF in the study's protocol or model file.
    identified_vaf: Option<f64>,
    measured: bool,
    strokes: u32,
    clamps: u64,
    /// Whether the force was that of the table, as in a session.
    rendering: Verdict,
}

impl Rendered {
    /// Whether the force was shown to be right.
    pub(super) fn is_right(&self) -> bool {
        self.rendering == Verdict::Ok
    }

    /// For the terminal.
    fn line(&self) -> String {
        let identified = (self.identified_vaf).map_or("–".to_owned(), |vaf| format!("{vaf:.3}"));
        format!(
            "{:<14} {:>5.3}   {:>6.3}   {:>10.3}   {identified:>14}   {}\n",
            self.model,
            self.vaf,
            self.bias_n,
            self.residual_n,
            self.rendering.as_str()
        )
    }
}

/// Plays and compares each table of a study.
pub(super) fn compare_all(
    protocol: &Path,
    port: &SerialPortArgs,
    console: &mut Console,
    json: bool,
) -> Result<Vec<Rendered>, Failure> {
    let loaded = load::load(protocol)?;
    let mut device = port.open_serial(HostSettings::default())?;
    if !json {
        console.say(format!(
            "move the handle from end to end, {} s for each table",
            PLAYBACK.as_secs()
        ));
        console.out("rendered        VAF   bias N   residual N   identified VAF   verdict\n")?;
    }
    let all = compare_each(
        &loaded,
        &mut device,
        Pace::real(),
        &mut |rendered| match json {
            true => Ok(()),
            false => console.out(rendered.line()),
        },
    )?;
    if !json && all.iter().all(|r| !r.measured) {
        console.say("no force sensor: the values are for the commanded force");
    }
    Ok(all)
}

/// `report` receives each comparison at once.
fn compare_each(
    loaded: &Loaded,
    device: &mut dyn Device,
    mut pace: Pace,
    report: &mut dyn FnMut(&Rendered) -> Result<(), Failure>,
) -> Result<Vec<Rendered>, Failure> {
    let mut all = Vec::new();
    for entry in &loaded.protocol.models {
        let Some(table) = loaded.models.get(&entry.id) else {
            continue;
        };
        if entry.duplicate_of.is_some() || entry.device == Some(DeviceKind::Manual) {
            continue;
        }
        let limits = playback_limits(&loaded.protocol, Some(table));
        let uncertified = loaded.protocol.device.uncertified.as_ref();
        let allow_uncertified = uncertified.is_some_and(|u| u.play);
        let stimulus = Stimulus {
            allow_uncertified,
            ..Stimulus::of_table(table)
        };
        let mut samples = Vec::new();
        let mut collect = |reports: &[Report]| {
            for report in reports {
                if let Report::Telemetry(more) = report {
                    samples.extend_from_slice(more);
                }
            }
        };
        let playback =
            single_playback::play(device, &stimulus, limits, PLAYBACK, &mut pace, &mut collect);
        let playback = playback.map_err(|e| {
            Failure::device(format!("{}: {e}", entry.id))
                .hint("hold the handle during the playback")
        })?;
        let (score, measured) =
            compare(table, &samples).map_err(|e| Failure::device(format!("{}: {e}", entry.id)))?;
        let rendered = Rendered {
            model: entry.id.to_string(),
            vaf: score.vaf,
            bias_n: score.bias_n,
            residual_n: score.residual_n,
            identified_vaf: entry.vaf,
            measured,
            strokes: playback.strokes,
            clamps: playback.clamp_count,
            rendering: super::rendering::fidelity(device, table, limits, &samples, &playback)?
                .verdict,
        };
        report(&rendered)?;
        all.push(rendered);
    }
    Ok(all)
}

/// Compares the playback with the table like a recording. Also returns whether the force
/// was measured.
fn compare(table: &Realization, samples: &[Sample]) -> Result<(Score, bool), CompareError> {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Err(CompareError::TooFewSamples(0));
    };
    let period_s = (last.t_s - first.t_s) / (samples.len().max(2) - 1) as f64;
    if !(period_s > 0.0 && samples.len() >= MIN_SAMPLES) {
        return Err(CompareError::TooFewSamples(samples.len()));
    }
    let signal = |e: &dyn std::fmt::Display| CompareError::Signal(e.to_string());
    let measured = samples.iter().all(|s| s.force_measured_n.is_some());
    let filter = LowPass::new(FILTER_HZ, 1.0 / period_s).map_err(|e| signal(&e))?;
    let column = |of: fn(&Sample) -> f64| -> Vec<f64> {
        filter.zero_phase(&samples.iter().map(of).collect::<Vec<f64>>())
    };
    let x_mm = column(|s| s.x_mm);
    let f_n = column(|s| s.force_measured_n.unwrap_or(s.force_command_n));
    let v_mm_s = difference(&x_mm, period_s);
    let a_m_s2: Vec<f64> = difference(&v_mm_s, period_s)
        .iter()
        .map(|a| a * 1e-3)
        .collect();
    let t_s: Vec<f64> = samples.iter().map(|s| s.t_s).collect();
    let from = t_s.partition_point(|t| *t < SKIPPED_S);
    let to = samples.len().saturating_sub(100);
    if from >= to {
        return Err(CompareError::TooShort);
    }
    let columns = Columns {
        t_s: &t_s[from..to],
        x_mm: &x_mm[from..to],
        v_mm_s: Some(&v_mm_s[from..to]),
        a_m_s2: &a_m_s2[from..to],
        f_n: &f_n[from..to],
    };
    let mut bytes = Vec::new();
    recording::write(&mut bytes, "rendered\n", columns).map_err(|e| signal(&e))?;
    let recording = recording::read("the playback", bytes.as_slice()).map_err(|e| signal(&e))?;
    Ok((vaf::score(table, &recording), measured))
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_device::firmware::{Wrong, WrongLoads};
    use study_device::virtual_device::{Options, VirtualDevice};

    fn compared(wrong: Option<&str>) -> Vec<Rendered> {
        let protocol = concat!(env!("CARGO_MANIFEST_DIR"), "/protocols/turn-signal");
        let loaded = load::load(Path::new(protocol)).unwrap();
        let mut options = Options::seeded(2);
        options.device.wrong = wrong.map(|name| WrongLoads {
            wrong: Wrong::named(name).unwrap(),
            loads: [2, u32::MAX],
        });
        let mut device = VirtualDevice::new(options);
        let mut lines = Vec::new();
        let pace = Pace::Virtual(Duration::ZERO);
        let all = compare_each(&loaded, &mut device, pace, &mut |rendered| {
            lines.push(rendered.line());
            Ok(())
        });
        let all = all.unwrap();
        for (line, rendered) in lines.iter().zip(&all) {
            assert!(
                line.trim_end().ends_with(rendered.rendering.as_str()),
                "{line}"
            );
        }
        all
    }

    #[test]
    fn the_right_device_has_the_force_of_every_table() {
        let all = compared(None);
        assert_eq!(all.len(), 5);
        assert!(all.iter().all(Rendered::is_right), "{all:#?}");
        assert!(all.iter().all(|r| r.vaf > 0.8 && !r.measured), "{all:#?}");
    }

    /// From the second table on.
    #[test]
    fn a_wrong_device_is_told_from_the_right_one_in_each_table() {
        for (wrong, verdict) in [("half-force", Verdict::Flag), ("no-clamp", Verdict::Fault)] {
            let all = compared(Some(wrong));
            assert!(all[0].is_right(), "{wrong}: {all:#?}");
            let found: Vec<Verdict> = all[1..].iter().map(|r| r.rendering).collect();
            assert_eq!(found, [verdict; 4], "{wrong}: {all:#?}");
        }
    }
}
