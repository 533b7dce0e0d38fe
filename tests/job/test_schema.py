"""The JSON Schema of a job file: what it passes, what it marks."""

from __future__ import annotations

import tomllib
from typing import Any

import jsonschema
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job import Sweep
from chimera_hpc.job.schema import job_schema
from chimera_hpc.job.shipped import jobs_folder

OTHERS = {"claims.toml", "causes.toml"}
JOBS = [file for file in sorted(jobs_folder().rglob("*.toml")) if file.name not in OTHERS]
VALIDATOR = jsonschema.Draft202012Validator(job_schema())


def complaints(job: dict[str, Any]) -> list[str]:
    return [error.json_path for error in VALIDATOR.iter_errors(job)]


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(job_schema())


@pytest.mark.parametrize("file", JOBS, ids=lambda file: file.stem)
def test_every_shipped_job_passes(file):
    assert complaints(tomllib.loads(file.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    ("table", "key", "value", "place"),
    [
        ("grid", "p", 3, "$.grid"),
        ("grid", "P", 0, "$.grid.P"),
        ("grid", "sigma", [0.1], "$.grid"),
        ("fixed", "epsilon", 0, "$.fixed.epsilon"),
        ("fixed", "phi", 1.0, "$.fixed"),
        ("integrator", "rtol", "small", "$.integrator.rtol"),
        ("integrator", "method", "rk4", "$.integrator.method"),
        ("features", "peaks", 10, "$.features"),
        ("reduction", "cuts", [1], "$.reduction.cuts[0]"),
        ("reduction", "analyses", ["x"], "$.reduction.analyses[0]"),
        ("reduction", "figures", ["x"], "$.reduction.figures"),
    ],
)
def test_the_schema_marks_what_the_package_refuses(table, key, value, place):
    job = {"name": "a", "model": "topological_fhn", "grid": {"P": 3, "Q": "P"}, "fixed": {}}
    assert complaints(job) == []
    Sweep.from_dict(job)
    wrong = {**job, table: {**job.get(table, {}), key: value}}
    assert complaints(wrong) == [place]
    with pytest.raises(BadInput):
        Sweep.from_dict(wrong)


def test_models_have_their_own_parameters():
    networked = {"name": "a", "model": "networked_fhn", "grid": {"sigma": "0.1:0.5:0.1"}}
    assert complaints(networked) == []
    assert complaints({**networked, "grid": {"Q": 3}}) == ["$.grid"]
    assert complaints({**networked, "model": "mine:ring", "grid": {"anything": 3}}) == []
    assert complaints({**networked, "model": "unknown"}) == ["$.model"]


def test_one_word_may_stand_for_a_list_of_one():
    job = {"name": "a", "model": "topological_fhn", "grid": {"P": 3, "Q": 3}}
    assert complaints({**job, "reduction": {"atlas": "diagonal", "beside": ["x"]}}) == []
