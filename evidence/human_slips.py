"""Plausible mistakes of a user with valid data: no result may be wrong without a caution.

    python3 evidence/human_slips.py --program target/debug/tactile

Each mistake is one change of a valid call: a unit, a column, a name, a frame, a number from the wrong line. The call must be
refused, the interval of every result must contain the truth, or a caution must name the mistake, its field or its consequence.
Prints the mistakes that violate this, and the number of mistakes.
"""

import argparse
import itertools
import json
import pathlib
import re
import shutil
import subprocess
import tempfile

EXAMPLES = pathlib.Path(__file__).parent.parent / "examples" / "data"
# The ball of the example, and the forces of its frames.
MODULUS_PA, FORCES_N = 103e3, [0.01, 0.02]
FORCE = "force --reference press/reference.png --pairs press/calibration.csv --pixel-um 40 press/frame_1.png press/frame_2.png"
DEPTH = "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 dark_frame.pgm --ball-radius-mm 4"


def scene_slips():
    """Changes of the scene file."""
    sizes = ["[40, 40]", "[0.04, 0.04]", "[4e-5, 40]", "[4e-5, 4e-4]", "[40e-9, 40e-9]", "[8e-5, 8e-5]", "[4e-4, 4e-4]", "[4e-6, 4e-6]", "[2e-5, 4e-5]", "[80e-6, 40e-6]", "[40, 40e-6]", "[44e-5, 44e-5]"]
    radii = ["3", "6e-3", "1.5e-3", "3e-6", "30e-3", "0.3", "3e-4"]
    thicknesses = ["10", "1e-3", "10e-6", "0.1"]
    moduli = ["100", "100e6", "0.1", "1e3", "100e9"]
    ratios = ["0.3", "0.05", "5", "-0.5", "0.0"]
    forces = ["10", "0.1", "1e-5", "20", "1000"]
    yield from (("[4e-05, 4e-05]", size) for size in sizes)
    yield from (("radius_m = 0.003", f"radius_m = {radius}") for radius in radii)
    yield from (("thickness_m = 10e-3", f"thickness_m = {thickness}") for thickness in thicknesses)
    yield from (("youngs_modulus_pa = 100e3", f"youngs_modulus_pa = {modulus}") for modulus in moduli)
    yield from (("0.003\npoisson_ratio = 0.5", f"0.003\npoisson_ratio = {ratio}") for ratio in ratios)
    yield from (('"frame_1.png"', f'"frame_1.png"\nforce_N = {force}') for force in forces)
    yield from [
        ('image = "frame_1.png"', 'image = "reference.png"'),
        ('image = "frame_2.png"', 'image = "frame_1.png"'),
        ('reference = "reference.png"', 'reference = "frame_1.png"'),
        ('reference = "reference.png"', 'reference = "frame_2.png"'),
        ('shape = "sphere"', 'shape = "ball"'),
        ('shape = "sphere"\nradius_m = 0.003', 'shape = "block"'),
        ('pairs = "calibration.csv"', 'depth_table = "calibration.csv"'),
    ]


def table_slips(text):
    """Changes of a table of two columns with a heading."""
    head, *rows = text.strip().splitlines()
    cells = [row.split(",") for row in rows]
    first, second = (list(column) for column in zip(*cells))
    join = lambda a, b, heading=head: "\n".join([heading, *(f"{x},{y}" for x, y in zip(a, b))]) + "\n"
    scaled = lambda column, factor: [repr(float(v) * factor) for v in column]
    yield "swapped columns", join(second, first)
    yield "reversed forces", join(first, second[::-1])
    yield "constant", join(first, second[:1] * len(second))
    for factor in (1e3, 1e-3, 10, 9.81, 1 / 9.81, 1e6):
        yield f"forces times {factor:g}", join(first, scaled(second, factor))
    for factor in (1e3, 1e-3, 1e-6):
        yield f"light times {factor:g}", join(scaled(first, factor), second)
    yield "half the rows", join(first[::2], second[::2])
    yield "two rows", join(first[:2], second[:2])
    yield "one outlier", join(first, [repr(10 * float(second[-1]) + 1), *second[1:]])
    yield "heading in mN", join(first, second, head.replace("_N", "_mN"))
    yield "no heading", "\n".join(rows) + "\n"
    yield "semicolons and commas", text.replace(",", ";").replace(".", ",")


def option_slips():
    """Changes of the arguments."""
    for um in ("40e-6", "0.04", "4", "400", "40,40000", "40,4", "80", "20", "40000", "40,48"):
        yield FORCE.replace("--pixel-um 40", f"--pixel-um {um}"), "force"
    names = ["press/reference.png", "press/frame_1.png", "press/frame_2.png"]
    for reference, *frames in itertools.permutations(names):
        if reference != names[0]:
            yield f"force --reference {reference} --pairs press/calibration.csv --pixel-um 40 {' '.join(frames)}", "force"
    for um in ("0.1", "100e-6", "1e5", "100,1e5", "10", "1000"):
        yield DEPTH.replace("--pixel-um 100", f"--pixel-um {um}"), "depth"
    for mm in ("4e-3", "8", "2", "40", "4000"):
        yield DEPTH.replace("--ball-radius-mm 4", f"--ball-radius-mm {mm}"), "depth"
    yield DEPTH.replace("dark_reference.pgm", "dark_frame.pgm").replace("100 dark_frame", "100 dark_reference"), "depth"


def truths(command):
    """Places of the results of a subcommand, and their true values."""
    if command in ("measure", "stream"):
        yield ("youngs_modulus_pa",), MODULUS_PA
    if command == "force":
        yield from ((("frames", k, "contact", "force_n"), force) for k, force in enumerate(FORCES_N))


def answered(program, folder, call):
    """The result of a call. None if it is refused."""
    ended = subprocess.run([program, *call.split(), "--json"], cwd=folder, capture_output=True, text=True, timeout=120)
    if ended.returncode == 2 or not ended.stdout:
        return None
    # A stream prints a line for each frame, and its result in the last one.
    text = ended.stdout.splitlines()[-1] if call.startswith("stream") else ended.stdout
    return json.loads(text)


def kinds(answer):
    return {caution["kind"] for caution in answer["cautions"]}


def silent(answer, usual):
    """Wrong results without a caution. A caution that also occurs for the valid data (`usual`) is not about the mistake."""
    if answer is None or kinds(answer) - usual[answer["command"]]:
        return None
    for path, truth in truths(answer["command"]):
        found = answer
        for key in path:
            found = found[key] if isinstance(found, list) or key in (found or {}) else None
        if not found or "error" in found:
            continue
        low, high = found["interval_95"]
        # A result outside its interval by up to a fiftieth is not counted.
        if low is not None and low > 1.02 * truth or high is not None and high < 0.98 * truth:
            return f"{path[0]} {found['value']:.4g} in {low:.4g} to {high:.4g}, true {truth:.4g}"
    return None


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, default="target/debug/tactile")
    options = parser.parse_args()
    program, slips, passed = options.program.absolute(), 0, 0

    def tried(what, folder, call):
        nonlocal slips, passed
        slips += 1
        if found := silent(answered(program, folder, call), usual):
            passed += 1
            print(f"{what}: {found}", flush=True)

    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name) / "data"
        shutil.copytree(EXAMPLES, folder)
        measure, stream = "measure press/scene.toml --points 40", "stream press/scene.toml --allowed-late 100"
        usual = {call.split()[0]: kinds(answered(program, folder, call)) for call in (measure, stream, FORCE, DEPTH)}
        scene = folder / "press" / "scene.toml"
        good = scene.read_text()
        for before, after in scene_slips():
            assert before in good, before
            scene.write_text(good.replace(before, after, 1))
            for command in (measure, stream):
                tried(f"{command.split()[0]}: {before!r} is {after!r}", folder, command)
        scene.write_text(good)
        for table, calls in {
            "press/calibration.csv": [FORCE, measure, stream],
            "depth_table.csv": [DEPTH],
        }.items():
            text = re.sub(r"^#.*\n", "", (folder / table).read_text(), flags=re.M)
            for what, changed in table_slips(text):
                (folder / table).write_text(changed)
                for call in calls:
                    tried(f"{call.split()[0]}: {table} with {what}", folder, call)
            (folder / table).write_text(text)
        for call, command in option_slips():
            tried(f"{command}: {call}", folder, call)
    print(f"{slips} slips, {passed} in silence")
    raise SystemExit(passed > 0)


if __name__ == "__main__":
    main()
