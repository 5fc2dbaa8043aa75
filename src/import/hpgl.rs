//! Lines of an HPGL plot, in millimetres.
use super::drawing::{Drawing, DrawingError, DrawnLine};
use crate::geom::Vec2;

/// Millimetres per plotter unit.
const UNIT: f64 = 0.025;

/// Reads PU, PD, PA and SP with absolute coordinates; the layer is the number of the pen. Commands that draw or change
/// the meaning of coordinates and are not known are refused.
pub fn read_hpgl(text: &str) -> Result<Drawing, DrawingError> {
    let mut drawing = Drawing::default();
    let (mut pen, mut down, mut at) = (String::from("0"), false, Vec2::zeros());
    let mut points: Vec<Vec2> = Vec::new();
    let mut line = 1;
    for command in text.split_inclusive(';') {
        let before = command.len() - command.trim_start().len();
        line += command[..before].matches('\n').count();
        let fault =
            |message: &str| DrawingError::Program { line, message: message.into(), text: command.trim().into() };
        let command_text = command.trim().trim_end_matches(';');
        if command_text.is_empty() {
            continue;
        }
        let Some((name, arguments)) = command_text.split_at_checked(2) else {
            return Err(fault("a command of one letter"));
        };
        match name {
            "IN" | "DF" | "VS" | "FS" => {}
            "SP" => {
                finish(&mut points, &pen, &mut drawing);
                pen = arguments.trim().into();
            }
            "PU" | "PD" | "PA" => {
                if name == "PU" {
                    finish(&mut points, &pen, &mut drawing);
                }
                down = if name == "PA" { down } else { name == "PD" };
                let numbers: Vec<f64> = arguments
                    .split([',', ' '])
                    .filter(|it| !it.is_empty())
                    .map(|it| it.parse().map_err(|_| fault("not a number")))
                    .collect::<Result<_, _>>()?;
                if !numbers.len().is_multiple_of(2) {
                    return Err(fault("an odd number of coordinates"));
                }
                for pair in numbers.chunks_exact(2) {
                    let next = Vec2::new(pair[0], pair[1]) * UNIT;
                    if down {
                        if points.is_empty() {
                            points.push(at);
                        }
                        points.push(next);
                    }
                    at = next;
                }
            }
            _ => return Err(fault("a command that is not known")),
        }
    }
    finish(&mut points, &pen, &mut drawing);
    Ok(drawing)
}

/// A line that ends where it began is closed.
fn finish(points: &mut Vec<Vec2>, pen: &str, drawing: &mut Drawing) {
    let mut points = std::mem::take(points);
    let closed = points.len() > 2 && points.first() == points.last();
    if closed {
        points.pop();
    }
    if points.len() > 1 {
        drawing.lines.push(DrawnLine { layer: pen.into(), color: None, points, closed });
    }
}
