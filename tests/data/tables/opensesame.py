"""Makes opensesame-1.csv and opensesame-2.csv: what the logger of OpenSesame 4 saves of an experiment with ratings and a
two-interval forced choice. A script within the experiment answers, in the place of a keyboard.

    pip install --no-deps opensesame-core==4.1.22
    pip install pygame-ce pyyaml webcolors python-pseudorandom python-fileinspector markdown pillow
    SDL_VIDEODRIVER=dummy SDL_AUDIODRIVER=dummy python3 opensesame.py
"""

import random

from libopensesame.experiment import Experiment

TEXTURES = ["soft", "medium", "crisp", "sharp"]
LEVELS = [0.5, 1, 2, 4, 8]


def cycles(rows):
    lines = [f"\tset cycles {len(rows)}", "\tset repeat 1", "\tset order random"]
    for i, row in enumerate(rows):
        lines += [f"\tsetcycle {i} {name} \"{value}\"" for name, value in row.items()]
    return "\n".join(lines)


SCRIPT = f"""---
API: 3
OpenSesame: 4.1.22
Platform: posix
---
set width 320
set height 240
set title "Textures"
set start experiment
set canvas_backend legacy
set clock_backend legacy
set keyboard_backend legacy
set mouse_backend legacy
set sampler_backend legacy
set color_backend legacy
set log_backend csv
set coordinates uniform
set fullscreen no

define sequence experiment
	run rating_loop always
	run choice_loop always

define loop rating_loop
{cycles([{"task": "rating", "texture": t, "repetition": r} for r in (1, 2) for t in TEXTURES])}
	run rating_trial

define sequence rating_trial
	run answer_rating always
	run logger always

define loop choice_loop
{cycles([{"task": "2afc", "level": level, "correct_response": key} for level in LEVELS for key in "zm" * 4])}
	run choice_trial

define sequence choice_trial
	run answer_choice always
	run logger always

define inline_script answer_rating
	___run__
	import random
	quality = dict(soft=2, medium=3, crisp=5, sharp=6)
	given = quality[var.texture] + random.choice([-1, 0, 0, 1])
	responses.add(response=given, response_time=random.randint(500, 2000), item='rating')
	__end__

define inline_script answer_choice
	___run__
	import math
	import random
	right = var.correct_response
	wrong = 'm' if right == 'z' else 'z'
	knows = random.random() < 1 - math.exp(-(var.level / 2.5) ** 2)
	given = right if knows or random.random() < 0.5 else wrong
	responses.add(
		response=given, correct=given == right, response_time=random.randint(400, 1500), item='choice')
	__end__

define logger logger
	set auto_log yes
"""

for subject in (1, 2):
    random.seed(subject)
    experiment = Experiment(
        string=SCRIPT, logfile=f"opensesame-{subject}.csv", subject_nr=subject, experiment_path=".", fullscreen=False
    )
    experiment.run()
    experiment.end()
