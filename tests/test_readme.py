"""What README and guide tell of names, keys and defaults is what the code has, and what they lead to is there."""

import ast
import json
import re
import shutil
import tomllib
from dataclasses import asdict, fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import typer
from typer.testing import CliRunner

import davinci_forces
from davinci_forces import commands, exports, guide, robots, stages
from davinci_forces.cli import app
from davinci_forces.errors import BadRequest, BadStudy
from davinci_forces.estimators import ESTIMATORS
from davinci_forces.logs import FORMATS
from davinci_forces.maths.models.terms import TERMS
from davinci_forces.maths.units import SI, UNITS
from davinci_forces.records import (
    KINDS,
    Control,
    Excitation,
    FreeWeight,
    Guess,
    HandLimit,
    HapticResponse,
    HapticRun,
    Links,
    Lyapunov,
    Origin,
    Record,
    SensorForce,
    Stiffness,
    TipBudget,
    TipContact,
    TipForce,
    TissueModel,
    TorqueConstant,
    Weight,
)
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.records.record import COLUMN_DTYPES
from davinci_forces.report.results import collect
from davinci_forces.robots.robot import Joint
from davinci_forces.runner import ALL
from davinci_forces.runner.console import show_markdown
from davinci_forces.runner.graph import every_step
from davinci_forces.runner.signature import declaration, stage_of
from davinci_forces.study import AttachedMass, HapticScenario, LogEntry, Options, Settings, reading
from davinci_forces.study.channels import OF_A_JOINT, OF_THE_LOG
from davinci_forces.study.entries import ROLES, TARE_ROLES
from tests import test_tip
from tests.arm import log_table
from tests.conftest import ROOT

PACKAGE = ROOT / "pipeline" / "davinci_forces"
README = (ROOT / "README.md").read_text(encoding="utf-8")
GUIDE = PACKAGE / "guide"
PAGES = {file.stem: file.read_text(encoding="utf-8") for file in sorted(GUIDE.rglob("*.md"))}
CHANGES = [file.stem for file in (GUIDE / "changes").glob("*.md")]
TEXT = "\n\n".join([README, *(text for name, text in PAGES.items() if name not in CHANGES)])
SPAN = re.compile(r"`([^`]+)`")


def rows(*header: str) -> list[list[str]]:
    """The cells of the rows of the one table whose header begins with these words."""
    lines = [*TEXT.splitlines(), *PAGES["0.2.0"].splitlines()]
    [start] = [i for i, line in enumerate(lines) if line.startswith("| " + " | ".join(header) + " |")]
    table = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            break
        table.append([cell.strip() for cell in line.strip("|").split("|")])
    return table


def spans(cell: str) -> list[str]:
    return SPAN.findall(cell)


def named(table: list[list[str]]) -> list[str]:
    """What stands in code in the first column."""
    return [span for row in table for span in spans(row[0])]


def makers(kind: type) -> list[str]:
    """The stages that make a kind of record, in order."""
    return list(dict.fromkeys(stage_of(step) for step in every_step() if kind in declaration(step).makes))


def test_records_are_those_that_there_are_with_their_folders_and_stages():
    table = rows("record", "folder", "made by")
    assert named(table) == list(KINDS)
    for [name], [folder], made_by in ((spans(row[0]), spans(row[1]), row[2]) for row in table):
        made = makers(KINDS[name])
        assert folder == KINDS[name].folder(), name
        assert made_by == (", ".join(f"`{stage}`" for stage in made) if len(made) < 4 else "any stage"), name


def test_settings_are_those_that_there_are_with_their_defaults():
    table = rows("setting", "default")
    defaults = {spans(name)[0]: tomllib.loads(f"x = {default}")["x"] for name, default, *_ in table}
    assert list(defaults.items()) == list(asdict(Settings()).items())
    assert [type(value) for value in defaults.values()] == [type(value) for value in asdict(Settings()).values()]


def test_the_page_of_a_robot_s_file_names_every_term_of_a_joint():
    assert [name for name in TERMS if f"`{name}`" not in PAGES["robot-file"].replace("\n", " ")] == []


def test_the_robot_that_is_shown_is_one(tmp_path):
    [text] = [block for block in re.findall(r"```toml\n(.*?)```", PAGES["robot-file"], re.S) if "[[joint]]" in block]
    (tmp_path / "my_arm.toml").write_text(text)
    robot = robots.load("my_arm.toml", tmp_path)
    assert [joint.name for joint in robot.joints] == ["shoulder"]


def test_roles_are_those_that_there_are():
    listed = [role.strip() for row in rows("role") for role in row[0].split(",")]
    assert sorted(listed) == sorted(ROLES)
    comment = re.search(r"^role = .*# (.*)$", PAGES["own-arm"], re.M)[1]
    assert re.split(r", | or ", comment) == list(ROLES)


@pytest.mark.parametrize("page", ["weight", "study"])
def test_the_roles_that_a_tare_may_have_are_said_where_a_tare_is_stated(page):
    assert f"role {' or '.join(TARE_ROLES)}" in PAGES[page]


def test_channels_are_those_that_there_are_with_the_units_taken():
    joint, log = rows("channel of a joint"), rows("channel of the log")
    assert sorted(named(joint)) == sorted(OF_A_JOINT)
    assert sorted(named(log)) == sorted(OF_THE_LOG)
    for row in joint:
        last = OF_A_JOINT[spans(row[0])[-1]]
        kinds = {last.format(position=p, effort=e) for p, e in (("angle", "torque"), ("length", "force"))}
        assert all(SI[kind] in re.split(r", | or ", row[2]) for kind in kinds), row
    for row in log:
        units = [SI[OF_THE_LOG[name]] or "-" for name in spans(row[0])]
        assert row[2] in (", ".join(units), units[0])


def test_formats_and_what_they_need_are_those_that_there_are():
    assert named(rows("format", "files")) == list(FORMATS)
    code = "".join(source.read_text(encoding="utf-8") for source in (PACKAGE / "logs").rglob("*.py"))
    required = {f".venv/bin/pip install {package}" for package in re.findall(r'package="(\w+)"', code)}
    table = rows("package", "licence")
    assert {spans(row[3])[0] for row in table} == required
    optional = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    for row in table:
        [package] = spans(row[0])
        assert spans(row[3])[0].endswith(f" {package}")
        [requirement] = [r for r in optional["all"] if re.match(r"\w+", r)[0] == package]
        assert [requirement] in optional.values()


def test_units_are_those_that_there_are():
    told = re.search(r"Units: (.*?), and rates", TEXT, re.S)[1]
    names = set(re.findall(r"m?N m\b|[^\s,]+", told.replace("N mN", "N, mN")))
    assert names == {unit for unit in UNITS if "/" not in unit}


def test_keys_of_a_study_and_its_logs_are_all_told():
    code = PAGES["own-arm"].partition("```toml")[2].partition("```")[0]
    pages = "\n".join(PAGES[name] for name in ("own-arm", "study", "robot-file", "clocks", "roles", "record"))
    said = re.sub(r"```.*?```", "", pages, flags=re.S)
    told = set(re.findall(r"\b(\w+) = ", code + " ".join(spans(said))))
    told |= set(re.findall(r"\[+(?:log\.)?(\w+)", code)) | {span for span in spans(said) if span.isidentifier()}
    names = {f.name for kind in (LogEntry, Options, AttachedMass) for f in fields(kind)}
    assert names - {"options"} | {"file"} <= told
    changeable = {f.name for f in fields(Joint)} - {"name", "kind", "published", "physical", "printed"}
    assert {"title", "robot", "simulated", "settings", "log", "tool", "length", "baseline"} | changeable <= told
    assert "[robot_overrides." in said


def test_stages_commands_and_options_are_those_that_there_are():
    assert named(rows("stage", "does")) == list(ALL)
    assert named(rows("command", "does")) == list(commands.COMMANDS)
    options = {o for p in typer.main.get_command(app).commands["fit"].params for o in p.opts if o.startswith("--")}
    assert {option.split()[0] for option in named(rows("option", "does"))} == options - {"--help"}


def test_formats_of_an_export_are_those_that_there_are():
    assert named(rows("exported format", "writes")) == list(exports.FORMATS)


def test_targets_of_the_makefile_are_all_told():
    makefile = (ROOT / "Makefile").read_text()
    targets = set(re.findall(r"^([a-z]+):.*##", makefile, re.M))
    listed = set(spans(PAGES["contributing"].partition("targets of the Makefile:")[2].partition("\n\n")[0]))
    assert listed == targets
    for target in named(rows("while you work")):
        assert target.removeprefix("make ") in targets


def test_what_is_to_be_written_has_a_place_and_is_listed_in_one():
    for _, write, _, listed in rows("to add"):
        assert (PACKAGE / spans(write)[0]).parent.is_dir() or (PACKAGE / spans(write.partition(" in ")[2])[0]).exists()
        for file in (span for span in spans(listed) if span.endswith(".py")):
            assert (PACKAGE / file).is_file(), file


def test_old_names_are_gone_and_new_ones_there():
    names = {"stage": set(stages.STAGES), "record": set(KINDS)}
    names["column"] = {column for kind in KINDS.values() for column in (*kind.columns(), *kind.scalars())}
    names["folder in `processed/<study>/`"] = {kind.folder() for kind in KINDS.values()}
    names["hand"] = {name for name, _ in HapticScenario().hands}
    renamed = rows("what", "before")
    assert renamed
    for what, old, new in renamed:
        assert spans(old)[0] not in names[what]
        assert spans(new)[0] in names[what]


def test_the_version_to_be_cited_is_the_package_s():
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"(version {version})" in README
    assert f"\nversion: {version}\n" in (GUIDE / "CITATION.cff").read_text()
    assert version == davinci_forces.__version__
    newest = max(CHANGES, key=lambda name: tuple(map(int, name.split("."))))
    assert version in (newest, f"{newest}.dev0")
    assert ("unreleased" in PAGES[newest].partition("\n")[0]) == version.endswith(".dev0")


WORD = {"source": r"(?:found|table-6\.1|table-6\.1-corrected)"}  # the words of keys that may hold a dot


def patterns() -> dict[str, re.Pattern[str]]:
    """Every key that the README tells, as a pattern; one that begins with a dot ends like the first of its row."""
    found = {}
    for cell, *_ in rows("key", "is"):
        first, *others = spans(cell)
        for key in (first, *(first.rpartition(".")[0] + other for other in others)):
            found[key] = re.compile(re.sub(r"<(\w+)>", lambda m: WORD.get(m[1], "[^.]+"), key.replace(".", r"\.")))
    return found


def told(keys: set[str]) -> tuple[set[str], set[str]]:
    """Keys that no pattern tells, and patterns that tell of none."""
    known = patterns()
    return (
        {key for key in keys if not any(pattern.fullmatch(key) for pattern in known.values())},
        {name for name, pattern in known.items() if not any(pattern.fullmatch(key) for key in keys)},
    )


def made(kind: type[Record], **about: Any) -> Record:
    """A record of a kind with whatever its fields may hold, as if it had been read."""
    rows = 2
    values = {str: "x", float: 1.0, int: 1, tuple[float, ...]: (1.0, 2.0, 3.0, 4.0, 5.0)}
    values |= {column: np.ones(rows, dtype) for column, dtype in COLUMN_DTYPES.items()}
    record = kind(**{f.name: about.get(f.name, values[f.type]) for f in fields(kind)})
    object.__setattr__(record, "origin", Origin("x.parquet", "", {f.name: "" for f in fields(kind)}))
    return record


ROBOT = ("robot.", "control.", "excitation.")
BY_HAND = (*ROBOT, "weight.", "tissue.", "stability.", "haptics.", "guess.", "tip.", "sensor.")


def test_keys_of_a_robot_and_of_what_hangs_on_it_or_pushes_it_are_told_and_those_told_are_there():
    """Of records made by hand, as designing a robot takes half a minute, and the arm of the tests has no chain."""
    records = [made(Links), made(Control), made(Lyapunov), made(Excitation, source="table-6.1")]
    guess = made(Guess, parameter=np.array(["inertia", "offset"], object))
    records += [
        made(Weight),
        made(FreeWeight),
        made(TorqueConstant),
        made(Stiffness),
        made(TissueModel),
        guess,
        made(HandLimit),
        made(HapticResponse),
        made(HapticRun),
    ]
    records += [made(TipForce), made(TipContact), made(TipBudget), made(SensorForce)]
    keys = set(collect(Catalogue(lambda kind: [record for record in records if isinstance(record, kind)])))
    assert {key.partition(".")[0] + "." for key in keys} == set(BY_HAND)
    untold, empty = told(keys)
    assert not untold
    assert not {name for name in empty if name.startswith(BY_HAND)}


@pytest.mark.medium
def test_keys_of_a_study_are_told_and_those_told_are_there(analysed, tmp_path):
    """The study is one that is simulated, so that it has a truth."""
    home = tmp_path / "lab"
    shutil.copytree(analysed.parent.parent, home)
    (home / "raw" / "arm" / "truth.toml").write_text("simulated = true\n[theta.hand_roll]\ninertia = 0.45\n")
    assert CliRunner().invoke(app, ["report", str(home / "raw" / "arm")]).exit_code == 0
    keys = {result["key"] for result in json.loads((home / "reports" / "arm" / "results.json").read_text())}
    assert "truth.hand_roll.inertia" in keys
    untold, empty = told(keys)
    assert not untold
    # Several joints that move in one log, or several identification logs of one, and added terms: here there are none.
    not_here = ("ekf.<log>.<joint>.clock_std", "cv.<log>.<joint>.chosen_by_log.", "choice.<joint>.term.<term>")
    assert not {name for name in empty if not name.startswith((*BY_HAND, *not_here))}


@pytest.mark.medium
def test_the_lines_of_python_run_as_they_are_written(analysed, tmp_path, capsys):
    shutil.copytree(analysed.parent.parent, tmp_path / "lab")
    code = PAGES["python"].partition("```python\n")[2].partition("```")[0]
    exec(code.replace("raw/davinci-demo", str(tmp_path / "lab" / "raw" / "arm")), {})
    printed = capsys.readouterr().out
    assert "nothing to do, all stages are up to date" in printed
    assert "\nN m\n" in printed
    assert "kg m^2" in printed


def test_the_study_file_of_the_guide_is_one(tmp_path):
    (tmp_path / "study.toml").write_text(PAGES["own-arm"].partition("```toml\n")[2].partition("```")[0])
    study = reading.read(tmp_path)
    assert study.settings == Settings(effort={"hand_roll": 0.5})  # the others as they are by default
    assert study.logs[0].joints == ("hand_roll",)


def test_the_page_on_study_files_has_every_key_of_one(tmp_path):
    tables = "tool = { x = 1 }\nbase = { x = 1 }\nsettings = { x = 1 }\nrobot_overrides = { hand_roll = { x = 1 } }\n"
    log = 'name = "a"\nfile = "a.csv"\nrole = "weight"\nx = 1\nweight = { x = 1 }\nchannels = { time = { x = 1 } }\n'
    (tmp_path / "study.toml").write_text(f'robot = "davinci"\nx = 1\n{tables}[[log]]\n{log}')
    with pytest.raises(BadStudy) as caught:
        reading.read(tmp_path)
    known = [keys.split(", ") for keys in re.findall("unknown key 'x'; known keys are (.*)", str(caught.value))]
    assert len(known) == 8
    written = re.findall(r"`(\w+)`|\b(\w+) = |(?m:^|`)\[+(?:log\.)?(\w+)", PAGES["study"])
    assert not {key for keys in known for key in keys} - {word for words in written for word in words}


def test_the_study_page_says_of_free_what_the_page_on_an_own_arm_says():
    free = [re.search(r"\nfree = .*\n( +#.*\n)*", PAGES[page]) for page in ("study", "own-arm")]
    assert free[0] is not None
    assert "validation" in free[0][0]
    assert free[1] is not None
    assert free[0][0] == free[1][0]


@pytest.mark.medium
def test_the_scenario_of_the_guide_is_simulated_and_its_push_found(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("slide.toml").write_text(PAGES["simulate"].partition("```toml\n")[2].partition("```")[0])
    for command in (["simulate", "slide.toml", "raw/slide"], ["measure", "raw/slide"]):
        assert CliRunner().invoke(app, command).exit_code == 0
    push = davinci_forces.read("raw/slide", "Contact").query("stated == 1").iloc[0]
    assert abs(push.peak - 20.0) < 3.0 * push.peak_std < 4.0


def test_what_python_is_offered_is_what_the_guide_shows():
    code = PAGES["python"].partition("```python\n")[2].partition("```")[0]
    assert set(davinci_forces.__all__) <= set(re.findall(r"davinci_forces\.(\w+)\(", code))


def test_readme_and_guide_lead_to_files_that_are_there():
    for file in re.findall(r"`((?:pipeline|tests|raw/d)[\w./-]*\.(?:py|md|toml))`", TEXT):
        assert Path(ROOT / file).is_file(), file
    for page in [ROOT / "README.md", *GUIDE.rglob("*.md")]:
        for link in re.findall(r"\]\(([^)#:]+)(?:#[\w-]+)?\)|src=\"([^\"]+)\"", page.read_text(encoding="utf-8")):
            assert (page.parent / "".join(link)).is_file(), (page.name, link)


def test_no_page_is_left_out_of_the_index_and_none_has_the_name_of_another():
    topics = [file.stem for file in GUIDE.rglob("*.md")]
    assert len(topics) == len(set(topics))
    linked = {Path(link).stem for link in re.findall(r"\]\(([\w./-]+\.md)\)", PAGES["index"])}
    assert linked == {*topics} - {"index", "contributing", "changes", *CHANGES}


def texts_of(folder: Path) -> str:
    """The texts in the code of a folder, with `{}` in the place of values."""
    texts = []
    for file in sorted(folder.rglob("*.py")):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.JoinedStr):
                texts.append("".join(str(v.value) if isinstance(v, ast.Constant) else "{}" for v in node.values))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.append(node.value)
    return "\n".join(texts)


def test_messages_are_those_of_the_stages_and_no_stage_with_remarks_is_left_out():
    table = rows("stage", "the remark says")
    code = "\n".join(texts_of(PACKAGE / room) for room in ("stages", "identification", "logs", "maths", "runner"))
    for stage, says, *_ in table:
        for phrase in spans(says):
            assert phrase in code, (stage, phrase)
    speaking = {f.stem for f in (PACKAGE / "stages").rglob("*.py") if "diagnostic(" in f.read_text(encoding="utf-8")}
    assert {spans(row[0])[0] for row in table} == {name.replace("_", "-") for name in speaking}
    assert len({row[1] for row in table}) == len(table)


def test_every_row_of_a_table_is_below_the_head_of_one():
    for topic, text in PAGES.items():
        blocks = [block.splitlines() for block in re.sub(r"```.*?```", "", text, flags=re.DOTALL).split("\n\n")]
        for lines in blocks:
            rows = [i for i, line in enumerate(lines) if line.startswith("|")]
            assert not rows or lines[rows[0] + 1].startswith("|--"), (topic, lines[rows[0]])


def test_terms_are_in_order_and_each_once():
    terms = [row[0] for row in rows("term", "means")]
    assert terms == sorted(set(terms))


PAGE_ONE = (
    "Verdict", "New path", "Model error", "Error / effort", "R2", "Ceiling", "Detection level", "Sought", "Coverage",
    "95 % band", "caution", "same path", "at rest", "too narrow", "too wide", "external effort", "free space", "run",
    "stated window", "alarm level", "standard error", "stiffness", "quartiles",
)  # fmt: skip


@pytest.mark.parametrize("term", PAGE_ONE)
def test_the_guide_explains_every_term_of_page_one(term):
    page = guide.page(term)
    assert page.topic == "terms"
    assert term.lower() in page.text.lower()
    assert len(page.text) < 400


@pytest.mark.parametrize(
    ("topic", "meant"), [("review", "compare"), ("labveiw", "labview"), ("limits", ".*robot-file")]
)
def test_a_topic_that_is_no_page_names_the_page_whose_title_has_it_or_that_is_spelled_alike(topic, meant):
    with pytest.raises(BadRequest, match=f"did you mean {meant}"):
        guide.page(topic)


@pytest.mark.parametrize(
    ("topic", "words"),
    [
        ("skip", "topic `study`"),
        ("trust", "topic `how-far-to-trust-it`"),
        ("smallest contact", "for a contact in a stated window, the detection level"),
    ],
)
def test_words_that_users_look_up_lead_to_a_page_or_say_which_number_answers(topic, words):
    assert words in guide.page(topic).as_text


@pytest.mark.parametrize(("name", "topic", "says"), [
    ("JointModel", "records", "joint_model; predict; the model of one joint along one log"),
    ("q_tau", "study", "random walk of the external effort"),
])  # fmt: skip
def test_a_name_of_the_reference_is_explained_by_the_tables_that_have_it(name, topic, says):
    first = guide.page(name).as_text.split("\n\n")[0]
    assert first.startswith(f"**`{name}`** (topic `{topic}`): ")
    assert says in first.replace("`", "")


def test_a_topic_that_is_a_notebook_shows_its_words_and_code_and_names_its_file():
    shown = guide.page("from-arrays").as_text
    assert shown.startswith("# From arrays to external efforts")
    assert "```python\nimport numpy as np" in shown
    assert re.search(r"This is the notebook .*from-arrays\.ipynb; Jupyter shows its pictures, too\.$", shown)


def test_a_term_of_two_words_needs_no_quotes():
    shown = CliRunner().invoke(app, ["guide", "detection", "level"])
    assert (shown.exit_code, "detection level: " in shown.output) == (0, True)


def test_a_page_links_every_notebook():
    texts = [page.text for page in guide.pages()]
    for notebook in GUIDE.glob("*.ipynb"):
        assert any(f"{notebook.name})" in text for text in texts), notebook.name


def test_a_topic_is_one_page():
    topics = [page.topic for page in guide.pages()]
    assert sorted(set(topics)) == sorted(topics)


def test_every_link_of_the_guide_s_file_leads_somewhere_in_it():
    file = guide.as_html()
    targets = set(re.findall(r'\bid="([^"]+)"', file))
    assert {page.topic for page in guide.pages()} < targets
    links = re.findall(r'<a [^>]*\bhref="([^"]+)"', file.partition("<script")[0])
    inside = [link for link in links if not link.startswith("https://")]
    assert len(inside) > 100
    assert [link for link in inside if link.removeprefix("#") not in targets] == []


def test_pages_that_are_made_have_every_field_name_and_robot_once():
    pages = {page.topic: page.text for page in guide.pages()}
    headings = re.findall(r"^## (.*)$", pages["fields"], re.M)
    assert headings == [kind.__name__ for kind in KINDS.values()]
    for heading, part in zip(headings, re.split(r"^## .*$", pages["fields"], flags=re.M)[1:], strict=True):
        kind = next(kind for kind in KINDS.values() if kind.__name__ == heading)
        assert sorted(re.findall(r"^\| `(\w+)`", part, re.M)) == sorted((*kind.scalars(), *kind.columns()))
    assert re.findall(r"^## davinci_forces\.(\w+)$", pages["api"], re.M) == davinci_forces.__all__
    assert "Stream.step(t: float, q: ArrayLike, tau: ArrayLike, dq: ArrayLike | None=None)" in pages["api"]
    assert "BadRequest" in pages["api"]
    assert re.findall(r"^## (\w+)$", pages["robots"], re.M) == list(robots.ROBOTS)
    assert "hand_roll" in pages["robots"]


def test_no_page_loses_a_word_on_a_narrow_terminal(monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    for page in guide.pages():
        show_markdown(page.as_text)
        shown = "".join(capsys.readouterr().out.split())
        for name in re.findall(r"^\| `(\w+)` \|", page.text, re.M):
            assert name in shown or len(name) > 12, (page.topic, name)
        assert shown.count("…") == page.text.count("…"), page.topic


def test_no_line_of_code_is_broken_on_a_narrow_terminal(monkeypatch, capsys):
    """A broken comment would be code."""
    monkeypatch.setenv("COLUMNS", "80")
    for page in guide.pages():
        show_markdown(page.as_text)
        shown = {line.rstrip() for line in capsys.readouterr().out.splitlines()}
        code = "".join(re.findall(r"^```\w*\n(.*?)^```", page.as_text, re.M | re.DOTALL))
        assert {line.rstrip() for line in code.splitlines()} <= shown, page.topic
    assert max(map(len, PAGES["python"].partition("```python\n")[2].partition("```")[0].splitlines())) <= 80


def test_the_readme_is_two_screens_to_the_first_result_and_not_much_more():
    assert len(README.splitlines()) <= 130
    assert len(README.split()) <= 1000
    assert "leave no joint without an identification log" in README  # the only one of a joint may be on page one
    assert README.index("make all") < 4000


def test_the_keys_of_a_log_that_the_readme_names_make_a_study(tmp_path):
    *stated, (weight, tare) = re.findall(r"(?m)^   - `([^`]+)`(?: and `([^`]+)`)?:", README)
    logs = (
        log_table("bare", "bare.csv", "validation", ["instrument_slide"]),
        log_table("pushed", "pushed.csv", "contact", ["hand_roll"], "\n".join(line for line, _ in stated)),
        log_table("loaded", "loaded.csv", "weight", ["instrument_slide"], f"{weight}\n{tare}"),
    )
    (tmp_path / "study.toml").write_text("".join(['title = "Mine"\nrobot = "davinci"\nsimulated = true\n', *logs]))
    study = reading.read(tmp_path)
    assert (study.log("loaded").weight.mass, study.log("loaded").tare) == (0.5, "bare")
    assert (study.log("pushed").free, study.log("pushed").contact) == (((0.0, 5.0),), ((12.0, 14.5),))


@pytest.mark.medium
def test_the_lines_of_python_of_the_readme_and_of_streams_run(analysed, tmp_path, capsys):
    shutil.copytree(analysed.parent.parent, tmp_path / "lab")
    for text in (README, PAGES["stream"]):
        for code in re.findall(r"```python\n(.*?)```", text, re.S):
            exec(code.replace("raw/davinci-demo", str(tmp_path / "lab" / "raw" / "arm")), {})
    assert "starting" in capsys.readouterr().out


def test_the_lines_on_the_force_at_the_tip_give_the_force_that_the_report_gives(monkeypatch, capsys):
    efforts = test_tip.efforts("davinci", test_tip.PUSH) + test_tip.noise(3)
    tracks = test_tip.tracks("davinci", efforts)
    rows = [
        {name: getattr(t, name) for name in ("t", "q", "tau_ext_smooth", "tau_ext_smooth_std", "tau_ext_direct")}
        for t in tracks
    ]
    every = pd.concat([pd.DataFrame(row | {"joint": t.joint}) for row, t in zip(rows, tracks, strict=True)])
    monkeypatch.setattr(davinci_forces, "read", lambda *_, **__: every)
    made: dict = {}
    exec(PAGES["tip-force"].partition("```python\n")[2].partition("```")[0], made)
    force = test_tip.run("davinci", tracks)[TipForce]
    np.testing.assert_allclose(made["force"], np.column_stack([force.f_x, force.f_y, force.f_z]), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(made["C"][:, 0, 1], force.c_xy, rtol=1e-6)
    said = capsys.readouterr().out
    assert "left in the efforts: 0.0" in said
    printed = re.search(r"without smoothing: \[(.*?)\]", said)[1]
    np.testing.assert_allclose(made["J"][made["k"]].T @ np.array(printed.split(), float), made["direct"], rtol=1e-6)


def test_estimators_are_those_that_there_are():
    assert named(rows("estimator", "finds")) == list(ESTIMATORS)
