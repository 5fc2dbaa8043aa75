//! The `[coarsen]` table and the adapter to the kernel.
use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{
    CoarsenError, Density, IsotropicOptions, QuadricOptions, TessellationOptions, remesh, simplify, smallest_angle,
    tessellate,
};
use crate::{
    geom::Vec3,
    mesh::{
        TriMesh,
        distance::{SurfaceDistance, two_sided_bounds},
    },
    model::SourceMesh,
    numeric::Monitor,
    profile::{Angle, Extent, Length, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
    surface::sphere_map::Pattern,
};

/// Faces asked for when the table does not say: about 3 000 vertices, which the develop stage takes as they are.
const FACES: usize = 6_000;
/// "auto" keeps meshes up to this many faces.
const MANY: usize = 20_000;
/// "auto" remeshes a smaller mesh with bad faces to at least this many.
const FEW: usize = 4_000;
/// A face with a smaller angle than this is bad, degrees.
const BAD_ANGLE: f64 = 8.0;
/// "auto" remeshes when more than this share of the faces is bad.
const BAD_SHARE: f64 = 0.02;
/// Distance from the source that isotropic remeshing keeps to when the table does not say, percent of the diagonal.
const REMESH_ERROR: f64 = 0.4;
/// Distance from the source to which tessellations are refined when the table does not say, percent of the diagonal.
const TESSELLATION_ERROR: f64 = 0.5;
/// Share by which the proven distance may exceed the true one.
const RESOLUTION: f64 = 0.01;

/// The `[coarsen]` table.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CoarsenStage {
    /// How: see [`Method`].
    pub method: Method,
    /// Number of faces: reached exactly or short of it by one by "quadric", within some percent by "isotropic".
    /// 6000 unless `max_error` ("quadric") or `edge_length` ("isotropic") takes its place.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub faces: Option<usize>,
    /// Largest distance from the input, either way: a length, or percent of the input's diagonal. "quadric" proves it and
    /// stops there; "isotropic" makes more faces for it where needed, 0.4 % if not given; "sphere" likewise, 0.5 %, but a
    /// `grid` stays as it is.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub max_error: Option<Extent>,
    /// Length of edges, instead of `faces`. For "isotropic" only.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub edge_length: Option<Length>,
    /// Edges whose faces make a larger angle are creases and are kept, degrees.
    pub feature_angle: Angle,
    /// What "sphere" covers the surface with.
    pub tessellation: Tessellation,
    /// Meridians and rings of tessellation = "latitude-longitude", instead of `faces`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub grid: Option<[usize; 2]>,
    /// The pole of the tessellation lies where the input ends in this direction; up when absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pole: Option<[f64; 3]>,
    /// Whether the tessellation is evened out on the surface; otherwise limbs get few faces.
    pub compensate: bool,
}

impl Default for CoarsenStage {
    fn default() -> Self {
        Self {
            method: Method::Auto,
            faces: None,
            max_error: None,
            edge_length: None,
            feature_angle: Angle::degrees(40.0),
            tessellation: Tessellation::Icosahedron,
            grid: None,
            pole: None,
            compensate: true,
        }
    }
}

/// Patterns of triangles, as they are written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tessellation {
    /// Eight triangles, divided.
    Octahedron,
    /// Twenty triangles, divided.
    Icosahedron,
    /// Six squares, divided.
    Cube,
    /// Rings and meridians between two poles.
    LatitudeLongitude,
}

impl Tessellation {
    /// The pattern with about that many faces, or with the meridians and rings of `grid`.
    fn pattern(self, faces: usize, grid: Option<[usize; 2]>) -> Pattern {
        let side = |least: f64| ((faces as f64 / least).sqrt().round() as usize).max(1);
        match self {
            Self::Octahedron => Pattern::Octahedron(side(8.0)),
            Self::Icosahedron => Pattern::Icosahedron(side(20.0)),
            Self::Cube => Pattern::Cube(side(12.0)),
            Self::LatitudeLongitude => {
                // Twice as many meridians as rings: squares on the equator.
                let rings = side(4.0);
                let [meridians, rings] = grid.unwrap_or([2 * rings, rings]);
                Pattern::LatitudeLongitude { meridians, rings }
            }
        }
    }
}

/// How to coarsen, as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Method {
    /// "isotropic" if the mesh has more than 20 000 faces, or more than asked for, or many bad ones; else "off".
    Auto,
    /// Edge collapse by quadric error: fewest faces for an error.
    Quadric,
    /// Remeshing with nearly equilateral faces.
    Isotropic,
    /// A regular pattern of triangles, through a conformal map of the input to the sphere.
    Sphere,
    /// The mesh as it is.
    Off,
}

/// What a table means for a mesh.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Plan {
    Off,
    Quadric(QuadricOptions),
    Isotropic(IsotropicOptions),
    Sphere(TessellationOptions),
}

impl Plan {
    fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Quadric(_) => "quadric",
            Self::Isotropic(_) => "isotropic",
            Self::Sphere(_) => "sphere",
        }
    }
}

impl CoarsenStage {
    /// `up` is the axis that points up.
    fn plan(&self, mesh: &TriMesh, up: usize) -> Plan {
        let extent = |it: Extent| it.resolve(mesh.bounds().diagonal());
        let feature_angle = self.feature_angle.radians;
        let isotropic = |faces: usize| {
            Plan::Isotropic(IsotropicOptions {
                density: self.edge_length.map_or(Density::Faces(faces), |it| Density::EdgeLength(it.mm)),
                max_error: Some(extent(self.max_error.unwrap_or(Extent::Percent(REMESH_ERROR)))),
                feature_angle,
            })
        };
        let count = mesh.face_count();
        match self.method {
            Method::Off => Plan::Off,
            Method::Sphere => {
                let axis = |k: usize| Vec3::from_fn(|i, _| f64::from(u8::from(i == k)));
                let pole = self.pole.map_or(axis(up), Vec3::from);
                // The first meridian on the side of the axis that is most across the pole.
                let across = axis(pole.iamin());
                Plan::Sphere(TessellationOptions {
                    pattern: self.tessellation.pattern(self.faces.unwrap_or(FACES), self.grid),
                    axes: [pole, across],
                    compensate: self.compensate,
                    // A grid that was chosen line by line stays as it is unless a distance is asked for as well.
                    max_error: match (self.max_error, self.grid) {
                        (None, Some(_)) => f64::INFINITY,
                        (asked, _) => extent(asked.unwrap_or(Extent::Percent(TESSELLATION_ERROR))),
                    },
                })
            }
            Method::Isotropic => isotropic(self.faces.unwrap_or(FACES)),
            Method::Quadric => Plan::Quadric(QuadricOptions {
                faces: self.faces.or(self.max_error.is_none().then_some(FACES)),
                max_error: self.max_error.map(extent),
                feature_angle,
            }),
            Method::Auto => {
                let asked = self.edge_length.is_some() || self.faces.is_some_and(|faces| faces < count);
                if asked || count > MANY || bad_share(mesh) > BAD_SHARE {
                    isotropic(self.faces.unwrap_or(count.clamp(FEW, FACES)))
                } else {
                    Plan::Off
                }
            }
        }
    }
}

/// Share of the faces with a bad angle.
fn bad_share(mesh: &TriMesh) -> f64 {
    let bad = mesh.faces().filter(|&f| smallest_angle(mesh, f).to_degrees() < BAD_ANGLE).count();
    bad as f64 / mesh.face_count() as f64
}

impl Stage for CoarsenStage {
    const NAME: &'static str = "coarsen";
    const VERSION: u32 = 4;
    type Input = SourceMesh;
    type Output = TriMesh;
    type Profile = ();
    type Error = CoarsenError;

    fn profile(_: &Profiles) {}

    fn check(&self) -> Result<(), KeyError> {
        KeyError::range("faces", self.faces.unwrap_or(FACES) as f64, 4.0, 1e8)?;
        match self.max_error {
            Some(Extent::Percent(percent)) => KeyError::range("max_error", percent, 1e-6, 100.0)?,
            Some(Extent::Length(length)) => KeyError::range("max_error", length.mm, 1e-9, 1e6)?,
            None => {}
        }
        if let Some(length) = self.edge_length {
            KeyError::range("edge_length", length.mm, 1e-6, 1e6)?;
            let refuse = |message: &str| Err(KeyError { key: "edge_length", message: message.to_owned() });
            if self.faces.is_some() {
                return refuse("says the same as `faces`: write one of them");
            }
            if matches!(self.method, Method::Quadric | Method::Sphere | Method::Off) {
                return refuse("is for method = \"isotropic\" or \"auto\"");
            }
        }
        if let Some([meridians, rings]) = self.grid {
            KeyError::range("grid", meridians as f64, 3.0, 1e4)?;
            KeyError::range("grid", rings as f64, 1.0, 1e4)?;
        }
        if self.pole.is_some_and(|it| !Vec3::from(it).norm().is_normal()) {
            return Err(KeyError { key: "pole", message: "must be a direction such as [0, 1, 0]".into() });
        }
        KeyError::range("feature_angle", self.feature_angle.radians.to_degrees(), 1.0, 180.0)
    }

    fn run(&self, source: &SourceMesh, _: &(), cx: &Cx) -> Result<TriMesh, CoarsenError> {
        match self.plan(&source.mesh, source.up) {
            Plan::Off => Ok(source.mesh.clone()),
            Plan::Quadric(options) => simplify(&source.mesh, &options, &cx.monitor),
            Plan::Isotropic(options) => remesh(&source.mesh, &options, &cx.monitor),
            Plan::Sphere(options) => tessellate(&source.mesh, &options, &cx.monitor),
        }
    }

    fn section(&self, source: &SourceMesh, _: &(), output: &TriMesh) -> Section {
        let plan = self.plan(&source.mesh, source.up);
        let diagonal = source.mesh.bounds().diagonal();
        let smallest = output.faces().map(|f| smallest_angle(output, f)).fold(f64::INFINITY, f64::min);
        let (sampled, bound) = if plan == Plan::Off {
            (SurfaceDistance { hausdorff: 0.0, mean: 0.0 }, 0.0)
        } else {
            let bounds = two_sided_bounds(&source.mesh, output, RESOLUTION, &Monitor::silent())
                .expect("a silent monitor never cancels");
            (SurfaceDistance::between(&source.mesh, output), bounds.upper)
        };
        let percent = 100.0 / diagonal;
        let section = Section::new(
            Self::NAME,
            json!({
                "method": plan.name(),
                "vertices": output.vertex_count(),
                "faces": output.face_count(),
                "min_angle_deg": smallest.to_degrees(),
                "hausdorff_pct": sampled.hausdorff * percent,
                "hausdorff_bound_pct": bound * percent,
                "mean_pct": sampled.mean * percent,
            }),
        );
        match self.max_error {
            Some(limit) => section.check(Check::at_most(
                "coarsen.max_error",
                bound * percent,
                limit.resolve(diagonal) * percent,
                "% of the diagonal",
                "proven distance between the input and the coarse mesh; allow a larger coarsen.max_error or more faces",
            )),
            None => section,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    fn table(text: &str) -> Result<CoarsenStage, String> {
        let table: CoarsenStage = toml::from_str(text).map_err(|err| err.to_string())?;
        table.check().map_err(|err| err.to_string())?;
        Ok(table)
    }

    fn source(mesh: TriMesh) -> SourceMesh {
        SourceMesh { mesh, file: "shape.obj".to_owned(), repairs: Vec::new(), up: 2 }
    }

    #[test]
    fn tables_are_checked() {
        assert_eq!(table(""), Ok(CoarsenStage::default()));
        for (text, complaint) in [
            ("faces = 2", "`faces` must be between"),
            ("max_error = \"0 %\"", "`max_error` must be between"),
            ("edge_length = 2.0\nfaces = 100", "write one of them"),
            ("edge_length = 2.0\nmethod = \"quadric\"", "is for method"),
            ("feature_angle = 0", "`feature_angle` must be between"),
            ("method = \"sphere\"\ngrid = [2, 5]", "`grid` must be between"),
            ("pole = [0, 0, 0]", "must be a direction"),
            ("method = \"magic\"", "unknown variant"),
            ("face = 3", "unknown field"),
        ] {
            let found = table(text).unwrap_err();
            assert!(found.contains(complaint), "{text}: {found}");
        }
        let full = table("method = \"quadric\"\nfaces = 500\nmax_error = \"0.5 %\"\nfeature_angle = 30").unwrap();
        assert_eq!(toml::from_str::<CoarsenStage>(&toml::to_string(&full).unwrap()).unwrap(), full);
    }

    #[test]
    fn auto_leaves_good_meshes_and_remeshes_others() {
        let auto = CoarsenStage::default();
        assert_eq!(auto.plan(&shapes::icosphere(10.0, 4), 2), Plan::Off);
        let slivers = auto.plan(&shapes::cylinder(10.0, 500.0, 200, 2), 2);
        assert!(matches!(slivers, Plan::Isotropic(it) if it.density == Density::Faces(FEW)), "{slivers:?}");
        let many = auto.plan(&shapes::icosphere(10.0, 6), 2);
        assert!(matches!(many, Plan::Isotropic(it) if it.density == Density::Faces(FACES)), "{many:?}");
        let asked = table("faces = 1000").unwrap().plan(&shapes::icosphere(10.0, 4), 2);
        assert!(matches!(asked, Plan::Isotropic(it) if it.density == Density::Faces(1000)), "{asked:?}");
    }

    #[test]
    fn the_section_says_what_was_done() {
        let source = source(shapes::torus(30.0, 10.0, 60, 30));
        let cx = Cx { seed: 0, monitor: Monitor::silent(), kept: None, keep: &|_| () };
        for (text, method) in [
            ("", "off"),
            ("method = \"quadric\"\nfaces = 600\nmax_error = \"2 %\"", "quadric"),
            ("method = \"isotropic\"\nfaces = 900", "isotropic"),
        ] {
            let stage = table(text).unwrap();
            let output = stage.run(&source, &(), &cx).unwrap();
            let section = stage.section(&source, &(), &output);
            let values = &section.tables["coarsen"];
            assert_eq!(values["method"], method);
            assert_eq!(values["faces"], output.face_count());
            let number = |key: &str| values[key].as_f64().unwrap();
            assert!(number("mean_pct") <= number("hausdorff_pct"));
            assert!(number("hausdorff_pct") <= number("hausdorff_bound_pct") + 1e-9);
            assert_eq!(number("hausdorff_pct") == 0.0, method == "off");
            assert!(section.checks.iter().all(|it| it.ok), "{:?}", section.checks);
            assert_eq!(section.checks.len(), usize::from(stage.max_error.is_some()));
        }
    }

    #[test]
    fn tessellations_have_about_the_faces_asked_for_and_refuse_what_is_not_a_sphere() {
        let cx = Cx { seed: 0, monitor: Monitor::silent(), kept: None, keep: &|_| () };
        let ball = source(shapes::rounded_cuboid(Vec3::new(20.0, 30.0, 40.0), 8.0, 4, 4));
        for (name, faces) in [("octahedron", 392), ("icosahedron", 320), ("cube", 432), ("latitude-longitude", 400)] {
            let text = format!("method = \"sphere\"\nfaces = 400\ntessellation = \"{name}\"\n");
            let coarse = table(&(text.clone() + "max_error = \"6 %\"")).unwrap();
            let output = coarse.run(&ball, &(), &cx).unwrap();
            assert_eq!((output.face_count(), output.genus()), (faces, 0), "{name}");
            let near = table(&text).unwrap();
            let output = near.run(&ball, &(), &cx).unwrap();
            assert!((faces..4 * faces).contains(&output.face_count()), "{name}: {}", output.face_count());
            let values = &near.section(&ball, &(), &output).tables["coarsen"];
            assert!(values["method"] == "sphere" && values["hausdorff_pct"].as_f64().unwrap() <= 0.5, "{values}");
            assert!(values["min_angle_deg"].as_f64().unwrap() > 15.0, "{name}: {values}");
        }
        let grid = table("method = \"sphere\"\ntessellation = \"latitude-longitude\"\ngrid = [9, 5]").unwrap();
        assert_eq!(grid.run(&ball, &(), &cx).unwrap().face_count(), 90);
        let refused = grid.run(&source(shapes::torus(30.0, 10.0, 20, 10)), &(), &cx).unwrap_err().to_string();
        assert!(refused.contains("handles") && refused.contains("coarsen.method"), "{refused}");
    }
}
