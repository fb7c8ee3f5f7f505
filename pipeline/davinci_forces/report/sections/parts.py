"""What several sections share: panels, tables that are long, and words."""

from davinci_forces.records import Whiteness
from davinci_forces.report.content import HBand, Panel, Stems

LEFT_OUT = {
    "leave one log out": "the log",
    "leave one period out": "a period",
    "leave a block of path out": "a block of path",
    "leave a segment out": "a segment",
}
MEASURES = (
    "With periods left out, or logs, the error says how well a model describes the motion that it was made of: a "
    "period repeats the path of the others, so every parameter gains. With path blocks left out, on raw samples, it "
    "says what to expect on a path that is new; that is larger, and what a model is chosen by."
)


def autocorrelation(w: Whiteness, heading: str, named: bool = True) -> Panel:
    """An autocorrelation with the bands that white noise stays in; `named` in a legend."""
    acf = w.acf[1:]
    names = ("99 % band", "95 % band") if named else ("", "")
    bands = (HBand(-w.band_99, w.band_99, names[0], "sky"), HBand(-w.band, w.band, names[1]))
    marks = (*bands, Stems(w.lag[1:].astype(float), acf, "", "blue"))
    # Small ones are drawn large enough to be told from the band, and always on both sides of zero.
    reach = max(4 * w.band, 0.1)
    low, high = min(-reach, 1.1 * float(acf.min())), max(reach, min(1.1 * float(acf.max()), 1.0))
    return Panel(heading, "lag [samples]", "autocorrelation", marks, y_range=(low, high))
