//! What a device makes of each table of a study, against the table.
//!
//! Somebody strokes the handle while the device plays. Position and force go through
//! the filter that recordings go through, speed and acceleration are differences of
//! the position: so a playback is compared as a recording is, and the VAF of what
//! was rendered can stand beside the one that the table was identified with.

use crate::cli::playback::Port;
use crate::cli::{Console, Failure, Kind, load};
use crate::device::host::Settings;
use crate::device::link::Threaded;
use crate::device::{Device, Report, Stimulus};
use crate::runner::playback_limits;
use serde::Serialize;
use std::path::Path;
use std::time::{Duration, Instant};
use study_base::limits::Limits;
use study_core::outcome::Sample;
use study_core::protocol::DeviceKind;
use study_haptics::identify::signal::{LowPass, difference};
use study_haptics::identify::vaf::{self, Score};
use study_haptics::model::Realization;
use study_haptics::recording::{self, Columns};

/// How long each is stroked.
const STROKED: Duration = Duration::from_secs(8);
/// The force comes up, and the filter's beginning is not compared, s.
const LEFT_OUT_S: f64 = 0.6;
/// That of the recordings of the documentation, Hz.
const FILTER_HZ: f64 = 30.0;
/// How long a load, a start or a stop may take.
const ANSWER_WITHIN: Duration = Duration::from_secs(10);

/// What was rendered of one table.
#[derive(Debug, Clone, Serialize)]
pub(super) struct Rendered {
    model: String,
    /// Against the table, of the force that was measured, or else commanded.
    vaf: f64,
    bias_n: f64,
    residual_n: f64,
    /// What the table was identified with, if the study says so.
    identified_vaf: Option<f64>,
    measured: bool,
    strokes: u32,
    clamps: u64,
}

/// Plays each table of a study.
pub(super) fn look(
    protocol: &Path,
    port: &Port,
    console: &mut Console,
    json: bool,
) -> Result<Vec<Rendered>, Failure> {
    let loaded = load::load(protocol)?;
    let mut device = port.open_serial(Settings::default())?;
    let mut all = Vec::new();
    if !json {
        console.say(format!(
            "stroke the handle from end to end, {} s for each table",
            STROKED.as_secs()
        ));
        console.out("rendered        VAF   bias N   residual N   identified VAF\n")?;
    }
    for entry in &loaded.protocol.models {
        let Some(table) = loaded.models.get(&entry.id) else {
            continue;
        };
        if entry.duplicate_of.is_some() || entry.device == Some(DeviceKind::Manual) {
            continue;
        }
        let limits = playback_limits(&loaded.protocol, Some(table));
        let permitted = loaded.protocol.device.uncertified.as_ref();
        let played = play(
            &mut device,
            table,
            permitted.is_some_and(|u| u.play),
            limits,
        );
        let (samples, strokes, clamps) = played.map_err(|why| {
            Failure::new(Kind::Device, format!("{}: {why}", entry.id))
                .hint("hold the handle; the tables before it are above")
        })?;
        let (score, measured) = compare(table, &samples)
            .map_err(|why| Failure::new(Kind::Device, format!("{}: {why}", entry.id)))?;
        let rendered = Rendered {
            model: entry.id.to_string(),
            vaf: score.vaf,
            bias_n: score.bias_n,
            residual_n: score.residual_n,
            identified_vaf: entry.vaf,
            measured,
            strokes,
            clamps,
        };
        if !json {
            let identified = entry.vaf.map_or("–".to_owned(), |vaf| format!("{vaf:.3}"));
            console.out(format!(
                "{:<14} {:>5.3}   {:>6.3}   {:>10.3}   {identified}\n",
                entry.id, score.vaf, score.bias_n, score.residual_n
            ))?;
        }
        all.push(rendered);
    }
    if !json && all.iter().all(|r| !r.measured) {
        console.say("no force sensor: this is what was commanded, not what the hand felt");
    }
    Ok(all)
}

/// The samples of a playback, strokes and clamps.
fn play(
    device: &mut Threaded,
    table: &Realization,
    permitted: bool,
    limits: Limits,
) -> Result<(Vec<Sample>, u32, u64), String> {
    let start = Instant::now();
    let stimulus = Stimulus {
        permitted,
        ..Stimulus::of_table(table)
    };
    let at = || start.elapsed();
    let told = |e: crate::device::DeviceError| e.to_string();
    device.load(&stimulus, limits, at()).map_err(told)?;
    let mut samples = Vec::new();
    let mut stop_at = None;
    let mut due = ANSWER_WITHIN;
    loop {
        for report in device.poll(at()) {
            match report {
                Report::Loaded => device.start(at()).map_err(told)?,
                Report::Started => {
                    stop_at = Some(at() + STROKED);
                    due = at() + STROKED + ANSWER_WITHIN;
                }
                Report::Telemetry(more) => samples.extend(more),
                Report::Stopped(playback) => {
                    return Ok((samples, playback.strokes, playback.clamp_count));
                }
                Report::Fault(why) | Report::Lost(why) => return Err(why),
                Report::Mount(_) | Report::Progress { .. } | Report::Ready => {}
            }
        }
        if stop_at.take_if(|stop_at| at() >= *stop_at).is_some() {
            device.stop(at()).map_err(told)?;
        }
        if at() > due {
            return Err("it does not answer in time".to_owned());
        }
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The playback as a recording, and how much of it the table predicts.
fn compare(table: &Realization, samples: &[Sample]) -> Result<(Score, bool), String> {
    let (Some(first), Some(last)) = (samples.first(), samples.last()) else {
        return Err("it sent no telemetry".to_owned());
    };
    let period_s = (last.t_s - first.t_s) / (samples.len().max(2) - 1) as f64;
    if !(period_s > 0.0 && samples.len() > 2000) {
        return Err(format!("{} samples are too few", samples.len()));
    }
    let measured = samples.iter().all(|s| s.force_measured_n.is_some());
    let filter = LowPass::new(FILTER_HZ, 1.0 / period_s).map_err(|e| e.to_string())?;
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
    let from = t_s.partition_point(|t| *t < LEFT_OUT_S);
    let to = samples.len().saturating_sub(100);
    if from >= to {
        return Err("it ended before the force was up".to_owned());
    }
    let columns = Columns {
        t_s: &t_s[from..to],
        x_mm: &x_mm[from..to],
        v_mm_s: Some(&v_mm_s[from..to]),
        a_m_s2: &a_m_s2[from..to],
        f_n: &f_n[from..to],
    };
    let mut bytes = Vec::new();
    recording::write(&mut bytes, "rendered\n", columns).map_err(|e| e.to_string())?;
    let recording = recording::read("the playback", bytes.as_slice()).map_err(|e| e.to_string())?;
    Ok((vaf::score(table, &recording), measured))
}
