#!/usr/bin/env python3
"""Compares the installed Python package with SciPy, rustcpd, pycpd and its own program in one run.

    evidence/peers/python_package.py     # where tactile_imaging, scipy, pycpd 2 and rustcpd 4 are installed

Each package solves a problem in turn, in several rounds with one thread, and its shortest time counts. Missing packages are left
out.
"""

import importlib
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("RAYON_NUM_THREADS", "1")

import numpy as np
import tactile_imaging as ti


def package(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        print(f"{name} is not installed")
        return None


def program(*arguments, calls=20):
    """Processor seconds of the program in the wheel for one repetition of its work."""

    def seconds(repeat):
        command = [sys.executable, "-m", "tactile_imaging", *map(str, arguments), "--repeat", str(repeat)]
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        subprocess.run(command, capture_output=True, check=True)
        return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before

    return (seconds(calls + 1) - seconds(1)) / calls


def race(title, programs, rounds=5):
    """Shortest processor time of each package, which other processes hardly change, and the ratio to the first. A package may
    return its own time."""
    best = dict.fromkeys(programs, np.inf)
    for _ in range(rounds):
        for name, call in programs.items():
            start = time.process_time()
            seconds = call()
            seconds = seconds if isinstance(seconds, float) else time.process_time() - start
            best[name] = min(best[name], seconds)
    first = next(iter(best.values()))
    print(f"{title:34}", "   ".join(f"{name} {1e3 * seconds:.1f} ms ({seconds / first:.2f})" for name, seconds in best.items()))


def splines(random, scipy):
    sites, values, queries = random.uniform(-1, 1, (1000, 3)), random.normal(size=1000), random.uniform(-1, 1, (10_000, 3))
    ours = ti.ThinPlateSpline(sites, values)
    fits, evaluations = {"ours": lambda: ti.ThinPlateSpline(sites, values)}, {"ours": lambda: ours(queries)}
    if scipy:
        theirs = scipy.RBFInterpolator(sites, values)
        print("splines differ by", np.abs(theirs(queries) - ours(queries)).max())
        fits["SciPy"] = lambda: scipy.RBFInterpolator(sites, values)
        evaluations["SciPy"] = lambda: theirs(queries)
    race("spline of 1,000 sites in space", fits)
    race("its values at 10,000 places", evaluations)
    with tempfile.TemporaryDirectory() as folder:
        files = [table(Path(folder) / name, points) for name, points in (("a.csv", sites), ("b.csv", 1.1 * sites + 0.1 * sites[:, ::-1] ** 2), ("c.csv", sites[:9]))]
        moved = np.loadtxt(files[1], delimiter=",", skiprows=1)
        race("map of 1,000 points in space", {"ours": lambda: ti.ThinPlateSpline(sites, moved), "tactile": lambda: program("warp", *files)}, rounds=3)


def table(path, points):
    np.savetxt(path, points, delimiter=",", fmt="%.17g", comments="", header=",".join("xyz"[: points.shape[1]]))
    return path


def matches(random, pycpd, rustcpd):
    model = random.uniform(-1, 1, (500, 2))
    bent = model + 0.1 * np.sin(3 * model[:, ::-1])
    target = bent[random.permutation(500)]
    programs = {"ours": lambda: ti.match_points(model, target)}
    if pycpd:
        programs["pycpd"] = lambda: pycpd.DeformableRegistration(X=target, Y=model).register()
    if rustcpd:
        programs["rustcpd"] = lambda: rustcpd.register_deformable(model, target, parallel=False)
    with tempfile.TemporaryDirectory() as folder:
        files = [table(Path(folder) / name, points) for name, points in (("a.csv", model), ("b.csv", target))]
        programs["tactile"] = lambda: program("match", *files)
        race("match of 500 points", programs, rounds=3)


def strains(random):
    for axes, name in ((2, "plane"), (3, "space")):
        before = random.uniform(-1, 1, (5000, axes))
        after = (before * (1 + 0.02 * np.arange(1, axes + 1)))[random.permutation(5000)]
        race(f"strain of 5,000 points, {name}", {"ours": lambda: ti.strain_between(before, after)}, rounds=3)


def gels(random):
    """A gel of 320 × 240 pixels under a ball, lit from three sides."""
    rows, columns = np.mgrid[:240, :320]

    def lit(x, y, radius, ball=60.0):
        inside = np.maximum(radius**2 - (columns - x) ** 2 - (rows - y) ** 2, 0)
        q, p = np.gradient(np.sqrt(inside + ball**2 - radius**2))
        sides = 2 * np.pi * (np.arange(3) / 3 + 0.1)
        shade = 0.82 * (p[..., None] * np.cos(sides) + q[..., None] * np.sin(sides)) + 0.57
        frame = 40 + 170 * np.maximum(shade, 0) / np.sqrt(1 + p**2 + q**2)[..., None] + random.normal(0, 1, (240, 320, 3))
        return np.clip(np.round(frame), 0, 255).astype(np.uint8)

    still = lit(0, 0, 0)
    places = random.uniform([60, 60, 18], [260, 180, 28], (10, 3))
    circles = [tuple(place) for place in places]
    sensor = ti.GelSensor.calibrate(still, [lit(*place) for place in places], ball_radius=60 * 5e-5, pixel_size=5e-5, circles=circles)
    frames = [lit(160 + k, 120, 25) for k in range(10)]
    race("ten frames of a gel, 320 × 240", {"ours": lambda: [sensor.read(frame) for frame in frames][:0]})


def main():
    random = np.random.default_rng(0)
    splines(random, package("scipy.interpolate"))
    matches(random, package("pycpd"), package("rustcpd"))
    strains(random)
    gels(random)
    identity = type("Rows", (), {"match_points": lambda self, model, target: np.arange(len(model))})()
    points = random.uniform(-1, 1, (5000, 2))
    moved = points + 0.01 * np.sin(3 * points[:, ::-1])
    race("own matcher of 5,000 points", {"ours": lambda: ti.match_points(points, moved, identity)}, rounds=3)
    race("nearest neighbours of 5,000", {"ours": lambda: ti.match_points(points, points + 1e-3, "nearest-neighbour")}, rounds=3)


if __name__ == "__main__":
    main()
