"""The documentation holds: commands and examples run, links lead somewhere, names exist."""

import ast
import doctest
import importlib
import io
import itertools
import re
from contextlib import redirect_stdout

import doc_commands
import pytest
from commands import ROOT
from markdown import COMMANDS, FENCE, Page, write_files

import attjax
from attjax.config.presets import PRESETS
from attjax.config.settings import FIELDS

README = Page(ROOT / "README.md")
INDEX = Page(ROOT / "docs" / "README.md")
CONTRIBUTING = Page(ROOT / "CONTRIBUTING.md")
PAGES = [README, CONTRIBUTING, *(Page(path) for path in sorted((ROOT / "docs").rglob("*.md")))]
LINKING = [*PAGES, Page(ROOT / "CHANGELOG.md")]
LANGUAGES = {COMMANDS, "python", "text", "toml", "c", "json"}
PEERS = ("gymnasium", "stable_baselines3", "sb3_contrib", "gymnax", "rejax", "evosax")


def name(page):
    return str(page.path.relative_to(ROOT))


def each(pages):
    return pytest.mark.parametrize("page", pages, ids=name)


PROGRAMS = [
    pytest.param(page, block, id=f"{name(page)}:{block.line}")
    for page in PAGES
    for block in page.blocks
    if block.language == "python" and ">>> " not in block.text
]


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """A folder like a clone of this repository, and the current one."""
    doc_commands.prepare(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    return tmp_path


@each([page for page in PAGES if page.commands])
def test_commands_run(page, clone):
    write_files(page, clone)
    for line, words in page.commands:
        try:
            doc_commands.run(words)
        except (AssertionError, SystemExit, doc_commands.Unknown) as error:
            shown = f"{name(page)}:{line}: {' '.join(words)}"
            raise AssertionError(f"{shown}\n{error or 'failed'}") from error


@each(PAGES)
def test_commands_in_the_text_have_flags_that_there_are(page):
    for words in filter(None, map(doc_commands.with_values, page.inline_code)):
        try:
            doc_commands.check(words)
        except SystemExit as error:
            raise AssertionError(f"{name(page)}: {' '.join(words)}") from error


@each(PAGES)
def test_flags_in_the_text_exist(page):
    texts = [code for code in page.inline_code if doc_commands.with_values(code) is None]
    mentioned = set(re.findall(r"(?<![\w-])--[a-z][\w-]*", " ".join(texts)))
    assert mentioned <= doc_commands.known_flags()


@each(PAGES)
def test_blocks_have_a_language_and_are_none_of_a_list(page):
    """After a list, forges take an indented block for its last item's text."""
    for block in page.blocks:
        assert block.language in LANGUAGES, block
        before = [line for line in page.lines[: block.line - 1] if line.strip()]
        if not FENCE.match(before[-1]):
            paragraph = itertools.takewhile(str.strip, reversed(page.lines[: block.line - 2]))
            assert not re.match(r"(-|\*|\d+\.) ", list(paragraph)[-1]), block


@pytest.mark.parametrize("page, block", PROGRAMS)
def test_python_runs(page, block, clone):
    """A block runs by itself, and prints what the block of text right after it says."""
    write_files(page, clone)
    for peer in PEERS:
        if peer in block.text:
            pytest.importorskip(peer)
    printed = io.StringIO()
    with redirect_stdout(printed):
        exec(compile(block.text, f"{name(page)}:{block.line}", "exec"), {"__name__": "__main__"})
    assert_printed(page.output_of(block), printed.getvalue())


def assert_printed(expected, printed):
    matches = doctest.OutputChecker().check_output(
        expected.strip() + "\n", printed.strip() + "\n", doctest.ELLIPSIS
    )
    assert matches, f"expected:\n{expected}\nprinted:\n{printed}"


@each(LINKING)
def test_links_lead_somewhere(page):
    for link in page.links:
        if re.match(r"https?://|mailto:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.path.parent / path).resolve() if path else page.path
        assert target.exists(), link
        assert not anchor or anchor in Page(target).anchors, link


@pytest.mark.parametrize(
    "path", sorted((ROOT / "docs" / "examples").glob("*.*")), ids=lambda path: path.name
)
def test_files_of_examples_are_shown_as_they_are(path):
    """But for what a file says of itself at its top."""
    shown = [block.text.strip() for page in PAGES for block in page.blocks]
    assert any(text and path.read_text().strip().endswith(text) for text in shown)


def test_every_page_is_reached_from_the_index():
    reached, following = {README.path}, [INDEX.path]  # the README's own links do not count
    while following:
        path = following.pop()
        reached.add(path)
        targets = [(path.parent / x.partition("#")[0]).resolve() for x in Page(path).links]
        following += [x for x in targets if x.suffix == ".md" and x not in reached]
    assert {page.path for page in PAGES} <= reached
    assert "docs/README.md" in README.links


def test_the_readme_fits_on_two_screens():
    assert len(README.path.read_text().split()) <= 700


def test_the_citation_names_this_version():
    assert f"\nversion: {attjax.__version__}\n" in (ROOT / "CITATION.cff").read_text()


def test_every_preset_is_described():
    text = (ROOT / "docs" / "train.md").read_text()
    for preset in PRESETS:
        assert f"| `{preset}` |" in text


def test_the_table_of_presets_is_of_the_presets():
    text = (ROOT / "docs" / "concepts.md").read_text()
    names = re.search(r"^\| \| `(precise.+)` \|$", text, re.MULTILINE)[1].split("` | `")
    rows = re.findall(r"^\| `(\w+)` \| (.+) \|$", text, re.MULTILINE)
    table = {setting: cells.split(" | ") for setting, cells in rows}
    assert set(names) == set(PRESETS)
    for field in FIELDS.values():
        values = [shown(PRESETS[name].flat[field.name]) for name in names]
        if field.name in table or len(set(values)) > 1:
            assert table[field.name] == values, field.name


def shown(value):
    if isinstance(value, tuple):
        return ",".join(map(str, value))
    return {True: "yes", False: "no"}[value] if isinstance(value, bool) else str(value)


API = re.findall(
    r"\[`attjax\.(?:([\w.]+)\.)?(\w+)`\]\(\.\./attjax/([\w/]+)\.py\)",
    (ROOT / "docs/api.md").read_text(),
)


@pytest.mark.parametrize("module, member, file", API, ids=lambda x: x)
def test_names_of_the_api_exist_and_are_described(module, member, file):
    described = descriptions(ast.parse((ROOT / "attjax" / f"{file}.py").read_text()))
    assert not member.startswith("_")
    assert described[member], f"{file}.{member} has no docstring"
    place = pytest.importorskip(f"attjax.{module}".rstrip("."), reason="a peer is not here")
    source = importlib.import_module(f"attjax.{file}".replace("/", "."))
    assert getattr(place, member) is getattr(source, member)


def descriptions(module):
    """By name, what a module says of each function, class and constant that it defines."""
    described = {}
    for node, later in itertools.pairwise([*module.body, ast.Pass()]):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            described[node.name] = ast.get_docstring(node)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            is_text = isinstance(later, ast.Expr) and isinstance(later.value, ast.Constant)
            text = later.value.value if is_text else None
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            described |= {x.id: text for x in targets if isinstance(x, ast.Name)}
    return described


def test_the_api_has_every_public_name_of_the_top_level():
    assert {member for module, member, _ in API if not module} == set(attjax.__all__)


def test_tests_that_pages_name_are_there():
    tests = {path.name: path.read_text() for path in (ROOT / "tests").rglob("test_*.py")}
    pages = [ROOT / "CONTRIBUTING.md", *(ROOT / "docs").rglob("*.md")]
    text = "\n".join(path.read_text() for path in pages)
    named = re.findall(r"`(test_\w+\.py)(?:::(test_[\w…]+))?`", text)
    assert len(named) > 100
    for file, test in named:
        pattern = test.replace("…", r"\w*") or r"test_\w+"
        assert re.search(rf"^def {pattern}\(", tests[file], re.MULTILINE), (file, test)


def test_the_reference_can_be_built(tmp_path):
    pytest.importorskip("pdoc")
    result = doc_commands.python_process("docs/reference.py", str(tmp_path))
    assert result.returncode == 0, result.stderr
    assert not re.search("[Ww]arn", result.stderr), result.stderr
    assert 'id="AttitudeEnv"' in (tmp_path / "attjax.html").read_text()
    assert "Table 1" in (tmp_path / "attjax" / "envs" / "simulator.html").read_text()
    for path in tmp_path.rglob("*.html"):  # what a docstring that is not understood becomes
        assert not re.search(r"<blockquote>\s*<blockquote>", path.read_text()), path.name
