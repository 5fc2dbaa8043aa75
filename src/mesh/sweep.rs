//! What a moving cutter takes from a body, by samples of its surface.
//!
//! | symbol | meaning |
//! | --- | --- |
//! | h | height of a sample over the tip, along the axis |
//! | ρ | its distance from the axis |
//! | γ | half angle of a conical cutter, 0 for a cylinder |
//!
//! The flank is the surface ρ = r + h tan γ, so a sample outside it has the clearance (ρ − r) cos γ − h sin γ; one inside
//! the cutter has a negative clearance, which is also at least −h, its distance from the flat end.
use super::{FaceId, TriMesh};
use crate::geom::{Box3, Vec3};

/// A cutter with its holder; lengths in mm from the tip.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tool {
    /// Radius at the tip.
    pub radius: f64,
    /// Half angle γ of the cone, radians.
    pub taper: f64,
    /// Length of the cutting edges.
    pub flute: f64,
    /// Radius of the shank above them.
    pub shank: f64,
    /// Where the holder begins.
    pub reach: f64,
    /// Radius of the holder.
    pub holder: f64,
    /// Length of the holder, with the spindle nose as far as it is as wide.
    pub holder_length: f64,
}

impl Tool {
    /// A straight wire of a radius and length: all of it cuts.
    pub fn wire(radius: f64, length: f64) -> Self {
        Self { radius, taper: 0.0, flute: length, shank: radius, reach: length, holder: radius, holder_length: 0.0 }
    }

    /// Radius of the flank at a height.
    pub fn radius_at(&self, height: f64) -> f64 {
        self.radius + height * self.taper.tan()
    }

    /// Largest radius of the cutting part.
    pub fn widest(&self) -> f64 {
        self.radius.max(self.radius_at(self.flute))
    }

    /// Height and distance from the axis of a point.
    fn polar(&self, pose: &Pose, p: &Vec3) -> (f64, f64) {
        let d = p - pose.tip;
        let h = d.dot(&pose.axis);
        (h, (d - pose.axis * h).norm())
    }

    /// Clearance of a point over the flank, where it stands beside it.
    pub fn flank(&self, pose: &Pose, p: &Vec3) -> Option<f64> {
        let (h, rho) = self.polar(pose, p);
        let (sin, cos) = self.taper.sin_cos();
        (0.0..=self.flute).contains(&h).then_some((rho - self.radius) * cos - h * sin)
    }

    /// How deep a point lies inside the cutting part, or inside the shank and holder; 0 for both outside.
    pub fn depths(&self, pose: &Pose, p: &Vec3) -> (f64, f64) {
        let (h, rho) = self.polar(pose, p);
        let (sin, cos) = self.taper.sin_cos();
        if h < 0.0 || h > self.reach + self.holder_length {
            return (0.0, 0.0);
        }
        if h <= self.flute {
            return (h.min(h * sin - (rho - self.radius) * cos).max(0.0), 0.0);
        }
        let shank = if h <= self.reach { self.shank - rho } else { 0.0 };
        let holder = if h >= self.reach { (self.holder - rho).min(h - self.reach) } else { 0.0 };
        (0.0, shank.max(holder).max(0.0))
    }
}

/// Where a cutter is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// Middle of its flat end.
    pub tip: Vec3,
    /// Unit vector from the tip to the shank.
    pub axis: Vec3,
}

impl Pose {
    /// The point of the axis at a height.
    pub fn at(&self, height: f64) -> Vec3 {
        self.tip + self.axis * height
    }
}

/// Points of a surface in the cells of a lattice.
#[derive(Debug, Clone)]
pub struct Samples {
    /// The points.
    pub points: Vec<Vec3>,
    /// The face of each.
    pub faces: Vec<FaceId>,
    cell: f64,
    low: Vec3,
    size: [usize; 3],
    /// First entry of `order` of every cell, and the end of the last.
    first: Vec<u32>,
    order: Vec<u32>,
}

/// Cells along the diagonal of the body.
const CELLS: f64 = 70.0;

impl Samples {
    /// Points of the faces that `spacing` gives a distance for, at most so far apart, those on its edges included.
    pub fn new(mesh: &TriMesh, spacing: impl Fn(FaceId) -> Option<f64>) -> Self {
        let (points, faces) = Self::spread(mesh, spacing);
        Self::of_points(points, faces)
    }

    /// The points of [`Samples::new`] with the face of each.
    pub fn spread(mesh: &TriMesh, spacing: impl Fn(FaceId) -> Option<f64>) -> (Vec<Vec3>, Vec<FaceId>) {
        let (mut points, mut faces) = (Vec::new(), Vec::new());
        for f in mesh.faces() {
            let Some(spacing) = spacing(f) else { continue };
            let corners = mesh.face_positions(f);
            let side = |k: usize| (corners[(k + 1) % 3] - corners[k]).norm();
            let base = (0..3).max_by(|&a, &b| side(a).total_cmp(&side(b))).expect("a triangle has three sides");
            let [a, b, c] = [0, 1, 2].map(|k| corners[(base + k) % 3]);
            let height = 2.0 * mesh.area(f) / side(base).max(f64::MIN_POSITIVE);
            let rows = (height / spacing).ceil().max(1.0) as usize;
            for row in 0..=rows {
                let s = row as f64 / rows as f64;
                let columns =
                    ((1.0 - s) * side(base) / spacing).ceil().max(if row < rows { 1.0 } else { 0.0 }) as usize;
                for column in 0..=columns {
                    let t = column as f64 / columns.max(1) as f64;
                    points.push((a + (b - a) * t) * (1.0 - s) + c * s);
                    faces.push(f);
                }
            }
        }
        (points, faces)
    }

    /// Given points, each with a face.
    pub fn of_points(points: Vec<Vec3>, faces: Vec<FaceId>) -> Self {
        let bounds =
            if points.is_empty() { Box3 { min: Vec3::zeros(), max: Vec3::zeros() } } else { Box3::of(&points) };
        let cell = (bounds.diagonal() / CELLS).max(1e-3);
        let size = [0, 1, 2].map(|k| (bounds.size()[k] / cell) as usize + 1);
        let mut out = Self { points, faces, cell, low: bounds.min, size, first: vec![], order: vec![] };
        let cells: Vec<usize> = out.points.iter().map(|p| out.index(out.place(p))).collect();
        let mut first = vec![0_u32; size.iter().product::<usize>() + 1];
        for &c in &cells {
            first[c + 1] += 1;
        }
        for c in 1..first.len() {
            first[c] += first[c - 1];
        }
        let mut next = first.clone();
        out.order = vec![0; cells.len()];
        for (i, &c) in cells.iter().enumerate() {
            out.order[next[c] as usize] = i as u32;
            next[c] += 1;
        }
        out.first = first;
        out
    }

    fn place(&self, p: &Vec3) -> [usize; 3] {
        [0, 1, 2].map(|k| (((p[k] - self.low[k]) / self.cell).max(0.0) as usize).min(self.size[k] - 1))
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    /// Calls `visit` with every sample that may be within `radius` of the segment from `a` to `b`, and some farther ones.
    pub fn near(&self, a: &Vec3, b: &Vec3, radius: f64, mut visit: impl FnMut(usize)) {
        let margin = Vec3::repeat(radius);
        let (low, high) = (a.inf(b) - margin, a.sup(b) + margin);
        let far = self.low + Vec3::from_fn(|k, _| self.size[k] as f64 * self.cell);
        if (0..3).any(|k| high[k] < self.low[k] || low[k] > far[k]) {
            return;
        }
        let (from, to) = (self.place(&low), self.place(&high));
        let limit = radius + 0.867 * self.cell;
        let edge = b - a;
        let longest = edge.iamax();
        // Layer by layer along the longest extent of the segment, so that only cells around it are looked at.
        for layer in from[longest]..=to[longest] {
            let (mut first, mut last) = (from, to);
            if edge[longest].abs() > radius {
                let bottom = self.low[longest] + layer as f64 * self.cell - radius - a[longest];
                let ends = [bottom, bottom + self.cell + 2.0 * radius].map(|it| (it / edge[longest]).clamp(0.0, 1.0));
                let (p, q) = (a + edge * ends[0], a + edge * ends[1]);
                (first, last) = (self.place(&(p.inf(&q) - margin)), self.place(&(p.sup(&q) + margin)));
            }
            (first[longest], last[longest]) = (layer, layer);
            for z in first[2]..=last[2] {
                for y in first[1]..=last[1] {
                    for x in first[0]..=last[0] {
                        let c = self.index([x, y, z]);
                        let (start, end) = (self.first[c] as usize, self.first[c + 1] as usize);
                        if start == end {
                            continue;
                        }
                        let middle = self.low + Vec3::new(x as f64 + 0.5, y as f64 + 0.5, z as f64 + 0.5) * self.cell;
                        if crate::geom::closest_on_segment(&(middle - a), &edge).1 <= limit * limit {
                            self.order[start..end].iter().for_each(|&i| visit(i as usize));
                        }
                    }
                }
            }
        }
    }
}

/// The deepest place of its kind.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Deepest {
    /// How deep, mm.
    pub depth: f64,
    /// Where.
    pub place: Vec3,
}

impl Deepest {
    /// Takes the other if it is deeper.
    pub fn meet(&mut self, depth: f64, place: Vec3) {
        if depth > self.depth {
            *self = Self { depth, place };
        }
    }
}

/// A cutter that moves past the samples of a body.
#[derive(Debug, Clone)]
pub struct Sweep<'a> {
    samples: &'a Samples,
    tool: Tool,
    /// Samples farther from the flank than this are not looked at.
    band: f64,
    /// Smallest clearance of every sample so far; what is inside the cutter is negative.
    pub clearance: Vec<f64>,
    /// Whether the line of contact has passed over the sample.
    pub passed: Vec<bool>,
    /// Deepest place inside the shank or the holder.
    pub collision: Deepest,
    scratch: Vec<u32>,
}

impl<'a> Sweep<'a> {
    /// Before the first move. Clearances beyond `band` are not told apart.
    pub fn new(samples: &'a Samples, tool: Tool, band: f64) -> Self {
        let n = samples.points.len();
        let (clearance, passed) = (vec![f64::INFINITY; n], vec![false; n]);
        Self { samples, tool, band, clearance, passed, collision: Deepest::default(), scratch: vec![] }
    }

    /// The cutter moves a little, from one pose to the next, in contact between two heights over the tip (none where the
    /// second is below the first) with the faces that `facing` gives a unit normal for. Returns the deepest sample that the
    /// cutting part is in at the second pose.
    pub fn step(
        &mut self,
        from: &Pose,
        to: &Pose,
        contact: [f64; 2],
        facing: &dyn Fn(FaceId) -> Option<Vec3>,
    ) -> Deepest {
        /// The contact is within 45° of the normal.
        const FACING: f64 = 0.7;
        let tool = self.tool;
        let mut cut = Deepest::default();
        let mut near = std::mem::take(&mut self.scratch);
        near.clear();
        self.samples.near(&to.tip, &to.at(tool.flute), tool.widest() + self.band, |i| near.push(i as u32));
        let (sin, cos) = tool.taper.sin_cos();
        for &i in &near {
            let i = i as usize;
            let p = &self.samples.points[i];
            let (height, rho) = tool.polar(to, p);
            if !(0.0..=tool.flute).contains(&height) {
                continue;
            }
            let clearance = (rho - tool.radius) * cos - height * sin;
            if clearance > self.band {
                continue;
            }
            // Near the flat end the way out is down.
            let depth = height.min(-clearance);
            cut.meet(depth, *p);
            self.clearance[i] = self.clearance[i].min(if depth > 0.0 { -depth } else { clearance.max(0.0) });
            if self.passed[i] || height < contact[0] || contact[1] < height {
                continue;
            }
            let Some(normal) = facing(self.samples.faces[i]) else { continue };
            let from_axis = p - to.at(height);
            if from_axis.dot(&normal) > -FACING * from_axis.norm() {
                continue;
            }
            // The line of contact is within a step and a half of the sample.
            let travel = to.at(height) - from.at(height);
            let travel = travel - to.axis * travel.dot(&to.axis);
            self.passed[i] = (p - to.tip).dot(&travel).abs() <= 1.5 * travel.norm_squared();
        }
        self.scratch = near;
        let wide = tool.shank.max(tool.holder);
        let (low, high) = (to.at(tool.flute), to.at(tool.reach + tool.holder_length));
        let samples = self.samples;
        samples.near(&low, &high, wide, |i| {
            let p = &samples.points[i];
            self.collision.meet(tool.depths(to, p).1, *p);
        });
        cut
    }

    /// The deepest sample inside the cutting part.
    pub fn gouge(&self) -> Deepest {
        let mut out = Deepest::default();
        for (p, &it) in self.samples.points.iter().zip(&self.clearance) {
            out.meet(-it, *p);
        }
        out
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::shapes;

    const TOOL: Tool =
        Tool { radius: 3.0, taper: 0.0, flute: 20.0, shank: 2.5, reach: 30.0, holder: 10.0, holder_length: 20.0 };

    #[test]
    fn a_cutter_beside_a_plate_takes_what_it_should() {
        // A plate 40 mm square at z = 0; the cutter lies along x, over y from 5 to 30.
        let plate = shapes::grid(20, 20, 2.0);
        let samples = Samples::new(&plate, |_| Some(0.5));
        let at = |y: f64, z: f64| Pose { tip: Vec3::new(10.0, y, z), axis: Vec3::x() };
        for (height, gouge, excess) in [(3.0, 0.0, 0.0), (2.9, 0.1, 0.0), (3.2, 0.0, 0.2)] {
            let mut sweep = Sweep::new(&samples, Tool { holder: 2.5, ..TOOL }, 1.0);
            let poses: Vec<Pose> = (0..=250).map(|k| at(5.0 + 0.1 * k as f64, height)).collect();
            for w in poses.windows(2) {
                sweep.step(&w[0], &w[1], [0.0, 20.0], &|_| Some(Vec3::z()));
            }
            assert!((sweep.gouge().depth - gouge).abs() < 1e-9, "{height}: {:?}", sweep.gouge());
            let passed = sweep.clearance.iter().zip(&sweep.passed).filter(|it| *it.1);
            let left = passed.map(|it| *it.0).fold(0.0, f64::max);
            assert!((left - excess).abs() < 2e-3, "{height}: {left}");
            // What the line of contact passed is a rectangle of 20 by 25 mm.
            let passed: Vec<&Vec3> =
                samples.points.iter().zip(&sweep.passed).filter(|it| *it.1).map(|it| it.0).collect();
            let bounds = Box3::of(passed.iter().copied());
            assert!((bounds.size() - Vec3::new(20.0, 25.0, 0.0)).norm() < 0.51, "{bounds:?}");
        }
        // The holder is wider than the cutter and reaches into the plate.
        let mut sweep = Sweep::new(&samples, TOOL, 1.0);
        let pose = Pose { tip: Vec3::new(-12.0, 20.0, 3.0), axis: Vec3::x() };
        sweep.step(&pose, &pose, [0.0, 20.0], &|_| None);
        assert!((sweep.collision.depth - 7.0).abs() < 1e-9, "{:?}", sweep.collision);
        assert_eq!(sweep.gouge().depth, 0.0);
    }

    #[test]
    fn a_cone_touches_along_its_flank() {
        let tool = Tool { taper: 0.1, shank: 4.5, ..TOOL };
        let pose = Pose { tip: Vec3::zeros(), axis: Vec3::z() };
        for h in [0.0, 7.0, 20.0] {
            let on = Vec3::new(3.0 + h * 0.1_f64.tan(), 0.0, h);
            assert!(tool.flank(&pose, &on).unwrap().abs() < 1e-12);
            let inside = on - Vec3::new(0.1_f64.cos(), 0.0, -0.1_f64.sin()) * 0.2;
            if h == 7.0 {
                assert!((tool.depths(&pose, &inside).0 - 0.2).abs() < 1e-12);
            }
        }
        assert_eq!(tool.flank(&pose, &Vec3::new(1.0, 0.0, -0.1)), None);
        // Near the flat end the way out is down.
        assert!((tool.depths(&pose, &Vec3::new(0.5, 0.0, 0.05)).0 - 0.05).abs() < 1e-12);
    }
}
