#!/usr/bin/env python3
"""Ordinary faults of a bench, each alone and at two sizes: is an answer right, cautioned, refused, or wrong in silence?

    python3 evidence/bench_faults.py target/release/tactile            # counts, and the cases that went wrong
    python3 evidence/bench_faults.py target/release/tactile --all      # a line per case
    python3 evidence/bench_faults.py target/release/tactile scratch    # only faults whose name contains a word
    python3 evidence/bench_faults.py target/release/tactile --light 100   # room light ± 15 grey with lamps ± 10 %
    python3 evidence/bench_faults.py target/release/tactile --calibrations 40   # layers found from rigid balls

Frames are drawn from presses by finite elements (tests/data), which share no law with the estimator. Each fault is asked by
`measure` and `stream` (modulus) and `force` (force of the smaller load) under a fixed skin. An answer is

    right       its 95 % interval contains the truth, and it has no caution
    cautioned   it has a caution
    wider       its interval is more than three times as wide as without the fault
    refused     there is no answer
    silent      its interval does not contain the truth, and there is no caution.

Of three kinds of fault, the first must be right, cautioned or refused. A small fault moves the answer by less than a third of its
interval: it may be named, but neither refused nor widened more than threefold. No word is due to a harmless one.
Mistakes in statements that frames cannot show are counted apart.
"""
import argparse
import collections
import csv
import json
import math
import pathlib
import random
import subprocess
import tempfile

from example_data import BALLS, CONTACT_M, GREY_PER_PA, PIXEL_M, SMALL, png, sensor_calibration, sensor_presses

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Table of presses, modulus, radius, layers, two forces, side of the contact's centre from that of the frame (px), even background.
SCENES = {
    "three layers, 103 kPa": ("calculix", 103e3, 0.003, [(2e-3, 136e3), (3e-3, 80e3), (5e-3, 34e3)], [0.1391261, 0.4711676], (3.3, -2.4), False),
    "three layers, 75 kPa": ("calculix", 75e3, 0.006, [(2e-3, 136e3), (3e-3, 80e3), (5e-3, 34e3)], [0.3291946, 0.6878776], (-2.1, 1.7), True),
    "one layer, 60 kPa": ("finite_element", 60e3, 0.003, [(7.5e-3, 80e3)], [0.08, 0.2], (0.4, 3.2), False),
    "one layer, 103 kPa": ("calculix", 103e3, 0.004, [(5e-3, 110e3)], [0.2417782, 0.5000749], (-0.6, 0.3), False),
}
ROWS, COLUMNS = 130, 174
# Radius of the larger contact in pixels, and the light of its pressure.
RADIUS_PX, PEAK_GREY = 36.0, 170.0
READ_GREY, SHOT = 0.5, 0.02
TIMES_WIDER = 3.0
# Cautions about surface, match and strain do not concern forces and moduli.
ASIDE = {"coarse_strain", "unmatched", "match_not_converged", "folded", "frame_left_out", "input_left_out"}
EVERY = ["right", "cautioned", "wider", "refused", "silent"]
KINDS = ["fault", "statement", "small", "harmless"]


def pressures(table, modulus, radius, layers, force):
    """Pairs of radius and pressure, and the contact radius."""
    stack = ";".join(f"{t:g}:{e:g}" for t, e in layers)
    rows = []
    with open(ROOT / f"tests/data/{table}_presses.csv", newline="") as file:
        _, *lines = csv.reader(file)
    for e, ball, guide, newton, a, _, r, p, _ in lines:
        same = ";".join(f"{float(t):g}:{float(m):g}" for t, m in (pair.split(":") for pair in guide.split(";") if pair)) == stack
        if same and float(e) == modulus and float(ball) == radius and math.isclose(float(newton), force, rel_tol=1e-6):
            rows.append((float(r), float(p), float(a)))
    return sorted((r, p) for r, p, _ in rows), rows[0][2]


class World:
    """What the fault changes. All light is in grey levels, before noise."""

    def __init__(self, scene, seed):
        self.table, self.modulus, self.radius_m, self.layers, self.forces, self.shift, self.even = scene
        found = [pressures(self.table, self.modulus, self.radius_m, self.layers, f) for f in self.forces]
        self.profiles = [profile for profile, _ in found]
        self.pixel_m = found[1][1] / RADIUS_PX
        self.per_pa = PEAK_GREY / self.profiles[1][0][1]
        self.seed = seed
        self.lamps = self.stray = 0.0           # change since the calibration
        self.lamps_later = self.stray_later = 0.0  # change since the reference
        self.side = 0.0                         # the lamps of one side
        self.noise, self.row_noise = 1.0, 0.0
        self.gamma = 1.0
        self.barrel = self.vignette = 0.0
        self.stretch = 1.0                      # longer over shorter axis of the contact
        self.skew = self.halo = 0.0
        self.blur = 0
        self.exponent = 1.0
        self.places = [self.shift, self.shift]
        self.pressed_reference = False
        self.averaged = 1                       # frames in the mean of the reference
        self.light = []                         # functions (row, column, frame or None) -> grey
        self.change = []                        # functions of the stored frame (list of rows, frame or None)
        self.extra = []                         # further frames of the scene
        self.edits = []                         # changes of the calibration's pairs
        self.way_back = 0.0                     # more light of the smaller load, which is the second frame
        self.calibration_light = True
        self.scale = {"pixel": 1.0, "radius": 1.0, "thickness": 1.0, "modulus": 1.0}

    def pairs(self):
        random.seed(self.seed + 7)
        top = 1.3 * self.forces[1]
        # The calibration's gauge has a noise of a thousandth of its range.
        levels = [*range(11), *range(9, -1, -1)]
        # Light as the power e of the pressure under a ball: the sum grows with the force as F^((2 + e)/3).
        profile, peak = self.profiles[1], self.profiles[1][0][1]
        rings = [((r1**2 - r0**2), 0.5 * (p0 + p1) / peak) for (r0, p0), (r1, p1) in zip(profile, profile[1:])]
        e = self.exponent
        share = sum(area * p**e for area, p in rings) / sum(area * p for area, p in rings)
        light = lambda f: self.per_pa * self.forces[1] / self.pixel_m**2 * share * (f / self.forces[1]) ** ((2 + e) / 3)
        rows = [(light(f), f + 1e-3 * top * random.gauss(0, 1)) for f in (0.1 * top * k for k in levels)]
        for edit in self.edits:
            rows = edit(rows)
        return rows

    def background(self, r, c):
        x, y = (c - 86.5) / 87, (r - 64.5) / 65
        return 22.0 if self.even else 22.0 + 6.0 * x - 3.0 * y + 5.0 * x * y + 2.0 * math.sin(9 * x + 4 * y)

    def pressure(self, frame, r, c, inside=False):
        x0, y0 = self.places[frame]
        x, y = c - 86.5, r - 64.5
        if self.barrel:
            # The lens moves a point at radius s to s (1 - k s²/S²): undo it.
            s2 = (x * x + y * y) / 87.0**2
            x, y = x * (1 + self.barrel * s2), y * (1 + self.barrel * s2)
        root = math.sqrt(self.stretch)
        x, y = (x - x0) * self.pixel_m * root, (y - y0) * self.pixel_m / root
        r_m, profile = math.hypot(x, y), self.profiles[frame]
        # A pixel at the rim sees the mean over itself.
        if not inside and abs(r_m - profile[-1][0]) < 1.5 * self.pixel_m:
            steps = [-0.375, -0.125, 0.125, 0.375]
            return sum(self.pressure(frame, r + u, c + v, True) for u in steps for v in steps) / 16
        if r_m >= profile[-1][0]:
            return 0.0
        # p² is nearly linear in r².
        low, high = 0, len(profile) - 1
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (middle, high) if profile[middle][0] <= r_m else (low, middle)
        (r0, p0), (r1, p1) = profile[low], profile[high]
        t = (r_m**2 - r0**2) / (r1**2 - r0**2)
        return math.sqrt(max(p0**2 + t * (p1**2 - p0**2), 0.0)) * (1 + self.skew * x / profile[-1][0])

    def lit(self, r, c, frame, calibrated=False):
        peak = self.profiles[1][0][1]
        signal = 0.0
        if frame is not None or self.pressed_reference and not calibrated:
            p = self.pressure(frame if frame is not None else 0, r, c) * (1 if frame is not None else 0.3)
            signal = self.per_pa * peak * (p / peak) ** self.exponent if p > 0 else 0.0
            signal *= 1 + self.way_back if frame == 0 else 1
        lamps, stray = (0.0, 0.0) if calibrated else (self.lamps, self.stray)
        if frame is not None:
            lamps, stray = lamps + self.lamps_later, stray + self.stray_later
        side = 0.0 if calibrated else self.side
        x, y = (c - 86.5) / 87, (r - 64.5) / 65
        lens = 1 - self.vignette * (x * x + y * y) / 2
        grey = (1 + lamps) * (1 + side * x) * lens * (self.background(r, c) + signal) + stray
        return grey + (0.0 if calibrated else sum(light(r, c, frame) for light in self.light))

    def image(self, frame, calibrated=False, averaged=1, seed=0):
        """One frame in 8 bits, or the rounded mean of several."""
        random.seed(f"{self.seed} {frame} {calibrated} {seed}")
        grey = [[self.lit(r, c, frame, calibrated) for c in range(COLUMNS)] for r in range(ROWS)]
        if self.blur and not calibrated:
            grey = blurred(grey, self.blur)
        if self.halo and not calibrated:
            # A share of the contact's light is spread over the frame.
            spread = sum(map(sum, grey)) / (ROWS * COLUMNS) - sum(self.background(r, c) for r in range(ROWS) for c in range(COLUMNS)) / (ROWS * COLUMNS)
            grey = [[g - self.halo * (g - self.background(r, c)) + self.halo * spread for c, g in enumerate(row)] for r, row in enumerate(grey)]
        noise, rows = (1.0, 0.0) if calibrated else (self.noise, self.row_noise)
        image = []
        for row in grey:
            of_row, line = random.gauss(0, rows) if rows else 0.0, []
            for g in row:
                sd = noise * math.sqrt((READ_GREY**2 + SHOT * max(g, 0.0)) / averaged)
                g += of_row / math.sqrt(averaged) + random.gauss(0, sd)
                if self.gamma != 1.0 and not calibrated:
                    g = 255 * (max(g, 0.0) / 255) ** self.gamma
                line.append(min(255, max(0, round(g))))
            image.append(line)
        for change in self.change if not calibrated else []:
            change(image, frame)
        return image

    def write(self, folder):
        frames = [self.image(k) for k in ([1, 0] if self.way_back else [0, 1])] + [make(self) for make in self.extra]
        for k, image in enumerate(frames):
            (folder / f"frame_{k}.png").write_bytes(png(image))
        (folder / "reference.png").write_bytes(png(self.image(None, averaged=self.averaged, seed=1)))
        (folder / "calibration.png").write_bytes(png(self.image(None, calibrated=True)))
        rows = "".join(f"{value:.1f},{force:.7f}\n" for value, force in self.pairs())
        (folder / "pairs.csv").write_text("integrated_pixel_value,force_N\n" + rows)
        s = self.scale
        layers = ", ".join(f"{{ refractive_index = 1.41, thickness_m = {s['thickness'] * t}, youngs_modulus_pa = {s['modulus'] * e}, poisson_ratio = 0.5 }}" for t, e in self.layers)
        named = 'reference = "calibration.png"\n' if self.calibration_light else ""
        (folder / "scene.toml").write_text(f"""reference = "reference.png"
pixel_size_m = [{s['pixel'] * self.pixel_m}, {s['pixel'] * self.pixel_m}]
coupling_error = "exact"
layer_error = 0.01
[calibration]
pairs = "pairs.csv"
{named}{"".join(f'[[frames]]{chr(10)}image = "frame_{k}.png"{chr(10)}' for k in range(len(frames)))}[object]
shape = "sphere"
radius_m = {s['radius'] * self.radius_m}
poisson_ratio = 0.5
poisson_ratio_error = "exact"
radius_error_m = {2e-3 * self.radius_m}
adhesion_error_j_per_m2 = "exact"
[waveguide]
layers = [{layers}]
""")
        return len(frames)


def blurred(grey, half):
    for _ in range(2):
        sums = []
        for row in grey:
            padded = [row[0]] * half + row + [row[-1]] * half
            total, line = sum(padded[:2 * half + 1]), []
            for c in range(len(row)):
                line.append(total / (2 * half + 1))
                if c + 1 < len(row):
                    total += padded[c + 2 * half + 1] - padded[c]
            sums.append(line)
        grey = [list(column) for column in zip(*sums)]
    return grey


# Faults: name, kind, what it does to a world at two sizes.

def put(**values):
    def change(world):
        for name, value in values.items():
            setattr(world, name, value)
    return change


def spot(row, column, radius, grey, frames=(0, 1)):
    def light(r, c, frame):
        inside = (r - row) ** 2 + (c - column) ** 2 <= radius**2
        return grey if inside and frame in frames else 0.0
    return lambda world: world.light.append(light)


def hot(count):
    def change(world):
        random.seed(world.seed)
        pixels = [(round(64 + random.uniform(-15, 15)), round(86 + random.uniform(-15, 15))) for _ in range(count)]

        def burn(image, _):
            for r, c in pixels:
                image[r][c] = 255
        world.change.append(burn)
    return change


def scratch(grey, later):
    def light(r, c, frame):
        near = abs((r - 20) - 0.4 * (c - 90)) < 1.0 and 60 < c < 160
        return grey if near and (frame is not None or not later) else 0.0
    return lambda world: world.light.append(light)


def bands(grey):
    def light(r, c, frame):
        return grey * math.sin(2 * math.pi * r / 31 + (0.0 if frame is None else 1.3 + 2.1 * frame))
    return lambda world: world.light.append(light)


def interlaced(pixels):
    def change(world):
        def shift(image, frame):
            if frame is not None:
                for r in range(1, ROWS, 2):
                    image[r][:] = image[r][pixels:] + image[r][-1:] * pixels
        world.change.append(shift)
    return change


def crumb(radius):
    """At the rim of the larger contact."""
    def change(world):
        x, y = world.shift
        spot(64.5 + y + 0.6 * RADIUS_PX, 86.5 + x + 0.75 * RADIUS_PX, radius, 60.0)(world)
    return change


def pairs(edit):
    def change(world):
        world.edits.append(edit)
    return change


def one_pair(factor):
    return lambda rows: [(v, f * factor if k == 13 else f) for k, (v, f) in enumerate(rows)]


def further(kind):
    def make(world):
        if kind == "empty":
            return world.image(None, seed=9)
        if kind == "saturated":
            return [[min(255, 3 * g) for g in row] for row in world.image(1, seed=9)]
        return [[0] * COLUMNS for _ in range(ROWS)]
    return lambda world: world.extra.append(make)


def stated(name, factor):
    return lambda world: world.scale.__setitem__(name, factor)


def annulus(sign):
    """A wet ring outside the contact, or the dark rim of a tacky ball."""
    def change(world):
        def light(r, c, frame):
            if frame is None:
                return 0.0
            x0, y0 = world.shift
            a = world.profiles[frame][-1][0] / world.pixel_m
            s = math.hypot(c - 86.5 - x0, r - 64.5 - y0)
            return sign if a < s < a + 6 else 0.0
        world.light.append(light)
    return change


def lamp_of_four(loss):
    def light(world):
        def lit(r, c, frame):
            return -loss * world.background(r, c) * math.exp(-((c - 10) ** 2 + (r - 10) ** 2) / 60.0**2)
        world.light.append(lit)
    return light


def clip_black(grey):
    def change(world):
        world.stray -= grey
    return change


def rising(way_back):
    def change(world):
        world.edits.append(lambda rows: rows[:11])
        world.way_back = way_back
    return change


GRAVITY = 9.80665
FAULTS = [
    ("none", "harmless", put(), put()),
    ("lamps since the calibration", "fault", put(lamps=0.05), put(lamps=-0.1)),
    ("room light", "fault", put(stray=4.0), put(stray=15.0)),
    ("room light and lamps", "fault", put(stray=15.0, lamps=-0.1), put(stray=-8.0, lamps=0.1)),
    ("lamps since the reference", "fault", put(lamps_later=0.02), put(lamps_later=-0.05)),
    ("room light since the reference", "fault", put(stray_later=1.0), put(stray_later=4.0)),
    ("lamps of one side", "fault", put(side=0.1), put(side=0.3)),
    ("one lamp of four", "fault", lamp_of_four(0.3), lamp_of_four(0.9)),
    ("black level lower, clipped", "fault", clip_black(8), clip_black(30)),
    ("camera gamma", "fault", put(gamma=0.9), put(gamma=0.7)),
    ("light as a power of pressure", "fault", put(exponent=0.9), put(exponent=1.15)),
    ("hot pixels under the contact", "harmless", hot(1), hot(5)),
    ("rounded mean as reference", "harmless", put(averaged=4), put(averaged=64)),
    ("noise of rows", "harmless", put(row_noise=0.3), put(row_noise=0.6)),
    ("glowing scratch", "small", scratch(5.0, True), scratch(15.0, True)),
    ("scratch in all frames", "small", scratch(5.0, False), scratch(15.0, False)),
    ("50 Hz bands", "small", bands(0.7), bands(2.0)),
    ("noise", "harmless", put(noise=3.0), put(noise=6.0)),
    ("interlacing", "small", interlaced(1), interlaced(2)),
    ("defocus", "harmless", put(blur=1), put(blur=2)),
    ("slant", "small", put(skew=0.1), put(skew=0.2)),
    ("ellipse", "small", put(stretch=1.02), put(stretch=1.05)),
    ("crumb at the rim", "small", crumb(2), crumb(4)),
    ("bright spot elsewhere", "small", spot(20, 30, 3, 40.0), spot(110, 150, 6, 80.0)),
    ("halo", "fault", put(halo=0.03), put(halo=0.08)),
    ("vignetting, contact aside", "fault", put(vignette=0.1, places=[(30.0, 12.0)] * 2), put(vignette=0.3, places=[(30.0, 12.0)] * 2)),
    ("barrel distortion, mid-frame", "statement", put(barrel=0.03), put(barrel=0.1)),
    ("pressed reference", "fault", put(pressed_reference=True), put(pressed_reference=True, lamps=0.02)),
    ("wet ring", "fault", annulus(8.0), annulus(40.0)),
    ("tacky rim", "fault", annulus(-8.0), annulus(-18.0)),
    ("a frame without contact", "harmless", further("empty"), further("black")),
    ("a saturated frame", "harmless", further("saturated"), further("saturated")),
    ("forces in grams", "statement", pairs(lambda rows: [(v, f / GRAVITY * 1e3) for v, f in rows]), pairs(lambda rows: [(v, f / GRAVITY) for v, f in rows])),
    ("forces in millinewtons", "statement", pairs(lambda rows: [(v, 1e3 * f) for v, f in rows]), pairs(lambda rows: [(v, 1e-3 * f) for v, f in rows])),
    ("gauge not zeroed", "statement", pairs(lambda rows: [(v, f + 0.01 * rows[10][1]) for v, f in rows]), pairs(lambda rows: [(v, f + 0.05 * rows[10][1]) for v, f in rows])),
    ("a mistyped pair", "statement", pairs(one_pair(10.0)), pairs(one_pair(1.2))),
    ("way back, calibrated by rising forces", "fault", rising(0.02), rising(0.05)),
    ("pixel size in other units", "statement", stated("pixel", 1e3), stated("pixel", 2.0)),
    ("radius in other units", "statement", stated("radius", 1e3), stated("radius", 2.0)),
    ("the layers' units", "statement", stated("thickness", 1e3), stated("modulus", 1e3)),
    ("the calibration's light not kept", "fault", put(calibration_light=False, lamps=0.05), put(calibration_light=False, lamps=-0.1)),
]


def ask(program, folder, *words):
    done = subprocess.run([program, *words, "--json"], cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL)
    last = [line for line in done.stdout.splitlines() if line.strip()]
    for text in (done.stdout, last[-1] if last else ""):
        try:
            return json.loads(text), done.stderr
        except ValueError:
            continue
    return {}, done.stderr


def cautions_of(value):
    """Those about forces and moduli, and not about a frame that is left out."""
    return [c for c in value.get("cautions", []) if c.get("kind") not in ASIDE and c.get("frame", 1) <= 2]


def interval(value):
    """Lower and upper end of a modulus. `None` without one."""
    value = value or {}
    ends = value.get("interval_95") or (value.get("Ok") or {}).get("interval_95")
    return ends and [ends[0] or 0.0, ends[1] if ends[1] is not None else math.inf]


def answers(program, folder, world, ways=("measure", "stream", "force")):
    """Name, truth, interval, cautions and refusal of each way to ask."""
    pixel_um = 1e6 * world.scale["pixel"] * world.pixel_m
    light = ["--pairs-reference", "calibration.png"] if world.calibration_light else []
    for way in [way for way in ways if way != "force"]:
        value, said = ask(program, folder, way, "scene.toml")
        modulus = value.get("youngs_modulus_pa", {})
        yield way, world.modulus, interval(modulus), cautions_of(value), str(modulus.get("error") or modulus.get("Err") or said.strip())[-150:]
    files = ["frame_0.png", "frame_1.png"] if world.way_back else ["frame_0.png"]
    words = ["force", "--reference", "reference.png", "--pairs", "pairs.csv", *light, "--skin", "--pixel-um", f"{pixel_um:g}", *files]
    value, said = ask(program, folder, *words)
    frames = value.get("frames") or [{}]
    force = ((frames[-1].get("contact") or {}).get("force_n")) or None
    ends = force and [force["value"] - 1.96 * force["standard_error"], force["value"] + 1.96 * force["standard_error"]]
    yield "force", world.forces[0], ends, cautions_of(value), str(frames[-1].get("error") or said.strip())[-150:]


def judge(truth, ends, cautions, plain):
    if ends is None:
        return "refused"
    if plain and ends[1] - ends[0] > TIMES_WIDER * (plain[1] - plain[0]):
        return "wider"
    if cautions:
        return "cautioned"
    return "right" if ends[0] <= truth <= ends[1] else "silent"


def is_wrong(kind, found):
    allowed = {"small": ("right", "cautioned"), "harmless": ("right",)}
    return found == "silent" or found not in allowed.get(kind, EVERY)


def changed_light(program, count):
    """Forces after draws of room light and lamps since the calibration, where the background is uneven."""
    scenes = [scene for scene in SCENES.values() if not scene[-1]]
    errors, half_widths, inside = [], [], 0
    for k in range(count):
        world = World(scenes[k % len(scenes)], 1000 + k)
        random.seed(f"light {k}")
        world.stray, world.lamps = random.uniform(-15, 15), random.uniform(-0.1, 0.1)
        with tempfile.TemporaryDirectory() as folder:
            world.write(pathlib.Path(folder))
            truth, ends = next((truth, ends) for way, truth, ends, *_ in answers(program, pathlib.Path(folder), world, ["force"]))
        errors.append(abs((ends[0] + ends[1]) / 2 / truth - 1))
        half_widths.append((ends[1] - ends[0]) / 2 / truth)
        inside += ends[0] <= truth <= ends[1]
    errors.sort()
    half_widths.sort()
    print(f"force inside its interval in {inside} of {count}; error: median {100 * errors[count // 2]:.2f} %, 95 of 100 below "
          f"{100 * errors[int(0.95 * count)]:.2f} %; half width: median {100 * half_widths[count // 2]:.2f} %, 95 of 100 below "
          f"{100 * half_widths[int(0.95 * count)]:.2f} %")


def calibrations(program, count):
    """The layer found from two rigid balls on 100 kPa (contact radii by finite elements), every input wrong by its stated error."""
    deviations = []
    for k in range(count):
        random.seed(f"calibration {k}")
        pixel_m = [PIXEL_M * (1 + 1e-3 * random.gauss(0, 1)) for _ in range(2)]
        gauge = 1 + 1e-3 * random.gauss(0, 1)
        radii = {ball: ball * (1 + 1e-6 / ball * random.gauss(0, 1)) for ball, *_ in BALLS}

        def image(ball, force):
            a = CONTACT_M[ball, force] * (radii[ball] / ball) ** (1 / 3) if force else 1.0
            peak = GREY_PER_PA * 3 * force / (2 * math.pi * a * a)

            def level(r, c):
                share = ((pixel_m[1] * (r - 35.2)) ** 2 + (pixel_m[0] * (c - 35.8)) ** 2) / (a * a)
                grey = 10 + peak * math.sqrt(max(1 - share, 0.0))
                return round(grey + random.gauss(0, math.sqrt(READ_GREY**2 + SHOT * grey)))
            return png([[level(r, c) for c in range(SMALL)] for r in range(SMALL)])
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            (folder / "reference.png").write_bytes(image(0.0, 0.0))
            parts = sensor_calibration().split("force_N = ")
            for number, ball, force, _ in sensor_presses():
                (folder / f"press_{number:02}.png").write_bytes(image(ball, force))
                rest = parts[number].partition("\n")[2]
                parts[number] = f"{force * gauge + 2e-5 * random.gauss(0, 1):.7f}\n{rest}"
            (folder / "calibration.toml").write_text("force_N = ".join(parts))
            value, said = ask(program, folder, "calibrate", "calibration.toml")
        if not value:
            print(said.strip())
            continue
        found = next(layer["fitted"] for layer in value["layers"] if layer["parameter"] == "youngs_modulus_pa")
        deviations.append((found["value"] - 100e3) / found["standard_error"])
    inside = sum(abs(d) <= 1.96 for d in deviations)
    print(f"layer inside its interval in {inside} of {len(deviations)}; deviations in standard errors: "
          f"mean {sum(deviations) / len(deviations):+.2f}, root mean square {math.sqrt(sum(d * d for d in deviations) / len(deviations)):.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("word", nargs="?", default="")
    parser.add_argument("--all", action="store_true", help="print every case")
    parser.add_argument("--light", type=int, metavar="COUNT", help="draw changes of the light instead")
    parser.add_argument("--calibrations", type=int, metavar="COUNT", help="draw calibrations from balls instead")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    program = options.program.resolve()
    if options.calibrations:
        return calibrations(program, options.calibrations)
    if options.light:
        return changed_light(program, options.light)
    kept, widths = collections.defaultdict(collections.Counter), collections.defaultdict(list)
    for name, scene in SCENES.items():
        plain = {}
        for fault, kind, *sizes in FAULTS:
            if options.word not in fault and fault != "none":
                continue
            for size, change in enumerate(sizes if fault != "none" else sizes[:1]):
                world = World(scene, 100 * options.seed + size)
                change(world)
                with tempfile.TemporaryDirectory() as folder:
                    folder = pathlib.Path(folder)
                    world.write(folder)
                    for way, truth, ends, cautions, said in answers(program, folder, world):
                        if fault == "none":
                            plain[way] = ends
                            widths[way].append((ends[1] - ends[0]) / 2 / truth if ends else math.inf)
                        found = judge(truth, ends, cautions, plain.get(way))
                        kept[fault, kind][found] += 1
                        if is_wrong(kind, found) or options.all:
                            off = [f"{100 * (end / truth - 1):+.1f}" for end in ends] if ends else said
                            usual = [f"{100 * (end / truth - 1):+.1f}" for end in plain[way]] if plain.get(way) else "?"
                            print(f"{found:9} {fault} [{size + 1}], {name}, {way}: {off} % (usual {usual}), {[c.get('kind') for c in cautions]}", flush=True)
    print("\n| fault | kind | " + " | ".join(EVERY) + " |\n|---|---|" + "---|" * len(EVERY))
    for (fault, kind), counts in sorted(kept.items(), key=lambda row: KINDS.index(row[0][1])):
        print(f"| {fault} | {kind} | " + " | ".join(str(counts[k]) for k in EVERY) + " |")
    print()
    for kind in KINDS:
        rows = [counts for (_, other), counts in kept.items() if other == kind]
        wrong = sum(count for counts in rows for found, count in counts.items() if is_wrong(kind, found))
        print(f"{kind}: {wrong} of {sum(sum(counts.values()) for counts in rows)} answers wrong")
    print("half widths without a fault: " + ", ".join(f"{way} {100 * sum(w) / len(w):.2f} %" for way, w in widths.items()))


if __name__ == "__main__":
    main()
