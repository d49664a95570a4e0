"""The notebooks and the Python of the documentation run from the first line to the last."""

import re

import nbformat
import numpy as np
import pytest
from conftest import DATA
from nbclient import NotebookClient

FOLDER = DATA.parent / "python"


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.ipynb")), ids=lambda path: path.stem)
def test_a_notebook_runs(path):
    notebook = nbformat.read(path, as_version=4)
    kept = {"metadata": {"path": str(FOLDER)}}
    NotebookClient(notebook, timeout=300, kernel_name="python3", resources=kept).execute()
    # What is committed is small.
    assert path.stat().st_size < 100_000


@pytest.mark.parametrize("name", ["README.md", "docs/python.md", "docs/own_stage.md", "docs/match_warp_strain.md"])
def test_the_python_of_a_page_runs(name):
    text = (DATA.parents[1] / name).read_text(encoding="utf-8")
    code = re.findall(r"^```python\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    # The blocks of a page follow one another.
    names = {"np": np}
    for block in code:
        exec(block, names)
    assert code and "ti" in names
