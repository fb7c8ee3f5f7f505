"""Install packages into the environment of this interpreter: by uv, or by pip where uv fails for any reason.

    python .ci/install.py --require-hashes -r LOCK
    python .ci/install.py --slim

The arguments are those of `pip install`.  uv is the machine's, or pip brings the pinned one into the environment.  It
needs a third of pip's processor time.  It gets pip's settings: package indexes, folders of wheels, certificates.
`--slim` removes what running does not need: that uv, and the tests of packages, a tenth of the environment.
"""

import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check", "-q"]
PINNED = Path(__file__).with_name("install.lock")
SETTINGS = {  # pip's setting -> uv's variable
    "index-url": "UV_DEFAULT_INDEX",
    "extra-index-url": "UV_INDEX",
    "find-links": "UV_FIND_LINKS",
    "no-index": "UV_NO_INDEX",
    "trusted-host": "UV_INSECURE_HOST",
    "cert": "SSL_CERT_FILE",
    "proxy": "ALL_PROXY",
    "timeout": "UV_HTTP_TIMEOUT",
}


def main(*arguments: str) -> int:
    """Install packages, without what they need in turn, or remove what running does not need; the exit code."""
    if arguments == ("--slim",):
        return slim()
    try:
        command = [uv(), "pip", "install", "-q", "--python", sys.executable, "--no-deps", *arguments]
        subprocess.run(command, check=True, env=os.environ | settings())
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"uv could not install ({error}), so pip does: {' '.join(arguments)}", file=sys.stderr)
        return subprocess.run([*PIP, "install", "--no-deps", *arguments]).returncode
    return 0


def slim() -> int:
    """Remove uv and the tests of packages from the environment; the exit code."""
    for folder in [*Path(sysconfig.get_path("purelib")).glob("*/**/tests")]:
        if folder.parts[-4:-2] != ("scipy", "io"):  # which hold files of MATLAB that our tests read
            shutil.rmtree(folder, ignore_errors=True)
    return subprocess.run([*PIP, "uninstall", "-y", "uv"], capture_output=True).returncode


def uv() -> str:
    """The uv of this machine or of the environment, which pip installs where there is none."""
    place = str(Path(sys.executable).parent)
    found = shutil.which("uv", path=place) or shutil.which("uv")
    if found is None:
        subprocess.run([*PIP, "install", "--require-hashes", "--no-deps", "-r", str(PINNED)], check=True)
        found = shutil.which("uv", path=place)
    return found or "uv"


def settings() -> dict[str, str]:
    """uv's environment, by pip's settings; the most specific of several files, and pip's variables, come last."""
    listed = subprocess.run([*PIP, "config", "list"], capture_output=True, text=True, check=True).stdout
    stated = dict(line.split("=", 1) for line in listed.splitlines() if "=" in line)
    by_name = {name.rpartition(".")[2]: value.strip("'\"").replace("\\n", " ") for name, value in stated.items()}
    found = {SETTINGS[name]: " ".join(value.split()) for name, value in by_name.items() if name in SETTINGS}
    if "UV_FIND_LINKS" in found:
        found["UV_FIND_LINKS"] = found["UV_FIND_LINKS"].replace(" ", ",")
    found["UV_INDEX_STRATEGY"] = "unsafe-best-match"  # all indexes alike, as for pip; the hashes keep that safe
    return {name: value for name, value in found.items() if name not in os.environ}


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
