"""What benchmarks of logs may ask for."""

import pytest

from tests.benchmarks.reading import Report


@pytest.fixture(scope="module")
def full(request: pytest.FixtureRequest) -> bool:
    """Whether the promised sizes are asked for; else it is a tenth of them, at half the ratio."""
    return bool(request.config.getoption("--full"))


@pytest.fixture
def report(capsys: pytest.CaptureFixture[str]) -> Report:
    """Prints past the capture, so that the numbers are seen."""

    def say(line: str) -> None:
        with capsys.disabled():
            print(f"\n{line}", end="")

    return say
