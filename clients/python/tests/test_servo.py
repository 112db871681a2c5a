"""The servo against values that can be written down: python3 -m unittest discover clients/python/tests"""

import math
import os
import random
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "src"))

from study_device import Constants, Device, Servo, Table, Trip  # noqa: E402


def table(**changed):
    """F = 0.1 kg·a + 0.01 N·s/mm·v + 0.2 N/mm·x ± 0.5 N between −20 and 20 mm."""
    branch = lambda f0: {
        "m_kg": [0.1] * 3,
        "b_n_s_per_mm": [0.01] * 3,
        "k_n_per_mm": [0.2] * 3,
        "f0_n": [f0] * 3,
    }
    return Table(
        {
            "lookup": "linear",
            "direction": {"rule": "sign", "delta_mm": None},
            "trained": {"x_mm": [-20.0, 20.0], "v_mm_s": 100.0},
            "x_mm": [-20.0, 0.0, 20.0],
            "positive": branch(0.5),
            "negative": branch(-0.5),
            **changed,
        }
    )


def play(what, motion, seconds=2.0, turns=None, limit=9.0, **constants):
    """Rows (t, x, v, force) of a motion x(t)."""
    servo = Servo(what, Constants(**constants), limit, 1000.0)
    t, rows = 0.0, []
    while t < seconds:
        x = motion(t)
        rows.append((t, x, servo.v_mm_s, servo.step(t + 7.0, x, None)))
        t += turns() if turns else 1e-3
    return servo, rows


class ServoTest(unittest.TestCase):
    def test_a_constant_speed_has_the_force_of_the_line(self):
        _, rows = play(table(), lambda t: -15.0 + 14.0 * t)
        t, x, _, force = rows[-1]
        expected = 0.01 * 14.0 + 0.2 * x + 0.5 + 0.002 * 14.0
        self.assertAlmostEqual(force, expected, 6)

    def test_a_mass_feels_the_acceleration(self):
        # x = 2 mm·t²: 0.004 m/s².
        servo, rows = play(table(), lambda t: -10.0 + 2.0 * t * t)
        t, x, _, force = rows[-1]
        v = 4.0 * t
        expected = 0.1 * 0.004 + 0.012 * v + 0.2 * x + 0.5
        self.assertAlmostEqual(force, expected, 3)

    def test_turns_of_any_length_give_the_same_force(self):
        motion = lambda t: 12.0 * math.sin(2 * math.pi * 0.8 * t)
        _, even = play(table(), motion)
        chance = random.Random(1)
        _, uneven = play(table(), motion, turns=lambda: chance.uniform(2e-4, 2.5e-3))
        at = lambda rows, t: min(rows, key=lambda row: abs(row[0] - t))[3]
        for t in [0.1, 0.5, 0.77, 1.3, 1.9]:
            self.assertAlmostEqual(at(even, t), at(uneven, t), delta=0.05)

    def test_the_force_rises_by_half_a_cosine(self):
        _, rows = play(table(), lambda t: 0.0 + 1e-9 * t)
        for t, share in [(0.0, 0.0), (0.1, 0.5 - 0.5 * math.cos(math.pi / 4)), (0.5, 1.0)]:
            force = min(rows, key=lambda row: abs(row[0] - t))[3]
            self.assertAlmostEqual(force, 0.5 * share, delta=5e-3)

    def test_limit_slew_and_wall(self):
        _, rows = play(table(), lambda t: 18.0 + 2.0 * t, limit=2.0)
        self.assertLessEqual(max(abs(row[3]) for row in rows), 2.0)
        servo, rows = play(table(), lambda t: 18.0 + 1.1 * t)
        t, x, v, force = rows[-1]
        wall = 10.0 * (x - 20.0) + 0.01 * 1.1
        self.assertAlmostEqual(force, 0.012 * 1.1 + 0.2 * 20.0 + 0.5 + wall, 3)
        _, rows = play(table(), lambda t: 5.0 if t < 1.0 else 5.9)
        steps = [abs(b[3] - a[3]) for a, b in zip(rows, rows[1:])]
        self.assertLessEqual(max(steps), 2.0 + 1e-9)

    def test_look_ups(self):
        branch = {
            "m_kg": [0.0] * 3,
            "b_n_s_per_mm": [0.0] * 3,
            "k_n_per_mm": [0.0] * 3,
            "f0_n": [1.0, 2.0, 4.0],
        }
        for lookup, expected in [("linear", 3.2), ("floor", 2.0), ("nearest", 4.0)]:
            what = table(lookup=lookup, positive=branch, negative=branch)
            self.assertAlmostEqual(what.parameters(12.0, 1.0)[3], expected)
            self.assertEqual(what.parameters(-30.0, 1.0)[3], 1.0)
            self.assertEqual(what.parameters(30.0, 1.0)[3], 4.0)

    def test_direction_rules(self):
        play_rule = table(direction={"rule": "play", "delta_mm": 2.0})
        dahl = table(direction={"rule": "dahl", "delta_mm": 2.0})
        back = lambda t: 0.0 if t < 1.0 else -min(1.0, 20.0 * (t - 1.0))
        servo, _ = play(play_rule, back)
        self.assertAlmostEqual(servo._z, 0.0, 6)
        servo, _ = play(dahl, back)
        self.assertAlmostEqual(servo._z, -1.0 + 2.0 * math.exp(-0.5), 6)

    def test_trips(self):
        for motion, words in [
            (lambda t: 19.0 + 20.0 * t, "beyond the range"),
            (lambda t: 0.0 if t < 1 else 1.2, "jumped"),
            (lambda t: float("nan") if t > 1 else 0.0, "no number"),
        ]:
            with self.assertRaisesRegex(Trip, words):
                play(table(), motion)
        servo = Servo(table(), Constants(), 9.0, 10.0)
        servo.step(0.0, 0.0, 0.0)
        with self.assertRaisesRegex(Trip, "velocity"):
            servo.step(0.001, 0.02, 20.0)

    def test_strokes_and_energy(self):
        servo, _ = play(table(), lambda t: 18.0 * math.sin(2 * math.pi * t), seconds=3.1)
        self.assertEqual(servo.strokes, 5)
        self.assertLessEqual(servo.least_energy_j, 0.0)

    def test_invalid_tables_say_why(self):
        for changed, words in [
            ({"x_mm": [0.0, 0.0, 1.0]}, "ascend"),
            ({"lookup": "cubic"}, "look-up"),
            ({"direction": {"rule": "play", "delta_mm": None}}, "delta_mm"),
            ({"x_mm": [0.0, 1.0]}, "other nodes"),
            ({"positive": {}}, "not complete"),
        ]:
            with self.assertRaisesRegex(ValueError, words):
                table(**changed)

    def test_hello_has_every_constant(self):
        device = Device("a", 5.0, 300.0, (-10.0, 10.0), watchdog_ms=100.0)
        hello = device.hello()
        self.assertEqual(hello["servo"]["loop_hz"], 1000.0)
        self.assertEqual(len(hello["servo"]), 10)


if __name__ == "__main__":
    unittest.main()
