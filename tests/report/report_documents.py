"""A document that holds every kind of block and of mark, and text that tries to be markup."""

import numpy as np

from davinci_forces.report.content import (
    Bullets,
    Document,
    Equation,
    Figure,
    Figure3D,
    Listing,
    Number,
    OnScreen,
    Panel,
    Prose,
    Section,
    Table,
    Verdict,
    literal,
)
from davinci_forces.report.content.marks import (
    Band,
    Bars,
    HBand,
    Histogram,
    HLine,
    Line,
    Line3D,
    Points,
    Points3D,
    Reference,
    Stems,
    Tiles,
    VLine,
    VSpan,
)

HOSTILE = "<script>alert(1)</script> #set page() $x$ *b* **c** `d` [@e] \\ \"q\" 'a' & é Ω"


def zoomable(samples: int, label: str) -> Figure:
    """Traces of a length: position in one panel; effort, band and a contact window in the other."""
    t = np.arange(samples) / 100
    q = np.sin(t)
    return Figure(
        "Traces of `roll`.",
        "Two panels of traces.",
        (
            Panel(
                "Position </script> $$x$$",
                "t [s]",
                "q [rad]",
                (Line(t, q, "</script><b>alert(2)</b> $$x$$ \\(y\\)", "black"),),
            ),
            Panel(
                "Effort",
                "t [s]",
                "τ [N m]",
                (
                    VSpan(1, 2, "contact"),
                    Band(t, q - 1, q + 1, "±2σ"),
                    Line(t, q, "model"),
                    HLine(0.0),
                    VLine(1.0),
                    HBand(-0.1, 0.1),
                    Points([0, 1], [0, 1], "knots", y_std=[0.1, 0.1]),
                    Stems([0, 1], [0, 1]),
                ),
            ),
        ),
        label=label,
        zoomable=True,
    )


def still() -> Figure:
    """A figure of five panels that hold every mark between them."""
    x = np.linspace(0.1, 1, 50)
    return Figure(
        f"Still, $theta_1$ of {literal(HOSTILE)}.",
        HOSTILE,
        (
            Panel("Lines", "$x$ [s]", HOSTILE, (Line(x, x, "_under $y$"), Line(x, x**2, style="dotted"), HLine(0.5))),
            Panel("", "x", "n", (Histogram([0, 1, 2], [3, 4], "counts"), VLine(1.5), VSpan(0, 1), Band(x, x, x + 1))),
            Panel("Log", "x", "y", (Points(x, x, y_std=0.1), Reference(1), HBand(0.1, 0.2), Stems(x, x)), x_log=True),
            Panel("", "", "", (Tiles([1.0, -0.5, -0.5, 1.0], ("θ1 $a$", "θ2 b")),)),
            Panel("", "", "θ", (Bars(("a", "b"), [1, 2], "LSE"), Bars(("a", "b"), [2, 3], "WLSE"))),
        ),
        label="still",
        columns=2,
    )


def document(simulated: bool = True) -> Document:
    """Every kind of block, in sections and a subsection."""
    hostile = literal(HOSTILE)
    table = Table(
        "Parameters.",
        ("name", "LSE", "RMSE"),
        (("$theta_1$", Number(1.234, "N m", 0.056, "fit.a"), Number(3, "N")), (hostile, Number(2, "N m"), Number(1))),
        label="parameters",
    )
    chain = Figure3D(
        "Chain.", "Chain.", (Line3D([0, 1], [0, 1], [0, 1], "links"), Points3D([0], [1], [0], "", "", ("p",)))
    )
    method = Section(
        "Method", "method", (Prose("As in [@update]:"), Equation("x = K (y - hat(y))", "x is K times y", "update"))
    )
    first = Section(
        f"First {hostile}",
        "first",
        (
            Prose(f"**Bold** `code` $x^2$, [@still], [@parameters], [@method].\n\nSecond: {hostile}"),
            Verdict("good", "well"),
            Verdict("warn", hostile),
            Verdict("bad", "badly"),
            Verdict("info", "so"),
            Bullets(("one", f"`{hostile}`")),
            Listing(f"{HOSTILE}\n\tindented\x07"),
            table,
            still(),
            chain,
            method,
        ),
    )
    folded = OnScreen(f"Folded {hostile}", "folded", (Prose("Only here."), zoomable(40, "folded-zoom"), table_of_one()))
    second = Section("Second", "second", (zoomable(400, "zoom"), folded, Prose("See [@folded] and [@folded-zoom].")))
    return Document("Report", f"Study {HOSTILE}", simulated, (first, second))


def table_of_one() -> Table:
    """A table of one number."""
    return Table("One.", ("name", "value"), (("a", Number(1, "m", key="one.a")),))
