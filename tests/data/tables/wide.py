"""Makes wide.csv: the ratings of jspsych-P01.csv to jspsych-P03.csv as a spreadsheet in many countries writes them, with a
row for each participant, semicolons and decimal commas.

    python3 wide.py
"""

import csv

rows = []
for name in ("P01", "P02", "P03"):
    with open(f"jspsych-{name}.csv", newline="") as file:
        trials = [trial for trial in csv.DictReader(file) if trial["task"] == "rating"]
    row = {"participant": name}
    for trial in sorted(trials, key=lambda trial: (trial["texture"], trial["repetition"])):
        row[f"{trial['texture']}_{trial['repetition']}"] = f"{float(trial['response']):.1f}".replace(".", ",")
    rows.append(row)
# P03 was not asked about one of them.
rows[-1]["sharp_2"] = ""
with open("wide.csv", "w", newline="", encoding="utf-8-sig") as file:
    writer = csv.DictWriter(file, rows[0].keys(), delimiter=";")
    writer.writeheader()
    writer.writerows(rows)
