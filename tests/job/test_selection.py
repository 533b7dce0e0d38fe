"""What a job may ask to be drawn: selections of points, names of figures."""

from __future__ import annotations

import pytest
from jobs_for_tests import BARE, job_text

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job import Sweep
from chimera_hpc.job.selection import parse_selection, split_figure_name

JOB = job_text(BARE, {"grid.P": "2:24"}) + "[reduction]\n"


def test_selection_gives_integers_and_floats_by_name():
    values = parse_selection("P=9  Q=3 epsilon=1e-1 b=-2 seed=0")
    assert values == {"P": 9, "Q": 3, "epsilon": 0.1, "b": -2, "seed": 0}
    assert [type(x) for x in values.values()] == [int, int, float, int, int]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "NAME=NUMBER is needed"),
        ("P", "NAME=NUMBER is needed"),
        ("P = 9", "NAME=NUMBER is needed"),
        ("P=9,Q=9", "NAME=NUMBER is needed"),
        ("P=9 P=9", "P is given twice"),
        ("seeds=3", "unknown 'seeds'; did you mean seed"),
        ("P=9.5", "P: 9.5 is not an integer"),
        ("P=0", "P: 0 is not an integer from 1"),
        ("P=nine", "could not convert"),
        ("epsilon=0", "epsilon: 0 is not a finite number above 0"),
        ("b=inf", "b: inf is not a finite number"),
        ("n_nodes=50", "unknown 'n_nodes'"),
    ],
)
@pytest.mark.parametrize("key", ["show", "replay"])
def test_wrong_selection_is_refused_when_the_job_is_read(key, text, said):
    with pytest.raises(BadInput, match=said) as caught:
        Sweep.from_toml_text(f'{JOB}{key} = ["P=2", "{text}"]')
    assert f"reduction.{key}: " in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("value", ['"P=9"', "[9]", "9"])
def test_selections_must_be_a_list_of_texts(value):
    with pytest.raises(BadInput, match="is not a list such as"):
        Sweep.from_toml_text(f"{JOB}show = {value}")


def test_figures_are_all_by_default_and_survive_a_round_trip():
    assert Sweep.from_toml_text(JOB).reduction.figures == "auto"
    named = Sweep.from_toml_text(f'{JOB}figures = ["space_time", "dendrogram", "projections_4"]')
    assert named.reduction.figures == ("space_time", "dendrogram", "projections_4")
    assert Sweep.from_dict(named.to_dict()) == named


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ('["dendrograms"]', "'dendrograms' is not a figure; did you mean dendrogram"),
        ('["space_time_3"]', "'space_time_3' is not a figure; did you mean space_time"),
        ('["dendrogram_0"]', "'dendrogram_0' is not a figure"),
        ('"all"', 'neither "auto" nor a list of names; known: space_time, indicators'),
        ("[3]", 'neither "auto" nor a list of names'),
    ],
)
def test_wrong_figure_is_refused_with_what_is_allowed(value, said):
    with pytest.raises(BadInput, match=f"reduction.figures: .*{said}"):
        Sweep.from_toml_text(f"{JOB}figures = {value}")


def test_what_is_drawn_is_no_part_of_the_digest():
    drawn = Sweep.from_toml_text(f'{JOB}show = ["P=9"]\nreplay = ["P=1 Q=1"]\nfigures = []')
    assert drawn.digest == Sweep.from_toml_text(JOB).digest


def test_figure_name_is_taken_apart():
    assert split_figure_name("modal_classes_12") == ("modal_classes", 12)
    assert split_figure_name("space_time") == ("space_time", None)
