"""An independent simulation of studies of thresholds above several standards, for docs/power.md and docs/calibration.md.

Participants, staircases and the test are this file's own; only the function of each participant and condition is
fitted by the program, which reads a table of trials. Three standards with equal JNDs, or Weber fractions that differ:

    python3 docs/thresholds-check.py --study target/release/study --studies 2000 --file equal.csv
    python3 docs/thresholds-check.py --study target/release/study --studies 500 --conditions 2 --threshold 0.1 --ratio 1.4 --file weber.csv
    python3 docs/thresholds-check.py --file equal.csv --table

The file has a line for each study; what is there is not simulated again, and --shard 2/4 simulates every fourth
study. Needs numpy and scipy.
"""

import argparse
import csv
import json
import math
import os
import subprocess
import tempfile

import numpy as np
from scipy.special import ndtr
from scipy.stats import f as f_distribution

WIDTH = 3.289707253902944  # standard deviations of a normal from 5 to 95 %
LEVELS = np.round(np.arange(0.02, 1.4001, 0.02), 2)  # above the standard, as a linear family has them


def correct(args, level, threshold):
    """The share of correct answers; the threshold is where half of what can be felt is felt."""
    if args.observer == "normal":
        felt = ndtr((level - threshold) / (args.width * threshold) * WIDTH)
    elif args.observer == "weibull":
        felt = 1.0 - math.exp(-math.log(2.0) * (level / threshold) ** 2.5)
    else:  # d' in proportion to the level
        felt = 2.0 * ndtr(0.6744897501960817 * level / threshold) - 1.0
    return 0.5 + (0.5 - args.lapse) * felt


def staircase(args, threshold, random):
    """1 up, 3 down from 0.3 in equal steps of 0.08 and, after the first reversal, 0.04."""
    level, direction, run, reversals, answers = 0.3, 0, 0, 0, []
    for _ in range(args.trials):
        presented = LEVELS[np.argmin(np.abs(LEVELS - level))]
        right = random.random() < correct(args, presented, threshold)
        answers.append((presented, int(right)))
        step = 0
        if right:
            run += 1
            if run >= (3 if reversals else 1):
                step, run = -1, 0
        else:
            step, run = 1, 0
        if step:
            reversals += direction not in (0, step)
            direction = step
            level += step * (0.04 if reversals else 0.08)
            level = min(max(level, LEVELS[0]), LEVELS[-1])
    return answers


def study(args, number):
    """Thresholds of a study, as the program finds them, with their intervals and truths."""
    random = np.random.default_rng([args.seed, number])
    rows, truths = [], {}
    for participant in range(args.participants):
        own = args.participant * random.standard_normal()
        for condition in range(args.conditions):
            along = condition / max(args.conditions - 1, 1)
            other = own + args.interaction * random.standard_normal()
            threshold = args.threshold * args.ratio**along * math.exp(other)
            truths[f"P{participant}", f"c{condition}"] = threshold
            for level, right in staircase(args, threshold, random):
                rows.append((f"P{participant}", f"c{condition}", level, right))
    with tempfile.TemporaryDirectory() as folder:
        table = os.path.join(folder, "trials.csv")
        with open(table, "w", newline="") as out:
            writer = csv.writer(out)
            writer.writerow(("participant", "condition", "level", "correct"))
            writer.writerows(rows)
        ladder = f"{LEVELS[0]}..{LEVELS[-1]}:{(LEVELS[-1] / LEVELS[0]) ** (1 / 40):.17g}"
        command = [args.study, "analyze", table, "--task", "2ifc", "--fit-scale", "log", "--ladder", ladder, "--json"]
        found = subprocess.run(command, capture_output=True, check=True, text=True).stdout
    values = json.loads(found)["values"]
    def of(key, what):
        return values[f"psy/{key[0]}/{key[1]}/posterior/threshold/{what}"]

    return {key: (truth, of(key, "median"), of(key, "ci95_lo"), of(key, "ci95_hi")) for key, truth in truths.items()}


def decided(args, found):
    """p of the F test of conditions by participants, ratio of the last to the first, mean error, square, coverage."""
    logs = np.array(
        [[math.log(found[f"P{i}", f"c{c}"][1]) for c in range(args.conditions)] for i in range(args.participants)]
    )
    n, k = logs.shape
    rest = logs - logs.mean(axis=0) - logs.mean(axis=1, keepdims=True) + logs.mean()
    between = n * ((logs.mean(axis=0) - logs.mean()) ** 2).sum() / (k - 1)
    within = (rest**2).sum() / ((n - 1) * (k - 1))
    p = f_distribution.sf(between / within, k - 1, (n - 1) * (k - 1))
    errors = np.array([math.log(estimate / truth) for truth, estimate, _, _ in found.values()])
    holds = np.mean([low <= truth <= high for truth, _, low, high in found.values()])
    return p, logs[:, -1].mean() - logs[:, 0].mean(), errors.mean(), (errors**2).mean(), holds


def table(args):
    with open(args.file) as lines:
        rows = np.array([[float(x) for x in line.split(",")[1:]] for line in lines])
    n = len(rows)

    def mean(x):
        return f"{np.mean(x):.4f} ± {np.std(x, ddof=1) / math.sqrt(n):.4f}"

    rms = math.sqrt(rows[:, 3].mean())
    error = np.std(rows[:, 3], ddof=1) / math.sqrt(n) / (2 * rms)
    print(f"{n} studies; differ {mean(rows[:, 0] <= 0.05)}; ln ratio {mean(rows[:, 1])}; bias of ln {mean(rows[:, 2])};")
    print(f"RMS of ln {rms:.4f} ± {error:.4f}; 95 % intervals hold {mean(rows[:, 4])}")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--study", default="study")
    parser.add_argument("--file", default="thresholds.csv")
    parser.add_argument("--studies", type=int, default=100)
    parser.add_argument("--shard", default="1/1")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--participants", type=int, default=10)
    parser.add_argument("--conditions", type=int, default=3)
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--threshold", type=float, default=0.08)
    parser.add_argument("--ratio", type=float, default=1.0)
    parser.add_argument("--participant", type=float, default=0.3)
    parser.add_argument("--interaction", type=float, default=0.1)
    parser.add_argument("--lapse", type=float, default=0.02)
    parser.add_argument("--observer", choices=("normal", "weibull", "proportional"), default="proportional")
    parser.add_argument("--width", type=float, default=1.0, help="of a normal, in thresholds")
    parser.add_argument("--seed", type=int, default=2026)
    args = parser.parse_args()
    if not args.table:
        own, shards = (int(x) for x in args.shard.split("/"))
        there = set()
        if os.path.exists(args.file):
            with open(args.file) as lines:
                there = {int(line.split(",")[0]) for line in lines}
        for number in range(args.studies):
            if number % shards == own - 1 and number not in there:
                line = ",".join(f"{x:.9g}" for x in decided(args, study(args, number)))
                with open(args.file, "a") as out:
                    out.write(f"{number},{line}\n")
    table(args)


if __name__ == "__main__":
    main()
