"""What the Markdown pages hold: code blocks, code in the text, links and anchors.

The convention: an indented block, or a fenced one marked sh, holds commands to paste; where
their output follows, each command has ``$ `` in front. Everything else is fenced: ``python`` to
run, ``text`` for what is only to be read, ``toml`` and so on for files.
"""

import dataclasses
import re
import shlex
from pathlib import Path

COMMANDS = "sh"
FENCE = re.compile(r"```(\S*)")


@dataclasses.dataclass(frozen=True)
class Block:
    """A code block: the line it starts at, its language and its text."""

    line: int
    language: str
    text: str

    @property
    def height(self) -> int:
        return len(self.text.splitlines())


@dataclasses.dataclass(frozen=True)
class Page:
    """A Markdown page."""

    path: Path

    @property
    def lines(self) -> list[str]:
        return self.path.read_text().splitlines()

    @property
    def blocks(self) -> list[Block]:
        return list(_blocks(self.lines))

    def output_of(self, block: Block) -> str:
        """The text in the block right after this fenced one, "" if there is none."""
        start = block.line + block.height + 3
        texts = [x.text for x in self.blocks if x.language == "text" and x.line == start]
        return "".join(texts)

    @property
    def prose(self) -> str:
        """The text without its code blocks and comments."""
        lines = self.lines
        for block in self.blocks:
            for index in range(block.line - 1, block.line - 1 + block.height):
                lines[index] = ""
        text = "\n".join(line for line in lines if not FENCE.match(line))
        return re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)

    @property
    def inline_code(self) -> list[str]:
        return [" ".join(code.split()) for code in re.findall(r"`([^`]+)`", self.prose)]

    @property
    def links(self) -> list[str]:
        """The targets of its links and images."""
        return re.findall(r"\]\(([^)\s]+)\)", re.sub(r"`[^`]*`(?!\])", "", self.prose))

    @property
    def anchors(self) -> set[str]:
        """What forges make of its headings."""
        headings = re.findall(r"^#+ (.+)$", self.prose, re.MULTILINE)
        return {re.sub(r"[^\w\- ]", "", x.lower()).replace(" ", "-") for x in headings}

    @property
    def commands(self) -> list[tuple[int, list[str]]]:
        """(line, words) of the commands in its blocks."""
        shells = [block for block in self.blocks if block.language == COMMANDS]
        return [command for block in shells for command in _commands(block)]


def _blocks(lines):
    fence, start, kept = None, 0, []
    for number, line in enumerate([*lines, ""], 1):
        opened = FENCE.match(line)
        if fence is not None and line.startswith("```"):
            yield Block(start, fence, "\n".join(kept))
            fence, kept = None, []
        elif fence is not None:
            kept.append(line)
        elif opened:
            fence, start = opened[1], number + 1
        elif line.startswith("    ") and (kept or not lines[number - 2].strip()):
            start = start if kept else number
            kept.append(line[4:])
        elif kept and line.strip():
            yield Block(start, COMMANDS, "\n".join(kept).rstrip())
            kept = []
        elif kept:
            kept.append("")
    if kept:
        yield Block(start, COMMANDS, "\n".join(kept).rstrip())


def _commands(block):
    lines = re.sub(r"\\\n\s*", " ", block.text).splitlines()
    prompted = any(line.startswith("$ ") for line in lines)
    for number, line in enumerate(lines, block.line):
        if line.startswith("$ ") or (line.strip() and not prompted):
            words = split(line.removeprefix("$ "))
            if words:
                yield number, words


def split(command: str) -> list[str]:
    """The words of a command, without its comment; ``&&`` and ``>`` are words of their own."""
    lexer = shlex.shlex(command, posix=True, punctuation_chars="&>|;")
    lexer.whitespace_split = True
    return list(lexer)


def write_files(page: Page, folder: Path) -> None:
    """Write the files that a page shows: blocks whose first line names them, ``# name``."""
    for block in page.blocks:
        named = re.match(r"# ([\w.-]+\.(?:py|toml|json))$", block.text.split("\n")[0])
        if named:
            (folder / named[1]).write_text(block.text + "\n")
