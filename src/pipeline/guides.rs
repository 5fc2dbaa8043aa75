//! What the `[cut]` table says about places on the input: drawn seams and painted faces, read and brought to size; and the
//! lines that `[sphere]` engraves.
use std::path::{Path, PathBuf};

use serde::Deserialize;
use toml::Spanned;

use super::{
    config::{Config, ConfigError},
    input::InputError,
};
use crate::{
    geom::{Vec2, Vec3},
    import::{
        DrawnLine,
        mesh::{NamedFace, read_drawn},
        read_svg,
    },
    mesh::Soup,
    model::{Guides, Patch},
};

/// The keys of `[cut]` that name places; the stage reads the others.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Keys {
    seams: Option<PathBuf>,
    seam_vertices: Option<Spanned<Vec<Vec<u32>>>>,
    prefer: Vec<Paint>,
    avoid: Vec<Paint>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Paint {
    paint: Option<Spanned<String>>,
    faces: Option<Spanned<Vec<u32>>>,
}

/// The keys of `[sphere]` that name a file or places of the input; the stage reads the others.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct SphereKeys {
    texture: Option<PathBuf>,
    path: Vec<[f64; 3]>,
}

/// The guides of a job whose input file holds `soup`, times `scale`; `None` where `[cut]` names no places and `[sphere]` no
/// lines and no path.
pub(super) fn load(config: &Config<'_>, file: &Path, soup: &Soup, scale: f64) -> Result<Option<Guides>, InputError> {
    let mut out = Guides::default();
    places(config, file, soup, scale, &mut out)?;
    if let Some(table) = config.tables.get("sphere") {
        let keys = SphereKeys::deserialize(toml::de::Deserializer::from(table.clone()));
        let keys = keys.map_err(|err| config.source.toml_error(&err))?;
        if let Some(path) = keys.texture {
            out.texture = texture(&config.source.folder().join(path))?;
        }
        out.path = keys.path.iter().map(|&p| Vec3::from(p) * scale).collect();
    }
    Ok((out != Guides::default()).then_some(out))
}

/// The lines of an SVG whose page is the sphere in equirectangular projection, as longitudes and latitudes, radians.
fn texture(path: &Path) -> Result<Vec<Vec<Vec2>>, InputError> {
    let refuse = |reason: String| InputError::Texture { path: path.display().to_string(), reason };
    let bytes = std::fs::read(path).map_err(|err| refuse(err.to_string()))?;
    let drawing = read_svg(&bytes).map_err(|err| refuse(err.to_string()))?;
    let size = drawing.size.filter(|it| it.x > 0.0 && it.y > 0.0);
    let Some(size) = size.filter(|_| !drawing.lines.is_empty()) else {
        return Err(refuse("it holds no lines on a page; convert texts and pictures to paths".into()));
    };
    // The origin of the page is its lower left corner.
    let place =
        |p: &Vec2| Vec2::new((p.x / size.x - 0.5) * std::f64::consts::TAU, (p.y / size.y - 0.5) * std::f64::consts::PI);
    let line = |it: &DrawnLine| {
        let again = it.points.first().filter(|_| it.closed);
        it.points.iter().chain(again).map(place).collect()
    };
    Ok(drawing.lines.iter().map(line).collect())
}

/// Adds what `[cut]` names.
fn places(config: &Config<'_>, file: &Path, soup: &Soup, scale: f64, out: &mut Guides) -> Result<(), InputError> {
    let Some(table) = config.tables.get("cut") else { return Ok(()) };
    let keys = Keys::deserialize(toml::de::Deserializer::from(table.clone()));
    let keys = keys.map_err(|err| config.source.toml_error(&err))?;
    if let Some(path) = &keys.seams {
        let path = config.source.folder().join(path);
        let lines = read_drawn(&path).map_err(InputError::Seams)?.lines;
        if lines.is_empty() {
            let message = format!("{} holds no lines (`l` elements); export the drawn edges as OBJ", path.display());
            return Err(config.source.error(message, Some(table.span())).into());
        }
        out.seams.extend(lines);
    }
    if let Some(chains) = &keys.seam_vertices {
        let vertex = |&v: &u32| {
            let problem = || {
                let message = format!(
                    "vertex {v} of cut.seam_vertices: the input has {} vertices (0 to {})",
                    soup.positions.len(),
                    soup.positions.len() - 1
                );
                config.source.error(message, Some(chains.span()))
            };
            soup.positions.get(v as usize).copied().ok_or_else(problem)
        };
        for chain in chains.get_ref() {
            out.seams.push(chain.iter().map(vertex).collect::<Result<_, ConfigError>>()?);
        }
    }
    let mut named: Option<Vec<NamedFace>> = None;
    for (list, entries) in [("prefer", &keys.prefer), ("avoid", &keys.avoid)] {
        for (k, entry) in entries.iter().enumerate() {
            let key = format!("{list} {k}");
            let triangles = match (&entry.paint, &entry.faces) {
                (Some(name), _) => {
                    if named.is_none() {
                        named = Some(faces_of(file, soup)?);
                    }
                    with_name(config, named.as_deref().unwrap_or_default(), name)?
                }
                (None, Some(faces)) => numbered(config, &faces_of(file, soup)?, faces)?,
                (None, None) => continue,
            };
            out.patches.push(Patch { key, triangles });
        }
    }
    let resize = |p: &mut Vec3| *p *= scale;
    out.seams.iter_mut().flatten().for_each(resize);
    out.patches.iter_mut().flat_map(|it| &mut it.triangles).flatten().for_each(resize);
    Ok(())
}

/// The faces of the input in the order of the file; those of formats without names are its triangles.
fn faces_of(file: &Path, soup: &Soup) -> Result<Vec<NamedFace>, InputError> {
    if file.extension().is_some_and(|it| it.eq_ignore_ascii_case("obj")) {
        return Ok(read_drawn(file)?.faces);
    }
    let corners = |face: &[u32; 3]| face.iter().map(|&v| soup.positions[v as usize]).collect();
    Ok(soup.faces.iter().map(|face| NamedFace { corners: corners(face), names: vec![] }).collect())
}

fn fan(face: &NamedFace) -> impl Iterator<Item = [Vec3; 3]> + '_ {
    face.corners.windows(2).skip(1).map(|pair| [face.corners[0], pair[0], pair[1]])
}

fn with_name(config: &Config<'_>, faces: &[NamedFace], name: &Spanned<String>) -> Result<Vec<[Vec3; 3]>, ConfigError> {
    let wanted = name.get_ref();
    let found: Vec<[Vec3; 3]> = faces.iter().filter(|it| it.names.contains(wanted)).flat_map(fan).collect();
    if !found.is_empty() {
        return Ok(found);
    }
    let mut names: Vec<&str> = faces.iter().flat_map(|it| &it.names).map(String::as_str).collect();
    names.sort_unstable();
    names.dedup();
    let known = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
    let message = format!("no face of the input belongs to a group, material or object `{wanted}`; there are {known}");
    Err(config.source.error(message, Some(name.span())))
}

fn numbered(
    config: &Config<'_>,
    faces: &[NamedFace],
    wanted: &Spanned<Vec<u32>>,
) -> Result<Vec<[Vec3; 3]>, ConfigError> {
    let mut out = Vec::new();
    for &f in wanted.get_ref() {
        let Some(face) = faces.get(f as usize) else {
            let message = format!("the input has no face {f}: it has {} faces, counted from 0", faces.len());
            return Err(config.source.error(message, Some(wanted.span())));
        };
        out.extend(fan(face));
    }
    if out.is_empty() {
        return Err(config.source.error("`faces` names no face", Some(wanted.span())));
    }
    Ok(out)
}
