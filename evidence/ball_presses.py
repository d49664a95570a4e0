#!/usr/bin/env python3
"""Presses balls on soft layers or a rigid flat with CalculiX (`ccx`, Debian's calculix-ccx): contacts by another program.

    evidence/ball_presses.py FOLDER [--size X] [--part K/N] [NAMES ...]

writes FOLDER/NAME.csv and FOLDER/balls.csv with all balls in the folder. There is one row per load and radius, with the columns of
`tests/data/finite_element_presses.csv`. There are twelve balls with two loads each, and a load takes one to four minutes. NAMES
selects some balls, and `--part` divides them into jobs.

Axisymmetric quadratic elements with reduced integration (CAX8R) at finite strain, compressible neo-Hooke
U = C10 (I1 - 3) + (J - 1)^2 / D1 with C10 = mu/2, D1 = 2/kappa. Half of a ball: its equator comes down as a plane and slides.
The lower face of the layers is fixed, their rim is free.

No contact search: the ball's surface touches up to a chosen node, and the approach is sought at which the pressure is not singular
there. Near the edge p = K s^(-1/2) + C s^(1/2) + D s^(3/2) + E s^(5/2), with s the distance to it, and K = 0 is the contact without friction.
On layers each node of the ball is tied to one of the layers along the common normal alone. The layers' mesh is moved until tied
nodes meet, and the normals are those of the deformed face: eight to twelve rounds.

Errors of the mesh, by halving it: forces move by 0.05 to 0.1 % at `--size 1`, radii by 0.001 %.
"""
import argparse
import math
import os
import pathlib
import subprocess
import tempfile

from inclusion_scenes import TISSUE, Mesh, even_spline, graded, pressures, printed

# The paper's guide: thickness (mm) and Young's modulus (kPa) from the ball's side; mN, mm and kPa throughout.
PAPER = ((2.0, 136.0), (3.0, 80.0), (5.0, 34.0))
POISSON = 0.499
# Modulus, radius, layers, and the angles of contact from the pole (rad) under the two loads.
BALLS = {
    "soft_ball_low": (62.0, 3.0, PAPER, (0.35, 0.5)),
    "soft_ball_high": (62.0, 3.0, PAPER, (0.75, 0.85)),
    "paper_ball_low": (103.0, 3.0, PAPER, (0.3, 0.55)),
    "paper_ball_high": (103.0, 3.0, PAPER, (0.85, 1.0)),
    "stiff_ball": (210.0, 3.0, PAPER, (0.6, 0.75)),
    "wide_ball_low": (45.0, 8.0, PAPER, (0.3, 0.4)),
    "wide_ball_high": (75.0, 6.0, PAPER, (0.5, 0.65)),
    "layer_low": (62.0, 5.0, ((6.0, 80.0),), (0.2, 0.4)),
    "layer_high": (103.0, 4.0, ((5.0, 110.0),), (0.55, 0.7)),
    "flat_low": (103.0, 3.0, (), (0.2, 0.35)),
    "flat_middle": (62.0, 5.0, (), (0.45, 0.6)),
    "flat_high": (150.0, 3.0, (), (0.7, 0.8)),
}
# Numbers above those of the layers.
BALL = TISSUE
HEADER = "youngs_modulus_pa,radius_m,layers,force_n,contact_radius_m,indentation_m,r_m,pressure_pa,height_m"
# Number of radii that are written per load.
POINTS = 40
# Maximum number of solutions per load. Eight to fifteen are usual.
MOST_ROUNDS = 40


def fill(mesh, us, vs, region, position):
    """One element for each cell of the lines us and vs."""
    def at(lines, k):
        return 0.5 * (lines[k // 2] + lines[(k + 1) // 2])

    mesh.block(len(us) - 1, len(vs) - 1, region, lambda i, j: position(at(us, i), at(vs, j)))


def node(mesh, point, region):
    """The tag of a body: at z = 0 the ball has its own nodes."""
    return mesh.node(point, region == BALL and abs(point[1]) < 1e-9)


def refined(start, edge, end, first, coarse, longest):
    """Lines from start to end, densest at the edge between them."""
    inside = graded(edge, start, first, coarse, 1.25)[::-1]
    return inside[:-1] + graded(edge, end, first, longest, 1.3)


def ball_mesh(mesh, radius, contact, size):
    """Half a ball above z = 0: a core like a square and a shell whose lines are densest at the contact's edge."""
    first = 0.02 * size * contact
    angles = refined(0.0, contact, 0.5 * math.pi, first, 0.1 * size * contact, 0.1 * size)
    half = min(range(len(angles)), key=lambda k: abs(angles[k] - 0.25 * math.pi))
    diagonal, core = angles[half], 0.5 * radius

    def on_core(angle):
        if angle <= diagonal:
            return core * angle / diagonal, core
        return core, core * (0.5 * math.pi - angle) / (0.5 * math.pi - diagonal)

    def shell(t, angle):
        inner, outer = on_core(angle), (radius * math.sin(angle), radius * math.cos(angle))
        return outer[0] + t * (inner[0] - outer[0]), radius - outer[1] - t * (inner[1] - outer[1])

    depths = graded(0.0, 1.0, 2 * first, 0.2 * size, 1.3)
    fill(mesh, depths, angles, BALL, shell)
    across = [on_core(angle)[0] for angle in angles[:half + 1]]
    along = [on_core(angle)[1] for angle in angles[half:]][::-1]
    fill(mesh, across, along, BALL, lambda x, y: (x, radius - y))
    # The nodes in contact, including midpoints, from the pole outwards.
    touching = [a for k in range(len(angles) - 1) if angles[k + 1] <= contact + 1e-9 for a in (angles[k], 0.5 * (angles[k] + angles[k + 1]))]
    return [node(mesh, shell(0.0, angle), BALL) for angle in [*touching, contact]]


def layer_mesh(mesh, layers, radius, places, size):
    """Layers below z = 0 whose nodes touch at `places`."""
    edge, rim = places[-1], max(5.0 * radius, 3.0 * sum(t for t, _ in layers))
    first = places[-1] - places[-3]
    corners = places[::2] + graded(edge, rim, first, 0.15 * rim * size, 1.3)[1:]
    middles = dict(zip(corners, places[1::2]))

    # Lines are interpolated by number, so that midpoints stay in place.
    def position(u, v):
        k = math.floor(u)
        if u == k:
            return corners[k], v
        return middles.get(corners[k], 0.5 * (corners[k] + corners[k + 1])), v

    top, step = 0.0, 2 * first
    for region, (thickness, _) in enumerate(layers):
        lines = graded(top, top - thickness, step, 0.3 * thickness * size + 0.1, 1.3)
        step = lines[-2] - lines[-1]
        fill(mesh, list(range(len(corners))), lines, region, position)
        top -= thickness
    return [node(mesh, (r, 0.0), 0) for r in places], top


def clockwise(mesh, nodes):
    (x0, y0), (x1, y1), (x2, y2) = (mesh.nodes[n - 1] for n in nodes[:3])
    return (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0) < 0


def deck(case, mesh, ball_side, layer_side, normals, bottom, approach, steps):
    modulus, radius, layers, _ = case
    reference = len(mesh.nodes) + 1
    lines = ["*NODE, NSET=ALL"] + [f"{k},{r:.12g},{z:.12g}" for k, (r, z) in enumerate([*mesh.nodes, (0.0, 2 * radius)], 1)]
    for region, e in [(BALL, modulus), *((k, e) for k, (_, e) in enumerate(layers))]:
        label = "BALL" if region == BALL else f"LAYER{region}"
        lines.append(f"*ELEMENT, TYPE=CAX8R, ELSET={label}")
        for k, (other, n) in enumerate(mesh.elements, 1):
            if other == region:
                n = [n[i] for i in (0, 3, 2, 1, 7, 6, 5, 4)] if clockwise(mesh, n) else n
                lines.append(",".join(map(str, [k, *n])))
        shear, bulk = e / (2 * (1 + POISSON)), e / (3 * (1 - 2 * POISSON))
        lines += [f"*MATERIAL, NAME=M{label}", "*HYPERELASTIC, NEO HOOKE", f"{shear / 2:.12g},{2 / bulk:.12g}",
                  f"*SOLID SECTION, ELSET={label}, MATERIAL=M{label}"]
    nodes = list(enumerate(mesh.nodes, 1))
    sets = {"AXIS": [k for k, (r, _) in nodes if r < 1e-9], "EQUATOR": [k for k, (_, z) in nodes if z > radius - 1e-7], "SKIN": ball_side}
    if layers:
        sets.update(GLASS=[k for k, (_, z) in nodes if z < bottom + 1e-7], FACE=layer_side)
    for label, members in sets.items():
        lines += [f"*NSET, NSET={label}"] + [f"{k}," for k in members]
    lines += ["*BOUNDARY", "AXIS,1,1"]
    if layers:
        lines += ["GLASS,1,2"]
        for a, b, (nr, nz) in zip(ball_side, layer_side, normals):
            (ra, za), (rb, zb) = mesh.nodes[a - 1], mesh.nodes[b - 1]
            gap = nr * (ra - rb) + nz * (za - zb)
            terms = [f"{a},2,{nz:.12g}", f"{b},2,{-nz:.12g}"]
            if abs(nr) > 1e-9:
                terms += [f"{a},1,{nr:.12g}", f"{b},1,{-nr:.12g}"]
            terms.append(f"{reference},2,{gap:.12g}")
            lines += ["*EQUATION", str(len(terms))] + terms
    lines += ["*STEP, NLGEOM, INC=1000", "*STATIC", f"{1 / steps:.6g},1.,1e-4,{1 / steps:.6g}", "*BOUNDARY", f"EQUATOR,2,2,{-approach:.12g}"]
    if layers:
        lines.append(f"{reference},2,2,1.")
    else:
        lines += [f"{k},2,2,{-mesh.nodes[k - 1][1]:.12g}" for k in ball_side]
    for label, options, values in (("SKIN", "", "U,RF"), ("EQUATOR", ", TOTALS=ONLY", "RF"), *([("FACE", "", "U")] if layers else [])):
        lines += [f"*NODE PRINT, NSET={label}{options}, FREQUENCY=1000", values]
    return "\n".join([*lines, "*END STEP", ""])


def run(text):
    with tempfile.TemporaryDirectory() as folder:
        job = pathlib.Path(folder) / "job"
        job.with_suffix(".inp").write_text(text)
        told = subprocess.run(["ccx", "job"], cwd=folder, capture_output=True, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
        loads = printed(job.with_suffix(".dat"))
        if "Job finished" not in told.stdout or not loads:
            return None
        return loads[-1]


def least_squares(rows, values):
    """Coefficients of a linear model, from its normal equations."""
    n = len(rows[0])
    a = [[sum(r[i] * r[j] for r in rows) for j in range(n)] + [sum(r[i] * y for r, y in zip(rows, values))] for i in range(n)]
    for i in range(n):
        pivot = max(range(i, n), key=lambda k: abs(a[k][i]))
        a[i], a[pivot] = a[pivot], a[i]
        for k in range(n):
            if k != i:
                f = a[k][i] / a[i][i]
                a[k] = [x - f * y for x, y in zip(a[k], a[i])]
    return [a[i][n] / a[i][i] for i in range(n)]


class Contact:
    """A ball that touches up to an angle, with the layers' mesh and the normals of the last solution."""

    def __init__(self, case, contact, size):
        self.case, self.contact, self.size = case, contact, size
        self.places = self.normals = self.gaps = None
        self.relaxation = 1.0

    def solve(self, approach):
        """Solves once and returns the distance of tied nodes along the face."""
        _, radius, layers, _ = self.case
        mesh = Mesh()
        skin = ball_mesh(mesh, radius, self.contact, self.size)
        places = self.places or [mesh.nodes[n - 1][0] for n in skin]
        # At first the face is assumed half as steep as the ball.
        tilts = [0.5 * math.asin(mesh.nodes[n - 1][0] / radius) for n in skin]
        normals = self.normals or [(-math.sin(tilt), math.cos(tilt)) for tilt in tilts]
        face, bottom = layer_mesh(mesh, layers, radius, places, self.size) if layers else ([], 0.0)
        tried = (run(deck(self.case, mesh, skin, face, normals, bottom, approach, steps)) for steps in (8, 20, 60))
        load = next((load for load in tried if load), None)
        if load is None:
            raise RuntimeError("CalculiX does not converge")
        moved = [[x + u for x, u in zip(mesh.nodes[n - 1], load["displacements"][n])] for n in skin]
        apart = 0.0
        if layers:
            other = [[x + u for x, u in zip(mesh.nodes[n - 1], load["displacements"][n])] for n in face]
            gaps = [0.0] + [a[0] - b[0] for a, b in zip(moved[1:], other[1:])]
            apart = max(map(abs, gaps))
            self.relax(gaps)
            self.places = [r + self.relaxation * gap for r, gap in zip(places, gaps)]
            self.normals = normals_of(moved)
        self.mesh, self.skin, self.load, self.moved = mesh, skin, load, moved
        return apart

    def relax(self, gaps):
        """Aitken's relaxation of vectors (Irons and Tuck 1969, Int. J. Numer. Methods Eng. 1, 275)."""
        if self.gaps:
            changes = [new - old for new, old in zip(gaps, self.gaps)]
            slope = sum(old * change for old, change in zip(self.gaps, changes)) / sum(change * change for change in changes)
            self.relaxation = min(max(-self.relaxation * slope, 0.5), 5.0)
        self.gaps = gaps

    def force(self):
        """The wedge has two degrees."""
        return -180.0 * self.load["force"]

    def radius(self):
        return self.moved[-1][0]

    def pressure(self):
        # The ball is above, so that its forces have the opposite sign.
        return [(r, -p) for r, p in pressures(self.mesh, [(n, n) for n in self.skin], self.load)]

    def singular(self):
        """The amount by which the contact without a singular edge is wider: 2 K / C."""
        a = self.radius()
        points = [(a - r, p) for r, p in self.pressure()][:-2]
        points = [(s, p) for s, p in points if s < 0.5 * a]
        k, c, *_ = least_squares([(s ** -0.5, s ** 0.5, s ** 1.5, s ** 2.5) for s, _ in points], [p for _, p in points])
        return 2 * k / c


def normals_of(points):
    """Normals of the curve through points, upwards and vertical on the axis."""
    found = [(0.0, 1.0)]
    for k in range(1, len(points)):
        k0 = min(max(k - 1, 0), len(points) - 3)
        (x0, y0), (x1, y1), (x2, y2) = points[k0:k0 + 3]
        x = points[k][0]
        slope = (y0 * (2 * x - x1 - x2) / ((x0 - x1) * (x0 - x2)) + y1 * (2 * x - x0 - x2) / ((x1 - x0) * (x1 - x2))
                 + y2 * (2 * x - x0 - x1) / ((x2 - x0) * (x2 - x1)))
        length = math.hypot(1.0, slope)
        found.append((-slope / length, 1.0 / length))
    return found


def press(case, contact, size):
    """The solution without a singular edge, and its approach."""
    radius, layers = case[1:3]
    body = Contact(case, contact, size)
    approach = (0.9 if layers else 0.8) * radius * math.sin(contact) ** 2
    before = None
    for _ in range(MOST_ROUNDS):
        apart = body.solve(approach)
        a, wider = body.radius(), body.singular()
        if max(abs(wider), apart) < 1e-4 * a:
            return body, approach
        # Hertz: a^2 = R d. The secant, once the layers' mesh has nearly settled.
        slope = 0.5 * a / approach
        if before and apart < 0.02 * a and approach != before[0]:
            secant = (wider - before[1]) / (approach - before[0])
            slope = secant if 0.3 * slope < secant < 3 * slope else slope
        before = (approach, wider)
        approach -= max(-0.2 * approach, min(0.2 * approach, wider / slope))
    raise RuntimeError("the edge stays singular")


def rows(name, contact, size):
    """The object, force, contact radius, approach, and pressure and height as functions of the radius, in SI units."""
    modulus, radius, layers, _ = BALLS[name]
    body, approach = press(BALLS[name], contact, size)
    a = body.radius()
    squares = even_spline([(r, p * p) for r, p in body.pressure()[:-1]] + [(a, 0.0)])
    height = even_spline([tuple(point) for point in body.moved[1:]])
    stack = ";".join(f"{1e-3 * t:g}:{1e3 * e:g}" for t, e in layers)
    for k in range(POINTS + 1):
        r = a * math.sin(0.5 * math.pi * k / POINTS)
        numbers = [1e3 * modulus, 1e-3 * radius, stack, 1e-3 * body.force(), 1e-3 * a, 1e-3 * approach]
        pressure = 1e3 * math.sqrt(max(squares(r), 0.0)) if k < POINTS else 0.0
        yield ",".join(x if isinstance(x, str) else f"{x:.7g}" for x in [*numbers, 1e-3 * r, pressure, 1e-3 * height(r)])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--size", type=float, default=0.7, help="length of elements; 1 moves forces by 0.1 %%")
    parser.add_argument("--part", default="0/1", help="K/N: every N-th ball from the K-th")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    part, parts = map(int, options.part.split("/"))
    for name in [name for name in BALLS if not options.names or name in options.names][part::parts]:
        path = options.folder / f"{name}.csv"
        if path.exists():
            continue
        try:
            found = [row for contact in BALLS[name][3] for row in rows(name, contact, options.size)]
        except RuntimeError as error:
            print(f"{name}: {error}", flush=True)
            continue
        path.write_text("\n".join(found) + "\n")
        print(f"{name}: done", flush=True)
    there = [path.read_text() for name in BALLS if (path := options.folder / f"{name}.csv").exists()]
    (options.folder / "balls.csv").write_text(HEADER + "\n" + "".join(there))


if __name__ == "__main__":
    main()
