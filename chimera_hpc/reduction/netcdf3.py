"""NetCDF 3 files of any size, in little memory: the header of a tiny file, with other lengths.

A file of the classic format begins with a header: lengths of the dimensions, and for each variable
its bytes and where they begin. The variables without the unlimited dimension follow, then the
records: one value along that dimension of each of the others.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8}
"""Bytes of a value by the number of its type."""
_LARGEST = 2**32 - 1
"""Stands for more bytes than a number of 32 bits can say."""


@dataclass(frozen=True)
class Place:
    """Where the values of a variable are."""

    begin: int
    """Of all, or of those in the first record."""
    shape: tuple[int, ...]
    """Without the unlimited dimension."""
    size: int
    """Bytes of all values, or of those in a record, without padding."""


@dataclass(frozen=True)
class Layout:
    """A header, and where the values are."""

    head: bytes
    places: Mapping[str, Place]
    record: int
    """Bytes from one record to the next."""


def resized(template: bytes, lengths: Mapping[str, int], n_records: int) -> Layout:
    """Return the layout of a file as `template`, but for the lengths of some of its dimensions."""
    head, scan = bytearray(template), _Scan(template)
    head[4:8] = n_records.to_bytes(4, "big")
    dimensions = []
    scan.number()
    for _ in range(scan.number()):
        name, length = scan.text(), scan.number()
        length = lengths.get(name, length) if length else 0
        head[scan.at - 4 : scan.at] = length.to_bytes(4, "big")
        dimensions.append(length)
    scan.attributes()
    variables = []
    scan.number()
    for _ in range(scan.number()):
        name, shape = scan.text(), [dimensions[scan.number()] for _ in range(scan.number())]
        scan.attributes()
        variables.append((name, shape, _BYTES[scan.number()], scan.at))
        scan.at += 12
    places, end, record = {}, scan.at, 0
    # Stable: the order is kept otherwise.
    for name, shape, size, at in sorted(variables, key=lambda variable: 0 in variable[1]):
        is_record = 0 in shape
        inner = tuple(shape[1:] if is_record else shape)
        places[name] = Place(end, inner, size * math.prod(inner))
        padded = places[name].size + -places[name].size % 4
        head[at : at + 4] = min(padded, _LARGEST).to_bytes(4, "big")
        head[at + 4 : at + 12] = end.to_bytes(8, "big")
        end += padded
        record += padded * is_record
    return Layout(bytes(head[: scan.at]), places, record)


class _Scan:
    """Reads a header from the front."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 8

    def number(self) -> int:
        self.at += 4
        return int.from_bytes(self.data[self.at - 4 : self.at], "big")

    def text(self) -> str:
        size = self.number()
        text = self.data[self.at : self.at + size].decode()
        self.at += size + -size % 4
        return text

    def attributes(self) -> None:
        self.number()
        for _ in range(self.number()):
            self.text()
            size = _BYTES[self.number()] * self.number()
            self.at += size + -size % 4
