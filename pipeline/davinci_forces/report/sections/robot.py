"""The robot that the analysis assumes: its kinematic chain, its links, and the workspace of its tip."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Column, Links, Pose, Workspace
from davinci_forces.report.content import Block, Figure3D, Prose, Table, literal
from davinci_forces.report.content.marks import Colour, Line3D, Points3D
from davinci_forces.report.content.number import MISSING
from davinci_forces.report.context import Context
from davinci_forces.report.sections.parts import explanation, section_of, strokes


@section_of("The robot", "robot", Links)
def section(context: Context, records: list[Links]) -> Iterator[Block]:
    """The chain and its table.  Tables 3.1, 4.2, Fig 3.5"""
    links, worst = records[0], context.number("robot.worst_condition", 3)
    tabulated = not np.isnan(links.alpha).all()
    chain_kind = "a Denavit-Hartenberg chain" if tabulated else "a tree of links"
    moved_by = [coordinate for coordinate in links.moved_by.tolist() if coordinate]
    shared = len(set(moved_by)) < len(moved_by)
    parallelogram = f"{explanation('robot-parallelogram')} " * shared
    unbounded = "has no bound: the Jacobian is singular within the joints' limits, or a joint has no limits."
    reach = unbounded if worst == MISSING else f"reaches {worst} within the joints' limits."
    robot = literal(context.study.robot.title)
    yield Prose(explanation("robot", robot=robot, kind=chain_kind, parallelogram=parallelogram, reach=reach))
    rows = []
    for link, parent, coordinate in zip(links.link, links.parent, links.moved_by, strict=True):
        mover = f"$q_{coordinate}$" if coordinate else "–"
        numbers = context.numbers(f"robot.link.{link}", ("alpha", "a", "d", "offset", "mass"), 4)
        rows.append((literal(link), literal(parent), mover, *numbers))
    header = ("Link", "On", "Moved by", "$alpha$", "$a$", "$d$", "$theta$ at 0", "Mass")
    caption = "Denavit-Hartenberg parameters and masses" if tabulated else "Joints and masses"
    yield Table(f"{caption} of the links.", header, tuple(rows), "links-table", "lllrrrrr")
    yield chain(context)


def links_in_space(pose: Pose) -> Column:
    """A line from each frame to the one that carries it, as one interrupted line (3 N, 3)."""
    number = {name: i for i, name in enumerate(pose.link)}
    frames = np.column_stack([pose.x, pose.y, pose.z])
    return strokes(frames[[number[name] for name in pose.parent[1:]]], frames[1:])


def chain(context: Context) -> Figure3D:
    """The chain at three configurations, and the places that its tip reaches."""
    configurations: dict[str, tuple[str, Colour]] = {
        "zero": ("q = 0", "black"), "low": ("lower limits", "blue"), "high": ("upper limits", "vermillion"),
    }  # fmt: skip
    places = (Points3D(w.x, w.y, w.z, "places of the tip", "sky") for w in context.catalogue.records(Workspace))
    poses = ((links_in_space(pose).T, configurations[pose.pose]) for pose in context.catalogue.records(Pose))
    marks: tuple[Line3D | Points3D, ...] = (*places, *(Line3D(x, y, z, *looks) for (x, y, z), looks in poses))
    caption = "The chain at q = 0 and at both ends of the joints' ranges, with places that the tip reaches in between."
    alt = "The robot's links as lines in space at three configurations, and the cloud of places of its tip."
    return Figure3D(caption, alt, marks, height=110)
