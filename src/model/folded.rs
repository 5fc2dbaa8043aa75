//! A sheet folded along curved creases.
use crate::geom::{Vec2, Vec3, polyline::ArcLength};

/// The folded sheet, the steps on its way, and what was found along its creases.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Folded {
    /// Mean edge of the nets, mm.
    pub edge: f64,
    /// Vertices of the nets.
    pub vertices: usize,
    /// Steps from flat to folded; the last is the result.
    pub frames: Vec<FoldFrame>,
    /// The creases in the order of the pattern.
    pub creases: Vec<FoldedCrease>,
    /// The handles.
    pub handles: Vec<Held>,
    /// Figures of the result.
    pub figures: FoldFigures,
    /// Steps of the solver.
    pub iterations: usize,
    /// Time that they took, s (may differ between runs).
    pub seconds: f64,
    /// Places where two creases run through one cell of the grid without meeting there, in the plane, mm.
    pub crowded: Vec<Vec2>,
}

/// The sheet on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldFrame {
    /// How far the handles have come, in (0, 1].
    pub share: f64,
    /// Vertices of the sheet, mm.
    pub points: Vec<Vec3>,
}

/// A crease after folding.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldedCrease {
    /// In the plane, mm; the first point of a closed one is not repeated.
    pub points: Vec<Vec2>,
    /// Whether the last point joins the first.
    pub closed: bool,
    /// Patches on its left and on its right.
    pub patches: [usize; 2],
    /// The piece that it is on.
    pub piece: usize,
    /// Where it was measured, from its first point on.
    pub samples: Vec<FoldSample>,
}

/// Which way the paper is folded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fold {
    /// Away from the printed side.
    Mountain,
    /// Towards it.
    Valley,
    /// Nobody knows: no place of the crease was measured.
    Unknown,
}

impl Fold {
    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::Mountain => "mountain",
            Self::Valley => "valley",
            Self::Unknown => "unknown",
        }
    }
}

/// A stretch of a crease that is folded one way.
#[derive(Debug, Clone, PartialEq)]
pub struct Run {
    /// Which way.
    pub fold: Fold,
    /// Mean fold angle over it, as [`FoldSample::angle`].
    pub angle: f64,
    /// In the plane, mm; the first point of a closed one is not repeated.
    pub points: Vec<Vec2>,
    /// Whether it is all of a closed crease.
    pub closed: bool,
}

impl FoldedCrease {
    /// The stretches from one change between mountain and valley to the next, along the crease. Places that were left out of
    /// the fold count only where nothing else was measured.
    pub fn runs(&self) -> Vec<Run> {
        let sound: Vec<&FoldSample> = self.samples.iter().filter(|it| it.excluded.is_empty()).collect();
        let sound = if sound.is_empty() { self.samples.iter().collect() } else { sound };
        let fold = |it: &FoldSample| if it.angle > 0.0 { Fold::Mountain } else { Fold::Valley };
        let mut groups: Vec<Vec<&FoldSample>> = Vec::new();
        for it in sound {
            match groups.last_mut().filter(|group| fold(group[0]) == fold(it)) {
                Some(group) => group.push(it),
                None => groups.push(vec![it]),
            }
        }
        let mean = |group: &[&FoldSample]| group.iter().map(|it| it.angle).sum::<f64>() / group.len() as f64;
        let whole = |fold, angle| Run { fold, angle, points: self.points.clone(), closed: self.closed };
        let mut open = self.points.clone();
        open.extend(self.points.first().filter(|_| self.closed));
        let line = ArcLength::new(open);
        let (Some(first), Some(line)) = (groups.first(), line) else { return vec![whole(Fold::Unknown, 0.0)] };
        if groups.len() == 1 {
            return vec![whole(fold(first[0]), mean(first))];
        }
        let ends: Vec<f64> = groups
            .windows(2)
            .map(|it| 0.5 * (it[0][it[0].len() - 1].along + it[1][0].along))
            .chain([line.length()])
            .collect();
        let mut from = 0.0;
        let cut = |(group, &to): (&Vec<&FoldSample>, &f64)| {
            let points = line.stretch(from, to);
            from = to;
            Run { fold: fold(group[0]), angle: mean(group), points, closed: false }
        };
        groups.iter().zip(&ends).map(cut).collect()
    }
}

/// A crease at one place.
#[derive(Debug, Clone, PartialEq)]
pub struct FoldSample {
    /// Way along the crease in the plane, mm.
    pub along: f64,
    /// Place in the plane, mm.
    pub flat: Vec2,
    /// Place in space, mm.
    pub place: Vec3,
    /// Angle between the sides, 0 when flat, more than 0 for a mountain seen from the printed side, radians.
    pub angle: f64,
    /// Why no fold was demanded here; empty where it was.
    pub excluded: String,
}

/// A handle at the end of its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Held {
    /// What it is, in words.
    pub name: String,
    /// Place in the plane, mm.
    pub flat: Vec2,
    /// How far from its target it is, mm.
    pub miss: f64,
}

/// Figures of a folded net; lengths in units of its mean edge.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct FoldFigures {
    /// Crease points that are not crease vertices and not on straight creases.
    pub crease_points: usize,
    /// Crease points on straight creases, which have no osculating plane.
    pub straight: usize,
    /// Of the crease points left out because they divide their edge too unevenly or the crease runs along it.
    pub excluded: usize,
    /// Of the remaining ones, folded by the exact test.
    pub folded: usize,
    /// Mean absolute fold angle over the remaining ones, radians.
    pub mean_fold: f64,
    /// Least absolute fold angle over them, radians.
    pub least_fold: f64,
    /// Mean absolute fold angle over the points on straight creases, radians.
    pub straight_fold: f64,
    /// Mean |l − l₀| / l₀ over the edges.
    pub stretch_mean: f64,
    /// Largest |l − l₀| / l₀.
    pub stretch_max: f64,
    /// Mean distance of the two copies of a crease point.
    pub continuity_mean: f64,
    /// Largest distance.
    pub continuity_max: f64,
    /// Largest |cos α_k − cos α_{k+1}|.
    pub net_residual: f64,
    /// Largest |2π − Σ α| over inner vertices, radians.
    pub angle_defect: f64,
}
