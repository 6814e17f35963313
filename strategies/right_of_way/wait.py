"""Wait and retry, nothing else: the simplest right of way, which any head-on meeting defeats."""

from automaton.strategy.kernels import kernel
from automaton.strategy.layer import Strategy

NEVER_ASKED = 256  # failed retries are counted up to 255


@kernel
def decide(view, batch, decisions, memory, workspace):
    """Every decision stays KEEP."""


class Wait(Strategy):
    """Wait and retry for ever; robots that meet head-on stay there."""

    layer = "right_of_way"
    compiled = decide

    def wait_ranges(self):
        p = self.parameters
        return (*p.wait_empty, *p.wait_loaded, NEVER_ASKED)
