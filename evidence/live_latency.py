#!/usr/bin/env python3
"""Delay between the last byte of a frame and its numbers on the live page, and throughput of a stream.

    live_latency.py PROGRAM [--frames 1600] [--rate 80] [--viewers 1]

Pipes frames of a contact, 1392 x 1040 with the noise of a camera, to `PROGRAM stream SCENE - --serve` at a fixed rate and reads
the events as a browser does. Prints the centiles of the delay, the frames per second that the program accepted, and its peak
memory. With `--rate 100000 --viewers 0` the program sets the rate. Standard library only. The sender and the viewers share the
computer with the program, so that real figures are better.
"""
import argparse
import json
import math
import os
import pathlib
import random
import re
import resource
import socket
import subprocess
import tempfile
import threading
import time

COLUMNS, ROWS = 1392, 1040
SCENE = """reference = "reference.pgm"
pixel_size_m = [5e-6, 5e-6]
frames = [{ image = "light.pgm" }, { image = "heavy.pgm" }]
calibration = { pairs = "pairs.csv" }
object = { shape = "sphere", radius_m = 3e-3, poisson_ratio = 0.5 }
[waveguide]
layers = [{ refractive_index = 1.4, thickness_m = 10e-3, youngs_modulus_pa = 1e5, poisson_ratio = 0.5 }]
"""
NEWTONS_PER_LEVEL = 2e-9


def picture(peak, radius, noise):
    """A ball's pressure of `peak` grey levels on a background of 10, with one or two levels of noise."""
    rows = []
    for row in range(ROWS):
        high = [(column - COLUMNS / 2) ** 2 + (row - ROWS / 2) ** 2 for column in range(COLUMNS)]
        level = [10 + peak * math.sqrt(max(0.0, 1 - d / radius**2)) for d in high]
        rows.append(bytes(round(v) + (n & 3) for v, n in zip(level, noise.randbytes(COLUMNS))))
    return b"".join(rows)


def view(address, arrivals):
    """Notes when the event of each frame is complete."""
    with socket.create_connection(address) as connection:
        connection.sendall(b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n")
        pending = b""
        while received := connection.recv(1 << 20):
            now = time.perf_counter()
            *events, pending = (pending + received).split(b"\n\n")
            for event in events:
                number = re.search(rb'"frame":(\d+)', event)
                if number:
                    arrivals.setdefault(int(number[1]), now)


def send(pipe, frames, count, rate):
    """Writes the frames at their rate and returns when each was complete."""
    complete = {}
    pipe.write(b"YUV4MPEG2 W%d H%d F%d:1 Ip A1:1 Cmono\n" % (COLUMNS, ROWS, rate))
    start = time.perf_counter()
    for k in range(count):
        time.sleep(max(0.0, start + k / rate - time.perf_counter()))
        pipe.write(b"FRAME\n" + frames[k // 40 % 2][5 * k % 7])
        pipe.flush()
        complete[k + 1] = time.perf_counter()
    pipe.close()
    return complete


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("program")
    parser.add_argument("--frames", type=int, default=1600)
    parser.add_argument("--rate", type=int, default=80)
    parser.add_argument("--viewers", type=int, default=1)
    arguments = parser.parse_args()
    noise = random.Random(1)
    frames = [[picture(*contact, noise) for _ in range(7)] for contact in [(90, 139), (115, 175)]]
    named = {"reference": picture(0, 1, noise), "light": frames[0][0], "heavy": frames[1][0]}
    with tempfile.TemporaryDirectory() as folder:
        home = pathlib.Path(folder)
        (home / "scene.toml").write_text(SCENE)
        pairs = [f"{levels},{NEWTONS_PER_LEVEL * levels}" for levels in range(0, 10_000_001, 2_500_000)]
        (home / "pairs.csv").write_text("integrated_pixel_value,force_N\n" + "\n".join(pairs) + "\n")
        for name, levels in named.items():
            (home / f"{name}.pgm").write_bytes(b"P5\n%d %d\n255\n" % (COLUMNS, ROWS) + levels)
        call = ["stream", str(home / "scene.toml"), "-", "--allowed-late", "100", "--serve", "127.0.0.1:0"]
        program = subprocess.Popen([os.path.abspath(arguments.program), *call], stdin=subprocess.PIPE,
                                   stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, bufsize=-1)
        line = program.stderr.readline().decode()
        address = re.search(r"http://([\d.]+):(\d+)", line)
        if not address:
            raise SystemExit(line)
        threading.Thread(target=program.stderr.read, daemon=True).start()
        arrivals = [{} for _ in range(arguments.viewers)]
        place = (address[1], int(address[2]))
        viewers = [threading.Thread(target=view, args=(place, seen)) for seen in arrivals]
        for viewer in viewers:
            viewer.start()
        time.sleep(0.3)
        complete = send(program.stdin, frames, arguments.frames, arguments.rate)
        for viewer in viewers:
            viewer.join()
        program.wait()
    delays = sorted(1e3 * (seen[k] - complete[k]) for seen in arrivals for k in seen) or [math.nan]
    centiles = {f"{share:g} %": round(delays[int(share / 100 * (len(delays) - 1))], 2) for share in (50, 95, 99, 100)}
    seconds = complete[arguments.frames] - complete[1]
    found = {"events": sum(map(len, arrivals)), "milliseconds": centiles, "frames_per_second": round((arguments.frames - 1) / seconds)}
    print(json.dumps(found | {"megabytes": round(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024)}))


if __name__ == "__main__":
    main()
