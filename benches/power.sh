#!/bin/sh
# `study power` and its peers on the same design in one run: processor time for 1,000 studies
# of 10 x 8 x 3, and the closed forms as a process.
#
#   sh benches/power.sh [STUDIES]     studies that the peer simulates (default 100)
set -eu
cd "$(dirname "$0")/.."
cargo bench --quiet --bench power
cargo build --quiet --release --bin study
study=${CARGO_TARGET_DIR:-target}/release/study
printf '\n`study power protocols/turn-signal --closed` as a process, processor time of 20 runs:\n'
(i=0; while [ $i -lt 20 ]; do "$study" power protocols/turn-signal --closed >/dev/null; i=$((i + 1)); done; times | tail -1)
printf '\nPeers:\n'
if command -v Rscript >/dev/null && Rscript -e 'library(lme4); library(lmerTest)' >/dev/null 2>&1; then
  Rscript lab/power-peers.R "${1:-100}"
else
  echo "SKIPPED: no R with lme4 and lmerTest here" >&2
fi
