//! What the device did in a playback, beside what its table gives for the same motion.

use crate::runner::playback_limits;
use serde_json::{Map, Value};
use std::collections::BTreeMap;
use study_analysis::study::samples;
use study_base::text::ModelId;
use study_device::rendering_of;
use study_haptics::model::Realization;
use study_plan::protocol::{DeviceKind, Protocol};
use study_report::plot::strip::{extent, strip};
use study_session::outcome::{Event, FormId, Playback, Sample};
use study_session::rendering::{Expected, Played, expected};
use study_session::store::{SessionData, layout};
use study_wire::servo::ServoSettings;

/// Rows of a strip chart.
const ROWS: usize = 4;

/// Reads the playbacks of a session.
pub(super) struct Reader<'a> {
    pub(super) session: &'a SessionData,
    pub(super) protocol: &'a Protocol,
    /// Of each realization.
    pub(super) tables: &'a BTreeMap<ModelId, Realization>,
    /// Whether forces are shown, and beside the table.
    pub(super) revealed: bool,
}

/// A playback with its samples.
pub(super) struct Felt {
    file: String,
    samples: Vec<Sample>,
    /// Where the force is shown and the realization has a table.
    expected: Option<Expected>,
    revealed: bool,
}

impl Reader<'_> {
    /// What the telemetry of a playback tells; `None` for other events, and without a file
    /// that can be read.
    pub(super) fn read(&self, event: &Event) -> Option<Felt> {
        let Event::PlaybackEnded {
            trial,
            attempt,
            playback,
            telemetry,
            rendering,
            interval,
            ..
        } = event
        else {
            return None;
        };
        let file = match telemetry {
            // A name with a folder leads out of the results; `study verify` refuses it.
            Some(file) if file.file.contains(['/', '\\', '\0']) => return None,
            Some(file) => file.file.clone(),
            // Journals of earlier releases do not name it.
            None => layout::telemetry_of(*trial, *attempt, *interval, 1),
        };
        let samples = samples(&self.session.path.join(layout::TELEMETRY).join(&file))?;
        let expected = match self.revealed {
            true => {
                let faded_from_s = rendering.as_ref().and_then(|found| found.faded_from_s);
                self.expected(
                    (*trial, *attempt, *interval),
                    playback,
                    faded_from_s,
                    &samples,
                )
            }
            false => None,
        };
        Some(Felt {
            file,
            samples,
            expected,
            revealed: self.revealed,
        })
    }

    /// Whether an event is the answer of a trial of adjustment, which names the level that was felt: a realization.
    pub(super) fn names_level(&self, event: &Event) -> bool {
        let (Event::Answered { form, question, .. } | Event::Corrected { form, question, .. }) =
            event
        else {
            return false;
        };
        let FormId::Trial { trial, .. } = form else {
            return false;
        };
        let planned = self.session.history.planned(*trial);
        let part = planned.and_then(|trial| self.protocol.part(trial.part.as_ref()?));
        part.is_some_and(|part| {
            part.task.adjustment().is_some() && part.asks.first() == Some(question)
        })
    }

    fn expected(
        &self,
        (trial, attempt, interval): (u32, u32, Option<u32>),
        playback: &Playback,
        faded_from_s: Option<f64>,
        samples: &[Sample],
    ) -> Option<Expected> {
        let mut attempts = self.session.history.all_attempts();
        let (_, attempt) = attempts.find(|(t, a)| *t == trial && a.number == attempt)?;
        let place = interval.unwrap_or(1).checked_sub(1)?;
        let model = attempt.models.get(place as usize)?;
        let table = self.tables.get(model)?;
        let kind = self.session.history.start().map(|start| start.device_kind);
        // The journal has no constants of the servo: those of docs/wire.md.
        let servo = ServoSettings {
            force_n: playback_limits(self.protocol, Some(table)).force_n.get(),
            ..ServoSettings::default()
        };
        Some(expected(&Played {
            model,
            what: rendering_of(table),
            servo,
            servo_told: false,
            samples,
            numbered: kind != Some(DeviceKind::Process),
            lost: playback.samples_lost,
            faded_from_s,
            time_ratio: playback.time_ratio,
            host_late_s: None,
            others: &[],
        }))
    }
}

impl Felt {
    /// The numbers of the samples in a line, and strip charts.
    pub(super) fn text(&self, columns: usize) -> String {
        let points = |of: fn(&Sample) -> f64| -> Vec<(f64, f64)> {
            self.samples.iter().map(|s| (s.t_s, of(s))).collect()
        };
        let values = |points: &[(f64, f64)]| extent(points.iter().map(|(_, y)| *y));
        let position = points(|s| s.x_mm);
        if !self.revealed {
            // The shape of a force tells its realization also without a scale.
            return strip("Position, without scale", &position, None, columns, ROWS);
        }
        let force = points(|s| s.force_command_n);
        let table = self.table();
        let [a, b] = [values(&force), values(&table)];
        let of_force = match table.is_empty() {
            true => a,
            false => [a[0].min(b[0]), a[1].max(b[1])],
        };
        let difference = match self.expected.as_ref().and_then(|e| e.rms_difference_n) {
            Some(rms_n) => format!("{rms_n:.3} N"),
            None => "not known".to_owned(),
        };
        let mut out = format!(
            "          largest force {:.2} N, rms difference from the table {difference}\n",
            self.peak_n()
        );
        for (heading, points, scale) in [
            ("Position, mm", &position, values(&position)),
            ("Force of the device, N", &force, of_force),
            ("Force of the table, N", &table, of_force),
        ] {
            out.push_str(&strip(heading, points, Some(scale), columns, ROWS));
        }
        out
    }

    /// The force of the table over time, where it is known.
    fn table(&self) -> Vec<(f64, f64)> {
        let Some(expected) = &self.expected else {
            return Vec::new();
        };
        let times = expected.samples.iter().map(|s| s.t_s);
        times.zip(expected.force_n.iter().copied()).collect()
    }

    /// Adds what the samples tell to the fields of the event.
    pub(super) fn json(&self, fields: &mut Map<String, Value>) {
        fields.insert("file".to_owned(), self.file.clone().into());
        if self.revealed {
            let rms_n = self.expected.as_ref().and_then(|e| e.rms_difference_n);
            fields.insert("peak_force_n".to_owned(), self.peak_n().into());
            fields.insert("rms_difference_n".to_owned(), rms_n.into());
        }
    }

    /// The largest commanded force, N.
    fn peak_n(&self) -> f64 {
        let sizes = self.samples.iter().map(|s| s.force_command_n.abs());
        sizes.fold(0.0, f64::max)
    }
}
