"""Interrupts every subcommand that writes files at random instants: results must be complete, without other files beside them.

    python3 fuzz/ends.py --program target/debug/tactile --instants 100 --small-disk /mnt/small

A folder contains the results of an earlier call. The call is repeated with another option and interrupted: by SIGKILL, SIGTERM or SIGHUP after a random time, by SIGXFSZ 
or a failed write at a random file size limit, or by a full disk if --small-disk names a folder on a file system of about a megabyte
(`mount -t tmpfs -o size=1m none /mnt/small`). Every file must then equal, byte for byte, that of the earlier call or of the
complete later one, and no other file may exist.
"""

import argparse
import pathlib
import random
import re
import resource
import shutil
import signal
import subprocess
import tempfile
import time

EXAMPLES = pathlib.Path(__file__).parent.parent / "examples" / "data"
SENSOR = "--pixel-um 40 press/frame_1.png press/frame_2.png"
# A call, and the word that the earlier call had in place of one of its words.
CALLS = [
    ("measure press/scene.toml --points 60", "60", "50"),
    (f"force --reference press/reference.png --pairs press/calibration.csv {SENSOR}", "-um 40", "-um 41"),
    ("calibrate press/calibration.csv", "csv", "csv --there-and-back"),
    ("calibrate sensor/calibration.toml", "", ""),
    ("match cases.txt", "cases.txt", "cases.txt --method nearest"),
    ("warp sources.csv targets.csv queries.csv", "queries", "sources"),
    ("strain before.csv after.csv", "before.csv after.csv", "after.csv before.csv"),
    ("integrate slope_x.csv slope_y.csv --pixel-size 5e-5", "5e-5", "6e-5"),
    ("depth --reference dark_reference.pgm --table depth_table.csv --pixel-um 100 dark_frame.pgm", "100", "90"),
    ("stream press/scene.toml --allowed-late 100", "", ""),
    ("light --rays 20", "20", "10"),
    ("markers --reference markers_reference.png markers_frame.png", "", ""),
    ("table press/scene.toml --moduli 2 --largest-ratio 0.3", "0.3", "0.2"),
]
TIMES = re.compile(rb"(?m)^(case \S+) [\d.e-]+$")
ENDS = ["SIGKILL", "SIGTERM", "SIGHUP", "SIGXFSZ", "failed write", "full disk"]


def contents(folder: pathlib.Path) -> dict[str, bytes]:
    """The files of a folder. The table of matches contains times, which are removed."""
    files = {str(f.relative_to(folder)): f.read_bytes() for f in folder.rglob("*") if f.is_file()}
    return {name: TIMES.sub(rb"\1", data) if name == "cases.txt" else data for name, data in files.items()}


def copied(earlier: dict[str, bytes], folder: pathlib.Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    for name, data in earlier.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(data)


def run(program: pathlib.Path, call: str, data: pathlib.Path, out: pathlib.Path, ending=None, after_s=None, limit=None) -> float:
    """Runs a call, interrupts it, and returns its duration."""
    target = out / "sensor.toml" if call.startswith("calibrate sensor") else out
    started = time.monotonic()
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "stdin": subprocess.DEVNULL}
    child = subprocess.Popen([program, *call.split(), "--out", target], cwd=data, preexec_fn=limit, **quiet)
    if after_s is not None:
        time.sleep(after_s)
        child.send_signal(ending)
    child.wait(timeout=600)
    return time.monotonic() - started


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, default="target/debug/tactile")
    parser.add_argument("--instants", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--small-disk", type=pathlib.Path)
    options = parser.parse_args()
    program, draw = options.program.absolute(), random.Random(options.seed)
    ends = [end for end in ENDS if end != "full disk" or options.small_disk]
    complaints = 0
    with tempfile.TemporaryDirectory() as name:
        base = pathlib.Path(name)
        data = base / "data"
        shutil.copytree(EXAMPLES, data)
        for call, word, before in CALLS:
            run(program, call.replace(word, before, 1), data, base / "earlier")
            took = run(program, call, data, base / "later")
            earlier, later = contents(base / "earlier"), contents(base / "later")
            assert later, f"{call} writes nothing"
            wrong, kept, replaced = 0, 0, 0
            for _ in range(options.instants):
                end = draw.choice(ends)
                small = options.small_disk / "out" if end == "full disk" else base / "out"
                copied(earlier, small)
                after_s, limit, filler = None, None, None
                size = draw.randrange(max(map(len, later.values())))
                if end == "full disk":
                    filler = options.small_disk / "filler"
                    filler.write_bytes(bytes(max(0, shutil.disk_usage(options.small_disk).free - size)))
                elif end in ("SIGXFSZ", "failed write"):
                    action = signal.SIG_DFL if end == "SIGXFSZ" else signal.SIG_IGN

                    def limit(size=size, action=action):
                        signal.signal(signal.SIGXFSZ, action)
                        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

                else:
                    after_s = draw.uniform(0, 1.05 * took)
                run(program, call, data, small, getattr(signal, end, None), after_s, limit)
                found = contents(small)
                whole = all(found.get(f) in (earlier[f], later.get(f)) for f in earlier)
                whole = whole and all(found[f] == later.get(f) for f in found if f not in earlier)
                wrong, kept, replaced = wrong + (not whole), kept + (found == earlier), replaced + (found == later)
                if not whole:
                    odd = [f for f in found if found[f] not in (earlier.get(f), later.get(f))]
                    print(f"    {end}: {odd} or lost {set(earlier) - set(found)}", flush=True)
                if filler:
                    filler.unlink()
                shutil.rmtree(small, ignore_errors=True)
            complaints += wrong
            shutil.rmtree(base / "earlier"), shutil.rmtree(base / "later")
            print(f"{call}: {options.instants} ends, {kept} kept all, {replaced} replaced all, {wrong} wrong", flush=True)
    print(f"{complaints} complaints")
    raise SystemExit(complaints > 0)


if __name__ == "__main__":
    main()
