"""Fixtures and data shared by the tests."""

from pathlib import Path

import numpy as np
import pytest
import tactile_imaging as ti

DATA = Path(__file__).parents[2] / "examples" / "data"


def points(n, d=2, seed=0):
    """Random points in a square or a cube of side two."""
    return np.random.default_rng(seed).uniform(-1, 1, (n, d))


def lattice(n, seed=0):
    """n × n points, displaced from a lattice by a tenth of its step."""
    places = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=-1).reshape(-1, 2)
    return places + 0.1 * points(n * n, seed=seed)


@pytest.fixture(scope="session")
def scene():
    """The default press with a pixel of 172 µm."""
    return ti.simulate(coarser=8)
