#!/usr/bin/env python3
"""Counts the instructions of four jobs under callgrind and compares them with evidence/counts.json.

    evidence/counts.py            compare; fails where a count grew by more than 5 %
    evidence/counts.py --record   measure and write the record

Counts depend on the compiler and on the SIMD level the program finds at run time. Valgrind shows programs a processor with
AVX2 and FMA at most, so every machine that has these runs the same code; on others, and with another compiler
than the record's, nothing is compared and one line says so. Needs valgrind; without it one line says so.
"""
import json
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
RECORD = ROOT / "evidence" / "counts.json"
JOBS = ["match_105", "frame_pass", "spline_fit_200", "pipeline"]
GROWTH = 0.05


def run(command):
    return subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout


def compiler():
    return run(["rustc", "--version"]).strip()


def simd_level():
    """The widest level that valgrind shows and this processor has."""
    try:
        flags = set(re.search(r"^flags\s*:(.*)$", pathlib.Path("/proc/cpuinfo").read_text(), re.M)[1].split())
    except (OSError, TypeError):
        return "unknown"
    return "avx2+fma" if {"avx2", "fma"} <= flags else "below avx2"


def binary():
    """Builds the bench as the step benches does, so that nothing is compiled twice, and returns its path."""
    command = ["cargo", "test", "--workspace", "--features", "tactile-benches/fem", "--bench", "instructions", "--no-run", "--message-format=json"]
    messages = (json.loads(line) for line in run(command).splitlines() if line.startswith("{"))
    built = [m["executable"] for m in messages if m.get("executable") and m["target"]["name"] == "instructions"]
    return built[-1]


def count(program, job, folder):
    output = pathlib.Path(folder) / job
    command = ["valgrind", "--tool=callgrind", "--toggle-collect=*counted*", f"--callgrind-out-file={output}", program, job]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"counts: {job} failed under valgrind:\n{done.stdout}{done.stderr}")
    found = re.search(r"^(?:totals|summary):\s*(\d+)", output.read_text(), re.M)
    if not found or int(found[1]) == 0:
        sys.exit(f"counts: {job}: callgrind saw no instruction of the job")
    return int(found[1])


def compare(counts, record):
    grown = False
    for job, now in counts.items():
        before = record["instructions"][job]
        change = now / before - 1
        verdict = "GREW" if change > GROWTH else "smaller: record it" if change < -GROWTH else ""
        grown |= change > GROWTH
        print(f"  {job:16} {now:15,} recorded {before:15,} {change:+8.2%} {verdict}")
    return grown


def main():
    recording = "--record" in sys.argv[1:]
    if not shutil.which("valgrind"):
        print("counts: skipped, valgrind is not installed")
        return 0
    record = json.loads(RECORD.read_text()) if RECORD.exists() else None
    here = {"compiler": compiler(), "simd": simd_level()}
    if not recording:
        if record is None:
            print(f"counts: skipped, nothing is recorded yet in {RECORD.relative_to(ROOT)}; write it with --record")
            return 0
        unlike = [k for k in here if here[k] != record[k]]
        if unlike:
            print("counts: skipped, " + ", ".join(f"{k} is {here[k]}, the record's {record[k]}" for k in unlike))
            return 0
    program = binary()
    with tempfile.TemporaryDirectory() as folder:
        counts = {job: count(program, job, folder) for job in JOBS}
    if recording:
        RECORD.write_text(json.dumps(here | {"instructions": counts}, indent=2) + "\n")
        print(f"recorded {counts}")
        return 0
    if compare(counts, record):
        print("counts: more than 5 % above the record. Mend it, or record the new counts in the same commit and say why.")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
