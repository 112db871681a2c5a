"""Whether the vendor's client (PyPI `moteus`) accepts the mock; exit status 77 without it.

    python3 bridges/moteus/accept.py
"""

from __future__ import annotations

import asyncio
import math
import os
import subprocess
import sys

HERE = os.path.dirname(os.path.abspath(__file__))
# The folder of the same name beside this file is not the vendor's package.
sys.path = [path for path in sys.path if os.path.abspath(path or ".") not in (HERE, os.path.dirname(HERE))]

try:
    import moteus
    from moteus.fdcanusb import Fdcanusb
except ImportError as error:
    print(f"the package moteus is not here: {error}", file=sys.stderr)
    sys.exit(77)


async def accept(path: str) -> None:
    controller = moteus.Controller(id=1, transport=Fdcanusb(path))
    stopped = await controller.set_stop(query=True)
    assert stopped.values[moteus.Register.MODE] == moteus.Mode.STOPPED, stopped
    state = await controller.query()
    values = state.values
    assert state.id == 1 and values[moteus.Register.FAULT] == 0, state
    assert abs(values[moteus.Register.VOLTAGE] - 24.0) < 0.5, state
    assert abs(values[moteus.Register.POSITION]) <= 12.5 / (2 * math.pi * 20) + 1e-6, state
    for _ in range(3):
        state = await controller.set_position(
            position=math.nan,
            velocity=0.0,
            feedforward_torque=0.05,
            kp_scale=0.0,
            kd_scale=0.0,
            maximum_torque=0.1,
            watchdog_timeout=0.2,
            query=True,
        )
        await asyncio.sleep(0.01)
    assert state.values[moteus.Register.MODE] == moteus.Mode.POSITION, state
    assert abs(state.values[moteus.Register.TORQUE] - 0.05) < 1e-3, state
    await asyncio.sleep(0.4)
    state = await controller.query()
    assert state.values[moteus.Register.MODE] == moteus.Mode.TIMEOUT, state
    await controller.set_stop()
    print(f"moteus {moteus.VERSION}: the vendor's client accepts the mock")


def main() -> None:
    mock = subprocess.Popen(
        [sys.executable, os.path.join(HERE, "mock.py")],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        asyncio.run(accept(mock.stdout.readline().strip()))
    finally:
        mock.kill()


if __name__ == "__main__":
    main()
