"""Chimera states in networks of oscillators: sweeps, measures, classes.

The public names are loaded when they are first used (PEP 562), so that ``import chimera_hpc`` costs
milliseconds: the kernels compile, and scikit-learn alone takes seconds.
"""

from chimera_hpc.base.public import load_on_use

# Not from typing: the current folder, which may hold a typing.py, may come first on the path yet.
TYPE_CHECKING = False

if TYPE_CHECKING:
    from chimera_hpc.measures.fourier import fourier_features
    from chimera_hpc.measures.variation import total_variations
    from chimera_hpc.models.custom import OwnModel
    from chimera_hpc.models.frequencies import natural_frequencies
    from chimera_hpc.models.kuramoto_sakaguchi import KuramotoSakaguchi
    from chimera_hpc.models.networked_fhn import NetworkedFHN
    from chimera_hpc.models.networked_fhn_network import NetworkFHN
    from chimera_hpc.models.parameters import Limit, Parameter
    from chimera_hpc.models.simplicial_kuramoto import SimplicialKuramoto
    from chimera_hpc.models.stuart_landau import StuartLandau
    from chimera_hpc.models.topological_fhn import TopologicalFHN
    from chimera_hpc.network.network import Network
    from chimera_hpc.network.topology import Topology
    from chimera_hpc.recordings.many import classify_recordings
    from chimera_hpc.run.simulate import simulate
    from chimera_hpc.store.labelled import open_sweep as open

__version__ = "0.2.0"

__all__ = [
    "KuramotoSakaguchi",
    "Limit",
    "Network",
    "NetworkFHN",
    "NetworkedFHN",
    "OwnModel",
    "Parameter",
    "SimplicialKuramoto",
    "StuartLandau",
    "TopologicalFHN",
    "Topology",
    "__version__",
    "classify_recordings",
    "fourier_features",
    "natural_frequencies",
    "open",
    "simulate",
    "total_variations",
]

# public name -> the module that has it, and its name there
_EXPORTS = {
    "Limit": ("chimera_hpc.models.parameters", "Limit"),
    "Network": ("chimera_hpc.network.network", "Network"),
    "KuramotoSakaguchi": ("chimera_hpc.models.kuramoto_sakaguchi", "KuramotoSakaguchi"),
    "NetworkFHN": ("chimera_hpc.models.networked_fhn_network", "NetworkFHN"),
    "SimplicialKuramoto": ("chimera_hpc.models.simplicial_kuramoto", "SimplicialKuramoto"),
    "StuartLandau": ("chimera_hpc.models.stuart_landau", "StuartLandau"),
    "TopologicalFHN": ("chimera_hpc.models.topological_fhn", "TopologicalFHN"),
    "natural_frequencies": ("chimera_hpc.models.frequencies", "natural_frequencies"),
    "NetworkedFHN": ("chimera_hpc.models.networked_fhn", "NetworkedFHN"),
    "OwnModel": ("chimera_hpc.models.custom", "OwnModel"),
    "Parameter": ("chimera_hpc.models.parameters", "Parameter"),
    "Topology": ("chimera_hpc.network.topology", "Topology"),
    "classify_recordings": ("chimera_hpc.recordings.many", "classify_recordings"),
    "fourier_features": ("chimera_hpc.measures.fourier", "fourier_features"),
    "open": ("chimera_hpc.store.labelled", "open_sweep"),
    "simulate": ("chimera_hpc.run.simulate", "simulate"),
    "total_variations": ("chimera_hpc.measures.variation", "total_variations"),
}

__getattr__, __dir__ = load_on_use(__name__, _EXPORTS)
