//! Terms of use as the formats of archives write them.
//!
//! ```
//! use study_base::license::{spdx, spdx_address};
//!
//! assert_eq!(spdx("CC-BY-4.0"), Some("CC-BY-4.0"));
//! assert_eq!(spdx("any use, with credit"), None);
//! assert_eq!(spdx_address("CC0-1.0"), "https://spdx.org/licenses/CC0-1.0.html");
//! ```

/// The license as an SPDX identifier, if it can be one.
pub fn spdx(license: &str) -> Option<&str> {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "-._".contains(c);
    Some(license).filter(|id| !id.is_empty() && id.chars().all(allowed))
}

/// The page of a license that has an identifier.
pub fn spdx_address(id: &str) -> String {
    format!("https://spdx.org/licenses/{id}.html")
}
