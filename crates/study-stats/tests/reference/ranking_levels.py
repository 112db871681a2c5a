"""Reference values of rankings in levels, by a program of its own (numpy, SciPy): python3 ranking_levels.py

Three participants rank six items three times each, with ties. Item 3 is above all others every time, and 2 and 5 are below
all others. The likelihood of all items has no maximum: here it is that of all six items, written out over all sets, with the
worths of a level e^60 times those of the next one, which is its limit to the last digit.
"""

import itertools

import numpy as np
from scipy import optimize, stats

RANKINGS = np.array([
    [2, 3, 5, 1, 4, 6], [3, 2, 6, 1, 4, 5], [2, 2, 5, 1, 4, 6],
    [4, 2, 5, 1, 3, 5], [2, 4, 5, 1, 3, 6], [2, 3, 5, 1, 3, 6],
    [2, 3, 5, 1, 4, 6], [3, 4, 5, 1, 2, 5], [2, 3, 6, 1, 4, 5],
])
PEOPLE = np.repeat([0, 1, 2], 3)
LEVELS = [[3], [0, 1, 4], [2, 5]]
# Parameters: 0, 1, 2 and ln delta; the logarithms of the worths of a level sum to 0.
MAP = np.zeros((6, 4))
MAP[0, 0] = MAP[1, 1] = MAP[2, 2] = 1
MAP[4, :2] = -1
MAP[5, 2] = -1
APART = np.array([-60, -60, -120, 0, -60, -120])


def choices(ranks):
    left = list(range(6))
    while len(left) > 1:
        taken = [i for i in left if ranks[i] == min(ranks[j] for j in left)]
        yield taken, left
        left = [i for i in left if i not in taken]


def log_likelihood(at, who=None):
    worths = MAP @ at + APART
    total = 0.0
    for person, ranks in zip(PEOPLE, RANKINGS):
        if who is not None and person != who:
            continue
        for taken, left in choices(ranks):
            sets = [s for k in (1, 2) for s in itertools.combinations(left, k)]
            eta = np.array([worths[list(s)].mean() + (at[3] if len(s) == 2 else 0) for s in sets])
            total += eta[sets.index(tuple(taken))] - np.logaddexp.reduce(eta)
    return total


def gradient(f, at, h=1e-4):
    """Central differences of the fourth order."""
    unit = np.eye(4)
    return np.array([
        (8 * (f(at + h * u) - f(at - h * u)) - f(at + 2 * h * u) + f(at - 2 * h * u)) / (12 * h) for u in unit
    ])


at = optimize.minimize(lambda x: -log_likelihood(x), np.zeros(4), method="BFGS", options={"gtol": 1e-9}).x
for _ in range(3):
    hessian = np.array([gradient(lambda x, i=i: gradient(log_likelihood, x)[i], at, 1e-3) for i in range(4)])
    at = at - np.linalg.solve(hessian, gradient(log_likelihood, at))
v = np.linalg.inv(-hessian)
print("worths", MAP @ at)
print("standard errors", np.sqrt(np.diag(MAP @ v @ MAP.T)))
print("tie", at[3], np.sqrt(v[3, 3]), "log-likelihood", log_likelihood(at))
scores = np.array([v @ gradient(lambda x, who=who: log_likelihood(x, who), at) for who in range(3)])
contrast = MAP[0] - MAP[4]
print("0 less 4", contrast @ at, np.sqrt(contrast @ v @ contrast), np.sqrt(contrast @ (scores.T @ scores) @ contrast))
for n in (1, 3, 5, 6, 10, 20):
    test = stats.binomtest(n, n)
    low = test.proportion_ci(0.95, "exact").low
    print("above in all of", n, "by at least", np.log(low / (1 - low)), "p", test.pvalue)
