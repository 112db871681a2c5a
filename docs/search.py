#!/usr/bin/env python3
"""Reproduces the pairs of a search from docs/search.md alone.

An independent implementation for comparison: it follows the text of the
document rather than being fast. `study` itself does not use it.

    python3 docs/search.py --seed 5 --stream search --steps 5,4 --without 19 --start 4 --trials 12

prints `trial,first,second` for somebody who prefers the lower point every time;
with `--answers FILE` (a number for each trial: the preferred point) it prints
the pairs up to the one that follows the last answer. `--left-out 7@3,4@5` leaves
out point 7 after three trials and point 4 after five.
"""

import argparse
import itertools
import math
import os
import sys

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from schedule import Stream  # noqa: E402

POLYNOMIALS = [
    (0, [1]),
    (1, [1, 3]),
    (1, [1, 3, 1]),
    (2, [1, 1, 1]),
    (1, [1, 1, 3, 3]),
    (4, [1, 3, 5, 13]),
    (2, [1, 1, 5, 5, 17]),
]


def directions(dimension):
    if dimension == 0:
        return [1 << (31 - k) for k in range(32)]
    a, m = POLYNOMIALS[dimension - 1]
    s = len(m)
    v = [m[k] << (31 - k) for k in range(s)]
    for k in range(s, 32):
        new = v[k - s] ^ (v[k - s] >> s)
        for j in range(1, s):
            if (a >> (s - 1 - j)) & 1:
                new ^= v[k - j]
        v.append(new)
    return v


class Lattice:
    def __init__(self, steps, without):
        self.steps = steps
        places = list(itertools.product(*(range(n) for n in steps)))
        self.places = places
        self.certified = [p for p in range(len(places)) if p not in without]

    def point_at(self, fractions):
        point = 0
        for fraction, n in zip(fractions, self.steps):
            point = point * n + (fraction * n >> 32)
        return point

    def coordinates(self, point):
        return [step / (n - 1) for step, n in zip(self.places[point], self.steps)]


def even_pairs(lattice, trials, stream):
    d = len(lattice.steps)
    shift = [stream.draw() >> 32 for _ in range(2 * d)]
    numbers = [directions(k) for k in range(2 * d)]
    at, index, pairs = [0] * (2 * d), 0, []
    while len(pairs) < trials:
        drawn = [x ^ s for x, s in zip(at, shift)]
        bit = 0
        while index >> bit & 1:
            bit += 1
        at = [x ^ v[bit] for x, v in zip(at, numbers)]
        index += 1
        one, two = lattice.point_at(drawn[:d]), lattice.point_at(drawn[d:])
        if one != two and one in lattice.certified and two in lattice.certified:
            pairs.append((min(one, two), max(one, two)))
    return pairs


def phi(z):
    return math.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)


def Phi(z):
    return 0.5 * math.erfc(-z / math.sqrt(2))


def cholesky(a):
    n = len(a)
    l = [[0.0] * n for _ in range(n)]
    for i in range(n):
        for j in range(i + 1):
            rest = a[i][j] - sum(l[i][k] * l[j][k] for k in range(j))
            l[i][j] = math.sqrt(rest) if i == j else rest / l[j][j]
    return l


def forward(l, b):
    x = []
    for i, row in enumerate(l):
        x.append((b[i] - sum(row[k] * x[k] for k in range(i))) / row[i])
    return x


def backward(l, b):
    n = len(b)
    x = [0.0] * n
    for i in reversed(range(n)):
        x[i] = (b[i] - sum(l[k][i] * x[k] for k in range(i + 1, n))) / l[i][i]
    return x


class Model:
    """The posterior of one kernel."""

    def __init__(self, coordinates, length, sd, answers):
        def k(a, b):
            r = math.sqrt(5 * sum(((x - y) / length) ** 2 for x, y in zip(coordinates[a], coordinates[b])))
            return sd * sd * (1 + r + r * r / 3) * math.exp(-r)

        self.k = k
        self.n = len(coordinates)
        self.answers = answers
        m = len(answers)
        c = [[k(a, e) - k(a, f) - k(b, e) + k(b, f) for e, f in answers] for a, b in answers]
        g = [0.0] * m
        for _ in range(60):
            z = [x / math.sqrt(2) for x in g]
            h = [phi(t) / Phi(t) for t in z]
            s = [x / math.sqrt(2) for x in h]
            w = [0.5 * x * (x + t) for x, t in zip(h, z)]
            root = [math.sqrt(x) for x in w]
            l = cholesky([[(i == j) + root[i] * c[i][j] * root[j] for j in range(m)] for i in range(m)])
            b = [x * y + t for x, y, t in zip(w, g, s)]
            cb = [sum(x * y for x, y in zip(row, b)) for row in c]
            solved = backward(l, forward(l, [r * x for r, x in zip(root, cb)]))
            target = [x - r * y for x, r, y in zip(b, root, solved)]
            g = [sum(x * y for x, y in zip(row, target)) for row in c]
        self.s, self.root, self.l = s, root, l
        log = sum(math.log(Phi(x / math.sqrt(2))) for x in g)
        quadratic = sum(x * y for x, y in zip(s, g))
        self.evidence = log - 0.5 * quadratic - sum(math.log(l[i][i]) for i in range(m))

    def next_pair(self, acquire, may):
        rows = [[self.k(a, j) - self.k(b, j) for j in range(self.n)] for a, b in self.answers]
        mean = [sum(s * row[j] for s, row in zip(self.s, rows)) for j in range(self.n)]
        whitened = [forward(self.l, [r * row[j] for r, row in zip(self.root, rows)]) for j in range(self.n)]

        def covariance(i, j):
            return self.k(i, j) - sum(x * y for x, y in zip(whitened[i], whitened[j]))

        if acquire == "challenger":
            most = max(m for i, m in enumerate(mean) if may[i])
            tied = most - 1e-9 * max(abs(most), 1.0)
            best = next(i for i, m in enumerate(mean) if may[i] and m >= tied)
            others = [j for j in range(self.n) if j != best and may[j]]
            promises = []
            for j in others:
                variance = covariance(best, best) + covariance(j, j) - 2 * covariance(best, j)
                promises.append(mean[j] - mean[best] + 2.0 * math.sqrt(max(0.0, variance)))
            most = max(promises)
            tied = most - 1e-9 * max(abs(most), 1.0)
            other = others[next(i for i, promise in enumerate(promises) if promise >= tied)]
            return min(best, other), max(best, other)

        pairs = [(a, b) for b in range(self.n) for a in range(b) if may[a] and may[b]]
        values = []
        for a, b in pairs:
            spread = math.sqrt(max(0.0, covariance(a, a) + covariance(b, b) - 2 * covariance(a, b)))
            value = max(mean[a], mean[b])
            if spread > 0:
                t = abs(mean[a] - mean[b]) / spread
                value += spread * (phi(t) - t * Phi(-t))
            values.append(value)
        most = max(values)
        tied = most - 1e-9 * max(abs(most), 1.0)
        return pairs[next(i for i, value in enumerate(values) if value >= tied)]


def kernels(dimensions):
    root = math.sqrt(dimensions / 2)
    for length in (0.2, 0.4, 0.8):
        for sd in (1.0, 2.0, 4.0):
            yield length * root, sd, -0.5 * ((length != 0.4) + (sd != 2.0))


def next_pair(lattice, answers, acquire, out):
    index = {point: i for i, point in enumerate(lattice.certified)}
    coordinates = [lattice.coordinates(point) for point in lattice.certified]
    inner = [(index[a], index[b]) for a, b in answers]
    best, best_value = None, -math.inf
    for length, sd, weight in kernels(len(lattice.steps)):
        model = Model(coordinates, length, sd, inner)
        if model.evidence + weight > best_value + 1e-9:
            best, best_value = model, model.evidence + weight
    a, b = best.next_pair(acquire, [point not in out for point in lattice.certified])
    return lattice.certified[a], lattice.certified[b]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--stream", required=True, help="names of the path, separated by commas")
    parser.add_argument("--steps", required=True, help="steps of each axis, separated by commas")
    parser.add_argument("--without", default="", help="points that are not certified")
    parser.add_argument("--start", type=int, required=True)
    parser.add_argument("--acquire", choices=["challenger", "eubo"], default="challenger")
    parser.add_argument("--trials", type=int, required=True)
    parser.add_argument("--left-out", default="", help="points that are left out, with the trials before that")
    parser.add_argument("--answers", help="a file with the preferred point of each trial, one a line")
    arguments = parser.parse_args()
    numbers = lambda text: [int(word) for word in text.split(",") if word]
    lattice = Lattice(numbers(arguments.steps), set(numbers(arguments.without)))
    stream = Stream(arguments.seed, *arguments.stream.split(","))
    planned = even_pairs(lattice, arguments.trials, stream)
    preferred = None
    if arguments.answers:
        with open(arguments.answers, encoding="utf-8") as file:
            preferred = [int(line) for line in file if line.strip()]
    left_out = [tuple(map(int, word.split("@"))) for word in arguments.left_out.split(",") if word]
    answers, turn = [], 0
    for trial in range(arguments.trials):
        out = {point for point, after in left_out if after <= trial}
        turns = [(turn + k) % len(planned) for k in range(len(planned))]
        free = [k for k in turns if not out & set(planned[k])]
        if free:
            turn, pair = free[0], planned[free[0]]
        else:
            pair = tuple([point for point in lattice.certified if point not in out][:2])
        turn += 1
        if trial >= arguments.start:
            pair = next_pair(lattice, answers, arguments.acquire, out)
        print(f"{trial + 1},{pair[0]},{pair[1]}")
        if preferred is None:
            answers.append(pair)
        elif trial < len(preferred):
            answers.append(pair if preferred[trial] == pair[0] else pair[::-1])
        else:
            break


main()
