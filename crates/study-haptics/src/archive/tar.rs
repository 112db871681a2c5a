//! The container of a bundle: a plain tar archive (POSIX ustar) in one form only.
//!
//! Files only, sorted by name; mode 0644, owner 0, time 0; two blocks of zeros at the end. Equal
//! files therefore give equal bytes, and a reader can refuse everything else: an entry is what its
//! name, its size and this form make of it, or the archive was not written here. No link, folder or
//! long name can be expressed.

use std::cmp::Ordering;
use study_base::text::Untrusted;

/// Bytes of a block.
const BLOCK: usize = 512;
/// Most bytes of an archive.
pub const MAX_BYTES: usize = 256 * 1024 * 1024;
/// Most files of an archive.
pub(super) const MAX_FILES: usize = 100;
/// Most bytes of a name; the field has 100.
const MAX_NAME: usize = 99;

/// Why an archive cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages have the meanings")]
pub enum TarError {
    #[error("{bytes} bytes, more than {most}", most = MAX_BYTES)]
    TooLarge { bytes: usize },
    #[error("more than {most} files", most = MAX_FILES)]
    TooMany,
    #[error("it is not a tar archive")]
    NotTar,
    #[error("it ends within a file: the copy is not complete")]
    Incomplete,
    #[error("bytes follow the end of the archive")]
    Trailing,
    #[error("a file in it has no name")]
    NoName,
    #[error("the name `{}` could lead out of a folder", Untrusted(.0))]
    Name(String),
    #[error("`{0}` is {1}, and a bundle has files only")]
    Kind(String, &'static str),
    #[error("`{0}` is not in the order of the names, or occurs twice")]
    Order(String),
    #[error("the header of `{0}` was changed: name, mode, owner, time or checksum")]
    Header(String),
}

/// Whether a name can be that of an entry: components of `A-Z a-z 0-9 . _ -` that do not begin
/// with a dot.
fn is_plain(name: &str) -> bool {
    let allowed = |c: char| c.is_ascii_alphanumeric() || "._-".contains(c);
    let component = |part: &str| !part.is_empty() && !part.starts_with('.');
    name.len() <= MAX_NAME
        && name
            .split('/')
            .all(|part| component(part) && part.chars().all(allowed))
}

/// The header of a file.
fn header(name: &str, size: usize) -> [u8; BLOCK] {
    let mut block = [0; BLOCK];
    let mut put = |at: usize, text: &str| {
        block[at..at + text.len()].copy_from_slice(text.as_bytes());
    };
    put(0, name);
    put(100, "0000644\0");
    put(108, "0000000\0");
    put(116, "0000000\0");
    put(124, &format!("{size:011o}\0"));
    put(136, "00000000000\0");
    // the checksum counts its own field as spaces
    put(148, "        ");
    put(156, "0");
    put(257, "ustar\x0000");
    let sum: u32 = block.iter().map(|byte| u32::from(*byte)).sum();
    block[148..156].copy_from_slice(format!("{sum:06o}\0 ").as_bytes());
    block
}

/// The archive of some files, which have to be sorted by name.
///
/// # Errors
/// [`TarError::TooLarge`].
pub(super) fn write(files: &[(String, Vec<u8>)]) -> Result<Vec<u8>, TarError> {
    let bytes = |(_, content): &(String, Vec<u8>)| BLOCK + content.len().next_multiple_of(BLOCK);
    let bytes = files.iter().map(bytes).sum::<usize>() + 2 * BLOCK;
    if bytes > MAX_BYTES {
        return Err(TarError::TooLarge { bytes });
    }
    let mut out = Vec::with_capacity(bytes);
    for (name, content) in files {
        out.extend_from_slice(&header(name, content.len()));
        out.extend_from_slice(content);
        out.resize(out.len().next_multiple_of(BLOCK), 0);
    }
    out.resize(bytes, 0);
    Ok(out)
}

/// The files of an archive.
///
/// # Errors
/// [`TarError`] for everything that [`write`] does not write.
pub(super) fn read(bytes: &[u8]) -> Result<Vec<(String, Vec<u8>)>, TarError> {
    if bytes.len() > MAX_BYTES {
        return Err(TarError::TooLarge { bytes: bytes.len() });
    }
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    let mut rest = bytes;
    loop {
        let Some((block, after)) = rest.split_first_chunk::<BLOCK>() else {
            return Err(match files.is_empty() {
                true => TarError::NotTar,
                false => TarError::Incomplete,
            });
        };
        if block.iter().all(|byte| *byte == 0) && !files.is_empty() {
            return match after.len().cmp(&BLOCK) {
                Ordering::Less => Err(TarError::Incomplete),
                Ordering::Equal if after.iter().all(|byte| *byte == 0) => Ok(files),
                Ordering::Equal | Ordering::Greater => Err(TarError::Trailing),
            };
        }
        if &block[257..262] != b"ustar" {
            return Err(match files.last() {
                None => TarError::NotTar,
                Some((name, _)) => TarError::Header(format!("{name}, or of the file after it,")),
            });
        }
        let (name, size) = entry(block)?;
        if files.len() == MAX_FILES {
            return Err(TarError::TooMany);
        }
        if files.last().is_some_and(|(before, _)| *before >= name) {
            return Err(TarError::Order(name));
        }
        let stored = size.next_multiple_of(BLOCK);
        let content = after.get(..stored).ok_or(TarError::Incomplete)?;
        if content[size..].iter().any(|byte| *byte != 0) {
            return Err(TarError::Header(name));
        }
        rest = &after[stored..];
        files.push((name, content[..size].to_vec()));
    }
}

/// Name and size of a header.
fn entry(block: &[u8; BLOCK]) -> Result<(String, usize), TarError> {
    let field = |at: usize, most: usize| {
        let field = &block[at..at + most];
        let end = field.iter().position(|byte| *byte == 0).unwrap_or(most);
        String::from_utf8_lossy(&field[..end]).into_owned()
    };
    let name = field(0, MAX_NAME + 1);
    if name.is_empty() {
        return Err(TarError::NoName);
    }
    if !is_plain(&name) || block[345] != 0 {
        return Err(TarError::Name(name));
    }
    let kind = match block[156] {
        b'0' => None,
        b'1' | b'2' => Some("a link"),
        b'5' => Some("a folder"),
        _ => Some("no plain file"),
    };
    if let Some(kind) = kind {
        return Err(TarError::Kind(name, kind));
    }
    let size = usize::from_str_radix(&field(124, 12), 8).unwrap_or(usize::MAX);
    if size > MAX_BYTES {
        return Err(TarError::TooLarge { bytes: size });
    }
    match header(&name, size) == *block {
        true => Ok((name, size)),
        false => Err(TarError::Header(name)),
    }
}
