"""Random numbers for statistics, addressed by a seed: the same on every machine and NumPy version.

The mixer is SplitMix64's finalizer (Steele, Lea & Flood 2014), as in the kernels, on whole arrays.
"""

from __future__ import annotations

from typing import Final

import numpy as np
import numpy.typing as npt

Bits = npt.NDArray[np.uint64]

_GOLDEN: Final = np.uint64(0x9E3779B97F4A7C15)
_A: Final = np.uint64(0xBF58476D1CE4E5B9)
_B: Final = np.uint64(0x94D049BB133111EB)


def mixed(value: Bits) -> Bits:
    """A bijection of the 64-bit integers, elementwise."""
    value = (value ^ (value >> np.uint64(30))) * _A
    value = (value ^ (value >> np.uint64(27))) * _B
    return value ^ (value >> np.uint64(31))


def bits(seed: int, rows: int, columns: int) -> Bits:
    """(rows, columns) 64 random bits each, addressed by seed, row and column."""
    with np.errstate(over="ignore"):
        start = mixed(np.array([seed % 2**64], np.uint64) + _GOLDEN)
        row = mixed(start ^ (np.arange(rows, dtype=np.uint64) * _GOLDEN + _A))
        return mixed(row[:, None] ^ (np.arange(columns, dtype=np.uint64) * _GOLDEN + _B))


def resamples(seed: int, rows: int, n: int) -> npt.NDArray[np.int64]:
    """(rows, n) indices drawn with replacement from 0..n - 1: bootstrap samples."""
    high = bits(seed, rows, n) >> np.uint64(32)
    return (high * np.uint64(n) >> np.uint64(32)).astype(np.int64)


def uniforms(seed: int, rows: int, columns: int) -> npt.NDArray[np.float64]:
    """(rows, columns) uniform numbers in (0, 1)."""
    found: npt.NDArray[np.float64] = ((bits(seed, rows, columns) >> np.uint64(11)) + 0.5) / 2**53
    return found
