#!/usr/bin/env python3
"""SciPy's own tests of `RBFInterpolator`, run on `tactile_imaging.ThinPlateSpline`.

    evidence/peers/scipy_splines.py      # where SciPy, pytest and tactile_imaging are installed

The tests are those of the installed SciPy. A test of a feature that `ThinPlateSpline` does not offer is skipped with the reason:
other kernels, polynomials of another degree, neighbours, smoothing by site. Errors are compared by type, not by their messages.
"""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
import tactile_imaging as ti
from scipy.interpolate.tests import test_rbfinterp as theirs


class Spline:
    """The supported part of `RBFInterpolator`."""

    def __init__(self, y, d, neighbors=None, smoothing=0.0, kernel="thin_plate_spline", epsilon=None, degree=None):
        offered = ["thin_plate_spline", "linear", "cubic"]
        if kernel not in [*offered, "test"]:
            pytest.skip(f"the kernel {kernel} is not offered")
        if degree not in (None, 1):
            pytest.skip(f"the degree {degree} is not offered")
        if np.ndim(smoothing):
            pytest.skip("smoothing by site is not offered")
        self.spline = ti.ThinPlateSpline(y, d, smoothing=smoothing, kernel=kernel)
        # If the points determine no affine part, SciPy raises an error and ours has a flag. SciPy's "linear" has no affine part.
        if self.spline.flags and kernel != "linear":
            raise np.linalg.LinAlgError(self.spline.flags[0])

    def __call__(self, x):
        return self.spline(x)


class Plugin:
    """Uses only NumPy, compares errors by type, and runs one class of the tests."""

    @pytest.fixture
    def xp(self):
        return np

    def pytest_configure(self, config):
        config.addinivalue_line("markers", "slow")
        config.addinivalue_line("markers", "skip_xp_backends")

    def pytest_collection_modifyitems(self, items):
        items[:] = [item for item in items if item.cls is theirs.TestRBFInterpolatorNeighborsNone]


def main():
    theirs.RBFInterpolator = Spline
    kinds = {name: getattr(pytest, name) for name in ("mark", "warns", "skip", "fixture", "param")}
    theirs.pytest = SimpleNamespace(raises=lambda kind, match=None: pytest.raises(kind), **kinds)
    return pytest.main(["-q", "-rs", "-p", "no:cacheprovider", theirs.__file__], plugins=[Plugin()])


if __name__ == "__main__":
    sys.exit(main())
