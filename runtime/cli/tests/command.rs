//! All suites of the command but those that need a machine of their own (`large.rs`) or a library (`petsc.rs`), in one program.
//!
//! `cargo test --workspace --test command folder::` runs those of one file.

mod accuracy;
mod accuracy_campaign;
mod commands;
mod common;
mod consistency;
mod editors;
mod finite;
mod folder;
mod gradient;
mod guide;
mod known_solutions;
mod memory;
mod mesh;
mod messages;
mod new;
mod pairs;
mod plot;
mod prune;
mod refine;
mod report;
mod resume;
mod run_command;
mod singular;
mod statements;
mod strangers;
mod surfaces;
mod sweep;
mod tables;
mod truth;
mod watch;
