#!/usr/bin/env python3
"""SciPy's own tests of `RBFInterpolator`, run on `tactile_imaging.ThinPlateSpline`.

    evidence/peers/scipy_splines.py      # where SciPy, pytest and tactile_imaging are installed

The tests are those of the SciPy that is installed. One that asks for what `ThinPlateSpline` does not offer is skipped with
the reason: other kernels, polynomials of another degree, neighbours, smoothing by site. Errors are compared by kind, not by
their words.
"""

import sys
from types import SimpleNamespace

import numpy as np
import pytest
import tactile_imaging as ti
from scipy.interpolate.tests import test_rbfinterp as theirs


class Spline:
    """`RBFInterpolator`, as far as it goes."""

    def __init__(self, y, d, neighbors=None, smoothing=0.0, kernel="thin_plate_spline", epsilon=None, degree=None):
        offered = ["thin_plate_spline", "linear", "cubic"]
        if kernel not in [*offered, "test"]:
            pytest.skip(f"the kernel {kernel} is not offered")
        if degree not in (None, 1):
            pytest.skip(f"the degree {degree} is not offered")
        if np.ndim(smoothing):
            pytest.skip("smoothing by site is not offered")
        self.spline = ti.ThinPlateSpline(y, d, smoothing=smoothing, kernel=kernel)
        # If the points determine no affine part, theirs is an error and ours has a flag. Theirs of "linear" has none.
        if self.spline.flags and kernel != "linear":
            raise np.linalg.LinAlgError(self.spline.flags[0])

    def __call__(self, x):
        return self.spline(x)


class Plugin:
    """NumPy alone, errors by kind, a class of their tests."""

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
