//! Colours for pictures.

/// sRGB, 8 bits each.
pub type Rgb = [u8; 3];

/// The `index`-th of a series of colours of equal lightness and strength whose hues stay apart however many there are
/// (steps of the golden angle around the OKLCH circle).
pub fn palette(index: usize) -> Rgb {
    const LIGHTNESS: f64 = 0.80;
    const CHROMA: f64 = 0.10;
    /// 360° / φ², radians.
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    let hue = 0.9 + GOLDEN_ANGLE * index as f64;
    oklab(LIGHTNESS, CHROMA * hue.cos(), CHROMA * hue.sin())
}

/// From OKLab to sRGB (B. Ottosson, "A perceptual color space for image processing", 2020).
fn oklab(lightness: f64, a: f64, b: f64) -> Rgb {
    let cube = |it: f64| it * it * it;
    let l = cube(lightness + 0.396_337_777_4 * a + 0.215_803_757_3 * b);
    let m = cube(lightness - 0.105_561_345_8 * a - 0.063_854_172_8 * b);
    let s = cube(lightness - 0.089_484_177_5 * a - 1.291_485_548_0 * b);
    [
        4.076_741_662_1 * l - 3.307_711_591_3 * m + 0.230_969_929_2 * s,
        -1.268_438_004_6 * l + 2.609_757_401_1 * m - 0.341_319_396_5 * s,
        -0.004_196_086_3 * l - 0.703_418_614_7 * m + 1.707_614_701_0 * s,
    ]
    .map(encode)
}

/// Linear light in [0, 1] to an sRGB byte (IEC 61966-2-1).
pub(super) fn encode(linear: f64) -> u8 {
    let linear = linear.clamp(0.0, 1.0);
    let encoded = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * linear.powf(1.0 / 2.4) - 0.055 };
    (encoded * 255.0).round() as u8
}

/// An sRGB byte to linear light in [0, 1].
pub(super) fn decode(byte: u8) -> f64 {
    let encoded = f64::from(byte) / 255.0;
    if encoded <= 0.040_45 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_survive_linear_light() {
        assert!((0..=255).all(|it| encode(decode(it)) == it));
    }

    #[test]
    fn white_is_white_and_neighbours_differ() {
        assert_eq!(oklab(1.0, 0.0, 0.0), [255; 3]);
        for i in 0..40 {
            for j in 0..i {
                assert_ne!(palette(i), palette(j));
            }
        }
    }
}
