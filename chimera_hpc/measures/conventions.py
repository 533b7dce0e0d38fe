"""Options of the Fourier method, and the presets that set several options at once.

The text of the paper leaves open which maxima place the windows, how many windows count, where
phases begin and how they are averaged. `default` uses all of a recording, one clock for the ring
and the circular mean. `paper-printed` is the convention that agrees with most of the numbers and
statements that the paper prints (docs/method.md compares both).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any, Literal, ParamSpec, TypeVar

from chimera_hpc.measures.checks import choice

Parameters = ParamSpec("Parameters")
Result = TypeVar("Result")

WindowReference = Literal["ring", "own"]
PhaseMean = Literal["circular", "arithmetic"]
Refine = Literal["parabola", "sine-fit"]
TimeOrigin = Literal["window", "recording", "absolute"]
Steady = Literal["apart", "level"]
Preset = Literal["default", "paper-printed"]

PRESETS: Mapping[str, Mapping[str, Any]] = {
    "default": {
        "window_reference": "ring",
        "max_windows": 0,
        "prominence": 0.0,
        "refine": "parabola",
        "time_origin": "window",
        "phase_mean": "circular",
        "steady": "apart",
    },
    "paper-printed": {
        "window_reference": "own",
        "max_windows": 4,
        "prominence": 0.1,
        "refine": "sine-fit",
        "time_origin": "recording",
        "phase_mean": "arithmetic",
        "steady": "level",
    },
}
"""Settings of `fourier_features` and of [features] by the name of the preset."""


def preset_settings(name: Any) -> Mapping[str, Any]:
    """Return the settings of a preset; raise BadInput for an unknown name."""
    choice("preset", name, tuple(PRESETS))
    return PRESETS[name]


def accepts_presets(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Decorate a function so that its keyword `preset` sets what the call does not."""

    @wraps(function)
    def call(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        settings: Any = {**preset_settings(kwargs.get("preset", "default")), **kwargs}
        return function(*args, **settings)

    return call
