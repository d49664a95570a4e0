#!/usr/bin/env python3
"""Computes the small reference cases of the stability suites, in 80-digit decimal arithmetic, with only Python's standard library.

    evidence/reference_cases.py           write tactile-*/tests/reference/*.json
    evidence/reference_cases.py --check   fail if the files differ from the computed ones

Inputs are doubles, and the numbers belong to these doubles; results are printed with 20 digits. The `condition` of a case bounds
the change of a result, relative to its scale, in units of the rounding of the inputs (2^-52 of each). No algorithm can avoid this
change.
"""
import json
import pathlib
import sys
from decimal import Decimal, getcontext

from reference_math import acos, asin, atan, determinant, eye, inverse, log, mul, solve, square_root, transpose

getcontext().prec = 80
D = Decimal
ROOT = pathlib.Path(__file__).resolve().parent.parent
EPSILON = D(2) ** -52


class Stream:
    """SplitMix64, so that the cases are the same everywhere."""

    def __init__(self, seed):
        self.state = seed

    def next(self):
        mask = (1 << 64) - 1
        self.state = (self.state + 0x9E3779B97F4A7C15) & mask
        z = self.state
        z = ((z ^ (z >> 30)) * 0xBF58476D1CE4E5B9) & mask
        z = ((z ^ (z >> 27)) * 0x94D049BB133111EB) & mask
        return ((z ^ (z >> 31)) >> 11) / (1 << 53)

    def point(self, dimension, size=1.0):
        return [size * (2 * self.next() - 1) for _ in range(dimension)]


# Thin-plate splines ----------------------------------------------------------------------------------------------------------

KERNELS = {
    "r2logr": lambda s: s * s.ln() / 2 if s else D(0),
    "negr": lambda s: -s.sqrt(),
    "r3": lambda s: s * s.sqrt(),
}


def squared(a, b):
    return sum((x - y) ** 2 for x, y in zip(a, b))


def spline(points, values, smoothing, kernel, queries):
    """Values at the queries of the spline of [K + lambda I, P; P', 0]."""
    n, dimension = len(points), len(points[0])
    size = n + dimension + 1
    system = [[D(0)] * size for _ in range(size)]
    for i in range(n):
        for j in range(n):
            system[i][j] = kernel(squared(points[i], points[j])) + (smoothing if i == j else 0)
        for k, x in enumerate([D(1)] + points[i]):
            system[i][n + k] = system[n + k][i] = x
    weights = solve(system, [[v] for v in values] + [[D(0)]] * (dimension + 1))
    weights = [w[0] for w in weights]
    affine = lambda q: weights[n] + sum(w * x for w, x in zip(weights[n + 1:], q))
    return [affine(q) + sum(weights[i] * kernel(squared(points[i], q)) for i in range(n)) for q in queries]


def spline_condition(points, values, smoothing, kernel, queries, results):
    """Sum over all inputs of the largest change of a query by one rounding of the input."""
    scale = max(map(abs, values))
    total = [D(0)] * len(queries)
    step = D(10) ** -30
    for i in range(len(points)):
        for k in range(len(points[0]) + 1):
            moved, changed = [list(p) for p in points], list(values)
            target = moved[i] if k < len(points[0]) else changed
            index = k if k < len(points[0]) else i
            target[index] += target[index] * step
            after = spline(moved, changed, smoothing, kernel, queries)
            total = [t + abs(a - b) / step / scale for t, a, b in zip(total, after, results)]
    return 1 + max(total)


def tps_cases():
    # name, scale, offset in diameters, thickness of the last axis, distance of the closest pair, lambda in the units of the case
    shapes = [
        ("ordinary", 1.0, 0.0, 1.0, None, 0.0), ("scale 1e-9", 1e-9, 0.0, 1.0, None, 0.0), ("scale 1e9", 1e9, 0.0, 1.0, None, 0.0),
        ("offset 1e6", 1.0, 2e6, 1.0, None, 0.0), ("near-coplanar", 1.0, 0.0, 1e-5, None, 0.0),
        ("near-duplicate", 1.0, 0.0, 1.0, 1e-7, 0.0), ("lambda 1e-6", 1.0, 0.0, 1.0, None, 1e-6), ("lambda 1", 1.0, 0.0, 1.0, None, 1.0),
        ("lambda 1e12", 1.0, 0.0, 1.0, None, 1e12),
    ]
    for dimension, kernels in ((2, ["r2logr"]), (3, ["negr", "r3"])):
        for number, (name, scale, offset, thickness, pair, smoothing) in enumerate(shapes):
            stream = Stream(100 * dimension + number)
            place = lambda p: [scale * (x * (thickness if k == dimension - 1 else 1.0) + offset) for k, x in enumerate(p)]
            points = [place(stream.point(dimension)) for _ in range(8)]
            if pair:
                points[7] = [points[0][0] + pair * scale] + points[0][1:]
            values = [2 * stream.next() - 1 for _ in points]
            queries = [place(stream.point(dimension, 0.8)) for _ in range(2)]
            exact = [[list(map(D, p)) for p in s] for s in (points, queries)]
            for kernel in kernels:
                inputs = (exact[0], list(map(D, values)), D(smoothing), KERNELS[kernel], exact[1])
                results = spline(*inputs)
                yield {
                    "name": name, "dimension": dimension, "kernel": kernel, "lambda": smoothing, "points": points, "values": values,
                    "queries": queries, "expected": results, "condition": spline_condition(*inputs, results),
                }


# Optics ----------------------------------------------------------------------------------------------------------------------


def ulps(x, k):
    for _ in range(abs(k)):
        x = next_double(x, k > 0)
    return x


def next_double(x, up):
    import struct
    bits = struct.unpack("<q", struct.pack("<d", x))[0] + (1 if up else -1)
    return struct.unpack("<d", struct.pack("<q", bits))[0]


def optics_cases():
    indices = [("ordinary", 1.38, 1.0), ("ordinary", 1.41, 1.0), ("scale 1e-9", 1.4e-9, 1e-9), ("scale 1e9", 1.4e9, 1e9)]
    indices += [("near n0", ulps(1.0, k), 1.0) for k in (1, 2, 1000)]
    root = 2.0 ** 0.5
    indices += [("near sqrt 2", ulps(root, k), 1.0) for k in (0, -1, -2, -1000)]
    for name, n, n0 in indices:
        n_, n0_ = D(n), D(n0)
        sine = ((n_ - n0_) * (n_ + n0_)).sqrt() / n0_
        case = {"name": name, "n": n, "n0": n0, "critical_rad": asin(n0_ / n_), "critical_complement_rad": acos(n0_ / n_)}
        if sine < 1:
            case |= {"acceptance_rad": asin(sine), "acceptance_complement_rad": acos(sine)}
        yield case


# Strain ----------------------------------------------------------------------------------------------------------------------


def rotation(angle):
    """A rotation about (1, 2, 2)/3, each entry rounded to a double."""
    import math
    c, s, u = math.cos(angle), math.sin(angle), [1 / 3, 2 / 3, 2 / 3]
    cross = [[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]]
    return [[(c if i == j else 0) + s * cross[i][j] + (1 - c) * u[i] * u[j] for j in range(3)] for i in range(3)]


def strain_cases():
    stretch = [[0.9, 0.2, -0.1], [0.2, -0.6, 0.3], [-0.1, 0.3, 0.4]]
    for name, angle, size in [
        ("ordinary", 0.4, 0.1), ("tiny strain", 0.0, 1e-12), ("tiny strain, large turn", 2.5, 1e-12),
        ("small strain, large turn", 3.0, 1e-6), ("large strain", 1.0, 0.9), ("nearly singular", 0.3, 1.3),
    ]:
        turn = rotation(angle)
        f = [[sum(turn[i][k] * ((k == j) + size * stretch[k][j]) for k in range(3)) for j in range(3)] for i in range(3)]
        exact = [[D(x) for x in row] for row in f]
        c = mul(transpose(exact), exact)
        identity = eye(3)
        green = [[(c[i][j] - identity[i][j]) / 2 for j in range(3)] for i in range(3)]
        back = inverse(exact)
        finger = mul(transpose(back), back)
        u = square_root(c)
        norm = lambda m: max(sum(map(abs, row)) for row in m)
        yield {
            "name": name, "f": f, "condition": norm(exact) * norm(back), "jacobian": determinant(exact), "green_lagrange": green,
            "almansi": [[(identity[i][j] - finger[i][j]) / 2 for j in range(3)] for i in range(3)],
            "biot": [[u[i][j] - identity[i][j] for j in range(3)] for i in range(3)],
            "hencky": [[x / 2 for x in row] for row in log(c)],
        }


# Hertz -----------------------------------------------------------------------------------------------------------------------


def hertz_cases():
    for name, force, radius, modulus in [
        ("ordinary", 0.7, 3e-3, 1.3e5), ("scale 1e-9", 0.7e-9, 3e-9, 2e11), ("scale 1e9", 0.7e9, 3e9, 1e-3), ("stiff", 1e-9, 1e9, 1e12),
        ("soft", 1e9, 1e-9, 1.0),
    ]:
        f, r, e = D(force), D(radius), D(modulus)
        a = (3 * f * r / (4 * e)) ** (D(1) / 3)
        yield {
            "name": name, "force": force, "radius": radius, "modulus": modulus, "contact_radius": a, "indentation": a * a / r,
            "peak_pressure": 3 * f / (2 * PI * a * a),
        }


PI = 4 * atan(D(1))


# Matching --------------------------------------------------------------------------------------------------------------------


def angle_between(u, v):
    """2 atan2(|u/|u| - v/|v||, |u/|u| + v/|v||), Kahan."""
    lengths = [sum(x * x for x in w).sqrt() for w in (u, v)]
    u, v = ([x / l for x in w] for w, l in zip((u, v), lengths))
    apart = sum((x - y) ** 2 for x, y in zip(u, v)).sqrt()
    along = sum((x + y) ** 2 for x, y in zip(u, v)).sqrt()
    return PI if along == 0 else 2 * atan(apart / along)


def edges(points):
    return [(i, a, [y - x for x, y in zip(points[i], points[a])]) for i in range(len(points)) for a in range(len(points)) if i != a]


def supports(m, model, target):
    """S_ij = sum over a, b of M_ab min(d)/max(d) (1 - angle/pi), all other points being neighbours."""
    result = [[D(0)] * len(target) for _ in model]
    for i, a, u in edges(model):
        for j, b, v in edges(target):
            d, e = (sum(x * x for x in w).sqrt() for w in (u, v))
            result[i][j] += m[a][b] * min(d, e) / max(d, e) * (1 - angle_between(u, v) / PI)
    return result


def sinkhorn(m, sweeps):
    rows, columns = len(m) - 1, len(m[0]) - 1
    m = [list(row) for row in m]
    for _ in range(sweeps):
        for i in range(rows):
            total = sum(m[i])
            m[i] = [x / total for x in m[i]]
        for j in range(columns):
            total = sum(row[j] for row in m)
            for row in m:
                row[j] /= total
    return m


def matching_cases():
    for number, (name, scale, offset, spread) in enumerate([
        ("ordinary", 1.0, 0.0, 0), ("scale 1e-9", 1e-9, 0.0, 0), ("scale 1e9", 1e9, 0.0, 0), ("offset 1e6", 1.0, 2e6, 0),
        ("wild entries", 1.0, 0.0, 120),
    ]):
        stream = Stream(900 + number)
        model, target = ([[scale * (x + offset) for x in stream.point(2)] for _ in range(n)] for n in (4, 5))
        m = [[(0.0 if (i, j) == (4, 5) else stream.next() * 10.0 ** (spread * (stream.next() - 1))) for j in range(6)] for i in range(5)]
        exact = [[D(x) for x in row] for row in m]
        yield {
            "name": name, "model": model, "target": target, "m": m, "sweeps": 7, "sinkhorn": sinkhorn(exact, 7),
            "support": supports(exact, *([list(map(D, p)) for p in s] for s in (model, target))),
        }


# Uncertain numbers -----------------------------------------------------------------------------------------------------------

def uncertain_cases():
    """Contributions to the error of f(x, y, z) to first order: the gradient times the parts of a source, added in squares for
    noise, the first of four."""
    for number, (name, size) in enumerate([("ordinary", 0), ("scales apart", 9), ("near zero", -12)]):
        stream = Stream(1200 + number)
        inputs = [[stream.next() + 0.5] + stream.point(4, 0.01) for _ in range(3)]
        inputs[1] = [x * 10.0 ** size for x in inputs[1]]
        inputs[0][1:] = [part * inputs[0][0] for part in inputs[0][1:]]
        exact = [[D(x) for x in row] for row in inputs]
        (x, *_), (y, *_), (z, *_) = exact
        power = D(-1.75)

        def propagated(value, gradient):
            moved = [[slope * row[k] for slope, row in zip(gradient, exact)] for k in range(1, 5)]
            noise = sum(m * m for m in moved[0]).sqrt()
            return [value, noise] + [sum(m) for m in moved[1:]]

        raised = (power * x.ln()).exp()
        results = {
            "product": propagated(x * y, [y, x]),
            "quotient": propagated(x / y, [1 / y, -x / y ** 2]),
            "power": propagated(raised, [power * raised / x]),
            "mean": propagated((x + y + z) / 3, [D(1) / 3] * 3),
        }
        covariance = sum(a * b for a, b in zip(results["product"][2:], results["quotient"][2:]))
        yield {"name": name, "inputs": inputs, "exponent": -1.75, **results, "covariance": covariance}


FILES = {
    "tactile-core/tests/reference/uncertain.json": uncertain_cases,
    "tactile-tps/tests/reference/splines.json": tps_cases,
    "tactile-optics/tests/reference/angles.json": optics_cases,
    "tactile-elasticity/tests/reference/strain.json": strain_cases,
    "tactile-elasticity/tests/reference/hertz.json": hertz_cases,
    "tactile-match/tests/reference/relaxation.json": matching_cases,
}


def written(value):
    """JSON with decimals of 20 digits as numbers, one case per line."""
    if isinstance(value, Decimal):
        return f"{value:.19e}" if value else "0.0"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{json.dumps(k)}: {written(v)}" for k, v in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(written, value)) + "]"
    return json.dumps(value)


def main():
    stale = []
    for name, cases in FILES.items():
        text = "[\n" + ",\n".join(written(case) for case in cases()) + "\n]\n"
        path = ROOT / name
        if "--check" in sys.argv[1:]:
            stale += [name] if not path.exists() or path.read_text() != text else []
            continue
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
        print(f"{name}: {text.count(chr(10)) - 2} cases, {len(text)} bytes")
    for name in stale:
        print(f"reference_cases: {name} is not what the script writes")
    return 1 if stale else 0


if __name__ == "__main__":
    sys.exit(main())
