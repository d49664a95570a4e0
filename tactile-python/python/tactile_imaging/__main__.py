"""The program `tactile`."""

import sys

from ._native import run_program


def main() -> None:
    """Runs the program on the arguments of this process."""
    sys.exit(run_program(["tactile", *sys.argv[1:]]))


if __name__ == "__main__":
    main()
