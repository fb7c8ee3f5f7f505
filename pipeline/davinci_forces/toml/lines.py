"""The line of every key of a TOML file, which tomllib does not tell."""

import re
import tomllib
from collections.abc import Iterator
from functools import cache

KeyPath = tuple[str | int, ...]  # keys from the top of the file, and numbers in lists from 0

QUOTED = r""""(?:[^"\\]|\\.)*"|'[^']*'"""
LONG = r'''"""(?:[^\\]|\\.)*?"{3,5}|\'\'\'.*?'{3,5}'''
DATE = r"\d{4}-\d\d-\d\d \d[^][{}=,#\s]*"  # with a space before the time
TOKEN = re.compile(rf"""({LONG}|{QUOTED}|{DATE}|[^][{{}}=,#\s"']+|[][{{}}=,])|#[^\n]*""", re.DOTALL)
PART = re.compile(rf"""({QUOTED})|[^."']+""", re.DOTALL)


def lines_of(text: str) -> dict[KeyPath, int]:
    """The line, from 1, of every table, key and element of a list; `text` is one that tomllib takes."""
    return _Scanner(text).scan()


def _tokens(text: str) -> Iterator[tuple[int, str]]:
    """Words and marks, each with its line; no comments."""
    line, before = 1, 0
    for match in TOKEN.finditer(text):
        line, before = line + text.count("\n", before, match.start()), match.start()
        if match[1]:
            yield line, match[1]


@cache
def _unquoted(key: str) -> str:
    """A quoted key, of which there are few, however often they are used."""
    return str(tomllib.loads(f"key = {key}")["key"])


class _Scanner:
    def __init__(self, text: str) -> None:
        self.left = list(_tokens(text))[::-1]
        self.lines: dict[KeyPath, int] = {(): 1}
        self.last: dict[KeyPath, int] = {}  # of [[lists]]: the number of the latest table

    def scan(self) -> dict[KeyPath, int]:
        table: KeyPath = ()
        while self.left:
            if self.skipped("["):
                table = self.header()
            else:
                self.pair(table)
        return self.lines

    def skipped(self, mark: str) -> bool:
        """Whether a mark is next, which is then taken."""
        return self.left[-1][1] == mark and bool(self.left.pop()) if self.left else False

    def header(self) -> KeyPath:
        """[table] or [[list]], from its second character on."""
        is_list = self.skipped("[")
        line, parts = self.key("]")
        path: KeyPath = ()
        for part in parts:
            path = (*self.inside(path), part)
            self.lines.setdefault(path, line)
        if is_list:
            self.skipped("]")
            self.last[path] = self.last.get(path, -1) + 1
            path = self.inside(path)
        self.lines[path] = line
        return path

    def inside(self, path: KeyPath) -> KeyPath:
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
        line, words = self.left[-1][0], ""
        while not self.skipped(end):
            words += self.left.pop()[1]
        return line, [_unquoted(part[0]) if part[1] else part[0] for part in PART.finditer(words)]

    def value(self, path: KeyPath) -> None:
        """One word; or a list, whose elements have lines of their own, or an inline table, whose pairs do."""
        _, word = self.left.pop()
        end = {"[": "]", "{": "}"}.get(word)
        number = 0
        while end and not self.skipped(end):
            if word == "{":
                self.pair(path)
            else:
                self.lines[*path, number] = self.left[-1][0]
                self.value((*path, number))
                number += 1
            self.skipped(",")
