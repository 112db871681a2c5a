"""What the bridges share: the client library from this repository, and their options."""

from __future__ import annotations

import argparse
import os
import sys

_HERE = os.path.dirname(os.path.abspath(__file__))
sys.path.insert(0, os.path.join(_HERE, "..", "clients", "python", "src"))

from study_device import Axis, AxisError, Constants, Device, Reading, run  # noqa: E402

__all__ = ["Axis", "AxisError", "Constants", "Device", "Reading", "device", "options", "run"]


def numbers(count: int):
    """An option with so many numbers, such as ``-40,40``."""

    def read(text: str):
        values = tuple(float(part) for part in text.split(","))
        if len(values) != count:
            raise ValueError(text)
        return values

    read.__name__ = f"{count} numbers"
    return read


def options(description: str, *, force_n: float, stroke: str, loop_hz: float) -> argparse.ArgumentParser:
    """A parser with the options that every bridge has."""
    parser = argparse.ArgumentParser(
        description=description, formatter_class=argparse.ArgumentDefaultsHelpFormatter
    )
    add = parser.add_argument
    add("--id", help="name of the device in every file; one for each device")
    add("--force", type=float, default=force_n, metavar="N", help="largest force")
    add("--velocity", type=float, default=800.0, metavar="MM_S", help="largest speed")
    add("--stroke", type=numbers(2), default=stroke, metavar="MM,MM", help="reach of the handle; write --stroke=-40,40")
    add("--origin", type=float, default=0.0, metavar="MM", help="position of the device that is 0 in the tables")
    add("--reverse", action="store_true", help="the tables count against the device's direction")
    add("--loop", type=float, default=loop_hz, metavar="HZ", help="turns per second")
    add("--least-mass", type=float, default=0.0, metavar="KG", help="smallest mass that is rendered: minus that of the handle, or 0")
    add("--stiffness", type=float, metavar="N_MM", help="stiffest realization that does not vibrate")
    add("--watchdog", type=float, default=200.0, metavar="MS", help="limp after so long without the host")
    add("--simulated", action="store_true", help="what is connected is a mock")
    return parser


def device(args: argparse.Namespace, id: str, version: str) -> Device:
    """What `hello` says with these options."""
    return Device(
        id=args.id or id,
        force_n=args.force,
        velocity_mm_s=args.velocity,
        stroke_mm=tuple(args.stroke),
        stiffness_n_per_mm=args.stiffness,
        version=version,
        simulated=args.simulated,
        watchdog_ms=args.watchdog,
        constants=Constants(loop_hz=args.loop, least_mass_kg=args.least_mass),
    )
