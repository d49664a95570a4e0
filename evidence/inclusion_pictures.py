"""Independent truth for the search of a lump from the whole face: CalculiX in three dimensions.

    python inclusion_pictures.py OUT [COUNT] [SEED]   draws COUNT blocks (default 60) and solves them

Needs numpy, scipy and CalculiX (`ccx`, or the program named by $CCX). Nothing of the project is
used. OUT gets NAME.csv for each block and scenes.csv, as the example `picture_study` of
`tactile-inclusion` reads them. Scenes listed in scenes.csv are not solved again.

A block of tissue (a cylinder, radius R, height H, base held) with an ellipsoidal lump lies under the
sensor's guide: a disc of radius a, three layers glued to rigid glass that comes down by known
approaches. Materials are compressible neo-Hookean,
W = mu/2 (J^-2/3 I1 - 3) + K/2 (J - 1)^2, elements C3D20R at finite strain. The lump's centre lies in
the plane y = 0, a mirror, and half is meshed; of two like lumps at +-x a quarter. The mesh is
mapped: a core cube, a shell up to the lump's surface, a shell up to a box with rounded corners,
columns above and below, sectors from the box to the rim, a ring outside. Face and guide meet node to
node and are tied by equations, in all directions (bonded) or along z (frictionless). Within three
quarters of the face the pressure is 0.3 % above that of axisymmetric runs, scatter 0.2 %, worst 0.8 %.
Nodes that are tied along z part sideways, and the pressure then acts at two places: 0.3 % at the
centre of a plain block and 1.7 % above a lump at a tenth of the block's height. Each approach is
therefore solved again on a block whose mesh is moved along the face, so that tied nodes meet where
they end; 0.1 % remains. Millimetres, kPa and mN inside; files in m, Pa, N.
"""
import copy
import csv
import dataclasses
import os
import subprocess
import sys
import tempfile
import time
from math import factorial

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as sla
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import cKDTree

LAYERS = ((2.0, 136.0), (3.0, 80.0), (5.0, 34.0))  # thickness mm, modulus kPa; from the face to the glass


@dataclasses.dataclass(frozen=True)
class Scene:
    axes: tuple = (12.0, 12.0, 12.0)  # the lump's diameters along x, y, z
    depth: float = 4.0  # of its top
    x: float = 0.0  # of its centre, from the face's axis
    E1: float = 40.0
    E0: float = 5.0
    H: float = 30.0
    R: float = 40.0
    a: float = 16.0
    nu: float = 0.495
    twin: bool = False  # a like lump at -x
    contact: str = "bonded"
    approach: tuple = (1.0, 2.0, 3.0)


def drawn(count, seed):
    """Blocks by name: one in ten plain, one in ten an ellipsoid, one in ten with two lumps."""
    rng = np.random.default_rng(seed)
    out = {}
    for k in range(count):
        diameter, depth = rng.uniform(6, 16), rng.uniform(2, 9)
        E0 = rng.uniform(4, 12)
        E1, x = E0 * np.exp(rng.uniform(np.log(2), np.log(12))), rng.uniform(0, 9)
        contact = rng.choice(["bonded", "frictionless"])
        kind = ("plain", "ellipsoid", "pair")[k % 10] if k % 10 < 3 else "ball"
        axes = (diameter,) * 3
        if kind == "ellipsoid":
            axes = tuple(min(16.0, diameter * r) for r in np.exp(rng.uniform(-0.28, 0.28, 3)))
        if kind == "pair":
            diameter = min(diameter, 10.0)
            axes, x = (diameter,) * 3, rng.uniform(2 / 3, 0.8) * diameter
        out[f"{kind}_{k:02d}"] = Scene(
            axes, depth, x, E0 if kind == "plain" else E1, E0, twin=kind == "pair", contact=contact
        )
    return out


# ---------------------------------------------------------------------------------------------------------- mesh

def _steps(n, last_over_first=1.0):
    """2n+1 numbers from 0 to 1: ends and middles of n intervals whose lengths change geometrically."""
    ends = np.r_[0, np.cumsum(last_over_first ** (np.arange(n) / max(n - 1, 1)))]
    return np.interp(np.arange(2 * n + 1) / 2, np.arange(n + 1), ends / ends[-1])


FACES = [list(f) for f in ((0, 1, 2, 3, 8, 9, 10, 11), (4, 5, 6, 7, 12, 13, 14, 15), (0, 1, 5, 4, 8, 17, 12, 16), (1, 2, 6, 5, 9, 18, 13, 17),
                           (2, 3, 7, 6, 10, 19, 14, 18), (0, 3, 7, 4, 11, 19, 15, 16))]  # a 20-node element's sides


class Mesh:
    """Nodes (mm), 20-node elements, materials (0 tissue, 1 lump, 2.. layers), bodies; node sets; the face's quadrilaterals (8 nodes of the tissue).

    `n` elements along half the box, `tall` up the box; of the other directions (number, last over first) where they are graded: from the box to the rim,
    from the rim out, from the box up to the face, in the guide's first layer; `below` the box; in the lump's and the tissue's `shells`."""

    def __init__(self, s, n=4, tall=5, rim=(5, 0.3), out=(4, 12.0), top=(3, 0.5), guide=(2, 2.0), below=2, shells=(1, 2)):
        r, zc = np.array(s.axes) / 2, -s.depth - s.axes[2] / 2
        nest = 0.3  # the box's plan lies between the lump's outline and the rim
        cx, w = (1 - nest) * s.x, (1 - nest) * r[:2] + nest * s.a
        if s.twin:  # a quarter: the box between the mirror x = 0 and the rim
            cx, w = s.x, np.array([0.5 * (r[0] + min(s.x, s.a - s.x)), 0.7 * r[1] + 0.3 * s.a])
        margin = lambda room: r[2] * room / (room + 2 * r[2])
        zt, zb = zc + r[2] + margin(s.depth), zc - r[2] - margin(s.H - s.depth - 2 * r[2])
        self.top = zt
        grid, rise = np.linspace(-1, 1, 4 * n + 1), np.linspace(-1, 1, 2 * tall + 1)
        half = grid[2 * n:]
        round_ = lambda u, v: np.stack([0.4 * u + 0.6 * u * np.sqrt(1 - v * v / 2), 0.4 * v + 0.6 * v * np.sqrt(1 - u * u / 2)], -1)
        plan = lambda u, v: np.array([cx, 0.0]) + w * round_(u, v)
        self.parts = []
        # the lump: core, then shells through the five faces of a cube
        U, V, W = np.meshgrid(grid, half, rise, indexing="ij")
        cube = np.stack([U, V, W], -1)
        big = np.abs(cube).max(-1, keepdims=True)
        sphere = lambda c: (t := np.tan(np.pi / 4 * c)) / np.linalg.norm(t, axis=-1, keepdims=True)
        safe = np.where(big > 0, cube / np.where(big > 0, big, 1), np.eye(3)[0])
        centre, core = np.array([s.x, 0.0, zc]), 0.5
        inner = lambda c, ball, size: centre + core * r * (0.6 * c * 0.85 + 0.4 * size * ball)
        self.parts.append((inner(cube, sphere(safe), big), 1, 0))
        for axis, side in ((0, -1), (0, 1), (1, 1), (2, -1), (2, 1)):
            c = np.take(cube, 0 if side < 0 else -1, axis)
            ball, one = sphere(c), np.ones(c.shape[:2] + (1,))
            box = np.concatenate([plan(c[..., 0], c[..., 1]), zb + (zt - zb) * (c[..., 2:] + 1) / 2], -1)
            surface = centre + r * ball
            self._ruled(inner(c, ball, one), surface, _steps(shells[0]), 1, 0)
            self._ruled(surface, box, _steps(shells[1], 1.6), 0, 0)
        # columns and sectors
        levels = [((zb - (zb + s.H) * _steps(below, 1.6))[::-1], 0, 0), (zb + (zt - zb) * (rise + 1) / 2, 0, 0), (zt - zt * _steps(*top), 0, 0)]
        for i, (h, _) in enumerate(LAYERS):
            levels.append((sum(v for v, _ in LAYERS[:i]) + h * _steps(*(guide if i == 0 else (1, 1))), 2 + i, 1))
        edges = {"left": (-np.ones_like(half), half), "top": (grid, np.ones_like(grid)), "right": (np.ones_like(half), half)}
        left, right = (np.arctan2(*plan(np.array(u), np.array(1.0))[::-1]) for u in (-1.0, 1.0))  # the box's corners, seen from the axis
        angles = {"left": (np.pi, left), "top": (left, right), "right": (0, right)}
        arc = lambda name, radius: np.stack([radius * np.cos(t := np.linspace(*angles[name], len(edges[name][0]))), radius * np.sin(t)], -1)
        if s.twin:
            angles["top"] = (np.pi / 2, right)
        for level, (zs, material, body) in enumerate(levels):
            if level != 1:  # there the box has its own elements
                self._prism(plan(U[..., 0], V[..., 0]), zs, material, body)
            for name, (u, v) in edges.items():
                box, ring, far = plan(u, v), arc(name, s.a), arc(name, s.R)
                if s.twin and name == "left":
                    ring, far = np.stack([np.zeros_like(half), s.a * half], -1), None
                t = _steps(*rim)[None, :, None]
                self._prism((1 - t) * box[:, None] + t * ring[:, None], zs, material, body)
                if body == 0 and far is not None:
                    t = _steps(*out)[None, :, None]
                    self._prism((1 - t) * ring[:, None] + t * far[:, None], zs, material, body)
        self._join(s)

    def _ruled(self, inner, outer, t, material, body):
        t = t[None, None, :, None]
        self.parts.append(((1 - t) * inner[:, :, None] + t * outer[:, :, None], material, body))

    def _prism(self, xy, zs, material, body):
        x = np.broadcast_to(xy[:, :, None], xy.shape[:2] + (len(zs), 2))
        self.parts.append((np.concatenate([x, np.broadcast_to(zs[None, None, :, None], x.shape[:3] + (1,))], -1), material, body))

    def _join(self, s):
        corners = np.array([(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)])
        pairs = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
        offsets = np.r_[corners, [(corners[i] + corners[j]) // 2 for i, j in pairs]]
        mirror = [0, 3, 2, 1, 4, 7, 6, 5, 11, 10, 9, 8, 15, 14, 13, 12, 16, 19, 18, 17]
        points, bodies, elements, materials, count = [], [], [], [], 0
        for x, material, body in self.parts:
            number = np.arange(count, count + x[..., 0].size).reshape(x.shape[:3])
            i, j, k = (g.ravel() for g in np.meshgrid(*(np.arange(0, m - 2, 2) for m in x.shape[:3]), indexing="ij"))
            e = np.stack([number[i + a, j + b, k + c] for a, b, c in offsets], 1)
            p = x.reshape(-1, 3)[e[:, :8] - count].mean(0)
            if np.linalg.det([p[1] - p[0], p[3] - p[0], p[4] - p[0]]) < 0:
                e = e[:, mirror]
            points.append(x.reshape(-1, 3)), bodies.append(np.full(x[..., 0].size, body))
            elements.append(e), materials.append(np.full(len(e), material))
            count += x[..., 0].size
        points, bodies, elements = np.concatenate(points), np.concatenate(bodies), np.concatenate(elements)
        close = cKDTree(np.c_[points, 1e3 * bodies]).query_pairs(1e-5, output_type="ndarray")
        _, group = sp.csgraph.connected_components(sp.coo_matrix((np.ones(len(close)), close.T), (count, count)))
        used, first, e = np.unique(group[elements], return_index=True, return_inverse=True)
        keep = elements.ravel()[first]
        self.x, self.body, self.el, self.mat = points[keep], bodies[keep], e.reshape(-1, 20), np.concatenate(materials)
        near = lambda v, t: np.abs(v - t) < 1e-6
        x, y, z = self.x.T
        lower = near(z, 0) & (self.body == 0)
        tissue, guide = np.flatnonzero(lower & (np.hypot(x, y) < s.a + 1e-6)), np.flatnonzero(near(z, 0) & (self.body == 1))
        far, match = cKDTree(self.x[guide]).query(self.x[tissue])
        if far.max() > 1e-5 or len(guide) != len(tissue):
            raise ArithmeticError("the meshes of face and guide do not meet")
        self.sets = {"mirror": np.flatnonzero(near(y, 0)), "base": np.flatnonzero(near(z, -s.H)), "tissue": tissue, "guide": guide[match],
                     "glass": np.flatnonzero(near(z, sum(h for h, _ in LAYERS))), "mirrorx": np.flatnonzero(near(x, 0)) if s.twin else np.array([], int)}
        on = np.isin(self.el, tissue)
        self.face = np.array([e[f] for e, m in zip(self.el, on) if m[:8].sum() == 4 and m.sum() == 8 for f in FACES if m[f].all()])


# ------------------------------------------------------------------------------------------------------ CalculiX

def deck(s, m, approach):
    """CalculiX input, with two increments per approach, which are halved if Newton's method fails."""
    out = ["*NODE, NSET=ALL"] + [f"{i + 1},{x:.10e},{y:.10e},{z:.10e}" for i, (x, y, z) in enumerate(m.x)]
    E, nu = [s.E0, s.E1] + [e for _, e in LAYERS], [s.nu] * 2 + [0.495] * len(LAYERS)
    for k in np.unique(m.mat):
        out.append(f"*ELEMENT, TYPE=C3D20R, ELSET=M{k}")
        for i in np.flatnonzero(m.mat == k):
            e = m.el[i] + 1
            out += [f"{i + 1}," + ",".join(map(str, e[:10])) + ",", ",".join(map(str, e[10:]))]
        mu, K = E[k] / 2 / (1 + nu[k]), E[k] / 3 / (1 - 2 * nu[k])
        out += [f"*MATERIAL, NAME=A{k}", f"*HYPERELASTIC, NEO HOOKE\n{mu / 2:.9e},{2 / K:.9e}", f"*SOLID SECTION, ELSET=M{k}, MATERIAL=A{k}"]
    for name, nodes in m.sets.items():
        out += [f"*NSET, NSET={name.upper()}"] * (len(nodes) > 0) + [",".join(map(str, nodes[i:i + 12] + 1)) for i in range(0, len(nodes), 12)]
    out += ["*BOUNDARY", "BASE,1,3", "MIRROR,2,2"] + ["MIRRORX,1,1"] * s.twin + ["GLASS,1,2"]
    mirror, mirrorx = set(m.sets["mirror"]), set(m.sets["mirrorx"])
    for t, g in zip(m.sets["tissue"], m.sets["guide"]):
        for c in (1, 2, 3) if s.contact == "bonded" else (3,):
            if not (c == 2 and t in mirror or c == 1 and t in mirrorx):
                out += ["*EQUATION", "2", f"{g + 1},{c},1,{t + 1},{c},-1"]
    for d in approach:
        out += ["*STEP, NLGEOM, INC=100", "*STATIC", "0.5,1.,1e-3", "*BOUNDARY", f"GLASS,3,3,{-d:.9e}"]
        out += ["*NODE PRINT, NSET=TISSUE, FREQUENCY=1000", "RF,U", "*NODE PRINT, NSET=GUIDE, FREQUENCY=1000", "U", "*END STEP"]
    return "\n".join(out) + "\n"


def run(s, m, approach):
    """Positions (mm) and forces (mN) of the tissue's face nodes, and the guide's positions, at each approach."""
    with tempfile.TemporaryDirectory() as tmp:
        with open(f"{tmp}/job.inp", "w") as f:
            f.write(deck(s, m, approach))
        ended = subprocess.run(["nice", "-n", "10", os.environ.get("CCX", "ccx"), "-i", "job"], cwd=tmp, capture_output=True, text=True,
                             env=os.environ | {"OMP_NUM_THREADS": "1"})
        tables = {"forces": [], "displacements": []}
        for line in open(f"{tmp}/job.dat"):
            words = line.split()
            if words and words[0] in tables:
                table = []
                tables[words[0]].append(table)
            elif words:
                table.append([float(w) for w in words])
    if ended.returncode or len(tables["forces"]) < len(approach):
        raise ArithmeticError("ccx: " + ended.stdout[-600:])
    place = np.zeros(len(m.x), int)
    for name in ("tissue", "guide"):
        place[m.sets[name]] = np.arange(len(m.sets[name]))

    def values(rows):
        rows, out = np.array(rows), np.zeros((len(rows), 3))
        out[place[rows[:, 0].astype(int) - 1]] = rows[:, 1:]
        return out

    moves = tables["displacements"]
    return [
        (m.x[m.sets["tissue"]] + values(moves[2 * i]), values(forces), m.x[m.sets["guide"]] + values(moves[2 * i + 1]))
        for i, forces in enumerate(tables["forces"])
    ]


def moved(s, m, apart):
    """The mesh with the block's nodes moved along the face by -`apart` (N,2; mm; at the face's nodes): less below it, none from the box down or at the block's side."""
    start, radius = m.x[m.sets["guide"]][:, :2], np.hypot(*m.x[:, :2].T)
    nearest = cKDTree(start).query(m.x[:, :2] * np.minimum(1, s.a / np.maximum(radius, s.a))[:, None])[1]
    share = np.clip((s.R - radius) / (s.R - s.a), 0, 1) * np.clip(1 - m.x[:, 2] / m.top, 0, 1) * (m.body == 0)
    out = copy.copy(m)
    out.x = m.x - np.c_[share[:, None] * apart[nearest], np.zeros(len(m.x))]
    return out


def solve(s, m):
    """Positions (mm) and forces (mN) of the tissue's face nodes at each approach."""
    first = run(s, m, s.approach)
    if s.contact == "bonded":
        return [(at, force) for at, force, _ in first]
    out = []
    for d, (at, _, guide) in zip(s.approach, first):
        at, force, _ = run(s, moved(s, m, (at - guide)[:, :2]), [d])[0]
        out.append((at, force))
    return out


# ------------------------------------------------------------------------------------------------------ pressure

def _shape8(xi, eta):
    """Eight-node shape functions, their two derivatives, and the bilinear functions of the corners, at one point."""
    cx, cy = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
    a, b = 1 + cx * xi, 1 + cy * eta
    N = np.r_[a * b * (cx * xi + cy * eta - 1) / 4, (1 - xi**2) * (1 - eta) / 2, (1 + xi) * (1 - eta**2) / 2, (1 - xi**2) * (1 + eta) / 2, (1 - xi) * (1 - eta**2) / 2]
    dx = np.r_[cx * b * (2 * cx * xi + cy * eta) / 4, -xi * (1 - eta), (1 - eta**2) / 2, -xi * (1 + eta), -(1 - eta**2) / 2]
    dy = np.r_[cy * a * (cx * xi + 2 * cy * eta) / 4, -(1 - xi**2) / 2, -(1 + xi) * eta, (1 - xi**2) / 2, -(1 - xi) * eta]
    return N, dx, dy, np.r_[a * b / 4, np.zeros(4)]  # the last: bilinear


def _zernike(p, order):
    """Zernike polynomials that are even in y, at points (N,2) of the unit disc: (N, coefficients)."""
    r, angle, out = np.hypot(*p.T), np.arctan2(p[:, 1], p[:, 0]), []
    for n in range(order + 1):
        for k in range(n % 2, n + 1, 2):
            out.append(np.cos(k * angle) * sum((-1) ** i * factorial(n - i) / (factorial(i) * factorial((n + k) // 2 - i) * factorial((n - k) // 2 - i))
                                               * r ** (n - 2 * i) for i in range((n - k) // 2 + 1)))
    return np.stack(out, -1)


def recover(s, m, x, force, grid, order=12):
    """Pressure (kPa) at points `grid` (N,2; mm, on the deformed face; nan outside it), from nodal positions and forces of the tissue's face.

    Reduced integration makes the forces alternate between corners and middles of sides, so middles are shared out to their ends: 
    integrals of the pressure times bilinear hat functions, one per corner.  Inside 0.6 a the pressure is the Zernike series that fits them best; beyond 0.75 a it is 1/sqrt(1 - r^2/a^2), a flat punch's, times
    the bilinear function with these integrals; between them the two are blended."""
    at = {node: i for i, node in enumerate(m.sets["tissue"])}
    face, start, cut = np.vectorize(at.get)(m.face), m.x[m.sets["guide"]][:, :2], 0.95 * s.a
    xy, X = x[face][..., :2], start[face]
    weight = lambda p: 1 / np.sqrt(1 - np.minimum(np.hypot(*p.T) / s.a, 1 - 1e-6) ** 2)
    size, count = len(start), len(face)
    g, gw = np.polynomial.legendre.leggauss(6)
    hats, mass, series = 0, 0, 0
    for xi, wi in zip(g, gw):
        for eta, we in zip(g, gw):
            N, dx, dy, L = _shape8(xi, eta)
            J, p = np.einsum("dn,fnk->fdk", np.array([dx, dy]), xy), np.einsum("n,fnk->fk", N, X)
            area = wi * we * np.abs(J[:, 0, 0] * J[:, 1, 1] - J[:, 0, 1] * J[:, 1, 0])
            spread = sp.csr_matrix((np.tile(L[:4], count), (face[:, :4].ravel(), np.repeat(np.arange(count), 4))), (size, count))
            hats = hats + spread @ area
            mass = mass + spread @ sp.diags(area * weight(p)) @ spread.T
            series = series + spread @ (_zernike(p / cut, order) * area[:, None])
    integral, reach = -force[:, 2].copy(), np.zeros(size)
    for f in face:
        reach[f] = np.maximum(reach[f], np.hypot(*start[f].T).max())
    ends = {f[4 + k]: (f[k], f[(k + 1) % 4]) for f in face for k in range(4)}
    for node, pair in ends.items():
        integral[list(pair)] += integral[node] / 2
    use = np.setdiff1d(np.arange(size), list(ends))
    bilinear = np.zeros(size)
    bilinear[use] = sla.spsolve(sp.csc_matrix(mass)[use][:, use], integral[use])
    fine = np.linspace(-1, 1, 13)
    rows = [np.c_[np.einsum("n,fnk->fk", N, xy), np.einsum("n,fnk->fk", N, X), bilinear[face] @ L] for N, _, _, L in (_shape8(u, v) for u in fine for v in fine)]
    rows = np.concatenate(rows)
    rows = rows[np.unique(np.round(rows[:, :2], 6), axis=0, return_index=True)[1]]
    use, near = use[reach[use] < cut], rows[np.hypot(*rows[:, 2:4].T) < 0.8 * s.a]
    light = 0.1 * np.sqrt(hats[use].sum() / len(near))  # the bilinear one has a small say, for where elements are large the series is free
    A = np.r_[series[use] / np.sqrt(hats[use])[:, None], light * _zernike(near[:, 2:4] / cut, order)]
    coefficients = np.linalg.lstsq(A, np.r_[integral[use] / np.sqrt(hats[use]), light * near[:, 4] * weight(near[:, 2:4])], rcond=None)[0]
    folded = np.abs(grid) if s.twin else np.c_[grid[:, 0], np.abs(grid[:, 1])]
    table = LinearNDInterpolator(rows[:, :2], rows[:, 2:])(folded)
    X, b = table[:, :2], table[:, 2]
    inside = np.isfinite(b)
    out, r = np.full(len(grid), np.nan), np.hypot(*X[inside].T) / s.a
    mix = np.clip((r - 0.6) / 0.15, 0, 1)
    out[inside] = mix * b[inside] * np.minimum(weight(X[inside]), 8) + (1 - mix) * (_zernike(X[inside] / cut, order) @ coefficients)
    return out


# ----------------------------------------------------------------------------------------------------------- command line

COLUMNS = ["scene", "axis_x_m", "axis_y_m", "axis_z_m", "depth_m", "x_m", "twin_at_minus_x", "E1_pa", "E0_pa", "block_height_m", "block_radius_m", "disc_radius_m", "nu", "contact"]
COLUMNS += [f"{what}_{i}_{unit}" for what, unit in (("approach", "m"), ("force", "n")) for i in (1, 2, 3)]


def write(out, name, s, m, results):
    """NAME.csv (load_index, x_m, y_m, pressure_pa on a grid of 0.5 mm, y >= 0, x >= 0 for twins) and its row of scenes.csv, replacing an older one."""
    x, y = np.meshgrid(np.arange(0 if s.twin else -34, 35) / 2, np.arange(0, 35) / 2)
    grid, whole = np.c_[x.ravel(), y.ravel()], 4 if s.twin else 2
    with open(f"{out}/{name}.csv", "w") as f:
        f.write("load_index,x_m,y_m,pressure_pa\n")
        for i, (at, force) in enumerate(results):
            p = recover(s, m, at, force, grid) * 1e3
            f.writelines(f"{i + 1},{a / 1e3:.5g},{b / 1e3:.5g},{v:.6g}\n" for (a, b), v in zip(grid, p) if np.isfinite(v))
    forces = [f"{-whole * f[:, 2].sum() * 1e-3:.7g}" for _, f in results]
    row = [name, *(v / 1e3 for v in (*s.axes, s.depth, s.x)), int(s.twin), s.E1 * 1e3, s.E0 * 1e3, s.H / 1e3, s.R / 1e3, s.a / 1e3, s.nu, s.contact, *(d / 1e3 for d in s.approach), *forces]
    path = f"{out}/scenes.csv"
    rows = [r for r in csv.reader(open(path))][1:] if os.path.exists(path) else []
    with open(path, "w", newline="") as f:
        csv.writer(f).writerows([COLUMNS] + [r for r in rows if r[0] != name] + [row])


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    folder, table = sys.argv[1], os.path.join(sys.argv[1], "scenes.csv")
    count, seed = (int(a) for a in (sys.argv[2:4] + ["60", "1"][len(sys.argv) - 2 :])[:2])
    os.makedirs(folder, exist_ok=True)
    known = {r[0] for r in csv.reader(open(table))} if os.path.exists(table) else set()
    for name, scene in drawn(count, seed).items():
        if name in known:
            continue
        begun = time.time()
        try:
            mesh = Mesh(scene)
            write(folder, name, scene, mesh, solve(scene, mesh))
        except ArithmeticError as error:
            print(f"{name}: {error}", flush=True)
        else:
            print(f"{name}: {len(mesh.x)} nodes, {time.time() - begun:.0f} s", flush=True)
