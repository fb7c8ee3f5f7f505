"""The robot that the analysis assumes: its kinematic chain, its links, and the workspace of its tip."""

from collections.abc import Iterator

from davinci_forces.records import Links, Pose, Workspace
from davinci_forces.report.content import Block, Figure3D, Line3D, Points3D, Prose, Table, literal
from davinci_forces.report.context import Context
from davinci_forces.report.sections.parts import section_of


@section_of(Links, "The robot", "robot")
def section(context: Context, records: list[Links]) -> Iterator[Block]:
    """The chain and its table.  Tables 3.1, 4.2, Fig 3.5"""
    links, worst = records[0], context.results["robot.worst_condition"].number(3)
    yield Prose(
        f"The {literal(context.study.robot.title)} is modelled as a Denavit-Hartenberg chain. The parallelogram's "
        "links share the coordinate of the pitch, so the tool pivots about a remote centre without a bearing there. "
        "Forces at the tip follow from efforts at the joints through the Jacobian. Its condition number reaches "
        f"{worst} within the joints' limits: this factor can multiply the relative error of an effort."
    )
    rows = tuple(
        (
            literal(link),
            literal(links.parent[i]),
            "–" if links.moved_by[i] == 0 else f"$q_{links.moved_by[i]}$",
            *context.numbers(f"robot.link.{link}", ("alpha", "a", "d", "offset", "mass"), 4),
        )
        for i, link in enumerate(links.link)
    )
    header = ("Link", "On", "Moved by", "$alpha$", "$a$", "$d$", "$theta$ at 0", "Mass")
    yield Table("Denavit-Hartenberg parameters and masses of the links.", header, rows, "links-table", "lllrrrrr")
    yield chain(context)


def walk(pose: Pose) -> list[int]:
    """The frames in the order of one line along every link, which goes to and fro at branches."""
    number = {name: i for i, name in enumerate(pose.link)}
    path = [0]
    for i in range(1, len(pose.link)):
        up, down = ([start] for start in (path[-1], i))
        for way in (up, down):
            while way[-1] != 0:
                way.append(number[pose.parent[way[-1]]])
        meet = next(frame for frame in up if frame in down)
        path += up[1 : up.index(meet) + 1] + down[: down.index(meet)][::-1]
    return path


def chain(context: Context) -> Figure3D:
    """The chain at three configurations, and the places that its tip reaches."""
    colours = {"zero": "black", "low": "blue", "high": "vermillion"}
    configurations = {"zero": "q = 0", "low": "lower limits", "high": "upper limits"}
    marks: list[Line3D | Points3D] = []
    for workspace in context.catalogue.records(Workspace):
        marks.append(Points3D(workspace.x, workspace.y, workspace.z, "places of the tip", "sky"))
    for pose in context.catalogue.records(Pose):
        path = walk(pose)
        marks.append(
            Line3D(pose.x[path], pose.y[path], pose.z[path], configurations[pose.pose], colours[pose.pose])  # type: ignore[arg-type]
        )
    return Figure3D(
        "The chain at q = 0 and at both ends of the joints' ranges, with places that the tip reaches in between.",
        "The robot's links as lines in space at three configurations, and the cloud of places of its tip.",
        tuple(marks),
        height=110,
    )
