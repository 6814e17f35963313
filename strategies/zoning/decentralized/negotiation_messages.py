"""What robots that negotiate remember, tell each other, and reckon with; and who hears whom."""

import numpy as np

from automaton.engine.service_zones import MESSAGE_WORDS
from automaton.engine.state import NIL
from automaton.strategy.kernels import kernel, position
from strategies.zoning.design.zone_workspace import ZONE_RULE_COUNT
from strategies.zoning.queues.reassignment import is_running

NANO = 1_000_000_000  # loads are told in this part of a minute
DEGREES = 1 << 12  # more robots than any robot has in range
BIAS = NANO // 10  # that consensus begins with

# memory.per_robot
LOOK = 0  # tick of the next look
AVERAGE = 1  # tick of the next consensus
ROUND = 2  # step of the consensus that goes on, or NIL
MEAN = 3  # of the last one, in nano-minutes; NIL: none yet
IN = 4  # 1 in tolerance, 0 out of it, NIL unknown
SINCE = 5  # tick since which that is so
CALM = 6  # tick of the last calm, or of the last redesign
LED = 7  # turns led in this redesign
SHARE = 8  # tick of the next sharing
REDESIGNS = 9  # counters
SHARES = 10
MESSAGES = 11
OWN = 12

# words of `said`
VALUE = 0  # and 1: what consensus has come to, by even and odd steps: value * DEGREES + degree
REDESIGN = 2  # tick in which the redesign began, 0 before the first
LEADER = 3  # who leads next, as far as this robot knows
TURN = 4  # the number of that turn
TURNS = 5  # turns that this robot led
DONE = 6  # 1: the redesign is over

# memory.parameters, after the rules of zones in millionths
RANGE = 0  # cells
TOLERANCE = 1  # nano-minutes
PATIENCE = 2  # ticks
HYSTERESIS = 3
LOOK_EVERY = 4
AVERAGE_EVERY = 5
ROUNDS = 6
MOST_TURNS = 7
ITERATIONS = 8
HOT = 9  # millionths
COLD = 10
SCALE = 11
PAUSE = 12  # ticks
SHARING = 13
NEAR = 14  # cells
SHARE_EVERY = 15
FIRST_RULE = 16
AGE = FIRST_RULE + ZONE_RULE_COUNT  # weights of Algorithm 2, in thousandths
JOB = AGE + 1
FIRST_TRY = JOB + 1  # tries in which the first zones are not found
MILLION = 1_000_000

LEADERS = 33  # stream of the draws of the next leader


@kernel
def is_near(view, i, j, far):
    """Whether two robots are at most so many cells apart, as the crow flies, and both in order."""
    if i == j or not is_running(view, j):
        return False
    here, there = position(view, i), position(view, j)
    if there == NIL:
        return False
    width = view.grid.width
    across, down = here % width - there % width, here // width - there // width
    return across * across + down * down <= far * far


@kernel
def find_robots_in_range(view, reach, i, far):
    """Mark the zones of a robot and of those in range; returns how many of these there are."""
    count = 0
    for zone in range(reach.shape[0]):
        reach[zone] = 0
        server = np.int64(view.service_zones.server[zone])
        if server == NIL:
            continue
        j = np.int64(view.robots.at_index[server])
        if j == i or is_near(view, i, j, far):
            reach[zone] = 1
    for j in range(view.robots.cell.shape[0]):
        if is_near(view, i, j, far):
            count += 1
    return count


@kernel
def begin_message(view, out, k, i):
    """Begin to say something new: what robot i says stays as it is but for what is changed now."""
    if out.sends_message[k] == 0:
        out.sends_message[k] = 1
        for word in range(MESSAGE_WORDS):
            out.messages[k, word] = view.service_zones.messages[i, word]
