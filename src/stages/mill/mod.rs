//! Flank milling and hot-wire cutting: a cutter is led along the rulings of a piece so that its side touches all of each.
//!
//! Postures stand on the rulings of the strips, which are interpolated inside the panels ([`lines`]); each is settled on the
//! developed mesh ([`guard`]) in as many levels as the bow of the ruling takes ([`levels`]), and turned into joints of the
//! machine ([`kinematics`]); blocks are halved until the cutter, moved as the controller moves it, neither cuts in nor hovers;
//! at last the whole program is swept past samples of the body ([`proof`], [`crate::mesh::sweep`]), and where that finds too
//! much left, lower levels are cut as well. Formulas and symbols: [`posture`].

mod curve;
mod guard;
pub mod kinematics;
mod levels;
mod lines;
mod machine;
mod path;
mod plan;
pub mod posture;
mod proof;
pub mod stage;
mod tell;
#[cfg(test)]
mod tests;

pub use kinematics::{Beyond, Carrier, Kinematics, Linear, Rotary};
pub use machine::{Machine, Wire};

use std::collections::BTreeSet;

use crate::{
    geom::{Box3, Vec3},
    mesh::{
        Bvh, FaceId, Field, Id, TriMesh,
        sweep::{Deepest, Samples, Tool},
    },
    model::{CutMesh, MillMove, Milling, PieceId, Ruled, Setup, StripLeft, Strips},
    numeric::{Cancelled, Monitor},
    surface::subdivide,
};
use guard::Guard;
use lines::{Band, Skin};
use proof::{Proof, Swept};
use tell::Tight;

/// Plain options of the kernel. Lengths mm, angles radians, speeds mm/s.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Pieces to cut, by name; every one that can be cut when empty.
    pub pieces: Vec<String>,
    /// The machine.
    pub machine: Machine,
    /// The cutter.
    pub tool: Tool,
    /// How far the cutter reaches beyond the end of a ruling, where there is room.
    pub overhang: f64,
    /// How far a strip is cut beyond its first and last ruling, where there is room.
    pub overlap: f64,
    /// Length of the ways in and out, over the surface.
    pub lead: f64,
    /// Distance of rapid moves from the body.
    pub clearance: f64,
    /// Material on the surface before the first cut.
    pub stock: f64,
    /// Most that one cut takes off.
    pub depth: f64,
    /// How deep the surface may be cut into.
    pub gouge: f64,
    /// How much may be left on it.
    pub excess: f64,
    /// Speed of the cut.
    pub feed: f64,
    /// Spindle speed, 1/min; passed on.
    pub spindle: f64,
    /// Direction of the body that lies up on the machine; the one that reaches most when absent.
    pub up: Option<Vec3>,
    /// Size of the block that the body stands on.
    pub fixture: Vec3,
    /// Where the middle of the table top is, in work coordinates.
    pub table: Vec3,
}

/// Why nothing is milled.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MillError {
    /// A name that no piece has.
    #[error("there is no piece `{name}`; there are {known}")]
    Unknown {
        /// The name.
        name: String,
        /// All names.
        known: String,
    },
    /// A piece, and why it cannot be cut.
    #[error("piece {name}: {reason}")]
    Piece {
        /// Its name.
        name: String,
        /// For people: what, where, what to do.
        reason: String,
    },
    /// The profile has no axes to cut a block with.
    #[error("the machine `{name}` works sheets; pieces are milled by one of kind \"mill\" or \"hot-wire\"")]
    Machine {
        /// Its name.
        name: String,
    },
    /// The run was interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// Cuts the pieces that were asked for.
///
/// Where pieces are named, each of them must be possible; where none is, those that are not are listed in the result, and
/// at least one must be possible.
pub fn mill(cut: &CutMesh, strips: &Strips, options: &Options, monitor: &Monitor) -> Result<Milling, MillError> {
    let wanted = wanted(cut, &options.pieces)?;
    let strict = !options.pieces.is_empty();
    let mut refused = Vec::new();
    let mut refuse = |piece: PieceId, reason: String| {
        let name = cut.pieces[piece].name.clone();
        if strict {
            return Err(MillError::Piece { name, reason });
        }
        refused.push([name, reason]);
        Ok(())
    };
    let mut good = Vec::new();
    let mut tight = Vec::new();
    for piece in wanted {
        match unfit(cut, strips, piece, options) {
            Some(it) if it.share > MOST_TIGHT => refuse(piece, it.reason)?,
            found => {
                good.push(piece);
                tight.extend(found.map(|it| [cut.pieces[piece].name.clone(), it.reason]));
            }
        }
    }
    let mesh = &cut.mesh;
    let body = samples(mesh, &|f| good.contains(&cut.piece_of[f]), options);
    let (points, on) = Samples::spread(mesh, |_| Some(spacing(options)));
    let samples = Samples::of_points(points, on);
    let guard = Guard {
        samples: &samples,
        spacing: spacing(options),
        tool: options.tool,
        withdrawn: match options.machine {
            Machine::Mill(_) => mesh.bounds().diagonal(),
            Machine::Wire(_) => 0.0,
        },
        allowed: options.gouge / 4.0,
        push: options.excess.min(0.25 * options.tool.radius.max(options.excess)),
    };
    let faces = |piece: PieceId| mesh.faces().filter(|&f| cut.piece_of[f] == piece).collect::<Vec<_>>();
    let skins: Vec<Skin<'_>> = good.iter().map(|&it| Skin::new(mesh, faces(it))).collect();
    let bands: Vec<(PieceId, Vec<Band<'_>>)> =
        good.iter().zip(&skins).map(|(&it, skin)| (it, Band::of_piece(strips, it, skin))).collect();
    let mut plan = plan::plan(cut, &bands, &guard, options, monitor)?;
    for (piece, reason) in &plan.unreached {
        refuse(*piece, reason.clone())?;
    }
    if plan.runs.is_empty() {
        let [name, reason] = refused.first().cloned().unwrap_or_else(|| ["-".into(), "there is nothing to cut".into()]);
        return Err(MillError::Piece { name, reason });
    }
    let (moves, swept) = program(cut, strips, &body, &guard, &mut plan, options, monitor)?;
    let pieces: Vec<PieceId> = good.into_iter().filter(|it| moves.iter().any(|made| made.piece == *it)).collect();
    let mut out = assemble(cut, &pieces, &body, &plan, &guard, (moves, swept), options, monitor)?;
    (out.refused, out.tight) = (refused, tight);
    Ok(out)
}

fn wanted(cut: &CutMesh, names: &[String]) -> Result<Vec<PieceId>, MillError> {
    let all = || (0..cut.pieces.len()).map(PieceId::new);
    if names.is_empty() {
        return Ok(all().collect());
    }
    let find = |name: &String| {
        let known = || cut.pieces.iter().map(|it| it.name.as_str()).collect::<Vec<_>>().join(", ");
        all()
            .find(|&it| cut.pieces[it].name == *name)
            .ok_or_else(|| MillError::Unknown { name: name.clone(), known: known() })
    };
    names.iter().map(find).collect()
}

/// The blocks of a plan and what their sweep finds. Where it shows that too much is left, lower levels are cut as well.
fn program(
    cut: &CutMesh,
    strips: &Strips,
    body: &Body,
    guard: &Guard<'_>,
    plan: &mut plan::Plan<'_>,
    options: &Options,
    monitor: &Monitor,
) -> Result<(Vec<MillMove>, Swept), MillError> {
    let points = &body.samples.points;
    let panels = Panels::new(strips);
    let mut proof = Proof::new(cut, body, plan, options);
    let mut runs = std::mem::take(&mut plan.runs);
    let mut moves = Vec::new();
    let mut round = 0;
    while !runs.is_empty() {
        path::extend(&mut moves, &runs, plan, (cut, guard), options, monitor)?;
        proof.advance(&moves, monitor)?;
        if round == ROUNDS {
            break;
        }
        round += 1;
        let swept = proof.swept();
        let is_high = |i: &usize| swept.passed[*i] && swept.highest[*i] > 0.9 * options.excess;
        let high = (0..points.len()).filter(is_high).map(|i| points[i]);
        runs = plan.finer(&panels.at(high), cut, guard, options, monitor)?;
    }
    Ok((moves, proof.swept()))
}

/// Rounds in which what the sweep finds too high is cut in lower levels.
const ROUNDS: usize = 3;

/// The panels of all strips, to be found by place.
struct Panels {
    tree: Option<(Bvh, Vec<usize>)>,
}

impl Panels {
    fn new(strips: &Strips) -> Self {
        Self { tree: strips.mesh().map(|(mesh, panels)| (Bvh::new(&mesh), panels)) }
    }

    /// Numbers of the panels next to places.
    fn at(&self, places: impl Iterator<Item = Vec3>) -> BTreeSet<usize> {
        let Some((tree, panels)) = &self.tree else { return BTreeSet::new() };
        places.map(|p| panels[tree.closest(p).face.index()]).collect()
    }
}

/// A piece is not cut when its cutter is too large for more than this share of it.
const MOST_TIGHT: f64 = 0.5;

/// Why a piece, or a share of it, cannot be cut along its rulings with this cutter.
fn unfit(cut: &CutMesh, strips: &Strips, piece: PieceId, options: &Options) -> Option<Tight> {
    let all = |reason: &str| Some(Tight { share: 1.0, reason: reason.into() });
    match strips.ruled[piece] {
        Ruled::Yes => tell::too_tight(cut, strips, piece, options.tool.widest(), options.excess),
        Ruled::Flat => {
            all("is flat, so it has no rulings to set the side of a cutter along; face it with the end of one")
        }
        Ruled::Unreliable => {
            all("has no reliable rulings; develop it further, or cut it smaller, before its side can be milled")
        }
        Ruled::Unsolved => all("has no rulings: they could not be found in its flat shape"),
    }
}

/// Samples of the body, and those in the middle of the faces of the painted mesh.
struct Body {
    samples: Samples,
    painted: TriMesh,
    /// The sample of each face of the painted mesh; none where nothing is to be cut.
    middles: Vec<Option<usize>>,
    /// Whether a sample weighs in the share that is covered, and how much.
    areas: Vec<f64>,
}

/// The spacing of samples keeps what they miss of a cylinder, d²/(8 r), to a quarter of the gouge allowed; not below this, mm.
const FINEST: f64 = 0.15;
/// Largest faces of the painted mesh, as a share of the diagonal.
const PAINT: f64 = 0.008;
const MOST_DIVISIONS: usize = 4;

fn spacing(options: &Options) -> f64 {
    (2.0 * options.tool.radius * options.gouge).sqrt().max(FINEST)
}

fn samples(mesh: &TriMesh, cut: &dyn Fn(FaceId) -> bool, options: &Options) -> Body {
    let spacing = spacing(options);
    let (mut points, mut faces) = Samples::spread(mesh, |_| Some(spacing));
    let part = |wanted: bool| {
        let chosen: Vec<FaceId> = mesh.faces().filter(|&f| cut(f) == wanted).collect();
        let mut local = vec![u32::MAX; mesh.vertex_count()];
        let (mut places, mut triangles) = (Vec::new(), Vec::new());
        for &f in &chosen {
            triangles.push(mesh.face_vertices(f).map(|v| {
                let slot = &mut local[v.index()];
                if *slot == u32::MAX {
                    *slot = places.len() as u32;
                    places.push(mesh.position(v));
                }
                *slot
            }));
        }
        (places, triangles, chosen)
    };
    let (mut places, mut triangles, mut origin) = part(true);
    if let Ok(mut fine) = TriMesh::new(places.clone(), &triangles) {
        let longest = |mesh: &TriMesh| mesh.edges().map(|e| mesh.edge_length(e)).fold(0.0, f64::max);
        for _ in 0..MOST_DIVISIONS {
            if longest(&fine) <= PAINT * mesh.bounds().diagonal() {
                break;
            }
            let Ok(finer) = subdivide(&fine) else { break };
            origin = (0..4 * origin.len()).map(|k| origin[k / 4]).collect();
            fine = finer;
        }
        (places, triangles) = (fine.positions().as_slice().to_vec(), fine.face_indices());
    }
    let mut middles = Vec::with_capacity(triangles.len());
    let mut areas = vec![0.0; points.len()];
    for (t, f) in triangles.iter().zip(&origin) {
        let [a, b, c] = t.map(|i| places[i as usize]);
        middles.push(Some(points.len()));
        points.push((a + b + c) / 3.0);
        faces.push(*f);
        areas.push((b - a).cross(&(c - a)).norm() / 2.0);
    }
    let first = places.len() as u32;
    let (rest, others, _) = part(false);
    places.extend(rest);
    middles.extend(others.iter().map(|_| None));
    triangles.extend(others.iter().map(|t| t.map(|i| i + first)));
    let painted = TriMesh::new(places, &triangles).expect("faces of a mesh, some divided, are a mesh");
    Body { samples: Samples::of_points(points, faces), painted, middles, areas }
}

/// Gouge, excess and coverage, face by face what a ball of the cutter's radius leaves; returns the area to be cut, mm².
fn measure(
    out: &mut Milling,
    cut: &CutMesh,
    body: &Body,
    guard: &Guard<'_>,
    swept: &Swept,
    mine: &Field<FaceId, bool>,
    monitor: &Monitor,
) -> Result<f64, Cancelled> {
    let (points, faces) = (&body.samples.points, &body.samples.faces);
    let limit = out.limits[1];
    let (mut total, mut covered, mut unfit) = (0.0, 0.0, 0.0);
    let mut closing = vec![0.0; points.len()];
    for (i, p) in points.iter().enumerate() {
        out.gouge.meet(-swept.lowest[i], *p);
        if !mine[faces[i]] {
            continue;
        }
        total += body.areas[i];
        if !swept.passed[i] {
            continue;
        }
        covered += body.areas[i];
        if swept.highest[i] > limit {
            monitor.check()?;
            closing[i] = guard.closing(*p, cut.mesh.normal(faces[i]));
            if closing[i] > limit / 2.0 {
                out.unfit.meet(closing[i], *p);
                unfit += body.areas[i];
            }
        }
        out.excess.meet(swept.highest[i] - closing[i], *p);
    }
    for (slot, i) in out.closing.iter_mut().zip(&body.middles) {
        *slot = i.map_or(0.0, |i| closing[i]);
    }
    let total = f64::max(total, f64::MIN_POSITIVE);
    (out.covered, out.unfit_share) = (covered / total, unfit / total);
    Ok(total)
}

/// Parts of strips below this share of the area that is to be cut are not told of.
const LEAST_LEFT: f64 = 1e-4;

/// Puts the result together, but for what was refused.
#[allow(clippy::too_many_arguments, reason = "everything that the result tells of")]
fn assemble(
    cut: &CutMesh,
    pieces: &[PieceId],
    body: &Body,
    plan: &plan::Plan<'_>,
    guard: &Guard<'_>,
    (moves, swept): (Vec<MillMove>, Swept),
    options: &Options,
    monitor: &Monitor,
) -> Result<Milling, Cancelled> {
    let mesh = &cut.mesh;
    let mine = Field::<FaceId, bool>::from_fn(mesh.face_count(), |f| pieces.contains(&cut.piece_of[f]));
    let samples = &body.samples;
    let mut out = Milling {
        axes: options.machine.letters(),
        setup: plan.setup,
        tool: options.tool,
        span: options.machine.span(),
        spindle: options.spindle,
        segments: moves.iter().map(|it| it.segment + 1).max().unwrap_or(0) as usize,
        moves,
        pieces: pieces.iter().map(|&it| cut.pieces[it].name.clone()).collect(),
        refused: vec![],
        tight: vec![],
        left: vec![],
        painted: Box::new(body.painted.clone()),
        deviation: body.middles.iter().map(|it| it.filter(|&i| swept.passed[i]).map(|i| swept.shown(i))).collect(),
        closing: vec![0.0; body.middles.len()],
        covered: 0.0,
        gouge: Deepest::default(),
        excess: Deepest::default(),
        unfit: Deepest::default(),
        unfit_share: 0.0,
        collision: swept.collision,
        limits: [options.gouge, options.excess],
    };
    let total = measure(&mut out, cut, body, guard, &swept, &mine, monitor)?;
    // What bars the way round of one strip may be cut from another: no more is left of a piece than nothing passed.
    let uncut = |piece: PieceId| -> f64 {
        let all = (0..samples.points.len()).filter(|&i| cut.piece_of[samples.faces[i]] == piece && !swept.passed[i]);
        all.map(|i| body.areas[i]).sum()
    };
    for it in &plan.left {
        let area = it.area.min(uncut(it.piece));
        if area > LEAST_LEFT * total {
            let (piece, strip, reason) = (cut.pieces[it.piece].name.clone(), it.strip, it.reason.clone());
            out.left.push(StripLeft { piece, strip, area, reason });
        }
    }
    out.left.sort_by(|a, b| b.area.total_cmp(&a.area));
    Ok(out)
}

/// The block that the body stands on, in work coordinates.
fn fixture(options: &Options) -> Box3 {
    let half = Vec3::new(options.fixture.x / 2.0, options.fixture.y / 2.0, 0.0);
    let top = Vec3::new(0.0, 0.0, options.fixture.z);
    Box3 { min: options.table - half, max: options.table + half + top }
}

/// The body on its block, turned so that `up` is up: its other axes are those of the body that are nearest to them.
fn standing(bounds_of: &TriMesh, up: Vec3, options: &Options) -> Setup {
    let side = if up.x.abs() < 0.9 { Vec3::x() } else { Vec3::y() };
    let x = (side - up * up.dot(&side)).normalize();
    let rows = [x, up.cross(&x), up];
    placed(bounds_of, rows, options)
}

/// The body turned, with the middle of its foot on the middle of the block.
fn placed(mesh: &TriMesh, rows: [Vec3; 3], options: &Options) -> Setup {
    let turn = Setup { rows, shift: Vec3::zeros() };
    let turned: Vec<Vec3> = mesh.positions().iter().map(|&p| turn.turn(p)).collect();
    let bounds = Box3::of(&turned);
    let foot = Vec3::new((bounds.min.x + bounds.max.x) / 2.0, (bounds.min.y + bounds.max.y) / 2.0, bounds.min.z);
    let top = options.table + Vec3::new(0.0, 0.0, options.fixture.z);
    Setup { rows, shift: top - foot }
}
