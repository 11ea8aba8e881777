"""Texts of mesh files: their characters, and where in them something is wrong."""

import codecs
import warnings
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from softseam_services.body.body import Floats

_MARKS = {codecs.BOM_UTF8: "utf-8", codecs.BOM_UTF16_LE: "utf-16-le", codecs.BOM_UTF16_BE: "utf-16-be"}


def decoded(data: bytes) -> str:
    """UTF-8, or UTF-16 where a mark says so; letters that are neither are replaced, as they are in names alone."""
    for mark, encoding in _MARKS.items():
        if data.startswith(mark):
            return data[len(mark) :].decode(encoding, "replace")
    return data.decode("utf-8", "replace")


def quoted(words: Sequence[str], most: int = 60) -> str:
    """Words as a message cites them, cut where they are long."""
    text = " ".join(words)
    return repr(text if len(text) <= most else text[: most - 3] + "...")


def numbers(text: bytes | str) -> Floats:
    """Numbers between blanks (k,). Raises ValueError where something else is among them."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return np.fromstring(text, dtype=np.float64, sep=" ") if text.strip() else np.zeros(0)
        except (DeprecationWarning, ValueError):
            words = text.split()
            for word in words:
                try:
                    float(word)
                except ValueError:
                    said = word.decode("latin-1") if isinstance(word, bytes) else word
                    raise ValueError(f"{quoted([said])} is no number") from None
            return np.array([float(word) for word in words])


def list_starts(flat: NDArray[np.int64], n: int) -> NDArray[np.int64]:
    """Where n lists with their lengths begin. Raises ValueError where they are not as long as all together."""
    width = len(flat) // max(n, 1)
    if width and width * n == len(flat) and (flat[::width] == width - 1).all():
        return np.arange(n) * width
    lengths, starts, at = flat.tolist(), [], 0
    for _ in range(n):
        starts.append(at)
        at += 1 + lengths[at]
    if at != len(flat):
        raise ValueError(f"{n:,} lists of {at:,} numbers in place of {len(flat):,}")
    return np.array(starts, dtype=np.int64)
