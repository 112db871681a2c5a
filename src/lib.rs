//! `study`: haptic experiments, from probe recordings to a report.
//!
//! record → identify → validate → play back → rate → analyze. The method is that of
//! Colton & Hollerbach, "Haptic Models of an Automotive Turn-Signal Switch", World
//! Haptics 2007. The central part is the experiment runner: a session cannot be
//! repeated, and a device can injure.
//!
//! # Layers
//!
//! A crate or module uses only layers above its own line, and of those only what
//! `tests/architecture.rs` lists. `docs/architecture.md` describes each.
//!
//! | layer | crates and modules |
//! |---|---|
//! | 0 | `study-base` (text, limits, diagnostic, rng), `study-wire` (serial format, servo), `study-stats` |
//! | 1 | `study-haptics` (trajectory, plant, recording, identify, model); `study-plan` (protocol, procedure, schedule) |
//! | 2 | `study-session` (outcome, session, rendering, store) |
//! | 3 | `study-analysis` (analyze, power, preregister, export); `study-device`; [`rater`] |
//! | 4 | `study-report`; [`runner`], [`doctor`] |
//! | 5 | [`tui`]; [`plain`], [`screen`] |
//! | 6 | [`cli`] |
//!
//! Input and output happen only in `store`, `tui`, `plain`, `screen`, `runner` (the
//! clock), `link` and `process` of `study-device`, and `cli`. Everywhere else time, randomness and identity
//! are arguments.
//!
//! # Glossary
//!
//! * **protocol**: the study file. The serial format is called **wire**.
//! * **realization**: the parameters of a haptic model, the paper's word. In file
//!   formats its key is `model`; a **model file** holds one. **fit**: a statistical model.
//! * **study**: one protocol and everything that was collected with it.
//! * **participant**: a person who takes part, under a pseudonym. **rater**: a simulated
//!   participant. **operator**: who runs the session, also called the experimenter.
//! * **row**: a place in the planned orders; **seat**: a row, or the number of a
//!   pilot or simulated participant, which use no row.
//! * **session**: one sitting of a participant. **block**: a part of a session in
//!   which each realization comes once. **trial**: one planned presentation.
//!   **attempt**: one try at a trial; a failed one is repeated.
//! * **answer**: to one question; **outcome**: everything known about a trial.
//!   **measured outcome**: a number that is measured in a trial besides its questions, such as a time.
//! * **recording**: what a probe measured. **telemetry**: what a device reports.
//! * **limp**: a device that produces no force.
//! * **VAF**: variance accounted for, 1 − var(F − F̂)/var(F), of a realization on
//!   a recording it was not identified from.
//! * `lambda`: forgetting factor; `dx`: resampling increment; `m`, `b`, `k`, `F0`:
//!   mass, damping, stiffness, offset force. The paper's symbols.

pub mod cli;
pub mod doctor;
pub mod front;
pub mod plain;
pub mod rater;
pub mod rehearsal;
pub mod runner;
pub mod screen;
pub mod tui;
