//! `study trajectory`: draw a trajectory and check it against limits.

pub(super) mod picture;

use super::{Console, Failure};
use std::fs;
use std::io::{BufWriter, Read as _, Write};
use std::path::{Path, PathBuf};
use study_base::text::Untrusted;
use study_haptics::identify::evidence::Term;
use study_haptics::identify::forecast::{self, Sensors};
use study_haptics::plant::{self, MAX_RATE_HZ, MIN_RATE_HZ, Parameters, Probe};
use study_haptics::trajectory::{Trajectory, check, file, spectrum};
use study_wire::predict::Motion;

/// Largest size of a trajectory or plant file.
const MAX_BYTES: u64 = 1024 * 1024;
/// Height of a curve, lines.
const CURVE_ROWS: usize = 8;
/// Height of the spectrum, lines.
const SPECTRUM_ROWS: usize = 5;
/// Upper end of the spectrum as a multiple of the highest frequency of any part.
const SHOWN_SPECTRUM: f64 = 2.0;

/// Arguments of `study trajectory`.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// The trajectory file, TOML with format = "study-trajectory/1"
    #[arg(value_name = "SPEC")]
    spec: PathBuf,

    /// Write t_s,x_mm,v_mm_s,a_m_s2 as CSV, ramps included
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,

    /// Sampling rate, of the CSV and of the recording that is foretold
    #[arg(long, value_name = "HZ", default_value_t = 1000.0, value_parser = rate, allow_negative_numbers = true)]
    rate: f64,

    /// Resolution of the encoder
    #[arg(long, value_name = "MM", default_value_t = Probe::default().encoder_mm, value_parser = not_negative)]
    encoder: f64,

    /// Noise of the force sensor, rms
    #[arg(long, value_name = "N", default_value_t = Probe::default().force_noise_n, value_parser = not_negative)]
    noise: f64,

    /// The target, whose limits apply: a, b or a plant file
    #[arg(long, value_name = "a|b|FILE", default_value = "a")]
    plant: String,

    /// Overwrite FILE if it exists
    #[arg(long, requires = "out")]
    force: bool,
}

/// Why a sampling rate is rejected.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(super) enum RateError {
    #[error("not a number")]
    NotANumber,
    #[error("a sampling rate is from {MIN_RATE_HZ} to {MAX_RATE_HZ} Hz")]
    OutOfRange,
}

/// Parses a sampling rate, Hz.
pub(super) fn rate(given: &str) -> Result<f64, RateError> {
    let value: f64 = given.trim().parse().map_err(|_| RateError::NotANumber)?;
    match (MIN_RATE_HZ..=MAX_RATE_HZ).contains(&value) {
        true => Ok(value),
        false => Err(RateError::OutOfRange),
    }
}

fn not_negative(given: &str) -> Result<f64, String> {
    let value = given.trim().parse().ok();
    value
        .filter(|value: &f64| *value >= 0.0 && value.is_finite())
        .ok_or_else(|| "0 or a number above it is expected".to_owned())
}

/// Draws a trajectory, says what it identifies, checks it and writes it as CSV.
pub(super) fn run(args: &Args, console: &mut Console) -> Result<(), Failure> {
    let trajectory = read_trajectory(&args.spec, console)?;
    let (_, target) = read_plant(&args.plant, console)?;
    refuse_to_overwrite(args.out.as_deref(), args.force)?;
    console.out(page(&trajectory, console.width))?;
    let sensors = Sensors {
        encoder_mm: args.encoder,
        force_noise_n: args.noise,
        rate_hz: args.rate,
    };
    console.out(identifiable(&trajectory, sensors))?;
    if let Err(violations) = Probe::default().check(&trajectory, &target) {
        let violations: Vec<String> = violations.iter().map(ToString::to_string).collect();
        return Err(Failure::input(format!(
            "{}: {}",
            args.spec.display(),
            violations.join("; ")
        ))
        .hint("lower the amplitude or the frequency of a part, or move offset_mm"));
    }
    if let Some(out) = &args.out {
        write_file(out, |sink| write_csv(sink, &trajectory, args.rate))?;
        console.say(format!("wrote {}", out.display()));
    }
    Ok(())
}

fn write_csv(sink: &mut dyn Write, trajectory: &Trajectory, rate_hz: f64) -> std::io::Result<()> {
    writeln!(sink, "t_s,x_mm,v_mm_s,a_m_s2")?;
    // bounded by the longest trajectory and the highest sampling rate
    let rows = (trajectory.total_s() * rate_hz + 1e-6).floor() as usize;
    for i in 0..=rows {
        let t_s = i as f64 / rate_hz;
        let p = trajectory.at(t_s);
        writeln!(
            sink,
            "{t_s:.6},{:.6},{:.5},{:.6}",
            p.x_mm, p.v_mm_s, p.a_m_s2
        )?;
    }
    Ok(())
}

/// The text shown: extremes, position and velocity over time, spectrum.
fn page(trajectory: &Trajectory, width: usize) -> String {
    let columns = width.clamp(40, 120) - study_report::plot::braille::LABEL - 2;
    let e = check::extremes(trajectory);
    let title = trajectory.title.as_deref().unwrap_or("untitled trajectory");
    let mut out = format!(
        "{}\n{} s, ramps of {} s before and after\nposition {:.2} to {:.2} mm, speed up to {:.1} mm/s, acceleration up to {:.2} m/s²\n",
        Untrusted(title),
        trajectory.duration_s,
        trajectory.ramp_s,
        e.x_mm[0],
        e.x_mm[1],
        e.v_mm_s,
        e.a_m_s2
    );
    let total_s = trajectory.total_s();
    for (heading, of) in [
        ("position, mm", (|m| m.x_mm) as fn(Motion) -> f64),
        ("velocity, mm/s", |m| m.v_mm_s),
    ] {
        let value = |t_s: f64| of(trajectory.at(t_s));
        let times = [0.0, total_s];
        out += &picture::curve(heading, "s", times, columns, CURVE_ROWS, value);
    }
    let to_hz = (SHOWN_SPECTRUM * trajectory.top_hz()).min(100.0);
    let bands = spectrum::bands(trajectory, to_hz, columns);
    let heading = "spectrum of the position, mm (logarithmic, four decades)";
    out + &picture::columns(heading, "Hz", [0.0, to_hz], &bands, 1e-4, SPECTRUM_ROWS)
}

/// What a recording of the trajectory will identify, at best.
fn identifiable(trajectory: &Trajectory, sensors: Sensors) -> String {
    let Sensors {
        encoder_mm,
        force_noise_n,
        rate_hz,
    } = sensors;
    let mut out = format!(
        "\nidentifiable, at {rate_hz} Hz with an encoder of {encoder_mm} mm and {force_noise_n} N of noise:\n"
    );
    let Some(found) = forecast::of(|t_s| trajectory.at(t_s), trajectory.total_s(), sensors) else {
        return out + "  nothing: the motion does not go forth and back\n";
    };
    for (term, least) in [Term::Mass, Term::Damping].into_iter().zip(found.least) {
        let name = term.as_str();
        out += &match least {
            Some(least) => format!("  {name}: from {} on\n", term.shown(least)),
            None => format!(
                "  {name}: no, its {} is that of the position and direction, or below the steps of the encoder\n",
                term.regressor()
            ),
        };
    }
    let share = 100.0 * found.both_directions;
    let friction_n = found.friction_n;
    out += &format!(
        "  friction: from {friction_n:.4} N on, in {share:.0} % of the travel, which is passed in both directions\n"
    );
    let (detent_mm, scale_mm) = (found.detent_mm, found.scale_mm);
    out += &format!(
        "  detents: from {detent_mm:.3} mm on by the samples; those narrower than {:.3} mm need --dx\n",
        2.0 * scale_mm
    );
    out
}

/// Reads a small text file.
fn text_of(path: &Path) -> Result<String, Failure> {
    let mut text = String::new();
    fs::File::open(path)
        .and_then(|file| file.take(MAX_BYTES + 1).read_to_string(&mut text))
        .map_err(|e| Failure::file(path, &e))?;
    if text.len() as u64 > MAX_BYTES {
        return Err(Failure::input(format!(
            "{} is larger than {MAX_BYTES} bytes",
            path.display()
        )));
    }
    Ok(text)
}

/// Reads a trajectory file; prints its warnings.
pub(super) fn read_trajectory(path: &Path, console: &mut Console) -> Result<Trajectory, Failure> {
    match file::parse(&path.display().to_string(), &text_of(path)?) {
        (Some(trajectory), findings) => {
            console.findings(&[findings]);
            Ok(trajectory)
        }
        (None, findings) => Err(Failure::faults(vec![findings])),
    }
}

/// The target with this name or in this file, and its description for a recording's
/// header.
pub(super) fn read_plant(
    given: &str,
    console: &mut Console,
) -> Result<(String, Parameters), Failure> {
    if let Some(parameters) = Parameters::named(given) {
        return Ok((given.to_lowercase(), parameters));
    }
    let path = Path::new(given);
    if !path.exists() {
        return Err(
            Failure::input(format!("there is no target or file named {given}"))
                .hint("--plant is a, b or the path of a plant file"),
        );
    }
    match plant::file::parse(given, &text_of(path)?) {
        (Some(parameters), findings) => {
            console.findings(&[findings]);
            Ok(("of a file".to_owned(), parameters))
        }
        (None, findings) => Err(Failure::faults(vec![findings])),
    }
}

/// Fails if a file exists and may not be overwritten.
pub(super) fn refuse_to_overwrite(out: Option<&Path>, force: bool) -> Result<(), Failure> {
    match out {
        // what is written replaces it: a device or a pipe would be gone
        Some(path) if fs::metadata(path).is_ok_and(|found| !found.is_file()) => Err(
            Failure::input(format!("{} exists and is no regular file", path.display()))
                .hint("name a file to write; nothing was written"),
        ),
        Some(path) if !force && path.exists() => {
            Err(Failure::input(format!("{} already exists", path.display()))
                .hint("--force overwrites it; nothing was written"))
        }
        _ => Ok(()),
    }
}

/// Writes a file atomically: a reader sees all of it or none.
pub(super) fn write_file(
    path: &Path,
    content: impl FnOnce(&mut dyn Write) -> std::io::Result<()>,
) -> Result<(), Failure> {
    let mut name = path.file_name().unwrap_or_default().to_owned();
    name.push(".part");
    let part = path.with_file_name(name);
    let written = fs::File::create(&part)
        .and_then(|file| {
            let mut sink = BufWriter::with_capacity(1 << 16, file);
            content(&mut sink)?;
            sink.flush()?;
            sink.get_ref().sync_all()
        })
        .and_then(|()| fs::rename(&part, path));
    written.map_err(|e| {
        // an incomplete file is of no use
        let _ = fs::remove_file(&part);
        Failure::file(path, &e)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_shows_the_numbers_and_three_pictures() {
        let text = include_str!("../../protocols/turn-signal/validation-1.5hz.toml");
        let trajectory = file::parse("v.toml", text).0.unwrap();
        let page = page(&trajectory, 80);
        assert!(page.contains("position 2.50 to 32.50 mm"), "{page}");
        for heading in ["position, mm", "velocity, mm/s", "spectrum"] {
            assert!(page.contains(heading), "{page}");
        }
        assert!(
            page.lines().all(|line| line.chars().count() <= 100),
            "{page}"
        );
    }

    #[test]
    fn only_a_possible_sampling_rate_is_accepted() {
        assert_eq!(rate("1000"), Ok(1000.0));
        for bad in ["0", "nan", "inf", "-1", "40001", "x"] {
            assert!(rate(bad).is_err(), "{bad}");
        }
    }
}
