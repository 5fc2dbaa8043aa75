//! A chart of what closeness costs: energy and seam length against the deviation allowed, as SVG.
use svg::{
    Document,
    node::element::{Circle, Line, Path, Text},
};

use crate::model::Tradeoff;

/// Size of the picture and free space around its axes, pixels.
const SIZE: [f64; 2] = [640.0, 420.0];
const BORDER: f64 = 60.0;
/// Divisions of each axis.
const TICKS: usize = 4;
const INK: &str = "#262b33";
/// Colours of the energy and of the seam length.
const COLORS: [&str; 2] = ["#b3541e", "#1e6fb3"];

/// The picture; `diagonal` is that of the input, mm.
pub(super) fn tradeoffs(rows: &[Tradeoff], diagonal: f64) -> Vec<u8> {
    let percent: Vec<f64> = rows.iter().map(|it| 100.0 * it.max_deviation / diagonal).collect();
    let series: [Vec<f64>; 2] =
        [rows.iter().map(|it| it.energy).collect(), rows.iter().map(|it| it.seam_length / diagonal).collect()];
    let most = |values: &[f64]| values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    let x = |value: f64| BORDER + (SIZE[0] - 2.0 * BORDER) * value / most(&percent);
    let y = |value: f64, top: f64| SIZE[1] - BORDER - (SIZE[1] - 2.0 * BORDER) * value / top;
    let mut document = Document::new()
        .set("viewBox", format!("0 0 {} {}", SIZE[0], SIZE[1]))
        .set("font-family", "sans-serif")
        .set("font-size", 13)
        .add(line([BORDER, SIZE[1] - BORDER], [SIZE[0] - BORDER, SIZE[1] - BORDER]))
        .add(text("deviation allowed, % of the diagonal", [SIZE[0] / 2.0, SIZE[1] - 15.0], "middle", INK));
    for &value in &percent {
        let label = short(value);
        document = document.add(text(&label, [x(value), SIZE[1] - BORDER + 20.0], "middle", INK));
    }
    let sides = [(BORDER, "end", -8.0, "energy"), (SIZE[0] - BORDER, "start", 8.0, "seam length / diagonal")];
    for ((values, color), (side, anchor, shift, name)) in series.iter().zip(COLORS).zip(sides) {
        let top = most(values);
        document = document.add(line([side, BORDER], [side, SIZE[1] - BORDER]));
        document = document.add(text(name, [side, BORDER - 20.0], "middle", color));
        for tick in 0..=TICKS {
            let value = top * tick as f64 / TICKS as f64;
            document = document.add(text(&short(value), [side + shift, y(value, top) + 4.0], anchor, color));
        }
        let points: Vec<[f64; 2]> = percent.iter().zip(values).map(|(&p, &value)| [x(p), y(value, top)]).collect();
        let mut data = String::new();
        for [px, py] in &points {
            data.push_str(&format!("{}{px:.2},{py:.2}", if data.is_empty() { "M" } else { " L" }));
        }
        document =
            document.add(Path::new().set("d", data).set("fill", "none").set("stroke", color).set("stroke-width", 2));
        for [px, py] in points {
            let at = (format!("{px:.2}"), format!("{py:.2}"));
            document = document.add(Circle::new().set("cx", at.0).set("cy", at.1).set("r", 3.5).set("fill", color));
        }
    }
    format!("{document}\n").into_bytes()
}

/// Three significant digits.
fn short(value: f64) -> String {
    let digits = if value > 0.0 { (2.0 - value.log10().floor()).clamp(0.0, 6.0) as usize } else { 0 };
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn line(from: [f64; 2], to: [f64; 2]) -> Line {
    Line::new().set("x1", from[0]).set("y1", from[1]).set("x2", to[0]).set("y2", to[1]).set("stroke", INK)
}

fn text(content: &str, at: [f64; 2], anchor: &str, color: &str) -> Text {
    let (x, y) = (format!("{:.2}", at[0]), format!("{:.2}", at[1]));
    Text::new(content).set("x", x).set("y", y).set("text-anchor", anchor).set("fill", color)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chart_is_an_svg_with_a_point_per_row_and_series() {
        let row = |max_deviation: f64| Tradeoff {
            max_deviation,
            energy: 4.0 / max_deviation,
            seam_length: 30.0 / max_deviation,
            bound: 0.9 * max_deviation,
        };
        let chart = String::from_utf8(tradeoffs(&[row(0.5), row(1.0), row(2.0)], 100.0)).unwrap();
        assert_eq!(chart.matches("<circle").count(), 6);
        // The largest value touches the top of its axis, deviations lie where their percentage says.
        assert_eq!(chart.matches("cy=\"60.00\"").count(), 2, "{chart}");
        assert_eq!(chart.matches("cx=\"580.00\"").count(), 2, "{chart}");
        assert_eq!(chart.matches("cx=\"320.00\"").count(), 2, "{chart}");
        let options = resvg::usvg::Options::default();
        assert!(resvg::usvg::Tree::from_str(&chart, &options).is_ok());
        assert_eq!([0.0, 0.25, 1.0, 12.34, 1234.5].map(short), ["0", "0.25", "1", "12.3", "1234"]);
    }
}
