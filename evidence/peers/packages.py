"""The other packages, each as a function with the same arguments. One that is not installed is left out, and said to be."""
import importlib

import numpy as np

# Regularisation, width of the kernel, outlier ratio, tolerance and iterations of coherent point drift. `tuned` is the best of a grid over
# the first three on seeds that the tables do not use (`compare.py --tune --seeds 2`); `customary` are the values of the method's authors;
# `stiff` bends least, for noise. Models are brought to unit radius, targets by the same similarity, or in `customary` by their own.
SETTINGS = {
    "tuned": dict(alpha=3.0, beta=2.0, w=0.2, tolerance=1e-5, iterations=200),
    "stiff": dict(alpha=30.0, beta=2.0, w=0.2, tolerance=1e-5, iterations=200),
    "customary": dict(alpha=3.0, beta=2.0, w=0.1, tolerance=1e-5, iterations=150),
}


def rustcpd_exact(x, y, s):
    return rustcpd(x, y, s, low_rank=None)


def rustcpd_rank30(x, y, s):
    return rustcpd(x, y, s, low_rank=30, low_rank_method="pivoted_cholesky")


def rustcpd(x, y, s, **options):
    import rustcpd

    found = rustcpd.register_deformable(
        y, x, alpha=s["alpha"], beta=s["beta"], outlier_weight=s["w"], tolerance=s["tolerance"],
        max_iterations=s["iterations"], parallel=False, **options,
    )
    return np.asarray(found.points)


def pycpd(x, y, s):
    import pycpd

    registration = pycpd.DeformableRegistration(
        X=y, Y=x, alpha=s["alpha"], beta=s["beta"], w=s["w"], tolerance=s["tolerance"], max_iterations=s["iterations"]
    )
    return registration.register()[0]


def probreg(x, y, s):
    from probreg import cpd

    found = cpd.registration_cpd(
        x, y, "nonrigid", lmd=s["alpha"], beta=s["beta"], w=s["w"], tol=s["tolerance"], maxiter=s["iterations"]
    )
    return found.transformation.transform(x)


def scipy_assignment(x, y, _):
    """The cheapest assignment by distance: what a matcher must beat. A point that gets no partner stays."""
    from scipy.optimize import linear_sum_assignment
    from scipy.spatial.distance import cdist

    warped = x.copy()
    rows, columns = linear_sum_assignment(cdist(x, y))
    warped[rows] = y[columns]
    return warped


def matchers():
    """Functions from a model and a target to the warped model, by name."""
    # The same method gives the same answer: the slower packages, and the low rank, run fewer settings.
    drift = {
        "rustcpd": (rustcpd_exact, SETTINGS),
        "rustcpd rank 30": (rustcpd_rank30, ["tuned"]),
        "pycpd": (pycpd, ["tuned"]),
        "probreg": (probreg, ["tuned", "customary"]),
    }
    found = {
        f"{name}, {setting}": (call, SETTINGS[setting])
        for name, (call, settings) in drift.items()
        if installed(name.split()[0])
        for setting in settings
    }
    return found | {"scipy linear_sum_assignment": (scipy_assignment, None)}


def splines():
    """By name: kernel, fit(sources, targets), values(fitted, queries), values and gradients or None."""
    from scipy.interpolate import RBFInterpolator

    found = {}
    for kernel, name in (("r2logr", "thin_plate_spline"), ("r", "linear")):
        fit = lambda x, y, name=name: RBFInterpolator(x, y, kernel=name, degree=1)
        found[f"scipy {name}"] = (kernel, fit, lambda model, q: model(q), None)
    if installed("ferreus_rbf"):
        from ferreus_rbf import RBFInterpolator as Ferreus
        from ferreus_rbf.interpolant_config import Drift, InterpolantSettings, RBFKernelType

        for kernel, name in (("r2logr", "ThinPlateSpline"), ("r", "Linear")):
            settings = InterpolantSettings(getattr(RBFKernelType, name), drift=Drift.Linear)
            fit = lambda x, y, settings=settings: Ferreus(x, y, settings)
            found[f"ferreus_rbf {name}"] = (
                kernel, fit, lambda model, q: model.evaluate(q), lambda model, q: model.evaluate_with_gradients(q)
            )
    if installed("morphops"):
        import morphops

        values = lambda m, q: morphops.P_matrix(q) @ m[2] + morphops.K_matrix(q, m[0]) @ m[1]
        found["morphops"] = ("r", lambda x, y: (x, *morphops.tps_coefs(x, y)), values, None)
    return found


def scipy_poisson(p, q):
    """Least squares with natural boundary: the divergence of the slopes, inverted by scipy's cosine transforms."""
    from scipy import fft

    rows, columns = p.shape
    flux_x, flux_y = np.zeros((rows, columns + 1)), np.zeros((rows + 1, columns))
    flux_x[:, 1:-1] = (p[:, 1:] + p[:, :-1]) / 2
    flux_y[1:-1] = (q[1:] + q[:-1]) / 2
    spectrum = fft.dctn(np.diff(flux_x, axis=1) + np.diff(flux_y, axis=0), norm="ortho", overwrite_x=True)
    along = lambda n: 2 * np.cos(np.pi * np.arange(n) / n) - 2
    eigenvalues = along(rows)[:, None] + along(columns)[None]
    eigenvalues[0, 0] = 1.0
    spectrum /= eigenvalues
    spectrum[0, 0] = 0.0
    return fft.idctn(spectrum, norm="ortho", overwrite_x=True)


def installed(name):
    try:
        # What fails to import may lie below the package's own front page.
        importlib.import_module({"probreg": "probreg.cpd"}.get(name, name))
    except (ImportError, OSError) as error:
        if name not in missing:
            missing[name] = str(error)
    return name not in missing


missing = {}
