"""Events in a few words, and the groups in which they are picked."""

from __future__ import annotations

from typing import Final

from automaton.engine import observation as codes
from automaton.engine.robot_states import BATTERY_PERCENT
from automaton.evidence.history.event_history import Event

EVENT_GROUPS: Final = {  # what can be picked in the list of events: name and codes
    "deliveries": (codes.EVENT_DELIVERED,),
    "deadlocks": (codes.EVENT_WAIT_CYCLE, codes.EVENT_DEADLOCK),
    "retreats": (codes.EVENT_RETREATED,),
    "picks": (codes.EVENT_PICKED, codes.EVENT_DROPPED, codes.EVENT_VISITED),
    "orders": (codes.EVENT_ORDER_TAKEN, codes.EVENT_ORDER_RETURNED),
    "parking bays": (codes.EVENT_LEFT_BAY, codes.EVENT_PARKED),
    "charging": (codes.EVENT_CHARGING,),
    "faults": (codes.EVENT_DEPLETED, codes.EVENT_FAILED, codes.EVENT_TOWED, codes.EVENT_BACK),
    "illegal": (codes.EVENT_ILLEGAL_DECISION,),
    "parts": (codes.EVENT_JOB_DONE, codes.EVENT_PART_FINISHED),
    "zones": (codes.EVENT_ZONES_REDESIGNED,),
}
TEXTS: Final = {
    codes.EVENT_ORDER_TAKEN: "takes order {subject}",
    codes.EVENT_PICKED: "picks up load {subject}",
    codes.EVENT_DROPPED: "drops load {subject}",
    codes.EVENT_DELIVERED: "delivers load {subject}",
    codes.EVENT_LEFT_BAY: "leaves its parking bay",
    codes.EVENT_PARKED: "is parked",
    codes.EVENT_RETREATED: "retreats {value} step{s}",
    codes.EVENT_ORDER_RETURNED: "returns order {subject}",
    codes.EVENT_CHARGING: "charges from {percent}",
    codes.EVENT_DEPLETED: "battery is empty",
    codes.EVENT_FAILED: "breaks down",
    codes.EVENT_TOWED: "is towed",
    codes.EVENT_BACK: "is back",
    codes.EVENT_ILLEGAL_DECISION: "illegal decision",
    codes.EVENT_WAIT_CYCLE: "wait cycle of {value} closes",
    codes.EVENT_DEADLOCK: "deadlock of {value} robots",
    codes.EVENT_JOB_DONE: "station {station} is done with part {subject}",
    codes.EVENT_PART_FINISHED: "part {subject} is finished",
    codes.EVENT_ZONES_REDESIGNED: "zones redesigned: {value} station{s}",
    codes.EVENT_VISITED: "does a stop of order {subject}",
}
TRIP_TEXTS: Final = TEXTS | {  # where orders are trips of pods
    codes.EVENT_ORDER_TAKEN: "takes trip {subject}",
    codes.EVENT_PICKED: "lifts the pod of trip {subject}",
    codes.EVENT_DELIVERED: "stores the pod of trip {subject}",
    codes.EVENT_ORDER_RETURNED: "returns trip {subject}",
    codes.EVENT_VISITED: "was served for trip {subject}",
}
SUBJECTS: Final = (
    codes.EVENT_ORDER_TAKEN,
    codes.EVENT_PICKED,
    codes.EVENT_DROPPED,
    codes.EVENT_DELIVERED,
    codes.EVENT_ORDER_RETURNED,
    codes.EVENT_VISITED,
)


def event_words(event: Event, trips: bool = False) -> str:
    """An event in a few words, without the robot."""
    plural = "" if event.value == 1 else "s"
    percent = f"{event.value / BATTERY_PERCENT:.0f} %"
    words = {"subject": event.subject, "value": event.value, "s": plural, "percent": percent}
    words["station"] = event.value + 1
    return (TRIP_TEXTS if trips else TEXTS)[event.code].format(**words)
