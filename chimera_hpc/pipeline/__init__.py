"""The analysis as scikit-learn estimators: features, variations, panels, classes.

The paper is one line,

    make_pipeline(FourierFeatures(), TotalVariation(), MinMaxScaler(), AgglomerativeClustering(3))

X is a list of runs (t, u), an array (runs, times, nodes), or the dataset that `chimera_hpc.open`
gives. The estimators call the functions by which a sweep is measured and classified.
"""

from chimera_hpc.base.public import load_on_use

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

__getattr__, __dir__ = load_on_use(
    __name__, {name: (f"{__name__}.{home}", name) for name, home in _HOMES.items()}
)
