"""Read the elements of a URDF as numbers and names; problems are noted with their lines.

The file is XML.  A document type is refused: a URDF needs none, and a document type could define entities that expand a
thousandfold or that refer to other files.
"""

import math
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

import numpy as np

from davinci_forces.errors import BadRobot
from davinci_forces.files import read_bytes
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import PARAMETERS, of_pseudo_inertias, pseudo_inertias, tensors
from davinci_forces.maths.mechanics.placed import transform
from davinci_forces.robots.robot import MOST_LINKS
from davinci_forces.toml import TomlFile, excerpt, unlikely

MAX_BYTES = 4_000_000  # a description has a few thousand lines; shapes are in separate files
TOO_LARGE = f"more than the {MAX_BYTES / 1e6:.0f} MB that are read; keep shapes in separate files"
MAX_DEPTH = 30  # levels of nested elements; simulators nest their elements up to ten levels deep
MOST_ELEMENTS = 30_000  # 30 for each of MOST_LINKS, including visual and collision shapes
MOST_ATTRIBUTES = 30
NAME = re.compile(r"[\w ./:+-]{1,100}")  # links and joints; valid in files, equations and messages
MOVING = ("revolute", "continuous", "prismatic")
NO_LIMIT = 1e9  # [N m, N or SI units of motion] larger values mean no limit, which URDF cannot express
NEGLIGIBLE_INERTIA = 1e-7  # [kg m^2] several times that of 1 cm^3 of water; programs write such noise for "none"
ROUNDING = 1e-9  # share of an inertia's largest eigenvalue: rounded digits may make an eigenvalue this negative
TIP = "tip"  # name of the frame at the tip in files that we write
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


@dataclass(frozen=True)
class Element:
    """One XML element: its tag, its attributes, its first line, and its inner elements."""

    tag: str
    attributes: dict[str, str]
    line: int
    inner: list["Element"] = field(default_factory=list)

    def children(self, tag: str) -> list["Element"]:
        """The inner elements with this tag."""
        return [element for element in self.inner if element.tag == tag]

    def child(self, tag: str) -> "Element | None":
        """The first inner element with this tag, or None."""
        return next(iter(self.children(tag)), None)


def read(file: Path) -> Element:
    """The outermost element of a file; raises BadRobot if it cannot be read, is not XML, or has a document type."""
    try:
        text = read_bytes(file, MAX_BYTES, TOO_LARGE)
    except FileNotFoundError:
        raise BadRobot(f"{file}: there is no such robot file") from None
    except OSError as error:
        raise BadRobot(f"{file}: {error.strerror}") from None
    return parse(text, str(file))


def parse(text: bytes, name: str) -> Element:
    """The outermost element of an XML text; errors name it `name`, and are those of `read`."""
    parser = expat.ParserCreate()
    outermost = Element("", {}, 0)
    open_elements = [outermost]
    counts = Counter[str]()

    def start(tag: str, attributes: dict[str, str]) -> None:
        counts.update(("element", tag) if len(open_elements) == 2 else ("element",))
        for what, number, most in (
            ("nested elements", len(open_elements), MAX_DEPTH), ("elements", counts["element"], MOST_ELEMENTS),
            ("joints", counts["joint"], MOST_LINKS), ("links", counts["link"], MOST_LINKS),
            ("attributes in an element", len(attributes), MOST_ATTRIBUTES),
        ):  # fmt: skip
            if number > most:
                excess = f"it has more than {most} {what}"
                raise BadRobot(f"{name}:{parser.CurrentLineNumber}: {excess}; describe one arm of the robot only")
        element = Element(tag, attributes, parser.CurrentLineNumber)
        open_elements[-1].inner.append(element)
        open_elements.append(element)

    def document_type(*_: object) -> None:
        remedy = "a URDF needs no document type; delete <!DOCTYPE ...> and what it defines"
        raise BadRobot(f"{name}:{parser.CurrentLineNumber}: {remedy}")

    parser.StartElementHandler, parser.EndElementHandler = start, lambda _: open_elements.pop()
    parser.StartDoctypeDeclHandler = document_type
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        wrong = f"not XML: {expat.ErrorString(error.code)}, at column {error.offset + 1}"
        hint = "; run xacro first, and name the .urdf that it writes" if b"xacro:" in text else ""
        raise BadRobot(f"{name}:{error.lineno}: {wrong}{hint}") from None
    except (ValueError, LookupError) as error:  # an encoding that Python does not know
        raise BadRobot(f"{name}: not XML: {error}; save it as UTF-8") from None
    return outermost.inner[0]


class UrdfJoint(NamedTuple):
    """One joint as its file states it."""

    name: str
    kind: str  # one of MOVING, or "fixed"
    parent: str
    child: str
    placement: Array  # pose of the child's frame in the parent's frame at q = 0 (4, 4) [m]
    axis: Array  # (3,) in the child's frame, of length 1
    position: tuple[float, float]
    velocity: float
    effort: float
    mimic: str  # name of the joint that this joint mimics, or ""
    multiplier: float
    bias: float
    line: int


class Notes:
    """The problems of one element, noted with its line and its name."""

    def __init__(self, file: TomlFile, element: Element) -> None:
        self.file, self.element = file, element
        named = element.attributes.get("name")
        self.called = f"<{element.tag} name={excerpt(named)}>" if named is not None else f"<{element.tag}>"

    def problem(self, text: str, at: Element | None = None) -> None:
        """Note a problem of the element, or of an inner element."""
        inner = "" if at is None or at is self.element else f" <{at.tag}>"
        self.file.note((at or self.element).line, f"{self.called}{inner}: {text}")

    def name(self, element: Element | None, key: str, subject: str) -> str:
        """The name in an attribute, or ""; a problem begins with its `subject`."""
        value = "" if element is None else element.attributes.get(key, "")
        if not value:
            self.problem(f"{subject} is missing", element)
        elif not NAME.fullmatch(value):
            allowed = "letters, digits, spaces and _./:+-"
            self.problem(f"{subject} is {excerpt(value)}, but may have only {allowed}", element)
        return value

    def numbers(self, element: Element | None, key: str, default: Sequence[float]) -> list[float]:
        """The finite numbers of an attribute, as many as the default has; the default if it is missing or wrong."""
        if element is None or key not in element.attributes:
            return list(default)
        text = element.attributes[key]
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) != len(default) or not all(map(math.isfinite, values)):
            how = "a finite number" if len(default) == 1 else f"{len(default)} finite numbers with spaces between them"
            self.problem(f"{key} must be {how}, not {excerpt(text)}", element)
            return list(default)
        limits = element.tag == "limit"  # numbers above NO_LIMIT mean no limit
        kind = "force" if key == "effort" else ""
        likely = (unlikely(key, x, kind) for x in values if abs(x) < NO_LIMIT or not limits)
        if wrong := next(filter(None, likely), ""):
            self.problem(f"{wrong}, not {excerpt(text)}", element)
            return list(default)
        return values

    def number(self, element: Element | None, key: str, default: float) -> float:
        """One finite number."""
        return self.numbers(element, key, [default])[0]

    def pose(self, element: Element | None) -> Array:
        """The pose (4, 4) of an <origin>."""
        xyz, rpy = (self.numbers(element, key, [0.0] * 3) for key in ("xyz", "rpy"))
        return transform(xyz, rpy)


def inertial_parameters(link: Element, file: TomlFile) -> Array:
    """The inertial parameters (10,) of a link in its frame; 0 if it has no <inertial>."""
    stated = link.child("inertial")
    if stated is None:
        return np.zeros(len(PARAMETERS))
    notes, mass = Notes(file, link), stated.child("mass")
    m = notes.number(mass, "value", 0.0)
    if mass is None or "value" not in mass.attributes:
        notes.problem('its inertial has no mass; write <mass value="..."/> [kg], or leave the inertial out', stated)
    if m < 0:
        notes.problem(f"the mass is {m:g} kg, but must be 0 or more", mass)
    tensor = stated.child("inertia")
    about_centre = np.array([[0.0] * 4 + [notes.number(tensor, key, 0.0) for key in TENSOR]])
    values = np.linalg.eigvalsh(tensors(about_centre))[0]
    if values[0] < -max(ROUNDING * abs(values).max(), NEGLIGIBLE_INERTIA):
        wrong = f"the smallest principal moment of inertia is {values[0]:.3g} kg m^2, but must be 0 or more"
        notes.problem(f"{wrong}; correct its signs, or leave the inertial out", tensor)
    T, J = notes.pose(stated.child("origin")), pseudo_inertias(about_centre)[0]
    J[3, 3] = m
    return np.asarray(of_pseudo_inertias((T @ J @ T.T)[None])[0])


def read_joint(element: Element, file: TomlFile) -> UrdfJoint:
    """Read a joint; a joint of unknown type becomes a fixed joint, so that the links after it stay connected."""
    notes, kind = Notes(file, element), element.attributes.get("type", "")
    name = notes.name(element, "name", "its name")
    parent_link = notes.name(element.child("parent"), "link", 'its <parent link="..."/>')
    child_link = notes.name(element.child("child"), "link", 'its <child link="..."/>')
    if kind not in (*MOVING, "fixed"):
        remedy = "replace it by several of these" if kind in ("floating", "planar") else "correct it"
        notes.problem(f"type is {excerpt(kind)}, but must be {', '.join(MOVING)} or fixed; {remedy}")
        kind = "fixed"
    # Exporters of CAD programs write 0 0 0 for a fixed joint.
    stated_axis = None if element.attributes.get("type") == "fixed" else element.child("axis")
    axis = np.array(notes.numbers(stated_axis, "xyz", [1.0, 0.0, 0.0]))
    length = float(np.linalg.norm(axis))
    if not length:
        notes.problem("xyz is 0 0 0, but an axis needs a direction", stated_axis)
    mimic = element.child("mimic")
    bounds = _bounds(notes, element.child("limit"), kind)
    return UrdfJoint(
        name=name, kind=kind, parent=parent_link, child=child_link, placement=notes.pose(element.child("origin")),
        axis=axis / (length or 1.0), position=bounds, velocity=_most(notes, element.child("limit"), "velocity"),
        effort=_most(notes, element.child("limit"), "effort"),
        mimic=notes.name(mimic, "joint", "the joint that it mimics") if mimic else "",
        multiplier=notes.number(mimic, "multiplier", 1.0), bias=notes.number(mimic, "offset", 0.0), line=element.line,
    )  # fmt: skip


def _bounds(notes: Notes, limit: Element | None, kind: str) -> tuple[float, float]:
    """The range of a joint's position; infinite if the joint is continuous or states no bound but 0 for both."""
    low, high = (notes.number(limit, key, 0.0) for key in ("lower", "upper"))
    if kind not in ("revolute", "prismatic") or low == high == 0.0:
        return -math.inf, math.inf
    if low >= high:
        wrong = f"lower is {low:g} and upper is {high:g}, but lower must be less than upper"
        notes.problem(f'{wrong}; correct them, or write type="fixed" if the joint does not move', limit)
    return low if low > -NO_LIMIT else -math.inf, high if high < NO_LIMIT else math.inf


def _most(notes: Notes, limit: Element | None, key: str) -> float:
    """A limit of velocity or effort; infinite for 0, which many files state for an unknown limit."""
    most = notes.number(limit, key, 0.0)
    if most < 0:
        notes.problem(f"{key} is {most:g}, but must be 0 or more", limit)
    return most if 0 < most < NO_LIMIT else math.inf
