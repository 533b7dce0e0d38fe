"""Bad input is one line on stderr and exit status 2, and nothing is written."""

import os
from argparse import ArgumentTypeError

import pytest
from jobs_for_tests import BARE, job_text

from chimera_hpc.cli.main import parser
from chimera_hpc.sweep import main

JOB = job_text(BARE, {"name": "bad", "grid.seeds": 2})


@pytest.fixture
def job(tmp_path):
    file = tmp_path / "bad.toml"
    file.write_text(JOB)
    return file


def refused(arguments, capsys):
    """The one line that a refused command prints."""
    assert main([str(argument) for argument in arguments]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1, lines
    assert "Traceback" not in lines[0]
    return lines[0]


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("features.n_peeks=9", ["n_peeks", "n_peaks"]),
        ("grid.R=3", ["R"]),
        ("P=text", ["P"]),
        ("n_nodes=8.5", ["n_nodes"]),
        ("P=[2, 25]", ["P", "n_nodes"]),
        ("Q=[5]", ["Q", "P"]),
        ("flips=101", ["flips", "links"]),
        ("epsilon=0", ["epsilon", "above 0"]),
        ("P=[]", ["P", "empty"]),
        ("P=[3, 3]", ["P"]),
        ("seeds=0", ["seeds"]),
        ("seeds=[1, 1]", ["seeds"]),
        ("features.start=1000", ["features.start", "t_end"]),
        ('reduction.show=["sigma=0.1"]', ["reduction.show", "sigma"]),
        ('reduction.replay=["P=3 Q=9"]', ["reduction.replay", "Q"]),
        ("features.start=-1", ["features.start"]),
        ("features.n_overlap=10", ["n_overlap", "n_peaks"]),
        ("integrator.rtol=nan", ["rtol"]),
        ("integrator.method=rk4", ["method", "tsit5"]),
        ("keep.series=some", ["series", "first-seed"]),
        ("reduction.linkage=single", ["linkage", "ward"]),
    ],
)
def test_bad_value_is_refused_with_what_and_where(override, words, job, tmp_path, capsys):
    line = refused(["run", job, "--set", override, "--out", tmp_path / "out"], capsys)
    for word in words:
        assert word in line
    assert sorted(os.listdir(tmp_path)) == ["bad.toml"]


def test_missing_job_file_is_refused(tmp_path, capsys):
    assert "nowhere.toml" in refused(["run", tmp_path / "nowhere.toml"], capsys)


def test_job_that_is_not_toml_is_refused_with_its_line(tmp_path, capsys):
    file = tmp_path / "job.toml"
    file.write_text('name = "x"\nmodel == 3\n')
    assert "line 2" in refused(["plan", file], capsys)


@pytest.mark.parametrize("command", ["status", "reduce", "retry", "verify"])
def test_folder_without_a_store_is_refused(command, tmp_path, capsys):
    assert str(tmp_path) in refused([command, tmp_path], capsys)


def test_store_of_another_sweep_is_refused_with_the_keys_that_differ(job, tmp_path, capsys):
    from chimera_hpc.job import Sweep
    from chimera_hpc.store.store import Store

    out = tmp_path / "out"
    out.mkdir()
    Store.plan(out / "store.zarr", Sweep.load(job))
    before = {path: path.read_bytes() for path in out.rglob("*") if path.is_file()}
    changes = ["--set", "epsilon=0.04", "--set", "integrator.rtol=1e-4"]
    line = refused(["run", job, "--out", out, *changes], capsys)
    assert "epsilon" in line
    assert "rtol" in line
    after = {path: path.read_bytes() for path in out.rglob("*.json") if path.is_file()}
    assert all(before[path] == content for path, content in after.items())


def test_folder_that_cannot_be_made_is_refused(job, tmp_path, capsys):
    file = tmp_path / "file"
    file.write_text("")
    assert "file" in refused(["run", job, "--out", file / "out"], capsys)
    assert file.read_text() == ""


@pytest.mark.parametrize("workers", ["0", "-3"])
def test_workers_below_one_are_refused(workers, job, tmp_path, capsys):
    line = refused(["run", job, "--out", tmp_path / "out", "--workers", workers], capsys)
    assert "--workers" in line
    assert not (tmp_path / "out").exists()


def test_scheduler_file_that_is_missing_is_refused(job, tmp_path, capsys):
    arguments = ["run", job, "--out", tmp_path / "out", "--cluster", "scheduler-file"]
    line = refused([*arguments, "--scheduler-file", tmp_path / "none.json"], capsys)
    assert "none.json" in line


def test_an_empty_name_of_a_file_or_folder_is_refused_by_every_command(capsys):
    commands = parser()._subparsers._group_actions[0].choices
    asked = [(name, action) for name, sub in commands.items() for action in sub._actions]
    files = {"DIR", "FILE", "STORE", "JOB.toml"}
    found = [action for _, action in asked if files & {action.metavar}]
    assert len(found) > 20
    for action in found:
        for text in ("", " "):
            with pytest.raises(ArgumentTypeError, match="empty; the name of a file or folder"):
                action.type(text)
    with pytest.raises(SystemExit) as end:
        main(["export", "results", "--to", ""])
    assert end.value.code == 2
    assert "--to: empty" in capsys.readouterr().err


def test_merge_without_the_name_of_the_new_folder_is_refused(capsys):
    with pytest.raises(SystemExit) as end:
        main(["merge", "one", "two"])
    assert end.value.code == 2
    assert "required: --out" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((), "the following arguments are required: COMMAND"),
        (("classify",), "the following arguments are required: FILE"),
        (("classify", "u.npz", "--bridge", "x"), "argument --bridge: invalid int value: 'x'"),
        (("plan", "job", "--one\ntwo"), "unrecognized arguments: --one\\ntwo"),
    ],
)
def test_a_wrong_command_line_is_one_line_too(
    words: tuple[str, ...], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(words)
    out, error = capsys.readouterr()
    assert (stop.value.code, out) == (2, "")
    assert error.startswith(f"error: {said}; python -m chimera_hpc.sweep ")
    assert error.endswith(" --help shows the usage\n")
    assert error.count("\n") == 1
