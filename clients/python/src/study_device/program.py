"""The loop of a controller program, and its messages with `study`."""

from __future__ import annotations

import gc
import json
import math
import os
import queue
import signal
import sys
import threading
import time
from dataclasses import dataclass, field
from typing import Any, Dict, List, Optional, Tuple

from .axis import Axis, AxisError, Reading
from .servo import Constants, Servo, Table, Trip

FORMAT = "study-process/2"
#: Samples are sent this often, s.
SEND_S = 0.02
#: Turns per second without a playback.
IDLE_HZ = 100.0
Row = Tuple[float, float, float, float, Optional[float]]


@dataclass(frozen=True)
class Device:
    """What the program says of itself in `hello`."""

    #: 1 to 64 characters; the name of the device in every file.
    id: str
    #: The most that the device can do: force in N, speed in mm/s.
    force_n: float
    velocity_mm_s: float
    #: Positions that the handle can reach, mm.
    stroke_mm: Tuple[float, float]
    #: The stiffest realization that it renders without vibration, N/mm.
    stiffness_n_per_mm: Optional[float] = None
    #: Version of the program and of the firmware behind it.
    version: Optional[str] = None
    #: Whether there is no motor and no hand: then every session is a pilot.
    simulated: bool = False
    #: The force is off this long after the last sign of life of `study`, ms: 50 to 500.
    watchdog_ms: float = 200.0
    constants: Constants = field(default_factory=Constants)

    def hello(self) -> Dict[str, Any]:
        """The message."""
        hello: Dict[str, Any] = {
            "format": FORMAT,
            "id": self.id,
            "telemetry": True,
            "simulated": self.simulated,
            "limits": {"force_n": self.force_n, "velocity_mm_s": self.velocity_mm_s},
            "stroke_mm": list(self.stroke_mm),
            "watchdog_ms": self.watchdog_ms,
            "servo": self.constants.to_json(),
        }
        if self.version is not None:
            hello["version"] = self.version
        if self.stiffness_n_per_mm is not None:
            hello["stiffness_n_per_mm"] = self.stiffness_n_per_mm
        return hello


def run(device: Device, axis: Axis) -> int:
    """Plays until the input ends; returns the exit status.

    The force is off whenever this function is left, also by an exception or a signal.
    """
    program = _Program(device, axis)
    if hasattr(signal, "SIGTERM") and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGTERM, lambda *_: program.commands.put(None))
    try:
        program.loop()
        return 0
    except KeyboardInterrupt:
        return 130
    except AxisError as error:
        program.say("fault", what=str(error))
        print(error, file=sys.stderr)
        return 1
    except Exception as error:
        program.say("fault", what=f"{type(error).__name__}: {error}")
        raise
    finally:
        try:
            axis.limp()
        except AxisError:
            pass  # It is gone, and its own watchdog has to do it.
        finally:
            axis.close()
            program.flush()


class _Program:
    def __init__(self, device: Device, axis: Axis) -> None:
        self.device = device
        self.axis = axis
        self.commands: "queue.SimpleQueue[Optional[Dict[str, Any]]]" = queue.SimpleQueue()
        self.lines: "queue.SimpleQueue[Optional[bytes]]" = queue.SimpleQueue()
        self.load = 0
        self.table: Optional[Table] = None
        self.limits = (0.0, 0.0)
        self.servo: Optional[Servo] = None
        self.rows: List[Row] = []
        self.sent_s = 0.0
        self.alive_s = 0.0
        self.last: Row = (0.0, 0.0, 0.0, 0.0, None)
        self.ended = False
        # A turn that waits for another thread is late.
        sys.setswitchinterval(2e-4)
        self.writer = threading.Thread(target=self._write, daemon=True)
        self.writer.start()

    # -- messages

    def say(self, message: str, **fields: Any) -> None:
        text = json.dumps({"say": message, **fields}, allow_nan=False)
        self.lines.put(text.encode() + b"\n")

    def _write(self) -> None:
        """A host that does not read must not stop the loop."""
        while True:
            line = self.lines.get()
            if line is None:
                return
            view = memoryview(line)
            try:
                while view:
                    view = view[os.write(1, view) :]
            except OSError:
                return

    def flush(self) -> None:
        self.lines.put(None)
        self.writer.join(0.3)

    def _read(self) -> None:
        # Not sys.stdin: a thread that waits in it stops the end of the program.
        rest = b""
        while True:
            try:
                more = os.read(0, 65536)
            except OSError:
                more = b""
            if not more:
                self.commands.put(None)
                return
            *lines, rest = (rest + more).split(b"\n")
            for line in lines:
                try:
                    command = json.loads(line)
                except ValueError:
                    continue
                if isinstance(command, dict):
                    self.commands.put(command)

    # -- the loop

    def loop(self) -> None:
        gc.disable()
        _priority()
        self._off()
        self.say("hello", **self.device.hello())
        threading.Thread(target=self._read, daemon=True).start()
        due = time.monotonic()
        while not self.ended:
            self._commands()
            reading = self.axis.read()
            now = time.monotonic()
            self._turn(reading, now if reading.t_s is None else reading.t_s, now)
            if self.axis.sets_pace:
                continue
            playing = self.servo is not None
            due += 1.0 / (self.device.constants.loop_hz if playing else IDLE_HZ)
            left = due - time.monotonic()
            if left > 0.0:
                if not playing:
                    self._wait(left)
                    due = min(due, time.monotonic() + 1e-3)
                else:
                    time.sleep(left)
            elif left < -2.0 / self.device.constants.loop_hz:
                # What is missed is missed: turns do not pile up.
                due = time.monotonic()

    def _wait(self, left: float) -> None:
        """Waits for a command; one that comes is answered at once."""
        try:
            self._command(self.commands.get(timeout=left))
        except queue.Empty:
            pass

    def _turn(self, reading: Reading, t_s: float, now: float) -> None:
        servo = self.servo
        if servo is None:
            self.last = (
                self.last[0], reading.x_mm, reading.v_mm_s or 0.0, 0.0, reading.measured_n
            )
            return
        if now - self.alive_s > 1e-3 * self.device.watchdog_ms:
            self._trip("no alive: the computer or its screen does not respond")
            return
        try:
            force_n = servo.step(t_s, reading.x_mm, reading.v_mm_s)
        except Trip as trip:
            self._trip(str(trip))
            return
        self.axis.push(-force_n)
        self.last = (servo.t_s, reading.x_mm, servo.v_mm_s, force_n, reading.measured_n)
        if not self.rows or self.rows[-1][0] < servo.t_s:
            self.rows.append(self.last)
        if now - self.sent_s >= SEND_S:
            self.sent_s = now
            self._send()

    def _send(self) -> None:
        if self.rows and self.servo is not None:
            self.say("samples", load=self.load, samples=self.rows)
            self.say(
                "progress", load=self.load, strokes=self.servo.strokes, clamps=self.servo.clamps
            )
        self.rows = []

    def _off(self) -> None:
        """No force before the next load and start."""
        self.axis.limp()
        self.table = None
        if self.servo is not None:
            self.servo = None
            notes = self.axis.notes()
            if notes:
                print(notes, file=sys.stderr, flush=True)
        self.rows = []

    def _trip(self, why: str) -> None:
        self.axis.limp()
        self._send()
        self._off()
        self.say("fault", what=why)

    # -- commands

    def _commands(self) -> None:
        while not self.ended:
            try:
                command = self.commands.get_nowait()
            except queue.Empty:
                return
            self._command(command)

    def _command(self, command: Optional[Dict[str, Any]]) -> None:
        if command is None:
            self._free()
            self.ended = True
            return
        do, load = command.get("do"), command.get("load")
        if do == "load":
            self._off()
            self.load = int(load or 0)
            self._load(command)
        elif do == "free":
            self.load = int(load or 0)
            self._free()
        elif load != self.load:
            return
        elif do == "start":
            self._start()
        elif do == "stop":
            self._stop()
        elif do == "alive":
            self.alive_s = time.monotonic()

    def _load(self, command: Dict[str, Any]) -> None:
        try:
            if command.get("table") is None:
                raise ValueError("it plays tables only")
            table = Table(command["table"])
            low, high = self.device.stroke_mm
            if table.low_mm < low or table.high_mm > high:
                raise ValueError(
                    f"it ranges from {table.low_mm:g} to {table.high_mm:g} mm, "
                    f"and the stroke from {low:g} to {high:g} mm"
                )
            limits = command["limits"]
            force_n, velocity = float(limits["force_n"]), float(limits["velocity_mm_s"])
            if not (math.isfinite(force_n) and force_n > 0 and velocity > 0):
                raise ValueError("its limits are no numbers above 0")
        except (ValueError, KeyError, TypeError) as error:
            self.say("refused", load=self.load, why=str(error))
            return
        self.table = table
        self.limits = (min(force_n, self.device.force_n), min(velocity, self.device.velocity_mm_s))
        self.say("loaded", load=self.load)

    def _start(self) -> None:
        if self.table is None or self.servo is not None:
            return
        self.servo = Servo(self.table, self.device.constants, *self.limits)
        self.rows = []
        self.sent_s = self.alive_s = time.monotonic()
        self.say("started", load=self.load)

    def _stop(self) -> None:
        servo = self.servo
        if servo is None:
            return
        self.axis.limp()
        self._send()
        self._off()
        self.say("outcome", load=self.load, **servo.outcome())

    def _free(self) -> None:
        self._off()
        reading = self.axis.read()
        t_s, _, v_mm_s, _, _ = self.last
        sample = (t_s, reading.x_mm, reading.v_mm_s or v_mm_s, 0.0, reading.measured_n)
        self.say("free", load=self.load, sample=sample)


def _priority() -> None:
    """Turns come in time on a computer that does other things, if the system permits it."""
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(10))  # type: ignore[attr-defined]
    except (AttributeError, OSError):
        try:
            os.nice(-10)
        except (AttributeError, OSError):
            pass
