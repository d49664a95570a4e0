"""Splines compared with SciPy, and matchers compared with the program."""

import subprocess
import sys

import numpy as np
import pytest
import tactile_imaging as ti
from conftest import DATA, lattice, points
from scipy.interpolate import RBFInterpolator


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kernel", ["thin_plate_spline", "linear", "cubic"])
@pytest.mark.parametrize("smoothing", [0.0, 0.1])
def test_splines_are_those_of_scipy(d, kernel, smoothing):
    sources, queries = points(40, d), points(30, d, seed=1)
    targets = np.stack([np.sin(3 * sources[:, 0]), sources[:, 1] ** 2], axis=1)
    theirs = RBFInterpolator(sources, targets, kernel=kernel, smoothing=smoothing, degree=1)
    ours = ti.ThinPlateSpline(sources, targets, smoothing=smoothing, kernel=kernel)
    expected = theirs(queries)
    # Both solve a system of condition below 1e4 in double precision.
    assert np.abs(ours(queries) - expected).max() < 1e-12 * np.abs(expected).max()
    single = ti.ThinPlateSpline(sources, targets[:, 0], smoothing=smoothing, kernel=kernel)
    assert np.abs(single(queries) - ours(queries)[:, 0]).max() < 1e-12


def test_the_jacobian_is_the_difference_quotient():
    sources, queries = points(40), points(10, seed=1)
    spline = ti.ThinPlateSpline(sources, np.sin(3 * sources))
    step = 1e-6
    for k in range(2):
        shift = step * np.eye(2)[k]
        quotient = (spline(queries + shift) - spline(queries - shift)) / (2 * step)
        # Central differences: step² times the third derivative, and rounding over the step.
        assert np.abs(spline.jacobian(queries)[:, :, k] - quotient).max() < 1e-6


def test_matches_have_the_bits_of_the_program(tmp_path):
    # In a separate process, because the program installs an interrupt handler.
    command = [sys.executable, "-m", "tactile_imaging", "match", DATA / "cases.txt"]
    subprocess.run([*command, "--out", tmp_path], check=True, capture_output=True)

    def cases(path):
        found, rows = {}, None
        for line in path.read_text().splitlines():
            word, *rest = line.split() or ["#"]
            if word == "case":
                rows = found.setdefault(rest[0], {"m": [], "t": [], "w": [], "a": []})
            elif rows and word in rows:
                rows[word].append([float(number) for number in rest])
        return found

    answers = cases(tmp_path / "cases.txt")
    for name, case in cases(DATA / "cases.txt").items():
        found = ti.match_points(case["m"], case["t"])
        assert np.array_equal(found.assignment, np.ravel(answers[name]["a"]))
        # The program uses the warp of the matcher: both agree with the deformation within the noise.
        assert np.allclose(found.warped, answers[name]["w"], atol=found.sigma + 1e-8)


MATCHERS = [
    "annealed-softassign",
    "coherent-point-drift",
    "relaxation-labelling",
    "linear-assignment",
    "nearest-neighbour",
]


@pytest.mark.parametrize("matcher", MATCHERS)
def test_every_matcher_matches_a_slight_bend(matcher):
    model = lattice(5)
    order = np.random.default_rng(2).permutation(len(model))
    target = np.empty_like(model)
    target[order] = model + 0.02 * model[:, ::-1]
    found = ti.match_points(model, target, matcher)
    assert np.array_equal(found.assignment, order)
    assert found.pairs.shape == (25, 2) and found.warped.shape == (25, 2)


def test_options_reach_their_matcher():
    model = points(36)
    turned = model @ np.array([[-1.0, 0.0], [0.0, -1.0]])
    found = ti.match_points(model, turned, rotation="any", transformation="rigid")
    assert np.array_equal(found.assignment, np.arange(36))
    near = ti.match_points(model, model + 5.0, "nearest-neighbour", max_distance=0.1)
    assert near.pairs.shape[0] == 0
    with pytest.raises(TypeError, match="has no option motion"):
        ti.match_points(model, model, "nearest-neighbour", motion="rigid")


def test_strain_between_finds_a_stretch():
    before = lattice(8)
    found = ti.strain_between(before, before * [1.02, 1.0])
    # Green–Lagrange: (1.02² − 1)/2.
    assert abs(found.value[0, 0] - 0.0202) < 1e-6
    assert found.strains.shape == (64, 3, 3)
    turn = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])
    turned = ti.strain_between(before, (before * [1.1, 1.0]) @ turn.T, paired=True, measure="biot")
    for values, right in [(turned.rotations_rad, 0.3), (turned.size_ratios, 1.1), (turned.principal_strains, 0.1)]:
        assert np.allclose(values[:, 0], right, atol=1e-6)
    assert np.allclose(turned.displacement_gradients[5, :2, :2], turn @ np.diag([1.1, 1.0]) - np.eye(2), atol=1e-6)
    hencky = ti.strain_between(before, before * [1.02, 1.0], measure="hencky")
    assert abs(hencky.value[0, 0] - np.log(1.02)) < 1e-6


def test_doubtful_pairs_are_refused_or_flagged():
    before, after = points(60), points(60, seed=1)
    with pytest.raises(ti.TactileError, match="doubtful|smooth"):
        ti.strain_between(before, after)


def test_slopes_and_shading_give_heights():
    y, x = np.mgrid[:30, :40] * 0.1
    heights = ti.integrate(0 * x + 0.3, 0 * y - 0.2, 0.1)
    plane = 0.3 * x - 0.2 * y
    assert np.abs(heights - (plane - plane.mean())).max() < 1e-9
    # A hemisphere of radius 20 under frontal light.
    y, x = np.mgrid[:61, :61] - 30.0
    ball = np.sqrt(np.maximum(400 - x**2 - y**2, 0))
    mask = x**2 + y**2 < 18**2
    found = ti.reconstruct(ball / 20, mask=mask)
    assert abs(np.nanmax(found) - (20 - np.sqrt(400 - 18**2))) < 1
    assert np.isnan(found[~mask]).all()


def test_hertz_forth_and_back():
    forces, radius, modulus = np.array([0.01, 0.02, 0.03]), 3e-3, 1e5
    radii = [ti.hertz(force, radius, modulus).contact_radius for force in forces]
    with_errors = np.stack([radii, np.full(3, 1e-7)], axis=1)
    found = ti.estimate_modulus(
        np.stack([forces, np.full(3, 1e-5)], axis=1),
        with_errors,
        ti.Object.sphere(radius),
        estimator="sphere",
    )
    # The same law, so that only rounding differs.
    assert found.value == pytest.approx(modulus, rel=1e-9)


def test_the_arrays_of_the_program_are_its_tables(tmp_path):
    """`tactile strain` writes the same numbers as text and as arrays."""
    before, after = (str(DATA / name) for name in ("before.csv", "after.csv"))
    call = [sys.executable, "-m", "tactile_imaging", "strain", before, after]
    subprocess.run([*call, "--grid", "0.002", "--out", str(tmp_path)], check=True)
    for name in ("strain", "grid"):
        table = np.genfromtxt(tmp_path / f"{name}.csv", delimiter=",", names=True)
        arrays = np.load(tmp_path / f"{name}.npz")
        points, strain = arrays["points"], arrays["strain"]
        np.testing.assert_array_equal(points[..., 1].ravel(), table["y_m"])
        np.testing.assert_array_equal(strain[..., 0, 1].ravel(), table["e_xy"])
        np.testing.assert_array_equal(arrays["standard_error"][..., 1, 1].ravel(), table["se_e_yy"])
    # Axes of a grid: y, then x.
    assert np.ptp(points[:, 0, 0]) == 0 < np.ptp(points[:, 0, 1])
