"""The model as a ROS 2 package: joint states in, external efforts and the force at the tip out.

Its core is `filters.online` and `filters.sample`, copied; it needs rclpy and numpy alone.
"""

import json
from pathlib import Path

from davinci_forces.errors import BadRequest
from davinci_forces.exports.identified import Export, Rendering
from davinci_forces.files import read_bytes, text_of
from davinci_forces.filters import online, sample

NAME = "davinci_forces_stream"  # of the package, the module and the executable
CORE = (online, sample)
HERE = "from davinci_forces.filters."  # of an import in the core, which becomes relative
TEMPLATES = ("package.xml", "setup.py", "node.py")


def render(export: Export) -> Rendering:
    """Render the package, to be built by colcon.

    Raises BadRequest if a joint has no filter, or filters have different rates.
    """
    document = export.document()
    try:
        online.Stream(document)
    except ValueError as error:
        raise BadRequest(f"{export.study.name}: {error}") from error
    head = [line.replace("--", "- -").replace('"""', "'''").replace("\\", "/") for line in export.head()]
    values = {"HEAD": "\n".join(head), "COMMENT": "\n".join(f"# {line}" for line in head), "NAME": NAME}
    values["VERSION"] = ".".join(part for part in export.origin.version.split(".") if part.isdigit())
    files = {name: text_of(read_bytes(Path(__file__).with_name(f"{name}.in"))) for name in TEMPLATES}
    for key, value in values.items():
        files = {name: text.replace(f"@{key}@", value) for name, text in files.items()}
    files[f"{NAME}/node.py"] = files.pop("node.py")
    for module in CORE:
        source = text_of(read_bytes(Path(str(module.__file__)))).replace(HERE, "from .")
        files[f"{NAME}/{module.__name__.rpartition('.')[2]}.py"] = f"{values['COMMENT']}\n{source}"
    place = f"$base/lib/{NAME}\n"
    files |= {
        "setup.cfg": f"{values['COMMENT']}\n[develop]\nscript_dir={place}[install]\ninstall_scripts={place}",
        f"resource/{NAME}": values["COMMENT"] + "\n",
        f"{NAME}/__init__.py": f'"""External efforts of an arm.\n\n{values["HEAD"]}\n"""\n',
        f"{NAME}/model.json": json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n",
    }
    return Rendering(files, export.remarks())
