//! Parts made ready for the search: grown by half the gap, simplified outwards, turned, and filled with circles.
use crate::geom::{
    Box2, Vec2, boolean,
    polygon::{bounds_turned, contains, convex_hull, edges, turned},
    polyline::simplify,
    segment_tree::SegmentTree,
    signed_area,
};

/// Horizontal strips into which the edges of a shape are sorted.
const STRIPS: usize = 24;
/// Circles are placed on a grid of this many points along the longer side of a part's box.
const GRID: usize = 48;
/// No more circles than this, and none beyond this share of the area.
const CIRCLES: (usize, f64) = (16, 0.92);
/// The smallest circle over the largest.
const LEAST_CIRCLE: f64 = 0.04;

/// A circle inside a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Circle {
    pub(super) center: Vec2,
    pub(super) radius: f64,
}

/// A part at one angle, in a frame whose origin is the centre of its box.
#[derive(Debug, Clone)]
pub(super) struct Shape {
    /// Radians, counter-clockwise.
    pub(super) angle: f64,
    /// From the part's own frame, turned, to this one.
    pub(super) shift: Vec2,
    /// Half the size of its box.
    pub(super) half: Vec2,
    /// Box of the footprint itself, neither grown nor simplified.
    pub(super) bounds: Box2,
    /// Boundary, by the even-odd rule.
    pub(super) edges: Vec<[Vec2; 2]>,
    /// The edges once more for each strip of the box that they touch, strip by strip from below, and where each begins.
    strips: (Vec<[Vec2; 2]>, Vec<usize>),
    /// Circles inside, largest first.
    pub(super) circles: Vec<Circle>,
    /// The same for sums over all of them.
    pub(super) lanes: Lanes,
}

/// Circles that are worked on together.
pub(super) const LANES: usize = 4;

/// Circles by coordinate, filled up with circles of radius 0.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Lanes {
    pub(super) count: usize,
    pub(super) x: Vec<[f32; LANES]>,
    pub(super) y: Vec<[f32; LANES]>,
    pub(super) radius: Vec<[f32; LANES]>,
}

impl Lanes {
    fn new(circles: &[Circle]) -> Self {
        let lane = |value: &dyn Fn(&Circle) -> f64| {
            let some = |it: &[Circle]| std::array::from_fn(|k| it.get(k).map_or(0.0, value) as f32);
            circles.chunks(LANES).map(some).collect()
        };
        let (x, y) = (lane(&|it| it.center.x), lane(&|it| it.center.y));
        Self { count: circles.len(), x, y, radius: lane(&|it| it.radius) }
    }
}

/// A part, with what does not depend on its angle.
#[derive(Debug, Clone)]
pub(super) struct Prepared {
    /// At every allowed angle.
    pub(super) shapes: Vec<Shape>,
    /// Area of its convex hull, mm².
    pub(super) hull: f64,
    /// Largest extent, mm.
    pub(super) diameter: f64,
}

impl Prepared {
    /// Grows a footprint by `grow + tolerance` and takes out points as far as `tolerance` allows: what remains holds every
    /// point within `grow` of the footprint.
    pub(super) fn new(footprint: &[Vec<Vec2>], angles: &[f64], grow: f64, tolerance: f64) -> Self {
        let grown: Vec<Vec<Vec2>> = boolean::offset(footprint, grow + tolerance).into_iter().flatten().collect();
        let thin = |it: &Vec<Vec2>| -> Vec<Vec2> {
            simplify(it, true, tolerance, &|_| false).into_iter().map(|i| it[i]).collect()
        };
        let contours: Vec<Vec<Vec2>> = grown.iter().map(thin).filter(|it| it.len() > 2).collect();
        let circles = circles(&contours);
        let hull = convex_hull(&contours.concat());
        let exact = convex_hull(&footprint.concat());
        let shape = |&angle: &f64| {
            let bounds = bounds_turned(&hull, angle);
            let shift = -(bounds.min + bounds.max) / 2.0;
            let place = |p: Vec2| turned(p, angle) + shift;
            let circles: Vec<Circle> = circles.iter().map(|it| Circle { center: place(it.center), ..*it }).collect();
            let edges: Vec<[Vec2; 2]> =
                contours.iter().flat_map(|it| edges(it)).map(|(a, b)| [place(a), place(b)]).collect();
            Shape {
                angle,
                shift,
                half: bounds.size() / 2.0,
                bounds: bounds_turned(&exact, angle).moved(shift),
                strips: strips(&edges, bounds.size().y / 2.0),
                edges,
                lanes: Lanes::new(&circles),
                circles,
            }
        };
        let diameter = hull.iter().flat_map(|p| hull.iter().map(move |q| (p - q).norm())).fold(0.0, f64::max);
        Self { shapes: angles.iter().map(shape).collect(), hull: signed_area(&hull), diameter }
    }
}

impl Shape {
    /// Edges among which are all that come between two heights; some are there more than once.
    pub(super) fn between(&self, low: f64, high: f64) -> &[[Vec2; 2]] {
        let (edges, begins) = &self.strips;
        let strip = |y: f64| strip(y, self.half.y);
        &edges[begins[strip(low)]..begins[strip(high) + 1]]
    }
}

/// The strip of a box of half height `half` that holds a height.
fn strip(y: f64, half: f64) -> usize {
    (((y + half) / (2.0 * half) * STRIPS as f64).max(0.0) as usize).min(STRIPS - 1)
}

fn strips(edges: &[[Vec2; 2]], half: f64) -> (Vec<[Vec2; 2]>, Vec<usize>) {
    let mut sorted = Vec::new();
    let mut begins = vec![0];
    for k in 0..STRIPS {
        let touches = |[a, b]: &&[Vec2; 2]| (strip(a.y.min(b.y), half)..=strip(a.y.max(b.y), half)).contains(&k);
        sorted.extend(edges.iter().filter(touches));
        begins.push(sorted.len());
    }
    (sorted, begins)
}

/// Circles that fill a region, each as large as the boundary and those before it allow (poles of inaccessibility).
fn circles(contours: &[Vec<Vec2>]) -> Vec<Circle> {
    let tree = SegmentTree::of_contours(contours);
    let bounds = Box2::of(contours.iter().flatten());
    let step = bounds.size().amax() / GRID as f64;
    let count = bounds.size().map(|it| (it / step).ceil() as usize);
    let room = |p: Vec2| tree.nearest(p).map_or(0.0, |it| (it.1 - p).norm());
    let mut places: Vec<(Vec2, f64)> = Vec::new();
    for j in 0..count.y {
        for i in 0..count.x {
            let p = bounds.min + Vec2::new(i as f64 + 0.5, j as f64 + 0.5) * step;
            if contains(contours, p) {
                places.push((p, room(p)));
            }
        }
    }
    let area: f64 = contours.iter().map(|it| signed_area(it)).sum();
    let mut found: Vec<Circle> = Vec::new();
    let mut covered = 0.0;
    while found.len() < CIRCLES.0 && covered < CIRCLES.1 * area {
        let free = |p: Vec2, room: f64| found.iter().map(|it| (p - it.center).norm() - it.radius).fold(room, f64::min);
        let best = places.iter().map(|&(p, room)| (p, free(p, room))).max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((mut center, mut radius)) = best.filter(|it| it.1 > 0.0) else { break };
        // The grid is coarse: walk to the true maximum with shrinking steps.
        let mut reach = step / 2.0;
        while reach > 0.02 * step {
            let around = [[1., 0.], [0., 1.], [-1., 0.], [0., -1.]].map(|[x, y]| center + Vec2::new(x, y) * reach);
            let tried = around.into_iter().filter(|&p| contains(contours, p)).map(|p| (p, free(p, room(p))));
            match tried.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|it| it.1 > radius) {
                Some(better) => (center, radius) = better,
                None => reach /= 2.0,
            }
        }
        if found.first().is_some_and(|it| radius < LEAST_CIRCLE * it.radius) {
            break;
        }
        found.push(Circle { center, radius });
        covered += std::f64::consts::PI * radius * radius;
    }
    if found.is_empty() {
        // A sliver between the points of the grid still needs something that can overlap.
        let center = contours.first().map_or_else(Vec2::zeros, |it| it[0]);
        found.push(Circle { center, radius: 1e-3 * step });
    }
    found
}
