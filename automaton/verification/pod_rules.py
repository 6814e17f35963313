"""The rules of pods: independent checks of lines, trips, places and pods.

Lines are released in sequence and join trips by fixed rules; a trip has a place at the station of
its next stop, or ends in storage. Actions of robots with pods come from the recording; everything
else is recomputed from the lines of the header.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Any, Final

from automaton.engine.record_codes import ACTION_MASK, MOVE_NORTH
from automaton.floor.floor_plan import CELL_KINDS, STORAGE
from automaton.verification.motion_rules import Acts, Complaint, ReplayedMotion
from automaton.verification.move_time_rules import NIL

PARTS_OF_TICK: Final = 1_000_000  # parts of a tick, in which handling is recorded
LONGEST: Final = 65_535  # base duration of a visit in ticks
NOT_YET: Final = (1 << 31) - 1  # release of a trip without lines

Idle = Callable[[int, int], bool]  # whether a trip may be reserved for a robot


class ReplayedTrips:
    """The positions of pods, waiting lines, and places of robots; trips are numbered like orders."""

    def __init__(
        self, header: dict[str, Any], motion: ReplayedMotion, report_violation: Complaint
    ) -> None:
        self.motion = motion
        self.report_violation = report_violation
        self.there = "pods" in header  # otherwise all fields are empty
        # Otherwise trips are listed orders, with their own stops.
        self.of_lines = "lines" in header
        scenario = header["scenario"]
        rules = scenario.get("pods") or {}
        self._factor: int = scenario.get("refine", 1)  # handling is recorded in coarse ticks
        self._joins: bool = rules.get("join", True)
        self._drives_under: bool = rules.get("under", "empty") == "empty"
        self._most_stops: int = rules.get("max_stops", 0)
        self.slot_cell: list[int] = header["slots"]["cell"].tolist()
        lines = _lists(header.get("lines"))
        stations = _lists(header.get("pod_stations"))
        self.slot: list[int] = _lists(header.get("pods")).get("slot", [])
        self.standing = {self.slot_cell[slot]: pod for pod, slot in enumerate(self.slot)}
        self.trip = [NIL] * len(self.slot)  # of each pod, until the trip is done
        self.waiting: list[list[int]] = [[] for _ in self.slot]  # lines that wait for its next trip
        self._stored: list[int] = []  # pods stored in this tick
        self._order: list[int] = lines.get("order", [])
        self._pod: list[int] = lines.get("pod", [])
        self._asks: list[int] = lines.get("station", [])
        self._release: list[int] = lines.get("release_tick", [])
        self._priority: list[int] = lines.get("priority", [])
        self._sku: list[int] = lines.get("sku", [])
        self._holders = _holders(header.get("pods") or {})
        self.weight: list[int] = _lists(header.get("pods")).get("weight", [1] * len(self.slot))
        self.taken_from = list(self._pod)
        self.wanted = [0] * len(self.slot)  # open lines of each pod: known and not done
        self._handling: list[list[int]] = lines.get("handling", [])
        count = len(self._pod)
        self._coming = sorted(range(count), key=lambda line: (-self._release[line], -line))
        self.served_at, self.in_trip, self.done = [NIL] * count, [NIL] * count, [NIL] * count
        self._station_of_order: dict[int, int] = {}
        self.cell: list[int] = stations.get("cell", [])
        self._places: list[int] = stations.get("places", [])
        self._rule: list[int] = stations.get("rule", [])
        self._visit: list[int] = stations.get("visit", [])
        self._ticks_from: list[list[int]] = stations.get("ticks_from", [])
        self.taken, self.open = [0] * len(self.cell), [0] * len(self.cell)
        self._ways = LoadedWays(motion, self.cell)
        self._breaks = _breaks(header, self.cell)
        self._serving: dict[int, tuple[int, int]] = {}  # station -> its robot, and the last tick
        self.known = 0  # trips
        if not self.of_lines:
            count = len(header["orders"]["source"]) if self.there else 0
        self.pod_of = [NIL] * count  # by trip
        if not self.of_lines:
            stands = {slot: pod for pod, slot in enumerate(self.slot)}
            self.pod_of = [
                stands.get(slot, NIL) for slot in header["orders"]["source"][:count].tolist()
            ]
        self.begun, self.priority, self.release = [0] * count, [0] * count, [NOT_YET] * count
        self.stops: list[list[int]] = [[] for _ in range(count)]  # stations
        self.served: list[list[list[int]]] = [[] for _ in range(count)]  # lines, by stop
        self.over = [0] * count  # completed stops
        robots = len(motion.home)
        self.place, self.leaving, self.offered = [NIL] * robots, [NIL] * robots, [NIL] * robots
        self.offers: dict[int, int] = {}  # trips of this tick -> robot beneath the pod
        self._withdrawn: dict[int, int] = {}  # robot -> trip, in this tick, without a reason yet
        # A robot about to fail gets no offer; actions do not show this.
        faults = scenario["faults"]
        self._may_fail = bool(faults.get("listed") or faults.get("failure_probability"))
        self._may_fail |= scenario.get("battery") is not None

    # Lines become trips

    def plan(self, tick: int, is_free: Idle) -> list[tuple[int, int]]:
        """Release lines; returns new trips with their slots. `is_free`: robot, trip."""
        before = self.known
        for pod in sorted(self._stored):
            lines, self.waiting[pod] = self.waiting[pod], []
            trip = self._new_trip(pod, is_free)
            for number, line in enumerate(lines):
                if (number and not self._joins) or not self._add(trip, line):
                    self.waiting[pod].append(line)
        self._stored.clear()
        while self._coming and self._release[self._coming[-1]] <= tick:
            line = self._coming.pop()
            self._choose_station(line)
            self._choose_pod(line)
            self._take_line(line, is_free)
        return [(trip, self.slot[self.pod_of[trip]]) for trip in range(before, self.known)]

    def line_up(
        self, released: list[int], is_free: Callable[[int, int], bool]
    ) -> list[tuple[int, int]]:
        """Listed orders whose pods have no other order, with their slots; the others wait.

        `released`: orders of this tick that carry pods.
        """
        begun = [(pod, self.waiting[pod].pop(0)) for pod in sorted(self._stored)]
        self._stored.clear()
        for pod, order in begun:
            self._begin(pod, order, is_free)
        for order in released:
            pod = self.pod_of[order]
            if self.trip[pod] == NIL:
                self._begin(pod, order, is_free)
                begun.append((pod, order))
            else:
                self.waiting[pod].append(order)
        return [(order, self.slot[pod]) for pod, order in begun]

    def _choose_station(self, line: int) -> None:
        order = self._order[line]
        station = self._asks[line]
        if station == NIL:
            fewest = min(range(len(self.cell)), key=lambda k: (self.open[k], k))
            station = self._station_of_order.get(order, fewest)
        self.served_at[line] = self._station_of_order[order] = station
        self.open[station] += 1

    def _choose_pod(self, line: int) -> None:
        """A pod with the SKU: with a coming stop there, else the nearest stored one, else the least
        in demand."""
        if self._pod[line] == NIL:
            station, pods = self.served_at[line], self._holders[self._sku[line]]
            calling = [pod for pod in pods if self._joins and self._calls_at(pod, station)]
            at_rest = [pod for pod in pods if self.trip[pod] == NIL and self.slot[pod] != NIL]
            ticks = self._ticks_from[station] if at_rest else []
            at_rest.sort(key=lambda pod: (ticks[self.slot[pod]], pod))
            rarely = sorted(pods, key=lambda pod: (self.wanted[pod], pod))
            self.taken_from[line] = (calling or at_rest or rarely)[0]
        self.wanted[self.taken_from[line]] += 1

    def _calls_at(self, pod: int, station: int) -> bool:
        """Whether a pod's trip has a stop at a station that has not begun."""
        trip = self.trip[pod]
        return trip != NIL and station in self.stops[trip][self.begun[trip] :]

    def _take_line(self, line: int, is_free: Idle) -> None:
        pod = self.taken_from[line]
        trip = self.trip[pod]
        if trip == NIL and not self.waiting[pod]:
            trip = self._new_trip(pod, is_free)
            self._add(trip, line)
        elif trip == NIL or not self._joins or not self._add(trip, line):
            self.waiting[pod].append(line)

    def _new_trip(self, pod: int, is_free: Idle) -> int:
        trip = self.known
        self.known += 1
        self.pod_of[trip] = pod
        self._begin(pod, trip, is_free)
        return trip

    def _begin(self, pod: int, trip: int, is_free: Idle) -> None:
        """A trip may be taken; it is reserved for a robot beneath its pod."""
        self.trip[pod] = trip
        self._offer(trip, self.slot_cell[self.slot[pod]], is_free)

    def _offer(self, trip: int, cell: int, is_free: Idle) -> None:
        """A trip may be reserved for the robot beneath its pod."""
        for r, where in enumerate(self.motion.cell):
            if where == cell and r not in self.motion.claim and is_free(r, trip):
                self.offers[trip] = r

    def _add(self, trip: int, line: int) -> bool:
        """Add a line to a stop that has not begun, or to a new stop; False: neither is possible."""
        stations, station = self.stops[trip], self.served_at[line]
        later = [k for k in range(self.begun[trip], len(stations)) if stations[k] == station]
        if later:
            stop = later[0]
        elif len(stations) < self._most_stops and (not stations or self.over[trip] < len(stations)):
            stop = len(stations)
            stations.append(station)
            self.served[trip].append([])
        else:
            return False
        lines = self.served[trip]
        first = not any(lines)
        lines[stop].append(line)
        self.in_trip[line] = trip
        mine = self._priority[line]
        self.priority[trip] = mine if first else max(self.priority[trip], mine)
        self.release[trip] = min(self.release[trip], self._release[line])
        return True

    # The next stop of a trip

    def next_station(self, trip: int) -> int:
        """The next station of a trip; NIL: into storage."""
        stations = self.stops[trip]
        return stations[self.over[trip]] if self.over[trip] < len(stations) else NIL

    def ticks(self, trip: int, stop: int) -> int:
        """Duration of a visit: the sum for its lines, rounded to ticks."""
        station = self.stops[trip][stop]
        by_line = self._handling[self._rule[station]]
        parts = self._visit[station] + sum(by_line[line] for line in self.served[trip][stop])
        ticks = (2 * parts + PARTS_OF_TICK) // (2 * PARTS_OF_TICK)
        return min(self._factor * max(ticks, 1), LONGEST) if parts else 0

    def has_break(self, tick: int, cell: int) -> bool:
        """Whether a cell is a station that has a break."""
        station = self.cell.index(cell) if cell in self.cell else NIL
        return any(k == station and a <= tick < b for k, a, b in self._breaks)

    # Actions of robots

    def take(self, r: int, trip: int) -> None:
        """A robot gets a trip, and a place at its station."""
        if self.offered[r] not in (NIL, trip):
            text = f"gets trip {trip}, but the trip of the pod above it stays reserved for it"
            self.report_violation("order", [r], self.motion.cell[r], text)
        self.offered[r] = NIL
        if self._withdrawn.get(r, trip) != trip:
            del self._withdrawn[r]  # it has another trip, even if only for a moment
        self._take_place(r, self.next_station(trip))

    def _take_place(self, r: int, station: int) -> None:
        self.place[r] = station
        if station == NIL:
            return
        if not self._has_place(station):
            text = (
                f"goes to station {station + 1}, where all {self._places[station]} places are taken"
            )
            self.report_violation("place", [r], self.cell[station], text)
        self.taken[station] += 1

    def _has_place(self, station: int) -> bool:
        return self._places[station] == NIL or self.taken[station] < self._places[station]

    def give_back(self, r: int) -> None:
        """A robot loses its trip."""
        if self.place[r] != NIL:
            self.taken[self.place[r]] -= 1
        self.place[r] = NIL

    def withdraw(self, r: int) -> None:
        """The trip of the pod above a robot is no longer reserved for it."""
        self._withdrawn[r] = self.offered[r]
        self.offered[r] = NIL

    def lift(self, r: int, trip: int) -> None:
        """A robot picks up the pod of a trip."""
        pod = self.pod_of[trip]
        if pod == NIL or self.slot[pod] == NIL:
            self.report_violation(
                "pod", [r], self.motion.cell[r], "lifts a pod that is not in storage"
            )
            return
        self.standing.pop(self.slot_cell[self.slot[pod]], None)
        self.slot[pod] = NIL

    def store(self, r: int, trip: int, slot: int, is_over: bool) -> None:
        """A robot drops the pod of a trip, which may have to continue from there."""
        pod, cell = self.pod_of[trip], self.slot_cell[slot]
        if pod == NIL or self.slot[pod] != NIL or cell in self.standing:
            text = "stores a pod that it does not have, or in an occupied slot"
            self.report_violation("pod", [r], cell, text)
            return
        self.slot[pod], self.standing[cell] = slot, pod
        if not is_over:
            return
        self.trip[pod] = NIL
        if self.waiting[pod]:
            self._stored.append(pod)

    def put_aside(
        self,
        r: int,
        slot: int,
        is_over: bool,
        load: Sequence[int],
        free: dict[int, int],
        idle: Idle,
    ) -> None:
        """The pod of a towed robot is put into a slot; `free`: empty slots, by cell."""
        trip, motion = load[r], self.motion
        for other, cell in enumerate(motion.cell):
            if other != r and cell != NIL and (load[other] != NIL or not self._drives_under):
                free.pop(cell, None)
                free.pop(motion.claim.get(other, (cell, 0))[0], None)
        if self._ways.nearest(r, free) != slot:
            pod = self.pod_of[trip] + 1
            text = f"is towed, and its pod {pod} is put into slot {slot}, not the nearest one"
            self.report_violation("pod", [r], motion.cell[r], text)
        self._serving = {k: one for k, one in self._serving.items() if one[0] != r}
        self.begun[trip] = self.over[trip]
        self.store(r, trip, slot, is_over)
        if not is_over:
            self._offer(trip, self.slot_cell[slot], idle)

    def serve(self, tick: int, r: int, trip: int, ticks: int, stop: int) -> None:
        """A visit begins at the next stop of a trip."""
        cell = self.motion.cell[r]
        station = self.cell.index(cell) if cell in self.cell else NIL
        if self.has_break(tick, cell):
            self.report_violation(
                "visit", [r], cell, "begins a visit during a break of its station"
            )
        other, until = self._serving.get(station, (r, 0))
        if station != NIL and until >= tick:
            text = "begins a visit at a station that is serving another robot"
            self.report_violation("visit", [other, r], cell, text)
        self._serving[station] = r, tick + ticks - 1
        self.begun[trip] = stop + 1

    def finish_stop(self, tick: int, r: int, trip: int) -> int:
        """A visit ends, and its lines are done; returns their number."""
        station, stop = self.next_station(trip), self.over[trip]
        if station == NIL:
            return 0
        lines = self.served[trip][stop]
        for line in lines:
            if self.done[line] != NIL:
                self.report_violation("line", [r], NIL, f"line {line} is done twice")
            self.done[line] = tick
            self.wanted[self.taken_from[line]] -= 1
            self.open[station] -= 1
        self.over[trip] = self.begun[trip] = stop + 1
        following = self.next_station(trip)
        if following == station:
            return len(lines)
        self.leaving[r], self.place[r] = station, NIL
        if following != NIL and self._has_place(following):
            self._take_place(r, following)
        elif following != NIL:
            self._end_early(trip)
        return len(lines)

    def _end_early(self, trip: int) -> None:
        """There is no place at the next station: the remaining lines of a trip wait, ahead of the
        others."""
        left = [line for lines in self.served[trip][self.over[trip] :] for line in lines]
        for line in left:
            self.in_trip[line] = NIL
        del self.stops[trip][self.over[trip] :], self.served[trip][self.over[trip] :]
        pod = self.pod_of[trip]
        self.waiting[pod] = left + self.waiting[pod]

    # Every tick

    def check_moves(self, acts: Acts, load: Sequence[int], order: Sequence[int]) -> None:
        """No robot with a load drives under a pod; by some rules, only the robot that lifts the pod
        does."""
        for r, did in acts:
            code = did & ACTION_MASK
            if not 0 < code <= MOVE_NORTH or (load[r] == NIL and self._drives_under):
                continue
            to = self.motion.cell[r] + self.motion.step[code - 1]
            pod = self.standing.get(to, NIL)
            if pod != NIL and load[r] != NIL:
                self.report_violation("pod", [r], to, "drives with a load under a pod")
            elif pod != NIL and (order[r] == NIL or self.pod_of[order[r]] != pod):
                self.report_violation(
                    "pod", [r], to, "drives under a pod that it is not going to lift"
                )

    def end(self, load: Sequence[int]) -> None:
        """After motion: free places at stations that robots have left, and trips of pods that they
        left."""
        for trip, r in self.offers.items():
            if not self._may_fail:
                text = f"is free under the pod of trip {trip}, but the trip is not reserved for it"
                self.report_violation("order", [r], self.motion.cell[r], text)
        self.offers.clear()
        for r, cell in enumerate(self.motion.cell):
            station, trip = self.leaving[r], self.offered[r]
            if station != NIL and cell != self.cell[station]:
                self.taken[station] -= 1
                self.leaving[r] = NIL
            if trip != NIL and not self._stands_beneath(r, trip):
                text = f"has left the pod of trip {trip}, but the trip stays reserved for it"
                self.report_violation("order", [r], cell, text)
        for r, trip in self._withdrawn.items():
            if self._stands_beneath(r, trip):
                text = f"is under the pod of trip {trip}, but the trip is no longer reserved for it"
                self.report_violation("order", [r], self.motion.cell[r], text)
        self._withdrawn.clear()
        carried = [self.pod_of[trip] for trip in load if trip != NIL]
        if len(set(carried)) + len(self.standing) != len(self.slot):
            text = f"{len(carried)} pods are carried and {len(self.standing)} stand in storage"
            self.report_violation("pod", [], NIL, f"{text}, of {len(self.slot)}")

    def _stands_beneath(self, r: int, trip: int) -> bool:
        return self.standing.get(self.motion.cell[r], NIL) == self.pod_of[trip]

    def _stations(self) -> list[int]:
        """A list with an entry for each possible stop of all trips; listed orders have their own
        stops."""
        stations = [(stops + [NIL] * self._most_stops)[: self._most_stops] for stops in self.stops]
        return [station for stops in stations for station in stops]

    def state(self) -> dict[str, dict[str, list[int]]]:
        """The values required in a recorded state, by array."""
        lines = {"served_at": self.served_at, "trip": self.in_trip, "done": self.done}
        stations = {"station": self._stations()} if self.of_lines else {}
        return {
            "pods": {
                "slot": self.slot,
                "trip": self.trip,
                "first_line": [lines[0] if lines else NIL for lines in self.waiting],
            },
            "lines": lines,
            "trips": {
                "begun": self.begun,
                **stations,
                "place": self.place,
                "leaving": self.leaving,
                "offered": self.offered,
            },
            "pod_stations": {"taken": self.taken, "open_lines": self.open},
        }


def _lists(arrays: dict[str, Any] | None) -> dict[str, Any]:
    """Arrays of a header as lists."""
    return {name: array.tolist() for name, array in (arrays or {}).items()}


def _holders(pods: dict[str, Any]) -> list[list[int]]:
    """The pods that hold each SKU, by number."""
    first, held = (pods.get(name, []) for name in ("sku_first", "sku_pod"))
    return [sorted(held[a:b].tolist()) for a, b in pairwise(first)]


def _breaks(header: dict[str, Any], cells: list[int]) -> list[tuple[int, int, int]]:
    """Station, first tick and the tick after the last of all breaks."""
    stride = header["floor"]["width"] + 2
    breaks = []
    for station in (header["scenario"].get("stations") or {}).values():
        x, y = station["at"]
        number = cells.index((y + 1) * stride + x + 1)
        breaks += [(number, one["from"], one["from"] + one["for"]) for one in station["breaks"]]
    return breaks


# Destinations of the pods of towed robots.


FAR = 1 << 60  # ticks to an unreachable cell


class LoadedWays:
    """Paths of robots on a floor; no path crosses storage cells, except at its ends."""

    def __init__(self, motion: ReplayedMotion, stations: Sequence[int]) -> None:
        self.motion = motion
        self._stations = stations
        self._homes = list(motion.home)
        # By robot: storage cells from which it reaches everything.
        self._ends: dict[int, set[int]] = {}
        # The same for loads only, by headings and by closed cells.
        self._ends_of_loads: dict[tuple[int, frozenset[int]], set[int]] = {}

    def ticks(
        self, r: int, start: int, headings: Iterable[int], loaded: bool = True
    ) -> dict[int, int]:
        """Least ticks from a cell to all cells that robot r can reach; `headings`: possible first
        headings."""
        motion = self.motion
        apart = motion.headings[r]
        move, turn = (motion.types.ticks[r][name][loaded] for name in ("move", "turn"))
        closed, limits = motion.types.closed[r][loaded], motion.pace.limits
        best = {(start, heading): 0 for heading in headings}
        queue = [(0, *pose) for pose in best]
        while queue:
            ticks, cell, heading = heapq.heappop(queue)
            if best[cell, heading] < ticks:
                continue
            after: list[tuple[int, int, int]] = []
            if self._turns(r, cell):
                turned = {(heading + 1) % apart, (heading - 1) % apart}
                after += [(ticks + turn, cell, to) for to in turned]
            if cell == start or motion.kind[cell] != STORAGE:
                for direction in range(heading, 4, apart):
                    to = cell + motion.step[direction]
                    if motion.exits[cell] >> direction & 1 and to not in closed:
                        least_move = max(move, limits.get((cell, direction), 0))
                        after.append((ticks + least_move, to, heading))
            for later, to, now in after:
                if later < best.get((to, now), FAR):
                    best[to, now] = later
                    heapq.heappush(queue, (later, to, now))
        least: dict[int, int] = {}
        for (cell, _), ticks in best.items():
            least[cell] = min(ticks, least.get(cell, FAR))
        return least

    def _turns(self, r: int, cell: int) -> bool:
        headings = self.motion.headings[r]
        return headings == 4 or (headings == 2 and CELL_KINDS[self.motion.kind[cell]].turns)

    def starts(self, r: int, target: int, loaded: bool = True) -> set[int]:
        """The cells from which robot r can reach a cell, starting in any heading."""
        motion = self.motion
        apart, kind = motion.headings[r], motion.kind
        closed = motion.types.closed[r][loaded]
        poses = {(target, heading) for heading in range(apart)}
        left = list(poses)
        while left:
            cell, heading = left.pop()
            before: list[tuple[int, int]] = []
            if self._turns(r, cell):
                before += [(cell, (heading + 1) % apart), (cell, (heading - 1) % apart)]
            for direction in range(heading, 4, apart) if cell not in closed else ():
                at = cell - motion.step[direction]
                if motion.exits[at] >> direction & 1:
                    before.append((at, heading))
            for pose in before:
                if pose not in poses:
                    poses.add(pose)
                    if kind[pose[0]] != STORAGE or pose[0] == target:
                        left.append(pose)
        return {cell for cell, _ in poses}

    def useful(self, r: int) -> set[int]:
        """The storage cells that robot r with a load can reach from every station, and back.

        If areas are closed to robots without a load, also without a load from its start, and back.
        """
        if r not in self._ends:
            ends = self._stored_by(r)
            empty, full = self.motion.types.closed[r]
            if empty - full:
                every, home = range(self.motion.headings[r]), self._homes[r]
                ends = ends & self.ticks(r, home, every, False).keys() & self.starts(r, home, False)
            self._ends[r] = ends
        return self._ends[r]

    def _stored_by(self, r: int) -> set[int]:
        """Where robots that drive like robot r can put their loads, regardless of their homes."""
        way = self.motion.headings[r], frozenset(self.motion.types.closed[r][True])
        if way not in self._ends_of_loads:
            ends = {cell for cell, kind in enumerate(self.motion.kind) if kind == STORAGE}
            every = range(self.motion.headings[r])
            for station in self._stations:
                ends &= self.ticks(r, station, every).keys() & self.starts(r, station)
            self._ends_of_loads[way] = ends
        return self._ends_of_loads[way]

    def nearest(self, r: int, free: dict[int, int]) -> int:
        """The free slot that robot r reaches first, ties: lowest; NIL: none. `free`: by cell."""
        ticks = self.ticks(r, self.motion.cell[r], (self.motion.heading[r],))
        useful = self.useful(r)
        ranks = [(ticks.get(cell, FAR), slot) for cell, slot in free.items() if cell in useful]
        return min(ranks)[1] if ranks else NIL
