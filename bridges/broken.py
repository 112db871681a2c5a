"""A simulated device with one mistake that a bridge may have: what `study device check` says of each.

    python3 bridges/broken.py                       the names
    python3 bridges/broken.py half-force            the device
    python3 bridges/broken.py --table STUDY         checks all with that program, and prints the table of docs/bridges.md
"""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Callable, Dict, List, Optional, Tuple

from common import Axis, Device, Reading, run
from study_device import program as program_module
from study_device import servo as servo_module
from study_device.program import _Program
from study_device.servo import Servo, Table

W = 2.0 * math.pi * 0.7


class Simulated(Axis):
    """A hand that no force can stop, and a force sensor."""

    has_sensor = True

    def __init__(self) -> None:
        self.motor_n = 0.0

    def read(self) -> Reading:
        t = time.monotonic()
        sensed = -self.motor_n if self.has_sensor else None
        return Reading(12.5 * math.sin(W * t), 12.5 * W * math.cos(W * t), sensed, t)

    def push(self, motor_n: float) -> None:
        self.motor_n = motor_n


DEVICE: Dict[str, Any] = dict(
    id="broken",
    force_n=9.0,
    velocity_mm_s=1000.0,
    stroke_mm=(-40.0, 40.0),
    version="0.1",
    simulated=True,
)
#: Name: what is wrong, and what makes it so.
FLAWS: Dict[str, Tuple[str, Callable[[Simulated], None]]] = {}


def flaw(name: str, what: str):
    def add(make: Callable[[Simulated], None]) -> None:
        FLAWS[name] = (what, make)

    return add


def patch(owner: Any, name: str, make: Callable[[Any], Any]) -> None:
    setattr(owner, name, make(getattr(owner, name)))


@flaw("none", "nothing")
def _(axis):
    pass


@flaw("motor-sign", "the motor pushes the wrong way; there is a force sensor")
def _(axis):
    patch(Simulated, "push", lambda old: lambda self, n: old(self, -n))


@flaw("force-sign", "the force of the table with the wrong sign")
def _(axis):
    patch(Servo, "step", lambda old: lambda self, *a: _negated(self, old(self, *a)))


def _negated(servo, force_n):
    servo.force_n = -force_n
    return -force_n


@flaw("half-force", "the motor gives half of the force; there is a force sensor")
def _(axis):
    patch(Simulated, "push", lambda old: lambda self, n: old(self, 0.5 * n))


@flaw("half-force-unseen", "the same without a sensor")
def _(axis):
    Simulated.has_sensor = False
    patch(Simulated, "push", lambda old: lambda self, n: old(self, 0.5 * n))


@flaw("meters", "positions and speeds in meters")
def _(axis):
    _readings(lambda r: Reading(1e-3 * r.x_mm, 1e-3 * r.v_mm_s, r.measured_n, r.t_s))


@flaw("turns-per-second", "speeds in another unit")
def _(axis):
    _readings(lambda r: Reading(r.x_mm, r.v_mm_s / (2 * math.pi), r.measured_n, r.t_s))


@flaw("late", "the force of 20 ms ago is commanded")
def _(axis):
    _delayed(Servo, "step", 20)


@flaw("late-motor", "the motor pushes 20 ms late; there is a force sensor")
def _(axis):
    queue: List[float] = [0.0] * 20

    def push(self, n):
        queue.append(n)
        self.motor_n = queue.pop(0)

    def limp(self):
        queue[:] = [0.0] * 20
        self.motor_n = 0.0

    Simulated.push, Simulated.limp = push, limp


@flaw("late-speed", "the speed through a low-pass of 5 Hz")
def _(axis):
    state = [0.0]

    def slow(r):
        state[0] += (1.0 - math.exp(-2 * math.pi * 5.0 * 1e-3)) * (r.v_mm_s - state[0])
        return Reading(r.x_mm, state[0], r.measured_n, r.t_s)

    _readings(slow)


@flaw("nan", "a sample that is no number, now and then")
def _(axis):
    def say(old):
        def new(self, message, **fields):
            if message == "samples" and time.monotonic() % 2.0 < 0.03:
                t, x, v, _, measured = fields["samples"][-1]
                fields["samples"] = fields["samples"][:-1] + [(t, x, v, float("nan"), measured)]
            text = json.dumps({"say": message, **fields})
            self.lines.put(text.encode() + b"\n")

        return new

    patch(_Program, "say", say)


@flaw("deaf-to-free", "ignores free")
def _(axis):
    _deaf("free")


@flaw("deaf-to-stop", "ignores stop")
def _(axis):
    _deaf("stop")


@flaw("deaf-to-alive", "plays on without alive")
def _(axis):
    def start(old):
        def new(self):
            old(self)
            self.alive_s = math.inf

        return new

    patch(_Program, "_start", start)
    patch(_Program, "_command", lambda old: lambda self, c: c and c["do"] == "alive" or old(self, c))


@flaw("deaf-to-end", "plays on when its input has ended")
def _(axis):
    patch(_Program, "_command", lambda old: lambda self, c: c and old(self, c))


@flaw("no-latch", "starts again after free, without a load")
def _(axis):
    kept: List[Any] = [None]

    def off(old):
        def new(self):
            kept[0] = self.table or kept[0]
            old(self)

        return new

    def start(old):
        def new(self):
            self.table = self.table or kept[0]
            old(self)

        return new

    patch(_Program, "_off", off)
    patch(_Program, "_start", start)


@flaw("first-table", "of two loads it plays the first")
def _(axis):
    def load(old):
        def new(self, command):
            table = self.kept if getattr(self, "kept", None) else command["table"]
            self.kept = None if getattr(self, "kept", None) else command["table"]
            old(self, {**command, "table": table})

        return new

    patch(_Program, "_load", load)


@flaw("no-clamp", "ignores the force limit of a load")
def _(axis):
    patch(Servo, "__init__", lambda old: lambda self, t, c, f, v: old(self, t, c, 100.0, v))


@flaw("no-ramp", "full force at once")
def _(axis):
    _other_constants(ramp_s=1e-6, slew_n_s=1e9)


@flaw("no-velocity-trip", "goes on above the velocity limit")
def _(axis):
    patch(Servo, "__init__", lambda old: lambda self, t, c, f, v: old(self, t, c, f, 1e9))


@flaw("no-range-trip", "goes on beyond the range")
def _(axis):
    _other_constants(overtravel_mm=1e9)


@flaw("no-stroke", "loads a table beyond its stroke")
def _(axis):
    def hello(old):
        return lambda self: {**old(self), "stroke_mm": [-20.0, 20.0]}

    patch(Device, "hello", hello)


@flaw("strict", "ends at a command that it does not know")
def _(axis):
    def command(old):
        def new(self, c):
            if c is not None and c["do"] == "future-command":
                raise ValueError("unknown command")
            old(self, c)

        return new

    patch(_Program, "_command", command)


@flaw("old-position", "reads the position every twentieth turn only")
def _(axis):
    state: List[Any] = [0, None]

    def old(r):
        if state[0] % 20 == 0:
            state[1] = r
        state[0] += 1
        return Reading(state[1].x_mm, state[1].v_mm_s, r.measured_n, r.t_s)

    _readings(old)


@flaw("no-constants", "tells no constants, and filters the acceleration at 5 Hz")
def _(axis):
    patch(Device, "hello", lambda old: lambda self: _without(old(self), "servo"))
    _other_constants(acceleration_hz=5.0)


@flaw("other-constants", "tells the usual damping, and adds 0.02 N·s/mm")
def _(axis):
    _other_constants(damping_n_s_per_mm=0.02)


@flaw("strange-constants", "tells an added damping of 0.02 N·s/mm")
def _(axis):
    def hello(old):
        return lambda self: {**old(self), "servo": {"loop_hz": 1000, "damping_n_s_per_mm": 0.02}}

    patch(Device, "hello", hello)


@flaw("no-mass", "leaves the mass out")
def _(axis):
    _parameters(lambda self, x, z, found: (0.0, *found[1:]))


@flaw("one-branch", "plays the branch for larger x in both directions")
def _(axis):
    def parameters(old):
        return lambda self, x, z: old(self, x, 1.0)

    patch(Table, "parameters", parameters)


@flaw("sign-rule", "the rule sign in the place of play and Dahl")
def _(axis):
    def table(old):
        def new(self, value):
            old(self, value)
            self.rule = "sign"

        return new

    patch(Table, "__init__", table)


@flaw("node-numbers", "the table one node too far")
def _(axis):
    _parameters(lambda self, x, z, found: self.old(x + 1.0, z))


@flaw("fast-clock", "times that run a tenth too fast")
def _(axis):
    _rows(lambda i, row: (1.1 * row[0], *row[1:]))


@flaw("counted-times", "times that are counted, not measured, of a loop that is late")
def _(axis):
    patch(Simulated, "read", lambda old: lambda self: (time.sleep(1.3e-3), old(self))[1])
    count = [0]

    def row(i, row):
        count[0] = 0 if row[0] < 1e-9 else count[0] + 1
        return (1e-3 * count[0], *row[1:])

    _rows(row)


@flaw("backwards", "the samples of a message in the wrong order")
def _(axis):
    def say(old):
        def new(self, message, **fields):
            if message == "samples":
                fields["samples"] = fields["samples"][::-1]
            old(self, message, **fields)

        return new

    patch(_Program, "say", say)


@flaw("slow", "a loop of 200 Hz")
def _(axis):
    DEVICE["constants"] = servo_module.Constants(loop_hz=200.0)


@flaw("whistle", "a vibration of 0.4 N at 250 Hz is added")
def _(axis):
    def step(old):
        def new(self, t, x, v):
            n = old(self, t, x, v)
            # added behind the servo, so that its filters do not see it
            self.hum = 0.4 * math.sin(2 * math.pi * 250.0 * t)
            return n + self.hum

        return new

    patch(Servo, "step", step)


@flaw("strokes", "counts every stroke three times")
def _(axis):
    def outcome(old):
        def new(self):
            found = old(self)
            return {**found, "strokes": 3 * found["strokes"]}

        return new

    patch(Servo, "outcome", outcome)


@flaw("fold-back", "the motor gives less while the handle is slow; there is a force sensor")
def _(axis):
    def push(self, n):
        slow = abs(12.5 * W * math.cos(W * time.monotonic())) < 20.0
        self.motor_n = 0.4 * n if slow else n

    Simulated.push = push


def _readings(change: Callable[[Reading], Reading]) -> None:
    patch(Simulated, "read", lambda old: lambda self: change(old(self)))


def _rows(change: Callable[[int, Any], Any]) -> None:
    def say(old):
        def new(self, message, **fields):
            if message == "samples":
                fields["samples"] = [change(i, row) for i, row in enumerate(fields["samples"])]
            old(self, message, **fields)

        return new

    patch(_Program, "say", say)


def _delayed(owner: Any, name: str, turns: int) -> None:
    def make(old):
        def new(self, *a):
            if not hasattr(self, "queue"):
                self.queue = [0.0] * turns
            self.queue.append(old(self, *a))
            return self.queue.pop(0)

        return new

    patch(owner, name, make)


def _deaf(name: str) -> None:
    patch(_Program, "_command", lambda old: lambda self, c: c and c["do"] == name or old(self, c))


def _other_constants(**changed: float) -> None:
    """The servo has others than it tells."""

    def init(old):
        def new(self, t, c, f, v):
            old(self, t, servo_module.Constants(**{**c.to_json(), **changed}), f, v)

        return new

    patch(Servo, "__init__", init)


def _parameters(change: Callable[..., Any]) -> None:
    old = Table.parameters

    def new(self, x, z):
        self.old = lambda x, z: old(self, x, z)
        return change(self, x, z, old(self, x, z))

    Table.parameters = new


def _without(value: Dict[str, Any], key: str) -> Dict[str, Any]:
    return {k: v for k, v in value.items() if k != key}


# -- the table


def checked(study: str, name: str) -> "Tuple[str, List[str]]":
    """The verdict about one, and what is seen."""
    done = subprocess.run(
        [os.path.abspath(study), "device", "check", "--json", "--command", f"python3 broken.py {name}"],
        cwd=os.path.dirname(os.path.abspath(__file__)),
        capture_output=True,
        text=True,
    )
    try:
        told = json.loads(done.stdout)
    except ValueError:
        lines = done.stderr.strip().splitlines()
        return "refused", [line.partition(": ")[2] for line in lines if line.startswith("error")]
    clauses = [v for v in told["verdicts"] if not v["pass"]]
    rendering = [r for r in told["rendering"] or [] if r["result"] != "pass"]
    failed = [r for r in rendering if r["result"] == "fail"]
    seen = [f"`{v['clause']}`: {v['seen']}" for v in clauses]
    if failed:
        seen.append(f"{len(failed)} tables: {failed[0]['what']}: {failed[0]['seen'].partition('; VAF')[0]}")
    elif rendering:
        seen.append(f"{len(rendering)} tables not judged: {rendering[0]['what']}: {rendering[0]['seen']}")
    if told["pass"]:
        return "pass", []
    judged = failed or any(v["judged"] for v in clauses)
    return ("FAIL" if judged else "open"), seen


def table(study: str, names: List[str]) -> int:
    with ThreadPoolExecutor(6) as pool:
        found = list(pool.map(lambda name: checked(study, name), names))
    print("| name | what is wrong | check | what it says |\n|---|---|---|---|")
    for name, (verdict, seen) in zip(names, found):
        words = "; ".join(one if len(one) < 170 else one[:170] + "…" for one in seen[:2]).replace("|", "\\|")
        print(f"| {name} | {FLAWS[name][0]} | {verdict} | {words} |")
    unseen = [n for n, (verdict, _) in zip(names, found) if verdict == "pass"]
    return 0 if unseen == [n for n in names if n in ("none", "half-force-unseen")] else 1


def main(arguments: List[str]) -> int:
    if not arguments:
        for name, (what, _) in FLAWS.items():
            print(f"{name:20} {what}")
        return 0
    if arguments[0] == "--table":
        return table(arguments[1], arguments[2:] or list(FLAWS))
    axis = Simulated()
    FLAWS[arguments[0]][1](axis)
    return run(Device(**DEVICE), axis)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
