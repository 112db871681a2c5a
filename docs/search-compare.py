#!/usr/bin/env python3
"""The regret of searches by AEPsych and by BoTorch, for docs/search.md: the same perceivers, lattices and numbers of answers as
`cargo bench --bench search -- --regret`.

    cargo bench --bench search -- --perceivers 200 --file perceivers.csv
    python3 -m venv env && env/bin/pip install aepsych
    env/bin/python docs/search-compare.py --perceivers perceivers.csv --people 200 --file others.csv
    cat regret.csv others.csv > all.csv && cargo bench --bench search -- --table --file all.csv

A file has one line for each perceiver and method. What is there is not simulated again; --shard 2/4 simulates every fourth
perceiver, into a file of its own. Both programs search a continuous space; each point that they propose is moved to the nearest
point of the lattice, and where both of a pair come to the same point, the second one becomes a neighbor. The recommended point is
the point of the lattice with the largest posterior mean. AEPsych has the settings of its example of optimization by pairs
(configs/pairwise_opt_example.ini: qLogNoisyExpectedImprovement), with 8 pairs of Sobol first; BoTorch a PairwiseGP with its own
priors, and the expected utility of the best option. Without the packages a method is SKIPPED, and the exit code is 77.
"""

import argparse
import os
import sys

import numpy as np

AFTER = (20, 40, 60)
START = 8
METHODS = ("AEPsych", "BoTorch EUBO")


def axis(dimensions):
    """Coordinates of the lattice along each axis, as in the bench."""
    return np.linspace(0.0, 1.0, 9 if dimensions < 4 else 5)


def points(dimensions):
    return np.stack(np.meshgrid(*[axis(dimensions)] * dimensions, indexing="ij"), -1).reshape(-1, dimensions)


class Perceiver:
    """The utilities of all points, and answers with the noise of each impression."""

    def __init__(self, dimensions, utilities, seed):
        self.dimensions = dimensions
        self.points = points(dimensions)
        self.utilities = utilities
        self.random = np.random.default_rng(seed)

    def nearest(self, x):
        steps = len(axis(self.dimensions))
        at = np.clip(np.rint(np.asarray(x) * (steps - 1)), 0, steps - 1).astype(int)
        return int(np.ravel_multi_index(tuple(at), (steps,) * self.dimensions))

    def pair(self, first, second):
        """Two different points of the lattice, as near as can be to two proposed ones."""
        a, b = self.nearest(first), self.nearest(second)
        if a == b:
            apart = np.abs(self.points - self.points[a]).sum(1)
            neighbors = np.flatnonzero(np.isclose(apart, axis(self.dimensions)[1]))
            b = int(self.random.choice(neighbors))
        return a, b

    def prefers_second(self, a, b):
        felt = self.utilities[[a, b]] + self.random.standard_normal(2)
        return bool(felt[1] > felt[0])

    def regret(self, point):
        return float(self.utilities.max() - self.utilities[point])


def aepsych(perceiver, seed):
    import torch
    from aepsych.config import Config
    from aepsych.strategy import SequentialStrategy

    torch.manual_seed(seed)
    names = [f"par{k + 1}" for k in range(perceiver.dimensions)]
    parameters = "\n".join(f"[{name}]\npar_type = continuous\nlower_bound = 0\nupper_bound = 1" for name in names)
    text = f"""
[common]
parnames = [{", ".join(names)}]
stimuli_per_trial = 2
outcome_types = [binary]
strategy_names = [init_strategy, opt_strategy]
{parameters}
[init_strategy]
min_asks = {START}
generator = SobolGenerator
[SobolGenerator]
seed = {seed}
[opt_strategy]
min_asks = {AFTER[-1]}
refit_every = 5
generator = OptimizeAcqfGenerator
model = PairwiseProbitModel
[PairwiseProbitModel]
inducing_size = 100
mean_covar_factory = DefaultMeanCovarFactory
[OptimizeAcqfGenerator]
restarts = 10
samps = 1000
acqf = qLogNoisyExpectedImprovement
[qLogNoisyExpectedImprovement]
objective = ProbitObjective
"""
    strategy = SequentialStrategy.from_config(Config(config_str=text))
    grid = torch.tensor(perceiver.points)
    regrets = []
    for answered in range(1, AFTER[-1] + 1):
        proposed = strategy.gen().detach().numpy()[0]  # dimensions × 2
        a, b = perceiver.pair(proposed[:, 0], proposed[:, 1])
        asked = torch.tensor(np.stack([perceiver.points[a], perceiver.points[b]], -1)[None])
        strategy.add_data(asked, [int(perceiver.prefers_second(a, b))])
        if answered in AFTER:
            strategy.predict(grid)  # fits what is new
            mean, _ = strategy.model.predict(grid, rereference=None)
            regrets.append(perceiver.regret(int(mean.detach().numpy().argmax())))
    return regrets


def botorch(perceiver, seed):
    import torch
    from botorch.acquisition.preference import AnalyticExpectedUtilityOfBestOption
    from botorch.fit import fit_gpytorch_mll
    from botorch.models.pairwise_gp import PairwiseGP, PairwiseLaplaceMarginalLogLikelihood
    from botorch.optim import optimize_acqf

    torch.manual_seed(seed)
    grid = torch.tensor(perceiver.points, dtype=torch.double)
    bounds = torch.stack([torch.zeros(perceiver.dimensions), torch.ones(perceiver.dimensions)]).double()
    start = torch.quasirandom.SobolEngine(2 * perceiver.dimensions, scramble=True, seed=seed).draw(START).numpy()
    compared, regrets = [], []

    def fitted():
        # A row for each point that was felt.
        felt = sorted({point for pair in compared for point in pair})
        row = {point: i for i, point in enumerate(felt)}
        answers = torch.tensor([[row[better], row[worse]] for better, worse in compared])
        model = PairwiseGP(grid[felt], answers)
        fit_gpytorch_mll(PairwiseLaplaceMarginalLogLikelihood(model.likelihood, model))
        return model

    for answered in range(1, AFTER[-1] + 1):
        if answered <= START:
            drawn = start[answered - 1]
            first, second = drawn[: perceiver.dimensions], drawn[perceiver.dimensions :]
        else:
            acquire = AnalyticExpectedUtilityOfBestOption(pref_model=fitted())
            first, second = optimize_acqf(acquire, bounds, q=2, num_restarts=10, raw_samples=512)[0].numpy()
        a, b = perceiver.pair(first, second)
        compared.append((b, a) if perceiver.prefers_second(a, b) else (a, b))
        if answered in AFTER:
            with torch.no_grad():
                mean = fitted().posterior(grid).mean.squeeze(-1)
            regrets.append(perceiver.regret(int(mean.argmax())))
    return regrets


def missing(method):
    try:
        if method == "AEPsych":
            import aepsych  # noqa: F401
        else:
            import botorch  # noqa: F401
    except ImportError as why:
        return str(why)
    return None


def lines(file):
    """Name, number and results; a line that an interruption tore is not among them."""
    if not os.path.exists(file):
        return
    with open(file, encoding="utf-8") as text:
        for line in text:
            if line.endswith("\n"):
                name, number, *numbers = line.rstrip("\n").split(",")
                yield name, int(number), [float(x) for x in numbers]


def without_torn_line(file):
    if os.path.exists(file):
        with open(file, "rb+") as raw:
            raw.truncate(raw.read().rfind(b"\n") + 1)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--perceivers", required=True, help="a file of cargo bench --bench search -- --perceivers")
    parser.add_argument("--file", required=True)
    parser.add_argument("--people", type=int, default=200)
    parser.add_argument("--shard", default="1/1")
    parser.add_argument("--only", default="", help="such as '2 peaked' or 'AEPsych'")
    args = parser.parse_args()
    own, shards = (int(x) for x in args.shard.split("/"))
    run = {"AEPsych": aepsych, "BoTorch EUBO": botorch}
    skipped = {method: why for method in METHODS if (why := missing(method)) is not None}
    for method, why in skipped.items():
        print(f"SKIPPED: {method} was not compared: {why}", file=sys.stderr)
    without_torn_line(args.file)
    there = {(name, number) for name, number, _ in lines(args.file)}
    for world, number, utilities in lines(args.perceivers):
        if number >= args.people or number % shards != own - 1:
            continue
        _, dimensions, kind = world.split(" ", 2)
        for method in METHODS:
            name = f"regret {dimensions} {kind} {method}"
            if method in skipped or args.only not in name or (name, number) in there:
                continue
            perceiver = Perceiver(int(dimensions), np.array(utilities), [30, number, METHODS.index(method)])
            numbers = ",".join(f"{x:.6f}" for x in run[method](perceiver, number))
            with open(args.file, "a", encoding="utf-8") as out:
                out.write(f"{name},{number},{numbers}\n")
    return 77 if skipped else 0


if __name__ == "__main__":
    sys.exit(main())
