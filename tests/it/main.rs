//! The one integration test binary.

mod files;
mod job;
mod pieces;
mod registry;
mod tidy;
