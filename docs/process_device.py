"""An example controller for `study run --device process --command "python3 docs/process_device.py"`. It simulates a
moving handle; replace this by a separate loop for your motor. docs/devices.md describes the messages."""
import json, math, signal, sys, time

def say(message, **fields):
    print(json.dumps({"say": message, **fields}), flush=True)

def force_n(table, x, v):  # at the nearest node; a real controller interpolates, at 4 kHz
    node = min(range(len(table["x_mm"])), key=lambda i: abs(table["x_mm"][i] - x))
    branch = table["positive" if v >= 0 else "negative"]
    return branch["b_n_s_per_mm"][node] * v + branch["k_n_per_mm"][node] * x + branch["f0_n"][node]

say("hello", format="study-process/1", id="example-1", telemetry=True, simulated=True,
    limits={"force_n": 12.0, "velocity_mm_s": 500.0})
table, limit_n, since = None, 0.0, None  # the loaded table, and the start of the playback
for line in sys.stdin:  # the input ends with the host, and the force with the program
    command, now = json.loads(line), time.monotonic()
    do, load = command["do"], command["load"]
    if do == "load" and command["table"] is None:
        say("refused", load=load, why="no table")
    elif do == "load":
        table, limit_n = command["table"], command["limits"]["force_n"]
        say("loaded", load=load)
    elif do == "start":
        since = now
        say("started", load=load)
    elif do == "stop" and since:
        say("stopped", load=load, duration_s=now - since, strokes=int(2 * (now - since)),
            least_energy_j=0.0, switches_per_s=0.0, clamps=0)
    elif do == "alive" and since:  # one cycle per second within the trained range
        (low, high), t = table["trained"]["x_mm"], now - since
        half, w = 0.45 * (high - low), 2 * math.pi
        x, v = (low + high) / 2 - half * math.cos(w * t), w * half * math.sin(w * t)
        force = max(-limit_n, min(limit_n, force_n(table, x, v)))
        say("samples", load=load, samples=[[t, x, v, force, None]])
        say("progress", load=load, strokes=int(2 * t), clamps=0)
    if do in ("stop", "limp"):
        since = None  # zero force
    signal.setitimer(signal.ITIMER_REAL, 0.5 if since else 0)  # without `alive`, SIGALRM ends the program
