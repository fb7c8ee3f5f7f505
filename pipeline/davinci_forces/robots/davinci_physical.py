"""The physical parameters of the da Vinci's joints, 12, 21 and 7: first guesses, and the box they are searched in.

The guesses are those of Tables 4.1 and 4.2, by which the thesis computed those of Tables 6.4-6.6.  It does not print
its box.  This one holds every value that such a link or motor could have, and no more, the same for all of a kind.
"""

import numpy as np

from davinci_forces.maths.models.physical import Physical, PhysicalTable, Quality
from davinci_forces.robots.davinci_chain import CHAIN, DRIVES, GUESSED_LC5, in_table_frames

BOX = {
    Quality.MASS: (0.0, 5.0),  # [kg]
    Quality.CENTRE: (0.0, 0.6),  # [m]; the longest bar measures 0.515 m
    Quality.MOMENT: (0.0, 0.1),  # [kg m^2]
    Quality.ROTOR: (0.0, 5e-5),  # [kg m^2]
    Quality.VISCOUS: (0.0, 20.0),
    Quality.COULOMB: (0.0, 20.0),
}
AXES = {"x": 0, "y": 1, "z": 2}
GUESSED = in_table_frames(GUESSED_LC5)


def motor(joint: int) -> tuple[Physical, ...]:
    """The rotor's inertia, and the friction of motor and joint together."""
    guesses = (
        (f"Jm{joint + 1}", Quality.ROTOR, DRIVES.motor_inertia),
        (f"v{joint + 1}", Quality.VISCOUS, DRIVES.viscous),
        (f"c{joint + 1}", Quality.COULOMB, DRIVES.coulomb),
    )
    return tuple(Physical(name, quality, float(x[joint]), *BOX[quality]) for name, quality, x in guesses)


def masses(*links: str) -> tuple[Physical, ...]:
    """Masses by link."""
    at = map(CHAIN.links.index, links)
    guesses = zip(links, GUESSED.masses[list(at)].tolist(), strict=True)
    return tuple(Physical(f"m{link}", Quality.MASS, guess, *BOX[Quality.MASS], link) for link, guess in guesses)


def centres(*links: str) -> tuple[Physical, ...]:
    """How far centres of mass are from the origins of the links' frames, along the axis that they lie on."""
    found = []
    for link in links:
        centre = GUESSED.centres[CHAIN.links.index(link)]
        axis = int(np.abs(centre).argmax())
        found.append(Physical(f"lc{link}", Quality.CENTRE, float(-centre[axis]), *BOX[Quality.CENTRE], link, axis))
    return tuple(found)


def moments(*named: str) -> tuple[Physical, ...]:
    """Moments of inertia, by axis and link."""
    found = []
    for name in named:
        axis, link = AXES[name[0]], name[1:]
        guess = float(GUESSED.inertias[CHAIN.links.index(link), axis, axis])
        found.append(Physical(f"I{name}", Quality.MOMENT, guess, *BOX[Quality.MOMENT], link, axis))
    return tuple(found)


def table(joint: int, *parameters: tuple[Physical, ...]) -> PhysicalTable:
    """The physical parameters of a joint of the arm's three."""
    return PhysicalTable(CHAIN, joint, 3, (*motor(joint), *(x for part in parameters for x in part)))


# (6.7) leaves out links 6 to 9.
ROLL = table(0, masses("3", "4", "5"), centres("3", "5"), moments("y2", "y3", "x4", "x5"))
# (6.10) leaves out Iz7, which only adds to Iy6; the print's signs do not matter, for the chain says how each enters.
PITCH = table(
    1,
    masses("3", "4", "5", "6", "7", "8", "9L"),
    centres("3", "5", "6", "7", "8", "9L"),
    moments("z3", "y5", "y6", "y8", "y9L"),
)
SLIDE = table(2, masses("6", "7", "8", "9L"))
