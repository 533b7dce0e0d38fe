"""Topology, the name that Network has had since it was only a ring."""

from chimera_hpc.network.network import Network

Topology = Network
