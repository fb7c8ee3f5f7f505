"""What the panels of a figure show: marks, as data.  Words in figures are shown as they are, without inline marks."""

from dataclasses import dataclass, fields
from typing import Literal

import numpy as np

from davinci_forces.maths.arrays import Array

Colour = Literal["", "black", "blue", "vermillion", "green", "orange", "sky", "purple", "yellow", "grey"]
Style = Literal["", "solid", "dashed", "dotted", "dashdot"]


class Mark:
    """What all marks share: columns become float arrays of one length, but for one edge more, checked when made."""

    def __post_init__(self) -> None:
        columns = {f.name: np.asarray(getattr(self, f.name), float) for f in fields(self) if f.type is Array}  # type: ignore[arg-type]
        shapes = {name: column.shape for name, column in columns.items()}
        lengths = {column.size - (name == "edges") for name, column in columns.items()}
        if any(len(shape) != 1 for shape in shapes.values()) or len(lengths) > 1:
            raise ValueError(f"{type(self).__name__}: columns must be flat and of one length, not {shapes}")
        for name, column in columns.items():
            object.__setattr__(self, name, column)


@dataclass(frozen=True, eq=False)
class Samples(Mark):
    """Samples of y over x; the label is their entry in the legend."""

    x: Array
    y: Array
    label: str = ""
    colour: Colour = ""  # "" takes the next of the palette


@dataclass(frozen=True, eq=False)
class Line(Samples):
    """A curve through samples; NaN interrupts it."""

    style: Style = ""  # "" takes the next style, so that lines of a panel differ without colours, too


@dataclass(frozen=True, eq=False)
class Points(Samples):
    """Separate points; if given, each point has an error bar of +- `y_std` and a name next to it."""

    y_std: Array | None = None
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.y_std is not None:
            object.__setattr__(self, "y_std", np.broadcast_to(np.asarray(self.y_std, float), self.x.shape))


@dataclass(frozen=True, eq=False)
class Band(Mark):
    """The area between two curves, such as +- 2 sigma."""

    x: Array
    lower: Array
    upper: Array
    label: str = ""
    colour: Colour = ""


@dataclass(frozen=True, eq=False)
class Stems(Samples):
    """A stem from zero to each value, as an autocorrelation is drawn."""


@dataclass(frozen=True, eq=False)
class Histogram(Mark):
    """Counts (or densities) between edges: (n + 1,) edges and (n,) counts."""

    edges: Array
    counts: Array
    label: str = ""
    colour: Colour = ""


@dataclass(frozen=True, eq=False)
class Tiles(Mark):
    """A square matrix of numbers from -1 to 1, row by row, each on a tile tinted by it; and the names of rows."""

    value: Array  # (n^2,)
    names: tuple[str, ...]  # (n,) of rows, and of columns, at which their first words stand
    label: str = ""
    colour: Colour = "blue"  # of positive numbers; negative ones are `opposite`
    opposite: Colour = "vermillion"

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.value) != len(self.names) ** 2:
            raise ValueError(f"Tiles: {len(self.names)} names need their square of numbers, not {len(self.value)}")


@dataclass(frozen=True, eq=False)
class Bars(Mark):
    """One bar per name; several Bars in a panel share the names and stand side by side."""

    names: tuple[str, ...]
    heights: Array
    label: str = ""
    colour: Colour = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.heights) != len(self.names):
            raise ValueError(f"Bars: {len(self.names)} names need as many heights, not {len(self.heights)}")


@dataclass(frozen=True)
class HLine:
    """A horizontal line across the panel."""

    y: float
    label: str = ""
    colour: Colour = "grey"
    style: Style = "dashed"


@dataclass(frozen=True)
class VLine:
    """A vertical line across the panel."""

    x: float
    label: str = ""
    colour: Colour = "grey"
    style: Style = "dashed"


@dataclass(frozen=True)
class HBand:
    """A range of y across the panel, such as the confidence band of an autocorrelation."""

    lower: float
    upper: float
    label: str = ""
    colour: Colour = "grey"


@dataclass(frozen=True)
class VSpan:
    """A range of x over the height of the panel, such as a contact window."""

    start: float
    end: float
    label: str = ""
    colour: Colour = "orange"


@dataclass(frozen=True)
class Reference:
    """The straight line y = intercept + slope x across the panel."""

    slope: float
    intercept: float = 0.0
    label: str = ""
    colour: Colour = "grey"
    style: Style = "dashed"


AnyMark = Line | Points | Band | Stems | Histogram | Bars | Tiles | HLine | VLine | HBand | VSpan | Reference


@dataclass(frozen=True, eq=False)
class Line3D(Mark):
    """A curve in space; an `arrow` has a head at its end."""

    x: Array
    y: Array
    z: Array
    label: str = ""
    colour: Colour = ""
    style: Style = ""
    arrow: bool = False


@dataclass(frozen=True, eq=False)
class Points3D(Mark):
    """Points in space, each with its name beside it where `names` is given."""

    x: Array
    y: Array
    z: Array
    label: str = ""
    colour: Colour = ""
    names: tuple[str, ...] = ()
