//! Moulds: the surface of revolution that a net is isometric to, those that it can be bent into, and what a shop makes of them.
mod finish;
mod panels;
mod ribs;
mod segments;
mod solid;
pub mod stage;

use std::f64::consts::{PI, TAU};

pub use finish::Mill;
pub use panels::PanelSize;
pub use ribs::Ribs;

use crate::{
    geom::{Box3, Vec2, Vec3, polygon::point_segment_distance},
    model::{GeodesicNet, Molds},
    numeric::{Cancelled, Monitor},
};

/// Walls of solid moulds, and what they must fit into.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Shell {
    /// Thickness, mm.
    pub thickness: f64,
    /// Largest distance between facets and the surface of revolution across, mm.
    pub chord: f64,
    /// Diameter of the dowels, mm; 0 for none.
    pub dowel: f64,
    /// Depth of their holes, mm.
    pub depth: f64,
    /// Size of the machine, mm, in any order.
    pub limit: Vec3,
    /// How they are milled; `None` for no programs.
    pub mill: Option<Mill>,
}

/// What moulds are made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Form {
    /// Solid walls.
    Solid(Shell),
    /// Ribs of sheet stock.
    Ribs(Ribs),
}

/// Plain options of the kernel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Options {
    /// What the surface of revolution should be like.
    pub wish: Wish,
    /// Rows and strips of a panel.
    pub panel: PanelSize,
    /// Total curvature up to which a panel is as good as flat, rad.
    pub flat: f64,
    /// What moulds are made of.
    pub form: Form,
}

/// Why there is no mould.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MoldError {
    /// A parallel grows faster than the meridian is long.
    #[error(
        "between rows {row} and {next} the radius changes by {change:.4} mm over a meridian of {length:.4} mm: λ = {lambda:.4} is too large, take at most {most:.4}",
        next = row + 1
    )]
    NotReal {
        /// The first of both rows.
        row: usize,
        /// Change of the radius, mm.
        change: f64,
        /// Length of the meridian between both, mm.
        length: f64,
        /// λ asked for.
        lambda: f64,
        /// The largest that is real.
        most: f64,
    },
    /// The run was interrupted.
    #[error(transparent)]
    Interrupted(Cancelled),
    /// The wall does not fit between the surface and the axis, or folds up in a hollow of the profile.
    #[error(
        "a wall of {thickness} mm does not fit behind a profile that comes as near as {radius:.2} mm to the axis; make it thinner"
    )]
    Thick {
        /// Thickness asked for, mm.
        thickness: f64,
        /// Least radius, mm.
        radius: f64,
    },
    /// No division fits the machine.
    #[error(
        "the smallest parts that the mould can be divided into are {:.0} × {:.0} × {:.0} mm, the machine takes {:.0} × {:.0} × {:.0} mm: give more rows, or a larger mold.size",
        size.x, size.y, size.z, limit.x, limit.y, limit.z
    )]
    TooLarge {
        /// Size of the parts, mm.
        size: Vec3,
        /// Size of the machine, mm.
        limit: Vec3,
    },
    /// A solid that is none.
    #[error("mould {name} is no solid: {reason}; change the thickness of its wall or its dowels")]
    Broken {
        /// Its name.
        name: String,
        /// Why.
        reason: String,
    },
    /// A strip reaches around the axis.
    #[error(
        "one panel goes {degrees:.0}° around the axis at λ = {lambda:.4}: take fewer strips per panel, or a λ above {least:.4}"
    )]
    Around {
        /// Angle of the panel, degrees.
        degrees: f64,
        /// λ asked for.
        lambda: f64,
        /// λ at which it goes once around.
        least: f64,
    },
    /// λ is not a positive number.
    #[error("λ is {lambda}; it must be above 0 and at most {most:.4}")]
    NotPositive {
        /// λ asked for.
        lambda: f64,
        /// The largest that is real.
        most: f64,
    },
}

/// What a mould should be like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Wish {
    /// The sector that carries one strip fits the smallest box, by its volume.
    Smallest,
    /// The profile is as straight as can be.
    Flattest,
    /// The widest parallel has this radius, mm.
    Radius(f64),
    /// This member of the family.
    Lambda(f64),
}

/// The lengths of a net that its surfaces of revolution share, each the mean over its row.
#[derive(Debug, Clone, PartialEq)]
pub struct Intrinsic {
    /// Edge across, per row, mm.
    pub widths: Vec<f64>,
    /// Edge along from each row to the next, mm.
    pub lengths: Vec<f64>,
    /// Strips side by side.
    pub strips: usize,
    /// Largest relative deviation of an edge from the mean of its row: 0 where the net is isometric to a surface of revolution with
    /// equal strips.
    pub deviation: f64,
}

/// A surface of revolution as its profile: regular polygons of `strips` edges over the angle `turn` on each parallel.
#[derive(Debug, Clone, PartialEq)]
pub struct Revolution {
    /// Radius and height per row, mm. Heights rise.
    pub profile: Vec<Vec2>,
    /// Angle that the whole net takes around the axis, rad; above 2π the net overlaps itself, a sector of it does not.
    pub turn: f64,
    /// Member of the Minding family, by 1 for the one in which the net turns once around.
    pub lambda: f64,
}

/// Least radius of a mould that is chosen, as a multiple of the thickness of its wall or the depth of its ribs.
const ROOM: f64 = 2.0;
/// Members of the family that are tried for a wish.
const TRIED: usize = 400;
/// Smallest λ tried, as a share of the largest.
const LEAST: f64 = 0.02;
/// Halvings of the search for the largest λ.
const HALVINGS: usize = 60;

impl Intrinsic {
    /// Measures a net.
    pub fn of(net: &GeodesicNet) -> Self {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        let mut deviation = 0.0_f64;
        let mut level = |values: Vec<f64>| {
            let mean = mean(&values);
            deviation = values.iter().map(|it| (it / mean - 1.0).abs()).fold(deviation, f64::max);
            mean
        };
        let widths = (0..net.rows).map(|i| level((0..net.columns - 1).map(|j| net.across(i, j)).collect())).collect();
        let lengths = (0..net.rows - 1).map(|i| level((0..net.columns).map(|j| net.along(i, j)).collect())).collect();
        Self { widths, lengths, strips: net.columns - 1, deviation }
    }

    /// Radii of the polygons in which the net takes the angle 2π / λ (§4.2.2, proposition 4.3).
    fn radii(&self, lambda: f64) -> Vec<f64> {
        let half = PI / (self.strips as f64 * lambda);
        self.widths.iter().map(|it| it / (2.0 * half.min(PI / 2.0).sin())).collect()
    }

    /// The row whose meridian is too short for the change of the radius, with that change.
    fn obstacle(&self, lambda: f64) -> Option<(usize, f64)> {
        let radii = self.radii(lambda);
        let change = |i: usize| radii[i + 1] - radii[i];
        (0..self.lengths.len()).find(|&i| change(i).abs() > self.lengths[i]).map(|i| (i, change(i)))
    }

    /// The largest λ at which the surface is real; infinite for a cylinder.
    pub fn largest_lambda(&self) -> f64 {
        let mut high = 1.0;
        while self.obstacle(high).is_none() {
            high *= 2.0;
            if high > 1e9 {
                return f64::INFINITY;
            }
        }
        let mut low = 0.0;
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if self.obstacle(middle).is_none() { low = middle } else { high = middle }
        }
        low
    }

    /// The member λ of the Minding family: radius about λ r, and heights by dh² = l² − dr². At λ = 1 the net turns once around.
    pub fn revolution(&self, lambda: f64) -> Result<Revolution, MoldError> {
        if !(lambda > 0.0 && lambda.is_finite()) {
            return Err(MoldError::NotPositive { lambda, most: self.largest_lambda() });
        }
        if let Some((row, change)) = self.obstacle(lambda) {
            let (length, most) = (self.lengths[row], self.largest_lambda());
            return Err(MoldError::NotReal { row, change, length, lambda, most });
        }
        let radii = self.radii(lambda);
        let mut height = 0.0;
        let mut profile = vec![Vec2::new(radii[0], 0.0)];
        for (i, length) in self.lengths.iter().enumerate() {
            height += (length.powi(2) - (radii[i + 1] - radii[i]).powi(2)).max(0.0).sqrt();
            profile.push(Vec2::new(radii[i + 1], height));
        }
        Ok(Revolution { profile, turn: TAU / lambda, lambda })
    }

    /// The member that fulfils a wish best. Of [`Wish::Smallest`] and [`Wish::Flattest`] only members count on which a panel of
    /// `strips` spans no more than a right angle and which keep `room`, mm, between the surface and the axis; where there is
    /// none, the one with the most room.
    pub fn wished(&self, wish: Wish, strips: usize, room: f64) -> Result<Revolution, MoldError> {
        let by_price = |price: &dyn Fn(&Revolution) -> f64| {
            let widest = self.widths.iter().copied().fold(0.0, f64::max);
            let shortest = self.lengths.iter().copied().fold(f64::INFINITY, f64::min);
            // A cylinder has no largest; beyond this one strip is flat to a millionth of its width.
            let most = self.largest_lambda().min(1e3 * widest.max(shortest) / widest);
            let least = (LEAST * most).max(4.0 * strips as f64 / self.strips as f64).min(most);
            let members = (0..=TRIED).map(|k| most * (least / most).powf(k as f64 / TRIED as f64));
            let narrowest = |it: &Revolution| it.profile.iter().map(|p| p.x).fold(f64::INFINITY, f64::min);
            let best = members
                .filter_map(|lambda| self.revolution(lambda).ok())
                .filter(|it| narrowest(it) >= room)
                .map(|it| (price(&it), it))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            best.map_or_else(|| self.revolution(most), |it| Ok(it.1))
        };
        match wish {
            Wish::Lambda(lambda) => self.revolution(lambda),
            Wish::Radius(radius) => {
                let widest = self.widths.iter().copied().fold(0.0, f64::max);
                let sine = (widest / (2.0 * radius)).clamp(f64::MIN_POSITIVE, 1.0);
                self.revolution(PI / (self.strips as f64 * sine.asin()))
            }
            Wish::Smallest => by_price(&|it| it.sector_volume(self.strips, strips)),
            Wish::Flattest => by_price(&Revolution::depth),
        }
    }
}

impl Revolution {
    /// The surface as a net of `columns` meridians, of which neighbours are `turn` / `strips` apart, symmetric to the x-axis.
    pub fn net(&self, strips: usize, columns: usize) -> GeodesicNet {
        let step = self.turn / strips as f64;
        GeodesicNet::from_fn(self.profile.len(), columns, |i, j| {
            let angle = step * (j as f64 - 0.5 * (columns - 1) as f64);
            let p = self.profile[i];
            Vec3::new(p.x * angle.cos(), p.x * angle.sin(), p.y)
        })
    }

    /// Largest distance of the profile from the chord between its ends, mm.
    pub fn depth(&self) -> f64 {
        let (first, last) = (self.profile[0], self.profile[self.profile.len() - 1]);
        self.profile.iter().map(|p| point_segment_distance(*p, first, last)).fold(0.0, f64::max)
    }

    /// Volume of the box around the sector that carries `part` of all `strips`, mm³.
    pub fn sector_volume(&self, strips: usize, part: usize) -> f64 {
        let size = Box3::of(&self.net(strips, part + 1).points).size();
        size.x * size.y * size.z
    }
}

/// Moulds for a net that is isometric to a surface of revolution.
pub fn molds(net: &GeodesicNet, options: &Options, monitor: &Monitor) -> Result<Molds, MoldError> {
    let found = Intrinsic::of(net);
    let strips = if options.panel.strips == 0 { found.strips } else { options.panel.strips.min(found.strips) };
    let room = match options.form {
        Form::Solid(it) => ROOM * it.thickness,
        Form::Ribs(it) => ROOM * it.depth,
    };
    let revolution = found.wished(options.wish, strips, room)?;
    let step = revolution.turn / found.strips as f64;
    let (panels, curvature) = panels::panels(net, &revolution, step, options.panel, options.flat);
    let angle = step * strips as f64;
    if angle > TAU {
        let (degrees, lambda) = (angle.to_degrees(), revolution.lambda);
        return Err(MoldError::Around { degrees, lambda, least: lambda * angle / TAU });
    }
    let mut out = Molds {
        step,
        lambda: revolution.lambda,
        largest_lambda: found.largest_lambda(),
        deviation: found.deviation,
        congruence: panels::congruence(net),
        curvature,
        drawings: vec![ribs::half_section(&revolution.profile)],
        ..Molds::default()
    };
    let mut rows: Vec<(usize, [usize; 2])> = panels.iter().filter_map(|it| Some((it.mold?, it.rows))).collect();
    rows.dedup();
    for (mold, rows) in rows {
        match options.form {
            Form::Solid(shell) => {
                let made = segments::segments(&revolution, mold, rows, angle, &shell, monitor)?;
                out.segments.extend(made.segments);
                out.programs.extend(made.programs);
                out.undoweled += made.undoweled;
            }
            Form::Ribs(it) => out.drawings.extend(ribs::ribs(&revolution, mold, rows, angle, &it)),
        }
    }
    Ok(Molds { profile: revolution.profile, panels, ..out })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A net over the whole turn of a surface with a waist and a belly.
    fn vase() -> (GeodesicNet, Vec<Vec2>) {
        let profile: Vec<Vec2> = (0..13)
            .map(|k| f64::from(k) / 12.0)
            .map(|t| Vec2::new(4.0 + 1.2 * (6.0 * t).sin() - 1.5 * t * t, 20.0 * t))
            .collect();
        let surface = Revolution { profile: profile.clone(), turn: TAU, lambda: 1.0 };
        (surface.net(24, 25), profile)
    }

    #[test]
    fn a_surface_of_revolution_is_found_again() {
        let (net, profile) = vase();
        let found = Intrinsic::of(&net);
        assert!(found.deviation < 1e-12);
        let again = found.revolution(1.0).unwrap();
        for (a, b) in again.profile.iter().zip(&profile) {
            assert!((a - b).norm() < 1e-12, "{a} against {b}");
        }
    }

    #[test]
    fn the_minding_family_keeps_all_lengths_and_ends_where_it_says() {
        let (net, _) = vase();
        let found = Intrinsic::of(&net);
        let most = found.largest_lambda();
        assert!(most > 1.0 && most < 100.0, "{most}");
        for lambda in [0.5, 0.9, 0.999_999 * most] {
            let bent = Intrinsic::of(&found.revolution(lambda).unwrap().net(24, 25));
            let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
            assert!(same(&bent.widths, &found.widths) && same(&bent.lengths, &found.lengths), "{lambda}");
        }
        let error = found.revolution(1.001 * most).unwrap_err();
        assert!(matches!(error, MoldError::NotReal { most: said, .. } if (said - most).abs() < 1e-12), "{error}");
        assert!(matches!(found.revolution(0.0), Err(MoldError::NotPositive { .. })));
    }

    fn options(form: Form) -> Options {
        Options { wish: Wish::Lambda(1.0), panel: PanelSize { rows: 0, strips: 4 }, flat: 0.0, form }
    }

    #[test]
    fn solid_moulds_fit_the_machine_and_add_up() {
        let (net, _) = vase();
        let net = GeodesicNet { points: net.points.iter().map(|p| p * 10.0).collect(), ..net };
        let shell = Shell {
            thickness: 8.0,
            chord: 0.02,
            dowel: 3.0,
            depth: 6.0,
            limit: Vec3::new(80.0, 40.0, 35.0),
            mill: None,
        };
        let made = molds(&net, &options(Form::Solid(shell)), &Monitor::silent()).unwrap();
        assert!(made.segments.len() > 4 && made.congruence < 1e-9, "{}", made.segments.len());
        let mut limit = [80.0, 40.0, 35.0];
        limit.sort_by(f64::total_cmp);
        for it in &made.segments {
            assert!(it.mesh.boundary_loops().is_empty() && it.volume > 0.0 && it.dowels > 0, "{}", it.name);
            let mut size = [it.size.x, it.size.y, it.size.z];
            size.sort_by(f64::total_cmp);
            assert!(size.iter().zip(limit).all(|(a, b)| *a <= b), "{}: {size:?}", it.name);
        }
        // In one piece, without dowels, it has the volume of all parts and their holes.
        let whole = Shell { dowel: 0.0, limit: Vec3::repeat(1e4), ..shell };
        let one = molds(&net, &options(Form::Solid(whole)), &Monitor::silent()).unwrap();
        assert_eq!(one.segments.len(), 1);
        let parts: f64 = made.segments.iter().map(|it| it.volume).sum();
        let holes: f64 = made.segments.iter().map(|it| it.dowels as f64 * 6.0 * PI * 1.5 * 1.5).sum();
        let all = one.segments[0].volume;
        assert!(parts < all && parts + holes > 0.999 * all, "{parts} and holes of {holes} of {all}");
        let small = Shell { limit: Vec3::repeat(3.0), ..shell };
        let error = molds(&net, &options(Form::Solid(small)), &Monitor::silent()).unwrap_err();
        assert!(matches!(error, MoldError::TooLarge { .. }), "{error}");
        let thick = Shell { thickness: 60.0, ..whole };
        let error = molds(&net, &options(Form::Solid(thick)), &Monitor::silent()).unwrap_err();
        assert!(matches!(error, MoldError::Thick { .. }), "{error}");
    }

    #[test]
    fn a_ball_neither_gouges_nor_leaves_more_than_its_ridges() {
        let (net, _) = vase();
        let net = GeodesicNet { points: net.points.iter().map(|p| p * 10.0).collect(), ..net };
        let mill =
            Mill { radius: 4.0, scallop: 0.05, allowance: 0.5, layer: 6.0, clearance: 5.0, speeds: [1000.0, 8000.0] };
        let limit = Vec3::repeat(1e4);
        let shell = Shell { thickness: 8.0, chord: 0.02, dowel: 0.0, depth: 6.0, limit, mill: Some(mill) };
        let wanted = Options { panel: PanelSize { rows: 6, strips: 3 }, ..options(Form::Solid(shell)) };
        let made = molds(&net, &wanted, &Monitor::silent()).unwrap();
        assert_eq!(made.programs.len(), 2);
        for it in &made.programs {
            assert!(it.gouge < 0.02 && it.scallop <= 0.05 && it.scallop > 0.005, "{} {}", it.gouge, it.scallop);
            assert!(it.passes > 10);
        }
    }

    #[test]
    fn ribs_have_a_slot_at_every_crossing() {
        let (net, _) = vase();
        let net = GeodesicNet { points: net.points.iter().map(|p| p * 10.0).collect(), ..net };
        let form = Form::Ribs(Ribs { thickness: 3.0, spacing: 40.0, depth: 12.0 });
        let made = molds(&net, &options(form), &Monitor::silent()).unwrap();
        let (up, level): (Vec<_>, Vec<_>) = made.drawings[1..].iter().partition(|it| it.name.contains("up"));
        assert!(up.len() > 1 && level.len() > 4);
        for it in &made.drawings {
            crate::geom::outline::check_outline(&it.contours).unwrap_or_else(|err| panic!("{}: {err}", it.name));
        }
        let rows = net.rows;
        assert!(up.iter().all(|it| it.contours[0].len() == rows + 2 + 4 * level.len()));
    }

    #[test]
    fn wishes_are_fulfilled() {
        let (net, _) = vase();
        let found = Intrinsic::of(&net);
        let widest = |it: &Revolution| it.profile.iter().map(|p| p.x).fold(0.0, f64::max);
        assert!((widest(&found.wished(Wish::Radius(3.0), 1, 0.0).unwrap()) - 3.0).abs() < 1e-9);
        let plain = found.revolution(1.0).unwrap();
        assert!(found.wished(Wish::Flattest, 1, 0.0).unwrap().depth() <= plain.depth());
        let small = found.wished(Wish::Smallest, 1, 0.5).unwrap();
        assert!(small.profile.iter().all(|p| p.x >= 0.5) && 4.0 * small.turn <= 24.0 * TAU);
        assert!(small.sector_volume(24, 1) <= plain.sector_volume(24, 1));
        assert!(found.wished(Wish::Radius(1e3), 1, 0.0).is_err());
    }
}
