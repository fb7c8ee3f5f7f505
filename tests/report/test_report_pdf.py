"""The PDF: text is text, figures are lines, nothing leaves the page; as poppler reads it, where it is installed."""

import random
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest

from davinci_forces.report.content import Document, Equation, Number, Prose, Section, Table
from davinci_forces.report.content.layout import number_blocks, references
from davinci_forces.report.writers import pdf
from davinci_forces.report.writers.typesetting import NotTypeset, typeset

poppler = pytest.mark.skipif(shutil.which("pdftotext") is None, reason="no pdftotext on the path to read the PDF with")
MILLIMETRE = 72 / 25.4


@pytest.fixture(scope="module")
def source(full: Document) -> bytes:
    return pdf.render(full)


def read(source: bytes, *options: str) -> str:
    command = ["pdftotext", *options, "-", "-"]
    return subprocess.run(command, input=source, capture_output=True, check=True, timeout=60).stdout.decode()


def one(*blocks: object, simulated: bool = False) -> Document:
    return Document("T", "s", simulated, (Section("A", "a", blocks),))  # type: ignore[arg-type]


@poppler
def test_text_that_looks_like_markup_is_shown_as_text(source: bytes) -> None:
    text = re.sub(r"\s+", " ", read(source).replace("\N{ZERO WIDTH SPACE}", ""))
    assert text.count("<script>alert(1)</script> #set page() $x$ *b* **c**") >= 6
    assert "[@e] \\ \"q\" 'a' & é Ω" in text


def test_no_text_can_become_markup() -> None:
    template = pdf.TEMPLATE.read_text(encoding="utf-8")
    evaluated = re.findall(r"eval\(([^)]*)\)", template)
    assert evaluated == ['it, mode: "math"', 'it.typst, mode: "math"']


@poppler
def test_every_page_of_simulated_data_says_so(source: bytes) -> None:
    pages = read(source).rstrip("\f").split("\f")
    assert len(pages) > 2
    assert all("SIMULATED" in page for page in pages)
    assert "SIMULATED" not in read(pdf.render(one(Prose("text"))))


@poppler
def test_what_is_on_screen_only_is_named_and_left_out(source: bytes) -> None:
    text = re.sub(r"\s+", " ", read(source).replace("\N{ZERO WIDTH SPACE}", ""))
    assert "In the HTML report: Folded <script>" in text
    assert "Figure S1 (in the HTML report)" in text
    assert "Only here." not in text


@poppler
def test_both_files_print_the_same_numbers(source: bytes, full: Document) -> None:
    text = read(source)
    for name in ("Figure 1.", "Figure 2.", "Figure 3.", "Table 1.", "(1)", "1.1"):
        assert name in text
    for reference in references(number_blocks(full)).values():
        assert reference.split()[-1].strip(".") in text


def test_figures_are_vectors_and_fonts_travel_along(source: bytes) -> None:
    assert source.startswith(b"%PDF-1.7")
    assert b"/Subtype/Image" not in source
    assert not re.search(rb"/Subtype\s*/Image", source)
    assert len(re.findall(rb"/FontFile[23]", source)) >= 3


def test_the_same_document_gives_the_same_bytes_without_a_date(source: bytes, full: Document) -> None:
    assert pdf.render(full) == source
    assert b"CreationDate" not in source
    assert b"ModDate" not in source


@poppler
@pytest.mark.parametrize("columns", [3, 9, 16])
def test_no_table_leaves_the_page_and_a_long_one_repeats_its_header(columns: int) -> None:
    names = tuple(f"h{i}" for i in range(columns - 1))
    row = (
        "`" + "0123456789abcdef" * 4 + "`",
        *(Number(-123.456, "N m", 0.0123) for _ in range(columns - 2)),
        "a/b" * 30,
    )
    rendered = pdf.render(one(Table("Wide.", ("f0", *names), (row,) * 40)))
    edges = [float(x) for x in re.findall(r'xMax="([\d.]+)"', read(rendered, "-bbox"))]
    assert max(edges) <= (210 - 20) * MILLIMETRE + 0.5
    pages = read(rendered).rstrip("\f").split("\f")
    assert len(pages) > 1
    assert all("f0" in page for page in pages)


@poppler
def test_a_caption_stays_with_the_first_row_of_its_table() -> None:
    alone = 0
    for lines in range(24, 36):  # one of these ends where only the caption has room
        blocks = [*(Prose(f"line {k}") for k in range(lines)), Table("Word.", ("h", "i"), (("first", "2"),) * 20)]
        pages = read(pdf.render(one(*blocks))).split("\f")
        [with_caption] = [page for page in pages if "Word." in page]
        assert "first" in with_caption
        alone += f"line {lines - 1}" not in with_caption
    assert 0 < alone < 12


@poppler
@pytest.mark.slow
def test_no_cell_of_any_table_leaves_the_page() -> None:
    rng = random.Random(1)

    def words() -> str:
        return " ".join("".join(rng.choices("abcW_-/", k=rng.randint(1, 60))) for _ in range(rng.randint(1, 4)))

    sizes = [(rng.randint(1, 12), rng.randint(1, 4)) for _ in range(20)]
    tables = [
        Table(
            "T",
            tuple(words() for _ in range(columns)),
            tuple(tuple(words() for _ in range(columns)) for _ in range(rows)),
        )
        for columns, rows in sizes
    ]
    edges = [float(x) for x in re.findall(r'xMax="([\d.]+)"', read(pdf.render(one(*tables)), "-bbox"))]
    assert len(edges) > 500
    assert max(edges) <= (210 - 20) * MILLIMETRE + 0.5


@poppler
def test_letters_are_the_largest_at_which_no_line_of_a_table_breaks() -> None:
    def height(columns: int) -> float:
        row = ("realistic-validation",) * columns
        page = read(pdf.render(one(Table("T", ("h",) * columns, (row,)))), "-bbox")
        [top, bottom] = re.findall(r'yMin="([\d.]+)"[^>]*yMax="([\d.]+)">realistic-validation', page)[0]
        return float(bottom) - float(top)

    assert height(1) == pytest.approx(height(6), rel=1e-3)
    assert height(7) == pytest.approx(height(1) * 8 / 9, rel=1e-3)


@poppler
def test_a_long_word_breaks_after_a_sign_and_loses_nothing() -> None:
    word = "_".join(f"folder{i}" * 3 for i in range(12))
    lines = re.sub("\N{ZERO WIDTH SPACE}", "", read(pdf.render(one(Prose(word))))).split("\n")
    parts = [line for line in lines if line.startswith("folder")]
    assert len(parts) > 2
    assert "".join(parts) == word
    assert all(line.endswith("_") for line in parts[:-1])


@poppler
def test_a_wide_equation_and_a_long_word_stay_on_the_page() -> None:
    rendered = pdf.render(
        one(Equation(" + ".join(f"theta_{i} dot(q)_{i}" for i in range(40)), "sum"), Prose("x" * 500))
    )
    edges = [float(x) for x in re.findall(r'xMax="([\d.]+)"', read(rendered, "-bbox"))]
    assert max(edges) <= (210 - 20) * MILLIMETRE + 0.5


@poppler
def test_an_equation_stays_on_the_page_of_the_table_that_follows_it() -> None:
    table = Table("Parameters.", ("symbol", "value"), tuple((f"${x}$", Number(1)) for x in "abcdefgh"))
    pages = []
    for lines in range(20, 40):
        filling = Prose("\n\n".join(["filling"] * lines))
        read_pages = read(pdf.render(one(filling, Equation("a + b", "sum"), table))).split("\f")
        pages.append([next(i for i, page in enumerate(read_pages) if words in page) for words in ("(1)", "Table 1.")])
    assert {tuple(both) for both in pages} == {(0, 0), (1, 1)}


@poppler
def test_a_name_stays_whole_while_a_header_can_take_lines() -> None:
    names = [f"realistic-tip-contact-of-run-{i}" for i in range(4)]
    header = ("log", *(f"a long header of many words {i}" for i in range(6)))
    rows = tuple((name, *(Number(-1.25, "N m", 0.01) if name[-1] == "0" else "–" for _ in range(6))) for name in names)
    text = read(pdf.render(one(Table("Logs.", header, rows)))).replace("\N{NO-BREAK SPACE}", " ")
    assert all(name in text for name in names)
    assert text.count("−1.250 ± 0.010") == 6


@poppler
def test_no_number_breaks_where_words_have_to() -> None:
    """As on page one, if a joint has a long name and its numbers a power of ten and a unit of two letters."""
    numbers = [Number(4.38e-6 * 10**i, unit, 4.5e-7) for i, unit in enumerate(("N m", "N"))]
    cells = ("100 %", "14 %", "82 %, too narrow", "0.8016 ± 0.0052", "0.8343")
    rows = tuple(("shoulder_lift_joint", "Narrow band, at rest", *cells, number, number, number) for number in numbers)
    header = ("Joint", "Verdict", "New path", "Error", "Coverage", "R2", "Ceiling", "Model error", "Level", "Sought")
    table = Table("Trust.", header, rows, align="ll" + "r" * 8)
    text = read(pdf.render(one(table))).replace("\N{NO-BREAK SPACE}", " ")
    for words, times in ((cells[0], 2), (cells[1], 2), (cells[2], 2), (cells[3], 2), *((str(n), 3) for n in numbers)):
        assert text.count(words) == times, words


def test_the_file_says_what_it_is_of_whom_and_on_what() -> None:
    made = replace(one(Prose("text")), author="A Laboratory", keywords=("friction", "da Vinci"), edition="report ID 77")
    source = pdf.render(made)
    for words in (b"A Laboratory", b"friction", b"report ID 77"):
        assert words in source


def test_a_warning_of_typst_is_an_error(tmp_path: Path) -> None:
    template = tmp_path / "warns.typ"
    template.write_text('#text(font: "No such font")[x]')
    with pytest.raises(NotTypeset, match="no such font"):
        typeset(template, {}, "pdf")


def test_a_wrong_equation_is_an_error() -> None:
    with pytest.raises(NotTypeset, match=r"report\.typ"):
        pdf.render(one(Equation("nonsense(", "?")))


@poppler
def test_a_table_of_printed_rows_counts_the_others() -> None:
    rows = tuple((f"row-{i}", Number(float(i), "N")) for i in range(30))
    text = re.sub(r"\s+", " ", read(pdf.render(one(Table("Contacts.", ("a", "b"), rows, printed=(3, 7))))))
    assert "Contacts. 28 more in the HTML report." in text
    assert [row for row, _ in rows if re.search(rf"{row}\b", text)] == ["row-3", "row-7"]


def test_no_line_begins_with_the_unit_of_a_number():
    text, code, _, bold = pdf._inline("errs by 4 % in 2 logs and `at 5 s` **2.0 ± 0.1 N m on 3 masses**")
    assert text["text"] == "errs by 4\N{NO-BREAK SPACE}% in 2 logs and "
    assert code["text"] == "at 5 s"
    assert bold["text"] == "2.0 ± 0.1 N m on 3 masses".replace(" ", "\N{NO-BREAK SPACE}", 4)
