"""What a laboratory writes: one axis of its device."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional


class AxisError(Exception):
    """The device cannot be read or driven; its text is shown to the experimenter."""


@dataclass(frozen=True)
class Reading:
    """What the device measured at one instant."""

    #: Position of the handle, mm.
    x_mm: float
    #: Its speed, mm/s; ``None`` if the device measures positions only.
    v_mm_s: Optional[float] = None
    #: Force that the hand applies towards larger x by a sensor, N; ``None`` without one.
    measured_n: Optional[float] = None
    #: When that was, s on a clock that only rises; ``None``: when :meth:`Axis.read` returned.
    t_s: Optional[float] = None


class Axis:
    """One axis of a device. All methods are called by one thread, and none may wait for long."""

    #: Whether :meth:`read` waits for the device's next measurement, which then sets the pace.
    sets_pace = False

    def read(self) -> Reading:
        """Position and speed now."""
        raise NotImplementedError

    def push(self, motor_n: float) -> None:
        """Pushes the handle with this force, N, positive towards larger x.

        That is the opposite of the force of a table, which is what the hand has to apply.
        """
        raise NotImplementedError

    def limp(self) -> None:
        """Switches the force off at once, in any state, also twice."""
        self.push(0.0)

    def notes(self) -> str:
        """What was noticed in a playback, in a line; printed on standard error after it."""
        return ""

    def close(self) -> None:
        """Ends the connection; the force is off."""
