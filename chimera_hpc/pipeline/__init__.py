"""The analysis as scikit-learn estimators: features, variations, panels, classes.

The paper is one line,

    make_pipeline(FourierFeatures(), TotalVariation(), MinMaxScaler(), AgglomerativeClustering(3))

X is a list of runs (t, u), an array (runs, times, nodes), or the dataset that `chimera_hpc.open`
gives. The estimators call the functions by which a sweep is measured and classified.
"""

from importlib import import_module

TYPE_CHECKING = False

if TYPE_CHECKING:
    from chimera_hpc.pipeline.classes import ChimeraClasses
    from chimera_hpc.pipeline.features import FourierFeatures, HilbertFeatures, WaveletFeatures
    from chimera_hpc.pipeline.numbers import Panel, TotalVariation

_HOMES = {
    "ChimeraClasses": "classes",
    "FourierFeatures": "features",
    "HilbertFeatures": "features",
    "Panel": "numbers",
    "TotalVariation": "numbers",
    "WaveletFeatures": "features",
}

__all__ = [
    "ChimeraClasses",
    "FourierFeatures",
    "HilbertFeatures",
    "Panel",
    "TotalVariation",
    "WaveletFeatures",
]


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
