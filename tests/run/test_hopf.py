"""The chimera of two populations, followed in A: its breathing starts at the Hopf point.

Reduced equations: D. M. Abrams, R. Mirollo, S. H. Strogatz, D. A. Wiley, Phys. Rev. Lett. 101,
084103 (2008), eq. 12, with the phases of the second population on the invariant manifold.
"""

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

from chimera_hpc.job.initial_file import read_initial
from chimera_hpc.job.shipped import jobs_folder
from chimera_hpc.store.store import Store
from chimera_hpc.sweep import main

JOB = jobs_folder() / "examples" / "two_populations.toml"
BREATHING = 3e-3
"""Standard deviation of R from which a run breathes; the resting chimera has less than 1e-3."""
LAG = np.pi / 2 - 0.1


def slope(state, a):
    """Rates of r and psi."""
    r, psi = state
    inside, across = (1 + a) / 2, (1 - a) / 2
    pull = inside * r * np.sin(LAG) - across * np.sin(psi - LAG)
    return np.array(
        [
            (1 - r * r) / 2 * (inside * r * np.cos(LAG) + across * np.cos(psi - LAG)),
            (1 + r * r) / (2 * r) * pull - inside * np.sin(LAG) - across * r * np.sin(psi + LAG),
        ]
    )


def chimera(a):
    """Return r and psi of the resting chimera, followed from A = 0.2."""
    state = np.array([0.72914708, -0.20940801])
    for value in np.linspace(0.2, a, 21):
        state = fsolve(slope, state, args=(value,), xtol=1e-13)
    return state


def growth(a):
    """Largest real part of the eigenvalues of the resting chimera."""
    state, h = chimera(a), 1e-6
    columns = [(slope(state + h * e, a) - slope(state - h * e, a)) / (2 * h) for e in np.eye(2)]
    return float(np.linalg.eigvals(np.array(columns).T).real.max())


def hopf_point():
    return float(brentq(growth, 0.25, 0.29))


def test_the_hopf_point_lies_between_the_known_states():
    assert growth(0.2) == pytest.approx(-0.01445, abs=1e-5)
    assert growth(0.28) == pytest.approx(0.00034, abs=1e-5)
    assert hopf_point() == pytest.approx(0.277775, abs=1e-5)


def test_the_first_state_of_the_example_is_the_chimera():
    states, _ = read_initial(JOB.with_name("two_populations.npz"))
    phase = states.state(0)[0]
    r, psi = chimera(0.272)
    assert np.ptp(phase[:32]) == 0.0
    assert np.exp(1j * phase[32:]).mean() == pytest.approx(r, abs=1e-6)
    assert phase[0] == pytest.approx(psi, abs=1e-9)


@pytest.mark.slow
def test_breathing_starts_at_the_hopf_point(tmp_path: Path):
    out = tmp_path / "out"
    assert main(["run", str(JOB), "--out", str(out), "--no-figures", "--cluster", "serial"]) == 0
    store = Store.open(out / "store.zarr")
    a, deviation = store.points.columns["A"], store.scalars()["R_std"]
    first = int(np.argmax(deviation > BREATHING))
    onset = 0.5 * (a[first - 1] + a[first])
    assert (deviation[:first] < 0.5 * BREATHING).all()
    assert (deviation[first:] > BREATHING).all()
    assert abs(onset - hopf_point()) < 0.002
