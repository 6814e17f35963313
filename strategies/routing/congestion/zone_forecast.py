"""Who will be where: predicted robots in each zone, tick by tick, from now to a horizon.

memory.shared   the counts of the zones, four ticks to a word; then room for a replay, and whether a
                count has overflowed. All of it is zero between two calls of a strategy.
memory.per_robot[i]   what is predicted of robot i: the columns below, then the steps of its plan,
then its
                visits to zones, which are what it adds to the counts.

A visit is zone << 32 | first tick << 16 | tick in which it is over. A count goes up to 65,535; one
that would go beyond stays there until all are forgotten.
"""

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL

HORIZON = 0  # entries of memory.parameters; a strategy's own come behind them
ZONES = 1
SHARES = 2  # 1: what is predicted of a zone is a share of all ticks, the same for each of them
OWN_PARAMETERS = 3

# Columns of memory.per_robot; ticks are counted from now.
PLACE = 0  # the cell in which its next step begins
TRAVEL = 1  # direction in which it comes there
HEADING = 2
FREE = 3  # tick in which its next step begins
STEP = 4  # steps begun
STEPS = 5  # steps of its plan
ZONE = 6  # where it is counted, or NIL
SINCE = 7  # the tick in which it came there
VISITS = 8
LINK = 9  # the robot whose step begins in the same tick, plus one
# 1: its first step begins in a parking bay, 2 or more: it has left it, its step ends after so many
IN_BAY = 10
KEPT = 11  # a number that a strategy keeps from call to call
TASK = 12  # of which task the plan is, where whole tasks are planned
COLUMNS = 13

LANES = 4  # counts in a word
LANE = 16  # bits of a count
MASK = (1 << LANE) - 1
EVERY_LANE = 0x0001000100010001
MAX_HORIZON = MASK  # of a horizon
WHOLE = 1_000_000  # a robot that is in a zone all the time, where shares are predicted


def row_size(horizon: int) -> int:
    """Columns of memory.per_robot for a horizon of so many ticks."""
    return COLUMNS + 2 * (horizon + 2)


def shared_size(traffic_zone_count: int, horizon: int) -> int:
    """Length of memory.shared for so many zones and ticks."""
    return traffic_zone_count * -(-horizon // LANES) + traffic_zone_count + horizon + 1


@kernel
def most_steps(memory):
    """Steps, and visits, that a row has room for: one for each tick, and for work that takes none."""
    return memory.parameters[HORIZON] + 2


@kernel
def words_of_zone(memory):
    return (memory.parameters[HORIZON] + LANES - 1) // LANES


@kernel
def present(memory, zone, tick):
    """Robots predicted in a zone at a tick; none where there is no zone, and beyond the horizon."""
    if zone == NIL or tick >= memory.parameters[HORIZON]:
        return 0
    word = memory.shared[zone * words_of_zone(memory) + tick // LANES]
    return (word >> (tick % LANES * LANE)) & MASK


@kernel
def occupancy(memory, zone, tick):
    """Thousandths of robots that are expected in a zone at a tick."""
    if zone != NIL and memory.parameters[SHARES]:
        return memory.shared[first_share(memory) + zone] // (WHOLE // 1000)
    return 1000 * present(memory, zone, tick)


@kernel
def first_share(memory):
    """Where the shares of the zones begin in memory.shared; a replay counts robots there."""
    return memory.parameters[ZONES] * words_of_zone(memory)


@kernel
def add(memory, zone, begin, end, sign):
    """Add `sign` to the counts of a zone from tick `begin` to before tick `end`."""
    base = zone * words_of_zone(memory)
    if memory.per_robot.shape[0] > MASK:
        add_within_bounds(memory, base, begin, end, sign)
        return
    tick = begin
    while tick < end:
        if tick % LANES == 0 and tick + LANES <= end:
            memory.shared[base + tick // LANES] += sign * EVERY_LANE
            tick += LANES
        else:
            memory.shared[base + tick // LANES] += sign << (tick % LANES * LANE)
            tick += 1


@kernel
def add_within_bounds(memory, base, begin, end, sign):
    """The same with more robots than a count can hold: it must not carry into its neighbour."""
    for tick in range(begin, end):
        word, shift = base + tick // LANES, tick % LANES * LANE
        count = (memory.shared[word] >> shift) & MASK
        if count == MASK or count + sign > MASK:
            memory.shared[word] |= MASK << shift
            memory.shared[memory.shared.shape[0] - 1] = 1
        else:
            memory.shared[word] += sign << shift


@kernel
def enter_zone(memory, i, zone, tick):
    """Robot i is in `zone` from `tick` on: its visit to the zone before is over, and counted."""
    row = memory.per_robot[i]
    if zone == row[ZONE]:
        return
    if row[ZONE] != NIL and tick > row[SINCE]:
        visit = COLUMNS + most_steps(memory) + row[VISITS]
        row[visit] = (row[ZONE] << 32) | (row[SINCE] << LANE) | tick
        row[VISITS] += 1
        add(memory, row[ZONE], row[SINCE], tick, 1)
    row[ZONE] = zone
    row[SINCE] = tick


@kernel
def forget(memory, i):
    """Take robot i out of the counts."""
    row = memory.per_robot[i]
    first = COLUMNS + most_steps(memory)
    for visit in row[first : first + row[VISITS]]:
        add(memory, visit >> 32, (visit >> LANE) & MASK, visit & MASK, -1)
    row[VISITS] = 0


@kernel
def forget_all(memory):
    """Leave the counts as they are found: all zero."""
    for i in range(memory.per_robot.shape[0]):
        forget(memory, i)
    if memory.shared[memory.shared.shape[0] - 1]:
        memory.shared[:] = 0
    if memory.parameters[SHARES]:
        first = first_share(memory)
        memory.shared[first : first + memory.parameters[ZONES]] = 0
