"""Recordings from Python: what a run was like, without running it again by its strategies.

from automaton.recordings import read

read("run.rec").tables(states="1 s", robots=[3]).states.to_pandas()
read("run.rec").picture(at=120, follow=3)
read("run.rec").film()
"""

from automaton.recordings.recorded_run import RecordedRun, read

__all__ = ["RecordedRun", "read"]
