//! The one integration test binary.

mod files;
mod fixtures;
mod job;
mod meshes;
mod pieces;
mod registry;
mod tidy;
