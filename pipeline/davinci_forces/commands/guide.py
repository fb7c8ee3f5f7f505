"""Show the guide: the list of topics, one topic, or all pages as one HTML file for a browser (--html)."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from davinci_forces.errors import BadRequest
from davinci_forces.files import write_bytes
from davinci_forces.runner.console import echo, show_markdown

DEFAULT_FILE = Path("davinci-forces-guide.html")


def run(
    topic: Annotated[list[str] | None, Argument(help="Topic or term to show; without one, the list of topics.")] = None,
    html: Annotated[bool, Option("--html", help="Write the whole guide as one HTML file, for offline use.")] = False,
    out: Annotated[Path | None, Option(help=f"File that --html writes, instead of {DEFAULT_FILE}.")] = None,
) -> None:
    """Show a topic or the list of topics in the terminal, or write the HTML file and say where it is."""
    from davinci_forces import guide

    page = guide.page(" ".join(topic)) if topic else None
    if not html:
        if out:
            raise BadRequest("--out names the file that --html writes; add --html")
        show_markdown(page.as_text if page else guide.contents())
        return
    file = out or DEFAULT_FILE
    write_bytes(file, guide.as_html().encode())
    echo(f"see {file}{f'#{page.topic}' if page else ''}")
