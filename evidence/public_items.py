#!/usr/bin/env python3
"""The public items of all crates, methods among them, from the pages `cargo doc --workspace --no-deps --all-features` has written.

    evidence/public_items.py                    fail where a recorded item is gone or a new one shows no example
    evidence/public_items.py --record           write both records; a removal needs a new minor version before 1.0, a major one after
    evidence/public_items.py --without-example  list what shows no example

A type, trait or function has an example when its page shows one; a method when an example on its type's page calls it.
`public_items.txt` holds the items, `without_example.txt` those that have always gone without: that list may only get shorter.

It sees names, not signatures; before a release run `cargo semver-checks` as well (see CONTRIBUTING.md).
"""
import html
import os
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
DOC = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "doc"
ITEMS, BARE = ROOT / "evidence" / "public_items.txt", ROOT / "evidence" / "without_example.txt"
CRATES = ["elasticity", "force", "imaging", "match", "optics", "sfs", "tps"]

# What follows the item's own methods on its page.
FOREIGN = re.compile(r'<h2 id="(?:trait|synthetic|blanket)-implementations"|<h2 id="(?:implementors|foreign-impls)"')
EXAMPLE = re.compile(r'<pre class="rust rust-example-rendered">(.*?)</pre>', re.S)
METHOD = re.compile(r'<section id="(?:ty)?method\.(\w+?)(?:-\d+)?" class="method')


def of_page(name, kind, page):
    """The item of a page and its methods, each with whether an example shows it."""
    own = FOREIGN.split(page.read_text(), maxsplit=1)[0]
    examples = "\n".join(html.unescape(re.sub(r"<[^>]+>", "", block)) for block in EXAMPLE.findall(own))
    yield f"{name} ({kind})", bool(examples)
    for method in METHOD.findall(own):
        yield f"{name}::{method} (method)", re.search(rf"\b{method}\b", examples) is not None


def items():
    """Maps every item to whether it has an example."""
    found = {}
    for crate in (f"tactile_{name}" for name in CRATES):
        index = DOC / crate / "all.html"
        if not index.exists():
            sys.exit(f"public_items: no {index.relative_to(ROOT)}; run `.ci/run docs` first")
        for link, path in re.findall(r'<li><a href="([^"]+)">([^<]+)</a></li>', index.read_text()):
            kind = pathlib.PurePosixPath(link).name.split(".")[0]
            found.update(of_page(f"{crate}::{path}", kind, index.parent / link))
    return found


def read(record):
    return set(record.read_text().split("\n")) - {""}


def write(record, names):
    record.write_text("".join(f"{name}\n" for name in sorted(names)))


def compare(found, bare):
    """Names what is gone and what came without an example; returns their number."""
    removed = sorted(read(ITEMS) - set(found))
    undocumented = sorted(bare - read(BARE))
    for name in removed:
        print(f"public_items: {name} is gone: a breaking change; record it and say so in the changelog")
    for name in undocumented:
        print(f"public_items: {name} shows no example")
    mended, new = len(read(BARE) - bare), len(set(found) - read(ITEMS))
    print(f"public_items: {len(found)} items, {len(removed)} gone, {new} new; {len(bare)} without example, {mended} fewer than recorded")
    return len(removed) + len(undocumented)


def main():
    found = items()
    bare = {name for name, shown in found.items() if not shown}
    if "--without-example" in sys.argv[1:]:
        print("\n".join(sorted(bare)))
        print(f"public_items: {len(bare)} of {len(found)} items show no example")
    elif "--record" in sys.argv[1:]:
        write(ITEMS, found)
        write(BARE, bare)
        print(f"public_items: recorded {len(found)}, {len(bare)} of them without example")
    else:
        return 1 if compare(found, bare) else 0
    return 0


if __name__ == "__main__":
    sys.exit(main())
