"""The guide's notebooks run from their first cell to their last, and are small."""

import os
import re
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from tests.conftest import QUICK_DESIGN, ROOT
from tests.guide.make_logs import demonstration

NOTEBOOKS = sorted((ROOT / "pipeline" / "davinci_forces" / "guide").glob("*.ipynb"))
LARGEST = 300_000  # [bytes]
QUICK = f"""\
from importlib import import_module
for name, value in {QUICK_DESIGN}.items():
    module, _, constant = name.rpartition(".")
    assert hasattr(import_module(module), constant), name
    setattr(import_module(module), constant, value)
"""


def start_quickly(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Kernels begin with a coarser design, of which no notebook shows a number, and with no name of their own."""
    start = folder / "start.py"
    start.write_text(f"exec({QUICK!r}, {{}})\n")
    monkeypatch.setenv("PYTHONSTARTUP", str(start))


def shown(notebook: nbformat.NotebookNode) -> list[str]:
    """What the cells return as words; of numbers and pictures only that they are there."""
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    texts = [
        "a picture" if "image/png" in o.get("data", {}) else o.get("text") or o.data["text/plain"] for o in outputs
    ]
    return [" ".join(re.sub(r"-?\d+\.\d+", "number", text).split()) for text in texts]


@pytest.mark.medium
@pytest.mark.filterwarnings("ignore")  # of the kernel's own packages
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_shows_what_it_shows_again(notebook, tmp_path, monkeypatch):
    demonstration(tmp_path)
    start_quickly(tmp_path, monkeypatch)
    monkeypatch.setenv("PYTHONPATH", str(ROOT / "pipeline"))
    monkeypatch.delenv("MPLBACKEND", raising=False)  # the kernel's, which puts pictures into cells
    monkeypatch.setenv("PATH", os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]]))
    assert notebook.stat().st_size < LARGEST
    stored = nbformat.read(notebook, as_version=4)
    again = nbformat.from_dict(stored)
    before = shown(stored)
    client = NotebookClient(again, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}})
    client.execute()
    assert before.count("a picture") == 1
    assert shown(again) == before
