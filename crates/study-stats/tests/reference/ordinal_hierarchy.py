"""Reference values of the ordinal hierarchical model: numpyro (NUTS).

    python3 -m venv env && env/bin/pip install numpyro arviz
    env/bin/python ordinal_hierarchy.py            # all data sets
    env/bin/python ordinal_hierarchy.py NAME …     # some of them

simulates the data (numpy, fixed seeds) and writes ordinal_NAME.txt: the covariate, the cells with the counts of their
categories, and for each number its posterior mean, standard deviation and quantiles at 2.5, 50 and 97.5 %, each followed
by its Monte Carlo error, by four chains. The model and its priors are those of study_stats::ordinal_hierarchy, written
independently: all effects are sampled.
"""

import sys

import numpy

WARMUP, DRAWS, CHAINS = 2000, 10000, 4
# participants, realizations, repetitions, categories, covariate, tau, sigma, omega, slope, lapse, missing, shift
SETS = {
    "usual": (12, 5, 2, 7, True, 0.3, 0.6, 0.4, 0.6, 0.0, 0.0, 0.0),
    "no_covariate": (8, 4, 3, 5, False, 0.8, 0.5, 0.3, 0.0, 0.0, 0.0, 0.0),
    "missing": (14, 6, 1, 7, True, 0.4, 0.8, 0.5, 0.3, 0.0, 0.3, 0.5),
    "few": (3, 3, 4, 4, True, 0.3, 0.4, 0.3, 0.5, 0.0, 0.0, 0.0),
    "ceiling": (10, 4, 2, 7, False, 0.5, 0.7, 0.4, 0.0, 0.0, 0.0, 2.2),
    "lapses": (15, 5, 4, 9, True, 0.4, 0.5, 0.3, 0.8, 0.15, 0.0, 0.0),
}


def simulate(name):
    n, k, r, levels, has_x, tau, sigma, omega, slope, lapse, missing, shift = SETS[name]
    rng = numpy.random.default_rng(2600 + list(SETS).index(name))
    x = numpy.linspace(-1.4, 1.4, k) if has_x else numpy.zeros(k)
    thresholds = numpy.linspace(-1.6, 1.6, levels - 1)
    m = slope * x + tau * rng.standard_normal(k) + shift
    cells = []
    for i in range(n):
        u = sigma * rng.standard_normal()
        for j in range(k):
            w = omega * rng.standard_normal()
            counts = numpy.zeros(levels, int)
            for _ in range(r):
                y = numpy.searchsorted(thresholds, m[j] + u + w + rng.standard_normal())
                counts[rng.integers(levels) if rng.random() < lapse else y] += 1
            if rng.random() >= missing:
                cells.append((i, j, counts))
    return (x if has_x else None), cells


def posterior(x, cells, seed):
    import jax
    import jax.numpy as jnp
    import numpyro
    import numpyro.distributions as dist
    from jax.scipy.stats import norm

    who = jnp.array([c[0] for c in cells])
    which = jnp.array([c[1] for c in cells])
    counts = jnp.array([c[2] for c in cells])
    n, k, levels = int(who.max()) + 1, int(which.max()) + 1, counts.shape[1]

    def model():
        support = dist.constraints.ordered_vector
        c = numpyro.sample("c", dist.ImproperUniform(support, (), (levels - 1,)))
        numpyro.factor("prior of c", dist.Normal(0.0, 3.0).log_prob(c).sum())
        tau, sigma, omega = (numpyro.sample(s, dist.HalfNormal(1.0)) for s in ("tau", "sigma", "omega"))
        lapse = numpyro.sample("lapse", dist.Beta(1.0, 30.0))
        m = tau * numpyro.sample("m", dist.Normal(0, 1).expand([k]))
        if x is not None:
            m = m + numpyro.sample("slope", dist.Normal(0.0, 1.0)) * jnp.array(x)
        m = numpyro.deterministic("realizations", m)
        u = sigma * numpyro.sample("u", dist.Normal(0, 1).expand([n]))
        w = omega * numpyro.sample("w", dist.Normal(0, 1).expand([len(cells)]))
        eta = m[which] + u[who] + w
        below = norm.cdf(c[None, :] - eta[:, None])
        ends = jnp.concatenate([jnp.zeros((len(cells), 1)), below, jnp.ones((len(cells), 1))], axis=1)
        p = (1 - lapse) * jnp.diff(ends, axis=1) + lapse / levels
        numpyro.factor("ratings", (counts * jnp.log(jnp.clip(p, 1e-300))).sum())

    numpyro.enable_x64()
    kernel = numpyro.infer.NUTS(model, target_accept_prob=0.95)
    mcmc = numpyro.infer.MCMC(
        kernel, num_warmup=WARMUP, num_samples=DRAWS, num_chains=CHAINS, chain_method="sequential", progress_bar=False
    )
    mcmc.run(jax.random.PRNGKey(seed))
    print("divergences", int(mcmc.get_extra_fields()["diverging"].sum()))
    return mcmc.get_samples(group_by_chain=True)


def lines(name):
    import arviz

    x, cells = simulate(name)
    draws = {key: numpy.asarray(value) for key, value in posterior(x, cells, 7).items()}
    m = draws["realizations"]
    k = m.shape[2]
    numbers = {s: draws[s] for s in ("tau", "sigma", "omega", "lapse")}
    if x is not None:
        numbers["slope"] = draws["slope"]
    for j in range(k):
        numbers[f"realization {j}"] = m[:, :, j] - m.mean(axis=2)
    for j in range(draws["c"].shape[2]):
        numbers[f"threshold {j}"] = draws["c"][:, :, j]
    numbers["difference"] = m[:, :, 0] - m[:, :, k - 1]
    for j in range(k):
        numbers[f"highest {j}"] = (m.argmax(axis=2) == j).astype(float)
    yield "covariate " + " ".join(repr(float(v)) for v in (x if x is not None else []))
    for i, j, counts in cells:
        yield f"cell {i} {j} " + " ".join(str(int(c)) for c in counts)
    for key, value in numbers.items():
        if value.std() == 0.0:  # in no draw the highest
            yield f"posterior {key} | {value.mean():.6g} 0" + " 0" * 8
            continue
        out = [value.mean(), arviz.mcse(value, method="mean"), value.std(ddof=1), arviz.mcse(value, method="sd")]
        for q in (0.025, 0.5, 0.975):
            out += [numpy.quantile(value, q), arviz.mcse(value, method="quantile", prob=q)]
        assert float(arviz.rhat(value)) < 1.01, (name, key)
        yield f"posterior {key} | " + " ".join(f"{float(v):.6g}" for v in out)


if __name__ == "__main__":
    for name in sys.argv[1:] or SETS:
        with open(f"ordinal_{name}.txt", "w") as file:
            file.write("".join(line.rstrip() + "\n" for line in lines(name)))
        print(name)
