"""The notebooks run and reproduce their stored output, and the Python code of the documentation runs unchanged."""

import os
import re

import nbformat
import numpy as np
import pytest
from conftest import DATA
from nbclient import NotebookClient

FOLDER = DATA.parent / "python"
ROOT = DATA.parents[1]


def printed(notebook):
    """The numbers in the output of each cell. A slow kernel sends the lines of a cell in several pieces."""

    def text(cell):
        outputs = cell.get("outputs", [])
        return "".join(output.get("text") or output.get("data", {}).get("text/plain", "") for output in outputs)

    return [[float(number) for number in re.findall(r"-?\d+\.?\d*(?:e[-+]?\d+)?", text(cell))] for cell in notebook.cells]


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_shows_what_it_holds(path):
    notebook = nbformat.read(path, as_version=4)
    stored = printed(notebook)
    kept = {"metadata": {"path": str(FOLDER)}}
    client = NotebookClient(notebook, timeout=300, kernel_name="python3", resources=kept, record_timing=False)
    client.execute()
    if "RECORD_ANSWERS" in os.environ:
        # Nothing about the machine is kept.
        notebook.metadata.pop("language_info", None)
        nbformat.write(notebook, path)
        return
    found = printed(notebook)
    # Two digits are compared, because readers do not notice smaller differences.
    assert [len(cell) for cell in found] == [len(cell) for cell in stored]
    assert np.allclose(sum(found, []), sum(stored, []), rtol=0.05, atol=1e-9)
    # Committed notebooks are small.
    assert path.stat().st_size < 100_000


PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
BLOCKS = {
    f"{page.stem} {number}": block
    for page in PAGES
    for number, block in enumerate(re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE))
}


@pytest.mark.parametrize("block", BLOCKS)
def test_a_block_of_the_documentation_runs_alone(block, monkeypatch):
    monkeypatch.chdir(ROOT)
    exec(BLOCKS[block], {})
