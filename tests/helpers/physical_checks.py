"""What no run may do, read off positions, loads and charges as they are before and after a tick.

A third opinion: it knows neither the kernels that move robots nor the validator of recordings, and
never asks who claimed what or what was legal, only where everything was and is.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass

from automaton.engine.state import (
    ACTION_CHARGE,
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_TURN,
    ACTION_WAIT,
    BATTERY_FULL,
    FOLLOWING_CONVOY,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    STATUS_DEPLETED,
    STATUS_FAILED,
    STATUS_REMOVED,
    STATUS_TOWED,
    World,
)
from automaton.floor.floor_plan import CHARGER, RACK, STATION

Edge = tuple[int, int]
OFF_THE_FLOOR = (STATUS_TOWED, STATUS_REMOVED)
OUT_OF_ORDER = (STATUS_DEPLETED, STATUS_FAILED)


@dataclass
class Picture:
    """A world after a tick; robots by identity."""

    cell: list[int]
    claim: list[int]
    busy: list[int]
    heading: list[int]
    travel: list[int]
    status: list[int]
    load: list[int]
    charge: list[int]
    home: list[int]
    state: list[int]  # of orders
    place: list[int]
    slot: list[int]  # cells of slots


def picture_of(world: World) -> Picture:
    robots = world.robots
    names = ["cell", "claim", "busy", "heading", "travel", "status", "load", "charge", "home"]
    arrays = [getattr(robots, name)[robots.at_index].tolist() for name in names]
    orders = (
        world.orders.state.tolist(),
        world.orders.current_slot.tolist(),
        world.slots.cell.tolist(),
    )
    return Picture(*arrays, *orders)


def whereabouts(picture: Picture, order: int) -> int:
    """The cell in which an order lies, or of the robot that carries it; NIL: nowhere."""
    if picture.place[order] != NIL:
        return picture.slot[picture.place[order]]
    return picture.cell[picture.load.index(order)] if order in picture.load else NIL


class PhysicalChecks:
    """Watches a run; `found` counts what was wrong by kind, `first` says where each kind began."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.capacity = (world.grid.cell_flags >> 5 & 3).tolist()  # 0: no limit
        self.exits = (world.grid.cell_flags & 15).tolist()
        self.kind = world.grid.kind.tolist()
        self.step = [int(offset) for offset in world.grid.offset[:4]]
        self.drain = world.rules.drain[0].tolist()
        self.ticks = 0
        self.found: Counter[str] = Counter()
        self.first: dict[str, str] = {}
        self.now = picture_of(world)

    def tick(self) -> None:
        """Compare the world with what it was a tick ago."""
        before, self.now = self.now, picture_of(self.world)
        self.ticks += 1
        self._check_room()
        self._check_edges([self._edge(before, r) for r in range(len(self.now.cell))])
        for r in range(len(self.now.cell)):
            self._check_jump(before, r)
            self._check_condition(before, r)
            if self.world.rules.battery:
                self._check_charge(before, r)
        self._check_loads(before)

    def _wrong(self, kind: str, text: str) -> None:
        self.found[kind] += 1
        self.first.setdefault(kind, f"tick {self.ticks}: {text}")

    # Positions

    def _check_room(self) -> None:
        """No cell holds too many robots; under convoy a robot may come into what another one leaves."""
        inside: dict[int, list[int]] = defaultdict(list)  # lanes that robots are in, by cell
        ahead: dict[int, list[int]] = defaultdict(list)  # and where they will be
        convoy = self.world.rules.following == FOLLOWING_CONVOY
        for r, (cell, claim) in enumerate(zip(self.now.cell, self.now.claim, strict=True)):
            if cell == NIL:
                continue
            lane = self.now.travel[r] >> 1
            is_moving = claim not in (NIL, cell)
            inside[cell].append(lane)
            if claim == cell:
                inside[cell].append(1 - lane)
            if is_moving:
                ahead[claim].append(self.step.index(claim - cell) >> 1)
            if not is_moving or not convoy:
                ahead[cell].extend([lane, 1 - lane] if claim == cell else [lane])
        for cell, lanes in [*inside.items(), *ahead.items()]:
            limit = self.capacity[cell]
            if limit and (len(lanes) > limit or (limit == 2 and len(set(lanes)) < len(lanes))):
                self._wrong("collision", f"{len(lanes)} robots in cell {cell}")

    def _edge(self, before: Picture, r: int) -> Edge | None:
        """The edge on which a robot was during the tick, or None."""
        cell, now = before.cell[r], self.now.cell[r]
        if before.claim[r] not in (NIL, cell):
            return cell, before.claim[r]
        if self.now.claim[r] not in (NIL, now):
            return now, self.now.claim[r]
        parked = now == NIL and self.now.status[r] not in OFF_THE_FLOOR
        begin = self.now.home[r] if cell == NIL else cell
        end = self.now.home[r] if parked else now
        return (begin, end) if NIL not in (begin, end) and begin != end else None

    def _check_edges(self, edges: list[Edge | None]) -> None:
        robots: dict[Edge, list[int]] = defaultdict(list)
        for r, edge in enumerate(edges):
            if edge is not None:
                robots[edge].append(r)
        for (begin, end), drivers in robots.items():
            step = end - begin
            if step not in self.step or not self.exits[begin] >> self.step.index(step) & 1:
                self._wrong("jump", f"robots {drivers} from cell {begin} to {end}")
            others = robots.get((end, begin), []) if begin < end else []
            if others and 1 in (self.capacity[begin], self.capacity[end]):
                at_once = all(self.now.claim[r] == NIL for r in drivers + others)
                kind = "swap" if at_once else "overlap on an edge"
                self._wrong(kind, f"robots {drivers} and {others} over {begin} - {end}")

    def _check_jump(self, before: Picture, r: int) -> None:
        """A move ends where it leads, and only then may the robot do something else."""
        claim, now = before.claim[r], self.now.cell[r]
        arrived = now == claim or (now == NIL and claim == self.now.home[r])
        if claim != NIL and not arrived and (now, self.now.claim[r]) != (before.cell[r], claim):
            self._wrong("jump", f"robot {r} leaves its way to cell {claim} for {now}")

    def _check_condition(self, before: Picture, r: int) -> None:
        """Who is down stands still."""
        if before.status[r] in OUT_OF_ORDER and self.now.status[r] in OUT_OF_ORDER:
            for name in ("cell", "claim", "heading", "load", "charge"):
                if getattr(before, name)[r] != getattr(self.now, name)[r]:
                    self._wrong("down", f"robot {r} changes its {name}")

    # Charges

    def _check_charge(self, before: Picture, r: int) -> None:
        """What begins is paid at once and in full; nothing else than a charger gives charge."""
        was, now = before.charge[r], self.now.charge[r]
        if not 0 <= now <= BATTERY_FULL:
            self._wrong("battery", f"robot {r} has {now} units")
        action = self._begun(before, r)
        loaded = int(before.load[r] != NIL)
        if before.status[r] == STATUS_TOWED != self.now.status[r]:
            return  # it comes back from repair, and may be exhausted in the same tick
        if action != NIL:
            ticks = self.now.busy[r] + 1
            price = ticks * self.drain[action][loaded]
            if action == ACTION_MOVE and self.world.rules.following == FOLLOWING_CONVOY:
                own = int(self.world.traffic.own_ticks[self.world.robots.at_index[r]])
                waits = (ticks - own) * self.drain[ACTION_WAIT][loaded]
                price = own * self.drain[action][loaded]
                price += min(waits, was - price)
            if was - now != price:
                self._wrong("battery", f"robot {r} pays {was - now} of {was}, not {price}")
        elif now > was:
            charger = self.now.cell[r] != NIL and self.kind[self.now.cell[r]] == CHARGER
            charges = self.world.robots.action[self.world.robots.at_index[r]] == ACTION_CHARGE
            if not charger or not charges or now - was > self.world.rules.curve[:, :, 1].max():
                self._wrong("battery", f"robot {r} gains {now - was} units")

    def _begun(self, before: Picture, r: int) -> int:
        """The operation that a robot begins in this tick and that takes time, or NIL."""
        if before.busy[r] > 0:
            return NIL
        if self._edge(before, r) is not None:
            return ACTION_MOVE
        on_floor = NIL not in (before.cell[r], self.now.cell[r])
        if on_floor and before.heading[r] != self.now.heading[r]:
            return ACTION_TURN
        if before.status[r] not in OUT_OF_ORDER and self.now.status[r] in OUT_OF_ORDER:
            return NIL
        if before.load[r] != self.now.load[r]:
            return ACTION_PICK if before.load[r] == NIL else ACTION_DROP
        return NIL

    # Loads

    def _check_loads(self, before: Picture) -> None:
        now = self.now
        carried = Counter(load for load in now.load if load != NIL)
        for order, (state, place) in enumerate(zip(now.state, now.place, strict=True)):
            robots, slots = carried[order], int(place != NIL)
            if robots + slots != 1 or (state == ORDER_CARRIED) != (robots == 1):
                self._wrong("load", f"order {order}: {robots} robots, {slots} slots have it")
            if before.state[order] == ORDER_DELIVERED != state:
                self._wrong("load", f"order {order} was delivered, and is not any more")
            if before.place[order] != place and NIL not in (before.place[order], place):
                self._wrong("load", f"order {order} jumps from slot {before.place[order]}")
        for r, (was, load) in enumerate(zip(before.load, now.load, strict=True)):
            if was != load and NIL not in (was, load):
                self._wrong("load", f"robot {r} has load {load} in place of {was}")
            elif was != load:
                where = whereabouts(before, load) if was == NIL else whereabouts(now, was)
                # What a robot that is down leaves may be picked up in the same tick.
                taken = was != NIL and was in now.load and now.status[r] in OUT_OF_ORDER
                if not taken and not self._reaches(before, r, where):
                    self._wrong("load", f"robot {r} handles a load in cell {where}")
        full = [int(order) for order in self.world.slots.content if order != NIL]
        if len(set(full)) < len(full) or any(now.place[o] == NIL for o in full):
            self._wrong("load", "a shelf holds what lies elsewhere")

    def _reaches(self, before: Picture, r: int, cell: int) -> bool:
        """Whether a robot stands where it handles what lies in a cell, or has left it there."""
        here = self.now.cell[r] if self.now.cell[r] != NIL else before.cell[r]
        if self.now.status[r] not in (0, 1, 2):
            return cell == (before.cell[r] if before.cell[r] != NIL else here)
        if here == cell:
            return self.kind[cell] == STATION
        return here - cell in (self.step if self.kind[cell] != RACK else self.step[1::2])
