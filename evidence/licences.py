#!/usr/bin/env python3
"""Checks that the licence of every package the workspace can depend on is one that MIT OR Apache-2.0 code may be shipped with.

Reads `cargo metadata`; an SPDX expression passes if its AND/OR/WITH structure can be met from ALLOWED.
"""
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
ALLOWED = {
    "MIT", "MIT-0", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-2-Clause", "BSD-3-Clause", "ISC", "Zlib", "0BSD", "BSL-1.0",
    "CC0-1.0", "Unlicense", "Unicode-3.0", "Unicode-DFS-2016",
}


def tokens(expression):
    # The old form "MIT/Apache-2.0" means OR.
    text = re.sub(r"\s+WITH\s+", "~", expression.replace("/", " OR "))
    return [t.replace("~", " WITH ") for t in re.findall(r"[()]|[^\s()]+", text)]


def allowed(expression):
    """Evaluates an SPDX expression: AND binds tighter than OR."""
    rest = tokens(expression)

    def atom():
        token = rest.pop(0)
        if token != "(":
            return token in ALLOWED
        value = either()
        rest.pop(0)
        return value

    def both():
        value = atom()
        while rest and rest[0] == "AND":
            rest.pop(0)
            value = atom() and value
        return value

    def either():
        value = both()
        while rest and rest[0] == "OR":
            rest.pop(0)
            value = both() or value
        return value

    return either() and not rest


def main():
    command = ["cargo", "metadata", "--format-version", "1", "--all-features", "--locked"]
    packages = json.loads(subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True).stdout)["packages"]
    refused = [(p["name"], p["version"], p["license"]) for p in packages if not p["license"] or not allowed(p["license"])]
    for name, version, licence in refused:
        print(f"licences: {name} {version}: {licence or 'none stated'} is not on the list in evidence/licences.py")
    print(f"licences: {len(packages)} packages, {len(refused)} refused")
    return 1 if refused else 0


if __name__ == "__main__":
    sys.exit(main())
