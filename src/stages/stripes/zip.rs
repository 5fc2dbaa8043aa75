//! One strip with one zipper (Schüller, Poranne and Sorkine-Hornung 2018): singularities at the tips of rings so that all lines
//! are one path from tip to tip.
//!
//! On a surface of genus 0 whose lines are closed rings, every ring parts it, so the regions between them form a tree, and
//! its leaves are tips (a boundary loop is a leaf as well). With an index k at every tip, |k| lines end there and
//! Σ|k| / 2 lines run from the positive to the negative ones. What is left of the surface is one disk exactly if the lines, joined where
//! they end at the same tip, form a tree over the n tips: then Σ|k| = 2 (n − 1). If no more than two meet at a tip they form a path:
//! one zipper from end to end, whose two sides are the whole outline of the strip. So two tips get ±1, all others ±2, and
//! around every limb winds at least one line. Which of these wind most evenly is told by the energy, quadratic in the
//! indices; whether the lines close up to a path by counting them, also for other levels, which reconnect at the saddles.
use std::f64::consts::TAU;

use super::{
    isolines::{ArcEnd, Crossings, Levels},
    search::{SearchError, density},
    split::split,
};
use crate::{
    mesh::{EdgeId, FaceId, Field, TriMesh, VertexId},
    model::Web,
    numeric::{Monitor, random::Random},
    surface::{
        field_aligned::{AlignError, Indices, Parameterization},
        tree_cotree::Node,
    },
};

/// A surface with more tips is not taken for a body with limbs: its rings are those of a bad mesh, or far too narrow.
const MOST_TIPS: usize = 32;
/// Of more tips than this there are too many choices to look at all.
const ALL_UP_TO: usize = 12;
/// From so many of them exchanges start then.
const STARTS: usize = 300;
/// Choices that are tried, most even ones first, at least and at most …
const TRIES: [usize; 2] = [8, 120];
/// … and in all so many faces.
const EFFORT: usize = 2_000_000;
/// Levels that are tried for each.
const SHIFTS: u32 = 16;

/// How the lines between `crossings` hang together; `rim` is the boundary loop of every boundary edge ([`rims`]).
pub fn web(crossings: &Crossings, rim: &Field<EdgeId, u32>) -> Web {
    let (open, closed) = crossings.arcs();
    let loops = rim.iter().filter(|it| **it != u32::MAX).max().map_or(0, |it| *it as usize + 1);
    let inner = crossings.ends.len();
    let at = |end: ArcEnd| match end {
        ArcEnd::Inner(k) => k,
        ArcEnd::Rim(e) => inner + rim[e] as usize,
    };
    let count = inner + loops;
    let mut root: Vec<usize> = (0..count).collect();
    let mut degree = vec![0_usize; count];
    let mut cycles = closed;
    for ends in open {
        let [a, b] = ends.map(at);
        degree[a] += 1;
        degree[b] += 1;
        let [a, b] = [a, b].map(|mut x| {
            while root[x] != x {
                root[x] = root[root[x]];
                x = root[x];
            }
            x
        });
        if a == b { cycles += 1 } else { root[a] = b }
    }
    let parts = (0..count).filter(|&x| root[x] == x).count();
    let branches = degree.iter().map(|it| it.saturating_sub(2)).sum();
    Web { cycles, gaps: (parts + closed).saturating_sub(1), branches }
}

/// The boundary loop of every boundary edge, `u32::MAX` elsewhere.
pub fn rims(mesh: &TriMesh) -> Field<EdgeId, u32> {
    let mut out = Field::filled(mesh.edge_count(), u32::MAX);
    for (path, k) in mesh.boundary_loops().iter().zip(0..) {
        path.iter().for_each(|&h| out[mesh.edge(h)] = k);
    }
    out
}

/// What [`zip`] found.
#[derive(Debug, Clone)]
pub struct Zipped<'a> {
    /// The parameterisation.
    pub it: Parameterization<'a>,
    /// Its levels.
    pub levels: Levels,
    /// How the lines hang together.
    pub web: Web,
}

/// Looks for indices at the tips of the rings of `rings`, which has no singularities on a surface of one component and genus 0, for which
/// the lines are one path, or as nearly so as it can; `settle` is what is done to a parameterisation before its lines are drawn; `None` where there are not two tips, or too many.
pub fn zip<'a>(
    mesh: &TriMesh,
    rings: &Parameterization<'a>,
    margin: f64,
    settle: &dyn Fn(&mut Parameterization<'a>),
    monitor: &Monitor,
) -> Result<Option<Zipped<'a>>, SearchError> {
    let levels = Levels { per_turn: 1, offset: 0.0 };
    let crossings = Crossings::new(mesh, &rings.alpha, &rings.n, levels);
    let Some(tips) = tips(mesh, rings, &crossings, margin) else { return Ok(None) };
    if !(2..=MOST_TIPS).contains(&tips.len()) {
        return Ok(None);
    }
    let rim = rims(mesh);
    let solver = rings.solver();
    let solve = |k: &[i32]| {
        let nodes = tips.iter().copied().zip(k.iter().copied()).collect();
        solver.solve(mesh, rings.omega().clone(), &Indices { nodes, generators: Vec::new() })
    };
    let at =
        tips.iter().map(|&it| solver.tree.index(it)).collect::<Result<Vec<usize>, _>>().map_err(AlignError::from)?;
    let energy = Energy::new(tips.len(), |k| {
        monitor.check()?;
        let potential = solve(k)?.potential();
        Ok(at.iter().map(|&node| potential[node]).collect())
    })?;
    let tries = (EFFORT / mesh.face_count().max(1)).clamp(TRIES[0], TRIES[1]);
    let mut best: Option<Zipped<'_>> = None;
    for k in choices(tips.len(), &energy).into_iter().take(tries) {
        monitor.check()?;
        let mut it = solve(&k)?;
        settle(&mut it);
        if density(mesh, &it).1 {
            continue;
        }
        for shift in 0..SHIFTS {
            let levels = Levels { per_turn: 1, offset: f64::from(shift) / f64::from(SHIFTS) };
            let crossings = Crossings::new(mesh, &it.alpha, &it.n, levels);
            let found = web(&crossings, &rim);
            if best.as_ref().is_none_or(|it| found < it.web) {
                best = Some(Zipped { it: it.clone(), levels, web: found });
            }
            if found.is_path() {
                return Ok(best);
            }
        }
    }
    Ok(best)
}

/// The energy as a quadratic function of the indices at n tips that sum to 0: those of all but the first.
struct Energy {
    linear: Vec<f64>,
    quadratic: Vec<Vec<f64>>,
}

impl Energy {
    /// From the potential at every tip ([`Parameterization::potential`]) for indices there: it is half the derivative by 2π k.
    fn new(n: usize, potential: impl Fn(&[i32]) -> Result<Vec<f64>, SearchError>) -> Result<Self, SearchError> {
        let slope = |k: &[i32]| -> Result<Vec<f64>, SearchError> {
            let at = potential(k)?;
            Ok(at[1..].iter().map(|it| 2.0 * TAU * (it - at[0])).collect())
        };
        let linear = slope(&vec![0; n])?;
        let row = |i: usize| {
            let mut k = vec![0; n];
            (k[0], k[i]) = (-1, 1);
            Ok(slope(&k)?.iter().zip(&linear).map(|(a, b)| 0.5 * (a - b)).collect())
        };
        let quadratic = (1..n).map(row).collect::<Result<_, SearchError>>()?;
        Ok(Self { linear, quadratic })
    }

    /// How much more than without indices.
    fn of(&self, k: &[i32]) -> f64 {
        let x = |i: usize| f64::from(k[i + 1]);
        let m = self.linear.len();
        let row = |i: usize| (0..m).map(|j| self.quadratic[i][j] * x(j)).sum::<f64>();
        (0..m).map(|i| x(i) * (self.linear[i] + row(i))).sum()
    }
}

/// Ways to give ±1 to two of n tips and ±2 to the others with a sum of 0, those of least energy first: all of them, or of many tips
/// those that no exchange of two indices improves.
fn choices(n: usize, energy: &Energy) -> Vec<Vec<i32>> {
    let mut out: Vec<(f64, Vec<i32>)> = Vec::new();
    if n <= ALL_UP_TO {
        all(n, &mut |k| out.push((energy.of(k), k.to_vec())));
    } else {
        let mut random = Random::new(n as u64);
        for start in 0..STARTS {
            let mut k = one(n, if start % 2 == 0 { 1 } else { -1 });
            (1..n).for_each(|i| k.swap(i, random.below(i + 1)));
            out.push((exchange(&mut k, energy), k));
        }
    }
    out.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
    let mut out: Vec<Vec<i32>> = out.into_iter().map(|it| it.1).collect();
    out.dedup();
    out
}

/// One way: signs that alternate along a path whose first end has `sign`.
fn one(n: usize, sign: i32) -> Vec<i32> {
    let size = |i: usize| if i == 0 || i == n - 1 { 1 } else { 2 };
    (0..n).map(|i| if i % 2 == 0 { sign * size(i) } else { -sign * size(i) }).collect()
}

/// Exchanges indices as long as that lowers the energy, which it returns.
fn exchange(k: &mut [i32], energy: &Energy) -> f64 {
    let mut now = energy.of(k);
    loop {
        let before = now;
        for i in 0..k.len() {
            for j in 0..i {
                if k[i] == k[j] {
                    continue;
                }
                k.swap(i, j);
                let then = energy.of(k);
                if then < now { now = then } else { k.swap(i, j) }
            }
        }
        if !(now < before) {
            return now;
        }
    }
}

/// Calls `take` with all ways.
fn all(n: usize, take: &mut dyn FnMut(&[i32])) {
    for signs in 0_u32..1 << n {
        let size = |i: usize| if signs >> i & 1 == 1 { 2 } else { -2 };
        let sum: i32 = (0..n).map(size).sum();
        for a in 0..n {
            // Halves two of them.
            for b in (0..a).filter(|&b| sum == (size(a) + size(b)) / 2) {
                let k: Vec<i32> = (0..n).map(|i| if i == a || i == b { size(i) / 2 } else { size(i) }).collect();
                take(&k);
            }
        }
    }
}

/// A node at every tip: a face at the vertex where α is farthest from the only ring around it, or a boundary loop. `None` where the
/// mesh cannot be cut along the rings.
fn tips(mesh: &TriMesh, rings: &Parameterization<'_>, crossings: &Crossings, margin: f64) -> Option<Vec<Node>> {
    let split = split(mesh, crossings, margin).ok()?;
    let lined = &split.mesh;
    let cut = split.edges();
    let regions = split.parts(&cut);
    let mut region = Field::<FaceId, usize>::filled(lined.face_count(), 0);
    for (k, faces) in regions.iter().enumerate() {
        faces.iter().for_each(|&f| region[f] = k);
    }
    // Rings lie between two regions, which form a tree: the regions with one ring are leaves.
    let mut next: Vec<Vec<usize>> = vec![Vec::new(); regions.len()];
    for e in lined.edges().filter(|&e| cut[e]) {
        let h = lined.halfedge(e);
        let Some(twin) = lined.twin(h) else { continue };
        let [a, b] = [h, twin].map(|it| region[lined.face(it)]);
        next[a].push(b);
        next[b].push(a);
    }
    for it in &mut next {
        it.sort_unstable();
        it.dedup();
    }
    let loops = lined.boundary_loops();
    let open: Vec<usize> = loops.iter().map(|path| region[lined.face(path[0])]).collect();
    let of = |v: VertexId| lined.outgoing(v).next().map(|h| region[lined.face(h)]);
    // Whether the ring of a region is its lowest level.
    let mut above = vec![false; regions.len()];
    for e in mesh.edges() {
        let [a, b] = mesh.edge_vertices(e);
        let top = if crossings.count[e] > 0 { b } else { a };
        if crossings.count[e] != 0
            && let Some(k) = of(top)
        {
            above[k] = true;
        }
    }
    let mut best: Vec<Option<(f64, VertexId)>> = vec![None; regions.len()];
    for v in mesh.vertices() {
        let Some(k) = of(v).filter(|&k| next[k].len() == 1 && !open.contains(&k)) else { continue };
        // The rest above the level goes on across edges that no line crosses.
        let rest = (rings.alpha[v] / TAU).rem_euclid(1.0);
        let depth = if above[k] { rest } else { 1.0 - rest };
        if best[k].is_none_or(|it| depth > it.0) {
            best[k] = Some((depth, v));
        }
    }
    let inner = best.into_iter().flatten().filter_map(|(_, v)| mesh.outgoing(v).next());
    Some(inner.map(|h| Node::Face(mesh.face(h))).chain((0..loops.len()).map(Node::Loop)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{mesh::shapes, surface::field_aligned::Parameterizer};

    #[test]
    fn the_energy_is_that_of_the_solution_and_all_choices_can_be_one_path() {
        let mesh = shapes::icosphere(10.0, 3);
        let n = mesh.face_count();
        let tips = [0, n / 5, n / 3, n / 2, n - 1].map(|f| Node::Face(FaceId(f as u32)));
        let solver = Parameterizer::new(&mesh).unwrap();
        let omega = Field::from_fn(mesh.edge_count(), |e: EdgeId| f64::from(e.0 % 7) - 3.0);
        let solve = |k: &[i32]| {
            let nodes = tips.iter().copied().zip(k.iter().copied()).collect();
            solver.solve(&mesh, omega.clone(), &Indices { nodes, generators: Vec::new() }).unwrap()
        };
        let at = tips.map(|it| solver.tree.index(it).unwrap());
        let potential = |k: &[i32]| {
            let all = solve(k).potential();
            Ok(at.iter().map(|&node| all[node]).collect())
        };
        let energy = Energy::new(5, potential).unwrap();
        let base = solve(&[0; 5]).energy();
        let choices = choices(5, &energy);
        // Two tips with 1 and three with 2: two of one sign and three of the other, of which the sums agree.
        assert_eq!(choices.len(), 2 * 30);
        let mut last = f64::NEG_INFINITY;
        for k in choices {
            assert_eq!((k.iter().sum::<i32>(), k.iter().map(|it| it.abs()).sum::<i32>()), (0, 8));
            let (found, told) = (solve(&k).energy() - base, energy.of(&k));
            assert!((found - told).abs() < 1e-9 * found.abs() && told >= last, "{k:?}: {found} {told}");
            last = told;
        }
        for (n, sign) in [(2, 1), (7, 1), (7, -1), (20, 1), (31, -1)] {
            let k = one(n, sign);
            assert_eq!((k.iter().sum::<i32>(), k.iter().map(|it| it.abs()).sum::<i32>()), (0, 2 * (n as i32 - 1)));
        }
    }
}
