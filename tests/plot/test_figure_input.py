"""Titles of drawn runs."""

from __future__ import annotations

from chimera_hpc.plot.figure_input import folded


def test_parameters_above_a_panel_are_folded_between_them() -> None:
    assert folded("$P = 3$, $Q = 3$, seed 0") == "$P = 3$, $Q = 3$, seed 0"
    place = "$P = 12$, rewire $= 0.02$, network_seed $= 1$, seed 2"
    assert folded(place) == "$P = 12$, rewire $= 0.02$\nnetwork_seed $= 1$, seed 2"
    wide = r"$\mathrm{rewire} = 0.02$, $\mathrm{seed} = 1$"
    assert folded(wide) == wide
