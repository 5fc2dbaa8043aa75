//! Mould segments: the wall under a sector of the surface of revolution, divided along parallels and meridians until its parts fit
//! the machine, with holes for dowels in the joints.
use super::{
    MoldError, Revolution, Shell, finish,
    solid::{Hole, Sector},
};
use crate::{
    geom::{
        Box3, Vec2, Vec3,
        boolean::{difference, intersection, offset},
        polyline::{merge_near, simplify, subdivided},
    },
    mesh::{Field, TriMesh},
    model::{GeodesicNet, MoldSegment, Molds},
    numeric::Monitor,
};

/// Points of a section nearer than this are one, mm; far above what single precision in an STL can tell apart.
const MERGE: f64 = 1e-3;
/// Points of a section that lie so near to a line through others are left out, mm: a triangle on three points of a line has no
/// area.
const STRAIGHT: f64 = 1e-4;
/// Parts across and along that are tried.
const MOST: [usize; 2] = [64, 64];
/// Least wall on both sides of a dowel, mm.
const MEAT: f64 = 1.0;

/// The wall of thickness `thickness` under a profile between two heights, as a polygon of (radius, height), counter-clockwise.
pub(super) fn wall(profile: &[Vec2], thickness: f64, heights: [f64; 2]) -> Result<Vec<Vec2>, MoldError> {
    let n = profile.len();
    let far = 4.0 * thickness + 1.0;
    let radius = profile.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
    // Longer than it is at both ends and far behind the axis, so that only the profile itself has a wall.
    let beyond = |end: Vec2, before: Vec2| end + (end - before).normalize() * far;
    let (low, high) = (beyond(profile[0], profile[1]), beyond(profile[n - 1], profile[n - 2]));
    let widest = profile.iter().map(|p| p.x).fold(low.x.max(high.x), f64::max);
    let back = -widest - far;
    let mut body = vec![Vec2::new(back, low.y), low];
    body.extend(profile);
    body.extend([high, Vec2::new(back, high.y)]);
    let core: Vec<Vec<Vec2>> = offset(std::slice::from_ref(&body), -thickness).concat();
    let window = [[0.0, heights[0]], [2.0 * widest, heights[0]], [2.0 * widest, heights[1]], [0.0, heights[1]]];
    let shell = difference(&[body], &core).concat();
    let mut found = intersection(&shell, &[window.map(Vec2::from).to_vec()]);
    found.sort_by(|a, b| a[0].len().cmp(&b[0].len()).reverse());
    let thick = || MoldError::Thick { thickness, radius };
    let [region] = &found[..] else { return Err(thick()) };
    let [ring] = &region[..] else { return Err(thick()) };
    if ring.iter().any(|p| p.x <= MERGE) {
        return Err(thick());
    }
    let apart: Vec<Vec2> = merge_near(ring, true, MERGE, &|_| false).into_iter().map(|k| ring[k]).collect();
    Ok(simplify(&apart, true, STRAIGHT, &|_| false).into_iter().map(|k| apart[k]).collect())
}

/// How a sector is divided: rows at which it is cut, and parts across.
struct Division {
    rows: Vec<usize>,
    across: usize,
}

/// The profile is divided so often before it is swept, so that its facets do not show on a panel.
const SMOOTH: u32 = 3;

/// The solid parts of mould number `mold`, which carries panels between two rows over an angle, with the programs that mill them.
pub(super) fn segments(
    revolution: &Revolution,
    mold: usize,
    rows: [usize; 2],
    angle: f64,
    shell: &Shell,
    monitor: &Monitor,
) -> Result<Molds, MoldError> {
    let fine = 2_usize.pow(SMOOTH);
    let profile = (0..SMOOTH).fold(revolution.profile.clone(), |line, _| subdivided(&line));
    wall(&profile, shell.thickness, rows.map(|it| revolution.profile[it].y))?;
    let Division { rows, across } = divide(&revolution.profile, rows, angle, shell)?;
    let mut out = Molds::default();
    let part = angle / across as f64;
    for (place, pair) in rows.windows(2).enumerate() {
        let heights = [pair[0], pair[1]].map(|it| revolution.profile[it].y);
        let section = wall(&profile, shell.thickness, heights)?;
        let level = [place > 0, place + 2 < rows.len()];
        for k in 0..across {
            monitor.check().map_err(MoldError::Interrupted)?;
            let ends = [k > 0, k + 1 < across];
            let (sector, without) = sector(&section, part, heights, [ends, level], shell);
            out.undoweled += without;
            let name = format!("M{}-{}-{}", mold + 1, place + 1, k + 1);
            let (made, corner) = segment(&sector, name.clone(), [pair[0], pair[1]])?;
            out.segments.push(made);
            let Some(mill) = &shell.mill else { continue };
            let lay = |more: f64| {
                let mut net = skin(&profile, [fine * pair[0], fine * pair[1]], part, more);
                // The net of a stretch of the profile keeps its heights.
                net.points.iter_mut().for_each(|p| *p -= corner);
                net.mesh().map_err(|err| MoldError::Broken { name: name.clone(), reason: err.to_string() })
            };
            let placed = Placed { name: name.clone(), patch: lay(0.0)?, beyond: lay(3.0 * mill.radius)? };
            out.programs.push(finish::program(&placed, mill, monitor).map_err(MoldError::Interrupted)?);
        }
    }
    Ok(out)
}

/// A part over an angle, drilled at those of its ends and levels that join others; and the number of joints without room for that.
fn sector(section: &[Vec2], angle: f64, heights: [f64; 2], joined: [[bool; 2]; 2], shell: &Shell) -> (Sector, usize) {
    let widest = section.iter().map(|p| p.x).fold(0.0, f64::max);
    let steps = (angle / (2.0 * (1.0 - shell.chord / widest).clamp(-1.0, 1.0).acos())).ceil().max(2.0) as usize;
    let angles = [-0.5, 0.5].map(|it| it * angle);
    let mut out = Sector {
        section: section.to_vec(),
        angles,
        steps,
        radius: shell.dowel / 2.0,
        ends: [vec![], vec![]],
        level: vec![],
    };
    let mut without = 0;
    for side in [0, 1].into_iter().filter(|_| shell.dowel > 0.0) {
        if joined[0][side] {
            out.ends[side] = end_holes(section, shell);
            without += usize::from(out.ends[side].is_empty());
        }
        if joined[1][side] {
            let found = level_holes(section, heights[side], angle, shell);
            without += usize::from(found.is_none());
            out.level.extend(found);
        }
    }
    (out, without)
}

/// The outer side of a segment where its STL lies: as it is, and longer on all sides so that a ball can roll off it.
pub(super) struct Placed {
    /// Name of the segment.
    pub(super) name: String,
    pub(super) patch: TriMesh,
    pub(super) beyond: TriMesh,
}

/// Facets of what is milled lie so near to the surface across, mm.
const MILLED: f64 = 1e-3;

/// The outer side between two rows over an angle, longer by `more` on all sides.
fn skin(profile: &[Vec2], rows: [usize; 2], angle: f64, more: f64) -> GeodesicNet {
    let mut line = profile[rows[0]..=rows[1]].to_vec();
    if more > 0.0 {
        let n = line.len();
        let beyond = |end: Vec2, before: Vec2| end + (end - before).normalize() * more;
        let (low, high) = (beyond(line[0], line[1]), beyond(line[n - 1], line[n - 2]));
        line.insert(0, Vec2::new(low.x.max(1e-3 * line[0].x), low.y));
        line.push(Vec2::new(high.x.max(1e-3 * high.x), high.y));
    }
    let narrow = line.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
    let widest = line.iter().map(|p| p.x).fold(0.0, f64::max);
    let angle = (angle + 2.0 * more / narrow).min(1.9 * std::f64::consts::PI);
    let steps = (angle / (2.0 * (1.0 - MILLED / widest).acos())).ceil().max(2.0) as usize;
    Revolution { profile: line, turn: angle, lambda: 1.0 }.net(steps, steps + 1)
}

fn segment(sector: &Sector, name: String, rows: [usize; 2]) -> Result<(MoldSegment, Vec3), MoldError> {
    let broken = |reason: String| MoldError::Broken { name: name.clone(), reason };
    let mesh = sector.mesh().map_err(|err| broken(err.to_string()))?;
    if !mesh.boundary_loops().is_empty() {
        return Err(broken("it is not closed".into()));
    }
    let bounds = mesh.bounds();
    let corner = |p: &Vec3| p - bounds.min;
    let mesh = mesh.with_positions(Field::from_vec(mesh.positions().iter().map(corner).collect()));
    let volume = mesh.faces().map(|f| mesh.face_positions(f)).map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0).sum();
    let dowels =
        sector.ends.iter().map(Vec::len).sum::<usize>() + sector.level.iter().map(|it| it.1.len()).sum::<usize>();
    Ok((MoldSegment { name, mesh, rows, size: bounds.size(), volume, dowels }, bounds.min))
}

/// The fewest parts that fit the machine.
fn divide(profile: &[Vec2], [first, last]: [usize; 2], angle: f64, shell: &Shell) -> Result<Division, MoldError> {
    let fits = |size: Vec3| {
        let sorted = |it: Vec3| {
            let mut it = [it.x, it.y, it.z];
            it.sort_by(f64::total_cmp);
            it
        };
        sorted(size).iter().zip(sorted(shell.limit)).all(|(a, b)| *a <= b)
    };
    let mut best: Option<(usize, Division)> = None;
    let mut smallest = Vec3::repeat(f64::INFINITY);
    for along in 1..=MOST[0].min(last - first) {
        let rows = even_rows(profile, [first, last], along);
        let across = (1..=MOST[1]).find(|&across| {
            let sizes =
                rows.windows(2).map(|it| box_of(profile, [it[0], it[1]], angle / across as f64, shell.thickness));
            let largest = sizes.fold(Vec3::zeros(), |a, b| a.sup(&b));
            if largest.norm() < smallest.norm() {
                smallest = largest;
            }
            fits(largest)
        });
        let Some(across) = across else { continue };
        if best.as_ref().is_none_or(|it| along * across < it.0) {
            best = Some((along * across, Division { rows, across }));
        }
    }
    best.map(|it| it.1).ok_or(MoldError::TooLarge { size: smallest, limit: shell.limit })
}

/// Size of the box of a part with its middle meridian over the x-axis, from its outer side and the thickness.
fn box_of(profile: &[Vec2], rows: [usize; 2], angle: f64, thickness: f64) -> Vec3 {
    let stretch = &profile[rows[0]..=rows[1]];
    let (sin, cos) = (angle / 2.0).min(std::f64::consts::PI).sin_cos();
    let mut bounds = Box3::empty();
    for p in stretch {
        let inner = (p.x - 2.0 * thickness).max(0.0);
        bounds.grow(&Vec3::new(p.x, p.x * if angle >= std::f64::consts::PI { 1.0 } else { sin }, p.y));
        bounds.grow(&Vec3::new(p.x.min(inner) * cos.max(0.0) + p.x * cos.min(0.0), 0.0, p.y));
    }
    let size = bounds.size();
    Vec3::new(size.x, 2.0 * size.y, size.z)
}

/// Rows that cut a stretch of the profile into parts of about one length.
fn even_rows(profile: &[Vec2], [first, last]: [usize; 2], parts: usize) -> Vec<usize> {
    let mut along = vec![0.0];
    for k in first..last {
        along.push(along[k - first] + (profile[k + 1] - profile[k]).norm());
    }
    let total = along[last - first];
    let mut rows: Vec<usize> = (0..=parts)
        .map(|part| first + along.partition_point(|&it| it < total * part as f64 / parts as f64 - 1e-9 * total))
        .collect();
    rows.dedup();
    rows
}

/// Two holes in an end face, where the wall is thick enough.
fn end_holes(section: &[Vec2], shell: &Shell) -> Vec<Hole> {
    let radius = shell.dowel / 2.0;
    let heights =
        section.iter().map(|p| p.y).fold([f64::INFINITY, f64::NEG_INFINITY], |a, y| [a[0].min(y), a[1].max(y)]);
    let hole = |share: f64| {
        let z = heights[0] + (heights[1] - heights[0]) * share;
        let [inner, outer] = crossing(section, z)?;
        let room = (outer - inner) / 2.0 - radius - MEAT;
        let middle = (inner + outer) / 2.0;
        // The wall turns away from the straight hole.
        let depth = shell.depth.min((2.0 * middle * room.max(0.0)).sqrt());
        (depth >= radius && far_from_rim(section, Vec2::new(middle, z), radius + MEAT))
            .then_some(Hole { at: Vec2::new(middle, z), depth })
    };
    let apart = 0.5 * (heights[1] - heights[0]) > 2.0 * shell.dowel;
    if apart { [0.25, 0.75].into_iter().filter_map(hole).collect() } else { hole(0.5).into_iter().collect() }
}

/// Two holes in the level face at a height, or one where it is narrow.
fn level_holes(section: &[Vec2], height: f64, angle: f64, shell: &Shell) -> Option<(usize, Vec<Hole>)> {
    let n = section.len();
    let level = |k: usize| [section[k], section[(k + 1) % n]].iter().all(|p| (p.y - height).abs() <= MERGE);
    let length = |k: usize| (section[(k + 1) % n] - section[k]).norm();
    let side = (0..n).filter(|&k| level(k)).max_by(|&a, &b| length(a).total_cmp(&length(b)))?;
    let radius = shell.dowel / 2.0;
    let middle = (section[side].x + section[(side + 1) % n].x) / 2.0;
    let inwards = if section.iter().map(|p| p.y).sum::<f64>() / n as f64 > height { 1.0 } else { -1.0 };
    // As deep as the wall stays around it.
    let room = |depth: f64| {
        let [inner, outer] = crossing(section, height + inwards * depth)?;
        Some((middle - inner).min(outer - middle))
    };
    let deep = (0..=16).map(|k| shell.depth * (1.0 - f64::from(k) / 16.0));
    let depth = deep.into_iter().find(|&it| {
        [0.25, 0.5, 1.0].iter().all(|share| room(it * share + 1e-6).is_some_and(|room| room >= radius + MEAT))
    })?;
    let wide = middle * angle;
    if depth < radius || wide < 2.0 * shell.dowel {
        return None;
    }
    let hole = |share: f64| Hole { at: Vec2::new(middle, share * angle), depth };
    let pair = wide >= 5.0 * shell.dowel;
    Some((side, if pair { vec![hole(-0.25), hole(0.25)] } else { vec![hole(0.0)] }))
}

/// Least and largest radius of a section at a height.
fn crossing(section: &[Vec2], z: f64) -> Option<[f64; 2]> {
    let n = section.len();
    let sides = (0..n).map(|k| (section[k], section[(k + 1) % n])).filter(|(a, b)| (a.y - z) * (b.y - z) < 0.0);
    let found: Vec<f64> = sides.map(|(a, b)| a.x + (b.x - a.x) * (z - a.y) / (b.y - a.y)).collect();
    let least = found.iter().copied().fold(f64::INFINITY, f64::min);
    let most = found.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (found.len() == 2).then_some([least, most])
}

fn far_from_rim(section: &[Vec2], p: Vec2, distance: f64) -> bool {
    crate::geom::polygon::edges(section).all(|(a, b)| crate::geom::polygon::point_segment_distance(p, a, b) >= distance)
}
