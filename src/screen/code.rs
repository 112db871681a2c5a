//! A link as a code that a camera reads.

use qrcodegen::{QrCode, QrCodeEcc};

/// Modules of light around the code, which cameras need.
const MARGIN: i32 = 2;

/// The lines of the code, two modules a character: light modules are drawn, so that the
/// code is right on a dark terminal; cameras read it on a light one, too. `None` for a
/// link that is too long.
pub(super) fn code(link: &str) -> Option<Vec<String>> {
    let code = QrCode::encode_text(link, QrCodeEcc::Low).ok()?;
    let (from, to) = (-MARGIN, code.size() + MARGIN);
    let light = |x, y| !code.get_module(x, y);
    let cell = |x, y| match (light(x, y), light(x, y + 1)) {
        (true, true) => '█',
        (true, false) => '▀',
        (false, true) => '▄',
        (false, false) => ' ',
    };
    let rows = (from..to).step_by(2);
    Some(
        rows.map(|y| (from..to).map(|x| cell(x, y)).collect())
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_fits_on_a_small_terminal() {
        let link = format!(
            "http://[2001:db8:1234:5678:9abc:def0:1234:5678]:65535/#{}",
            "f".repeat(32)
        );
        let lines = code(&link).unwrap();
        assert!(lines.len() <= 22, "{}", lines.len());
        assert!(lines.iter().all(|l| l.chars().count() <= 45));
        // The margin and a finder pattern in the corner.
        assert!(lines[0].chars().all(|c| c == '█'));
        assert!(lines[1].starts_with("██ ▄▄▄▄▄ "), "{}", lines[1]);
    }
}
