//! Opens a mesh along cut edges: new vertices, pieces, and the seams that say which boundary edges belong together.
use super::{chart::ChartBuilder, cut_graph::arcs};
use crate::mesh::{EdgeId, FaceId, Field, HalfedgeId, MeshError, TriMesh, VertexId};

/// A mesh opened along edges. Faces and halfedges keep their ids.
#[derive(Debug, Clone, PartialEq)]
pub struct Opening {
    /// The opened mesh.
    pub mesh: TriMesh,
    /// The vertex of the closed mesh that each vertex came from.
    pub origin: Field<VertexId, VertexId>,
    /// Number of the piece of each face; piece 0 has the largest area.
    pub piece_of: Field<FaceId, u32>,
    /// How many pieces.
    pub pieces: usize,
    /// Maximal chains of cut edges between the same two pieces, broken where more than two cut edges meet: both sides as
    /// boundary halfedges, k-th with k-th; the first side in its order of travel, the second against it.
    pub seams: Vec<[Vec<HalfedgeId>; 2]>,
}

/// Opens `mesh` along the edges of `cut` (on the boundary they change nothing).
///
/// Fails when an opened component has no index representation, which a lone cut edge that touches neither boundary nor
/// other cut edges has not (it would leave a boundary loop of two edges between the same two vertices).
pub fn open(mesh: &TriMesh, cut: &Field<EdgeId, bool>) -> Result<Opening, MeshError> {
    let is_cut = |e: EdgeId| cut[e];
    let mut builder = ChartBuilder::new(mesh);
    let all: Vec<FaceId> = mesh.faces().collect();
    let mut components: Vec<(f64, Vec<FaceId>)> = builder
        .components(&all, &is_cut)
        .into_iter()
        .map(|faces| (faces.iter().map(|&f| mesh.area(f)).sum(), faces))
        .collect();
    components.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1[0].cmp(&b.1[0])));
    let mut piece_of = Field::filled(mesh.face_count(), 0);
    for (k, (_, faces)) in components.iter().enumerate() {
        for &f in faces {
            piece_of[f] = k as u32;
        }
    }
    let chart = builder.chart(all, &is_cut);
    let positions = chart.origin.iter().map(|&v| mesh.position(v)).collect();
    let seams = arcs(mesh, cut).into_iter().flat_map(|arc| split_by_pieces(mesh, &piece_of, &arc)).collect();
    Ok(Opening {
        mesh: TriMesh::new(positions, &chart.corners)?,
        origin: Field::from_vec(chart.origin),
        piece_of,
        pieces: components.len(),
        seams,
    })
}

/// One arc as seams: oriented so that the first side belongs to the smaller piece number (on a tie as it comes), and
/// broken where the pair of pieces changes.
fn split_by_pieces(mesh: &TriMesh, piece_of: &Field<FaceId, u32>, arc: &[EdgeId]) -> Vec<[Vec<HalfedgeId>; 2]> {
    let mut path: Vec<HalfedgeId> = Vec::with_capacity(arc.len());
    for (k, &e) in arc.iter().enumerate() {
        let h = mesh.halfedge(e);
        let twin = mesh.twin(h).expect("arcs run along inner edges");
        let forward = match (path.last(), arc.get(k + 1)) {
            (Some(&before), _) => mesh.tail(h) == mesh.head(before),
            (None, Some(&next)) => mesh.edge_vertices(next).contains(&mesh.head(h)),
            (None, None) => true,
        };
        path.push(if forward { h } else { twin });
    }
    let twin = |h: HalfedgeId| mesh.twin(h).expect("arcs run along inner edges");
    let pieces = |h: HalfedgeId| (piece_of[mesh.face(h)], piece_of[mesh.face(twin(h))]);
    path.chunk_by(|&g, &h| pieces(g) == pieces(h))
        .map(|run| {
            let (left, right) = pieces(run[0]);
            let others: Vec<HalfedgeId> = run.iter().map(|&h| twin(h)).collect();
            if left <= right {
                [run.to_vec(), others]
            } else {
                // Seen from the other side the order of travel is reversed.
                [others.into_iter().rev().collect(), run.iter().rev().copied().collect()]
            }
        })
        .collect()
}
