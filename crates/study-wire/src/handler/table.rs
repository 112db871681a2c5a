//! The uploaded table and the checks before it may be played.

use crate::certificate::{Certificate, Certifier, Range};
use crate::elements::{self, ElementsView, Spring};
use crate::message::{ElementsBegin, Node, Refusal, TableBegin, TableChunk, UploadCrc};
use crate::predict::{BranchView, Lookup, TableView};
use crate::real::Real;

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

/// Nodes of a table in the servo's precision.
#[derive(Debug, Clone)]
struct Nodes<const N: usize, R> {
    x_mm: [R; N],
    /// m, b, k, F0 for v > 0; below for v < 0.
    positive: [[R; N]; 4],
    negative: [[R; N]; 4],
}

impl<const N: usize, R: Real> Nodes<N, R> {
    const fn new() -> Self {
        Self {
            x_mm: [R::ZERO; N],
            positive: [[R::ZERO; N]; 4],
            negative: [[R::ZERO; N]; 4],
        }
    }

    fn set(&mut self, at: usize, node: &Node) {
        self.x_mm[at] = R::of(node.x_mm);
        for parameter in 0..4 {
            self.positive[parameter][at] = R::of(node.positive[parameter]);
            self.negative[parameter][at] = R::of(node.negative[parameter]);
        }
    }

    /// Whether node `at` has only finite numbers and lies behind the one before it.
    fn evaluable(&self, at: usize) -> bool {
        let ascends = at == 0 || self.x_mm[at - 1] < self.x_mm[at];
        let mut parameters = self.positive.iter().chain(&self.negative);
        ascends && self.x_mm[at].is_finite() && parameters.all(|values| values[at].is_finite())
    }

    /// The first `len` nodes.
    fn view(&self, len: usize, lookup: Lookup) -> TableView<'_, R> {
        TableView {
            x_mm: &self.x_mm[..len],
            positive: branch(&self.positive, len),
            negative: branch(&self.negative, len),
            lookup,
        }
    }

    /// The first `len` nodes of elements, see [`Node::of_elements`].
    fn elements<'a>(
        &'a self,
        len: usize,
        mass_kg: R,
        springs: &'a [Spring],
    ) -> ElementsView<'a, R> {
        let [force_n, forwards, backwards, first] = &self.positive;
        let [second, third, fourth, fifth] = &self.negative;
        ElementsView {
            x_mm: &self.x_mm[..len],
            mass_kg,
            force_n: &force_n[..len],
            damping_n_s_per_mm: [&forwards[..len], &backwards[..len]],
            springs,
            spring_n: [first, second, third, fourth, fifth].map(|profile| &profile[..len]),
        }
    }

    /// Removes the first of `len` nodes.
    fn shift(&mut self, len: usize) {
        self.x_mm.copy_within(1..len, 0);
        for values in self.positive.iter_mut().chain(&mut self.negative) {
            values.copy_within(1..len, 0);
        }
    }
}

/// Nodes that are kept in double precision: those of a chunk that wait to be judged, the
/// last one that was, and the one before.
const WINDOW: usize = TableChunk::MAX_NODES + 2;

/// A table, or elements, with a capacity of `N` nodes.
#[derive(Debug, Clone)]
pub(super) struct TableBuffer<const N: usize, R> {
    nodes: Nodes<N, R>,
    len: usize,
    pub(super) begin: Option<TableBegin>,
    /// Of elements, in addition to `begin`.
    elements: Option<ElementsBegin>,
    crc: UploadCrc,
    /// The first node that is not finite or does not ascend.
    bad: Option<usize>,
    /// The last nodes as they were received; the certificate is that of the host.
    window: Nodes<WINDOW, f64>,
    window_len: usize,
    certifier: Certifier,
    of_elements: elements::Certifier,
}

/// A refusal and its detail, see [`Refusal`].
pub(super) type Refused = (Refusal, u32);

impl<const N: usize, R: Real> TableBuffer<N, R> {
    pub(super) const fn new() -> Self {
        Self {
            nodes: Nodes::new(),
            len: 0,
            begin: None,
            elements: None,
            crc: UploadCrc::new(),
            bad: None,
            window: Nodes::new(),
            window_len: 0,
            certifier: Certifier::new(),
            of_elements: elements::Certifier::new(),
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

    /// Begins a new upload of elements.
    pub(super) fn begin_elements(&mut self, begin: &ElementsBegin) -> Result<(), Refused> {
        self.begin(&TableBegin::from(begin))?;
        self.crc = UploadCrc::of_elements(begin);
        self.elements = Some(*begin);
        Ok(())
    }

    pub(super) fn clear(&mut self) {
        self.begin = None;
        self.elements = None;
        self.of_elements = elements::Certifier::new();
        self.len = 0;
        self.bad = None;
        self.window_len = 0;
        self.certifier = Certifier::new();
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
        if self.window_len == WINDOW {
            let first = self.len - WINDOW;
            while self.judged() < first + 2 && self.judge() {}
            self.window.shift(WINDOW);
            self.window_len -= 1;
        }
        let at = self.window_len;
        self.window.set(at, node);
        self.window_len += 1;
        self.nodes.set(self.len, node);
        if !(self.window.evaluable(at) && self.nodes.evaluable(self.len)) {
            self.bad = self.bad.or(Some(self.len));
        }
        self.crc.node(node);
        self.len += 1;
    }

    pub(super) fn crc(&self) -> u32 {
        self.crc.value()
    }

    pub(super) fn view(&self) -> TableView<'_, R> {
        let lookup = self.begin.map(|begin| begin.lookup);
        self.nodes.view(self.len, lookup.unwrap_or(Lookup::Linear))
    }

    /// The elements, if the upload is one of elements.
    pub(super) fn elements(&self) -> Option<ElementsView<'_, R>> {
        let begin = self.elements.as_ref()?;
        let mass_kg = R::of(begin.mass_kg);
        Some((self.nodes).elements(self.len, mass_kg, begin.springs.as_slice()))
    }

    fn judged(&self) -> usize {
        match self.elements {
            Some(_) => self.of_elements.judged(),
            None => self.certifier.judged(),
        }
    }

    /// Received nodes whose certificate has not been computed.
    pub(super) fn unjudged(&self) -> usize {
        match self.bad {
            None => self.len - self.judged(),
            Some(_) => 0,
        }
    }

    /// Computes the certificate of the next node; false if it needs the one after it, or
    /// if there is none. A device does so while it waits for the next chunk, so that
    /// little is left for COMMIT.
    pub(super) fn judge(&mut self) -> bool {
        let Some(begin) = self.begin else {
            return false;
        };
        let nodes = usize::from(begin.nodes);
        let at = self.judged();
        let known = at + 1 < self.len || (at < self.len && self.len == nodes);
        if !known || self.bad.is_some() {
            return false;
        }
        let at = at + self.window_len - self.len;
        if let Some(elements) = &self.elements {
            let springs = elements.springs.as_slice();
            let view = (self.window).elements(self.window_len, elements.mass_kg, springs);
            self.of_elements.step(&view, at);
            return true;
        }
        let view = self.window.view(self.window_len, begin.lookup);
        let range = Range {
            x_mm: begin.range_mm,
            v_mm_s: begin.trained_mm_s,
        };
        self.certifier
            .step(&view, at, nodes, begin.direction, range);
        true
    }

    /// Checks that the table is complete and may be played; its force limit, N.
    /// `with_state`: the stiffness includes the change of force over the direction state.
    pub(super) fn validate(
        &mut self,
        crc: u32,
        bounds: &Bounds,
        with_state: bool,
    ) -> Result<f64, Refused> {
        let Some(begin) = self.begin else {
            return Err((Refusal::WrongState, 0));
        };
        let complete = self.len == usize::from(begin.nodes);
        require(complete, Refusal::Incomplete, self.len as u32)?;
        require(self.crc() == crc, Refusal::Checksum, self.crc())?;
        self.check_evaluable(&begin)?;
        let asked = Asked {
            range_mm: begin.range_mm,
            force_n: begin.force_n,
            velocity_mm_s: begin.velocity_mm_s,
            uncertified_n: begin.uncertified_n,
        };
        asked.check_limits(bounds)?;
        while self.judge() {}
        let certificate = match &self.elements {
            Some(elements) => {
                let springs = elements.springs.as_slice();
                let view = (self.window).elements(self.window_len, elements.mass_kg, springs);
                self.of_elements.finish(&view, elements.trained_mm_s)
            }
            None => self.certifier.finish(),
        };
        asked.permit(&certificate, bounds, with_state)
    }

    /// Checks that the force is defined at every position.
    fn check_evaluable(&self, begin: &TableBegin) -> Result<(), Refused> {
        let bad = |node: usize| Err((Refusal::BadTable, node as u32));
        if self.len < 2 {
            return bad(self.len);
        }
        if let Some(node) = self.bad {
            return bad(node);
        }
        let known = match &self.elements {
            Some(elements) => {
                let springs = elements.springs.as_slice();
                elements.mass_kg.is_finite() && springs.iter().all(Spring::is_valid)
            }
            None => begin.direction.delta_mm().is_none_or(positive),
        };
        if ordered(begin.range_mm) && known && positive(begin.trained_mm_s) {
            Ok(())
        } else {
            bad(self.len)
        }
    }
}

fn branch<const N: usize, R>(parameters: &[[R; N]; 4], len: usize) -> BranchView<'_, R> {
    let [m, b, k, f0] = parameters;
    BranchView {
        m_kg: &m[..len],
        b_n_s_per_mm: &b[..len],
        k_n_per_mm: &k[..len],
        f0_n: &f0[..len],
    }
}

/// The limits that an upload asks for.
#[derive(Debug, Clone, Copy)]
pub(super) struct Asked {
    pub(super) range_mm: [f64; 2],
    pub(super) force_n: f64,
    pub(super) velocity_mm_s: f64,
    pub(super) uncertified_n: Option<f64>,
}

impl Asked {
    /// Checks that every limit is finite, positive and not above the device's.
    pub(super) fn check_limits(&self, bounds: &Bounds) -> Result<(), Refused> {
        let within = |value: f64, most: f64| positive(value) && value <= most;
        let cap_fits = self
            .uncertified_n
            .is_none_or(|cap| within(cap, bounds.force_n));
        let ([low, high], [lowest, highest]) = (self.range_mm, bounds.stroke_mm);
        let force = within(self.force_n, bounds.force_n) && cap_fits;
        require(force, Refusal::Limit, 1)?;
        let velocity = within(self.velocity_mm_s, bounds.velocity_mm_s);
        require(velocity, Refusal::Limit, 2)?;
        require(low >= lowest && high <= highest, Refusal::Limit, 3)
    }

    /// The force limit with this certificate, N.
    pub(super) fn permit(
        &self,
        certificate: &Certificate,
        bounds: &Bounds,
        with_state: bool,
    ) -> Result<f64, Refused> {
        match (
            check_physics(certificate, bounds, with_state),
            self.uncertified_n,
        ) {
            (Ok(()), _) => Ok(self.force_n),
            (Err(_), Some(cap_n)) => Ok(cap_n.min(self.force_n)),
            (Err(refused), None) => Err(refused),
        }
    }
}

/// Conditions for playing a table without the explicit permission to play it
/// uncertified.
fn check_physics(c: &Certificate, bounds: &Bounds, with_state: bool) -> Result<(), Refused> {
    require(c.mass.holds(), Refusal::Uncertified, 1)?;
    require(c.damping.holds(), Refusal::Uncertified, 2)?;
    require(c.hysteresis.holds(), Refusal::Uncertified, 3)?;
    // NaN is not within a bound.
    let asked_n_per_mm = match with_state {
        true => c.rendered_n_per_mm(),
        false => c.stiffness_n_per_mm,
    };
    let stiffness = asked_n_per_mm <= bounds.stiffness_n_per_mm;
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

/// Whether both ends are finite and ascend.
pub(super) fn ordered([low, high]: [f64; 2]) -> bool {
    low.is_finite() && high.is_finite() && low < high
}

pub(super) fn positive(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::certificate::certify;
    use crate::message::FixedVec;
    use crate::predict::Direction;
    use proptest::prelude::*;

    const NODES: usize = 11;

    proptest! {
        /// A table that is judged while it arrives has the certificate of the whole table.
        #[test]
        fn judging_node_by_node_gives_the_same_certificate(
            values in proptest::array::uniform11(proptest::array::uniform8(-1.0..3.0)),
            steps in proptest::array::uniform11(0.1..2.0),
            judged in proptest::array::uniform4(0..6),
            lookup in 0..3_usize,
            delta_mm in prop::option::of(0.1..1.0),
        ) {
            let mut x_mm = 1.0;
            let mut nodes = [Node::default(); NODES];
            for ((node, values), step) in nodes.iter_mut().zip(values).zip(steps) {
                x_mm += step;
                let [m, b, k, f0, ..] = values;
                let [.., m2, b2, k2, f2] = values;
                *node = Node { x_mm, positive: [m, b, k, f0], negative: [m2, b2, k2, f2] };
            }
            let begin = TableBegin {
                nodes: NODES as u16,
                lookup: Lookup::NAMES[lookup].1,
                direction: delta_mm.map_or(Direction::Sign, |delta_mm| Direction::Play { delta_mm }),
                range_mm: [0.0, 40.0],
                trained_mm_s: 100.0,
                force_n: 1.0,
                velocity_mm_s: 100.0,
                uncertified_n: None,
            };
            let mut table = TableBuffer::<16, f64>::new();
            table.begin(&begin).unwrap();
            for (at, (some, judged)) in nodes.chunks(3).zip(judged).enumerate() {
                let first = (3 * at) as u16;
                table.chunk(&TableChunk { first, nodes: FixedVec::of(some) }).unwrap();
                for _ in 0..judged {
                    table.judge();
                }
            }
            while table.judge() {}
            prop_assert_eq!(table.unjudged(), 0);
            let range = Range { x_mm: begin.range_mm, v_mm_s: begin.trained_mm_s };
            let whole = certify(&table.view(), begin.direction, range);
            prop_assert_eq!(table.certifier.finish(), whole);
        }
    }

    proptest! {
        /// Elements that are judged while they arrive have the certificate of the whole.
        #[test]
        fn judging_elements_node_by_node_gives_the_same_certificate(
            values in proptest::array::uniform11(proptest::array::uniform8(-0.1..3.0)),
            steps in proptest::array::uniform11(0.1..2.0),
            judged in proptest::array::uniform4(0..6),
        ) {
            let mut x_mm = 1.0;
            let mut nodes = [Node::default(); NODES];
            for ((node, values), step) in nodes.iter_mut().zip(values).zip(steps) {
                x_mm += step;
                *node = Node::of_elements(x_mm, values);
            }
            let springs = [
                Spring::Stop { slip_mm: 0.2 },
                Spring::Latch { rearm_mm: 2.0, break_mm: 6.5 },
                Spring::Maxwell { slip_mm: 3.0, relaxation_s: 0.1 },
            ];
            let begin = ElementsBegin {
                nodes: NODES as u16,
                mass_kg: 0.1,
                range_mm: [0.0, 40.0],
                trained_mm_s: 100.0,
                force_n: 1.0,
                velocity_mm_s: 100.0,
                uncertified_n: None,
                springs: FixedVec::of(&springs),
            };
            let mut table = TableBuffer::<16, f64>::new();
            table.begin_elements(&begin).unwrap();
            for (at, (some, judged)) in nodes.chunks(3).zip(judged).enumerate() {
                let first = (3 * at) as u16;
                table.chunk(&TableChunk { first, nodes: FixedVec::of(some) }).unwrap();
                for _ in 0..judged {
                    table.judge();
                }
            }
            while table.judge() {}
            prop_assert_eq!(table.unjudged(), 0);
            let whole = table.elements().unwrap();
            // the third spring has the values of its place, the others are not read
            prop_assert_eq!(whole.spring_n[2][4], values[4][5]);
            let found = table.of_elements.finish(&whole, begin.trained_mm_s);
            prop_assert_eq!(found, whole.certificate(begin.trained_mm_s));
        }
    }
}
