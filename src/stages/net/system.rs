//! The constraints of a net as rows over its points, and the normal equations of their linearisation.
//!
//! Every constraint is a linear combination of edge or diagonal lengths (or of their logarithms), so one kind of row serves all
//! of them. Unknowns are the coordinates of the points and nothing else: a fifth of the variables of the paper.
use crate::{
    geom::Vec3,
    numeric::{
        dissection::nested_dissection,
        sparse::{Analysis, Cholesky, SparseError, SymmetricMatrix},
    },
};

/// A family of constraints (§5.1 of the paper), each with its own weight.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Family {
    /// Geodesic parallel coordinates: equal diagonals in every quad (F = 0), equal opposite edges along the geodesics (E does
    /// not depend on v, lemma 4.1).
    Geodesic,
    /// Equal edges along every geodesic.
    ArcLength,
    /// Equal edges along every line across (equation 7).
    EqualWidth,
    /// Edges across keep one ratio from row to row (equation 5).
    Ratio,
    /// Edges across change linearly along the strip: no Gaussian curvature (equation 8).
    Developable,
    /// Edges keep the length of a reference.
    Isometry,
    /// Diagonals of a quad keep the difference of their lengths in a reference: with [`Family::Isometry`] its angles.
    Diagonals,
    /// Points lie on a given surface.
    Proximity,
    /// Points lie where a handle wants them.
    Handle,
    /// Second differences vanish. Never part of the residual.
    Fairness,
}

impl Family {
    /// All of them.
    pub const ALL: [Self; 10] = [
        Self::Geodesic,
        Self::ArcLength,
        Self::EqualWidth,
        Self::Ratio,
        Self::Developable,
        Self::Isometry,
        Self::Diagonals,
        Self::Proximity,
        Self::Handle,
        Self::Fairness,
    ];

    /// What a person calls it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Geodesic => "geodesic parallel coordinates",
            Self::ArcLength => "arc length",
            Self::EqualWidth => "equal strip width",
            Self::Ratio => "constant ratio of widths",
            Self::Developable => "developable",
            Self::Isometry => "isometry",
            Self::Diagonals => "diagonals",
            Self::Proximity => "proximity",
            Self::Handle => "handles",
            Self::Fairness => "fairness",
        }
    }
}

/// A weight per family; 0 switches one off.
pub type Weights = [f64; Family::ALL.len()];

/// Weight of the roughness of a step beside its length, times the square of the number of points: second differences of a
/// given bump shrink with the square of the mesh width, so steps are equally smooth on nets of all sizes.
const ROUGHNESS: f64 = 1.5e-3;
/// Factors of a second difference.
const SECOND: [f64; 3] = [1.0, -2.0, 1.0];

/// One constraint: Σ c g(|p_a − p_b|) = target over its terms (a, b, c), with g the identity or the logarithm.
#[derive(Debug, Clone)]
struct Row {
    family: Family,
    terms: [u32; 2],
    /// Range in `corners`: the points it touches.
    corners: [u32; 2],
    /// First of its blocks, those of pairs (a, b) of its corners with b not behind a.
    block: u32,
    target: f64,
    logarithm: bool,
}

#[derive(Debug, Clone, Copy)]
struct Term {
    /// Numbers of the ends among the corners of the row.
    ends: [u8; 2],
    factor: f64,
}

/// A pull of one point towards a plane or a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Pull {
    pub point: usize,
    pub target: Vec3,
    /// Unit normal of the plane; `None` for the place itself.
    pub normal: Option<Vec3>,
    pub family: Family,
}

/// All constraints of a net of fixed size, with their normal equations.
#[derive(Debug)]
pub(super) struct System {
    rows: Vec<Row>,
    terms: Vec<Term>,
    corners: Vec<u32>,
    /// For each block of each row, the place of its three columns in the matrix.
    blocks: Vec<[u32; 3]>,
    /// Triples of points whose second difference is faired, and their blocks.
    triples: Vec<([u32; 3], [[u32; 3]; 6])>,
    diagonal: Vec<[u32; 3]>,
    matrix: SymmetricMatrix,
    factor: Option<Cholesky>,
    analysis: Analysis,
}

/// Collects rows.
pub(super) struct Builder {
    rows: Vec<Row>,
    terms: Vec<Term>,
    corners: Vec<u32>,
    triples: Vec<[u32; 3]>,
}

impl Builder {
    pub(super) fn new() -> Self {
        Self { rows: vec![], terms: vec![], corners: vec![], triples: vec![] }
    }

    /// Adds Σ c g(|a − b|) = target over (a, b, c).
    pub(super) fn row(&mut self, family: Family, logarithm: bool, terms: &[(usize, usize, f64)], target: f64) {
        let mut corners: Vec<u32> = terms.iter().flat_map(|it| [it.0 as u32, it.1 as u32]).collect();
        corners.sort_unstable();
        corners.dedup();
        let local = |p: usize| corners.iter().position(|&it| it as usize == p).expect("it was just collected") as u8;
        let start = self.terms.len() as u32;
        self.terms.extend(terms.iter().map(|it| Term { ends: [local(it.0), local(it.1)], factor: it.2 }));
        let first = self.corners.len() as u32;
        self.corners.extend(&corners);
        self.rows.push(Row {
            family,
            terms: [start, self.terms.len() as u32],
            corners: [first, self.corners.len() as u32],
            block: 0,
            target,
            logarithm,
        });
    }

    /// Fairs the second difference at `b`.
    pub(super) fn fair(&mut self, a: usize, b: usize, c: usize) {
        let mut triple = [a as u32, b as u32, c as u32];
        triple.sort_unstable();
        self.triples.push(triple);
    }

    /// Orders and analyses. `places` are points in the plane that tell where unknowns lie.
    pub(super) fn finish(self, places: &[[f64; 3]]) -> Result<System, SparseError> {
        let Self { mut rows, terms, corners, triples } = self;
        let n = places.len() as u32;
        // All nine entries of a block, so that its columns are contiguous in the matrix.
        let block = |a: u32, b: u32| (0..9).map(move |k| (3 * a + k % 3, 3 * b + k / 3));
        let mut wanted: Vec<(u32, u32)> = (0..n).map(|p| (p, p)).collect();
        for row in &mut rows {
            row.block = wanted.len() as u32 - n;
            wanted.extend(lower(&corners[row.corners[0] as usize..row.corners[1] as usize]));
        }
        let of_rows = wanted.len() - n as usize;
        wanted.extend(triples.iter().flat_map(|it| lower(it)));
        let pairs: Vec<(u32, u32)> = wanted.iter().flat_map(|&(a, b)| block(a, b)).collect();
        let (matrix, slots) = SymmetricMatrix::with_pattern(3 * n as usize, &pairs);
        let columns = |k: usize| [0, 3, 6].map(|c| slots[9 * k + c]);
        // On the diagonal of the matrix columns begin at their own row: (3p + c, 3p + c).
        let on_diagonal = |k: usize| [0, 4, 8].map(|c| slots[9 * k + c]);
        let place = |k: usize| if wanted[k].0 == wanted[k].1 { on_diagonal(k) } else { columns(k) };
        let all: Vec<[u32; 3]> = (0..wanted.len()).map(place).collect();
        let (diagonal, rest) = all.split_at(n as usize);
        let (blocks, faired) = rest.split_at(of_rows);
        let triples = triples
            .into_iter()
            .zip(faired.chunks(6))
            .map(|(it, slots)| (it, [slots[0], slots[1], slots[2], slots[3], slots[4], slots[5]]))
            .collect();
        let order = nested_dissection(&matrix, 3, places);
        let analysis = Analysis::with_ordering(&matrix, &order)?;
        Ok(System {
            rows,
            terms,
            corners,
            blocks: blocks.to_vec(),
            triples,
            diagonal: diagonal.to_vec(),
            matrix,
            factor: None,
            analysis,
        })
    }
}

/// Pairs (a, b) of ascending `corners` with a ≥ b.
fn lower(corners: &[u32]) -> impl Iterator<Item = (u32, u32)> + '_ {
    corners.iter().enumerate().flat_map(move |(k, &a)| corners[..=k].iter().map(move |&b| (a, b)))
}

/// Adds `factor` · a bᵀ to the block of two points, of which only the lower half is stored where they are one.
fn add_product(values: &mut [f64], columns: [u32; 3], a: &Vec3, b: &Vec3, same: bool) {
    for c in 0..3 {
        let from = if same { c } else { 0 };
        let start = columns[c] as usize;
        for r in from..3 {
            values[start + r - from] += a[r] * b[c];
        }
    }
}

fn add_identity(values: &mut [f64], columns: [u32; 3], factor: f64, same: bool) {
    for c in 0..3 {
        values[columns[c] as usize + if same { 0 } else { c }] += factor;
    }
}

impl System {
    /// Sets the lengths that the rows of a family want, in the order in which they were added.
    pub(super) fn set_targets(&mut self, family: Family, targets: &[f64]) {
        for (row, &target) in self.rows.iter_mut().filter(|it| it.family == family).zip(targets) {
            row.target = target;
        }
    }

    /// Value of a row, and its gradient by corner in `gradient`.
    fn evaluate(&self, row: &Row, x: &[Vec3], gradient: &mut [Vec3; 6]) -> f64 {
        let corners = &self.corners[row.corners[0] as usize..row.corners[1] as usize];
        gradient[..corners.len()].fill(Vec3::zeros());
        let mut value = -row.target;
        for term in &self.terms[row.terms[0] as usize..row.terms[1] as usize] {
            let [a, b] = term.ends.map(usize::from);
            let edge = x[corners[a] as usize] - x[corners[b] as usize];
            let length = edge.norm().max(f64::MIN_POSITIVE);
            let (g, slope) = if row.logarithm { (length.ln(), 1.0 / length) } else { (length, 1.0) };
            value += term.factor * g;
            let pull = edge * (term.factor * slope / length);
            gradient[a] += pull;
            gradient[b] -= pull;
        }
        value
    }

    /// √Σφ² per family over the rows and pulls with a weight, fairness left out.
    pub(super) fn residuals(&self, x: &[Vec3], pulls: &[Pull], weights: &Weights) -> Weights {
        let mut sums = [0.0; Family::ALL.len()];
        let mut gradient = [Vec3::zeros(); 6];
        for row in self.rows.iter().filter(|it| weights[it.family as usize] > 0.0) {
            sums[row.family as usize] += self.evaluate(row, x, &mut gradient).powi(2);
        }
        for pull in pulls.iter().filter(|it| weights[it.family as usize] > 0.0) {
            let miss = x[pull.point] - pull.target;
            sums[pull.family as usize] += pull.normal.map_or(miss.norm_squared(), |n| n.dot(&miss).powi(2));
        }
        sums.map(f64::sqrt)
    }

    /// The step δ of (HᵀH + KᵀK + ε² I) δ = −Hᵀφ − Kᵀκ at `x`: guided projection (Tang et al. 2014) with H the rows of the
    /// hard constraints, K those of fairness.
    pub(super) fn step(
        &mut self,
        x: &[Vec3],
        pulls: &[Pull],
        weights: &Weights,
        damping: f64,
    ) -> Result<Vec<Vec3>, SparseError> {
        let mut matrix = std::mem::replace(&mut self.matrix, SymmetricMatrix::from_triplets(0, &[]));
        let values = matrix.values_mut();
        values.fill(0.0);
        let mut down = vec![0.0; 3 * x.len()];
        let mut gradient = [Vec3::zeros(); 6];
        for row in &self.rows {
            let weight = weights[row.family as usize];
            if weight == 0.0 {
                continue;
            }
            let value = weight * self.evaluate(row, x, &mut gradient);
            let corners = &self.corners[row.corners[0] as usize..row.corners[1] as usize];
            let mut block = row.block as usize;
            for a in 0..corners.len() {
                gradient[a] *= weight;
                for c in 0..3 {
                    down[3 * corners[a] as usize + c] -= value * gradient[a][c];
                }
                for b in 0..=a {
                    add_product(values, self.blocks[block], &gradient[a], &gradient[b], a == b);
                    block += 1;
                }
            }
        }
        for pull in pulls {
            let weight = weights[pull.family as usize].powi(2);
            let columns = self.diagonal[pull.point];
            let mut miss = x[pull.point] - pull.target;
            match pull.normal {
                Some(n) => {
                    add_product(values, columns, &(n * weight), &n, true);
                    miss = n * n.dot(&miss);
                }
                None => add_identity(values, columns, weight, true),
            }
            for c in 0..3 {
                down[3 * pull.point + c] -= weight * miss[c];
            }
        }
        self.add_fairness(values, &mut down, x, weights[Family::Fairness as usize].powi(2));
        self.add_metric(values, damping * damping);
        let solved = match &mut self.factor {
            Some(factor) => factor.refactor(&matrix),
            None => self.analysis.factor(&matrix).map(|it| self.factor = Some(it)),
        };
        self.matrix = matrix;
        solved?;
        if let Some(factor) = &self.factor {
            factor.solve_in_place(&mut down);
        }
        Ok(down.chunks(3).map(|it| Vec3::new(it[0], it[1], it[2])).collect())
    }

    /// Adds `factor` (I + s LᵀL), L the second differences: steps are damped the more the rougher they are, which keeps a net
    /// from crumpling along the directions that the constraints leave nearly free.
    fn add_metric(&self, values: &mut [f64], factor: f64) {
        for columns in &self.diagonal {
            add_identity(values, *columns, factor, true);
        }
        self.add_bending(values, factor * ROUGHNESS * (self.diagonal.len() as f64).powi(2));
    }

    /// Adds `factor` LᵀL.
    fn add_bending(&self, values: &mut [f64], factor: f64) {
        for (_, blocks) in &self.triples {
            let mut block = blocks.iter();
            for a in 0..3 {
                for (b, columns) in (0..=a).zip(&mut block) {
                    add_identity(values, *columns, factor * SECOND[a] * SECOND[b], a == b);
                }
            }
        }
    }

    fn add_fairness(&self, values: &mut [f64], down: &mut [f64], x: &[Vec3], weight: f64) {
        if weight == 0.0 {
            return;
        }
        for (points, _) in &self.triples {
            let bend: Vec3 = (0..3).map(|k| x[points[k] as usize] * SECOND[k]).sum();
            for a in 0..3 {
                for c in 0..3 {
                    down[3 * points[a] as usize + c] -= weight * SECOND[a] * bend[c];
                }
            }
        }
        self.add_bending(values, weight);
    }
}
