//! Stripes: lines at a constant spacing along a direction field, that start and end only where they are asked to (seed 001,
//! Noma and Kawahara), to cut a surface into strips, to draw on it, or to guide a tool.
//!
//! The field makes a 1-form of 2π / spacing, [`crate::surface::field_aligned`] the scalar field α along it with prescribed
//! singularities, and the lines are its isolines α ≡ 0 (mod 2π).
pub mod isolines;
pub mod lines;
pub mod search;
pub mod split;
pub mod stage;
mod starts;
pub mod zip;

use std::f64::consts::TAU;

use isolines::{Crossings, Isoline, Levels};

use crate::{
    geom::{Complex, Vec3},
    mesh::{Bvh, EdgeId, FaceId, Field, Id, MeshError, TriMesh, VertexId},
    model::{StripeEnd, Stripes},
    numeric::{Cancelled, Monitor},
    surface::{
        direction_field::{
            DirectionField, FieldError, Guide, TrivialError, Turns, away_from, boundary_guides, guided, principal,
            principal_guides, smoothest, tips, trivial,
        },
        field_aligned::{AlignError, Indices, Parameterization, Parameterizer},
        tangent::{TangentSpaces, one_form},
        tree_cotree::{IndexError, Node},
    },
};

/// Lines per mean edge that a mesh carries: beyond it the lines follow single faces.
const LINES_PER_EDGE: f64 = 4.0;
/// Share of an edge that lines keep from its ends where they cut it.
const MARGIN: f64 = 0.03;
/// How much guides count against smoothness.
const STRENGTH: f64 = 100.0;

/// Which way α rises. The lines run across it.
#[derive(Debug, Clone, PartialEq)]
pub enum Along {
    /// The smoothest field there is.
    Smoothest,
    /// The direction of largest or least normal curvature.
    Curvature {
        /// Whether the least is meant.
        least: bool,
        /// How much it counts against smoothness.
        strength: f64,
    },
    /// A direction in space, projected on the surface: the lines are rings about it.
    Axis(Vec3),
    /// Away from points, mm, as far as the surface goes: the lines are rings about every limb. On a component without one, away
    /// from one of its tips.
    Distance(Vec<Vec3>),
    /// Along the boundary, the surface on the left; smooth inside.
    Boundary,
    /// The guides alone.
    Guides,
}

/// Where an index belongs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Spot {
    /// A face of the mesh.
    Face(usize),
    /// The face nearest to a point, mm.
    Near(Vec3),
    /// A boundary loop.
    Loop(usize),
}

/// What to make.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// 1 for a vector field, 2 for a line field, which may turn by half a turn around a point.
    pub symmetry: i32,
    /// The field.
    pub along: Along,
    /// Whether the Laplacian is that of the intrinsic Delaunay triangulation, for meshes with slivers.
    pub delaunay: bool,
    /// Angle by which the field is turned, radians.
    pub turn: f64,
    /// Points with a direction that the field should have there.
    pub guides: Vec<(Vec3, Vec3)>,
    /// Singularities of the field itself (turns); empty: where they fall. Loops not named have 0.
    pub field_singularities: Vec<(Spot, i32)>,
    /// Distance of the lines, mm.
    pub spacing: f64,
    /// Where lines begin (index > 0) and end.
    pub singularities: Vec<(Spot, i32)>,
    /// Windings around generators.
    pub generators: Vec<(usize, i32)>,
    /// How many pairs may be added where they make the spacing more even.
    pub budget: usize,
    /// Share of the misfit that a pair of the budget must save.
    pub least_gain: f64,
    /// Whether singularities are added until no line parts the surface: one strip.
    pub join: bool,
    /// How often α is fitted again to the direction in which it rises, at the same steepness everywhere: the distance of the lines
    /// evens out, at the price of the direction.
    pub even: usize,
    /// Points near which lines start: an open one at its nearer end, a closed one at its nearest point.
    pub starts: Vec<Vec3>,
}

/// Why there are no stripes.
#[derive(Debug, thiserror::Error)]
pub enum StripesError {
    /// Interrupted.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
    /// The field.
    #[error(transparent)]
    Field(#[from] FieldError),
    /// Singularities of the field.
    #[error(transparent)]
    Trivial(#[from] TrivialError),
    /// The parameterisation.
    #[error(transparent)]
    Align(#[from] AlignError),
    /// What is not known for line fields.
    #[error("{0} needs a vector field: set symmetry = 1")]
    VectorsOnly(&'static str),
    /// A spacing that is none.
    #[error("lines cannot be {0} mm apart: the spacing must be a positive number")]
    Spacing(f64),
    /// The spacing.
    #[error(
        "lines {spacing} mm apart are closer than the mesh carries: its edges are {edge:.3} mm long on average, which is good for lines {least:.3} mm apart ({most:.4} per mm); take a wider spacing or a finer mesh"
    )]
    Resolution {
        /// What was asked, mm.
        spacing: f64,
        /// Mean edge, mm.
        edge: f64,
        /// The closest lines that are possible, mm.
        least: f64,
        /// The same as a frequency, 1 / mm.
        most: f64,
    },
    /// Lines without number.
    #[error(
        "the lines wind {0:.0} times as densely as the spacing asks for: triangles of the mesh are so obtuse that the least energy has no bound; set intrinsic_delaunay = true, or remesh the surface (coarsen with method = \"isotropic\")"
    )]
    Dense(f64),
    /// The mesh with the lines in it is not a mesh.
    #[error("the mesh cannot be cut along the lines: {0}; remesh the surface (coarsen with method = \"isotropic\")")]
    Split(#[from] MeshError),
}

impl From<search::SearchError> for StripesError {
    fn from(error: search::SearchError) -> Self {
        match error {
            search::SearchError::Cancelled(it) => it.into(),
            search::SearchError::Align(it) => it.into(),
        }
    }
}

/// The lines of all turns.
const LINES: Levels = Levels { per_turn: 1, offset: 0.0 };

/// Stripes, with what is needed to cut along them.
#[derive(Debug, Clone, PartialEq)]
pub struct Laid {
    /// The stripes.
    pub stripes: Stripes,
    /// Their crossings.
    pub crossings: Crossings,
    /// The mesh of the crossings where it is not the given one: that with the branch points of a line field as vertices.
    pub mesh: Option<TriMesh>,
}

/// Lays stripes on a mesh.
pub fn stripes(mesh: &TriMesh, options: &Options, monitor: &Monitor) -> Result<Laid, StripesError> {
    let (spacing, edge) = (options.spacing, mesh.mean_edge_length());
    if !(spacing > 0.0 && spacing.is_finite()) {
        return Err(StripesError::Spacing(spacing));
    }
    let least = edge / LINES_PER_EDGE;
    if spacing < least {
        return Err(StripesError::Resolution { spacing, edge, least, most: 1.0 / least });
    }
    monitor.progress(0.0, "direction field");
    let start = monitor.seconds();
    let solver = if options.delaunay { Parameterizer::with_intrinsic_delaunay } else { Parameterizer::new }(mesh)?;
    let factored = monitor.seconds();
    let tangent = TangentSpaces::new(mesh);
    let field = field(mesh, &tangent, &solver, options)?;
    monitor.check()?;
    if options.symmetry == 2 {
        return along_lines(mesh, &tangent, &field, options);
    }
    let frequency = TAU / options.spacing;
    let gradient = Field::from_vec(field.vectors().iter().map(|it| it * frequency).collect::<Vec<Complex>>());
    let omega = one_form(mesh, &tangent, &gradient);
    let bvh = Bvh::new(mesh);
    let indices = Indices {
        nodes: options.singularities.iter().map(|&(spot, index)| (node(spot, &bvh), index)).collect(),
        generators: options.generators.clone(),
    };
    monitor.progress(0.5, "parameterisation");
    let mut it = solver.solve(mesh, omega, &indices)?;
    let settle = |it: &mut Parameterization<'_>| {
        for _ in 0..options.even {
            it.set_field(evened(mesh, it, frequency));
        }
    };
    settle(&mut it);
    let plain = it.energy();
    search::spend(&mut it, options.budget, options.least_gain, monitor)?;
    let mut levels = LINES;
    if options.join {
        monitor.progress(0.7, "joining lines");
        (it, levels) = joined(mesh, it, &settle, monitor)?;
    }
    let edit = monitor.seconds();
    it.set_field(it.omega().clone());
    let edit = monitor.seconds() - edit;
    monitor.check()?;
    let turns = it.differences(mesh).iter().map(|x| x.abs() / TAU).sum::<f64>();
    let (times, dense) = search::density(mesh, &it);
    if dense && turns > LINES_PER_EDGE * mesh.edge_count() as f64 {
        return Err(StripesError::Dense(times));
    }
    let crossings = Crossings::new(mesh, &it.alpha, &it.n, levels);
    let lines = crossings.lines(mesh);
    let mut out = measured(mesh, &it, &lines, options);
    out.web = zip::web(&crossings, &zip::rims(mesh));
    out.field_singularities = field.turns(mesh, &tangent).faces.len();
    out.energy = [plain, it.energy()];
    out.seconds = [factored - start, edit];
    Ok(Laid { stripes: out, crossings, mesh: None })
}

/// Adds singularities until no line parts the surface: at the tips of all limbs so that the lines are one path, or pair by pair.
fn joined<'a>(
    mesh: &TriMesh,
    mut it: Parameterization<'a>,
    settle: &dyn Fn(&mut Parameterization<'a>),
    monitor: &Monitor,
) -> Result<(Parameterization<'a>, Levels), StripesError> {
    let plain = it.nodes()[..mesh.face_count()].iter().all(|&k| k == 0);
    if plain && it.generators().is_empty() && it.solver().tree.roots.len() == 1 {
        let zipped = zip::zip(mesh, &it, MARGIN, settle, monitor)?;
        if let Some(found) = zipped.filter(|it| it.web.cycles == 0) {
            return Ok((found.it, found.levels));
        }
    }
    search::join(mesh, &mut it, LINES, monitor)?;
    Ok((it, LINES))
}

/// The 1-form of the direction in which α rises, `frequency` everywhere (radians per mm); as before at singular faces. One step of
/// the local and global solves of ∫ (|∇α| − frequency)².
fn evened(mesh: &TriMesh, it: &Parameterization<'_>, frequency: f64) -> Field<EdgeId, f64> {
    let u = it.differences(mesh);
    let slope = |f: FaceId| {
        let along = mesh.face_halfedges(f).map(|h| {
            let e = mesh.edge(h);
            if mesh.halfedge(e) == h { u[e] } else { -u[e] }
        });
        gradient(mesh, f, along).and_then(|it| it.try_normalize(0.0))
    };
    let slopes: Field<FaceId, Option<Vec3>> = Field::from_fn(mesh.face_count(), slope);
    Field::from_fn(mesh.edge_count(), |e| {
        let h = mesh.halfedge(e);
        let both = [Some(h), mesh.twin(h)].into_iter().flatten();
        let known: Vec<Vec3> = both.filter_map(|h| slopes[mesh.face(h)]).collect();
        let sum: Vec3 = known.iter().sum();
        if known.is_empty() { it.omega()[e] } else { frequency * sum.dot(&mesh.vector(h)) / known.len() as f64 }
    })
}

/// Gradient of a function that rises so along the sides of a face; `None` in a singular one.
fn gradient(mesh: &TriMesh, f: FaceId, rises: [f64; 3]) -> Option<Vec3> {
    let [a, b, c] = mesh.face_positions(f);
    let (p, q) = (b - a, c - a);
    let normal = p.cross(&q);
    let regular = rises.iter().sum::<f64>().abs() < 1.0;
    regular.then(|| (q.cross(&normal) * rises[0] - normal.cross(&p) * rises[2]) / normal.norm_squared())
}

/// Stripes across a line field.
fn along_lines(
    mesh: &TriMesh,
    tangent: &TangentSpaces,
    field: &DirectionField,
    options: &Options,
) -> Result<Laid, StripesError> {
    let given = [
        (options.join, "one strip"),
        (options.budget > 0, "a budget"),
        (options.even > 0, "evenness"),
        (!options.generators.is_empty(), "an index of a generator"),
    ];
    if let Some(it) = given.iter().find(|it| it.0) {
        return Err(StripesError::VectorsOnly(it.1));
    }
    let bvh = Bvh::new(mesh);
    let mut faces = Vec::new();
    for &(spot, index) in &options.singularities {
        match node(spot, &bvh) {
            Node::Face(f) if f.index() < mesh.face_count() => faces.push((f, index)),
            Node::Loop(_) => return Err(StripesError::VectorsOnly("an index of a boundary")),
            node => return Err(AlignError::from(IndexError::NoSuchNode { node, count: mesh.face_count() }).into()),
        }
    }
    let found = lines::lines(mesh, tangent, field, options.spacing, &faces)?;
    let index = |f: FaceId| (found.rises[f].iter().sum::<f64>() / TAU).round() as i32;
    let at = |f: FaceId, index: i32| StripeEnd { face: f, place: centre(mesh, f), index };
    let singular = found.mesh.faces().map(|f| (f, index(f))).filter(|it| it.1 != 0);
    let lines = found.crossings.lines(&found.mesh);
    let stripes = Stripes {
        lines: starts::stripe_lines(mesh, &lines, &|f| found.origin[f], &options.starts),
        drawn: true,
        faces: mesh.face_count(),
        components: mesh.components().1,
        prescribed: faces.iter().map(|&(f, index)| at(f, index)).collect(),
        found: singular.map(|(f, index)| at(found.origin[f], index)).collect(),
        web: zip::web(&found.crossings, &zip::rims(&found.mesh)),
        field_singularities: found.branches,
        period_error: found.period_error,
        energy: [found.energy; 2],
        spacing: spread(&found.mesh, &|f| found.rises[f], options.spacing),
        ..Stripes::default()
    };
    Ok(Laid { stripes, crossings: found.crossings, mesh: Some(found.mesh) })
}

fn centre(mesh: &TriMesh, f: FaceId) -> Vec3 {
    mesh.face_positions(f).iter().sum::<Vec3>() / 3.0
}

fn node(spot: Spot, bvh: &Bvh) -> Node {
    match spot {
        Spot::Face(face) => Node::Face(FaceId::new(face)),
        Spot::Near(place) => Node::Face(bvh.closest(place).face),
        Spot::Loop(path) => Node::Loop(path),
    }
}

fn nearest_vertex(mesh: &TriMesh, bvh: &Bvh, place: Vec3) -> VertexId {
    let near = |v: VertexId| (mesh.position(v) - place).norm();
    let [a, b, c] = mesh.face_vertices(bvh.closest(place).face);
    [b, c].into_iter().fold(a, |best, v| if near(v) < near(best) { v } else { best })
}

/// The field that is asked for.
fn field(
    mesh: &TriMesh,
    tangent: &TangentSpaces,
    solver: &Parameterizer,
    options: &Options,
) -> Result<DirectionField, StripesError> {
    let bvh = Bvh::new(mesh);
    if !options.field_singularities.is_empty() {
        return Ok(prescribed(mesh, tangent, solver, &bvh, options)?.turned(options.turn));
    }
    let mut guides: Vec<Guide> = options
        .guides
        .iter()
        .filter_map(|&(place, direction)| {
            let vertex = nearest_vertex(mesh, &bvh, place);
            Some(Guide { vertex, direction: tangent.from_space(mesh, vertex, direction)?, strength: STRENGTH })
        })
        .collect();
    let symmetry = options.symmetry;
    let field = match &options.along {
        Along::Smoothest if guides.is_empty() => smoothest(mesh, tangent, symmetry)?,
        Along::Smoothest | Along::Guides => guided(mesh, tangent, symmetry, &guides)?,
        Along::Axis(axis) => {
            let here = |v| tangent.from_space(mesh, v, *axis).unwrap_or(Complex::new(0.0, 0.0));
            let field = DirectionField::from_vectors(symmetry, &Field::from_fn(mesh.vertex_count(), here));
            if field.power.iter().all(|it| it.norm_sqr() == 0.0) {
                return Err(FieldError::Zero("the axis is at right angles to the surface").into());
            }
            field
        }
        Along::Distance(from) => {
            let mut sources: Vec<VertexId> = from.iter().map(|&p| nearest_vertex(mesh, &bvh, p)).collect();
            let component = mesh.components().0;
            let of = |v: VertexId| mesh.outgoing(v).next().map(|h| component[mesh.face(h)]);
            let named: Vec<Option<u32>> = sources.iter().map(|&v| of(v)).collect();
            sources.extend(tips(mesh).into_iter().filter(|&v| !named.contains(&of(v))));
            let field = away_from(mesh, tangent, &sources, options.spacing.max(mesh.mean_edge_length()))?;
            // As a line field it has no more than its direction.
            DirectionField::from_vectors(symmetry, &field.vectors())
        }
        Along::Boundary => {
            guides.extend(boundary_guides(mesh, tangent, 0.0, STRENGTH));
            if guides.is_empty() {
                return Err(FieldError::Zero("the surface has no boundary to run along").into());
            }
            guided(mesh, tangent, symmetry, &guides)?
        }
        Along::Curvature { least, strength } => {
            let curvature = principal(mesh, tangent);
            let mut lines = principal_guides(&curvature, *least, *strength);
            lines.extend(guides);
            let field = guided(mesh, tangent, 2, &lines)?;
            // Lines have no sign: a vector field takes the nearer one.
            if symmetry == 1 { oriented(mesh, tangent, &field) } else { field }
        }
    };
    Ok(field.turned(options.turn))
}

/// The field with the singularities that were listed.
fn prescribed(
    mesh: &TriMesh,
    tangent: &TangentSpaces,
    solver: &Parameterizer,
    bvh: &Bvh,
    options: &Options,
) -> Result<DirectionField, StripesError> {
    let mut turns = Turns { faces: Vec::new(), loops: vec![0; solver.tree.loops.len()] };
    for &(spot, index) in &options.field_singularities {
        let node = node(spot, bvh);
        solver.tree.index(node).map_err(TrivialError::from)?;
        match node {
            Node::Face(f) => turns.faces.push((f, index)),
            Node::Loop(k) => turns.loops[k] += index,
        }
    }
    let (field, _) = trivial(mesh, tangent, options.symmetry, &turns, solver)?;
    // The first guide says how the whole is turned.
    let Some(&(place, direction)) = options.guides.first() else { return Ok(field) };
    let v = mesh.face_vertices(bvh.closest(place).face)[0];
    let wish = tangent
        .from_space(mesh, v, direction)
        .ok_or(FieldError::Zero("the guide is at right angles to the surface"))?;
    let turn = (wish.powi(options.symmetry) * field.power[v].conj()).arg();
    Ok(field.turned(turn / f64::from(options.symmetry)))
}

/// A line field as a vector field: signs that agree along a tree from the surest vertex on. Across seams, which end in the
/// branch points, they do not.
fn oriented(mesh: &TriMesh, tangent: &TangentSpaces, lines: &DirectionField) -> DirectionField {
    let mut vectors = lines.vectors();
    let mut seen = Field::<VertexId, bool>::filled(mesh.vertex_count(), false);
    for seed in mesh.vertices() {
        if seen[seed] {
            continue;
        }
        seen[seed] = true;
        let mut queue = std::collections::VecDeque::from([seed]);
        while let Some(v) = queue.pop_front() {
            for h in mesh.outgoing(v) {
                let w = mesh.head(h);
                if !seen[w] {
                    seen[w] = true;
                    let carried = vectors[v] * tangent.transport(h);
                    if (carried * vectors[w].conj()).re < 0.0 {
                        vectors[w] = -vectors[w];
                    }
                    queue.push_back(w);
                }
            }
        }
    }
    DirectionField::from_vectors(1, &vectors)
}

/// What the report says of a parameterisation and its lines.
fn measured(mesh: &TriMesh, it: &Parameterization, lines: &[Isoline], options: &Options) -> Stripes {
    let tree = &it.solver().tree;
    let u = it.differences(mesh);
    let sums = tree.sums(&u);
    let at = |f: FaceId, index: i32| StripeEnd { face: f, place: centre(mesh, f), index };
    let ends = |index: &dyn Fn(usize) -> i32| {
        let all = mesh.faces().map(|f| (f, index(f.index()))).filter(|it| it.1 != 0);
        all.map(|(f, index)| at(f, index)).collect::<Vec<_>>()
    };
    let along = |h| {
        let e = mesh.edge(h);
        if mesh.halfedge(e) == h { u[e] } else { -u[e] }
    };
    let off = |sum: f64| (sum - TAU * (sum / TAU).round()).abs();
    let around = |g: usize| tree.generator_loop(mesh, g).iter().map(|&(e, sign)| sign * u[e]).sum::<f64>();
    let periods = (0..tree.generators.len()).map(around);
    let loops = it.nodes()[mesh.face_count()..].to_vec();
    Stripes {
        lines: starts::stripe_lines(mesh, lines, &|f| f, &options.starts),
        drawn: true,
        faces: mesh.face_count(),
        components: tree.roots.len(),
        prescribed: ends(&|f| it.nodes()[f]),
        found: ends(&|f| (sums[f] / TAU).round() as i32),
        windings: [loops, it.generators().to_vec()],
        period_error: sums.iter().copied().chain(periods).map(off).fold(0.0, f64::max),
        spacing: spread(mesh, &|f| mesh.face_halfedges(f).map(along), options.spacing),
        ..Stripes::default()
    }
}

/// Local distance 2π / |∇α| of the lines over faces that are not singular: least, largest, mean and standard deviation by area.
/// Where α hardly changes, at its tips, no line runs: faces that do not reach from one line to the next in ten spacings
/// do not count.
fn spread(mesh: &TriMesh, rises: &dyn Fn(FaceId) -> [f64; 3], spacing: f64) -> [f64; 4] {
    let mut out = [f64::INFINITY, 0.0, 0.0, 0.0];
    let mut area = 0.0;
    for f in mesh.faces() {
        let Some(slope) = gradient(mesh, f, rises(f)) else { continue };
        let distance = TAU / slope.norm();
        if !(distance < 10.0 * spacing) {
            continue;
        }
        let weight = mesh.area(f);
        area += weight;
        out[0] = out[0].min(distance);
        out[1] = out[1].max(distance);
        out[2] += weight * distance;
        out[3] += weight * distance * distance;
    }
    if area == 0.0 {
        return [0.0; 4];
    }
    out[2] /= area;
    out[3] = (out[3] / area - out[2] * out[2]).max(0.0).sqrt();
    out
}

/// The mesh with its lines as edges, these as pairs of its vertices, and into how many parts they divide it.
pub fn cut_along(mesh: &TriMesh, crossings: &Crossings) -> Result<(TriMesh, Vec<[u32; 2]>, usize), StripesError> {
    let split = split::split(mesh, crossings, MARGIN)?;
    let parts = split.parts(&split.edges()).len();
    Ok((split.mesh, split.lines, parts))
}

#[cfg(test)]
mod tests;
