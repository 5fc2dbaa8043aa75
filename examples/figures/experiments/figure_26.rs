//! Four surfaces, the last one only nearly developable, each meshed along its rulings, at a slant to them, irregularly, and
//! with half as many vertices at one end of the rulings as at the other.
use super::{
    FREE, Figure, Report, descend, energy,
    measures::{crease, creases, flat_share, hinge_share, inner, quantile, total},
};
use fabricate::{
    geom::{Vec2, Vec3, angle_between},
    mesh::{HalfedgeId, TriMesh, distance::SurfaceDistance},
    numeric::random::Random,
};

pub(super) const FIGURE: Figure = Figure {
    number: 26,
    claim: "how a nearly developable surface is meshed hardly matters for its shape, but decides where the rulings run",
    run,
};

/// A smooth surface over the unit square, ruled along t.
struct Surface {
    name: &'static str,
    point: fn(f64, f64) -> Vec3,
}

const SURFACES: [Surface; 4] = [
    Surface { name: "cylinder", point: |s, t| round(1.0, 2.4 * (s - 0.5), 1.6 * t) },
    Surface { name: "cone", point: |s, t| round(0.5 + t, 2.6 * (s - 0.5), 1.2 * t) },
    Surface {
        name: "tangent developable",
        point: |s, t| {
            let angle = 2.2 * s;
            let (on_helix, tangent) = (round(1.0, angle, 0.5 * angle), Vec3::new(angle.cos(), 0.5, -angle.sin()));
            on_helix + (0.6 + t) * tangent.normalize()
        },
    },
    Surface { name: "barrel", point: |s, t| round(1.06 - 0.06 * (2.0 * t - 1.0).powi(2), 2.4 * (s - 0.5), 1.6 * t) },
];

/// A point at some angle around the y axis.
fn round(radius: f64, angle: f64, y: f64) -> Vec3 {
    Vec3::new(radius * angle.sin(), y, radius * angle.cos())
}

const COLUMNS: usize = 24;
const ROWS: usize = 14;

fn run(report: &mut Report) {
    for surface in &SURFACES {
        for (meshing, parameters) in
            [("along", along()), ("slanted", slanted()), ("irregular", irregular()), ("uneven", uneven())]
        {
            let point = |p: &Vec2| (surface.point)(p.x, p.y);
            let start =
                TriMesh::new(parameters.0.iter().map(point).collect(), &parameters.1).expect("patches are meshes");
            let (mesh, _) = descend(&start, energy("covariance"), FREE, 300);
            let what = format!("{} {meshing}", surface.name);
            report.show(&what.replace(' ', "-"), &mesh);
            let [before, after] = [&start, &mesh].map(|it| total(it, energy("covariance")));
            let (distance, diagonal) = (SurfaceDistance::between(&start, &mesh), start.bounds().diagonal());
            let astray = quantile(&angles_to_rulings(surface, &mesh), 0.5);
            report.note(format!(
                "{what}: energy {before:.1e} to {after:.1e}, distance at most {:.2} %, flat vertices {:.2}, from the smooth rulings {astray:.1}°",
                100.0 * distance.hausdorff / diagonal,
                flat_share(&mesh, 1.0),
            ));
            report.at_most(
                &format!("{what}: mean distance from the start, percent"),
                100.0 * distance.mean / diagonal,
                2.0,
            );
            report.at_least(&format!("{what}: share of hinges"), hinge_share(&mesh, 2.0), 0.9);
            let developable = surface.name != "barrel";
            match meshing {
                "along" if developable => {
                    report.at_most(&format!("{what}: energy, as it is developable already"), before, 1e-6);
                    report.at_most(
                        &format!("{what}: distance moved, percent"),
                        100.0 * distance.hausdorff / diagonal,
                        0.01,
                    );
                    report.at_most(&format!("{what}: from the smooth rulings, degrees"), astray, 0.1);
                }
                _ => report.at_most(&format!("{what}: energy over that before"), after / before, 0.1),
            }
            // Those of the tangent developable turn too fast for so few steps.
            if meshing == "slanted" && surface.name != "tangent developable" {
                report.at_least(&format!("{what}: follows the mesh, from the smooth rulings, degrees"), astray, 5.0);
            }
            if meshing == "uneven" {
                let ends = ruled_ends(&mesh) as f64 / (2 * COARSE - 1) as f64;
                report.at_most(&format!("{what}: share of the vertices at the finer end with a ruling"), ends, 0.75);
            }
        }
    }
}

/// Angles between the sharpest edge of every vertex that is bent and the ruling of the smooth surface, degrees.
fn angles_to_rulings(surface: &Surface, mesh: &TriMesh) -> Vec<f64> {
    /// Below this there is no ruling, degrees.
    const BENT: f64 = 2.0;
    let sharpness = |h: &HalfedgeId| crease(mesh, *h).unwrap_or(0.0);
    let mut out = Vec::new();
    for v in inner(mesh).filter(|&v| creases(mesh, v)[1] > BENT) {
        let Some(h) = mesh.outgoing(v).max_by(|a, b| sharpness(a).total_cmp(&sharpness(b))) else { continue };
        let [s, t] = nearest(surface, mesh.position(v));
        let ruling = (surface.point)(s, t + 0.01) - (surface.point)(s, t - 0.01);
        let angle = angle_between(mesh.vector(h), ruling).to_degrees();
        out.push(angle.min(180.0 - angle));
    }
    out
}

/// Parameters of the point of a surface that is nearest to `p`, by search.
fn nearest(surface: &Surface, p: Vec3) -> [f64; 2] {
    let distance = |it: [f64; 2]| ((surface.point)(it[0], it[1]) - p).norm();
    let (mut at, mut step) = ([0.5; 2], 0.25);
    while step > 1e-4 {
        let around = [[step, 0.0], [-step, 0.0], [0.0, step], [0.0, -step]].map(|d| [at[0] + d[0], at[1] + d[1]]);
        let best = around.into_iter().fold(at, |best, it| if distance(it) < distance(best) { it } else { best });
        if best == at {
            step /= 2.0;
        }
        at = best;
    }
    at
}

/// Vertices of the last row, its two ends excepted, at which an inner edge bends by more than 1°. The last row of
/// [`uneven`] holds the last vertices.
fn ruled_ends(mesh: &TriMesh) -> usize {
    let row = mesh.vertices().skip(mesh.vertex_count() - 2 * COARSE).take(2 * COARSE - 1);
    row.filter(|&v| creases(mesh, v).first().is_some_and(|&sharpest| sharpest > 1.0)).count()
}

/// Points in the unit square and faces.
type Patch = (Vec<Vec2>, Vec<[u32; 3]>);

/// A lattice whose points are moved by `warp`, which gets its place in the unit square, and split by one diagonal or, where
/// `other` says so, the other.
fn lattice(mut warp: impl FnMut(Vec2) -> Vec2, mut other: impl FnMut() -> bool) -> Patch {
    let place = |i: usize, j: usize| Vec2::new(i as f64 / COLUMNS as f64, j as f64 / ROWS as f64);
    let points = (0..=ROWS).flat_map(|j| (0..=COLUMNS).map(move |i| place(i, j))).map(&mut warp).collect();
    let id = |i: usize, j: usize| (j * (COLUMNS + 1) + i) as u32;
    let mut faces = Vec::new();
    for (i, j) in (0..COLUMNS * ROWS).map(|k| (k % COLUMNS, k / COLUMNS)) {
        let [a, b, c, d] = [id(i, j), id(i + 1, j), id(i + 1, j + 1), id(i, j + 1)];
        faces.extend(if other() { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] });
    }
    (points, faces)
}

fn along() -> Patch {
    lattice(|p| p, || false)
}

fn slanted() -> Patch {
    lattice(|p| Vec2::new(p.x + 0.7 * (p.y - 0.5) * p.x * (1.0 - p.x), p.y), || false)
}

fn irregular() -> Patch {
    let (mut shift, mut coin) = (Random::new(26), Random::new(27));
    let inside = |x: f64| if x == 0.0 || x == 1.0 { 0.0 } else { 1.0 };
    let mut jitter = |x: f64, n: usize| x + inside(x) * 0.7 * (shift.unit() - 0.5) / n as f64;
    lattice(|p| Vec2::new(jitter(p.x, COLUMNS), jitter(p.y, ROWS)), || coin.unit() < 0.5)
}

/// Edges at the coarse end.
const COARSE: usize = 12;

/// Every row has one edge more than that before.
fn uneven() -> Patch {
    let rows: Vec<usize> = (COARSE..=2 * COARSE).collect();
    let (mut points, mut faces, mut first) = (Vec::new(), Vec::new(), Vec::new());
    for (j, &n) in rows.iter().enumerate() {
        first.push(points.len());
        points.extend((0..=n).map(|i| Vec2::new(i as f64 / n as f64, j as f64 / COARSE as f64)));
    }
    for j in 0..COARSE {
        let (n, m) = (rows[j], rows[j + 1]);
        let (mut a, mut b) = (0, 0);
        while a < n || b < m {
            let (p, q) = ((first[j] + a) as u32, (first[j + 1] + b) as u32);
            // The end that lags behind goes on.
            if a == n || (b < m && (b + 1) * n <= (a + 1) * m) {
                faces.push([p, q + 1, q]);
                b += 1;
            } else {
                faces.push([p, p + 1, q]);
                a += 1;
            }
        }
    }
    (points, faces)
}
