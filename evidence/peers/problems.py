"""Problems with known answers: point sets to match, splines to fit, slopes to integrate.

Case files are those of `tactile match`: a line `case NAME D n_model n_target`, then rows `m` (model point), `t` (target point,
shuffled), `g` (noise-free true position of a model point) and `p` (row of its true partner among the targets, -1 for none). Programs
see `m` and `t`.
"""
from dataclasses import dataclass

import numpy as np


@dataclass
class Case:
    """Two point sets and, for every model point, its true position and the row of its partner."""

    name: str
    model: np.ndarray
    target: np.ndarray
    truth: np.ndarray
    partner: np.ndarray

    @property
    def level(self):
        """The name without the number of its draw."""
        return self.name.rsplit("_", 1)[0]

    def text(self):
        lines = [f"case {self.name} {self.model.shape[1]} {len(self.model)} {len(self.target)}"]
        for tag, rows in (("m", self.model), ("t", self.target), ("g", self.truth)):
            lines += [" ".join([tag, *(repr(float(v)) for v in row)]) for row in rows]
        lines += [f"p {row}" for row in self.partner]
        return "\n".join(lines) + "\n"

    def score(self, warped, assigned):
        """Mean distance of the warped points from the truth, and share of right partners, over the points that have one."""
        paired = self.partner >= 0
        # Published files give true positions only for paired points.
        truth = self.truth if len(self.truth) == paired.sum() else self.truth[paired]
        error = np.linalg.norm(np.asarray(warped)[paired] - truth, axis=1).mean()
        return float(error), float((np.asarray(assigned)[paired] == self.partner[paired]).mean())


def read_cases(path):
    cases = []
    for line in open(path):
        tag, *words = line.split() or ["#"]
        if tag == "case":
            rows = {key: [] for key in "mtgp"}
            cases.append((words[0], rows))
        elif tag in "mtgp":
            rows[tag].append([float(word) for word in words])
    return [
        Case(name, *(np.array(rows[tag]) for tag in "mtg"), np.array(rows["p"], int).ravel())
        for name, rows in cases
        if rows["g"] and rows["p"]
    ]


def read_answers(path):
    """Warped points, assigned rows and time in ms by case, from a result file of `tactile match`."""
    answers = {}
    for line in open(path):
        tag, *words = line.split() or ["#"]
        if tag == "case":
            warped, assigned = [], []
            answers[words[0]] = (warped, assigned, float(words[1]))
        elif tag == "w":
            warped.append([float(word) for word in words])
        elif tag == "a":
            assigned.append(int(words[0]))
    return answers


# Root mean square displacement as a share of the diameter.
LEVELS = {1: 0.03, 2: 0.08, 3: 0.15}
# Noise: root mean square 2 % of the diameter; outliers: a fifth more targets, anywhere; missing: a tenth of the targets.
DEGRADATIONS = ("clean", "noise", "outliers", "missing")
SHAPES = {"plane105": (2, 105), "space105": (3, 105), "space200": (3, 200)}


def scattered(n, rng):
    """Points of the unit disc. Each is the farthest of ten draws from the previous points, so that they are even but not a lattice."""
    points = np.zeros((0, 2))
    while len(points) < n:
        draws = rng.uniform(-1, 1, (40, 2))
        draws = draws[(draws**2).sum(1) < 1][:10]
        nearest = np.linalg.norm(draws[:, None] - points[None], axis=2).min(1, initial=9.0)
        points = np.vstack([points, draws[nearest.argmax()]])
    return points


def smooth_field(model, rms, diameter, rng):
    """A random affine field and six Gaussians with a width of 0.4 diameters. None if it folds or stretches by more than 2.5."""
    n, dim = model.shape
    low, high = model.min(0), model.max(0)
    centres, amplitudes = rng.uniform(low, high, (6, dim)), rng.normal(size=(6, dim))
    affine = 0.25 * rng.normal(size=(dim, dim))
    steps = model[:, None] - centres[None]
    width = 0.4 * diameter
    weights = np.exp(-(steps**2).sum(2) / (2 * width**2))
    field = weights @ amplitudes + (model - model.mean(0)) @ affine.T
    field -= field.mean(0)
    scale = rms / np.sqrt((field**2).sum(1).mean())
    bends = -np.einsum("nk,ki,nkj->nij", weights, amplitudes, steps) / width**2
    gradients = np.eye(dim) + scale * (bends + affine)
    stretches = np.linalg.svd(gradients, compute_uv=False)
    if np.linalg.det(gradients).min() <= 0 or stretches.min() < 0.4 or stretches.max() > 2.5:
        return None
    return scale * field


def synthetic(shape, level, degradation, seed):
    """A disc (plane) or a bell over it (space), moved by a smooth field and degraded; the random draw depends on all arguments."""
    dim, n = SHAPES[shape]
    rng = np.random.default_rng([seed, level, dim, n])
    model = scattered(n, rng)
    if dim == 3:
        model = np.c_[model, 0.6 * np.exp(-(model**2).sum(1) / 0.4)]
    diameter = np.linalg.norm(model[:, None] - model[None], axis=2).max()
    field = None
    while field is None:
        field = smooth_field(model, LEVELS[level] * diameter, diameter, rng)
    truth, kept = model + field, np.arange(n)
    # The degradations of one seed share their geometry.
    rng = np.random.default_rng([seed, level, dim, n, 1 + DEGRADATIONS.index(degradation)])
    target = truth
    if degradation == "noise":
        target = truth + rng.normal(size=truth.shape) * 0.02 * diameter / np.sqrt(dim)
    elif degradation == "missing":
        kept = np.sort(rng.permutation(n)[n // 10 :])
        target = truth[kept]
    elif degradation == "outliers":
        low, high = truth.min(0), truth.max(0)
        margin = 0.1 * (high - low)
        target = np.vstack([truth, rng.uniform(low - margin, high + margin, (n // 5, dim))])
    order = rng.permutation(len(target))
    partner = np.full(n, -1)
    partner[kept] = np.argsort(order)[: len(kept)]
    return Case(f"{shape}_L{level}_{degradation}_{seed}", model, target[order], truth, partner)


def spline_problem(n, seed=0):
    """Points of a cube, their images, queries and the queries' true images: identity plus five Gaussians."""
    rng = np.random.default_rng([seed, n])
    centres, amplitudes = rng.uniform(-1, 1, (5, 3)), rng.normal(0, 0.1, (5, 3))

    def image(points):
        squares = ((points[:, None] - centres[None]) ** 2).sum(2)
        return points + np.exp(-squares / 0.72) @ amplitudes

    sources, queries = rng.uniform(-1, 1, (n, 3)), rng.uniform(-0.95, 0.95, (10_000, 3))
    return sources, image(sources), queries, image(queries)


def slopes_problem(rows, columns, seed=0):
    """Heights of eight Gaussian bumps that vanish at the border, and their slopes along x and y."""
    rng = np.random.default_rng([seed, rows, columns])
    y, x = np.mgrid[0:rows, 0:columns].astype(float)
    z, p, q = np.zeros((3, rows, columns))
    small = min(rows, columns)
    for _ in range(8):
        cx, cy = columns * rng.uniform(0.35, 0.65), rows * rng.uniform(0.35, 0.65)
        width, height = small * rng.uniform(0.03, 0.06), small * rng.normal(0, 0.02)
        bump = height * np.exp(-((x - cx) ** 2 + (y - cy) ** 2) / (2 * width**2))
        z, p, q = z + bump, p - bump * (x - cx) / width**2, q - bump * (y - cy) / width**2
    return z - z.mean(), p, q
