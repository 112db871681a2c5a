//! `study record`: move the probe along a trajectory and record the response.
//!
//! With the simulated probe and target the header of the recording contains everything
//! needed to reproduce it byte for byte. [`wire`] records with a probe on a serial port.

mod wire;

use super::device_selection::SerialPortArgs;
use super::trajectory::{
    picture, rate, read_plant, read_trajectory, refuse_to_overwrite, write_file,
};
use super::{Console, Failure};
use std::fmt::Write as _;
use std::path::PathBuf;
use study_base::text::Untrusted;
use study_haptics::identify::signal::{Excitation, LowPass, delay, difference, excitation, filter};
use study_haptics::plant::{self, Measurement, Parameters, Probe, ProbeError};
use study_haptics::recording::{self, Columns};
use study_haptics::trajectory::{self, Trajectory};

/// Default corner frequency of the filter, Hz, as in the documentation.
const FILTER_HZ: f64 = 30.0;
/// Height of the chart of condition numbers, lines.
const ROWS: usize = 4;

/// Arguments of `study record`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The trajectory file, TOML with format = "study-trajectory/1"
    #[arg(value_name = "TRAJECTORY")]
    trajectory: PathBuf,

    /// Write the recording to this file [default: standard output]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Sampling rate
    #[arg(long, value_name = "HZ", default_value_t = 1000.0, value_parser = rate, allow_negative_numbers = true)]
    rate: f64,

    /// The probe: simulated (with a simulated target), or on a serial port
    #[arg(long, value_name = "KIND", value_parser = ["simulated", "serial"], default_value = "simulated")]
    device: String,
    #[command(flatten)]
    port: SerialPortArgs,
    /// Largest force of a probe on a serial port, N
    #[arg(long, value_name = "N", default_value_t = 12.0)]
    max_force: f64,

    /// Seed of the sensors' noise
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,

    /// The simulated target: a, b or a plant file
    #[arg(long, value_name = "a|b|FILE", default_value = "a")]
    plant: String,

    /// Corner frequency of the zero-phase filter on x, a and F
    #[arg(long, value_name = "HZ", default_value_t = FILTER_HZ, conflicts_with = "raw")]
    filter: f64,

    /// Write the unfiltered signals of the sensors, without velocity
    #[arg(long)]
    raw: bool,

    /// Overwrite FILE if it exists
    #[arg(long, requires = "out")]
    force: bool,
}

impl Args {
    /// The filter; `None` with `--raw`.
    fn low_pass(&self) -> Result<Option<LowPass>, Failure> {
        (!self.raw)
            .then(|| LowPass::new(self.filter, self.rate).map_err(Failure::input))
            .transpose()
    }
}

/// Records and writes the recording.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    if args.device == "serial" {
        return wire::run(args, console);
    }
    if args.port.port.is_some() || args.port.baud.is_some() {
        return Err(
            Failure::usage("--port and --baud do not apply to the simulated probe")
                .hint("--device serial records with the probe on that port"),
        );
    }
    let trajectory = read_trajectory(&args.trajectory, console)?;
    let (name, target) = read_plant(&args.plant, console)?;
    refuse_to_overwrite(args.out.as_deref(), args.force)?;
    let filter = args.low_pass()?;
    let probe = Probe::default();
    let measured = probe
        .record(&trajectory, &target, args.rate, args.seed)
        .map_err(|e| probe_failure(args, &e))?;
    let header = header(args, &trajectory, &name, &target, &probe);
    let bytes = recording_bytes(&trajectory, &measured, filter, args.rate, &header);
    finish(args, &bytes, console)
}

/// Prints a summary of the recording and writes it.
fn finish(args: &Args, bytes: &[u8], console: &mut Console) -> Result<(), Failure> {
    summary(bytes, console);
    match &args.out {
        Some(path) => {
            write_file(path, |sink| sink.write_all(bytes))?;
            console.say(format!("wrote {}", path.display()));
            Ok(())
        }
        None => console.out(String::from_utf8_lossy(bytes)),
    }
}

fn probe_failure(args: &Args, error: &ProbeError) -> Failure {
    let failure = Failure::input(format!("{}: {error}", args.trajectory.display()));
    match error {
        ProbeError::Trajectory(_) => {
            failure.hint("nothing was moved; `study trajectory` draws the trajectory")
        }
        _ => failure,
    }
}

/// The header of the recording: a description, then the trajectory and plant files.
fn header(
    args: &Args,
    trajectory: &Trajectory,
    name: &str,
    target: &Parameters,
    probe: &Probe,
) -> String {
    let trajectory_file = args.trajectory.file_name().unwrap_or_default();
    let filter = match args.raw {
        true => "--raw".to_owned(),
        false => format!("--filter {}", args.filter),
    };
    // model files keep this line as their note
    let mut out = format!(
        "simulated, not measured: study record {} --plant {name} --rate {} --seed {} {filter} (simulation {})\n",
        Untrusted(&trajectory_file.to_string_lossy()),
        args.rate,
        args.seed,
        plant::SIMULATION,
    );
    out.push_str(&filter_line(args));
    // writing to a String cannot fail
    let _ = writeln!(
        out,
        "probe: encoder {} mm, force noise {} N rms, acceleration noise {} m/s² rms; F is what it applies to the target, positive with +x",
        probe.encoder_mm, probe.force_noise_n, probe.acceleration_noise_m_s2
    );
    let [from_s, to_s] = trajectory.recorded_s();
    let _ = writeln!(out, "kept: {from_s} to {to_s} s, between the ramps");
    let _ = writeln!(
        out,
        "again: the command of the first line, with these two files as the trajectory and --plant"
    );
    out + &embedded("TRAJECTORY", &trajectory::file::write(trajectory))
        + &embedded("PLANT", &plant::file::write(target))
}

/// A file as part of the header, under its name.
fn embedded(name: &str, text: &str) -> String {
    // blank lines would be lost where trailing spaces are stripped
    let lines = text.lines().filter(|line| !line.is_empty());
    let lines: String = lines.map(|line| format!("  {line}\n")).collect();
    format!("{name}:\n{lines}")
}

/// The header line about the filter of the signals.
fn filter_line(args: &Args) -> String {
    match args.raw {
        true => "filter: none; x as the encoder counts, a and F with their noise\n".to_owned(),
        false => format!(
            "filter: {}; the same on x, a and F; v: central difference of x\n",
            filter::description(args.filter)
        ),
    }
}

/// The recording between the ramps as CSV. The ramps are filtered too, so that the
/// transients of the filter at the ends are not part of the recording.
fn recording_bytes(
    trajectory: &Trajectory,
    measured: &Measurement,
    filter: Option<LowPass>,
    rate_hz: f64,
    header: &str,
) -> Vec<u8> {
    let [x_mm, a_m_s2, f_n] = [&measured.x_mm, &measured.a_m_s2, &measured.f_n]
        .map(|column| filter.map_or_else(|| column.clone(), |f| f.zero_phase(column)));
    let v_mm_s = filter.map(|_| difference(&x_mm, 1.0 / rate_hz));
    let [from_s, to_s] = trajectory.recorded_s();
    let first = measured.t_s.partition_point(|t| *t < from_s - 1e-9);
    let last = measured.t_s.partition_point(|t| *t <= to_s + 1e-9);
    let columns = Columns {
        t_s: &measured.t_s[first..last],
        x_mm: &x_mm[first..last],
        v_mm_s: v_mm_s.as_ref().map(|v| &v[first..last]),
        a_m_s2: &a_m_s2[first..last],
        f_n: &f_n[first..last],
    };
    let mut bytes = Vec::with_capacity(64 * (last - first));
    recording::write(&mut bytes, header, columns).expect("memory takes every write");
    bytes
}

/// Prints a summary of the recording.
fn summary(bytes: &[u8], console: &mut Console) {
    let recording = match recording::read("the recording", bytes) {
        Ok(recording) => recording,
        Err(e) => {
            console.say(format!(
                "warning: the recording cannot be used for identification: {e}"
            ));
            return;
        }
    };
    for warning in &recording.warnings {
        console.say(format!("warning: {warning}"));
    }
    let [low, high] = recording.range_mm();
    console.say(format!(
        "{} samples, {:.2} s, {low:.2} to {high:.2} mm",
        recording.len(),
        recording.duration_s()
    ));
    match delay::accelerometer_s(&recording) {
        Ok(Some(late_s)) => console.say(format!(
            "delay of the accelerometer relative to the encoder: {:.3} ms",
            late_s * 1e3
        )),
        Ok(None) | Err(_) => console.say("the delay of the accelerometer cannot be determined"),
    }
    let excitation = Excitation::of(&recording);
    let Some((median, worst)) = excitation.median().zip(excitation.worst()) else {
        return;
    };
    console.say(format!(
        "condition number of [a v x 1]: median {median:.1}, worst {:.0} at {:.1} mm, above {} in {:.0} % of the windows",
        worst.condition,
        worst.x_mm,
        excitation::ILL_CONDITIONED,
        100.0 * excitation.ill_conditioned_share()
    ));
    for line in excitation_picture(&excitation).lines() {
        console.say(line);
    }
    if let Some(warning) = excitation.warning() {
        console.say(format!("warning: {warning}"));
    }
}

/// A bar chart of the condition number over x, the larger one of both directions.
fn excitation_picture(excitation: &Excitation) -> String {
    let (Some(first), Some(last)) = (excitation.windows.first(), excitation.windows.last()) else {
        return String::new();
    };
    let half = 0.5 * excitation.window_mm;
    let range = [first.x_mm - half, last.x_mm + half];
    let count = ((range[1] - range[0]) / excitation.window_mm).round() as usize;
    if !(2..=200).contains(&count) {
        return String::new();
    }
    // two characters per window; positions without a window have no bar
    let mut values = vec![0.0f64; 2 * count];
    for window in &excitation.windows {
        let index = ((window.x_mm - first.x_mm) / excitation.window_mm).round() as usize;
        for value in values.iter_mut().skip(2 * index).take(2) {
            *value = value.max(window.condition);
        }
    }
    let most = values.iter().copied().fold(1.0, f64::max);
    let heading = "condition number of [a v x 1] by position (logarithmic from 1)";
    picture::columns(heading, "mm", range, &values, 1.0 / (1.1 * most), ROWS)
}
