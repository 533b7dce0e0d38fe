"""Commands that print something for other programs: shells and editors."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from chimera_hpc.cli import COMMANDS


def test_bash_accepts_the_script_and_completes_commands_and_choices(sweep, tmp_path):
    code, script, _ = sweep("completion", "bash")
    assert code == 0
    (tmp_path / "script").write_text(script)
    typed = {
        "chimera-hpc ": {command.name for command in COMMANDS},
        "chimera-hpc run --clus": {"--cluster"},
        "chimera-hpc completion ": {"bash", "zsh"},
    }
    for line, wanted in typed.items():
        words = line.split(" ")
        typed_words = " ".join(word or '""' for word in words)
        program = (
            f"source {tmp_path / 'script'}; COMP_WORDS=({typed_words}); "
            f"COMP_CWORD={len(words) - 1}; _shtab_chimera_hpc; printf '%s\\n' ${{COMPREPLY[@]}}"
        )
        done = subprocess.run(["bash", "-c", program], capture_output=True, text=True, check=True)
        assert wanted <= set(done.stdout.split()), line


def test_job_files_and_folders_are_completed_as_such(sweep):
    _, script, _ = sweep("completion", "bash")
    assert "run_pos_0_COMPGEN=_shtab_compgen_files" in script
    assert "status_pos_0_COMPGEN=_shtab_compgen_dirs" in script


def test_zsh_script_names_the_program(sweep):
    assert sweep("completion", "zsh")[1].startswith("#compdef chimera-hpc\n")


def test_completion_without_its_library_is_bad_input(sweep, monkeypatch):
    monkeypatch.setitem(sys.modules, "shtab", None)
    code, _, errors = sweep("completion", "bash")
    assert code == 2
    assert errors == (
        "error: completion: shtab is missing; pip install 'chimera_hpc[completion]' brings it\n"
    )


def test_an_unknown_shell_is_bad_input(sweep):
    with pytest.raises(SystemExit) as caught:
        sweep("completion", "csh")
    assert caught.value.code == 2


def test_the_schema_is_printed_as_json(sweep):
    code, text, _ = sweep("schema")
    assert code == 0
    assert json.loads(text)["title"] == "Job file of chimera_hpc"
