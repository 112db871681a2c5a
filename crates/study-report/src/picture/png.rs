//! Pictures as PNG with 300 pixels per inch.

use super::font::{letters, outline, units};
use super::{BOLD, Color, Item, POINTS, Path, Picture, RIM, Step, Text};
use png::{PixelDimensions, Unit};
use std::io::Write as _;
use std::sync::{Mutex, PoisonError};
use tiny_skia::{
    FillRule, LineCap, LineJoin, Mask, Paint, PathBuilder, PixmapMut, Rect, Stroke, StrokeDash,
    Transform,
};
use ttf_parser::OutlineBuilder;

/// Pixels per inch.
const DPI: f64 = 300.0;

/// Pixels per px.
const SCALE: f32 = (DPI / 72.0 * POINTS) as f32;

/// Largest side of a picture, pixels.
const MAX_SIDE: u32 = 16_384;

/// Why a PNG cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PngError {
    /// The picture is empty or too large.
    #[error("the figure has {width} × {height} pixels; each side must have 1 to {MAX_SIDE}")]
    Size {
        /// Width, pixels.
        width: u32,
        /// Height, pixels.
        height: u32,
    },
    /// Encoding failed.
    #[error("the figure cannot be written as PNG")]
    Encoding(#[from] png::EncodingError),
}

/// Draws pictures as PNG; can be shared between threads.
#[derive(Debug, Default)]
pub struct Painter {
    /// Buffers for reuse: allocating megabytes takes as long as drawing.
    canvases: Mutex<Vec<Vec<u8>>>,
}

impl Painter {
    /// The picture as a PNG file.
    ///
    /// # Errors
    /// [`PngError`] if it is empty or too large.
    pub fn png(&self, picture: &Picture) -> Result<Vec<u8>, PngError> {
        // A size that is not finite or too large saturates.
        let pixels = |side: f64| (side as f32 * SCALE).ceil() as u32;
        let (width, height) = (pixels(picture.width), pixels(picture.height));
        if width.max(height) > MAX_SIDE {
            return Err(PngError::Size { width, height });
        }
        let canvases = || self.canvases.lock().unwrap_or_else(PoisonError::into_inner);
        let mut canvas = canvases().pop().unwrap_or_default();
        canvas.clear();
        canvas.resize(4 * width as usize * height as usize, 0xff);
        let pixmap = PixmapMut::from_bytes(&mut canvas, width, height)
            .ok_or(PngError::Size { width, height })?;
        draw(picture, pixmap);
        let png = encoded(picture, &canvas, width, height);
        canvases().push(canvas);
        Ok(png?)
    }
}

fn draw(picture: &Picture, mut pixmap: PixmapMut<'_>) {
    let mut mask = None;
    for item in &picture.items {
        match item {
            Item::Path(p) => path(&mut pixmap, p, mask.as_ref()),
            Item::Text(t) => text(&mut pixmap, t),
            Item::Clip(to) => mask = clip(&pixmap, to.map(|v| v as f32)),
            Item::Unclip => mask = None,
        }
    }
}

fn scale() -> Transform {
    Transform::from_scale(SCALE, SCALE)
}

fn paint(color: Color, opacity: f64) -> Paint<'static> {
    let mut paint = Paint::default();
    // Between 0 and 255, so the cast is exact.
    let alpha = (opacity.clamp(0.0, 1.0) * 255.0).round() as u8;
    paint.set_color_rgba8(color.0, color.1, color.2, alpha);
    paint
}

fn clip(pixmap: &PixmapMut<'_>, [left, top, right, bottom]: [f32; 4]) -> Option<Mask> {
    let mut mask = Mask::new(pixmap.width(), pixmap.height())?;
    let within = PathBuilder::from_rect(Rect::from_ltrb(left, top, right, bottom)?);
    mask.fill_path(&within, FillRule::Winding, true, scale());
    Some(mask)
}

fn path(pixmap: &mut PixmapMut<'_>, path: &Path, mask: Option<&Mask>) {
    let mut builder = PathBuilder::new();
    for step in &path.steps {
        match *step {
            Step::Move((x, y)) => builder.move_to(x as f32, y as f32),
            Step::Line((x, y)) => builder.line_to(x as f32, y as f32),
            Step::Close => builder.close(),
        }
    }
    let Some(lines) = builder.finish() else {
        return;
    };
    if let Some(color) = path.fill {
        let paint = paint(color, path.opacity);
        pixmap.fill_path(&lines, &paint, FillRule::Winding, scale(), mask);
    }
    if let Some(pen) = path.pen {
        let stroke = Stroke {
            width: pen.width as f32,
            line_cap: if pen.round {
                LineCap::Round
            } else {
                LineCap::Butt
            },
            line_join: if pen.round {
                LineJoin::Round
            } else {
                LineJoin::Miter
            },
            dash: StrokeDash::new(pen.dash.to_vec(), 0.0),
            ..Stroke::default()
        };
        let paint = paint(pen.color, path.opacity);
        pixmap.stroke_path(&lines, &paint, &stroke, scale(), mask);
    }
}

fn text(pixmap: &mut PixmapMut<'_>, t: &Text) {
    let (letters, width) = letters(&t.text);
    let mut shape = Shape(PathBuilder::new());
    outline(&letters, &mut shape);
    let Some(shape) = shape.0.finish() else {
        return;
    };
    let unit = (t.size / units()) as f32;
    let start = -(f64::from(width) * t.anchor.share()) as f32;
    let place = scale()
        .pre_translate(t.at.0 as f32, t.at.1 as f32)
        .pre_rotate(-f32::from(t.angle))
        .pre_scale(unit, -unit)
        .pre_translate(start, 0.0);
    let ink = paint(t.color, 1.0);
    let mut outlined = |paint: &Paint<'_>, px: f64| {
        let stroke = Stroke {
            width: px as f32 / unit,
            line_join: LineJoin::Round,
            ..Stroke::default()
        };
        pixmap.stroke_path(&shape, paint, &stroke, place, None);
    };
    if t.rim {
        outlined(&paint(Color::WHITE, 1.0), RIM);
    }
    if t.bold {
        outlined(&ink, t.size * BOLD);
    }
    pixmap.fill_path(&shape, &ink, FillRule::Winding, place, None);
}

/// Outlines as a path.
struct Shape(PathBuilder);

impl OutlineBuilder for Shape {
    fn move_to(&mut self, x: f32, y: f32) {
        self.0.move_to(x, y);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.0.line_to(x, y);
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.0.quad_to(x1, y1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.0.cubic_to(x1, y1, x2, y2, x, y);
    }

    fn close(&mut self) {
        self.0.close();
    }
}

/// Encodes without the alpha channel, because every picture has a white background. Fast
/// compression takes a third of the time of the default one.
fn encoded(
    picture: &Picture,
    rgba: &[u8],
    width: u32,
    height: u32,
) -> Result<Vec<u8>, png::EncodingError> {
    // Most figures compress to less than a sixteenth.
    let mut bytes = Vec::with_capacity(rgba.len() / 16);
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Fast);
    encoder.set_filter(png::Filter::Up);
    let per_meter = (DPI / 0.0254).round() as u32;
    encoder.set_pixel_dims(Some(PixelDimensions {
        xppu: per_meter,
        yppu: per_meter,
        unit: Unit::Meter,
    }));
    encoder.add_itxt_chunk("Title".to_owned(), picture.title.clone())?;
    if let Some(note) = &picture.note {
        encoder.add_itxt_chunk("Comment".to_owned(), note.clone())?;
    }
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
