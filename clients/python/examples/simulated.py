"""A simulated axis with a hand that strokes it: `study device check --command "python3 …/simulated.py"`.

Replace the class by one for your device.
"""

import math
import os
import sys
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "src"))

from study_device import Axis, Device, Reading, run


class Simulated(Axis):
    """The hand moves the handle over ±12.5 mm, as if no force could stop it."""

    def read(self) -> Reading:
        t = time.monotonic()
        return Reading(x_mm=12.5 * math.sin(2 * math.pi * 0.7 * t), t_s=t)

    def push(self, motor_n: float) -> None:
        self.motor_n = motor_n


if __name__ == "__main__":
    device = Device(
        id="simulated-python",
        force_n=12.0,
        velocity_mm_s=1000.0,
        stroke_mm=(-40.0, 40.0),
        version="0.1.0",
        simulated=True,
    )
    sys.exit(run(device, Simulated()))
