//! The one integration test binary.
#![allow(clippy::unwrap_used, reason = "a test that cannot go on panics")]

mod board;
mod energies;
mod facets;
mod figures;
mod files;
mod fixtures;
mod fold;
mod job;
mod layout;
mod machine;
mod meshes;
mod mill;
mod net;
mod newcomer;
mod page;
mod pieces;
mod plain;
mod ports;
mod registry;
mod send;
mod sheets;
mod sphere;
mod streamed;
mod stripes;
mod strips;
mod strokes;
mod tidy;
