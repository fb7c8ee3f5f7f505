"""An XML file as elements that know their lines, so that what is wrong with it can be said with its place.

A document type is refused: a description of a robot needs none, and entities that expand a thousandfold, or that name
other files, come with one.
"""

from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat

from davinci_forces.errors import BadRobot

LARGEST = 4_000_000  # bytes; what people describe has some thousands of lines, and shapes are in files of their own


@dataclass(frozen=True)
class Element:
    """One element, its attributes, the line that it begins at, and what is in it."""

    tag: str
    attributes: dict[str, str]
    line: int
    inner: list["Element"] = field(default_factory=list)

    def all(self, tag: str) -> list["Element"]:
        """The elements in it that have this tag."""
        return [element for element in self.inner if element.tag == tag]

    def first(self, tag: str) -> "Element | None":
        """The first of them, or None."""
        return next(iter(self.all(tag)), None)


def read(file: Path) -> Element:
    """The outermost element of a file.

    Raises
    ------
    BadRobot
        If the file cannot be read, is not XML, or has a document type.
    """
    try:
        if (size := file.stat().st_size) > LARGEST:
            said = f"it has {size / 1e6:.1f} MB, and a robot's description has at most {LARGEST / 1e6:.0f}"
            raise BadRobot(f"{file}: {said}: keep shapes in files of their own")
        text = file.read_bytes()
    except FileNotFoundError:
        raise BadRobot(f"{file}: there is no such robot file") from None
    except OSError as error:
        raise BadRobot(f"{file}: {error.strerror}") from None
    return parse(text, str(file))


def parse(text: bytes, name: str) -> Element:
    """The outermost element of a text of XML, called `name` in problems; raises as `read` does."""
    parser = expat.ParserCreate()
    outermost = Element("", {}, 0)
    open_elements = [outermost]

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = Element(tag, attributes, parser.CurrentLineNumber)
        open_elements[-1].inner.append(element)
        open_elements.append(element)

    def end(tag: str) -> None:
        open_elements.pop()

    def document_type(*_: object) -> None:
        said = "a robot's description needs no document type; delete <!DOCTYPE ...> and what it defines"
        raise BadRobot(f"{name}:{parser.CurrentLineNumber}: {said}")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.StartDoctypeDeclHandler = document_type
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        said = f"not XML: {expat.ErrorString(error.code)}, at column {error.offset + 1}"
        hint = "; run xacro first, and name the .urdf that it writes" if b"xacro:" in text else ""
        raise BadRobot(f"{name}:{error.lineno}: {said}{hint}") from None
    except (ValueError, LookupError) as error:  # of an encoding that Python does not know
        raise BadRobot(f"{name}: not XML: {error}; save it as UTF-8") from None
    return outermost.inner[0]
