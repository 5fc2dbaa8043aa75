//! What a job will take, told before it runs. The rules are read off the jobs in `fixtures/` (the numbers below say which), and
//! good to a factor of two.
use super::{input::Source, plan::Plan};
use crate::{
    model::{Noun, Operation, SourceMesh},
    profile::Head,
};

/// Rough figures of a job.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// Sheets of stock.
    pub sheets: f64,
    /// Length of cuts, m.
    pub cut_m: f64,
    /// Time on the machine, s.
    pub machine_seconds: f64,
    /// Time to compute on one core, s.
    pub computing_seconds: f64,
}

/// Share of the sheets that parts fill, seams over the diagonal of the model, and seconds to compute a thousand faces, by
/// recipe. `fixtures/figure.toml`: 0.49, 10.9, 0.9; `fixtures/facets.toml`: 0.31, 11.0, 4; `fixtures/zip-ball.toml`:
/// 0.15, 21.8, 1.
const RULES: [(&str, [f64; 3]); 3] =
    [("developable", [0.5, 11.0, 0.9]), ("facets", [0.32, 11.0, 4.0]), ("stripes", [0.2, 20.0, 1.0])];
/// Time on the machine over that of the cuts alone, for lettering, marks and lifts: `fixtures/figure.toml` 1 039 s for 5.2 m
/// at 25 mm/s.
const LIFTED: f64 = 5.0;
/// The same for a beam, which is off at once: the figure of that job in `felt-3mm` on `laser-co2`, 360 s for 4 m at 20 mm/s.
const BEAM: f64 = 1.8;
/// What `coarsen` leaves of a large mesh where it is not told.
const FACES: usize = 6_000;
/// Meshes up to this size are left as they are.
const KEPT: usize = 20_000;

/// The rough figures; `None` where no rule is known for the recipe.
pub fn estimate(plan: &Plan, source: &Source) -> Option<Estimate> {
    let mesh = &SourceMesh::peek(&source.artifact)?.mesh;
    let [filled, seams, per_thousand] = RULES.iter().find(|it| it.0 == plan.recipe)?.1;
    let [short, long] = plan.profiles.room();
    let coarsen = plan.echo.get("coarsen");
    let key = |key: &str| coarsen.and_then(|it| it.get(key));
    let count = mesh.face_count();
    let faces = match (key("method").and_then(|it| it.as_str()), key("faces").and_then(|it| it.as_u64())) {
        (Some("off") | None, _) => count,
        (_, Some(faces)) => count.min(faces as usize),
        _ if count > KEPT => FACES,
        _ => count,
    };
    let cut_m = 2.0 * seams * mesh.bounds().diagonal() / 1000.0;
    let feed = plan.profiles.machine.tools.get(Operation::CutOutside).map_or(0.0, |it| it.feed / 60.0);
    let all = if matches!(plan.profiles.machine.head, Head::Laser { .. }) { BEAM } else { LIFTED };
    Some(Estimate {
        sheets: (mesh.total_area() / (filled * short * long)).ceil(),
        cut_m,
        machine_seconds: if feed > 0.0 { all * 1000.0 * cut_m / feed } else { 0.0 },
        computing_seconds: 1.0 + per_thousand * faces as f64 / 1000.0 + count as f64 / 50_000.0,
    })
}
