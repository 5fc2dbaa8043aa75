//! Headless pictures of meshes and sheets, as PNG. Deterministic: no GPU, no fonts, no threads.

mod color;
mod mesh;
mod sheet;

pub use color::{Rgb, palette};
pub use mesh::{Edges, MeshStyle, Scene, Stroke, Up, mesh, scene, seen};
use resvg::tiny_skia::{ColorU8, Pixmap};
pub use sheet::{SheetStyle, lines, sheet};

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
pub enum RenderError {
    /// Nothing to allocate, or too much.
    #[error("a picture of {width} × {height} pixels cannot be made")]
    Size {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
    },
    /// The encoder failed.
    #[error("the picture cannot be encoded: {0}")]
    Png(String),
}

/// Largest side of a picture, pixels: its supersampled buffers then stay under 2 GB.
const LARGEST: u32 = 4096;

/// An opaque picture from rows of colours.
fn png(width: u32, height: u32, colors: &[Rgb]) -> Result<Vec<u8>, RenderError> {
    let mut pixmap = Pixmap::new(width, height).ok_or(RenderError::Size { width, height })?;
    for (pixel, [r, g, b]) in pixmap.pixels_mut().iter_mut().zip(colors) {
        *pixel = ColorU8::from_rgba(*r, *g, *b, u8::MAX).premultiply();
    }
    encode(&pixmap)
}

/// Pictures of one size side by side, `columns` in a row.
pub fn tiles(pictures: &[Vec<Rgb>], [width, height]: [u32; 2], columns: usize) -> Result<Vec<u8>, RenderError> {
    let columns = columns.min(pictures.len()).max(1);
    let rows = pictures.len().div_ceil(columns);
    let (w, h) = (width as usize, height as usize);
    let mut pixels = vec![[u8::MAX; 3]; columns * w * rows * h];
    for (k, picture) in pictures.iter().enumerate() {
        for (y, line) in picture.chunks_exact(w).enumerate() {
            let at = ((k / columns) * h + y) * columns * w + (k % columns) * w;
            pixels[at..at + w].copy_from_slice(line);
        }
    }
    png(width * columns as u32, height * rows as u32, &pixels)
}

fn encode(pixmap: &Pixmap) -> Result<Vec<u8>, RenderError> {
    pixmap.encode_png().map_err(|error| RenderError::Png(error.to_string()))
}
