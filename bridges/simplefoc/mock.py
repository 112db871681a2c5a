"""A SimpleFOC board with a motor and a hand on a pseudo-terminal, whose path is printed.

    python3 bridges/simplefoc/mock.py --radius 20

It does what the documentation of Commander and of the monitor says (SimpleFOC 2.3 and 2.4), and what the sketch
has to do: without a line for a tenth of a second the motor is disabled.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

from pty_mock import hand, serve  # noqa: E402

#: Turns of the sketch's loop per second.
LOOP_HZ = 5000.0
LAG_S = 2e-4
SILENCE_S = 0.1
#: Volts for an ampere.
OHM = 2.0


class Board:
    def __init__(self, letter: str, radius_mm: float) -> None:
        self.letter, self.radius_mm = letter, radius_mm
        self.target = self.effort = 0.0
        self.enabled = True
        self.verbose = 1
        self.variables = 0b1100011
        self.downsample = 100
        self.count = 0.0
        self.at = self.told = time.monotonic()

    def run(self, line: bytes) -> bytes:
        """What Commander prints for a line."""
        text = line.decode("ascii", "replace")
        self.told = time.monotonic()
        if text.startswith("@"):
            if text[1:]:
                self.verbose = int(text[1:])
            return self.say("Verb:", {0: "off!", 3: "machine"}.get(self.verbose, "on!"))
        if text == "?":
            return self.say("", f"{self.letter}:motor")
        if not text.startswith(self.letter):
            return b""
        command = text[1:]
        if not command or command[0] in "-+.0123456789":
            return self.set_target(command)
        if command[0] == "E":
            if command[1:]:
                self.enabled = float(command[1:]) != 0.0
                if not self.enabled:
                    self.target = 0.0
            return self.say("Status: ", str(int(self.enabled)))
        if command[0] == "C":
            return self.say("Motion:", "torque")
        if command[0] == "T":
            return self.say("Torque: ", "foc curr")
        if command[0] == "M":
            return self.monitor(command[1:])
        return self.say("unknown cmd ", "err")

    def set_target(self, command: str) -> bytes:
        if command:
            try:
                self.target = float(command.split()[0])
            except ValueError:
                self.target = 0.0
        return self.say("Target: ", f"{self.target:.3f}")

    def monitor(self, command: str) -> bytes:
        what, value = command[:1], command[1:]
        if what == "C":
            self.variables = 0
            return self.say("Monitor | ", "clear")
        if what == "D":
            if value:
                self.downsample = int(float(value))
            return self.say("Monitor | downsample: ", str(self.downsample))
        if what == "S":
            if value:
                self.variables = int(value.ljust(7, "0")[:7], 2)
            return self.say("Monitor | ", f"{self.variables:07b}")
        if what == "G":
            _, v, angle = self.state()
            values = [self.target, OHM * self.effort, 0.0, self.effort, 0.0, v, angle]
            return self.say("Monitor | ", f"{values[int(value)]:.3f}")
        return self.say("", "err")

    def say(self, words: str, value: str) -> bytes:
        if self.verbose == 0:
            return b""
        return ((words if self.verbose == 1 else "") + value + "\r\n").encode()

    def state(self) -> "tuple[float, float, float]":
        """Current, velocity, angle now."""
        now = time.monotonic()
        if now - self.told > SILENCE_S:
            self.enabled, self.target = False, 0.0
        part = 1.0 - math.exp(-(now - self.at) / LAG_S)
        self.effort += part * ((self.target if self.enabled else 0.0) - self.effort)
        self.at = now
        x_mm, v_mm_s = hand(now)
        return self.effort, v_mm_s / self.radius_mm, x_mm / self.radius_mm

    def line(self) -> bytes:
        """The next line of the monitor."""
        if not self.variables or not self.downsample:
            return b""
        self.count += LOOP_HZ * PERIOD_S
        if self.count < self.downsample:
            return b""
        self.count = 0.0
        amp, v, angle = self.state()
        columns = [
            f"{self.target:.4f}",
            f"{OHM * amp:.4f}",
            "0.0000",
            f"{1e3 * amp:.2f}",
            "0.00",
            f"{v:.4f}",
            f"{angle:.4f}",
        ]
        shown = [c for i, c in enumerate(columns) if self.variables >> (6 - i) & 1]
        # Arduino's println ends with both.
        return "\t".join(shown).encode() + b"\r\n"


#: The mock looks at the time so often, s.
PERIOD_S = 1e-3


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--letter", default="M")
    parser.add_argument("--radius", type=float, default=20.0, metavar="MM")
    args = parser.parse_args()
    board = Board(args.letter, args.radius)
    return serve(board.run, board.line, PERIOD_S)


if __name__ == "__main__":
    sys.exit(main())
