//! The tables of a data set: columns with their description, and rows.
//!
//! A column is described by its declaration in `protocol::columns` and by what the
//! protocol says of its question or realization.

use super::Options;
use super::select::{OLDEST, Selected, is_age};
use std::borrow::Cow;
use study_base::text::ModelId;
use study_plan::protocol::columns::{
    Column, IntervalColumn, Kind, ParticipantColumn, RatingColumn, Repeats, Typed,
};
use study_plan::protocol::{DeviceNumber, Factor, Protocol, Question, Scale};
use study_session::outcome::cell::{Cell, Header, Row};
use study_session::outcome::{IntervalRow, ParticipantRow, RatingRow};

/// Most levels of a scale that are listed one by one.
const MAX_LEVELS: i64 = 101;

/// Text without the control characters that no table can have; line breaks and tabs stay.
pub(super) fn clean(text: &str) -> Cow<'_, str> {
    let bad = |c: char| c.is_control() && !matches!(c, '\n' | '\r' | '\t');
    match text.contains(bad) {
        true => Cow::Owned(text.replace(bad, "\u{fffd}")),
        false => Cow::Borrowed(text),
    }
}

/// What the cells of a column are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Type {
    Text,
    Whole,
    Number,
    Flag,
    Time,
}

/// A column.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Field {
    pub(super) name: String,
    /// The text of its question.
    pub(super) title: Option<String>,
    pub(super) meaning: String,
    pub(super) kind: Type,
    pub(super) unit: Option<String>,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    /// Every value that its cells can have, with its label; empty if there is no such
    /// list.
    pub(super) levels: Vec<(String, String)>,
    /// Whether the levels have an order.
    pub(super) ordered: bool,
    /// When a cell is empty.
    pub(super) empty: Option<String>,
    /// Whether a person typed its cells.
    pub(super) free: bool,
    /// Whether what was typed stands in every row of a session.
    pub(super) once: bool,
    /// Whether its cells tell when a session took place.
    pub(super) tells_when: bool,
}

impl Field {
    pub(super) fn new(kind: Type, name: &str, meaning: &str) -> Self {
        Self {
            name: name.to_owned(),
            title: None,
            meaning: meaning.to_owned(),
            kind,
            unit: None,
            min: None,
            max: None,
            levels: Vec::new(),
            ordered: false,
            empty: None,
            free: false,
            once: false,
            tells_when: false,
        }
    }

    /// As declared.
    fn declared(column: Column, name: &str) -> Self {
        let kind = match column.kind {
            Kind::Text | Kind::Level(_) | Kind::Answer => Type::Text,
            Kind::Whole => Type::Whole,
            Kind::Number => Type::Number,
            Kind::Flag => Type::Flag,
            Kind::Time => Type::Time,
        };
        let mut field = Self::new(kind, name, column.meaning);
        field.unit = column.unit.map(str::to_owned);
        field.free = column.typed != Typed::No;
        field.once = column.typed == Typed::Once;
        field.tells_when = column.tells_when;
        field.empty = column.empty.map(str::to_owned);
        if let Kind::Level(levels) = column.kind {
            let pair = |(value, label): &(&str, &str)| ((*value).to_owned(), (*label).to_owned());
            field.levels = levels.iter().map(pair).collect();
        }
        if column.kind == Kind::Whole {
            field.min = Some(0.0);
        }
        field
    }

    /// The answers to a question.
    fn question(column: Column, question: &Question) -> Self {
        let mut field = Self::declared(column, question.id.as_str());
        field.title = Some(question.prompt.clone());
        (field.min, field.max) = match question.kind.scale() {
            Scale::Levels { from, to, labels } => {
                field.kind = Type::Whole;
                field.ordered = true;
                if to - from < MAX_LEVELS {
                    let label = |n: i64| labels.get(&n).cloned().unwrap_or(n.to_string());
                    field.levels = (from..=to).map(|n| (n.to_string(), label(n))).collect();
                }
                (Some(from as f64), Some(to as f64))
            }
            Scale::Interval { from, to, labels } => {
                field.kind = Type::Number;
                let ends: Vec<String> = labels.iter().map(|(v, l)| format!("{v}: {l}")).collect();
                if !ends.is_empty() {
                    field.meaning = format!("{}. {}", field.meaning, ends.join("; "));
                }
                (Some(from), Some(to))
            }
            Scale::Open {
                unit,
                min,
                max,
                above,
            } => {
                field.kind = Type::Number;
                field.unit = unit.map(str::to_owned);
                (min.or(above), max)
            }
            Scale::Names { options, multiple } => {
                if multiple {
                    field.meaning = format!("{}. Options: {}", field.meaning, options.join("; "));
                } else {
                    field.levels = options.iter().map(|o| (o.clone(), o.clone())).collect();
                }
                (None, None)
            }
            Scale::Free => {
                field.free = true;
                (None, None)
            }
        };
        field
    }

    /// The name of its type in a dictionary.
    pub(super) fn type_name(&self) -> &'static str {
        match self.kind {
            Type::Text => "text",
            Type::Whole => "whole number",
            Type::Number => "number",
            Type::Flag => "true or false",
            Type::Time => "date and time",
        }
    }

    /// The level of measurement.
    pub(super) fn measurement(&self) -> &'static str {
        match self.kind {
            _ if self.ordered => "ordinal",
            Type::Text | Type::Flag => "nominal",
            Type::Whole | Type::Number | Type::Time => "continuous",
        }
    }
}

/// A table.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Table<'a> {
    /// Its name, also of its file.
    pub(super) name: &'static str,
    pub(super) meaning: &'static str,
    pub(super) fields: Vec<Field>,
    pub(super) rows: Vec<Vec<Cell<'a>>>,
    /// The columns that distinguish its rows.
    pub(super) key: &'static [&'static str],
    /// Column, and table and column to which it refers.
    pub(super) refers: &'static [(&'static str, &'static str, &'static str)],
}

impl<'a> Table<'a> {
    pub(super) fn place(&self, column: &str) -> Option<usize> {
        self.fields.iter().position(|f| f.name == column)
    }

    /// Removes columns.
    pub(super) fn drop_fields(&mut self, dropped: impl Fn(&Field) -> bool) {
        let keep: Vec<bool> = self.fields.iter().map(|f| !dropped(f)).collect();
        for row in &mut self.rows {
            let mut kept = keep.iter();
            row.retain(|_| *kept.next().unwrap_or(&true));
        }
        let mut kept = keep.iter();
        self.fields.retain(|_| *kept.next().unwrap_or(&true));
    }

    /// Adds a column.
    pub(super) fn add(&mut self, field: Field, cells: impl IntoIterator<Item = Cell<'a>>) {
        self.fields.push(field);
        for (row, cell) in self.rows.iter_mut().zip(cells) {
            row.push(cell);
        }
    }

    /// Text of the cells of a row.
    pub(super) fn text<'s>(&self, row: &'s [Cell<'a>], column: &str) -> Option<String>
    where
        'a: 's,
    {
        let cell = row.get(self.place(column)?)?;
        (*cell != Cell::Empty).then(|| clean(&cell.to_string()).into_owned())
    }
}

/// All tables of a data set.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Tables<'a> {
    pub(super) ratings: Table<'a>,
    pub(super) participants: Table<'a>,
    pub(super) realizations: Table<'a>,
    /// Only with parts.
    pub(super) intervals: Option<Table<'a>>,
}

fn table<'a, R: Row>(
    (name, meaning): (&'static str, &'static str),
    header: &Header<R::Column>,
    rows: &'a [R],
    field: impl Fn(R::Column, &str) -> Field,
) -> Table<'a> {
    let cells = |row: &'a R| {
        let cell = |(column, name): &(R::Column, String)| row.cell(*column, name);
        header.iter().map(cell).collect()
    };
    Table {
        name,
        meaning,
        fields: header.iter().map(|(c, n)| field(*c, n)).collect(),
        rows: rows.iter().map(cells).collect(),
        key: &[],
        refers: &[],
    }
}

/// Every realization of a study: those of the file, the levels of families, the points of
/// spaces, and the standards of tracks.
struct Realizations<'a> {
    protocol: &'a Protocol,
    ids: Vec<(ModelId, Option<(&'a str, f64)>)>,
}

impl<'a> Realizations<'a> {
    fn of(protocol: &'a Protocol) -> Self {
        let mut ids: Vec<(ModelId, Option<(&str, f64)>)> = protocol
            .models
            .iter()
            .map(|m| (m.id.clone(), None))
            .collect();
        for family in &protocol.families {
            let levels = family.realizations();
            ids.extend(levels.map(|(id, level)| (id, Some((family.id.as_str(), level)))));
        }
        for space in &protocol.spaces {
            let points = space.lattice.certified().iter();
            ids.extend(points.map(|point| (space.realization(*point), None)));
        }
        for track in &protocol.tracks {
            let level = track.family().zip(track.standard_level());
            let standard = track.standard();
            if ids.iter().all(|(id, _)| *id != standard) {
                ids.push((
                    standard,
                    level.map(|(family, level)| (family.as_str(), level)),
                ));
            }
        }
        Self { protocol, ids }
    }

    /// Each with a few words.
    fn levels(&self) -> Vec<(String, String)> {
        let label =
            |id: &ModelId, level: &Option<(&str, f64)>| match (level, self.protocol.model(id)) {
                (Some((family, level)), _) => format!("{family} {level}"),
                (None, Some(model)) => match model.vaf {
                    Some(vaf) => format!("{}, VAF {vaf:.4}", model.role.as_str()),
                    None => model.role.as_str().to_owned(),
                },
                (None, None) => id.to_string(),
            };
        (self.ids.iter())
            .map(|(id, level)| (id.to_string(), label(id, level)))
            .collect()
    }

    fn table(&self) -> Table<'static> {
        let mut id = Field::new(Type::Text, "id", "realization");
        id.levels = self.levels();
        let mut duplicate = Field::new(
            Type::Text,
            "duplicate_of",
            "realization of which it is a hidden repeat",
        );
        duplicate.empty = Some("it is none".to_owned());
        let mut family = Field::new(Type::Text, "family", "family to which it belongs");
        family.empty = Some("it is no level of a family".to_owned());
        let mut fields = vec![
            id,
            Field::declared(RatingColumn::Role.column(), "role"),
            duplicate,
            vaf_field(RatingColumn::Vaf.column()),
            family,
            level_field(
                Field::declared(RatingColumn::Level.column(), "level"),
                self.protocol,
            ),
        ];
        let header = RatingRow::header(self.protocol);
        let covariates = header
            .iter()
            .filter(|(c, _)| *c == RatingColumn::Covariates);
        let covariates: Vec<&str> = covariates.map(|(_, name)| name.as_str()).collect();
        fields.extend((covariates.iter()).map(|c| covariate_field(c)));
        fields.extend(self.protocol.factors.iter().map(factor_field));
        let number = |x: Option<f64>| x.map_or(Cell::Empty, Cell::Number);
        let text = |t: Option<&str>| t.map_or(Cell::Empty, |t| Cell::Text(t.to_owned().into()));
        let row = |(id, level): &(ModelId, Option<(&str, f64)>)| {
            let model = self.protocol.model(id);
            let role = model.map_or("test", |m| m.role.as_str());
            let duplicate = model.and_then(|m| m.duplicate_of.as_ref());
            let mut cells = vec![
                text(Some(id.as_str())),
                text(Some(role)),
                text(duplicate.map(ModelId::as_str)),
                number(model.and_then(|m| m.vaf)),
                text(level.map(|(family, _)| family)),
                number(level.map(|(_, level)| level)),
            ];
            cells.extend(
                (covariates.iter())
                    .map(|c| number(model.and_then(|m| m.covariates.get(*c)).copied())),
            );
            cells.extend(self.protocol.factors.iter().map(|factor| {
                let level = model.and_then(|m| m.levels.get(factor.id.as_str()));
                text(level.map(String::as_str))
            }));
            cells
        };
        Table {
            name: "realizations",
            meaning: "One row for each realization, in the order of the protocol.",
            rows: self.ids.iter().map(row).collect(),
            fields,
            key: &["id"],
            refers: &[],
        }
    }
}

fn vaf_field(column: Column) -> Field {
    let mut field = Field::declared(column, "vaf");
    field.max = Some(1.0);
    field
}

fn covariate_field(name: &str) -> Field {
    let column = RatingColumn::Covariates.column();
    let mut field = Field::declared(column, name);
    field.meaning = "covariate of the realization".to_owned();
    field
}

fn factor_field(factor: &Factor) -> Field {
    let mut field = Field::declared(RatingColumn::Levels.column(), factor.id.as_str());
    field.meaning = "level of the realization in the factor".to_owned();
    field.levels = (factor.levels.iter())
        .map(|level| (level.clone(), level.clone()))
        .collect();
    field.ordered = true;
    field
}

fn sent_field(mut field: Field, number: &DeviceNumber) -> Field {
    field.meaning = format!("{} that the controller program sent", number.name);
    field.unit = Some(number.unit.clone()).filter(|unit| unit != "1");
    field
}

/// The unit of a level is that of its family, if there is only one.
fn level_field(mut field: Field, protocol: &Protocol) -> Field {
    let units: Vec<_> = protocol.families.iter().map(|f| &f.unit).collect();
    if let Some(Some(unit)) = units.first()
        && units.iter().all(|u| u.as_ref() == Some(unit))
    {
        field.unit = Some(unit.clone());
    }
    field
}

impl<'a> Tables<'a> {
    pub(super) fn of(protocol: &'a Protocol, selected: &'a Selected, options: &Options) -> Self {
        let realizations = Realizations::of(protocol);
        let levels = realizations.levels();
        let is_realization = |name: &str| matches!(name, "model" | "previous_model");
        let plain = |column: Column, name: &str| {
            let mut field = Field::declared(column, name);
            match name {
                _ if column.repeats == Repeats::Covariate => field = covariate_field(name),
                _ if column.repeats == Repeats::Factor => {
                    let factor = protocol.factors.iter().find(|f| f.id.as_str() == name);
                    field = factor.map_or(field, factor_field);
                }
                _ if column.repeats == Repeats::Sent => {
                    let mut sent = protocol.numbers_of_device();
                    if let Some((_, number)) = sent.find(|(id, _)| id.as_str() == name) {
                        field = sent_field(field, number);
                    }
                }
                "vaf" | "rendered_vaf" | "delivered_vaf" => field.max = Some(1.0),
                "level" | "level_proposed" => field = level_field(field, protocol),
                name if is_realization(name) => field.levels.clone_from(&levels),
                _ => {}
            }
            field
        };
        let asked = |questions: &[&'a [Question]], column: Column, name: &str| {
            let mut all = questions.iter().copied().flatten();
            match all.find(|q| q.id.as_str() == name) {
                Some(question) if column.repeats == Repeats::Question => {
                    Field::question(column, question)
                }
                _ => plain(column, name),
            }
        };
        let mut in_trials: Vec<&'a [Question]> = vec![protocol.questions.as_slice()];
        let between = protocol.questionnaires.iter();
        in_trials.extend(between.map(|own| own.questions.as_slice()));
        let mut ratings = table(
            ("ratings", "One row for each planned trial."),
            &RatingRow::header_of(protocol, &selected.rows),
            &selected.rows,
            |c: RatingColumn, name| asked(&in_trials, c.column(), name),
        );
        ratings.key = &["participant", "session", "trial"];
        ratings.refers = &[
            ("participant", "participants", "participant"),
            ("model", "realizations", "id"),
        ];
        let forms: [&[Question]; 3] = [&protocol.setup, &protocol.intake, &protocol.outro];
        let mut participants = table(
            (
                "participants",
                "One row for each participant, by the last session.",
            ),
            &ParticipantRow::header(protocol),
            &selected.participants,
            |c: ParticipantColumn, name| {
                let mut field = asked(&forms, c.column(), name);
                if is_age(name) && field.kind == Type::Number {
                    field.kind = Type::Whole;
                    field.max = field.max.map(|m| m.min(OLDEST));
                    field.meaning += ". Whole years; above 89 written as 89";
                }
                field
            },
        );
        participants.key = &["participant"];
        let intervals = (!protocol.parts.is_empty()).then(|| {
            let mut table = table(
                (
                    "intervals",
                    "One row for each presentation, of failed attempts, too.",
                ),
                &IntervalRow::header(),
                &selected.intervals,
                |c: IntervalColumn, name| plain(c.column(), name),
            );
            table.key = &[
                "participant",
                "session",
                "trial",
                "attempt",
                "interval",
                "replays",
            ];
            table.refers = &[
                ("participant", "participants", "participant"),
                ("model", "realizations", "id"),
            ];
            table
        });
        let mut tables = Self {
            ratings,
            participants,
            realizations: realizations.table(),
            intervals,
        };
        for table in tables.all_mut() {
            table.drop_fields(|f| {
                (f.free && !options.comments)
                    || (options.redact_ids && f.name == "row")
                    || (options.redact_times && f.tells_when)
            });
        }
        if tables
            .realizations
            .rows
            .iter()
            .all(|row| row[4] == Cell::Empty)
        {
            let families = ["family", "level"];
            tables
                .realizations
                .drop_fields(|f| families.contains(&f.name.as_str()));
        }
        tables
    }

    pub(super) fn all(&self) -> impl Iterator<Item = &Table<'a>> {
        [&self.ratings, &self.participants, &self.realizations]
            .into_iter()
            .chain(&self.intervals)
    }

    fn all_mut(&mut self) -> impl Iterator<Item = &mut Table<'a>> {
        [
            &mut self.ratings,
            &mut self.participants,
            &mut self.realizations,
        ]
        .into_iter()
        .chain(&mut self.intervals)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use study_base::text::QuestionId;
    use study_plan::protocol::{QuestionKind, kinds};

    fn field(kind: QuestionKind) -> Field {
        let question = Question {
            id: QuestionId::new("q").unwrap(),
            prompt: "?".to_owned(),
            kind,
            required: true,
        };
        Field::question(RatingColumn::Questions.column(), &question)
    }

    #[test]
    fn a_scale_lists_its_levels_up_to_a_hundred_and_one() {
        let levels = |to| {
            let (from, labels) = (0, [(0, "none".to_owned())].into());
            field(QuestionKind::Rating(kinds::Rating { from, to, labels })).levels
        };
        assert_eq!(levels(100).len(), 101);
        assert_eq!(levels(100)[0], ("0".to_owned(), "none".to_owned()));
        assert!(levels(101).is_empty());
    }

    #[test]
    fn the_least_value_of_a_number_is_its_least_or_what_it_has_to_be_above() {
        let range = |min, above| {
            let (unit, max) = (None, Some(9.0));
            let number = field(QuestionKind::Number(kinds::Number {
                unit,
                min,
                max,
                above,
            }));
            (number.min, number.max)
        };
        assert_eq!(range(Some(2.0), None), (Some(2.0), Some(9.0)));
        assert_eq!(range(None, Some(0.0)), (Some(0.0), Some(9.0)));
        assert_eq!(range(None, None), (None, Some(9.0)));
    }
}
