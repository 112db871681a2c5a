"""An example controller for `study run --device process --command "python3 docs/process_device.py"`. It simulates a
moving handle. clients/python is a package that does all this for the motor of a laboratory; docs/devices.md describes
the messages."""
import json, math, os, signal, sys, time

def say(message, **fields):
    os.write(1, (json.dumps({"say": message, **fields}) + "\n").encode())

def force_n(table, x, v):  # at the nearest node; a real controller interpolates, at 1 kHz or more
    node = min(range(len(table["x_mm"])), key=lambda i: abs(table["x_mm"][i] - x))
    branch = table["positive" if v >= 0 else "negative"]
    return branch["b_n_s_per_mm"][node] * v + branch["k_n_per_mm"][node] * x + branch["f0_n"][node]

def sample(t):  # one cycle per second within the trained range
    low, high = table["trained"]["x_mm"]
    half, w = 0.45 * (high - low), 2 * math.pi
    x, v = (low + high) / 2 - half * math.cos(w * t), w * half * math.sin(w * t)
    force = force_n(table, x, v) * (0.5 - 0.5 * math.cos(math.pi * min(t / 0.4, 1)))  # it rises for 0.4 s
    return [t, x, v, max(-limit_n, min(limit_n, force)) if since else 0.0, None]

def without_alive(*_):  # the host does not answer: zero force until the next load
    global since, table
    since = table = None
    say("fault", what="no alive")

signal.signal(signal.SIGALRM, without_alive)
say("hello", format="study-process/2", id="example-1", version="2", telemetry=True, simulated=True,
    limits={"force_n": 12.0, "velocity_mm_s": 500.0}, watchdog_ms=500)  # `servo` would tell its constants
table, limit_n, since, load = None, 0.0, None, 0  # the loaded table, and the start of the playback
for line in sys.stdin:
    command, now = json.loads(line), time.monotonic()
    do, load = command["do"], command["load"]
    if do == "load" and command["table"] is None:
        say("refused", load=load, why="no table")
    elif do == "load":
        table, limit_n, since = command["table"], command["limits"]["force_n"], None
        say("loaded", load=load)
    elif do == "start" and table:
        since = now
        say("started", load=load)
        say("samples", load=load, samples=[sample(0.0)])
    elif do == "stop" and since:
        say("outcome", load=load, duration_s=now - since, strokes=int(2 * (now - since)),
            least_energy_j=0.0, switches_per_s=0.0, clamps=0)
        since = table = None  # zero force
    elif do == "free":
        t, since = now - (since or now), None  # zero force
        say("free", load=load, sample=sample(t) if table else [t, 0.0, 0.0, 0.0, None])
        table = None
    elif do == "alive" and since:
        say("samples", load=load, samples=[sample(now - since)])
        say("progress", load=load, strokes=int(2 * (now - since)), clamps=0)
    signal.setitimer(signal.ITIMER_REAL, 0.5 if since else 0)  # without `alive` comes SIGALRM
say("free", load=load, sample=[0.0, 0.0, 0.0, 0.0, None])  # the input ends with the host, and the force with it
