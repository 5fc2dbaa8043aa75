//! The search for a forest of few trees with short seams.
//!
//! Trees grow from every tile as in Kruskal's algorithm: hinges are folded in the order of a heuristic (Schlickenrieder,
//! "Nets of polyhedra", 1997: least perimeter, flattest folds, steepest edges) wherever the union neither overlaps nor
//! leaves the sheet, so that every state on the way is a valid set of pieces. Then branches move from one hinge to
//! another, within their piece or to another one, by simulated annealing (as in Korpitsch, Takahashi, Gröller and Wu,
//! "Simulated annealing to unfold 3D meshes and assign glue tabs", 2020, who allow overlaps on the way instead).
use rayon::prelude::*;

use super::{
    Options,
    forest::{Forest, Move},
    tiles::Tiles,
};
use crate::{
    geom::Vec3,
    mesh::{Field, TriMesh, VertexId},
    numeric::{Cancelled, Monitor, random::Random},
};

/// Orders that are annealed, the best ones.
const STARTS: usize = 4;
/// Directions for the steepest edges besides the axes.
const DIRECTIONS: usize = 6;
/// Temperatures at the start and at the end, in units of the energy.
const HOT: f64 = 0.02;
const COLD: f64 = 2e-4;
/// What the share of the seams counts against the sum of the square roots of the shares of the pieces.
const SEAM: f64 = 0.6;
/// Share of the moves after which all pieces count alike, however large.
const UNEQUAL: f64 = 0.6;
/// Shares of the area up to this are rounding.
const EMPTY: f64 = 1e-12;
/// Moves between two looks at the monitor.
const LAP: usize = 256;

/// The best forest found.
pub(super) fn search<'a>(
    mesh: &TriMesh,
    tiles: &'a Tiles,
    options: &'a Options,
    monitor: &Monitor,
) -> Result<Forest<'a>, Cancelled> {
    let mut grown: Vec<(usize, Forest<'a>)> = orders(mesh, tiles, options.seed)
        .into_par_iter()
        .enumerate()
        .map(|(k, order)| Ok((k, grow(tiles, options, &order, monitor)?)))
        .collect::<Result<_, Cancelled>>()?;
    grown.sort_by(|a, b| worth(&a.1).total_cmp(&worth(&b.1)).then(a.0.cmp(&b.0)));
    grown.truncate(STARTS);
    let annealed: Vec<(usize, Forest<'a>)> = grown
        .into_par_iter()
        .enumerate()
        .map(|(start, (k, it))| {
            let progress = |done: f64| monitor.progress((start as f64 + done) / STARTS as f64, "unfolding");
            Ok((k, anneal(it, tiles, options, options.seed ^ k as u64, (monitor, &progress))?))
        })
        .collect::<Result<_, Cancelled>>()?;
    let best = annealed.into_iter().min_by(|(i, a), (j, b)| {
        let ((m, x), (n, y)) = (rank(a), rank(b));
        m.cmp(&n).then(x.total_cmp(&y)).then(i.cmp(j))
    });
    Ok(best.expect("there is at least one order").1)
}

/// What counts in the end: few pieces, then short seams.
fn rank(forest: &Forest) -> (usize, f64) {
    (forest.count(), forest.seam_length())
}

/// What the annealing makes small at first: pieces few and very unequal, so that the small ones vanish, and short seams.
fn worth(forest: &Forest) -> f64 {
    let total: f64 = forest.areas().sum();
    forest.areas().map(|it| (it / total).sqrt()).sum::<f64>() + SEAM * forest.seam_length() / forest.hinge_length()
}

/// Orders in which hinges are folded.
fn orders(mesh: &TriMesh, tiles: &Tiles, seed: u64) -> Vec<Vec<u32>> {
    let sorted = |cost: &dyn Fn(u32) -> f64| {
        let mut order: Vec<u32> = (0..tiles.hinges.len() as u32).collect();
        order.sort_by(|&a, &b| cost(a).total_cmp(&cost(b)).then(a.cmp(&b)));
        order
    };
    let hinge = |k: u32| &tiles.hinges[k as usize];
    let longest = tiles.hinges.iter().map(|it| it.length).fold(f64::MIN_POSITIVE, f64::max);
    let mut out = vec![
        sorted(&|k| -hinge(k).length),
        sorted(&|k| hinge(k).bend),
        sorted(&|k| hinge(k).bend / std::f64::consts::PI - hinge(k).length / longest),
    ];
    let mut random = Random::new(seed);
    let mut draw = || 2.0 * random.unit() - 1.0;
    let mut directions = vec![Vec3::x(), -Vec3::x(), Vec3::y(), -Vec3::y(), Vec3::z(), -Vec3::z()];
    directions.extend((0..DIRECTIONS).map(|_| Vec3::new(draw(), draw(), draw())));
    for up in directions {
        let cut = steepest(mesh, tiles, up);
        out.push(sorted(&|k| if cut[k as usize] { 2.0 * longest } else { 0.0 } - hinge(k).length));
    }
    out
}

/// Whether a hinge holds the steepest edge up from a vertex.
fn steepest(mesh: &TriMesh, tiles: &Tiles, up: Vec3) -> Vec<bool> {
    let mut best: Field<VertexId, (f64, u32)> = Field::filled(mesh.vertex_count(), (f64::NEG_INFINITY, u32::MAX));
    for (k, hinge) in tiles.hinges.iter().enumerate() {
        for &e in &hinge.edges {
            let [a, b] = mesh.edge_vertices(e);
            let slope = (mesh.position(b) - mesh.position(a)).normalize().dot(&up);
            for (v, slope) in [(a, slope), (b, -slope)] {
                if slope > best[v].0 {
                    best[v] = (slope, k as u32);
                }
            }
        }
    }
    let mut cut = vec![false; tiles.hinges.len()];
    best.iter().filter(|it| it.1 != u32::MAX).for_each(|it| cut[it.1 as usize] = true);
    cut
}

/// Folds hinges in order wherever that is allowed.
fn grow<'a>(tiles: &'a Tiles, options: &'a Options, order: &[u32], monitor: &Monitor) -> Result<Forest<'a>, Cancelled> {
    let mut forest = Forest::new(tiles, options);
    for (k, &hinge) in order.iter().enumerate() {
        if k % LAP == 0 {
            monitor.check()?;
        }
        join(&mut forest, tiles, hinge);
    }
    Ok(forest)
}

/// Joins the two pieces of a hinge if they are two and it is allowed.
fn join(forest: &mut Forest, tiles: &Tiles, hinge: u32) -> bool {
    let [a, b] = tiles.hinges[hinge as usize].tiles;
    let [p, q] = [a, b].map(|it| forest.piece(it));
    if p == q {
        return false;
    }
    let (stays, goes) = if forest.tiles(p).len() >= forest.tiles(q).len() { (a, q) } else { (b, p) };
    let it = Move { tiles: forest.tiles(goes).to_vec(), open: None, fold: hinge, stays };
    let allowed = forest.allows(&it);
    if allowed {
        forest.make(&it);
    }
    allowed
}

/// Moves branches about.
fn anneal<'a>(
    mut forest: Forest<'a>,
    tiles: &'a Tiles,
    options: &'a Options,
    seed: u64,
    (monitor, progress): (&Monitor, &dyn Fn(f64)),
) -> Result<Forest<'a>, Cancelled> {
    let mut random = Random::new(seed);
    let (hinges, total) = (tiles.hinges.len(), forest.areas().sum::<f64>());
    let length = forest.hinge_length();
    let mut best = forest.folded().to_vec();
    let mut now = rank(&forest);
    let mut least = now;
    let moves = if hinges == 0 { 0 } else { options.moves };
    for k in 0..moves {
        let done = k as f64 / moves as f64;
        if k % LAP == 0 {
            monitor.check()?;
            progress(done);
        }
        let heat = HOT * (COLD / HOT).powf(done);
        let Some(it) = propose(&mut forest, tiles, &mut random) else { continue };
        let area = |tiles_: &[u32]| tiles_.iter().map(|&t| tiles.tiles[t as usize].area).sum::<f64>();
        let equal = done > UNEQUAL;
        let size = |area: f64| match (equal, area / total) {
            (_, share) if share < EMPTY => 0.0,
            (true, _) => 1.0,
            (false, share) => share.sqrt(),
        };
        let (from, to, moved) = (forest.area(it.tiles[0]), forest.area(it.stays), area(&it.tiles));
        let cut = |hinge: u32| tiles.hinges[hinge as usize].length;
        let longer = it.open.map_or(0.0, cut) - cut(it.fold);
        let mut change = SEAM / length * longer;
        if forest.piece(it.tiles[0]) != forest.piece(it.stays) {
            let rest = if it.open.is_none() { 0.0 } else { from - moved };
            change += size(rest) + size(to + moved) - size(from) - size(to);
        }
        if (change > 0.0 && random.unit() >= (-change / heat).exp()) || !forest.allows(&it) {
            continue;
        }
        forest.make(&it);
        now = (now.0 - usize::from(it.open.is_none()), now.1 + longer);
        if now.0 < least.0 || now.0 == least.0 && now.1 < least.1 {
            least = now;
            best.copy_from_slice(forest.folded());
        }
    }
    let mut best = Forest::of(tiles, options, &best);
    // What can be joined as it is.
    let mut order: Vec<u32> = (0..hinges as u32).collect();
    order.sort_by(|&a, &b| {
        let length = |k: u32| tiles.hinges[k as usize].length;
        length(b).total_cmp(&length(a)).then(a.cmp(&b))
    });
    while order.iter().any(|&hinge| join(&mut best, tiles, hinge)) {
        monitor.check()?;
    }
    Ok(best)
}

/// A random hinge that is cut, and what could be moved there.
fn propose(forest: &mut Forest, tiles: &Tiles, random: &mut Random) -> Option<Move> {
    let fold = random.below(tiles.hinges.len()) as u32;
    if forest.is_folded(fold) {
        return None;
    }
    let [a, b] = tiles.hinges[fold as usize].tiles;
    let (goes, stays) = if random.below(2) == 0 { (a, b) } else { (b, a) };
    let open = if forest.piece(goes) == forest.piece(stays) {
        let path = forest.path(goes, stays);
        Some(path[random.below(path.len())])
    } else if random.below(3) == 0 {
        None
    } else {
        let own = forest.tiles(forest.piece(goes));
        let other = own[random.below(own.len())];
        forest.first_fold(other, goes)
    };
    Some(Move { tiles: forest.side(goes, open), open, fold, stays })
}
