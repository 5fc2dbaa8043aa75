//! What strips are worth.
use super::border::planarity;
use crate::{
    geom::{Box2, Vec2, Vec3, angle_between, ears::ears, polygon::orientation, signed_area},
    mesh::{
        Bvh, Field, Id,
        distance::{SurfaceDistance, sample},
    },
    model::{CutMesh, Flattening, Panel, PanelKind, PieceId, Ruled, Strips},
};

/// Panels smaller than this share of their piece do not count as quads and polygons.
const LEAST_SHARE: f64 = 0.002;
/// Points at which normals are compared.
const SAMPLES: usize = 20_000;

/// What the strips of a job are worth.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Strips: chains of panels.
    pub strips: usize,
    /// Quadrilaterals, polygons and triangles.
    pub panels: [usize; 3],
    /// Shares of the area in them.
    pub area_shares: [f64; 3],
    /// Share of the area in quadrilaterals and polygons of at least 0.2 % of their piece each.
    pub panel_share: f64,
    /// Pairs of rulings of a piece whose ends interleave along its outline.
    pub interleaved: usize,
    /// Pairs of rulings of a piece that cross in the plane without a common end.
    pub crossings: usize,
    /// Points of the outline where more than one ruling ends.
    pub shared_ends: usize,
    /// Largest planarity of a quadrilateral or polygon.
    pub planarity_max: f64,
    /// Planarity that 99 of 100 quadrilaterals and polygons keep.
    pub planarity_p99: f64,
    /// Share of the area of the flat pieces under panels whose outline is simple.
    pub covered_share: f64,
    /// Two-sided distance between the cut mesh and the panels, mm.
    pub distance: SurfaceDistance,
    /// Mean angle between the normals of the mesh and of the panel there, radians.
    pub normal_error: f64,
    /// Mean angle between the directions at the vertices and the rulings of the quadrilaterals there, weighted by
    /// confidence, radians.
    pub direction_error: f64,
    /// Mean of |length in space − length in the plane| / length in the plane of the rulings.
    pub chord_error: f64,
    /// The same with the length along the surface: what the flattening stretched, without what the ruling bends.
    pub stretch_error: f64,
    /// Pieces without a result.
    pub unsolved: Vec<PieceId>,
    /// Pieces without reliable rulings.
    pub unreliable: Vec<PieceId>,
    /// Planar pieces.
    pub flat: Vec<PieceId>,
}

/// Measures strips against the mesh they were made from.
pub fn quality(cut: &CutMesh, flat: &Flattening, strips: &Strips) -> Quality {
    let outlines: Vec<Vec<Vec2>> = strips.panels.iter().map(|it| strips.flat_outline(it)).collect();
    let areas: Vec<f64> = outlines.iter().map(|it| signed_area(it)).collect();
    let mut piece_area = Field::filled(cut.pieces.len(), 0.0);
    for f in cut.mesh.faces() {
        piece_area[cut.piece_of[f]] += signed_area(&cut.mesh.face_vertices(f).map(|v| flat.uv[v])).abs();
    }
    let total: f64 = piece_area.iter().sum();
    let mut panels = [0; 3];
    let mut area_shares = [0.0; 3];
    let (mut panel_area, mut covered) = (0.0, 0.0);
    for ((panel, &area), outline) in strips.panels.iter().zip(&areas).zip(&outlines) {
        let kind = panel.kind as usize;
        panels[kind] += 1;
        area_shares[kind] += area / total;
        if panel.kind != PanelKind::Triangle && area >= LEAST_SHARE * piece_area[panel.piece] {
            panel_area += area;
        }
        if area > 0.0 && is_simple(outline) {
            covered += area;
        }
    }
    let mut planar = planarities(strips);
    planar.sort_by(f64::total_cmp);
    let [interleaved, crossings] = crossing_pairs(strips);
    let (distance, normal_error, direction_error) = distance(cut, strips);
    let [chord_error, stretch_error] = chord_errors(strips);
    let pieces = |wanted: Ruled| strips.ruled.enumerate().filter(|it| *it.1 == wanted).map(|it| it.0).collect();
    Quality {
        strips: (0..strips.panels.len()).filter(|&p| p == 0 || key(strips, p) != key(strips, p - 1)).count(),
        panels,
        area_shares,
        panel_share: panel_area / total,
        interleaved,
        crossings,
        shared_ends: shared_ends(strips),
        planarity_max: planar.last().copied().unwrap_or(0.0),
        planarity_p99: planar.get((planar.len() * 99).div_ceil(100).saturating_sub(1)).copied().unwrap_or(0.0),
        covered_share: covered / total,
        distance,
        normal_error,
        direction_error,
        chord_error,
        stretch_error,
        unsolved: pieces(Ruled::Unsolved),
        unreliable: pieces(Ruled::Unreliable),
        flat: pieces(Ruled::Flat),
    }
}

fn key(strips: &Strips, p: usize) -> (PieceId, u32) {
    (strips.panels[p].piece, strips.panels[p].strip)
}

/// Whether ears fill an outline: none is turned over, as some would be where it crosses itself.
fn is_simple(outline: &[Vec2]) -> bool {
    let all = signed_area(outline);
    ears(outline).iter().all(|t| signed_area(&t.map(|k| outline[k])) > -1e-9 * all)
}

/// Planarity of every quadrilateral and polygon: of the four ends of its rulings, or half its thickness over its size.
fn planarities(strips: &Strips) -> Vec<f64> {
    let mut ends: Vec<Vec<u32>> = vec![Vec::new(); strips.panels.len()];
    for ruling in &strips.rulings {
        for p in ruling.panels {
            ends[p as usize].extend(ruling.ends);
        }
    }
    let of = |(p, panel): (usize, &Panel)| match panel.kind {
        PanelKind::Triangle => None,
        PanelKind::Quad => {
            // Corners of a piece are numbered along its outline.
            ends[p].sort_unstable();
            let corners: [u32; 4] = ends[p][..].try_into().ok()?;
            Some(planarity(corners.map(|c| strips.place(c))))
        }
        PanelKind::Polygon => {
            let normal = strips.normal(panel);
            let heights = || panel.outline.iter().map(|&c| normal.dot(&strips.place(c)));
            let (low, high) = (heights().fold(f64::INFINITY, f64::min), heights().fold(f64::NEG_INFINITY, f64::max));
            let size = Box2::of(&strips.flat_outline(panel)).size().norm();
            Some(0.5 * (high - low) / size.max(f64::MIN_POSITIVE))
        }
    };
    strips.panels.iter().enumerate().filter_map(of).collect()
}

/// Pairs of rulings that interleave along the outline, and that cross in the plane.
fn crossing_pairs(strips: &Strips) -> [usize; 2] {
    let mut out = [0; 2];
    for group in strips.rulings.chunk_by(|a, b| a.piece == b.piece) {
        for (i, a) in group.iter().enumerate() {
            for b in &group[i + 1..] {
                let between = |c: u32| a.ends[0] < c && c < a.ends[1];
                let outside = |c: u32| c < a.ends[0] || c > a.ends[1];
                let [c, d] = b.ends;
                out[0] += usize::from((between(c) && outside(d)) || (outside(c) && between(d)));
                let uv = |c: u32| strips.flat(c);
                let apart = a.ends.iter().all(|c| !b.ends.contains(c));
                out[1] += usize::from(apart && crosses(a.ends.map(uv), b.ends.map(uv)));
            }
        }
    }
    out
}

/// Whether two segments cross inside both.
fn crosses([a, b]: [Vec2; 2], [c, d]: [Vec2; 2]) -> bool {
    orientation(a, b, c) * orientation(a, b, d) < 0.0 && orientation(c, d, a) * orientation(c, d, b) < 0.0
}

fn shared_ends(strips: &Strips) -> usize {
    let mut ends: Vec<u32> = strips.rulings.iter().flat_map(|it| it.ends).collect();
    ends.sort_unstable();
    ends.chunk_by(|a, b| a == b).filter(|it| it.len() > 1).count()
}

/// Distance in both directions; mean angle between the normals of the mesh and of the panels; mean angle between the
/// directions at the vertices and the rulings next to them, weighted by confidence.
fn distance(cut: &CutMesh, strips: &Strips) -> (SurfaceDistance, f64, f64) {
    let mesh = &cut.mesh;
    let Some((panels, panel_of)) = strips.mesh() else {
        return (SurfaceDistance { hausdorff: 0.0, mean: 0.0 }, 0.0, 0.0);
    };
    let between = SurfaceDistance::between(mesh, &panels);
    let normals: Vec<Vec3> = strips.panels.iter().map(|it| strips.normal(it)).collect();
    let along = mean_rulings(strips);
    let points = sample(mesh, SAMPLES);
    let places: Vec<Vec3> = points.iter().map(|it| it.position(mesh)).collect();
    let (mut turned, mut astray, mut weights) = (0.0, 0.0, 0.0);
    for (point, closest) in points.iter().zip(Bvh::new(&panels).closest_all(&places)) {
        let panel = panel_of[closest.face.index()];
        turned += angle_between(mesh.normal(point.face), normals[panel]);
        let doubled: Vec2 = mesh.face_vertices(point.face).iter().map(|&v| strips.directions[v]).sum();
        let weight = doubled.norm() * along[panel].norm();
        if weight > 0.0 && cut.piece_of[point.face] == strips.panels[panel].piece {
            astray += doubled.norm() * 0.5 * angle_between(doubled.push(0.0), along[panel].push(0.0));
            weights += doubled.norm();
        }
    }
    (between, turned / points.len().max(1) as f64, astray / f64::max(weights, f64::MIN_POSITIVE))
}

/// Mean direction of the rulings of each quadrilateral, angles doubled; 0 for other panels.
fn mean_rulings(strips: &Strips) -> Vec<Vec2> {
    let mut sums = vec![Vec2::zeros(); strips.panels.len()];
    for ruling in &strips.rulings {
        let d = strips.flat(ruling.ends[1]) - strips.flat(ruling.ends[0]);
        for p in ruling.panels.map(|p| p as usize).into_iter().filter(|&p| strips.panels[p].kind == PanelKind::Quad) {
            sums[p] += Vec2::new(d.x * d.x - d.y * d.y, 2.0 * d.x * d.y);
        }
    }
    sums
}

/// Means over the rulings of |length in space − length in the plane| / length in the plane, straight and along the surface.
fn chord_errors(strips: &Strips) -> [f64; 2] {
    let mut sums = [0.0; 2];
    for it in &strips.rulings {
        let flat = (strips.flat(it.ends[1]) - strips.flat(it.ends[0])).norm();
        let straight = (strips.place(it.ends[1]) - strips.place(it.ends[0])).norm();
        sums[0] += (straight - flat).abs() / flat;
        sums[1] += (it.length - flat).abs() / flat;
    }
    sums.map(|it| it / strips.rulings.len().max(1) as f64)
}
