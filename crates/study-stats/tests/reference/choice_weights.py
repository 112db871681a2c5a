"""Reference values of the weights of components in choices: numpy 2.4.6, scipy 1.17.1.

    python3 choice_weights.py

simulates choices (fixed seeds) and writes choice_weights.txt: for each case the errors of each stimulus, the choices
(`preferred>other@participant`), and

* `fit`: λ (`inf` for equal weights, −α of the sparse penalty) and the weights, by `scipy.optimize.minimize(method="L-BFGS-B")` with bounds,
  then `scipy.optimize.root` of the gradient over the weights that are not 0;
* `penalty`: that which is chosen by cross-validation;
* `left_out` and `other_stimuli`: choices, score, score of equal weights, share predicted, that of equal weights, gain
  and its interval, by nested cross-validation;
* `own`: of each component, the part of its squared differences that the others do not have, by `numpy.linalg.lstsq`.
"""

import numpy as np
from scipy.optimize import minimize, root
from scipy.stats import norm, t

SIZE = 1e-3
LAMBDAS = [1e3, 1e2, 1e1, 1.0, 1e-1, 1e-2, -8.0, -4.0, -2.0]


def hazard(z):
    return np.exp(norm.logpdf(z) - norm.logcdf(z))


def fit(x, lam):
    """Weights of scaled differences x, one row for each choice."""
    k = x.shape[1]
    if lam < 0:
        first = fit(x, 1e-2)
        kept = first > 0
        whole = np.zeros(k)
        if kept.any():
            whole[kept] = solve(x[:, kept], SIZE * np.eye(kept.sum()), -lam / first[kept])
        return whole
    if np.isinf(lam):
        whole = solve(x.sum(1, keepdims=True), np.array([[SIZE * k]]), np.zeros(1))
        return np.full(k, whole[0])
    return solve(x, lam * (np.eye(k) - 1.0 / k) + SIZE * np.eye(k), np.zeros(k))


def solve(x, penalty, linear):
    """The maximum with the penalty ½ w P w + linear w over w of at least 0."""
    z = lambda w: x @ w / np.sqrt(2.0)
    value = lambda w: -norm.logcdf(z(w)).sum() + 0.5 * w @ penalty @ w + linear @ w
    slope = lambda w: -(x * (hazard(z(w)) / np.sqrt(2.0))[:, None]).sum(0) + penalty @ w + linear
    w = minimize(value, np.full(x.shape[1], 0.1), jac=slope, method="L-BFGS-B",
                 bounds=[(0.0, None)] * x.shape[1],
                 options=dict(ftol=1e-15, gtol=1e-10, maxiter=5000)).x
    free = w > 1e-6
    whole = np.zeros_like(w)

    def of_free(v):
        whole[:] = 0.0
        whole[free] = v
        return slope(whole)[free]

    if free.any():
        found = root(of_free, w[free], tol=1e-13)
        whole[:] = 0.0
        whole[free] = found.x
    assert (slope(whole)[~free] >= -1e-6).all() and (whole >= 0).all()
    return whole


def score(x, w):
    return norm.logcdf(x @ w / np.sqrt(2.0))


def penalty(x, units, among):
    folds = min(len(among), 5)
    if folds < 2:
        return np.inf
    place = {unit: i % folds for i, unit in enumerate(among)}
    fold = np.array([place.get(u, -1) for u in units])
    best = None
    for lam in [np.inf] + LAMBDAS:
        total = 0.0
        for f in range(folds):
            train, test = (fold >= 0) & (fold != f), fold == f
            total += score(x[test], fit(x[train], lam)).sum()
        if best is None or total > best[1] + 1e-9 * abs(best[1]):
            best = (lam, total)
    return best[0]


def summary(units, rows):
    """rows: unit, log score, that of equal weights, right, right of equal weights."""
    rows = np.array(rows)
    mine = rows[:, 0]
    gains = np.array([(rows[mine == u, 1] - rows[mine == u, 2]).mean() for u in np.unique(mine)])
    n = len(gains)
    half = t.ppf(0.975, n - 1) * gains.std(ddof=1) / np.sqrt(n)
    means = rows.mean(0)
    return [len(rows), means[1], means[2], means[3], means[4],
            gains.mean(), gains.mean() - half, gains.mean() + half]


def predicted(x, units, train, test, among):
    lam = penalty(x[train], units[train], among)
    own, equal = fit(x[train], lam), fit(x[train], np.inf)
    right = lambda w, r: 1.0 if r @ w > 0 else 0.5 if r @ w == 0 else 0.0
    return [(u, score(r, own), score(r, equal), right(own, r), right(equal, r))
            for u, r in zip(units[test], x[test])]


def left_out(x, units):
    names = list(range(units.max() + 1))
    folds = min(len(names), 10)
    rows = []
    for f in range(folds):
        test = units % folds == f
        among = [u for u in names if u % folds != f]
        rows += predicted(x, units, ~test, test, among)
    return summary(units, rows)


def other_stimuli(x, units, pairs, over_participants):
    names = sorted(set(pairs.ravel()))
    folds = min(len(names), 5)
    place = {name: i % folds for i, name in enumerate(names)}
    rows = []
    for f in range(folds):
        test = np.array([place[a] == f or place[b] == f for a, b in pairs])
        if test.all():
            continue
        among = list(range(units.max() + 1)) if over_participants else list(units[~test])
        rows += predicted(x, units, ~test, test, among)
    return summary(units, rows)


def case(out, name, seed, people, each, stimuli, weights):
    random = np.random.default_rng(seed)
    k = len(weights)
    errors = np.round(random.normal(size=(stimuli, k)) ** 2, 4)
    choices = []
    for person in range(people):
        own = random.lognormal(0.0, 0.3) if people > 1 else 1.0
        for _ in range(each):
            a, b = random.choice(stimuli, 2, replace=False)
            felt = -own * errors[[a, b]] @ weights + random.normal(size=2)
            choices.append((a, b, person) if felt[0] > felt[1] else (b, a, person))
    choices = np.array(choices)
    d = errors[choices[:, 1]] - errors[choices[:, 0]]
    scale = np.sqrt((d**2).sum(1).mean())
    x = d / scale
    over_participants = people >= 5
    units = choices[:, 2] if over_participants else np.arange(len(choices))
    text = lambda numbers: " ".join(repr(float(n)) for n in numbers)
    out.append(f"case {name}")
    out += [f"error {text(row)}" for row in errors]
    out.append("choices " + " ".join(f"{a}>{b}@{p}" for a, b, p in choices))
    for lam in [np.inf] + LAMBDAS:
        out.append(f"fit {lam} {text(fit(x, lam) / scale)}")
    out.append(f"penalty {penalty(x, units, list(range(units.max() + 1)))}")
    out.append("left_out " + text(left_out(x, units)))
    out.append("other_stimuli " + text(other_stimuli(x, units, choices[:, :2], over_participants)))
    own = []
    for i in range(k):
        others = np.delete(d, i, 1)
        rest = d[:, i] - others @ np.linalg.lstsq(others, d[:, i], rcond=None)[0]
        own.append((rest**2).sum() / (d[:, i] ** 2).sum())
    out.append(f"own {text(own)}")


out = []
case(out, "people", 1, 7, 24, 9, [1.0, 0.0, 0.3])
case(out, "equal", 2, 6, 20, 8, [0.5, 0.5, 0.5, 0.5])
case(out, "one", 3, 1, 50, 8, [0.0, 0.8])
with open("choice_weights.txt", "w") as file:
    file.write("\n".join(out) + "\n")
