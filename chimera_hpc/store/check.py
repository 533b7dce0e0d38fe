"""Finds damaged chunks: missing, truncated, altered."""

from __future__ import annotations

import time

import numpy as np
from numpy.typing import NDArray

from chimera_hpc.base.status import Status
from chimera_hpc.store.blocks import BlockFiles, Damage, DamagedChunk
from chimera_hpc.store.ledger import FIELDS, LedgerScan, digests

_RETRY_SECONDS = 0.5


def find_damaged(
    files: BlockFiles, ledger: LedgerScan, *, deep: bool = False, patience: float = 0.0
) -> list[Damage]:
    """Return what is damaged in the blocks that the ledger vouches for, ordered by block.

    Ledger chunks are always read whole. Of the other chunks presence and length are checked and, if
    `deep`, they are decoded, and the digest of every point is recomputed from the bytes on the
    disk. A missing chunk is looked for again until `patience` seconds are over: network file
    systems show new files late.
    """
    found = [Damage(block, "ledger", "wrong length or checksum") for block in ledger.damaged]
    deadline = time.monotonic() + patience
    for block in np.flatnonzero(ledger.written).tolist():
        damage = shallow_damage(files, block)
        while any(d.reason == "missing" for d in damage) and time.monotonic() < deadline:
            time.sleep(_RETRY_SECONDS)
            damage = shallow_damage(files, block)
        if deep:
            named = {d.array for d in damage}
            damage += [d for d in _deep_damage(files, block) if d.array not in named]
        found += damage
    return sorted(found, key=lambda damage: damage.block)


def shallow_damage(files: BlockFiles, block: int) -> list[Damage]:
    """Return which chunks of a block, the ledger's apart, are missing or of wrong length."""
    looks = (files.look(name, block) for name in files.shapes if name != "ledger")
    return [damage for damage in looks if damage]


def _deep_damage(files: BlockFiles, block: int) -> list[Damage]:
    damage = []
    chunks: dict[str, NDArray[np.float64]] = {}
    for name in files.shapes:
        try:
            chunks[name] = files.read(name, block)
        except DamagedChunk as error:
            damage.append(error.damage)
    if {"features", "scalars", "ledger"} <= set(chunks):
        ledger = chunks["ledger"]
        ran = ledger[:, FIELDS.index("status")] != Status.NEVER
        found = digests(chunks["features"][ran], chunks["scalars"][ran])
        wrong = np.count_nonzero(found != ledger[ran, FIELDS.index("digest")])
        if wrong:
            reason = f"another digest than the ledger's, in {wrong} points"
            damage.append(Damage(block, "features or scalars", reason))
    return damage
