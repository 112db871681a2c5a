//! Statistics of thresholds and comparisons: tracks, psychometric functions, detection,
//! paired preferences, magnitude estimation, MUSHRA, identification, similarity, ranking, adjustment. Each function takes what was
//! answered and returns statistics as records; `docs/statistics-psychophysics.md`
//! defines them.

mod abilities;
mod adjustment;
mod again;
mod counting;
pub(crate) mod decided;
mod detection;
mod discriminations;
mod excluded;
mod explored;
mod findings;
mod fits;
mod identification;
mod marginal;
mod of_adjustment;
mod of_identification;
mod of_ranking;
mod of_scales;
mod of_similarity;
mod over_participants;
mod part_data;
pub mod perceptual;
mod population;
mod preferences;
mod questionnaires;
mod ranking;
pub mod results;
mod scales;
pub mod search;
mod sequential;
mod similarity;
mod standards;
mod study;
mod table;
mod tracks;
mod trials;

pub use adjustment::{SettingRow, adjustment};
pub use detection::{Detection, Task, detection};
pub(crate) use discriminations::{have_ratios, settings as track_settings};
pub use findings::{PartFinding, PartQuestion};
pub use fits::{FitCell, FitSettings, psychometric};
pub use identification::{LabelRow, OwnConfusions, identification};
pub use over_participants::Measured;
pub use part_data::{LevelData, PartAnalysis, PartData, StudyData};
pub(crate) use part_data::{asked, sessions_of};
pub use preferences::{Choice, Preference, preferences};
pub use ranking::{RankingRow, ranking};
pub use scales::{MagnitudeRow, MushraRoles, MushraRow, magnitude, mushra};
pub use similarity::{Properties, SimilarityRow, similarity};
pub use study::parts;
pub(crate) use study::searchers_of;
pub(crate) use table::{PARTICIPANT, correct_column};
pub use table::{TableError, TableKind, analyze_table, read_table};
pub use tracks::{TrackData, TrackTrial, quest_plus, staircase, track_order};
pub use trials::{Asked, TrialCount, TrialSettings, discrimination};
