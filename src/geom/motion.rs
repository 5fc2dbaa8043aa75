//! How long a path takes on a machine with limited acceleration: trapezoids of speed, corners at a speed that grows with
//! their opening, and a look ahead over a row of blocks, as boards of the GRBL family plan.

/// One stretch of a path.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Block {
    /// mm.
    pub length: f64,
    /// Speed wished for, mm/s.
    pub nominal: f64,
    /// Along the path, mm/s².
    pub acceleration: f64,
    /// Largest speed at its start, mm/s: 0 from rest, else that of the corner before it.
    pub entry: f64,
}

/// Seconds of a path of `length` mm entered at `v0` and left at `v1` mm/s, with top speed `v` and acceleration `a`.
pub fn trapezoid(length: f64, v0: f64, v: f64, v1: f64, a: f64) -> f64 {
    let ramps = (2.0 * v * v - v0 * v0 - v1 * v1) / (2.0 * a);
    if ramps <= length {
        return (2.0 * v - v0 - v1) / a + (length - ramps) / v;
    }
    let peak = ((2.0 * a * length + v0 * v0 + v1 * v1) / 2.0).sqrt().max(v0).max(v1);
    (2.0 * peak - v0 - v1) / a
}

/// Greatest speed through a corner, mm/s, by the cosine of its turn: that of a circle which leaves the corner by
/// `deviation` mm (Jeon, "Improving Grbl: Cornering Algorithm", 2011).
pub fn corner_speed(cos_turn: f64, acceleration: f64, deviation: f64) -> f64 {
    if cos_turn < -0.999_999 {
        return 0.0;
    }
    // Half the angle between the legs: a quarter turn where the path is straight.
    let sine = ((1.0 + cos_turn) / 2.0).sqrt();
    if sine > 0.999_999 { f64::INFINITY } else { (acceleration * deviation * sine / (1.0 - sine)).sqrt() }
}

/// Seconds of each of the first `count` blocks and the speed after them, when the first is entered at `entry` mm/s and
/// the machine could stop after the last of all.
pub fn plan(blocks: &[Block], entry: f64, count: usize) -> (Vec<f64>, f64) {
    let mut entries = vec![0.0; blocks.len() + 1];
    for (i, block) in blocks.iter().enumerate().rev() {
        let nominal = block.nominal.min(if i == 0 { f64::INFINITY } else { blocks[i - 1].nominal });
        let reach = (entries[i + 1] * entries[i + 1] + 2.0 * block.acceleration * block.length).sqrt();
        entries[i] = block.entry.min(nominal).min(reach);
    }
    let mut v = entry;
    let seconds = blocks.iter().zip(&entries[1..]).take(count).map(|(block, next)| {
        let reach = (v * v + 2.0 * block.acceleration * block.length).sqrt();
        let exit = next.min(reach);
        let top = block.nominal.max(v).max(exit);
        let seconds = trapezoid(block.length, v, top, exit, block.acceleration);
        v = exit;
        seconds
    });
    let seconds = seconds.collect();
    (seconds, v)
}
