"""Reference values of the preference Gaussian process: numpy 2.4.6, scipy 1.17.1, and BoTorch where it is installed.

    python3 -m venv env && env/bin/pip install numpy scipy torch botorch
    env/bin/python preference_gp.py

simulates answers (fixed seeds) and writes preference_gp.txt: for each case the kernel, the points, the answers, and

* `posterior`: mean and standard deviation at each point, and `covariance` of some pairs: the mode of the utilities of
  all points, found by `scipy.optimize.minimize(method="trust-exact")` over whitened utilities, and the inverse of the
  Hessian there. The program searches among the differences of the answers instead and never inverts K;
* `evidence`: Laplace's approximation of the logarithm, from the same Hessian;
* `eubo`: the expected utility of the better of two points from those, then its mean over 10⁷ draws of the normal
  posterior and the standard error of that mean;
* `exact`, of cases with three points: mean and standard deviation by the trapezoidal rule over 161³ whitened
  utilities within ±8, and the logarithm of the evidence: what Laplace's method approximates;
* `botorch`: mean and standard deviation by `PairwiseGP` of BoTorch 0.18.1 with the same fixed kernel, in float64, with a
  jitter of 10⁻⁹ of the variance and a tolerance of 10⁻¹². BoTorch cuts (f_a − f_b)/√2 to ±3 where it computes derivatives,
  which moves means by up to 1 in two of the cases; that is switched off here.
"""

import sys

import numpy as np
from scipy.optimize import minimize
from scipy.special import erfc, log_ndtr

DRAWS = 10_000_000


def matern(points, sd, lengths):
    scaled = points / lengths
    r = np.sqrt(5.0 * ((scaled[:, None, :] - scaled[None, :, :]) ** 2).sum(-1))
    return sd**2 * (1.0 + r + r**2 / 3.0) * np.exp(-r)


def hazard(z):
    return np.exp(-0.5 * z * z - 0.5 * np.log(2 * np.pi) - log_ndtr(z))


def laplace(K, D):
    L = np.linalg.cholesky(K)
    A = D @ L / np.sqrt(2.0)

    def value(x):
        return 0.5 * x @ x - log_ndtr(A @ x).sum()

    def gradient(x):
        return x - A.T @ hazard(A @ x)

    def hessian(x):
        z = A @ x
        h = hazard(z)
        return np.eye(len(x)) + A.T @ ((h * (h + z))[:, None] * A)

    found = minimize(value, np.zeros(len(K)), jac=gradient, hess=hessian, method="trust-exact", options={"gtol": 1e-12})
    x = found.x
    for _ in range(3):  # to rounding
        x = x - np.linalg.solve(hessian(x), gradient(x))
    H = hessian(x)
    covariance = L @ np.linalg.solve(H, L.T)
    return L @ x, covariance, -value(x) - 0.5 * np.linalg.slogdet(H)[1]


def eubo(mean, covariance, a, b):
    spread = np.sqrt(covariance[a, a] + covariance[b, b] - 2 * covariance[a, b])
    t = (mean[a] - mean[b]) / spread
    Phi = 0.5 * erfc(-t / np.sqrt(2))
    return mean[a] * Phi + mean[b] * (1 - Phi) + spread * np.exp(-0.5 * t * t) / np.sqrt(2 * np.pi)


def drawn(mean, covariance, a, b, rng):
    pair = [a, b]
    L = np.linalg.cholesky(covariance[np.ix_(pair, pair)])
    z = rng.standard_normal((2, DRAWS))
    first = mean[a] + L[0, 0] * z[0]
    second = mean[b] + L[1, 0] * z[0] + L[1, 1] * z[1]
    best = np.maximum(first, second)
    return best.mean(), best.std(ddof=1) / np.sqrt(DRAWS)


def exact(K, D):
    grid = np.linspace(-8.0, 8.0, 161)
    step = grid[1] - grid[0]
    x = np.stack(np.meshgrid(grid, grid, grid, indexing="ij"), -1).reshape(-1, 3)
    L = np.linalg.cholesky(K)
    f = x @ L.T
    log = -0.5 * (x**2).sum(1) - 1.5 * np.log(2 * np.pi) + log_ndtr(f @ D.T / np.sqrt(2.0)).sum(1)
    weight = np.exp(log) * step**3
    total = weight.sum()
    weight /= total
    mean = weight @ f
    return mean, np.sqrt(weight @ (f - mean) ** 2), np.log(total)


def botorch(points, sd, lengths, answers):
    try:
        import torch
        from botorch.models import PairwiseGP
        from botorch.models.likelihoods.pairwise import PairwiseProbitLikelihood
        from gpytorch.kernels import MaternKernel, ScaleKernel
    except ImportError:
        return None
    torch.set_default_dtype(torch.float64)
    PairwiseProbitLikelihood._zlim = 1000.0
    kernel = ScaleKernel(MaternKernel(nu=2.5, ard_num_dims=points.shape[1]))
    kernel.outputscale = sd**2
    kernel.base_kernel.lengthscale = torch.tensor(lengths)
    x = torch.tensor(points)
    model = PairwiseGP(
        x, torch.tensor(answers), covar_module=kernel, jitter=1e-9 * sd**2, xtol=1e-12, maxfev=100_000
    )
    model.eval()
    with torch.no_grad():
        found = model.posterior(x)
    return found.mean.squeeze(-1).numpy(), found.variance.squeeze(-1).sqrt().numpy()


def cases():
    """Name, points, standard deviation, lengths, answers."""
    rng = np.random.default_rng(30)
    three = np.array([[0.0], [0.4], [1.0]])
    yield "three", three, 1.5, [0.5], [(1, 0), (1, 2), (2, 0), (1, 0)]
    yield "three_against", three, 2.0, [0.3], [(0, 1), (1, 0), (2, 1), (2, 1), (2, 0)]

    def square(n, d):
        return np.stack(np.meshgrid(*[np.linspace(0, 1, n)] * d, indexing="ij"), -1).reshape(-1, d)

    def simulated(points, peak, trials):
        utility = 4.0 * np.exp(-((points - peak) ** 2).sum(1) / (2 * 0.35**2))
        answers = []
        while len(answers) < trials:
            a, b = rng.integers(len(points), size=2)
            if a != b:
                first = utility[a] + rng.standard_normal() > utility[b] + rng.standard_normal()
                answers.append((int(a), int(b)) if first else (int(b), int(a)))
        return answers

    line = square(9, 1)
    yield "line", line, 2.0, [0.4], simulated(line, [0.7], 20)
    plane = square(5, 2)
    yield "plane", plane, 2.0, [0.4, 0.8], simulated(plane, [0.25, 0.75], 40)
    # The same pair again and again: the differences of the answers have a singular covariance.
    yield "repeated", plane, 4.0, [0.2, 0.2], [(7, 3)] * 12 + [(3, 7)] * 2 + [(7, 20)]
    # One point always loses: steep tails.
    yield "one_sided", line, 4.0, [0.8], [(8, i) for i in range(8)] * 12
    cube = square(4, 3)
    yield "cube", cube, 4.0, [0.49, 0.49, 0.245], simulated(cube, [0.3, 0.6, 0.9], 100)


def main():
    rng = np.random.default_rng(300)
    lines = []
    for name, points, sd, lengths, answers in cases():
        K = matern(points, sd, np.array(lengths))
        D = np.zeros((len(answers), len(points)))
        for i, (preferred, other) in enumerate(answers):
            D[i, preferred], D[i, other] = 1.0, -1.0
        mean, covariance, evidence = laplace(K, D)
        lines.append(f"case {name}")
        lines.append("kernel " + " ".join(repr(float(x)) for x in [sd, *lengths]))
        lines += ["point " + " ".join(repr(float(x)) for x in point) for point in points]
        lines.append("choices " + " ".join(f"{a}>{b}" for a, b in answers))
        lines.append(f"evidence {float(evidence)!r}")
        for i in range(len(points)):
            lines.append(f"posterior {i} {float(mean[i])!r} {float(np.sqrt(covariance[i, i]))!r}")
        last = len(points) - 1
        pairs = [(0, 1), (0, last), (last // 2, last)]
        for a, b in pairs:
            lines.append(f"covariance {a} {b} {float(covariance[a, b])!r}")
        for a, b in pairs:
            average, error = drawn(mean, covariance, a, b, rng)
            value = eubo(mean, covariance, a, b)
            lines.append(f"eubo {a} {b} {float(value)!r} {float(average)!r} {float(error)!r}")
        every = [(eubo(mean, covariance, a, b), a, b) for b in range(len(points)) for a in range(b)]
        most = max(every)[0]
        best = next((a, b) for value, a, b in every if value >= most - 1e-9 * max(abs(most), 1.0))
        lines.append(f"best {best[0]} {best[1]}")
        if len(points) == 3:
            exact_mean, exact_sd, log = exact(K, D)
            lines.append(f"exact_evidence {float(log)!r}")
            lines += [f"exact {i} {float(exact_mean[i])!r} {float(exact_sd[i])!r}" for i in range(3)]
        theirs = botorch(points, sd, lengths, answers)
        if theirs is None:
            print("SKIPPED: BoTorch is not installed", file=sys.stderr)
        else:
            lines += [f"botorch {i} {float(theirs[0][i])!r} {float(theirs[1][i])!r}" for i in range(len(points))]
    with open("preference_gp.txt", "w", encoding="utf-8") as file:
        file.write("\n".join(lines) + "\n")


main()
