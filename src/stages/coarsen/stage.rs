//! The `[coarsen]` table and the adapter to the kernels.
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{CoarsenError, IsotropicOptions, QuadricOptions, remesh, simplify};
use crate::{
    mesh::{TriMesh, distance::SurfaceDistance},
    model::SourceMesh,
    numeric::Monitor,
    profile::{Angle, Extent, Length, Profiles},
    stage::{Cx, KeyError, Section, Stage},
};

/// How to coarsen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Isotropic where the mesh is too fine or too thin for the next stage, else off.
    Auto,
    /// Edge collapse by quadric error.
    Quadric,
    /// Edges of one length.
    Isotropic,
    /// The input as it is.
    Off,
}

/// The `[coarsen]` table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CoarsenStage {
    /// How.
    pub method: Method,
    /// Number of faces to reach, about (isotropic) or at most (quadric).
    pub faces: Option<usize>,
    /// With "quadric": largest distance to the input, either way; proven.
    pub max_error: Option<Extent>,
    /// With "isotropic": edge length, instead of `faces`.
    pub edge_length: Option<Length>,
    /// Edges with a larger angle between their faces are creases and kept.
    pub feature_angle: Angle,
}

/// Faces when the config names none: about 3000 vertices, which the next stage handles in seconds.
const FACES: usize = 6000;
/// `auto` leaves meshes of up to so many faces as they are,
const AUTO_FACES: usize = 20_000;
/// unless more than this share of their faces
const AUTO_THIN: f64 = 0.02;
/// has an angle below this, radians (8°: what the barriers of the next stage keep).
const AUTO_ANGLE: f64 = 0.14;
/// Quadric collapse before remeshing leaves this many times the faces wanted, so that remeshing has something to choose.
const HEAD_START: usize = 3;

impl Default for CoarsenStage {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            faces: None,
            max_error: None,
            edge_length: None,
            feature_angle: Angle::degrees(50.0),
        }
    }
}

impl CoarsenStage {
    /// What `auto` means for this mesh.
    fn method(&self, mesh: &TriMesh) -> Method {
        let asked = self.faces.is_some() || self.edge_length.is_some();
        match self.method {
            Method::Auto if asked || mesh.face_count() > AUTO_FACES => Method::Isotropic,
            Method::Auto => {
                let thin = |f: &_| mesh.face_halfedges(*f).iter().any(|&h| mesh.corner_angle(h) < AUTO_ANGLE);
                let share = mesh.faces().filter(thin).count() as f64 / mesh.face_count() as f64;
                if share > AUTO_THIN { Method::Isotropic } else { Method::Off }
            }
            other => other,
        }
    }

    fn isotropic(&self, source: &TriMesh, monitor: &Monitor<'_>) -> Result<TriMesh, CoarsenError> {
        let faces = self.faces.unwrap_or(FACES);
        // F equilateral triangles of side L have the area F √3/4 L².
        let even = (source.total_area() * 4.0 / (3.0_f64.sqrt() * faces as f64)).sqrt();
        let edge_length = self.edge_length.map_or(even, |it| it.mm);
        let feature_angle = self.feature_angle.radians;
        let wanted = source.total_area() * 4.0 / (3.0_f64.sqrt() * edge_length * edge_length);
        let head_start = HEAD_START * wanted as usize;
        let start = if source.face_count() > 2 * head_start {
            simplify(source, &QuadricOptions { faces: Some(head_start), max_error: None, feature_angle }, monitor)?
        } else {
            source.clone()
        };
        remesh(source, &start, &IsotropicOptions { edge_length, feature_angle }, monitor)
    }
}

impl Stage for CoarsenStage {
    const NAME: &'static str = "coarsen";
    const VERSION: u32 = 1;
    type Input = SourceMesh;
    type Output = TriMesh;
    type Profile = ();
    type Error = CoarsenError;

    fn profile(_: &Profiles) {}

    fn check(&self) -> Result<(), KeyError> {
        if let Some(faces) = self.faces {
            KeyError::range("faces", faces as f64, 4.0, 1e8)?;
        }
        if let Some(length) = self.edge_length {
            KeyError::range("edge_length", length.mm, 1e-6, 1e6)?;
        }
        if let Some(error) = self.max_error {
            KeyError::range("max_error", error.resolve(100.0), 1e-9, 1e6)?;
        }
        KeyError::range("feature_angle", self.feature_angle.radians.to_degrees(), 1.0, 180.0)
    }

    fn run(&self, source: &SourceMesh, (): &(), cx: &Cx) -> Result<TriMesh, CoarsenError> {
        let mesh = &source.mesh;
        match self.method(mesh) {
            Method::Off | Method::Auto => Ok(mesh.clone()),
            Method::Isotropic => self.isotropic(mesh, &cx.monitor),
            Method::Quadric => {
                let max_error = self.max_error.map(|it| it.resolve(mesh.bounds().diagonal()));
                let faces = self.faces.or((max_error.is_none()).then_some(FACES));
                let feature_angle = self.feature_angle.radians;
                simplify(mesh, &QuadricOptions { faces, max_error, feature_angle }, &cx.monitor)
            }
        }
    }

    fn section(&self, source: &SourceMesh, (): &(), coarse: &TriMesh) -> Section {
        let method = self.method(&source.mesh);
        let distance = if method == Method::Off {
            SurfaceDistance { hausdorff: 0.0, mean: 0.0 }
        } else {
            SurfaceDistance::between(&source.mesh, coarse)
        };
        let percent = 100.0 / source.mesh.bounds().diagonal();
        Section::new(
            "coarsen",
            json!({
                "method": method,
                "vertices": coarse.vertex_count(),
                "faces": coarse.face_count(),
                "hausdorff_pct": distance.hausdorff * percent,
                "mean_pct": distance.mean * percent,
            }),
        )
    }
}
