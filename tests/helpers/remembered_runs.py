"""Tests that ask for the same runs share them: a scenario and a seed are run once.

Those of one module share all runs; workers of pytest-xdist share runs of shipped strategies by files.
"""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Iterator
from contextlib import contextmanager
from functools import wraps
from pathlib import Path
from typing import Any

import msgspec
import pytest

from automaton.studies import process_pool
from automaton.studies.process_pool import Chunk, RunResult
from automaton.world.resolved import Resolved

FOLDER = "RUNS_OF_ALL_WORKERS"  # the variable that names it (conftest.py)


def kept(resolved: Resolved, key: Any) -> Path | None:
    """The file of a run, if its scenario says all about it: a strategy of a test may change."""
    if FOLDER not in os.environ or any(":" in choice.name for _, choice in resolved.choices):
        return None
    name, floor = getattr(key[-1], "__qualname__", "<with arguments>"), resolved.floor_plan
    if "<" in name:  # what such a function does is not said by its name
        return None
    conduct = f"{key[-1].__module__}.{name}"
    parts = repr(key[:-1]), conduct, floor.kind.tobytes(), floor.exits.tobytes()
    return Path(os.environ[FOLDER], hashlib.sha256(repr(parts).encode()).hexdigest())


def carried_out(resolved: Resolved, key: Any, chunk: Chunk, carry_out: Any) -> RunResult:
    """The result of a chunk of one run, which another worker may have carried out."""
    path = kept(resolved, key)
    if path is not None and path.exists():
        known: RunResult = pickle.loads(path.read_bytes())
        return known
    [result] = carry_out(chunk)[1]
    if path is not None:
        half = path.with_suffix(f".{os.getpid()}")
        half.write_bytes(pickle.dumps(result))
        half.rename(path)
    return result


@contextmanager
def remembered_runs() -> Iterator[None]:
    """Meanwhile this process carries out no run of many a second time; workers carry out theirs."""
    known: dict[Any, RunResult] = {}
    carry_out = process_pool.run_chunk
    encode = msgspec.json.Encoder(enc_hook=lambda table: None).encode  # the files tell its rows

    @wraps(carry_out)  # workers are sent the name of the original
    def run_chunk(chunk: Chunk) -> tuple[int, list[RunResult]]:
        keys = [
            (encode(resolved.scenario), resolved.files, seed, chunk.conduct)
            for resolved, seed in chunk.jobs
        ]
        for key, job in zip(keys, chunk.jobs, strict=True):
            if key not in known:
                known[key] = carried_out(job[0], key, chunk._replace(jobs=(job,)), carry_out)
        return chunk.first, [known[key] for key in keys]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(process_pool, "run_chunk", run_chunk)
        yield
