"""What zoning wants to hear of: orders that are in no queue, robots that fail or come back."""

from automaton.compiled import kernel
from automaton.world.state import UNQUEUED


@kernel
def tell_zoning(world):
    """Something happened: zoning is asked in this tick, or in the next one."""
    if world.zoning.wake.shape[0]:
        world.clock[UNQUEUED] += 1
