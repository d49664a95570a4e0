"""Elementary functions and small matrices over `decimal`, to the precision of the context minus a few digits."""
from decimal import Decimal, getcontext

D = Decimal


def atan(x):
    """Halves the angle until the series is short: atan x = 2 atan(x / (1 + sqrt(1 + x^2)))."""
    x, factor = D(x), 1
    while abs(x) > D("0.01"):
        x, factor = x / (1 + (1 + x * x).sqrt()), 2 * factor
    total, power, k = D(0), x, 1
    while power and abs(power) > abs(x) * D(10) ** -(getcontext().prec + 5):
        total += power / k if k % 4 == 1 else -power / k
        power, k = power * x * x, k + 2
    return factor * total


def asin(x):
    return 2 * atan(x / (1 + ((1 - x) * (1 + x)).sqrt()))


def acos(x):
    """Accurate near 1: pi/2 - asin x = 2 atan sqrt((1 - x)/(1 + x))."""
    return 2 * atan(((1 - x) / (1 + x)).sqrt())


def eye(n):
    return [[D(i == j) for j in range(n)] for i in range(n)]


def transpose(a):
    return [list(row) for row in zip(*a)]


def mul(a, b):
    return [[sum(x * y for x, y in zip(row, column)) for column in zip(*b)] for row in a]


def solve(a, b):
    """Gauss with row pivoting."""
    rows = [list(x) + list(y) for x, y in zip(a, b)]
    n = len(a)
    for k in range(n):
        pivot = max(range(k, n), key=lambda i: abs(rows[i][k]))
        rows[k], rows[pivot] = rows[pivot], rows[k]
        for i in range(k + 1, n):
            factor = rows[i][k] / rows[k][k]
            if factor:
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k])]
    for k in reversed(range(n)):
        rows[k] = [x / rows[k][k] for x in rows[k]]
        for i in range(k):
            factor = rows[i][k]
            rows[i] = [x - factor * y for x, y in zip(rows[i], rows[k])]
    return [row[n:] for row in rows]


def inverse(a):
    return solve(a, eye(len(a)))


def determinant(a):
    (a, b, c), (d, e, f), (g, h, i) = a
    return a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g)


def square_root(a):
    """Denman and Beavers' iteration, quadratic."""
    y, z = a, eye(len(a))
    for _ in range(200):
        back_y, back_z = inverse(y), inverse(z)
        following = [[(p + q) / 2 for p, q in zip(r, s)] for r, s in zip(y, back_z)]
        z = [[(p + q) / 2 for p, q in zip(r, s)] for r, s in zip(z, back_y)]
        change = max(abs(p - q) for r, s in zip(y, following) for p, q in zip(r, s))
        y = following
        if change < D(10) ** -(getcontext().prec - 8):
            return y
    raise ArithmeticError("no square root")


def log(a):
    """Square roots until a is near one, then the series of log(1 + x), then doubled back."""
    root, factor = a, 1
    distance = lambda m: max(abs(p - q) for r, s in zip(m, eye(len(m))) for p, q in zip(r, s))
    while distance(root) > D("1e-3"):
        root, factor = square_root(root), 2 * factor
    x = [[p - q for p, q in zip(r, s)] for r, s in zip(root, eye(len(a)))]
    total, power = [[D(0)] * len(a) for _ in a], x
    for k in range(1, 60):
        total = [[t + (p / k if k % 2 else -p / k) for t, p in zip(r, s)] for r, s in zip(total, power)]
        power = mul(power, x)
    return [[factor * t for t in row] for row in total]
