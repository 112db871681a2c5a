"""Makes psychopy-P01.csv to psychopy-P03.csv: what PsychoPy's ExperimentHandler saves of an experiment with ratings on a
slider and a two-interval forced choice by keys, with the columns that Builder gives them. A simulated observer answers.

    pip install --no-deps psychopy==2025.2.4 pandas packaging numpy   (and what `import psychopy.data` asks for)
    python3 psychopy_data.py
"""

import math
import random

from psychopy import data

TEXTURES = {"soft": 2, "medium": 3, "crisp": 5, "sharp": 6}
LEVELS = [0.5, 1, 2, 4, 8]

for participant in ("P01", "P02", "P03"):
    draw = random.Random(participant)
    experiment = data.ExperimentHandler(
        name="textures",
        extraInfo={"participant": participant, "session": "001", "date": "2024-05-17_10h12.30.123", "expName": "textures"},
        savePickle=False,
        saveWideText=True,
        dataFileName=f"psychopy-{participant}",
    )
    clock = 0.0
    # The instructions: a row without a loop.
    clock += draw.uniform(2, 5)
    experiment.addData("welcome.keys", "space")
    experiment.addData("welcome.rt", round(clock, 4))
    experiment.nextEntry()
    ratings = data.TrialHandler(
        nReps=2, method="random", seed=draw.randrange(10**6), name="ratings",
        trialList=[{"texture": texture} for texture in TEXTURES],
    )
    experiment.addLoop(ratings)
    for trial in ratings:
        seconds = draw.uniform(0.5, 2)
        rating = min(7, max(1, TEXTURES[trial["texture"]] + draw.choice([-1, 0, 0, 1])))
        ratings.addData("slider.response", float(rating))
        ratings.addData("slider.rt", round(seconds, 4))
        ratings.addData("slider.started", round(clock, 4))
        clock += seconds
        experiment.nextEntry()
    trials = data.TrialHandler(
        nReps=8, method="random", seed=draw.randrange(10**6), name="trials",
        trialList=[{"level": level} for level in LEVELS],
    )
    experiment.addLoop(trials)
    for trial in trials:
        right = draw.choice(["left", "right"])
        knows = draw.random() < 1 - math.exp(-((trial["level"] / 2.5) ** 2))
        given = right if knows or draw.random() < 0.5 else {"left": "right", "right": "left"}[right]
        trials.addData("corrAns", right)
        trials.addData("key_resp.keys", given)
        trials.addData("key_resp.corr", int(given == right))
        trials.addData("key_resp.rt", round(draw.uniform(0.4, 1.6), 4))
        experiment.nextEntry()
    experiment.close()
