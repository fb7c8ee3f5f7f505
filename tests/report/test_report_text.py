"""Inline marks, references and numbering."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from report_documents import HOSTILE

from davinci_forces.report.content import Document, Equation, Number, Prose, Section, Table, in_format, literal
from davinci_forces.report.content.inline import Span, message, parse, printable
from davinci_forces.report.content.layout import columns, number_blocks, references

anything = st.text(st.one_of(st.sampled_from("\\$`*[]@a "), st.characters()))


@given(anything)
def test_literal_text_is_one_span_of_text_and_comes_back_unchanged(text: str) -> None:
    assert "".join(span.text for span in parse(literal(text))) == printable(text)
    assert {span.kind for span in parse(literal(text))} <= {"text"}


@given(anything.filter(bool))
def test_literal_text_inside_code_and_bold_stays_inside(text: str) -> None:
    for kind, mark in (("code", "`"), ("bold", "**")):
        assert parse(f"{mark}{literal(text)}{mark}") == (Span(kind, printable(text)),)


def test_a_message_has_its_code_marked_up_and_all_else_as_it_is() -> None:
    spans = parse(message("run-1 of a[*b*]: -0.0672 to -.5 rad; set `sign = -1` by `$ x`"))
    assert spans == (
        Span("text", "run-1 of a[*b*]: −0.0672 to −.5 rad; set "),
        Span("code", "sign = -1"),
        Span("text", " by "),
        Span("code", "$ x"),
    )
    assert parse(message("a`b is -1")) == (Span("text", "a`b is -1"),)  # the name of a channel


@given(anything)
def test_a_message_loses_no_letter(text: str) -> None:
    def bare(x: str) -> str:
        return x.replace("`", "").replace("−", "-")

    assert bare("".join(span.text for span in parse(message(text)))) == bare(printable(text))


@pytest.mark.parametrize(
    ("value", "form", "shown"),
    [(-2.54, ".1f", "−2.5"), (-0.04, ".1f", "0.0"), (0.04, "+.1f", "0.0"), (2.0, "+.1f", "+2.0"), (-3, "d", "−3"),
     (float("nan"), ".1f", "–"), (-1e-9, "g", "−1e−09")],
)  # fmt: skip
def test_a_number_has_a_true_minus_and_a_printed_zero_no_sign(value: float, form: str, shown: str) -> None:
    assert in_format(value, form) == shown


def test_marks_are_read_and_a_mark_without_its_partner_is_text() -> None:
    spans = parse("a $x_1$ `c` **b** [@fig-1] 5\\$ and ` and [@Wrong]")
    assert spans == (
        Span("text", "a "),
        Span("maths", "x_1"),
        Span("text", " "),
        Span("code", "c"),
        Span("text", " "),
        Span("bold", "b"),
        Span("text", " "),
        Span("reference", "fig-1"),
        Span("text", " 5$ and ` and [@Wrong]"),
    )


def test_sections_equations_figures_and_tables_are_numbered_in_reading_order(full: Document) -> None:
    assert references(number_blocks(full)) == {
        "first": "Section 1",
        "method": "Section 1.1",
        "second": "Section 2",
        "parameters": "Table 1",
        "still": "Figure 1",
        "zoom": "Figure 3",
        "update": "Eq. (1)",
        "folded": f"“Folded {printable(HOSTILE)}”",
        "folded-zoom": "Figure S1",
    }


def test_a_reference_that_leads_nowhere_is_named() -> None:
    with pytest.raises(ValueError, match="nowhere"):
        number_blocks(Document("T", "s", False, (Section("A", "a", (Prose("[@a] and [@nowhere]"),)),)))


def test_two_blocks_of_one_label_are_refused() -> None:
    equation = Equation("x", "x", "same")
    with pytest.raises(ValueError, match="same"):
        Document("T", "s", False, (Section("A", "a", (equation, equation)),))


def test_a_table_whose_rows_do_not_fit_its_header_is_refused() -> None:
    with pytest.raises(ValueError, match="2 columns"):
        Table("T", ("a", "b"), (("1",),))


def test_a_unit_that_a_column_shares_moves_to_its_header_and_others_stay() -> None:
    table = Table("T", ("name", "a", "b"), (("x", Number(1, "N m"), Number(1, "N")), ("y", "–", Number(2, "m"))))
    name, a, b = columns(table)
    assert [parse(column.head)[0].text for column in (name, a, b)] == ["name", "a [N\N{NO-BREAK SPACE}m]", "b"]
    assert [cell.text for cell in a.cells] == ["1.000", "–"]
    assert [cell.text for cell in b.cells] == ["1.000 N", "2.000 m"]
    assert [column.align for column in (name, a, b)] == ["l", "r", "r"]
