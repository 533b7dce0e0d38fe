"""The sweep as a value: reading, defaults, overrides, digest, what a job can express."""

from __future__ import annotations

import json
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
from pydantic import ValidationError

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import built_in
from chimera_hpc.job.reading import apply_overrides
from chimera_hpc.job.tables import TABLES
from chimera_hpc.measures.conventions import PRESETS

QUICKSTART = Path(__file__).parents[2] / "jobs" / "quickstart.toml"
HEAD = 'name = "x"\nmodel = "topological_fhn"\n'
DIAGONAL = HEAD + '[grid]\nP = "2:24"\nQ = "P"\nseeds = 20\n'


def diagonal(*overrides):
    return Sweep.from_toml_text(DIAGONAL, overrides)


def test_the_quickstart_job_states_the_defaults():
    stated, implied = Sweep.load(QUICKSTART).to_dict(), diagonal().to_dict()
    assert stated.pop("name") == "quickstart"
    assert implied.pop("name") == "x"
    for key in ("show", "replay"):  # the runs of the paper's figures
        del stated["reduction"][key], implied["reduction"][key]
    assert stated == implied


def test_the_quickstart_job_names_every_key_that_has_a_default():
    text = QUICKSTART.read_text(encoding="utf-8")
    for table, model in TABLES.items():
        if table in ("continue", "decide"):  # a job without them has neither chains nor rounds
            continue
        part = text.partition(f"[{table}]")[2].partition("\n[")[0]
        missing = [
            key for key, field in model.model_fields.items()
            if field.default is not None and f"\n{key} = " not in part
        ]  # fmt: skip
        assert missing == []


def test_the_quickstart_job_is_the_diagonal_with_twenty_seeds():
    points = Sweep.load(QUICKSTART).points()
    assert len(points) == 460
    assert (points.columns["P"] == points.columns["Q"]).all()
    assert points.row(33)["P"] == 3
    assert points.row(33)["seed"] == 13


def test_the_digest_of_the_quickstart_job_is_known():
    """If this changes, every existing store refuses to go on: change it only on purpose."""
    assert Sweep.load(QUICKSTART).digest == "ab8d8dc84323f0c0"


TIMESCALE = '[grid]\nP = [6, 12, 21]\nQ = "P"\nepsilon = { linspace = [0.01, 0.1, 19] }\nseeds = 10'
BASIN = """
[grid]
P = "1:30"
Q = 0
delta = { linspace = [0.01, 1.5, 50] }
seeds = 20
[fixed]
n_nodes = 100
[integrator]
t_end = 50
[features]
start = 40
"""
ROBUSTNESS = '[grid]\nP = 13\nQ = "P"\norientation = [1, 2]\nflips = "{}"\nseeds = 10'


@pytest.mark.parametrize(
    ("text", "n_points"),
    [
        ('[grid]\nP = "3:24"\nQ = "0:P"\nseeds = 20\n[reduction]\ncuts = [3, 4]', 6380),
        (TIMESCALE, 570),
        (BASIN, 30_000),
        (ROBUSTNESS.format("0:50"), 1020),
        (ROBUSTNESS.format("0:325:5"), 1320),
        ('[grid]\nP = "1:24"\nQ = 0\norientation = 2\nseeds = 20', 480),
        ('[grid]\nP = [6, 12, 21]\nQ = "P"\nb = { linspace = [0.5, 3.3, 15] }\nseeds = 10', 450),
        ('[grid]\nP = [1, 2]\nQ = "0:P"\nseeds = 20', 100),
        ("[fixed]\nP = 9\nQ = 9", 1),
    ],
)
def test_the_experiments_can_be_expressed(text, n_points):
    assert len(Sweep.from_toml_text(HEAD + text).points()) == n_points


def test_the_networked_model_can_be_expressed():
    text = 'name = "n"\nmodel = "networked_fhn"\n[grid]\nsigma = "0.1:0.6:0.05"\nseeds = 10\n'
    sweep = Sweep.from_toml_text(text + "[features]\nstart = 800\n[reduction]\ncuts = [5]")
    assert len(sweep.points()) == 110
    assert sweep.n_nodes == 500


def test_a_sweep_survives_json_and_pickle():
    sweep = Sweep.from_toml_text(
        HEAD
        + TIMESCALE
        + '\n[slurm]\nsetup = ["module load python"]\n[reduction]\nnames = ["a", "b"]'
    )
    assert Sweep.from_dict(json.loads(json.dumps(sweep.to_dict()))) == sweep
    assert pickle.loads(pickle.dumps(sweep)) == sweep


def test_a_sweep_cannot_be_changed():
    with pytest.raises(ValidationError, match="frozen"):
        diagonal().integrator.rtol = 1.0
    with pytest.raises(ValidationError, match="frozen"):
        diagonal().name = "y"


@pytest.mark.parametrize(
    "overrides",
    [
        ["P=[" + ",".join(map(str, range(2, 25))) + "]"],
        ["P=2:24:1"],
        ["seeds=[" + ",".join(map(str, range(20))) + "]"],
        ["seeds=0:19"],
        ["b=0.5", "integrator.t_end=1000"],
        ["name=other", "title=Something else"],
        ["reduction.cuts=[2]", "reduction.linkage=average", "reduction.depth=4.0"],
        ["keep.series=none", "run.block=7", "run.tighten=1", "slurm.time=1:00:00"],
    ],
)
def test_ways_of_writing_and_undigested_tables_leave_the_digest(overrides):
    assert diagonal(*overrides).digest == diagonal().digest


OTHER = {
    "integrator": {
        "method": None, "form": "full", "t_end": 999.0, "t_step": 0.02, "rtol": 1e-4,
        "atol": 1e-7, "delta": 0.1, "centre": "upper", "ball": "euclidean", "max_steps": 9,
        "time_out": 1.0, "initial": None, "initial_digest": "0123456789abcdef",
    },
    "features": {
        "preset": None, "start": 900, "n_peaks": 11, "n_overlap": 4, "max_windows": 4,
        "prominence": 0.1, "window_reference": "own", "reference_node": 1,
        "phase_mean": "arithmetic", "refine": "sine-fit", "time_origin": "absolute",
        "steady": "level", "steady_threshold": 0.1, "groups": 5,
    },
    "fixed": {"n_nodes": 51, "orientation": 2, "epsilon": 0.1, "b": 1, "c": -1, "flips": 1},
    "grid": {"P": "2:23", "Q": "0:P", "seeds": 19},
}  # fmt: skip
CHANGES = [
    f"{table}.{key}={value}" for table in OTHER for key, value in OTHER[table].items() if value
]


@pytest.mark.parametrize("change", CHANGES)
def test_every_digested_key_changes_the_digest_and_is_explained(change):
    here, store = diagonal(change), diagonal()
    assert here.digest != store.digest
    (line,) = here.explain_difference(store)
    assert line.startswith(change.partition("=")[0] + ": ")


def test_the_changes_tried_are_all_digested_keys():
    for table in ("integrator", "features"):
        assert set(OTHER[table]) == set(TABLES[table].model_fields)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ("P=3:24", "grid.P: 3:24 here, 2:24 in the store"),
        ("seeds=[5,7]", "grid.seeds: [5, 7] here, 20 in the store"),
        ("b=0.75", "fixed.b: 0.75 here, 0.5 in the store"),
        ("features.window_reference=own", "features.window_reference: own here, ring in the store"),
    ],
)
def test_a_difference_is_explained_in_one_line(change, line):
    assert diagonal(change).explain_difference(diagonal()) == [line]


def test_a_parameter_that_became_an_axis_is_explained():
    here = diagonal("epsilon={ linspace = [0.01, 0.1, 10] }")
    assert here.explain_difference(diagonal()) == [
        "grid.epsilon: [0.01, 0.02, ..., 0.1] here, nothing in the store",
        "order of axes: [P, Q, epsilon, seeds] here, [P, Q, seeds] in the store",
        "fixed.epsilon: nothing here, 0.05 in the store",
    ]


def test_zero_has_no_sign():
    assert diagonal("c=-0.0").digest == diagonal("c=0").digest


def test_the_order_of_axes_belongs_to_the_digest():
    text = HEAD + '[grid]\nQ = "P"\nP = "2:24"\nseeds = 20'
    swapped = Sweep.from_toml_text(text)
    assert swapped.digest != diagonal().digest
    assert swapped.explain_difference(diagonal()) == [
        "order of axes: [Q, P, seeds] here, [P, Q, seeds] in the store"
    ]


def test_equal_sweeps_have_no_difference():
    assert diagonal("P=2:24:1").explain_difference(diagonal()) == []


def test_the_integrators_delta_is_not_digested_when_delta_is_an_axis():
    here = diagonal("delta=[0.1,0.2]", "integrator.delta=0.5")
    assert here.digest == diagonal("delta=[0.1,0.2]").digest


@pytest.mark.parametrize(
    ("overrides", "table", "key", "value"),
    [
        (["P=3:8"], "grid", "P", "3:8"),
        (["P=12"], "grid", "P", [12]),
        (["fixed.P=12"], "grid", "P", [12]),
        (["Q=[0,2]"], "grid", "Q", [0, 2]),
        (["Q=0:P"], "grid", "Q", "0:P"),
        (["seeds=4"], "grid", "seeds", 4),
        (["grid.seeds=[7]"], "grid", "seeds", [7]),
        (["b=1"], "fixed", "b", 1.0),
        (["fixed.b=1.5"], "fixed", "b", 1.5),
        (["grid.b=1.5"], "grid", "b", [1.5]),
        (["b=[1,2]"], "grid", "b", [1.0, 2.0]),
        (["flips=0:50"], "grid", "flips", "0:50"),
        (["delta=[0.1]"], "grid", "delta", [0.1]),
        (["P=3:8", "P=4"], "grid", "P", [4]),
        (["P=10:20:30"], "grid", "P", [10]),
        (["features.start=900"], "features", "start", 900.0),
        (["features.refine=sine-fit"], "features", "refine", "sine-fit"),
        (["features.refine='sine-fit'"], "features", "refine", "sine-fit"),
        ([" integrator.rtol = 1e-6 "], "integrator", "rtol", 1e-6),
        (["reduction.cuts=[3]"], "reduction", "cuts", [3]),
        (["run.workers=2"], "run", "workers", 2),
        (["slurm.setup=['module load a=b']"], "slurm", "setup", ["module load a=b"]),
    ],
)
def test_overrides(overrides, table, key, value):
    text = DIAGONAL + "[fixed]\nb = 0.7"
    assert Sweep.from_toml_text(text, overrides).to_dict()[table][key] == value


def test_overrides_of_keys_that_the_file_does_not_have():
    sweep = Sweep.from_toml_text(HEAD, ["P=3", "Q=0:P", "seeds=4"])
    assert sweep.grid == {"Q": "0:P", "seeds": 4}
    assert sweep.fixed["P"] == 3


def test_overrides_leave_the_data_they_are_put_upon():
    data = {"grid": {"P": 3}, "fixed": {"b": 1.0}}
    apply_overrides(data, ["P=4", "b=[1,2]"])
    assert data == {"grid": {"P": 3}, "fixed": {"b": 1.0}}


def test_overrides_of_the_top_keys():
    sweep = diagonal("name=other", "title=Two words")
    assert (sweep.name, sweep.title) == ("other", "Two words")


def test_a_fixed_key_that_becomes_an_axis_leaves_fixed():
    sweep = Sweep.from_toml_text(DIAGONAL + "[fixed]\nb = 0.7", ["grid.b=[1,2]"])
    assert "b" not in sweep.fixed


def test_a_file_with_a_byte_order_mark_and_windows_line_ends_is_read(tmp_path):
    path = tmp_path / "job.toml"
    path.write_bytes(b"\xef\xbb\xbf" + DIAGONAL.replace("\n", "\r\n").encode())
    assert Sweep.load(path) == diagonal()


def test_reading_a_job_loads_nothing_heavy():
    code = (
        "import sys; from chimera_hpc.job import Sweep, block_size\n"
        f"sweep = Sweep.load({str(QUICKSTART)!r})\n"
        "block_size(sweep, len(sweep.points())), sweep.digest\n"
        "heavy = {'numba', 'scipy', 'zarr', 'dask', 'sklearn', 'matplotlib', 'xarray', 'pandas'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_json_schema_describes_every_key():
    schema = Sweep.model_json_schema()
    json.dumps(schema, allow_nan=False)
    tables = [schema, *schema["$defs"].values()]
    tables += [schema["properties"][name] for name in ("grid", "fixed")]
    described = {
        f"#/$defs/{name}" for name, table in schema["$defs"].items() if table["description"]
    }
    for table in tables:
        assert table["additionalProperties"] is False
        assert all(
            e.get("description") or e["$ref"] in described for e in table["properties"].values()
        )
    assert schema["$defs"]["Integrator"]["properties"]["rtol"]["exclusiveMinimum"] == 0
    assert schema["properties"]["fixed"]["properties"]["orientation"]["maximum"] == 2


def test_models_are_complete():
    for name, model in built_in().items():
        names = [parameter.name for parameter in model.parameters]
        assert len(set(names)) == len(names), name
        assert not {"seed", "seeds", "delta", "n_nodes"} & {*names, *model.constants}
        assert {key for limit in model.limits for key in (limit.name, *limit.needs)} <= set(names)


def test_an_error_is_one_line_with_file_and_override():
    with pytest.raises(BadInput) as caught:
        Sweep.load(QUICKSTART, ["P=2:25"])
    assert str(caught.value) == (
        f"{QUICKSTART} with --set 'P=2:25': grid.P: 25 is too large, at most 24 is allowed "
        "(2 P must be smaller than n_nodes; n_nodes = 50)"
    )


PRINTED = "features.preset=paper-printed"


def test_a_preset_sets_several_keys_and_each_can_be_overridden():
    sweep = diagonal(PRINTED, "features.max_windows=6")
    found = sweep.features
    assert (found.window_reference, found.phase_mean, found.time_origin) == (
        "own",
        "arithmetic",
        "recording",
    )
    assert (found.max_windows, found.prominence, found.steady) == (6, 0.1, "level")
    assert Sweep.from_dict(sweep.to_dict()) == sweep


def test_a_preset_on_the_command_line_replaces_what_the_job_file_says():
    sweep = Sweep.load(QUICKSTART, (PRINTED, "features.max_windows=5"))
    assert (sweep.features.window_reference, sweep.features.max_windows) == ("own", 5)


def test_the_digest_holds_what_a_preset_sets_and_not_its_name():
    plain = diagonal()
    assert diagonal("features.preset=default", "features.max_windows=0").digest == plain.digest
    preset = diagonal(PRINTED)
    spelt = diagonal(
        *(f"features.{k}={json.dumps(v)}" for k, v in PRESETS["paper-printed"].items())
    )
    assert preset.digest == spelt.digest != plain.digest
    assert preset.explain_difference(spelt) == []


def test_an_unknown_preset_is_refused_in_one_line():
    with pytest.raises(BadInput, match=r"features\.preset = 'paper': it should be 'default' or"):
        diagonal("features.preset=paper")
