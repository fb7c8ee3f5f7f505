"""The problems of a TOML file, and of the files that it names, each with its line."""

from collections.abc import Mapping

from davinci_forces.errors import PipelineError
from davinci_forces.toml.lines import KeyPath

MOST_PROBLEMS = 200  # problems of a file that are kept; after correcting these, the file is read again
MAX_PROBLEM_LENGTH = 2_000  # characters


class TomlFile:
    """A file, the lines of its keys, and its problems."""

    def __init__(self, name: str, lines: Mapping[KeyPath, int]) -> None:
        self.name, self.lines = name, lines
        self.noted: set[tuple[int, str]] = set()
        self.left_out = 0  # number of problems beyond `MOST_PROBLEMS`
        self.named: list[TomlFile] = []  # files whose problems are reported with those of this file

    def line(self, path: KeyPath) -> int:
        """The line of a key, or of the table that lacks the key."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)

    def note(self, line: int, text: str) -> None:
        """Note something wrong with a line."""
        if self.is_full:
            self.left_out += 1
        else:
            self.noted.add((line, text if len(text) <= MAX_PROBLEM_LENGTH else f"{text[:MAX_PROBLEM_LENGTH]} ..."))

    @property
    def is_full(self) -> bool:
        """Whether no more problems are kept."""
        return len(self.noted) >= MOST_PROBLEMS

    def problems(self) -> list[str]:
        """Every problem, in the order of the file, with its file and line."""
        texts = [f"{self.name}:{line}: {text}" for line, text in sorted(self.noted)]
        texts += [f"{self.name}: {self.left_out} more problems; correct these first"] if self.left_out else []
        return texts + [problem for file in self.named for problem in file.problems()]

    def refuse(self, kind: type[PipelineError]) -> None:
        """Raise every problem, one a line, as an error of that kind; do nothing if there are no problems."""
        if problems := self.problems():
            raise kind("\n".join(problems))
