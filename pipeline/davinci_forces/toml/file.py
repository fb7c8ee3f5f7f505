"""What is wrong with a TOML file, and with the files that it names, each with its line."""

from collections.abc import Mapping

from davinci_forces.errors import PipelineError
from davinci_forces.toml.lines import KeyPath

MOST_PROBLEMS = 200  # of a file that are kept: who has mended so many reads it again
LONGEST = 2_000  # characters of one


class TomlFile:
    """A file, the lines of its keys, and its problems."""

    def __init__(self, name: str, lines: Mapping[KeyPath, int]) -> None:
        self.name, self.lines = name, lines
        self.noted: set[tuple[int, str]] = set()
        self.left_out = 0  # problems beyond the most that are kept
        self.named: list[TomlFile] = []  # whose problems are said together with its own

    def line(self, path: KeyPath) -> int:
        """The line of a key; of what would hold it, where it is missing."""
        while path and path not in self.lines:
            path = path[:-1]
        return self.lines.get(path, 1)

    def note(self, line: int, text: str) -> None:
        """Note something wrong with a line."""
        if self.is_full:
            self.left_out += 1
        else:
            self.noted.add((line, text if len(text) <= LONGEST else f"{text[:LONGEST]} ..."))

    @property
    def is_full(self) -> bool:
        """Whether no more problems are kept."""
        return len(self.noted) >= MOST_PROBLEMS

    def problems(self) -> list[str]:
        """Every problem, in the order of the file, with its file and line."""
        own = [f"{self.name}:{line}: {text}" for line, text in sorted(self.noted)]
        own += [f"{self.name}: {self.left_out} more problems; mend these first"] if self.left_out else []
        return own + [problem for file in self.named for problem in file.problems()]

    def refuse(self, kind: type[PipelineError]) -> None:
        """Raise every problem, one a line, as an error of that kind; nothing where there is none."""
        if problems := self.problems():
            raise kind("\n".join(problems))
