"""Text files in whatever encoding they have."""

from __future__ import annotations

import gzip

from chimera_hpc.base.errors import BadInput


def text_of(raw: bytes) -> str:
    """Decode text, compressed or not: UTF-16 with its mark, UTF-8, else Windows-1252.

    A minus sign that is no hyphen becomes one. Raises BadInput for what is no text.
    """
    raw = gzip.decompress(raw) if raw.startswith(b"\x1f\x8b") else raw
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        text = raw.decode("utf-16")
    else:
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("cp1252", "replace")
    if "\0" in text:
        raise BadInput("can't be read as text: it holds bytes of value 0; save it as CSV in UTF-8")
    return text.replace("\u2212", "-").replace("\r\n", "\n").replace("\r", "\n")
