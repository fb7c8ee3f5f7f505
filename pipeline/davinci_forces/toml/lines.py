"""The line of every key of a TOML file, which tomllib does not provide, and the problems of the file."""

import re
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache

from davinci_forces.errors import PipelineError

KeyPath = tuple[str | int, ...]  # keys from the top of the file, and numbers in lists from 0

# An unclosed string ends with its line or the text, so that no scan reads it twice.
QUOTED = r""""(?:[^"\\\n]++|\\.)*+"?|'[^'\n]*+'?"""
LONG = r'''"""(?:[^"\\]++|\\.|"(?!""))*+"{0,5}|\'\'\'(?:[^']++|'(?!''))*+'{0,5}'''
DATE = r"\d{4}-\d\d-\d\d \d[^][{}=,#\s]*"  # with a space before the time
TOKEN = re.compile(rf"""({LONG}|{QUOTED}|{DATE}|[^][{{}}=,#\s"']+|[][{{}}=,])|#[^\n]*""", re.DOTALL)
PART = re.compile(rf"""({QUOTED})|[^."']+""", re.DOTALL)

# Limits of a file.  The largest study, ten thousand logs with all their channels, has 650 000 words and marks, two
# brackets around a key of two names, and no word of 1000 characters outside quotes.  tomllib takes a second for a text
# of four million escaped characters.
MAX_WORDS = 800_000
MAX_TABLES = 10_000
MAX_DEPTH = 16
MAX_WORD_LENGTH = 10_000
MAX_TEXT_LENGTH = 100_000
NOTHING = (0, "")  # after the last word or mark
COST_OF_NAME = 4  # words: what tomllib keeps of a name that a dot follows takes as much memory
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


def excess(text: str) -> str:
    """Find in one scan which limit for tomllib a text exceeds, and in which line; "" if no limit is exceeded.

    tomllib's time grows with the square of the number of names in a key; a name takes 500 bytes, a digit 100.
    """
    line, words, listed, deep, names, length, quoted = 1, 0, 0, 0, 0, 0, 0
    around, before, is_value = list[int](), "", False  # names and brackets that each open bracket stands in
    for line, word in _tokens(text):  # noqa: B007 - of the word that is too much
        words += 1
        if word in "[{":
            listed += word == before == "[" and around == [1]
            around.append(names + 1)
            deep, names = deep + names + 1, 0
        elif word in "]}":
            deep, names = deep - (around.pop() if around else 0), 0
        elif word == "," or is_value:
            names = 0
        elif word != "=":
            dots = word.count(".") if word[0] not in "\"'" else 0
            words, names = words + COST_OF_NAME * dots, names + 1 + dots
        length, quoted = (len(word), 0) if word[0] not in "\"'" else (0, len(word))
        before, is_value = word, word == "="
        if words > MAX_WORDS or listed > MAX_TABLES or deep + names > MAX_DEPTH:
            break
        if length > MAX_WORD_LENGTH or quoted > MAX_TEXT_LENGTH:
            break
    counts = (
        (words, MAX_WORDS, "names, values and marks"), (listed, MAX_TABLES, "[[tables]]"),
        (deep + names, MAX_DEPTH, "names and brackets inside each other"),
        (length, MAX_WORD_LENGTH, "characters in one name or number"),
        (quoted, MAX_TEXT_LENGTH, "characters in one text"),
    )  # fmt: skip
    return next((f"{line}: it has more than {most} {what}" for number, most, what in counts if number > most), "")


def lines_of(text: str) -> dict[KeyPath, int]:
    """The line, from 1, of every table, key and element of a list; `text` is valid for tomllib."""
    return _Scanner(text).lines


def _tokens(text: str) -> Iterator[tuple[int, str]]:
    """Words and marks, each with its line; no comments."""
    line, before = 1, 0
    for match in TOKEN.finditer(text):
        line, before = line + text.count("\n", before, match.start()), match.start()
        if match[1]:
            yield line, match[1]


@cache
def _unquoted(key: str) -> str:
    """A quoted key without its quotes; cached, because a file repeats a few keys often."""
    return key[1:-1] if "\\" not in key else str(tomllib.loads(f"key = {key}")["key"])


class _Scanner:
    def __init__(self, text: str) -> None:
        self.left = _tokens(text)
        self.next = next(self.left, NOTHING)
        self.lines: dict[KeyPath, int] = {(): 1}
        self.last: dict[KeyPath, int] = {}  # of [[lists]]: the number of the latest table
        table: KeyPath = ()
        while self.next is not NOTHING:
            if self.skip_mark("["):
                table = self.header()
            else:
                self.pair(table)

    def skip_mark(self, mark: str) -> bool:
        """Take a mark if it is the next token, and return whether it was."""
        return self.next[1] == mark and bool(self.take())

    def take(self) -> tuple[int, str]:
        """Take the next word or mark."""
        token, self.next = self.next, next(self.left, NOTHING)
        return token

    def header(self) -> KeyPath:
        """[table] or [[list]], from its second character on."""
        is_list = self.skip_mark("[")
        line, parts = self.key("]")
        path: KeyPath = ()
        for part in parts:
            path = (*self.latest(path), part)
            self.lines.setdefault(path, line)
        if is_list:
            self.skip_mark("]")
            self.last[path] = self.last.get(path, -1) + 1
            path = self.latest(path)
        self.lines[path] = line
        return path

    def latest(self, path: KeyPath) -> KeyPath:
        return (*path, self.last[path]) if path in self.last else path

    def pair(self, path: KeyPath) -> None:
        """key = value"""
        line, parts = self.key("=")
        for part in parts:
            path = (*path, part)
            self.lines.setdefault(path, line)
        self.value(path)

    def key(self, end: str) -> tuple[int, list[str]]:
        """The parts of a dotted key, and its line."""
        line, words = self.next[0], ""
        while not self.skip_mark(end):
            words += self.take()[1]
        return line, [_unquoted(part[0]) if part[1] else part[0] for part in PART.finditer(words)]

    def value(self, path: KeyPath) -> None:
        """One word, or a list or an inline table; each element of a list and each pair of a table has its own line."""
        _, word = self.take()
        end = {"[": "]", "{": "}"}.get(word)
        number = 0
        while end and not self.skip_mark(end):
            if word == "{":
                self.pair(path)
            else:
                self.lines[*path, number] = self.next[0]
                self.value((*path, number))
                number += 1
            self.skip_mark(",")
