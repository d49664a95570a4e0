#!/usr/bin/env python3
"""The public items of all crates, from the pages `cargo doc --workspace --no-deps --all-features` has written.

    evidence/public_items.py                    compare with evidence/public_items.txt: removed items fail, new ones are named
    evidence/public_items.py --record           write the record; a removal needs a new minor version before 1.0, a major one after
    evidence/public_items.py --without-example  list the items whose page shows no example

It sees items, not signatures; before a release run `cargo semver-checks` as well (`cargo install cargo-semver-checks`).
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
DOC = ROOT / "target" / "doc"
RECORD = ROOT / "evidence" / "public_items.txt"
CRATES = ["elasticity", "force", "imaging", "match", "optics", "sfs", "tps"]


def items():
    """Maps `crate::path (kind)` to the page."""
    found = {}
    for crate in (f"tactile_{name}" for name in CRATES):
        page = DOC / crate / "all.html"
        if not page.exists():
            sys.exit(f"public_items: no {page.relative_to(ROOT)}; run `.ci/run docs` first")
        for link, path in re.findall(r'<li><a href="([^"]+)">([^<]+)</a></li>', page.read_text()):
            kind = pathlib.PurePosixPath(link).name.split(".")[0]
            found[f"{crate}::{path} ({kind})"] = page.parent / link
    return found


def main():
    found = items()
    if "--without-example" in sys.argv[1:]:
        bare = [name for name, page in found.items() if "rust-example-rendered" not in page.read_text()]
        print("\n".join(sorted(bare)))
        print(f"public_items: {len(bare)} of {len(found)} items show no example")
        return 0
    if "--record" in sys.argv[1:]:
        RECORD.write_text("\n".join(sorted(found)) + "\n")
        print(f"public_items: recorded {len(found)}")
        return 0
    recorded = set(RECORD.read_text().split("\n")) - {""}
    removed, new = sorted(recorded - set(found)), sorted(set(found) - recorded)
    for name in removed:
        print(f"public_items: {name} is gone: a breaking change; record it and say so in the changelog")
    print(f"public_items: {len(found)} items, {len(removed)} removed, {len(new)} new since the record")
    return 1 if removed else 0


if __name__ == "__main__":
    sys.exit(main())
