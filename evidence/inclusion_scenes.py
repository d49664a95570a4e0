#!/usr/bin/env python3
"""Creates scenes of a tissue block with a spherical inclusion under the sensor's guide, solved by CalculiX (`ccx`, Debian's calculix-ccx).

    evidence/inclusion_scenes.py FOLDER [--size MM] [--seed N] [--part K/N] [--spheroids] [--weak] [NAMES ...]

writes FOLDER/scenes.csv and FOLDER/NAME.csv as `tactile-inclusion/examples/inclusion_study` reads them: 108 blocks with an
inclusion, 32 plain ones, drawn from a fixed seed or N. With --spheroids the inclusions are drawn with heights over widths from 1/1.75 to 1.75
and the diameter is that of the ball of equal volume. With --weak they are alternately soft (0.2 to 0.7 of the tissue's modulus)
and small (4 to 6 mm). NAMES selects some scenes, and `--part` divides them into jobs. Existing files
are kept. A scene takes 5 to 30 s.

Axisymmetric quadratic elements with reduced integration (CAX8R) at finite strain, compressible neo-Hooke
U = C10 (I1 - 3) + (J - 1)^2 / D1 with C10 = mu/2, D1 = 2/kappa. The face's nodes are doubled and tied by equations, in both
directions where it sticks, along the axis alone where it slides. The ties' forces are the pressure's moments with the shape
functions: their sums with the hat function of each corner node over the deformed area of the hat give the pressure.

A face that slides: nodes tied along the axis part sideways, and the pressure would act at two places. The block's mesh is moved
along the face until tied nodes meet in the deformed state (three rounds). The ties' forces are axial: the radial share of a normal
pressure on the slightly bent face is not in them. Contact pairs have it, and give about 2 % less at a tenth of the block's height.

Errors of the mesh, by halving it: elements of 1 mm (`--size 1`) are 0.1 to 0.2 % stiffer than those of 0.6 mm, alike at all radii within
0.7 of the face; at the rim, whose pressure is singular, by percents.
"""
import argparse
import bisect
import math
import os
import pathlib
import random
import re
import subprocess
import tempfile

# Thickness (mm) and Young's modulus (kPa) of the guide's layers, from the block's side; mN, mm and kPa throughout.
LAYERS = [(2.0, 136.0), (3.0, 80.0), (5.0, 34.0)]
GUIDE_POISSON = 0.495
BLOCK_RADIUS = 40.0
TISSUE = len(LAYERS)
HEADER = ("scene,D_m,depth_m,E1_pa,E0_pa,block_height_m,block_radius_m,disc_radius_m,nu,contact,"
          "approach_1_m,approach_2_m,approach_3_m,force_1_n,force_2_n,force_3_n,aspect")


def half_axes(scene):
    """Half width and half height of the inclusion."""
    return 0.5 * scene["D"] * scene["aspect"] ** (-1 / 3), 0.5 * scene["D"] * scene["aspect"] ** (2 / 3)


def draw(seed, spheroids, weak):
    """The scenes: dictionaries of lengths in mm and moduli in kPa."""
    rng = random.Random(seed)
    scenes = []

    def logarithmic(low, high):
        return math.exp(rng.uniform(math.log(low), math.log(high)))

    def block():
        return {"E0": logarithmic(4.0, 60.0), "H": rng.uniform(20, 40), "R": rng.uniform(15, 19)}

    def finish(scene, name, sticks, loads):
        part = rng.uniform(0.08, 0.12)
        # Beyond 0.09 of the height, shared axial displacements are not valid at the rim of a sliding face.
        part = part if sticks else 0.085 + 0.15 * (part - 0.08)
        step = round(part * scene["H"] / loads, 3)
        scene.update(name=name, sticks=sticks, approaches=[step * (k + 1) for k in range(loads)])
        scenes.append({key: round(value, 3) if key in ("E0", "E1", "H", "R", "D", "d", "aspect") else value for key, value in scene.items()})

    count = 0
    while count < 108:
        scene = block()
        scene.update(D=rng.uniform(6, 16), d=rng.uniform(2, 9))
        scene.update(E1=scene["E0"] * logarithmic(1.5, 15), nu=0.495)
        scene.update(aspect=logarithmic(1 / 1.75, 1.75) if spheroids else 1.0)
        if weak and count % 2 == 0:
            scene.update(E1=scene["E0"] * logarithmic(0.2, 0.7))
        elif weak:
            scene.update(D=rng.uniform(4, 6))
        half_width, half_height = half_axes(scene)
        if 2 * half_height + scene["d"] + 2.0 > scene["H"] or half_width > 0.6 * scene["R"]:
            continue
        finish(scene, f"own_{count:03}", count % 5 not in (1, 3), 2 if count % 3 == 0 else 3)
        count += 1
    for count in range(32):
        scene = block()
        scene.update(D=0.0, d=0.0, aspect=1.0, E1=scene["E0"], nu=round(min(rng.gauss(0.495, 0.005), 0.499), 4))
        finish(scene, f"plain_{count:03}", count % 2 == 0, 2 if count % 3 == 0 else 3)
    return scenes


def graded(start, end, first, longest, growth):
    """Lines from start to end. Steps begin at `first`, grow up to `longest`, and are scaled to fit."""
    length, steps, step = abs(end - start), [], first
    while sum(steps) + 0.5 * step < length:
        steps.append(step)
        step = min(step * growth, longest)
    steps = steps or [length]
    lines = [start]
    for step in steps:
        lines.append(lines[-1] + (end - start) * step / sum(steps))
    return lines[:-1] + [end]


class Mesh:
    """Eight-node quadrilaterals. Coincident nodes with the same tag are merged."""

    def __init__(self):
        self.nodes, self.elements, self.index = [], [], {}

    def node(self, point, tag):
        key = tuple(round(x * 1e6) for x in point)
        for i in (-1, 0, 1):
            for j in (-1, 0, 1):
                if (tag, key[0] + i, key[1] + j) in self.index:
                    return self.index[tag, key[0] + i, key[1] + j]
        self.nodes.append(point)
        self.index[(tag, *key)] = len(self.nodes)
        return len(self.nodes)

    def block(self, columns, rows, region, position):
        """Elements whose node (i, j), i <= 2 columns, j <= 2 rows, is at position(i, j); the face's nodes are the block's own."""
        def at(i, j):
            point = position(i, j)
            return self.node(point, region >= TISSUE and abs(point[1]) < 1e-9)

        for j in range(0, 2 * rows, 2):
            for i in range(0, 2 * columns, 2):
                corners = [at(i, j), at(i + 2, j), at(i + 2, j + 2), at(i, j + 2)]
                middles = [at(i + 1, j), at(i + 2, j + 1), at(i + 1, j + 2), at(i, j + 1)]
                self.elements.append((region, corners + middles))

    def rectangle(self, rs, zs, region):
        def at(lines, k):
            return 0.5 * (lines[k // 2] + lines[(k + 1) // 2])

        self.block(len(rs) - 1, len(zs) - 1, region, lambda i, j: (at(rs, i), at(zs, j)))

    def inclusion(self, axes, centre, width, low, high, n):
        """The box [0, width] x [low, high] around an ellipse on the axis: a core, shells to the ellipse, shells to the box."""
        half, tall = 0.5 * axes[0], 0.5 * axes[1]

        def box(k, width, low, high):
            t = k / (2 * n)
            if t <= 1:
                return t * width, low
            if t <= 3:
                return width, low + 0.5 * (t - 1) * (high - low)
            return (4 - t) * width, high

        def core(k):
            r, z = box(k, half, -tall, tall)
            # Sides bulge towards the circle, which opens the angles at the corners.
            scale = 0.92 * (1 + 0.13 * (1 - (r / half) ** 2) + 0.13 * (1 - (z / tall) ** 2))
            return r * scale, centre + z * scale

        def ellipse(k):
            angle = math.pi * k / (8 * n)
            return axes[0] * math.sin(angle), centre - axes[1] * math.cos(angle)

        def mixed(a, b, t):
            return a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1])

        def mirrored(point):
            return point[0], 2 * centre - point[1]

        def filled(i, j):
            u, v = i / (2 * n), j / (4 * n)
            bottom, right, first, last = core(i), core(2 * n + j), core(0), core(2 * n)
            left = mixed(first, mirrored(first), v)
            across, along = mixed(bottom, mirrored(bottom), v), mixed(left, right, u)
            corners = mixed(mixed(first, last, u), mixed(mirrored(first), mirrored(last), u), v)
            return tuple(across[k] + along[k] - corners[k] for k in (0, 1))

        inner, outer = max(1, round(0.3 * n)), max(1, round(0.35 * n))
        self.block(inner, 4 * n, TISSUE + 1, lambda i, j: mixed(core(j), ellipse(j), i / (2 * inner)))
        self.block(outer, 4 * n, TISSUE, lambda i, j: mixed(ellipse(j), box(j, width, low, high), i / (2 * outer)))
        self.block(n, 2 * n, TISSUE + 1, filled)


def build(scene, size):
    """Mesh with the block below z = 0 and the guide above, of elements of about `size`."""
    face, height, diameter, depth = scene["R"], scene["H"], scene["D"], scene["d"]
    half_width, half_height = half_axes(scene)
    # A bonded rim is resolved. The elements of a sliding rim are inverted if they are finer than this.
    first, longest, growth = (0.2 * size, size, 1.3) if scene["sticks"] else (0.045 * face, 0.045 * face, 1.0)
    beyond = graded(face, BLOCK_RADIUS, first, 8 * size, 1.7)
    mesh = Mesh()
    if diameter > 0:
        width = half_width + min(0.4 * half_width, 0.5 * (face - half_width))
        top = depth - min(0.45 * depth, 0.4 * half_height)
        bottom = depth + 2 * half_height + min(0.5 * (height - depth - 2 * half_height), 0.4 * half_height)
        n = max(math.ceil(width / size), 4)
        step = (bottom - top) / (2 * n)
        columns = [[width * k / n for k in range(n + 1)], graded(face, width, first, longest, growth)[::-1], beyond]
        above = max(1, round(top / size))
        rows = [[-top + top * k / above for k in range(above + 1)], [-bottom + step * k for k in range(2 * n + 1)],
                graded(-bottom, -height, max(step, size), 5 * size, 1.5)[::-1]]
    else:
        columns = [graded(face, 0.0, first, longest, growth)[::-1], beyond]
        rows = [graded(0.0, -height, 0.6 * size, 3 * size, 1.25)[::-1]]
    for row, zs in enumerate(rows):
        for column, rs in enumerate(columns):
            if diameter > 0 and (row, column) == (1, 0):
                mesh.inclusion((half_width, half_height), -(depth + half_height), width, -bottom, -top, n)
            else:
                mesh.rectangle(rs, zs, TISSUE)
    z, step = 0.0, 0.5 * size
    for region, (thickness, _) in enumerate(LAYERS):
        lines = graded(z, z + thickness, step, 2.5 * size, 1.4)
        step = lines[-1] - lines[-2]
        for rs in columns[:-1]:
            mesh.rectangle(rs, lines, region)
        z += thickness
    return mesh


def between(points, x):
    """Linear interpolation. The last segment is extrapolated."""
    k = min(max(bisect.bisect([place for place, _ in points], x) - 1, 0), len(points) - 2)
    (a, at_a), (b, at_b) = points[k:k + 2]
    return at_a + (x - a) / (b - a) * (at_b - at_a)


def move_block(mesh, scene, shift):
    """Moves the block's nodes along r: at the face by `shift` as a function of r, and less with growing depth and distance from the
    face."""
    face, depth = scene["R"], scene["d"] or 0.4 * scene["H"]
    for node in {node for region, nodes in mesh.elements if region >= TISSUE for node in nodes}:
        r, z = mesh.nodes[node - 1]
        by = between(shift, min(r, face)) * min(1.0, (BLOCK_RADIUS - r) / (BLOCK_RADIUS - face))
        mesh.nodes[node - 1] = (r + max(0.0, 1 + z / depth) * by, z)


def pairs_of(mesh, scene):
    """The face's nodes from the axis outwards: (the block's, the guide's)."""
    sides = []
    for is_block in (True, False):
        nodes = {n for region, nodes in mesh.elements if (region >= TISSUE) == is_block for n in nodes}
        face = [n for n in nodes if abs(mesh.nodes[n - 1][1]) < 1e-9 and mesh.nodes[n - 1][0] < scene["R"] + 1e-7]
        sides.append(sorted(face, key=lambda n: mesh.nodes[n - 1][0]))
    return list(zip(*sides))


def deck(scene, mesh, pairs, approaches, longest):
    """CalculiX input: the approaches in equal steps of at most `longest`, with output at each."""
    lines = ["*NODE, NSET=ALL"] + [f"{k},{r:.12g},{z:.12g}" for k, (r, z) in enumerate(mesh.nodes, 1)]
    materials = [(modulus, GUIDE_POISSON) for _, modulus in LAYERS] + [(scene["E0"], scene["nu"])]
    materials += [(scene["E1"], scene["nu"])] if scene["D"] > 0 else []
    for region, (modulus, nu) in enumerate(materials):
        lines.append(f"*ELEMENT, TYPE=CAX8R, ELSET=E{region}")
        lines += [",".join(map(str, [k, *nodes])) for k, (other, nodes) in enumerate(mesh.elements, 1) if other == region]
        shear, bulk = modulus / (2 * (1 + nu)), modulus / (3 * (1 - 2 * nu))
        lines += [f"*MATERIAL, NAME=M{region}", "*HYPERELASTIC, NEO HOOKE", f"{shear / 2:.12g},{2 / bulk:.12g}",
                  f"*SOLID SECTION, ELSET=E{region}, MATERIAL=M{region}"]
    top = sum(thickness for thickness, _ in LAYERS)
    nodes = list(enumerate(mesh.nodes, 1))
    sets = {"AXIS": [k for k, (r, _) in nodes if r < 1e-9], "BASE": [k for k, (_, z) in nodes if z < 1e-7 - scene["H"]],
            "GLASS": [k for k, (_, z) in nodes if z > top - 1e-7], "FACE": [a for a, _ in pairs], "GUIDE": [b for _, b in pairs]}
    for name, members in sets.items():
        lines += [f"*NSET, NSET={name}"] + [f"{k}," for k in members]
    for a, b in pairs:
        for component in (2, 1) if scene["sticks"] and mesh.nodes[a - 1][0] > 1e-9 else (2,):
            lines += ["*EQUATION", "2", f"{a},{component},1.,{b},{component},-1."]
    each = math.ceil(approaches[0] / longest)
    lines += ["*BOUNDARY", "AXIS,1,1", "BASE,1,2", "GLASS,1,1", "*STEP, NLGEOM, INC=1000", "*STATIC, DIRECT",
              f"{1 / (each * len(approaches)):.12g},1.", "*BOUNDARY", f"GLASS,2,2,{-approaches[-1]:.12g}"]
    for name, options, values in (("FACE", "", "U,RF"), ("GUIDE", "", "U"), ("GLASS", ", TOTALS=ONLY", "RF")):
        lines += [f"*NODE PRINT, NSET={name}{options}, FREQUENCY={each}", values]
    return "\n".join([*lines, "*END STEP", ""])


def printed(path):
    """The output of CalculiX for each load: displacements U and forces RF of nodes, and the force on the glass."""
    loads, kind, before = [], None, None
    for line in path.read_text().splitlines():
        heading = re.match(r"\s*(displacements|forces|total force) .* time\s+(\S+)", line)
        if heading:
            if heading[2] != before:
                loads.append({"displacements": {}, "forces": {}})
                before = heading[2]
            kind = heading[1]
        elif line.strip():
            numbers = line.split()
            if kind == "total force":
                loads[-1]["force"] = float(numbers[1])
            else:
                loads[-1][kind][int(numbers[0])] = [float(x) for x in numbers[1:3]]
    return loads


def run(scene, mesh, pairs, approaches):
    """Solves an input, with shorter steps if it does not converge."""
    with tempfile.TemporaryDirectory() as folder:
        job = pathlib.Path(folder) / "job"
        for longest in (0.8, 0.4, 0.2):
            job.with_suffix(".inp").write_text(deck(scene, mesh, pairs, approaches, longest))
            told = subprocess.run(["ccx", "job"], cwd=folder, capture_output=True, text=True,
                                  env={**os.environ, "OMP_NUM_THREADS": "1"})
            loads = printed(job.with_suffix(".dat"))
            if "Job finished" in told.stdout and len(loads) == len(approaches):
                return loads
    raise RuntimeError(f"{scene['name']} does not converge")


def pressures(mesh, pairs, load):
    """(r, p) at the centre of each corner's hat function: the sum of forces over its deformed area, minus the contribution of the
    curvature."""
    nodes = [a for a, _ in pairs]
    # The forces are those of a wedge of two degrees.
    forces = [-180 * load["forces"][n][1] for n in nodes]
    radii = [mesh.nodes[n - 1][0] + load["displacements"][n][0] for n in nodes]
    count = (len(nodes) + 1) // 2
    moments, total = [[0.0] * 3 for _ in range(count)], forces[::2]
    for k in range(count - 1):
        a, b, c = radii[2 * k:2 * k + 3]
        for xi, weight in ((-math.sqrt(0.6), 5 / 9), (0.0, 8 / 9), (math.sqrt(0.6), 5 / 9)):
            r = 0.5 * xi * (xi - 1) * a + (1 - xi * xi) * b + 0.5 * xi * (xi + 1) * c
            area = 2 * math.pi * r * weight * ((xi - 0.5) * a - 2 * xi * b + (xi + 0.5) * c)
            for corner, hat in ((k, 0.5 * (1 - xi)), (k + 1, 0.5 * (1 + xi))):
                for power in range(3):
                    moments[corner][power] += hat * area * r ** power
        for corner in (k, k + 1):
            total[corner] += 0.5 * forces[2 * k + 1]
    mean = [f / m[0] for f, m in zip(total, moments)]
    centre = [m[1] / m[0] for m in moments]
    variance = [m[2] / m[0] - c * c for m, c in zip(moments, centre)]
    points = [(centre[0], mean[0] - variance[0] * (mean[1] - mean[0]) / (centre[1] ** 2 + variance[1] - centre[0] ** 2 - variance[0]))]
    for k in range(1, count - 1):
        left, right = centre[k] - centre[k - 1], centre[k + 1] - centre[k]
        bend = 2 * ((mean[k + 1] - mean[k]) / right - (mean[k] - mean[k - 1]) / left) / (left + right)
        points.append((centre[k], mean[k] - 0.5 * variance[k] * bend))
    return points


def even_spline(points):
    """Natural cubic spline through points and their mirror images at the axis."""
    xs = [-r for r, _ in points[::-1]] + [r for r, _ in points]
    ys = [p for _, p in points[::-1]] + [p for _, p in points]
    n = len(xs)
    diagonal, right, bends = [1.0] * n, [0.0] * n, [0.0] * n
    for i in range(1, n - 1):
        before, after = xs[i] - xs[i - 1], xs[i + 1] - xs[i]
        share = before / diagonal[i - 1] if i > 1 else 0.0
        diagonal[i] = 2 * (before + after) - share * before
        right[i] = 6 * ((ys[i + 1] - ys[i]) / after - (ys[i] - ys[i - 1]) / before) - share * right[i - 1]
    for i in range(n - 2, 0, -1):
        bends[i] = (right[i] - (xs[i + 1] - xs[i]) * bends[i + 1]) / diagonal[i]

    def at(x):
        i = min(max(bisect.bisect(xs, x) - 1, 0), n - 2)
        h = xs[i + 1] - xs[i]
        a, b = (xs[i + 1] - x) / h, (x - xs[i]) / h
        return a * ys[i] + b * ys[i + 1] + ((a ** 3 - a) * bends[i] + (b ** 3 - b) * bends[i + 1]) * h * h / 6

    return at


def solve(scene, size):
    """Forces in N and pressures as functions of the radius, for each approach."""
    if scene["sticks"]:
        mesh = build(scene, size)
        pairs = pairs_of(mesh, scene)
        loads = run(scene, mesh, pairs, scene["approaches"])
        return [(-0.180 * load["force"], even_spline(pressures(mesh, pairs, load))) for load in loads]
    found = []
    for approach in scene["approaches"]:
        shift = [(0.0, 0.0), (scene["R"], 0.0)]
        for _ in range(3):
            mesh = build(scene, size)
            pairs = pairs_of(mesh, scene)
            move_block(mesh, scene, shift)
            load = run(scene, mesh, pairs, [approach])[0]
            moved = []
            for a, b in pairs:
                (ra, _), (rb, _) = mesh.nodes[a - 1], mesh.nodes[b - 1]
                apart = ra + load["displacements"][a][0] - rb - load["displacements"][b][0]
                moved.append((rb, ra - rb - apart))
            shift = moved
        found.append((-0.180 * load["force"], even_spline(pressures(mesh, pairs, load))))
    return found


def write(scene, found, folder):
    rows, count = ["load_index,r_m,pressure_pa"], math.ceil(0.9 * scene["R"] / 0.25)
    for load, (_, pressure) in enumerate(found, 1):
        rows += [f"{load},{0.25e-3 * k:.6g},{1e3 * pressure(0.25 * k):.8g}" for k in range(count)]
    (folder / f"{scene['name']}.csv").write_text("\n".join(rows) + "\n")
    blank = [""] * (3 - len(found))
    values = [1e-3 * scene["D"], 1e-3 * scene["d"], 1e3 * scene["E1"], 1e3 * scene["E0"], 1e-3 * scene["H"], 1e-3 * BLOCK_RADIUS]
    values = [f"{x:.6g}" for x in [*values, 1e-3 * scene["R"], scene["nu"]]]
    row = [scene["name"], *values, "bonded" if scene["sticks"] else "frictionless",
           *[f"{1e-3 * a:.6g}" for a in scene["approaches"]], *blank, *[f"{force:.8g}" for force, _ in found], *blank, f"{scene['aspect']:.6g}"]
    (folder / f"{scene['name']}.row").write_text(",".join(row) + "\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--size", type=float, default=0.9, help="length of elements in mm")
    parser.add_argument("--seed", type=int, default=20240613, help="of the draw: another one gives scenes that no constant was chosen on")
    parser.add_argument("--part", default="0/1", help="K/N: every N-th scene from the K-th")
    parser.add_argument("--spheroids", action="store_true", help="inclusions wider or taller than balls")
    parser.add_argument("--weak", action="store_true", help="inclusions that are soft or small")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    part, parts, scenes = *map(int, options.part.split("/")), draw(options.seed, options.spheroids, options.weak)
    wanted = [scene for scene in scenes if not options.names or scene["name"] in options.names]
    for scene in wanted[part::parts]:
        if not (options.folder / f"{scene['name']}.row").exists():
            try:
                write(scene, solve(scene, options.size), options.folder)
            except RuntimeError as error:
                print(error, flush=True)
    rows = [path.read_text() for scene in scenes if (path := options.folder / f"{scene['name']}.row").exists()]
    (options.folder / "scenes.csv").write_text(HEADER + "\n" + "".join(rows))


if __name__ == "__main__":
    main()
