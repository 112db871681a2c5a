"""A motor of a SimpleFOC sketch as a device of `study`, over its Commander and its monitor.

    study device check --command "python3 bridges/simplefoc/bridge.py --port /dev/ttyACM0 --radius 20 --newton 0.8"

The sketch needs `commander.motor(&motor, cmd)` under one letter, `motor.useMonitoring(Serial)`, `motor.monitor()` in
its loop, torque control, and a line rate that carries a thousand lines of 20 bytes per second. SimpleFOC has
no watchdog: without a line from here a motor keeps its last target. The sketch has to call `motor.disable()`
when nothing has come for a tenth of a second; bridges/simplefoc/sketch.md has the lines.
"""

from __future__ import annotations

import argparse
import os
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

from common import Axis, AxisError, Reading, device, options, run  # noqa: E402
from serial_port import SerialError, SerialPort  # noqa: E402

VERSION = "simplefoc-bridge 0.1"
#: Time for the next line of the monitor, s.
TIMEOUT_S = 0.1
#: Of the monitor: current q, velocity, angle; without a current sensor the voltage.
WITH_CURRENT, WITH_VOLTAGE = b"0001011", b"0100011"
#: So many damaged lines may come in a row.
DAMAGED = 20


class SimpleFoc(Axis):
    """One motor; lengths by the lever arm of the handle."""

    sets_pace = True

    def __init__(self, args: argparse.Namespace) -> None:
        self._letter = args.letter.encode()
        self._sign = -1.0 if args.reverse else 1.0
        self._radius_mm: float = args.radius
        self._origin_mm: float = args.origin
        self._newton: float = args.newton
        self._most = args.force / args.newton
        self._measures = args.current
        self._enabled = True
        try:
            self._port = SerialPort(args.port, args.baud)
        except SerialError as error:
            raise AxisError(str(error)) from None
        own = self._letter
        self._send(b"@0")  # no answers, which would stand among the lines of the monitor
        self.limp()
        self._send(own + b"C0")  # torque
        self._send(own + b"MC")
        time.sleep(0.05)
        self._port.drop()
        self._send(own + b"MD%d" % args.downsample)
        self._send(own + b"MS" + (WITH_CURRENT if self._measures else WITH_VOLTAGE))
        self.read()

    def read(self) -> Reading:
        damaged = 0
        while True:
            try:
                line = self._port.line(TIMEOUT_S)
            except SerialError as error:
                raise AxisError(f"the SimpleFOC board has gone: {error}") from None
            if line is None:
                raise AxisError("the SimpleFOC board sends no monitor lines")
            now = time.monotonic()
            try:
                effort, velocity, angle = (float(word) for word in line.split(b"\t"))
            except ValueError:
                damaged += 1
                if damaged > DAMAGED:
                    raise AxisError("the lines of the monitor cannot be read") from None
                continue
            x = self._sign * angle * self._radius_mm - self._origin_mm
            v = self._sign * velocity * self._radius_mm
            measured = None
            if self._measures:
                measured = -self._sign * 1e-3 * effort * self._newton
            return Reading(x, v, measured, now)

    def push(self, motor_n: float) -> None:
        target = self._sign * motor_n / self._newton
        target = min(max(target, -self._most), self._most)
        if not self._enabled:
            self._send(self._letter + b"E1")
            self._enabled = True
        self._send(self._letter + b"%.4f" % target)

    def limp(self) -> None:
        if self._enabled:
            self._send(self._letter + b"0")
            self._send(self._letter + b"E0")
            self._enabled = False

    def close(self) -> None:
        self._port.close()

    def _send(self, line: bytes) -> None:
        try:
            self._port.write(line + b"\n")
        except SerialError as error:
            raise AxisError(f"the SimpleFOC board has gone: {error}") from None


def main() -> int:
    parser = options(__doc__, force_n=5.0, stroke="-40,40", loop_hz=1000.0)
    add = parser.add_argument
    add("--port", required=True, help="serial port of the board")
    add("--baud", type=int, default=921600, help="ignored by USB")
    add("--letter", default="M", help="letter of the motor in the sketch")
    add("--radius", type=float, required=True, metavar="MM", help="lever arm from axis to handle")
    add("--newton", type=float, required=True, metavar="N", help="force at the handle for a target of 1 (V or A), measured with a weight")
    add("--current", action="store_true", help="the board measures the current: targets are A")
    add("--downsample", type=int, default=5, help="turns of the sketch's loop for each line of the monitor")
    args = parser.parse_args()
    try:
        axis = SimpleFoc(args)
    except AxisError as error:
        print(error, file=sys.stderr)
        return 1
    name = os.path.basename(args.port)
    return run(device(args, f"simplefoc-{name}"[:64], VERSION), axis)


if __name__ == "__main__":
    sys.exit(main())
