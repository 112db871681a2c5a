//! Recording with a probe on a serial port: the sampled trajectory is sent to the device,
//! which follows it and returns the measured signals.

use super::{Args, embedded, filter_line, finish, recording_bytes};
use crate::cli::console::shell_command;
use crate::cli::device::port::PortConnection;
use crate::cli::trajectory::{read_trajectory, refuse_to_overwrite};
use crate::cli::{Console, Failure};
use study_base::limits::Limit;
use study_base::text::Untrusted;
use study_device::host::display_name;
use study_device::link::nonce;
use study_device::probe::{self, ProbePath};
use study_haptics::trajectory;

/// The command line of this recording. A port set in `device.toml` is read from there
/// again.
fn command_line(args: &Args) -> String {
    let mut words: Vec<String> = ["study", "record"].map(str::to_owned).to_vec();
    words.push(args.trajectory.to_string_lossy().into_owned());
    let mut option = |name: &str, value: Option<String>| {
        if let Some(value) = value {
            words.extend([format!("--{name}"), value]);
        }
    };
    option("device", Some(args.device.clone()));
    option("port", args.port.shown_port());
    option("baud", args.port.baud.map(|b| b.to_string()));
    option("rate", Some(args.rate.to_string()));
    option("max-force", Some(args.max_force.to_string()));
    option("filter", (!args.raw).then(|| args.filter.to_string()));
    if args.raw {
        words.push("--raw".to_owned());
    }
    shell_command(&words)
}

/// Records with the device and writes the recording.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let trajectory = read_trajectory(&args.trajectory, console)?;
    refuse_to_overwrite(args.out.as_deref(), args.force)?;
    let force_n = Limit::new(args.max_force).map_err(Failure::input)?.get();
    let filter = args.low_pass()?;
    // bounded by the longest trajectory and the highest sampling rate
    let samples = (trajectory.total_s() * args.rate + 1e-6).floor() as usize + 1;
    let x_mm = |i: usize| trajectory.at(i as f64 / args.rate).x_mm;
    let path = ProbePath {
        x_mm: (0..samples).map(x_mm).collect(),
        rate_hz: args.rate,
        force_n,
    };
    let mut connection = PortConnection::open(&args.port)?;
    let address = connection.address.clone();
    let progress = crate::cli::console::progress(100, "% of the path");
    let mut done = |share: f64| progress.set_position((100.0 * share) as u64);
    let recorded = probe::record(&mut connection, nonce(), &path, &mut done);
    progress.finish_and_clear();
    let (device, measured) = recorded.map_err(|why| {
        let why = why.to_string();
        let (address, why) = (Untrusted(&address), Untrusted(&why));
        Failure::device(format!("{address}: {why}")).hint(
            "nothing was recorded; `study device info` shows the limits of the probe, `study trajectory` the extremes of the trajectory",
        )
    })?;
    let what = match device.flags.simulated {
        true => "simulated, not measured: the simulated probe at the end of a wire",
        false => "measured by a probe",
    };
    // model files keep the first line as their note
    let mut header = format!(
        "{what}, {} ({}); {} (study {})\n",
        display_name(&device.serial),
        display_name(&device.firmware),
        Untrusted(&command_line(args)),
        env!("CARGO_PKG_VERSION"),
    );
    header += &filter_line(args);
    header += &embedded("TRAJECTORY", &trajectory::file::write(&trajectory));
    let bytes = recording_bytes(&trajectory, &measured, filter, args.rate, &header);
    finish(args, &bytes, console)
}
