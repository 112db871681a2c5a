"""Two black boxes on the recordings of switch A, for the table in docs/estimators.md.

    python3 -m venv venv && venv/bin/pip install numpy scikit-learn
    venv/bin/python lab/compare_black_box.py tests/data/recordings/training_a.csv \
        tests/data/recordings/validation_a.csv

* narx: nonlinear autoregression with exogenous inputs, a multilayer perceptron (two layers of
  32 tanh units) of x, v, a now and earlier and of its own force earlier; trained one step
  ahead, validated in free run, so that it never sees the measured force.
* nfir: the same without its own force.
* reservoir: a recurrent net of 400 tanh units with random, fixed connections and a readout by
  ridge regression (echo state network); its leak, spectral radius and ridge are the best of
  a small grid on the last fifth of the training recording.

Everything runs at 250 Hz, because the recorded signals end at 30 Hz. Neither of them is passive, and
neither is meant to be rendered.
"""

import itertools
import sys

import numpy as np
import sklearn
from sklearn.exceptions import ConvergenceWarning
from sklearn.neural_network import MLPRegressor
import warnings

EVERY = 4  # 1 kHz to 250 Hz
LAGS = [1, 2, 4, 8, 16, 32, 64]  # in samples of 4 ms
OWN = [1, 2, 3, 4]
SETTLING = 125
NOISE_N = 0.3


def load(path):
    rows = [line for line in open(path) if not line.startswith("#")][1:]
    data = np.array([[float(v) for v in row.split(",")] for row in rows])[::EVERY]
    _, x, v, a, f = data.T
    return np.stack([x, v, a], axis=1), f


def vaf(force, predicted):
    error = (force - predicted)[SETTLING:]
    return 1 - error.var() / force[SETTLING:].var()


def lagged(inputs):
    columns = [inputs]
    for lag in LAGS:
        columns.append(np.vstack([np.repeat(inputs[:1], lag, axis=0), inputs[:-lag]])[:, :1])
    return np.hstack(columns)


def perceptron(own, training, validation):
    inputs, force = training
    features = lagged(inputs)
    if own:
        past = [np.concatenate([np.repeat(force[:1], lag), force[:-lag]]) for lag in OWN]
        # noise on its own force makes the free run stable
        noise = np.random.default_rng(2).normal(scale=NOISE_N, size=(len(force), len(OWN)))
        features = np.hstack([features, np.stack(past, axis=1) + noise])
    mean, scale = features.mean(0), features.std(0)
    level, unit = force.mean(), force.std()
    net = MLPRegressor(hidden_layer_sizes=(32, 32), activation="tanh", solver="adam", max_iter=300,
                       learning_rate_init=2e-3, alpha=1e-5, random_state=1)
    net.fit((features - mean) / scale, (force - level) / unit)
    inputs, force = validation
    features = lagged(inputs)
    if not own:
        return vaf(force, net.predict((features - mean) / scale) * unit + level)
    weights = list(zip(net.coefs_, net.intercepts_))
    history = [force[0]] * max(OWN)
    for row in features:
        now = np.concatenate([row, [history[-lag] for lag in OWN]])
        layer = (now - mean) / scale
        for w, b in weights[:-1]:
            layer = np.tanh(layer @ w + b)
        value = (layer @ weights[-1][0] + weights[-1][1])[0] * unit + level
        history.append(float(np.clip(value, level - 10 * unit, level + 10 * unit)))
    return vaf(force, np.array(history[max(OWN):]))


def states(inputs, leak, radius):
    random = np.random.default_rng(1)
    size = 400
    own = random.normal(size=(size, size)) * (random.random((size, size)) < 0.05)
    own *= radius / np.abs(np.linalg.eigvals(own)).max()
    into = random.uniform(-1, 1, size=(size, inputs.shape[1] + 1))
    state, out = np.zeros(size), []
    for row in inputs:
        state = (1 - leak) * state + leak * np.tanh(own @ state + into @ np.append(row, 1.0))
        out.append(np.concatenate([state, row, [1.0]]))
    return np.array(out)


def reservoir(training, validation):
    mean, scale = training[0].mean(0), training[0].std(0)
    inputs, force = (training[0] - mean) / scale * [2.0, 1.0, 1.0], training[1]
    others = (validation[0] - mean) / scale * [2.0, 1.0, 1.0]
    cut = len(force) * 4 // 5
    best = None
    for leak, radius in itertools.product([0.1, 0.3, 1.0], [0.3, 0.8]):
        s = states(inputs, leak, radius)
        for ridge in [1e-4, 1e-2, 1e0]:
            def fit(to):
                a = s[SETTLING:to]
                return np.linalg.solve(a.T @ a + ridge * len(a) * np.eye(a.shape[1]), a.T @ force[SETTLING:to])
            held = vaf(force[cut:], s[cut:] @ fit(cut))
            if best is None or held > best[0]:
                best = (held, leak, radius, fit(len(force)))
    _, leak, radius, readout = best
    print(f"reservoir: leak {leak}, radius {radius}, held out {best[0]:.5f}")
    return vaf(validation[1], states(others, leak, radius) @ readout)


if __name__ == "__main__":
    warnings.simplefilter("ignore", ConvergenceWarning)
    training, validation = load(sys.argv[1]), load(sys.argv[2])
    print("Python", sys.version.split()[0], "numpy", np.__version__, "scikit-learn", sklearn.__version__)
    print(f"nfir      {perceptron(False, training, validation):.5f}")
    print(f"narx      {perceptron(True, training, validation):.5f}")
    print(f"reservoir {reservoir(training, validation):.5f}")
