"""The servo: from the measured motion to the force, in turns of any length.

docs/wire.md 7 and 8 and docs/devices.md 3 of `study` specify it.
"""

from __future__ import annotations

import bisect
import math
from dataclasses import asdict, dataclass
from typing import Any, Dict, List, Mapping, Optional, Sequence, Tuple

#: Corner of the low-pass of a speed from positions alone, Hz.
SPEED_HZ = 200.0
#: A clamp ends below this share of the limit.
CLAMP_END = 0.9
#: The share of the range at each side that counts as its end.
END_SHARE = 0.2


@dataclass(frozen=True)
class Constants:
    """What the servo adds to a table. State others only if the mechanics require it."""

    #: Turns per second that the loop is meant to have.
    loop_hz: float = 1000.0
    acceleration_hz: float = 20.0
    least_mass_kg: float = 0.0
    damping_n_s_per_mm: float = 0.002
    wall_n_per_mm: float = 10.0
    wall_n_s_per_mm: float = 0.01
    overtravel_mm: float = 2.5
    jump_mm: float = 1.0
    slew_n_s: float = 2000.0
    ramp_s: float = 0.4

    def to_json(self) -> Dict[str, float]:
        """As in `hello`."""
        return asdict(self)


class Trip(Exception):
    """The servo has switched the force off; why."""


class Branch:
    """Parameters for one direction, by node: mass kg, damping N·s/mm, stiffness N/mm, offset N."""

    __slots__ = ("nodes",)

    def __init__(self, value: Mapping[str, Any], count: int) -> None:
        columns = [
            _numbers(value, key) for key in ("m_kg", "b_n_s_per_mm", "k_n_per_mm", "f0_n")
        ]
        if any(len(column) != count for column in columns):
            raise ValueError("the branches have other nodes than x_mm")
        self.nodes: List[Tuple[float, float, float, float]] = list(zip(*columns))


class Table:
    """A realization as `load` has it.

    :raises ValueError: for a table that cannot be played, with the reason.
    """

    def __init__(self, value: Mapping[str, Any]) -> None:
        try:
            self.lookup: str = value["lookup"]
            direction = value["direction"]
            self.rule: str = direction["rule"]
            delta: Optional[float] = direction["delta_mm"]
            low, high = (float(x) for x in value["trained"]["x_mm"])
            self.trained_mm_s = float(value["trained"]["v_mm_s"])
            self.x_mm = _numbers(value, "x_mm")
            self.positive = Branch(value["positive"], len(self.x_mm))
            self.negative = Branch(value["negative"], len(self.x_mm))
        except (KeyError, TypeError) as error:
            raise ValueError(f"the table is not complete: {error!r}") from None
        self.low_mm, self.high_mm = low, high
        if self.lookup not in ("linear", "floor", "nearest"):
            raise ValueError(f"unknown look-up {self.lookup!r}")
        if self.rule not in ("sign", "play", "dahl"):
            raise ValueError(f"unknown direction rule {self.rule!r}")
        if self.rule != "sign" and not (delta is not None and delta > 0):
            raise ValueError("the direction rule has no delta_mm above 0")
        self.delta_mm = delta or 0.0
        ascend = all(a < b for a, b in zip(self.x_mm, self.x_mm[1:]))
        if len(self.x_mm) < 2 or not ascend or not low < high:
            raise ValueError("its positions do not ascend")
        if not all(map(math.isfinite, (low, high, self.trained_mm_s))):
            raise ValueError("its range or speed is no number")

    def parameters(self, x_mm: float, z: float) -> Tuple[float, float, float, float]:
        """Mass, damping, stiffness and offset at a position, both directions mixed by z."""
        xs = self.x_mm
        last = len(xs) - 1
        left = bisect.bisect_right(xs, x_mm) - 1
        if left < 0:
            left, part = 0, 0.0
        elif left >= last:
            left, part = last, 0.0
        else:
            part = (x_mm - xs[left]) / (xs[left + 1] - xs[left])
            if self.lookup == "floor":
                part = 0.0
            elif self.lookup == "nearest":
                left, part = left + (part > 0.5), 0.0
        up, down = 0.5 * (1.0 + z), 0.5 * (1.0 - z)
        p, n = self.positive.nodes[left], self.negative.nodes[left]
        m, b, k, f = (up * p[i] + down * n[i] for i in range(4))
        if part:
            p, n = self.positive.nodes[left + 1], self.negative.nodes[left + 1]
            m += part * (up * p[0] + down * n[0] - m)
            b += part * (up * p[1] + down * n[1] - b)
            k += part * (up * p[2] + down * n[2] - k)
            f += part * (up * p[3] + down * n[3] - f)
        return m, b, k, f


def _numbers(value: Mapping[str, Any], key: str) -> List[float]:
    numbers: Sequence[Any] = value[key]
    found = [float(n) for n in numbers]
    if not all(map(math.isfinite, found)):
        raise ValueError(f"{key} has a value that is no number")
    return found


class Servo:
    """Plays a table; one for each playback."""

    def __init__(
        self, table: Table, constants: Constants, force_n: float, velocity_mm_s: float
    ) -> None:
        self._table = table
        self._own = constants
        self._force_n = force_n
        self._velocity_mm_s = velocity_mm_s
        self._began_s: Optional[float] = None
        self._last_s = 0.0
        self._last_x = 0.0
        self._v = 0.0
        self._band = self._low = 0.0
        self._z = 1.0
        self._slewed_n = 0.0
        self._clamping = False
        self._end: Optional[bool] = None
        self._energy_j = 0.0
        self._switches = 0
        #: The force that the hand has to apply since the last turn, N.
        self.force_n = 0.0
        #: Speed of the last turn, mm/s.
        self.v_mm_s = 0.0
        #: Time since the start, s.
        self.t_s = 0.0
        self.strokes = 0
        self.clamps = 0
        self.least_energy_j = 0.0

    def outcome(self) -> Dict[str, float]:
        """What the playback was, with the keys of the message."""
        return {
            "duration_s": self.t_s,
            "strokes": self.strokes,
            "least_energy_j": self.least_energy_j,
            "switches_per_s": self._switches / self.t_s if self.t_s > 0 else 0.0,
            "clamps": self.clamps,
        }

    def step(self, t_s: float, x: float, v: Optional[float]) -> float:
        """One turn: the force that the hand has to apply from now on, N.

        ``t_s`` is a clock that only rises, ``x`` mm, ``v`` mm/s or ``None``.

        :raises Trip: if the force has to be off.
        """
        own, table = self._own, self._table
        if self._began_s is None:
            self._began_s, dt, dx = t_s, 1.0 / own.loop_hz, 0.0
            v = v if v is not None else 0.0
            acceleration = 0.0
        else:
            dt, dx = t_s - self._last_s, x - self._last_x
            if not dt > 0.0:
                return self.force_n
            if v is None:
                part = 1.0 - math.exp(-2.0 * math.pi * SPEED_HZ * dt)
                v = self._v + part * (dx / dt - self._v)
            acceleration = 1e-3 * (v - self._v) / dt
        self._trips(x, v, acceleration, dx, dt)
        self._energy_j += 1e-3 * self.force_n * dx
        self.least_energy_j = min(self.least_energy_j, self._energy_j)
        self._last_s, self._last_x, self._v = t_s, x, v
        self.t_s, self.v_mm_s = t_s - self._began_s, v
        self._count_strokes(x)

        acceleration = self._low_pass(acceleration, dt)
        self._turn(dx, v)
        inside = min(max(x, table.low_mm), table.high_mm)
        mass, damping, stiffness, offset = table.parameters(inside, self._z)
        slow = min(max(v, -table.trained_mm_s), table.trained_mm_s)
        wanted = (
            max(mass, own.least_mass_kg) * acceleration
            + damping * slow
            + stiffness * inside
            + offset
            + own.damping_n_s_per_mm * v
        )
        beyond = x - inside
        if beyond:
            wall = own.wall_n_per_mm * beyond + own.wall_n_s_per_mm * v
            wanted += max(wall, 0.0) if beyond > 0.0 else min(wall, 0.0)
        if not math.isfinite(wanted):
            raise Trip("the force is no number")
        ramp = 1.0
        if self.t_s < own.ramp_s:
            ramp = 0.5 - 0.5 * math.cos(math.pi * self.t_s / own.ramp_s)
        self._count_clamps(abs(wanted * ramp))
        limit = self._force_n
        change = min(max(wanted, -limit), limit) - self._slewed_n
        most = own.slew_n_s * dt
        self._slewed_n += min(max(change, -most), most)
        self.force_n = min(max(self._slewed_n * ramp, -limit), limit)
        return self.force_n

    def _trips(self, x: float, v: float, a: float, dx: float, dt: float) -> None:
        own, table = self._own, self._table
        if not (math.isfinite(x) and math.isfinite(v) and math.isfinite(a)):
            raise Trip("position or speed is no number")
        if abs(v) > self._velocity_mm_s:
            raise Trip(f"velocity limit: {abs(v):.0f} mm/s")
        if not table.low_mm - own.overtravel_mm <= x <= table.high_mm + own.overtravel_mm:
            raise Trip(f"beyond the range: {x:.1f} mm")
        if abs(dx) > own.jump_mm * max(1.0, dt * own.loop_hz):
            raise Trip(f"the position jumped by {dx:.1f} mm")

    def _low_pass(self, a: float, dt: float) -> float:
        # Butterworth, two poles, as two trapezoidal integrators: the turn may have any length.
        k = math.tan(min(math.pi * self._own.acceleration_hz * dt, 1.5))
        first = 1.0 / (1.0 + k * (k + math.sqrt(2.0)))
        error = a - self._low
        band = first * self._band + k * first * error
        out = self._low + k * first * self._band + k * k * first * error
        self._band, self._low = 2.0 * band - self._band, 2.0 * out - self._low
        return out

    def _turn(self, dx: float, v: float) -> None:
        table, z = self._table, self._z
        if table.rule == "sign":
            z = 1.0 if v > 0.0 else -1.0 if v < 0.0 else z
        elif table.rule == "play":
            z = min(max(z + 2.0 * dx / table.delta_mm, -1.0), 1.0)
        elif dx:
            sign = math.copysign(1.0, dx)
            z = sign + (z - sign) * math.exp(-abs(dx) / table.delta_mm)
        self._switches += (z >= 0.0) != (self._z >= 0.0)
        self._z = z

    def _count_strokes(self, x: float) -> None:
        table = self._table
        zone = END_SHARE * (table.high_mm - table.low_mm)
        if x <= table.low_mm + zone:
            end = False
        elif x >= table.high_mm - zone:
            end = True
        else:
            return
        self.strokes += self._end is not None and self._end != end
        self._end = end

    def _count_clamps(self, size_n: float) -> None:
        if size_n > self._force_n:
            self.clamps += not self._clamping
            self._clamping = True
        elif size_n < CLAMP_END * self._force_n:
            self._clamping = False
