//! The uploaded table and the checks before it may be played.

use crate::certificate::{self, Certificate};
use crate::message::{Node, Refusal, TableBegin, TableChunk, UploadCrc};
use crate::predict::{BranchView, Lookup, TableView};

/// Limits of a device for every upload.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Largest force, N.
    pub force_n: f64,
    /// Largest velocity limit, mm/s.
    pub velocity_mm_s: f64,
    /// Largest stiffness of a table that the device renders stably, N/mm.
    pub stiffness_n_per_mm: f64,
    /// Largest damping of a table that the device renders stably, N·s/mm.
    pub damping_n_s_per_mm: f64,
    /// Lowest and highest position of the handle, mm.
    pub stroke_mm: [f64; 2],
}

/// A table with a capacity of `N` nodes.
#[derive(Debug, Clone)]
pub(super) struct TableBuffer<const N: usize> {
    x_mm: [f64; N],
    /// m, b, k, F0 for v > 0; below for v < 0.
    positive: [[f64; N]; 4],
    negative: [[f64; N]; 4],
    len: usize,
    pub(super) begin: Option<TableBegin>,
    crc: UploadCrc,
}

/// A refusal and its detail, see [`Refusal`].
pub(super) type Refused = (Refusal, u32);

impl<const N: usize> TableBuffer<N> {
    pub(super) fn new() -> Self {
        Self {
            x_mm: [0.0; N],
            positive: [[0.0; N]; 4],
            negative: [[0.0; N]; 4],
            len: 0,
            begin: None,
            crc: UploadCrc::default(),
        }
    }

    /// Begins a new upload in place of the old one.
    pub(super) fn begin(&mut self, begin: &TableBegin) -> Result<(), Refused> {
        self.clear();
        let fits = usize::from(begin.nodes) <= N;
        require(fits, Refusal::TooMany, N as u32)?;
        self.crc = UploadCrc::of_table(begin);
        self.begin = Some(*begin);
        Ok(())
    }

    pub(super) fn clear(&mut self) {
        self.begin = None;
        self.len = 0;
    }

    pub(super) fn chunk(&mut self, chunk: &TableChunk) -> Result<(), Refused> {
        let Some(begin) = &self.begin else {
            return Err((Refusal::WrongState, 0));
        };
        let nodes = chunk.nodes.as_slice();
        let next = usize::from(chunk.first) == self.len;
        require(next, Refusal::Order, self.len as u32)?;
        let fits = self.len + nodes.len() <= usize::from(begin.nodes);
        require(fits, Refusal::TooMany, u32::from(begin.nodes))?;
        for node in nodes {
            self.add(node);
        }
        Ok(())
    }

    fn add(&mut self, node: &Node) {
        let at = self.len;
        self.x_mm[at] = node.x_mm;
        for parameter in 0..4 {
            self.positive[parameter][at] = node.positive[parameter];
            self.negative[parameter][at] = node.negative[parameter];
        }
        self.crc.node(node);
        self.len += 1;
    }

    pub(super) fn crc(&self) -> u32 {
        self.crc.value()
    }

    pub(super) fn view(&self) -> TableView<'_> {
        let lookup = self.begin.map(|begin| begin.lookup);
        TableView {
            x_mm: &self.x_mm[..self.len],
            positive: branch(&self.positive, self.len),
            negative: branch(&self.negative, self.len),
            lookup: lookup.unwrap_or(Lookup::Linear),
        }
    }

    /// Checks that the table is complete and may be played; its force limit, N.
    pub(super) fn validate(&self, crc: u32, bounds: &Bounds) -> Result<f64, Refused> {
        let Some(begin) = &self.begin else {
            return Err((Refusal::WrongState, 0));
        };
        let complete = self.len == usize::from(begin.nodes);
        require(complete, Refusal::Incomplete, self.len as u32)?;
        require(self.crc() == crc, Refusal::Checksum, self.crc())?;
        self.check_evaluable(begin)?;
        check_limits(begin, bounds)?;
        let range = certificate::Range {
            x_mm: begin.range_mm,
            v_mm_s: begin.trained_mm_s,
        };
        let certificate = certificate::certify(&self.view(), begin.direction, range);
        match (check_physics(&certificate, bounds), begin.uncertified_n) {
            (Ok(()), _) => Ok(begin.force_n),
            (Err(_), Some(cap_n)) => Ok(cap_n.min(begin.force_n)),
            (Err(refused), None) => Err(refused),
        }
    }

    /// Checks that the force is defined at every position.
    fn check_evaluable(&self, begin: &TableBegin) -> Result<(), Refused> {
        let bad = |node: usize| Err((Refusal::BadTable, node as u32));
        if self.len < 2 {
            return bad(self.len);
        }
        for node in 0..self.len {
            let ascends = node == 0 || self.x_mm[node - 1] < self.x_mm[node];
            let mut parameters = self.positive.iter().chain(&self.negative);
            let finite =
                self.x_mm[node].is_finite() && parameters.all(|values| values[node].is_finite());
            if !(ascends && finite) {
                return bad(node);
            }
        }
        let [low, high] = begin.range_mm;
        let ordered = low.is_finite() && high.is_finite() && low < high;
        let known = begin.direction.delta_mm().is_none_or(positive);
        if ordered && known && positive(begin.trained_mm_s) {
            Ok(())
        } else {
            bad(self.len)
        }
    }
}

fn branch<const N: usize>(parameters: &[[f64; N]; 4], len: usize) -> BranchView<'_> {
    let [m, b, k, f0] = parameters;
    BranchView {
        m_kg: &m[..len],
        b_n_s_per_mm: &b[..len],
        k_n_per_mm: &k[..len],
        f0_n: &f0[..len],
    }
}

/// Checks that every limit is finite, positive and not above the device's.
fn check_limits(begin: &TableBegin, bounds: &Bounds) -> Result<(), Refused> {
    let within = |value: f64, most: f64| positive(value) && value <= most;
    let cap_fits = begin
        .uncertified_n
        .is_none_or(|cap| within(cap, bounds.force_n));
    let ([low, high], [lowest, highest]) = (begin.range_mm, bounds.stroke_mm);
    let force = within(begin.force_n, bounds.force_n) && cap_fits;
    require(force, Refusal::Limit, 1)?;
    let velocity = within(begin.velocity_mm_s, bounds.velocity_mm_s);
    require(velocity, Refusal::Limit, 2)?;
    require(low >= lowest && high <= highest, Refusal::Limit, 3)
}

/// Conditions for playing a table without the explicit permission to play it
/// uncertified.
fn check_physics(certificate: &Certificate, bounds: &Bounds) -> Result<(), Refused> {
    let c = certificate;
    require(c.mass.holds(), Refusal::Uncertified, 1)?;
    require(c.damping.holds(), Refusal::Uncertified, 2)?;
    require(c.hysteresis.holds(), Refusal::Uncertified, 3)?;
    // NaN is not within a bound.
    let stiffness = c.stiffness_n_per_mm <= bounds.stiffness_n_per_mm;
    require(stiffness, Refusal::Limit, 4)?;
    let damping = c.damping_n_s_per_mm <= bounds.damping_n_s_per_mm;
    require(damping, Refusal::Limit, 5)
}

/// A refusal with its detail unless `satisfied`.
pub(super) fn require(satisfied: bool, refusal: Refusal, detail: u32) -> Result<(), Refused> {
    if satisfied {
        Ok(())
    } else {
        Err((refusal, detail))
    }
}

fn positive(value: f64) -> bool {
    value.is_finite() && value > 0.0
}
