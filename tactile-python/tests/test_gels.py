"""Gels lit in colours or darkening, and markers: from arrays."""

import copy
import json
import pickle

import numpy as np
import pytest
import tactile_imaging as ti
from conftest import DATA

PIXEL = 5e-5
BALL = 40.0
ROWS, COLUMNS = 160, 200


def half_space(x, y, radius, ball=BALL):
    """Hertz: displacement of the face of a half-space by a ball with contact radius `radius`, in pixels."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    rho = np.maximum(np.hypot(columns - x, rows - y) / radius, 1e-9)
    outside = np.maximum(rho, 1.0)
    tail = (2 - outside**2) * np.arcsin(1 / outside) + np.sqrt(outside**2 - 1)
    return radius**2 / ball * np.where(rho < 1, 1 - rho**2 / 2, tail / np.pi)


def lit(depth, seed=0):
    """A matt face under red, green and blue lamps from three sides, with noise of one level."""
    q, p = np.gradient(depth)
    across = np.mgrid[:ROWS, :COLUMNS] / np.reshape([ROWS, COLUMNS], (2, 1, 1)) - 0.5
    frame = np.empty((ROWS, COLUMNS, 3))
    for channel in range(3):
        angle = 2 * np.pi * (channel / 3 + 0.1)
        side, height = np.cos(np.radians(35)), np.sin(np.radians(35))
        shade = side * (p * np.cos(angle) + q * np.sin(angle)) + height
        shade = np.maximum(shade / np.sqrt(1 + p**2 + q**2), 0)
        fall = 1 + 0.4 * (across[1] * np.cos(angle) + across[0] * np.sin(angle))
        frame[..., channel] = 40 + 170 * fall * shade
    noise = np.random.default_rng(seed).normal(0, 1, frame.shape)
    return np.clip(np.round(frame + noise), 0, 255).astype(np.uint8)


def presses():
    places = np.random.default_rng(1).uniform([45, 45, 12], [155, 115, 20], (10, 3))
    return [lit(half_space(*place), k + 1) for k, place in enumerate(places)]


@pytest.fixture(scope="module")
def sensor():
    layer = (4e-3, 0.48, 1e5, 1e4)
    return ti.GelSensor.calibrate(
        lit(np.zeros((ROWS, COLUMNS))),
        presses(),
        ball_radius=BALL * PIXEL,
        pixel_size=PIXEL,
        layer=layer,
    )


def test_a_press_has_the_depth_and_area_of_hertz(sensor):
    assert sensor.report.flags == [] and sensor.report.median_angle < 2
    assert sensor.report.circles.shape == (10, 3) and sensor.shape == (ROWS, COLUMNS)
    frame = sensor.read(lit(half_space(110, 70, 18, ball=60), 99))
    (contact,) = frame.contacts
    assert np.hypot(contact.x.value - 110, contact.y.value - 70) < 1
    # Half of the depth is below the rim.
    truth = PIXEL * 18**2 / 60
    assert contact.depth.value == pytest.approx(truth / 2, rel=0.1)
    assert contact.depth_below_far.value == pytest.approx(truth, rel=0.15)
    assert contact.area.value == pytest.approx(np.pi * (18 * PIXEL) ** 2, rel=0.1)
    assert frame.force.value == contact.force.value > 0
    assert frame.depth.shape == frame.labels.shape == (ROWS, COLUMNS) and frame.labels.max() == 1
    normals = frame.normals()
    assert np.allclose(np.linalg.norm(normals, axis=2), 1, atol=1e-5)
    assert normals[70, 100, 0] > 0 > normals[70, 120, 0]
    points = frame.points()
    assert points.shape == (ROWS * COLUMNS, 3)
    assert points[70 * COLUMNS + 110] == pytest.approx((110 * PIXEL, 70 * PIXEL, -frame.depth[70, 110]))
    assert contact.outline.shape[1] == 2 and frame.to_dict()["contacts"][0]["touches_edge"] is False
    assert frame.plot().axes


def test_untouched_frames_have_no_contact(sensor):
    frame = sensor.read(lit(np.zeros((ROWS, COLUMNS)), 7))
    assert frame.contacts == [] and frame.force is None and frame.flags == []


def test_frames_of_opencv_are_named_and_read_by_their_order(sensor):
    press = lit(half_space(110, 70, 18), 99)
    with pytest.raises(ti.TactileError, match='order="bgr"'):
        sensor.read(press[..., ::-1])
    swapped = ti.GelSensor.calibrate(
        lit(np.zeros((ROWS, COLUMNS)))[..., ::-1],
        [frame[..., ::-1] for frame in presses()],
        ball_radius=np.full(10, BALL * PIXEL),
        pixel_size=PIXEL,
        order="bgr",
    )
    expected = sensor.read(press).depth
    assert np.array_equal(swapped.read(np.ascontiguousarray(press[..., ::-1])).depth, expected)
    with pytest.raises(ti.TactileError, match="black"):
        sensor.read(np.zeros_like(press))


def test_a_sensor_is_saved_and_loaded(sensor, tmp_path):
    sensor.save(tmp_path / "gel.toml")
    other = ti.GelSensor.load(tmp_path / "gel.toml")
    press = lit(half_space(90, 80, 15), 5)
    assert np.array_equal(other.read(press).depth, sensor.read(press).depth)
    assert other.read(press).force.value == sensor.read(press).force.value
    assert other.report is None
    example = ti.GelSensor.calibrate_file(DATA / "colour" / "calibration.toml")
    assert example.shape == (90, 120)


@pytest.mark.parametrize(
    "call",
    [
        lambda s: s.read(np.zeros((ROWS, COLUMNS), np.uint8)),
        lambda s: s.read(np.zeros((ROWS, COLUMNS, 3))),
        lambda s: s.read(np.zeros((ROWS, COLUMNS + 1, 3), np.uint8)),
        lambda s: ti.GelSensor.load(__file__),
        lambda s: ti.GelSensor.calibrate(
            np.zeros((9, 9, 3), np.uint8), [], ball_radius=1e-3, pixel_size=1e-4
        ),
        lambda s: ti.GelSensor.calibrate(
            lit(np.zeros((ROWS, COLUMNS))), presses(), ball_radius=1e-3, pixel_size=-1.0
        ),
        lambda s: ti.GelSensor.load("absent.toml", order="rbg"),
        lambda s: ti.markers(np.zeros((4, 4)), np.zeros((4, 4))),
        lambda s: ti.markers(np.zeros((40, 40), np.uint8), np.zeros((40, 41), np.uint8)),
    ],
)
def test_bad_calls_are_a_sentence(sensor, call):
    with pytest.raises(ValueError, match=".{15}"):
        call(sensor)


def dots(shift):
    rows, columns = np.mgrid[:120, :160]
    x, y = columns - shift[0], rows - shift[1]
    near = np.hypot((x + 10) % 20 - 10, (y + 10) % 20 - 10)
    # The whole lattice is visible.
    inside = (x > 15) & (x < 145) & (y > 15) & (y < 105)
    return np.where(inside & (near < 4.5), 60, 180).astype(np.uint8)


def test_markers_move_as_the_gel_does():
    found = ti.markers(dots((0, 0)), dots((2, -1)))
    assert found.positions.shape == found.displacements.shape and len(found.positions) > 20
    assert np.allclose(found.displacements, (2, -1), atol=0.1)
    colours = np.repeat(dots((0, 0))[..., None], 3, axis=2)
    assert np.array_equal(ti.markers(colours, colours).positions, found.positions)
    with pytest.raises(ti.TactileError, match="no markers"):
        ti.markers(np.full((40, 40), 90, np.uint8), np.full((40, 40), 90, np.uint8))


def darkened(depth, seed=0):
    """A gel that darkens by 90 levels per millimetre, with noise of one level."""
    noise = np.random.default_rng(seed).normal(0, 1, depth.shape)
    return np.clip(np.round(180 - 90 * depth + noise), 0, 255).astype(np.uint8)


def dent(x, y, contact, ball=4.0):
    """A ball of 4 mm in contact up to `contact` mm, and a dent that decays outside, in mm."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    r = 1e3 * PIXEL * np.hypot(columns - x, rows - y)
    rim = np.sqrt(ball**2 - contact**2)
    around = 0.6 * contact / rim
    inside = around + np.sqrt(np.maximum(ball**2 - r**2, 0)) - rim
    return np.where(r < contact, inside, around * np.exp(-(r - contact) / 0.6))


def test_a_gel_that_darkens_is_calibrated_by_balls_or_a_table(tmp_path):
    places = np.random.default_rng(3).uniform([80, 70, 1.0], [120, 90, 2.0], (8, 3))
    flat = darkened(np.zeros((ROWS, COLUMNS)))
    frames = [darkened(dent(*place), k + 1) for k, place in enumerate(places)]
    gauge = [(frame, place[2] ** 3) for frame, place in zip(frames, places)]
    by_balls = ti.GelSensor.calibrate(
        flat, frames, ball_radius=4e-3, pixel_size=PIXEL, gauge=gauge
    )
    assert by_balls.report.flags == []
    by_table = ti.GelSensor.darkening(flat, [[0, 0], [90, 1e-3]], pixel_size=PIXEL)
    truth = dent(100, 80, 1.4)
    for sensor in (by_balls, by_table):
        (contact,) = sensor.read(darkened(truth, 50)).contacts
        assert contact.depth_below_far.value == pytest.approx(1e-3 * truth.max(), abs=2.5e-5)
    assert by_table.read(frames[0]).force is None
    force = by_balls.read(darkened(truth, 51)).force
    assert abs(force.value - 1.4**3) < 3 * force.standard_error
    by_balls.save(tmp_path / "dark.toml")
    loaded = ti.GelSensor.load(tmp_path / "dark.toml")
    assert loaded.read(frames[0]).force.value == by_balls.read(frames[0]).force.value
    with pytest.raises(ValueError, match="grey levels are needed"):
        by_table.read(lit(np.zeros((ROWS, COLUMNS))))
    with pytest.raises(ti.TactileError, match="the frame is black"):
        by_table.read(np.zeros((ROWS, COLUMNS), np.uint8))


def test_sensors_and_frames_are_copied_and_sent(sensor):
    frame = sensor.read(lit(half_space(110, 70, 18, ball=60), 99))
    for again in (pickle.loads(pickle.dumps(sensor)), copy.copy(sensor), copy.deepcopy(sensor)):
        assert again.read(lit(half_space(110, 70, 18, ball=60), 99)) == frame
    for again in (pickle.loads(pickle.dumps(frame)), copy.deepcopy(frame)):
        assert again == frame and repr(again) == repr(frame)
    assert ti.GelFrame.from_dict(frame.to_dict()) == frame
    assert ti.GelFrame.from_dict(json.loads(json.dumps(frame.to_dict(plain=True)))) == frame
    with pytest.raises(ti.TactileError, match="no printed dots"):
        sensor.follower()


def dotted(frame, shift=0.0):
    """Dots of 3 px every 20 px, moved along x."""
    rows, columns = np.mgrid[:ROWS, :COLUMNS]
    x, y = (columns - 10 - shift + 10) % 20 - 10, rows % 20 - 10
    cover = 1 / (1 + np.exp(2 * (np.hypot(x, y) - 3)))
    return np.round(frame * (1 - 0.8 * cover)[..., None]).astype(np.uint8)


def test_a_follower_gives_shear_and_slip():
    still = dotted(lit(np.zeros((ROWS, COLUMNS))))
    balls = [dotted(frame) for frame in presses()]
    sensor = ti.GelSensor.calibrate(still, balls, ball_radius=BALL * PIXEL, pixel_size=PIXEL, layer=(4e-3, 0.48, 1e5, 0.0))
    assert sensor.has_dots
    press = lit(half_space(110, 70, 30, ball=100), 99)
    live = sensor.follower()
    for shift in (0.0, 1.0, 2.0, 3.0, 4.0):
        frame = live.read(dotted(press, shift))
    # 80 cells of a square millimetre move by 0.2 mm on a layer of 4 mm. The lit slopes under a dot move its centre by a twentieth of
    # a pixel, in common.
    stiffness = 1e5 / 2 / 1.48 / 4e-3 * 80e-6
    along, across = (part.value for part in frame.shear)
    assert abs(along - stiffness * 4 * PIXEL) < stiffness * 0.05 * PIXEL and abs(across) < stiffness * 0.05 * PIXEL
    assert frame.slip == 0.0 and frame.torque.standard_error > 0
    assert sensor.read(dotted(press, 4.0)).shear is None
    assert pickle.loads(pickle.dumps(frame)) == frame
    # Without visible dots the face is read, and a flag gives the reason.
    hidden = live.read(press)
    assert hidden.force is not None and hidden.shear is None and len(hidden.flags) == 1
