"""Whether damaged files do harm: mutants of every file that the program reads.

    python tests/proofs/mutated_files.py [--count 10000] [--seed 1] [--only CASE] [--first N]

Each is read by the commands that are for it, in a worker with 3 GB of memory and 60 s of processor time;
`tests/helpers/file_mutants.py` says how files are altered. It must end in one sentence and exit code 2,
or be accepted; a scenario that is accepted runs for 100 ticks. Prints what was counted and each file that
ended otherwise, and exits with 1 if there is one. The tests do some dozens.
"""

from __future__ import annotations

import argparse
import resource
import signal
import sys
import time
from collections import Counter
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from file_mutants import draw, outcome
from recording_trials import peak_memory

SECONDS = 60  # of processor time, for one file; a second time if it was spent on compiling kernels
MEMORY = 3 << 30  # bytes that may be in use
SPACE = 12 << 30  # and of addresses
RENEWED = 200  # files after which there is a new worker: each one has its own most memory


def work(pipe: Connection, seed: int, only: str) -> None:
    """Try the files that are named by their numbers, one after another, within bounds."""
    resource.setrlimit(resource.RLIMIT_AS, (SPACE, SPACE))
    while True:
        number = pipe.recv()
        case, files = draw(number, seed, only)
        signal.setitimer(signal.ITIMER_PROF, SECONDS)
        try:
            said = outcome(case, files)
        except MemoryError:
            said = "out of memory"
        except BaseException as error:
            said = f"{type(error).__name__}: {str(error)[:200]}"
        signal.setitimer(signal.ITIMER_PROF, 0)
        pipe.send((case.name, said, peak_memory()))


class Worker:
    """A process that tries files; restarted when it dies."""

    def __init__(self, seed: int, only: str) -> None:
        self._options = seed, only
        self._begin()

    def _begin(self) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=work, args=(theirs, *self._options), daemon=True)
        self._process.start()
        theirs.close()

    def tried(self, number: int) -> tuple[str, str, int]:
        """Return the case, what became of it, and the most bytes of memory so far."""
        result = self._tried(number)
        return self._tried(number) if result[1] == "hang" else result

    def _tried(self, number: int) -> tuple[str, str, int]:
        try:
            self._pipe.send(number)
            name, said, memory = self._pipe.recv()
            return name, said, memory
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._process.join()
            code = self._process.exitcode
            self._begin()
            name = draw(number, *self._options)[0].name
            return name, ("hang" if code == -signal.SIGPROF else f"crash: exit code {code}"), 0

    def end(self) -> None:
        self._process.kill()  # it may be in a command, which minds SIGTERM
        self._process.join()


def main() -> int:
    """Try the files; 1 if one of them ended as it must not."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", default="")
    options = parser.parse_args()
    begun = time.monotonic()
    counts: Counter[str] = Counter()
    wrong = peak = 0
    worker = Worker(options.seed, options.only)
    for number in range(options.first, options.first + options.count):
        name, said, memory = worker.tried(number)
        peak = max(peak, memory)
        if said not in ("accepted", "refused") or memory > MEMORY:
            wrong += 1
            room = f" with {memory >> 20} MiB" if memory > MEMORY else ""
            print(f"--seed {options.seed} --first {number} ({name}): {said}{room}", flush=True)
            said = "wrong"
        counts[said] += 1
        if (number + 1) % RENEWED == 0 or memory > MEMORY:
            worker.end()
            worker = Worker(options.seed, options.only)
            print(f"{number + 1}: {dict(counts)}, {time.monotonic() - begun:.0f} s", flush=True)
    worker.end()
    print(f"{dict(counts)}, at most {peak >> 20} MiB, {time.monotonic() - begun:.0f} s")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
