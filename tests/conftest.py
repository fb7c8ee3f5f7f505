"""What every test may ask for."""

import os
from pathlib import Path

import matplotlib as mpl
import pytest
from hypothesis import settings

mpl.use("Agg")
settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="run long studies, too")
    parser.addoption("--full", action="store_true", help="run benchmarks at their full size")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if not config.getoption("--slow"):
        for item in items:
            if "slow" in item.keywords:
                item.add_marker(pytest.mark.skip(reason="a long study; run with --slow"))


ROOT = Path(__file__).parent.parent
BESIDE = ROOT.parent / "shared" / "data"


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real recordings, which are not ours to ship; tests on them skip where it is absent."""
    folder = Path(os.environ.get("DAVINCI_FORCES_DATA", BESIDE))
    if not folder.is_dir():
        pytest.skip(f"real recordings are not at {folder}; set DAVINCI_FORCES_DATA to their folder")
    return folder
