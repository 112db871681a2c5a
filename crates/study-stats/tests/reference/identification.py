"""Identification: a reference file, and simulated studies.

    python3 identification.py golden > ../../../../tests/golden/psychophysics/identification_sim.json
    python3 identification.py simulate [STUDIES]
    python3 identification.py bias [STUDIES]

Needs numpy and SciPy. The choice model is fitted by iterative scaling, which the program does not use. `golden` writes answers
of six participants and what follows from them; identification.R comes to the same numbers. `simulate` and `bias` print the tables of
docs/calibration.md: the bias of information transfer, its intervals, and the test against guesses; and the bias of one matrix beside both
formulas.
"""
import json
import sys

import numpy as np
from scipy import stats

LABELS = ["buzz", "click", "soft/long", "tick"]
REALIZATIONS = {"m1": 0, "m2": 1, "m3": 2, "m4": 3, "m5": 3}


def entropy(counts):
    p = counts[counts > 0] / counts.sum()
    return -(p * np.log2(p)).sum()


def bias(m):
    """Of fixed numbers of presentations."""
    r, c = m.sum(1)[:, None], m.sum(0)[None]
    filled = m > 0
    elsewhere = (1 - m / np.where(r > 0, r, 1)) * (1 - m / np.where(c > 0, c, 1))
    return elsewhere[filled].sum() / (2 * m.sum() * np.log(2))


def transmitted(m):
    return entropy(m.sum(1)) + entropy(m.sum(0)) - entropy(m.ravel())


def corrected(m):
    return transmitted(m) - bias(m)


def choice(m):
    """Similarities and biases of quasi-symmetry by iterative scaling."""
    m = m + 1 / len(m)
    fit = np.ones_like(m)
    for _ in range(100_000):
        before = fit
        fit = fit * (m.sum(1) / fit.sum(1))[:, None]
        fit = fit * (m.sum(0) / fit.sum(0))[None, :]
        fit = fit * (m + m.T) / (fit + fit.T)
        if np.abs(fit / before - 1).max() < 1e-15:
            break
    own = np.diag(fit)
    weight = np.sqrt(fit[0] * own / (fit[:, 0] * own[0]))
    return np.sqrt(fit * fit.T / np.outer(own, own)), weight / weight.sum()


def sensitivity(m, a, b):
    rate = lambda k, n: (k + 0.5) / (n + 1)
    z = stats.norm.ppf
    return z(rate(m[a, a], m[a, a] + m[a, b])) - z(rate(m[b, a], m[b, a] + m[b, b]))


def guessed(m):
    return (m.sum(1) * m.sum(0)).sum() / m.sum() ** 2


def guesses(m):
    """The variance of the share of correct answers of guesses."""
    n, r, c = m.sum(), m.sum(1), m.sum(0)
    alone = (r * c * (n - r) * (n - c)).sum()
    return (alone + (r * c).sum() ** 2 - ((r * c) ** 2).sum()) / (n**4 * (n - 1))


def interval(own, statistic):
    """Estimate ± t times the standard error of leaving out each participant."""
    n, total = len(own), sum(own)
    left = np.array([statistic(total - m) for m in own])
    se = np.sqrt((n - 1) / n * ((left - left.mean()) ** 2).sum())
    half = stats.t.ppf(0.975, n - 1) * se
    return statistic(total) - half, statistic(total) + half


def transfer_interval(own):
    """On the logarithm of what is lost of the entropy of the labels that were right."""
    n, total = len(own), sum(own)
    lost = lambda m: entropy(m.sum(1)) - corrected(m)
    left = np.array([lost(total - m) for m in own])
    se = np.sqrt((n - 1) / n * ((left - left.mean()) ** 2).sum())
    most = entropy(total.sum(1))
    least = min(lost(total), most)
    half = stats.t.ppf(0.975, n - 1) * se / least
    return max(most - least * np.exp(half), 0), max(most - least * np.exp(-half), 0)


def above_guessing(own):
    above = np.array([np.trace(m) / m.sum() - guessed(m) for m in own])
    n = len(own)
    least = 0.25 * sum(guesses(m) for m in own) / n**2
    se = np.sqrt(max(above.var(ddof=1) / n, least))
    t = above.mean() / se
    return above.mean(), se, t, 2 * stats.t.sf(abs(t), n - 1)


def share(clusters):
    """A share with Wilson's interval over clusters (Korn & Graubard 1998)."""
    hits, trials = np.array(clusters, float).T
    s, total = len(hits), trials.sum()
    p = hits.sum() / total
    v = s / (s - 1) * ((hits - p * trials) ** 2).sum() / total**2
    n = min(p * (1 - p) / v, total) if v > 1e-24 and 0 < p < 1 else s
    t = stats.t.ppf(0.975, s - 1)
    center = (p + t * t / (2 * n)) / (1 + t * t / n)
    half = t / (1 + t * t / n) * np.sqrt(p * (1 - p) / n + t * t / (4 * n * n))
    return p, max(center - half, 0), min(center + half, 1)


def escaped(name):
    return name.replace("%", "%25").replace("/", "%2F").replace("|", "%7C")


def golden():
    rng = np.random.default_rng(28)
    place = np.array([0.0, 0.8, 2.0, 2.6])
    rows = []
    for p in range(6):
        scale = 0.8 * np.exp(0.3 * rng.normal())
        liking = np.exp(0.3 * rng.normal(size=4))
        for name, label in REALIZATIONS.items():
            weight = np.exp(-np.abs(place - place[label]) / scale) * liking
            for _ in range(8):
                given = rng.choice(4, p=weight / weight.sum())
                rows.append([f"P{p + 1:02}", name, LABELS[label], LABELS[given]])
    people = sorted({r[0] for r in rows})
    own = []
    for who in people:
        m = np.zeros((4, 4))
        for r in rows:
            if r[0] == who:
                m[LABELS.index(r[2]), LABELS.index(r[3])] += 1
        own.append(m)
    total = sum(own)
    found = {}

    def put(identifier, value, tolerance=1e-9):
        found["identification/" + identifier] = {
            "value": float(value),
            "tol_rel": tolerance,
            "tol_abs": tolerance / 100,
            "source": ["own numpy", "own R"],
        }

    def ends(identifier, low_high, tolerance=1e-9):
        put(identifier + "_lo", low_high[0], tolerance)
        put(identifier + "_hi", low_high[1], tolerance)

    p, low, high = share([(np.trace(m), m.sum()) for m in own])
    put("n", total.sum())
    put("correct", p)
    ends("correct_ci95", (low, high))
    put("by_guessing", guessed(total))
    mean, se, t, probability = above_guessing(own)
    for name, value in zip(["mean", "se", "t", "df", "p"], [mean, se, t, 5, probability]):
        put("above_guessing/" + name, value)
    half = stats.t.ppf(0.975, 5) * se
    ends("above_guessing/ci95", (mean - half, mean + half))
    bits = transfer_interval(own)
    put("information/transmitted", transmitted(total))
    put("information/corrected", corrected(total))
    ends("information/corrected_ci95", bits)
    put("information/stimulus", entropy(total.sum(1)))
    put("information/items", 2 ** max(corrected(total), 0))
    ends("information/items_ci95", (2 ** bits[0], 2 ** bits[1]))
    for a, right in enumerate(LABELS):
        for b, given in enumerate(LABELS):
            put(f"confusion/{escaped(right)}/{escaped(given)}", total[a, b])
    for name in REALIZATIONS:
        hits = lambda who: [(r[2] == r[3]) for r in rows if r[0] == who and r[1] == name]
        clusters = [(sum(hits(who)), len(hits(who))) for who in people]
        p, low, high = share(clusters)
        put(f"realization/{name}/n", sum(c[1] for c in clusters))
        put(f"realization/{name}/correct", p)
        ends(f"realization/{name}/correct_ci95", (low, high))
    similarity, biases = choice(total)
    for a, label in enumerate(LABELS):
        put(f"label/{escaped(label)}/place", a + 1)
        put(f"label/{escaped(label)}/n", total.sum(1)[a])
        put(f"label/{escaped(label)}/given", total.sum(0)[a])
        put(f"label/{escaped(label)}/bias", biases[a], 1e-7)
        for b in range(a + 1, 4):
            pair = f"pair/{escaped(label)}|{escaped(LABELS[b])}/"
            put(pair + "similarity", similarity[a, b], 1e-7)
            logs = interval(own, lambda m: np.log(choice(m)[0][a, b]))
            ends(pair + "similarity_ci95", np.exp(logs), 1e-6)
            put(pair + "d", sensitivity(total, a, b))
            ends(pair + "d_ci95", interval(own, lambda m: sensitivity(m, a, b)))
    for who, m in zip(people, own):
        put(f"participant/{who}/n", m.sum())
        put(f"participant/{who}/correct", np.trace(m) / m.sum())
        put(f"participant/{who}/by_guessing", guessed(m))
        put(f"participant/{who}/information", corrected(m))
    document = {
        "schema": 1,
        "dataset": "identification_sim",
        "kind": "identification",
        "about": "five realizations named by one of four labels, one of which belongs to two; a label has a slash",
        "provenance": "simulated by crates/study-stats/tests/reference/identification.py, numpy seed 28",
        "licence": "CC0",
        "n_expected": len(found),
        "left_out_disagreeing": [],
        "input": {
            "columns": ["participant", "realization", "target", "answer"],
            "labels": LABELS,
            "rows": rows,
        },
        "expected": found,
    }
    json.dump(document, sys.stdout, indent=1)
    print()


def people_of(rng, n, k, scale, spread):
    """Shares of answers of n participants: similarities fall with the distance of k labels on a line."""
    distance = np.abs(np.arange(k)[:, None] - np.arange(k)[None])
    own = scale * np.exp(spread * rng.normal(size=n))
    weight = np.exp(-distance[None] / own[:, None, None]) * np.exp(0.3 * rng.normal(size=(n, 1, k)))
    return weight / weight.sum(2, keepdims=True)


def all_bits(m):
    """Of several matrices: information by maximum likelihood, by Miller's formula for drawn and for fixed numbers of
    presentations, and the entropy of the labels that were right."""
    n = m.sum((-1, -2))
    p = m / n[..., None, None]

    def h(p):
        return -(p * np.log2(np.where(p > 0, p, 1))).sum(-1)

    most = h(p.sum(-1))
    raw = most + h(p.sum(-2)) - h(p.reshape(*p.shape[:-2], -1))
    r, c = m.sum(-1, keepdims=True), m.sum(-2, keepdims=True)
    drawn = (m > 0).sum((-1, -2)) - (r > 0).sum((-1, -2)) - (c > 0).sum((-1, -2)) + 1
    elsewhere = (1 - m / np.where(r > 0, r, 1)) * (1 - m / np.where(c > 0, c, 1))
    fixed = np.where(m > 0, elsewhere, 0).sum((-1, -2))
    unit = 2 * n * np.log(2)
    return raw, raw - drawn / unit, raw - fixed / unit, most


# Participants, labels, repetitions, similarity, its spread.
STUDIES = [
    (10, 4, 5, np.inf, 0.0),
    (10, 8, 3, np.inf, 0.0),
    (2, 4, 5, 1.0, 0.3),
    (5, 4, 10, 1.0, 0.3),
    (10, 4, 5, 1.0, 0.3),
    (10, 6, 5, 1.5, 0.3),
    (10, 10, 5, 1.0, 0.3),
    (20, 4, 10, 1.0, 0.5),
    (5, 4, 5, 0.4, 0.5),
    (10, 4, 5, 0.4, 0.5),
    (2, 4, 5, 0.25, 0.3),
    (3, 4, 5, 0.25, 0.3),
    (5, 4, 5, 0.25, 0.3),
    (10, 4, 5, 0.25, 0.3),
    (20, 4, 5, 0.25, 0.3),
    (10, 8, 3, 0.3, 0.3),
    (5, 4, 5, 0.2, 0.3),
    (10, 4, 5, 0.2, 0.3),
]


def named(scale):
    return "guesses" if np.isinf(scale) else f"e^(−d/{scale})"


def simulate(studies):
    print("| participants × labels × repetitions | similarity | true bits | maximum likelihood | Miller, drawn | corrected | interval holds | ± t·se holds | bootstrap holds | no interval | above guesses at .05 |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for n, k, repetitions, scale, spread in STUDIES:
        rng = np.random.default_rng(1955)
        true = transmitted(people_of(rng, 40_000, k, scale, spread).mean(0) / k)
        t = stats.t.ppf(0.975, n - 1)
        found, ours, symmetric, bootstrap, alike, yes = [], 0, 0, 0, 0, 0
        for _ in range(studies):
            shares = people_of(rng, n, k, scale, spread)
            own = rng.multinomial(repetitions, shares).astype(float)
            total = own.sum(0)
            raw, drawn, estimate, most = all_bits(total)
            found.append((raw, drawn, estimate))
            left = all_bits(total - own)
            se = np.sqrt((n - 1) * (left[3] - left[2]).var())
            weights = rng.multinomial(n, [1 / n] * n, size=400).astype(float)
            low, high = np.quantile(all_bits(np.einsum("bn,nij->bij", weights, own))[2], [0.025, 0.975])
            bootstrap += low <= true <= high
            yes += above_guessing(own)[3] <= 0.05
            if se < 1e-10:
                alike += 1
                continue
            least = min(most - estimate, most)
            ends = most - least * np.exp(np.array([1, -1]) * t * se / least)
            ours += max(ends[0], 0) <= true + 1e-12 and true - 1e-12 <= max(ends[1], 0)
            symmetric += abs(estimate - true) <= t * se
        raw, drawn, estimate = np.mean(found, 0)
        share = lambda count, of=studies: f"{count / of:.3f}"
        print(
            f"| {n} × {k} × {repetitions} | {named(scale)} | {true:.3f} | {raw:.3f} | {drawn:.3f} | {estimate:.3f} | "
            f"{share(ours, studies - alike)} | {share(symmetric, studies - alike)} | {share(bootstrap)} | {share(alike)} | {share(yes)} |",
            flush=True,
        )


def one_matrix(studies):
    """The bias of one matrix whose rows have fixed numbers of answers."""
    print("| labels × answers to each | matrix | true bits | bias | Miller, drawn | fixed |")
    print("|---|---|---|---|---|---|")
    rng = np.random.default_rng(1955)
    for k, n in [(4, 5), (4, 20), (4, 100), (8, 10), (8, 60)]:
        for scale in [np.inf, 1.0, 0.4, 0.25, 0.15]:
            shares = people_of(np.random.default_rng(28), 1, k, scale, 0.0)[0]
            true = transmitted(shares / k)
            m = rng.multinomial(n, shares, size=(studies, k)).astype(float)
            raw, drawn, fixed, _ = all_bits(m)
            print(
                f"| {k} × {n} | {named(scale)} | {true:.3f} | {raw.mean() - true:+.4f} | {(raw - drawn).mean():+.4f} | "
                f"{(raw - fixed).mean():+.4f} |",
                flush=True,
            )


if __name__ == "__main__":
    studies = int(sys.argv[2]) if len(sys.argv) > 2 else 1000
    if sys.argv[1:2] == ["golden"]:
        golden()
    elif sys.argv[1:2] == ["bias"]:
        one_matrix(studies)
    else:
        simulate(studies)
