#!/usr/bin/env bash
# Starts an example device and runs `study device check` on it.
#
#   firmware/check.sh c          the example in C on a pseudo-terminal
#   firmware/check.sh emulator   the STM32F4 image in qemu-system-arm
#
# Where the system permits it, the device runs at real-time priority: it has a processor of
# its own, and must not wait for other programs.
#
# Exit status: 0 all clauses passed, 77 a tool is missing, else the clauses failed.
set -euo pipefail
cd "$(dirname "$0")/.."
target_dir=${CARGO_TARGET_DIR:-target}
thumb=thumbv7em-none-eabihf
work=$(mktemp -d)
device=
cleanup() {
  [ -z "$device" ] || kill "$device" 2>/dev/null || true
  rm -rf "$work"
}
trap cleanup EXIT

soon=
if chrt -f 5 true 2>/dev/null; then soon="chrt -f 5"; fi

case "${1-}" in
  c)
    command -v cc >/dev/null || { echo "no C compiler here" >&2; exit 77; }
    cargo build --locked -q -p study-firmware-c
    cc -std=c99 -Wall -Wextra -pedantic -Werror -O2 -I firmware/c/include firmware/c/examples/pty.c \
      "$target_dir/debug/libstudy_firmware_c.a" -lm -lpthread -ldl -o "$work/device"
    $soon "$work/device" > "$work/said" &
    ;;
  emulator)
    command -v qemu-system-arm >/dev/null || { echo "no qemu-system-arm here" >&2; exit 77; }
    cargo build --locked -q --release -p study-firmware --example stm32f4 --target "$thumb"
    # While it calculates, the emulated clock counts instructions, 8 ns each: a period of
    # 250 us has 31,250 of them, as with a Cortex-M4 at 168 MHz.
    $soon qemu-system-arm -M netduinoplus2 -display none -monitor none -icount shift=3 -serial pty \
      -kernel "$target_dir/$thumb/release/examples/stm32f4" > "$work/said" 2>&1 &
    ;;
  *) echo "usage: firmware/check.sh c | emulator" >&2; exit 2 ;;
esac
device=$!
port=
for _ in $(seq 100); do
  port=$(grep -o '/dev/pts/[0-9]*' "$work/said" || true)
  [ -z "$port" ] || break
  sleep 0.1
done
[ -n "$port" ] || { echo "the device did not start:" >&2; cat "$work/said" >&2; exit 1; }
cargo build --locked -q -p haptic-study
# An emulator looks once a second whether somebody has opened its port, and drops what is
# written before: hold it open for the check.
exec 7<>"$port"
sleep 2
# The hand that the emulated board simulates leaves the range of the tables by which the force is
# judged, and each of them trips.
rendering=
[ "$1" != emulator ] || rendering=--without-rendering
"$target_dir/debug/study" device check $rendering --port "$port"
