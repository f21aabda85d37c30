"""The text files in attjax/templates that are filled in for the user."""

from importlib import resources
from string import Template


def read(name: str) -> str:
    """A template as it is."""
    return resources.files("attjax").joinpath("templates", name).read_text(encoding="utf-8")


def fill(name: str, **values) -> str:
    """A template with its ``$names`` replaced."""
    return Template(read(name)).substitute(values)
