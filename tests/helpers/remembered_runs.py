"""Tests of one module that ask for the same runs share them: a scenario and a seed are run once."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

import msgspec
import pytest

from automaton.studies import process_pool
from automaton.studies.process_pool import Chunk, RunResult


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
                [known[key]] = carry_out(chunk._replace(jobs=(job,)))[1]
        return chunk.first, [known[key] for key in keys]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(process_pool, "run_chunk", run_chunk)
        yield
