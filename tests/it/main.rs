//! The one integration test binary.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]

mod energies;
mod figures;
mod files;
mod fixtures;
mod job;
mod meshes;
mod pieces;
mod registry;
mod tidy;
