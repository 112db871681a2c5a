//! The Sobol sequence in up to eight dimensions, with a random digital shift.

use super::lattice::MAX_AXES;
use study_base::rng::Stream;

/// Primitive polynomials and initial numbers of Joe & Kuo (2008, SIAM Journal on Scientific Computing 30; new-joe-kuo-6.21201), from the second
/// dimension on: coefficients a between the first and the last, and m; the degree is the number of m.
const DIRECTIONS: [(u32, &[u32]); 2 * MAX_AXES - 1] = [
    (0, &[1]),
    (1, &[1, 3]),
    (1, &[1, 3, 1]),
    (2, &[1, 1, 1]),
    (1, &[1, 1, 3, 3]),
    (4, &[1, 3, 5, 13]),
    (2, &[1, 1, 5, 5, 17]),
];

const BITS: usize = 32;

/// The sequence, as fractions of 2³².
#[derive(Debug, Clone)]
pub(super) struct Sobol {
    directions: Vec<[u32; BITS]>,
    shift: Vec<u32>,
    at: Vec<u32>,
    index: u32,
}

impl Sobol {
    /// Before its first point, in Gray code order. All numbers of a dimension are combined with its shift by exclusive or; the
    /// shifts are the upper halves of the stream's next numbers.
    pub(super) fn new(dimensions: usize, stream: &mut Stream) -> Self {
        let shift = (0..dimensions).map(|_| (stream.next_u64() >> 32) as u32);
        Self {
            directions: (0..dimensions).map(directions).collect(),
            shift: shift.collect(),
            at: vec![0; dimensions],
            index: 0,
        }
    }

    /// The next point.
    pub(super) fn next(&mut self) -> Vec<u32> {
        let point = self.at.iter().zip(&self.shift).map(|(x, s)| x ^ s);
        let point = point.collect();
        // The lowest bit of the index that is 0.
        let bit = self.index.trailing_ones() as usize % BITS;
        for (x, directions) in self.at.iter_mut().zip(&self.directions) {
            *x ^= directions[bit];
        }
        self.index = self.index.wrapping_add(1);
        point
    }
}

/// The direction numbers of a dimension, from 0.
fn directions(dimension: usize) -> [u32; BITS] {
    let mut found = [0u32; BITS];
    let Some((a, m)) = dimension.checked_sub(1).map(|d| DIRECTIONS[d]) else {
        for (k, v) in found.iter_mut().enumerate() {
            *v = 1 << (BITS - 1 - k);
        }
        return found;
    };
    let degree = m.len();
    for k in 0..BITS {
        found[k] = match m.get(k) {
            Some(m) => m << (BITS - 1 - k),
            None => {
                let mut v = found[k - degree] ^ (found[k - degree] >> degree);
                for j in 1..degree {
                    if (a >> (degree - 1 - j)) & 1 == 1 {
                        v ^= found[k - j];
                    }
                }
                v
            }
        };
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scipy 1.17.1: `qmc.Sobol(8, scramble=False, bits=32)`, points 1, 2, 3, 5, 17 and 40, times 2³².
    const KNOWN: [(usize, [u32; 8]); 6] = [
        (1, [2_147_483_648; 8]),
        (
            2,
            [
                3_221_225_472,
                1_073_741_824,
                1_073_741_824,
                1_073_741_824,
                3_221_225_472,
                3_221_225_472,
                1_073_741_824,
                3_221_225_472,
            ],
        ),
        (
            3,
            [
                1_073_741_824,
                3_221_225_472,
                3_221_225_472,
                3_221_225_472,
                1_073_741_824,
                1_073_741_824,
                3_221_225_472,
                1_073_741_824,
            ],
        ),
        (
            5,
            [
                3_758_096_384,
                3_758_096_384,
                536_870_912,
                1_610_612_736,
                3_758_096_384,
                2_684_354_560,
                3_758_096_384,
                1_610_612_736,
            ],
        ),
        (
            17,
            [
                2_550_136_832,
                4_160_749_568,
                4_160_749_568,
                671_088_640,
                3_355_443_200,
                2_013_265_920,
                134_217_728,
                1_476_395_008,
            ],
        ),
        (
            40,
            [
                1_006_632_960,
                335_544_320,
                1_140_850_688,
                4_227_858_432,
                3_019_898_880,
                3_154_116_608,
                3_154_116_608,
                1_543_503_872,
            ],
        ),
    ];

    #[test]
    fn the_sequence_is_that_of_scipy() {
        let mut sobol = Sobol::new(8, &mut Stream::new(1, &["sobol"]));
        let shift = sobol.shift.clone();
        assert_ne!(shift[0], shift[1]);
        let points: Vec<Vec<u32>> = (0..64).map(|_| sobol.next()).collect();
        assert_eq!(points[0], shift);
        for (index, expected) in KNOWN {
            let found: Vec<u32> = points[index]
                .iter()
                .zip(&shift)
                .map(|(x, s)| x ^ s)
                .collect();
            assert_eq!(found, expected, "point {index}");
        }
    }
}
