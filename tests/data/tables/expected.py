"""Makes expected/*.csv: what `study import table` has to make of the files in this folder, by Python's own readers.

    python3 expected.py
"""

import csv
import glob
import json
import os


def rows(pattern):
    for path in sorted(glob.glob(pattern)):
        with open(path, newline="", encoding="utf-8-sig") as file:
            yield path, list(csv.DictReader(file))


def write(name, columns, lines):
    os.makedirs("expected", exist_ok=True)
    with open(f"expected/{name}.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(lines)


def numbered(lines):
    """Ratings with the number of the trial of each participant."""
    counts = {}
    for subject, model, rating in lines:
        counts[subject] = counts.get(subject, 0) + 1
        yield subject, model, rating, counts[subject]


RATINGS = ["subject", "model", "rating", "trial_index"]
TRIALS = ["participant", "level", "correct"]

jspsych = [trial for _, trials in rows("jspsych-*.csv") for trial in trials]
write("jspsych-ratings", RATINGS, numbered(
    (t["subject"], t["texture"], t["response"]) for t in jspsych if t["task"] == "rating"))
write("jspsych-trials", TRIALS, [(t["subject"], t["level"], t["correct"]) for t in jspsych if t["task"] == "2afc"])
with open("jspsych-P03.json") as file:
    trials = [t for t in json.load(file) if t["task"] == "rating"]
write("jspsych-json", RATINGS, numbered((t["subject"], t["texture"], t["response"]) for t in trials))

psychopy = [trial for _, trials in rows("psychopy-*.csv") for trial in trials]
write("psychopy-ratings", RATINGS, numbered(
    (t["participant"], t["texture"], t["slider.response"]) for t in psychopy if t["texture"]))
write("psychopy-trials", TRIALS, [(t["participant"], t["level"], t["key_resp.corr"]) for t in psychopy if t["key_resp.corr"]])

opensesame = [trial for _, trials in rows("opensesame-*.csv") for trial in trials]
write("opensesame-ratings", RATINGS, numbered(
    (t["subject_nr"], t["texture"], t["response"]) for t in opensesame if t["task"] == "rating"))
write("opensesame-trials", TRIALS, [(t["subject_nr"], t["level"], t["correct"]) for t in opensesame if t["task"] == "2afc"])

with open("wide.csv", newline="", encoding="utf-8-sig") as file:
    wide = list(csv.DictReader(file, delimiter=";"))
lines = [
    (row["participant"], *name.rsplit("_", 1), cell)
    for row in wide for name, cell in row.items() if name != "participant" and cell
]
write("wide", ["subject", "model", "rating", "repetition"], [
    (subject, model, cell.replace(",", "."), repetition) for subject, model, repetition, cell in lines])
