//! Tables as CSV.
//!
//! RFC 4180: UTF-8, lines end in CR LF, a cell with a comma, quotation mark or
//! line end is quoted. Text is written as typed, even where a spreadsheet would take
//! it for a formula.

use crate::outcome::cell::{Header, Row};
use std::io;

/// A table with its header.
pub(super) fn csv<R: Row>(header: &Header<R::Column>, rows: &[R]) -> io::Result<Vec<u8>> {
    let mut out = csv::WriterBuilder::new()
        .terminator(csv::Terminator::CRLF)
        .from_writer(Vec::new());
    out.write_record(header.iter().map(|(_, name)| name))?;
    for row in rows {
        let cells = header.iter().map(|(column, name)| row.cell(*column, name));
        out.write_record(cells.map(|cell| cell.to_string()))?;
    }
    out.into_inner().map_err(|e| e.into_error())
}

#[cfg(test)]
mod tests {
    use super::csv;
    use crate::outcome::cell::{Cell, Header, Row};
    use crate::outcome::ratings::Ratings;
    use crate::outcome::{
        AttemptEvent, AttemptRow, Author, Channel, Failure, Fidelity, IntervalRow, ParticipantRow,
        RatingRow, State, Status, Verdict,
    };
    use chrono::{DateTime, FixedOffset};
    use proptest::prelude::*;
    use std::collections::BTreeMap;
    use study_base::text::{ModelId, PartId, ParticipantId, QuestionId};
    use study_plan::protocol::columns::{
        AttemptColumn, Column, IntervalColumn, Kind, ParticipantColumn, RatingColumn, Repeats,
    };
    use study_plan::protocol::{Answer, DeviceKind, Medium, Role};

    /// Values for the fields of a row, drawn from a list.
    struct Draws<'a>(std::iter::Cycle<std::slice::Iter<'a, u32>>);

    impl Draws<'_> {
        fn whole(&mut self) -> u32 {
            *self.0.next().unwrap()
        }

        fn of<T: Copy>(&mut self, all: &[T]) -> T {
            all[self.whole() as usize % all.len()]
        }

        fn maybe<T>(&mut self, value: impl FnOnce(&mut Self) -> T) -> Option<T> {
            let some = !self.whole().is_multiple_of(3);
            some.then(|| value(self))
        }

        fn number(&mut self) -> f64 {
            f64::from(self.whole()) / 7.0 - 1e8
        }

        fn fidelity(&mut self) -> Fidelity {
            let verdicts = [
                Verdict::Ok,
                Verdict::Unverified,
                Verdict::TooLittle,
                Verdict::Flag,
                Verdict::Fault,
            ];
            Fidelity {
                verdict: self.of(&verdicts),
                rendered_vaf: self.maybe(Self::number),
                delivered_vaf: self.maybe(Self::number),
                judged_share: self.maybe(Self::number),
                error_jnd: self.maybe(Self::number),
                nearest_model: self.maybe(Self::model),
                ..Fidelity::default()
            }
        }

        fn flag(&mut self) -> bool {
            self.whole().is_multiple_of(2)
        }

        fn text(&mut self) -> String {
            let hostile = [
                "",
                "a, b",
                "=1+1",
                "\"quoted\"\r\nsecond line",
                "よかった",
                " x ",
            ];
            self.of(&hostile).to_owned()
        }

        fn time(&mut self) -> DateTime<FixedOffset> {
            let at =
                DateTime::from_timestamp(i64::from(self.whole()), self.whole() % 1_000_000_000);
            at.unwrap().fixed_offset()
        }

        fn participant(&mut self) -> ParticipantId {
            ParticipantId::new(self.of(&["P01", "P02", "SIM001"])).unwrap()
        }

        fn part(&mut self) -> PartId {
            PartId::new(self.of(&["a", "day-2"])).unwrap()
        }

        fn model(&mut self) -> ModelId {
            ModelId::new(self.of(&["A", "B", "lambda-0.9991"])).unwrap()
        }
    }

    fn question(id: &str) -> QuestionId {
        QuestionId::new(id).unwrap()
    }

    /// `number` makes the row the only one of its subject, realization, repetition.
    fn rating_row(draws: &[u32], number: u32) -> RatingRow {
        let mut d = Draws(draws.iter().cycle());
        let declined = || Answer::Declined {
            reason: "no".to_owned(),
        };
        let rating = d.maybe(|d| Answer::Rating(i64::from(d.whole() % 9) - 4));
        let status = match rating {
            Some(_) => d.of(&[Status::Ok, Status::Failed]),
            None => d.of(&[Status::Failed, Status::Declined, Status::Missing]),
        };
        let rating = rating.or_else(|| d.maybe(|_| declined()));
        let answers = [
            ("realism", rating),
            ("comment", d.maybe(|d| Answer::Text(d.text()))),
            ("effort", d.maybe(|d| Answer::Number(d.number()))),
        ];
        RatingRow {
            study: "a-study".to_owned(),
            participant: d.participant(),
            session: d.whole(),
            row: d.maybe(Draws::whole),
            trial: d.whole(),
            block: d.whole(),
            position: d.maybe(|d| d.whole() | 1),
            planned_position: d.whole(),
            model: Some(d.model()),
            role: d.of(&[
                Role::Test,
                Role::Practice,
                Role::HiddenReference,
                Role::LowAnchor,
                Role::Physical,
            ]),
            repetition: number,
            previous_model: d.maybe(Draws::model),
            practice: d.whole().is_multiple_of(4),
            pilot: d.flag(),
            simulated: d.flag(),
            device_kind: d.of(&[
                DeviceKind::Simulated,
                DeviceKind::Serial,
                DeviceKind::Process,
                DeviceKind::Manual,
            ]),
            device_id: "simulated-1".to_owned(),
            operator: "AB, \"x\"".to_owned(),
            tool_version: "0.1.0".to_owned(),
            protocol_version: d.whole(),
            answers: (answers.into_iter())
                .filter_map(|(id, answer)| Some((question(id), answer?)))
                .collect(),
            corrected: d.flag(),
            declined: d.flag(),
            remarks: d.text(),
            reference_s: d.maybe(Draws::number),
            exploration_s: d.maybe(Draws::number),
            response_s: d.maybe(Draws::number),
            strokes: d.maybe(Draws::whole),
            least_energy_j: d.maybe(Draws::number),
            switches_per_s: d.maybe(Draws::number),
            clamp_count: d.maybe(|d| u64::from(d.whole()) << 20),
            started_at: d.maybe(Draws::time),
            rated_at: d.maybe(Draws::time),
            attempt: d.maybe(Draws::whole),
            status,
            vaf: d.maybe(Draws::number),
            covariates: BTreeMap::from([("lambda".to_owned(), d.number())]),
            levels: BTreeMap::from([("friction".to_owned(), d.text())]),
            part: Some(PartId::new("p").unwrap()),
            track: d.maybe(|_| PartId::new("t").unwrap()),
            level: d.maybe(Draws::number),
            correct: d.maybe(Draws::flag),
            replays: d.maybe(Draws::whole),
            fidelity: d.maybe(Draws::fidelity),
            host_late_ms: d.maybe(Draws::number),
            input_channel: d.maybe(|d| d.of(&[Channel::Terminal, Channel::Plain, Channel::Page])),
            front_name: d.maybe(Draws::text),
            group: d.maybe(Draws::part),
            session_id: d.maybe(Draws::part),
            paused_s: d.maybe(Draws::number),
            felt_again_after_s: d.maybe(Draws::number),
            answer_before_feedback: d.maybe(|d| Answer::Choice(vec![d.text()])),
            questionnaire_paused_s: d.maybe(Draws::number),
            questionnaire_late: d.maybe(Draws::flag),
            media_offset_ms: d.maybe(Draws::number),
            media_uncertainty_ms: d.maybe(Draws::number),
            media_jitter_ms: d.maybe(Draws::number),
            sent: BTreeMap::from([("duration".to_owned(), d.number())]),
        }
    }

    fn interval_row(draws: &[u32]) -> IntervalRow {
        let mut d = Draws(draws.iter().cycle());
        let id = |_: &mut Draws<'_>| PartId::new("p").unwrap();
        IntervalRow {
            study: "a-study".to_owned(),
            participant: d.participant(),
            session: d.whole(),
            part: Some(id(&mut d)),
            trial: d.whole(),
            attempt: d.whole(),
            interval: d.whole(),
            model: d.maybe(Draws::model),
            level: d.maybe(Draws::number),
            level_proposed: d.maybe(Draws::number),
            track: d.maybe(id),
            track_trial: d.maybe(Draws::whole),
            target: d.maybe(Draws::flag),
            catch: d.maybe(Draws::flag),
            gap_s: d.maybe(Draws::number),
            replays: d.whole(),
            exploration_s: d.maybe(Draws::number),
            strokes: d.maybe(Draws::whole),
            fidelity: d.maybe(Draws::fidelity),
            host_late_ms: d.maybe(Draws::number),
        }
    }

    fn attempt_row(draws: &[u32]) -> AttemptRow {
        let mut d = Draws(draws.iter().cycle());
        AttemptRow {
            participant: d.participant(),
            session: d.whole(),
            simulated: d.flag(),
            pilot: d.flag(),
            trial: d.maybe(Draws::whole),
            attempt: d.maybe(Draws::whole),
            model: d.maybe(Draws::model),
            what: d.of(&[
                AttemptEvent::Attempt,
                AttemptEvent::Answer,
                AttemptEvent::Correction,
                AttemptEvent::Failure,
                AttemptEvent::Closed,
                AttemptEvent::Remark,
                AttemptEvent::Resume,
                AttemptEvent::State,
                AttemptEvent::Reveal,
                AttemptEvent::SelfWeighed,
                AttemptEvent::Media,
                AttemptEvent::NumberSent,
            ]),
            question: d.maybe(|_| question("realism")),
            from: d.maybe(|d| Answer::Choice(vec![d.text(), "b".to_owned()])),
            to: d.maybe(|d| Answer::Rating(d.whole().into())),
            failure: d.maybe(|d| {
                d.of(&[
                    Failure::DeviceFault,
                    Failure::PlaybackLost,
                    Failure::MarkedBad,
                    Failure::Stopped,
                    Failure::Interrupted,
                    Failure::Rendering,
                    Failure::Media,
                ])
            }),
            by: d.maybe(|d| d.of(&[Author::Participant, Author::Experimenter])),
            text: d.text(),
            at: d.time(),
            input_channel: d.maybe(|d| d.of(&[Channel::Terminal, Channel::Plain, Channel::Page])),
            medium: d.maybe(|d| d.of(&Medium::ALL)),
            media_offset_ms: d.maybe(Draws::number),
            media_uncertainty_ms: d.maybe(Draws::number),
        }
    }

    fn participant_row(draws: &[u32]) -> ParticipantRow {
        let mut d = Draws(draws.iter().cycle());
        ParticipantRow {
            participant: d.participant(),
            session: d.whole(),
            state: d.of(&[
                State::Unfinished,
                State::Done,
                State::Void,
                State::NoShow,
                State::DroppedOut,
                State::Excluded,
                State::Withdrawn,
            ]),
            reason: d.text(),
            row: d.maybe(Draws::whole),
            pilot: d.flag(),
            simulated: d.flag(),
            erased: d.flag(),
            consent_version: d.maybe(|_| "1.0".to_owned()),
            protocol_version: d.maybe(Draws::whole),
            trials_done: d.whole(),
            trials_planned: d.whole(),
            started_at: d.maybe(Draws::time),
            answers: BTreeMap::from([(question("hand"), Answer::Text(d.text()))]),
            group: d.maybe(Draws::part),
            session_id: d.maybe(Draws::part),
            gap_h: d.maybe(Draws::number),
        }
    }

    /// The header of a study with these questions and the covariate `lambda`.
    fn header<C: Copy>(all: &[C], declaration: fn(C) -> Column, questions: &[&str]) -> Header<C> {
        (all.iter())
            .flat_map(|c| match declaration(*c).repeats {
                Repeats::Once => vec![(*c, declaration(*c).name.to_owned())],
                Repeats::Question => questions.iter().map(|q| (*c, (*q).to_owned())).collect(),
                Repeats::Covariate => vec![(*c, "lambda".to_owned())],
                Repeats::Factor => vec![(*c, "friction".to_owned())],
                Repeats::Sent => vec![(*c, "duration".to_owned())],
            })
            .collect()
    }

    /// Checks the cells of a row against the declarations of their columns, and the CSV
    /// against the cells.
    fn check<R: Row>(
        row: &R,
        header: &Header<R::Column>,
        declaration: fn(R::Column) -> Column,
    ) -> Result<(), TestCaseError> {
        let table = csv(header, std::slice::from_ref(row)).unwrap();
        let mut reader = csv::Reader::from_reader(&table[..]);
        let names: Vec<String> = header.iter().map(|(_, name)| name.clone()).collect();
        prop_assert_eq!(reader.headers().unwrap(), names);
        let record = reader.records().next().unwrap().unwrap();
        for (at, (column, name)) in header.iter().enumerate() {
            let declared = declaration(*column);
            let cell = row.cell(*column, name);
            prop_assert_eq!(&record[at], cell.to_string());
            let fits = match (&cell, declared.kind) {
                (Cell::Empty, _) => declared.empty.is_some(),
                (Cell::Text(text), Kind::Level(levels)) => levels.iter().any(|l| l.0 == text),
                (Cell::Text(_), kind) => matches!(kind, Kind::Text | Kind::Answer),
                (Cell::Whole(_), kind) => matches!(kind, Kind::Whole | Kind::Answer),
                (Cell::Number(_), kind) => matches!(kind, Kind::Number | Kind::Answer),
                (Cell::Flag(_), kind) => kind == Kind::Flag,
                (Cell::Time(_), kind) => kind == Kind::Time,
            };
            prop_assert!(fits, "{}: {:?}", name, cell);
        }
        Ok(())
    }

    const QUESTIONS: [&str; 3] = ["realism", "comment", "effort"];

    proptest! {
        #[test]
        fn cells_are_what_their_columns_declare(draws in prop::collection::vec(any::<u32>(), 97)) {
            let columns = header(RatingColumn::ALL, RatingColumn::column, &QUESTIONS);
            check(&rating_row(&draws, 1), &columns, RatingColumn::column)?;
            check(&interval_row(&draws), &IntervalRow::header(), IntervalColumn::column)?;
            check(&attempt_row(&draws), &AttemptRow::header(), AttemptColumn::column)?;
            let columns = header(ParticipantColumn::ALL, ParticipantColumn::column, &["hand"]);
            check(&participant_row(&draws), &columns, ParticipantColumn::column)?;
        }

        #[test]
        fn a_written_table_reads_back_as_its_rows(
            draws in prop::collection::vec(prop::collection::vec(any::<u32>(), 97), 1..8)
        ) {
            let rows: Vec<RatingRow> = (1..).zip(&draws).map(|(n, d)| rating_row(d, n)).collect();
            prop_assume!(rows.iter().any(|r| !r.practice && r.track.is_none()));
            let columns = header(RatingColumn::ALL, RatingColumn::column, &QUESTIONS);
            let table = csv(&columns, &rows).unwrap();
            for asked in [None, Some("realism"), Some("effort")] {
                let read = Ratings::read_csv("ratings.csv", &table[..], asked).unwrap();
                let wanted = Ratings::from_rows(&rows, &question(asked.unwrap_or("realism")), None);
                prop_assert_eq!(read, wanted);
            }
        }
    }
}
