//! The `[sphere]` table and its section of the report.
use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use serde_json::json;

use super::{GoreError, Gores, Options, Slices, gores, seam_length};
use crate::{
    geom::Vec3,
    mesh::Field,
    model::{DevelopableMesh, Globe, Guides, SourceMesh, Stripes},
    profile::{Angle, Profiles},
    stage::{Check, Cx, KeyError, Section, Stage},
    surface::sphere_map::{Method, Route, certify},
};

/// How a closed surface is sliced through its map to the sphere.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SphereStage {
    /// How the map is found.
    pub method: MethodKey,
    /// How the surface is sliced.
    pub slices: SlicesKey,
    /// Number of gores, or of rings.
    pub count: usize,
    /// Gores that stretch too much are halved up to this number.
    pub most: usize,
    /// The poles lie where the input ends in this direction and against it; up when absent.
    pub pole: Option<[f64; 3]>,
    /// Places of the input, in its own coordinates: the first and the last are the poles instead of `pole`, and rings are equally
    /// wide along the way between them, past the places in between.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub path: Vec<[f64; 3]>,
    /// The first meridian passes where the input ends in this direction.
    pub front: Option<[f64; 3]>,
    /// Longitude of the first seam.
    pub start: Angle,
    /// Angles on the sphere from the poles to the rims of the caps, top and bottom; 0 for none.
    pub caps: [Angle; 2],
    /// Whether seams may be longer or shorter in the plane than on the surface, both sides alike, so that the slices stretch
    /// less.
    pub share: bool,
    /// Principal stretch to which gores are halved; the material's when absent.
    pub stretch: Option<f64>,
    /// Distance of engraved parallels and meridians; 0 for none.
    pub graticule: Angle,
    /// SVG whose lines are engraved: the page is the sphere in equirectangular projection, longitude −180° to 180° across,
    /// latitude 90° to −90° down; read with the input.
    pub texture: Option<PathBuf>,
}

impl Default for SphereStage {
    fn default() -> Self {
        Self {
            method: MethodKey::Auto,
            slices: SlicesKey::Meridians,
            count: 12,
            most: 48,
            pole: None,
            path: Vec::new(),
            front: None,
            start: Angle::degrees(0.0),
            caps: [Angle::degrees(0.0); 2],
            share: true,
            stretch: None,
            graticule: Angle::degrees(0.0),
            texture: None,
        }
    }
}

/// How the map is found, as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MethodKey {
    /// The fast way, and the other where it leaves a flipped face.
    Auto,
    /// Through a progressive mesh.
    Hierarchical,
}

/// How the surface is sliced, as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum SlicesKey {
    /// From pole to pole.
    Meridians,
    /// Rings of equal width along the first seam's meridian, or along `path`.
    Rings,
}

/// The stretch that the material takes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Stock {
    stretch: f64,
}

fn unit(k: usize) -> Vec3 {
    Vec3::from_fn(|i, _| f64::from(u8::from(i == k)))
}

impl SphereStage {
    fn options(&self, source: &SourceMesh, stock: &Stock, guides: Option<&Guides>) -> Options {
        let pole = self.pole.map_or(unit(source.up), Vec3::from);
        Options {
            method: match self.method {
                MethodKey::Auto => Method::Auto,
                MethodKey::Hierarchical => Method::Hierarchical,
            },
            slices: match self.slices {
                SlicesKey::Meridians => Slices::Meridians,
                SlicesKey::Rings => Slices::Rings,
            },
            count: self.count,
            most: self.most.max(self.count),
            pole,
            path: guides.map(|it| it.path.clone()).unwrap_or_default(),
            front: self.front.map_or_else(|| unit(pole.iamin()), Vec3::from),
            start: self.start.radians,
            caps: self.caps.map(|it| it.radians),
            share: self.share,
            stretch: self.stretch.unwrap_or(stock.stretch),
            graticule: self.graticule.radians,
            texture: guides.map(|it| it.texture.clone()).unwrap_or_default(),
        }
    }
}

impl Stage for SphereStage {
    const NAME: &'static str = "sphere";
    const VERSION: u32 = 3;
    type Input = (SourceMesh, Option<Guides>);
    type Output = (DevelopableMesh, Guides, Stripes, Globe);
    type Profile = Stock;
    type Error = GoreError;

    fn profile(profiles: &Profiles) -> Stock {
        Stock { stretch: profiles.material.stretch }
    }

    fn check(&self) -> Result<(), KeyError> {
        let least = if self.slices == SlicesKey::Meridians { 3.0 } else { 2.0 };
        KeyError::range("count", self.count as f64, least, 360.0)?;
        KeyError::range("most", self.most as f64, least, 720.0)?;
        for cap in self.caps {
            KeyError::range("caps", cap.radians.to_degrees(), 0.0, 80.0)?;
        }
        if let Some(stretch) = self.stretch {
            KeyError::range("stretch", stretch, 1e-6, 1.0)?;
        }
        if self.graticule.radians != 0.0 {
            KeyError::range("graticule", self.graticule.radians.to_degrees(), 1.0, 90.0)?;
        }
        let refuse = |message: &str| Err(KeyError { key: "path", message: message.into() });
        match self.path.len() {
            0 | 2 => {}
            1 => return refuse("needs at least two places, [x, y, z] each: its ends become the poles"),
            _ if self.slices == SlicesKey::Meridians => {
                return refuse(
                    "may pass places between its ends for slices = \"rings\" only; give its two ends for gores",
                );
            }
            _ => {}
        }
        if self.path.iter().flatten().any(|it| !it.is_finite()) {
            return refuse("must be places such as [0, 10, 2.5], in the coordinates of the input");
        }
        if self.pole.is_some() && !self.path.is_empty() {
            return refuse("says where the poles are, and so does `pole`: write one of them");
        }
        for (key, axis) in [("pole", self.pole), ("front", self.front)] {
            if axis.is_some_and(|it| !Vec3::from(it).norm().is_normal()) {
                return Err(KeyError { key, message: "must be a direction such as [0, 1, 0]".into() });
            }
        }
        Ok(())
    }

    fn run(
        &self,
        (source, guides): (&SourceMesh, Option<&Guides>),
        stock: &Stock,
        cx: &Cx,
    ) -> Result<Self::Output, GoreError> {
        let made = gores(&source.mesh, &self.options(source, stock, guides), &cx.monitor)?;
        let globe = globe(&made, self.slices == SlicesKey::Rings);
        let mut guides = guides.cloned().unwrap_or_default();
        guides.scales = vec![1.0; guides.edges.len()];
        guides.scales.extend(&made.scales);
        guides.edges.extend(made.seams.iter().map(|&e| made.mesh.edge_vertices(e).map(|v| v.0)));
        let developed = DevelopableMesh {
            energy: Field::filled(made.mesh.vertex_count(), 0.0),
            mesh: made.mesh,
            max_deviation: 0.0,
            rounds: Vec::new(),
            tradeoffs: Vec::new(),
        };
        Ok((developed, guides, made.drawn, globe))
    }

    fn section(
        &self,
        _: (&SourceMesh, Option<&Guides>),
        stock: &Stock,
        (_, _, drawn, globe): &Self::Output,
    ) -> Section {
        let found = certify(&globe.faces, &globe.points);
        let limit = self.stretch.unwrap_or(stock.stretch);
        let finite = |it: f64| it.is_finite().then_some(it);
        let n = globe.stretch.len() - 2;
        let slices: Vec<_> = (0..n)
            .map(|k| {
                let mut slice = json!({ "principal_stretch": finite(globe.stretch[k]) });
                match globe.lines.get(k) {
                    Some(line) if !globe.rings => slice["from_deg"] = json!(line.to_degrees()),
                    Some(z) => slice["to_latitude_deg"] = json!(z.asin().to_degrees()),
                    None => {}
                }
                slice
            })
            .collect();
        let table = json!({
            "method": globe.method,
            "faces": globe.faces.len(),
            "flips": found.flips,
            "degree": found.degree,
            "energy": globe.energy,
            "dilatation_mean": globe.dilatation[0],
            "dilatation_p99": globe.dilatation[1],
            "centroid": globe.centroid,
            "held": globe.held,
            "seconds": globe.seconds,
            "slices": slices,
            "caps": globe.stretch[n..].iter().map(|&it| json!({ "principal_stretch": finite(it) })).collect::<Vec<_>>(),
            "seam_length_mm": globe.seam_length,
            "seam_scale": globe.seam_scale,
            "stretch_limit": limit,
            "drawn_lines": drawn.lines.len(),
        });
        let over = globe.stretch.iter().filter(|it| **it > limit).count();
        let note = match over {
            0 => format!("{n} slices, each within the limit as it is"),
            _ => format!(
                "{over} of {n} slices and caps exceed {limit}; the stage cut divides them further. Allow more with sphere.most, or a material that stretches"
            ),
        };
        let note = match globe.held {
            0 => note,
            held => format!(
                "{note}; double precision kept {held} vertices from their conformal place: the energy is {:.2} % above 8π, \
                 and the mean dilatation {:.2}. Shorten thin limbs, or remesh them with smaller faces",
                100.0 * (globe.energy / (8.0 * std::f64::consts::PI) - 1.0),
                globe.dilatation[0]
            ),
        };
        let mut section =
            Section::new(Self::NAME, table).check(certificate("sphere.certificate", &globe.faces, &globe.points));
        section.tables["sphere"]["note"] = json!(note);
        section
    }
}

/// Whether no face is flipped and the sphere is covered once, exactly.
pub fn certificate(name: &str, faces: &[[u32; 3]], points: &[Vec3]) -> Check {
    let found = certify(faces, points);
    let note =
        format!("{} faces, each by an exact predicate; they cover the sphere {} times", faces.len(), found.degree);
    Check { ok: found.holds(), ..Check::at_most(name, found.flips as f64, 0.0, "flipped faces", note) }
}

fn globe(made: &Gores, rings: bool) -> Globe {
    let quality = made.map.quality;
    Globe {
        points: made.map.points.as_slice().to_vec(),
        faces: made.faces.clone(),
        images: made.points.clone(),
        method: match made.map.route {
            Route::Direct => "direct",
            Route::Hierarchical => "hierarchical",
        }
        .into(),
        energy: quality.energy,
        dilatation: [quality.dilatation_mean, quality.dilatation_p99],
        centroid: quality.centroid,
        held: made.map.held,
        seconds: made.seconds,
        rings,
        lines: made.lines.clone(),
        stretch: made.stretch.clone(),
        seam_length: seam_length(made),
        seam_scale: [
            made.scales.iter().copied().fold(f64::INFINITY, f64::min),
            made.scales.iter().copied().fold(0.0, f64::max),
        ],
    }
}
