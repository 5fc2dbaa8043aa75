//! The `[mold]` table and its section of the report.
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::{Form, Mill, MoldError, Options, PanelSize, Ribs, Shell, Wish, molds};
use crate::{
    geom::Vec3,
    mesh::Field,
    model::{DevelopableMesh, GeodesicNet, Guides, MoldProgram, MoldSegment, Molds, NetFit},
    profile::{Angle, Length, Profiles},
    stage::{Check, Cx, Inputs, KeyError, Section, Stage},
};

/// Which surface of revolution carries the panels, and what its moulds are made of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MoldStage {
    /// What the surface of revolution should be like, of all that the net can be bent into.
    pub wish: WishKey,
    /// Radius of its widest parallel instead of `wish`.
    pub radius: Option<Length>,
    /// Member λ of the Minding family instead of `wish`; at 1 the net turns once around.
    pub lambda: Option<f64>,
    /// Strips per panel; 0 for all.
    pub panel_strips: usize,
    /// Rows of quads per panel; 0 for all.
    pub panel_rows: usize,
    /// Total curvature up to which a panel is as good as flat and needs no mould.
    pub flat: Angle,
    /// What moulds are made of.
    pub form: FormKey,
    /// Thickness of solid moulds.
    pub wall: Length,
    /// Largest distance between the facets of a solid mould and the surface across.
    pub chord: Length,
    /// Diameter of dowels in the joints of solid moulds; 0 for none.
    pub dowel: Length,
    /// Depth of their holes.
    pub dowel_depth: Length,
    /// Size of the machine that makes solid moulds.
    pub size: [Length; 3],
    /// Diameter of the ball nose that mills solid moulds on three axes; no programs when absent.
    pub ball: Option<Length>,
    /// Height of the ridges that it leaves.
    pub scallop: Length,
    /// What roughing leaves.
    pub allowance: Length,
    /// Most that one layer of roughing takes.
    pub layer: Length,
    /// Speed of cuts, mm/min.
    pub feed: f64,
    /// Speed of the spindle, 1/min.
    pub spindle: f64,
    /// Thickness of the sheet stock of ribs.
    pub rib: Length,
    /// Largest distance of ribs.
    pub rib_spacing: Length,
    /// Depth of ribs where the mould is narrowest.
    pub rib_depth: Length,
}

/// What a surface of revolution should be like, as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WishKey {
    /// The mould of a strip takes the least room.
    Smallest,
    /// The profile is as straight as can be.
    Flattest,
}

/// What moulds are made of, as it is written in the config.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FormKey {
    /// Walls, printed or milled.
    Solid,
    /// Ribs of sheet stock with slots.
    Ribs,
}

impl Default for MoldStage {
    fn default() -> Self {
        Self {
            wish: WishKey::Smallest,
            radius: None,
            lambda: None,
            panel_strips: 2,
            panel_rows: 0,
            flat: Angle::degrees(0.5),
            form: FormKey::Solid,
            wall: Length::mm(12.0),
            chord: Length::mm(0.02),
            dowel: Length::mm(6.0),
            dowel_depth: Length::mm(12.0),
            size: [Length::mm(220.0), Length::mm(220.0), Length::mm(250.0)],
            ball: None,
            scallop: Length::mm(0.05),
            allowance: Length::mm(0.5),
            layer: Length::mm(3.0),
            feed: 1500.0,
            spindle: 12_000.0,
            rib: Length::mm(6.0),
            rib_spacing: Length::mm(60.0),
            rib_depth: Length::mm(30.0),
        }
    }
}

/// Height of rapid moves over a mould that is milled, mm.
const CLEARANCE: f64 = 5.0;
/// How deep a mould may be cut into, mm.
const GOUGE: f64 = 0.02;
/// Deviation of edges from the mean of their rows up to which a net counts as isometric to a surface of revolution.
const ISOMETRIC: f64 = 1e-4;
/// Strips laid flat are congruent within this, mm.
const CONGRUENT: f64 = 0.1;

impl MoldStage {
    fn options(&self) -> Options {
        let wish = match (self.lambda, self.radius, self.wish) {
            (Some(lambda), ..) => Wish::Lambda(lambda),
            (None, Some(radius), _) => Wish::Radius(radius.mm),
            (None, None, WishKey::Smallest) => Wish::Smallest,
            (None, None, WishKey::Flattest) => Wish::Flattest,
        };
        let form = match self.form {
            FormKey::Solid => Form::Solid(Shell {
                thickness: self.wall.mm,
                chord: self.chord.mm,
                dowel: self.dowel.mm,
                depth: self.dowel_depth.mm,
                limit: Vec3::from(self.size.map(|it| it.mm)),
                mill: self.ball.map(|ball| Mill {
                    radius: ball.mm / 2.0,
                    scallop: self.scallop.mm,
                    allowance: self.allowance.mm,
                    layer: self.layer.mm,
                    clearance: CLEARANCE,
                    speeds: [self.feed, self.spindle],
                }),
            }),
            FormKey::Ribs => {
                Form::Ribs(Ribs { thickness: self.rib.mm, spacing: self.rib_spacing.mm, depth: self.rib_depth.mm })
            }
        };
        let panel = PanelSize { rows: self.panel_rows, strips: self.panel_strips };
        Options { wish, panel, flat: self.flat.radians, form }
    }
}

impl Stage for MoldStage {
    const NAME: &'static str = "mold";
    const VERSION: u32 = 2;
    type Input = (NetFit, Option<Guides>);
    type Output = (DevelopableMesh, Guides, Molds);
    type Profile = ();
    type Error = MoldError;

    fn profile(_: &Profiles) {}

    fn check(&self) -> Result<(), KeyError> {
        if let Some(lambda) = self.lambda {
            KeyError::range("lambda", lambda, f64::MIN_POSITIVE, 1e9)?;
        }
        if let Some(radius) = self.radius {
            KeyError::range("radius", radius.mm, 0.1, 1e6)?;
        }
        if self.lambda.is_some() && self.radius.is_some() {
            return Err(KeyError { key: "radius", message: "and `lambda` both say which mould; keep one".into() });
        }
        KeyError::range("flat", self.flat.radians.to_degrees(), 0.0, 90.0)?;
        KeyError::range("wall", self.wall.mm, 0.4, 1000.0)?;
        KeyError::range("chord", self.chord.mm, 1e-4, 10.0)?;
        KeyError::range("dowel", self.dowel.mm, 0.0, 100.0)?;
        KeyError::range("dowel_depth", self.dowel_depth.mm, 0.1, 1000.0)?;
        for size in self.size {
            KeyError::range("size", size.mm, 1.0, 1e5)?;
        }
        if let Some(ball) = self.ball {
            KeyError::range("ball", ball.mm, 0.2, 100.0)?;
            KeyError::range("scallop", self.scallop.mm, 1e-4, ball.mm / 4.0)?;
        }
        KeyError::range("allowance", self.allowance.mm, 0.0, 100.0)?;
        KeyError::range("layer", self.layer.mm, 0.01, 1000.0)?;
        KeyError::range("feed", self.feed, 1.0, 1e6)?;
        KeyError::range("spindle", self.spindle, 0.0, 1e6)?;
        KeyError::range("rib", self.rib.mm, 0.1, 100.0)?;
        KeyError::range("rib_spacing", self.rib_spacing.mm, 2.0 * self.rib.mm, 1e5)?;
        KeyError::range("rib_depth", self.rib_depth.mm, 2.0 * self.rib.mm, 1e4)
    }

    fn run(&self, (fit, guides): (&NetFit, Option<&Guides>), (): &(), cx: &Cx) -> Result<Self::Output, MoldError> {
        let made = molds(&fit.net, &self.options(), &cx.monitor)?;
        let mesh =
            fit.net.mesh().map_err(|err| MoldError::Broken { name: "the net".into(), reason: err.to_string() })?;
        let mut guides = guides.cloned().unwrap_or_default();
        guides.scales = vec![1.0; guides.edges.len()];
        let seams = seams(&fit.net, &made);
        guides.scales.extend(vec![1.0; seams.len()]);
        guides.edges.extend(seams);
        let developed = DevelopableMesh {
            energy: Field::filled(mesh.vertex_count(), 0.0),
            mesh,
            max_deviation: 0.0,
            rounds: Vec::new(),
            tradeoffs: Vec::new(),
        };
        Ok((developed, guides, made))
    }

    fn section(&self, (fit, _): <Self::Input as Inputs>::Refs<'_>, (): &(), (_, _, made): &Self::Output) -> Section {
        let finite = |it: f64| it.is_finite().then_some(it);
        let mut table = json!({
            "segments": made.segments.iter().map(segment).collect::<Vec<_>>(),
            "minding_lambda": made.lambda,
            "largest_lambda": finite(made.largest_lambda),
            "strip_angle_deg": made.step.to_degrees(),
            "revolution_deviation": made.deviation,
            "strips_congruence_mm": made.congruence,
            "panels": made.panels.len(),
            "flat_panels": made.panels.iter().filter(|it| it.mold.is_none()).count(),
            "molds": made.curvature.iter().filter(|it| **it > self.flat.radians).count(),
            "panel_curvature_deg": made.curvature.iter().map(|it| it.to_degrees()).collect::<Vec<_>>(),
            "drawings": made.drawings.iter().map(|it| &it.name).collect::<Vec<_>>(),
            "joints_without_dowels": made.undoweled,
            "programs": made.programs.iter().map(program).collect::<Vec<_>>(),
        });
        if !fit.strain.is_empty() {
            table["max_strain"] = json!(fit.strain.iter().copied().fold(0.0, f64::max));
        }
        Section { checks: self.promises(made), ..Section::new(Self::NAME, table) }
    }
}

impl MoldStage {
    fn promises(&self, made: &Molds) -> Vec<Check> {
        let mut out = Vec::new();
        // What is as good as flat needs no surface of revolution.
        if made.panels.iter().any(|it| it.mold.is_some()) {
            let note = "largest relative difference of an edge from the mean of its row; set net.equal_width = 1 and let net.proximity fade to 0";
            out.push(Check::at_most("mold.revolution", made.deviation, ISOMETRIC, "", note));
            out.push(Check::at_most(
                "mold.congruent",
                made.congruence,
                CONGRUENT,
                "mm",
                "strips laid flat, against their mean",
            ));
        }
        let open = made.segments.iter().filter(|it| !it.mesh.boundary_loops().is_empty()).count();
        out.push(Check::at_most("mold.watertight", open as f64, 0.0, "open segments", ""));
        if !made.programs.is_empty() {
            let worst = |of: &dyn Fn(&MoldProgram) -> f64| made.programs.iter().map(of).fold(0.0, f64::max);
            let note = "the ball of every program, swept over its mould";
            out.push(Check::at_most("mold.gouge", worst(&|it| it.gouge), GOUGE, "mm", note));
            let note = "what the ball leaves; a smaller one reaches into hollows";
            out.push(Check::at_most("mold.scallop", worst(&|it| it.scallop), self.scallop.mm, "mm", note));
        }
        out
    }
}

fn segment(it: &MoldSegment) -> Value {
    json!({
        "file": format!("mold/{}.stl", it.name),
        "watertight": it.mesh.boundary_loops().is_empty(),
        "volume_mm3": it.volume,
        "size_mm": [it.size.x, it.size.y, it.size.z],
        "rows": it.rows,
        "dowel_holes": it.dowels,
    })
}

fn program(it: &MoldProgram) -> Value {
    json!({
        "file": format!("mold/{}.ngc", it.segment),
        "finishing_passes": it.passes,
        "max_gouge_mm": it.gouge,
        "max_scallop_mm": it.scallop.is_finite().then_some(it.scallop),
    })
}

/// The edges between panels.
fn seams(net: &GeodesicNet, made: &Molds) -> Vec<[u32; 2]> {
    let mut out = Vec::new();
    for it in &made.panels {
        let [[top, bottom], [left, right]] = [it.rows, it.columns];
        if left > 0 {
            out.extend((top..bottom).map(|i| [net.index(i, left) as u32, net.index(i + 1, left) as u32]));
        }
        if top > 0 {
            out.extend((left..right).map(|j| [net.index(top, j) as u32, net.index(top, j + 1) as u32]));
        }
    }
    out
}
