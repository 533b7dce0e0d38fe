"""Pages of the documentation: their examples are run, their commands and links exist."""

from __future__ import annotations

import doctest
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest

from chimera_hpc.cli.main import main, parser
from chimera_hpc.job.registry import CUT_FIGURES, FIGURES

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", *sorted(DOCS.glob("*.md"))]
OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
PROGRAM = r"(?:python -m chimera_hpc\.sweep|chimera-hpc|scripts/run) "
IN_BLOCK = re.compile(rf"^ *(?:\$ )?{PROGRAM}(.*)$", re.MULTILINE)
IN_TEXT = re.compile(rf"`{PROGRAM}([^`]*)`")


def code_blocks(text: str, language: str) -> Iterator[str]:
    """Fenced blocks of one language, in order."""
    for match in re.finditer(rf"^```{language}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        yield match.group(1)


def examples(page: Path) -> str:
    """Blocks with prompts, one after the other: they share their names."""
    blocks = code_blocks(page.read_text(encoding="utf-8"), "python")
    return "\n".join(block for block in blocks if block.startswith(">>> "))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder in which the command of the page on library use was typed."""
    folder = tmp_path_factory.mktemp("pages")
    (block,) = code_blocks((DOCS / "library.md").read_text(encoding="utf-8"), "console")
    words = shlex.split(block.removeprefix("$ python -m chimera_hpc.sweep "))
    out = words.index("--out") + 1
    words[out] = str(folder / words[out])
    assert main([*words, "--cluster", "serial", "--no-figures"]) == 0
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("page", [p for p in PAGES if examples(p)], ids=lambda page: page.stem)
def test_examples_give_what_the_page_prints(page, small, monkeypatch):
    monkeypatch.chdir(small)
    test = doctest.DocTestParser().get_doctest(examples(page), {}, page.stem, str(page), 0)
    said: list[str] = []
    result = doctest.DocTestRunner(optionflags=OPTIONS).run(test, out=said.append)
    assert result.attempted > 0
    assert result.failed == 0, "".join(said)


def test_the_program_of_the_readme_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    programs = code_blocks((ROOT / "README.md").read_text(encoding="utf-8"), "python")
    (program,) = [block for block in programs if not block.startswith(">>> ")]
    exec(compile(program, "README.md", "exec"), {})
    assert re.fullmatch(r"\((0\.\d+(, )?){3}\)\n", capsys.readouterr().out)


def commands(page: Path) -> list[str]:
    """Command lines of ours that a page prints, without what a shell takes from them."""
    text = page.read_text(encoding="utf-8").replace("\\\n", " ")
    lines = [*IN_BLOCK.findall(text), *(" ".join(x.split()) for x in IN_TEXT.findall(text))]
    return [re.sub(r"(^|\s)[#>&|].*$|\s{3,}.*$", "", line) for line in lines]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_commands_of_a_page_are_accepted(page, capsys):
    wrong = []
    for line in commands(page):
        words = shlex.split(line) or ["jobs/quickstart.toml"]
        if words[0].startswith(("COMMAND", "JOB")) or any(w.startswith("[-") for w in words):
            continue  # a form, not a command
        if words[0].endswith(".toml"):
            words.insert(0, "run")
        try:
            parser().parse_args(words)
        except SystemExit as end:
            if end.code:  # 0 after --help
                wrong.append(f"{line}: {capsys.readouterr().err.splitlines()[-1]}")
    assert wrong == []


def test_there_are_commands_to_check():
    assert sum(len(commands(page)) for page in PAGES) > 20


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_and_pictures_of_a_page_exist(page):
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    targets = re.findall(r"\]\(([^)\s#]+)[^)]*\)", text)
    files = [target for target in targets if not re.match(r"\w+:", target)]
    assert [target for target in files if not (page.parent / target).exists()] == []


def test_gallery_has_every_figure_of_the_registry():
    text = (DOCS / "gallery.md").read_text(encoding="utf-8")
    rows = "".join(line.split("|")[1] for line in text.splitlines() if line.startswith("| `"))
    assert set(re.findall(r"`(\w+)`", rows)) == {*FIGURES, *CUT_FIGURES}


def test_every_page_is_in_the_contents():
    index = (DOCS / "index.md").read_text(encoding="utf-8").replace("[", "").replace("]", "")
    pages = {p.relative_to(DOCS).with_suffix("").as_posix() for p in DOCS.glob("*.md")}
    pages |= {f"notebooks/{p.stem}" for p in DOCS.glob("notebooks/*.ipynb")}
    assert pages - set(index.split()) == {"index"}


def test_the_site_is_built_from_the_code_as_it_is(monkeypatch):
    monkeypatch.syspath_prepend(str(DOCS))
    from generated import command_line, job_file_tables, statuses, store_arrays

    assert "| `rtol` | number above 0 | `0.001` | Relative tolerance. |" in job_file_tables()
    assert "usage: python -m chimera_hpc.sweep plan" in command_line()
    assert "| `u` | point, time, node | int16 | 58 x 5001 x 50 |" in store_arrays()
    assert "| 255 | `never` | never run |" in statuses()
