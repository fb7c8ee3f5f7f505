"""A hundred dialects of text: each is read as the values that it was written from, or refused with the right words."""

import json
from collections.abc import Callable, Iterator, Sequence
from datetime import datetime, timedelta
from io import StringIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from davinci_forces.errors import BadLog
from davinci_forces.logs import open_log
from davinci_forces.maths.units import measures, size
from tests.logs.cutting import is_cut_honestly
from tests.logs.reading import read

ROWS, STEP = 60, 0.01
MAX_REFUSED = 25
T = STEP * np.arange(ROWS)
Q = 0.8 * np.sin(3 * T + 0.4)  # [rad]
AMPS = 1.3 * np.cos(5 * T) - 0.2  # [A]
TRUTH = {"t": T, "q": Q, "i": AMPS}
BIG = 1234.5 + 700.25 * np.arange(ROWS)  # [N] crosses thousands
NOON = datetime(2026, 10, 15, 11, 59, 59, 800000)  # so that the log passes noon
EPOCH = 1_792_065_599_800_000_000  # [ns] the same moment in UTC
ENGLISH = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")

Cells = Sequence[Sequence[str]]


class Dialect(NamedTuple):
    """A text, its samples in SI by the name or the number of a channel, or the words that refuse it."""

    text: str | bytes
    truth: dict[str | int, Any]
    refused: str = ""
    tolerance: float = 1e-9


def number(x: float, mark: str = ".", form: str = ".12g") -> str:
    return format(x, form).replace(".", mark)


def rows(*columns: Any, mark: str = ".", form: str = ".12g") -> list[list[str]]:
    """Cells of numbers; columns of words stay."""
    return [
        [cell if isinstance(cell, str) else number(cell, mark, form) for cell in row]
        for row in zip(*columns, strict=True)
    ]


def table(head: Sequence[str], cells: Cells, delimiter: str = ",", end: str = "\n") -> str:
    return end.join([*head, *(delimiter.join(row) for row in cells)]) + end


def plain(head: str = "t,q,i", scale: Sequence[float] = (1, 1, 1), delimiter: str = ",", **form: Any) -> str:
    """Times, positions and currents, each multiplied by a number, below a header."""
    scaled = (x * s for x, s in zip((T, Q, AMPS), scale, strict=True))
    return table([head] if head else [], rows(*scaled, **form), delimiter)


def named(*names: str | int) -> dict[str | int, Any]:
    return dict(zip(names, TRUTH.values(), strict=True))


NUMBERED = named(0, 1, 2)


def stamped(written: Callable[[datetime], str], delimiter: str = ";", step: float = STEP) -> str:
    moments = [written(NOON + timedelta(seconds=k * step)) for k in range(ROWS)]
    return table([delimiter.join(("when", "q"))], rows(moments, Q), delimiter)


def dated(step: float = STEP) -> dict[str | int, Any]:
    return {"when": step * np.arange(ROWS), "q": Q}


def half_day(moment: datetime) -> str:
    return (
        f"{moment.hour % 12 or 12}:{moment:%M:%S}.{moment.microsecond // 1000:03} {'PM' if moment.hour > 11 else 'AM'}"
    )


def fraction(moment: datetime, mark: str = ".") -> str:
    return f"{moment:%H:%M:%S}{mark}{moment.microsecond // 1000:03}"


def grouped(x: float, group: str, mark: str) -> str:
    return f"{x:,.2f}".replace(".", "D").replace(",", group).replace("D", mark)


def framed(border: bool) -> str:
    head, *lines = plain(delimiter=" | ", head="t | q | i").splitlines()
    ruler = "|---|---|---|" if not border else "+-----+-----+-----+"
    lines = [f"| {line} |" for line in lines]
    return "\n".join([*([ruler] if border else []), f"| {head} |", ruler, *lines, *([ruler] if border else [])]) + "\n"


def inserted(text: str, line: str, at: int = 30) -> str:
    lines = text.splitlines()
    return "\n".join([*lines[:at], line, *lines[at:]]) + "\n"


def in_pandas(index: bool, header: Any = True, **how: Any) -> str:
    out = StringIO()
    pd.DataFrame(TRUTH).to_csv(out, index=index, header=header, **how)
    return out.getvalue()


def plotjuggler() -> str:
    names = ['"__time"', '"/joint_states/position/panda_joint1"', '"/joint_states/effort/panda_joint1"']
    cells = [[f"{1_792_065_599.8 + t:.6f}", number(q), number(i)] for t, q, i in zip(T, Q, AMPS, strict=True)]
    return table([",".join(names)], cells)


def rostopic() -> str:
    names = "time,field.header.seq,field.header.stamp,field.header.frame_id,field.name0,field.position0,field.effort0"
    ns = [str(EPOCH + round(1e9 * t)) for t in T]
    cells = rows(ns, [str(k) for k in range(ROWS)], ns, [""] * ROWS, ["yaw"] * ROWS, Q, AMPS)
    return table([f"%{names}"], cells)


def read_dialects() -> Iterator[tuple[str, Dialect]]:
    """Those that are read."""
    deg, milli = np.degrees(1), 1e3
    for name, text in {
        "comma": plain(),
        "comma and blank": plain("t, q, i", delimiter=", "),
        "semicolon": plain("t;q;i", delimiter=";"),
        "tab": plain("t\tq\ti", delimiter="\t"),
        "blanks": plain("t q i", delimiter="   "),
        "pipe": plain("t|q|i", delimiter="|"),
        "semicolon, decimal comma": plain("t;q;i", delimiter=";", mark=","),
        "tab, decimal comma": plain("t\tq\ti", delimiter="\t", mark=","),
        "blanks, decimal comma": plain("t q i", delimiter=" ", mark=","),
        "pipe, decimal comma": plain("t|q|i", delimiter="|", mark=","),
        "exponents": plain(form=".11e"),
        "signs": plain(form="+.12g"),
        "CRLF": plain().replace("\n", "\r\n"),
        "CR": plain().replace("\n", "\r"),
        "old LabVIEW's CR CR LF": plain().replace("\n", "\r\r\n"),
        "quoted names": plain('"t","q","i"'),
        "blank lines": plain().replace("\n", "\n\n"),
        "all cells quoted": table(['"t","q","i"'], [[f'"{c}"' for c in row] for row in rows(T, Q, AMPS)]),
        "all cells quoted, decimal comma": table(
            ['"t","q","i"'], [[f'"{c}"' for c in row] for row in rows(T, Q, AMPS, mark=",")]
        ),
        "hash before the names": plain("# t,q,i"),
        "percent before the names": plain("% t q i", delimiter=" "),
        "slashes before the names": plain("// t,q,i"),
        "a delimiter before every row": plain("t;q;i", delimiter=";").replace("\n", "\n;")[:-1],
        "a title above": plain("Recorded by M\n\nt,q,i"),
        "a preamble of keys": plain("Date: 2026-10-15\nRate: 100\nOperator;M\nt;q;i", delimiter=";"),
        "a preamble as wide as the rows": plain("Subject,A,left\nTrial,B,right\nt,q,i"),
        "a ruler below the names": plain("t q i\n--- --- ---", delimiter=" "),
        "a delimiter at every end": plain("t;q;i;", delimiter=";").replace("\n", ";\n").replace(";;", ";"),
        "names in another delimiter": plain("t, q, i", delimiter=" "),
        "names apart by tabs": plain("t\tq\ti", delimiter=" "),
        "Excel's sep": plain("sep=;\nt;q;i", delimiter=";"),
        "Markdown": framed(False),
        "MySQL": framed(True),
        "psql": plain(" t | q | i\n---+---+---", delimiter=" | "),
        "fixed width": plain("    t    q    i", delimiter="     "),
        "names and words of types": plain("t,q,i\nfloat,float,float").replace(
            "t,q,i\nfloat,float,float", "float,float,float\nt,q,i"
        ),
        "pandas without index": in_pandas(False),
        "pandas with index": in_pandas(True),
        "numpy savetxt": plain("# t q i", delimiter=" ", form=".18e"),
        "R write.csv": in_pandas(True, quoting=2),
        "a comment in the middle": inserted(plain(), "# pause here, 3, 4"),
        "a remark in the middle": inserted(plain(), "-- Trial 2 --"),
        "slashes in the middle": inserted(plain(), "// pause, 3, 4"),
        "words in the middle": inserted(plain(), "Pause"),
        "the header again": inserted(plain(), "t,q,i"),
        "a count below the rows": plain() + "(60 rows)\n",
        "a comment at the end": plain() + "% end\n",
        "NA among the text": plain("t,q,i,note").replace("\n0", ",NA\n0").replace("note,NA", "note"),
    }.items():
        yield name, Dialect(text, TRUTH)
    for name, text in {
        "no header": plain(""),
        "no header, blanks": plain("", delimiter=" "),
        "no header, a comment": plain("# of 2026"),
        "pandas without names": in_pandas(False, header=[0, 1, 2]),
        "a leading tab and blanks": plain("", delimiter="\t "),
    }.items():
        yield name, Dialect(text, NUMBERED)
    yield "UTF-8 with a mark", Dialect(plain().encode("utf-8-sig"), TRUTH)
    yield "UTF-16", Dialect(plain().encode("utf-16"), TRUTH)
    yield (
        "Windows' degrees",
        Dialect(plain("t [s];q [°];i [A]", (1, deg, 1), ";").encode("cp1252"), named("t [s]", "q [°]", "i [A]")),
    )
    yield "pandas without names, with index", Dialect(in_pandas(True, header=[0, 1, 2]), named("0", "1", "2"))
    for head in (
        "t [ms],q [deg],i [mA]",
        "t (ms),q (deg),i (mA)",
        "t_ms,q_deg,i_mA",
        "t ms,q deg,i mA",
        "t_ms_1,q_deg_1,i_mA_1",
        "TimeMs,PosDeg,CurrentmA",
        "time.ms,pos.deg,cur.mA",
        "t [msec],q [Degrees],i [milliamps]",
        "t {ms},q {deg},i {mA}",
        "q_ms,q_deg,i_ma_filtered",
        "[ms] t,[deg] q,[mA] i".replace("[ms] t", "x [ms] t")
        .replace("[deg] q", "x [deg] q")
        .replace("[mA] i", "x [mA] i"),
    ):
        yield head, Dialect(plain(head, (milli, deg, milli)), named(*head.split(",")))
    over = plain("time / ms,q / deg,i / mA", (milli, deg, milli))
    yield "quantities over units", Dialect(over, named("time", "q", "i"))
    yield "quantities over units, as written", Dialect(over, named("time / ms", "q / deg", "i / mA"))
    yield "quantities over units in brackets", Dialect(over.replace("/ deg", "/ (deg)"), named("time", "q", "i"))
    for name, units in {
        "units below": "ms,deg,mA",
        "units in brackets below": "[ms],[deg],[mA]",
        "words for units below": "msec,degrees,milliamps",
    }.items():
        yield name, Dialect(plain(f"t,q,i\n{units}", (milli, deg, milli)), TRUTH)
    yield "units above", Dialect(plain("ms,deg,mA\nt,q,i", (milli, deg, milli)), TRUTH)
    yield (
        "a row of types below",
        Dialect(plain("t_ms,q_deg,i_mA\nfloat,float,float", (milli, deg, milli)), named("t_ms", "q_deg", "i_mA")),
    )
    yield (
        "words below the units",
        Dialect(plain("t [ms],q [deg],i [mA]\ntime,joint,motor", (milli, deg, milli)), named("time", "joint", "motor")),
    )
    yield "units alone", Dialect(plain("ms,deg,mA", (milli, deg, milli)), named("ms", "deg", "mA"))
    yield (
        "names of two lines",
        Dialect(plain('"t\n[ms]","q\n[deg]","i\n[mA]"', (milli, deg, milli)), named("t [ms]", "q [deg]", "i [mA]")),
    )
    labelled = (
        plain("Name;t;q;i\nUnit;ms;deg;mA", (milli, deg, milli), ";").replace("\n0", "\n;0").replace("mA\n", "mA\n")
    )
    yield (
        "rows with labels",
        Dialect("".join(line if line[0] in "NU;" else f";{line}" for line in labelled.splitlines(True)), TRUTH),
    )
    yield "Origin's three lines", Dialect(plain("t,q,i\nms,deg,mA\ntime,joint,motor", (milli, deg, milli)), TRUTH)
    yield "index in the names", Dialect(plain("t,q[0],q[1]"), named("t", "q[0]", "q[1]"))
    yield "joints in the names", Dialect(plain("t,q[outer_yaw],i (joint 1)"), named("t", "q[outer_yaw]", "i (joint 1)"))
    yield (
        "index and unit",
        Dialect(plain("t,q[0] (deg),i[0] (mA)", (1, deg, milli)), named("t", "q[0] (deg)", "i[0] (mA)")),
    )
    yield "minutes", Dialect(plain("time_min,q_rpm,i_a", (1 / 60, 30 / np.pi, 1)), named("time_min", "q_rpm", "i_a"))
    yield (
        "rostopic echo -p",
        Dialect(
            rostopic(), {"field.header.stamp": 1e-9 * EPOCH + T, "field.position0": Q, "field.effort0": AMPS}, "", 3e-7
        ),
    )
    yield (
        "PlotJuggler",
        Dialect(
            plotjuggler(),
            named("__time", "/joint_states/position/panda_joint1", "/joint_states/effort/panda_joint1")
            | {"__time": 1e-9 * EPOCH + T},
            "",
            3e-7,
        ),
    )
    for unit, per_second in (("ns", 1e9), ("us", 1e6), ("ms", 1e3)):
        count = [str(round(EPOCH * 1e-9 * per_second) + round(per_second * t)) for t in T]
        text = table([], rows(count, Q, AMPS))
        yield f"{unit} since 1970 without a header", Dialect(text, NUMBERED | {0: 1e-9 * EPOCH + T}, "", 5e-7)
    excel = (NOON - datetime(1899, 12, 30)) / timedelta(days=1)
    days = table(["Date,q,i"], rows([f"{excel + t / 86400:.12f}" for t in T], Q, AMPS))
    yield "days since 1900", Dialect(days, {"Date": 86400 * excel + T, "q": Q, "i": AMPS}, "", 2e-6)
    for name, text in {
        "German dates": stamped(lambda m: f"{m:%d.%m.%Y} {fraction(m, ',')}").replace("q", "q"),
        "German dates of one digit": stamped(lambda m: f"{m.day}.{m.month}.{m.year}, {fraction(m)}"),
        "US dates": stamped(lambda m: f"{m:%m/%d/%Y} {fraction(m)}"),
        "US dates with AM and PM": stamped(lambda m: f"{m.month}/{m.day}/{m.year} {half_day(m)}"),
        "British dates": stamped(lambda m: f"{m:%d/%m/%Y} {fraction(m)}", "\t"),
        "MATLAB's dates": stamped(lambda m: f"{m.day:02}-{ENGLISH[m.month - 1]}-{m.year} {fraction(m)}"),
        "compact dates": stamped(lambda m: f"{m:%Y%m%dT%H%M%S}.{m.microsecond // 1000:03}"),
        "dates as numbers": stamped(lambda m: f"{m:%Y%m%d%H%M%S}.{m.microsecond // 1000:03}"),
        "ISO 8601": stamped(lambda m: m.isoformat() + "Z"),
        "ISO 8601 with a comma": stamped(lambda m: f"{m:%Y-%m-%d} {fraction(m, ',')}"),
    }.items():
        yield name, Dialect(text, dated())
    hours = stamped(lambda m: f"{m.month}/{m.day}/{m.year} {half_day(m)}", step=997.0)
    yield "US dates past one o'clock and midnight", Dialect(hours, dated(997.0))
    yield "Markdown, by number", Dialect(framed(False), NUMBERED)
    yield "times of day", Dialect(stamped(fraction), {"when": 43199.8 + T, "q": Q})
    yield "times of half a day", Dialect(stamped(half_day), {"when": 43199.8 + T, "q": Q})
    two = [
        row[0].split() + row[1:]
        for row in rows([f"{NOON:%d.%m.%Y} {fraction(NOON + timedelta(seconds=t))}" for t in T.tolist()], Q)
    ]
    yield "German days and times apart", Dialect(table(["day\ttime\tq"], two, "\t"), {"time": 43199.8 + T, "q": Q})
    thousands = {"t": T, "F": BIG}
    for name, group, mark, delimiter in (
        ("German thousands", ".", ",", ";"),
        ("US thousands", ",", ".", ";"),
        ("US thousands and tabs", ",", ".", "\t"),
        ("French thousands", "\u202f", ",", ";"),
        ("Swiss thousands", "’", ".", ";"),
        ("ISO 80000 thousands", " ", ",", "\t"),
    ):
        cells = [[number(t, mark), grouped(f, group, mark)] for t, f in zip(T, BIG, strict=True)]
        yield name, Dialect(table([f"t{delimiter}F"], cells, delimiter), thousands)
    cells = [[number(t), f'"{grouped(f, ",", ".")}"'] for t, f in zip(T, BIG, strict=True)]
    yield "quoted US thousands", Dialect(table(["t,F"], cells), thousands)


def refused_dialects() -> Iterator[tuple[str, Dialect]]:
    """Those that are refused, when they are opened or when the column is read."""
    short = plain("t,q")
    few = [[number(t, ","), f"{1234 + k}"[:1] + "." + f"{1234 + k}"[1:]] for k, t in enumerate(T)]
    for name, text, words in (
        ("a header one name short", short, "names 2 columns .* but rows have 3; which one has no name is not known"),
        (
            "R's row names",
            '"t" "q" "i"\n' + "".join(f'"{k + 1}" {" ".join(row)}\n' for k, row in enumerate(rows(T, Q, AMPS))),
            "row.names = FALSE",
        ),
        ("names one short below a preamble as wide as the rows", plain("Subject,A,left\nt,q"), "names 2 columns"),
        ("a header two names long", plain("t,q,i,x,y"), "names 5 columns"),
        ("units one short", plain("t q i\ns rad", delimiter=" "), "names 2 columns"),
        ("names with blanks between blanks", plain("Time Joint pos Motor cur", delimiter=" "), "names 5 columns"),
        ("another header in the middle", inserted(plain(), "t,dq,i"), ":31: 't,dq,i' is neither a row nor the header"),
        (
            "a blank where a sample is missing",
            inserted(plain("t q i", delimiter=" "), "0.3 0.5"),
            ":31: the row has 2 cells, .* not known",
        ),
        ("rows that become wider", inserted(plain(), "0.3,0.5,1,2"), ":31: the row has 4 cells"),
        (
            "a thousand or a decimal mark",
            table(["t;n"], few, ";"),
            r"'(1)\.(\d+)' may be \1\2 with a thousands separator, or \1\.\2; export",
        ),
        (
            "a column of thousands or fractions",
            table(["t;n"], [[number(t), f"{1 + k % 9},{200 + k}"] for k, t in enumerate(T)], ";"),
            r"column 1 \(n\) holds '(\d),(\d+)', which may be \1\2 with a thousands separator, or \1\.\2; export",
        ),
        (
            "every mark may be of thousands",
            table(["t;n"], [[c.split(",")[0] or "0", n] for c, n in few], ";"),
            r"'(1)\.(\d+)' may be \1\2 with",
        ),
        (
            "dates of two readings",
            stamped(lambda m: f"05/10/{m.year} {fraction(m)}"),
            "may be day 05 of month 10, or day 10 of month 05",
        ),
        (
            "minutes and seconds",
            stamped(lambda m: f"{m:%M:%S}.{m.microsecond // 1000:03}"),
            "in a format that is not read; export seconds",
        ),
        (
            "dates in words",
            stamped(lambda m: f"Thu {m.day} October {m.year} {fraction(m)}"),
            "in a format that is not read",
        ),
        (
            "units in the cells",
            table(["t,q,i"], rows(T, [f"{q} rad" for q in Q], AMPS)),
            "a number and its unit in one cell; export the numbers alone",
        ),
        (
            "commas for all",
            plain("", delimiter=",", mark=",", form=".3f"),
            "the comma may be the delimiter, the decimal mark, or both",
        ),
        (
            "commas for all, one digit",
            plain("", delimiter=",", mark=",", form=".1f").replace("-", ""),
            "the comma may be",
        ),
        ("commas for all, below names", plain(mark=",", form=".3f").replace("-", ""), "the comma may be"),
        (
            "one column of thousands",
            "F\n" + "".join(f"{1000 + k:,}.5\n" for k in range(ROWS)),
            "the delimiter, or separate thousands",
        ),
        (
            "JSON",
            "".join(json.dumps(dict(zip(TRUTH, row, strict=True))) + "\n" for row in zip(T, Q, AMPS, strict=True)),
            "JSON: write columns",
        ),
        (
            "XML",
            "<log>\n" + "".join(f"<row><t>{t}</t><q>{q}</q></row>\n" for t, q in zip(T, Q, strict=True)),
            "save the table as CSV",
        ),
        (
            "YAML of rostopic echo",
            "".join(f"header:\n  seq: {k}\nposition: [{q}]\n---\n" for k, q in enumerate(Q)),
            "rostopic echo -p",
        ),
        ("words alone", "no numbers\nat all\n", "no delimiter"),
        (
            "several marks in one log",
            table(["t;q"], [[number(t), number(q, ",")] for t, q in zip(T, Q, strict=True)], ";"),
            "another decimal mark",
        ),
    ):
        yield name, Dialect(text, {}, words)


READ, REFUSED = dict(read_dialects()), dict(refused_dialects())


def read_all(path: Path) -> None:
    """Every channel, also those of text."""
    log = open_log(path)
    for channel in log.channels:
        list(log.blocks([channel.name]))


def in_si(dialect: Dialect) -> dict[str | int, Any]:
    """The samples of the channels that a dialect names, in SI, as a study takes them."""
    text = dialect.text if isinstance(dialect.text, bytes) else dialect.text.encode()
    log, samples = read(text, "log.csv")
    channels = {name: log.find(name) for name in dialect.truth or range(len(log.channels))}
    assert all(measures(channel.unit) or not channel.unit for channel in channels.values())
    return {
        name: samples[channel.name] * (size(channel.unit) if channel.unit else 1.0)
        for name, channel in channels.items()
    }


@pytest.mark.parametrize("name", READ)
def test_a_dialect_is_read_as_the_values_it_was_written_from(name):
    dialect = READ[name]
    samples = in_si(dialect)
    for channel, truth in dialect.truth.items():
        assert_allclose(samples[channel], truth, rtol=1e-9, atol=dialect.tolerance)


@pytest.mark.parametrize("name", REFUSED)
def test_any_other_dialect_is_refused_with_the_remedy(name, tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(REFUSED[name].text)
    with pytest.raises(BadLog, match=REFUSED[name].refused):
        read_all(path)


def test_there_are_a_hundred_dialects_and_few_are_refused():
    assert len(READ) + len(REFUSED) >= 100
    assert len(REFUSED) <= MAX_REFUSED


@pytest.mark.parametrize("name", READ)
def test_a_dialect_that_is_cut_loses_its_last_rows_alone(name):
    text = READ[name].text
    content = text if isinstance(text, bytes) else text.encode()
    for length in np.random.default_rng(len(content)).integers(len(content) // 3, len(content), 4).tolist():
        is_cut_honestly(content, length, "log.csv")
