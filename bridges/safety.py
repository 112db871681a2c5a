"""How long a moteus has torque after an accident, on the mock: host killed, host stopped, bridge killed, bridge stopped.

    python3 bridges/safety.py 50

The controller's own watchdog (0.1 s) is what helps where the bridge is gone.
"""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import sys
import threading
import time
import tty
from typing import List

from moteus.mock import Controller

HERE = os.path.dirname(os.path.abspath(__file__))
TABLE = {
    "lookup": "linear",
    "direction": {"rule": "sign", "delta_mm": None},
    "trained": {"x_mm": [-15.0, 15.0], "v_mm_s": 300.0},
    "x_mm": [-15.0, 15.0],
    **{
        side: {"m_kg": [0.0] * 2, "b_n_s_per_mm": [0.0] * 2, "k_n_per_mm": [0.0] * 2, "f0_n": [2.0] * 2}
        for side in ("positive", "negative")
    },
}
LIMITS = {"force_n": 5.0, "velocity_mm_s": 1000.0}
#: No torque, N·m.
ZERO_NM = 1e-4


class Rig:
    """The mock on a pseudo-terminal in this process, with the time since which it has no torque."""

    def __init__(self) -> None:
        self.controller = Controller(1, 20.0)
        self.master, slave = os.openpty()
        tty.setraw(slave)
        self.path = os.ttyname(slave)
        self.slave = slave
        self.forceful_s = 0.0
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        rest = b""
        while True:
            ready, _, _ = select.select([self.master], [], [], 2e-4)
            if ready:
                *lines, rest = (rest + os.read(self.master, 4096)).split(b"\n")
                for line in lines:
                    out = self.controller.answer(line.strip())
                    if out:
                        os.write(self.master, out)
            self.controller.advance()
            if abs(self.controller.torque_nm) > ZERO_NM:
                self.forceful_s = time.monotonic()


def one(rig: Rig, how: str) -> float:
    """An accident; ms from it to the last torque."""
    bridge = subprocess.Popen(
        [sys.executable, os.path.join(HERE, "moteus", "bridge.py"), "--port", rig.path, "--radius", "20", "--simulated"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    bridge.stdout.readline()  # its hello
    threading.Thread(target=lambda: [None for _ in bridge.stdout], daemon=True).start()

    def tell(do: str, **more) -> None:
        bridge.stdin.write((json.dumps({"do": do, "load": 1, **more}) + "\n").encode())
        bridge.stdin.flush()

    tell("load", table=TABLE, limits=LIMITS, uncertified=False, model="m")
    tell("start")
    began = time.monotonic()
    # at another phase between two signs of life each time
    lasting = 0.6 + 0.02 * (hash(str(began)) % 100) / 100
    while time.monotonic() - began < lasting or abs(rig.controller.torque_nm) < 0.01:
        tell("alive")
        time.sleep(0.02)
        assert time.monotonic() - began < 20, "it does not play"
    accident = time.monotonic()
    if how == "host killed":
        bridge.stdin.close()
    elif how == "bridge killed":
        bridge.kill()
    elif how == "bridge stopped":
        os.kill(bridge.pid, signal.SIGSTOP)
    time.sleep(0.7)
    lasted = 1e3 * (rig.forceful_s - accident)
    bridge.kill()
    bridge.wait()
    return lasted


def main() -> None:
    times = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    print("| | n | median, ms | most, ms |\n|---|---|---|---|")
    for how in ("host killed", "host stopped", "bridge killed", "bridge stopped"):
        rig = Rig()
        found: List[float] = sorted(one(rig, how) for _ in range(times))
        print(f"| {how} | {times} | {found[times // 2]:.1f} | {found[-1]:.1f} |", flush=True)


if __name__ == "__main__":
    main()
