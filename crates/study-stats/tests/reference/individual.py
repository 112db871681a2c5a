"""Reference values of weights of dimensions, by a program of its own (numpy, SciPy): python3 individual.py

Five participants rate the differences of seven stimuli of a plane, whose two dimensions they weigh differently. The loss of INDSCAL
(Carroll & Chang 1970, Psychometrika 35) is minimized here over coordinates and weights at once by SciPy's trust region
(least_squares with bounds), from many starts, without the alternating least squares of the analysis.
"""

import numpy as np
from scipy.optimize import least_squares

OBJECTS, DIMENSIONS = 7, 2
A, B = np.triu_indices(OBJECTS, 1)


def simulated():
    random = np.random.default_rng(70)
    places = np.array([[0, 0], [3, 1], [1, 4], [4, 4.5], [2, 2.2], [5, 0.5], [0.4, 2.6]])
    weights = np.array([[1, 0.15], [0.8, 0.5], [0.5, 0.9], [0.2, 1], [1, 1]])
    own = np.sqrt((((places[A] - places[B]) ** 2) @ weights.T).T)
    own = 15 * own + 3 * random.normal(size=own.shape)
    return np.clip(np.round(own), 0, 100)


def products(ratings):
    """The scalar products of a participant, with a sum of squares of 1."""
    d = np.zeros((OBJECTS, OBJECTS))
    d[A, B] = d[B, A] = ratings
    j = np.eye(OBJECTS) - 1 / OBJECTS
    b = -0.5 * j @ d**2 @ j
    return b / np.linalg.norm(b)


RATINGS = simulated()
ALL = np.array([products(row) for row in RATINGS])
PEOPLE = len(ALL)


def parts(at):
    x = at[: OBJECTS * DIMENSIONS].reshape(OBJECTS, DIMENSIONS)
    return x, at[OBJECTS * DIMENSIONS:].reshape(PEOPLE, DIMENSIONS)


def residuals(at):
    x, w = parts(at)
    return (ALL - np.einsum("ir,kr,jr->kij", x, w, x)).ravel()


random = np.random.default_rng(1)
low = np.concatenate([np.full(OBJECTS * DIMENSIONS, -np.inf), np.zeros(PEOPLE * DIMENSIONS)])
best = None
for _ in range(4):
    start = np.concatenate([random.normal(size=OBJECTS * DIMENSIONS), np.ones(PEOPLE * DIMENSIONS)])
    found = least_squares(residuals, start, bounds=(low, np.inf), xtol=1e-15, ftol=1e-15, gtol=1e-13, max_nfev=400)
    if best is None or found.cost < best.cost - 1e-12:
        best = found
x, w = parts(best.x)
w = w * (x**2).sum(axis=0)
x = x / np.sqrt((x**2).sum(axis=0))
order = np.argsort(-(w**2).sum(axis=0))
x, w = x[:, order], w[:, order]
for r in range(DIMENSIONS):
    x[:, r] *= np.sign(x[np.abs(x[:, r]).argmax(), r])
fits = 1 - ((ALL - np.einsum("ir,kr,jr->kij", x, w, x)) ** 2).sum(axis=(1, 2))


def common():
    """Everybody has the same weights, but for a factor: alternately the factors and the map."""
    s = np.ones(PEOPLE)
    for _ in range(500):
        values, vectors = np.linalg.eigh(np.einsum("k,kij->ij", s, ALL))
        c = (vectors[:, -DIMENSIONS:] * np.maximum(values[-DIMENSIONS:], 0)) @ vectors[:, -DIMENSIONS:].T
        s = np.maximum(np.einsum("kij,ij->k", ALL, c) / (c**2).sum(), 0)
    return 1 - ((ALL - s[:, None, None] * c) ** 2).sum() / PEOPLE


np.set_printoptions(precision=9, suppress=True)
print("ratings", RATINGS.astype(int).tolist())
print("coordinates", x)
print("weights", w)
print("fits", fits, "mean", fits.mean())
print("common", common())
