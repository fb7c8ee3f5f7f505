"""A six-joint arm like the UR10: published Denavit-Hartenberg lengths and masses, plausible centres and inertias."""

from pathlib import Path

JOINTS = [  # name, offset, angles, axis, position, velocity and effort limit, mass, centre, moments of inertia
    ("pan", "0 0 0.1273", "0 0 0", "0 0 1", 6.2832, 2.16, 330, 7.778, "0 0.02 -0.01", (0.0315, 0.0315, 0.0219)),
    ("lift", "0 0.2209 0", "0 1.5708 0", "0 1 0", 6.2832, 2.16, 330, 12.93, "0 -0.04 0.24", (0.4216, 0.4216, 0.0364)),
    ("elbow", "0 -0.1719 0.612", "0 0 0", "0 1 0", 3.1416, 3.15, 150, 3.87, "0 0.01 0.24", (0.1111, 0.1111, 0.0109)),
    ("wrist-1", "0 0 0.5723", "0 1.5708 0", "0 1 0", 6.2832, 3.2, 54, 1.96, "0 0.1 0.01", (0.0051, 0.0051, 0.0055)),
    ("wrist-2", "0 0.1149 0", "0 0 0", "0 0 1", 6.2832, 3.2, 54, 1.96, "0 0.01 0.1", (0.0051, 0.0051, 0.0055)),
    ("wrist-3", "0 0 0.1157", "0 0 0", "0 1 0", 6.2832, 3.2, 54, 0.202, "0 0.06 0", (0.00014, 0.00014, 0.00022)),
]


def write(folder: Path, joints: int = 6) -> Path:
    """Write the URDF of the first joints into a folder."""
    text, parent = '<robot name="six"><link name="base"/>', "base"
    for name, xyz, rpy, axis, position, velocity, effort, mass, centre, (xx, yy, zz) in JOINTS[:joints]:
        inertia = f'<inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" ixz="0" iyz="0"/>'
        inertial = f'<inertial><origin xyz="{centre}"/><mass value="{mass}"/>{inertia}</inertial>'
        limit = f'<limit lower="{-position}" upper="{position}" velocity="{velocity}" effort="{effort}"/>'
        text += (
            f'<link name="{name}_link">{inertial}</link><joint name="{name}" type="revolute"><parent link="{parent}"/>'
            f'<child link="{name}_link"/><origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}</joint>'
        )
        parent = f"{name}_link"
    (folder / "six.urdf").write_text(text + "</robot>")
    return folder / "six.urdf"
