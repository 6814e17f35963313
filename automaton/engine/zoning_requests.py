"""What zoning wants to hear of: orders that are in no queue, robots that fail or come back."""

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import CLOCK_UNQUEUED_ORDERS


@kernel
def request_zoning(world):
    """Something happened: zoning is asked in this tick, or in the next one."""
    if world.service_zones.wake.shape[0]:
        world.clock[CLOCK_UNQUEUED_ORDERS] += 1
