"""Presses and sessions: true values, results of the program, threads, memory."""

import json
import re
import signal
import subprocess
import sys
import threading
import types
import typing
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import tactile_imaging as ti
from conftest import DATA, points

SCENE = DATA / "press" / "scene.toml"


def test_three_lines_to_the_modulus_of_the_default_press(scene):
    modulus = ti.press_of(scene).modulus()
    low, high = modulus.interval_95
    assert low < scene.truth["youngs_modulus"] < high
    assert low < modulus.value < high
    assert modulus.to_dict()["estimator"] == modulus.estimator
    assert "kPa" in repr(modulus) and "<table>" in modulus._repr_html_()
    with pytest.raises(AttributeError):
        modulus.value = 1.0


def program(*arguments):
    """The JSON output of the program, from a separate process."""
    command = [sys.executable, "-m", "tactile_imaging", *map(str, arguments), "--json"]
    return json.loads(subprocess.run(command, capture_output=True, check=True).stdout)


def test_a_scene_file_has_the_bits_of_the_program():
    ours = ti.Press.from_scene(SCENE).measure()
    theirs = program("measure", SCENE)
    # Those of the program also have a sentence.
    for flag, caution in zip(ours.pop("flags"), theirs["cautions"], strict=True):
        assert caution.items() >= flag.items()
    # Its report has times.
    del ours["report"]
    # The program counts loads from one.
    for estimates in (ours["estimators"], theirs["estimators"]):
        for estimate in estimates:
            del estimate["warnings"]
    assert ours == {key: theirs[key] for key in ours}


def assert_has_shape(value, kind):
    """Compares a value with what a type checker reads of it."""
    parts = typing.get_args(kind)
    if typing.is_typeddict(kind):
        assert kind.__required_keys__ <= set(value) <= set(kind.__annotations__), kind
        for name, part in typing.get_type_hints(kind).items():
            if name in value:
                assert_has_shape(value[name], part)
    elif isinstance(kind, types.UnionType):
        kinds = [part for part in parts if typing.is_typeddict(part) == isinstance(value, dict)]
        if isinstance(value, dict):
            kinds = [part for part in kinds if ("error" in value) == ("error" in part.__annotations__)]
        fits = [part for part in kinds if isinstance(value, dict) or isinstance(value, typing.get_origin(part) or part)]
        assert_has_shape(value, fits[0])
    elif kind is not typing.Any:
        origin = typing.get_origin(kind) or kind
        assert isinstance(value, (float, int) if origin is float else origin), (value, kind)
        if origin is list:
            for entry in value:
                assert_has_shape(entry, parts[0])


def test_a_measurement_has_the_type_that_is_declared(scene):
    press = ti.press_of(scene, control_points=60)
    empty = ti.Press(ti.pipeline_of(scene), scene.reference)
    empty.add_frame(scene.reference)
    timed = ti.Press(ti.pipeline_of(scene), scene.reference)
    for second, frame in enumerate([*scene.frames, *scene.frames]):
        timed.add_frame(frame, time=second)
    for measured in (press, empty, timed, ti.Press.from_scene(SCENE)):
        assert_has_shape(measured.measure(), ti.Measurement)


def test_a_press_has_contact_surface_points_and_strain(scene):
    press = ti.press_of(scene, control_points=60)
    assert len(press) == 2 and np.array_equal(press.image(1), scene.frames[1])
    contact = press.contact(1)
    assert abs(contact.force.value / 1.2 - 1) < 0.02
    radius = scene.truth["contact_radii"][1]
    # A tenth of a pixel.
    assert abs(contact.radius.value - radius) < 0.1 * scene.pixel_size[0]
    assert np.nanmax(press.surface(1).heights) > 0
    assert press.control_points(0).shape == (60, 3)
    # Finite elements: the guide is depressed by 2.13 mm under 1.2 N.
    depth, error = press.guide_depression(1, [0.0, 5e-3])
    assert abs(depth[0] - 2.134e-3) < 1.96 * error[0] and 0 < depth[1] < depth[0]
    found = press.matching(1)
    assert len(found.pairs) > 50
    assert np.isfinite(press.strain(1).value).all()
    assert "kPa" in press.summary() and len(press.estimates()) > 1


def test_a_gauge_takes_the_place_of_a_calibration(scene):
    pipeline = ti.Pipeline(
        ti.Object.sphere(scene.radius), pixel_size=scene.pixel_size, waveguide=scene.waveguide
    )
    press = ti.Press(pipeline, scene.reference)
    for frame, force in zip(scene.frames, scene.truth["forces"]):
        press.add_frame(frame, gauge=force, gauge_error=1e-3)
    low, high = press.modulus().interval_95
    assert low < scene.truth["youngs_modulus"] < high


def test_a_sensor_is_calibrated_saved_and_loaded(tmp_path):
    sensor = ti.Sensor.calibrate(DATA / "sensor" / "calibration.toml")
    sensor.save(tmp_path / "sensor.toml")
    again = ti.Sensor.load(tmp_path / "sensor.toml")
    grey = np.linspace(0, 100, 11)
    assert np.array_equal(sensor.pressure(grey), again.pressure(grey))
    assert np.all(np.diff(sensor.pressure(grey)) > 0)
    assert ti.Pipeline(ti.Object.sphere(3e-3), sensor=again) is not None


def test_depth_is_read_from_a_table():
    y, x = np.mgrid[:64, :64] - 32.0
    # A ball of 4 mm, pressed 0.8 mm deep, with pixels of 100 µm and 50 grey levels per millimetre.
    ball = np.sqrt(np.maximum(16 - 0.01 * (x**2 + y**2), 0)) - 3.2
    depth = np.maximum(ball, 0)
    reference = np.full((64, 64), 200, np.uint8)
    frame = np.round(200 - 50 * depth).astype(np.uint8)
    table = [(0, 0), (50, 1e-3)]
    surface = ti.depth(frame, reference, table, 1e-4)
    # Half a grey level.
    assert np.nanmax(surface.heights) == pytest.approx(0.8e-3, abs=0.5e-3 / 50)
    assert ti.depth(reference, reference, table, 1e-4) is None


def test_a_lump_is_found():
    found = ti.inclusion_of_scene(DATA / "inclusion" / "scene.toml")
    (lump,) = found.lumps
    assert found.verdict == "found" and "diameter" in lump.identified and lump.x is None
    # The block of the example has 5 kPa and contains a lump of 12 mm and 40 kPa, 4 mm deep.
    low, high = found.block_modulus.interval_95
    assert low < 5e3 < high
    truth = {"diameter": 12e-3, "depth": 4e-3, "youngs_modulus": 40e3}
    for name, value in truth.items():
        low, high = getattr(lump, name).interval_95
        assert low < value < high
    assert found.to_dict()["lumps"][0]["depth"]["value"] == lump.depth.value


def test_a_lump_between_presses_has_its_place():
    found = ti.inclusion_of_scene(DATA / "inclusion" / "scan.toml", hidden=4)
    (lump,) = found.lumps
    # The lump of the example scan lies at (8, 4) mm.
    for place, truth in ((lump.x, 8e-3), (lump.y, 4e-3)):
        low, high = place.interval_95
        assert low < truth < high
    # The program prints this position with one decimal of a millimetre (docs/inclusion.md).
    hidden = found.hidden
    assert hidden.next_position == pytest.approx((-12.0e-3, -10.5e-3), abs=0.05e-3)
    assert hidden.diameters.shape == (len(hidden.depths), len(hidden.positions))


def session_answer(pipeline, scene):
    session = ti.Session(pipeline, [scene.reference])
    assert session.push(scene.reference) is None
    forces = [session.push(frame).force.value for frame in scene.frames]
    return forces, session.modulus().value


def test_eight_sessions_at_once_have_the_bits_of_one(scene):
    pipeline = ti.pipeline_of(scene)
    alone = session_answer(pipeline, scene)
    assert alone[1] == pytest.approx(ti.press_of(scene).modulus().value, rel=0.01)
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: session_answer(pipeline, scene), range(8)))
    assert answers == [alone] * 8


def test_threads_share_a_press(scene):
    press = ti.press_of(scene, control_points=60)
    with ThreadPoolExecutor(8) as pool:
        strains = list(pool.map(lambda _: press.strain(1).value[0, 0], range(8)))
    assert len(set(strains)) == 1


def test_a_session_does_not_grow():
    resource = pytest.importorskip("resource")
    scene = ti.simulate(coarser=16)
    session = ti.Session(ti.pipeline_of(scene), [scene.reference])

    def push(count):
        for k in range(count):
            session.push(scene.frames[k % 2])
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss

    before = push(1000)
    # A frame has 5.7 kB. If they were kept, 9,000 frames would take 50 MB.
    assert push(9000) - before < 4 << 10


def test_the_keyboard_stops_a_long_match():
    # Random points, for which all starts of the search are tried.
    timer = threading.Timer(0.1, signal.raise_signal, [signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        ti.match_points(points(600), points(600, seed=1), rotation="any")
    timer.join()


def test_a_press_is_drawn(scene, tmp_path):
    pytest.importorskip("matplotlib")
    figure = ti.press_of(scene).plot()
    figure.savefig(tmp_path / "press.png")
    assert (tmp_path / "press.png").stat().st_size > 1000


def test_presses_of_known_force_give_gain_and_layers(scene):
    pipeline, reference = ti.pipeline_of(scene, coupling_error=0.06), scene.reference
    # The second frame has 1.2 N, but 1.3 N are stated.
    weight = ti.CheckPress.sample(scene.frames[1], 1.3, force_error=1e-3)
    press = pipeline.with_checks(reference, [weight]).press(reference)
    press.add_frame(scene.frames[1])
    force = press.contact(0).force
    assert abs(force.value / 1.3 - 1) < 1e-6 and force.standard_error < 0.02
    # A correctly stated ball confirms the layers, and a much softer one contradicts them.
    ball = {"youngs_modulus": scene.truth["youngs_modulus"], "radius": 3e-3}
    known = ti.CheckPress.ball(scene.frames[1], 1.2, **ball)
    checked = pipeline.with_checks(reference, [known]).press(reference)
    for frame in scene.frames:
        checked.add_frame(frame)
    low, high = checked.modulus().interval_95
    assert low < scene.truth["youngs_modulus"] < high
    softer = ti.CheckPress.ball(scene.frames[1], 1.2, radius=3e-3, youngs_modulus=1e4)
    with pytest.raises(ValueError, match="contradicts the stated layers"):
        pipeline.with_checks(reference, [softer])
    assert repr(weight) == "CheckPress.sample(1.3 N)"


# What is cut from the example's scene for each row of the table in the documentation.
LEFT_OUT = {
    "nothing": None,
    "`[[check]]`": r"^\[\[check\]\].*?(?=^\[)",
    "`adhesion_error_j_per_m2`": r"^adhesion_error.*?\n",
    "one of the `[[frames]]`": r"^\[\[frames\]\]\nimage = \"frame_1.*?\n",
    "`[waveguide]`": r"^\[waveguide\]\n.*?\n",
}


@pytest.mark.parametrize("line", LEFT_OUT)
def test_the_documentation_has_what_each_line_of_the_scene_buys(line, tmp_path):
    page = (DATA.parents[1] / "docs" / "first_measurement.md").read_text(encoding="utf-8")
    stated = re.search(rf"^\| {re.escape(line)} \| (\d+) to (\d+) kPa", page, re.MULTILINE).groups()
    text = SCENE.read_text(encoding="utf-8")
    if LEFT_OUT[line]:
        text, found = re.subn(LEFT_OUT[line], "", text, count=1, flags=re.MULTILINE | re.DOTALL)
        assert found
    text = re.sub(r'"(\w+\.(?:png|csv))"', lambda name: json.dumps(str(SCENE.parent / name[1])), text)
    (tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    low, high = ti.Press.from_scene(tmp_path / "scene.toml").modulus().interval_95
    assert (round(1e-3 * low), round(1e-3 * high)) == tuple(map(int, stated))
