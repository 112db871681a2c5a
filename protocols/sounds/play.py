"""Plays the tones of protocol.toml with `aplay` (ALSA): `study run protocols/sounds --command "python3
protocols/sounds/play.py"`. docs/devices.md describes the messages."""
import array, json, math, shutil, subprocess, sys, threading, time

RATE = 48_000

def say(message, **fields):
    print(json.dumps({"say": message, **fields}), flush=True)

def samples(frequency, seconds=3.0):
    fade, turn = RATE // 50, 2 * math.pi * frequency / RATE  # 20 ms, against a click
    level = lambda n: 6553 * min(1.0, n / fade)
    tone = array.array("h", (round(level(n) * math.sin(turn * n)) for n in range(int(RATE * seconds))))
    if sys.byteorder == "big":
        tone.byteswap()
    return tone.tobytes()

def feed(player, tone):
    try:
        player.stdin.write(tone)
    except BrokenPipeError:
        pass  # stopped

say("hello", format="study-process/1", id="aplay", telemetry=False, simulated=False,
    limits={"force_n": 12.0, "velocity_mm_s": 1000.0})  # it makes no force
tone, player, since = b"", None, 0.0
for line in sys.stdin:
    command = json.loads(line)
    do, load = command["do"], command["load"]
    if do == "load" and not shutil.which("aplay"):
        say("refused", load=load, why="aplay is not installed")
    elif do == "load":
        tone = samples(float(command["model"].removeprefix("tone-")))
        say("loaded", load=load)
    elif do == "start":
        player, since = subprocess.Popen(["aplay", "-q", "-f", "S16_LE", "-r", str(RATE)],
                                         stdin=subprocess.PIPE), time.monotonic()
        threading.Thread(target=feed, args=(player, tone), daemon=True).start()
        say("started", load=load)
    elif do in ("stop", "limp") and player:
        player.kill()
        player = None
        if do == "stop":
            say("stopped", load=load, duration_s=time.monotonic() - since, strokes=0,
                least_energy_j=0.0, switches_per_s=0.0, clamps=0)
