"""Reference values of ratio scaling in crates/study-stats/src/similarity/tests.rs: python3 similarity.py
(Python 3.11, scikit-learn 1.9.1, SciPy 1.17.1). The data are in similarity.R.

python3 similarity.py golden > tests/golden/psychophysics/similarity_sim.json writes the reference file of the
analysis: simulated ratings, and what NumPy and SciPy compute of them. python3 similarity.py coverage simulates the
intervals of the correlation with properties, and people who rate different pairs."""

import itertools
import json
import pathlib
import re
import sys

import numpy as np
from scipy.optimize import minimize

text = (pathlib.Path(__file__).parent / "similarity.R").read_text()
numbers = text[text.index("similarity <- c(") : text.index("half <-")]
lower = [float(x) for x in re.findall(r"\d?\.\d+", numbers)]
n = 14
a, b = [i.astype(int) for i in np.triu_indices(n, 1)]
delta = 1 - np.array(lower)
full = np.zeros((n, n))
full[a, b] = full[b, a] = delta


def stress1(x, weight, a=a, b=b, delta=delta):
    """Kruskal's stress 1 with the best factor of the dissimilarities."""
    d = np.sqrt(((x[a] - x[b]) ** 2).sum(axis=1))
    factor = (weight * delta * d).sum() / (weight * delta**2).sum()
    return np.sqrt((weight * (d - factor * delta) ** 2).sum() / (weight * d**2).sum())


def sklearn(k, full=full):
    from sklearn.manifold import MDS

    fit = MDS(k, n_init=100, max_iter=20_000, eps=1e-14, random_state=1, metric="precomputed",
              metric_mds=True, init="random", normalized_stress=False)
    return fit.fit_transform(full)


def minimized(k, weight, starts=100, a=a, b=b, delta=delta, n=n):
    """Weighted raw stress by BFGS, with missing pairs of weight 0."""
    random = np.random.default_rng(1)

    def loss(flat):
        x = flat.reshape(n, k)
        difference = x[a] - x[b]
        d = np.sqrt((difference**2).sum(axis=1)) + 1e-300
        residual = weight * (d - delta)
        gradient = np.zeros_like(x)
        pull = 2 * (residual / d)[:, None] * difference
        np.add.at(gradient, a, pull)
        np.add.at(gradient, b, -pull)
        return (weight * (d - delta) ** 2).sum(), gradient.ravel()

    best = None
    for _ in range(starts):
        found = minimize(loss, random.normal(size=n * k), jac=True, method="L-BFGS-B",
                         options={"maxiter": 20_000, "ftol": 1e-15, "gtol": 1e-12})
        if best is None or found.fun < best.fun:
            best = found
    return best.x.reshape(n, k)


def in_common(unit):
    """Means of the pairs after each person's were divided by a factor, so that it does not matter who rated what."""
    factors, known = np.ones(len(unit)), ~np.isnan(unit)
    for _ in range(1000):
        mean = np.nanmean(unit / factors[:, None], axis=0)
        factors = np.nansum(unit, axis=1) / (known * mean).sum(axis=1)
    return np.nanmean(unit / factors[:, None], axis=0)


def golden():
    """Six people rate six stimuli of a plane, in both orders and beside themselves; one leaves a pair out."""
    random = np.random.default_rng(28)
    names = ["m1", "m2", "m3", "m4", "m5", "m6"]
    places = np.array([[0, 0], [1, 0.3], [2.2, -0.2], [3, 1.1], [1.2, 2], [2.6, 2.2]])
    rows = []
    for person in range(6):
        uses, noise = 0.5 + 0.1 * person, 5
        for i, j in itertools.product(range(6), repeat=2):
            if person == 4 and {i, j} == {1, 3}:
                continue
            for _ in range(2 if i == j else 1):
                far = np.linalg.norm(places[i] - places[j])
                rating = 40 * uses * far ** 0.8 + noise * random.normal() + (2 if i < j else 0)
                rows.append([f"P{person + 1}", names[i], names[j], float(min(100, max(0, round(rating))))])
    people = sorted({row[0] for row in rows})
    pairs = list(itertools.combinations(range(6), 2))

    def order(who, i, j):
        own = [r[3] for r in rows if r[:3] == [who, names[i], names[j]]]
        return np.mean(own) if own else np.nan

    one = np.array([[order(who, i, j) for i, j in pairs] for who in people])
    other = np.array([[order(who, j, i) for i, j in pairs] for who in people])
    both = (one + other) / 2
    own_mean = np.nanmean(both, axis=1)
    unit = both / own_mean[:, None]
    mean = in_common(unit)
    # What 1 of them is on the scale.
    points = (np.nansum(both, axis=1) / (~np.isnan(both) * mean).sum(axis=1)).mean()
    expected = {}

    def put(key, value, tolerance=1e-9, source=("own numpy",)):
        expected["similarity/" + key] = {"value": float(value), "tol_rel": tolerance,
                                         "tol_abs": tolerance / 100, "source": list(source)}

    different = [r for r in rows if r[1] != r[2]]
    same = [r for r in rows if r[1] == r[2]]
    put("n", len(different))
    put("mean", own_mean.mean())
    put("n_participants", len(people))
    known = ~np.isnan(unit)
    correlations = []
    for p, q in itertools.combinations(range(6), 2):
        kept = known[p] & known[q]
        correlations.append(np.corrcoef(unit[p, kept], unit[q, kept])[0, 1])
    put("agreement/mean_correlation", np.mean(correlations))
    whole = unit[known.all(axis=1)]
    from scipy.stats import rankdata
    ranks = np.array([rankdata(np.round(row, 10)) for row in whole])
    m, k = ranks.shape
    ties = sum(sum(c**3 - c for c in np.unique(row, return_counts=True)[1]) for row in ranks)
    spread = ((ranks.sum(axis=0) - m * (k + 1) / 2) ** 2).sum()
    put("agreement/kendall_w", 12 * spread / (m**2 * (k**3 - k) - m * ties))
    put("agreement/n_complete", m)
    put("order/rms", np.sqrt((np.nanmean(one - other, axis=0) ** 2).mean()))
    put("order/n_pairs", len(pairs))
    own = np.array([np.mean([r[3] for r in same if r[0] == who]) for who in people])
    put("identical/n", len(same))
    put("identical/mean", own.mean())
    put("identical/share", own.mean() / own_mean.mean())
    put("identical/n_not_below", (own >= own_mean).sum())
    far = np.zeros((6, 6))
    for (i, j), value in zip(pairs, mean):
        far[i, j] = far[j, i] = value
    center = np.eye(6) - 1 / 6
    values = np.sort(np.linalg.eigvalsh(-0.5 * center @ far**2 @ center))[::-1]
    a, b = np.array(pairs).T
    for k in (1, 2):
        put(f"dimensions/{k}/classical", values[:k].clip(0).sum() / np.abs(values).sum())
    one = np.ones(len(a))
    stress = stress1(minimized(2, one, 100, a, b, mean, 6), one, a, b, mean)
    put("dimensions/2/ratio_stress", stress, 1e-6, ("SciPy 1.17.1",))
    for at, (i, j) in enumerate(pairs):
        mine = both[~np.isnan(both[:, at]), at]
        id = f"pair/{names[i]}|{names[j]}/"
        put(id + "n", sum({r[1], r[2]} == {names[i], names[j]} for r in rows))
        put(id + "mean", mine.mean())
        put(id + "sd", mine.std(ddof=1))
        put(id + "rescaled", mean[at] * points)
    for at, who in enumerate(people):
        rest = in_common(np.delete(unit, at, axis=0))
        put(f"participant/{who}/n", sum(r[0] == who for r in different))
        put(f"participant/{who}/mean", own_mean[at])
        put(f"participant/{who}/identical", own[at])
        put(f"participant/{who}/with_others", np.corrcoef(unit[at, known[at]], rest[known[at]])[0, 1])
    document = {
        "schema": 1, "dataset": "similarity_sim", "kind": "similarity",
        "about": "six stimuli of a plane rated for their differences in both orders and beside themselves; one pair is missing of one participant",
        "provenance": "simulated by crates/study-stats/tests/reference/similarity.py, numpy seed 28",
        "licence": "CC0", "n_expected": len(expected), "left_out_disagreeing": [],
        "input": {"columns": ["participant", "first", "second", "rating"], "rows": rows},
        "expected": expected,
    }
    print(json.dumps(document, indent=1))


def coverage(objects=7, studies=150, resamples=200):
    """How often intervals of Procrustes' r have that of endlessly many people: ratio scaling of points of a plane."""
    from scipy.stats import t

    random = np.random.default_rng(3)
    a, b = np.triu_indices(objects, 1)
    at = np.arange(objects)

    def scaled(all, start, rounds):
        """SMACOF of many at once, from a map on."""
        full = np.zeros((len(all), objects, objects))
        full[:, a, b] = full[:, b, a] = all
        x = np.repeat(start[None], len(all), 0)
        for _ in range(rounds):
            far = np.sqrt(((x[:, :, None] - x[:, None]) ** 2).sum(-1))
            far[:, at, at] = 1
            turned = -full / far
            turned[:, at, at] = -turned.sum(2)
            x = turned @ x / objects
        return x

    def classical(values):
        full = np.zeros((objects, objects))
        full[a, b] = full[b, a] = values
        center = np.eye(objects) - 1 / objects
        values, vectors = np.linalg.eigh(-0.5 * center @ full**2 @ center)
        return vectors[:, -2:] * np.sqrt(np.maximum(values[-2:], 0))

    def r(x, y):
        x = x - x.mean(-2, keepdims=True)
        y = (y - y.mean()) / np.linalg.norm(y - y.mean())
        return np.linalg.norm(np.einsum("...ok,o->...k", x, y), axis=-1) / np.sqrt((x**2).sum((-1, -2)))

    def rated(base, people, noise):
        all = np.maximum(base + noise * random.normal(size=(people, len(a))), 0)
        return all / all.mean(axis=1, keepdims=True)

    def map_of(mean):
        return scaled(mean[None], classical(mean), 200)[0]

    for people, noise, other in [(6, .6, .5), (12, .6, .5), (12, 1.5, .5), (30, .6, .5), (6, .6, .02), (12, .6, 3)]:
        held = np.zeros(2)
        for _ in range(studies):
            places = random.normal(size=(objects, 2)) * [1.5, 1]
            y = places[:, 0] + other * random.normal(size=objects)
            base = np.linalg.norm(places[a] - places[b], axis=1)
            own = rated(base, people, noise)
            truth = r(map_of(rated(base, 3000, noise).mean(axis=0)), y)
            start = map_of(own.mean(axis=0))
            drawn = random.integers(0, people, (resamples, people))
            all = r(scaled(own[drawn].mean(axis=1), start, 25), y)
            low, high = np.quantile(all, [.025, .975])
            z = np.arctanh(np.minimum(all, .9999))
            half = t.ppf(.975, people - 1) * z.std(ddof=1) * np.sqrt(people / (people - 1))
            middle = np.arctanh(min(r(start, y), .9999))
            held += [low <= truth <= high, np.tanh(middle - half) <= truth <= np.tanh(middle + half)]
        print(people, "people, noise", noise, "percentiles, z and t:", held / studies)
    # Near pairs by half of the people, far ones by the others: the ratios of distances on a line.
    a, b = np.triu_indices(6, 1)
    far = (b - a).astype(float)
    own = np.maximum(20 * np.exp(.3 * random.normal(size=(12, 1))) * far + 2 * random.normal(size=(12, 15)), 0)
    own[:6, far > 2], own[6:, far < 2] = np.nan, np.nan
    unit = own / np.nanmean(own, axis=1, keepdims=True)
    for name, mean in [("by own means", np.nanmean(unit, axis=0)), ("in common", in_common(unit))]:
        print(name, [round(float(mean[far == k].mean() / mean[far == 1].mean()), 2) for k in range(1, 6)])


if sys.argv[1:] == ["golden"]:
    golden()
    sys.exit()
if sys.argv[1:] == ["coverage"]:
    coverage()
    sys.exit()

everything = np.ones(len(a))
for k in (1, 2, 3):
    print("ratio, scikit-learn, stress", k, stress1(sklearn(k), everything))


for k in (1, 2):
    print("ratio, SciPy, stress", k, stress1(minimized(k, everything), everything))
# Every third pair is missing.
some = (np.arange(len(a)) % 3 != 2).astype(float)
x = minimized(2, some)
print("ratio, SciPy, two of three pairs, stress 2", stress1(x, some))
print("distances 0-1, 0-3 (missing)", [np.linalg.norm(x[0] - x[i]) for i in (1, 3)])
