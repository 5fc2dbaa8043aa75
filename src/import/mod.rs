//! Readers: meshes, drawings (SVG, DXF, HPGL) and machine programs (G-code), our own and other people's.

mod drawing;
mod dxf;
pub mod gcode;
mod hpgl;
pub mod mesh;
mod svg;

pub use drawing::{Drawing, DrawingError, DrawnLine};
pub use dxf::read_dxf;
pub use gcode::read_gcode;
pub use hpgl::read_hpgl;
pub use svg::read_svg;
