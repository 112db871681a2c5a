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


def order_of(seed, n, repetitions, order, max_run, min_distance, kind, number, part=None):
    what, limit = rule(repetitions, max_run, min_distance)
    path = ("schedule",) if part is None else ("schedule", "part", part)
    stream = Stream(seed, *path, kind, str(number))
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
    Stream(seed, *path, "symbols").shuffle(symbols)
    first = repetitions * (number - 1)
    return [symbols[s] for r in range(repetitions) for s in line_of(n, first + r)]


# The sequences of intervals with a signal, the catch trials, and the answers with
# the sequences for which each is right.
METHODS = {
    "2ifc": (["CS", "SC"], [], [["CS"], ["SC"]]),
    "3ifc": (["CSS", "SCS", "SSC"], [], [["CSS"], ["SCS"], ["SSC"]]),
    "same-different": (["SC", "CS"], ["SS", "CC"], [["SS", "CC"], ["SC", "CS"]]),
    "abx": (["SCS", "SCC", "CSC", "CSS"], [], [["SCS", "CSC"], ["SCC", "CSS"]]),
    "odd-one-out": (
        ["SSC", "SCS", "CSS", "CCS", "CSC", "SCC"],
        [],
        [["CSS", "SCC"], ["SCS", "CSC"], ["SSC", "CCS"]],
    ),
    "yes-no": (["C"], ["S"], [["C"], ["S"]]),
}


def some_places(stream, n, k):
    """One in each of k stretches of n places."""
    starts = [i * n // k for i in range(k + 1)] if k else []
    return {a + stream.below(b - a) for a, b in zip(starts, starts[1:])}


class Track:
    def __init__(self, text):
        self.id, self.method, m, catch, easy = text.split(":")
        self.m, catch, easy = int(m), float(catch), float(easy)
        s = self.m / (1 - catch - easy)
        self.c, self.e = int(s * catch + 0.5), int(s * easy + 0.5)

    def trials(self, stream, version):
        return self.version_1(stream) if version == 1 else self.version_2(stream)

    def version_1(self, stream):
        signal, without, _ = METHODS[self.method]

        def blocks(of, n):
            taken = []
            while len(taken) < n and of:
                block = of + of
                stream.shuffle(block)
                taken += block
            return iter(taken[:n])

        ruled, catch, easy = blocks(signal, self.m), blocks(without, self.c), blocks(signal, self.e)
        are_easy = some_places(stream, self.m + self.e, self.e)
        are_catch = some_places(stream, self.m + self.e + self.c, self.c)
        trials, of_signal = [], 0
        for place in range(self.m + self.e + self.c):
            if place in are_catch:
                trials.append((next(catch), False))
            else:
                is_easy = of_signal in are_easy
                trials.append((next(easy if is_easy else ruled), is_easy))
                of_signal += 1
        return trials

    def version_2(self, stream):
        _, without, answers = METHODS[self.method]
        are_easy = some_places(stream, self.m + self.e, self.e)
        weights = [1] * len(answers)
        if without:
            weights = [self.c if a[0] in without else self.m + self.e for a in answers]
        total = sum(weights)
        lists = [[] for _ in answers]
        trials, of_signal = [], 0
        while True:
            right = []
            for _ in range(24):
                u, a = stream.below(total), 0
                while u >= weights[a]:
                    u, a = u - weights[a], a + 1
                right.append(a)
            if any(
                abs(right.count(a) * total - 24 * weights[a]) > 4 * total
                for a in range(len(answers))
            ):
                continue
            for a in right:
                if not lists[a]:
                    lists[a] = answers[a] * 2
                    stream.shuffle(lists[a])
                sequence = lists[a].pop(0)
                is_catch = sequence in without
                trials.append((sequence, not is_catch and of_signal in are_easy))
                of_signal += not is_catch
                if of_signal == self.m + self.e:
                    return trials


def tracks_of(seed, part, tracks, version, kind, number):
    seat = ("schedule", "part", part, kind, str(number))
    left = [track.trials(Stream(seed, *seat, track.id), version) for track in tracks]
    passes = Stream(seed, *seat, ".passes")
    while any(left):
        order = list(range(len(tracks)))
        passes.shuffle(order)
        for at in order:
            if left[at]:
                sequence, is_easy = left[at].pop(0)
                yield f"{tracks[at].id},{sequence},{'true' if is_easy else 'false'}"


def pairs_of(seed, part, pairs, order, repetitions, interval_order, version, kind, number):
    seat = ("schedule", "part", part, kind, str(number))
    drawn = Stream(seed, *seat, "intervals")
    if version == 1:
        stream = Stream(seed, "schedule", "part", part, "intervals")
        once = [stream.below(2) for _ in pairs]
        first = [once] * repetitions
    else:
        two = ("schedule", "part", part, kind, "two", str((number + 1) // 2), "intervals")
        stream, first = Stream(seed, *two), []
        for _ in range((repetitions + 1) // 2):
            first += [[stream.below(2) for _ in pairs]] * 2
    times = [0] * len(pairs)
    for at in order:
        times[at] += 1
        draw, r = drawn.below(2), times[at]
        if interval_order == "balanced":
            draw = (first[r - 1][at] + number + r) % 2
        a, b = pairs[at]
        yield f"{b},{a}" if draw else f"{a},{b}"


def similarity_of(seed, part, different, identical, practice, kind, number, pairs):
    stream = Stream(seed, "schedule", "part", part, "practice", kind, str(number))
    drawn = []
    while len(drawn) < practice:
        once = list(different)
        stream.shuffle(once)
        for a, b in once:
            drawn.append(f"{b},{a}" if stream.below(2) else f"{a},{b}")
    yield from drawn[:practice]
    yield from pairs(different + [[m, m] for m in identical])


def rankings_of(seed, part, models, practice, order, kind, number):
    stream = Stream(seed, "schedule", "part", part, "practice", kind, str(number))
    for _ in range(practice):
        once = list(models)
        stream.shuffle(once)
        yield " ".join(once)
    for at in range(0, len(order), len(models)):
        yield " ".join(models[m] for m in order[at : at + len(models)])


def practice_of(seed, part, models, rounds, draw, kind, number):
    stream = Stream(seed, "schedule", "part", part, "practice", kind, str(number))
    for _ in range(rounds):
        once = list(models)
        if draw == "rounds":
            stream.shuffle(once)
        else:
            once = [models[stream.below(len(models))] for _ in models]
        yield from once


def adjustment_of(seed, part, below, above, repetitions, practice, kind, number):
    def drawn(stream, levels, n):
        taken = []
        while len(taken) < n:
            once = list(levels)
            stream.shuffle(once)
            taken += once
        return taken[:n]

    stream = Stream(seed, "schedule", "part", part, "practice", kind, str(number))
    low, high = drawn(stream, below, practice), drawn(stream, above, practice)
    first = stream.below(2)
    yield from ((low, high)[(at + first) % 2][at] for at in range(practice))
    stream = Stream(seed, "schedule", "part", part, "starts", kind, str(number))
    low, high = drawn(stream, below, repetitions), drawn(stream, above, repetitions)
    for two in zip(low, high):
        yield from two[::-1] if stream.below(2) else two


def constant_levels(seed, track, levels, repetitions, kind, number):
    stream = Stream(seed, "track", track, kind, str(number))
    for _ in range(repetitions):
        once = list(levels)
        stream.shuffle(once)
        yield from once


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seed", type=int, required=True)
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--models", help="ids by comma, practice left out")
    what.add_argument("--pairs", help="such as a/b,a/c, of a part")
    what.add_argument("--track", action="append", help="ID:METHOD:TRIALS:CATCH:EASY, of a part")
    what.add_argument("--constant", help="ID:LEVELS:REPETITIONS, levels by comma")
    what.add_argument("--practice", help="ids by comma, of a part with a criterion")
    what.add_argument("--similarity", help="such as a/b,a/c, pairs of different ones of a part")
    what.add_argument("--ranking", help="ids by comma, of a part")
    what.add_argument("--adjustment", help="BELOW:ABOVE, the starts of each side by comma")
    parser.add_argument("--part", help="its id")
    parser.add_argument("--repetitions", type=int)
    parser.add_argument("--order", help="blocked, shuffled, williams, latin-square or fixed")
    parser.add_argument("--max-run", type=int)
    parser.add_argument("--min-distance", type=int)
    parser.add_argument("--interval-order", default="balanced", choices=["balanced", "random"])
    parser.add_argument("--order-version", type=int, default=1, choices=[1, 2])
    parser.add_argument("--identical", default="", help="ids by comma, compared with themselves")
    parser.add_argument("--practice-pairs", "--practice-trials", type=int, default=0)
    parser.add_argument("--practice-rankings", type=int, default=0)
    parser.add_argument("--rounds", type=int)
    parser.add_argument("--draw", default="rounds", choices=["rounds", "independent"])
    parser.add_argument("--kind", default="row", choices=["row", "pilot", "simulated"])
    parser.add_argument("--numbers", default="1", help="7 or 1-40")
    a = parser.parse_args()

    def order(n, kind, number):
        return order_of(
            a.seed, n, a.repetitions, a.order, a.max_run, a.min_distance, kind, number, a.part
        )

    if a.models:
        head, models = "model", a.models.split(",")

        def lines(number):
            return (models[m] for m in order(len(models), a.kind, number))
    elif a.pairs:
        head, pairs = "first,second", [pair.split("/") for pair in a.pairs.split(",")]

        def lines(number):
            own = order(len(pairs), a.kind, number)
            how = (a.repetitions, a.interval_order, a.order_version)
            return pairs_of(a.seed, a.part, pairs, own, *how, a.kind, number)
    elif a.similarity:
        head, different = "first,second", [pair.split("/") for pair in a.similarity.split(",")]
        identical = [m for m in a.identical.split(",") if m]

        def lines(number):
            def of(pairs):
                own = order(len(pairs), a.kind, number)
                return pairs_of(
                    a.seed, a.part, pairs, own, a.repetitions, "balanced", 2, a.kind, number
                )

            how = (identical, a.practice_pairs, a.kind, number, of)
            return similarity_of(a.seed, a.part, different, *how)
    elif a.ranking:
        head, ranked = "set", a.ranking.split(",")

        def lines(number):
            own = order(len(ranked), a.kind, number)
            how = (ranked, a.practice_rankings, own, a.kind, number)
            return rankings_of(a.seed, a.part, *how)
    elif a.adjustment:
        head, sides = "start", [side.split(",") for side in a.adjustment.split(":")]

        def lines(number):
            how = (a.repetitions, a.practice_pairs, a.kind, number)
            return adjustment_of(a.seed, a.part, *sides, *how)
    elif a.track:
        head, tracks = "track,intervals,easy", [Track(text) for text in a.track]

        def lines(number):
            return tracks_of(a.seed, a.part, tracks, a.order_version, a.kind, number)
    elif a.practice:
        head, practice = "model", a.practice.split(",")

        def lines(number):
            return practice_of(a.seed, a.part, practice, a.rounds, a.draw, a.kind, number)
    else:
        track, levels, repetitions = a.constant.split(":")
        head = "level"

        def lines(number):
            of = (track, levels.split(","), int(repetitions))
            return constant_levels(a.seed, *of, a.kind, number)

    first, _, last = a.numbers.partition("-")
    print(f"kind,number,position,{head}")
    for number in range(int(first), int(last or first) + 1):
        for position, line in enumerate(lines(number), 1):
            print(f"{a.kind},{number},{position},{line}")


if __name__ == "__main__":
    main()
