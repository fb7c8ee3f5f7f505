"""Write a commented study.toml for logs, with a guess of what their channels measure."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from davinci_forces.errors import BadRequest
from davinci_forces.files import write_bytes
from davinci_forces.runner.console import echo, table


def run(
    files: Annotated[list[Path], Argument(help="Logs, or the folder of the study that holds them: raw/<study>.")],
    robot: Annotated[
        str, Option(help="davinci, dvrk_psm, or a .toml or .urdf file in the study's folder.", show_default="guessed")
    ] = "",
    study: Annotated[Path | None, Option(help="Folder of the study, instead of the first log's.")] = None,
    show: Annotated[bool, Option("--print", help="Print the text instead of writing study.toml.")] = False,
) -> None:
    """Describe logs in a study.toml, and print what to check; an existing file is never overwritten."""
    from davinci_forces.study.draft import describe, is_folder, logs_in

    folder = study or (files[0] if is_folder(files[0]) else files[0].parent)
    draft = describe(logs_in(files), folder, robot)
    if show:
        echo(draft.text)
        return
    target = folder / "study.toml"
    if target.exists():
        remedy = "move or delete it, then run `new` again; --print shows the new text and writes nothing"
        raise BadRequest(f"{target} exists already, and `new` overwrites nothing: {remedy}")
    if draft.arm.text:
        write_bytes(folder / draft.arm.name, draft.arm.text.encode())
        echo(f"{folder / draft.arm.name}: {draft.arm.reason}; check the kinds of its joints and their terms")
        if len(draft.arm.robot.joints) > 1:
            echo("in it no joint's motion loads another: `davinci-forces guide robot-file` adds links")
    write_bytes(target, draft.text.encode())
    echo("\n".join(table([("file", "role", "rate", "joints", "look at"), *draft.rows])))
    if all(row.role in ("left out", "-") for row in draft.rows):
        remedy = "give its lines the position and the effort of each joint, uncomment them"
        echo(f"{target}: written, but no log can be used as it is: {remedy}, and run `davinci-forces all {folder}`")
    else:
        if draft.remark:
            echo(f"efforts are computed from currents: {draft.remark}")
        echo(f"{target}: written; check the channels, then run `davinci-forces all {folder}`")
