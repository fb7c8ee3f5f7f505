"""The guide as one HTML file: every page, their list, and a search that works without a network."""

import base64
import hashlib
import re

from davinci_forces.guide import FOLDER, GROUPS, LINK, Page, pages

PICTURE = re.compile(r"[\w./-]+\.png")


def render() -> str:
    """The whole file; the same pages give the same bytes."""
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
    listed = [(heading, [page for page in pages() if page.folder == folder]) for folder, heading in GROUPS.items()]
    groups = [(heading, members) for heading, members in listed if members]
    bodies = {page.topic: Markup(body(page)) for page in pages()}
    return environment.get_template("page.html").render(
        groups=groups, bodies=bodies, looks=looks(NAMES.values()), script=Markup(script), hash=f"sha256-{hashed}"
    )


def body(page: Page) -> str:
    """One page as HTML, with headings a level lower, names of its headings, and links within the file."""
    from markdown_it import MarkdownIt

    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    tokens = parser.parse(LINK.sub(_within, page.text))
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


def _within(link: re.Match[str]) -> str:
    """A link to a page as a link to its place in the file."""
    return f"[{link[1]}](#{link[2]}{f'--{link[3]}' if link[3] else ''})"


def _address(page: Page, source: str) -> str:
    """The data URL of a picture beside a page."""
    file = FOLDER / page.folder / source
    return f"data:image/png;base64,{base64.b64encode(file.read_bytes()).decode()}" if PICTURE.fullmatch(source) else ""
