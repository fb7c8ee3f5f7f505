"""Every section of the report: of a study that has everything, of one that has nothing, and of any in between."""

import ast
import re
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from string import Formatter
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces import guide
from davinci_forces.filters.response import noise_model
from davinci_forces.records import (
    KINDS,
    Average,
    Choice,
    Contact,
    Diagnostic,
    Excitation,
    FilterNoise,
    Fit,
    FreeSpace,
    Identifiability,
    Load,
    LogSummary,
    Motion,
    PathShare,
    PeriodResidual,
    Prediction,
    Push,
    Record,
    Spectrum,
    Stiffness,
    Streamed,
    TipContact,
    Track,
    Weight,
)
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.records.quantities import QUANTITIES
from davinci_forces.records.record import diagnostic
from davinci_forces.report import verdicts
from davinci_forces.report.changes import Change, StatedValue
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
    name_of,
    walk,
)
from davinci_forces.report.content.inline import literal, parse
from davinci_forces.report.content.layout import TEXTS, number_blocks
from davinci_forces.report.content.marks import Line, Points, VSpan
from davinci_forces.report.context import Context, name_in_sentence, title
from davinci_forces.report.results import Result, Results, collect
from davinci_forces.report.sections import (
    DOCUMENTS,
    SECTIONS,
    excitation,
    ground_truth,
    joints,
    methods,
    noise,
    parts,
    provenance,
    runs,
    summary,
    tissue,
)
from davinci_forces.report.sections import (
    baseline as baseline_section,
)
from davinci_forces.report.sections import (
    choice as choice_section,
)
from davinci_forces.report.sections import (
    contacts as contacts_section,
)
from davinci_forces.report.sections import (
    filters as filters_section,
)
from davinci_forces.report.sections import (
    weight as weight_section,
)
from davinci_forces.report.sections.joints.details import correlations
from davinci_forces.report.sections.parts import scored_predictions, trust
from davinci_forces.report.sections.summary import caveats, opening
from davinci_forces.report.verdicts import Trust
from davinci_forces.study import Source
from davinci_forces.study.review import Rating
from tests.contracts.conftest import Lab
from tests.test_words import LONG_SENTENCE, MEDIAN_SENTENCE, median_and_90th_percentile

SECTION = pytest.mark.parametrize("name", SECTIONS)
HASHES = {"0" * 64: "raw/arm/roll.csv", "1" * 64: f"{Fit.folder()}/independent/hand_roll.parquet"}
RAW, PROCESSED = ({place: sha} for sha, place in HASHES.items())
PROVENANCE = Provenance("lab", "1", {"numpy": "2"}, RAW, PROCESSED, {"fit": "no joint moves"})


RATINGS = (
    Rating("figure", "answer-figure", "doubt", "look <again>", "R", "2026-01-02", "0" * 64),
    Rating("run", "push", "accept", "", "", "", "0" * 64),
)


def context(lab: Lab, catalogue: Catalogue) -> Context:
    results = collect(catalogue)
    labels = frozenset({"answer-figure"})
    return Context(catalogue, lab.study, results, PROVENANCE, RATINGS, labels, baseline(results))


def baseline(results: Results) -> dict[str, StatedValue]:
    """The same numbers, of which one was another, one is gone and one is new."""
    earlier = {key: StatedValue(result.value, result.std, result.unit) for key, result in results.items()}
    for key in [*earlier][-1:]:
        del earlier[key]
    for key in [*earlier][:1]:
        earlier[key] = replace(earlier[key], value=results[key].value + 1.0)
    return earlier | {"gone": StatedValue(1.0)}


def without(catalogue: Catalogue, *kinds: type) -> Catalogue:
    return Catalogue(lambda kind: [] if kind in kinds else catalogue.records(kind))


def written(name: str, about: Context) -> Section | None:
    if name == "thesis":  # a section of the thesis's simulations alone
        about = replace(about, study=replace(about.study, truth={"scenario": "davinci-thesis"}))
    return import_module(f"davinci_forces.report.sections.{name}").section(about)


@pytest.fixture(scope="module")
def full(lab: Lab, catalogue: Catalogue) -> Context:
    return context(lab, catalogue)


@pytest.fixture(scope="module")
def faulty(faulty_lab: Lab, faulty_catalogue: Catalogue) -> Context:
    return context(faulty_lab, faulty_catalogue)


@SECTION
def test_a_study_that_has_everything_has_the_section(name: str, full: Context):
    section = written(name, full)
    assert isinstance(section, Section)
    assert section.title
    names = [label for block in walk(section) if (label := name_of(block))]
    assert len(set(names)) == len(names)


def test_every_explanation_is_used_with_the_values_of_its_braces():
    given = {}
    for source in Path(parts.__file__).parents[1].rglob("*.py"):
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func).removeprefix("parts.") == "explanation":
                given[ast.literal_eval(node.args[0])] = {value.arg for value in node.keywords}
    texts = parts.chapters("explanations.md")
    braces = {name: [field for _, field, *_ in Formatter().parse(text) if field] for name, text in texts.items()}
    assert given == {name: {field.partition(".")[0] for field in fields} for name, fields in braces.items()}


@SECTION
def test_figures_and_equations_are_told_in_other_words_to_those_who_do_not_see_them(name: str, full: Context):
    for block in walk(written(name, full)):
        if isinstance(block, Figure | Figure3D):
            assert block.alt.strip()
            assert block.caption.strip()
            assert block.alt != block.caption
        if isinstance(block, Equation):
            assert block.alt.strip()
            assert block.alt != block.typst


@SECTION
def test_no_text_shows_a_backtick_or_a_hyphen_for_a_minus(name: str, full: Context, faulty: Context):
    studies = (replace(about, study=replace(about.study, baseline="before")) for about in (full, faulty))
    for section in filter(None, (written(name, about) for about in studies)):
        texts = [text for block in walk(section) for text in TEXTS[type(block)](block)]
        spans = [span.text for text in texts for span in parse(text) if span.kind in ("text", "bold")]
        assert [text for text in spans if "`" in text or re.search(r"(?<![\w.-])-\.?\d", text)] == []


@SECTION
def test_what_is_called_a_relative_error_is_without_noise(name: str, full: Context):
    tables = [block for block in walk(section) if isinstance(block, Table)] if (section := written(name, full)) else []
    for table in tables:
        for head, *cells in zip(table.header, *table.rows, strict=True):
            keys = [cell.key or "" for cell in cells if isinstance(cell, Number)]
            of_residuals = [key for key in keys if key.startswith(("predict.", "cv.")) and "relative_error" in key]
            assert head == "Relative residual" if of_residuals else head != "Relative residual"


@SECTION
def test_every_number_of_a_table_is_the_result_of_its_key(name: str, full: Context):
    tables = [block for block in walk(written(name, full)) if isinstance(block, Table)]
    for number in [cell for table in tables for row in table.rows for cell in row if isinstance(cell, Number)]:
        assert number.key in full.results
        assert number.value == full.results[number.key].value


@SECTION
def test_a_study_without_records_has_no_section_or_one_that_says_so(name: str, lab: Lab, catalogue: Catalogue):
    nothing = replace(context(lab, without(catalogue, *KINDS.values())), labels=frozenset())  # so no figure, either
    section = written(name, nothing)
    if section is not None:
        number_blocks(Document("A test", "arm", True, (section,)))


def asking_for_all(name: str) -> Callable[..., Any]:
    """A method of results that notes that it was asked for all of them."""

    def method(self, *arguments: Any) -> Any:
        self.asked.add(None)
        return getattr(Results, name)(self, *arguments)

    return method


class Watched(Results):
    """Results that note which of them are asked for, by key; `None` stands for all."""

    def __init__(self, results: Results) -> None:
        super().__init__(results)
        self.asked: set[str | None] = set()

    def __getitem__(self, key: str) -> Result:
        self.asked.add(key)
        return super().__getitem__(key)

    def __contains__(self, key: object) -> bool:
        self.asked.add(str(key))
        return super().__contains__(key)

    def get(self, key: str, default: Any = None) -> Any:
        self.asked.add(key)
        return super().get(key, default)

    __iter__, __len__, keys, values, items, json, copy = map(
        asking_for_all, ("__iter__", "__len__", "keys", "values", "items", "json", "copy")
    )


class Unread(NamedTuple):
    """A section of the whole study, and the kinds of record that it did not ask for: without these it is the same."""

    section: Section | None
    kinds: set[type[Record]]


@pytest.fixture(scope="module")
def unread(lab: Lab, catalogue: Catalogue) -> dict[str, Unread]:
    """The sections by their names, written in the order of their documents."""
    publish: dict[str, set[type[Record]]] = {}
    for kind in KINDS.values():
        for number in [number for record in catalogue.records(kind) for number in record.published()]:
            publish.setdefault(number.key, set()).add(kind)
    asked: set[type[Record]] = set()
    watching = Catalogue(catalogue.records)
    whole = replace(context(lab, catalogue), labels=frozenset())
    results = Watched(whole.results)
    whole = replace(whole, catalogue=watching, results=results)
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(watching, "records", lambda kind: asked.add(kind) or catalogue.records(kind))
        for name in [name for _, names in DOCUMENTS.values() for name in names]:
            asked.clear()
            results.asked.clear()
            section = written(name, whole)
            kinds = asked.union(*(publish.get(key, set()) for key in results.asked))
            everything = None in results.asked or name == "ground_truth"  # which adds results, that others may show
            found[name] = Unread(section, set() if everything else {*KINDS.values()} - kinds)
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_a_kind_of_record_that_is_missing_costs_no_section(
    kind: str, lab: Lab, catalogue: Catalogue, unread: dict[str, Unread]
):
    """As it is when its stage failed, or has not run; what is left refers to nothing that is not there."""
    poorer = replace(context(lab, without(catalogue, KINDS[kind])), labels=frozenset())  # so no rated figure, either
    for _, names in DOCUMENTS.values():
        sections = (u.section if KINDS[kind] in (u := unread[n]).kinds else written(n, poorer) for n in names)
        number_blocks(Document("A test", "arm", True, tuple(filter(None, sections))))


def test_the_sections_together_are_a_document_whose_labels_differ_and_whose_references_lead_somewhere(full: Context):
    for _, names in DOCUMENTS.values():
        sections = tuple(section for name in names if (section := written(name, full)))
        assert len(number_blocks(Document("A test", "arm", True, sections))) == len(names)


@pytest.mark.parametrize("name", [name for name in SECTIONS if name != "thesis"])
def test_nothing_but_the_references_names_the_thesis_in_a_user_s_study(name: str, full: Context):
    """The ground truth of the thesis's simulations names their scenario."""
    section = written(name, full)
    assert section is not None
    shown = [block for block in walk(section) if not isinstance(block, Listing | Bullets | Section)]
    assert not full.compares_with_thesis
    assert not re.search(r"457\.24|\bthesis\b|Fig 8\.9", " ".join(map(repr, shown)))


@pytest.mark.parametrize(("true", "level"), [(1000.5, "good"), (1500.0, "info")])
def test_a_precise_stiffness_that_misses_the_truth_is_not_called_good(full: Context, true: float, level: str):
    [*_, measured] = full.catalogue.records(Stiffness)
    precise = replace(measured, stiffness=1000.0, stiffness_std=1.0, pushes=5)
    study = replace(full.study, truth={"log": [{"name": measured.log, "stiffness": true}]})
    assert tissue.verdict(replace(full, study=study), precise).level == level


def test_each_effect_that_a_simulation_put_in_has_its_term_with_its_value_or_none(full: Context):
    parameters = ("viscous", "coulomb_up", "coulomb_down", "static_up", "static_down", "stribeck_velocity",
                  "bristle_stiffness", "bristle_damping")  # fmt: skip
    friction = {"lab": {"hand_roll": dict.fromkeys(parameters, 0.25)}, "another": {"hand_roll": {}}}
    logs = [{"name": log, "family": "lab"} for fit in full.own_fits() for log in fit.logs]
    study = replace(full.study, truth={"friction": friction, "log": logs})
    [table] = [block for block in ground_truth.section(replace(full, study=study)).blocks if isinstance(block, Table)]
    rows = {(row[1], row[3]): row[4] for row in table.rows}
    estimate = rows["viscous friction", "viscous friction"]
    names = ground_truth.used_parameters(full, "hand_roll")
    assert estimate == full.results[names["viscous friction"]].number(3)
    assert {effect for effect, _ in rows} >= {effect for effect, _, _ in ground_truth.EFFECTS}
    for effect, _, terms in ground_truth.EFFECTS:
        taken = any(re.match(terms, name) for name in names)
        assert taken != (rows.get((effect, terms.replace("|", ", "))) == "not in the model")
    assert rows["windings, limits of current and voltage", ground_truth.WITHOUT_TERM] == "–"


def test_logs_are_not_called_good_above_the_remarks_of_a_stage(full: Context, catalogue: Catalogue):
    def verdicts(about: Context) -> list[tuple[str, str]]:
        return [(v.level, v.text) for v in runs.recording_blocks(about, summaries) if isinstance(v, Verdict)]

    [summary, *_] = full.catalogue.records(LogSummary)
    summaries = [replace(summary, warnings=(), dropped=0, duplicates=0, jitter=0.0)]
    [(level, text)] = verdicts(replace(full, catalogue=without(catalogue, Diagnostic)))
    assert (level, text) == ("good", "Every log was read without a remark.")
    remark = diagnostic("average", f"{summary.log}.roll", "warning", "a transient was left out")
    with_remark = Catalogue(lambda kind: [remark] if kind is Diagnostic else catalogue.records(kind))
    assert not verdicts(replace(full, catalogue=with_remark))  # none was read without one
    summaries.append(replace(summaries[0], log="another"))
    assert verdicts(replace(full, catalogue=with_remark)) == [("info", "1 of 2 logs were read without a remark.")]


def test_of_remarks_that_differ_in_log_and_numbers_paper_has_the_first(full: Context, catalogue: Catalogue):
    texts = [f"log_{i}/hand_roll: it stands still from {i}.00 to 9.00 s" for i in range(3)]
    remarks = [diagnostic("resample", f"log_{i}.hand_roll", "note", text) for i, text in enumerate(texts)]
    records = Catalogue(lambda kind: remarks if kind is Diagnostic else catalogue.records(kind))
    blocks = [*runs.recording_blocks(replace(full, catalogue=records), full.catalogue.records(LogSummary))]
    printed = [item for block in blocks if isinstance(block, Bullets) for item in block.items if "stands" in item]
    assert printed == [f"{texts[0]} (2 more remarks of this kind)"]
    [hidden] = [block.blocks for block in blocks if isinstance(block, OnScreen) and block.anchor == "all-remarks"]
    assert [len(items.items) for items in hidden if isinstance(items, Bullets)] == [3]


def test_the_code_in_a_remark_is_marked_up(full: Context):
    text = "push/hand_roll: positions from -0.1 to 1 rad; correct `limits`, by which `excite` designs"
    remark = diagnostic("resample", "push.hand_roll", "warning", text)
    records = Catalogue(lambda kind: [remark] if kind is Diagnostic else full.catalogue.records(kind))
    about = replace(full, catalogue=records)
    blocks = [*runs.recording_blocks(about, full.catalogue.records(LogSummary))]
    shown = [item for block in blocks if isinstance(block, Bullets) for item in block.items]
    for item in (shown[-1], *[look for _, look in caveats.looks_at(about, []) if "excite" in look]):
        assert [span.text for span in parse(item) if span.kind == "code"] == ["limits", "excite"]
        assert "from −0.1 to 1 rad" in item


def test_why_logs_have_no_force_at_the_tip_is_stated_also_where_no_log_has_one(full: Context, catalogue: Catalogue):
    remark = diagnostic("resolve", "push", "note", "push: no force at the tip: it has 4 joints")
    records = Catalogue(lambda kind: [remark] if kind is Diagnostic else catalogue.records(kind))
    blocks = [*runs.recording_blocks(replace(full, catalogue=records), full.catalogue.records(LogSummary))]
    stated = [block.blocks for block in blocks if isinstance(block, OnScreen) and block.anchor == "tip-left-out"]
    assert [items.items for [items] in stated if isinstance(items, Bullets)] == [(remark.text[0],)]


def test_a_mass_that_six_estimators_make_slightly_negative_is_remarked_once_and_calls_for_no_caution(full: Context):
    def fits(std: float) -> list[Fit]:
        fit = full.own_fits()[0]
        values = {"theta": np.full(len(fit), 0.5), "theta_std": np.full(len(fit), std), "positive": np.ones(len(fit))}
        values["theta"][0] = -0.0045
        return [replace(fit, estimator=name, **values) for name in ("lse", "wlse", "tls", "huber", "prior", "iv")]

    joint = full.own_fits()[0].group
    [verdict] = joints.implausible(fits(0.02), joint)
    assert (verdict.level, "cannot be distinguished from zero" in verdict.text) == ("info", True)
    [verdict] = joints.implausible(fits(0.001), joint)
    assert (verdict.level, "physically impossible" in verdict.text) == ("warn", True)


def test_the_report_is_about_the_fit_that_the_study_names_as_the_filter_uses_it(full: Context):
    joint = full.own_fits()[0].group
    for name in ("chosen.ridge", "independent.wlse"):
        settings = replace(full.study.settings, fit=name)
        context = replace(full, study=replace(full.study, settings=settings))
        assert context.used_fit(joint) == name
        assert context.predicting_fits(joint)[0] == name
        used = context.used_record(joint)
        assert (used is None) == (name == "independent.wlse")
        if used:
            assert (used.model, used.estimator) == ("chosen", "ridge")


def test_the_guide_explains_each_column_of_the_table_on_page_one(full: Context):
    table = summary.trust_table(full, [replace(trust, sought=0.5) for trust in trusts(full, hand_roll=0.05)])
    for head in table.header:
        assert guide.page(head.strip("$")).topic == "terms"


def trusts(full: Context, **shares: float) -> list[Trust]:
    """The trust in joints whose models err by these shares of the effort, on a path that no fit had seen."""
    p, space = full.catalogue.records(Prediction)[0], full.catalogue.records(FreeSpace)[0]
    return [
        Trust(
            joint, replace(p, role="validation", path="another path", model_error=share, effort_rms=1.0),
            replace(space, coverage=0.95, detection_level=0.07), None,
        )
        for joint, share in shares.items()
    ]  # fmt: skip


def test_the_verdict_on_a_study_is_a_sentence_by_the_rules_of_the_table(full: Context):
    said = opening.verdict_sentence(full, trusts(full, hand_roll=0.05, hand_pitch=0.16, instrument_slide=0.3))
    level, other = (full.number(f"threshold.{j}.alarm_level", 2, std=None) for j in ("hand_roll", "hand_pitch"))
    assert said == (
        f"The smallest effort that stands out from free motion (alarm level) is {level} on the hand roll and {other} "
        "on the hand pitch; on an unseen path the model errs by 16 % on the hand pitch, so judge its efforts with "
        "caution; on an unseen path the model errs by 30 % on the instrument slide, too much to be believed; in free "
        "motion the 95 % band of each joint is wide enough."
    )
    [narrow] = trusts(full, hand_roll=0.05)
    narrow = replace(narrow, space=replace(narrow.space, coverage=0.8))
    said = opening.verdict_sentence(full, [narrow])
    where = f"(alarm level) is {level} on the hand roll (whose 95 % band is too narrow)"
    assert said == f"The smallest effort that stands out from free motion {where}."
    [wide] = trusts(full, hand_roll=0.05)
    for std, words in ((0.02, "is too wide on the hand roll, and too narrow on none."), (0.03, "is wide enough.")):
        wide = replace(wide, space=replace(wide.space, coverage=0.995, coverage_std=std))  # 0.045 above 0.95
        assert opening.verdict_sentence(full, [wide]).endswith(words.replace("is wide", "of each joint is wide"))
    [same] = trusts(full, hand_roll=0.16)
    same = replace(same, prediction=replace(same.prediction, path="same path"))
    assert "on the fitted path the model errs by 16 % on the hand roll, and another path was not tested" in (
        opening.verdict_sentence(full, [same])
    )


def test_page_one_says_why_there_is_no_force_at_the_tip(full: Context):
    """Of the small arm in amperes, and of one with more joints than carry a tip."""
    assert any("force by the arm at its tip up to" in line for line in opening.forces_at_tip(full))
    robot = full.study.robot
    in_amperes = replace(robot, joints=tuple(replace(joint, effort="A") for joint in robot.joints))
    four = replace(robot, joints=(*robot.joints, robot.joints[0]))
    for arm, why in ((robot, None), (in_amperes, "the torque constants of all joints"), (four, "and this one has 4")):
        without = replace(full, study=replace(full.study, robot=arm), catalogue=Catalogue(lambda kind: []))
        said = [*opening.forces_at_tip(without)]
        assert len(said) == (why is not None)
        assert why is None or why in said[0]


def test_what_study_toml_is_warned_of_is_looked_at_first_where_it_spoils_all_efforts(full: Context):
    geared = "study.toml:7: 1 A of hand_roll counts as 426 N m: its torque_constant is 9.7 times the robot's"
    old = "study.toml:9: the setting 'derivative' no longer has an effect; remove it"
    context = replace(full, study=replace(full.study, remarks=(old, geared)))
    weights = {text: weight for weight, text in caveats.looks_at(context, []) if "study.toml" in text}
    assert sorted(weights.values()) == [caveats.WARNING, caveats.FIRST_OF_ALL]
    assert weights[next(text for text in weights if "counts as" in text)] == caveats.FIRST_OF_ALL
    listed = [block.items for block in walk(written("runs", context)) if isinstance(block, Bullets)]
    assert any("1 A of hand_roll counts as 426 N m" in text for items in listed for text in items)


def test_the_scale_of_each_friction_is_stated_with_its_unit(full: Context):
    fit = full.own_fits()[0]
    names, scale = fit.parameter.copy(), np.zeros(len(fit))
    assert joints.scales(full, fit.group, replace(fit, scale=scale)) == ""
    names[:2], scale[:2] = ("smooth friction", "presliding friction 1"), (0.03, 0.002)
    said = joints.scales(full, fit.group, replace(fit, parameter=names, scale=scale))
    assert (
        said
        == " Friction reverses or decays within 0.0300 rad/s (smooth friction), 0.00200 rad (presliding friction 1)."
    )


@pytest.mark.parametrize(("sought", "said"), [(0.1, "hides efforts of"), (0.4, "is more than a third of"), (5.0, "")])
def test_a_detection_level_is_a_caveat_where_it_comes_near_the_effort_sought(full: Context, sought, said):
    space = replace(full.catalogue.records(FreeSpace)[0], detection_level=0.2, coverage=0.95)
    looks = [*caveats.looks_at_band(full, Trust("hand_roll", None, space, sought))]
    assert len(looks) == bool(said)
    assert all(said in text for _, text in looks)
    assert_allclose([weight for weight, _ in looks], 0.2 / sought / verdicts.DETECTED)  # 1 where caution begins


@pytest.mark.parametrize(
    ("share", "said"),
    [(0.1038, "10.4 % of the effort"), (0.10003, "10.003 % of the effort"), (0.16, "16 % of the effort")],
)
def test_an_error_just_above_that_of_a_good_model_is_not_rounded_to_it(full: Context, share, said):
    p = next(p for p in full.catalogue.records(Prediction) if f"{p.prefix}.model_error" in full.results)
    about = replace(p, model_error=share, mean_error=0.0, effort_rms=1.0)
    [(_, text)] = caveats.looks_at_model(full, Trust("hand_roll", about, None, None))
    assert said in text
    assert "that of a good model is at most 10 %" in text


def test_an_error_that_is_mostly_constant_is_named_with_what_is_left_without_it(full: Context):
    p = next(p for p in full.catalogue.records(Prediction) if f"{p.prefix}.mean_error" in full.results)
    p = replace(p, model_error=0.5, mean_error=0.4, mean_error_std=0.01, effort_rms=1.0)
    [(_, text)] = caveats.looks_at_model(full, Trust("hand_roll", p, None, None))
    assert f"; {full.size(p, 'model_error', 0.3, 2)} without its constant part, " in text
    assert "an offset of the day, and of no interest, state `free` in that log: levels and band" in text
    logs = [replace(log, free=((0.0, 5.0),)) if log.name == p.log else log for log in full.study.logs]
    stated = replace(full, study=replace(full.study, logs=tuple(logs)))
    assert "state `free`" not in next(caveats.looks_at_model(stated, Trust("hand_roll", p, None, None)))[1]


@pytest.mark.parametrize(("mean_error", "offered"), [(0.04, True), (0.0, False)])
def test_a_narrow_band_of_a_log_whose_error_is_mostly_constant_offers_free_windows(full: Context, mean_error, offered):
    used = scored_predictions(full, "hand_roll")[0]
    p = replace(used, model_error=0.05, mean_error=mean_error, mean_error_std=0.001, effort_rms=1.0)
    logs = Catalogue(lambda kind: [p if record is used else record for record in full.catalogue.records(kind)])
    space = replace(full.catalogue.records(FreeSpace)[0], log=p.log, detection_level=0.2, coverage=0.73)
    [(_, text)] = caveats.looks_at_narrow_bands(replace(full, catalogue=logs), [Trust("hand_roll", p, space, None)])
    assert ("an offset of the day, and of no interest, state `free` in that log" in text) == offered


def test_an_error_of_twice_the_effort_suggests_a_wrong_sign(full: Context):
    p = next(p for p in full.catalogue.records(Prediction) if f"{p.prefix}.model_error" in full.results)
    for share, suggests in ((2.04, True), (1.5, False)):
        trusted = Trust("hand_roll", replace(p, model_error=share, mean_error=0.0, effort_rms=1.0), None, None)
        [(_, text)] = caveats.looks_at_model(full, trusted)
        assert ("wrong `sign`" in text) == suggests


def test_the_reason_of_a_problem_comes_before_a_narrow_band(full: Context):
    p = next(p for p in full.catalogue.records(Prediction) if f"{p.prefix}.model_error" in full.results)
    p = replace(p, model_error=0.3, mean_error=0.0, effort_rms=1.0)
    space = replace(full.catalogue.records(FreeSpace)[0], detection_level=0.2, coverage=0.1)
    for sought, said in ((None, "the model error is"), (0.1, "the detection level of")):
        looks = sorted(caveats.looks_at(full, [Trust("hand_roll", p, space, sought)]), reverse=True)
        assert said in looks[0][1]
        assert any("the 95 % band is too narrow" in text for _, text in looks[1:])


def test_page_one_says_what_was_measured_beside_what_is_stated(full: Context):
    lines = opening.measurements(full)
    [weight, *_] = full.catalogue.records(Weight)
    assert any(f"**{weight.log}**: mass" in line and f"stated {weight.stated_mass:g} kg" in line for line in lines)
    assert len(lines) <= opening.MAX_MEASURED + 1


@pytest.mark.parametrize(("same", "words"), [(True, "● Accept**."), (False, "The numbers have changed since")])
def test_the_sign_off_shows_the_verdict_of_review_toml(full: Context, same: bool, words: str):
    now = sha256(full.results.json()).hexdigest() if same else "0" * 64
    signed = Rating("study", "", "accept", "fit <for> use", "R", "2026-01-02", now)
    text = opening.sign_off(replace(full, ratings=(signed,))).text
    assert text.startswith("Reviewed by R on 2026-01-02")
    assert words in text
    assert "____" in opening.sign_off(replace(full, ratings=())).text


def test_sentences_of_a_report_are_short(full: Context):
    texts = []
    for _, names in DOCUMENTS.values():
        for block in [block for name in names if (section := written(name, full)) for block in walk(section)]:
            texts += [block.text] if isinstance(block, Prose | Verdict) else []
            texts += block.items if isinstance(block, Bullets) else []
            texts += [block.caption] if isinstance(block, Figure | Figure3D | Table) else []
    middle, long = median_and_90th_percentile("\n\n".join(texts))
    assert middle <= MEDIAN_SENTENCE
    assert long <= LONG_SENTENCE


def test_methods_tell_of_the_stages_that_ran_and_of_no_other(lab: Lab, catalogue: Catalogue):
    def told(about: Context) -> set[str | None]:
        return {block.label for block in walk(written("methods", about)) if isinstance(block, Equation)}

    every = {"motor", "averaging", "differentiation", "estimation", "choice-error", "model", "innovation", "correction"}
    every |= {"band", "detection", "weighing", "tissue-law"}
    assert told(context(lab, catalogue)) == every
    assert told(context(lab, without(catalogue, Track))) == every - {"model", "innovation", "correction"}
    assert told(context(lab, without(catalogue, *KINDS.values()))) == set()


def paragraph(about: Context) -> str:
    return " ".join(methods.paragraph_for_paper(about).split())


def test_the_paragraph_for_a_paper_names_filter_and_smoother_the_data_and_each_joint_s_own_numbers(full: Context):
    text = paragraph(full)
    assert "an extended Kalman filter" in text
    assert "and then a fixed-interval smoother (Bierman, 1973) without delay" in text
    assert "which it exerts on its environment, were estimated from motor efforts and joint positions" in text
    fits = {joint.name: full.shown_fit(joint.name) for joint in full.study.robot.joints}
    assert not any(fit.periods for fit in fits.values())  # the chosen model is not fitted to averages
    logs = {log for fit in fits.values() for log in fit.logs}
    summaries = [s for s in full.catalogue.records(LogSummary) if s.log in logs]
    data = f"all motion in {len(summaries)} simulated logs at 50 Hz"
    assert (
        f"{data}, {sum(s.duration for s in summaries):.0f} s in all (again, pitch, roll, slide: with 5 periods of"
        in text
    )
    motions = [m for m in full.catalogue.records(Motion) if m.log in logs]
    half = [replace(m, standing=(np.arange(len(m)) < len(m) / 2).astype(np.int64)) for m in motions]
    records = lambda kind: half if kind is Motion else full.catalogue.records(kind)
    moving = sum(s.duration for s in summaries) / 2
    assert f"{data}, {moving:.0f} s in all (" in paragraph(replace(full, catalogue=Catalogue(records)))
    for joint, fit in fits.items():
        [one] = re.findall(rf"{joint.replace('_', ' ')}: (.*?)[;.] ?(?:instrument|hand|For)", text)
        assert f"({len(fit)} parameters, " in one
        assert f"low-pass of {fit.cutoff[0]:g} Hz" in one
        assert all(name.replace(",", "") in one for name in parts.of_joint(fit, joint).values())
        for name, key in (("alarm level", f"threshold.{joint}.alarm_level"), ("coverage", f"band.{joint}.coverage")):
            assert f"{name} {full.number(key, 2)}" in one
    [weight] = full.catalogue.records(Weight)
    mass = full.number(f"weight.{weight.log}.mass", 2)
    assert f"Of known masses, {weight.stated_mass:g} kg was estimated as {mass}." in text
    assert "known masses" not in paragraph(replace(full, catalogue=without(full.catalogue, Weight)))


def test_the_paragraph_counts_of_averaged_logs_whole_periods_alone(full: Context):
    three = {"period.roll.periods": replace(full.results["period.roll.periods"], value=3.0)}
    study = replace(full.study, settings=replace(full.study.settings, fit="independent.lse"))
    about = replace(full, study=study, results=Results(full.results | three))
    assert all(about.shown_fit(joint.name).periods for joint in study.robot.joints)
    text = paragraph(about)
    data = "averages over the whole periods of 4 simulated logs at 50 Hz, 36 s in all"
    assert (
        f"identified from {data} (roll: 3 periods of 2.000 s; again, pitch, slide: 5 periods of 2.000 s each)." in text
    )
    assert "low-pass of" not in text.partition("Results")[2].partition("For the errors")[0]
    assert "The model was independent.lse." in text


def test_the_paragraph_states_currents_and_counts_the_parameters_that_joints_share_once(full: Context):
    [chosen, *_] = [full.shown_fit(joint.name) for joint in full.study.robot.joints]
    names = [joint.name for joint in full.study.robot.joints]
    rows = {name: np.tile(getattr(chosen, name), len(names)) for name in chosen.columns()}
    rows["parameter"] = np.array([f"{p} of {joint}" for joint in names for p in chosen.parameter], object)
    rows["phi"] = rows["phi"].copy()
    rows["phi"][1] = "partial"
    arm = replace(chosen, group="arm", structure="coupled", cutoff=(8.0, 9.0, 10.0), **rows)
    fits = [fit for fit in full.catalogue.records(Fit) if fit.model == "independent"]
    records = Catalogue(lambda kind: [*fits, arm] if kind is Fit else full.catalogue.records(kind))
    log = replace(full.study.logs[0], channels=(Source("hand_roll.i", "current", "current"),))
    about = replace(full, catalogue=records, study=replace(full.study, logs=(log, *full.study.logs[1:])))
    text = paragraph(about)
    assert "from motor currents, assumed torque constants, motor efforts and joint positions" in text
    others = Catalogue(
        lambda kind: [f for f in fits if f.group == "hand_roll"] if kind is Fit else records.records(kind)
    )
    assert "from motor currents, assumed torque constants and joint" in paragraph(replace(about, catalogue=others))
    together = "describes hand roll, hand pitch and instrument slide together"
    assert f"One model with {len(arm)} parameters {together}." in text
    assert f"({len(arm)} parameters" not in text
    assert [cutoff for cutoff in (8, 9, 10) if f"low-pass of {cutoff} Hz" in text] == [8, 9, 10]
    two = {name: getattr(arm, name)[: 2 * len(chosen)] for name in arm.columns()}
    pair = Catalogue(lambda k: [*fits, replace(arm, cutoff=(8.0, 9.0), **two)] if k is Fit else records.records(k))
    together = "describes hand roll and hand pitch together"
    assert f"One model with {2 * len(chosen)} parameters {together}." in paragraph(replace(about, catalogue=pair))
    alone = replace(chosen, structure="coupled", phi=arm.phi[: len(chosen)])  # through links, of one joint
    fits = [alone if fit is chosen else fit for fit in full.catalogue.records(Fit)]
    records = Catalogue(lambda kind: fits if kind is Fit else full.catalogue.records(kind))
    text = paragraph(replace(full, catalogue=records))
    assert f"hand roll: coupled model by ridge ({len(chosen)} parameters, " in text
    assert "together" not in text


def test_parameters_of_links_stand_beside_what_the_description_says_and_what_they_are_sums_of(full: Context):
    chosen = full.shown_fit("hand_roll")
    phi = np.array(["partial tau"] * len(chosen), object)
    sums = np.array(["+1 mx of upper +0.4 m of fore", *[""] * (len(chosen) - 1)], object)
    described = np.array([1.25, *[np.nan] * (len(chosen) - 1)])
    of_links = replace(chosen, structure="coupled", phi=phi, combination=sums, described=described)

    def blocks(fit):
        fits = [fit if other is chosen else other for other in full.catalogue.records(Fit)]
        records = Catalogue(lambda kind: fits if kind is Fit else full.catalogue.records(kind))
        return joints.link_parameters(replace(full, catalogue=records), ["hand_roll"])

    table, folded = blocks(of_links)
    assert table.header[-1] == "Described"
    assert [row[-1] for row in table.rows] == ["1.25"] + ["–"] * (len(chosen) - 1)
    assert "description" in table.caption
    [of_sums] = folded.blocks
    assert of_sums.rows == ((str(chosen.parameter[0]), "+1 mx of upper +0.4 m of fore"),)
    unknown, _ = blocks(replace(of_links, described=described * np.nan))
    assert unknown.header[-1] == "$z$"


def test_a_wrong_unit_is_the_first_to_look_at(lab: Lab, catalogue: Catalogue):
    wrong = diagnostic("resample", "push.hand_roll", "warning", "the logged velocity is twice its derivative")
    said = Catalogue(lambda kind: [*catalogue.records(kind), *([wrong] if kind is Diagnostic else [])])
    about = context(lab, said)
    [first, *_] = caveats.first_looks_in_order(about, [parts.trust(about, "hand_roll")])
    assert first == "the logged velocity is twice its derivative"


def test_remarks_that_differ_in_their_log_and_their_numbers_alone_take_one_place_on_page_one(
    lab: Lab, catalogue: Catalogue
):
    texts = [f"log_{i}/hand_roll: harmonic {i} of the position is {i} % of the largest" for i in range(1, 6)]
    remarks = [diagnostic("resample", text.partition(":")[0], "warning", text) for text in texts]
    remarks.append(diagnostic("resample", "log_1", "warning", "log_1: another remark"))
    about = context(lab, Catalogue(lambda kind: [*catalogue.records(kind), *(remarks if kind is Diagnostic else [])]))
    first, second, *_ = caveats.first_looks_in_order(about, [parts.trust(about, "hand_roll")])
    assert first == "log_1/hand_roll: harmonic 1 of the position is 1 % of the largest (4 more remarks of this kind)"
    assert second == "log_1: another remark"


@pytest.mark.parametrize(("share", "place"), [(0.4, 1), (0.012, 2)])
def test_a_unit_fault_that_the_filter_finds_comes_before_harmonics_and_a_small_harmonic_after_other_warnings(
    lab: Lab, catalogue: Catalogue, share: float, place: int
):
    cut = Spectrum("push", "hand_roll", 2, np.arange(4.0), np.array([0.0, 1.0, 0.5, share]))
    remarks = {
        "differentiate": "harmonic 3 of the position",
        "choose": "another warning",
        "ekf": "the filter's innovations are 1e+03 times as large as it assumes; check the units, signs and clock",
    }
    kinds = {Spectrum: [cut], Diagnostic: [diagnostic(stage, "push", "warning", x) for stage, x in remarks.items()]}
    about = context(lab, Catalogue(lambda kind: kinds.get(kind, [])))
    looks = caveats.first_looks_in_order(about, [])
    assert looks[0] == remarks["ekf"]
    assert looks.index(remarks["differentiate"]) == place
    assert caveats.omitted_share(cut) == share
    assert caveats.omitted_share(replace(cut, harmonics=3)) == 0.0


@pytest.mark.parametrize(("value", "is_told"), [(-0.3, True), (-0.1, False), (0.3, False)])
def test_page_one_names_a_parameter_of_the_used_model_that_no_mechanism_has(full: Context, value: float, is_told: bool):
    used = full.used_record("hand_roll") or full.fit_named(full.own_fit("hand_roll"), "hand_roll")
    assert used is not None
    row = int(np.flatnonzero(used.positive)[0])
    values = {name: getattr(used, name).copy() for name in ("theta", "theta_std")}
    values["theta"][row], values["theta_std"][row] = value, 0.1
    fits = [replace(used, **values) if fit is used else fit for fit in full.catalogue.records(Fit)]
    about = replace(full, catalogue=Catalogue(lambda kind: fits if kind is Fit else full.catalogue.records(kind)))
    name = parts.of_joint(used, "hand_roll")[row]
    told = [text for _, text in caveats.looks_at_parameters(about, "hand_roll") if f"negative {name}" in text]
    assert len(told) == is_told


def test_a_negative_lifted_mass_reverses_the_direction_of_its_joint(full: Context):
    used = full.used_record("hand_roll") or full.fit_named(full.own_fit("hand_roll"), "hand_roll")
    assert used is not None
    names, theta = used.parameter.copy(), used.theta.copy()
    row = int(np.flatnonzero(used.positive)[0])
    suffix = names[row].removeprefix(parts.of_joint(used, "hand_roll")[row])
    names[row], theta[row] = f"lifted mass{suffix}", -10.0 * used.theta_std[row]
    fits = [replace(used, parameter=names, theta=theta) if fit is used else fit for fit in full.catalogue.records(Fit)]
    about = replace(full, catalogue=Catalogue(lambda kind: fits if kind is Fit else full.catalogue.records(kind)))
    [(first, text)] = caveats.looks_at_parameters(about, "hand_roll")
    assert first == caveats.FIRST
    assert "write `sign = -1` with its position, velocity and effort, all three" in text


def test_the_remedy_for_a_negative_mass_names_the_joint_that_shows_it(full: Context):
    [of, *_] = full.catalogue.records(Weight)
    shown, errors = np.array([-0.4, -0.3]), np.array([0.9, 0.1])  # the second is the more certain to be negative
    two = {name: np.repeat(getattr(of, name)[:1], 2) for name in of.columns()}
    two |= {
        "loaded": np.array(["hand_roll", "instrument_slide"], object),
        "mass_alone": shown,
        "mass_alone_std": errors,
    }
    turned = replace(of, mass=-0.1, mass_std=0.001, differing="", side="not told", **two)
    assert "the positive direction of the instrument slide is not" in weight_section.verdict(full, turned).text
    one = replace(turned, **{name: getattr(turned, name)[:1] for name in turned.columns()})
    told = ["if they agree" in weight_section.by_joint(full, each).caption for each in (turned, one)]
    assert told == [True, False]
    verdict = weight_section.verdict(full, turned)
    assert verdict.level == "warn"
    assert "the positive direction of the instrument slide is not that of the robot's chain" in verdict.text


def test_a_mass_that_is_not_stated_leads_to_other_masses_only_if_there_are_some(full: Context):
    [stated, *_] = full.catalogue.records(Weight)
    unknown = replace(stated, stated_mass=float("nan"))

    def said(*weights: Weight) -> str:
        catalogue = Catalogue(lambda kind: list(weights) if kind is Weight else full.catalogue.records(kind))
        return weight_section.verdict(replace(full, catalogue=catalogue), unknown).text

    assert said(unknown, stated).endswith(
        "none tests the scale of the efforts: [@weight-table] has scales of other masses."
    )
    assert said(unknown).endswith("none tests the scale of the efforts.")


def test_every_run_with_a_mass_has_a_table_of_its_joints_and_the_first_stands_on_paper(full: Context):
    [of, *_] = full.catalogue.records(Weight)
    weights = [replace(of, log=log) for log in (of.log, "second", "third")]
    numbers = {
        key.replace(f"weight.{of.log}.", f"weight.{weight.log}."): number
        for weight in weights for key, number in full.results.items()
    }  # fmt: skip
    catalogue = Catalogue(lambda kind: weights if kind is Weight else full.catalogue.records(kind))
    blocks = weight_section.section(replace(full, catalogue=catalogue, results=Results(numbers))).blocks
    [others] = [block for block in blocks if isinstance(block, OnScreen)]
    tables = [
        [b.label for b in part if isinstance(b, Table) and "joints" in b.label] for part in (blocks, others.blocks)
    ]
    assert tables == [[f"weight-joints-{of.log}"], ["weight-joints-second", "weight-joints-third"]]


def test_a_joint_of_one_parameter_has_no_correlation(full: Context):
    of = full.catalogue.select(Identifiability, group="hand_roll")[0]
    one = replace(of, **{name: getattr(of, name)[:1] for name in of.columns()})
    about = replace(full, catalogue=Catalogue(lambda k: [one] if k is Identifiability else full.catalogue.records(k)))
    [_, figure] = correlations(about, "hand_roll")
    assert isinstance(figure, Figure)
    assert figure.alt.endswith("the strongest is 0.00.")


def test_more_logs_are_not_the_remedy_for_a_narrow_band_of_a_wrong_model(full: Context):
    [trust] = trusts(full, hand_roll=0.05)
    assert trust.space is not None
    narrow, error = replace(trust, space=replace(trust.space, coverage=0.3)), round(100 * trust.space.coverage_std)
    [(_, text)] = caveats.looks_at_narrow_bands(full, [narrow])
    assert f"it covers only 30 ± {error} % of free-space samples. More logs of free motion" in text
    [wrong] = trusts(full, hand_roll=1.0)
    [(_, text)] = caveats.looks_at_narrow_bands(full, [replace(wrong, space=narrow.space)])
    assert f"it covers only 30 ± {error} % of free-space samples. See" in text


def test_narrow_bands_of_several_joints_are_one_caveat(full: Context):
    shares = {"hand_roll": 0.7, "hand_pitch": 0.5}
    narrow = [
        replace(t, space=replace(t.space, joint=t.joint, coverage=shares[t.joint], coverage_std=0.001))
        for t in trusts(full, hand_roll=0.05, hand_pitch=0.05)
    ]
    [(_, text)] = caveats.looks_at_narrow_bands(full, narrow)
    start = f"**Hand roll and Hand pitch, {narrow[0].space.log}**: the 95 % band is too narrow: it covers only "
    assert text.startswith(f"{start}70 % and 50 % of free-space samples.")
    about, log = without(full.catalogue, PathShare), narrow[0].space.log
    some = full.catalogue.records(PathShare)[0]
    paths = [replace(some, log=log, joint=t.joint, speed_ratio=x) for t, x in zip(narrow, (1.1, 1.4), strict=True)]
    fast = replace(full, catalogue=Catalogue(lambda kind: paths if kind is PathShare else about.records(kind)))
    [(_, text)] = caveats.looks_at_narrow_bands(fast, narrow)
    assert "faster than in any fitted log, so the model extrapolates: Hand pitch 1.4 times." in text
    narrow[1] = replace(narrow[1], space=replace(narrow[1].space, log="other"))
    [(_, text)] = caveats.looks_at_narrow_bands(full, narrow)
    assert text.startswith(f"**Hand roll in {narrow[0].space.log} and Hand pitch in other**: ")
    assert list(caveats.looks_at_narrow_bands(full, trusts(full, hand_roll=0.05))) == []


def test_page_one_states_the_level_of_a_push_that_is_held_and_the_impulse_of_a_short_one(full: Context):
    [contact] = full.catalogue.select(Contact, log="push", joint="hand_roll")
    for share, is_held in ((0.95, True), (0.75, False)):
        held = replace(contact, peak=-contact.peak, middle_mean=-share * contact.peak)
        number = full.number("contact.push.hand_roll.1.middle_mean", 3)
        assert (f" s, held at {number})" in summary.peaks_in_words(full, [held])) == is_held
    [track] = full.catalogue.select(Track, log="push", joint="hand_roll")
    short = replace(
        held, peak=-contact.peak, middle_mean=-contact.peak, duration=0 * contact.duration + 1.9 * track.smooth_rise
    )
    number = full.number("contact.push.hand_roll.1.impulse", 3)
    assert f" s, impulse {number})" in summary.peaks_in_words(full, [short])


def test_page_one_claims_no_absence_on_a_joint_that_something_seems_to_touch(full: Context):
    [contact] = full.catalogue.select(Contact, log="push", joint="hand_roll")
    text = summary.peaks_in_words(full, [contact])
    [absent] = re.findall(r"None on (.*)", text)
    assert "the hand pitch above" in absent
    touch = Diagnostic("assess", "tip.hand_pitch", np.array(["warning"], object), np.array(["x"], object))
    about = replace(full, catalogue=Catalogue(lambda k: [touch] if k is Diagnostic else full.catalogue.records(k)))
    assert "the hand pitch above" not in summary.peaks_in_words(about, [contact])
    still = [replace(t, at_rest=1) if t.joint == "hand_pitch" else t for t in full.catalogue.records(Track)]
    rest = replace(full, catalogue=Catalogue(lambda k: still if k is Track else full.catalogue.records(k)))
    assert "the hand pitch above" not in summary.peaks_in_words(rest, [contact])  # friction hides it there


def test_a_force_at_the_tip_by_the_effort_of_one_joint_is_called_unlikely(full: Context):
    [line] = opening.forces_at_tip(full)
    assert "only one joint" not in line
    one = full.catalogue.select(Contact, log="tip", joint="instrument_slide")
    about = replace(full, catalogue=Catalogue(lambda k: one if k is Contact else full.catalogue.records(k)))
    [line] = [line for line in opening.forces_at_tip(about) if "force by the arm" in line]
    assert "if the arm was touched at its tip alone; only one joint shows it, as a touch elsewhere would" in line


def test_the_figure_of_page_one_shows_a_contact_log_before_a_free_one_in_which_a_contact_was_found(full: Context):
    [push] = full.catalogue.select(Contact, log="push", joint="hand_roll")
    [tip] = full.catalogue.select(Contact, log="tip", joint="hand_roll")
    pitch = full.catalogue.select(Contact, log="tip", joint="hand_pitch")
    in_free = replace(push, log="check")
    assert full.study.log("check").role != "contact"
    records = [in_free, tip, *pitch]
    about = replace(full, catalogue=Catalogue(lambda k: records if k is Contact else full.catalogue.records(k)))
    [panel] = summary.effort_panel(about, trusts(full, hand_roll=0.05)[0])
    assert panel.title == "Hand roll, tip"  # though it touches another joint, too


def test_the_effort_of_a_mass_is_drawn_with_the_offset_of_the_day(full: Context):
    [weight, *_] = full.catalogue.records(Weight)
    loads = [load for load in full.catalogue.select(Load, log=weight.log) if load.joint in weight.loaded]
    offsets = np.arange(1.0, len(weight) + 1)
    for stated, mass in ((0.2, 0.2), (np.nan, 0.3)):  # the estimated mass where none is stated
        of = replace(weight, joint_offset=offsets, stated_mass=stated, mass=0.3)
        panels = weight_section.figure(of, loads).panels
        assert len(panels) == len(loads) > 0
        for panel, load in zip(panels, loads, strict=True):
            offset = offsets[list(weight.loaded).index(load.joint)]
            assert_allclose(panel.marks[1].y, mass * load.load + offset)


def test_windows_of_the_contact_table_have_the_numbers_of_the_figure(full: Context):
    [contact, *_] = full.catalogue.records(Contact)
    twice = Catalogue(lambda kind: [contact, contact] if kind is Contact else full.catalogue.records(kind))
    [table] = [b for b in walk(written("contacts", replace(full, catalogue=twice))) if name_of(b) == "contact-table"]
    assert [row[2] for row in table.rows] == [str(number) for number in range(1, 2 * len(contact) + 1)]
    [panel] = contacts_section.peaks(full, [contact, contact]).panels
    [marked] = [mark for mark in panel.marks if isinstance(mark, Points)]
    assert marked.x.tolist() == [int(row[2]) for row in table.rows]


def test_no_window_lies_at_the_edge_of_its_panel(full: Context):
    [contact, *_] = full.catalogue.records(Contact)
    for count, ends in ((1, (0.0, 2.0)), (2, (0.0, 3.0)), (3, (0.0, 4.0))):
        windows = replace(contact, **{name: np.ones(count) for name in contact.columns()})
        assert contacts_section.peak_panel([windows], True).x_range == ends


def test_contacts_of_several_joints_at_one_time_are_one_row(full: Context):
    [contact, *_] = full.catalogue.select(Contact, log="tip")
    times = {
        "hand_roll": ([1.0, 5.0, 9.0], [2.0, 6.0, 9.5]),
        "hand_pitch": ([1.5, 7.0], [3.0, 8.0]),
    }
    above = {"hand_roll": [1, 1, 0], "hand_pitch": [1, 1]}
    contacts = [
        replace(contact, joint=joint, above=np.array(above[joint]), **{
            name: np.array(ends if name == "release" else starts, float) if name in ("onset", "release")
            else np.resize(getattr(contact, name), len(starts)) for name in contact.columns() if name != "above"
        })
        for joint, (starts, ends) in times.items()
    ]  # fmt: skip
    [table] = contacts_section.by_time(full, contacts)
    assert [(row[0], row[1]) for row in table.rows] == [
        ("tip", "1.0 to 3.0 s"),
        ("tip", "5.0 to 6.0 s"),
        ("tip", "7.0 to 8.0 s"),
    ]
    assert "–" not in table.rows[0]
    assert (table.rows[1][3], table.rows[2][2]) == ("–", "–")
    assert not [*contacts_section.by_time(full, contacts[:1])]
    long = {"onset": np.array([0.0]), "release": np.array([9.5]), "above": np.array([1]), "peak": np.array([1.0])}
    one = replace(contacts[1], **{name: getattr(contacts[1], name)[:1] for name in contacts[1].columns()} | long)
    elsewhere = replace(contacts[1], log="tip-2")
    groups = parts.contacts_at_once([*contacts, elsewhere], lambda of: of.above == 1)
    assert [[window[0] for window in group] for group in groups] == [["tip"] * 2, ["tip"], ["tip"], *2 * [["tip-2"]]]
    twice = replace(contacts[0], peak=np.array([5.0, 2.0, 1.0]))
    [table] = contacts_section.by_time(full, [twice, one])
    assert [row[2] for row in table.rows] == [full.number("contact.tip.hand_roll.1.peak")]  # the largest of a joint


def test_noise_that_would_hide_the_band_is_not_drawn(full: Context):
    track = full.catalogue.records(Track)[0]
    k = np.arange(len(track))
    quiet = replace(track, tau_ext_smooth=np.sin(0.01 * k), tau_ext_smooth_std=0.1 + 0.0 * k)
    for size, names in ((1.0, ["measured minus model", "smoother"]), (10.0, ["smoother"])):
        noisy = replace(quiet, tau_ext_direct=size * np.where(k % 2, 1.0, -1.0))
        panel = runs.external_effort_panel(noisy)
        assert [mark.label for mark in panel.marks if isinstance(mark, Line)] == names


def test_what_the_study_reverses_and_changes_is_listed(full: Context):
    log = full.study.logs[0]
    turned = replace(log, channels=tuple(replace(source, sign=-1) for source in log.channels[-2:]))
    study = replace(full.study, logs=(turned, *full.study.logs[1:]), changed={"hand_roll": {"gear_ratio": 90.0}})
    listed = [b.text for b in provenance.section(replace(full, study=study)).blocks if isinstance(b, Listing)]
    assert "hand_roll: gear_ratio = 90.0" in listed
    assert f"{log.name}: {', '.join(source.quantity for source in log.channels[-2:])}" in listed


def test_logs_that_state_the_same_start_are_named_once_where_they_were_recorded(full: Context):
    starts = ["2026-11-02T09:12:33.5", "2026-11-02T09:12:33.5", "2026-11-02T10:00:00", "", ""]
    of = full.catalogue.records(LogSummary)[0]
    made = [replace(of, log=f"log-{i}", started=started) for i, started in enumerate(starts)]
    records = Catalogue(lambda kind: made if kind is LogSummary else full.catalogue.records(kind))
    for simulated, times in ((False, 1), (True, 0)):
        about = replace(full, catalogue=records, study=replace(full.study, simulated=simulated))
        said = [b.text for b in provenance.section(about).blocks if isinstance(b, Prose) and "same start" in b.text]
        assert len(said) == times
        assert not said or said[0].startswith("**log-0 and log-1 state the same start, ")


def test_a_loop_of_hysteresis_has_the_scale_of_the_contact(full: Context):
    push = next(push for push in full.catalogue.records(Push) if 0 < push.inside.sum() < len(push))
    [model] = [mark for mark in tissue.hysteresis_panel(push).marks if isinstance(mark, Line)]
    inside = 1e3 * push.depth[push.inside == 1]
    assert (model.x.min(), model.x.max()) == pytest.approx((inside.min(), inside.max()))
    assert np.isfinite(model.y).all()


def test_joints_are_in_the_order_of_the_robot_whatever_logs_come_first(full: Context):
    [contact, *_] = full.catalogue.records(Contact)
    contacts = [replace(contact, joint=joint) for joint in ("instrument_slide", "hand_pitch", "hand_roll")]
    order = ["Hand roll", "Hand pitch", "Instrument slide"]
    assert [panel.title for panel in contacts_section.peaks(full, contacts).panels] == order
    levels = contacts_section.alarm_levels(full)
    assert sorted(order, key=lambda joint: levels.index(joint.lower())) == order


def test_contacts_that_were_found_are_not_said_to_exceed_a_level(lab: Lab, catalogue: Catalogue):
    found = [replace(c, stated=np.zeros_like(c.stated)) for c in catalogue.records(Contact)]
    about = context(lab, catalogue)
    said = summary.opening_paragraph(about, found[:1])
    level = "above the alarm level, which free motion crosses at most once in ten minutes"
    each = len(found[0])
    assert f"**{each} contact{'s' * (each > 1)} found {level}; the study states no window of contact." in said
    felt = [replace(found[0], joint=joint) for joint in ("hand_roll", "hand_pitch", "instrument_slide")]
    said = summary.opening_paragraph(about, felt)
    assert (
        f"**{3 * each} contacts of joints, at {each} time{'s' * (each > 1)}, found {level}; the study states no window"
        in said
    )
    ones = [replace(c, stated=1 + 0 * c.stated, above=1 + 0 * c.above, found=0 * c.found) for c in found]
    number = sum(map(len, ones))
    said = summary.opening_paragraph(about, ones)
    assert f"**Of {number} cases (stated windows, counted once for each joint on which they are measured), " in said
    assert f"exceeds the detection level in {number}, in {number} of them with its peak only." in said
    about = context(lab, without(catalogue, Contact))
    assert (
        "No contact is measured: none was found, and the study states no window of contact."
        in summary.opening_paragraph(about, [])
    )
    logs = tuple(log for log in about.study.logs if log.role != "contact")
    only_tissue = replace(about, study=replace(about.study, logs=logs))
    assert "No contact is measured: pushes are in [@tissue]." in summary.opening_paragraph(only_tissue, [])


def test_contacts_of_a_log_whose_free_motion_is_unknown_are_doubted(lab: Lab, catalogue: Catalogue):
    known = context(lab, catalogue)
    logs = tuple(replace(log, contact=(), free=()) if log.role == "contact" else log for log in known.study.logs)
    unknown = replace(known, study=replace(known.study, logs=logs))
    found = [replace(c, stated=np.zeros_like(c.stated)) for c in catalogue.records(Contact)]
    found = [
        replace(c, alarm_level=0.6 * np.sort(np.abs(c.peak))[0]) for c in found
    ]  # its smallest is below twice that
    small = sum(int((np.abs(c.peak) < 2 * c.alarm_level).sum()) for c in found)

    def number_of(about, contact):
        row = np.argmin(np.abs(contact.peak))
        return str(about.number(f"contact.{contact.log}.{contact.joint}.{row + 1}.peak", 3))

    why = "below twice the alarm level or in a log that identifies may be due to the model"
    doubt = f"** {small} peaks {why}: see [@contacts]."
    for about, doubted in ((known, False), (unknown, True)):
        paragraph = summary.opening_paragraph(about, found)
        assert doubt in paragraph
        assert all(number_of(about, c) in paragraph for c in found)  # none is larger
        notes = [block.text for block in walk(written("contacts", about)) if isinstance(block, Prose)]
        assert any("State windows in which nothing touched the arm, `free = " in note for note in notes) == doubted
    clear = [replace(found[0], alarm_level=0.1 * np.abs(found[0].peak).min(), above=found[0].above | 1), *found[1:]]
    paragraph = summary.opening_paragraph(known, clear)
    assert [number_of(known, c) in paragraph for c in clear] == [True] + [False] * len(found[1:])


def test_a_joint_without_efforts_is_not_counted_and_not_sent_to_record_what_it_has(lab: Lab, catalogue: Catalogue):
    def tracks(joints: set[str]) -> Catalogue:
        return Catalogue(lambda kind: [r for r in catalogue.records(kind) if kind is not Track or r.joint in joints])

    about = context(lab, tracks({"hand_roll"}))
    assert "It was estimated on 1 joint of" in summary.opening_paragraph(about, [])
    [entry, *_] = [log for log in about.study.logs if log.role == "contact"]
    assert "record an identification log" in contacts_section.reason(entry, None, False)
    [track, *_] = catalogue.select(Track, log=entry.name, at_rest=0)
    unfelt = contacts_section.reason(entry, track, True)
    assert "as where nothing touched the arm, or the touch does not load this joint" in unfelt
    assert contacts_section.reason(entry, None, True).startswith("its external effort is not estimated")


def test_a_warning_that_no_effort_is_estimated_is_the_first_to_look_at(lab: Lab, catalogue: Catalogue):
    text = "push/hand_roll: the inertia is not positive, so its external effort is not estimated"
    lost = diagnostic("predict", "push.hand_roll.model", "warning", text)
    about = context(lab, Catalogue(lambda kind: [*catalogue.records(kind), *([lost] if kind is Diagnostic else [])]))
    assert caveats.first_looks_in_order(about, [parts.trust(about, "hand_roll")])[0] == text


def test_the_value_of_a_peak_is_left_out_beside_a_larger_one(lab: Lab, catalogue: Catalogue):
    track = next(t for t in catalogue.records(Track) if t.log == "push")
    contact = next(c for c in catalogue.records(Contact) if (c.log, c.joint) == (track.log, track.joint))
    start, width = track.t[0], track.t[-1] - track.t[0]
    onset = start + width * np.array([0.3, 0.35, 0.7])
    values = {name: np.zeros(3) for name in type(contact).columns()}
    values |= {"found": np.ones(3), "onset": onset, "release": onset + 0.01 * width, "peak": np.array([1.0, -2.0, 0.5])}
    values |= {"t_peak": onset + 0.004 * width}
    shown = summary.named_peaks(track, replace(contact, **values))
    assert shown.names == ("", "−2", "+0.5")
    np.testing.assert_array_equal(shown.y, [1.0, -2.0, 0.5])  # where the names say
    np.testing.assert_array_equal(shown.x, values["t_peak"])
    apart = replace(contact, **values | {"alarm_level": 0.5})
    assert [contacts_section.verdict(apart, row) for row in range(3)] == ["found", "found", "small"]


def test_a_contact_log_decides_on_a_joint_where_its_windows_of_contact_or_free_of_it_are_stated(
    lab: Lab, catalogue: Catalogue
):
    about = context(lab, catalogue)
    [stated] = [log for log in about.study.logs if log.name == "push"]
    assert stated.contact
    for contact, free, counts in ((stated.contact, (), True), ((), ((1.0, 3.0),), True), ((), (), False)):
        logs = tuple(replace(log, contact=contact, free=free) if log is stated else log for log in about.study.logs)
        changed = replace(about, study=replace(about.study, logs=logs))
        scored = {prediction.log for prediction in parts.scored_predictions(changed, "hand_roll")}
        assert ("push" in scored) == counts


@pytest.mark.parametrize("worst", ["push", "tip"])
def test_page_one_shows_the_log_with_the_largest_error_and_names_its_windows_only_if_stated(
    lab: Lab, catalogue: Catalogue, worst: str
):
    [push] = catalogue.select(Contact, log="push", joint="hand_roll")
    [tip] = catalogue.select(Contact, log="tip", joint="hand_roll")
    push = replace(push, found=np.arange(len(push)) == 0)  # a window without a contact gets no name
    touched = [
        replace(c, joint=joint, above=1 + 0 * c.above) for c in (push, tip) for joint in ("hand_roll", "hand_pitch")
    ]
    errors = [
        replace(p, model_error=2.0 if p.log == worst else 1.0) for p in catalogue.select(Prediction, joint="hand_roll")
    ]
    records = {Contact: touched, Prediction: errors}
    shown = Catalogue(lambda kind: records.get(kind) or catalogue.records(kind))
    about = replace(context(lab, catalogue), catalogue=shown)
    trusted = parts.trust(about, "hand_roll")
    panels = list(summary.effort_panel(about, trusted))
    assert panels[0].title == f"Hand roll, {worst}"
    assert [len(mark.x) for mark in panels[0].marks if isinstance(mark, Points)] == [1]
    assert "stated contact windows shaded" in summary.caption(about, touched, panels)
    logs = tuple(replace(log, contact=() if log.name == worst else log.contact) for log in lab.study.logs)
    panels = list(summary.effort_panel(replace(about, study=replace(lab.study, logs=logs)), trusted))
    assert worst not in panels[0].title  # an error that holds the pushes is none of the model
    logs = tuple(replace(log, contact=()) for log in lab.study.logs)
    panels = list(summary.effort_panel(replace(about, study=replace(lab.study, logs=logs)), trusted))
    assert "shaded" not in summary.caption(about, touched, panels)


@pytest.mark.parametrize(("period", "advice"), [(1, " The arm may not yet have settled."), (3, "")])
def test_a_period_that_is_noisier_than_the_others_is_named(lab: Lab, catalogue: Catalogue, period: int, advice: str):
    average = catalogue.select(Average, log="again")[0]
    [residual] = catalogue.select(PeriodResidual, log=average.log, joint=average.joint)
    number = ((residual.t - average.t_start) / average.period + 1e-9).astype(int) + 1
    tau_noise = np.where(number == period, 8.0, 1.0) * np.sign(np.sin(1e4 * residual.t)) * 0.01
    quiet = np.zeros_like(tau_noise) + 1e-3
    spoilt = [replace(residual, q_noise=quiet, dq_noise=quiet, tau_noise=tau_noise)]
    about = replace(context(lab, catalogue), catalogue=Catalogue(lambda kind: spoilt if kind is PeriodResidual else []))
    [verdict] = noise.outliers(about, average)
    which = f"effort noise of period {period} of {average.periods} is 8.0 times that of the median period."
    assert verdict.text.endswith(f"{which}{advice}")


def test_new_keys_beyond_those_listed_are_counted(full: Context):
    keys = [f"new.{i}" for i in range(300 + 7)]
    differences = [Change(key, None, StatedValue(1.0)) for key in keys]
    [block] = [b for b in baseline_section.blocks(full, {}, differences) if isinstance(b, OnScreen)]
    [listing] = block.blocks
    *shown, last = listing.text.splitlines()
    assert shown == keys[:300]
    assert last == f"and {len(keys) - len(shown)} more"


def test_a_change_of_the_baseline_has_a_true_minus_and_no_sign_without_a_standard_error(full: Context):
    known = Change("a", StatedValue(3.0, 0.3), StatedValue(2.0, 0.4))
    unknown = Change("b", StatedValue(1.0), StatedValue(2.0))
    [table] = [b for b in baseline_section.blocks(full, {}, [known, unknown]) if isinstance(b, Table)]
    assert sorted(row[-1] for row in table.rows) == ["–", "−2.0"]


@pytest.mark.parametrize(("number", "printed"), [(3, 3), (18, 18), (19, 10), (400, 10)])
def test_the_weightiest_changes_of_the_baseline_are_on_paper(full: Context, number: int, printed: int):
    """Those without a standard error after those with one; the keys are in the order of their weights."""
    fits = [f"fit.roll.lse.p{i}" for i in range(number - 3)]
    keys = ["effort.a.roll.coverage", "noise.a.roll.sigma", *fits, "robot.condition"]
    after = {
        key: StatedValue(2.0 + number - i, None if key == "robot.condition" else 0.1) for i, key in enumerate(keys)
    }
    differences = [Change(key, replace(b, value=1.0), b) for key, b in after.items()]
    [_, table, *folded] = baseline_section.blocks(full, {}, differences[::-1])
    assert isinstance(table, Table)
    assert [row[0] for row in table.rows] == [literal(key) for key in keys[:printed]]
    assert table.caption.startswith(f"The first {printed} of {number} changes" if printed < number else f"{number} ch")
    whole = [[row[0] for row in block.rows] for screen in folded for block in walk(screen)]
    assert whole == [[literal(key) for key in keys[:300]]] * (printed < number)


def test_measurements_beyond_those_on_page_one_are_counted(full: Context):
    [measured, *_] = full.catalogue.records(Stiffness)
    weights, many = full.catalogue.records(Weight), [measured] * 6
    catalogue = Catalogue(lambda kind: many if kind is Stiffness else full.catalogue.records(kind))
    *shown, last, hands = opening.measurements(replace(full, catalogue=catalogue))
    assert hands.startswith("Haptic feedback, simulated: stable on tissue up to ")
    assert len(shown) == opening.MAX_MEASURED
    count = len(full.catalogue.records(TipContact)) + len(weights) + len(many)
    assert last.startswith(f"{count - opening.MAX_MEASURED} more logs")


def test_page_one_states_the_largest_force_at_the_tip_and_what_an_ampere_counts(full: Context):
    [contact] = full.catalogue.records(TipContact)
    [line] = opening.forces_at_tip(full)
    largest = full.number(f"tip.{contact.log}.{int(np.argmax(contact.f_peak)) + 1}.peak", 3)
    row = int(np.argmax(contact.f_peak))
    x, y, z = (full.number(f"tip.{contact.log}.{row + 1}.{name}", 3) for name in ("f_x", "f_y", "f_z"))
    of_all = f", the largest of {len(contact)}" if len(contact) > 1 else ""
    when = (
        f"{contact.onset[row]:.1f} to {contact.release[row]:.1f} s{of_all}; in the base’s axes x: {x}, y: {y}, z: {z}"
    )
    key = f"tip.{contact.log}.detection_level"
    told = f"**{contact.log}**: force by the arm at its tip up to {largest} ({when}), if the arm was touched at its tip"
    assert line == f"{told} alone; without contact, 99 % stay below {full.number(key, 2)}"
    known = {name: result for name, result in full.results.items() if name != key}  # no free motion is known
    [without] = opening.forces_at_tip(replace(full, results=Results(known)))
    assert without == f"{told} alone"
    assert np.hypot(np.hypot(contact.f_x, contact.f_y), contact.f_z)[row] == pytest.approx(contact.f_peak[row])
    assert float(line.partition("up to ")[2].partition(" ")[0]) == pytest.approx(contact.f_peak.max(), abs=0.05)
    [joint, *_] = full.study.robot.joints
    drive = replace(joint, gear_ratio=200.0, torque_constant=0.0438)
    robot = replace(full.study.robot, joints=(drive, *full.study.robot.joints[1:]))
    channel = Source(f"{joint.name}.i", "current", "current")
    logs = (replace(full.study.logs[0], channels=(channel,)),)
    told = opening.currents_in_words(replace(full, study=replace(full.study, robot=robot, logs=logs)))
    assert (
        told
        == " 1 A of a motor counts as 8.76 N m on the hand roll (by the robot’s description: check your drives); no ± "
        "holds the error of that."
    )
    for count, where in ((2, "the hand roll 1 and the hand roll 2"), (4, "each of 4 joints")):
        alike = tuple(replace(drive, name=f"{joint.name}_{i}") for i in range(1, count + 1))
        channels = tuple(Source(f"{joint.name}.i", "current", "current") for joint in alike)
        study = replace(
            full.study,
            changed={joint.name: {"torque_constant": 0.0438} for joint in alike},
            robot=replace(robot, joints=alike),
            logs=(replace(logs[0], channels=channels),),
        )
        told = opening.currents_in_words(replace(full, study=study))
        assert told == f" 1 A of a motor counts as 8.76 N m on {where}; no ± holds the error of that."


def test_page_one_names_the_log_of_all_panels_and_peaks_once(full: Context):
    panels = [Panel(f"Joint {i}, push", "time [s]", "effort [N m]", ()) for i in range(4)]
    assert [panel.title for panel in summary.in_column(panels)] == [f"Joint {i}" for i in range(4)]
    contacts = full.catalogue.records(Contact)
    assert summary.caption(full, contacts, panels).startswith("External effort of each joint in push")
    other = [*panels, Panel("Joint 4, tip", "time [s]", "effort [N m]", ())]
    assert [panel.title for panel in summary.in_column(other)] == [panel.title for panel in other]
    assert summary.caption(full, contacts, other).startswith("External effort of each joint. ")
    tip = [contact for contact in full.catalogue.records(Contact) if contact.log == "tip"]
    assert summary.peaks_in_words(full, tip).count("tip") == 1
    assert summary.peaks_in_words(full, tip).startswith(" Contact peaks in tip: ")


def test_page_one_says_which_panels_show_no_contact_log_and_where_dots_stand(full: Context):
    contacts, dot = full.catalogue.records(Contact), Points(np.zeros(1), np.ones(1))
    panels = [Panel(f"Joint {i}, {log}", "", "", ()) for i, log in enumerate(("push", "check", "roll"))]
    told = summary.caption(full, contacts, panels)
    assert " Joint 1 and Joint 2: in no contact log, so the worst run in free space is shown. " in told
    assert "in no contact log" not in summary.caption(full, contacts, panels[:1])
    assert "Dots" not in told
    told = summary.caption(full, contacts, [replace(panels[0], marks=(dot,))])
    assert told.endswith(" Dots: peaks, beyond the curve by what smoothing takes off them.")


def test_a_found_contact_is_outside_windows_only_where_some_are_stated(full: Context):
    def told(about: Context) -> str:
        [table] = [block for block in walk(written("contacts", about)) if name_of(block) == "contact-table"]
        return table.caption

    contacts = full.catalogue.records(Contact)
    none = [replace(contact, stated=0 * contact.stated) for contact in contacts]
    found = Catalogue(lambda kind: none if kind is Contact else full.catalogue.records(kind))
    assert "“found” for a contact outside the windows that the study states" in told(full)
    assert "“found” for a contact, as the study states no window" in told(replace(full, catalogue=found))


def test_the_poor_agreement_of_joints_on_a_mass_is_in_its_verdict_and_on_page_one(full: Context):
    [of, *_] = full.catalogue.records(Weight)
    for agreement, is_told in ((0.015, True), (0.5, False)):
        poor = replace(of, agreement=agreement, joint_offset=np.zeros_like(of.joint_offset))
        records = Catalogue(lambda kind, poor=poor: [poor] if kind is Weight else full.catalogue.records(kind))
        about = replace(full, catalogue=records)
        mass, clause = full.number(f"weight.{of.log}.mass", 3), " (its joints agree poorly: p-value 0.015)" * is_told
        assert f"estimated from the efforts is {mass}{clause}, " in weight_section.verdict(about, poor).text
        assert [f"mass {mass}{clause}, stated " in line for line in opening.masses(about)] == [True]
    unknown = replace(of, joint_offset=np.full_like(of.joint_offset, np.nan))
    about = replace(
        full, catalogue=Catalogue(lambda kind: [unknown] if kind is Weight else full.catalogue.records(kind))
    )
    [line] = opening.masses(about)
    assert f"mass {mass} (a change of its offset since {of.tare} would count as mass)" in line
    assert line.endswith(f"{verdicts.WORDS['warn']}, as its error exceeds 10 %")
    bare = replace(unknown, tare="")
    [line] = opening.masses(
        replace(full, catalogue=Catalogue(lambda k: [bare] if k is Weight else full.catalogue.records(k)))
    )
    assert f"mass {mass} (an offset of the effort would count as mass)" in line


def test_the_force_at_the_tip_says_what_is_added_to_its_peak(full: Context):
    prose = [block.text for block in walk(written("tip", full)) if isinstance(block, Prose)]
    assert (
        "as off a contact's peak, is added to the largest force of a contact, with its error. Noise raises" in prose[0]
    )


def test_page_one_states_every_peak_if_they_are_few_and_where_none_is(full: Context, monkeypatch):
    contacts = full.catalogue.records(Contact)
    above = [(of, row) for of in contacts for row in np.flatnonzero(of.above)]
    for most in (len(above), len(above) - 1):
        monkeypatch.setattr(summary, "MAX_PEAKS", most)
        text = summary.peaks_in_words(full, contacts)
        shown = [f"{of.onset[row]:.1f} to {of.release[row]:.1f} s" in text for of, row in above]
        assert all(shown) == (most == len(above))
        assert text.startswith(" Contact peaks" if all(shown) else " Largest contact peak of each joint")
    for joint in dict.fromkeys(of.joint for of, _ in above):
        [(size, largest)] = sorted(
            ((abs(of.peak[row]), f"{of.onset[row]:.1f} to") for of, row in above if of.joint == joint)
        )[-1:]
        assert size > 0
        assert largest in text
    [first, *others] = dict.fromkeys(of.joint for of, _ in above)
    alone = summary.peaks_in_words(full, [of for of in contacts if of.joint == first])
    for joint in others:
        level = full.number(f"threshold.{joint}.alarm_level", 2, std=None)
        assert f"{name_in_sentence(joint)} above {level}" in alone.partition(" None on ")[2]
    assert " None on " not in summary.peaks_in_words(full, contacts)


def test_where_nothing_is_to_be_looked_at_first_the_next_step_is_said(full: Context):
    unknown = [log.name for log in full.study.logs if log.role == "contact" and not log.has_known_free_motion]
    logs = tuple(replace(log, contact=(), free=()) if log.role == "contact" else log for log in full.study.logs)
    told = summary.next_step(replace(full, study=replace(full.study, logs=logs)))
    assert told.startswith(" Next: state when nothing touched the arm in ")
    assert all(log.name in told for log in logs if log.role == "contact")
    assert bool(summary.next_step(full)) == bool(unknown)


def test_the_coverage_of_page_one_is_the_lowest_of_all_logs_that_were_not_fitted(full: Context):
    [space, *_] = full.catalogue.select(FreeSpace, joint="hand_roll", filter="rts")
    known = (("check", "validation", 0.3, 0.96), ("push", "contact", 0.2, 0.7), ("roll", "identification", 0.1, 0.5))
    spaces = [
        replace(space, log=log, role=role, detection_level=level, coverage=share) for log, role, level, share in known
    ]
    records = Catalogue(lambda kind: spaces if kind is FreeSpace else full.catalogue.records(kind))
    about = replace(full, catalogue=records)
    trusted = trust(about, "hand_roll")
    assert (trusted.space.log, trusted.narrowest.log) == ("check", "push")
    assert trusted.narrow
    assert any(
        "hand_roll" not in text and "push" in text for _, text in caveats.looks_at_narrow_bands(about, [trusted])
    )


def test_the_largest_static_friction_of_each_joint_at_rest_is_stated_once(full: Context):
    [track, *_] = full.catalogue.records(Track)
    still = [
        replace(track, log=log, joint=joint, at_rest=1, static_friction=level)
        for log, joint, level in (("a", "hand_roll", 0.3), ("b", "hand_roll", 0.5), ("a", "hand_pitch", 0.2))
    ]
    texts = [block.text for block in runs.track_blocks(full, still) if isinstance(block, Prose)]
    [said] = [text for text in texts if "static level" in text]
    levels = [full.size(t, "static_friction", t.static_friction) for t in still[1:]]
    each = f"{levels[0]} on the hand roll and {levels[1]} on the hand pitch"
    assert said.endswith(f"up to that level, by the model at least: {each}.")


def test_standstill_is_shaded_in_the_effort_of_page_one(full: Context):
    def still(track: Track) -> Track:
        k = np.arange(len(track))
        return replace(track, standing=((k < 50) | (k >= len(track) - 30)).astype(int))

    tracks = [*map(still, full.catalogue.records(Track))]
    about = replace(full, catalogue=Catalogue(lambda kind: tracks if kind is Track else full.catalogue.records(kind)))
    [panel, *_] = [p for trusted in trusts(about, hand_roll=0.05) for p in summary.effort_panel(about, trusted)]
    [track] = [t for t in tracks if panel.title == f"{title(t.joint)}, {t.log}"]
    shaded = [(mark.start, mark.end) for mark in panel.marks if isinstance(mark, VSpan) and mark.colour == "yellow"]
    assert shaded == [(track.t[0], track.t[49]), (track.t[-30], track.t[-1])]


def test_details_of_a_joint_are_those_of_least_squares_in_whichever_order_its_fits_are(full: Context):
    fits = [fit for fit in full.own_fits() if fit.group == "hand_roll"]
    [(_, *one), (_, *other)] = (joints.comparison(full, order).blocks for order in (fits, fits[::-1]))
    assert one
    assert [*map(repr, one)] == [*map(repr, other)]


def test_a_fault_of_a_candidate_stands_beside_the_fits_and_not_on_page_one(full: Context, catalogue: Catalogue):
    fits = [fit for fit in full.own_fits() if fit.group == "hand_roll"]
    remark = diagnostic("fit", "hand_roll", "note", "hand_roll: lse estimates an inertia that is not positive")
    records = Catalogue(lambda kind: [remark] if kind is Diagnostic else catalogue.records(kind))
    about = replace(full, catalogue=records)
    [bullets] = [block for block in joints.comparison(about, fits).blocks if isinstance(block, Bullets)]
    assert bullets.items == (remark.text[0],)
    assert not any("inertia" in text for _, text in caveats.looks_at(about, trusts(full, hand_roll=0.05)))


def test_advice_that_a_failed_log_may_have_followed_is_not_on_page_one(full: Context, catalogue: Catalogue):
    advice = diagnostic("choose", "together", "warning", "arm: no identification log moves roll and pitch together")
    records = Catalogue(lambda kind: [advice] if kind is Diagnostic else catalogue.records(kind))
    roles = {log.role: log.name for log in full.study.logs}
    for failed, is_told in (("identification", False), ("contact", True)):
        failures = {f"ingest {roles[failed]}": "there is no channel 'q'"}
        about = replace(full, catalogue=records, provenance=replace(full.provenance, failures=failures))
        assert any("together" in text for _, text in caveats.looks_at(about, trusts(full, hand_roll=0.05))) == is_told
    alone = [track for track in full.catalogue.records(Track) if track.joint == "hand_roll"]  # in no log with others
    few = Catalogue(lambda kind: alone if kind is Track else records.records(kind))
    about = replace(full, catalogue=few)
    assert not any("together" in text for _, text in caveats.looks_at(about, trusts(full, hand_roll=0.05)))


def test_a_joint_tested_on_its_own_path_comes_between_errors_of_a_third_and_of_a_half(full: Context):
    """Its true error is not known: it may be worse than an error of a third, and an error of a half is worse."""
    [same] = trusts(full, hand_pitch=0.05)
    same = replace(same, prediction=replace(same.prediction, path="same path"), about=None)
    for share, first in ((0.33, "tested only on the path"), (0.55, "the model error is")):
        [other] = trusts(full, hand_roll=share)
        other = replace(other, prediction=replace(other.prediction, role="identification"))
        looks = sorted(caveats.looks_at(full, [other, same]), key=lambda look: -look[0])
        texts = [text for _, text in looks if "model error is" in text or "tested only" in text]
        assert first in texts[0]


def test_a_joint_without_a_log_for_validation_is_told_to_record_one(full: Context):
    [whole] = trusts(full, hand_pitch=0.05)
    refitted = {"role": "identification", "path": "another path"}
    for scheme, is_told in (("leave a block of path out", True), ("leave a log out", False)):
        tested = replace(whole, prediction=replace(whole.prediction, scheme=scheme, **refitted), about=None)
        told = [text for _, text in caveats.looks_at(full, [tested]) if "tested only on parts of fitted logs" in text]
        assert bool(told) == is_told
        assert all("Record a validation log on another path." in text for text in told)


@pytest.mark.parametrize(("seconds", "hidden"), [(1.0, 0.2), (20.0, 1.0)])
def test_what_a_filter_says_before_it_has_converged_is_not_what_an_effort_reaches(full: Context, seconds, hidden):
    """A second, of a short log a fifth."""
    track, rate = full.catalogue.records(Track)[0], 100.0
    t = np.arange(round(seconds * rate)) / rate
    columns = dict.fromkeys(Track.columns(), np.ones(len(t))) | {"t": t}
    for at, reached in ((round(hidden * rate) - 1, False), (round(hidden * rate), True)):
        effort = np.ones(len(t))
        effort[at] = 50.0
        figure = runs.trace(full, replace(track, rate=rate, **columns | {"tau_ext_smooth": effort}), "")
        assert ("reaches 50" in figure.alt) == reached


def test_a_trajectory_that_exceeds_a_limit_is_warned_of_and_each_curve_and_limit_is_named_once(full: Context):
    trajectories = full.catalogue.records(Excitation)
    meanings = {"": "", "excess_q": "position", "excess_dq": "velocity", "excess_ddq": "acceleration"}
    for exceeded, meaning in meanings.items():
        changed = [replace(e, **{name: 0.1 * (name == exceeded) for name in meanings if name}) for e in trajectories]
        catalogue = Catalogue(lambda kind, all_=changed: all_ if kind is Excitation else full.catalogue.records(kind))
        blocks = excitation.section(replace(full, catalogue=catalogue)).blocks
        warnings = [block.text for block in blocks if isinstance(block, Verdict)]
        keys = [f"excitation.{e.joint}.{e.source}.{exceeded}" for e in trajectories if exceeded]
        for key, text in zip(keys, warnings, strict=True):
            assert text.endswith(f"exceeds its {meaning} limits by {full.results[key].number(2)}.")
    for figure in (block for block in blocks if isinstance(block, Figure)):
        joint = next(e.joint for e in trajectories if figure.caption.startswith(title(e.joint)))
        shown, limits = [e for e in trajectories if e.joint == joint], full.study.robot.joint(joint).limits
        for panel, symbol in zip(figure.panels, ("q", "dq", "ddq"), strict=True):
            lines, ends = panel.marks[: len(shown)], panel.marks[len(shown) :]
            names = [excitation.source_label(e) if symbol == "q" else "" for e in shown]
            assert [mark.label for mark in panel.marks] == [*names, "limits" if symbol == "q" else "", ""]
            assert all(line.y is getattr(e, symbol) for line, e in zip(lines, shown, strict=True))
            assert [end.y for end in ends] == [*getattr(limits, symbol)]


def test_a_choice_that_errs_surely_more_than_the_plain_model_says_what_to_compare(full: Context):
    used, plain = full.shown_fit("hand_roll"), full.fit_named("independent.lse", "hand_roll")
    for size, is_worse in ((0.01, True), (100.0, False)):
        less = {
            key: replace(number, value=size, std=0.001)
            for key, number in full.results.items()
            if re.fullmatch(r"predict\..*\.hand_roll\.independent\.lse\.relative_error", key)
        }
        about = replace(full, results=Results(full.results | less))
        text = joints.compared_with_plain(about, "hand_roll", used, plain)
        assert text.endswith('did not help: compare `fit = "independent.lse"` in study.toml.') == is_worse


def test_a_detection_level_is_said_to_be_of_the_runs_that_no_fit_used(full: Context):
    texts = [parts.chapters("explanations.md")[name] for name in ("contacts", "free-space-table", "trust")]
    pages = [guide.page(topic).as_text for topic in ("record", "stages", "results", "start", "labview", "records")]
    texts += [*pages, guide.page("detection level").as_text, parts.chapters("methods.md")["Threshold"]]
    for text in texts:
        assert "that no fit used" in " ".join(text.split()), text[:200]
    assert "that no fit used" in QUANTITIES["detection_level"].meaning
    assert "free-motion samples of the worst run that no fit used stay;" in paragraph(full)
    spaces = [replace(space, role="identification") for space in full.catalogue.records(FreeSpace)]
    fitted = Catalogue(lambda kind: spaces if kind is FreeSpace else full.catalogue.records(kind))
    assert "of the worst run (of those that no fit used, if there are any) stay;" in paragraph(
        replace(full, catalogue=fitted)
    )


@pytest.mark.parametrize(("name", "kind"), [("runs", Track), ("prediction", Prediction)])
def test_the_worst_run_of_a_figure_is_said_to_be_of_those_that_no_fit_used(full: Context, name: str, kind: type):
    def captions(about: Context) -> list[str]:
        figures = [block for block in walk(written(name, about)) if isinstance(block, Figure)]
        return [figure.caption for figure in figures if "the worst run of this joint" in figure.caption]

    assert captions(full)
    roles = {
        k: [replace(record, role="identification") for record in full.catalogue.records(k)] for k in (kind, FreeSpace)
    }
    fitted = replace(full, catalogue=Catalogue(lambda of: roles.get(of) or full.catalogue.records(of)))
    assert all("that no fit used" in caption for caption in captions(full))
    assert captions(fitted)
    assert not any("that no fit used" in caption for caption in captions(fitted))


def test_the_best_candidate_of_a_kind_is_shown_beside_the_chosen_one(full: Context):
    [of, *_] = full.catalogue.records(Choice)
    chosen, variant = of.row_number(of.chosen), np.full(len(of), "searched", object)
    worst = replace(of, variant=variant, score=np.where(np.arange(len(of)) == chosen, of.score.max() + 1.0, of.score))
    assert choice_section.best_rows(worst) == [int(np.argmin(worst.score)), chosen]


def test_the_choice_names_the_model_in_use_where_another_took_the_place_of_the_chosen_one(full: Context):
    def said(estimator: str, fit: str = "chosen") -> str:
        every = full.catalogue.records(Prediction)
        predictions = [replace(p, estimator=estimator) if p.model == "chosen" else p for p in every]
        records = Catalogue(lambda kind: predictions if kind is Prediction else full.catalogue.records(kind))
        study = replace(full.study, settings=replace(full.study.settings, fit=fit))
        blocks = written("choice", replace(full, catalogue=records, study=study)).blocks
        [verdict] = [block.text for block in blocks if isinstance(block, Verdict)]
        return verdict

    [choice, *_] = full.catalogue.records(Choice)
    assert said("ridge").startswith(f"**Chosen: “{choice.chosen}”.** ")
    replaced = said("consistent")
    assert replaced.startswith(f"**In use: “chosen, consistent”. First chosen: “{choice.chosen}”.** ")
    assert "parameters that a mechanism can have take their place" in replaced
    stated = said("ridge", "independent.wlse")
    assert stated.startswith(
        f"**In use: “independent, WLSE”, by the setting `fit`. By the scores: “{choice.chosen}”.**"
    )
    assert "take their place" not in stated


def test_contacts_found_as_samples_arrive_are_counted_log_by_log(full: Context):
    [stream, *_] = [s for s in full.catalogue.records(Streamed) if s.joint == "hand_roll"]
    level = full.results["stream.hand_roll.alarm_level"].value
    peak = np.array([2.0, -3.0, 0.5]) * level
    some = dict.fromkeys(stream.columns(), peak)
    touched = replace(stream, **some)
    free = replace(stream, **dict.fromkeys(stream.columns(), peak[:0]))
    table = filters_section.stream_table(full, [touched, free])
    assert [row[-1] for row in table.rows] == ["2 of 3", "–"]
    whole = filters_section.stream_table(full, full.catalogue.records(Streamed))
    by_joint: dict[str, int] = {}
    for row in whole.rows:
        by_joint[row[0]] = by_joint.get(row[0], 0) + int(row[-1].partition(" of ")[0].replace("–", "0"))
    for joint, found in by_joint.items():
        name = joint.lower().replace(" ", "_")
        assert found == full.results[f"stream.{name}.contacts_found"].value


def test_a_model_error_of_zero_is_nowhere_printed_as_an_error(full: Context):
    """It is the root of a difference that is cut off at zero, so twice its standard error bounds it."""
    error = {key: replace(x, value=0.0, std=0.016) for key, x in full.results.items() if key.endswith(".model_error")}
    predictions = [
        replace(p, model_error=0.0, model_error_std=0.016, effort_rms=1.0) for p in full.catalogue.records(Prediction)
    ]
    records = Catalogue(lambda kind: predictions if kind is Prediction else full.catalogue.records(kind))
    about = replace(full, catalogue=records, results=Results(full.results | error))
    tables = [block for block in walk(written("prediction", about)) if isinstance(block, Table)]
    tables.append(summary.trust_table(about, [parts.trust(about, "hand_roll")]))
    columns = {name: i for i, name in enumerate(tables[0].header)}
    for row in tables[0].rows:
        assert str(row[columns["Model error"]]).startswith("< 0.032 N")
        assert row[columns["Error / effort"]] == "< 4 %"
    cells = [cell for table in tables for row in table.rows for cell in row if isinstance(cell, Number)]
    errors = [cell for cell in cells if cell.key.endswith(".model_error")]
    assert len(errors) > len(tables[0].rows)
    assert {cell.text for cell in errors} == {"< 0.032"}
    assert "< 4 %" in tables[-1].rows[0]
    assert "0.000" not in paragraph(about).partition("Results")[2].partition("detection")[0]


def test_a_log_with_a_mass_has_the_period_over_which_its_effort_is_averaged(full: Context):
    [load, *_] = [load for load in full.catalogue.records(Load) if load.log == load.weight]

    def shown(period: float) -> tuple[str, str]:
        loads = [replace(load, period=period, periods=4)]
        records = Catalogue(lambda kind: loads if kind is Load else full.catalogue.records(kind))
        table = runs.overview(replace(full, catalogue=records), full.catalogue.records(LogSummary))
        [row] = [row for row in table.rows if row[0] == load.log]
        return str(row[-2]), str(row[-1])

    assert shown(2.5) == ("2.5 s", "4")
    assert shown(0.0) == ("–", "–")


def test_the_smoother_that_filters_are_compared_with_has_a_random_walk_of_its_own(full: Context):
    """So its numbers differ from those of the report's smoother, and both tables say why."""
    noise = next(noise for noise in full.catalogue.records(FilterNoise) if noise.joint == "hand_roll")
    joint = replace(full.study.robot.joint("hand_roll"), q_tau=0.0)
    walks = {name: noise_model(noise, joint, 1.0 / noise.rate, 0.0, name).q_tau for name in ("ekf", "rts")}
    assert walks["rts"] != walks["ekf"]
    tables = {block.label: block.caption for block in walk(written("filters", full)) if isinstance(block, Table)}
    assert "has a random walk of its own (unless the study states one)" in tables["filter-comparison"]
    assert "differ from those in [@real-time-cost]" in tables["filter-comparison"]
    assert "so the smoother's numbers differ there" in tables["real-time-cost"]


def test_a_lifted_mass_has_its_reason_for_a_large_error_and_other_joints_have_none(full: Context):
    def told(name: str) -> list[bool]:
        blocks = [*joints.joint_blocks(full, [fit for fit in full.own_fits() if fit.group == name])]
        return [isinstance(b, Prose) and b.text.startswith("Friction that differs by direction") for b in blocks]

    after = told("instrument_slide")
    assert (after.count(True), after[2]) == (1, True)  # below its table
    assert not any(told("hand_roll"))
