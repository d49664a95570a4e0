#!/usr/bin/env python3
"""Run `tactile` and other packages on the same problems, in one run, and write one table of errors beside times.

    cargo build --release -p tactile-cli
    evidence/peers/compare.py                                    # synthetic cases, splines, slopes
    evidence/peers/compare.py --cases FOLDER --only matching     # also case files of yours, such as Chui and Rangarajan's

The packages of requirements.txt are installed into a virtual environment of their own; one that cannot be installed is left out and
named in the table. Everything has one thread. A problem is given to all programs in turn, --rounds times, and the least time of a
program counts: what else the machine does then touches all of them alike. Times are those of the call alone, measured in each program's
own process, without reading files and without the first call. All programs have one setting for all cases; `tactile` its defaults.
"""
import argparse
import collections
import json
import os
import pathlib
import platform
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
THREADS = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL", "RAYON", "NUMEXPR")}
# In a ratio an error below this counts as this: what is exact has rounding errors alone.
FLOOR = 1e-4


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--venv", type=pathlib.Path, default=TARGET / "peers" / "venv", help="virtual environment, made where it is missing")
    parser.add_argument("--out", type=pathlib.Path, default=TARGET / "peers", help="folder for comparison.md and comparison.json")
    parser.add_argument("--program", type=pathlib.Path, default=TARGET / "release" / "tactile", help="the program `tactile`")
    parser.add_argument("--only", nargs="+", choices=["matching", "splines", "slopes"], default=["matching", "splines", "slopes"])
    parser.add_argument("--cases", type=pathlib.Path, action="append", default=[], metavar="FOLDER", help="folder of case files with truth (may be repeated)")
    parser.add_argument("--samples", type=int, default=5, help="cases a level taken from such files")
    parser.add_argument("--seeds", type=int, default=5, help="synthetic cases a level (0: none)")
    parser.add_argument("--rounds", type=int, default=3, help="times that every program gets every problem")
    parser.add_argument("--tune", action="store_true", help="search the setting `tuned` again, print it, and stop")
    return parser.parse_args()


def in_environment(options):
    """Continues in the virtual environment, with one thread."""
    python = options.venv / "bin" / "python"
    if pathlib.Path(sys.prefix).resolve() == options.venv.resolve():
        return
    done = options.venv / "installed.txt"
    wanted = (HERE / "requirements.txt").read_text()
    if not done.is_file() or done.read_text() != wanted:
        subprocess.run([sys.executable, "-m", "venv", options.venv], check=True)
        # One by one: where one cannot be built the others are still compared.
        for package in wanted.split():
            print(f"installing {package}", file=sys.stderr)
            install = [python, "-m", "pip", "install", "-q", "--disable-pip-version-check", package]
            if subprocess.run(install).returncode:
                print(f"{package} is left out", file=sys.stderr)
        done.write_text(wanted)
    os.execve(python, [str(python), __file__, *sys.argv[1:]], os.environ | THREADS)


def timed(call, *values):
    start = time.perf_counter()
    found = call(*values)
    return found, 1e3 * (time.perf_counter() - start)


def tactile(program, *words):
    """The answer of the program as JSON."""
    command = [str(program), *map(str, words), "--json"]
    run = subprocess.run(command, capture_output=True, text=True)
    if run.returncode not in (0, 3):
        raise RuntimeError(f"{' '.join(command)}: {run.stderr.strip()}")
    return json.loads(run.stdout)


class Table:
    """Rows by set, level and program; the first program is the one that the others are compared with."""

    def __init__(self):
        self.rows = collections.OrderedDict()

    def add(self, group, level, program, **figures):
        self.rows.setdefault((group, level, program), []).append(figures)

    def levels(self):
        """A row a level and program: means of errors, medians of times, ratios to the first program."""
        import numpy as np

        rows, first = [], {}
        for (group, level, program), cases in self.rows.items():
            row = dict(set=group, level=level, program=program, cases=len(cases))
            row["failed"] = sum(case.get("failed", 0) for case in cases)
            for key in cases[0].keys() - {"failed"}:
                values = [case[key] for case in cases]
                none = any(value is None for value in values)
                row[key] = None if none else float((np.median if key.endswith("ms") else np.mean)(values))
            ours = first.setdefault((group, level), row)
            row["error_ratio"] = max(row["error"], FLOOR) / max(ours["error"], FLOOR)
            row["time_ratio"] = row["ms"] / ours["ms"]
            rows.append(row)
        return rows


def matching(options, table):
    import numpy as np
    import packages
    import problems

    sets = collections.OrderedDict()
    for shape in problems.SHAPES:
        sets[shape] = [
            problems.synthetic(shape, level, degradation, seed)
            for level in problems.LEVELS
            for degradation in problems.DEGRADATIONS
            for seed in range(options.seeds)
        ]
    for folder in options.cases:
        for path in sorted(folder.glob("*.txt")):
            by_level = collections.OrderedDict()
            for case in problems.read_cases(path):
                by_level.setdefault(case.level, []).append(case)
            sets[path.stem] = [case for cases in by_level.values() for case in cases[: options.samples]]
    ours = {"tactile match": [], "tactile match --method drift": ["--method", "drift"]}
    peers = packages.matchers()
    with tempfile.TemporaryDirectory() as folder:
        path, out = pathlib.Path(folder) / "case.txt", pathlib.Path(folder) / "out"
        for name, cases in sets.items():
            print(f"matching {name}: {len(cases)} cases", file=sys.stderr)
            for case in cases:
                path.write_text(case.text())
                best = {}
                for _ in range(options.rounds):
                    for program, words in ours.items():
                        tactile(options.program, "match", path, "--out", out, "--repeat", 3, *words)
                        answer = problems.read_answers(out / path.name).get(case.name)
                        keep(best, program, answer or (case.model, np.full(len(case.model), -1), float("nan")), answer is None)
                    for program, (call, setting) in peers.items():
                        answer, failed = registered(call, setting, case)
                        keep(best, program, answer, failed)
                for program, (warped, assigned, ms, failed) in best.items():
                    error, right = case.score(warped, assigned)
                    table.add(name, case.level, program, error=error, right=right, ms=ms, failed=int(failed))


def keep(best, program, answer, failed):
    """The answer with the least time so far."""
    warped, assigned, ms = answer
    if program not in best or best[program][3] or ms < best[program][2]:
        best[program] = (warped, assigned, ms, failed)


def registered(call, setting, case):
    """Warped points, nearest targets and time; a call that fails leaves the model where it was."""
    import numpy as np
    from packages import SETTINGS

    def frame(points):
        centre = points.mean(0)
        return centre, np.sqrt(((points - centre) ** 2).sum(1).mean())

    (centre, scale), (target_centre, target_scale) = frame(case.model), frame(case.target)
    if setting is not SETTINGS["customary"]:
        target_centre, target_scale = centre, scale
    x, y = (case.model - centre) / scale, (case.target - target_centre) / target_scale
    try:
        warped, ms = timed(call, x, y, setting)
        failed = not np.isfinite(warped).all()
    except Exception as error:
        print(f"{case.name}: {type(error).__name__}: {error}", file=sys.stderr)
        failed = True
    if failed:
        warped, ms, target_centre, target_scale = x, float("nan"), centre, scale
    nearest = np.linalg.norm(warped[:, None] - y[None], axis=2).argmin(1)
    return (warped * target_scale + target_centre, nearest, ms), failed


def splines(options, table):
    import numpy as np
    import packages
    import problems

    for n in (200, 1000):
        sources, targets, queries, truth = problems.spline_problem(n)
        rms = lambda values: float(np.sqrt(((np.asarray(values) - truth) ** 2).sum(1).mean()))
        for kernel in ("r2logr", "r"):
            best, group = {}, f"spline {kernel}"

            def least(program, error, **times):
                kept = best.setdefault(program, dict(error=error, **times))
                for key, ms in times.items():
                    kept[key] = ms if ms is None else min(ms, kept[key])

            peers = {name: rest for name, (kind, *rest) in packages.splines().items() if kind == kernel}
            with tempfile.TemporaryDirectory() as folder:
                paths = [pathlib.Path(folder) / f"{name}.csv" for name in ("sources", "targets", "queries")]
                for path, points in zip(paths, (sources, targets, queries)):
                    np.savetxt(path, points, delimiter=",", header="x,y,z", comments="", fmt="%.17g")
                for _ in range(options.rounds):
                    answer = tactile(options.program, "warp", *paths, "--kernel", kernel, "--repeat", 5, "--out", folder)
                    warped = np.loadtxt(pathlib.Path(folder) / "warped.csv", delimiter=",", skiprows=1)[:, :3]
                    # Its evaluation always gives the gradients too.
                    evaluate = answer["evaluate_ms"]
                    least("tactile warp", rms(warped), ms=answer["fit_ms"], evaluate_ms=evaluate, gradient_ms=evaluate)
                    for program, (fit, values, gradients) in peers.items():
                        if program not in best:
                            values(fit(sources, targets), queries)
                        model, fit_ms = timed(fit, sources, targets)
                        found, evaluate_ms = timed(values, model, queries)
                        gradient_ms = timed(gradients, model, queries)[1] if gradients else None
                        least(program, rms(found), ms=fit_ms, evaluate_ms=evaluate_ms, gradient_ms=gradient_ms)
            for program, figures in best.items():
                table.add(group, f"n = {n}", program, **figures)


def slopes(options, table):
    import numpy as np
    import packages
    import problems

    shape = (1042, 1392)
    heights, p, q = problems.slopes_problem(*shape)
    relative = lambda found: float(np.linalg.norm(found - found.mean() - heights) / np.linalg.norm(heights))
    best = {}
    with tempfile.TemporaryDirectory() as folder:
        paths = [pathlib.Path(folder) / f"{name}.csv" for name in "pq"]
        for path, values in zip(paths, (p, q)):
            np.savetxt(path, values, delimiter=",", fmt="%.17g")
        for k in range(options.rounds):
            out = ["--out", folder] if k == 0 else []
            ms = tactile(options.program, "integrate", *paths, "--method", "poisson", "--repeat", 5, *out)["time_ms"]
            if k == 0:
                error = relative(np.loadtxt(pathlib.Path(folder) / "heights.csv", delimiter=","))
            best["tactile integrate"] = dict(error=error, ms=min(ms, best.get("tactile integrate", {"ms": ms})["ms"]))
            packages.scipy_poisson(p, q)
            found, ms = timed(packages.scipy_poisson, p, q)
            best["scipy cosine Poisson"] = dict(error=relative(found), ms=min(ms, best.get("scipy cosine Poisson", {"ms": ms})["ms"]))
    for program, figures in best.items():
        table.add("slopes", f"{shape[1]} × {shape[0]}", program, **figures)


def tune(options):
    """The best of a grid for coherent point drift, on seeds from 100 on."""
    import itertools

    import packages
    import problems

    seeds = range(100, 100 + options.seeds)
    draws = itertools.product(problems.SHAPES, problems.LEVELS, problems.DEGRADATIONS, seeds)
    cases = [problems.synthetic(*draw) for draw in draws]
    results = []
    for alpha, beta, w in itertools.product((1, 3, 10, 30, 100), (1, 1.5, 2, 3), (0.1, 0.2, 0.4)):
        setting = packages.SETTINGS["tuned"] | dict(alpha=float(alpha), beta=float(beta), w=w)
        answers = (registered(packages.rustcpd_exact, setting, case)[0] for case in cases)
        errors = [case.score(*answer[:2])[0] for case, answer in zip(cases, answers)]
        results.append((sum(errors) / len(errors), setting))
    for error, setting in sorted(results, key=lambda result: result[0])[:5]:
        print(f"mean error {error:.5f}: {setting}")


def number(value, digits=3):
    return "–" if value is None else f"{value:.{digits}g}"


def summary(rows):
    """A line a set and program."""
    import numpy as np

    lines = [
        "| set | program | mean error | error ÷ ours, geometric mean | levels with less / more error (by 3 %) | right | median ms | time ÷ ours | failed |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    groups = collections.OrderedDict()
    for row in rows:
        if "right" in row:
            groups.setdefault((row["set"], row["program"]), []).append(row)
    for (name, program), levels in groups.items():
        ratios = np.array([row["error_ratio"] for row in levels])
        mean = lambda key: np.mean([row[key] for row in levels])
        lines.append(
            f"| {name} | {program} | {mean('error'):.4g} | {np.exp(np.log(ratios).mean()):.3f} | {(ratios < 0.97).sum()} / {(ratios > 1.03).sum()} "
            f"| {100 * mean('right'):.1f} % | {np.median([row['ms'] for row in levels]):.3g} "
            f"| {np.exp(np.log([row['time_ratio'] for row in levels]).mean()):.3g} | {sum(row['failed'] for row in levels)} |"
        )
    return lines if groups else []


def markdown(rows, conditions):
    lines = ["# Beside other packages", ""]
    lines += [f"- {key}: {value}" for key, value in conditions.items()]
    lines += ["", *summary(rows), ""]
    lines += [
        "| set | level | program | error | right | ms | error ÷ ours | time ÷ ours | 10,000 values, ms | with gradients, ms |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        right = "–" if "right" not in row else f"{100 * row['right']:.1f} %"
        lines.append(
            f"| {row['set']} | {row['level']} | {row['program']} | {row['error']:.3g} | {right} | {number(row['ms'])} | {number(row['error_ratio'])} "
            f"| {number(row['time_ratio'])} | {number(row.get('evaluate_ms'))} | {number(row.get('gradient_ms'))} |"
        )
    return "\n".join(lines) + "\n"


def main():
    options = arguments()
    if not options.program.is_file():
        sys.exit(f"{options.program} is not there: cargo build --release -p tactile-cli")
    in_environment(options)
    import importlib.metadata

    import packages

    if options.tune:
        return tune(options)
    table = Table()
    for part in options.only:
        {"matching": matching, "splines": splines, "slopes": slopes}[part](options, table)
    versions = {}
    for line in (HERE / "requirements.txt").read_text().split():
        name = line.split("==")[0]
        try:
            versions[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            versions[name] = "not installed"
    conditions = {
        "machine": f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} at the end, one thread a program",
        "packages": ", ".join(f"{name} {version}" for name, version in versions.items()),
        "times": f"least of {options.rounds} rounds; ratios hold within this run alone",
    }
    if packages.missing:
        conditions["left out"] = "; ".join(f"{name}: {why}" for name, why in packages.missing.items())
    rows = table.levels()
    options.out.mkdir(parents=True, exist_ok=True)
    text = markdown(rows, conditions)
    (options.out / "comparison.md").write_text(text)
    (options.out / "comparison.json").write_text(json.dumps(dict(conditions=conditions, settings=packages.SETTINGS, rows=rows), indent=1) + "\n")
    print(text.split("\n\n| set | level")[0])
    print(f"\nall levels: {options.out / 'comparison.md'}, {options.out / 'comparison.json'}")


if __name__ == "__main__":
    main()
