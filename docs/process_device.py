"""A controller for `study run --device process --command "python3 docs/process_device.py"`.

It moves a simulated handle back and forth; put your motor there. docs/devices.md
has the language. Standard library only.
"""
import json, math, os, select, sys, time

def say(word, **more):
    print(json.dumps({"say": word, **more}), flush=True)

def force_n(table, x, v):  # nearest node; a real controller interpolates, at 4 kHz
    node = min(range(len(table["x_mm"])), key=lambda i: abs(table["x_mm"][i] - x))
    branch = table["positive" if v >= 0 else "negative"]
    return branch["b_n_s_per_mm"][node] * v + branch["k_n_per_mm"][node] * x + branch["f0_n"][node]

say("hello", format="study-process/1", id="example-1", telemetry=True, simulated=True,
    limits={"force_n": 12.0, "velocity_mm_s": 500.0})
task, playing, alive, told, pending = None, None, time.monotonic(), 0.0, b""
while True:
    if select.select([0], [], [], 0.002)[0]:
        read = os.read(0, 65536)
        if not read:
            sys.exit()  # the host has gone: zero force, and out
        *lines, pending = (pending + read).split(b"\n")
        for words in map(json.loads, lines):
            alive = time.monotonic()
            if words["do"] == "load" and words["table"] is None:
                say("refused", load=words["load"], why="no table")
            elif words["do"] == "load":
                task = words
                say("loaded", load=words["load"])
            elif words["do"] == "start":
                playing, told = time.monotonic(), 0.0
                say("started", load=words["load"])
            elif words["do"] == "stop" and playing:
                lasted = time.monotonic() - playing
                playing = None
                say("stopped", load=words["load"], duration_s=lasted, strokes=int(2 * lasted),
                    least_energy_j=0.0, switches_per_s=0.0, clamps=0)
            elif words["do"] == "limp":
                playing = None
    if playing and time.monotonic() - alive > 0.5:
        playing = None
        say("fault", what="nothing heard of the host for 0.5 s")
    if playing and time.monotonic() - playing - told > 0.01:
        told = time.monotonic() - playing
        low, high = task["table"]["trained"]["x_mm"]
        middle, half = (low + high) / 2, 0.45 * (high - low)
        turn = 2 * math.pi  # one hertz
        x, v = middle - half * math.cos(turn * told), turn * half * math.sin(turn * told)
        limit = task["limits"]["force_n"]
        force = max(-limit, min(limit, force_n(task["table"], x, v)))
        say("samples", load=task["load"], samples=[[told, x, v, force, None]])
        say("progress", load=task["load"], strokes=int(2 * told), clamps=0)
