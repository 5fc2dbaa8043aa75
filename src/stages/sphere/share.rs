//! How long seams should be in the plane, so that the pieces on both sides stretch least.
//!
//! A gore whose sides keep their length in space must shrink in its middle by all that it is too long there. Where each piece
//! may choose the length of its sides, it shares that out: sides longer, middle shorter. Both sides of a seam must agree, so
//! a seam gets the mean of what they would choose.
use crate::{
    mesh::{EdgeId, FaceId, Field, TriMesh, VertexId},
    surface::{
        chart::{ChartBuilder, Metric},
        collapse::quality,
        flatten::{FlattenError, Flattener, Limit},
        isometric::Isometry,
    },
};

/// A seam changes its length by at most this share of the limit of stretch, so that the faces along it can keep that.
const MOST: f64 = 0.85;
/// Beside a face of a lower quality a seam keeps its length: a small share of a long side is much of the height over it.
const SLIVER: f64 = 0.2;
/// Sweeps along the seams that even out what the triangles on either side have to do with it.
const SWEEPS: usize = 4;

/// For every seam the factor of its length in the plane over that in space; 1 where a piece beside it is no disk, or is beyond
/// the limit all the same: what divides it further starts from lengths that are those of the surface.
pub(super) fn share(mesh: &TriMesh, seams: &[EdgeId], stretch: f64) -> Result<Vec<f64>, FlattenError> {
    let cut = |e: EdgeId| seams.binary_search(&e).is_ok();
    let metric = Metric::new(mesh);
    let mut builder = ChartBuilder::new(mesh);
    let mut chosen = Field::<EdgeId, f64>::filled(mesh.edge_count(), 0.0);
    let mut asking = Field::<EdgeId, u32>::filled(mesh.edge_count(), 0);
    for faces in builder.components(&mesh.faces().collect::<Vec<FaceId>>(), &cut) {
        let chart = builder.chart(faces, &cut);
        if !chart.is_disk() {
            continue;
        }
        let mut uv = Flattener::new(&metric, &chart)?.flatten()?;
        let isometry = Isometry::new(&metric, &chart).with_free_boundary();
        isometry.relax(&mut uv, stretch);
        if !isometry.excess(&uv, stretch).is_within(Limit::new(stretch).allowed) {
            continue;
        }
        let most = MOST * stretch;
        for (h, i, j) in chart.boundary_edges() {
            let ratio = (uv[j as usize] - uv[i as usize]).norm() / metric.length[h];
            chosen[mesh.edge(h)] += 0.5 * ratio.ln().clamp(-most, most);
            asking[mesh.edge(h)] += 1;
        }
    }
    for f in mesh.faces().filter(|&f| quality(mesh.face_positions(f)) < SLIVER) {
        mesh.face_halfedges(f).into_iter().for_each(|h| asking[mesh.edge(h)] = 0);
    }
    let mut factors = Field::from_fn(mesh.edge_count(), |e: EdgeId| if asking[e] == 2 { chosen[e] } else { 0.0 });
    let along = neighbours(mesh, seams);
    for _ in 0..SWEEPS {
        let before = factors.clone();
        for (&e, near) in seams.iter().zip(&along) {
            let own = mesh.edge_length(e);
            let (mut sum, mut weight) = (own * before[e], own);
            for &n in near {
                sum += mesh.edge_length(n) * before[n];
                weight += mesh.edge_length(n);
            }
            factors[e] = sum / weight;
        }
    }
    Ok(seams.iter().map(|&e| if asking[e] == 2 { factors[e].exp() } else { 1.0 }).collect())
}

/// The one or two seams that each goes on in; none beyond where several meet.
fn neighbours(mesh: &TriMesh, seams: &[EdgeId]) -> Vec<Vec<EdgeId>> {
    let mut at = Field::<VertexId, Vec<EdgeId>>::from_fn(mesh.vertex_count(), |_| Vec::new());
    for &e in seams {
        mesh.edge_vertices(e).into_iter().for_each(|v| at[v].push(e));
    }
    let beyond = |e: EdgeId| {
        let ends = mesh.edge_vertices(e).into_iter().filter(|&v| at[v].len() == 2);
        ends.flat_map(|v| at[v].iter().copied().filter(move |&it| it != e)).collect()
    };
    seams.iter().map(|&e| beyond(e)).collect()
}
