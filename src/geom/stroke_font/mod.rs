//! Lettering in single strokes, for pens, knives and lasers: the Hershey Roman Simplex alphabet.

mod glyphs;

use super::Vec2;

/// Height of the capitals in font units; the baseline is at 0.
const CAP_HEIGHT: f64 = 21.0;

/// One character in font units, y up.
struct Glyph {
    left: i8,
    right: i8,
    strokes: &'static [&'static [[i8; 2]]],
}

/// A line of text as strokes. Its lower left corner is the origin, the baseline runs along x.
#[derive(Debug, Clone, PartialEq)]
pub struct Lettering {
    /// Polylines of at least two points, mm.
    pub strokes: Vec<Vec<Vec2>>,
    /// Extent of the strokes, from the origin, mm.
    pub size: Vec2,
}

/// The row of a character; one that the font lacks is drawn as `?`.
fn glyph(character: char) -> &'static Glyph {
    // The degree sign follows the printable ASCII characters.
    let place =
        |it: char| if it == '°' { Some(95) } else { (it as usize).checked_sub(' ' as usize).filter(|&i| i < 95) };
    let row = |it: char| place(it).and_then(|i| glyphs::GLYPHS.get(i));
    row(character).or_else(|| row('?')).expect("the table holds `?`")
}

/// Whether every character has a shape of its own (printable ASCII and the degree sign).
pub fn covers(text: &str) -> bool {
    text.chars().all(|it| matches!(it, ' '..='~' | '°'))
}

/// Strokes of one line of `text` with capitals `height` mm high. Characters that the font lacks become `?`
/// (ask [`covers`] first where that matters). Blank text gives no strokes and no size.
pub fn letter(text: &str, height: f64) -> Lettering {
    let scale = height / CAP_HEIGHT;
    let mut strokes: Vec<Vec<Vec2>> = Vec::new();
    let mut pen = 0.0;
    for glyph in text.chars().map(glyph) {
        let origin = pen - f64::from(glyph.left);
        strokes.extend(glyph.strokes.iter().map(|stroke| {
            stroke.iter().map(|&[x, y]| Vec2::new(origin + f64::from(x), f64::from(y)) * scale).collect::<Vec<_>>()
        }));
        pen = origin + f64::from(glyph.right);
    }
    if strokes.is_empty() {
        return Lettering { strokes, size: Vec2::zeros() };
    }
    let bounds = super::Box2::of(strokes.iter().flatten());
    for point in strokes.iter_mut().flatten() {
        *point -= bounds.min;
    }
    Lettering { strokes, size: bounds.size() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_printable_character_but_the_space_has_its_own_strokes() {
        let shapes: Vec<_> = (' '..='~').chain(['°']).map(|it| letter(&it.to_string(), 10.0).strokes).collect();
        assert!(shapes[0].is_empty());
        for (i, shape) in shapes.iter().enumerate().skip(1) {
            assert!(!shape.is_empty() && shape.iter().all(|stroke| stroke.len() >= 2), "character {i}");
            // The alphabet draws `I` and `l` alike.
            let twin = shapes[..i].iter().position(|it| it == shape).map(|k| b' ' + k as u8);
            assert!(twin.is_none() || (twin, i) == (Some(b'I'), usize::from(b'l' - b' ')), "character {i}: {twin:?}");
        }
        assert!(covers("Part A-1 ~ 90°") && !covers("Größe"));
        assert_eq!(letter("ß", 5.0), letter("?", 5.0));
    }

    #[test]
    fn size_is_the_extent_of_the_strokes() {
        let text = letter("AB 10", 6.0);
        let bounds = crate::geom::Box2::of(text.strokes.iter().flatten());
        assert_eq!(bounds.min, Vec2::zeros());
        assert_eq!(bounds.max, text.size);
        assert!((text.size.y - 6.0).abs() < 1e-12);
    }
}
