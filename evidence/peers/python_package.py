#!/usr/bin/env python3
"""Compares the installed Python package with SciPy, rustcpd and pycpd in one run.

    evidence/peers/python_package.py     # where tactile_imaging, scipy, pycpd 2 and rustcpd 4 are installed

Each package solves a problem in turn, in several rounds with one thread, and its shortest time counts. Missing packages are left
out.
"""

import importlib
import os
import time

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


def race(title, programs, rounds=5):
    """Shortest time of each package in seconds, and the ratio to the first."""
    best = dict.fromkeys(programs, np.inf)
    for _ in range(rounds):
        for name, program in programs.items():
            start = time.perf_counter()
            program()
            best[name] = min(best[name], time.perf_counter() - start)
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


def matches(random, pycpd, rustcpd):
    model = random.uniform(-1, 1, (500, 2))
    bent = model + 0.1 * np.sin(3 * model[:, ::-1])
    target = bent[random.permutation(500)]
    programs = {"ours": lambda: ti.match_points(model, target)}
    if pycpd:
        programs["pycpd"] = lambda: pycpd.DeformableRegistration(X=target, Y=model).register()
    if rustcpd:
        programs["rustcpd"] = lambda: rustcpd.register_deformable(model, target, parallel=False)
    race("match of 500 points", programs, rounds=3)


def strains(random):
    for axes, name in ((2, "plane"), (3, "space")):
        before = random.uniform(-1, 1, (5000, axes))
        after = (before * (1 + 0.02 * np.arange(1, axes + 1)))[random.permutation(5000)]
        race(f"strain of 5,000 points, {name}", {"ours": lambda: ti.strain_between(before, after)}, rounds=3)


def main():
    random = np.random.default_rng(0)
    splines(random, package("scipy.interpolate"))
    matches(random, package("pycpd"), package("rustcpd"))
    strains(random)
    identity = type("Rows", (), {"match_points": lambda self, model, target: np.arange(len(model))})()
    points = random.uniform(-1, 1, (5000, 2))
    moved = points + 0.01 * np.sin(3 * points[:, ::-1])
    race("own matcher of 5,000 points", {"ours": lambda: ti.match_points(points, moved, identity)}, rounds=3)
    race("nearest neighbours of 5,000", {"ours": lambda: ti.match_points(points, points + 1e-3, "nearest-neighbour")}, rounds=3)


if __name__ == "__main__":
    main()
