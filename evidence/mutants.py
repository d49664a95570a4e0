#!/usr/bin/env python3
"""Tests a random sample of the mutants of one crate, all of them in one build.

The mutants are those that cargo-mutants lists (`cargo install cargo-mutants`, settings in `.cargo/mutants.toml`). A build for each would
take a minute; here every mutant of the sample is put beside the original behind a switch that an environment variable turns on, the
tests are built once, and run once for every mutant. One that fails a test or hangs is caught.

    python3 -m venv v && v/bin/pip install tree-sitter tree-sitter-rust
    v/bin/python evidence/mutants.py tactile-tps --sample 100 --seed 1 --copy ../mutants

works on a copy of the repository in the folder given, and prints every mutant with what became of it and the totals.
"""
import argparse
import collections
import json
import os
import random
import re
import resource
import signal
import subprocess
import sys
import time

import tree_sitter
import tree_sitter_rust

SWITCH = """
/// Which mutant stands in for the original, by the environment variable `MUTANT`.
#[doc(hidden)]
#[allow(missing_docs, unreachable_pub, dead_code)]
pub mod mutant {
    extern crate std; // some crates have it for their tests alone
    static ON: std::sync::OnceLock<u32> = std::sync::OnceLock::new();
    #[inline(always)]
    pub fn on(id: u32) -> bool {
        *ON.get_or_init(|| std::env::var("MUTANT").ok().and_then(|v| v.parse().ok()).unwrap_or(0)) == id
    }
}
"""


def offset(lines, place):
    """Byte offset of a place (line and column from 1, in characters)."""
    before = sum(len(line) for line in lines[: place["line"] - 1])
    text = lines[place["line"] - 1].decode()
    return before + len(text[: place["column"] - 1].encode())


def edit_of(mutant, source, lines, tree):
    """Start, end and the text for the switch of a mutant, with MUTANT_ID for its number; None where it cannot be switched."""
    start, end = (offset(lines, mutant["span"][side]) for side in ("start", "end"))
    new, genre = mutant["replacement"].encode(), mutant["genre"]
    node = tree.root_node.descendant_for_byte_range(start, max(start, end - 1))
    if genre == "FnValue":
        while node and node.type not in ("function_item",):
            node = node.parent
        body = node and node.child_by_field_name("body")
        if not body:
            return None
        at = body.start_byte + 1
        return at, at, b" if crate::mutant::on(MUTANT_ID) { return " + new + b"; } "
    if genre == "MatchArmGuard":
        guard = source[start:end]
        return start, end, b"(if crate::mutant::on(MUTANT_ID) { " + new + b" } else { " + guard + b" })"
    if genre == "BinaryOperator":
        while node and node.type not in ("binary_expression", "compound_assignment_expr"):
            node = node.parent
    elif genre == "UnaryOperator":
        while node and node.type != "unary_expression":
            node = node.parent
    else:
        return None
    # The mutant changes the operator alone, and with it perhaps what binds to what: the whole chain is switched.
    while node and node.parent and node.parent.type in ("binary_expression", "unary_expression"):
        node = node.parent
    if not node or b"let " in source[node.start_byte : node.end_byte] or node.parent.type == "let_chain":
        return None
    first, last = node.start_byte, node.end_byte
    changed = source[first:start] + new + source[end:last]
    switched = b"if crate::mutant::on(MUTANT_ID) { " + changed + b" } else { " + source[first:last] + b" }"
    return first, last, switched if node.type == "compound_assignment_expr" else b"(" + switched + b")"


def instrument(root, crate, mutants):
    """Writes all switches; returns the mutants that have one."""
    parser = tree_sitter.Parser(tree_sitter.Language(tree_sitter_rust.language()))
    files = collections.defaultdict(list)
    for mutant in mutants:
        files[mutant["file"]].append(mutant)
    switched = []
    for name, group in files.items():
        path = os.path.join(root, name)
        source = open(path, "rb").read()
        lines, tree = source.splitlines(keepends=True), parser.parse(source)
        edits = []
        for mutant in group:
            edit = edit_of(mutant, source, lines, tree)
            if edit and all(edit[1] <= other[0] or edit[0] >= other[1] for other, _ in edits):
                edits.append((edit, mutant))
                switched.append(mutant)
        for (start, end, text), mutant in sorted(edits, key=lambda e: e[0][:2], reverse=True):
            text = text.replace(b"MUTANT_ID", str(mutant["id"]).encode())
            source = source[:start] + text + source[end:]
        open(path, "wb").write(source)
    library = os.path.join(root, crate, "src/lib.rs")
    text = open(library).read()
    open(library, "w").write(text + SWITCH)
    return switched


def restore(root, crate):
    subprocess.run(["git", "checkout", "-q", crate], cwd=root, check=True)


def cargo(root, *arguments):
    """A cargo command's messages."""
    run = subprocess.run(["cargo", *arguments, "--message-format=json"], cwd=root, capture_output=True, text=True)
    messages = [json.loads(line) for line in run.stdout.splitlines() if line.startswith("{")]
    return run.returncode, messages, run.stderr


def refused(messages, root):
    """The numbers of the mutants in whose text the compiler found an error."""
    found = set()
    for message in messages:
        message = message.get("message") or {}
        if not isinstance(message, dict) or message.get("level") != "error":
            continue
        for span in message.get("spans", []):
            if not span["is_primary"]:
                continue
            source = open(os.path.join(root, span["file_name"]), "rb").read()
            # The last switch before the error, and those on its line.
            before = re.findall(rb"mutant::on\((\d+)\)", source[: span["byte_end"]])
            found.update(int(n) for n in before[-1:])
    return found


def switch_all(root, crate, sample):
    """Puts the switches of all mutants that compile into the copy."""
    switched, unviable = instrument(root, crate, sample), set()
    while True:
        status, messages, errors = cargo(root, "check", "-p", crate, "--lib", "--tests")
        if status == 0:
            return
        bad = refused(messages, root) - unviable
        if not bad:
            sys.exit(f"cannot build:\n{errors}")
        unviable |= bad
        restore(root, crate)
        instrument(root, crate, [m for m in switched if m["id"] not in unviable])


def draw(everything, count, seed):
    """So many of the mutants, numbered from 1."""
    random.Random(seed).shuffle(everything)
    print(f"{len(everything)} mutants in all", flush=True)
    return [{**mutant, "id": number} for number, mutant in enumerate(everything[:count], 1)]


def present(root, crate):
    """The numbers of the mutants that have a switch in the copy."""
    found = set()
    for folder, _, files in os.walk(os.path.join(root, crate, "src")):
        for name in files:
            source = open(os.path.join(folder, name), "rb").read()
            found.update(int(n) for n in re.findall(rb"mutant::on\((\d+)\)", source))
    return found


def main():
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("crate")
    arguments.add_argument("--sample", type=int, default=100)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--copy", required=True, help="folder for the copy of the repository")
    arguments.add_argument("--files", default="", help="regular expression that a mutant's file must match")
    arguments.add_argument("--limit", type=float, default=60, help="seconds of processor time that the tests may take")
    arguments.add_argument("--slow", nargs="*", default=[], help="tests that are run only where all others pass")
    arguments.add_argument("--built", action="store_true", help="go on with a copy that holds the switches of this sample")
    given = arguments.parse_args()
    root = os.path.abspath(given.copy)
    if not os.path.exists(root):
        here = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..")
        subprocess.run(["git", "clone", "-q", here, root], check=True)
    kept = os.path.join(root, f".mutants-{given.crate}.json")
    if given.built:
        sample = json.load(open(kept))
    else:
        restore(root, given.crate)
        listed = subprocess.run(["cargo", "mutants", "-p", given.crate, "--list", "--json"], cwd=root, capture_output=True, text=True, check=True)
        sample = draw([m for m in json.loads(listed.stdout) if re.search(given.files, m["file"])], given.sample, given.seed)
        json.dump(sample, open(kept, "w"))
        switch_all(root, given.crate, sample)
    there = present(root, given.crate)
    switched = [m for m in sample if m["id"] in there]
    status, messages, errors = cargo(root, "test", "-p", given.crate, "--lib", "--tests", "--no-run")
    programs = [m["executable"] for m in messages if m.get("reason") == "compiler-artifact" and m.get("executable")]
    counts = collections.Counter()
    folder = os.path.join(root, given.crate)

    def run(number):
        """`missed`, `caught` or `hung`."""
        quick = [option for test in given.slow for option in ("--skip", test)]
        for program, some in [(p, quick) for p in programs] + [(p, given.slow) for p in programs if given.slow]:
            try:
                tests = subprocess.run([program, "-q", *some], cwd=folder, env={**os.environ, "MUTANT": str(number), "PROPTEST_MAX_SHRINK_ITERS": "0", "CARGO_MANIFEST_DIR": folder},
                                       stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, timeout=20 * given.limit,
                                       preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (int(given.limit), int(given.limit))))
            except subprocess.TimeoutExpired:
                return "hung"
            if tests.returncode in (-signal.SIGXCPU, -signal.SIGKILL):
                return "hung"
            if tests.returncode != 0:
                return "caught"
        return "missed"

    begin = time.time()
    if run(0) != "missed":
        sys.exit("the tests fail without a mutant")
    print(f"{len(sample)} drawn; tests take {time.time() - begin:.1f} s", flush=True)
    for mutant in switched:
        outcome = run(mutant["id"])
        counts[outcome] += 1
        print(f"{outcome:7} {mutant['name']}", flush=True)
    tried = sum(counts[k] for k in ("caught", "hung", "missed"))
    print(f"{given.crate}: {tried} tried, {counts['caught']} caught, {counts['hung']} hung, {counts['missed']} missed; "
          f"{len(sample) - len(switched)} do not compile, cannot be switched or overlap another")
    restore(root, given.crate)


if __name__ == "__main__":
    main()
