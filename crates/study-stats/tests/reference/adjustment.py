"""Settings by the method of adjustment, and what NumPy and SciPy compute of them (Python 3.11, SciPy 1.17.1):
python3 adjustment.py > tests/golden/psychophysics/adjustment_sim.json"""

import itertools
import json

import numpy as np
from scipy import stats

STANDARD = 1.0
random = np.random.default_rng(28)
ladder = np.round(np.linspace(0.5, 1.5, 21), 12)
rows = []
for who in range(1, 9):
    equal, pull = random.normal(1.06, 0.08), random.uniform(0, 0.15)
    for side, starts in (("below", (0, 1, 2)), ("above", (18, 19, 20))):
        # One participant has settings of one side, another one has one of each.
        if who == 7 and side == "above":
            continue
        for start in starts[: 1 if who == 8 else 3]:
            mean = equal + pull * (ladder[start] - equal)
            set_at = int(np.argmin(abs(ladder - random.normal(mean, 0.07))))
            detours = 2 * int(random.integers(0, 3))
            rows.append([f"P{who}", side, float(ladder[set_at]), abs(set_at - start) + detours])

expected = {}


def put(id, value, tolerance=None):
    expected["adjustment/" + id] = {
        "value": float(value), "tol_rel": 1e-9, "tol_abs": float(tolerance or 1e-11), "source": ["own numpy"],
    }


def missing(id):
    expected["adjustment/" + id] = {"undefined": True, "source": ["own numpy"]}


def interval(id, values):
    low, high = stats.t.interval(0.95, len(values) - 1, np.mean(values), stats.sem(values))
    put(id + "_lo", low)
    put(id + "_hi", high)


def test(id, values, against=0.0):
    found = stats.ttest_1samp(values, against)
    put(id + "t", found.statistic)
    put(id + "df", len(values) - 1)
    put(id + "p", found.pvalue)


people = sorted({row[0] for row in rows})
own = {
    who: {side: np.array([r[2] for r in rows if r[:2] == [who, side]]) for side in ("below", "above")}
    for who in people
}
pse = {who: np.mean([s.mean() for s in sides.values() if len(s)]) for who, sides in own.items()}
squares = {who: sum(((s - s.mean()) ** 2).sum() for s in sides.values() if len(s)) for who, sides in own.items()}
df = {who: sum(len(s) - 1 for s in sides.values() if len(s)) for who, sides in own.items()}
points = np.array([pse[who] for who in people])

put("n", len(rows))
put("n_participants", len(people))
put("changes", np.mean([row[3] for row in rows]))
put("pse", points.mean())
interval("pse_ci95", points)
put("pse_sd", points.std(ddof=1))

put("error/standard", STANDARD)
put("error/mean", points.mean() - STANDARD)
interval("error/ci95", points - STANDARD)
put("error/relative", points.mean() / STANDARD - 1)
test("error/", points, STANDARD)

both = [who for who in people if all(len(s) for s in own[who].values())]
up = np.array([own[who]["below"].mean() for who in both])
down = np.array([own[who]["above"].mean() for who in both])
put("start/ascending", up.mean())
put("start/descending", down.mean())
put("start/difference", (up - down).mean())
interval("start/ci95", up - down)
test("start/", up - down)

scattered = [who for who in people if df[who]]
ss, free = np.array([squares[who] for who in scattered]), np.array([df[who] for who in scattered])
sd = np.sqrt(ss.sum() / free.sum())
put("spread/sd", sd)
put("spread/df", free.sum())
put("spread/relative", sd / points.mean())
# All resamples; the quantiles on both sides are three standard errors of 2000 of them away.
drawn = np.array(list(itertools.product(range(len(scattered)), repeat=len(scattered))), dtype=np.int8)
spreads = np.sqrt(ss[drawn].sum(axis=1) / free[drawn].sum(axis=1))
for end, at in (("lo", 0.025), ("hi", 0.975)):
    below, value, above = np.quantile(spreads, [at - 0.01, at, at + 0.01])
    put("spread/sd_ci95_" + end, value, max(value - below, above - value))

for who in people:
    id = f"participant/{who}/"
    put(id + "n", sum(row[0] == who for row in rows))
    put(id + "pse", pse[who])
    for name, side in (("ascending", "below"), ("descending", "above")):
        mine = own[who][side]
        put(id + name, mine.mean()) if len(mine) else missing(id + name)
    put(id + "sd", np.sqrt(squares[who] / df[who])) if df[who] else missing(id + "sd")

print(json.dumps({
    "schema": 1, "dataset": "adjustment_sim", "kind": "adjustment",
    "about": "levels set from below and from above until they feel equal to 1; settings stay near their start, one participant has settings of one side, and another one has one of each",
    "provenance": "simulated by crates/study-stats/tests/reference/adjustment.py, numpy seed 28",
    "licence": "CC0", "n_expected": len(expected), "left_out_disagreeing": [],
    "input": {"standard": STANDARD, "columns": ["participant", "start", "level", "changes"], "rows": rows},
    "expected": expected,
}, indent=1))
