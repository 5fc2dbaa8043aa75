//! Readers: meshes, drawings (SVG, DXF, PDF, HPGL) and machine programs (G-code), our own and other people's.

mod drawing;
mod dxf;
pub mod gcode;
mod hpgl;
pub mod mesh;
mod pdf;
mod svg;

pub use drawing::{Drawing, DrawingError, DrawnLine};
pub use dxf::read_dxf;
pub use gcode::read_gcode;
pub use hpgl::read_hpgl;
pub use pdf::read_pdf;
pub use svg::read_svg;
