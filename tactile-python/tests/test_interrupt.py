"""Ctrl-C stops every long computation."""

import signal
import subprocess
import sys
import time

import pytest

START = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
import numpy as np
import tactile_imaging as ti
points = lambda n, seed=0: np.random.default_rng(seed).uniform(-1, 1, (n, 2))
"""

# Without an interrupt each takes a minute or more.
LONG = {
    "default": ("", "ti.match_points(points(3000), points(3000, 1))"),
    "labelling": ("", "ti.match_points(points(400), points(400, 1), 'relaxation-labelling')"),
    "drift": ("", "ti.match_points(points(8000), points(8000, 1), 'coherent-point-drift', max_iterations=10_000, tolerance=0.0)"),
    "strain": ("", "ti.strain_between(points(300_000), points(300_000) + 0.1 * points(300_000, 1), paired=True)"),
    "assignment": ("", "ti.match_points(points(6000), points(6000, 1), 'linear-assignment')"),
    "moved": ("found = ti.match_points(points(3000), points(3000) + 1e-4, 'nearest-neighbour')", "found.transform(points(3_000_000))"),
    "cross-validation": ("", "ti.ThinPlateSpline(points(3000), points(3000, 1), smoothing='gcv')"),
    "spline": ("", "ti.ThinPlateSpline(points(200_000), points(200_000, 1))"),
    "values": ("spline = ti.ThinPlateSpline(points(1000), points(1000))", "spline(points(10_000_000))"),
    "own": (
        "class Rows:\n    def match_points(self, model, target):\n        while True:\n            np.arange(len(model))\n",
        "ti.match_points(points(100), points(100), Rows())",
    ),
}


@pytest.mark.parametrize("name", LONG)
def test_an_interrupt_ends_it(name):
    before, call = LONG[name]
    code = f"{START}{before}\nprint('ready', flush=True)\n{call}"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        assert process.stdout.readline() == "ready\n"
        time.sleep(1.0)
        assert process.poll() is None
        process.send_signal(signal.SIGINT)
        errors = process.communicate(timeout=60)[1]
    finally:
        process.kill()
    assert errors.rstrip().endswith("KeyboardInterrupt")
