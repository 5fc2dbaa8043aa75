//! Puts pictures of one height side by side. The README's, from the previews of its job:
//! `cargo run --release --example picture -- fixtures/picture.png out/preview/{input,developed,cut,sheet-01}.png`.
//!
//! One shape developed from three tessellations, each in a folder of its own (t is octahedron, icosahedron, cube or latitude-longitude):
//! `cargo run --release -- run fixtures/bumpy.obj --to develop --set coarsen.method=sphere --set coarsen.tessellation=t --out t`,
//! then `cargo run --release --example picture -- three.png {octahedron,icosahedron,cube,latitude-longitude}/preview/{coarse,developed}.png`.
use std::{env, error::Error, fs};

use resvg::{
    tiny_skia::{Color, FilterQuality, Pixmap, PixmapPaint, Transform},
    usvg,
};

/// Height of the strip, pixels.
const HEIGHT: f32 = 420.0;

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = env::args().skip(1);
    let target = args.next().ok_or("usage: picture TARGET.png PICTURE.png...")?;
    let read = |path: String| -> Result<Pixmap, Box<dyn Error>> { Ok(Pixmap::decode_png(&fs::read(path)?)?) };
    let pictures = args.map(read).collect::<Result<Vec<_>, _>>()?;
    let widths: Vec<f32> = pictures.iter().map(|it| HEIGHT * it.width() as f32 / it.height() as f32).collect();
    let size =
        usvg::Size::from_wh(widths.iter().sum(), HEIGHT).ok_or("the pictures are empty or missing")?.to_int_size();
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
