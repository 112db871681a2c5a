"""A pseudo-terminal on which a mock answers lines."""

from __future__ import annotations

import math
import os
import select
import sys
import time
import tty
from typing import Callable, Tuple


def hand(now: float) -> Tuple[float, float]:
    """Position, mm, and speed, mm/s, of a hand that no force can stop."""
    w = 2.0 * math.pi * 0.7
    return 12.5 * math.sin(w * now), 12.5 * w * math.cos(w * now)


def serve(answer: Callable[[bytes], bytes], idle: Callable[[], bytes], period_s: float) -> int:
    """Prints the path of the terminal and answers until standard input ends."""
    master, slave = os.openpty()
    tty.setraw(slave)
    print(os.ttyname(slave), flush=True)
    rest = b""
    due = time.monotonic()
    while True:
        wait = max(0.0, due - time.monotonic()) if period_s else 1.0
        ready, _, _ = select.select([master, sys.stdin], [], [], wait)
        if sys.stdin in ready and not sys.stdin.readline():
            return 0
        if master in ready:
            rest += os.read(master, 4096)
            *lines, rest = rest.split(b"\n")
            for line in lines:
                out = answer(line.strip())
                if out:
                    os.write(master, out)
        if period_s and time.monotonic() >= due:
            due = max(due + period_s, time.monotonic())
            out = idle()
            if out:
                os.write(master, out)
