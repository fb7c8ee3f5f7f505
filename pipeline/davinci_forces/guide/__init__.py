"""The guide: pages of Markdown in folders by purpose, for the terminal and as one HTML file that needs no network."""

import base64
import hashlib
import json
import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from difflib import get_close_matches
from functools import cache, cached_property
from pathlib import Path

from davinci_forces.errors import BadRequest
from davinci_forces.guide import generated

FOLDER = Path(__file__).parent
CHANGES, NOTEBOOKS = "changes", "notebooks"  # folders; pages of the second are made from *.ipynb beside this module
GROUPS = {  # folder -> its heading, in the order of the list
    "tutorials": "Tutorials: learn by doing",
    NOTEBOOKS: "Notebooks: from Python",
    "how-to": "How to: one task each",
    "reference": "Reference: every name, from the code",
    "explanation": "Explanation: how and why",
    "": "The project",
    CHANGES: "Changes, by version",
}
INDEX, TERMS = "index", "terms"  # topics of the page that lists the others, and of that which explains terms
LINK = re.compile(r"(?<!!)\[([^\]]+)\]\((?:[\w./-]*/)?([\w.-]+)\.(?:md|ipynb)(?:#([\w-]+))?\)")  # a page
COMMENT = re.compile(r"<!--.*?-->\n?", re.DOTALL)
PICTURE = re.compile(r"[\w./-]+\.png")


@dataclass(frozen=True)
class Page:
    """A page of the guide; its topic is the stem of its file."""

    topic: str
    folder: str
    title: str
    summary: str  # one sentence
    write: Callable[[], str]  # makes the Markdown, with title and summary

    @cached_property
    def text(self) -> str:
        """The Markdown of the page."""
        return self.write()

    @property
    def as_text(self) -> str:
        """The Markdown for a terminal: links to pages become their topics, and a notebook says where its file is."""
        file = FOLDER / f"{self.topic}.ipynb"
        pictures = f"\n\nThis is the notebook {file}; Jupyter shows its pictures, too." * (self.folder == NOTEBOOKS)
        return LINK.sub(lambda link: f"{link[1]} (topic `{link[2]}`)", self.text) + pictures


@cache
def pages() -> tuple[Page, ...]:
    """All pages, by group; in a group in the order in which the index links them."""
    found = [_read(file) for file in FOLDER.rglob("*.md")]
    found += [_notebook(file) for file in FOLDER.glob("*.ipynb")]
    found += [_made(topic, *about) for topic, about in generated.PAGES.items()]
    index = next(page for page in found if page.topic == INDEX)
    order = [INDEX, *(link[2] for link in LINK.finditer(index.text))]
    place = {topic: i for i, topic in reversed(list(enumerate(order)))}
    groups = list(GROUPS)
    return tuple(sorted(found, key=lambda p: (groups.index(p.folder), place.get(p.topic, len(order)), p.topic)))


def page(topic: str) -> Page:
    """The page of a topic, or what the page of terms says of a term, or the tables of other pages of a name.

    Raises BadRequest if there is none; it names the topics that hold these words, or are spelled most alike.
    """
    by_topic = {page.topic: page for page in pages()}
    if topic in by_topic:
        return by_topic[topic]
    words = rf"(?<!\w){re.escape(topic)}s?(?!\w)"
    rows = re.findall(rf"(?mi)^\| ([^|]*{words}[^|]*) \|(.*)\|$", by_topic[TERMS].text)
    others = re.findall(rf"(?mi)^\| ([^|]*) \|(.*{words}.*)\|$", by_topic[TERMS].text) if not rows else []
    if rows or others:
        meanings = [f"“{topic}” is no term of its own, but stands in what these mean:"] * (not rows)
        meanings += [f"**{term}**:{means}" for term, means in rows or others]
        return replace(by_topic[TERMS], write=lambda: "\n\n".join(meanings))
    named = re.compile(rf"(?m)^\| `{re.escape(topic)}` \|(.*)\|$")
    rows = [(page.topic, row) for page in by_topic.values() for row in named.findall(page.text)]
    if rows:
        lines = (f"**`{topic}`** (topic `{where}`): {row.replace(' |', ';').strip()}" for where, row in rows)
        return replace(by_topic[rows[0][0]], write=lambda: "\n\n".join(lines))
    lasting = {t: page for t, page in by_topic.items() if page.folder != CHANGES}
    titled = [t for t, page in lasting.items() if topic.lower() in f"{t} {page.title}".lower()]
    share = {t: len(re.findall(words, page.text, re.IGNORECASE)) / len(page.text) for t, page in lasting.items()}
    holding = sorted(filter(share.get, share), key=share.__getitem__, reverse=True)
    close = titled[:3] or holding[:3] or get_close_matches(topic.lower(), by_topic, 3, 0.4)
    meant = f"did you mean {' or '.join(close)}? " if close else ""
    raise BadRequest(f"the guide has no topic {topic!r}; {meant}`davinci-forces guide` lists all topics")


def by_group() -> list[tuple[str, list[Page]]]:
    """The heading of each group that has pages, with its pages."""
    listed = [(heading, [page for page in pages() if page.folder == folder]) for folder, heading in GROUPS.items()]
    return [(heading, members) for heading, members in listed if members]


def contents() -> str:
    """The list of topics as Markdown, by group, each with its summary."""
    about = "`davinci-forces guide TOPIC` shows a page, or explains a term of the report."
    lines = ["# davinci-forces: the guide", "", about]
    for heading, members in by_group():
        lines += ["", f"## {heading}", "", *(f"- **{page.topic}**: {page.summary}" for page in members)]
    return "\n".join(lines)


def as_html() -> str:
    """The guide as one HTML file with a search that needs no network; the same pages give the same bytes."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    from davinci_forces.report.writers.html import TEMPLATES
    from davinci_forces.report.writers.pictures import NAMES, looks

    environment = Environment(
        loader=FileSystemLoader([FOLDER, TEMPLATES]), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
    )  # fmt: skip
    script = (FOLDER / "search.js").read_text(encoding="utf-8")
    hashed = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    bodies = {page.topic: Markup(body(page)) for page in pages()}
    return environment.get_template("page.html").render(
        groups=by_group(), bodies=bodies, looks=looks(NAMES.values()), script=Markup(script), hash=f"sha256-{hashed}"
    )


def body(page: Page) -> str:
    """One page as HTML, with headings a level lower, names of its headings, and links within the file."""
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    text = LINK.sub(lambda link: f"[{link[1]}](#{link[2]}{f'--{link[3]}' if link[3] else ''})", page.text)
    tokens = parser.parse(text)
    for i, token in enumerate(tokens):
        if token.type in ("heading_open", "heading_close"):
            token.tag = f"h{int(token.tag[1]) + 1}"
        if token.type == "heading_open" and token.tag != "h2":
            token.attrSet("id", f"{page.topic}--{slug(tokens[i + 1].content)}")
        for child in token.children or ():
            if child.type == "image":
                child.attrSet("src", _address(page, str(child.attrGet("src"))))
    html = str(parser.renderer.render(tokens, parser.options, {}))
    return html.replace("<table>", '<div class="scroll"><table>').replace("</table>", "</table></div>")


def slug(heading: str) -> str:
    """The name of a heading in links: lower case, with `-` for blanks and without signs."""
    return re.sub(r"\s+", "-", re.sub(r"[^\w\s-]", "", heading.lower()).strip())


def _address(page: Page, source: str) -> str:
    """The data URL of a picture beside a page."""
    file = FOLDER / page.folder / source
    return f"data:image/png;base64,{base64.b64encode(file.read_bytes()).decode()}" if PICTURE.fullmatch(source) else ""


def _read(file: Path) -> Page:
    text = COMMENT.sub("", file.read_text(encoding="utf-8"))
    title, summary = (" ".join(part.split()) for part in text.split("\n\n", 2)[:2])
    folder = file.parent.relative_to(FOLDER).as_posix().removeprefix(".")
    return Page(file.stem, folder, title.removeprefix("# "), summary, lambda: text)


def _notebook(file: Path) -> Page:
    """The words and the code of a notebook."""
    cells = json.loads(file.read_bytes())["cells"]
    texts = [(cell["cell_type"], "".join(cell["source"])) for cell in cells]
    shown = [text if kind == "markdown" else f"```python\n{text}\n```" for kind, text in texts]
    title, summary = shown[0].split("\n\n", 2)[:2]
    return Page(file.stem, NOTEBOOKS, title.removeprefix("# "), summary, lambda: "\n\n".join(shown))


def _made(topic: str, title: str, summary: str, body: Callable[[], str]) -> Page:
    return Page(topic, "reference", title, summary, lambda: f"# {title}\n\n{summary}\n\n{body()}")
