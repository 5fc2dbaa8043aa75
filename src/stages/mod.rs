//! One folder per stage: `mod.rs` is the pure kernel, `stage.rs` its config table and adapter.

pub mod coarsen;
pub mod cut;
pub mod develop;
pub mod flatten;
pub mod fold;
pub mod layout;
pub mod mill;
pub mod mold;
pub mod nest;
pub mod net;
pub mod route;
pub mod sphere;
pub mod stripes;
pub mod strips;
pub mod unfold;
