#!/usr/bin/env python3
"""Reproduces the orders of `study schedule` from docs/schedule.md alone.

An independent implementation for comparison: it follows the text of the
document rather than being fast. `study` itself does not use it.
"""

import argparse
import hashlib
import struct
from functools import lru_cache


def chacha20_block(key, counter):
    """RFC 8439, section 2.3, with a nonce of zeros."""

    def rotate(x, n):
        return ((x << n) | (x >> (32 - n))) & 0xFFFFFFFF

    def quarter(s, a, b, c, d):
        s[a] = (s[a] + s[b]) & 0xFFFFFFFF
        s[d] = rotate(s[d] ^ s[a], 16)
        s[c] = (s[c] + s[d]) & 0xFFFFFFFF
        s[b] = rotate(s[b] ^ s[c], 12)
        s[a] = (s[a] + s[b]) & 0xFFFFFFFF
        s[d] = rotate(s[d] ^ s[a], 8)
        s[c] = (s[c] + s[d]) & 0xFFFFFFFF
        s[b] = rotate(s[b] ^ s[c], 7)

    start = list(struct.unpack("<4I", b"expand 32-byte k"))
    start += struct.unpack("<8I", key)
    start += [counter, 0, 0, 0]
    state = list(start)
    for _ in range(10):
        quarter(state, 0, 4, 8, 12)
        quarter(state, 1, 5, 9, 13)
        quarter(state, 2, 6, 10, 14)
        quarter(state, 3, 7, 11, 15)
        quarter(state, 0, 5, 10, 15)
        quarter(state, 1, 6, 11, 12)
        quarter(state, 2, 7, 8, 13)
        quarter(state, 3, 4, 9, 14)
    return struct.pack("<16I", *((a + b) & 0xFFFFFFFF for a, b in zip(state, start)))


# RFC 8439, appendix A.1, test vector 1.
assert chacha20_block(bytes(32), 0)[:16].hex() == "76b8e0ada0f13d90405d6ae55386bd28"


class Stream:
    def __init__(self, seed, *path):
        text = b"study-rng/1\0" + struct.pack("<Q", seed)
        for name in path:
            name = name.encode()
            text += struct.pack("<I", len(name)) + name
        self.key = hashlib.sha256(text).digest()
        self.counter = 0
        self.bytes = b""

    def draw(self):
        if not self.bytes:
            self.bytes = chacha20_block(self.key, self.counter)
            self.counter += 1
        word, self.bytes = self.bytes[:8], self.bytes[8:]
        return int.from_bytes(word, "little")

    def below(self, m):
        bits = (m - 1).bit_length()
        if bits == 0:
            return 0
        while True:
            number = 0
            for word in range(-(-bits // 64)):
                number |= self.draw() << (64 * word)
            number &= (1 << bits) - 1
            if number < m:
                return number

    def shuffle(self, items):
        for i in range(len(items) - 1, 0, -1):
            j = self.below(i + 1)
            items[i], items[j] = items[j], items[i]


def rule(repetitions, max_run, min_distance):
    if repetitions == 1:
        return ("none", 0)
    if min_distance is not None and min_distance >= 2:
        return ("distance", min_distance)
    if max_run == 1:
        return ("distance", 2)
    if max_run is not None and max_run < repetitions:
        return ("run", max_run)
    return ("none", 0)


def blocked(stream, n, repetitions, distance):
    order = []
    for p in range(n * repetitions):
        block = order[p - p % n :]
        recent = order[max(0, p - distance + 1) :]
        may_come = [m for m in range(n) if m not in block and m not in recent]
        order.append(may_come[stream.below(len(may_come))])
    return order


def shuffled_within(stream, n, repetitions, kind, limit):
    """A state is one pair per realization: times to come, and how long it may
    not come (distance) or how often it has just come (run, else 0)."""

    def choices(state):
        for m, (left, mark) in enumerate(state):
            if left and (mark == 0 if kind == "distance" else mark < limit):
                yield m

    def after(state, chosen):
        new = []
        for m, (left, mark) in enumerate(state):
            if kind == "distance":
                new.append((left - 1, limit - 1) if m == chosen else (left, max(0, mark - 1)))
            else:
                new.append((left - 1, mark + 1) if m == chosen else (left, 0))
        return new

    @lru_cache(maxsize=None)
    def completions_of(sorted_state):
        if all(left == 0 for left, _ in sorted_state):
            return 1
        return sum(completions(after(sorted_state, m)) for m in choices(sorted_state))

    def completions(state):
        # A realization that does not come any more needs no mark.
        return completions_of(tuple(sorted((left, mark if left else 0) for left, mark in state)))

    state = [(repetitions, 0)] * n
    u = stream.below(completions(state))
    order = []
    while len(order) < n * repetitions:
        for m in choices(state):
            count = completions(after(state, m))
            if u < count:
                order.append(m)
                state = after(state, m)
                break
            u -= count
    return order


def williams_line(n, line):
    lines = n if n % 2 == 0 else 2 * n
    line %= lines
    symbols = [0]
    low, high = 1, n - 1
    while len(symbols) < n:
        symbols.append(low)
        low += 1
        if len(symbols) < n:
            symbols.append(high)
            high -= 1
    symbols = [(s + line) % n for s in symbols]
    return symbols if line < n else symbols[::-1]


def latin_line(n, line):
    return [(line + place) % n for place in range(n)]


def order_of(seed, n, repetitions, order, max_run, min_distance, kind, number):
    what, limit = rule(repetitions, max_run, min_distance)
    stream = Stream(seed, "schedule", kind, str(number))
    if order == "blocked":
        return blocked(stream, n, repetitions, limit if what == "distance" else 1)
    if order == "shuffled":
        if what != "none":
            return shuffled_within(stream, n, repetitions, what, limit)
        trials = [m for m in range(n) for _ in range(repetitions)]
        stream.shuffle(trials)
        return trials
    if order == "fixed":
        return list(range(n)) * repetitions
    line_of = {"williams": williams_line, "latin-square": latin_line}[order]
    symbols = list(range(n))
    Stream(seed, "schedule", "symbols").shuffle(symbols)
    first = repetitions * (number - 1)
    return [symbols[s] for r in range(repetitions) for s in line_of(n, first + r)]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--models", required=True, help="ids by comma, practice left out")
    parser.add_argument("--repetitions", type=int, required=True)
    parser.add_argument("--order", required=True)
    parser.add_argument("--max-run", type=int)
    parser.add_argument("--min-distance", type=int)
    parser.add_argument("--kind", default="row", choices=["row", "pilot", "simulated"])
    parser.add_argument("--numbers", default="1", help="7 or 1-40")
    a = parser.parse_args()
    models = a.models.split(",")
    first, _, last = a.numbers.partition("-")
    print("kind,number,position,model")
    for number in range(int(first), int(last or first) + 1):
        order = order_of(
            a.seed, len(models), a.repetitions, a.order, a.max_run, a.min_distance, a.kind, number
        )
        for position, m in enumerate(order, 1):
            print(f"{a.kind},{number},{position},{models[m]}")


if __name__ == "__main__":
    main()
