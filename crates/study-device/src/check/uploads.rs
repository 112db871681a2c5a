//! Tables for the commissioning: valid ones, and ones that a device has to refuse.

use super::exchange::Exchange;
use super::{CheckFailure, FORCE_N};
use crate::host::upload::requests;
use study_wire::message::{Ack, Commit, Node, Play, Request, TableBegin};
use study_wire::predict::{Direction, Lookup};

/// Damping of the tables, N·s/mm.
const DAMPING: f64 = 0.005;

/// A table for upload.
#[derive(Debug, Clone)]
pub(super) struct Upload {
    pub(super) begin: TableBegin,
    pub(super) nodes: Vec<Node>,
}

impl Upload {
    /// A passive table of damping and a constant force, within the device's limits.
    pub(super) fn passive(exchange: &Exchange<'_>, force_n: f64) -> Result<Self, CheckFailure> {
        Self::with_nodes(exchange, force_n, 4)
    }

    pub(super) fn with_nodes(
        exchange: &Exchange<'_>,
        force_n: f64,
        count: u16,
    ) -> Result<Self, CheckFailure> {
        let device = exchange.identity()?;
        let [low, high] = device.stroke_mm;
        let margin = 0.1 * (high - low);
        let range_mm = [low + margin, high - margin];
        let parameters = [0.0, DAMPING, 0.0, force_n];
        let step = (range_mm[1] - range_mm[0]) / f64::from(count - 1);
        let nodes = (0..count)
            .map(|i| Node {
                x_mm: range_mm[0] + step * f64::from(i),
                positive: parameters,
                negative: parameters,
            })
            .collect();
        Ok(Self {
            begin: TableBegin {
                nodes: count,
                lookup: Lookup::Linear,
                direction: Direction::Play { delta_mm: 0.5 },
                range_mm,
                trained_mm_s: 100.0,
                force_n: FORCE_N.min(device.force_n),
                velocity_mm_s: device.velocity_mm_s,
                uncertified_n: None,
            },
            nodes,
        })
    }

    /// A table with a negative mass, which fails the certificate.
    pub(super) fn uncertified(exchange: &Exchange<'_>) -> Result<Self, CheckFailure> {
        let mut upload = Self::passive(exchange, 0.0)?;
        for node in &mut upload.nodes {
            node.positive[0] = -0.2;
            node.negative[0] = -0.2;
        }
        Ok(upload)
    }

    pub(super) fn crc(&self) -> u32 {
        requests(self.begin, &self.nodes).crc
    }

    pub(super) fn commit(&self) -> Request {
        Request::TableCommit(Commit { crc: self.crc() })
    }

    pub(super) fn chunks(&self) -> Vec<Request> {
        let mut all = requests(self.begin, &self.nodes).requests;
        all.retain(|request| matches!(request, Request::TableChunk(_)));
        all
    }

    /// Sends everything except COMMIT.
    pub(super) fn send(&self, exchange: &mut Exchange<'_>) -> Result<(), CheckFailure> {
        exchange.expect_done(Request::TableBegin(self.begin))?;
        for chunk in self.chunks() {
            exchange.expect_done(chunk)?;
        }
        Ok(())
    }

    pub(super) fn load(&self, exchange: &mut Exchange<'_>) -> Result<Ack, CheckFailure> {
        self.send(exchange)?;
        exchange.expect_done(self.commit())
    }

    /// A PLAY request for this table without telemetry, for at most `longest_ms`.
    pub(super) fn play(&self, exchange: &mut Exchange<'_>, longest_ms: u32) -> Play {
        Play {
            playback: exchange.next_playback(),
            crc: self.crc(),
            longest_ms,
            every: None,
        }
    }
}
