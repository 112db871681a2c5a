//! Pictures, videos and sounds that a realization has beside what is felt.
//!
//! Only the participant's page shows and plays them. Their files are frozen with the protocol, and the SHA-256 of each is part
//! of the stimulus.

use super::keys::words;
use super::{ModelEntry, Protocol};
use serde::Serialize;
use serde_json::{Value, json};

/// [`TrialRules::media_within_ms`](super::TrialRules::media_within_ms) unless the protocol says otherwise.
pub const MEDIA_WITHIN_MS: f64 = 100.0;

words! {
    /// What a medium is.
    Medium {
        /// A picture, which is shown.
        Picture = "picture",
        /// A video, which is played once.
        Video = "video",
        /// A sound, which is played once.
        Sound = "sound",
    }
}

impl Medium {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Picture, Self::Video, Self::Sound];

    /// The formats that a file of it can have, in words.
    pub fn formats(self) -> &'static str {
        match self {
            Self::Picture => "PNG or JPEG",
            Self::Video => "WebM or MP4",
            Self::Sound => "WAV, Ogg or MP3",
        }
    }
}

/// The format of a medium's file, by its first bytes. Others are refused: an SVG, for example, can carry programs and fetch
/// other files.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MediaFormat {
    /// A picture.
    Png,
    /// A picture.
    Jpeg,
    /// A video.
    WebM,
    /// A video.
    Mp4,
    /// A sound.
    Wav,
    /// A sound.
    Ogg,
    /// A sound.
    Mp3,
}

/// Major brands of MP4 files that browsers play as videos.
const BRANDS: [&[u8]; 11] = [
    b"isom", b"iso2", b"iso3", b"iso4", b"iso5", b"iso6", b"mp41", b"mp42", b"avc1", b"M4V ",
    b"dash",
];
/// Within so many bytes a WebM file says that it is one.
const DOC_TYPE_WITHIN: usize = 64;

impl MediaFormat {
    /// The format of a file; `None` if it is none of these.
    ///
    /// ```
    /// # use study_plan::protocol::{MediaFormat, Medium};
    /// let format = MediaFormat::of(b"RIFF\x24\0\0\0WAVEfmt ").unwrap();
    /// assert_eq!((format.medium(), format.content_type()), (Medium::Sound, "audio/wav"));
    /// assert_eq!(MediaFormat::of(b"<svg xmlns='http://www.w3.org/2000/svg'/>"), None);
    /// ```
    pub fn of(bytes: &[u8]) -> Option<Self> {
        let has = |at: usize, what: &[u8]| bytes.get(at..at + what.len()) == Some(what);
        let begin = &bytes[..bytes.len().min(DOC_TYPE_WITHIN)];
        if has(0, b"\x89PNG\r\n\x1a\n") && has(12, b"IHDR") {
            Some(Self::Png)
        } else if has(0, b"\xff\xd8\xff") {
            Some(Self::Jpeg)
        } else if has(0, b"\x1a\x45\xdf\xa3") && begin.windows(4).any(|four| four == b"webm") {
            Some(Self::WebM)
        } else if has(4, b"ftyp") && BRANDS.iter().any(|brand| has(8, brand)) {
            Some(Self::Mp4)
        } else if has(0, b"RIFF") && has(8, b"WAVE") {
            Some(Self::Wav)
        } else if has(0, b"OggS") {
            Some(Self::Ogg)
        } else if has(0, b"ID3") || is_mpeg_layer_3(bytes) {
            Some(Self::Mp3)
        } else {
            None
        }
    }

    /// What it is a file of.
    pub fn medium(self) -> Medium {
        match self {
            Self::Png | Self::Jpeg => Medium::Picture,
            Self::WebM | Self::Mp4 => Medium::Video,
            Self::Wav | Self::Ogg | Self::Mp3 => Medium::Sound,
        }
    }

    /// Its media type.
    pub fn content_type(self) -> &'static str {
        match self {
            Self::Png => "image/png",
            Self::Jpeg => "image/jpeg",
            Self::WebM => "video/webm",
            Self::Mp4 => "video/mp4",
            Self::Wav => "audio/wav",
            Self::Ogg => "audio/ogg",
            Self::Mp3 => "audio/mpeg",
        }
    }
}

/// Whether bytes begin with the header of an MPEG audio frame of layer III: its eleven bits of synchronization, and no
/// reserved version, bit rate or sampling rate (ISO/IEC 11172-3, 2.4.2.3).
fn is_mpeg_layer_3(bytes: &[u8]) -> bool {
    let &[0xff, second, third, ..] = bytes else {
        return false;
    };
    let synchronized = second & 0xe0 == 0xe0;
    let version = second & 0x18 != 0x08;
    let layer = second & 0x06 == 0x02;
    let rates = third & 0xf0 != 0xf0 && third & 0x0c != 0x0c;
    synchronized && version && layer && rates
}

/// The file of a medium.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct MediaFile {
    /// Relative to the protocol, inside the protocol's folder.
    pub file: String,
    /// SHA-256 of its content, once it was read.
    pub sha256: Option<String>,
}

/// What the participant's page shows and plays of a realization while it is felt.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize)]
pub struct Media {
    /// A picture.
    pub picture: Option<MediaFile>,
    /// A video.
    pub video: Option<MediaFile>,
    /// A sound.
    pub sound: Option<MediaFile>,
    /// What is seen, for screen readers.
    pub alt: Option<String>,
    /// What is heard, as text below.
    pub caption: Option<String>,
}

impl Media {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.files().next().is_none()
    }

    /// The media with their files.
    pub fn files(&self) -> impl Iterator<Item = (Medium, &MediaFile)> {
        Medium::ALL
            .into_iter()
            .filter_map(move |medium| Some((medium, self.file(medium)?)))
    }

    /// The file of a medium.
    pub fn file(&self, medium: Medium) -> Option<&MediaFile> {
        match medium {
            Medium::Picture => self.picture.as_ref(),
            Medium::Video => self.video.as_ref(),
            Medium::Sound => self.sound.as_ref(),
        }
    }

    /// The files, to be pinned.
    pub fn files_mut(&mut self) -> impl Iterator<Item = &mut MediaFile> {
        [&mut self.picture, &mut self.video, &mut self.sound]
            .into_iter()
            .flatten()
    }

    /// Adds the content of each file to what of a realization is stimulus. Without media nothing changes, nor do the
    /// fingerprints of protocols that have none.
    pub(super) fn pin(&self, stimulus: &mut Value) {
        for (medium, file) in self.files() {
            stimulus[medium.as_str()] = json!(file.sha256);
        }
    }
}

/// What of the media is read, by realization.
pub(super) fn texts(models: &[ModelEntry]) -> Value {
    let read =
        |m: &ModelEntry| json!({ "id": m.id, "alt": m.media.alt, "caption": m.media.caption });
    models.iter().map(read).collect()
}

impl Protocol {
    /// Whether a realization has media, so that only the participant's page can present the study.
    pub fn has_media(&self) -> bool {
        self.models.iter().any(|model| !model.media.is_empty())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_format_is_known_by_its_bytes_and_what_only_looks_like_one_is_none() {
        let png: &[u8] = b"\x89PNG\r\n\x1a\n\0\0\0\x0dIHDR\0\0\0\x01";
        let webm: &[u8] = b"\x1a\x45\xdf\xa3\x9fB\x86\x81\x01B\xf7\x81\x01B\xf2\x81\x04B\xf3\x81\x08B\x82\x84webm";
        let known: [(&[u8], MediaFormat); 8] = [
            (png, MediaFormat::Png),
            (b"\xff\xd8\xff\xe0\0\x10JFIF", MediaFormat::Jpeg),
            (webm, MediaFormat::WebM),
            (b"\0\0\0\x20ftypisom\0\0\x02\0", MediaFormat::Mp4),
            (b"RIFF\x24\0\0\0WAVEfmt ", MediaFormat::Wav),
            (b"OggS\0\x02", MediaFormat::Ogg),
            (b"ID3\x04\0", MediaFormat::Mp3),
            // MPEG-1 layer III, 128 kbit/s, 44.1 kHz.
            (b"\xff\xfb\x90\x64", MediaFormat::Mp3),
        ];
        for (bytes, format) in known {
            assert_eq!(MediaFormat::of(bytes), Some(format), "{format:?}");
        }
        let matroska: &[u8] = b"\x1a\x45\xdf\xa3\x9fB\x82\x88matroska";
        let others: [&[u8]; 13] = [
            b"",
            b"\x89PNG\r\n\x1a\n",
            b"GIF89a",
            b"RIFF\x24\0\0\0WEBPVP8 ",
            matroska,
            b"\0\0\0\x14ftypqt  ",
            b"\0\0\0\x20ftypM4A ",
            // An AAC frame (layer 0), a reserved version, a bad bit rate.
            b"\xff\xf1\x50\x80",
            b"\xff\xeb\x90\x64",
            b"\xff\xfb\xf0\x64",
            b"<?xml version=\"1.0\"?><svg/>",
            b"<html><script>",
            b"fmt study-model/1",
        ];
        for other in others {
            assert_eq!(MediaFormat::of(other), None, "{other:?}");
        }
    }

    #[test]
    fn every_format_is_one_of_its_medium() {
        let all = [
            (MediaFormat::Png, "PNG"),
            (MediaFormat::Jpeg, "JPEG"),
            (MediaFormat::WebM, "WebM"),
            (MediaFormat::Mp4, "MP4"),
            (MediaFormat::Wav, "WAV"),
            (MediaFormat::Ogg, "Ogg"),
            (MediaFormat::Mp3, "MP3"),
        ];
        for (format, name) in all {
            assert!(format.medium().formats().contains(name), "{name}");
        }
    }
}
