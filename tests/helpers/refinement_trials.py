"""Whether a world whose tick is K times finer has its robots in the same places: drawn cases.

What robots want depends on the tick of the coarse world alone, and so does who goes first: `wants`
gives every robot a priority of its own, and the hash of the tick decides nothing. Every move, and
every delay, takes K times as many of the fine ticks. State t of the coarse world is then compared
with state K t of the fine one: cells, claims, and K times the ticks still to go.

A want of coarse tick t is put to the fine world in the first of its K ticks (ONCE), or in each of
them (ALWAYS). Under `convoy` and `none` both give the same states exactly:

* Moves that begin in a first fine tick end in a last one, as their lengths are multiples of K, the
  greatest of several lengths included. So the fine world has the state of the coarse one, with K
  times the ticks to go, whenever a first fine tick begins, and the same set of moves begins in it.
* Where a want is put again in a later fine tick of t, nothing has been given up since the first
  one: under `none` because no move has ended, under `convoy` because whoever moves gave up its cell
  in the first tick already, and that one was won by a robot that wanted it, or by nobody.

The second needs that a robot that came out of its parking bay keeps others out for all K ticks, not
for one fine tick; so bays are drawn for ONCE only. Under `handover` neither holds: a cell changes
hands in the last tick of a move, and that is another moment in the fine world.
"""

from __future__ import annotations

from dataclasses import dataclass

from moving_worlds import MakeWorld, States, Want, Wants
from reference_motion import splitmix64

from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import FloorPlan
from automaton.runs.pictures.pictures import Following

SYMBOLS = ".......===~~><v^#"  # cells for one, for two, without limit, of one way, walls
ONCE, ALWAYS = "once", "always"  # how often a want is put to the fine world
STANDS = 7  # of 8 values, the one with which a robot wants nothing


@dataclass(frozen=True)
class Case:
    """A floor, robots that each have their own ticks of a move, and the ticks for which they move."""

    seed: int
    floor_plan: FloorPlan
    cells: tuple[int, ...]
    move: tuple[int, ...]
    ticks: int

    def bits(self, tick: int, identity: int) -> int:
        """64 random bits of a coarse tick and a robot."""
        return splitmix64(self.seed << 24 | tick << 8 | identity)

    def wants(self, tick: int, fine: int, bays: bool) -> Wants:
        """What robots want in a coarse tick, in a world whose tick is `fine` times finer."""
        robots = range(len(self.cells))
        bits = {k: self.bits(tick, k) for k in robots}
        rank = {k: place for place, k in enumerate(sorted(robots, key=lambda k: bits[k] >> 16))}
        return {
            k: Want(b >> 3 & 3, fine * self.move[k], rank[k], bays and b >> 5 & 31 == 0)
            for k, b in bits.items()
            if b & 7 != STANDS
        }

    def delays(self, tick: int) -> dict[int, int]:
        """Coarse ticks of the delays that begin in a coarse tick."""
        bits = {k: self.bits(tick, k) for k in range(len(self.cells))}
        return {k: 1 + (b >> 10 & 3) for k, b in bits.items() if b >> 12 & 15 == 0}


def drawn_case(seed: int) -> Case:
    """A small floor, often crowded, with robots of 1 to 4 ticks a move."""
    draws = (splitmix64(seed << 32 | number) for number in range(1 << 16))
    width, height = 2 + next(draws) % 4, 1 + next(draws) % 4
    symbols = [SYMBOLS[next(draws) % len(SYMBOLS)] for _ in range(width * height)]
    symbols[0] = "."
    rows = ["".join(symbols[y * width :][:width]) for y in range(height)]
    floor_plan = draw_floor("\n".join(rows))
    drivable = [c for c, drives in enumerate(floor_plan.drivable.ravel().tolist()) if drives]
    places = sorted(drivable, key=lambda cell: next(draws))
    cells = tuple(places[: 1 + next(draws) % len(places)])
    slowest = 1 + next(draws) % 4
    move = tuple(1 + next(draws) % slowest for _ in cells)
    return Case(seed, floor_plan, cells, move, ticks=24)


def states_of(
    make: MakeWorld, case: Case, following: Following, fine: int, put: str
) -> list[States]:
    """The states after each coarse tick of a world whose tick is `fine` times finer."""
    world = make(case.floor_plan, case.cells, following)
    states = []
    for tick in range(1, case.ticks + 1):
        wants = case.wants(tick, fine, bays=put == ONCE)
        delays = {k: fine * ticks for k, ticks in case.delays(tick).items()}
        world.delay(fine * (tick - 1) + 1, delays)
        for part in range(fine):
            world.tick(fine * (tick - 1) + part + 1, wants if part == 0 or put == ALWAYS else {})
        states.append(world.states())
    return states


def is_refined(make: MakeWorld, case: Case, following: Following, fine: int, put: str) -> bool:
    """Whether a world whose tick is `fine` times finer goes through the states of the coarse one."""
    coarse = [
        [(cell, claim, fine * ticks) for cell, claim, ticks in states]
        for states in states_of(make, case, following, 1, put)
    ]
    return states_of(make, case, following, fine, put) == coarse
