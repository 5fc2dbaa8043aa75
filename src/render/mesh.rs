//! A picture of a mesh: perspective, z-buffer, one shade per face, edges as dark as they are bent (after figures 14 and 26
//! of Stein, Grinspun and Crane, "Developability of Triangle Meshes", 2018: what is flat across an edge shows no line, so
//! the strips of a developable surface stand out).
use super::{
    LARGEST, RenderError, Rgb,
    color::{decode, encode},
    png,
};
use crate::{
    geom::{Vec2, Vec3, cross2},
    mesh::{EdgeId, FaceId, Field, TriMesh, VertexId},
};

/// Which way is up in the model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Up {
    /// Most models.
    #[default]
    Y,
    /// Printing and CAD.
    Z,
}

/// Which edges to draw. Boundary edges are always drawn, dark.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Edges {
    /// Only the boundary.
    Boundary,
    /// As dark as the angle between the faces, full from this angle (radians) on.
    ByAngle(f64),
    /// All alike, thin and light.
    All,
}

/// A line on the surface; of a single point it is a dot.
#[derive(Debug, Clone, PartialEq)]
pub struct Stroke {
    /// Its points, mm.
    pub points: Vec<Vec3>,
    /// Whether the last joins the first.
    pub closed: bool,
    /// Colour, in any light.
    pub color: Rgb,
    /// Pixels.
    pub width: f64,
}

/// How to draw a mesh.
#[derive(Clone, Copy)]
pub struct MeshStyle<'a> {
    /// Pixels.
    pub width: u32,
    /// Pixels.
    pub height: u32,
    /// Colour of a face.
    pub face: &'a (dyn Fn(FaceId) -> Rgb + Sync),
    /// Edges.
    pub edges: Edges,
    /// Lines on the surface, later ones over earlier ones.
    pub strokes: &'a [Stroke],
    /// Up axis of the model.
    pub up: Up,
    /// Where the camera stands around the up axis, radians; 0 looks at the model from its front (+z, with y up).
    pub azimuth: f64,
    /// How far above the horizon it stands, radians.
    pub elevation: f64,
}

impl Default for MeshStyle<'_> {
    /// A three-quarter view from slightly above, in one warm grey.
    fn default() -> Self {
        Self {
            width: 1000,
            height: 1000,
            face: &|_| [0xee, 0xe9, 0xe0],
            edges: Edges::ByAngle(0.35),
            strokes: &[],
            up: Up::Y,
            azimuth: 0.6,
            elevation: 0.3,
        }
    }
}

/// Samples per pixel and axis.
const SAMPLES: u32 = 3;
/// Half the angle of view, radians: a long lens, so that proportions stay true.
const HALF_VIEW: f64 = 0.2;
/// Free space around the model, as a share of the picture.
const BORDER: f64 = 0.06;
/// An edge is seen if it lies behind the surface by less than this share of the model's radius.
const EDGE_BIAS: f64 = 0.006;
const INK: Rgb = [0x26, 0x2b, 0x33];
/// Background, top and bottom.
const SKY: [Rgb; 2] = [[0xfb, 0xfc, 0xfd], [0xe6, 0xea, 0xef]];

/// A PNG of a mesh.
pub fn mesh(mesh: &TriMesh, style: &MeshStyle<'_>) -> Result<Vec<u8>, RenderError> {
    png(style.width, style.height, &scene(mesh, style, &[])?.pixels)
}

/// A picture of a mesh, and what is to be seen in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Row by row from the top.
    pub pixels: Vec<Rgb>,
    /// Of the points asked for: pixels from the upper left corner, `None` where the surface hides them.
    pub places: Vec<Option<Vec2>>,
}

/// How much of each face is seen, in samples.
pub fn seen(mesh: &TriMesh, style: &MeshStyle<'_>) -> Result<Field<FaceId, u32>, RenderError> {
    let canvas = surface(mesh, &View::new(mesh, style), style)?;
    let mut seen = Field::filled(mesh.face_count(), 0);
    canvas.face.iter().filter(|&&it| it > 0).for_each(|&it| seen[FaceId(it - 1)] += 1);
    Ok(seen)
}

/// The faces, without lines.
fn surface(mesh: &TriMesh, view: &View, style: &MeshStyle<'_>) -> Result<Canvas, RenderError> {
    let (width, height) = (style.width, style.height);
    if width == 0 || height == 0 || width > LARGEST || height > LARGEST {
        return Err(RenderError::Size { width, height });
    }
    let mut canvas = Canvas::new(width * SAMPLES, height * SAMPLES);
    for face in mesh.faces() {
        canvas.triangle(mesh.face_vertices(face).map(|v| view.points[v]), face.0 + 1);
    }
    Ok(canvas)
}

/// Draws a mesh and looks where points in space come to lie.
pub fn scene(mesh: &TriMesh, style: &MeshStyle<'_>, points: &[Vec3]) -> Result<Scene, RenderError> {
    let view = View::new(mesh, style);
    let mut canvas = surface(mesh, &view, style)?;
    let mut lights = vec![[0.0; 3]];
    lights.extend(mesh.faces().map(|face| {
        let corners = mesh.face_vertices(face).map(|v| view.points[v]);
        shade((style.face)(face), view.rotation * mesh.normal(face), corners)
    }));
    let pixel = f64::from(SAMPLES);
    for edge in mesh.edges() {
        let (ink, width) = line(mesh, edge, style.edges);
        if ink > 0.02 {
            let [a, b] = mesh.edge_vertices(edge).map(|v| view.points[v]);
            canvas.line([a, b], 0.5 * width * pixel, view.bias, |canvas, sample| {
                canvas.ink[sample] = canvas.ink[sample].max(ink as f32);
            });
        }
    }
    for stroke in style.strokes {
        let color = lights.len() as u32;
        lights.push(stroke.color.map(decode));
        let n = stroke.points.len();
        let ends = if stroke.closed || n == 1 { n } else { n.saturating_sub(1) };
        for i in 0..ends {
            let ends = [stroke.points[i], stroke.points[(i + 1) % n]].map(|p| view.place(&p));
            canvas.line(ends, 0.5 * stroke.width * pixel, view.bias, |canvas, sample| {
                (canvas.face[sample], canvas.ink[sample]) = (color, 0.0);
            });
        }
    }
    let place = |p: &Vec3| {
        let it = view.place(p);
        let (column, row) = (it.at.x as usize, it.at.y as usize);
        let inside = it.at.min() >= 0.0 && column < canvas.width && row < canvas.height;
        let depth = it.inverse_depth * (1.0 + view.bias);
        (inside && depth as f32 >= canvas.inverse_depth[row * canvas.width + column]).then_some(it.at / pixel)
    };
    let places = points.iter().map(place).collect();
    Ok(Scene { pixels: canvas.resolve(style.width, style.height, &lights), places })
}

/// Ink in [0, 1] and width in pixels of an edge.
fn line(mesh: &TriMesh, edge: EdgeId, edges: Edges) -> (f64, f64) {
    match (mesh.dihedral_cosine(edge), edges) {
        (None, _) => (0.9, 1.7),
        (Some(_), Edges::Boundary) => (0.0, 0.0),
        (Some(cosine), Edges::ByAngle(full)) => ((cosine.clamp(-1.0, 1.0).acos() / full).min(1.0) * 0.85, 1.3),
        (Some(_), Edges::All) => (0.35, 0.8),
    }
}

/// A vertex in the picture: sample coordinates and the reciprocal of its depth, which is linear there.
#[derive(Debug, Clone, Copy)]
struct Projected {
    at: Vec2,
    inverse_depth: f64,
}

struct View {
    points: Field<VertexId, Projected>,
    /// From the model to the camera's axes: x right, y up, z towards the viewer.
    rotation: nalgebra::Matrix3<f64>,
    /// Relative difference of inverse depth that hides no edge.
    bias: f64,
    center: Vec3,
    distance: f64,
    /// From the plane of projection to samples: what comes to lie in the middle of the picture, that place, and the scale.
    frame: (Vec2, Vec2, f64),
}

impl View {
    /// Turns the model, puts the camera at a distance that holds it, and fits what is seen into the picture.
    fn new(mesh: &TriMesh, style: &MeshStyle<'_>) -> Self {
        let upright = match style.up {
            Up::Y => nalgebra::Matrix3::identity(),
            Up::Z => nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, 0.0),
        };
        let turn = nalgebra::Rotation3::from_axis_angle(&Vec3::y_axis(), -style.azimuth);
        let tilt = nalgebra::Rotation3::from_axis_angle(&Vec3::x_axis(), style.elevation);
        let rotation = tilt.matrix() * turn.matrix() * upright;
        let bounds = mesh.bounds();
        let center = (bounds.min + bounds.max) / 2.0;
        let radius = mesh.positions().iter().map(|p| (p - center).norm()).fold(f64::MIN_POSITIVE, f64::max);
        let distance = radius / HALF_VIEW.sin();
        let bias = EDGE_BIAS * radius / distance;
        let frame = (Vec2::zeros(), Vec2::zeros(), 1.0);
        let mut view = Self { points: Field::from_vec(Vec::new()), rotation, bias, center, distance, frame };
        let seen: Vec<(Vec2, f64)> = mesh.positions().iter().map(|p| view.project(p)).collect();
        let frame = crate::geom::Box2::of(seen.iter().map(|it| &it.0));
        let samples = Vec2::new(f64::from(style.width), f64::from(style.height)) * f64::from(SAMPLES);
        let size = frame.size();
        let room = (1.0 - 2.0 * BORDER) * samples;
        let scale = (room.x / size.x.max(f64::MIN_POSITIVE)).min(room.y / size.y.max(f64::MIN_POSITIVE));
        let middle = (frame.min + frame.max) / 2.0;
        view.frame = (middle, samples / 2.0, scale);
        view.points = Field::from_vec(seen.into_iter().map(|it| view.framed(it)).collect());
        view
    }

    /// A point in the plane of projection, and the reciprocal of its depth.
    fn project(&self, p: &Vec3) -> (Vec2, f64) {
        let p = self.rotation * (p - self.center);
        let inverse_depth = 1.0 / (self.distance - p.z);
        (p.xy() * inverse_depth, inverse_depth)
    }

    fn framed(&self, (at, inverse_depth): (Vec2, f64)) -> Projected {
        let (middle, to, scale) = self.frame;
        let at = (at - middle) * scale;
        Projected { at: to + Vec2::new(at.x, -at.y), inverse_depth }
    }

    /// A point in the picture.
    fn place(&self, p: &Vec3) -> Projected {
        self.framed(self.project(p))
    }
}

/// Light of a face: a key light from the upper left, a weak one from the right, some from everywhere. The inner side of
/// an open surface is darker and greyer, so that holes read as holes.
fn shade(base: Rgb, normal: Vec3, corners: [Projected; 3]) -> [f64; 3] {
    let [a, b, c] = corners.map(|it| it.at);
    // Sample coordinates have y down, so a counter-clockwise face has a negative area there.
    let front = cross2(b - a, c - a) < 0.0;
    let normal = if front { normal } else { -normal };
    let key = normal.dot(&Vec3::new(-0.45, 0.65, 0.61)).max(0.0);
    let fill = normal.dot(&Vec3::new(0.8, 0.1, 0.59)).max(0.0);
    let light = 0.24 + 0.72 * key + 0.18 * fill;
    let base = base.map(decode);
    let grey = base.iter().sum::<f64>() / 3.0;
    base.map(|it| light * if front { it } else { 0.45 * it + 0.15 * grey })
}

struct Canvas {
    width: usize,
    height: usize,
    /// Reciprocal of the depth of the nearest surface; 0 where there is none.
    inverse_depth: Vec<f32>,
    /// What is nearest: 0 for nothing, else one more than the face, or beyond all faces a stroke.
    face: Vec<u32>,
    /// Share of ink.
    ink: Vec<f32>,
}

impl Canvas {
    fn new(width: u32, height: u32) -> Self {
        let (width, height) = (width as usize, height as usize);
        let count = width * height;
        Self { width, height, inverse_depth: vec![0.0; count], face: vec![0; count], ink: vec![0.0; count] }
    }

    /// Samples whose centres may lie in a box: columns, rows.
    fn samples(&self, low: Vec2, high: Vec2) -> (std::ops::Range<usize>, std::ops::Range<usize>) {
        let range = |low: f64, high: f64, count: usize| {
            let (low, high) = ((low - 0.5).ceil().max(0.0), (high - 0.5).floor());
            low as usize..(high + 1.0).clamp(0.0, count as f64) as usize
        };
        (range(low.x, high.x, self.width), range(low.y, high.y, self.height))
    }

    fn triangle(&mut self, corners: [Projected; 3], face: u32) {
        let [a, b, c] = corners.map(|it| it.at);
        let area = cross2(b - a, c - a);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let (columns, rows) = self.samples(a.inf(&b).inf(&c), a.sup(&b).sup(&c));
        let depths = corners.map(|it| it.inverse_depth);
        let sides = [(b, c), (c, a), (a, b)].map(|(from, to)| (from, (to - from) / area));
        for row in rows {
            let y = row as f64 + 0.5;
            // Along a row each barycentric coordinate is linear, so the samples inside are those between two columns.
            let lines = sides.map(|(from, side)| (side.x * (y - from.y) + side.y * from.x, -side.y));
            let (mut low, mut high) = (columns.start as f64, columns.end as f64);
            for (at_zero, slope) in lines {
                let root = -at_zero / slope - 0.5;
                match slope.total_cmp(&0.0) {
                    _ if slope == 0.0 => high = if at_zero < 0.0 { low } else { high },
                    std::cmp::Ordering::Greater => low = low.max(root.ceil()),
                    _ => high = high.min(root.floor() + 1.0),
                }
            }
            let depth_at_zero: f64 = (0..3).map(|i| lines[i].0 * depths[i]).sum();
            let depth_slope: f64 = (0..3).map(|i| lines[i].1 * depths[i]).sum();
            for column in low as usize..high.max(low) as usize {
                let depth = (depth_at_zero + depth_slope * (column as f64 + 0.5)) as f32;
                let sample = row * self.width + column;
                if depth > self.inverse_depth[sample] {
                    self.inverse_depth[sample] = depth;
                    self.face[sample] = face;
                }
            }
        }
    }

    /// Paints the samples of a round-ended line where it is not behind the surface by more than `bias`.
    fn line(&mut self, [a, b]: [Projected; 2], radius: f64, bias: f64, paint: impl Fn(&mut Self, usize)) {
        let along = b.at - a.at;
        let length = along.norm_squared();
        let reach = Vec2::repeat(radius);
        let (columns, rows) = self.samples(a.at.inf(&b.at) - reach, a.at.sup(&b.at) + reach);
        for row in rows {
            // The columns where the row crosses the strip about the line.
            let middle = a.at.x + (row as f64 + 0.5 - a.at.y) * along.x / along.y;
            let half = radius * (length.sqrt() / along.y).abs();
            let (low, high) = (middle - half - 1.0, middle + half + 1.0);
            // Without bounds where the line runs along the row, and they are infinite or no numbers.
            let low = if low > columns.start as f64 { low as usize } else { columns.start };
            let high = if high < columns.end as f64 { high.max(0.0) as usize } else { columns.end };
            for column in low..high {
                let at = Vec2::new(column as f64 + 0.5, row as f64 + 0.5);
                let t = if length > 0.0 { ((at - a.at).dot(&along) / length).clamp(0.0, 1.0) } else { 0.0 };
                if (at - a.at - t * along).norm_squared() > radius * radius {
                    continue;
                }
                let depth = (a.inverse_depth + t * (b.inverse_depth - a.inverse_depth)) * (1.0 + bias);
                let sample = row * self.width + column;
                if depth as f32 >= self.inverse_depth[sample] {
                    paint(self, sample);
                }
            }
        }
    }

    /// Averages the samples of each pixel in linear light; `lights[0]` is not read.
    fn resolve(&self, width: u32, height: u32, lights: &[[f64; 3]]) -> Vec<Rgb> {
        let ink = INK.map(decode);
        let [top, bottom] = SKY.map(|it| it.map(decode));
        let samples = SAMPLES as usize;
        let share = 1.0 / (samples * samples) as f64;
        let plain: Vec<Rgb> = lights.iter().map(|light| light.map(encode)).collect();
        let mut pixels = Vec::with_capacity((width * height) as usize);
        for row in 0..height as usize {
            let down = row as f64 / f64::from(height);
            let sky: [f64; 3] = std::array::from_fn(|i| top[i] + down * (bottom[i] - top[i]));
            let empty = sky.map(encode);
            for column in 0..width as usize {
                let block = (0..samples * samples)
                    .map(|i| (row * samples + i / samples) * self.width + column * samples + i % samples);
                let first = self.face[row * samples * self.width + column * samples];
                if block.clone().all(|it| self.face[it] == first && self.ink[it] == 0.0) {
                    pixels.push(if first == 0 { empty } else { plain[first as usize] });
                    continue;
                }
                let mut sum = [0.0; 3];
                for sample in block {
                    let ground = match self.face[sample] {
                        0 => &sky,
                        face => &lights[face as usize],
                    };
                    let share_of_ink = f64::from(self.ink[sample]);
                    for i in 0..3 {
                        sum[i] += ground[i] + share_of_ink * (ink[i] - ground[i]);
                    }
                }
                pixels.push(sum.map(|it| encode(it * share)));
            }
        }
        pixels
    }
}

#[cfg(test)]
mod tests {
    use resvg::tiny_skia::Pixmap;

    use super::*;
    use crate::mesh::shapes;

    fn picture(mesh_of: &TriMesh, style: &MeshStyle<'_>) -> Pixmap {
        Pixmap::decode_png(&mesh(mesh_of, style).unwrap()).unwrap()
    }

    fn rgb(picture: &Pixmap, x: u32, y: u32) -> Rgb {
        let pixel = picture.pixel(x, y).unwrap();
        [pixel.red(), pixel.green(), pixel.blue()]
    }

    #[test]
    fn a_sphere_is_round_lit_from_above_and_hides_its_back() {
        let sphere = shapes::icosphere(10.0, 4);
        let camera = MeshStyle { width: 200, height: 160, edges: Edges::Boundary, ..MeshStyle::default() };
        // What faces away from the viewer is red and must not show.
        let view = View::new(&sphere, &camera);
        let paint = |f: FaceId| if (view.rotation * sphere.normal(f)).z < -0.25 { [255, 0, 0] } else { [0, 160, 0] };
        let picture = picture(&sphere, &MeshStyle { face: &paint, ..camera });
        let covered = |x, y| {
            let [r, g, b] = rgb(&picture, x, y);
            g > r && g > b
        };
        assert_eq!(rgb(&picture, 0, 0), rgb(&picture, 199, 0), "background");
        assert!((0..200).all(|x| (0..160).all(|y| {
            let [r, g, _] = rgb(&picture, x, y);
            r <= g || r > 200
        })));
        // The disk fills the height less the border on both sides, and is as wide.
        let count = (0..200).flat_map(|x| (0..160).map(move |y| (x, y))).filter(|&(x, y)| covered(x, y)).count();
        let radius = 160.0 * (0.5 - BORDER);
        let expected = std::f64::consts::PI * radius * radius;
        assert!((count as f64 / expected - 1.0).abs() < 0.03, "{count} pixels for {expected:.0}");
        let bright = |x, y| rgb(&picture, x, y)[1];
        assert!(bright(80, 50) > bright(120, 120), "the key light comes from the upper left");
    }

    #[test]
    fn edges_show_by_their_angle() {
        let drawn = |divisions, edges| {
            let cube = shapes::cuboid(Vec3::new(10.0, 10.0, 10.0), divisions);
            picture(&cube, &MeshStyle { width: 120, height: 120, edges, ..MeshStyle::default() })
        };
        let changed = |a: &Pixmap, b: &Pixmap| {
            a.pixels().iter().zip(b.pixels()).filter(|(a, b)| a.red().abs_diff(b.red()) > 8).count()
        };
        let plain = drawn(4, Edges::Boundary);
        let bent = changed(&plain, &drawn(4, Edges::ByAngle(0.35)));
        // Nine edges of the cube are seen, each about 50 pixels long and two to three wide.
        assert!((300..1500).contains(&bent), "{bent}");
        // Those that divide its flat sides are not; where pieces of a line join, samples may round otherwise.
        assert!(changed(&drawn(4, Edges::ByAngle(0.35)), &drawn(1, Edges::ByAngle(0.35))) < 10);
        assert!(changed(&drawn(4, Edges::All), &drawn(1, Edges::All)) > bent, "unless all are asked for");
    }

    #[test]
    fn strokes_show_in_their_colour_where_the_surface_does_not_hide_them() {
        let sphere = shapes::icosphere(10.0, 4);
        let ring = |y: f64, color| Stroke {
            points: (0..60)
                .map(|k| f64::from(k) * std::f64::consts::TAU / 60.0)
                .map(|a| Vec3::new(10.0 * a.sin(), y, 10.0 * a.cos()))
                .collect(),
            closed: true,
            color,
            width: 3.0,
        };
        let dot = |z| Stroke { points: vec![Vec3::new(0.0, 0.0, z)], closed: false, color: [0, 0, 255], width: 9.0 };
        let strokes = [ring(0.0, [255, 0, 0]), dot(10.0), dot(-10.0)];
        let base = MeshStyle { width: 200, height: 200, edges: Edges::Boundary, ..MeshStyle::default() };
        let style = MeshStyle { strokes: &strokes, azimuth: 0.0, elevation: 0.0, ..base };
        let picture = picture(&sphere, &style);
        let count = |color: Rgb| {
            (0..200).flat_map(|x| (0..200).map(move |y| (x, y))).filter(|&(x, y)| rgb(&picture, x, y) == color).count()
        };
        // Seen edge on, the ring is a line as long as the disk is wide; of the two dots the far one is hidden.
        let width = 200.0 * (1.0 - 2.0 * BORDER);
        let (red, blue) = (count([255, 0, 0]) as f64, count([0, 0, 255]) as f64);
        assert!((red / (2.0 * width) - 1.0).abs() < 0.3, "{red}");
        let disk = std::f64::consts::PI * 4.5 * 4.5;
        assert!((0.6..1.1).contains(&(blue / disk)), "{blue}");
    }

    #[test]
    fn sizes_that_cannot_be_are_refused() {
        let cube = shapes::cuboid(Vec3::new(1.0, 1.0, 1.0), 1);
        for (width, height) in [(0, 10), (10, 0), (5000, 10)] {
            let style = MeshStyle { width, height, ..MeshStyle::default() };
            assert!(matches!(mesh(&cube, &style), Err(RenderError::Size { .. })));
        }
    }
}
