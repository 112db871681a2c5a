//! JSON files that contain their own checksum.
//!
//! The last key is `sha256`: the SHA-256 of the file's bytes with the 64 digits of this
//! value replaced by zeros.

use super::error::StoreError;
use serde::Serialize;
use serde_json::Value;
use std::path::Path;
use study_base::hex::sha256;

/// Number of digits of a SHA-256 in hexadecimal.
const DIGITS: usize = 64;
/// Key of the checksum.
const KEY: &str = "sha256";

#[derive(Serialize)]
struct Sealed<'a, T> {
    #[serde(flatten)]
    content: &'a T,
    sha256: &'a str,
}

/// The bytes of a document with its checksum; `path` is for the error.
///
/// # Errors
/// [`StoreError::Unstorable`] if the document is no JSON object.
pub(super) fn seal<T: Serialize>(content: &T, path: &Path) -> Result<Vec<u8>, StoreError> {
    let blank = "0".repeat(DIGITS);
    let document = Sealed {
        content,
        sha256: &blank,
    };
    let text = serde_json::to_string_pretty(&document).map_err(|e| StoreError::Unstorable {
        path: path.to_owned(),
        what: e.to_string(),
    })?;
    let text = text + "\n";
    let sum = sha256(text.as_bytes());
    // The checksum is the last value.
    let at = text.rfind(&blank).unwrap_or_default();
    Ok([&text[..at], &sum, &text[at + DIGITS..]]
        .concat()
        .into_bytes())
}

/// Whether a document agrees with its checksum; `None` if it has none, as a file of an
/// earlier release, or is no JSON object. A checksum under another name is a damaged one.
pub(super) fn is_intact(bytes: &[u8]) -> Option<bool> {
    let document: serde_json::Map<String, Value> = serde_json::from_slice(bytes).ok()?;
    let text = std::str::from_utf8(bytes).ok()?;
    let Some(sum) = document.get(KEY) else {
        return last_value(text).is_some_and(is_sum).then_some(false);
    };
    let sum = sum.as_str().unwrap_or_default();
    let Some(at) = text.rfind(sum).filter(|_| sum.len() == DIGITS) else {
        return Some(false);
    };
    let blank = [&text[..at], &"0".repeat(DIGITS), &text[at + DIGITS..]].concat();
    Some(sha256(blank.as_bytes()) == sum)
}

/// The last value of an object, if it is a text.
fn last_value(object: &str) -> Option<&str> {
    let value = object.trim_end().strip_suffix('}')?.trim_end();
    Some(value.strip_suffix('"')?.rsplit_once('"')?.1)
}

fn is_sum(text: &str) -> bool {
    text.len() == DIGITS && text.bytes().all(|b| b.is_ascii_hexdigit())
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_changed_byte_of_a_sealed_document_is_noticed() {
        let content = json!({"format": "x/1", "note": "0".repeat(DIGITS), "n": 12});
        let bytes = seal(&content, Path::new("x.json")).unwrap();
        assert_eq!(is_intact(&bytes), Some(true));
        for at in 0..bytes.len() {
            for bit in 0..8 {
                let mut changed = bytes.clone();
                changed[at] ^= 1 << bit;
                // What is no JSON any more is an error of its own.
                let is_json = serde_json::from_slice::<Value>(&changed).is_ok();
                let found = is_intact(&changed);
                assert_eq!(found, is_json.then_some(false), "bit {bit} of byte {at}");
            }
        }
    }

    #[test]
    fn a_document_without_a_checksum_is_neither() {
        assert_eq!(is_intact(b"{\"format\": \"x/1\"}\n"), None);
        assert_eq!(is_intact(b"not JSON"), None);
        assert_eq!(is_intact(b"{\"versions\": []}\n"), None);
    }

    /// The sum of the file with zeros in its place, by `sha256sum`.
    #[test]
    fn the_checksum_is_that_of_the_file_with_zeros_in_its_place() {
        let bytes = seal(&json!({"a": 1}), Path::new("x.json")).unwrap();
        let expected = format!("{{\n  \"a\": 1,\n  \"sha256\": \"{SUM}\"\n}}\n");
        assert_eq!(String::from_utf8(bytes).unwrap(), expected);
    }

    const SUM: &str = "f3d09652b50d345e403e517cac1b3c1ace359d18c35ed93eb1729608bb3398bf";
}
