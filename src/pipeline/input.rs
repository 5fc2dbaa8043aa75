//! The input mesh: read, repaired, brought to its physical size.
use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{
    beginning::{self, Beginning},
    codec,
    config::{Config, ConfigError},
    guides,
    pattern::{self, BorderKey},
};
use crate::{
    geom::Vec2,
    import::mesh::{self as reader, ImportError},
    mesh::{
        TriMesh,
        repair::{Components, MeshFacts, MeshRefusal, RepairOptions, repair},
    },
    model::{Artifact, Guides, Noun, SourceMesh},
    profile::Length,
    stage::Key,
};

/// Diagonals outside of this range, mm, are taken for a missing unit when the config gives neither unit nor size: below, parts
/// would be smaller than a fingernail.
const PLAUSIBLE: std::ops::RangeInclusive<f64> = 50.0..=3000.0;
/// Height given to a model of implausible size, mm.
const FALLBACK_HEIGHT: f64 = 180.0;

/// The `[input]` table.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct InputTable {
    /// The mesh file, relative to the config.
    pub mesh: Option<PathBuf>,
    /// The drawing of a crease pattern, relative to the config.
    pub pattern: Option<PathBuf>,
    /// What the lines on layers of a pattern are: border, crease, mountain, valley, cut or ignored.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub layers: BTreeMap<String, String>,
    /// What the lines of colours ("#RRGGBB") of a pattern are.
    #[serde(skip_serializing_if = "BTreeMap::is_empty")]
    pub colors: BTreeMap<String, String>,
    /// Where the border of a pattern comes from.
    pub border: Option<BorderKey>,
    /// Ends of lines of a pattern nearer than this to another line are moved onto it.
    pub snap: Option<Length>,
    /// Pixels per inch of a pattern without a unit.
    pub dpi: Option<f64>,
    units: Option<Unit>,
    scale: Option<f64>,
    height: Option<Length>,
    width: Option<Length>,
    depth: Option<Length>,
    diagonal: Option<Length>,
    up: Option<Up>,
    component: ComponentKey,
    fill_holes: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
enum Unit {
    #[serde(rename = "mm")]
    Millimetre,
    #[serde(rename = "cm")]
    Centimetre,
    #[serde(rename = "m")]
    Metre,
    #[serde(rename = "in")]
    Inch,
    #[serde(rename = "ft")]
    Foot,
}

impl Unit {
    fn millimetres(self) -> f64 {
        match self {
            Self::Millimetre => 1.0,
            Self::Centimetre => 10.0,
            Self::Metre => 1000.0,
            Self::Inch => 25.4,
            Self::Foot => 304.8,
        }
    }
}

/// The axis that points up, for `height`, `width` and `depth`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Up {
    Y,
    Z,
}

#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ComponentKey {
    /// Refuse several components.
    #[default]
    One,
    Largest,
    All,
}

/// Why there is no input mesh.
#[derive(Debug, thiserror::Error)]
pub enum InputError {
    /// A key of `[input]`.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The file is missing, cannot be read or holds something else.
    #[error("cannot read the mesh")]
    Unreadable(#[from] ImportError),
    /// The file of drawn seams.
    #[error("cannot read the seams of cut.seams")]
    Seams(#[source] ImportError),
    /// The lines to be engraved.
    #[error("cannot read the lines of sphere.texture, {path}: {reason}")]
    Texture {
        /// The file.
        path: String,
        /// Why.
        reason: String,
    },
    /// The crease pattern.
    #[error("the crease pattern {path} is refused: {reason}")]
    Pattern {
        /// The file.
        path: String,
        /// Why.
        reason: String,
    },
    /// The profile or the net that a net begins with.
    #[error("cannot begin a net with {path}: {reason}")]
    Profile {
        /// The file.
        path: String,
        /// Why.
        reason: String,
    },
    /// The surface cannot be worked with.
    #[error("the mesh {path} is refused")]
    Refused {
        /// The file.
        path: String,
        /// Why.
        source: MeshRefusal,
    },
}

/// The input of a run.
#[derive(Debug, Clone)]
pub struct Source {
    /// The surface at its physical size, a [`SourceMesh`].
    pub artifact: Artifact,
    /// Hash of its content.
    pub key: Key,
    /// What was drawn on it, [`crate::model::Guides`] or a [`crate::model::CreasePattern`], with the hash of its content.
    pub beside: Option<(Artifact, Key)>,
    /// The `input` table of the report.
    pub facts: Value,
    /// What the user should know.
    pub warnings: Vec<String>,
}

impl Source {
    /// Reads, repairs and scales the mesh that `[input]` names; without one, what `[net]` begins with.
    pub fn load(config: &Config<'_>) -> Result<Self, InputError> {
        if let Some(pattern) = &config.input.pattern {
            if config.input.mesh.is_some() {
                let span = config.input_spans.get("mesh").cloned();
                let message = "`input.mesh` and `input.pattern` are both given; keep one";
                return Err(config.source.error(message, span).into());
            }
            return pattern::load(config, pattern);
        }
        let sizing = Sizing::of(config)?;
        let begin = beginning::load(config)?;
        match (config.input.mesh.as_deref(), begin) {
            (Some(given), begin) => Self::of_mesh(config, given, begin, &sizing),
            (None, Some(begin)) => {
                let mesh = begin.mesh()?;
                Self::assemble(mesh, begin.name.clone(), vec![], Up::Z, &sizing, |scale| {
                    let mut guides = Guides::default();
                    begin.guide(scale, &mut guides);
                    Ok(Some(guides))
                })
            }
            (None, None) => {
                let message =
                    "the config names no mesh; add [input] with mesh = \"FILE\", or pattern = \"FILE\" for recipe fold";
                Err(config.source.error(message, None).into())
            }
        }
    }

    fn of_mesh(
        config: &Config<'_>,
        given: &Path,
        begin: Option<Beginning>,
        sizing: &Sizing,
    ) -> Result<Self, InputError> {
        let table = &config.input;
        let path = config.source.folder().join(given);
        let soup = reader::read(&path)?;
        let options = RepairOptions {
            components: match table.component {
                ComponentKey::One => Components::One,
                ComponentKey::Largest => Components::Largest,
                ComponentKey::All => Components::All,
            },
            fill_holes: table.fill_holes,
        };
        let (mesh, repairs) = repair(&soup, &options)
            .map_err(|source| InputError::Refused { path: path.display().to_string(), source })?;
        let up = table.up.unwrap_or_else(|| usual_up(given));
        let file = given.file_name().unwrap_or(given.as_os_str()).to_string_lossy().into_owned();
        let repairs = repairs.iter().map(ToString::to_string).collect();
        Self::assemble(mesh, file, repairs, up, sizing, |scale| {
            let guides = guides::load(config, &path, &soup, scale)?;
            let Some(begin) = begin else { return Ok(guides) };
            let mut guides = guides.unwrap_or_default();
            begin.guide(scale, &mut guides);
            Ok(Some(guides))
        })
    }

    /// Brings a mesh to its size, and its guides, which are made for the scale.
    fn assemble(
        mut mesh: TriMesh,
        file: String,
        repairs: Vec<String>,
        up: Up,
        sizing: &Sizing,
        guides: impl FnOnce(f64) -> Result<Option<Guides>, InputError>,
    ) -> Result<Self, InputError> {
        let mut warnings = Vec::new();
        let scale = sizing.scale(&mesh.bounds().size(), up, &mut warnings);
        mesh.positions_mut().as_mut_slice().iter_mut().for_each(|p| *p *= scale);
        let guides = guides(scale)?.map(|it| keyed(it.wrap()));
        let mesh = SourceMesh { mesh, file, repairs, up: if up == Up::Z { 2 } else { 1 } };
        let facts = facts(&mesh);
        let (artifact, key) = keyed(mesh.wrap());
        Ok(Self { artifact, key, beside: guides, facts, warnings })
    }
}

/// An artifact with the hash of its content.
pub(super) fn keyed(artifact: Artifact) -> (Artifact, Key) {
    let key = *blake3::hash(&codec::encode(std::slice::from_ref(&artifact))).as_bytes();
    (artifact, key)
}

/// Facts of a mesh file in its own units, as `fabricate inspect` shows them; `Err` says why it is refused.
pub fn inspect_mesh(path: &Path) -> Result<Value, String> {
    let chain = |err: &dyn std::error::Error| {
        std::iter::successors(Some(err), |it| it.source()).map(ToString::to_string).collect::<Vec<_>>().join(": ")
    };
    let soup = reader::read(path).map_err(|err| chain(&err))?;
    let options = RepairOptions { components: Components::All, fill_holes: 0 };
    let (mesh, repairs) = repair(&soup, &options).map_err(|err| chain(&err))?;
    let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    let repairs = repairs.iter().map(ToString::to_string).collect();
    Ok(facts(&SourceMesh { mesh, file, repairs, up: 1 }))
}

/// How the physical size is given.
pub(super) enum Sizing {
    /// Millimetres per unit of the file.
    Unit(f64),
    Factor(f64),
    /// Extent along an axis of (width, height, depth), or the diagonal, in mm.
    Along(Axis, f64),
    Unknown,
}

pub(super) enum Axis {
    Width,
    Height,
    Depth,
    Diagonal,
}

impl Axis {
    /// Extent of a drawing along it; it has no depth.
    pub(super) fn of_plane(&self, size: Vec2) -> Option<f64> {
        match self {
            Self::Width => Some(size.x),
            Self::Height => Some(size.y),
            Self::Depth => None,
            Self::Diagonal => Some(size.norm()),
        }
    }
}

impl Sizing {
    pub(super) fn of(config: &Config<'_>) -> Result<Self, ConfigError> {
        let table = &config.input;
        let length = |it: Option<Length>| it.map(|it| it.mm);
        let given: Vec<(&str, Self, f64)> = [
            ("units", table.units.map(Unit::millimetres), Self::Unit as fn(f64) -> Self),
            ("scale", table.scale, Self::Factor),
            ("width", length(table.width), |mm| Self::Along(Axis::Width, mm)),
            ("height", length(table.height), |mm| Self::Along(Axis::Height, mm)),
            ("depth", length(table.depth), |mm| Self::Along(Axis::Depth, mm)),
            ("diagonal", length(table.diagonal), |mm| Self::Along(Axis::Diagonal, mm)),
        ]
        .into_iter()
        .filter_map(|(key, value, make)| value.map(|it| (key, make(it), it)))
        .collect();
        let span = |key: &str| config.input_spans.get(key).cloned();
        if let Some((key, _, value)) = given.iter().find(|it| !(it.2 > 0.0 && it.2.is_finite())) {
            return Err(config.source.error(format!("`input.{key}` must be more than 0, not {value}"), span(key)));
        }
        let mut given = given.into_iter();
        match (given.next(), given.next()) {
            (None, _) => Ok(Self::Unknown),
            (Some(only), None) => Ok(only.1),
            (Some(first), Some(second)) => {
                let message = format!("`input.{}` and `input.{}` both give the size; keep one", first.0, second.0);
                Err(config.source.error(message, span(second.0)))
            }
        }
    }

    fn scale(&self, size: &crate::geom::Vec3, up: Up, warnings: &mut Vec<String>) -> f64 {
        let (height, depth) = match up {
            Up::Y => (size.y, size.z),
            Up::Z => (size.z, size.y),
        };
        // A flat model has no height; its diagonal stands in, so that nothing is divided by 0.
        let along = |extent: f64, mm: f64| if extent > 0.0 { mm / extent } else { mm / size.norm() };
        match self {
            Self::Unit(factor) | Self::Factor(factor) => *factor,
            Self::Along(Axis::Width, mm) => along(size.x, *mm),
            Self::Along(Axis::Height, mm) => along(height, *mm),
            Self::Along(Axis::Depth, mm) => along(depth, *mm),
            Self::Along(Axis::Diagonal, mm) => mm / size.norm(),
            Self::Unknown if PLAUSIBLE.contains(&size.norm()) => 1.0,
            Self::Unknown => {
                warnings.push(format!(
                    "the file has no unit and would be {:.4} mm across; it is made {FALLBACK_HEIGHT} mm high. \
                     Set input.units, input.scale or input.height",
                    size.norm()
                ));
                along(height, FALLBACK_HEIGHT)
            }
        }
    }
}

/// STL comes from CAD and printing, where z is up; the others from modelling and scanning, where y is.
fn usual_up(path: &Path) -> Up {
    if path.extension().is_some_and(|it| it.eq_ignore_ascii_case("stl")) { Up::Z } else { Up::Y }
}

fn facts(source: &SourceMesh) -> Value {
    let MeshFacts { vertices, faces, components, boundary_loops, genus, diagonal } = MeshFacts::of(&source.mesh);
    let size = source.mesh.bounds().size();
    json!({
        "file": source.file,
        "vertices": vertices,
        "faces": faces,
        "components": components,
        "boundary_loops": boundary_loops,
        "genus": genus,
        "diagonal_mm": diagonal,
        "size_mm": [size.x, size.y, size.z],
        "repairs": source.repairs,
    })
}
