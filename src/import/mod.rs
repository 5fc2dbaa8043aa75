//! Readers: meshes, drawings (SVG, DXF, FOLD, PDF, HPGL), tables of points and machine programs (G-code), our own and other people's.

mod creases;
mod drawing;
mod dxf;
mod fold;
pub mod gcode;
mod hpgl;
pub mod mesh;
mod pdf;
mod points;
mod svg;

pub use creases::{Assignment, Borders, CreaseFacts, CreaseRoles, PatternError, ReadPattern, pattern};
pub use drawing::{Drawing, DrawingError, DrawnLine};
pub use dxf::read_dxf;
pub use fold::read_fold;
pub use gcode::read_gcode;
pub use hpgl::read_hpgl;
pub use pdf::read_pdf;
pub use points::{NoPoint, read_points};
pub use svg::read_svg;
