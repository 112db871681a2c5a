//! `study`: from probe recordings of a haptic device to a defended result.
//!
//! record → identify → validate → play back → rate → analyze. The heart is the
//! experiment runner: what a subject says in an hour is irreplaceable, and the
//! device can hurt somebody. The method is that of Colton & Hollerbach, "Haptic
//! Models of an Automotive Turn-Signal Switch", World Haptics 2007.
//!
//! # Layers
//!
//! A module imports only from layers above its own line, and of those only what
//! `tests/architecture.rs` lists.
//!
//! | layer | modules |
//! |---|---|
//! | 0 | [`rng`], [`text`], [`limits`], [`diagnostic`] |
//! | 1 | [`protocol`], [`model`], [`trajectory`], [`recording`], [`stats`] |
//! | 2 | [`schedule`], [`outcome`], [`plant`], [`identify`] |
//! | 3 | [`session`], [`store`], [`device`], [`rater`], [`analyze`] |
//! | 4 | [`runner`], [`report`] |
//! | 5 | [`tui`] |
//! | 6 | [`cli`] |
//!
//! Input and output happen only in `store`, `tui`, `runner` (the clock),
//! `device::{link, serial, process}` and
//! `cli`. Everywhere else time, randomness and identity are arguments.
//!
//! # Glossary
//!
//! * **protocol**: the study file. Never the serial one, which is the **wire**.
//! * **realization**: a haptic model's parameters, the paper's word. **fit** is a
//!   statistical one.
//! * **study**: one protocol and everything that was gathered with it.
//! * **participant**: who takes part, under a pseudonym. **operator**: who runs
//!   the session. **rater**: a simulated participant.
//! * **row**: a place in the planned orders; **seat**: a row, or the number of a
//!   pilot or simulated participant, which take no row.
//! * **session**: one sitting of a participant. **block**: a part of a session in
//!   which each realization comes once. **trial**: one planned presentation.
//!   **attempt**: one try at a trial; a failed one comes back.
//! * **answer**: to one question; **outcome**: everything known of a trial.
//! * **recording**: what a probe measured. **telemetry**: what a device reports.
//! * **VAF**: variance accounted for, 1 − var(F − F̂)/var(F), of a realization on
//!   a recording it was not identified from.
//! * `lambda`: forgetting factor; `dx`: resampling increment; `m`, `b`, `k`, `F0`:
//!   mass, damping, stiffness, offset force. The paper's symbols.

pub mod cli;
pub mod device;
pub mod rater;
pub mod report;
pub mod runner;
pub mod tui;
