//! The sequential quadratic program of section 6.4, warm-started along a path of handles.
mod settle;

use std::collections::BTreeMap;

use super::{
    FoldError,
    figures::figures,
    kkt::Kkt,
    net::Net,
    terms::{Dihedral, FoldPoint, angle_values, angles, constraints_of},
};
use crate::{geom::Vec3, model::FoldFigures, numeric::Monitor};

/// Weights and limits of the solver, for a net whose mean edge is 1.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// w_H of the bending energy.
    pub bending: f64,
    /// Σ (l² − l₀²)² is weighted by this over the number of edges.
    pub isometry: f64,
    /// w_pos of the handles.
    pub position: f64,
    /// w_cont of the two copies of crease points.
    pub continuity: f64,
    /// w_D of the dihedral targets.
    pub dihedral: f64,
    /// h of tanh(h x) in the fold terms.
    pub steepness: f64,
    /// Share of the isometry and continuity weights along the path; they grow to the whole while it settles.
    pub soft: f64,
    /// δ of the stabilised step.
    pub delta: f64,
    /// Whether fold terms and the exact test are used.
    pub fold: bool,
    /// Edges stretched by more than this are held harder while it settles.
    pub stretch_limit: f64,
    /// Mean and largest gap along creases, in mean edges, beyond which gaps are held closer while it settles.
    pub continuity_limits: [f64; 2],
    /// Handles that miss by more than this, in mean edges, are held harder while it settles.
    pub handle_limit: f64,
    /// Creases are held at least so far folded at the end of the path, radians.
    pub least_fold: f64,
    /// Steps along the path of the handles.
    pub frames: usize,
    /// SQP iterations at every step of the path.
    pub iterations_per_frame: usize,
    /// Most SQP iterations at the end of the path.
    pub settle: usize,
}

impl Options {
    /// Weights of section 6.2, but isometry and continuity are a hundred times as heavy once the sheet comes to rest, which keeps
    /// the figures of section 6.1 for both; limits of section 6.1, none for handles.
    pub const PAPER: Self = Self {
        bending: 1.0,
        isometry: 2e6,
        position: 5.0,
        continuity: 1e6,
        dihedral: 100.0,
        steepness: 1000.0,
        soft: 0.01,
        delta: 1e-4,
        fold: true,
        stretch_limit: 4e-3,
        continuity_limits: [2e-4, 3.5e-3],
        handle_limit: f64::INFINITY,
        least_fold: 0.26,
        frames: 20,
        iterations_per_frame: 5,
        settle: 400,
    };
}

/// A linear form of vertices that is to reach a place: a point of the sheet, or the difference of two that are to meet.
#[derive(Debug, Clone, PartialEq)]
pub struct Handle {
    /// Vertices and coefficients.
    pub form: Vec<(u32, f64)>,
    /// Where it is to be at the end, in the unit of the net.
    pub target: Vec3,
    /// Weight on each axis, times the position weight; 0 leaves an axis free.
    pub axes: Vec3,
}

impl Handle {
    /// How far it is from its target on the axes that it holds.
    pub fn miss(&self, x: &[Vec3]) -> f64 {
        let gap = self.at(x) - self.target;
        Vec3::from_fn(|p, _| if self.axes[p] > 0.0 { gap[p] } else { 0.0 }).norm()
    }

    /// Its value.
    pub fn at(&self, x: &[Vec3]) -> Vec3 {
        self.form.iter().fold(Vec3::zeros(), |sum, &(v, w)| sum + x[v as usize] * w)
    }
}

/// How the last iteration went.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Step {
    /// Share of the step that was taken; 0 when no share lowered the merit.
    pub taken: f64,
    /// Largest change of a coordinate.
    pub change: f64,
    /// ‖c‖₂ after it.
    pub residual: f64,
    /// Objective after it.
    pub objective: f64,
    /// ω.
    pub omega: f64,
    /// Levenberg damping.
    pub damping: f64,
    /// Factorisations, more than 1 where ω was doubled.
    pub factorisations: usize,
    /// Largest residual of the linear system after refinement.
    pub linear_residual: f64,
}

/// A net on its way from flat to folded.
pub struct Solver<'a> {
    net: &'a Net,
    options: &'a Options,
    /// Fold points of the net.
    pub folds: Vec<FoldPoint>,
    dihedrals: Vec<Dihedral>,
    handles: Vec<Handle>,
    forms: Vec<(Vec<(u32, f64)>, Vec3)>,
    kkt: Kkt,
    /// Positions.
    pub x: Vec<Vec3>,
    multipliers: Vec<f64>,
    omega: f64,
    /// Levenberg damping of the Hessian.
    damping: f64,
    /// δ now.
    delta: f64,
    /// Share of the isometry and continuity weights now.
    stiffness: f64,
    /// Isometry weight of every edge, beside that of all.
    edge_weights: Vec<f64>,
    /// Per fold point: 1 for a mountain, −1 for a valley, 0 where either may be.
    pub sides: Vec<f64>,
    /// Sine of the angle that creases are held folded by now.
    least: f64,
    /// SQP iterations so far.
    pub iterations: usize,
}

/// What one set of positions is worth.
struct Worth {
    objective: f64,
    fold: f64,
    /// Σ λ c.
    lagrangian: f64,
    residual: f64,
    unfolded: usize,
}

impl Worth {
    /// The augmented Lagrangian, which the stabilised step always lowers.
    fn merit(&self, omega: f64, delta: f64) -> f64 {
        self.objective + omega * self.fold + self.lagrangian + 0.5 * self.residual.powi(2) / delta
    }
}

impl<'a> Solver<'a> {
    /// Starts from flat.
    pub fn new(
        net: &'a Net,
        options: &'a Options,
        handles: Vec<Handle>,
        dihedrals: Vec<Dihedral>,
    ) -> Result<Self, FoldError> {
        let folds = FoldPoint::all(net);
        // Bending is ½ w Σ A |L x|², the others w Σ |f|²: their Hessians are w A Lᵀ L and 2 w fᵀ f.
        let all = Vec3::repeat(1.0);
        let mut forms: Vec<_> =
            net.laplacian.iter().map(|it| (it.weights.clone(), all * (options.bending * it.area))).collect();
        for it in &net.points {
            let [a, b] = it.sides;
            let form = vec![(a.a, 1.0 - a.t), (a.b, a.t), (b.a, b.t - 1.0), (b.b, -b.t)];
            forms.push((form, all * (2.0 * options.continuity)));
        }
        forms.extend(handles.iter().map(|it| (it.form.clone(), it.axes * (2.0 * options.position))));
        let kkt = Kkt::new(net, &folds, &forms).map_err(|source| FoldError::Step { iteration: 0, source })?;
        Ok(Self {
            x: net.flat.clone(),
            multipliers: vec![0.0; kkt.constraints()],
            omega: 1.0,
            damping: LEAST_DAMPING,
            delta: options.delta,
            stiffness: 1.0,
            edge_weights: vec![1.0; net.edges.len()],
            sides: vec![0.0; folds.len()],
            least: 0.0,
            iterations: 0,
            net,
            options,
            folds,
            dihedrals,
            handles,
            forms,
            kkt,
        })
    }

    /// Number of values of the factor.
    pub fn factor_entries(&self) -> usize {
        self.kkt.entries()
    }

    /// Moves the handles from where they are to their targets and settles. `seen` hears of every frame.
    pub fn run(&mut self, monitor: &Monitor<'_>, seen: &mut dyn FnMut(usize, &Self, &Step)) -> Result<(), FoldError> {
        self.stiffen(self.options.soft);
        let starts: Vec<Vec3> = self.handles.iter().map(|it| it.at(&self.x)).collect();
        if self.sides.contains(&0.0) {
            self.decide(monitor, &starts)?;
        }
        for frame in 1..=self.options.frames {
            let share = frame as f64 / self.options.frames as f64;
            self.least = share * self.options.least_fold.sin();
            let targets: Vec<Vec3> =
                self.handles.iter().zip(&starts).map(|(it, start)| start + (it.target - start) * share).collect();
            let mut step = Step::default();
            for _ in 0..self.options.iterations_per_frame {
                monitor.check()?;
                step = self.step(&targets)?;
                if step.taken == 0.0 {
                    break;
                }
            }
            monitor.progress(share, "folding");
            seen(frame, self, &step);
        }
        let step = self.settle(monitor)?;
        seen(self.options.frames + 1, self, &step);
        Ok(())
    }

    /// Finds mountains and valleys: every crease is what most of it is after the first steps from flat. Then the sheet is flat
    /// again.
    fn decide(&mut self, monitor: &Monitor<'_>, starts: &[Vec3]) -> Result<(), FoldError> {
        let share = 1.0 / self.options.frames as f64;
        let targets: Vec<Vec3> =
            self.handles.iter().zip(starts).map(|(it, start)| start + (it.target - start) * share).collect();
        for _ in 0..self.options.iterations_per_frame {
            monitor.check()?;
            if self.step(&targets)?.taken == 0.0 {
                break;
            }
        }
        let mut lean: BTreeMap<usize, f64> = BTreeMap::new();
        for it in &self.folds {
            *lean.entry(self.net.points[it.point].crease).or_default() += it.mountain(&self.x).0 / it.scale;
        }
        for (it, side) in self.folds.iter().zip(&mut self.sides).filter(|it| *it.1 == 0.0) {
            *side = lean[&self.net.points[it.point].crease].signum();
        }
        self.x.clone_from(&self.net.flat);
        self.multipliers.fill(0.0);
        (self.omega, self.damping, self.delta) = (1.0, LEAST_DAMPING, self.options.delta);
        Ok(())
    }

    /// One SQP iteration towards the given places of the handles.
    pub fn step(&mut self, targets: &[Vec3]) -> Result<Step, FoldError> {
        self.iterations += 1;
        let mut out = Step::default();
        let here = self.worth(&self.x, targets);
        loop {
            let (d, multipliers, slope) = self.direction(targets, &mut out)?;
            let merit = here.merit(self.omega, self.delta);
            // A step over several cells leaves the region that its linearisation says anything about.
            let longest = d.iter().fold(0.0_f64, |m, it| m.max(it.abs()));
            let whole = (FARTHEST / longest).min(1.0);
            let (mut share, mut folding) = (whole, false);
            for _ in 0..MOST_HALVINGS {
                let trial: Vec<Vec3> = self
                    .x
                    .iter()
                    .zip(d.chunks_exact(3))
                    .map(|(x, d)| x + Vec3::new(d[0], d[1], d[2]) * share)
                    .collect();
                let there = self.worth(&trial, targets);
                let ok = there.unfolded <= here.unfolded;
                folding |= ok;
                if !ok && share == whole && out.factorisations < MOST_DOUBLINGS && self.omega < MOST_OMEGA {
                    break;
                }
                let value = there.merit(self.omega, self.delta);
                if ok && value.is_finite() && value <= merit + 1e-4 * share * slope + 1e-13 * merit.abs() {
                    out.taken = share;
                    out.change = longest * share;
                    (out.residual, out.objective) = (there.residual, there.objective);
                    if share == 1.0 {
                        self.multipliers = multipliers;
                        self.damping = (self.damping / RELAX).max(LEAST_DAMPING);
                    } else {
                        self.damping = (self.damping * TIGHTEN).min(MOST_DAMPING);
                    }
                    out.damping = self.damping;
                    self.x = trial;
                    return Ok(out);
                }
                share *= 0.5;
            }
            let doubled = !folding && self.omega < MOST_OMEGA && out.factorisations < MOST_DOUBLINGS + 3;
            if !doubled {
                self.damping = (self.damping * TIGHTEN * TIGHTEN).min(MOST_DAMPING);
                (out.residual, out.objective) = (here.residual, here.objective);
                return Ok(out);
            }
            self.omega *= 2.0;
        }
    }

    /// Solves for a direction; the third is the slope of the merit function along it.
    fn direction(&mut self, targets: &[Vec3], out: &mut Step) -> Result<(Vec<f64>, Vec<f64>, f64), FoldError> {
        let n = 3 * self.x.len();
        let mut right = vec![0.0; n + self.kkt.constraints()];
        self.kkt.begin(self.damping, self.delta);
        self.add_objective(targets, &mut right[..n]);
        let mut row = n;
        let mut pull = vec![0.0; n];
        for (index, star) in self.net.stars.iter().enumerate() {
            let it = angles(star, &self.x);
            self.kkt.set_star(index, &it, star.around.len());
            for (value, gradient) in it.values[..it.count].iter().zip(&it.gradients) {
                let force = self.multipliers[row - n] + value / self.delta;
                for (&v, g) in std::iter::once(&star.centre).chain(&star.around).zip(gradient) {
                    (0..3).for_each(|p| pull[3 * v as usize + p] += force * g[p]);
                }
                right[row] = -value - self.delta * self.multipliers[row - n];
                row += 1;
            }
        }
        let gradient = right[..n].to_vec();
        right[..n].iter_mut().for_each(|it| *it = -*it);
        let iteration = self.iterations;
        let solved = self.kkt.solve(&right, REFINEMENTS).map_err(|source| FoldError::Step { iteration, source });
        let (d, multipliers, residual) = solved?;
        let slope = gradient.iter().zip(&pull).zip(&d).map(|((g, p), d)| (g + p) * d).sum();
        (out.linear_residual, out.omega) = (residual, self.omega);
        out.factorisations += 1;
        Ok((d, multipliers, slope))
    }

    /// Adds the gradient of the objective, and its Gauss–Newton Hessian to the system.
    fn add_objective(&mut self, targets: &[Vec3], gradient: &mut [f64]) {
        let mut add = |v: u32, g: Vec3| {
            for p in 0..3 {
                gradient[3 * v as usize + p] += g[p];
            }
        };
        let first_handle = self.forms.len() - self.handles.len();
        for (k, (form, weight)) in self.forms.iter().enumerate() {
            let mut value = form.iter().fold(Vec3::zeros(), |sum, &(v, w)| sum + self.x[v as usize] * w);
            if k >= first_handle {
                value -= targets[k - first_handle];
            }
            value.component_mul_assign(weight);
            form.iter().for_each(|&(v, w)| add(v, value * w));
        }
        let isometry = self.isometry();
        for (edge, &[a, b]) in self.net.edges.iter().enumerate() {
            let e = self.x[a as usize] - self.x[b as usize];
            let phi = e.norm_squared() - (self.net.flat[a as usize] - self.net.flat[b as usize]).norm_squared();
            let weight = isometry * self.edge_weights[edge];
            add(a, e * (4.0 * weight * phi));
            add(b, e * (-4.0 * weight * phi));
            self.kkt.add_edge(edge, e, 8.0 * weight);
        }
        let folds = if self.options.fold { &self.folds[..] } else { &[] };
        for (index, it) in folds.iter().enumerate() {
            if self.sides[index] != 0.0 && self.least > 0.0 {
                let (phi, r) = it.shortfall(&self.x, self.least, self.sides[index]);
                if phi > 0.0 {
                    let weight = 2.0 * self.options.dihedral;
                    it.vertices.iter().zip(&r).for_each(|(&v, r)| add(v, r * (weight * phi)));
                    self.kkt.add_fold(&it.vertices, index, &r, weight);
                }
            }
            if it.straight {
                continue;
            }
            let (phi, r) = it.gradient(&self.x, self.options.steepness);
            if r.iter().any(|it| it.norm_squared() > 0.0) {
                it.vertices.iter().zip(&r).for_each(|(&v, r)| add(v, r * (2.0 * self.omega * phi)));
                self.kkt.add_fold(&it.vertices, index, &r, 2.0 * self.omega);
            }
            if self.sides[index] != 0.0 {
                let (phi, r) = it.wrong_side(&self.x, self.options.steepness, self.sides[index]);
                it.vertices.iter().zip(&r).for_each(|(&v, r)| add(v, r * (2.0 * self.omega * phi)));
                self.kkt.add_fold(&it.vertices, index, &r, 2.0 * self.omega);
            }
        }
        for it in &self.dihedrals {
            let (phi, r) = it.gradient(&self.folds, &self.x);
            let vertices = &self.folds[it.fold].vertices;
            vertices.iter().zip(&r).for_each(|(&v, r)| add(v, r * (2.0 * self.options.dihedral * phi)));
            self.kkt.add_fold(vertices, it.fold, &r, 2.0 * self.options.dihedral);
        }
    }

    fn isometry(&self) -> f64 {
        self.stiffness * self.options.isometry / self.net.edges.len() as f64
    }

    /// Objective without the fold terms, ‖c‖₂, and how many fold points fail the exact test.
    fn worth(&self, x: &[Vec3], targets: &[Vec3]) -> Worth {
        let first_handle = self.forms.len() - self.handles.len();
        let mut objective = 0.0;
        for (k, (form, weight)) in self.forms.iter().enumerate() {
            let mut value = form.iter().fold(Vec3::zeros(), |sum, &(v, w)| sum + x[v as usize] * w);
            if k >= first_handle {
                value -= targets[k - first_handle];
            }
            objective += 0.5 * value.component_mul(&value).dot(weight);
        }
        let isometry = self.isometry();
        for (&[a, b], weight) in self.net.edges.iter().zip(&self.edge_weights) {
            let [l, l0] = [x, &self.net.flat].map(|x| (x[a as usize] - x[b as usize]).norm_squared());
            objective += isometry * weight * (l - l0).powi(2);
        }
        for it in &self.dihedrals {
            objective += self.options.dihedral * it.gradient(&self.folds, x).0.powi(2);
        }
        let (mut fold, mut unfolded) = (0.0, 0);
        if self.options.fold {
            for (it, &side) in self.folds.iter().zip(&self.sides) {
                if side != 0.0 && self.least > 0.0 {
                    objective += self.options.dihedral * it.shortfall(x, self.least, side).0.powi(2);
                }
                if it.straight {
                    continue;
                }
                fold += it.value(x, self.options.steepness).powi(2);
                let mut wrong = !it.folds(x);
                if side != 0.0 {
                    fold += it.wrong_side(x, self.options.steepness, side).0.powi(2);
                    wrong |= it.mountain(x).0 * side < 0.0;
                }
                unfolded += usize::from(wrong);
            }
        }
        let (mut square, mut lagrangian) = (0.0, 0.0);
        let mut multipliers = self.multipliers.iter();
        for star in &self.net.stars {
            for (c, l) in angle_values(star, x).into_iter().take(constraints_of(star)).zip(multipliers.by_ref()) {
                square += c * c;
                lagrangian += l * c;
            }
        }
        Worth { objective, residual: square.sqrt(), unfolded, fold, lagrangian }
    }

    /// Figures of where it is.
    pub fn figures(&self) -> FoldFigures {
        figures(self.net, &self.folds, &self.x)
    }

    /// Distances of the handles from their targets, in mean edges.
    pub fn misses(&self) -> Vec<f64> {
        self.handles.iter().map(|it| it.miss(&self.x)).collect()
    }
}

/// Keeps the Hessian definite against rigid motions that no handle holds.
const LEAST_DAMPING: f64 = 1e-4;
/// Damping is not raised beyond this.
const MOST_DAMPING: f64 = 1e4;
/// Factor on the damping after a step that had to be shortened.
const TIGHTEN: f64 = 6.0;
/// Divisor of the damping after a full step.
const RELAX: f64 = 3.0;
/// δ is not lowered beyond this.
const LEAST_DELTA: f64 = 1e-8;
/// Rounds of refinement of a step.
const REFINEMENTS: usize = 3;
/// Factorisations in which ω may be doubled because the full step fails the exact test; after that the step is halved.
const MOST_DOUBLINGS: usize = 4;
/// Largest change of a coordinate in one step, in mean edges.
const FARTHEST: f64 = 2.0;
/// Halvings in a line search.
const MOST_HALVINGS: usize = 12;
/// ω is not doubled beyond this.
const MOST_OMEGA: f64 = 1e9;
