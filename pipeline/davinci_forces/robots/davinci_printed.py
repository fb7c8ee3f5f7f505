"""The parameters that the thesis prints for the da Vinci's joints, Tables 6.4 to 6.6, and what is wrong with them."""

from davinci_forces.robots.robot import Printed, PrintedColumn

GUESSES = "The printed error of the initial guesses does not belong to the printed guesses."

ROLL = Printed(
    "Table 6.4",
    (
        PrintedColumn("", (0.3843, 0.194, 1.0, 1.0), 1.3899),
        PrintedColumn("wlse", (0.4521, 0.0110, 0.3707, 0.2203), 0.0199),
        PrintedColumn("lse", (0.4528, 0.0103, 0.3706, 0.21968), 0.0197),
        PrintedColumn("pso", (0.4528, 0.0103, 0.3705, 0.2197), 0.0197),
    ),
    (GUESSES, "The guessed inertia of 0.3843 cannot be reproduced from Tables 4.1 and 4.2."),
)
PITCH = Printed(
    "Table 6.5",
    (
        PrintedColumn("", (0.2961, 1.9475, 0.115, 1.0, 0.1), 2.9145),
        PrintedColumn("wlse", (0.2381, 0.1350, 0.064, 0.9110, 0.4151), 0.0461),
        PrintedColumn("lse", (0.2384, 0.1343, 0.0705, 0.9064, 0.4155), 0.0460),
        PrintedColumn("pso", (0.2406, 0.1345, 0.0704, 0.9061, 0.4156), 0.0460),
    ),
    (
        GUESSES,
        "The guessed 0.115 of gravity's cosine was computed with +0.01 (m3 + m4) in place of −0.01 (m3 + m4).",
        "The 0.064 that weighted least squares are said to find for it should be about 0.070.",
    ),
)
SLIDE = Printed(
    "Table 6.6",
    (
        PrintedColumn("", (0.141, 1e-6, 1.0, 3.0), 8.8435),
        PrintedColumn("wlse", (2.4610, -0.0750, 3.2723, 3.9842), 1.8100),
        PrintedColumn("lse", (2.5626, -0.0712, 3.2723, 3.9840), 1.8101),
        PrintedColumn("pso", (2.485, 0.0003, 3.1939, 3.9975), 2.2986),
    ),
    (
        GUESSES,
        "The guessed mass of 0.141 kg cannot be reproduced from Tables 4.1 and 4.2.",
        "The 2.4610 kg that weighted least squares are said to find should be about 2.561.",
        "The error of 2.2986 of the swarm is not what its bounds cost, which is 0.0007: the swarm stuck.",
        "The sign of the inertia is 0.3 standard deviations from zero: it was not seen.",
    ),
)
