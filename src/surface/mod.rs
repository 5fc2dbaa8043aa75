//! Algorithms on surfaces that several stages share: edge collapse, charts, flattening, cut graphs, opening, directions of
//! rulings, sphere maps, subdivision, direction fields and parameterisations along them.

pub mod boundary_first;
pub mod chart;
pub mod collapse;
pub mod cut_graph;
pub mod direction_field;
pub mod distortion;
pub mod edit;
pub mod field_aligned;
pub mod flatten;
pub mod intrinsic_delaunay;
pub mod isometric;
pub mod offset;
pub mod opening;
pub mod overlap;
pub mod paths;
pub mod rulings;
pub mod seam_fit;
pub mod sphere_map;
pub mod straightest;
mod subdivide;
pub mod tangent;
pub mod tree_cotree;

pub use subdivide::subdivide;
