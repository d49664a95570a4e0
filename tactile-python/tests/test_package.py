"""The package against SciPy, against the truth of simulated presses, and against bad calls."""

import numpy as np
import pytest
import tactile_imaging as ti
from scipy.interpolate import RBFInterpolator


@pytest.fixture(scope="module")
def scene():
    return ti.simulate(coarser=8)


def points(n, d=2, seed=0):
    return np.random.default_rng(seed).uniform(-1, 1, (n, d))


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("kernel", ["thin_plate_spline", "linear", "cubic"])
@pytest.mark.parametrize("smoothing", [0.0, 0.1])
def test_splines_are_those_of_scipy(d, kernel, smoothing):
    sources, queries = points(40, d), points(30, d, seed=1)
    targets = np.stack([np.sin(3 * sources[:, 0]), sources[:, 1] ** 2], axis=1)
    theirs = RBFInterpolator(sources, targets, kernel=kernel, smoothing=smoothing, degree=1)
    ours = ti.ThinPlateSpline(sources, targets, smoothing=smoothing, kernel=kernel)
    expected = theirs(queries)
    # Both solve a system of condition below 1e6 in double precision.
    assert np.abs(ours(queries) - expected).max() < 1e-10 * np.abs(expected).max()
    single = ti.ThinPlateSpline(sources, targets[:, 0], smoothing=smoothing, kernel=kernel)
    assert single(queries).shape == (30,)


def test_the_jacobian_is_the_difference_quotient():
    sources, queries = points(40), points(10, seed=1)
    spline = ti.ThinPlateSpline(sources, np.sin(3 * sources))
    step = 1e-6
    for k in range(2):
        shift = step * np.eye(2)[k]
        quotient = (spline(queries + shift) - spline(queries - shift)) / (2 * step)
        # Central differences: step² times the third derivative, and rounding over the step.
        assert np.abs(spline.jacobian(queries)[:, :, k] - quotient).max() < 1e-6


def test_the_default_press_has_the_modulus_of_its_ball(scene):
    modulus = ti.press_of(scene).modulus()
    assert abs(modulus.value / scene.truth["youngs_modulus"] - 1) < 0.0538
    low, high = modulus.interval_95
    assert low < modulus.value < high
    assert modulus.to_dict()["estimator"] == modulus.estimator
    assert "kPa" in repr(modulus) and "<table>" in modulus._repr_html_()


def test_a_press_has_contact_surface_points_and_strain(scene):
    press = ti.press_of(scene, control_points=60)
    assert len(press) == 2
    contact = press.contact(1)
    assert abs(contact.force.value / 1.2 - 1) < 0.02
    assert np.nanmax(press.surface(1).heights) > 0
    assert press.control_points(0).shape == (60, 3)
    # From 0.7 N to 1.2 N the apparent surface grows by s = (1.2/0.7)^(1/3): e_xx = (s² − 1)/2.
    assert abs(press.strain(1).value[0, 0] - 0.216) < 0.03


def test_a_session_finds_the_modulus_of_the_press(scene):
    pipeline = ti.Pipeline(
        pairs=scene.pairs,
        pixel_size=scene.pixel_size,
        object=ti.Object.sphere(scene.radius),
        waveguide=scene.waveguide,
        estimator="sphere",
    )
    session = ti.Session(pipeline, [scene.reference])
    assert session.push(scene.reference) is None
    for frame in scene.frames:
        assert session.push(frame).force.value > 0.5
    assert session.modulus().value == pytest.approx(ti.press_of(scene).modulus().value, rel=0.01)


@pytest.mark.parametrize("matcher", ["annealed", "cpd", "labelling", "assignment", "nearest"])
def test_every_matcher_matches_a_slight_bend(matcher):
    model = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0)), axis=-1).reshape(-1, 2)
    model += 0.1 * points(20)
    order = np.random.default_rng(2).permutation(20)
    target = np.empty_like(model)
    target[order] = model + 0.02 * model[:, ::-1]
    found = ti.match_points(model, target, matcher)
    assert np.array_equal(found.assignment, order)
    assert found.pairs.shape == (20, 2) and found.warped.shape == (20, 2)


def test_strain_between_finds_a_stretch():
    before = np.stack(np.meshgrid(np.arange(8.0), np.arange(8.0)), axis=-1).reshape(-1, 2)
    before += 0.1 * points(64)
    found = ti.strain_between(before, before * [1.02, 1.0])
    # Green–Lagrange: (1.02² − 1)/2.
    assert abs(found.value[0, 0] - 0.0202) < 1e-6
    assert found.strains.shape == (64, 3, 3)


def test_slopes_are_integrated():
    y, x = np.mgrid[:30, :40] * 0.1
    heights = ti.integrate(0 * x + 0.3, 0 * y - 0.2, 0.1)
    plane = 0.3 * x - 0.2 * y
    assert np.abs(heights - (plane - plane.mean())).max() < 1e-9


class NearestOfMine:
    def match_points(self, model, target):
        distance = np.linalg.norm(model[:, None] - target[None], axis=2)
        rows = np.full(len(model), -1)
        for j, i in enumerate(distance.argmin(axis=0)):
            rows[i] = j
        return rows


def test_a_matcher_of_ones_own_runs_the_whole_pipeline(scene):
    press = ti.press_of(scene, matcher=NearestOfMine())
    assert press.modulus().value > 0
    assert np.isfinite(press.strain(1).value).all()


class Broken:
    def __init__(self, answer):
        self.answer = answer

    def match_points(self, model, target):
        return self.answer(model, target)


@pytest.mark.parametrize(
    "answer, sentence",
    [
        (lambda model, target: [0], "for each of 60"),
        (lambda model, target: np.zeros(len(model), int), "taken"),
        (lambda model, target: (np.arange(len(model)), np.full(len(model), np.nan)), "confidence"),
        (lambda model, target: np.full(len(model), -2), "-2"),
        (lambda model, target: np.zeros(len(model)), "int64"),
        (lambda model, target: None, "int64"),
        (lambda model, target: 1 / 0, "division by zero"),
    ],
)
def test_a_broken_matcher_is_one_clear_error(scene, answer, sentence):
    press = ti.press_of(scene, matcher=Broken(answer), control_points=60)
    with pytest.raises(ti.TactileError, match=sentence) as raised:
        press.strain(1)
    assert raised.value.__cause__ is not None


SQUARE = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
NAN = np.full((4, 2), np.nan)


@pytest.mark.parametrize(
    "call",
    [
        lambda: ti.match_points(SQUARE, NAN),
        lambda: ti.match_points(SQUARE, SQUARE[:0]),
        lambda: ti.match_points(SQUARE, np.zeros((4, 3))),
        lambda: ti.match_points(SQUARE[0], SQUARE[0]),
        lambda: ti.match_points(SQUARE, "points"),
        lambda: ti.match_points(SQUARE, SQUARE.astype(complex)),
        lambda: ti.match_points(SQUARE, SQUARE, "best"),
        lambda: ti.match_points(SQUARE, SQUARE, rotation="some"),
        lambda: ti.match_points(SQUARE, SQUARE, "cpd", outlier_weight=2.0),
        lambda: ti.strain_between(SQUARE, SQUARE),
        lambda: ti.ThinPlateSpline(SQUARE, NAN),
        lambda: ti.ThinPlateSpline(SQUARE, SQUARE[:3]),
        lambda: ti.ThinPlateSpline(SQUARE, SQUARE, smoothing=-1.0),
        lambda: ti.ThinPlateSpline(SQUARE, SQUARE, kernel="square"),
        lambda: ti.ThinPlateSpline(SQUARE, SQUARE)(np.zeros((2, 3))),
        lambda: ti.integrate(SQUARE, SQUARE[:2], 1.0),
        lambda: ti.integrate(SQUARE, SQUARE, -1.0),
        lambda: ti.simulate(forces=[-1.0]),
        lambda: ti.Pipeline(pairs=SQUARE, pixel_size=0.0, object=ti.Object.sphere(3e-3)),
        lambda: ti.Pipeline(pairs=SQUARE, pixel_size=1e-5, object=ti.Object.sphere(-1.0)),
        lambda: ti.press_of(ti.simulate(coarser=16), strain="none"),
    ],
)
def test_a_bad_value_is_a_value_error_with_a_sentence(call):
    with pytest.raises(ValueError, match=".{10}"):
        call()


def test_bad_frames(scene):
    press = ti.press_of(scene)
    for frame in (scene.frames[0].astype(float), np.zeros(5, np.uint8), "frame"):
        with pytest.raises(ValueError):
            press.add_frame(frame)
    with pytest.raises(IndexError):
        press.contact(7)
    press.add_frame(np.zeros((3, 3), np.uint8))
    with pytest.raises(ValueError):
        press.contact(2)
    with pytest.raises(TypeError):
        ti.match_points(SQUARE, SQUARE, "nearest", motion="rigid")


def test_any_layout_of_an_array_is_read(scene):
    flipped = ti.match_points(SQUARE[::-1], np.asfortranarray(SQUARE), "nearest")
    assert flipped.assignment.tolist() == [3, 2, 1, 0]
    with pytest.raises(ValueError):
        flipped.assignment[0] = 1
    with pytest.raises(AttributeError):
        flipped.sigma = 0.0
