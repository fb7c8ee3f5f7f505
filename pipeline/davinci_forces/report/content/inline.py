"""Inline marks: `$maths$`, backticks for code, `**bold**`, `[@label]` and `[words](file)`; a backslash takes a mark's
meaning away.
"""

import re
from itertools import groupby
from typing import Literal, NamedTuple

from davinci_forces.files import visible
from davinci_forces.report.content.number import MINUS

Kind = Literal["text", "code", "bold", "maths", "reference", "link"]

MARK = re.compile(
    r"\\(?P<escaped>[\\$`*\[\]])"
    r"|\$(?P<maths>(?:\\.|[^$\\])+)\$"
    r"|`(?P<code>(?:\\.|[^`\\])+)`"
    r"|\*\*(?P<bold>(?:\\.|[^*\\])+)\*\*"
    r"|\[@(?P<reference>[a-z0-9][a-z0-9._-]*)\]"
    r"|\[(?P<link>(?:\\.|[^\[\]\\])+)\]\((?P<to>[\w./%~-]+)\)",
    re.DOTALL,
)

NEGATIVE = re.compile(r"(?<![\w.)\]-])-(?=\.?\d)")  # the sign of a number, not the hyphen of a name


class Span(NamedTuple):
    """A run of text of one kind."""

    kind: Kind
    text: str
    to: str = ""  # target of a link: a file in the document's folder


def literal(text: str) -> str:
    """Escape text that may hold anything, so that it is shown as it is wherever inline marks are read."""
    return re.sub(r"([\\$`*\[])", r"\\\1", printable(text))


def message(text: str) -> str:
    """A message of the tool, as marked text: backticks enclose code, a minus is a true one, all else is as it is."""
    parts = text.split("`")
    if len(parts) % 2 == 0:  # a name from a log has one
        return literal(text)
    return "`".join(literal(part if i % 2 else NEGATIVE.sub(MINUS, part)) for i, part in enumerate(parts))


def printable(text: str) -> str:
    """A text as a page can show it: control characters and marks of direction written out, but for ends of lines."""
    return visible(text, "\t\n\r")


def parse(text: str) -> tuple[Span, ...]:
    """Split marked text into spans; a mark without its partner is text."""
    spans, place = list[Span](), 0
    for match in MARK.finditer(text):
        spans += [Span("text", text[place : match.start()]), _span(match)]
        place = match.end()
    joined = list[Span]()
    for is_text, group in groupby([*spans, Span("text", text[place:])], lambda span: span.kind == "text"):
        alike = list(group)
        joined += [Span("text", "".join(span.text for span in alike))] if is_text else alike
    return tuple(span._replace(text=printable(span.text)) for span in joined if span.text)


def _span(match: re.Match[str]) -> Span:
    if match["link"]:
        return Span("link", _unescaped(match["link"]), match["to"])
    kind, text = match.lastgroup, match[match.lastgroup or 0]
    if kind == "escaped":
        return Span("text", text)
    return Span(kind, _unescaped(text) if kind in ("code", "bold") else text)  # type: ignore[arg-type]


def _unescaped(text: str) -> str:
    """A marked text without the backslashes of `literal`."""
    return re.sub(r"\\([\\$`*\[\]])", r"\1", text)
