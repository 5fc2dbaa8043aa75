//! Lines as they leave the stage: which way they run and where they start.
use super::isolines::Isoline;
use crate::{
    geom::Vec3,
    mesh::{FaceId, TriMesh},
    model::StripeLine,
};

/// The lines with the pieces of which they are; `face` finds the face of the given mesh. An open line starts at its end nearer to one
/// of the points `starts`, a closed one at its point nearest to one of them.
pub(super) fn stripe_lines(
    mesh: &TriMesh,
    lines: &[Isoline],
    face: &dyn Fn(FaceId) -> FaceId,
    starts: &[Vec3],
) -> Vec<StripeLine> {
    let line = |it: &Isoline| {
        let line = StripeLine {
            points: it.points.iter().map(|it| it.place).collect(),
            closed: it.closed,
            inner_ends: it.inner_ends,
            pieces: it.pieces().map(|(f, ends)| (face(f), ends.map(|p| barycentric(mesh, face(f), p)))).collect(),
        };
        started(line, starts)
    };
    lines.iter().map(line).collect()
}

/// The line from where it is to start on.
fn started(mut line: StripeLine, starts: &[Vec3]) -> StripeLine {
    let miss = |p: Vec3| starts.iter().map(|s| (p - s).norm()).fold(f64::INFINITY, f64::min);
    if starts.is_empty() || line.points.len() < 2 {
        return line;
    }
    if !line.closed {
        if miss(line.points[line.points.len() - 1]) < miss(line.points[0]) {
            line.points.reverse();
            line.pieces.reverse();
            line.pieces.iter_mut().for_each(|it| it.1.reverse());
        }
        return line;
    }
    let n = line.points.len();
    let nearest = |i: usize, start: &Vec3| {
        let (a, b) = (line.points[i], line.points[(i + 1) % n]);
        let along = b - a;
        let length = along.norm_squared();
        let t = if length > 0.0 { ((start - a).dot(&along) / length).clamp(0.0, 1.0) } else { 0.0 };
        ((a + along * t - start).norm(), i, t)
    };
    let places = starts.iter().flat_map(|start| (0..n).map(move |i| (i, start))).map(|(i, start)| nearest(i, start));
    let Some((_, at, t)) = places.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1))) else { return line };
    line.points.rotate_left(at);
    line.pieces.rotate_left(at);
    if t > 0.0 {
        // The piece in which it starts is divided: its first half comes last.
        let (a, b) = (line.points[0], line.points[1 % n]);
        let (face, [from, to]) = line.pieces[0];
        let middle: [f64; 3] = std::array::from_fn(|k| from[k] + t * (to[k] - from[k]));
        line.pieces[0] = (face, [middle, to]);
        line.pieces.push((face, [from, middle]));
        line.points[0] = a;
        line.points.insert(1, a + (b - a) * t);
        line.points.rotate_left(1);
    }
    line
}

/// Barycentric coordinates of a point of a face.
fn barycentric(mesh: &TriMesh, f: FaceId, p: Vec3) -> [f64; 3] {
    let [a, b, c] = mesh.face_positions(f);
    let normal = (b - a).cross(&(c - a));
    let share = |x: Vec3, y: Vec3| normal.dot(&(x - p).cross(&(y - p))) / normal.norm_squared();
    [share(b, c), share(c, a), share(a, b)]
}
