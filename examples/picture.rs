//! Puts the README's picture together from the previews of a job:
//! `cargo run --release --example picture -- out fixtures/picture.png`.
use std::{env, error::Error, fs};

use resvg::{
    tiny_skia::{Color, FilterQuality, Pixmap, PixmapPaint, Transform},
    usvg,
};

/// Height of the strip, pixels.
const HEIGHT: f32 = 420.0;
const PICTURES: [&str; 4] = ["input", "developed", "cut", "sheet-01"];

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = env::args().skip(1);
    let (Some(job), Some(target)) = (args.next(), args.next()) else {
        return Err("usage: picture OUT_DIR PICTURE.png".into());
    };
    let read = |name: &str| -> Result<Pixmap, Box<dyn Error>> {
        Ok(Pixmap::decode_png(&fs::read(format!("{job}/preview/{name}.png"))?)?)
    };
    let pictures = PICTURES.map(read).into_iter().collect::<Result<Vec<_>, _>>()?;
    let widths: Vec<f32> = pictures.iter().map(|it| HEIGHT * it.width() as f32 / it.height() as f32).collect();
    let size = usvg::Size::from_wh(widths.iter().sum(), HEIGHT).ok_or("the previews are empty")?.to_int_size();
    let mut strip = Pixmap::new(size.width(), size.height()).ok_or("the strip is empty")?;
    strip.fill(Color::WHITE);
    let mut x = 0.0;
    let paint = PixmapPaint { quality: FilterQuality::Bicubic, ..PixmapPaint::default() };
    for (picture, width) in pictures.iter().zip(&widths) {
        let scale = HEIGHT / picture.height() as f32;
        strip.draw_pixmap(
            0,
            0,
            picture.as_ref(),
            &paint,
            Transform::from_scale(scale, scale).post_translate(x, 0.0),
            None,
        );
        x += width;
    }
    fs::write(target, strip.encode_png()?)?;
    Ok(())
}
