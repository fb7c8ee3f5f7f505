"""The version of the package, which pyproject.toml and the citation state, too."""

VERSION = "0.2.0.dev0"
