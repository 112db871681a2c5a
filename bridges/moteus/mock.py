"""A moteus controller with a motor and a hand on a pseudo-terminal, whose path is printed.

    python3 bridges/moteus/mock.py --radius 20

The vendor's client (PyPI `moteus`) finds, reads and drives it: bridges/moteus/accept.py.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

from moteus import frames  # noqa: E402
from pty_mock import hand, serve  # noqa: E402

#: Steps of the registers in their short forms: of INT8, INT16, INT32.
SCALES = {
    frames.POSITION: (0.01, 1e-4, 1e-5),
    frames.VELOCITY: (0.1, 2.5e-4, 1e-5),
    frames.TORQUE: (0.5, 0.01, 0.001),
    frames.VOLTAGE: (0.5, 0.1, 0.001),
    frames.TEMPERATURE: (1.0, 0.1, 0.001),
}
#: Time constant of the current, s.
LAG_S = 2e-4


class Controller:
    def __init__(self, target: int, radius_mm: float) -> None:
        self.target, self.way_mm = target, 2.0 * math.pi * radius_mm
        self.mode = frames.STOPPED
        self.command_nm = self.torque_nm = 0.0
        self.at = self.told = time.monotonic()
        self.timeout_s = 0.1

    def advance(self) -> None:
        now = time.monotonic()
        if self.mode == frames.POSITION_MODE and now - self.told > self.timeout_s:
            self.mode, self.command_nm = frames.TIMEOUT_MODE, 0.0
        part = 1.0 - math.exp(-(now - self.at) / LAG_S)
        self.torque_nm += part * (self.command_nm - self.torque_nm)
        self.at = now

    def answer(self, line: bytes) -> bytes:
        """What the adapter writes after a line."""
        had_one = len(line) > 3 and line[-3:-2] == b"*"
        mark = frames.with_checksum if had_one else bytes
        try:
            line = frames.checked(line, False)
            words = line.split()
            if words[:2] != [b"can", b"send"] or len(words) < 4:
                return mark(b"ERR unknown command") + b"\r\n"
            address, data = int(words[2], 16), bytes.fromhex(words[3].decode())
        except frames.FrameError:
            return frames.with_checksum(b"ERR checksum") + b"\r\n"
        except ValueError:
            return mark(b"ERR invalid hex") + b"\r\n"
        out = mark(b"OK") + b"\r\n"
        if address & 0x7F not in (self.target, 0x7F):
            return out
        try:
            written, asked, _ = frames.parse(data)
        except frames.FrameError:
            return out
        self.advance()
        self.told = time.monotonic()
        self.write(written)
        if address & 0x8000:
            reply = b"".join(self.reply(*one) for one in asked)
            source = address >> 8 & 0x7F
            text = frames.padded(reply).hex().upper().encode()
            out += mark(b"rcv %04x %s E B F" % (self.target << 8 | source, text)) + b"\r\n"
        return out

    def write(self, written: "dict[int, float]") -> None:
        if frames.MODE in written:
            self.mode = int(written[frames.MODE])
            if self.mode != frames.POSITION_MODE:
                self.command_nm = 0.0
        timeout = written.get(frames.COMMAND_TIMEOUT)
        if timeout is not None and timeout > 0:
            self.timeout_s = timeout
        torque = written.get(frames.COMMAND_TORQUE)
        if torque is not None and self.mode == frames.POSITION_MODE and math.isfinite(torque):
            self.command_nm = torque

    def reply(self, resolution: int, first: int, count: int) -> bytes:
        x_mm, v_mm_s = hand(time.monotonic())
        known = {
            frames.MODE: self.mode,
            frames.POSITION: x_mm / self.way_mm,
            frames.VELOCITY: v_mm_s / self.way_mm,
            frames.TORQUE: self.torque_nm,
            frames.VOLTAGE: 24.0,
            frames.TEMPERATURE: 25.0,
            frames.FAULT: 0,
        }
        values = []
        for register in range(first, first + count):
            value = float(known.get(register, 0.0))
            if resolution != frames.F32:
                scales = SCALES.get(register)
                value = round(value / scales[resolution]) if scales else int(value)
            values.append(value)
        return frames.reply(resolution, first, values)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--target", type=int, default=1)
    parser.add_argument("--radius", type=float, default=20.0, metavar="MM")
    args = parser.parse_args()
    controller = Controller(args.target, args.radius)
    return serve(controller.answer, bytes, 0.0)


if __name__ == "__main__":
    sys.exit(main())
