//! Why there are not fewer pieces: what gluing the smallest one to a neighbour would cost.
use super::CutError;
use crate::{
    geom::Vec3,
    mesh::{EdgeId, FaceId, Field, Id, TriMesh},
    model::{CutMesh, PieceId},
    surface::{
        chart::{ChartBuilder, Metric},
        flatten::{Flattener, Limit, polished},
        isometric::Isometry,
    },
};

/// What keeps the smallest piece apart from the neighbour that it could be glued to best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Obstacle {
    /// The smallest piece.
    pub piece: PieceId,
    /// The neighbour.
    pub neighbour: PieceId,
    /// Label of the seam between them.
    pub seam: u32,
    /// Where the two together would stretch most, mm.
    pub place: Vec3,
    /// Principal stretch max |ln σ| that 99.9 % of the area of both would keep. Where it is within the limit they would
    /// overlap, or not fit on the sheet.
    pub stretch: f64,
}

/// For the smallest piece of `cut`, which was made from `mesh`; `None` if no seam parts it from another piece along which
/// the two would be a disk.
pub fn obstacle(mesh: &TriMesh, cut: &CutMesh) -> Result<Option<Obstacle>, CutError> {
    let piece = PieceId::new(cut.pieces.len() - 1);
    let metric = Metric::new(mesh).with_rim(&cut.rim);
    let mut builder = ChartBuilder::new(mesh);
    let mut open = Field::<EdgeId, bool>::filled(mesh.edge_count(), false);
    let edges = |seam: usize| cut.seams[seam].sides[0].iter().map(|&h| mesh.edge(h));
    for e in (0..cut.seams.len()).flat_map(edges) {
        open[e] = true;
    }
    let mut best: Option<Obstacle> = None;
    for (k, seam) in cut.seams.iter().enumerate() {
        let [p, q] = [0, 1].map(|side: usize| cut.piece_of[mesh.face(seam.sides[side][0])]);
        if p == q || (p != piece && q != piece) {
            continue;
        }
        edges(k).for_each(|e| open[e] = false);
        let faces: Vec<FaceId> = mesh.faces().filter(|&f| [p, q].contains(&cut.piece_of[f])).collect();
        let chart = builder.chart(faces, &|e| open[e]);
        edges(k).for_each(|e| open[e] = true);
        if !chart.is_disk() {
            continue;
        }
        let uv = Flattener::new(&metric, &chart)?.flatten()?;
        let uv = polished(&metric, &chart, uv, Limit::new(cut.stretch)).uv;
        let isometry = Isometry::new(&metric, &chart);
        let mut stretches: Vec<(f64, FaceId)> =
            chart.faces.iter().enumerate().map(|(i, &f)| (isometry.principal_stretch(i, &uv), f)).collect();
        stretches.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        let mut left = Limit::new(cut.stretch).allowed * chart.faces.iter().map(|&f| metric.area[f]).sum::<f64>();
        let kept = stretches.iter().find(|it| {
            left -= metric.area[it.1];
            left < 0.0
        });
        let (Some(&(stretch, _)), Some(&(_, worst))) = (kept, stretches.first()) else { continue };
        if best.is_none_or(|it| stretch < it.stretch) {
            let neighbour = if p == piece { q } else { p };
            let place = mesh.face_positions(worst).iter().sum::<Vec3>() / 3.0;
            best = Some(Obstacle { piece, neighbour, seam: seam.label, place, stretch });
        }
    }
    Ok(best)
}
