"""A haptic device as a controller program of `study` (format ``study-process/2``).

A laboratory writes the :class:`Axis` of its device: how to read the position and how to push.
:func:`run` does the rest: the messages, the servo that renders a table, the trips, and the cases
in which the force has to be off (``free``, no ``alive``, end of input, an exception).

docs/devices.md of `study`, section 3, specifies messages and servo.
"""

from .axis import Axis, AxisError, Reading
from .program import Device, run
from .servo import Constants, Servo, Table, Trip

__all__ = [
    "Axis",
    "AxisError",
    "Constants",
    "Device",
    "Reading",
    "Servo",
    "Table",
    "Trip",
    "run",
]
__version__ = "0.1.0"
