"""Power of ranking, adjustment and identification, by a program of its own (numpy, SciPy): python3 power_felt.py

Reference values of crates/study-analysis/src/power/felt/tests.rs. Studies are drawn here without the streams of the program, and decided by
SciPy's t tests and by all orders of the ranks.
"""

import itertools

import numpy as np
from scipy import stats

random = np.random.default_rng(2007)
STUDIES = 100_000


def ranking(slope, interaction, people):
    """Three realizations, ranked once: how often W is in the upper 5 % of all orders of the ranks."""
    orders = np.array(list(itertools.permutations([1, 2, 3])))
    # The sums of ranks of all relative orders, the first participant's being fixed.
    sums = np.array([[1, 2, 3]])
    for _ in range(people - 1):
        sums = (sums[:, None, :] + orders[None]).reshape(-1, 3)
    spread = ((sums - 2 * people) ** 2).sum(axis=1)
    x = np.array([-1, 0, 1]) * np.sqrt(1.5)
    own = slope * x + interaction * random.normal(size=(STUDIES, people, 3))
    felt = own + random.normal(size=own.shape)
    ranks = 1 + (felt[..., None, :] > felt[..., :, None]).sum(axis=-1)
    found = ((ranks.sum(axis=1) - 2 * people) ** 2).sum(axis=1)
    p = np.array([(spread >= s).mean() for s in range(spread.max() + 1)])
    return (p[found] <= 0.05).mean()


def adjustment(difference, participant, setting, people, settings):
    """t test over participants of the mean of so many settings: noncentral t."""
    sd = np.sqrt(participant**2 + setting**2 / settings)
    critical, shift = stats.t.ppf(0.975, people - 1), difference / sd * np.sqrt(people)
    return stats.nct.sf(critical, people - 1, shift) + stats.nct.cdf(-critical, people - 1, shift)


def identification(correct, participant, label, people, trials):
    """Four labels, each right equally often, so that guesses are right in a quarter."""
    logit = np.log(correct / (1 - correct))
    ease = logit + label * random.normal(size=(STUDIES, 1, 4))
    share = 1 / (1 + np.exp(-(ease + participant * random.normal(size=(STUDIES, people, 1)))))
    right = random.binomial(trials, share).sum(axis=-1) / (4 * trials)
    t = (right.mean(axis=1) - 0.25) / (right.std(axis=1, ddof=1) / np.sqrt(people))
    return (t >= stats.t.ppf(0.975, people - 1)).mean()


for slope in (0.0, 0.7):
    print("ranked-alike, slope", slope, ranking(slope, 0.5, 6))
for difference in (0.0, 0.1):
    print("adjusted by", difference, adjustment(difference, 0.1, 0.2, 10, 4))
print("identified, 0.35", identification(0.35, 0.5, 0.3, 8, 6))
