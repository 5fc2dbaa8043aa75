//! The one integration test binary.

mod files;
mod job;
mod registry;
mod tidy;
mod pieces;
