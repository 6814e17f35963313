"""Recordings from Python: what a run was like, without running it again by its strategies.

from automaton.recordings import read

read("run.rec").tables(states="1 s", robots=[3]).states.to_pandas()
"""

from automaton.recordings.recorded_tables import RecordedRun, read

__all__ = ["RecordedRun", "read"]
