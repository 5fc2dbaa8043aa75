//! The search for cuts: what is cut so far, the pieces that makes, and how they get better.
use super::{CutError, Options, divide::dividing_path, join::Failures, piece::Piece, relieve::relieving_cuts};
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
/// How much creases attract the seams of the first solution.
const ATTRACTION: f64 = 2.0;
/// Peaks relieved at a time in the first solution, and one more for every thousand vertices.
const PEAKS: usize = 8;
/// A piece under the useful size costs as much as so many more pieces.
const SMALL_PIECE: f64 = 4.0;

/// State of the search.
pub(super) struct Search<'a> {
    pub(super) mesh: &'a TriMesh,
    pub(super) metric: Metric,
    pub(super) curvature: Field<VertexId, f64>,
    pub(super) weight: Field<EdgeId, f64>,
    /// Peaks of stretch that are relieved at a time.
    pub(super) peaks: usize,
    /// What one more piece is worth, as a length of seam, mm.
    pub(super) new_piece: f64,
    /// Faces of all pieces judged so far: the effort spent.
    pub(super) judged: usize,
    pub(super) must_cut: Field<VertexId, bool>,
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
}

/// Finds the edges to cut: through all vertices for which `is_terminal` holds and all that cannot be in the interior of
/// a piece, and wherever else the limits ask for it.
pub(super) fn search(
    mesh: &TriMesh,
    is_terminal: impl Fn(VertexId) -> bool,
    options: &Options,
    monitor: &Monitor,
) -> Result<Found, CutError> {
    let curvature = angle_defects(mesh);
    let weight = seam_weight(mesh, &curvature, ATTRACTION);
    let metric = Metric::new(mesh);
    let must_cut = must_cut(mesh, &metric, &curvature, CERTAIN * options.stretch);
    let mut cut = Field::filled(mesh.edge_count(), false);
    let terminals: Vec<VertexId> = mesh.vertices().filter(|&v| must_cut[v] || is_terminal(v)).collect();
    let all: Vec<FaceId> = mesh.faces().collect();
    cut_to_disks(mesh, &all, &weight, &curvature, &terminals, &mut cut, monitor)?;
    let mut search = Search {
        mesh,
        metric,
        curvature,
        weight,
        peaks: PEAKS,
        new_piece: options.new_piece * mesh.bounds().diagonal(),
        judged: 0,
        must_cut,
        builder: ChartBuilder::new(mesh),
        options,
        monitor,
        cut,
        pieces: Vec::new(),
        glued_into: Vec::new(),
        failures: Failures::default(),
        piece_of: Field::filled(mesh.face_count(), u32::MAX),
    };
    monitor.progress(0.1, "cutting to where it stretches most");
    search.settle(&all)?;
    monitor.progress(0.3, "gluing what can be glued");
    search.join(0)?;
    search.improve()?;
    search.join(0)?;
    search.enlarge()?;
    Ok(Found { cut: search.cut, terminals: terminals.len() })
}

/// Length / (1 + a S), a the `attraction`, with S = min(1, dihedral / 0.5) + min(1, (|K_a| + |K_b|) / 0.2): seams run along creases and
/// through curvature, where they are of use.
fn seam_weight(mesh: &TriMesh, curvature: &Field<VertexId, f64>, attraction: f64) -> Field<EdgeId, f64> {
    Field::from_fn(mesh.edge_count(), |e| {
        let bend = mesh.dihedral_cosine(e).map_or(0.0, |it| it.clamp(-1.0, 1.0).acos());
        let defect: f64 = mesh.edge_vertices(e).iter().map(|&v| curvature[v].abs()).sum();
        let crease = (bend / CREASE_ANGLE).min(1.0) + (defect / CREASE_DEFECT).min(1.0);
        // A zero weight would let paths wander.
        mesh.edge_length(e).max(f64::MIN_POSITIVE) / (1.0 + attraction * crease)
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
                dividing_path(self.mesh, &piece, &self.weight, self.new_piece, self.options.min_area)
                    .unwrap_or_default()
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
        let slits = piece.closed_slits(self.mesh, self.options.clearance);
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
        self.weight = seam_weight(self.mesh, &self.curvature, attraction);
    }

    /// Total length of edges, mm.
    pub(super) fn length(&self, edges: &[EdgeId]) -> f64 {
        edges.iter().map(|&e| self.mesh.edge_length(e)).sum()
    }

    pub(super) fn insert(&mut self, piece: Piece) {
        let id = self.pieces.len() as u32;
        for &f in &piece.chart.faces {
            self.piece_of[f] = id;
        }
        self.pieces.push(Some(piece));
        self.glued_into.push(id);
    }

    /// Whether a piece is under the useful size.
    pub(super) fn is_small(&self, piece: &Piece) -> bool {
        piece.area < self.options.min_area
    }

    /// What pieces are worth beside the length of their seams, mm.
    pub(super) fn price<'p>(&self, pieces: impl Iterator<Item = &'p Piece>) -> f64 {
        self.new_piece * pieces.map(|it| if self.is_small(it) { 1.0 + SMALL_PIECE } else { 1.0 }).sum::<f64>()
    }
}
