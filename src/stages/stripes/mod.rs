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

use std::f64::consts::TAU;

use isolines::{Crossings, Isoline, Levels};

use crate::{
    geom::{Complex, Vec3},
    mesh::{Bvh, FaceId, Field, Id, MeshError, TriMesh, VertexId},
    model::{StripeEnd, StripeLine, Stripes},
    numeric::{Cancelled, Monitor},
    surface::{
        direction_field::{
            DirectionField, FieldError, Guide, TrivialError, Turns, boundary_guides, guided, principal,
            principal_guides, smoothest, trivial,
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
#[derive(Debug, Clone, Copy, PartialEq)]
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
    /// Whether pairs are added at tips and saddles until no line parts the surface: one strip.
    pub join: bool,
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
    let edge = mesh.mean_edge_length();
    let least = edge / LINES_PER_EDGE;
    if !(options.spacing >= least) {
        return Err(StripesError::Resolution { spacing: options.spacing, edge, least, most: 1.0 / least });
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
    let plain = it.energy();
    search::spend(&mut it, options.budget, options.least_gain, monitor)?;
    if options.join {
        monitor.progress(0.7, "joining lines");
        search::join(mesh, &mut it, LINES, monitor)?;
    }
    let edit = monitor.seconds();
    it.set_field(it.omega().clone());
    let edit = monitor.seconds() - edit;
    monitor.check()?;
    let crossings = Crossings::new(mesh, &it.alpha, &it.n, LINES);
    let lines = crossings.lines(mesh);
    let mut out = measured(mesh, &it, &lines, options.spacing);
    out.field_singularities = field.turns(mesh, &tangent).faces.len();
    out.energy = [plain, it.energy()];
    out.seconds = [factored - start, edit];
    Ok(Laid { stripes: out, crossings, mesh: None })
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
        lines: lines.iter().map(|it| stripe_line(mesh, it, &|f| found.origin[f])).collect(),
        drawn: true,
        faces: mesh.face_count(),
        components: mesh.components().1,
        prescribed: faces.iter().map(|&(f, index)| at(f, index)).collect(),
        found: singular.map(|(f, index)| at(found.origin[f], index)).collect(),
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

/// A line as it leaves the stage; `face` finds the face of the given mesh.
fn stripe_line(mesh: &TriMesh, line: &Isoline, face: &dyn Fn(FaceId) -> FaceId) -> StripeLine {
    StripeLine {
        points: line.points.iter().map(|it| it.place).collect(),
        closed: line.closed,
        inner_ends: line.inner_ends,
        pieces: line.pieces().map(|(f, ends)| (face(f), ends.map(|p| barycentric(mesh, face(f), p)))).collect(),
    }
}

fn node(spot: Spot, bvh: &Bvh) -> Node {
    match spot {
        Spot::Face(face) => Node::Face(FaceId::new(face)),
        Spot::Near(place) => Node::Face(bvh.closest(place).face),
        Spot::Loop(path) => Node::Loop(path),
    }
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
            let face = bvh.closest(place).face;
            let near = |v: &VertexId| (mesh.position(*v) - place).norm();
            let vertex = mesh.face_vertices(face).into_iter().min_by(|a, b| near(a).total_cmp(&near(b)))?;
            Some(Guide { vertex, direction: tangent.from_space(mesh, vertex, direction)?, strength: STRENGTH })
        })
        .collect();
    let symmetry = options.symmetry;
    let field = match options.along {
        Along::Smoothest if guides.is_empty() => smoothest(mesh, tangent, symmetry)?,
        Along::Smoothest | Along::Guides => guided(mesh, tangent, symmetry, &guides)?,
        Along::Axis(axis) => {
            let here = |v| tangent.from_space(mesh, v, axis).unwrap_or(Complex::new(0.0, 0.0));
            let field = DirectionField::from_vectors(symmetry, &Field::from_fn(mesh.vertex_count(), here));
            if field.power.iter().all(|it| it.norm_sqr() == 0.0) {
                return Err(FieldError::Zero("the axis is at right angles to the surface").into());
            }
            field
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
            let mut lines = principal_guides(&curvature, least, strength);
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
fn measured(mesh: &TriMesh, it: &Parameterization, lines: &[Isoline], spacing: f64) -> Stripes {
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
        lines: lines.iter().map(|it| stripe_line(mesh, it, &|f| f)).collect(),
        drawn: true,
        faces: mesh.face_count(),
        components: tree.roots.len(),
        prescribed: ends(&|f| it.nodes()[f]),
        found: ends(&|f| (sums[f] / TAU).round() as i32),
        windings: [loops, it.generators().to_vec()],
        period_error: sums.iter().copied().chain(periods).map(off).fold(0.0, f64::max),
        spacing: spread(mesh, &|f| mesh.face_halfedges(f).map(along), spacing),
        ..Stripes::default()
    }
}

/// Barycentric coordinates of a point of a face.
fn barycentric(mesh: &TriMesh, f: FaceId, p: Vec3) -> [f64; 3] {
    let [a, b, c] = mesh.face_positions(f);
    let normal = (b - a).cross(&(c - a));
    let share = |x: Vec3, y: Vec3| normal.dot(&(x - p).cross(&(y - p))) / normal.norm_squared();
    [share(b, c), share(c, a), share(a, b)]
}

/// Local distance 2π / |∇α| of the lines over faces that are not singular: least, largest, mean and standard deviation by area.
/// Where α hardly changes, at its tips, no line runs: faces that do not reach from one line to the next in ten spacings
/// do not count.
fn spread(mesh: &TriMesh, rises: &dyn Fn(FaceId) -> [f64; 3], spacing: f64) -> [f64; 4] {
    let mut out = [f64::INFINITY, 0.0, 0.0, 0.0];
    let mut area = 0.0;
    for f in mesh.faces() {
        let rise = rises(f);
        if rise.iter().sum::<f64>().abs() > 1.0 {
            continue;
        }
        let [h, _, last] = mesh.face_halfedges(f);
        // ∇α in the basis of two sides p, q with rises a, b.
        let (p, q, a, b) = (mesh.vector(h), -mesh.vector(last), rise[0], -rise[2]);
        let (pp, pq, qq) = (p.norm_squared(), p.dot(&q), q.norm_squared());
        let squared = (a * a * qq - 2.0 * a * b * pq + b * b * pp) / (pp * qq - pq * pq);
        let distance = TAU / squared.sqrt();
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

/// The mesh with its lines as edges, and these as pairs of its vertices.
pub fn cut_along(mesh: &TriMesh, crossings: &Crossings) -> Result<(TriMesh, Vec<[u32; 2]>), StripesError> {
    let split = split::split(mesh, crossings, MARGIN)?;
    Ok((split.mesh, split.lines))
}

#[cfg(test)]
mod tests;
