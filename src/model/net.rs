//! Quad nets whose one family of lines is meant to be geodesics.
use super::Part;
use crate::{
    geom::{Vec3, polyline::subdivided},
    mesh::{MeshError, TriMesh},
};

/// A net of quads: `rows` points along each of `columns` lines. Line j runs through the points (0, j), (1, j), … and is a
/// geodesic once the net has been optimised (a u-line of Wang, Pellis, Rist, Pottmann, Müller 2019); the points (i, 0), (i, 1), …
/// are a line across. There are at least 2 rows and 2 columns, and every point is finite.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GeodesicNet {
    /// Points along a geodesic.
    pub rows: usize,
    /// Number of geodesics.
    pub columns: usize,
    /// The points, mm; (i, j) at i `columns` + j.
    pub points: Vec<Vec3>,
}

/// What surrounds a point of a net.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Unit tangent of the geodesic.
    pub along: Vec3,
    /// Unit tangent of the line across.
    pub across: Vec3,
    /// Unit normal, along × across.
    pub normal: Vec3,
}

impl GeodesicNet {
    /// The net through `place(i, j)`.
    pub fn from_fn(rows: usize, columns: usize, place: impl Fn(usize, usize) -> Vec3) -> Self {
        Self { rows, columns, points: (0..rows * columns).map(|k| place(k / columns, k % columns)).collect() }
    }

    /// Number of a point.
    pub fn index(&self, i: usize, j: usize) -> usize {
        i * self.columns + j
    }

    /// A point.
    pub fn at(&self, i: usize, j: usize) -> Vec3 {
        self.points[self.index(i, j)]
    }

    /// Length from (i, j) to (i + 1, j).
    pub fn along(&self, i: usize, j: usize) -> f64 {
        (self.at(i + 1, j) - self.at(i, j)).norm()
    }

    /// Length from (i, j) to (i, j + 1).
    pub fn across(&self, i: usize, j: usize) -> f64 {
        (self.at(i, j + 1) - self.at(i, j)).norm()
    }

    /// Mean length of all edges.
    pub fn mean_edge(&self) -> f64 {
        let (m, n) = (self.rows, self.columns);
        let along: f64 = (0..(m - 1) * n).map(|k| self.along(k / n, k % n)).sum();
        let across: f64 = (0..m * (n - 1)).map(|k| self.across(k / (n - 1), k % (n - 1))).sum();
        (along + across) / ((m - 1) * n + m * (n - 1)) as f64
    }

    /// Tangents by §2.2.1 of the paper, one-sided at the boundary: the normalised difference of the unit vectors to both
    /// neighbours. `None` where neighbours coincide.
    pub fn frame(&self, i: usize, j: usize) -> Option<Frame> {
        let unit = |from: Vec3, to: Vec3| (to - from).try_normalize(f64::MIN_POSITIVE);
        let here = self.at(i, j);
        let tangent = |before: Option<Vec3>, after: Option<Vec3>| {
            let back = before.and_then(|it| unit(it, here)).unwrap_or_default();
            let forth = after.and_then(|it| unit(here, it)).unwrap_or_default();
            (back + forth).try_normalize(f64::MIN_POSITIVE)
        };
        let along = tangent(i.checked_sub(1).map(|it| self.at(it, j)), (i + 1 < self.rows).then(|| self.at(i + 1, j)))?;
        let across =
            tangent(j.checked_sub(1).map(|it| self.at(i, it)), (j + 1 < self.columns).then(|| self.at(i, j + 1)))?;
        let normal = along.cross(&across).try_normalize(f64::MIN_POSITIVE)?;
        Some(Frame { along, across, normal })
    }

    /// Angle defect over a quarter of the area around, an estimate of the Gaussian curvature, 1/mm²; `None` on the boundary.
    pub fn gaussian_curvature(&self, i: usize, j: usize) -> Option<f64> {
        if i == 0 || j == 0 || i + 1 >= self.rows || j + 1 >= self.columns {
            return None;
        }
        let here = self.at(i, j);
        let ring = [
            self.at(i + 1, j),
            self.at(i + 1, j + 1),
            self.at(i, j + 1),
            self.at(i - 1, j + 1),
            self.at(i - 1, j),
            self.at(i - 1, j - 1),
            self.at(i, j - 1),
            self.at(i + 1, j - 1),
        ];
        let (mut angle, mut area) = (0.0, 0.0);
        for k in 0..8 {
            let (a, b) = (ring[k] - here, ring[(k + 1) % 8] - here);
            angle += crate::geom::angle_between(a, b);
            area += a.cross(&b).norm() / 2.0;
        }
        Some((std::f64::consts::TAU - angle) / (area / 4.0))
    }

    /// The net as triangles, both halves of a quad on the same side as `along × across`; vertex (i, j) keeps its number.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let mut out = Vec::with_capacity(2 * (self.rows - 1) * (self.columns - 1));
        for i in 0..self.rows - 1 {
            for j in 0..self.columns - 1 {
                let corner = |di, dj| self.index(i + di, j + dj) as u32;
                let [a, b, c, d] = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
                // The shorter diagonal keeps bent quads from folding.
                let at = |k: u32| self.points[k as usize];
                if (at(a) - at(c)).norm() <= (at(b) - at(d)).norm() {
                    out.extend([[a, b, c], [a, c, d]]);
                } else {
                    out.extend([[a, b, d], [b, c, d]]);
                }
            }
        }
        out
    }

    /// The same as a mesh.
    pub fn mesh(&self) -> Result<TriMesh, MeshError> {
        TriMesh::new(self.points.clone(), &self.triangles())
    }

    /// The net with a point between every two neighbours, on the cubic through four points of a line (on the parabola through
    /// three at its ends). Points of the net keep their place: (i, j) becomes (2 i, 2 j).
    pub fn subdivided(&self) -> Self {
        let (m, n) = (2 * self.rows - 1, 2 * self.columns - 1);
        let wide: Vec<Vec<Vec3>> = self.points.chunks(self.columns).map(subdivided).collect();
        let columns: Vec<Vec<Vec3>> =
            (0..n).map(|j| subdivided(&wide.iter().map(|row| row[j]).collect::<Vec<_>>())).collect();
        Self::from_fn(m, n, |i, j| columns[j][i])
    }
}

/// A net that was led to its constraints.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct NetFit {
    /// The net.
    pub net: GeodesicNet,
    /// R = √Σφ² of its constraints at mean edge 1, handles and fairness left out.
    pub residual: f64,
    /// Iterations made.
    pub iterations: usize,
    /// Time of the iterations, s (may differ between runs).
    pub seconds: f64,
    /// Handles that fight, with how far they are off, mm; the worst first.
    pub missed: Vec<(usize, f64)>,
    /// The net before it was bent.
    pub reference: Option<GeodesicNet>,
    /// Amount of strain |λ1| + |λ2| at every point against the reference; empty without one.
    pub strain: Vec<f64>,
    /// A second net on the same surface, whose geodesics cross those of the first.
    pub second: Option<GeodesicNet>,
    /// Laths along the geodesics of both.
    pub laths: Vec<Lath>,
    /// The laths as they lie flat.
    pub drawings: Vec<Part>,
}

/// A lath of a gridshell.
#[derive(Debug, Clone, PartialEq)]
pub struct Lath {
    /// Name, unique in the job.
    pub name: String,
    /// Length, mm.
    pub length: f64,
    /// Where it crosses others, from its beginning on.
    pub crossings: Vec<LathCrossing>,
    /// The bar that it is cut from, from 0, and where it begins there, mm; `None` where it is longer than a bar.
    pub bar: Option<(usize, f64)>,
}

/// A crossing of two laths.
#[derive(Debug, Clone, PartialEq)]
pub struct LathCrossing {
    /// Name of the other lath.
    pub other: String,
    /// Distance from the beginning along this one, mm.
    pub at: f64,
    /// How far both lines pass each other, mm.
    pub gap: f64,
}
