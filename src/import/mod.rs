//! Readers: meshes here, drawings and machine programs beside them.

pub mod mesh;
