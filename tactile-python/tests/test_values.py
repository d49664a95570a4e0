"""Results as values: copies, dictionaries, numbers and tables; maps of matches; splines of other shapes."""

import copy
import gc
import json
import multiprocessing
import pickle
import threading
import time
import weakref

import numpy as np
import pytest
import tactile_imaging as ti
from conftest import lattice, points
from scipy.interpolate import RBFInterpolator


def turned(model, degrees=5.0, scale=1.02, noise=0.0, seed=0):
    angle = np.radians(degrees)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    exact = scale * model @ turn.T + [3, 1]
    return exact, exact + np.random.default_rng(seed).normal(0, noise, model.shape)


@pytest.fixture(scope="module")
def results(scene):
    press = ti.press_of(scene)
    model = 100 * points(60)
    match = ti.match_points(model, turned(model)[1], transformation="similarity")
    strain = ti.strain_between(model, turned(model)[1], paired=True)
    return [press.modulus(), press.contact(1), press.surface(1), press.strain(1), match, strain, ti.match_points(model, model + 1)]


def test_results_are_copied_and_written(results):
    for result in results:
        for again in (pickle.loads(pickle.dumps(result)), copy.copy(result), copy.deepcopy(result)):
            assert again == result and repr(again) == repr(result)
        text = json.dumps(result.to_dict(plain=True), allow_nan=False)
        assert type(result).from_dict(json.loads(text)) == result, type(result)
    assert results[0] != results[1] and results[4] != results[6]
    with pytest.raises(ValueError, match="missing"):
        ti.Estimate.from_dict({"value": 1.0})


def first_contact(_):
    return ti.press_of(ti.simulate()).contact(0)


def test_processes_return_results():
    with multiprocessing.get_context("spawn").Pool(2) as pool:
        one, other = pool.map(first_contact, range(2))
    assert one == other and one.force.value > 0


def test_numbers_and_tables(results):
    modulus, contact, *_, match, strain, _ = results
    assert float(modulus) == modulus.value and format(modulus, ".3g") == format(modulus.value, ".3g")
    assert f"{contact.force}" == repr(contact.force)
    with pytest.raises(TypeError, match="no number"):
        float(match)
    pandas = pytest.importorskip("pandas")
    assert isinstance(strain.to_dataframe(), pandas.DataFrame) and len(strain.to_dataframe()) == 60
    assert len(contact.to_dataframe()) == 1


def test_a_match_has_its_map_and_takes_other_points_along():
    model, queries = 100 * points(200), 100 * points(40, seed=2)
    exact, noisy = turned(model, noise=0.05)
    wanted = turned(queries)[0]
    found = ti.match_points(model, noisy, transformation="similarity")
    homogeneous = np.c_[queries, np.ones(len(queries))] @ found.matrix.T
    assert abs(found.scale - 1.02) < 4 * found.scale_error and abs(found.rotation[2] - np.radians(5)) < 4 * found.rotation_error[2]
    assert np.all(np.abs(np.array(found.translation) - [3, 1]) < 4 * np.array(found.translation_error))
    for match in (found, ti.match_points(model, noisy)):
        places, errors = match.transform(queries)
        # Four standard errors for 80 numbers, except those that extrapolate a smooth field.
        assert np.median(np.abs(places - wanted) / errors[:, None]) < 1.5 and errors.max() < 0.1
    assert np.allclose(found.transform(queries)[0], homogeneous[:, :2], rtol=0, atol=1e-9)


@pytest.mark.parametrize("count", [300, 1200])
def test_warped_points_are_on_the_smooth_map_at_every_size(count):
    model = 7 * np.sqrt(count) * points(count)
    exact, noisy = turned(model, scale=1.0, noise=0.1)
    found = ti.match_points(model, noisy)
    # The noise of a coordinate is 0.1, and a smooth map of hundreds of points averages it away.
    assert np.sqrt(np.mean((found.warped - exact) ** 2)) < 0.05
    assert 0.1 < found.residual < 0.2


def test_strain_on_a_grid_in_a_series_and_as_a_file(tmp_path):
    before = lattice(9)
    frames = [before * [1 + 0.02 * k, 1.0] for k in range(4)]
    found = ti.strain_between(before, frames[2], paired=True, grid=1.0)
    grid = found.grid
    assert len(grid.points) == np.prod(grid.counts) >= 64
    # Green–Lagrange, and the displacement, of a stretch by 4 %.
    assert np.allclose(grid.strains[:, 0, 0], (1.04**2 - 1) / 2, atol=1e-9)
    assert np.allclose(grid.displacements, 0.04 * grid.points * [1, 0], atol=1e-9)
    own = ti.strain_between(before, frames[2], paired=True, grid=before[:5] + 0.1)
    assert own.grid.counts == [] and own.grid.points.shape == (5, 2)
    assert ti.StrainBetween.from_dict(own.to_dict(plain=True)).grid.counts == []
    for result, kind in ((found, "STRUCTURED_POINTS"), (ti.strain_between(before, frames[2], paired=True), "POLYDATA")):
        result.to_vtk(tmp_path / "strain.vtk")
        lines = (tmp_path / "strain.vtk").read_text().splitlines()
        assert lines[3] == f"DATASET {kind}"
        places = result.grid or result
        first = lines.index("TENSORS strain double") + 1
        tensors = np.array([line.split() for line in lines[first : first + 3 * len(places.points)]], float)
        assert np.array_equal(tensors.reshape(-1, 3, 3), places.strains)
        assert len(result.plot().axes) == 3
    series = ti.strain_series(frames)
    assert np.allclose([one.value[0, 0] for one in series], [((1 + 0.02 * k) ** 2 - 1) / 2 for k in (1, 2, 3)])
    assert len(ti.match_points(before, frames[1]).plot().axes[0].lines) == 2 + len(before)


def test_frames_of_a_press_are_its_items(scene):
    press = ti.press_of(scene)
    assert [frame.number for frame in press] == [0, 1]
    assert press[-1].contact == press.contact(-1) == press.contact(1)
    surface = press[0].surface
    assert np.array_equal(np.asarray(surface), surface.heights, equal_nan=True)
    assert surface.heights.shape == (len(surface.y), len(surface.x))
    assert np.isclose(surface.x[1] - surface.x[0], surface.pixel_size[0])
    assert repr(eval(repr(ti.Object.layer(1e-3, 2e-3)), {"Object": ti.Object})) == repr(ti.Object.layer(1e-3, 2e-3))


def test_frames_have_the_same_numbers_in_calls_and_sentences(scene):
    press = ti.press_of(scene)
    number = press.add_frame(scene.reference)
    with pytest.raises(ti.TactileError, match=f"^frame {number} shows no contact"):
        press.surface(number)
    for index in (7, -4, 2**62, -(2**63)):
        with pytest.raises(IndexError, match=f"no frame {index}: the press has 3"):
            press.contact(index)
    assert "\nframe 0 " in press.summary() and press.measure()["frames"][2]["error"].startswith(f"frame {number} ")
    loads = ti.estimate_modulus([[0.02, 1e-4], [0.9, 1e-3]], [[8e-4, 1e-5], [3e-3, 1e-5]], ti.Object.sphere(3e-3), estimator="sphere")
    assert any(flag.startswith("load 1: a/R") for flag in loads.flags)


def test_one_saturated_frame_does_not_end_a_session(scene):
    session = ti.Session(ti.pipeline_of(scene), [scene.reference])
    for frame in (scene.frames[0], np.full_like(scene.frames[0], 255), scene.frames[1]):
        try:
            session.push(frame)
        except ti.TactileError as error:
            assert "saturated" in str(error) and frame.min() == 255
    alone = ti.Session(ti.pipeline_of(scene), [scene.reference])
    for frame in scene.frames:
        alone.push(frame)
    assert np.isclose(session.modulus().value, alone.modulus().value, rtol=1e-9)


def test_the_error_of_an_own_contact_is_its_own(scene):
    class Known:
        def measure(self, frame, reference):
            return {"radius": (1e-3, 1e-5), "force": (0.5, 0.01), "mask": np.ones(frame.shape, bool)}

    for stated, expected in ((None, 0.01), (0.12, np.hypot(0.01, 0.06))):
        pipeline = ti.Pipeline(ti.Object.sphere(3e-3), contact=Known(), pixel_size=1e-4, coupling_error=stated)
        press = pipeline.press(scene.reference)
        press.add_frame(scene.frames[0])
        assert np.isclose(press.contact(0).force.standard_error, expected, rtol=1e-12)


def test_a_stage_that_holds_its_press_is_freed(scene):
    class Matcher:
        def match_points(self, model, target):
            return np.arange(len(model))

    own = Matcher()
    own.press = ti.press_of(scene, matcher=own)
    own.press.matching(1)
    gone = weakref.ref(own)
    del own
    gc.collect()
    assert gone() is None
    # A stage without other references lives as long as its press.
    press = ti.press_of(scene, matcher=Matcher())
    gc.collect()
    assert len(press.matching(1).pairs) > 100


def test_a_frame_waits_for_what_is_computed(scene):
    started = threading.Event()

    class Slow:
        def match_points(self, model, target):
            started.set()
            time.sleep(0.2)
            return np.arange(len(model))

    press = ti.press_of(scene, matcher=Slow())
    thread = threading.Thread(target=press.matching, args=(1,))
    thread.start()
    started.wait()
    assert press.add_frame(scene.frames[0]) == len(scene.frames) and len(press) == len(scene.frames) + 1
    thread.join()


@pytest.mark.parametrize("kernel", ["thin_plate_spline", "linear", "cubic"])
def test_splines_of_a_line_and_of_complex_values(kernel):
    line, values = points(25)[:, :1], points(25, seed=3)[:, 0]
    queries = points(40, seed=4)[:, :1]
    expected = RBFInterpolator(line, values, kernel=kernel, degree=1)(queries)
    ours = ti.ThinPlateSpline(line, values, kernel=kernel)
    # A system of condition below 1e6 in double precision.
    assert np.abs(ours(queries) - expected).max() < 1e-9 * np.abs(expected).max() and ours.flags == []
    assert np.array_equal(pickle.loads(pickle.dumps(ours))(queries), ours(queries))
    sources, grid = points(30), np.stack([points(20)] * 3)
    targets = points(30, seed=5)[:, :1, None] + 1j * np.random.default_rng(6).random((30, 2, 3))
    expected = RBFInterpolator(sources, targets, kernel=kernel, degree=1)(grid.reshape(-1, 2)).reshape(3, 20, 2, 3)
    assert np.abs(ti.ThinPlateSpline(sources, targets, kernel=kernel)(grid) - expected).max() < 1e-10
    assert "1 of 2 directions" in ti.ThinPlateSpline(np.repeat(line, 2, 1), values, kernel=kernel).flags[0]
