//! Nested dissection (George 1973) from coordinates: a fill-reducing elimination order for matrices whose graph lies on
//! a surface or in space, several times cheaper than minimum degree and with less fill on large meshes.
//!
//! A range of nodes is halved at the median along the longest side of its box; the edges across form a bipartite graph,
//! whose least vertex cover (Kőnig 1931) is the separator, eliminated after both halves.
use super::sparse::SymmetricMatrix;

const NONE: u32 = u32::MAX;
/// Ranges of so many nodes are not divided further. Leaves of 4 to 1000 nodes, ordered by minimum degree inside, were
/// tried: no less fill on triangle grids, and slower.
const LEAF: usize = 4;
/// From this many nodes every axis is tried and the one with the fewest nodes along the cut taken.
const CHOOSE_FROM: usize = 500;

/// An elimination order of the unknowns of `matrix`, for [`super::sparse::Analysis::with_ordering`]. Unknowns come in
/// blocks of `block` that share a point and stay together: block k is unknowns `block` k … `block` (k + 1) − 1, at
/// `points[k]`. Coordinates in the plane have a third that is 0. Deterministic; the result is a permutation whatever
/// the points are. Panics unless `points` has one point per block.
pub fn nested_dissection(matrix: &SymmetricMatrix, block: usize, points: &[[f64; 3]]) -> Vec<u32> {
    assert_eq!(points.len() * block, matrix.size(), "one point per block of unknowns");
    let (starts, neighbours) = quotient_graph(matrix, block);
    let n = points.len();
    let mut dissection = Dissection {
        starts,
        neighbours,
        points,
        part: vec![0; n],
        parts: 1,
        local: vec![NONE; n],
        scratch: Vec::with_capacity(n),
    };
    let mut nodes: Vec<u32> = (0..n as u32).collect();
    let mut ranges = vec![(0, n)];
    while let Some((start, end)) = ranges.pop() {
        if end - start > LEAF {
            let (left, right) = dissection.divide(&mut nodes[start..end]);
            ranges.extend([(start, start + left), (start + left, start + left + right)]);
        }
    }
    nodes.iter().flat_map(|&node| (0..block as u32).map(move |k| node * block as u32 + k)).collect()
}

/// Neighbours of each block of unknowns, without itself, in compressed rows.
fn quotient_graph(matrix: &SymmetricMatrix, block: usize) -> (Vec<u32>, Vec<u32>) {
    let n = matrix.size() / block;
    let mut last = vec![NONE; n];
    let mut pairs: Vec<(u32, u32)> = Vec::new();
    let mut starts = vec![0_u32; n + 1];
    for (row, column, _) in matrix.entries() {
        let (i, j) = ((row / block) as u32, (column / block) as u32);
        // Repeats of a pair that another pair has come between are harmless.
        if i != j && last[i as usize] != j {
            last[i as usize] = j;
            pairs.push((i, j));
            starts[i as usize + 1] += 1;
            starts[j as usize + 1] += 1;
        }
    }
    for k in 0..n {
        starts[k + 1] += starts[k];
    }
    let mut fill = starts.clone();
    let mut neighbours = vec![0; 2 * pairs.len()];
    for (i, j) in pairs {
        for (from, to) in [(i, j), (j, i)] {
            neighbours[fill[from as usize] as usize] = to;
            fill[from as usize] += 1;
        }
    }
    (starts, neighbours)
}

struct Dissection<'a> {
    starts: Vec<u32>,
    neighbours: Vec<u32>,
    points: &'a [[f64; 3]],
    /// Number of the part that a node lies in; `NONE` once it is in a separator.
    part: Vec<u32>,
    parts: u32,
    /// Number of a node in the bipartite graph being covered; `NONE` elsewhere.
    local: Vec<u32>,
    scratch: Vec<u32>,
}

impl Dissection<'_> {
    /// Reorders `nodes` into left half, right half, separator; returns the sizes of the halves.
    fn divide(&mut self, nodes: &mut [u32]) -> (usize, usize) {
        let middle = nodes.len() / 2;
        let (left, right) = (self.parts, self.parts + 1);
        self.parts += 2;
        let extents = self.extents(nodes);
        let longest = (1..3).fold(0, |best, k| if extents[k] > extents[best] { k } else { best });
        let mut best = (usize::MAX, longest);
        if nodes.len() >= CHOOSE_FROM {
            for axis in (0..3).filter(|&k| extents[k] > 0.2 * extents[longest]) {
                self.halve(nodes, axis, left);
                best = best.min((self.rim(&nodes[..middle], right), axis));
            }
        }
        self.halve(nodes, best.1, left);
        for v in self.separator(&nodes[..middle], right) {
            self.part[v as usize] = NONE;
        }
        self.scratch.clear();
        for wanted in [left, right, NONE] {
            self.scratch.extend(nodes.iter().filter(|&&v| self.part[v as usize] == wanted));
        }
        nodes.copy_from_slice(&self.scratch);
        let size = |wanted: u32| nodes.iter().filter(|&&v| self.part[v as usize] == wanted).count();
        (size(left), size(right))
    }

    /// Puts the lower half along an axis first, as part `left`; the upper half becomes part `left` + 1.
    fn halve(&mut self, nodes: &mut [u32], axis: usize, left: u32) {
        let middle = nodes.len() / 2;
        let points = self.points;
        let key = |v: u32| points[v as usize][axis];
        nodes.select_nth_unstable_by(middle, |&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
        for (k, &v) in nodes.iter().enumerate() {
            self.part[v as usize] = left + u32::from(k >= middle);
        }
    }

    /// How many of `left` have a neighbour in the part numbered `right`.
    fn rim(&self, left: &[u32], right: u32) -> usize {
        let around = |v: u32| self.starts[v as usize] as usize..self.starts[v as usize + 1] as usize;
        let crosses = |v: u32| self.neighbours[around(v)].iter().any(|&w| self.part[w as usize] == right);
        left.iter().filter(|&&v| crosses(v)).count()
    }

    fn extents(&self, nodes: &[u32]) -> [f64; 3] {
        let (mut low, mut high) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for &v in nodes {
            for (k, &x) in self.points[v as usize].iter().enumerate() {
                low[k] = low[k].min(x);
                high[k] = high[k].max(x);
            }
        }
        [0, 1, 2].map(|k| high[k] - low[k])
    }

    /// The least set of nodes that touches every edge between `left` and the part numbered `right`.
    fn separator(&mut self, left: &[u32], right: u32) -> Vec<u32> {
        let mut sides: [Vec<u32>; 2] = [Vec::new(), Vec::new()];
        let (mut starts, mut links) = (vec![0_u32], Vec::new());
        for &v in left {
            let before = links.len();
            for k in self.starts[v as usize]..self.starts[v as usize + 1] {
                let w = self.neighbours[k as usize];
                if self.part[w as usize] != right {
                    continue;
                }
                if self.local[w as usize] == NONE {
                    self.local[w as usize] = sides[1].len() as u32;
                    sides[1].push(w);
                }
                links.push(self.local[w as usize]);
            }
            if links.len() > before {
                sides[0].push(v);
                starts.push(links.len() as u32);
            }
        }
        for &w in &sides[1] {
            self.local[w as usize] = NONE;
        }
        let cover = vertex_cover(&starts, &links, sides[1].len());
        cover.into_iter().map(|(side, k)| sides[side][k]).collect()
    }
}

/// A least vertex cover of a bipartite graph, as (side, index): left vertex i has the right neighbours
/// `links[starts[i]..starts[i + 1]]`. From a greatest matching, by augmenting paths found breadth first.
fn vertex_cover(starts: &[u32], links: &[u32], right: usize) -> Vec<(usize, usize)> {
    let left = starts.len() - 1;
    let around = |i: usize| links[starts[i] as usize..starts[i + 1] as usize].iter().copied();
    let mut mate = [vec![NONE; left], vec![NONE; right]];
    for i in 0..left {
        if let Some(j) = around(i).find(|&j| mate[1][j as usize] == NONE) {
            mate[0][i] = j;
            mate[1][j as usize] = i as u32;
        }
    }
    // `from[j]`: the left vertex from which right vertex j was reached. Vertices reached in a search that found no
    // augmenting path never lie on one, so they stay marked.
    let mut from = vec![NONE; right];
    let mut reached = vec![false; left];
    let mut queue = Vec::new();
    for root in 0..left {
        if mate[0][root] != NONE {
            continue;
        }
        queue.clear();
        queue.push(root as u32);
        let mut touched = Vec::new();
        let mut free = None;
        let mut done = 0;
        'search: while done < queue.len() {
            let i = queue[done];
            done += 1;
            for j in around(i as usize) {
                if from[j as usize] != NONE {
                    continue;
                }
                from[j as usize] = i;
                touched.push(j);
                match mate[1][j as usize] {
                    NONE => {
                        free = Some(j);
                        break 'search;
                    }
                    next => queue.push(next),
                }
            }
        }
        match free {
            Some(mut j) => {
                loop {
                    let i = from[j as usize];
                    mate[1][j as usize] = i;
                    let next = std::mem::replace(&mut mate[0][i as usize], j);
                    if next == NONE {
                        break;
                    }
                    j = next;
                }
                for j in touched {
                    from[j as usize] = NONE;
                }
            }
            None => {
                for &i in &queue {
                    reached[i as usize] = true;
                }
            }
        }
    }
    let lefts = (0..left).filter(|&i| !reached[i] && mate[0][i] != NONE).map(|i| (0, i));
    let rights = (0..right).filter(|&j| from[j] != NONE).map(|j| (1, j));
    lefts.chain(rights).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numeric::{random::Random, sparse::Analysis};

    fn grid(m: usize, block: usize) -> (SymmetricMatrix, Vec<[f64; 3]>) {
        let mut triplets = Vec::new();
        let at = |node: usize, k: usize| (node * block + k) as u32;
        for i in 0..m * m {
            for k in 0..block {
                triplets.push((at(i, k), at(i, k), 4.0 * block as f64));
                for j in [(i % m + 1 < m).then_some(i + 1), (i + m < m * m).then_some(i + m)].into_iter().flatten() {
                    triplets.extend((0..block).map(|l| (at(i, k), at(j, l), -1.0)));
                }
            }
        }
        let points = (0..m * m).map(|i| [(i % m) as f64, (i / m) as f64, 0.0]).collect();
        (SymmetricMatrix::from_triplets(m * m * block, &triplets), points)
    }

    #[test]
    fn order_is_a_permutation_and_solves() {
        for (m, block) in [(1, 1), (2, 3), (9, 2), (80, 1), (40, 3)] {
            let (matrix, points) = grid(m, block);
            for points in [points.clone(), vec![[0.0; 3]; points.len()], vec![[f64::NAN; 3]; points.len()]] {
                let order = nested_dissection(&matrix, block, &points);
                let mut sorted = order.clone();
                sorted.sort_unstable();
                assert!(sorted.iter().enumerate().all(|(k, &it)| k == it as usize));
                if m * m * block > 2_000 && points[1][0] != 1.0 {
                    continue;
                }
                let b: Vec<f64> = (0..matrix.size()).map(|i| (i as f64).sin()).collect();
                let x = Analysis::with_ordering(&matrix, &order).unwrap().factor(&matrix).unwrap().solve(&b);
                let residual = matrix.multiply(&x).iter().zip(&b).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max);
                assert!(residual < 1e-10, "{m} {block}: {residual}");
            }
        }
    }

    #[test]
    fn about_the_fill_of_minimum_degree_on_a_large_grid() {
        let (matrix, points) = grid(200, 1);
        let order = nested_dissection(&matrix, 1, &points);
        let [ours, amd] =
            [Analysis::with_ordering(&matrix, &order), Analysis::new(&matrix)].map(|it| it.unwrap().entries());
        assert!((ours as f64) < 1.4 * amd as f64, "{ours} against {amd}");
    }

    #[test]
    fn covers_are_least() {
        let mut random = Random::new(5);
        for _ in 0..300 {
            let (left, right) = (1 + random.below(5), 1 + random.below(5));
            let (mut starts, mut links) = (vec![0], Vec::new());
            for _ in 0..left {
                links.extend((0..right as u32).filter(|_| random.below(3) == 0));
                starts.push(links.len() as u32);
            }
            let edges: Vec<(usize, usize)> = (0..left)
                .flat_map(|i| links[starts[i] as usize..starts[i + 1] as usize].iter().map(move |&j| (i, j as usize)))
                .collect();
            let covers =
                |chosen: usize| edges.iter().all(|&(i, j)| chosen >> i & 1 == 1 || chosen >> (left + j) & 1 == 1);
            let least = (0..1 << (left + right)).filter(|&it: &usize| covers(it)).map(|it| it.count_ones()).min();
            let found = vertex_cover(&starts, &links, right);
            let mask = found.iter().map(|&(side, k)| 1 << (side * left + k)).sum();
            assert!(covers(mask));
            assert_eq!(Some(found.len() as u32), least);
        }
    }
}
