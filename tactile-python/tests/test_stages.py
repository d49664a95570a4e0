"""User-defined stages, each in a few lines, and faulty ones."""

import numpy as np
import pytest
import tactile_imaging as ti


class Nearest:
    def match_points(self, model, target):
        distance = np.linalg.norm(model[:, None] - target[None], axis=2)
        rows = np.full(len(model), -1)
        rows[distance.argmin(axis=0)] = np.arange(len(target))
        return rows


class Dome:
    def reconstruct(self, image, mask, pixel_size):
        return np.where(mask, 1e-3 * np.nan_to_num(image) + 1e-4, np.nan)


class Highest:
    def sample(self, heights, mask, pixel_size, count):
        rows, columns = np.nonzero(mask & np.isfinite(heights))
        order = np.argsort(-heights[rows, columns])[:count]
        rows, columns = rows[order], columns[order]
        x, y = columns * pixel_size[0], rows * pixel_size[1]
        return np.stack([x, y, heights[rows, columns]], axis=1)


class Spline:
    def fit(self, sources, targets, weights):
        return ti.ThinPlateSpline(sources, targets, smoothing=1e-3, kernel="linear")


class GreenLagrange:
    def strain(self, deformation_gradient):
        return (deformation_gradient.T @ deformation_gradient - np.eye(3)) / 2


class Hertz:
    needs_strain = False

    def __init__(self, radius):
        self.radius = radius

    def estimate(self, loads):
        moduli = [0.5625 * x.force.value * self.radius / x.radius.value**3 for x in loads]
        return np.mean(moduli), np.std(moduli)


class HertzOnGuide(Hertz):
    counts_guide = True

    def estimate(self, loads, layers):
        self.layers = layers
        thickness, modulus, nu = layers.T
        guide = np.sum(thickness * (1 - nu**2) / modulus) / np.sum(thickness)
        reduced = np.mean([0.75 * x.force.value * self.radius / x.radius.value**3 for x in loads])
        return 0.75 / (1 / reduced - guide), 1.0


class Bright:
    def measure(self, frame, reference):
        mask = frame > reference.astype(int) + 10
        if not mask.any():
            return None
        radius = 172e-6 * np.sqrt(mask.sum() / np.pi)
        return {"force": (0.7, 0.01), "radius": (radius, 1e-5), "mask": mask}


def test_a_matcher_of_ones_own_runs_the_whole_pipeline(scene):
    press = ti.press_of(scene, matcher=Nearest())
    assert press.modulus().value > 0
    assert np.isfinite(press.strain(1).value).all()


def test_every_stage_of_ones_own_is_called(scene):
    built_in = ti.press_of(scene, control_points=60)
    same = ti.press_of(scene, control_points=60, strain=GreenLagrange())
    assert np.allclose(same.strain(1).value, built_in.strain(1).value, rtol=1e-12, atol=1e-12)
    assert np.nanmax(ti.press_of(scene, surface=Dome()).surface(0).heights) > 1e-4
    sampled = ti.press_of(scene, control_points=60, sampler=Highest()).control_points(0)
    assert sampled.shape == (60, 3)
    warped = ti.press_of(scene, control_points=60, warp=Spline())
    assert np.isfinite(warped.strain(1).value).all()
    estimated = ti.press_of(scene, estimator=Hertz(scene.radius)).modulus()
    assert estimated.estimator == "own estimator" and estimated.value > 0
    assert any("guide" in flag for flag in estimated.flags)
    on_guide = HertzOnGuide(scene.radius)
    counted = ti.press_of(scene, estimator=on_guide).modulus()
    assert np.array_equal(on_guide.layers, scene.waveguide)
    assert not any("guide" in flag for flag in counted.flags)
    contact = ti.press_of(scene, pairs=None, contact=Bright()).contact(0)
    assert contact.force.value == 0.7
    assert ti.match_points(np.eye(3), np.eye(3), Nearest()).assignment.tolist() == [0, 1, 2]


class Broken:
    def __init__(self, method, answer):
        setattr(self, method, answer)


@pytest.mark.parametrize(
    "stage, method, answer, sentence",
    [
        ("matcher", "match_points", lambda m, t: [0], "for each of 60"),
        ("matcher", "match_points", lambda m, t: np.zeros(len(m), int), "target"),
        ("matcher", "match_points", lambda m, t: np.full(len(m), -2), "-2"),
        ("matcher", "match_points", lambda m, t: np.zeros(len(m)), "int64"),
        ("matcher", "match_points", lambda m, t: None, "int64"),
        ("matcher", "match_points", lambda m, t: 1 / 0, "division by zero"),
        ("matcher", "match_points", lambda m, t: (m, m), "int64"),
        ("surface", "reconstruct", lambda i, m, p: i[1:], "shape"),
        ("surface", "reconstruct", lambda i, m, p: i + np.inf, "finite"),
        ("sampler", "sample", lambda h, m, p, n: np.zeros((3, 3)), "60 points"),
        ("warp", "fit", lambda s, t, w: None, "callable"),
        ("strain", "strain", lambda f: f[0], "two axes"),
        ("strain", "strain", lambda f: f * np.nan, "finite"),
        ("estimator", "estimate", lambda loads: 1.0, "standard error"),
        ("estimator", "estimate", lambda loads: (np.nan, 1.0), "finite"),
        ("contact", "measure", lambda f, r: {"radius": (1.0, 0.1)}, "mask"),
        (
            "contact",
            "measure",
            lambda f, r: {"radius": (1.0, 0.1), "mask": f > 0, "centre": (np.nan, 1.0)},
            "centre must be finite",
        ),
    ],
)
def test_a_broken_stage_is_one_clear_error(scene, stage, method, answer, sentence):
    stages = {stage: Broken(method, answer), "control_points": 60}
    if stage == "contact":
        stages["pairs"] = None
    press = ti.press_of(scene, **stages)
    with pytest.raises(ti.TactileError, match=sentence) as raised:
        press.modulus() if stage in ("estimator", "contact") else press.strain(1)
    assert raised.value.__cause__ is not None


def test_the_traceback_of_a_stage_is_kept(scene):
    class Failing:
        def match_points(self, model, target):
            raise LookupError("weights are missing")

    with pytest.raises(ti.TactileError, match="weights are missing") as raised:
        ti.press_of(scene, matcher=Failing()).strain(1)
    names = [entry.name for entry in raised.traceback]
    assert names and raised.value.__cause__.__traceback__.tb_frame.f_code.co_name == "match_points"


def test_a_stage_that_asks_its_own_press_is_told_so(scene):
    class Asking(Nearest):
        def match_points(self, model, target):
            self.press.strain(1)
            return super().match_points(model, target)

    matcher = Asking()
    matcher.press = ti.press_of(scene, matcher=matcher)
    with pytest.raises(ti.TactileError, match="waits for the stage"):
        matcher.press.strain(1)


def test_an_interrupt_within_a_stage_is_raised_itself(scene):
    class Interrupted:
        def match_points(self, model, target):
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        ti.press_of(scene, matcher=Interrupted()).strain(1)
