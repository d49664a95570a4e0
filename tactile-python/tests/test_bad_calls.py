"""Bad calls are a clear exception, odd arrays the right answer."""

import numpy as np
import pytest
import tactile_imaging as ti

SQUARE = np.array([[0.0, 0], [1, 0], [0, 1], [1, 1]])
NAN = np.full((4, 2), np.nan)
BALL = ti.Object.sphere(3e-3)
PAIRS = [[0.0, 0.0], [1e5, 1.0], [2e5, 2.0]]


def press():
    return ti.Pipeline(BALL, pairs=PAIRS, pixel_size=1e-4).press(np.zeros((20, 20), np.uint8))


VALUES = [
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
    (OverflowError, lambda: press().contact(-1)),
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
