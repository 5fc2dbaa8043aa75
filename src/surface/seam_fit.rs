//! Makes both sides of every seam equally long in the plane: a small least-squares problem over the outlines of all pieces
//! at once.
//!
//! With H_p the stiffness of piece p (second derivatives of its stretch, weighed by its area) and g_s the gradient of the
//! length of side s, the moves d_p that cost least, Σ ½ d_pᵀ H_p d_p, and take away the mismatches c_k of all seams are
//! d_p = −Σ ±μ_k H_p⁻¹ g_s with M μ = c, M_kl = Σ ± g_sᵀ H_p⁻¹ g_t over the sides s of seam k and t of seam l that lie on
//! the same piece. A few such steps, as lengths are not linear in the moves.
use super::{
    chart::{Chart, Metric},
    isometric::Isometry,
};
use crate::{
    geom::Vec2,
    numeric::{
        Cancelled, Monitor,
        sparse::{Cholesky, SymmetricMatrix},
    },
};

/// Steps at most: each leaves the square of the mismatch before it.
const STEPS: usize = 10;
/// A seam fits when its sides differ by this share of its length.
const FITS: f64 = 1e-7;
/// Added to the diagonal, as a share of its mean: for seams whose pieces cannot give.
const REGULARISATION: f64 = 1e-9;

/// A piece in the plane.
#[derive(Debug)]
pub struct Sheet<'a> {
    /// Its chart.
    pub chart: &'a Chart,
    /// Plane coordinates per local vertex, mm.
    pub uv: Vec<Vec2>,
}

/// One side of a seam.
#[derive(Debug, Clone, PartialEq)]
pub struct SeamSide {
    /// Index of the piece.
    pub sheet: usize,
    /// Its edges as pairs of local vertices.
    pub edges: Vec<[u32; 2]>,
}

impl SeamSide {
    /// Length in the plane, mm.
    pub fn length(&self, sheets: &[Sheet]) -> f64 {
        let uv = &sheets[self.sheet].uv;
        self.edges.iter().map(|&[a, b]| (uv[b as usize] - uv[a as usize]).norm()).sum()
    }
}

/// Moves the pieces as little as possible until the two sides of every seam are equally long, each piece stiff as it is
/// for the limit `stretch`. Pieces with flipped triangles stay as they are, and so may seams between such.
pub fn fit_seams(
    metric: &Metric,
    sheets: &mut [Sheet],
    seams: &[[SeamSide; 2]],
    stretch: f64,
    monitor: &Monitor,
) -> Result<(), Cancelled> {
    let mut of_sheet: Vec<Vec<(usize, f64)>> = vec![Vec::new(); sheets.len()];
    for (k, sides) in seams.iter().enumerate() {
        for (side, sign) in sides.iter().zip([1.0, -1.0]) {
            of_sheet[side.sheet].push((k, sign));
        }
    }
    for _ in 0..STEPS {
        let lengths: Vec<[f64; 2]> = seams.iter().map(|it| [0, 1].map(|k: usize| it[k].length(sheets))).collect();
        let mismatch: Vec<f64> = lengths.iter().map(|[a, b]| a - b).collect();
        if lengths.iter().all(|[a, b]| (a - b).abs() <= FITS * a.max(*b)) {
            break;
        }
        let mut entries: Vec<(u32, u32, f64)> = Vec::new();
        let mut responses: Vec<Vec<Vec<f64>>> = Vec::with_capacity(sheets.len());
        for (sheet, sides) in sheets.iter().zip(&of_sheet) {
            monitor.check()?;
            let gradients: Vec<Vec<f64>> =
                sides.iter().map(|&(k, sign)| gradient(&seams[k][usize::from(sign < 0.0)], sign, &sheet.uv)).collect();
            let response = respond(metric, sheet, &gradients, stretch);
            for (i, (k, _)) in sides.iter().enumerate() {
                for (j, (l, _)) in sides.iter().enumerate() {
                    // Both sides of a slit lie on one piece: then the two orders add up on the diagonal.
                    if l <= k && (l < k || j <= i) {
                        let value: f64 = gradients[i].iter().zip(&response[j]).map(|(a, b)| a * b).sum();
                        let twice = if l == k && i != j { 2.0 } else { 1.0 };
                        entries.push((*k as u32, *l as u32, twice * value));
                    }
                }
            }
            responses.push(response);
        }
        let mut matrix = SymmetricMatrix::from_triplets(seams.len(), &entries);
        let floor = REGULARISATION * matrix.diagonal().iter().sum::<f64>() / seams.len() as f64;
        (0..seams.len()).for_each(|k| matrix.add_to_diagonal(k, floor.max(f64::MIN_POSITIVE)));
        let Ok(factor) = Cholesky::new(&matrix) else { break };
        let forces = factor.solve(&mismatch);
        let moves: Vec<Vec<Vec2>> = responses
            .iter()
            .zip(&of_sheet)
            .zip(&*sheets)
            .map(|((response, sides), sheet)| {
                let mut sum = vec![Vec2::zeros(); sheet.uv.len()];
                for (column, &(k, _)) in response.iter().zip(sides) {
                    for (d, pair) in sum.iter_mut().zip(column.as_chunks::<2>().0) {
                        *d -= Vec2::from(*pair) * forces[k];
                    }
                }
                sum
            })
            .collect();
        // All pieces go the same part of the way, so that every seam gets better.
        let longest = |(sheet, moves): (&Sheet, &Vec<Vec2>)| sheet.chart.longest_step(&sheet.uv, moves);
        let step = sheets.iter().zip(&moves).map(longest).fold(1.0, f64::min);
        for (sheet, moves) in sheets.iter_mut().zip(moves) {
            sheet.uv.iter_mut().zip(moves).for_each(|(p, d)| *p += d * step);
        }
    }
    Ok(())
}

/// Gradient of ± the length of a side, x and y of every vertex.
fn gradient(side: &SeamSide, sign: f64, uv: &[Vec2]) -> Vec<f64> {
    let mut out = vec![0.0; 2 * uv.len()];
    for &[a, b] in &side.edges {
        let t = (uv[b as usize] - uv[a as usize]).normalize() * sign;
        for (v, t) in [(a, -t), (b, t)] {
            out[2 * v as usize] += t.x;
            out[2 * v as usize + 1] += t.y;
        }
    }
    out
}

/// H⁻¹ of each column; 0 for a piece that cannot be moved.
fn respond(metric: &Metric, sheet: &Sheet, columns: &[Vec<f64>], stretch: f64) -> Vec<Vec<f64>> {
    let n = 2 * sheet.uv.len();
    let isometry = Isometry::new(metric, sheet.chart);
    let mut all = columns.concat();
    match isometry.stiffness(&sheet.uv, stretch) {
        Some(factor) if !columns.is_empty() => {
            factor.solve_in_place(&mut all);
            all.iter_mut().for_each(|it| *it /= isometry.total_area());
        }
        _ => all.fill(0.0),
    }
    all.chunks_exact(n).map(<[f64]>::to_vec).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        mesh::{FaceId, TriMesh, shapes},
        surface::chart::ChartBuilder,
    };

    /// A sheet cut into a left, a middle and a right piece, each laid out as it is but for a map of its own.
    fn three(mesh: &TriMesh, maps: [&dyn Fn(Vec2) -> Vec2; 3]) -> (Vec<Chart>, Vec<Vec<Vec2>>, Vec<[SeamSide; 2]>) {
        let third = |f: FaceId| ((mesh.face_positions(f).iter().map(|p| p.x).sum::<f64>() / 3.0) / 20.0) as usize;
        let mut builder = ChartBuilder::new(mesh);
        let cut = |e| {
            let h = mesh.halfedge(e);
            mesh.twin(h).is_some_and(|twin| third(mesh.face(h)) != third(mesh.face(twin)))
        };
        let charts: Vec<Chart> =
            (0..3).map(|k| builder.chart(mesh.faces().filter(|&f| third(f) == k).collect(), &cut)).collect();
        let uv = charts.iter().zip(maps).map(|(c, map)| c.origin.iter().map(|&v| map(mesh.position(v).xy())).collect());
        let uv = uv.collect();
        let side = |k: usize, x: f64| {
            let path = &charts[k].loops[0];
            let n = path.len();
            let on = |v: u32| (mesh.position(charts[k].origin[v as usize]).x - x).abs() < 1e-9;
            let ends = (0..n).map(|i| [path[i].1, path[(i + 1) % n].1]);
            SeamSide { sheet: k, edges: ends.filter(|it| it.iter().all(|&v| on(v))).collect() }
        };
        let seams = vec![[side(0, 20.0), side(1, 20.0)], [side(1, 40.0), side(2, 40.0)]];
        (charts, uv, seams)
    }

    #[test]
    fn seams_that_do_not_fit_do_after_and_little_else_changes() {
        let mesh = shapes::grid(12, 8, 5.0);
        let metric = Metric::new(&mesh);
        let wider = |p: Vec2| Vec2::new(p.x, p.y * (1.0 + 1e-4 * p.x));
        let (charts, uv, seams) = three(&mesh, [&|p| p, &wider, &|p| p * 0.99]);
        let mut sheets: Vec<Sheet> = charts.iter().zip(uv.clone()).map(|(chart, uv)| Sheet { chart, uv }).collect();
        let mismatch = |sheets: &[Sheet]| -> f64 {
            let off = seams.iter().map(|it| it[0].length(sheets) / it[1].length(sheets) - 1.0);
            off.map(f64::abs).fold(0.0, f64::max)
        };
        let off = mismatch(&sheets);
        assert!(off > 0.01, "{off}");
        fit_seams(&metric, &mut sheets, &seams, 0.005, &Monitor::silent()).unwrap();
        assert!(mismatch(&sheets) < 1e-7, "{}", mismatch(&sheets));
        // The mismatch is shared: no piece is stretched by as much as the worst seam was off.
        for (sheet, before) in sheets.iter().zip(&uv) {
            let isometry = Isometry::new(&metric, sheet.chart);
            let worst = |uv: &[Vec2]| {
                (0..sheet.chart.faces.len()).map(|k| isometry.principal_stretch(k, uv)).fold(0.0, f64::max)
            };
            assert!(worst(&sheet.uv) < worst(before).max(off), "{} {}", worst(&sheet.uv), worst(before));
        }
    }

    #[test]
    fn seams_that_fit_stay() {
        let mesh = shapes::grid(12, 8, 5.0);
        let (charts, uv, seams) = three(&mesh, [&|p| p; 3]);
        let mut sheets: Vec<Sheet> = charts.iter().zip(uv.clone()).map(|(chart, uv)| Sheet { chart, uv }).collect();
        fit_seams(&Metric::new(&mesh), &mut sheets, &seams, 0.005, &Monitor::silent()).unwrap();
        assert!(sheets.iter().zip(uv).all(|(sheet, before)| sheet.uv == before));
    }
}
