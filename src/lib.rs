//! `fabricate` turns a 3-D shape into flat pieces that a machine can cut and a person can assemble.
//!
//! Data flows down one stair, and the modules are the stair:
//!
//! ```text
//! file ─ TriMesh ─ DevelopableMesh ─ CutMesh ─ Flattening ─ Parts ─ Sheets ─ Toolpaths ─ files
//!      coarsen   develop           cut      flatten      layout  nest     route      emit
//! ```
//!
//! `geom` and `numeric` know nothing of ours; `mesh` builds on them, `surface` on `mesh`; `model` holds the nouns that
//! cross stages; each folder of `stages` is one step (a pure kernel in `mod.rs`, its config table and adapter in
//! `stage.rs`); `pipeline` plans, caches and runs them; only `cli` prints. `tests/it/tidy.rs` holds the imports to this.
//!
//! Inside everything is f64, millimetres and radians; units exist only in the config, the profiles and the emitters.
//! The same config and seed give the same bytes on any number of threads.

pub mod cli;
pub mod emit;
pub mod geom;
pub mod import;
pub mod machine;
pub mod mesh;
pub mod model;
pub mod numeric;
pub mod pipeline;
pub mod profile;
pub mod render;
pub mod report;
pub mod stage;
pub mod stages;
pub mod surface;
