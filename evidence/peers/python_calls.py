"""The cost of a call from Python, and matching compared with the rustcpd wheel, in one process.

    pip install ./tactile-python rustcpd==4.0.0
    python evidence/peers/python_calls.py

Times are processor times of the thread, the shortest of all rounds.
"""
import time
from itertools import cycle

import numpy as np
import packages
import problems
import tactile_imaging as ti


def least(call, rounds, calls=1):
    """Seconds of one call."""
    best = np.inf
    for _ in range(rounds):
        start = time.thread_time()
        for _ in range(calls):
            call()
        best = min(best, (time.thread_time() - start) / calls)
    return best


def sessions():
    """A tiny frame, for which the call itself takes all the time, and the full frames of `force_of_a_frame`, which
    `cargo bench --bench pipeline` times."""
    for coarser, rounds in ((64, 200), (1, 200)):
        scene = ti.simulate(coarser=coarser, physics="hertz")
        session = ti.Session(ti.pipeline_of(scene), [scene.reference])
        frames = cycle(scene.frames)
        seconds = least(lambda: session.push(next(frames)), rounds, 2000 // rounds)
        print(f"session, frame of {scene.reference.shape}: {seconds * 1e6:.1f} µs")


def small_calls():
    square = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
    spline = ti.ThinPlateSpline(square, square)
    match = lambda: ti.match_points(square, square, "nearest-neighbour")
    print(f"match_points of four points: {least(match, 50, 200) * 1e6:.1f} µs")
    print(f"spline at four points: {least(lambda: spline(square), 50, 200) * 1e6:.1f} µs")


def matches(seeds=3):
    draws = [(level, kind, seed) for level in problems.LEVELS for kind in problems.DEGRADATIONS for seed in range(seeds)]
    results = {"tactile_imaging": [], "rustcpd": []}
    for level, kind, seed in draws:
        case = problems.synthetic("plane105", level, kind, seed)
        found = ti.match_points(case.model, case.target)
        ms = 1e3 * least(lambda: ti.match_points(case.model, case.target), 5)
        results["tactile_imaging"].append((*case.score(found.warped, found.assignment), ms))
        setting = packages.SETTINGS["tuned"]
        model, target, back = normalised(case)
        warped = back(packages.rustcpd_exact(model, target, setting))
        nearest = np.linalg.norm(warped[:, None] - case.target[None], axis=2).argmin(axis=1)
        ms = 1e3 * least(lambda: packages.rustcpd_exact(model, target, setting), 5)
        results["rustcpd"].append((*case.score(warped, nearest), ms))
    for name, rows in results.items():
        error, right, ms = np.mean(rows, axis=0)
        print(f"105 × 105, {len(rows)} cases, {name}: error {error:.5f}, {right:.1%} right, {ms:.2f} ms")


def normalised(case):
    """Both sets scaled by the similarity that gives the model unit radius, and the inverse map."""
    centre = case.model.mean(axis=0)
    scale = np.sqrt(((case.model - centre) ** 2).sum(axis=1).mean())
    there = lambda points: (points - centre) / scale
    return there(case.model), there(case.target), lambda points: points * scale + centre


if __name__ == "__main__":
    small_calls()
    sessions()
    matches()
