"""The text files of the package that are filled in for the user."""

from importlib import resources
from string import Template


def read(path: str) -> str:
    """A template as it is.

    Args:
        path: of the file, from the package's folder, with slashes.
    """
    return resources.files("attjax").joinpath(*path.split("/")).read_text(encoding="utf-8")


def fill(path: str, **values: str) -> str:
    """A template with its ``$names`` replaced."""
    return Template(read(path)).substitute(values)
