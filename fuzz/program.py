"""Mutates the files and the arguments of every subcommand of the program and runs it on them.

    python3 fuzz/program.py --program target/debug/tactile --seconds 3600 --seed 1

Requirements for every call: it ends within ten seconds of processor time with a valid exit code and without a panic. It stays
within its memory limit and reports a fault in one sentence. With --json it prints nothing or one object (a stream prints one per
line), in which no measured number lacks its value. A call that violates a rule is kept with its files in --found.
"""

import argparse
import json
import pathlib
import random
import resource
import shutil
import signal
import subprocess
import tempfile
import time

EXAMPLES = pathlib.Path(__file__).parent.parent / "examples" / "data"
CODES = {0, 1, 2, 3}
ADDRESS_SPACE = 6 << 30

CALLS = [
    "measure press/scene.toml --points 40",
    "force --reference press/reference.png --pairs press/calibration.csv --pixel-um 40 press/frame_1.png",
    "calibrate sensor/calibration.toml",
    "calibrate press/calibration.csv --there-and-back",
    "match cases.txt",
    "warp sources.csv targets.csv queries.csv",
    "strain before.csv after.csv",
    "integrate slope_x.csv slope_y.csv --pixel-size 5e-5",
    "depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 dark_frame.pgm --ball-radius-mm 4",
    "stream press/scene.toml --allowed-late 100 --rate 20",
    "light --rays 100",
]
FIELDS = ["", "0", "-1", "nan", "inf", "1e308", "-1e-320", "1e999", "9" * 20, "x", '"', "[[1]]", "1e-6", "1000", "0.5"]


def piece(data: bytes, at: int, separators: bytes) -> slice:
    """The line or field around a position, without its end."""
    start, end = at, at
    while start > 0 and data[start - 1] not in separators:
        start -= 1
    while end < len(data) and data[end] not in separators:
        end += 1
    return slice(start, end)


def mutated(data: bytes, draw: random.Random) -> bytes:
    """A few edits, so that most of the file stays valid."""
    out = bytearray(data)
    for _ in range(draw.randint(1, 4)):
        if not out:
            break
        at = draw.randrange(len(out))
        kind = draw.randrange(9)
        if kind == 0:
            out[at] = draw.randrange(256)
        elif kind == 1:
            out[at] ^= 1 << draw.randrange(8)
        elif kind == 2:
            del out[at:]
        elif kind == 3:
            del out[piece(out, at, b"\n")]
        elif kind == 4:
            line = bytes(out[piece(out, at, b"\n")])
            out[at:at] = line + b"\n"
        else:
            out[piece(out, at, b",;= []\n")] = draw.choice(FIELDS).encode()
    return bytes(out)


def mutated_call(call: str, draw: random.Random) -> list[str]:
    words = call.split()
    for _ in range(draw.randint(0, 2)):
        at = draw.randrange(1, len(words))
        kind = draw.randrange(4)
        if kind == 0:
            words[at] = draw.choice(FIELDS)
        elif kind == 1:
            words.insert(at, words[at])
        elif kind == 2 and len(words) > 2:
            del words[at]
        else:
            other = draw.choice(CALLS).split()
            words[at] = draw.choice(other[1:])
    return words


def complaint(folder: pathlib.Path, program: pathlib.Path, words: list[str], longest_s: int) -> str | None:
    """A description of the fault in how a call ended, or nothing if there is none."""

    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE, ADDRESS_SPACE))
        # Processor time, because the machine may be busy.
        resource.setrlimit(resource.RLIMIT_CPU, (longest_s, longest_s))

    command = [program, *words, "--json", "--out", "results"]
    try:
        ended = subprocess.run(command, cwd=folder, capture_output=True, timeout=60 * longest_s, preexec_fn=limit, stdin=subprocess.DEVNULL)
    except subprocess.TimeoutExpired:
        return f"takes longer than {60 * longest_s} s by the clock"
    if ended.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
        return f"takes longer than {longest_s} s of the processor's time"
    errors = ended.stderr.decode(errors="replace")
    if "panicked" in errors or ended.returncode not in CODES:
        return f"ended with {ended.returncode}: {errors[:300]}"
    # A stream prints a sentence for every unusable frame.
    sentences = [line for line in errors.splitlines() if line.startswith("tactile: ")]
    if ended.returncode == 2 and "Usage" not in errors and not 1 <= len(sentences) <= len(words):
        return f"does not say what is wrong in a sentence: {errors[:300]}"
    if not ended.stdout:
        return None
    try:
        # A stream prints a line of JSON for every frame before its result.
        answer = [json.loads(line) for line in ended.stdout.splitlines()] if words[0] == "stream" else json.loads(ended.stdout)
    except ValueError as error:
        return f"prints no JSON: {error}"
    return silent(answer, "") if ended.returncode == 0 else None


def silent(value: object, at: str) -> str | None:
    """A measured number without a value and without an error in its place."""
    if isinstance(value, dict):
        if "interval_95" in value and value.get("value") is None:
            return f"{at} has no value"
        inner = value.items()
    elif isinstance(value, list):
        inner = enumerate(value)
    else:
        return None
    found = (silent(child, f"{at}/{key}") for key, child in inner)
    return next((reason for reason in found if reason), None)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, default="target/debug/tactile")
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--longest", type=int, default=10, help="seconds of the processor's time for a call")
    parser.add_argument("--found", type=pathlib.Path, default="fuzz/found/program")
    options = parser.parse_args()
    draw, end = random.Random(options.seed), time.monotonic() + options.seconds
    calls = complaints = 0
    while time.monotonic() < end:
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name) / "data"
            shutil.copytree(EXAMPLES, folder)
            words = mutated_call(draw.choice(CALLS), draw)
            named = [folder / word for word in words if (folder / word).is_file()]
            # A file named in a scene is as likely to be faulty as the scene.
            beside = [path for file in named if file.suffix == ".toml" for path in file.parent.iterdir() if path.is_file()]
            for path in draw.sample(named + beside, k=min(len(named + beside), draw.randint(0, 2))):
                path.write_bytes(mutated(path.read_bytes(), draw))
            calls += 1
            reason = complaint(folder, options.program.absolute(), words, options.longest)
            if reason:
                complaints += 1
                kept = options.found / f"{options.seed}_{calls}"
                shutil.rmtree(folder / "results", ignore_errors=True)
                shutil.copytree(folder, kept, dirs_exist_ok=True)
                print(f"tactile {' '.join(words)}\n    {reason}\n    kept in {kept}", flush=True)
    print(f"{calls} calls, {complaints} complaints")
    raise SystemExit(complaints > 0)


if __name__ == "__main__":
    main()
