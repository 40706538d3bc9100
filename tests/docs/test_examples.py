"""Every example of README and docs/ is run, and what it prints is compared.

```python   is executed; lines with >>> are doctests. Blocks of one page share their names.
```console  lines after `$` are run, by bash or in this process; lines below are what stdout must hold (...: anything).
```toml     a block that begins with the comment `# NAME.toml` is that file for the examples below it; all must be TOML.
```sh       is too long or too interactive to run: every clamp3d in it must be a command with options that exist.
"""

import doctest
import os
import re
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path

import click
import pytest
from sybil import Sybil
from sybil.example import SybilFailure
from sybil.parsers.markdown import CodeBlockParser, PythonCodeBlockParser

from clamp3d import cli
from tests.command import call
from tests.docs.project import PAGES, ROOT

PYTHON = shlex.quote(sys.executable)
BASH = f'clamp3d() {{ {PYTHON} -m clamp3d "$@"; }}; python() {{ {PYTHON} "$@"; }}\n'


def in_bash(command):
    return subprocess.run(
        ["bash", "-c", BASH + command], capture_output=True, text=True, timeout=300, env=ENVIRONMENT, check=False
    )


def in_process(command):
    """A command that asks nothing of the shell."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("COLUMNS", ENVIRONMENT["COLUMNS"])
        return subprocess.CompletedProcess(command, *call(*shlex.split(command)[1:]))


def console(example):
    """Run each command of a console block, and compare what it prints."""
    for session in re.split(r"^\$ ", example.parsed, flags=re.MULTILINE)[1:]:
        command, _, expected = session.partition("\n")
        plain = re.fullmatch(r"""clamp3d ([^|<>&;$`*"]|"[^$`"]*")*""", command)
        done = in_process(command) if plain else in_bash(command)
        if done.returncode not in (0, 1, 3):
            return f"{command}\nexit code {done.returncode}: {done.stderr}"
        expected = "\n".join(line.rstrip() for line in expected.strip("\n").split("\n")) + "\n"
        got = "\n".join(line.rstrip() for line in done.stdout.strip("\n").split("\n")) + "\n"
        if expected.strip() and not doctest.OutputChecker().check_output(expected, got, doctest.ELLIPSIS):
            return f"{command}\nwanted:\n{expected}\ngot:\n{got}\nstderr:\n{done.stderr}"
    return None


def toml(example):
    """A file of the reader's, if its first line is its name."""
    tomllib.loads(example.parsed)
    if name := re.match(r"# ([\w-]+\.toml)\n", example.parsed):
        Path(name[1]).write_text(example.parsed, encoding="utf-8")


def shell(example):
    """Commands and options of a block that is not run."""
    for line in example.parsed.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words[:1] == ["clamp3d"]:
            command = cli.group.get_command(click.Context(cli.group), words[1])
            if command is None:
                return f"no such command: {line}"
            options = {name for option in command.params for name in (*option.opts, *option.secondary_opts)}
            unknown = [w for w in words[2:] if w.startswith("-") and w != "-" and w.split("=")[0] not in options]
            if unknown:
                return f"{line}: unknown {unknown}"
    return None


ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "120"}
SYBIL = Sybil(
    parsers=[
        PythonCodeBlockParser(doctest_optionflags=doctest.ELLIPSIS),
        CodeBlockParser("console", console),
        CodeBlockParser("toml", toml),
        CodeBlockParser("sh", shell),
    ],
    path=str(ROOT),
)


def run(page):
    for example in SYBIL.parse(page).examples():
        example.evaluate()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_examples(page, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for folder in ("examples", "meshes", "docs"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    run(page)


WRONG = ["python\n>>> 1 + 1\n3", "toml\na =", "sh\nclamp3d run --nonsense"]
WRONG += [f"console\n$ {text}" for text in ("echo 2\n3", "exit 2", "clamp3d conductors\n3", "clamp3d check --no")]


@pytest.mark.parametrize("block", WRONG)
def test_a_wrong_example_is_seen(block, tmp_path):
    page = tmp_path / "page.md"
    page.write_text(f"```{block}\n```\n")
    with pytest.raises((SybilFailure, tomllib.TOMLDecodeError)):
        run(page)
