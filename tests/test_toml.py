"""Tables of TOML: every key has its line, however the file is written, and what is wrong with a key is said there."""

import json
import math
import re
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from davinci_forces.errors import BadRequest
from davinci_forces.toml import parse, read
from davinci_forces.toml.lines import lines_of

NAMES = st.sampled_from(
    ["a", "b_1", "-", "7", "1.5", "a b", "[x]", "q = 1", "#", "'", '"', "\\", "", "é", "a\nb", "]]"]
)
SCALARS = st.sampled_from(
    ["1", "-2.5e3", "inf", "true", "0x1F", "1979-05-27 07:32:00.5", "1979-05-27T07:32:00Z", "07:32:00", '"[a] # = {"',
     "'\\'", '"\\""', '"""\n[a]\na = 1 # """', '"""a\\""" ""\n"""""', "'''\n[[a]]\n'' = ]'''''", '""""""', "''", '""']
)  # fmt: skip
NESTED = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAMES, inner, max_size=3),
    max_leaves=5,
)
DOCUMENTS = st.dictionaries(
    NAMES, NESTED | st.lists(st.dictionaries(NAMES, NESTED, max_size=3), max_size=3), max_size=4
)


class Writer:
    """Writes nested tables as TOML in one of many ways, and keeps the line that it puts each key on."""

    def __init__(self, draw) -> None:
        self.draw, self.text, self.lines = draw, "", {(): 1}

    def put(self, text: str, path=None) -> None:
        if path is not None:
            self.lines.setdefault(path, self.text.count("\n") + 1)
        self.text += text

    def choose(self, *choices):
        return self.draw(st.sampled_from(choices))

    def key(self, name: str) -> str:
        quoted = [json.dumps(name, ensure_ascii=False)]
        if re.fullmatch(r"[A-Za-z0-9_-]+", name):
            quoted.append(name)
        if "'" not in name and "\n" not in name:
            quoted.append(f"'{name}'")
        return self.choose(*quoted)

    def space(self) -> None:
        """What may stand between the elements of a list."""
        self.put(self.choose("", " ", "\n", " # ] , [[a]]\n\n", "\t"))

    def value(self, value, path) -> None:
        if isinstance(value, str):
            self.put(value)
        elif isinstance(value, list):
            self.put("[")
            for i, element in enumerate(value):
                self.space()
                self.lines[*path, i] = self.text.count("\n") + 1
                self.value(element, (*path, i))
                self.space()
                self.put("," if i < len(value) - 1 else self.choose("", ","))
            self.space()
            self.put("]")
        else:
            self.put("{")
            for i, (name, nested) in enumerate(value.items()):
                self.put(", " if i else " ")
                self.pair(name, nested, path)
            self.put(self.choose("", " ") + "}")

    def pair(self, name, value, path) -> None:
        path = (*path, name)
        self.put(self.key(name), path)
        if isinstance(value, dict) and len(value) == 1 and self.choose(True, False):
            self.put(self.choose(".", " . "))
            [(name, nested)] = value.items()
            self.pair(name, nested, path)
        else:
            self.put(self.choose("=", " = "))
            self.value(value, path)

    def table(self, table: dict, path, header: str) -> None:
        """Pairs first, and then the tables that have a header of their own."""
        later = [name for name, value in table.items() if _tables(value) and self.choose(True, False)]
        for name, value in table.items():
            if name not in later:
                self.put(self.choose("", "# [[a]] a = '''\n", "\n", "  "))
                self.pair(name, value, path)
                self.put(self.choose("\n", " # ] '''\n"))
        for name in later:
            below = f"{header}{self.choose('', ' ') if header else ''}{'.' if header else ''}{self.key(name)}"
            if isinstance(table[name], dict):
                self.headed(f"[{below}]", table[name], (*path, name), below)
            else:
                for i, nested in enumerate(table[name]):
                    self.lines.setdefault((*path, name), self.text.count("\n") + 1)
                    self.headed(f"[[{below}]]", nested, (*path, name, i), below)

    def headed(self, words: str, table: dict, path, header: str) -> None:
        self.put(words + self.choose("\n", " # x\n"), path)
        self.table(table, path, header)


def _tables(value) -> bool:
    """Whether a value may be written with headers."""
    return isinstance(value, dict) or (
        isinstance(value, list) and bool(value) and all(isinstance(x, dict) for x in value)
    )


def paths_of(value, path=()):
    yield path
    for key, nested in value.items() if isinstance(value, dict) else enumerate(value):
        if isinstance(nested, dict | list):
            yield from paths_of(nested, (*path, key))
        else:
            yield (*path, key)


@given(st.data(), DOCUMENTS)
def test_every_key_has_the_line_that_it_is_written_on(data, document):
    writer = Writer(data.draw)
    writer.table(document, (), "")
    lines = lines_of(writer.text)
    assert set(lines) == set(paths_of(tomllib.loads(writer.text)))
    assert lines == writer.lines
    written = writer.text.split("\n")
    for path, line in lines.items():
        if path and isinstance(path[-1], str):
            name = path[-1]
            assert name in written[line - 1] or json.dumps(name, ensure_ascii=False)[1:-1] in written[line - 1]


def test_a_table_has_the_line_of_its_own_header_wherever_it_is_first_mentioned():
    text = "a.b.c = 1\n[t.u]\nx = 1\n[t]\ny = 2\n[[l]]\n[l.m]\n[[l]]\n[[l.n]]\n[[l.n]]\n"
    lines = lines_of(text)
    assert (lines["a",], lines["a", "b"], lines["t",], lines["t", "u"]) == (1, 1, 4, 2)
    assert [lines["l",], lines["l", 0], lines["l", 0, "m"], lines["l", 1], lines["l", 1, "n"]] == [6, 6, 7, 8, 9]
    assert (lines["l", 1, "n", 0], lines["l", 1, "n", 1]) == (9, 10)


def table(text: str):
    return parse(text, "x.toml", BadRequest)


def test_each_accessor_gives_what_the_file_says():
    made = table('n = 3\nw = 4\nt = "a"\nf = true\nl = [1, 2]\np = [[1, 2]]\ns = ["a"]\n[t1]\nx = 1\n[[t2]]\nx = 2')
    assert (made.number("n"), made.whole("w"), made.text("t"), made.flag("f")) == (3.0, 4, "a", True)
    assert (made.numbers("l"), made.pairs("p", "pairs")) == ((1.0, 2.0), ((1.0, 2.0),))
    assert made.texts("s", None, "ab") == ("a",)
    assert (made.table("t1").number("x"), made.tables("t2")[0].number("x")) == (1.0, 2.0)
    made.close()
    assert made.file.problems() == []


@pytest.mark.parametrize(
    ("text", "ask", "says"),
    [
        ("n = 'x'", lambda t: t.number("n"), "1: n must be a number, not 'x'"),
        ("n = true", lambda t: t.number("n"), "1: n must be a number, not True"),
        (f"n = 1{'0' * 400}", lambda t: t.number("n"), f"1: n must be a number, not 1{'0' * 75} ..."),
        (f"n = 0x1{'0' * 5000}", lambda t: t.number("n"), "1: n must be a number, not a number of thousands of digits"),
        ("\nn = nan", lambda t: t.number("n"), "2: n must be finite, not nan"),
        ("n = -1", lambda t: t.number("n", low=0), "1: n must be finite and at least 0, not -1"),
        ("n = 0", lambda t: t.number("n", above=0), "1: n must be finite and greater than 0, not 0"),
        ("", lambda t: t.number("n"), "1: n is missing; it is a number"),
        ("n = -1", lambda t: t.whole("n"), "1: n must be at least 0, not -1"),
        ("n = 1.0", lambda t: t.whole("n"), "1: n must be a whole number, not 1.0"),
        ("n = 'c'", lambda t: t.text("n", choices=("a", "b")), "1: n must be one of a, b, not 'c'"),
        ("n = 1", lambda t: t.flag("n"), "1: n must be true or false, not 1"),
        ("n = [1, nan]", lambda t: t.numbers("n"), "1: n must be a list of finite numbers, not [1, nan]"),
        ("n = [1]", lambda t: t.numbers("n", count=2), "1: n must be a list of 2 finite numbers, not [1]"),
        ("n = [[1]]", lambda t: t.pairs("n", "pairs"), "1: n must be pairs, not [[1]]"),
        ("n = [[1, 2]]", lambda t: t.pairs("n", "two pairs", least=2), "1: n must be two pairs, not [[1, 2]]"),
        ("n = [['a']]", lambda t: t.texts("n", None, "ab"), "1: n must be a list of 'a', 'b', not [['a']]"),
        ("n = []", lambda t: t.texts("n", None, "ab"), "1: n must be a list of 'a', 'b', not []"),
        ("n = 1", lambda t: t.table("n"), "1: n: must be a table, not 1"),
        ("n = [1]", lambda t: t.tables("n"), "1: n must be a list of tables: write [[n]], not [1]"),
        ("n = []", lambda t: t.tables("n", "it has no [[n]]"), "1: it has no [[n]]"),
        ("[[n]]\n\n[[n]]\nx = 1", lambda t: t.tables("n")[1].text("x"), "4: n 2: x must be text, not 1"),
        ("n = 1\nlenght = 2", lambda t: (t.number("n"), "length" in t, t.close()),
         "2: unknown key 'lenght'; known keys are n, length; did you mean 'length'?"),
        ("[a.b]\nx = 1", lambda t: t.table("a").table("b").close(), "2: a.b: unknown key 'x'; known keys are none"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_value_is_said_with_its_line(text, ask, says):
    made = table(text)
    ask(made)
    assert made.file.problems() == [f"x.toml:{says}"]


def test_problems_come_in_the_order_of_the_file():
    made = table("a = 1\nb = 2\n" + "\n" * 10 + "c = 3")
    for key in ("c", "b", "a"):
        made.problem(key, key)
    made.problem("of b as well", "b", "missing")
    with pytest.raises(BadRequest) as caught:
        made.file.refuse(BadRequest)
    assert str(caught.value).splitlines() == ["x.toml:1: a", "x.toml:2: b", "x.toml:2: of b as well", "x.toml:13: c"]


def test_a_missing_number_is_no_number():
    assert math.isnan(table("").number("x"))


@pytest.mark.parametrize("text", [b"\xff", b"a =", b"a = " + b"[" * 5000 + b"]" * 5000, b"a = 1" + b"0" * 5000])
def test_a_file_that_is_not_toml_is_named(tmp_path, text):
    (tmp_path / "x.toml").write_bytes(text)
    with pytest.raises(BadRequest, match=r"x\.toml:(1:)? "):
        read(tmp_path / "x.toml", BadRequest)


def test_lines_are_counted_alike_whatever_ends_them(tmp_path):
    (tmp_path / "x.toml").write_bytes('\ufeffa = 1\r\nb = """\r\nc = 1\r\n"""\r\nd = "\u2028"\r\ne = 1'.encode())
    assert read(tmp_path / "x.toml", BadRequest).file.lines == {(): 1, ("a",): 1, ("b",): 2, ("d",): 5, ("e",): 6}
