"""Old names of settings are read; nothing that was stored changes its digest."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

from chimera_hpc import fourier_features
from chimera_hpc.base import renaming
from chimera_hpc.base.errors import BadInput
from chimera_hpc.cli.main import main
from chimera_hpc.job import Sweep, checks
from chimera_hpc.job.reading import apply_overrides

JOB = """
name = "renamed"
model = "topological_fhn"
[grid]
P = "3:5"
Q = "0:P"
epsilon = [0.02, 0.05]
seeds = 2
[features]
"""
OLD = """clock = "own"
n_share = 4
clock_node = 1
still = 0.02
"""
NEW = """window_reference = "own"
n_overlap = 4
reference_node = 1
steady_threshold = 0.02
"""


def load(text: str, overrides: tuple[str, ...] = ()) -> Sweep:
    return Sweep.from_toml_text(JOB + text, overrides)


def test_a_job_with_old_names_is_the_job_with_the_new_ones() -> None:
    with pytest.warns(FutureWarning, match=renaming.IS_RENAMING) as said:
        old = load(OLD)
    assert old == load(NEW)
    assert len(said) == 4
    assert "features.clock is called features.window_reference" in str(said[0].message)


def test_the_digest_is_that_of_version_0_1() -> None:
    # Printed by version 0.1 for the same job with its own names.
    assert load("").digest == DIGESTS["default"]
    assert load(NEW).digest == DIGESTS["own"]


DIGESTS = {"default": "959f5f9efe7aa8e5", "own": "60bdab624293f709"}


def test_a_stored_spec_with_old_names_is_read_in_silence() -> None:
    spec = load(NEW).to_dict()
    names = {new: old for old, new in renaming.FEATURES.items()}
    spec["features"] = {names.get(key, key): value for key, value in spec["features"].items()}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert Sweep.from_dict(spec) == load(NEW)


def test_both_names_at_once_are_refused() -> None:
    with pytest.raises(BadInput, match=r"features\.clock: unknown key"):
        load('clock = "own"\nwindow_reference = "own"')


def test_an_override_may_use_an_old_name_on_a_job_with_the_new_one() -> None:
    with pytest.warns(FutureWarning):
        sweep = load(NEW, ("features.clock=ring", "still=0.5"))
    assert sweep.features.window_reference == "ring"
    assert sweep.features.steady_threshold == 0.5


def test_the_command_line_says_each_new_name_on_one_line(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["plan", "quickstart", "--set", "clock=own", "--set", "features.clock=own"]
    assert main(words) == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("note: features.clock is called features.window_reference since")


def test_fourier_features_takes_its_old_arguments() -> None:
    t = 0.01 * np.arange(2001)
    u = np.cos(2 * np.pi * (t[:, None] * [1.0, 1.1]))
    with pytest.warns(FutureWarning, match=renaming.IS_RENAMING):
        old = fourier_features(t, u, n_share=1, clock="own")  # type: ignore[call-arg]
    new = fourier_features(t, u, n_overlap=1, window_reference="own")
    assert old.as_array().tobytes() == new.as_array().tobytes()


def test_every_axis_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[Any] = []
    parse = checks.parse_axis

    def counted(raw: Any, parameter: Any) -> Any:
        read.append(parameter.name)
        return parse(raw, parameter)

    monkeypatch.setattr(checks, "parse_axis", counted)
    sweep = load("")
    for _ in range(2):
        assert len(sweep.points()) == (4 + 5 + 6) * 2 * 2
        assert sweep.digest
        assert sweep.to_dict()["grid"] == {
            "P": "3:5",
            "Q": "0:P",
            "epsilon": [0.02, 0.05],
            "seeds": 2,
        }
        assert list(sweep.seeds) == [0, 1]
    assert sorted(read) == ["P", "Q", "epsilon"]


@pytest.mark.parametrize(
    ("override", "table", "value"),
    [
        ("n_peaks=5", "features", 5),
        ("t_end=500.0", "integrator", 500.0),
        ("series=none", "keep", "none"),
        ("b=0.7", "fixed", 0.7),
        ("P=3:8", "grid", "3:8"),
        ("seeds=4", "grid", 4),
    ],
)
def test_a_bare_key_is_looked_up_in_every_table(override: str, table: str, value: Any) -> None:
    data = {"model": "topological_fhn", "grid": {"P": 3}}
    key = override.partition("=")[0]
    assert apply_overrides(data, [override])[table][key] == value


def test_a_bare_key_that_two_tables_have_is_a_parameter() -> None:
    data = {"model": "topological_fhn", "grid": {}}
    assert apply_overrides(data, ["workers=3"])["fixed"] == {"workers": 3}
