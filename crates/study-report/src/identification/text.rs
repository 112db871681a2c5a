//! What `study identify` prints.

use super::printed::{Printed, align, short_name};
use super::{comparison, elements, elsewhere, first, json, loops};
use std::fmt::Write as _;
use study_base::text::Untrusted;
use study_haptics::identify::grid::Cell;
use study_haptics::identify::identification::Identification;
use study_haptics::identify::mechanism::{Filter, Fitted, PARAMETERS};
use study_haptics::identify::validation::{Accuracy, Validation};
use study_haptics::model::{Realization, Units};
use study_haptics::safe_play::{self, Danger};
use study_wire::certificate::{Certificate, SERVO_RATES_HZ};

/// Most cells shown as a list; more are shown as rows of lambda and columns of dx.
const MAX_ROWS: usize = 30;

/// The parameters of a mechanism as text.
fn mechanism_in_detail(fitted: &Fitted) -> String {
    let mut rows = vec![
        ["mechanism", "", "standard error", ""]
            .map(String::from)
            .to_vec(),
    ];
    let values = fitted.mechanism.scalars.to_array();
    for (((name, unit, _), value), error) in
        (PARAMETERS.iter().zip(values)).zip(fitted.standard_errors)
    {
        let error = error.map_or("-".to_owned(), |error| format!("{error:.2e}"));
        rows.push(vec![
            (*name).to_owned(),
            format!("{value:.4e}"),
            error,
            (*unit).to_owned(),
        ]);
    }
    let mut out = align(&rows);
    let decided = (fitted.decision).map_or(String::new(), |decision| {
        let [through, without] = decision.rms_n;
        let by = match decision.by_header {
            true => "as the header says",
            false => "as the errors say",
        };
        format!(
            " ({by}: where the measured force was left out, its error is {through:.4} N rms with a low-pass and {without:.4} N without)"
        )
    });
    let _ = match fitted.filter {
        Filter::Recorded(hz) => writeln!(
            out,
            "the recorded force passed a low-pass of about {hz} Hz; so does the predicted one{decided}"
        ),
        Filter::Both(hz) => writeln!(
            out,
            "recorded force not filtered; fitted below {hz} Hz, predicted without a filter{decided}"
        ),
    };
    let [low, high] = fitted.reach_mm;
    let _ = writeln!(
        out,
        "the follower was at {low:.2} to {high:.2} mm; beyond, detents and friction keep their last values"
    );
    out += "starts, with their rms error on a part and on all of the training recordings:\n";
    for a in &fitted.attempts {
        let fitted_n = a
            .fitted_n
            .map_or("not continued".to_owned(), |n| format!("{n:.4} N"));
        let _ = writeln!(
            out,
            "    backlash {:.2} mm, mass {:.3} kg: {:.4} N, {fitted_n}",
            a.gap_mm, a.mass_kg, a.compared_n
        );
    }
    out
}

/// A number without the digits that a conversion of units leaves.
fn plain(value: f64) -> String {
    let rounded = format!("{value:.6e}").parse::<f64>();
    rounded.map_or_else(|_| value.to_string(), |value| value.to_string())
}

/// The results as text for a terminal of this width.
pub fn text(results: &Identification, width: usize) -> String {
    let mut out = String::new();
    let p = Printed::of(results);
    if p.units != Units::Linear {
        let _ = writeln!(
            out,
            "angles in {} and torques in N·m; certificates, mechanisms and warnings in mm and N at {} mm",
            p.x(),
            p.lever_mm
        );
    }
    for training in results.training.iter().map(|source| &source.recording) {
        let fastest = p.length(training.top_speed_mm_s());
        let decimals = if fastest < 10.0 { 2 } else { 0 };
        let _ = writeln!(
            out,
            "{}: {} samples, {:.1} s, x {:.2} to {:.2} {x}, |v| up to {fastest:.decimals$} {x}/s",
            Untrusted(&training.name),
            training.len(),
            training.duration_s(),
            p.length(training.range_mm()[0]),
            p.length(training.range_mm()[1]),
            x = p.x(),
        );
    }
    if let Some(comparison) = &results.comparison {
        out.push('\n');
        out += &comparison::table(results, comparison);
        return finished(out, results, width);
    }
    if let Some(cell) = results.cells.first() {
        let _ = writeln!(out, "{}", settings(cell));
    }
    out.push('\n');
    match surface(results) {
        Some(rows) => {
            let name = (results.recordings.first()).map_or("", |source| &source.recording.name);
            let name = Untrusted(name);
            let x = p.x();
            let _ = writeln!(
                out,
                "VAF on {name}, by lambda (and L in {x}) and dx in {x}:"
            );
            out.push_str(&align(&rows));
        }
        None => {
            let mut rows = vec![heads(results)];
            let cells = results.cells.iter().enumerate();
            rows.extend(cells.map(|(i, cell)| row(results, cell, results.best == Some(i))));
            out.push_str(&align(&rows));
        }
    }
    out.push('\n');
    out.push_str(&selection(results));
    finished(out, results, width)
}

/// With the best cell in detail and the warnings.
fn finished(mut out: String, results: &Identification, width: usize) -> String {
    out.push_str(&best_in_detail(results));
    out.push_str(&elsewhere::text(results));
    out.push_str(&loops::text(results));
    for (warning, cells) in warnings(results) {
        let _ = writeln!(out, "warning: {warning} ({cells})");
    }
    out + &first::text(results, width)
}

/// A large grid as rows of lambda and columns of dx; `None` for a small one.
fn surface(results: &Identification) -> Option<Vec<Vec<String>>> {
    if results.cells.len() <= MAX_ROWS {
        return None;
    }
    let p = Printed::of(results);
    let mut increments: Vec<f64> = Vec::new();
    let mut rows: Vec<(f64, Vec<String>)> = Vec::new();
    for (i, cell) in results.cells.iter().enumerate() {
        let provenance = &cell.realization.provenance;
        let (lambda, dx) = (provenance.lambda?, provenance.dx_mm?);
        if !increments.contains(&dx) {
            increments.push(dx);
        }
        let mark = if results.best == Some(i) { "*" } else { "" };
        let vaf = format!("{mark}{:.4}", cell.scores.first()?.vaf);
        match rows.last_mut() {
            Some((last, row)) if *last == lambda => row.push(vaf),
            _ => {
                let memory = provenance
                    .memory_mm
                    .map_or("all".into(), |l| format!("{:.3}", p.length(l)));
                rows.push((lambda, vec![lambda.to_string(), memory, vaf]));
            }
        }
    }
    let mut heads = vec!["lambda".to_owned(), "L".to_owned()];
    heads.extend(increments.iter().map(|dx| plain(p.length(*dx))));
    let mut table = vec![heads];
    table.extend(rows.into_iter().map(|(_, row)| row));
    let columns = table[0].len();
    table
        .iter()
        .all(|row| row.len() == columns)
        .then_some(table)
}

/// The accuracy of the best cell by direction and detent, its ceiling and certificate.
fn best_in_detail(results: &Identification) -> String {
    let Some(cell) = results.best.map(|best| &results.cells[best]) else {
        return String::new();
    };
    let p = Printed::of(results);
    let [bias, residual] = ["bias", "residual"].map(|name| format!("{name} {}", p.f()));
    let heads = ["", "VAF", "NRMSE", &bias, &residual, "in JND"];
    let mut rows = vec![heads.map(String::from).to_vec()];
    let mut ceilings = String::new();
    // a torque in N·m is some 30 times smaller than its force
    let decimals = if p.units == Units::Linear { 3 } else { 5 };
    for (source, (validation, ceiling)) in results
        .recordings
        .iter()
        .zip(results.accuracies.iter().zip(&results.ceilings))
    {
        let Some(v) = validation else { continue };
        let mut row = |samples: String, accuracy: &Option<Accuracy>| {
            if let Some(accuracy) = accuracy {
                rows.push(vec![
                    samples,
                    format!("{:.4}", accuracy.vaf),
                    format!("{:.3}", accuracy.nrmse),
                    format!("{:+.*}", decimals, p.force(accuracy.bias_n)),
                    format!("{:.*}", decimals, p.force(accuracy.residual_n)),
                    format!("{:.1}", accuracy.residual_n / v.noticeable_n),
                ]);
            }
        };
        row(short_name(source), &Some(v.whole));
        row("v > 0".into(), &v.positive);
        row("v < 0".into(), &v.negative);
        for ([low, high], part) in &v.detents {
            let [low, high] = [*low, *high].map(|mm| p.length(mm));
            row(format!("x {low:.1} to {high:.1} {}", p.x()), part);
        }
        if let Some(c) = ceiling {
            let _ = writeln!(
                ceilings,
                "highest VAF that a model can reach on {}: {:.6} (its repetition differs by noise of {:.*} {}); the residual is {:.1} times the least one",
                Untrusted(&source.recording.name),
                c.vaf,
                decimals,
                p.force(c.noise_n),
                p.f(),
                c.residual(v.whole.vaf)
            );
        }
    }
    let provenance = &cell.realization.provenance;
    let filter = provenance.filter.as_deref().unwrap_or("unknown");
    let mechanism = (cell.fitted.as_deref()).map_or(String::new(), mechanism_in_detail);
    let springs = elements::in_detail(&cell.realization, p);
    let (noticeable, accuracy) = match rows.len() {
        1 => (String::new(), String::new()),
        _ => (
            noticeable(results.accuracies.iter().flatten()),
            align(&rows),
        ),
    };
    format!(
        "\nthe {} cell in detail{noticeable}\nsignals: {}\n{accuracy}{ceilings}{mechanism}{springs}certificate {}\n    {}\n    m < 0 at {:.0} % of the nodes, b < 0 at {:.0} %\n{}",
        if results.cells.len() == 1 {
            "only"
        } else {
            "best"
        },
        Untrusted(filter),
        cell.certificate,
        required_damping(&cell.certificate),
        100.0 * cell.certificate.negative_mass,
        100.0 * cell.certificate.negative_damping,
        dangers(&cell.realization),
    )
}

/// What a column of just noticeable differences is a multiple of.
fn noticeable<'a>(validations: impl Iterator<Item = &'a Validation>) -> String {
    let each: Vec<f64> = validations.map(|v| v.noticeable_n).collect();
    let least = each.iter().copied().fold(f64::INFINITY, f64::min);
    let most = each.iter().copied().fold(0.0, f64::max);
    let digits = |n: f64| (n * 1e3).round() / 1e3;
    let range = if digits(least) < digits(most) {
        format!("{} to {}", digits(least), digits(most))
    } else {
        digits(most).to_string()
    };
    format!("; JND: just noticeable difference, {range} N")
}

/// The settings that all cells share.
fn settings(cell: &Cell) -> String {
    let mut parts = vec![cell.method.as_str().to_owned()];
    let [start, sort] = json::start_and_sort(cell.method);
    parts.extend(start.map(|start| format!("{start} start")));
    parts.extend(sort.map(|sort| format!("{sort} in x")));
    if let Some(resample) = &cell.realization.provenance.resample {
        parts.push(format!("{resample} resampling"));
    }
    parts.push(format!("{} look-up", cell.realization.lookup.as_str()));
    parts.join(", ")
}

fn heads(results: &Identification) -> Vec<String> {
    let p = Printed::of(results);
    let (x, f) = (p.x(), p.f());
    let mut heads = vec![String::new()];
    if has_memory(results) {
        heads.extend(["lambda".into(), format!("L {x}")]);
    }
    heads.push(format!("dx {x}"));
    if has_delta(results) {
        heads.push(format!("delta {x}"));
    }
    for source in &results.recordings {
        heads.push(format!("VAF {}", short_name(source)));
        heads.extend([format!("bias {f}"), format!("residual {f}")]);
    }
    if results.weights.is_some() {
        let names = results.recordings.iter().map(short_name);
        heads.extend(names.map(|name| format!("perceptual {name}")));
    }
    heads.extend(["m<0", "b<0", "passive"].map(String::from));
    heads
}

/// Whether a cell has a forgetting factor or a width of its weights.
fn has_memory(results: &Identification) -> bool {
    let memory = |cell: &Cell| {
        let provenance = &cell.realization.provenance;
        provenance.lambda.is_some() || provenance.memory_mm.is_some()
    };
    results.cells.iter().any(memory)
}

/// Whether a cell has a direction state.
fn has_delta(results: &Identification) -> bool {
    let delta = |cell: &Cell| cell.realization.direction.delta_mm();
    results.cells.iter().any(|cell| delta(cell).is_some())
}

fn row(results: &Identification, cell: &Cell, best: bool) -> Vec<String> {
    let p = Printed::of(results);
    let decimals = p.decimals();
    let provenance = &cell.realization.provenance;
    let number = |n: Option<f64>| n.map_or("-".to_owned(), |n| n.to_string());
    let memory = match (provenance.lambda, provenance.memory_mm) {
        (Some(_), None) => "all".to_owned(),
        (_, Some(memory)) => format!("{:.3}", p.length(memory)),
        (None, None) => "-".to_owned(),
    };
    let mut row = vec![if best { "*" } else { "" }.to_owned()];
    if has_memory(results) {
        row.extend([number(provenance.lambda), memory]);
    }
    row.push((provenance.dx_mm).map_or("-".to_owned(), |dx| plain(p.length(dx))));
    if has_delta(results) {
        let delta_mm = cell.realization.direction.delta_mm();
        row.push(number(
            delta_mm.map(|mm| (1e4 * p.length(mm)).round() / 1e4),
        ));
    }
    for score in &cell.scores {
        row.push(format!("{:.6}", score.vaf));
        row.push(format!("{:+.decimals$}", p.force(score.bias_n)));
        row.push(format!("{:.decimals$}", p.force(score.residual_n)));
    }
    let perceptual = results.perceptual_vaf(&cell.realization).into_iter();
    row.extend(perceptual.map(|vaf| vaf.map_or("-".to_owned(), |vaf| format!("{vaf:.6}"))));
    let certificate = &cell.certificate;
    for share in [certificate.negative_mass, certificate.negative_damping] {
        row.push(format!("{:.0} %", 100.0 * share));
    }
    let passes = certificate.passes();
    row.push(if passes { "PASS" } else { "FAIL" }.to_owned());
    row
}

/// The VAF of the best cell, on what it was selected, and the VAF to report.
fn selection(results: &Identification) -> String {
    let Some(best) = results.best else {
        return "no cell has a VAF\n".into();
    };
    let cell = &results.cells[best];
    let validations = results.validations;
    let list = |from: usize, to: usize| {
        results.recordings[from..to]
            .iter()
            .zip(&cell.scores[from..to])
            .map(|(source, s)| format!("{:.6} on {}", s.vaf, Untrusted(&source.recording.name)))
            .collect::<Vec<_>>()
            .join(", ")
    };
    if results.recordings.is_empty() {
        return "no VAF: there is no --validate or --test recording\n".into();
    }
    if results.cells.len() == 1 {
        return format!("VAF {}\n", list(0, results.recordings.len()));
    }
    let mut out = format!(
        "* highest VAF: {}{}",
        list(0, validations),
        if validations == 1 {
            ", selected on this recording"
        } else {
            " (highest mean), selected on these recordings"
        }
    );
    out.push('\n');
    if validations < results.recordings.len() {
        let _ = writeln!(
            out,
            "  to report: {}",
            list(validations, results.recordings.len())
        );
    } else {
        out += "  the VAF on the recording used for selection is optimistic: report the VAF on a --test recording\n";
    }
    out
}

/// Each warning once, with the number of cells that have it.
fn warnings(results: &Identification) -> Vec<(String, String)> {
    let mut counts: Vec<(String, usize)> = Vec::new();
    for warning in results.cells.iter().flat_map(|cell| &cell.warnings) {
        let text = warning.to_string();
        match counts.iter_mut().find(|(other, _)| *other == text) {
            Some((_, count)) => *count += 1,
            None => counts.push((text, 1)),
        }
    }
    counts
        .into_iter()
        .map(|(text, count)| (text, format!("{count} of {} cells", results.cells.len())))
        .collect()
}

/// The damping that a device needs to render a realization.
pub fn required_damping(certificate: &Certificate) -> String {
    if certificate.stiffness_n_per_mm.is_infinite() {
        return "the force jumps at nodes: no servo rate suffices".to_owned();
    }
    let at = |hz: f64| {
        format!(
            "{:.2} at {} kHz",
            certificate.device_damping_n_s_per_m(hz, 0.0),
            hz / 1000.0
        )
    };
    let state = match certificate.state_n_per_mm {
        Some(n_per_mm) => format!(" and {n_per_mm:.2} over the direction state"),
        None => String::new(),
    };
    format!(
        "K up to {:.2} N/mm{state}, |b| up to {:.1} N·s/m; required device damping in N·s/m: {}",
        certificate.stiffness_n_per_mm,
        1000.0 * certificate.damping_n_s_per_mm,
        SERVO_RATES_HZ.map(at).join(", ")
    )
}

/// What an adversary makes on a device of a realization that passes its certificate.
fn dangers(realization: &Realization) -> String {
    if !realization.certificate().passes() {
        return String::new();
    }
    let found = safe_play::search(realization, &safe_play::Device::default());
    let line = |danger: &Danger| format!("warning: on a device, {danger}\n");
    found.iter().map(line).collect()
}
