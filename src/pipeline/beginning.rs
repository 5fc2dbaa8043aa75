//! What `[net]` begins with besides a mesh: a profile, or the net of an earlier run.
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::{config::Config, input::InputError};
use crate::{
    geom::{Vec2, polyline::ArcLength},
    import::{mesh::read, read_dxf, read_points, read_svg},
    mesh::{TriMesh, shapes},
    model::{GeodesicNet, Guides},
    stages::net::stage::{ProfileKey, check_profile},
};

/// The keys of `[net]` that name files; the stage reads the others.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Keys {
    profile: Option<ProfileKey>,
    previous: Option<PathBuf>,
}

/// A profile, or a net; in the units of its file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Beginning {
    /// What it was read from.
    pub(super) name: String,
    profile: Vec<Vec2>,
    net: Option<GeodesicNet>,
}

/// Points of a profile on the surface that a net stays on, and around it.
const FINENESS: [usize; 2] = [200, 360];

/// What `[net]` names; `None` where it names nothing, and where the job has no such stage.
pub(super) fn load(config: &Config<'_>) -> Result<Option<Beginning>, InputError> {
    let Some(table) = config.tables.get("net") else { return Ok(None) };
    let keys = Keys::deserialize(toml::de::Deserializer::from(table.clone()));
    let keys = keys.map_err(|err| config.source.toml_error(&err))?;
    let begin = |name: String| Beginning { name, profile: vec![], net: None };
    let name = |path: &Path| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
    if let Some(path) = keys.previous {
        let net = earlier(&config.source.folder().join(&path))?;
        return Ok(Some(Beginning { net: Some(net), ..begin(name(&path)) }));
    }
    let made = match keys.profile {
        None => return Ok(None),
        Some(ProfileKey::Points(points)) => {
            Beginning { profile: points.into_iter().map(Vec2::from).collect(), ..begin("net.profile".into()) }
        }
        Some(ProfileKey::File(path)) => {
            Beginning { profile: profile(&config.source.folder().join(&path))?, ..begin(name(&path)) }
        }
    };
    let refuse = |err: &dyn std::error::Error| InputError::Profile { path: made.name.clone(), reason: err.to_string() };
    check_profile(&made.profile).map_err(|err| refuse(&err))?;
    Ok(Some(made))
}

/// The first line of a drawing, the axis being the left edge of its page; or a table of radii and heights.
fn profile(path: &Path) -> Result<Vec<Vec2>, InputError> {
    let refuse = |reason: String| InputError::Profile { path: path.display().to_string(), reason };
    let bytes = std::fs::read(path).map_err(|err| refuse(err.to_string()))?;
    let is = |ending: &str| path.extension().is_some_and(|it| it.eq_ignore_ascii_case(ending));
    if !is("svg") && !is("dxf") {
        return read_points(&String::from_utf8_lossy(&bytes)).map_err(|err| refuse(err.to_string()));
    }
    let drawing = if is("svg") { read_svg(&bytes) } else { read_dxf(&bytes) };
    let line = drawing.map_err(|err| refuse(err.to_string()))?.lines.into_iter().next();
    let line = line.ok_or_else(|| refuse("it holds no line; draw the profile as a path".into()))?;
    if line.closed {
        return Err(refuse("its line is closed; draw the profile as one open path from end to end".into()));
    }
    Ok(line.points)
}

/// A net as `emit::net` writes it: point (i, j) has the number i columns + j, and the first face is a quad between both rows.
fn earlier(path: &Path) -> Result<GeodesicNet, InputError> {
    let soup = read(path)?;
    let columns = soup.faces.iter().take(2).flatten().max().map_or(0, |&it| it as usize - 1);
    let points = soup.positions;
    let rows = points.len() / columns.max(1);
    if columns < 2 || rows * columns != points.len() || soup.faces.len() != 2 * (rows - 1) * (columns - 1) {
        let reason =
            "it is no net of quads in rows; give a model/net.obj or model/bent.obj of an earlier run".to_owned();
        return Err(InputError::Profile { path: path.display().to_string(), reason });
    }
    Ok(GeodesicNet { rows, columns, points })
}

impl Beginning {
    /// The surface to look at and to stay on: the whole surface of revolution, or the triangles of the net.
    pub(super) fn mesh(&self) -> Result<TriMesh, InputError> {
        if let Some(net) = &self.net {
            let refuse = |reason: String| InputError::Profile { path: self.name.clone(), reason };
            return net.mesh().map_err(|err| refuse(err.to_string()));
        }
        let line = ArcLength::new(self.profile.clone()).expect("a profile was checked to have a length");
        let step = line.length() / (FINENESS[0] - 1) as f64;
        let even: Vec<Vec2> = (0..FINENESS[0]).map(|k| line.at(k as f64 * step).0).collect();
        Ok(shapes::revolve(&even, FINENESS[1]))
    }

    /// Puts it among the guides, times `scale`.
    pub(super) fn guide(self, scale: f64, guides: &mut Guides) {
        guides.profile = self.profile.into_iter().map(|p| p * scale).collect();
        guides.net = self.net;
        guides.net.iter_mut().flat_map(|it| &mut it.points).for_each(|p| *p *= scale);
    }
}
