#!/usr/bin/env python3
"""Known displacement fields measured by `tactile strain`: how often the stated 95 % intervals contain the gradient, and the errors.

    python3 -m venv V && V/bin/pip install numpy
    V/bin/python evidence/displacement_fields.py PROGRAM [SEEDS] [SIZES]

Seven fields in the plane and in space, on grids, jittered grids and random points of mean spacing 1, with noise of 0, 0.01, 0.1
and 0.3 spacings: 168 fields per size and seed. Each is a table of known pairs (columns x, y, z, u, v, w). A row for each class:
gradients inside 1.96 standard errors, those of the steepest tenth of the points, right pairs that were left out, and the
median over the fields of the root mean square error over the largest gradient. Points within one spacing of an inclusion's
edge, where the gradient jumps, are not counted.
"""
import collections, csv, json, pathlib, subprocess, sys, tempfile
import numpy as np

program = pathlib.Path(sys.argv[1]).resolve()
seeds = int(sys.argv[2]) if len(sys.argv) > 2 else 1
sizes = [int(n) for n in sys.argv[3].split(",")] if len(sys.argv) > 3 else [16, 40, 90, 200, 350, 990]
noises, layouts, largest = [0, 0.01, 0.1, 0.3], ["grid", "jittered", "random"], 1e-9


def affine(x, side, v):
    return np.stack([0.05 * x[0] + 0.02 * x[1], -0.03 * x[1], *([0 * x[0]] * (len(x) - 2))])


def quadratic(x, side, v):
    return np.stack([0.05 * x[0] ** 2 / side, 0.03 * x[0] * x[1] / side, *([0 * x[0]] * (len(x) - 2))])


def bump(x, side, v):
    c, width = x - side / 2, side * (0.15 + 0.1 * v)
    fall = np.exp(-(c**2).sum(0) / (2 * width**2))
    u = np.zeros_like(x)
    u[-1] += 0.15 * width * fall
    u[0] += 0.05 * c[0] * fall
    return u


def inclusion(x, side, v):
    c, radius = x - side / 2, side * (0.22 + 0.08 * v)
    r = np.maximum(np.sqrt((c**2).sum(0)), 1e-300)
    return 0.1 * c * np.minimum(1, radius / r) ** len(x)


def band(x, side, v):
    width = 4 + 2 * v
    return np.stack([0.06 * width * np.tanh((x[1] - side / 2) / width), *([0 * x[0]] * (len(x) - 1))])


def waves(x, side, v):
    length = max(side * (0.6 + 0.4 * v), 8) / (2 * np.pi)
    u = [0.06 * length * np.sin(x[1] / length + 1), 0.06 * length * np.cos(x[0] / length)]
    return np.stack([*u, *([0 * x[0]] * (len(x) - 2))])


def ramp(x, side, v):
    return np.stack([0.08 * np.maximum(x[0] - side * (0.4 + 0.2 * v), 0) ** 2 / side, *([0 * x[0]] * (len(x) - 1))])


def gradient(field, x, side, v):
    """Row i is the gradient of component i, by central differences: ten digits."""
    step = 1e-5 * side
    columns = []
    for a in range(len(x)):
        shift = np.zeros((len(x), 1))
        shift[a] = step
        columns.append((field(x + shift, side, v) - field(x - shift, side, v)) / (2 * step))
    return np.stack(columns, 1)


def points(layout, count, dimensions, random):
    side = count ** (1 / dimensions)
    if layout == "random":
        return side * random.random((dimensions, count)), side
    along = round(side)
    last = max(count // along ** (dimensions - 1), 2)
    axes = np.meshgrid(*[np.arange(along)] * (dimensions - 1), np.arange(last), indexing="ij")
    x = np.stack([a.ravel() for a in axes]).astype(float)
    return x + (0.6 * (random.random(x.shape) - 0.5) if layout == "jittered" else 0), along - 1


def study(field, count, dimensions, layout, noise, seed, folder):
    random = np.random.default_rng([seed, count, dimensions, layouts.index(layout), noises.index(noise), len(field.__name__)])
    x, side = points(layout, count, dimensions, random)
    v = random.random()
    u = field(x, side, v) + noise * random.standard_normal(x.shape)
    table, out = folder / "table.csv", folder / "out"
    names = [*"xyz"[:dimensions], *"uvw"[:dimensions]]
    np.savetxt(table, np.concatenate([x, u]).T, fmt="%.17g", delimiter=",", header=",".join(names), comments="")
    run = subprocess.run([program, "strain", table, "--out", out, "--json"], capture_output=True, text=True)
    if run.returncode:
        return None, run.stderr.strip()
    rows = list(csv.DictReader((out / "strain.csv").open()))
    true = gradient(field, x, side, v)
    kept = np.array([int(row["row_before"]) for row in rows])
    entries = [(i, a) for i in range(dimensions) for a in range(dimensions)]
    read = lambda prefix: np.array([[float(row[f"{prefix}du{'xyz'[i]}_d{'xyz'[a]}"]) for i, a in entries] for row in rows])
    off = read("") - np.array([true[i, a][kept] for i, a in entries]).T
    inside = np.abs(off) <= 1.96 * read("se_") + largest
    counted = np.ones(len(kept), bool)
    if field is inclusion:
        radius = side * (0.22 + 0.08 * v)
        counted = np.abs(np.sqrt(((x - side / 2) ** 2).sum(0)) - radius)[kept] > 1
    size = np.sqrt((true**2).sum((0, 1)))[kept]
    steep = counted & (size >= np.quantile(size, 0.9))
    share = lambda rows: inside[rows].mean() if rows.any() else np.nan
    size = max(np.abs(true).max(), 1e-300)
    return (share(counted), share(steep), len(x[0]) - len(kept), len(x[0]), np.sqrt((off**2).mean()) / size), None


classes = collections.defaultdict(list)
with tempfile.TemporaryDirectory() as scratch:
    for count in sizes:
        for dimensions in (2, 3):
            for field in (affine, quadratic, bump, inclusion, band, waves, ramp):
                for layout in layouts:
                    for noise in noises:
                        for seed in range(seeds):
                            found, refusal = study(field, count, dimensions, layout, noise, seed, pathlib.Path(scratch))
                            if refusal:
                                print(f"{field.__name__}, {count} {layout} points, {dimensions}-D, noise {noise}: {refusal}")
                                continue
                            name = f"{dimensions}-D {field.__name__}"
                            for key in ("all", name, f"{name}, {count}", f"{dimensions}-D {count}", f"{dimensions}-D {layout}",
                                        f"{dimensions}-D noise {noise}"):
                                classes[key].append(found)
print(f"{'class':<24} fields  inside %  steepest %  left out          median error")
for key, found in sorted(classes.items()):
    inside, steep, lost, count, error = np.array(found).T
    print(f"{key:<24} {len(found):6}  {100 * np.nanmean(inside):8.1f}  {100 * np.nanmean(steep) if np.isfinite(steep).any() else np.nan:10.1f}"
          f"  {lost.sum():5.0f}/{count.sum():<8.0f}  {np.median(error):13.1e}")
