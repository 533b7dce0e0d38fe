"""A model, method, measure, analysis or figure is one file and one line of the registry."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from textwrap import dedent
from typing import Any

import numpy as np
import pytest

from chimera_hpc.base.errors import BadInput
from chimera_hpc.job import Sweep, registry
from chimera_hpc.job.tables import Measures
from chimera_hpc.reduction.reduction import reduce_sweep
from chimera_hpc.run.block import run_block
from chimera_hpc.store.schema import scalar_labels
from chimera_hpc.store.store import Store

JOB: dict[str, Any] = {
    "name": "tiny",
    "model": "topological_fhn",
    "grid": {"P": 2, "Q": 0},
    "fixed": {"n_nodes": 8},
    "integrator": {"t_end": 2.0},
    "features": {"start": 1.0, "groups": 2},
    "run": {"block": 2},
}


@pytest.fixture
def add(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    """Write one file, and add one line to a part of the registry."""
    monkeypatch.syspath_prepend(tmp_path)
    modules = []

    def add_file(part: dict[str, str], name: str, text: str) -> None:
        module = f"own_{name}"
        (tmp_path / f"{module}.py").write_text(dedent(text), encoding="utf-8")
        monkeypatch.setitem(part, name, f"{module}:OBJECT")
        modules.append(module)

    yield add_file
    registry.load.cache_clear()
    for module in modules:
        sys.modules.pop(module, None)


def run(folder: Path, **tables: Any) -> Store:
    """Run a tiny sweep into the folder, in this process."""
    store = Store.plan(folder / "store.zarr", Sweep.from_dict({**JOB, **tables}))
    store.write_block(0, run_block(store.sweep, store.points), 1, 1)
    assert (store.ledger()["status"] > 0).all()
    return store


def test_a_model(add: Any, tmp_path: Path) -> None:
    add(
        registry.MODELS,
        "decay",
        """
        from chimera_hpc.models.custom import OwnModel, Parameter

        def rhs(y, dy, p, ints):
            for lane in range(y.shape[1]):
                for i in range(ints[0]):
                    dy[i, lane] = -p[0, lane] * y[i, lane]

        OBJECT = OwnModel(
            rhs,
            variables=("x",),
            parameters=(Parameter("rate", float, 0.5, "Of the decay."),),
            n_nodes=8,
            initial=lambda rng, row, n_nodes: [[1.0] * n_nodes],
        )
        """,
    )
    grid, exact = {"rate": [0.5, 1.0]}, {"rtol": 1e-8, "atol": 1e-10}
    integrator = {**JOB["integrator"], **exact}
    store = run(tmp_path, model="decay", grid=grid, integrator=integrator)
    for i, rate in enumerate((0.5, 1.0)):
        assert store.series(i)[-1] == pytest.approx(np.full(8, np.exp(-rate * 2.0)), abs=1e-4)


def test_a_method(add: Any, tmp_path: Path) -> None:
    add(
        registry.METHODS,
        "heun",
        """
        import numpy as np
        from chimera_hpc.integrate.tableau import Tableau, hermite, lower_triangular

        A = lower_triangular((1.0,), (0.5, 0.5))
        OBJECT = Tableau("heun", 2, 1, A, np.array([-0.5, 0.5, 0.0]), hermite(A[-1]), 3, "Heun")
        """,
    )
    end = {}
    for method in ("heun", "tsit5"):
        settings = {**JOB["integrator"], "method": method, "rtol": 1e-6, "atol": 1e-8}
        store = run(tmp_path / method, integrator=settings)
        end[method] = (int(store.ledger()["steps"][0]), store.series(0)[-1])
    assert end["heun"][0] > 3 * end["tsit5"][0]
    assert end["heun"][1] == pytest.approx(end["tsit5"][1], abs=2e-3)


MEASURE = """
from chimera_hpc.measures.measure import Measure

OBJECT = Measure(
    lambda features: [f"mean_u_{i}" for i in range(features.groups)],
    lambda run: [run.u[:, i].mean() for i in range(run.settings.groups)],
)
"""


def test_a_measure(add: Any, tmp_path: Path) -> None:
    add(registry.MEASURES, "mean_u", MEASURE)
    store = run(tmp_path, measures={"panel": ["variations", "mean_u"]})
    scalars = store.scalars()
    assert list(scalars) == ["V_theta", "V_a", "V_Omega", "mean_u_0", "mean_u_1"]
    for i in range(2):
        assert scalars[f"mean_u_{i}"][0] == pytest.approx(store.series(0)[:, i].mean())


def test_an_analysis_and_a_figure(add: Any, tmp_path: Path) -> None:
    add(registry.ANALYSES, "count", "def OBJECT(given): return {'runs': given.has_result.sum()}")
    add(
        registry.FIGURES,
        "curve",
        """
        from chimera_hpc.plot import style

        def OBJECT(data):
            figure, (axes,) = style.new_panels(1)
            axes.plot([data.curves["count"]["runs"]])
            return figure
        """,
    )
    run(tmp_path, reduction={"analyses": ["count"], "figures": ["curve"]})
    summary = reduce_sweep(tmp_path)
    assert json.loads(summary.results.read_bytes())["curves"] == {"count": {"runs": 1}}
    assert [path.name for path in summary.figures] == ["curve.png", "curve.pdf"]
    assert all(path.stat().st_size > 0 for path in summary.figures)


def test_every_place_of_the_registry_exists() -> None:
    parts = (registry.MODELS, registry.METHODS, registry.MEASURES, registry.ANALYSES)
    for part in (*parts, registry.FIGURES, registry.CUT_FIGURES):
        assert all(registry.load(place) is not None for place in part.values())


def test_the_default_panel_is_no_part_of_the_digest_and_another_is(add: Any) -> None:
    plain = Sweep.from_dict(JOB)
    default = list(registry.DEFAULT_PANEL)
    assert Sweep.from_dict({**JOB, "measures": {"panel": default}}).digest == plain.digest
    add(registry.MEASURES, "mean_u", MEASURE)
    assert Sweep.from_dict(JOB).digest == plain.digest
    more = Sweep.from_dict({**JOB, "measures": {"panel": [*default, "mean_u"]}})
    assert more.digest != plain.digest
    assert scalar_labels(more) == (*scalar_labels(plain), "mean_u_0", "mean_u_1")
    assert plain.explain_difference(more) == [
        "measures.panel: [variations, sigma, ..., local_sigma] here, "
        "[variations, sigma, ..., mean_u] in the store"
    ]


@pytest.mark.parametrize(
    ("panel", "said"),
    [
        (["variation"], "'variation' is not a measure; did you mean variations"),
        (["sigma", "variations"], "variations must come first"),
        ([], "variations must come first"),
        (["variations", "sigma", "sigma"], "holds a name twice"),
        ("variations", "is not a list of names"),
    ],
)
def test_a_wrong_panel_is_refused(panel: Any, said: str) -> None:
    with pytest.raises(BadInput, match=f"measures.panel: .*{said}"):
        Sweep.from_dict({**JOB, "measures": {"panel": panel}})


def test_an_analysis_without_its_measure_says_so(tmp_path: Path) -> None:
    measures, grid = {"panel": ["variations"]}, {"P": 2, "Q": 0, "seeds": 2}
    run(tmp_path, measures=measures, grid=grid, reduction={"analyses": ["sigma-l"]})
    (note,) = [
        n for n in reduce_sweep(tmp_path, make_figures=False).notes if n.startswith("analysis ")
    ]
    assert note == "analysis sigma-l: measures.panel has no measure that gives sigma_1"


def test_labels_are_known_without_kernels() -> None:
    import subprocess

    code = "import sys; from chimera_hpc.job import Sweep, registry\n"
    code += "panel = registry.measures(registry.DEFAULT_PANEL)\n"
    code += f"[m.labels(Sweep.from_dict({JOB!r}).features) for m in panel]\n"
    code += "assert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
    assert Measures().panel == registry.DEFAULT_PANEL
