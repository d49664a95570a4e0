#!/usr/bin/env python3
"""Runs every `tactile` line in the console blocks of the guide, and compares the output with that quoted in the guide.

    python3 evidence/guide_commands.py PROGRAM

A block of text after a console block quotes the output of the last command. Each of its lines except `…` must occur in the output.
"""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", re.S | re.M)


def main():
    program, wrong, answers = pathlib.Path(sys.argv[1]).resolve(), [], {}
    for page in sorted(ROOT.glob("docs/*.md")):
        quoted_from = None
        for kind, block in BLOCK.findall(page.read_text()):
            if kind == "text" and quoted_from:
                lines = {" ".join(line.split()) for line in answers[quoted_from].splitlines()}
                quoted = [" ".join(line.split()) for line in block.splitlines() if line.strip() not in ("", "…")]
                wrong += [f"{page.name}: `tactile {quoted_from}` does not print: {line}" for line in quoted if line not in lines]
            commands = [line.removeprefix("tactile ") for line in block.splitlines() if kind == "console" and line.startswith("tactile ")]
            for command in commands:
                if command not in answers:
                    done = subprocess.run([program, *command.split()], cwd=ROOT, capture_output=True, text=True, stdin=subprocess.DEVNULL)
                    answers[command] = done.stdout
                    if done.returncode:
                        wrong.append(f"{page.name}: `tactile {command}` failed: {done.stderr.strip()}")
            quoted_from = commands[-1] if commands else None
    print(f"{len(answers)} commands of the guide ran")
    if wrong:
        sys.exit("\n".join(wrong))


if __name__ == "__main__":
    main()
