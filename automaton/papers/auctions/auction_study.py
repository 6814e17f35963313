"""De Ryck et al., sections 4 and 5: sequential auctions with the cost of charging in the bids.

M. De Ryck, D. Pissoort, T. Holvoet, E. Demeester: Decentral task allocation for industrial
AGV-systems with resource constraints.
"""

from __future__ import annotations

from typing import Final

from automaton.papers.auctions.auction_claims import CLAIMS, REMARKS
from automaton.papers.auctions.auction_example import steps
from automaton.papers.auctions.auction_pictures import pictures
from automaton.papers.auctions.auction_tables import TABLES
from automaton.papers.reproduction_study import Reproduction


def texts() -> list[tuple[str, str]]:
    """The worked example step by step, and the assigned routes."""
    return [("Section 4, step by step", "\n".join(steps())), *pictures()]


REPRODUCTION: Final = Reproduction(
    name="auctions",
    title="Sequential auctions of tasks, with charging in the bids",
    source="De Ryck, Pissoort, Holvoet & Demeester, Decentral task allocation for industrial "
    "AGV-systems with resource constraints",
    strategies=(),
    tables=TABLES,
    averaged=(),
    claims=CLAIMS,
    remarks=REMARKS,
    seeds=20,
    claims_title="Paper's claims",
    texts=texts,
)
