"""The simulation channel of an Inverse Service with one Inverse3 and a hand, as its documentation describes it:
the inventory first, then one state for each message.

    python3 bridges/haply/mock.py --port 10001

The hand strokes along one axis as if no force could stop it, and pulls the handle across with a
force of its own. Without messages for a tenth of a second the force is zero.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import socket
import sys
import threading
import time
from typing import Any, Dict, List

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))

from haply.websocket import WebSocket, WebSocketError  # noqa: E402

AXES = "xyz"
ID = "04BA"
CENTER = [0.0, -0.12, 0.15]
#: Moving mass across, kg, and its friction, N·s/m.
MASS_KG, DAMPING = 0.3, 2.0
#: The force is zero so long after the last message, s.
IDLE_S = 0.1
STEP_S = 2.5e-4


class World:
    """The handle: moved along one axis, free across."""

    def __init__(self, along: int, pull_n: float) -> None:
        self.along, self.pull_n = along, pull_n
        self.at = time.monotonic()
        self.position, self.velocity = list(CENTER), [0.0] * 3
        self.force = [0.0] * 3
        self.commanded = 0.0
        self.lock = threading.Lock()

    def advance(self) -> None:
        """Up to now, in small steps."""
        now = time.monotonic()
        if now - self.commanded > IDLE_S:
            self.force = [0.0] * 3
        # Nobody looked meanwhile.
        self.at = max(self.at, now - 0.5)
        while self.at < now:
            dt = min(STEP_S, now - self.at)
            self.at += dt
            for i in range(3):
                if i == self.along:
                    continue
                # A soft hand that pulls across, slowly.
                hand = self.pull_n * math.sin(2 * math.pi * (0.3 + 0.1 * i) * self.at)
                hand -= 50.0 * (self.position[i] - CENTER[i])
                total = hand + self.force[i] - DAMPING * self.velocity[i]
                self.velocity[i] += dt * total / MASS_KG
                self.position[i] += dt * self.velocity[i]
        w = 2 * math.pi * 0.7
        self.position[self.along] = CENTER[self.along] + 0.0125 * math.sin(w * now)
        self.velocity[self.along] = 0.0125 * w * math.cos(w * now)


def vector(values: List[float]) -> Dict[str, float]:
    # The service sends single precision.
    return {axis: float(f"{value:.9g}") for axis, value in zip(AXES, values)}


def device(world: World, with_config: bool) -> Dict[str, Any]:
    angles = {"a0": -88.8, "a1": 118.2, "a2": 3.75}
    identity = {
        "position": {"x": 0.0, "y": 0.0, "z": 0.0},
        "rotation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "scale": {"x": 1.0, "y": 1.0, "z": 1.0},
    }
    playing = any(world.force)
    own: Dict[str, Any] = {
        "device_id": ID,
        "state": {
            "angular_position": angles,
            "angular_velocity": {"a0": 0.0, "a1": 0.0, "a2": 0.0},
            "body_orientation": {"x": 0.0355, "y": 0.699, "z": 0.0026, "w": 0.7143},
            "cursor_position": vector(world.position),
            "cursor_velocity": vector(world.velocity),
            "current_cursor_force": vector(world.force),
            "mode": "force_control" if playing else "idle",
            "control_domain": "cartesian" if playing else "undefined",
            "control_mode": "force" if playing else "idle",
            "transform": identity,
        },
        "status": {
            "calibrated": True,
            "in_use": playing,
            "power_supply": True,
            "ready": True,
            "started": True,
        },
    }
    if with_config:
        own["config"] = {
            "type": "inverse3",
            "device_info": {
                "major_version": 7,
                "minor_version": 5,
                "id": ID,
                "device_type": 4,
                "uuid": "0" * 28 + ID,
            },
            "port": "MOCK",
            "extended_device_id": "0" * 28 + ID,
            "extended_firmware_version": "0" * 32,
            "gravity_compensation": {"enabled": True, "scaling_factor": 1.0},
            "handedness": "right",
            "streaming_mode": "USB",
            "torque_scaling": {"enabled": True},
            "home_return": {"enabled": False},
            "preset": "defaults",
            "basis": {"permutation": "XYZ"},
            "mount": identity,
            "filters": {"force_gate": {"gain": 0.3}, "damping": {"scalar": 0.0}},
        }
    return own


def message(world: World, session: int, whole: bool) -> str:
    return json.dumps(
        {
            "session_id": session,
            "inverse3": [device(world, whole)],
            "verse_grip": [],
            "wireless_verse_grip": [],
            "custom_verse_grip": [],
        }
    )


def serve(connection: socket.socket, world: World, session: int) -> None:
    try:
        client = WebSocket.accept(connection)
        with world.lock:
            world.advance()
            first = message(world, session, True)
        client.send(first)
        while True:
            told = json.loads(client.receive(None))
            whole = "force_render_full_state" in told.get("session", {})
            with world.lock:
                world.advance()
                for own in told.get("inverse3", []):
                    command = own.get("commands", {}).get("set_cursor_force")
                    if own.get("device_id") == ID and command is not None:
                        force = [float(command["vector"].get(axis, 0.0)) for axis in AXES]
                        if all(map(math.isfinite, force)):
                            world.force, world.commanded = force, time.monotonic()
                answer = message(world, session, whole)
            client.send(answer)
    except (OSError, ValueError, WebSocketError, TimeoutError):
        pass
    finally:
        with world.lock:
            world.force = [0.0] * 3
        connection.close()


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--port", type=int, default=10001, help="0: any; it is printed")
    parser.add_argument("--axis", choices=AXES, default="x")
    parser.add_argument("--pull", type=float, default=1.0, metavar="N", help="force across")
    args = parser.parse_args()
    listener = socket.create_server(("127.0.0.1", args.port))
    print(listener.getsockname()[1], flush=True)
    world = World(AXES.index(args.axis), args.pull)
    session = 0
    while True:
        connection, _ = listener.accept()
        session += 1
        threading.Thread(target=serve, args=(connection, world, session), daemon=True).start()


if __name__ == "__main__":
    sys.exit(main())
