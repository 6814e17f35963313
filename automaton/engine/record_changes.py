"""The rows of changes that a recorded run keeps."""

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import CLOCK_CHANGE_ROWS, CLOCK_RECORDING, CLOCK_TICK

MAX_CHANGES = 13  # rows that a robot may add in a tick


@kernel
def record_change(clock, record, code, subject, value):
    """Append a row of changes if the run is recorded."""
    if clock[CLOCK_RECORDING]:
        row = clock[CLOCK_CHANGE_ROWS]
        record.changes[row, 0] = clock[CLOCK_TICK]
        record.changes[row, 1] = code
        record.changes[row, 2] = subject
        record.changes[row, 3] = value
        clock[CLOCK_CHANGE_ROWS] = row + 1
