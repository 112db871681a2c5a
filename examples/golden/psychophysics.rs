//! Reference files of psychophysics, by their `kind`: from the settings and rows of
//! `input` to the functions of `study_analysis::analyze::psychophysics`.

use serde::de::{DeserializeOwned, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value as Json, json};
use study_analysis::analyze::psychophysics as analysis;
use study_analysis::analyze::results::Field;
use study_analysis::analyze::{Value, Values, group_id};
use study_base::rng::Stream;
use study_plan::procedure::{Function, Parameter, Passes, QuestPlus, Scale, Staircase, Stop};
use study_plan::procedure::{quest, staircase};
use study_stats::detection::Answers;
use study_stats::mushra::Screening;
use study_stats::psychometric::{Core, Experiment, Level, Priors, Spacing};

/// Seed of the bootstrap of the deviance.
const SEED: u64 = 2007;

#[derive(Debug, thiserror::Error)]
pub(crate) enum Error {
    #[error("{0} is missing or is no {1}")]
    Key(String, &'static str),
    #[error("{0} `{1}` is not known")]
    Unknown(&'static str, String),
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    #[error(transparent)]
    Procedure(#[from] study_plan::procedure::ProcedureError),
}

/// The values of a reference file; an undefined one is null.
pub(crate) fn values(text: &str) -> Result<Map<String, Json>, Error> {
    let document: Json = serde_json::from_str(text)?;
    let kind = Settings(&document).text("kind")?;
    let input = &Settings(document.get("input").unwrap_or(&Json::Null));
    let found = match kind {
        "questplus" => vec![(String::new(), quest_plus(input, text)?)],
        "staircase" => vec![(String::new(), staircases(input)?)],
        "psychometric" | "psychometric_group" | "psychometric_edge" => {
            vec![(String::new(), psychometric(input)?)]
        }
        "sdt" => vec![(String::new(), detection(input)?)],
        "pairs" => vec![(String::new(), pairs(input, &input.rows()?)?)],
        "pairs_edge" => cases(input)?,
        "magnitude" => vec![(String::new(), magnitude(input)?)],
        "mushra" => vec![(String::new(), mushra(input)?)],
        "identification" => vec![(String::new(), identification(input)?)],
        "similarity" => vec![(String::new(), similarity(input)?)],
        "ranking" => vec![(String::new(), ranking(input)?)],
        "adjustment" => vec![(String::new(), adjustment(input)?)],
        other => return Err(Error::Unknown("the kind", other.to_owned())),
    };
    let mut printed = Map::new();
    for (prefix, values) in &found {
        for (id, value) in values.iter() {
            let value = match value {
                Value::Number(x) => json!(x),
                Value::List(list) => json!(list),
                Value::Undefined(_) => Json::Null,
            };
            printed.insert(format!("{prefix}{id}"), value);
        }
    }
    Ok(printed)
}

/// The settings of an input.
#[derive(Clone, Copy)]
struct Settings<'a>(&'a Json);

impl<'a> Settings<'a> {
    fn get<T: DeserializeOwned>(&self, key: &str, what: &'static str) -> Result<T, Error> {
        self.known(key)
            .ok_or_else(|| Error::Key(key.to_owned(), what))
    }

    /// `None` if it is missing, null or of another type.
    fn known<T: DeserializeOwned>(&self, key: &str) -> Option<T> {
        serde_json::from_value(self.0.get(key)?.clone()).ok()
    }

    fn text(&self, key: &str) -> Result<&'a str, Error> {
        let text = self.0.get(key).and_then(Json::as_str);
        text.ok_or_else(|| Error::Key(key.to_owned(), "text"))
    }

    fn number(&self, key: &str) -> Result<f64, Error> {
        self.get(key, "number")
    }

    fn rows(&self) -> Result<Vec<Row<'a>>, Error> {
        let columns: Vec<String> = self.get("columns", "list")?;
        let rows = self.0.get("rows").and_then(Json::as_array);
        let rows = rows.ok_or_else(|| Error::Key("rows".to_owned(), "list"))?;
        Ok((rows.iter())
            .map(|row| Row {
                columns: columns.clone(),
                cells: row.as_array().map(Vec::as_slice).unwrap_or_default(),
            })
            .collect())
    }
}

struct Row<'a> {
    columns: Vec<String>,
    cells: &'a [Json],
}

impl Row<'_> {
    fn cell(&self, column: &str) -> Option<&Json> {
        self.cells
            .get(self.columns.iter().position(|c| c == column)?)
    }

    fn number(&self, column: &str) -> Result<f64, Error> {
        let cell = self.cell(column).and_then(Json::as_f64);
        cell.ok_or_else(|| Error::Key(column.to_owned(), "number"))
    }

    /// The cell as text, also of a number.
    fn name(&self, column: &str) -> Option<String> {
        match self.cell(column)? {
            Json::String(text) => Some(text.clone()),
            Json::Null => None,
            other => Some(other.to_string()),
        }
    }

    /// Cell `place` of the row, after the names.
    fn at(&self, place: usize) -> Result<f64, Error> {
        let cell = self.cells.get(place).and_then(Json::as_f64);
        let column = self.columns.get(place).cloned().unwrap_or_default();
        cell.ok_or(Error::Key(column, "number"))
    }
}

/// Named lists in the order of the file, which `serde_json::Value` does not keep.
struct Grids(Vec<(String, Vec<f64>)>);

impl<'de> Deserialize<'de> for Grids {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Lists;
        impl<'de> Visitor<'de> for Lists {
            type Value = Grids;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("lists by name")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Grids, A::Error> {
                let mut lists = Vec::new();
                while let Some(list) = map.next_entry()? {
                    lists.push(list);
                }
                Ok(Grids(lists))
            }
        }
        deserializer.deserialize_map(Lists)
    }
}

#[derive(Deserialize)]
struct QuestFile {
    input: QuestInput,
}

#[derive(Deserialize)]
struct QuestInput {
    stimulus: Grids,
    parameters: Grids,
}

fn quest_plus(input: &Settings, text: &str) -> Result<Values, Error> {
    let file: QuestFile = serde_json::from_str(text)?;
    let dimensions = file.input.stimulus.0;
    let prior = Settings(input.0.get("prior").unwrap_or(&Json::Null));
    let parameters = (file.input.parameters.0.into_iter())
        .map(|(name, values)| Parameter {
            prior: prior.known(&name),
            name,
            values,
        })
        .collect();
    let answers: Vec<f64> = input.get("responses", "list")?;
    let presented: Vec<Vec<f64>> = input.get("presented", "list")?;
    let formula = |text: &str| Function::Formula(text.to_owned());
    let function = match Function::parse(input.text("function")?) {
        // A function of another name, or other dimensions: as the file writes it.
        Function::Formula(_) => formula(input.text("formula")?),
        named if dimensions.iter().any(|d| d.0 == "intensity") => named,
        _ => formula(input.text("formula")?),
    };
    let trials = u32::try_from(answers.len()).unwrap_or(u32::MAX).max(1);
    let rule = QuestPlus::new(function, parameters, trials);
    let mut track = quest::Progress::new(&rule, &dimensions)?;
    let mut proposed: Vec<(&str, Vec<f64>)> = (dimensions.iter())
        .map(|d| (d.0.as_str(), Vec::new()))
        .collect();
    let mut entropy = Vec::new();
    for (answer, presented) in answers.iter().zip(&presented) {
        let Some(next) = track.next() else {
            break;
        };
        for (list, level) in proposed.iter_mut().zip(next) {
            list.1.push(*level);
        }
        entropy.push(track.expected_entropy());
        track.answer(presented, *answer > 0.5);
    }
    let summary = track.summary();
    let entropies = Some((&entropy[..], track.entropy()));
    let found = analysis::quest_plus(&proposed, entropies, &summary);
    let names = [input.text("participant")?, input.text("track")?];
    Ok(named(&group_id("track", &names), &found))
}

/// The statistics of a record with this identifier.
fn named(id: &str, record: &impl Field) -> Values {
    let mut values = Values::default();
    record.put(id, &mut values);
    values
}

/// The rule of one track; what it does not state is that of the file.
fn up_down(track: &Settings, input: &Settings) -> Result<Staircase, Error> {
    fn known<T: DeserializeOwned>(track: &Settings, input: &Settings, key: &str) -> Option<T> {
        track.known(key).or_else(|| input.known(key))
    }
    fn get<T: DeserializeOwned>(track: &Settings, input: &Settings, key: &str) -> Result<T, Error> {
        known(track, input, key).ok_or_else(|| Error::Key(key.to_owned(), "number"))
    }
    let scale: String = get(track, input, "scale")?;
    Ok(Staircase {
        up: get(track, input, "up")?,
        down: get(track, input, "down")?,
        start: get(track, input, "start")?,
        steps: get(track, input, "steps")?,
        scale: match scale.to_lowercase().as_str() {
            "lin" | "linear" => Scale::Lin,
            "log" => Scale::Log,
            "db" => Scale::Db,
            _ => return Err(Error::Unknown("the scale", scale)),
        },
        step_up_factor: known(track, input, "step_up_factor").unwrap_or(1.0),
        min_level: known(track, input, "min_level"),
        max_level: known(track, input, "max_level"),
        initial_one_up_one_down: known(track, input, "initial_one_up_one_down").unwrap_or(true),
        stop: Stop {
            reversals: get(track, input, "stop_reversals")?,
            min_trials: known(track, input, "min_trials").unwrap_or(0),
            max_trials: known(track, input, "max_trials").unwrap_or(u32::MAX),
        },
        estimate_last: get(track, input, "estimate_last")?,
    })
}

struct Stairs<'a> {
    name: &'a str,
    rule: Staircase,
    progress: staircase::Progress,
    levels: Vec<f64>,
}

impl<'a> Stairs<'a> {
    fn new(track: &Settings<'a>, input: &Settings) -> Result<Self, Error> {
        let rule = up_down(track, input)?;
        Ok(Self {
            name: track.text("track")?,
            progress: staircase::Progress::new(&rule, None)?,
            rule,
            levels: Vec::new(),
        })
    }

    fn answer(&mut self, positive: bool) {
        if let Some(level) = self.progress.next() {
            self.levels.push(level);
            self.progress.answer(positive);
        }
    }
}

fn staircases(input: &Settings) -> Result<Values, Error> {
    let participant = input.text("participant")?;
    let mut found = Values::default();
    let print = |stairs: &Stairs, found: &mut Values| {
        let summary = stairs.progress.summary();
        let track = analysis::staircase(&stairs.rule, &stairs.levels, &summary);
        let id = group_id("track", &[participant, stairs.name]);
        track.put(&id, found);
    };
    let Some(tracks) = input.0.get("tracks").and_then(Json::as_array) else {
        let mut stairs = Stairs::new(input, input)?;
        for answer in input.get::<Vec<f64>>("responses", "list")? {
            stairs.answer(answer > 0.5);
        }
        print(&stairs, &mut found);
        return Ok(found);
    };
    let mut tracks = (tracks.iter())
        .map(|track| Stairs::new(&Settings(track), input))
        .collect::<Result<Vec<_>, _>>()?;
    let responses: Vec<Json> = input.get("responses", "list")?;
    let mut passes = Passes::new(tracks.len(), None::<Stream>);
    let mut order = Vec::new();
    for response in &responses {
        let Some(turn) = passes.next(|t| tracks[t].progress.next().is_none()) else {
            break;
        };
        order.push(turn);
        tracks[turn].answer(Settings(response).number("correct")? > 0.5);
    }
    for stairs in &tracks {
        print(stairs, &mut found);
    }
    let id = group_id("track", &[participant, "order"]);
    analysis::track_order(&order).put(&id, &mut found);
    Ok(found)
}

fn psychometric(input: &Settings) -> Result<Values, Error> {
    let core = input.text("core")?;
    let core = Core::named(core).ok_or_else(|| Error::Unknown("the core", core.to_owned()))?;
    if input
        .known::<f64>("alpha")
        .is_some_and(|alpha| alpha != 0.05)
    {
        let alpha = input.number("alpha")?;
        return Err(Error::Unknown("alpha", alpha.to_string()));
    }
    let gamma = input.number("gamma")?;
    let experiment = match input.text("experiment")? {
        "afc" => Experiment::ForcedChoice(gamma),
        "yesno" => Experiment::YesNo,
        "eq" => Experiment::Comparison,
        other => return Err(Error::Unknown("the experiment", other.to_owned())),
    };
    let name = |row: &Row, key: &str| {
        let own = row.name(key).or_else(|| input.known(key));
        own.ok_or_else(|| Error::Key(key.to_owned(), "text"))
    };
    let mut cells: Vec<analysis::FitCell> = Vec::new();
    for row in input.rows()? {
        let (participant, condition) = (name(&row, "participant")?, name(&row, "condition")?);
        let positive = row.number("correct").or_else(|_| row.number("yes"))?;
        let level = Level {
            level: row.number("level")?,
            positive,
            trials: row.number("trials")?,
        };
        let same =
            |c: &&mut analysis::FitCell| c.participant == participant && c.condition == condition;
        match cells.iter_mut().find(same) {
            Some(cell) => cell.levels.push(level),
            None => cells.push(analysis::FitCell {
                participant,
                condition,
                levels: vec![level],
            }),
        }
    }
    let settings = analysis::FitSettings {
        core,
        spacing: Spacing::Lin,
        experiment,
        gamma,
        lambda: input.number("lambda")?,
        lapse_most: input.known("lapse_max"),
        standard: input.known("standard"),
        priors: Priors::schuett(None),
        repeats: 2_000,
        seed: SEED,
    };
    Ok(analysis::psychometric(&cells, &settings).values())
}

fn detection(input: &Settings) -> Result<Values, Error> {
    let task = match input.text("task")? {
        "yes-no" => analysis::Task::YesNo,
        "2afc" | "2-afc" => analysis::Task::TwoAlternative,
        "oddity" => analysis::Task::Oddity,
        "abx" => analysis::Task::Abx,
        "same-different" => analysis::Task::SameDifferent,
        other => {
            let m = other
                .strip_suffix("-afc")
                .or_else(|| other.strip_suffix("afc"));
            let m = m.and_then(|m| m.parse().ok());
            let unknown = || Error::Unknown("the task", other.to_owned());
            analysis::Task::ForcedChoice(m.ok_or_else(unknown)?)
        }
    };
    let raw: Vec<String> = input.known("uncorrected").unwrap_or_default();
    let mut cells = Vec::new();
    for row in input.rows()? {
        let participant = row
            .name("participant")
            .or_else(|| input.known("participant"));
        let condition = row.name("condition").unwrap_or_else(|| "all".to_owned());
        // The counts follow the names, in the order of the columns.
        let first = row
            .columns
            .iter()
            .take_while(|c| ["participant", "condition"].contains(&c.as_str()));
        let first = first.count();
        let several = row.cells.len() >= first + 4;
        let answers = Answers {
            hits: row.at(first)?,
            n_hits: row.at(first + 1)?,
            false_alarms: if several { row.at(first + 2)? } else { 0.0 },
            n_false_alarms: if several { row.at(first + 3)? } else { 0.0 },
        };
        cells.push(analysis::Detection {
            participant: participant.ok_or_else(|| Error::Key("participant".to_owned(), "text"))?,
            raw: raw.contains(&condition),
            condition,
            answers,
        });
    }
    Ok(named("sdt", &analysis::detection(task, &cells)))
}

fn pairs(input: &Settings, rows: &[Row]) -> Result<Values, Error> {
    let mut preferences = Vec::new();
    for row in rows {
        let text = |key: &str| {
            row.name(key)
                .ok_or_else(|| Error::Key(key.to_owned(), "text"))
        };
        let participant = match input.known::<String>("cluster") {
            Some(column) => text(&column)?,
            None => String::new(),
        };
        let choices = match row.name("answer") {
            Some(answer) => vec![match answer.as_str() {
                "first" => analysis::Choice::First(1.0),
                "second" => analysis::Choice::Second(1.0),
                _ => analysis::Choice::Tie(1.0),
            }],
            None => vec![
                analysis::Choice::First(row.number("first_preferred")?),
                analysis::Choice::Second(row.number("second_preferred")?),
                analysis::Choice::Tie(row.number("tied").unwrap_or(0.0)),
            ],
        };
        for choice in choices {
            preferences.push(analysis::Preference {
                participant: participant.clone(),
                first: text("first")?,
                second: text("second")?,
                choice,
            });
        }
    }
    let ties = match input.text("ties")? {
        "davidson" => true,
        "none" => false,
        other => return Err(Error::Unknown("the treatment of ties", other.to_owned())),
    };
    let order = input.known("order_effect").unwrap_or(false);
    let found = analysis::preferences(&preferences, ties, order);
    Ok(named("pairs", &found))
}

/// Several data sets in one table, by the column `case`.
fn cases(input: &Settings) -> Result<Vec<(String, Values)>, Error> {
    let mut cases: Vec<(String, Vec<Row>)> = Vec::new();
    for row in input.rows()? {
        let case = row
            .name("case")
            .ok_or_else(|| Error::Key("case".to_owned(), "text"))?;
        match cases.iter_mut().find(|c| c.0 == case) {
            Some(found) => found.1.push(row),
            None => cases.push((case, vec![row])),
        }
    }
    (cases.into_iter())
        .map(|(case, rows)| Ok((format!("{case}/"), pairs(input, &rows)?)))
        .collect()
}

fn magnitude(input: &Settings) -> Result<Values, Error> {
    let rows = (input.rows()?.iter())
        .map(|row| {
            Ok(analysis::MagnitudeRow {
                participant: row.name("participant").unwrap_or_default(),
                level: row.number("level")?,
                estimate: row.number("estimate")?,
            })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    Ok(named("magnitude", &analysis::magnitude(&rows)))
}

fn identification(input: &Settings) -> Result<Values, Error> {
    let labels: Vec<String> = input.get("labels", "list")?;
    let rows = (input.rows()?.iter())
        .map(|row| {
            let place = |column: &str| {
                let label = row.name(column);
                let place = label.and_then(|label| labels.iter().position(|l| *l == label));
                place.ok_or_else(|| Error::Key(column.to_owned(), "label"))
            };
            Ok(analysis::LabelRow {
                participant: row.name("participant").unwrap_or_default(),
                realization: row.name("realization"),
                right: place("target")?,
                given: place("answer")?,
            })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let found = analysis::identification(&rows, &labels).0;
    Ok(named("identification", &found))
}

fn similarity(input: &Settings) -> Result<Values, Error> {
    let rows = (input.rows()?.iter())
        .map(|row| {
            Ok(analysis::SimilarityRow {
                participant: row.name("participant").unwrap_or_default(),
                first: row.name("first").unwrap_or_default(),
                second: row.name("second").unwrap_or_default(),
                rating: row.number("rating")?,
            })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let none = analysis::Properties::new();
    let found = analysis::similarity(&rows, &none, (SEED, "table"));
    Ok(named("similarity", &found))
}

fn ranking(input: &Settings) -> Result<Values, Error> {
    let rows = (input.rows()?.iter())
        .map(|row| {
            Ok(analysis::RankingRow {
                participant: row.name("participant").unwrap_or_default(),
                ranking: row.name("ranking").unwrap_or_default(),
                realization: row.name("realization").unwrap_or_default(),
                rank: row.number("rank")?,
            })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let found = analysis::ranking(&rows, (SEED, "table"));
    Ok(named("ranking", &found))
}

fn adjustment(input: &Settings) -> Result<Values, Error> {
    let rows = (input.rows()?.iter())
        .map(|row| {
            let start = row.name("start").unwrap_or_default();
            Ok(analysis::SettingRow {
                participant: row.name("participant").unwrap_or_default(),
                level: row.number("level")?,
                ascending: match start.as_str() {
                    "below" => true,
                    "above" => false,
                    _ => return Err(Error::Unknown("the start", start)),
                },
                changes: row.number("changes").ok(),
            })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let found = analysis::adjustment(&rows, input.known("standard"), (SEED, "table"));
    Ok(named("adjustment", &found))
}

fn mushra(input: &Settings) -> Result<Values, Error> {
    let rows = (input.rows()?.iter())
        .map(|row| {
            Ok(analysis::MushraRow {
                participant: row.name("participant").unwrap_or_default(),
                condition: row.name("condition").unwrap_or_default(),
                rating: row.number("rating")?,
            })
        })
        .collect::<Result<Vec<_>, Error>>()?;
    let roles = analysis::MushraRoles {
        reference: input.get("reference", "text")?,
        mid_anchor: input.known("mid_anchor"),
    };
    let known = Screening::default();
    let screening = Screening {
        reference_below: input
            .known("reference_below")
            .unwrap_or(known.reference_below),
        anchor_above: input.known("anchor_above").unwrap_or(known.anchor_above),
        more_than_percent: input
            .known("more_than")
            .map_or(known.more_than_percent, |share: f64| {
                (share * 1e11).round() / 1e9
            }),
    };
    let (kept, all) = analysis::mushra(&rows, &roles, &screening);
    let mut found = named("mushra", &kept);
    all.put("mushra_unscreened", &mut found);
    Ok(found)
}
