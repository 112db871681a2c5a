//! Interleaved tracks.

use study_base::rng::Stream;

/// The order of interleaved tracks: each pass takes every unfinished track once. A
/// shuffled pass draws the order of all tracks, finished ones too, so that the number
/// of draws does not depend on the answers.
#[derive(Debug)]
pub struct Passes {
    tracks: usize,
    stream: Option<Stream>,
    rest: Vec<usize>,
}

impl Passes {
    /// `tracks` tracks, in their order, or in a new order in each pass.
    pub fn new(tracks: usize, shuffle: Option<Stream>) -> Self {
        Self {
            tracks,
            stream: shuffle,
            rest: Vec::new(),
        }
    }

    /// The track whose turn it is, from 0; `None` when all have ended.
    pub fn next(&mut self, has_ended: impl Fn(usize) -> bool) -> Option<usize> {
        if (0..self.tracks).all(&has_ended) {
            return None;
        }
        loop {
            if self.rest.is_empty() {
                let mut pass: Vec<usize> = (0..self.tracks).collect();
                if let Some(stream) = &mut self.stream {
                    stream.shuffle(&mut pass);
                }
                pass.reverse();
                self.rest = pass;
            }
            let track = self.rest.pop()?;
            if !has_ended(track) {
                return Some(track);
            }
        }
    }
}
