"""What one robot remembers: under a radius a strategy sees its robot's rows of the state alone.

Its state exists twice then: in full, and as the strategy is shown it, which is zero but for the rows
of the robot that it is asked about. The loop knows no strategy's types, and moves bytes.
"""

from typing import Any

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.raw_memory import clear_bytes, copy_bytes
from automaton.engine.jit.structs import Struct

ROW_FULL = 0  # columns of memory.rows: address of a per-robot field in full; 0 for other fields
ROW_SHOWN = 1  # its address as shown
ROW_BYTES = 2  # of a robot's row; of the whole field unless it is per robot
NO_ROWS = np.zeros((0, 3), np.int64)  # without a radius
PER_ROBOT = "n"  # the first extent of fields with a row for each robot


def state_rows(full: Struct, shown: Struct) -> Any:
    """(f, 3) int64: the rows of a memory that has this state, in full and as shown."""
    rows = []
    for (_, declared, array), (_, _, other) in zip(full.arrays(), shown.arrays(), strict=True):
        if not declared.is_kept or not array.nbytes:
            continue
        addresses = [one.__array_interface__["data"][0] for one in (array, other)]
        if declared.extents[0] == PER_ROBOT:
            rows.append((*addresses, array.nbytes // len(array)))
        else:
            rows.append((0, addresses[1], array.nbytes))
    return np.array(rows, np.int64).reshape(len(rows), 3)


@kernel
def show_rows(rows, i):
    """Show a strategy what robot i remembers."""
    for k in range(rows.shape[0]):
        size = rows[k, ROW_BYTES]
        if rows[k, ROW_FULL]:
            copy_bytes(rows[k, ROW_SHOWN] + i * size, rows[k, ROW_FULL] + i * size, size)


@kernel
def keep_rows(rows, i):
    """Keep what robot i remembers now, and show nothing any more."""
    for k in range(rows.shape[0]):
        shown, size = rows[k, ROW_SHOWN], rows[k, ROW_BYTES]
        if rows[k, ROW_FULL]:
            shown += i * size
            copy_bytes(rows[k, ROW_FULL] + i * size, shown, size)
        clear_bytes(shown, size)
