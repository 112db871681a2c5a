//! Conversion of SVG to PNG with a bundled font.
//!
//! The same SVG gives the same bytes on every machine. The font is Liberation
//! Sans (SIL Open Font License 1.1, `assets/LiberationSans-LICENSE.txt`), with Latin,
//! Greek and Cyrillic. Letters of other scripts are missing in the PNG but not in the
//! SVG and the report, which use the reader's fonts.

use resvg::tiny_skia::{PixmapMut, Transform};
use resvg::usvg::{Options, Tree, fontdb};
use std::io::Write as _;
use std::sync::{Arc, Mutex, PoisonError};

const FONT: &[u8] = include_bytes!("../../assets/LiberationSans-Regular.ttf");

/// Name of the font in SVG.
const FAMILY: &str = "Liberation Sans";

/// Pixels per CSS pixel: enough for print at 10 cm width.
const SCALE: f32 = 2.0;

/// Largest side of a picture, pixels.
const MAX_SIDE: u32 = 16_384;

/// Why a PNG cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PngError {
    /// The SVG is invalid.
    #[error("the figure cannot be drawn: {0}")]
    Svg(#[from] resvg::usvg::Error),
    /// The picture is empty or too large.
    #[error("the figure has {width} × {height} pixels; each side must have 1 to {MAX_SIDE}")]
    Size {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// Encoding failed.
    #[error("the figure cannot be written as PNG: {0}")]
    Encoding(String),
}

/// Renders SVG; can be shared between threads.
#[derive(Debug)]
pub struct Painter {
    options: Options<'static>,
    /// Buffers for reuse: allocating megabytes takes as long as drawing.
    canvases: Mutex<Vec<Vec<u8>>>,
}

impl Default for Painter {
    fn default() -> Self {
        let mut fonts = fontdb::Database::new();
        fonts.load_font_data(FONT.to_vec());
        fonts.set_sans_serif_family(FAMILY);
        let options = Options {
            font_family: FAMILY.to_owned(),
            fontdb: Arc::new(fonts),
            ..Options::default()
        };
        Self {
            options,
            canvases: Mutex::default(),
        }
    }
}

impl Painter {
    /// Converts an SVG to a PNG file.
    ///
    /// # Errors
    /// [`PngError`] if the SVG is invalid or too large.
    pub fn png(&self, svg: &str) -> Result<Vec<u8>, PngError> {
        let tree = Tree::from_str(svg, &self.options)?;
        let size = tree.size();
        // A size is finite and positive; too large a size saturates.
        let pixels = |side: f32| (side * SCALE).ceil() as u32;
        let (width, height) = (pixels(size.width()), pixels(size.height()));
        if width.max(height) > MAX_SIDE {
            return Err(PngError::Size { width, height });
        }
        let canvases = || self.canvases.lock().unwrap_or_else(PoisonError::into_inner);
        let mut canvas = canvases().pop().unwrap_or_default();
        canvas.clear();
        canvas.resize(4 * width as usize * height as usize, 0);
        let mut picture = PixmapMut::from_bytes(&mut canvas, width, height)
            .ok_or(PngError::Size { width, height })?;
        let scale = Transform::from_scale(SCALE, SCALE);
        resvg::render(&tree, scale, &mut picture);
        let png = encoded(&canvas, width, height).map_err(|e| PngError::Encoding(e.to_string()));
        canvases().push(canvas);
        png
    }
}

/// Encodes without the alpha channel, because every figure has a white background. Fast
/// compression takes a third of the time of the default one.
fn encoded(rgba: &[u8], width: u32, height: u32) -> Result<Vec<u8>, png::EncodingError> {
    // Most figures compress to less than a sixteenth.
    let mut bytes = Vec::with_capacity(rgba.len() / 16);
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Up);
    let mut writer = encoder.write_header()?;
    let mut stream = writer.stream_writer()?;
    let mut rgb = vec![0; 3 * width as usize];
    for row in rgba.chunks_exact(4 * width as usize) {
        for (out, pixel) in rgb.chunks_exact_mut(3).zip(row.chunks_exact(4)) {
            out.copy_from_slice(&pixel[..3]);
        }
        stream.write_all(&rgb)?;
    }
    stream.finish()?;
    drop(writer);
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::svg::{Axis, Figure, Panel};
    use resvg::tiny_skia::Pixmap;

    /// Dark pixels of a figure whose x axis has this label.
    fn ink(label: &str) -> usize {
        let panel = Panel::new(Axis::new(label, 0.0, 1.0), Axis::new("", 0.0, 1.0));
        let figure = Figure::new("f", "", 300.0, 200.0).with(panel);
        let png = Painter::default().png(&figure.to_svg()).unwrap();
        let picture = Pixmap::decode_png(&png).unwrap();
        let dark = picture.pixels().iter().filter(|p| p.red() < 100);
        dark.count()
    }

    #[test]
    fn text_appears_in_the_picture() {
        let bare = ink("");
        let labelled = ink("position (mm)");
        assert!(labelled > bare + 300, "{bare} {labelled}");
        // Greek as well: λ is on many axes.
        assert!(ink("λ χ²") > bare + 60);
    }

    #[test]
    fn equal_figures_give_equal_pictures() {
        let svg = Figure::new("f", "t", 40.0, 30.0).to_svg();
        let other = Figure::new("g", "another", 33.0, 50.0).to_svg();
        let painter = Painter::default();
        let first = painter.png(&svg).unwrap();
        // On a canvas that was used before, by a larger one, too.
        let another = painter.png(&other).unwrap();
        assert_eq!(painter.png(&svg).unwrap(), first);
        assert_eq!(Painter::default().png(&other).unwrap(), another);
    }

    #[test]
    fn what_is_no_figure_is_an_error() {
        assert!(matches!(
            Painter::default().png("<p>"),
            Err(PngError::Svg(_))
        ));
        let large = Figure::new("f", "", 1e6, 10.0).to_svg();
        assert!(matches!(
            Painter::default().png(&large),
            Err(PngError::Size { .. })
        ));
    }
}
