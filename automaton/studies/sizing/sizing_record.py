"""The answer of `automaton size` as one JSON object, and as a table; times are in ticks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from automaton.studies.sizing.fleet_search import Candidate, Search, lost_by_cause, mean_of
from automaton.studies.sizing.question import Question
from automaton.studies.sizing.sizing_report import USES
from automaton.studies.sizing.sizing_session import MarginalGain, SensitivityResult, SizingSession

if TYPE_CHECKING:
    import pyarrow as pa

ROW_KEYS = ("robots", "runs", "met", "unfinished", "verdict", "after", "excluded")


@dataclass(frozen=True)
class SizingResult:
    """The answer to how many robots are enough."""

    robots: int | None  # the smallest fleet that meets the target, as far as known
    strategy: str | None  # the setting with which it does; "": the scenario's own
    settled: bool  # whether no smaller fleet may yet meet it
    record: dict[str, Any]  # everything, as `automaton size --json` prints it

    @property
    def candidates(self) -> pa.Table:
        """The fleets that were looked at, a row for each; needs pyarrow (extra `experiments`)."""
        from automaton.studies.sweeps.result_store import arrow

        rows = [
            {"strategy": answer["strategy"], **flat(candidate)}
            for answer in self.record["answers"]
            for candidate in answer["candidates"]
        ]
        return arrow().Table.from_pylist(rows)


def flat(candidate: dict[str, Any]) -> dict[str, Any]:
    """A candidate of the record as a row: intervals as three columns."""
    row = {name: candidate[name] for name in ROW_KEYS}
    for name in ("share", "mean"):
        interval = candidate[name] or {}
        row[name] = interval.get("value")
        row |= {f"{name}_{end}": interval.get(end) for end in ("low", "high")}
    return row


def sized(session: SizingSession, name: str, seed: int) -> SizingResult:
    """The answer of a session."""
    record = as_json(session, name, seed, 0.0)
    return SizingResult(record["robots"], record["strategy"], record["settled"], record)


def as_json(session: SizingSession, name: str, seed: int, price: float) -> dict[str, Any]:
    """Everything that the text tells; the same for any number of workers."""
    question, place = session.question, session.place
    return {
        "scenario": name,
        "seed": seed,
        "target": {
            "metric": question.target.metric,
            "sense": "<=" if question.target.at_most else ">=",
            "value": question.target.value,
            "unit": question.target.unit,
        },
        "estimand": "mean" if question.mean else "share",
        "warm_up": question.warm_up,
        "success_share": None if question.mean else question.success_share,
        "indifference": question.indifference,
        "alpha": question.alpha,
        "candidates": question.candidates,
        "budget": question.budget,
        "spent": session.spent,
        "complete": session.complete,
        "same_orders": session.same_orders,
        "robots": None if place is None else place.robots,
        "strategy": None if place is None else place.strategy,
        "settled": session.settled,
        "price": place.robots * price if price and place is not None else None,
        "answers": [search_as_json(one, session) for one in session.searches],
        "best": plain(session.best),
        "sensitivity": [moved_as_json(moved, question) for moved in session.moved],
    }


def search_as_json(search: Search, session: SizingSession) -> dict[str, Any]:
    """One strategy."""
    gain = session.gains.get(search.strategy)
    return {
        "strategy": search.strategy,
        **search.answer._asdict(),
        "spent": search.spent,
        "candidates": [candidate_as_json(one, session.question) for one in search.candidates],
        "gain": None if gain is None else gain_as_json(gain),
    }


def candidate_as_json(candidate: Candidate, question: Question) -> dict[str, Any]:
    """One fleet."""
    share = candidate.share(question)
    mean = candidate.mean(question.target.metric)
    return {
        "robots": candidate.place.robots,
        "runs": len(candidate.runs),
        "met": candidate.met(question),
        "unfinished": candidate.censored,
        "verdict": candidate.verdict,
        "after": candidate.after,
        "excluded": candidate.excluded or None,
        "refused": candidate.refused or None,
        "share": plain(share) if candidate.runs else None,
        "mean": plain(mean),
        "lost": lost_by_cause(candidate),
        "use": {
            what: mean_of(candidate, name)
            for name, what in USES.items()
            if any(name in run.figures for run in candidate.runs)
        },
    }


def gain_as_json(gain: MarginalGain) -> dict[str, Any]:
    """What the last robot gains: a difference with its interval, and what pairing would do."""
    return {"robots": gain.robots, "refused": gain.refused or None, "effect": plain(gain.effect)}


def plain(value: Any) -> Any:
    """Named tuples, within each other, as objects."""
    if not hasattr(value, "_asdict"):
        return value
    return {name: plain(one) for name, one in value._asdict().items()}


def moved_as_json(moved: SensitivityResult, question: Question) -> dict[str, Any]:
    """The fleets around the answer under other durations."""
    return {
        "percent": moved.percent,
        "smallest": moved.smallest(question),
        "fleets": [candidate_as_json(one, question) for one in moved.around],
    }
