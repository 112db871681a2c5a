//! What SVG, PNG and PDF keep to.

use super::png::{Painter, PngError};
use super::*;

fn with(text: &str) -> Picture {
    let mut picture = Picture::new("p", "title", 90.0, 60.0);
    picture.text(Text::new((5.0, 30.0), text, 12.0, Anchor::Start));
    picture
}

/// The pixels of a PNG, three bytes each.
fn pixels(png: &[u8]) -> (::png::OutputInfo, Vec<u8>) {
    let mut reader = ::png::Decoder::new(std::io::Cursor::new(png))
        .read_info()
        .unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    (info, bytes)
}

/// Number of dark pixels.
fn ink(picture: &Picture) -> usize {
    let (_, bytes) = pixels(&Painter::default().png(picture).unwrap());
    bytes.chunks(3).filter(|p| p[0] < 100).count()
}

#[test]
fn text_appears_in_the_png() {
    assert_eq!(ink(&with("")), 0);
    assert!(ink(&with("position (mm)")) > 300);
    // Greek as well: λ is on many axes.
    assert!(ink(&with("λ χ²")) > 60);
}

#[test]
fn what_the_font_lacks_is_a_box_and_no_error() {
    let picture = with("山田");
    assert!(ink(&picture) > 60);
    let content = content(&picture.to_pdf());
    assert!(
        content.contains("ActualText"),
        "the PDF carries the words: {content}"
    );
}

#[test]
fn a_png_has_300_pixels_per_inch_and_says_what_the_data_are() {
    // 90 px are 60 pt.
    let mut picture = with("a");
    picture.set_note("simulated");
    let png = Painter::default().png(&picture).unwrap();
    let reader = ::png::Decoder::new(std::io::Cursor::new(&png))
        .read_info()
        .unwrap();
    let info = reader.info();
    assert_eq!((info.width, info.height), (250, 167));
    assert_eq!(info.pixel_dims.unwrap().xppu, 11_811);
    let texts: Vec<String> = (info.utf8_text.iter())
        .map(|t| format!("{}: {}", t.keyword, t.get_text().unwrap()))
        .collect();
    assert_eq!(texts, ["Title: title", "Comment: simulated"]);
    let pdf = picture.to_pdf();
    assert!(pdf.windows(20).any(|w| w == b"/Subject (simulated)"));
    assert!(picture.to_svg().contains("<desc>simulated</desc>"));
}

#[test]
fn equal_pictures_give_equal_bytes() {
    let (one, other) = (with("one"), Picture::new("q", "", 33.0, 50.0));
    let painter = Painter::default();
    let first = painter.png(&one).unwrap();
    // On a canvas that was used before, by a larger one, too.
    let another = painter.png(&other).unwrap();
    assert_eq!(painter.png(&one).unwrap(), first);
    assert_eq!(Painter::default().png(&other).unwrap(), another);
    assert_eq!(one.to_pdf(), with("one").to_pdf());
}

#[test]
fn too_large_a_png_is_an_error() {
    for side in [1e6, f64::INFINITY, 0.0, f64::NAN] {
        let picture = Picture::new("p", "", side, 10.0);
        let drawn = Painter::default().png(&picture);
        assert!(matches!(drawn, Err(PngError::Size { .. })), "{side}");
    }
}

/// The content stream of the page.
fn content(pdf: &[u8]) -> String {
    let find = |from: usize, what: &[u8]| {
        from + pdf[from..]
            .windows(what.len())
            .position(|w| w == what)
            .unwrap()
    };
    let start = find(find(0, b"4 0 obj"), b"stream") + 7;
    let end = find(start, b"endstream") - 1;
    let raw = miniz_oxide::inflate::decompress_to_vec_zlib(&pdf[start..end]).unwrap();
    String::from_utf8_lossy(&raw).into_owned()
}

#[test]
fn a_pdf_has_the_size_on_paper_and_text_that_can_be_selected() {
    let pdf = with("Aa\u{a0}a").to_pdf();
    let text = String::from_utf8_lossy(&pdf);
    assert!(text.contains("/MediaBox [0 0 60 40]"), "{text}");
    // Two letters and a space, each with its character.
    for pair in ["<0001> <0041>", "<0002> <0061>", "<0003> <00A0>"] {
        assert!(text.contains(pair), "{pair}: {text}");
    }
    assert!(text.contains("+LiberationSans") && text.contains("/FontFile2"));
    let drawn = content(&pdf);
    assert!(drawn.contains("/F 12 Tf"), "{drawn}");
    // Few letters: much smaller than the font.
    assert!(pdf.len() < 12_000, "{}", pdf.len());
}

#[test]
fn a_dot_a_line_and_a_box_are_drawn_where_they_are() {
    let mut picture = Picture::new("p", "", 90.0, 60.0);
    let red = Color(0xff, 0, 0);
    let mut boxes = Path::filled(red);
    boxes.rectangle((9.0, 9.0), (18.0, 18.0));
    picture.path(boxes);
    picture.clip([0.0, 0.0, 90.0, 40.0]);
    let mut dots = Path::drawn(Pen::new(red, 9.0).round());
    dots.dot((45.0, 30.0));
    dots.segment((72.0, 30.0), (72.0, 60.0));
    picture.path(dots);
    picture.unclip();
    let (info, bytes) = pixels(&Painter::default().png(&picture).unwrap());
    let at = |x: f64, y: f64| {
        let place = |v: f64| (v * 300.0 / 108.0) as usize;
        let i = 3 * (place(y) * info.width as usize + place(x));
        bytes[i + 1] == 0
    };
    assert!(at(13.0, 13.0) && !at(7.0, 13.0) && !at(20.0, 13.0), "box");
    assert!(at(45.0, 30.0) && at(42.0, 30.0) && !at(41.5, 26.5), "dot");
    assert!(at(72.0, 38.0) && !at(72.0, 45.0), "clipped line");
    let svg = picture.to_svg();
    assert!(
        svg.contains("M9 9H18V18H9z") && svg.contains("M45 30h0"),
        "{svg}"
    );
}
