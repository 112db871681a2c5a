//! SVG to PNG, with one bundled font and none of the machine's.
//!
//! The same SVG gives the same bytes on every machine. The font is Liberation
//! Sans (SIL Open Font License 1.1, `assets/LiberationSans-LICENSE.txt`): Latin,
//! Greek and Cyrillic. Letters of other scripts are missing in the PNG; they are
//! in the SVG and in the report, which use the reader's fonts.

use resvg::tiny_skia::{Pixmap, Transform};
use resvg::usvg::{Options, Tree, fontdb};
use std::io::Write as _;
use std::sync::Arc;

const FONT: &[u8] = include_bytes!("../../assets/LiberationSans-Regular.ttf");

/// The name that the font has in SVG.
const FAMILY: &str = "Liberation Sans";

/// Pixels to a CSS pixel: enough for print at 10 cm width.
const SCALE: f32 = 2.0;

/// Largest side of a picture, pixels.
const MAX_SIDE: u32 = 16_384;

/// Why there is no PNG.
#[derive(Debug, thiserror::Error)]
pub enum PngError {
    /// It is no SVG that can be drawn.
    #[error("the figure cannot be drawn: {0}")]
    Svg(#[from] resvg::usvg::Error),
    /// It is empty, or larger than any picture should be.
    #[error("the figure has {width} × {height} pixels; from 1 to {MAX_SIDE} are possible")]
    Size {
        /// Pixels.
        width: u32,
        /// Pixels.
        height: u32,
    },
    /// The encoder failed.
    #[error("the figure cannot be written as PNG: {0}")]
    Encoding(String),
}

/// Draws SVG; made once, used for all figures.
#[derive(Debug)]
pub struct Painter {
    options: Options<'static>,
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
        Self { options }
    }
}

impl Painter {
    /// The picture of an SVG, as the bytes of a PNG.
    ///
    /// # Errors
    /// [`PngError`] for what is no SVG, or too large.
    pub fn png(&self, svg: &str) -> Result<Vec<u8>, PngError> {
        let tree = Tree::from_str(svg, &self.options)?;
        let size = tree.size();
        // A size is finite and positive; what is too large saturates.
        let pixels = |side: f32| (side * SCALE).ceil() as u32;
        let (width, height) = (pixels(size.width()), pixels(size.height()));
        let mut picture = Some((width, height))
            .filter(|(w, h)| *w.max(h) <= MAX_SIDE)
            .and_then(|(w, h)| Pixmap::new(w, h))
            .ok_or(PngError::Size { width, height })?;
        let scale = Transform::from_scale(SCALE, SCALE);
        resvg::render(&tree, scale, &mut picture.as_mut());
        encoded(&picture).map_err(|e| PngError::Encoding(e.to_string()))
    }
}

/// Three bytes a pixel: every figure has a white ground, so nothing shows through.
/// Fast compression takes a third of the time of the usual one.
fn encoded(picture: &Pixmap) -> Result<Vec<u8>, png::EncodingError> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, picture.width(), picture.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Up);
    let mut writer = encoder.write_header()?;
    let mut stream = writer.stream_writer()?;
    let width = picture.width() as usize;
    let mut rgb = vec![0; 3 * width];
    for row in picture.data().chunks_exact(4 * width) {
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
        let painter = Painter::default();
        assert_eq!(
            painter.png(&svg).unwrap(),
            Painter::default().png(&svg).unwrap()
        );
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
