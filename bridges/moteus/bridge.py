"""A motor on a moteus controller as a device of `study`, over its adapter (fdcanusb) or a serial port.

    study device check --command "python3 bridges/moteus/bridge.py --port /dev/ttyACM0 --radius 20"

The controller runs in position mode without gains, so that only the torque counts that each turn
sends; the answer has position, speed and torque. A torque reaches the motor one turn after it was
computed. The controller switches itself off 0.1 s after the last frame, if its `servo.timeout_mode`
is 0; this bridge cannot set that.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

from common import Axis, AxisError, Reading, device, options, run  # noqa: E402
from moteus import frames  # noqa: E402
from serial_port import SerialError, SerialPort  # noqa: E402

VERSION = "moteus-bridge 0.1"
#: Time for an answer, s, and the time after which the controller switches itself off.
TIMEOUT_S, WATCHDOG_S = 0.05, 0.1
#: So many answers may be lost or damaged in a row.
LOST = 5
NAN = float("nan")


class Moteus(Axis):
    """One controller; lengths by the lever arm of the handle."""

    def __init__(self, args: argparse.Namespace) -> None:
        self._sign = -1.0 if args.reverse else 1.0
        self._radius_mm: float = args.radius
        self._origin_mm: float = args.origin
        self._target: int = args.target
        self._uart: bool = args.uart
        self._most_nm = 1e-3 * args.force * args.radius
        self._torque_nm = 0.0
        self._plays = False
        self._last = Reading(0.0)
        self._lost = 0
        self._count = 0
        try:
            self._port = SerialPort(args.port, args.baud)
            self._port.drop()
        except SerialError as error:
            raise AxisError(str(error)) from None
        self.limp()

    def read(self) -> Reading:
        if self._plays:
            values = [NAN, 0.0, self._torque_nm, 0.0, 0.0, self._most_nm, NAN, WATCHDOG_S]
            command = frames.write(frames.INT8, frames.MODE, [frames.POSITION_MODE])
            command += frames.write(frames.F32, frames.COMMAND_POSITION, values)
        else:
            command = frames.write(frames.INT8, frames.MODE, [frames.STOPPED])
        return self._exchange(command)

    def push(self, motor_n: float) -> None:
        self._plays = True
        self._torque_nm = self._sign * 1e-3 * motor_n * self._radius_mm

    def limp(self) -> None:
        self._plays, self._torque_nm = False, 0.0
        self._exchange(frames.write(frames.INT8, frames.MODE, [frames.STOPPED]))

    def close(self) -> None:
        self._port.close()

    def _exchange(self, command: bytes) -> Reading:
        ask = frames.read(frames.F32, frames.POSITION, 3)
        ask += frames.read(frames.INT8, frames.MODE, 1) + frames.read(frames.INT8, frames.FAULT, 1)
        sent = time.monotonic()
        try:
            self._port.write(frames.send_line(self._target, command + ask, self._uart))
            answers = self._answer(sent + TIMEOUT_S)
        except SerialError as error:
            raise AxisError(f"the moteus has gone: {error}") from None
        except frames.FrameError as error:
            self._lost += 1
            if self._lost > LOST:
                raise AxisError(f"the moteus does not answer: {error}") from None
            return self._last
        now = time.monotonic()
        self._lost = 0
        mode, fault = int(answers[frames.MODE]), int(answers[frames.FAULT])
        if mode == frames.FAULTED:
            raise AxisError(f"the moteus reports fault {fault}")
        if self._plays and mode == frames.TIMEOUT_MODE:
            raise AxisError("the moteus has switched itself off: no frame for 0.1 s")
        way_mm = 2.0 * math.pi * self._radius_mm
        x = self._sign * way_mm * answers[frames.POSITION] - self._origin_mm
        v = self._sign * way_mm * answers[frames.VELOCITY]
        # What the motor pushes with, by its current; the hand holds against it.
        hand_n = -self._sign * 1e3 * answers[frames.TORQUE] / self._radius_mm
        self._last = Reading(x, v, hand_n, 0.5 * (sent + now))
        return self._last

    def _answer(self, until: float) -> "dict[int, float]":
        while True:
            line = self._port.line(until - time.monotonic())
            if line is None:
                raise frames.FrameError("nothing comes")
            if not line.strip():
                continue
            got = frames.received(line, self._uart)
            if got is not None and got[0] == self._target:
                answers = frames.parse(got[1])[2]
                if frames.TORQUE in answers and frames.FAULT in answers:
                    return answers


def main() -> int:
    parser = options(__doc__, force_n=8.0, stroke="-40,40", loop_hz=1000.0)
    add = parser.add_argument
    add("--port", required=True, help="serial port of the adapter or controller")
    add("--baud", type=int, default=921600, help="ignored by the adapter")
    add("--uart", action="store_true", help="a controller on a plain serial port: lines have checksums")
    add("--target", type=int, default=1, help="number of the controller")
    add("--radius", type=float, required=True, metavar="MM", help="lever arm from axis to handle")
    args = parser.parse_args()
    try:
        axis = Moteus(args)
    except AxisError as error:
        print(error, file=sys.stderr)
        return 1
    return run(device(args, f"moteus-{args.target}", VERSION), axis)


if __name__ == "__main__":
    sys.exit(main())
