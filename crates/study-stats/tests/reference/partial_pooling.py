"""Reference values of the pooled psychometric functions: numpyro 0.22.0 (NUTS).

    python3 -m venv env && env/bin/pip install numpyro arviz
    env/bin/python partial_pooling.py            # all data sets
    env/bin/python partial_pooling.py NAME …     # some of them

simulates the data (numpy, fixed seeds) and writes NAME.txt: the conditions, the cells with
LEVEL:POSITIVE/TRIALS, and for each parameter its posterior mean, standard deviation and quantiles
at 2.5, 50 and 97.5 %, each followed by its Monte Carlo error, by four chains.
The model and its priors are those of study_stats::psychometric::hierarchy, written independently:
participants' parameters are sampled, not integrated out.
"""

import sys

import numpy

WARMUP, DRAWS, CHAINS = 2000, 10000, 4
C_GUMBEL = 4.067383949407112
LN2 = numpy.log(2.0)


def core_numpy(name, u):
    from math import erf

    if name == "norm":
        z = 3.289707253902944 * u / numpy.sqrt(2.0)
        return 0.5 * (1.0 + numpy.vectorize(erf)(z))
    if name == "logistic":
        return 1.0 / (1.0 + numpy.exp(-5.88887795833288 * u))
    if name == "gumbel":
        return -numpy.expm1(-numpy.exp(C_GUMBEL * u) * LN2)
    raise ValueError(name)


def argument(kind, unit, origin, x, theta, omega, xp):
    if kind == "origin":
        return ((x - origin) / xp.exp(theta) - 1.0) / xp.exp(omega)
    return (x / unit - theta) / xp.exp(omega)


def staircase(rng, ladder, probability, trials, start, down=3):
    """Levels and answers of an up-down track on the ladder."""
    at, run, out = start, 0, []
    for trial in range(trials):
        right = rng.random() < probability(ladder[at])
        out.append((ladder[at], right))
        step = 3 if trial < 8 else 1
        if right:
            run += 1
            if run == down:
                run, at = 0, max(0, at - step)
        else:
            run, at = 0, min(len(ladder) - 1, at + step)
    return out


def constant(rng, levels, probability, repetitions):
    return [(x, rng.random() < probability(x)) for x in levels for _ in range(repetitions)]


def simulate(seed, people, means, ladder, kind, core, guess, trials, between, interaction,
             width, width_between, lapse, how, unit=1.0, origin=0.0, missing=(), asleep=()):
    rng = numpy.random.default_rng(seed)
    ladder = numpy.asarray(ladder, dtype=float)
    cells = []
    for person in range(people):
        b = between * rng.standard_normal()
        for condition, mean in enumerate(means):
            theta = mean + b + interaction * rng.standard_normal()
            omega = width + width_between * rng.standard_normal()

            def probability(x):
                if person in asleep:
                    return guess
                s = core_numpy(core, argument(kind, unit, origin, x, theta, omega, numpy))
                low = lapse if guess is None else guess
                return float(low + (1.0 - low - lapse) * s)

            if how == "staircase":
                answers = staircase(rng, ladder, probability, trials, int(0.8 * len(ladder)))
            else:
                levels = ladder[:: max(1, len(ladder) // how)]
                answers = constant(rng, levels, probability, trials // len(levels))
            if (person, condition) in missing:
                continue
            counts = {}
            for x, right in answers:
                k, n = counts.get(x, (0, 0))
                counts[x] = (k + int(right), n + 1)
            cells.append((person, condition, sorted((x, k, n) for x, (k, n) in counts.items())))
    steps = numpy.diff(ladder)
    conditions = [dict(core=core, guess=guess, kind=kind, origin=origin, unit=unit, low=ladder[0],
                       high=ladder[-1], least=float(steps.min()))] * len(means)
    return dict(conditions=conditions, cells=cells, people=people)


def ratio_ladder(low, high, n):
    return numpy.log(numpy.geomspace(low, high, n))


DATA = {
    # Ten people, a staircase of 40 trials each.
    "pool_staircases": lambda: simulate(
        1, 10, [numpy.log(0.12)], ratio_ladder(0.02, 2.0, 41), "ratios", "gumbel", 0.5, 40,
        0.35, 0.0, 0.487, 0.3, 0.02, "staircase"),
    # Six people, two conditions of eight constant levels.
    "pool_constant": lambda: simulate(
        2, 6, [numpy.log(0.1), numpy.log(0.16)], ratio_ladder(0.02, 0.6, 24), "ratios", "gumbel", 0.5,
        80, 0.3, 0.1, 0.6, 0.2, 0.03, 8),
    # A comparison with a standard, on a linear scale: five people.
    "pool_comparison": lambda: simulate(
        3, 5, [0.52], numpy.linspace(0.0, 1.0, 11), "even", "norm", None, 88, 0.06, 0.0, -0.8, 0.3,
        0.02, 11, unit=1.0),
    # Three intervals, three conditions above a standard of 0.2; two cells are missing.
    "pool_above_standard": lambda: simulate(
        4, 7, numpy.log([0.1, 0.13, 0.2]), 0.2 + numpy.geomspace(0.02, 1.0, 30), "origin", "norm",
        1.0 / 3.0, 50, 0.4, 0.15, 0.5, 0.3, 0.01, "staircase", origin=0.2,
        missing=((1, 2), (4, 0))),
    # Two people, few trials.
    "pool_two_people": lambda: simulate(
        5, 2, [numpy.log(0.2)], ratio_ladder(0.05, 0.8, 20), "ratios", "logistic", 0.5, 30, 0.2, 0.0,
        0.4, 0.2, 0.02, "staircase"),
    # Twenty people, two conditions of 80 trials: the size of a large study.
    "pool_large": lambda: simulate(
        6, 20, [numpy.log(0.1), numpy.log(0.12)], ratio_ladder(0.02, 0.6, 30), "ratios", "gumbel", 0.5,
        80, 0.4, 0.2, 0.487, 0.4, 0.02, "staircase"),
    # Eight people of whom one answers by chance, and one in ten answers of all is a lapse.
    "pool_asleep": lambda: simulate(
        7, 8, [numpy.log(0.15)], ratio_ladder(0.02, 1.0, 30), "ratios", "gumbel", 0.5, 60, 0.3, 0.0,
        0.487, 0.3, 0.10, "staircase", asleep=(3,)),
}

PRIORS = {
    "ratios": dict(between=0.5, interaction=0.3, width=(0.486664, 0.5), width_between=0.4),
    "origin": dict(between=0.5, interaction=0.3, width=(0.530628, 0.6), width_between=0.4),
    "even": dict(between=0.25, interaction=0.15, width=(-0.693147, 0.8), width_between=0.4),
}


def fit(data):
    import arviz
    import jax
    import jax.numpy as jnp
    import numpyro
    import numpyro.distributions as dist
    from jax.scipy.special import ndtr
    from numpyro.infer import MCMC, NUTS

    numpyro.enable_x64()
    conditions, cells = data["conditions"], data["cells"]
    kind = conditions[0]["kind"]
    priors = PRIORS[kind]
    unit, origin = conditions[0]["unit"], conditions[0]["origin"]
    rows = [(i, x, k, n) for i, (_, _, levels) in enumerate(cells) for x, k, n in levels]
    cell, x, k, n = (jnp.asarray(numpy.array(c, dtype=float)) for c in zip(*rows))
    cell = cell.astype(int)
    person = jnp.asarray([c[0] for c in cells])
    condition = jnp.asarray([c[1] for c in cells])
    core, guess = conditions[0]["core"], conditions[0]["guess"]

    def ends(c):
        if kind == "origin":
            return numpy.log(max(c["low"] - origin, c["least"] / 2)), numpy.log(c["high"] - origin)
        return c["low"] / unit, c["high"] / unit

    low, high = (jnp.asarray(e) for e in zip(*(ends(c) for c in conditions)))
    length = high - low

    def model():
        with numpyro.plate("conditions", len(conditions)):
            mu = numpyro.sample("mu", dist.Uniform(low - length / 2, high + length / 2))
        far = jnp.maximum(jnp.maximum(low - mu, mu - high), 0.0)
        numpyro.factor("falls", jnp.sum(jnp.log((1 + jnp.cos(2 * jnp.pi * far / length)) / 2)))
        tau = numpyro.sample("tau", dist.HalfNormal(priors["between"]))
        nu = numpyro.sample("nu", dist.Normal(*priors["width"]))
        kappa = numpyro.sample("kappa", dist.HalfNormal(priors["width_between"]))
        lam = numpyro.sample("lambda", dist.Beta(1.0, 30.0))
        with numpyro.plate("people", data["people"]):
            b = numpyro.sample("b", dist.Normal(0.0, 1.0))
        theta = mu[condition] + tau * b[person]
        with numpyro.plate("cells", len(cells)):
            w = numpyro.sample("w", dist.Normal(0.0, 1.0))
        if len(conditions) > 1:
            sigma = numpyro.sample("sigma", dist.HalfNormal(priors["interaction"]))
            with numpyro.plate("interactions", len(cells)):
                e = numpyro.sample("e", dist.Normal(0.0, 1.0))
            theta = theta + sigma * e
        theta = numpyro.deterministic("theta", theta)
        omega = nu + kappa * w
        u = argument(kind, unit, origin, x, theta[cell], omega[cell], jnp)
        if core == "norm":
            z = 3.289707253902944 * u
            s, t = ndtr(z), ndtr(-z)
        elif core == "logistic":
            s, t = jax.nn.sigmoid(5.88887795833288 * u), jax.nn.sigmoid(-5.88887795833288 * u)
        else:
            t = jnp.exp(-jnp.exp(jnp.minimum(C_GUMBEL * u, 6.0)) * LN2)
            s = 1.0 - t
        g = lam if guess is None else guess
        inner = 1.0 - g - lam
        numpyro.factor("answers", jnp.sum(k * jnp.log(g + inner * s) + (n - k) * jnp.log(lam + inner * t)))

    kernel = NUTS(model, target_accept_prob=0.95)
    mcmc = MCMC(kernel, num_warmup=WARMUP, num_samples=DRAWS, num_chains=CHAINS,
                chain_method="sequential", progress_bar=False)
    mcmc.run(jax.random.PRNGKey(1))
    samples = {name: numpy.asarray(v) for name, v in mcmc.get_samples(group_by_chain=True).items()}
    divergences = int(numpy.asarray(mcmc.get_extra_fields()["diverging"]).sum())
    wanted = {}
    for c in range(len(conditions)):
        wanted[f"mu {c}"] = samples["mu"][..., c]
        for d in range(c + 1, len(conditions)):
            wanted[f"contrast {c} {d}"] = samples["mu"][..., c] - samples["mu"][..., d]
    for name in ["tau", "sigma", "nu", "kappa", "lambda"]:
        if name in samples:
            wanted[name] = samples[name]
    for i in range(len(cells)):
        wanted[f"theta {i}"] = samples["theta"][..., i]
    lines, worst = [], 0.0
    for name, draws in wanted.items():
        worst = max(worst, float(arviz.rhat(draws)))
        numbers = [draws.mean(), arviz.mcse(draws, method="mean"), draws.std(), arviz.mcse(draws, method="sd")]
        for p in (0.025, 0.5, 0.975):
            numbers += [numpy.quantile(draws, p), arviz.mcse(draws, method="quantile", prob=p)]
        lines.append(f"posterior {name} | " + " ".join(f"{float(v):.8g}" for v in numbers))
    return lines, f"numpyro {numpyro.__version__}, {CHAINS} × {DRAWS} draws, {divergences} divergences, R-hat {worst:.4f}"


def write(name):
    data = DATA[name]()
    lines = []
    for c in data["conditions"]:
        guess = "lapse" if c["guess"] is None else repr(float(c["guess"]))
        lines.append(f"condition {c['core']} {guess} {c['kind']} {c['origin']!r} "
                     f"{float(c['low'])!r} {float(c['high'])!r} {float(c['least'])!r}")
    for person, condition, levels in data["cells"]:
        counts = " ".join(f"{float(x)!r}:{k}/{n}" for x, k, n in levels)
        lines.append(f"cell {person} {condition} {counts}")
    found, source = fit(data)
    with open(f"{name}.txt", "w") as file:
        file.write("\n".join([f"source {source}", *lines, *found]) + "\n")
    print(name, source, flush=True)


if __name__ == "__main__":
    for name in sys.argv[1:] or DATA:
        write(name)
