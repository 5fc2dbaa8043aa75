//! The search for cuts: what is cut so far, the pieces that makes, and how they get better.
use super::{
    Cost, CutError, Options, Region, divide::dividing_path, join::Failures, piece::Piece, relieve::relieving_cuts, rim,
    segment::patches,
};
use crate::{
    mesh::{EdgeId, FaceId, Field, TriMesh, VertexId, operators::angle_defects},
    numeric::Monitor,
    surface::{
        chart::{ChartBuilder, Metric},
        cut_graph::cut_to_disks,
        flatten::Limit,
    },
};

/// An edge whose faces meet at this angle counts as a full crease, radians.
const CREASE_ANGLE: f64 = 0.5;
/// An edge whose ends have this |angle defect| together counts as a full crease, radians.
const CREASE_DEFECT: f64 = 0.2;
/// Vertices that |u| of so many times the limit could not spare lie on the first cut.
const CERTAIN: f64 = 3.0;
/// How a solution is begun.
#[derive(Clone, Copy)]
enum Attempt {
    /// Seams join what must be cut; creases attract them so much.
    Joined(f64),
    /// Patches between creases first, as many as the best solution has pieces.
    Patches,
}
/// How much creases attract seams in the first solution.
const ATTRACTION: f64 = 0.7;
/// The other solutions tried, the most promising first: which one suits a surface shows only in the end.
const ATTEMPTS: [Attempt; 4] = [Attempt::Patches, Attempt::Joined(2.0), Attempt::Joined(5.0), Attempt::Joined(0.2)];
/// A seam on a preferred side counts for so much of its length, …
const PREFERRED: f64 = 0.3;
/// … on an avoided one for so much.
const AVOIDED: f64 = 3.0;
/// Faces judged in all after which nothing new is tried, one to two seconds of work. The first solution is always finished.
const EFFORT: usize = 700_000;
/// Faces judged after which no other attempt begins: once a surface is so large that one costs more, improving it gets
/// further than beginning anew.
const ATTEMPTS_EFFORT: usize = 200_000;
/// Improving ends when it has judged so many times the faces of the mesh: a small one is done sooner.
const IMPROVEMENT: usize = 60;
/// Peaks relieved at a time in the first solution, and one more for every thousand vertices.
const PEAKS: usize = 8;
/// What one more piece counts for where a path is chosen that divides one, as a length of seam over the diagonal,
/// whatever it costs in the end: many are glued again, and longer paths that part more pairs at once are not.
const DIVIDED: f64 = 0.01;
/// A piece under the useful size costs as much as so many more pieces.
const SMALL_PIECE: f64 = 4.0;

/// State of the search.
#[derive(Clone)]
pub(super) struct Search<'a> {
    pub(super) mesh: &'a TriMesh,
    pub(super) metric: Metric,
    pub(super) curvature: Field<VertexId, f64>,
    pub(super) weight: Field<EdgeId, f64>,
    /// What a seam along each edge counts for: its length, less on a preferred side, more on an avoided one, mm.
    pub(super) toll: Field<EdgeId, f64>,
    /// Peaks of stretch that are relieved at a time.
    pub(super) peaks: usize,
    /// What one more piece is worth, as a length of seam, mm.
    pub(super) new_piece: f64,
    /// What one more piece counts for where a path is chosen that divides one, as a length of seam, mm.
    pub(super) divided: f64,
    /// What a neck costs, as a length of seam, mm.
    pub(super) neck: f64,
    /// Faces of all pieces judged so far: the effort spent.
    pub(super) judged: usize,
    pub(super) must_cut: Field<VertexId, bool>,
    /// Edges that the user wants cut.
    pub(super) kept: Field<EdgeId, bool>,
    pub(super) builder: ChartBuilder<'a>,
    pub(super) options: &'a Options,
    pub(super) monitor: &'a Monitor<'a>,
    pub(super) cut: Field<EdgeId, bool>,
    /// Pieces by number; a number is never given twice, and what no longer lives is `None`.
    pub(super) pieces: Vec<Option<Piece>>,
    /// The piece that each piece was glued into; itself while it lives.
    pub(super) glued_into: Vec<u32>,
    pub(super) failures: Failures,
    pub(super) piece_of: Field<FaceId, u32>,
}

/// What a search found.
pub(super) struct Found {
    /// The edges to cut.
    pub(super) cut: Field<EdgeId, bool>,
    /// Number of vertices that the first cut was led through.
    pub(super) terminals: usize,
    /// What it costs.
    pub(super) cost: Cost,
    /// The edges of pieces that are not good that were to be longer or shorter in the plane than in space, ascending.
    pub(super) strained: Vec<EdgeId>,
}

/// Finds the edges to cut: through all vertices for which `is_terminal` holds and all that cannot be in the interior of
/// a piece, and wherever else the limits ask for it.
pub(super) fn search(
    mesh: &TriMesh,
    is_terminal: impl Fn(VertexId) -> bool,
    options: &Options,
    monitor: &Monitor,
) -> Result<Found, CutError> {
    let metric = Metric::new(mesh).with_rim(&rim(mesh, &options.scales));
    let curvature = angle_defects(mesh);
    let must_cut = must_cut(mesh, &metric, &curvature, CERTAIN * options.stretch);
    let terminals: Vec<VertexId> = mesh.vertices().filter(|&v| must_cut[v] || is_terminal(v)).collect();
    let toll = tolls(mesh, options);
    let mut kept = Field::filled(mesh.edge_count(), false);
    options.seams.iter().for_each(|&e| kept[e] = true);
    let mut best = Search {
        mesh,
        weight: seam_weight(mesh, &toll, &curvature, ATTRACTION),
        toll,
        metric,
        curvature,
        peaks: PEAKS,
        new_piece: options.new_piece * mesh.bounds().diagonal(),
        divided: DIVIDED * mesh.bounds().diagonal(),
        neck: options.neck * mesh.bounds().diagonal(),
        judged: 0,
        must_cut,
        builder: ChartBuilder::new(mesh),
        options,
        monitor,
        cut: kept.clone(),
        kept,
        pieces: Vec::new(),
        glued_into: Vec::new(),
        failures: Failures::default(),
        piece_of: Field::filled(mesh.face_count(), u32::MAX),
    };
    let uncut = best.clone();
    best.solve(&terminals)?;
    let mut judged = best.judged;
    for (attempt, k) in ATTEMPTS.into_iter().zip(1..) {
        // As much again as one attempt took must be left, and something to be saved.
        if judged + judged / k > ATTEMPTS_EFFORT || best.length(&best.seams()) == 0.0 {
            break;
        }
        let mut other = uncut.clone();
        match attempt {
            Attempt::Joined(attraction) => other.attract(attraction),
            Attempt::Patches => {
                other.cut = patches(mesh, best.pieces.iter().flatten().count(), &other.kept, monitor)?;
            }
        }
        other.solve(&terminals)?;
        judged += other.judged;
        if other.cost() < best.cost() {
            best = other;
        }
    }
    best.judged = judged;
    let limit = EFFORT.min(judged + IMPROVEMENT * mesh.face_count());
    best.straighten(limit)?;
    best.improve(limit)?;
    best.join(0)?;
    best.part_at_necks()?;
    best.enlarge()?;
    Ok(Found { cost: best.cost(), strained: best.strained(), cut: best.cut, terminals: terminals.len() })
}

/// What a seam along each edge counts for.
fn tolls(mesh: &TriMesh, options: &Options) -> Field<EdgeId, f64> {
    let mut out = Field::from_fn(mesh.edge_count(), |e| mesh.edge_length(e));
    let preferred = options.prefer.iter().map(|it| (it, PREFERRED));
    for (region, factor) in preferred.chain(options.avoid.iter().map(|it| (it, AVOIDED))) {
        let inside = membership(mesh, region);
        mesh.edges().filter(|&e| inside(e)).for_each(|e| out[e] *= factor);
    }
    out
}

/// Whether an edge belongs to a region.
fn membership<'r>(mesh: &'r TriMesh, region: &'r Region) -> Box<dyn Fn(EdgeId) -> bool + 'r> {
    let (side, middle) = match region {
        Region::Faces(faces) => {
            return Box::new(|e| {
                let h = mesh.halfedge(e);
                let sides = [Some(h), mesh.twin(h)];
                sides.into_iter().flatten().all(|h| faces.binary_search(&mesh.face(h)).is_ok())
            });
        }
        Region::Side(side) => (side, false),
        Region::Middle(side) => (side, true),
    };
    let heights = mesh.positions().iter().map(|p| p.dot(&side.towards));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), it| (a.min(it), b.max(it)));
    let from = high - side.share * (high - low);
    let (centre, half) = (0.5 * (low + high), 0.5 * side.share * (high - low));
    Box::new(move |e| {
        let [a, b] = mesh.edge_vertices(e).map(|v| mesh.position(v).dot(&side.towards));
        if middle { (0.5 * (a + b) - centre).abs() <= half } else { a + b >= 2.0 * from }
    })
}

/// Toll / (1 + a S), a the `attraction`, with S = min(1, dihedral / 0.5) + min(1, (|K_a| + |K_b|) / 0.2): seams run along creases and
/// through curvature, where they are of use.
fn seam_weight(
    mesh: &TriMesh,
    toll: &Field<EdgeId, f64>,
    curvature: &Field<VertexId, f64>,
    attraction: f64,
) -> Field<EdgeId, f64> {
    Field::from_fn(mesh.edge_count(), |e| {
        let bend = mesh.dihedral_cosine(e).map_or(0.0, |it| it.clamp(-1.0, 1.0).acos());
        let defect: f64 = mesh.edge_vertices(e).iter().map(|&v| curvature[v].abs()).sum();
        let crease = (bend / CREASE_ANGLE).min(1.0) + (defect / CREASE_DEFECT).min(1.0);
        // A zero weight would let paths wander.
        toll[e].max(f64::MIN_POSITIVE) / (1.0 + attraction * crease)
    })
}

/// Vertices that lie on a cut in every solution: in the interior A_vv u_v = −K_v − Σ A_vw u_w, so |u| ≤ s everywhere
/// implies |K_v| ≤ s (A_vv + Σ |A_vw|).
fn must_cut(mesh: &TriMesh, metric: &Metric, curvature: &Field<VertexId, f64>, limit: f64) -> Field<VertexId, bool> {
    let mut weights = Field::<EdgeId, f64>::filled(mesh.edge_count(), 0.0);
    for h in mesh.halfedges() {
        weights[mesh.edge(h)] += 0.5 * metric.cotangent[h];
    }
    Field::from_fn(mesh.vertex_count(), |v| {
        let around = || mesh.outgoing(v).map(|h| weights[mesh.edge(h)]);
        let row: f64 = around().sum::<f64>() + around().map(f64::abs).sum::<f64>();
        !mesh.is_boundary_vertex(v) && curvature[v].abs() > limit * row
    })
}

impl Search<'_> {
    /// A first solution through all `terminals`.
    fn solve(&mut self, terminals: &[VertexId]) -> Result<(), CutError> {
        let all: Vec<FaceId> = self.mesh.faces().collect();
        cut_to_disks(self.mesh, &all, &self.weight, &self.curvature, terminals, &mut self.cut, self.monitor)?;
        self.monitor.progress(0.1, "cutting to where it stretches most");
        self.settle(&all)?;
        self.monitor.progress(0.3, "gluing what can be glued");
        self.join(0)?;
        self.part_at_necks()
    }

    fn cost(&self) -> Cost {
        let pieces = || self.pieces.iter().flatten();
        (pieces().filter(|it| !it.is_good()).count(), self.length(&self.seams()) + self.price(pieces()))
    }

    /// The edges with a factor of length around pieces that are not good.
    fn strained(&self) -> Vec<EdgeId> {
        let bad = self.pieces.iter().flatten().filter(|it| !it.is_good());
        let mut around: Vec<EdgeId> =
            bad.flat_map(|it| it.chart.loops.iter().flatten()).map(|it| self.mesh.edge(it.0)).collect();
        around.sort_unstable();
        around.dedup();
        let scaled = |e: &EdgeId| self.options.scales.iter().any(|it| it.0 == *e && it.1 != 1.0);
        around.retain(scaled);
        around
    }

    /// The inner edges that are cut.
    pub(super) fn seams(&self) -> Vec<EdgeId> {
        self.mesh.edges().filter(|&e| self.cut[e] && !self.mesh.is_boundary_edge(e)).collect()
    }

    /// Judges the component that `faces` are with the edges cut now.
    pub(super) fn judge(&mut self, faces: Vec<FaceId>) -> Result<Piece, CutError> {
        self.judged += faces.len();
        let Self { builder, metric, cut, options, .. } = self;
        let chart = builder.chart(faces, &|e| cut[e]);
        Ok(Piece::new(builder, metric, chart, &|e| cut[e], options, Limit::new(options.stretch))?)
    }

    /// Cuts `faces` (whole components of the mesh as it is opened now) until every piece is good.
    pub(super) fn settle(&mut self, faces: &[FaceId]) -> Result<(), CutError> {
        let mut work = self.builder.components(faces, &|e| self.cut[e]);
        while let Some(faces) = work.pop() {
            self.monitor.check()?;
            let mut piece = self.judge(faces)?;
            if !piece.conflicts.is_empty() {
                piece = self.without_closed_slits(piece)?;
            }
            let edges = if piece.is_good() {
                Vec::new()
            } else if piece.contours.is_empty() {
                relieving_cuts(self.mesh, &piece, &self.weight, self.peaks)
            } else {
                let it = (&piece, &piece.conflicts[..]);
                dividing_path(self.mesh, it, &self.weight, self.divided, self.options.min_area).unwrap_or_default()
            };
            for &e in &edges {
                self.cut[e] = true;
            }
            if edges.is_empty() {
                self.insert(piece);
            } else {
                work.extend(self.builder.components(&piece.chart.faces, &|e| self.cut[e]));
            }
        }
        Ok(())
    }

    /// Slits whose sides coincide in the plane serve no purpose: glued, if the piece is good without them; else as it was.
    fn without_closed_slits(&mut self, piece: Piece) -> Result<Piece, CutError> {
        let mut slits = piece.closed_slits(self.mesh, self.options.clearance);
        slits.retain(|&e| !self.kept[e]);
        if slits.is_empty() {
            return Ok(piece);
        }
        for &e in &slits {
            self.cut[e] = false;
        }
        let glued = self.judge(piece.chart.faces.clone())?;
        if glued.is_good() {
            return Ok(glued);
        }
        for &e in &slits {
            self.cut[e] = true;
        }
        Ok(piece)
    }

    /// Changes how much creases attract seams.
    pub(super) fn attract(&mut self, attraction: f64) {
        self.weight = seam_weight(self.mesh, &self.toll, &self.curvature, attraction);
    }

    /// What seams along edges count for, mm.
    pub(super) fn length(&self, edges: &[EdgeId]) -> f64 {
        edges.iter().map(|&e| self.toll[e]).sum()
    }

    pub(super) fn insert(&mut self, piece: Piece) {
        let id = self.pieces.len() as u32;
        for &f in &piece.chart.faces {
            self.piece_of[f] = id;
        }
        self.pieces.push(Some(piece));
        self.glued_into.push(id);
    }

    /// Whether a piece is under the useful size, or a strip too narrow to be of use.
    pub(super) fn is_small(&self, piece: &Piece) -> bool {
        piece.area < self.options.min_area || piece.width < self.options.min_neck
    }

    /// What pieces are worth beside the length of their seams, mm.
    pub(super) fn price<'p>(&self, pieces: impl Iterator<Item = &'p Piece>) -> f64 {
        let price = |it: &Piece| {
            let pieces = if self.is_small(it) { 1.0 + SMALL_PIECE } else { 1.0 };
            self.new_piece * pieces + self.neck * it.necks.len() as f64
        };
        pieces.map(price).sum()
    }
}
