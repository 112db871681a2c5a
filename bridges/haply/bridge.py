"""One axis of a Haply Inverse3 as a device of `study`, by the simulation channel of the Inverse Service (3.5).

    study device check --command "python3 bridges/haply/bridge.py --axis x"

The service answers each message with the state of its devices. Every turn sends the force of the
turn before and reads the state: a force reaches the service one turn (1 ms) after it was computed.

The two other axes are held on a line by a spring and damper, from the place where the handle is
when the force begins. How far the handle left the line, and the force across it, is printed after
each playback (standard error).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
from typing import Any, Dict, List, Optional

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

from common import Axis, AxisError, Reading, device, options, run  # noqa: E402
from haply.websocket import WebSocket, WebSocketError  # noqa: E402

VERSION = "haply-bridge 0.1"
AXES = "xyz"
#: Time for the state, s.
TIMEOUT_S = 0.1
#: The force across rises for so long, s.
RISE_S = 0.3


class Inverse3(Axis):
    """One axis; the others are held."""

    def __init__(self, args: argparse.Namespace) -> None:
        self._along = AXES.index(args.axis)
        self._sign = -1.0 if args.reverse else 1.0
        self._origin_mm: float = args.origin
        self._hold = (args.hold, args.hold_damping, args.hold_force)
        self._most_n: float = args.force
        self._force = [0.0, 0.0, 0.0]
        self._position = [0.0, 0.0, 0.0]
        self._velocity = [0.0, 0.0, 0.0]
        self._line: Optional[List[float]] = None
        self._since = 0.0
        self._leak = Leak()
        self._limp_sent = False
        try:
            self._socket = WebSocket.connect(args.host, args.port, 3.0)
            first = json.loads(self._socket.receive(3.0))
        except (OSError, WebSocketError, ValueError) as error:
            raise AxisError(f"no Inverse Service at {args.host}:{args.port}: {error}") from None
        known: Dict[str, Any] = {d["device_id"]: d for d in first.get("inverse3", [])}
        if args.device is None and len(known) != 1:
            names = ", ".join(sorted(known)) or "none"
            raise AxisError(f"choose one with --device: the service has {names}")
        self.id: str = args.device or next(iter(known))
        if self.id not in known:
            raise AxisError(f"the service has no Inverse3 {self.id}")
        config, status = known[self.id].get("config", {}), known[self.id].get("status", {})
        if status.get("calibrated") is False or status.get("power_supply") is False:
            raise AxisError("the Inverse3 is not calibrated, or without power")
        info = config.get("device_info", {})
        self.firmware = f"{info.get('major_version', '?')}.{info.get('minor_version', '?')}"
        # Damping of the service would be a force that no table has.
        self._configure = {"damping": {"scalar": 0.0}}
        self._session: Optional[Dict[str, Any]] = {
            "configure": {"profile": {"name": "study"}}
        }
        self._see(first)

    def read(self) -> Reading:
        sent = time.monotonic()
        self._exchange()
        now = time.monotonic()
        x = self._position[self._along] * 1e3 - self._origin_mm
        v = self._velocity[self._along] * 1e3
        # The service has taken the state while this program waited.
        return Reading(self._sign * x, self._sign * v, None, 0.5 * (sent + now))

    def push(self, motor_n: float) -> None:
        now = time.monotonic()
        if self._line is None:
            self._line, self._since = list(self._position), now
            self._leak = Leak()
        stiffness, damping, most = self._hold
        rise = min(1.0, (now - self._since) / RISE_S)
        force = [0.0, 0.0, 0.0]
        across = 0.0
        for i in range(3):
            if i != self._along:
                away_mm = 1e3 * (self._position[i] - self._line[i])
                force[i] = -rise * (stiffness * away_mm + damping * 1e3 * self._velocity[i])
                across = math.hypot(across, force[i])
        # What the axis leaves of the largest force.
        allowed = min(most, math.sqrt(max(self._most_n**2 - motor_n**2, 0.0)))
        if across > allowed:
            force = [f * allowed / across for f in force]
            across = allowed
        force[self._along] = self._sign * motor_n
        self._force = force
        apart = [1e3 * (self._position[i] - self._line[i]) for i in range(3) if i != self._along]
        self._leak.add(math.hypot(*apart), across)
        self._limp_sent = False

    def limp(self) -> None:
        self._line = None
        self._force = [0.0, 0.0, 0.0]
        if not self._limp_sent:
            self._exchange()
            self._limp_sent = True

    def notes(self) -> str:
        return self._leak.text()

    def close(self) -> None:
        self._socket.close()

    def _exchange(self) -> None:
        vector = dict(zip(AXES, self._force))
        own: Dict[str, Any] = {
            "device_id": self.id,
            "commands": {"set_cursor_force": {"vector": vector}},
        }
        message: Dict[str, Any] = {"inverse3": [own]}
        if self._session is not None:
            message["session"], self._session = self._session, None
            own["configure"] = self._configure
        try:
            self._socket.send(json.dumps(message))
            self._see(json.loads(self._socket.receive(TIMEOUT_S)))
        except (OSError, WebSocketError, ValueError) as error:
            raise AxisError(f"the Inverse Service does not answer: {error}") from None

    def _see(self, message: Dict[str, Any]) -> None:
        for own in message.get("inverse3", []):
            if own.get("device_id") == self.id:
                state = own["state"]
                position, velocity = state.get("cursor_position"), state.get("cursor_velocity")
                if position is None or velocity is None:
                    raise AxisError("the Inverse3 tells no position: is it calibrated?")
                self._position = [float(position[a]) for a in AXES]
                self._velocity = [float(velocity[a]) for a in AXES]
                return
        raise AxisError(f"the Inverse3 {self.id} is gone")


class Leak:
    """How far the handle was off its line, mm, and the force across, N."""

    def __init__(self) -> None:
        self.count, self.far, self.force = 0, [0.0, 0.0], [0.0, 0.0]

    def add(self, far_mm: float, across_n: float) -> None:
        self.count += 1
        for value, sums in ((far_mm, self.far), (across_n, self.force)):
            sums[0] += value * value
            sums[1] = max(sums[1], value)

    def text(self) -> str:
        if not self.count:
            return ""
        far, force = (
            f"{math.sqrt(sums[0] / self.count):.2f} {unit} rms, {sums[1]:.2f} {unit} at most"
            for sums, unit in ((self.far, "mm"), (self.force, "N"))
        )
        return f"off the line: {far}; force across: {force}"


def main() -> int:
    parser = options(__doc__, force_n=8.0, stroke="-60,60", loop_hz=1000.0)
    add = parser.add_argument
    add("--axis", choices=AXES, default="x", help="axis of the service that is the handle's")
    add("--host", default="127.0.0.1", help="computer of the Inverse Service")
    add("--port", type=int, default=10001, help="its simulation channel")
    add("--device", help="device_id, if there are several")
    add("--hold", type=float, default=1.0, metavar="N_MM", help="stiffness of the line")
    add("--hold-damping", type=float, default=0.004, metavar="NS_MM", help="its damping")
    add("--hold-force", type=float, default=4.0, metavar="N", help="largest force across")
    args = parser.parse_args()
    try:
        axis = Inverse3(args)
    except AxisError as error:
        print(error, file=sys.stderr)
        return 1
    version = f"{VERSION}, firmware {axis.firmware}"
    return run(device(args, f"inverse3-{axis.id}-{args.axis}", version), axis)


if __name__ == "__main__":
    sys.exit(main())
