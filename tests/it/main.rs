//! The one integration test binary.

mod job;
mod registry;
mod tidy;
