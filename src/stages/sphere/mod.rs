//! Gores: a closed surface cut along the meridians or the parallels of its conformal map to the sphere, for globes, balls,
//! balloons and domes.
//!
//! The map is turned so that two chosen places are the poles. N meridians from pole to pole (or rings at equal distances along a
//! meridian of the surface, or along a path) become edges of the mesh and seams; gores that cannot be laid flat within the material's stretch
//! are halved lengthwise. What still exceeds it is left to the stage `cut`, which the seams bind.
mod mend;
mod path;
mod share;
pub mod slice;
pub mod stage;
#[cfg(test)]
mod tests;

use std::f64::consts::{FRAC_PI_2, TAU};

use crate::{
    geom::{Vec2, Vec3},
    mesh::{EdgeId, FaceId, MeshError, TriMesh, distance::SurfacePoint},
    model::{StripeLine, Stripes},
    numeric::Monitor,
    surface::{
        chart::{ChartBuilder, Metric},
        flatten::{FlattenError, Limit, flatten_domain},
        sphere_map::{Locator, Method, SphereError, SphereMap, Stretch, resolved_map, with_poles},
    },
};

use share::share;
use slice::{Sliced, middle};

/// Step of drawn lines, radians.
const STEP: f64 = TAU / 360.0;
/// A line that runs closer beside a seam than this, at less than 30° to it, is not drawn there, mm: the cut shows it.
const BESIDE: f64 = 0.5;

/// How the surface is sliced.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slices {
    /// From pole to pole.
    Meridians,
    /// Rings of equal width along the first meridian, or along a path.
    Rings,
}

/// Plain options; millimetres and radians.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// How the map is found.
    pub method: Method,
    /// How the surface is sliced.
    pub slices: Slices,
    /// Number of gores or rings.
    pub count: usize,
    /// Most gores after halving; no fewer than `count`.
    pub most: usize,
    /// The poles are the vertices farthest along this and against it, where there is no path.
    pub pole: Vec3,
    /// Places, the ends of which are the poles, top first, and along which rings are equally wide, mm; empty, or at least two.
    pub path: Vec<Vec3>,
    /// Longitude 0 passes what is farthest along this.
    pub front: Vec3,
    /// Longitude of the first seam.
    pub start: f64,
    /// Angle between a pole and the rim of its cap on the sphere, top and bottom; 0 for no cap.
    pub caps: [f64; 2],
    /// Whether seams may be longer or shorter in the plane than in space, so that pieces stretch less.
    pub share: bool,
    /// Limit of the principal stretch, to which gores are halved.
    pub stretch: f64,
    /// Distance of drawn parallels and meridians; 0 for none.
    pub graticule: f64,
    /// Lines to be drawn, as longitudes and latitudes.
    pub texture: Vec<Vec<Vec2>>,
}

/// A surface with its slices.
#[derive(Debug, Clone)]
pub struct Gores {
    /// The map of the given mesh, as it was certified.
    pub map: SphereMap,
    /// The faces of what was mapped: the given mesh, or its subdivision where its faces are too large for its limbs.
    pub faces: Vec<[u32; 3]>,
    /// The surface with the lines as edges.
    pub mesh: TriMesh,
    /// Image of its vertices on the sphere, the poles at ±z.
    pub points: Vec<Vec3>,
    /// The edges that are seams, ascending.
    pub seams: Vec<EdgeId>,
    /// For every seam how many times as long it should be in the plane as in space.
    pub scales: Vec<f64>,
    /// Longitudes of the seams from pole to pole, or heights of the rings on the sphere, ascending.
    pub lines: Vec<f64>,
    /// Per slice in the order of their lines, then both caps: the largest principal stretch of 99.9 % of its area.
    pub stretch: Vec<f64>,
    /// Lines to be engraved.
    pub drawn: Stripes,
    /// Time of the map, s (may differ between runs).
    pub seconds: f64,
}

/// Why there are no gores.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GoreError {
    /// There is no map, or it was interrupted.
    #[error(transparent)]
    Sphere(#[from] SphereError),
    /// A face of the sliced mesh is not usable.
    #[error("slicing made a face that is not usable: {0}; take fewer gores, or remesh the surface first")]
    Mesh(#[from] MeshError),
    /// The poles are one.
    #[error(
        "both ends of sphere.path lie nearest to one vertex of the mesh, at ({:.3}, {:.3}, {:.3}); choose ends that are farther apart, in the coordinates of the input file", place.x, place.y, place.z
    )]
    Ends {
        /// The vertex, mm.
        place: Vec3,
    },
    /// The path does not lead from pole to pole.
    #[error(
        "rings along sphere.path would cross one another near ({:.3}, {:.3}, {:.3}) mm: the path turns back there; leave out the places that make it turn, or take fewer rings", place.x, place.y, place.z
    )]
    Back {
        /// Where, mm.
        place: Vec3,
    },
    /// A slice cannot be flattened.
    #[error("a gore cannot be laid flat: {0}; remesh the surface there or take other poles")]
    Flatten(#[from] FlattenError),
}

/// Maps the surface to the sphere and slices it.
pub fn gores(mesh: &TriMesh, options: &Options, monitor: &Monitor) -> Result<Gores, GoreError> {
    let started = monitor.seconds();
    let (finer, map) = resolved_map(mesh, options.method, monitor)?;
    let mesh = finer.as_ref().unwrap_or(mesh);
    let seconds = monitor.seconds() - started;
    let points = with_poles(mesh, &map.points, path::poles(mesh, options)?, options.front);
    let mut lines = match options.slices {
        Slices::Meridians => {
            (0..options.count).map(|k| options.start + TAU * k as f64 / options.count as f64).collect()
        }
        Slices::Rings => path::ring_heights(mesh, &points, options)?,
    };
    loop {
        monitor.check().map_err(SphereError::from)?;
        let (sliced, images, seams) = slice(mesh, &points, &lines, options)?;
        let measured = |scales: &[f64]| measure((&sliced, &images), (&seams, scales), &lines, options);
        let shared = if options.share { Some(share(&sliced, &seams, options.stretch)?) } else { None };
        let (scales, stretch) = match shared.map(|it| (measured(&it), it)) {
            Some((Ok(stretch), scales)) => (scales, stretch),
            // Slivers may have no room for what the seams beside them want.
            _ => {
                let scales = vec![1.0; seams.len()];
                let stretch = measured(&scales)?;
                (scales, stretch)
            }
        };
        let halved = halve(&lines, &stretch, options);
        if halved.len() > lines.len() && halved.len() <= options.most {
            lines = halved;
            continue;
        }
        let drawn = draw(&sliced, &images, &seams, options);
        let faces = mesh.face_indices();
        return Ok(Gores { map, faces, mesh: sliced, points: images, seams, scales, lines, stretch, drawn, seconds });
    }
}

type SlicedMesh = (TriMesh, Vec<Vec3>, Vec<EdgeId>);

fn slice(mesh: &TriMesh, points: &[Vec3], lines: &[f64], options: &Options) -> Result<SlicedMesh, MeshError> {
    let mut sliced = Sliced::new(mesh, points);
    let pole = [1.0, -1.0];
    for (cap, pole) in options.caps.into_iter().zip(pole).filter(|it| it.0 > 0.0) {
        sliced.circle(pole * cap.cos(), Some(pole));
    }
    match options.slices {
        Slices::Meridians => lines.iter().for_each(|&line| sliced.meridian(line)),
        Slices::Rings => {
            // Without caps the first and the last slice are disks as they are.
            let last = lines.len() - 1;
            let end = |k: usize| [(last, 0), (0, 1)].into_iter().find(|&(at, i)| at == k && options.caps[i] == 0.0);
            for (k, &z) in lines.iter().enumerate() {
                sliced.circle(z, end(k).map(|it| pole[it.1]));
            }
            sliced.meridian(options.start);
        }
    }
    sliced.finish()
}

/// Largest stretch of 99.9 % of the area of every slice, laid flat; infinite for one that is not a disk.
fn measure(
    (mesh, points): (&TriMesh, &[Vec3]),
    (seams, scales): (&[EdgeId], &[f64]),
    lines: &[f64],
    options: &Options,
) -> Result<Vec<f64>, GoreError> {
    let cut = |e: EdgeId| seams.binary_search(&e).is_ok();
    let halfedges = mesh.halfedges().filter_map(|h| Some((h, scales[seams.binary_search(&mesh.edge(h)).ok()?])));
    let metric = Metric::new(mesh).with_rim(&halfedges.collect::<Vec<_>>());
    let mut builder = ChartBuilder::new(mesh);
    let all: Vec<FaceId> = mesh.faces().collect();
    let slices = lines.len() + usize::from(options.slices == Slices::Rings);
    let mut stretch = vec![0.0_f64; slices + 2];
    for faces in builder.components(&all, &cut) {
        let chart = builder.chart(faces.clone(), &cut);
        let slot = slot(mesh, points, &faces, lines, options);
        let worst = if chart.is_disk() {
            let flat = flatten_domain(&mut builder, &metric, &chart, &cut, 0.0, Limit::new(options.stretch))?;
            principal(mesh, &metric, &chart.faces, &chart.corners, &flat.uv)
        } else {
            f64::INFINITY
        };
        stretch[slot] = stretch[slot].max(worst);
    }
    Ok(stretch)
}

/// The principal stretch that 99.9 % of the area keep.
fn principal(mesh: &TriMesh, metric: &Metric, faces: &[FaceId], corners: &[[u32; 3]], uv: &[Vec2]) -> f64 {
    let mut found: Vec<(f64, f64)> = faces
        .iter()
        .zip(corners)
        .map(|(&f, corners)| {
            let flat = corners.map(|v| uv[v as usize]);
            let distortion = crate::surface::distortion::Distortion::new(mesh.face_positions(f), flat);
            (distortion.principal_stretch(), metric.area[f])
        })
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut left = 0.001 * found.iter().map(|it| it.1).sum::<f64>();
    found
        .iter()
        .find(|it| {
            left -= it.1;
            left < 0.0
        })
        .map_or(0.0, |it| it.0)
}

/// The slice that most of the area of some faces belongs to: between a line and the next, or a cap (the last two slots).
fn slot(mesh: &TriMesh, points: &[Vec3], faces: &[FaceId], lines: &[f64], options: &Options) -> usize {
    let slices = lines.len() + usize::from(options.slices == Slices::Rings);
    let mut votes = vec![0.0; slices + 2];
    for &f in faces {
        let (longitude, latitude) = middle(mesh, points, f);
        let [top, bottom] = options.caps.map(|cap| cap > 0.0 && latitude.abs() > FRAC_PI_2 - cap);
        let slot = if top && latitude > 0.0 {
            slices
        } else if bottom && latitude < 0.0 {
            slices + 1
        } else {
            match options.slices {
                Slices::Meridians => {
                    let behind = |line: &f64| (longitude - line).rem_euclid(TAU);
                    let least = (0..lines.len()).min_by(|&a, &b| behind(&lines[a]).total_cmp(&behind(&lines[b])));
                    least.unwrap_or(0)
                }
                Slices::Rings => lines.partition_point(|&z| z < latitude.sin()),
            }
        };
        votes[slot] += mesh.area(f);
    }
    let best = (0..votes.len()).max_by(|&a, &b| votes[a].total_cmp(&votes[b]).then(b.cmp(&a)));
    best.unwrap_or(0)
}

/// The lines with one more in the middle of every slice that stretches too much.
fn halve(lines: &[f64], stretch: &[f64], options: &Options) -> Vec<f64> {
    let over = |k: usize| stretch[k] > options.stretch;
    let mut out = lines.to_vec();
    match options.slices {
        Slices::Meridians => out.extend((0..lines.len()).filter(|&k| over(k)).map(|k| {
            let next = lines.get(k + 1).copied().unwrap_or(lines[0] + TAU);
            0.5 * (lines[k] + next)
        })),
        Slices::Rings => {
            let ends = [(options.caps[1] - FRAC_PI_2).sin(), (FRAC_PI_2 - options.caps[0]).sin()];
            let all = [&ends[..1], lines, &ends[1..]].concat();
            let middle = |k: usize| (0.5 * (all[k].asin() + all[k + 1].asin())).sin();
            out.extend((0..=lines.len()).filter(|&k| over(k)).map(middle));
        }
    }
    out.sort_by(f64::total_cmp);
    out
}

/// Parallels, meridians and the lines of the texture on the faces of the mesh, but for what runs along a seam.
fn draw(mesh: &TriMesh, points: &[Vec3], seams: &[EdgeId], options: &Options) -> Stripes {
    let direction = |longitude: f64, latitude: f64| {
        let ((sin, cos), (z, r)) = (longitude.sin_cos(), latitude.sin_cos());
        Vec3::new(r * cos, r * sin, z)
    };
    let mut lines: Vec<Vec<Vec3>> = Vec::new();
    if options.graticule > 0.0 {
        let turns = (TAU / STEP).round() as usize;
        let count = (FRAC_PI_2 / options.graticule - 1e-9).floor() as i64;
        for k in -count..=count {
            let latitude = k as f64 * options.graticule;
            lines.push((0..=turns).map(|i| direction(STEP * i as f64, latitude)).collect());
        }
        for k in 0..(TAU / options.graticule + 1e-9).floor() as usize {
            // Meridians end one parallel before the poles, where they would run into one another.
            let (longitude, end) = (options.start + k as f64 * options.graticule, count as f64 * options.graticule);
            let steps = (2.0 * end / STEP).ceil() as usize;
            lines.push((0..=steps).map(|i| direction(longitude, -end + 2.0 * end * i as f64 / steps as f64)).collect());
        }
    }
    for line in &options.texture {
        let mut out: Vec<Vec3> = Vec::new();
        for pair in line.windows(2) {
            let steps = ((pair[1] - pair[0]).norm() / STEP).ceil().max(1.0);
            out.extend((0..steps as usize).map(|i| {
                let p = pair[0] + (pair[1] - pair[0]) * (i as f64 / steps);
                direction(p.x, p.y)
            }));
        }
        out.extend(line.last().map(|p| direction(p.x, p.y)));
        lines.push(out);
    }
    let locator = Locator::new(mesh, points);
    let lines =
        lines.iter().flat_map(|line| on_faces(&locator, line, seams)).filter(|it| !it.pieces.is_empty()).collect();
    Stripes { lines, drawn: true, faces: mesh.face_count(), components: 1, ..Stripes::default() }
}

/// A line on the sphere as lines on the surface, broken where it runs along a seam.
fn on_faces(locator: &Locator<'_>, line: &[Vec3], seams: &[EdgeId]) -> Vec<StripeLine> {
    let mesh = locator.mesh();
    let place = |face, barycentric| SurfacePoint { face, barycentric }.position(mesh);
    let along = |it: &Stretch| {
        let length = (place(it.face, it.ends[1]) - place(it.face, it.ends[0])).norm();
        mesh.face_halfedges(it.face).into_iter().enumerate().any(|(k, h)| {
            let height = 2.0 * mesh.area(it.face) / mesh.vector(h).norm();
            let [from, to] = it.ends.map(|weights| weights[(k + 2) % 3] * height);
            let is_along = from.max(to) < BESIDE && (from - to).abs() <= 0.5 * length;
            is_along && seams.binary_search(&mesh.edge(h)).is_ok()
        })
    };
    let stretches = locator.trace(line);
    let runs = stretches.split(along).filter(|run| !run.is_empty());
    let drawn = runs.map(|run| {
        let mut points: Vec<Vec3> = run.iter().map(|it| place(it.face, it.ends[0])).collect();
        points.extend(run.last().map(|it| place(it.face, it.ends[1])));
        let pieces = run.iter().map(|it| (it.face, it.ends)).collect();
        StripeLine { points, closed: false, inner_ends: 0, pieces }
    });
    // A line along a seam touches faces that only have a corner on it.
    drawn.filter(|it| it.length() > BESIDE).collect()
}

/// Length of all seams, mm.
pub fn seam_length(gores: &Gores) -> f64 {
    gores.seams.iter().map(|&e| gores.mesh.edge_length(e)).sum()
}
