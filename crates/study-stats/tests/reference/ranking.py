"""Reference values of rankings, by a program of its own (numpy, SciPy).

python3 ranking.py > tests/golden/psychophysics/ranking_sim.json writes the reference file of the
analysis: six participants rank four stimuli twice, with ties; one rank is missing. The likelihood is that of Turner et al. (2020,
Computational Statistics 35, section 2.1), written out over all sets and maximized by Newton's method.
"""

import itertools
import json

import numpy as np
from scipy import stats

rng = np.random.default_rng(28)
ITEMS = ["m1", "m2", "m3", "m4"]
PEOPLE = [f"P{i}" for i in range(1, 7)]
STRENGTH = np.array([0.0, 1.2, 0.5, -0.8])


def simulated():
    """Rankings by participant: the ranks of all items, those that are near each other tied."""
    rankings = []
    for at, _ in enumerate(PEOPLE):
        own = STRENGTH + 0.5 * rng.normal(size=4)
        for _ in range(2):
            felt = own + 0.6 * rng.normal(size=4)
            order = np.argsort(-felt)
            ranks = np.zeros(4)
            rank = 1
            for place, item in enumerate(order):
                if place and felt[order[place - 1]] - felt[item] > 0.15:
                    rank = place + 1
                ranks[item] = rank
            rankings.append((at, ranks))
    rankings[3][1][2] = np.nan
    return rankings


RANKINGS = simulated()


def choices(ranks):
    """The set that is taken, and what is left, of each choice."""
    left = [i for i in range(4) if not np.isnan(ranks[i])]
    while len(left) > 1:
        best = min(ranks[i] for i in left)
        taken = tuple(i for i in left if ranks[i] == best)
        yield taken, tuple(left)
        left = [i for i in left if i not in taken]


MADE = [(who, choice) for who, ranks in RANKINGS for choice in choices(ranks)]
SIZES = sorted({len(taken) for _, (taken, _) in MADE} - {1})
SIZE = 3 + len(SIZES)
# Worths from the parameters: the last is minus the sum of the others.
MAP = np.zeros((4, SIZE))
MAP[:3, :3] = np.eye(3)
MAP[3, :3] = -1


def weight(taken):
    v = MAP[list(taken)].mean(axis=0)
    if len(taken) > 1:
        v[3 + SIZES.index(len(taken))] += 1
    return v


def derivatives(at, who=None):
    """Log-likelihood, gradient and information."""
    value, gradient, information = 0.0, np.zeros(SIZE), np.zeros((SIZE, SIZE))
    for own, (taken, left) in MADE:
        if who is not None and own != who:
            continue
        sets = [s for k in [1] + SIZES for s in itertools.combinations(left, k)]
        x = np.array([weight(s) for s in sets])
        eta = x @ at
        p = np.exp(eta - eta.max())
        p /= p.sum()
        chosen = sets.index(taken)
        value += np.log(p[chosen])
        mean = p @ x
        gradient += x[chosen] - mean
        information += (x - mean).T @ np.diag(p) @ (x - mean)
    return value, gradient, information


at = np.zeros(SIZE)
for _ in range(50):
    _, gradient, information = derivatives(at)
    at += np.linalg.solve(information, gradient)
assert np.abs(gradient).max() < 1e-12
v = np.linalg.inv(information)
log_worth = MAP @ at
log_worth_se = np.sqrt(np.diag(MAP @ v @ MAP.T))
worth = np.exp(log_worth) / np.exp(log_worth).sum()
of_each = [derivatives(at, who) for who in range(len(PEOPLE))]
scores = np.array([v @ d[1] for d in of_each])
sandwich = scores.T @ scores

expected = {}


def put(identifier, x, source="own numpy"):
    expected[f"ranking/{identifier}"] = {
        "value": float(x), "tol_rel": 1e-7, "tol_abs": 1e-9, "source": [source],
    }


put("n", len(RANKINGS))
put("n_participants", len(PEOPLE))
put("n_incomplete", sum(np.isnan(r).any() for _, r in RANKINGS))
whole = [(who, stats.rankdata(r)) for who, r in RANKINGS if not np.isnan(r).any()]
means = np.array([np.mean([r for own, r in whole if own == who], axis=0) for who in range(len(PEOPLE))])
ranked = np.array([stats.rankdata(row.round(10)) for row in means])
n, k = ranked.shape
friedman = stats.friedmanchisquare(*ranked.T)
put("agreement/n", n)
put("agreement/chi2", friedman.statistic, "SciPy")
put("agreement/w", friedman.statistic / (n * (k - 1)), "SciPy")
put("agreement/df", k - 1)
put("agreement/p_chi2", friedman.pvalue, "SciPy")
ranks = np.array([r for _, r in RANKINGS])
for i, item in enumerate(ITEMS):
    here = ~np.isnan(ranks[:, i])
    put(f"realization/{item}/n", here.sum())
    put(f"realization/{item}/mean_rank", means[:, i].mean())
    put(f"realization/{item}/sd", means[:, i].std(ddof=1))
    put(f"realization/{item}/first", np.mean(ranks[here, i] == np.nanmin(ranks[here], axis=1)))
    put(f"realization/{item}/worth", worth[i])
    put(f"realization/{item}/log_worth", log_worth[i])
    put(f"realization/{item}/log_worth_se", log_worth_se[i])
for place, size in enumerate(SIZES):
    put(f"ties/{size}/log_delta", at[3 + place])
    put(f"ties/{size}/log_delta_se", np.sqrt(v[3 + place, 3 + place]))
tested = []
for i, j in itertools.combinations(range(4), 2):
    both = ~np.isnan(ranks[:, i]) & ~np.isnan(ranks[:, j])
    id = f"pair/{ITEMS[i]}|{ITEMS[j]}/"
    put(id + "n", both.sum())
    put(id + "above", np.mean(ranks[both, i] < ranks[both, j]))
    put(id + "tied", np.mean(ranks[both, i] == ranks[both, j]))
    contrast = MAP[i] - MAP[j]
    difference, se = contrast @ at, np.sqrt(contrast @ v @ contrast)
    clustered = np.sqrt(contrast @ sandwich @ contrast)
    along = v @ contrast
    shares = np.array([along @ d[2] @ along for d in of_each])
    people = shares.sum() ** 2 / (shares**2).sum()
    decisive = max(clustered * np.sqrt(people / max(people - 1, people / 2)), se / 2)
    df = max(people - 1, 1)
    p = 2 * stats.t.sf(abs(difference / decisive), df)
    put(id + "difference", difference)
    put(id + "se", se)
    put(id + "se_clustered", clustered)
    put(id + "t", difference / decisive)
    put(id + "t_df", df)
    put(id + "p", p)
    tested.append((id, p))
highest = 0.0
for done, (id, p) in enumerate(sorted(tested, key=lambda one: one[1])):
    highest = min(max(highest, (len(tested) - done) * p), 1.0)
    put(id + "p_holm", highest)
order = np.argsort(-log_worth)
put("best/difference", log_worth[order[0]] - log_worth[order[1]])
best = ITEMS[order[0]]
put("best/p", max(e["value"] for id, e in expected.items() if id.endswith("p_holm") and best in id))
for who, name in enumerate(PEOPLE):
    put(f"participant/{name}/n", sum(own == who for own, _ in RANKINGS))
    others = np.delete(means, who, axis=0).mean(axis=0)
    put(f"participant/{name}/with_others", stats.spearmanr(means[who], others).statistic, "SciPy")

rows = [
    [PEOPLE[who], str(number), item, float(rank)]
    for number, (who, own) in enumerate(RANKINGS)
    for item, rank in zip(ITEMS, own)
    if not np.isnan(rank)
]
print(json.dumps({
    "schema": 1, "dataset": "ranking_sim", "kind": "ranking",
    "about": "four stimuli ranked twice by six participants, with ties; one rank is missing",
    "provenance": "simulated by crates/study-stats/tests/reference/ranking.py, numpy seed 28",
    "licence": "CC0", "n_expected": len(expected), "left_out_disagreeing": [],
    "input": {"columns": ["participant", "ranking", "realization", "rank"], "rows": rows},
    "expected": expected,
}, indent=1))
