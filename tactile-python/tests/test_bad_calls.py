"""Invalid calls raise a clear exception, and unusual arrays give the right result."""

import numpy as np
import pytest
import tactile_imaging as ti

SQUARE = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
NAN = np.full((4, 2), np.nan)
BALL = ti.Object.sphere(3e-3)
PAIRS = [[0.0, 0.0], [1e5, 1.0], [2e5, 2.0]]


def press():
    return ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4).press(np.zeros((20, 20), np.uint8))


def pressed():
    found = press()
    for _ in range(2):
        found.add_frame(GREY)
    return found


def saturated():
    pipeline = ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4)
    return ti.Session(pipeline, [GREY])


GREY = np.zeros((20, 20), np.uint8)
FLAT = np.array([[float(k % 6), float(k // 6)] for k in range(36)])
MASKED = np.ma.masked_array(SQUARE, mask=SQUARE > 0.5)
COLOUR = np.zeros((20, 20, 3), np.uint8)

VALUES = [
    lambda: ti.match_points(SQUARE, MASKED),
    lambda: ti.match_points(SQUARE, SQUARE, largest_motion=-1.0),
    lambda: ti.match_points(SQUARE, SQUARE, transformation="projective"),
    lambda: ti.match_points(SQUARE, SQUARE, outliers="all"),
    lambda: ti.match_points(SQUARE, SQUARE, "relaxation-labelling", slack=2.0),
    lambda: ti.match_points(SQUARE, SQUARE, "relaxation-labelling", neighbours=0),
    lambda: ti.match_points(SQUARE, SQUARE, "nearest-neighbour", max_distance=0.0),
    lambda: ti.match_points(SQUARE * 1e200, SQUARE),
    lambda: ti.match_points(SQUARE, SQUARE).transform(np.zeros((2, 3))),
    lambda: ti.match_points(SQUARE, SQUARE).transform(NAN[0]),
    lambda: ti.Match.from_dict({"assignment": [0]}),
    lambda: ti.Estimate.from_dict({"value": "1", "standard_error": 0.1, "interval_95": (0.0, 1.0)}),
    lambda: ti.strain_between(FLAT, FLAT[:-1], paired=True),
    lambda: ti.strain_between(FLAT, FLAT, "nearest-neighbour", paired=True),
    lambda: ti.strain_between(FLAT, FLAT, paired=True, grid=0.0),
    lambda: ti.strain_between(FLAT, FLAT, paired=True, grid=np.nan),
    lambda: ti.strain_between(FLAT, FLAT, paired=True, grid=1e-6),
    lambda: ti.strain_between(FLAT, FLAT, paired=True, grid=np.zeros((3, 3))),
    lambda: ti.strain_between(FLAT + np.nan, FLAT, paired=True),
    lambda: ti.strain_series([]),
    lambda: ti.strain_series([FLAT, np.zeros((36, 3))]),
    lambda: ti.strain_series([FLAT, FLAT * np.inf]),
    lambda: ti.ThinPlateSpline(SQUARE, MASKED),
    lambda: ti.ThinPlateSpline(SQUARE, 1.0),
    lambda: ti.ThinPlateSpline(np.zeros((4, 4)), SQUARE),
    lambda: ti.ThinPlateSpline(SQUARE, SQUARE[:, :0]),
    lambda: ti.ThinPlateSpline(SQUARE, SQUARE).jacobian(MASKED),
    lambda: ti.integrate(SQUARE, MASKED),
    lambda: ti.reconstruct(SQUARE, method="some"),
    lambda: ti.reconstruct(SQUARE, pixel_size=-1.0),
    lambda: ti.depth(GREY, GREY, [[0.0, 0.0]], 1e-4),
    lambda: ti.depth(GREY, GREY[:5], PAIRS, 1e-4),
    lambda: ti.depth(COLOUR, GREY, PAIRS, 1e-4),
    lambda: ti.markers(GREY, GREY[:5]),
    lambda: ti.markers(GREY, GREY.astype(float)),
    lambda: ti.estimate_modulus([1.0, np.nan], [1e-3, 2e-3], BALL),
    lambda: ti.hertz(1.0, np.nan, 1e5),
    lambda: ti.simulate(youngs_modulus=0.0),
    lambda: ti.simulate(coarser=0),
    lambda: press().add_frame(COLOUR),
    lambda: press().add_frame(GREY[:5]),
    lambda: press().add_frame(np.ma.masked_array(GREY, mask=True)),
    lambda: press().add_frame(GREY, gauge=np.nan),
    lambda: press().add_frame(GREY, gauge=1.0, gauge_error=-1.0),
    lambda: press().add_frame(GREY, gauge=1.0, gauge_error=np.inf),
    lambda: press().add_frame(GREY, time=np.nan),
    lambda: ti.Press(ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4), GREY[:0]),
    lambda: ti.Pipeline(BALL, pairs=[[0.0, 0.0]], pixel_size=1e-4),
    lambda: ti.Pipeline(BALL, pairs=np.full((3, 2), np.nan), pixel_size=1e-4),
    lambda: ti.Pipeline(BALL, depth_table=[[0.0, 0.0], [1.0, -1.0]], pixel_size=1e-4),
    lambda: ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4, gauge_error=np.nan),
    lambda: ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4, estimator="none"),
    lambda: ti.Pipeline(ti.Object.sphere(3e-3, poisson_ratio=0.6), pairs=PAIRS, pixel_size=1e-4),
    lambda: ti.Session(ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4), [GREY]).push(GREY[:5]),
    lambda: ti.GelSensor.calibrate(COLOUR, [], ball_radius=2e-3, pixel_size=1e-4),
    lambda: ti.GelSensor.calibrate(GREY, [GREY], ball_radius=2e-3, pixel_size=1e-4),
    lambda: ti.GelSensor.calibrate(COLOUR, [COLOUR], ball_radius=2e-3, pixel_size=1e-4, order="hsv"),
    lambda: ti.GelSensor.load(__file__),
    lambda: ti.match_points(SQUARE, NAN),
    lambda: ti.match_points(SQUARE, SQUARE + np.inf),
    lambda: ti.match_points(SQUARE, SQUARE[:0]),
    lambda: ti.match_points([], []),
    lambda: ti.match_points(SQUARE, np.zeros((4, 3))),
    lambda: ti.match_points(np.zeros((4, 4)), np.zeros((4, 4))),
    lambda: ti.match_points(SQUARE[0], SQUARE[0]),
    lambda: ti.match_points(SQUARE, "points"),
    lambda: ti.match_points(SQUARE, None),
    lambda: ti.match_points(SQUARE, SQUARE.astype(complex)),
    lambda: ti.match_points(SQUARE, SQUARE.astype("datetime64[s]")),
    lambda: ti.match_points(SQUARE, np.array([["a", "b"]], object)),
    lambda: ti.match_points(SQUARE, SQUARE, "best"),
    lambda: ti.match_points(SQUARE, SQUARE, rotation="some"),
    lambda: ti.match_points(SQUARE, SQUARE, outlier_ratio=np.nan),
    lambda: ti.match_points(SQUARE, SQUARE, max_iterations=0),
    lambda: ti.match_points(SQUARE, SQUARE, "coherent-point-drift", outlier_weight=2.0),
    lambda: ti.strain_between(SQUARE[:3], SQUARE[:3]),
    lambda: ti.strain_between(SQUARE, SQUARE, measure="none"),
    lambda: ti.ThinPlateSpline(SQUARE, NAN),
    lambda: ti.ThinPlateSpline(SQUARE, SQUARE[:3]),
    lambda: ti.ThinPlateSpline(SQUARE * 0, SQUARE),
    lambda: ti.ThinPlateSpline(SQUARE, SQUARE, smoothing=-1.0),
    lambda: ti.ThinPlateSpline(SQUARE, SQUARE, smoothing="some"),
    lambda: ti.ThinPlateSpline(SQUARE, SQUARE, kernel="square"),
    lambda: ti.ThinPlateSpline(SQUARE, SQUARE)(np.zeros((2, 3))),
    lambda: ti.integrate(SQUARE, SQUARE[:2], 1.0),
    lambda: ti.integrate(SQUARE, SQUARE, -1.0),
    lambda: ti.integrate(SQUARE, SQUARE, method="some"),
    lambda: ti.integrate(SQUARE, SQUARE, mask=SQUARE),
    lambda: ti.integrate(SQUARE[:0], SQUARE[:0]),
    lambda: ti.reconstruct(SQUARE, light=(0.0, 0.0, -1.0)),
    lambda: ti.simulate(forces=[-1.0]),
    lambda: ti.simulate(physics="springs"),
    lambda: ti.hertz(-1.0, 3e-3, 1e5),
    lambda: ti.estimate_modulus(SQUARE, SQUARE[:2], BALL),
    lambda: ti.Pipeline(BALL, pairs=PAIRS, pixel_size=0.0),
    lambda: ti.Pipeline(BALL, pairs=PAIRS, pixel_size=[1.0, 2.0, 3.0]),
    lambda: ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4, strain="none"),
    lambda: ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4, waveguide=[[1.0, -1.0, 0.5]]),
    lambda: ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4, radius_error=-1.0),
    lambda: ti.Pipeline(ti.Object.sphere(-1.0), pairs=PAIRS, pixel_size=1e-4),
    lambda: press().add_frame(np.zeros((20, 20))),
    lambda: press().add_frame(np.zeros(5, np.uint8)),
    lambda: press().add_frame("frame"),
    lambda: press().add_frame(np.zeros((20, 20), np.uint8), time=-1.0),
    lambda: ti.Session(ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4), []),
    lambda: ti.Sensor.load(__file__),
]


@pytest.mark.parametrize("call", VALUES)
def test_a_bad_value_is_a_value_error_with_a_sentence(call):
    with pytest.raises(ValueError, match=".{15}"):
        call()


OTHERS = [
    (IndexError, lambda: press().contact(7)),
    (TypeError, lambda: press().contact("first")),
    (IndexError, lambda: press().contact(-1)),
    (IndexError, lambda: pressed()[2]),
    (IndexError, lambda: pressed()[-3]),
    (TypeError, lambda: pressed()["0"]),
    (TypeError, lambda: pressed()[0:1]),
    (TypeError, lambda: pressed()[0.5]),
    (AttributeError, lambda: pressed()[0].colour),
    (ti.TactileError, lambda: pressed()[0].surface),
    (ti.TactileError, lambda: pressed().strain(-1)),
    (ti.TactileError, lambda: pressed().modulus()),
    (ti.TactileError, lambda: saturated().push(np.full((20, 20), 255, np.uint8))),
    (TypeError, lambda: ti.ThinPlateSpline(SQUARE)),
    (TypeError, lambda: ti.ThinPlateSpline(SQUARE, SQUARE, degree=1)),
    (TypeError, lambda: ti.strain_between(SQUARE, SQUARE, spline=1)),
    (TypeError, lambda: ti.strain_series(SQUARE[0, 0])),
    (TypeError, lambda: ti.Object.sphere()),
    (TypeError, lambda: ti.Object.sphere("3 mm")),
    (TypeError, lambda: ti.Object()),
    (TypeError, lambda: ti.Match()),
    (TypeError, lambda: ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4, matcher=object())),
    (TypeError, lambda: ti.Press(BALL, GREY)),
    (TypeError, lambda: ti.simulate(coarser="2")),
    (TypeError, lambda: float(ti.match_points(SQUARE, SQUARE))),
    (TypeError, lambda: hash(ti.hertz(1.0, 3e-3, 1e5))),
    (TypeError, lambda: ti.GelSensor()),
    (OSError, lambda: ti.GelSensor.load("absent.toml")),
    (OSError, lambda: ti.strain_between(FLAT, FLAT, paired=True).to_vtk("absent/strain.vtk")),
    (TypeError, lambda: ti.match_points(SQUARE, SQUARE, "nearest-neighbour", motion="rigid")),
    (TypeError, lambda: ti.match_points(SQUARE, SQUARE, max_iterations=-1)),
    (TypeError, lambda: ti.match_points(SQUARE, SQUARE, matcher=3)),
    (TypeError, lambda: ti.Pipeline(BALL)),
    (TypeError, lambda: ti.Pipeline(BALL, pairs=PAIRS, depth_table=PAIRS, pixel_size=1e-4)),
    (TypeError, lambda: ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4, surface=3)),
    (OSError, lambda: ti.Press.from_scene("absent.toml")),
    (OSError, lambda: ti.Sensor.load("absent.toml")),
    (ti.TactileError, lambda: press().modulus()),
]


@pytest.mark.parametrize("kind, call", OTHERS)
def test_other_bad_calls_raise_by_kind(kind, call):
    with pytest.raises(kind):
        call()


def layouts(array):
    """The same numbers in other types and layouts."""
    wide = np.zeros((2 * len(array), 4))
    wide[::2, ::2] = array
    odd = np.frombuffer(b"\0" + array.tobytes(), np.uint8, offset=1).view(array.dtype)
    kept = array.copy()
    kept.flags.writeable = False
    return {
        "list": array.tolist(),
        "Fortran": np.asfortranarray(array),
        "strided": wide[::2, ::2],
        "negative": array[::-1].copy()[::-1],
        "read-only": kept,
        "unaligned": odd.reshape(array.shape),
        "big-endian": array.astype(">f8"),
        "float32": array.astype(np.float32),
        "int": array.astype(int),
    }


@pytest.mark.parametrize("layout", layouts(SQUARE))
def test_any_layout_of_an_array_is_read(layout):
    given = layouts(SQUARE)[layout]
    found = ti.match_points(given, SQUARE[::-1], "nearest-neighbour")
    assert found.assignment.tolist() == [3, 2, 1, 0]
    expected = ti.ThinPlateSpline(SQUARE, SQUARE)(SQUARE)
    assert np.array_equal(ti.ThinPlateSpline(given, SQUARE)(given), expected)


def test_frames_of_any_layout_are_read(scene):
    pipeline = ti.pipeline_of(scene)
    expected = ti.press_of(scene).contact(0).force.value
    for frame in (np.asfortranarray(scene.frames[0]), scene.frames[0][::-1].copy()[::-1]):
        press = ti.Press(pipeline, np.asfortranarray(scene.reference))
        press.add_frame(frame)
        assert press.contact(0).force.value == expected


def test_results_are_frozen():
    found = ti.match_points(SQUARE, SQUARE, "nearest-neighbour")
    with pytest.raises(ValueError):
        found.assignment[0] = 1
    with pytest.raises(AttributeError):
        found.sigma = 0.0
    assert ti.ThinPlateSpline(SQUARE, SQUARE)(np.zeros((0, 2))).shape == (0, 2)
