"""Whatever a user writes: a sweep, or one line that says what, where and what is allowed."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job import Sweep
from chimera_hpc.job.models import built_in
from chimera_hpc.job.tables import TABLES

QUICKSTART = (Path(__file__).parents[2] / "jobs" / "quickstart.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        # methods of version 0.1
        (["integrator.method=verner6"], 'method "verner6" was removed in version 0.2: use "tsit5"'),
        (["integrator.method=kcl4"], 'method "kcl4" was removed in version 0.2: use "tsit5"'),
        # unknown keys
        (["integrator.rtoll=1"], "integrator.rtoll: unknown key; did you mean rtol?"),
        (["integrator.n_peaks=1"], "integrator.n_peaks: unknown key; it belongs in [features]"),
        (["integratr.rtol=1"], "integratr: unknown key; did you mean integrator?"),
        (["epsilonn=1"], "fixed.epsilonn: unknown key; did you mean epsilon?"),
        (["fixed.t_end=1"], "fixed.t_end: unknown key; it belongs in [integrator]"),
        (["grid.R=1"], "grid.R: unknown key; known: P, Q, orientation, epsilon, b, c"),
        (["grid.seed=1"], "grid.seed: unknown key; did you mean seeds?"),
        (["sigma=0.1"], "fixed.sigma: unknown key; known: n_nodes, P, Q"),
        (["a.b.c=1"], "a.b: unknown key; known: name, title"),
        # types and choices
        (["integrator.t_end='long'"], "integrator.t_end = 'long': it should be a valid number"),
        (["integrator.t_end=true"], "integrator.t_end = True: it should be a valid number"),
        (["integrator.max_steps=1e6"], "integrator.max_steps = 1000000.0: it should be a valid"),
        (["integrator.form=fulll"], "form = 'fulll': it should be 'reduced' or 'full'"),
        (["reduction.linkage=single"], "it should be 'ward', 'average' or 'complete'"),
        (["integrator.method=tsit"], "method: 'tsit' is unknown; did you mean tsit5?"),
        (["model=topological"], "model: 'topological' is not a known model; did you mean topol"),
        (["orientation=3"], "fixed.orientation: 3 is not an integer from 1 up to 2"),
        (["orientation=1.0"], "fixed.orientation: 1.0 is not an integer"),
        (["b=true"], "fixed.b: True is not a finite number"),
        (["reduction.cuts=[1]"], "reduction.cuts.0 = 1: it should be greater than or equal to 2"),
        (["reduction.cuts=3"], "reduction.cuts = 3: it should be a valid tuple"),
        (["reduction.cuts=[3,3]"], "reduction.cuts: (3, 3) holds a number twice"),
        (["reduction.cuts=[]"], "reduction.cuts: empty"),
        (["reduction.names=single"], "reduction.names: 'single' is neither"),
        (["reduction.names=['a','a']"], "reduction.names: ['a', 'a'] is neither"),
        (["reduction.depth=0"], "reduction.depth = 0: it should be greater than 0"),
        (["keep.dtype=int8"], "keep.dtype = 'int8': it should be 'int16' or 'float32'"),
        (["run.attempts=0"], "run.attempts = 0: it should be greater than or equal to 1"),
        (["run.tighten=2"], "run.tighten = 2: it should be less than or equal to 1"),
        (["slurm.time=soon"], "slurm.time = 'soon': String should match pattern"),
        (["slurm.partition=a b"], "slurm.partition = 'a b': String should match pattern"),
        (['slurm.setup=["a\\nb"]'], "slurm.setup.0 = 'a\\nb': String should match pattern"),
        (["name=../x"], "name = '../x': String should match pattern"),
        # parameters and grids
        (["P=25"], "grid.P: 25 is too large, at most 24 is allowed (2 P must be smaller"),
        (["fixed.n_nodes=48"], "grid.P: 24 is too large, at most 23 is allowed"),
        (["orientation=1:3"], "grid.orientation: 3 is not an integer from 1 up to 2"),
        (["P=0"], "grid.P: 0 is not an integer from 1"),
        (["Q=0:25"], "grid.Q: 3 is too large, at most 2 is allowed (Q may not exceed P; n_nodes"),
        (["Q=-1"], "grid.Q: -1 is not an integer from 0"),
        (["Q=-1:P"], "grid.Q: -1 is not an integer from 0"),
        (["P=3", "flips=151"], "fixed.flips: 151 is too large, at most 150 is allowed (flips may"),
        (["flips=[0,101]"], "grid.flips: 101 is too large, at most 100 is allowed"),
        (["flips=-1"], "fixed.flips: -1 is not an integer from 0"),
        (["epsilon=0"], "fixed.epsilon: 0 is not a finite number above 0"),
        (["epsilon=[0.1,-0.1]"], "grid.epsilon: -0.1 is not a finite number above 0"),
        (["epsilon=nan"], "fixed.epsilon: nan is not a finite number"),
        (["b=inf"], "fixed.b: inf is not a finite number"),
        (["n_nodes=2"], "fixed.n_nodes: 2 is not an integer from 3"),
        (["grid.n_nodes=[50,60]"], "grid.n_nodes: one for a whole sweep; set it in [fixed]"),
        (["P=[]"], "grid.P: empty axis"),
        (["P=5:4"], "grid.P: empty axis"),
        (["Q=3:P"], "grid.Q: the range 3:P is empty at P = 2"),
        (["P=[3,4,3]"], "grid.P: 3 is there twice, and would make duplicate points"),
        (["seeds=0"], "grid.seeds: 0 is not an integer from 1"),
        (["seeds=[]"], "grid.seeds: empty axis"),
        (["seeds=[1,1]"], "grid.seeds: 1 is there twice"),
        (["seeds=[-1]"], "grid.seeds: -1 is not an integer from 0"),
        (["seeds=P"], "grid.seeds: 'P' is neither a count, a list nor a range"),
        (["seeds=2.0"], "grid.seeds: 2.0 is not an integer"),
        (["Q=R"], "grid.Q: R is not an axis"),
        (["Q=0:p"], "grid.Q: p is not an axis"),
        (["Q=0:seeds"], "grid.Q: seeds is not an axis"),
        (["Q=0:delta"], "grid.Q: delta is not an axis"),
        (["Q=Q"], "grid.Q: the axes Q depend on each other in a circle"),
        (["P=Q"], "grid.P: the axes P, Q depend on each other in a circle"),
        (["b=[1,2]", "Q=b"], "grid.Q: must be integers, and b is not"),
        (["Q=0:b"], "grid.Q: b is not an integer"),
        (["seeds=1000000000"], "grid: 2.3e+10 points or more, at most 1e+08 are allowed"),
        (["flips=0:1000000000"], "grid: 2.3e+10 points or more, at most"),
        (["n_nodes=100001", "P=50000", "Q=0:P", "flips=0:Q"], "grid: 1.25e+09 points or more"),
        (["delta=0.1"], "fixed.delta: unknown key; it belongs in [integrator]"),
        (["delta=[-1]"], "grid.delta: -1 is not a finite number from 0"),
        # tables against each other
        (["features.start=-1"], "features.start = -1: it should be greater than or equal to 0"),
        (["features.start=1000"], "features.start: 1000 is outside the run, it must be below"),
        (["integrator.t_end=900"], "features.start: 950 is outside the run, it must be below"),
        (["integrator.t_end=0"], "integrator.t_end = 0: it should be greater than 0"),
        (["integrator.t_step=0"], "integrator.t_step = 0: it should be greater than 0"),
        (["integrator.t_step=51"], "integrator.t_step: 51 is not between"),
        (["integrator.t_step=1e-300"], "integrator.t_step: 1e-300 is not between"),
        (["integrator.rtol=0"], "integrator.rtol = 0: it should be greater than 0"),
        (["integrator.atol=-1e-9"], "integrator.atol = -1e-09: it should be greater than 0"),
        (["integrator.rtol=nan"], "integrator.rtol = nan: it should be a finite number"),
        (["integrator.time_out=inf"], "integrator.time_out = inf: it should be a finite number"),
        (["features.n_peaks=2"], "features.n_peaks = 2: it should be greater than or equal to 3"),
        (["features.n_overlap=10"], "features.n_overlap: 10 must be below features.n_peaks = 10"),
        (["features.reference_node=50"], "features.reference_node: 50 is outside the ring, 0 to"),
        (["features.groups=51"], "features.groups: 51 is more than n_nodes = 50"),
        (["integrator.centre=upper", "c=0"], "integrator.centre: upper has v = -b/c"),
        (["integrator.centre=upper", "c=[1,0]"], "integrator.centre: upper has v = -b/c"),
        # --set itself
        (["P"], "--set 'P': KEY=VALUE is needed"),
        (["=3"], "--set '=3': KEY=VALUE is needed"),
        (["P=[3"], "--set 'P=[3': the value is neither TOML nor a bare word or range"),
        (["P="], "--set 'P=': the value is neither TOML nor a bare word or range"),
        (["P=3\nQ=4"], "--set 'P=3\\nQ=4': the value is neither TOML nor a bare word or range"),
        (["name.x=3"], "--set 'name.x=3': name is not a table"),
    ],
)  # fmt: skip
def test_wrong_jobs_get_the_line_that_helps(overrides, message):
    with pytest.raises(BadInput) as caught:
        Sweep.from_toml_text(QUICKSTART, overrides)
    assert message in str(caught.value)
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('name = "x"\nmodel = \n', "job.toml: not valid TOML: Invalid value (at line 2, column 9)"),
        ('name = "x"', "job.toml: model: missing"),
        ('nam = "x"', "job.toml: nam: unknown key; did you mean name?"),
        ('name = "x"\nmodel = "topological_fhn"', "job.toml: grid.P: missing; P must be an axis"),
        ('name = "x"\nmodel = "topological_fhn"\ngrid = 3', "job.toml: grid = 3: it should be"),
        ('name = "x"\nmodel = "networked_fhn"\n[grid]\nQ = 1', "job.toml: grid.Q: unknown key"),
        (
            'name = "x"\nmodel = "networked_fhn"\n[integrator]\nform = "full"',
            "job.toml: integrator.form: this model has only reduced",
        ),
        (
            'name = "x"\nmodel = "networked_fhn"\n[integrator]\ncentre = "lower"',
            "job.toml: integrator.centre: lower has v = -b/c, so the model must have a c",
        ),
        (QUICKSTART.replace("[fixed]", "[fixed]\nP = 3"), "job.toml: fixed.P: P is an axis in"),
        (QUICKSTART.replace("[fixed]", "[fixed]\nseeds = 3"), "unknown key; it belongs in [grid]"),
        ("a" + ".a" * 3000 + " = 1", "job.toml: a: unknown key"),
        (QUICKSTART.replace('"P"', "{" + "a." * 3000 + "a = 1}"), "grid.Q: "),
        (QUICKSTART.replace('"P"', "0x" + "f" * 9000), "grid.Q: a huge integer is not"),
        ("a = " + "[" * 5000, "job.toml: not valid TOML"),
        ("a = 2020-13-45", "job.toml: not valid TOML"),
        (QUICKSTART.replace('"P"', "2020-01-01"), "grid.Q: datetime.date(2020, 1, 1) is not"),
    ],
)  # fmt: skip
def test_wrong_files_get_the_line_that_helps(tmp_path, monkeypatch, text, message):
    monkeypatch.chdir(tmp_path)
    Path("job.toml").write_text(text, encoding="utf-8")
    with pytest.raises(BadInput) as caught:
        Sweep.load("job.toml")
    # A new Python's parser refuses a key of thousands of parts itself.
    parser_refuses = "TOML key has more than the allowed" in str(caught.value)
    assert message in str(caught.value) or parser_refuses
    assert str(caught.value).isprintable()


def test_a_missing_job_file_is_bad_input(tmp_path):
    with pytest.raises(BadInput, match=r"nothing\.toml: no such job file$"):
        Sweep.load(tmp_path / "nothing.toml")


def test_a_folder_is_not_a_job_file(tmp_path):
    with pytest.raises(BadInput, match="not a readable job file"):
        Sweep.load(tmp_path)


def test_bytes_that_are_no_text_are_not_a_job_file(tmp_path):
    (tmp_path / "job.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadInput, match="not a readable job file"):
        Sweep.load(tmp_path / "job.toml")


def test_a_path_that_no_file_can_have_is_bad_input():
    with pytest.raises(BadInput, match="not a readable job file"):
        Sweep.load("a\0b")


KEYS = sorted(
    {"name", "title", "model", "seeds", "delta", "linspace", "n_nodes", *TABLES, "grid", "fixed"}
    | {key for table in TABLES.values() for key in table.model_fields}
    | {p.name for model in built_in().values() for p in model.parameters}
)
WORDS = [*built_in(), "P", "0:P", "3:8", "0:Q:2", "Q:P", "1:0", "0.1:1:0.1", "own", "full", "ward"]
scalars = (
    st.none() | st.booleans() | st.integers() | st.integers(0, 30) | st.floats() | st.text()
    | st.sampled_from(WORDS)
)  # fmt: skip
keys = st.sampled_from(KEYS) | st.text(max_size=5)
data = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=5)
)
jobs = st.fixed_dictionaries(
    {"name": st.just("x"), "model": st.sampled_from([*built_in()])},
    optional={
        "grid": st.dictionaries(keys, data, max_size=4),
        "fixed": st.dictionaries(keys, scalars, max_size=3),
        "integrator": st.dictionaries(keys, scalars, max_size=3),
        "features": st.dictionaries(keys, scalars, max_size=3),
    },
)


def is_one_line_or_a_sound_sweep(make):
    """Whether making a sweep gives a BadInput of one line, or one equal to its own data."""
    try:
        sweep = make()
    except BadInput as error:
        return str(error).isprintable() and len(str(error)) > 0
    return Sweep.from_dict(sweep.to_dict()) == sweep and len(sweep.digest) == 16


@settings(max_examples=300)
@given(data | jobs)
def test_any_data_is_a_sweep_or_one_line(value):
    assert is_one_line_or_a_sound_sweep(lambda: Sweep.from_dict(value))


@settings(max_examples=200)
@given(st.text())
def test_any_text_is_a_sweep_or_one_line(text):
    assert is_one_line_or_a_sound_sweep(lambda: Sweep.from_toml_text(text))


@settings(max_examples=300)
@given(st.data())
def test_any_damaged_job_is_a_sweep_or_one_line(choose):
    lines = QUICKSTART.splitlines()
    for _ in range(choose.draw(st.integers(1, 3))):
        i = choose.draw(st.integers(0, len(lines) - 1))
        key = lines[i].partition("=")[0]
        lines[i] = choose.draw(
            st.sampled_from(["", lines[i][: len(lines[i]) // 2], lines[i] * 2])
            | st.builds(lambda value, key=key: f"{key}= {value!r}", scalars)
            | st.text(max_size=20)
        )
    assert is_one_line_or_a_sound_sweep(lambda: Sweep.from_toml_text("\n".join(lines)))


@settings(max_examples=500)
@given(
    st.lists(
        st.text()
        | st.tuples(keys, keys, scalars | data).map(lambda t: f"{t[0]}.{t[1]}={t[2]}")
        | st.tuples(keys, scalars | data).map(lambda t: f"{t[0]}={t[1]}"),
        max_size=3,
    )
)
@example(["grid=1", "grid.P=3"])
@example(["P={linspace=[1,2,3]}"])
@example(["epsilon={linspace=[1e308,-1e308,3]}"])
@example(["epsilon=0:1e308:1e-300"])
def test_any_override_is_a_sweep_or_one_line(overrides):
    assert is_one_line_or_a_sound_sweep(lambda: Sweep.from_toml_text(QUICKSTART, overrides))
