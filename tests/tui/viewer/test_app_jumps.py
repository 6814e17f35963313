"""From a list to the place: what is chosen is seen on the map; and what `i` inspects."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable

import pytest
from panel_harness import said, text
from viewer_harness import Watched, mini, screen_text, viewing

from automaton.engine.state import NIL
from automaton.runs.metric_catalogue import time_shares
from automaton.units import percent
from automaton.world.resolve import resolve
from tui.playback.panel_view import CellChosen, RobotChosen, TickChosen
from tui.playback.run_source import Opening, live

NARROW, MIDDLE = (80, 24), (120, 36)
SHOWN = {"tabletop-1": 634, "goods-60x40": 900, "factory": 900}  # ticks


def story(
    tell: Callable[[Watched], Awaitable[None]],
    size: tuple[int, int] = NARROW,
    opening: Opening | None = None,
) -> None:
    async def told() -> None:
        async with viewing(opening, size) as user:
            await user.at(120)
            await tell(user)

    asyncio.run(told())


def covered(user: Watched) -> bool:
    """Whether panels are in the place of the map."""
    return not user.app.query_one("#maps").display


def place_of(user: Watched, cell: int) -> tuple[int, int]:
    row, column = user.session.pictures.camera.place_of(cell)
    return column, row


@pytest.mark.parametrize("size", [NARROW, MIDDLE])
def test_what_is_chosen_in_a_list_is_seen_on_the_map(size: tuple[int, int]) -> None:
    async def tell(user: Watched) -> None:
        cell = user.session.pictures.camera.floor_plan.cell(1, 4)
        for message in (RobotChosen(2), CellChosen(cell), TickChosen(60)):
            user.app.panels.show("full")
            await user.until(lambda: covered(user))
            user.display.column.post_message(message)
            await user.until(lambda: not covered(user))
        assert user.session.choice.cell == cell
        await user.until(lambda: user.tick == 60)

    story(tell, size)


def test_a_robot_of_the_table_is_seen_on_the_map() -> None:
    async def tell(user: Watched) -> None:
        await user.press("t")
        await user.until(lambda: user.display.column.name_open == "robots")
        await user.press("down", "enter")
        await user.until(lambda: user.session.choice.robot != NIL)
        assert not covered(user)

    story(tell)


def test_what_was_found_is_seen_on_the_map() -> None:
    async def tell(user: Watched) -> None:
        await user.press("e")
        await user.until(lambda: user.display.column.name_open == "events")
        await user.press("slash", *"robot", "space", "2", "enter")
        await user.until(lambda: user.session.choice.robot == 2 and not covered(user))

    story(tell)


@pytest.mark.parametrize(
    ("name", "tick", "size"),
    [
        *((name, tick, NARROW) for name, tick in SHOWN.items()),
        *((name, tick, MIDDLE) for name, tick in SHOWN.items()),
    ],
)
def test_the_bottleneck_and_where_the_time_went_are_seen_at_once(
    name: str, tick: int, size: tuple[int, int]
) -> None:
    """In a narrow terminal with the key that the last line names."""

    async def tell(user: Watched) -> None:
        if size == NARROW:
            assert "p Metrics" in screen_text(user.app)
            await user.press("p")
        await user.at(tick)
        figures = user.display.column.figures
        shares = time_shares(user.session.view().measured.uses)
        rows = [(f" {name} ", f" {percent(share)}") for name, share, _ in shares]
        await user.until(
            lambda: all(name in (told := text(figures)) and share in told for name, share in rows)
        )
        told = text(figures)
        assert 0 < told.index(" bottleneck ") < told.index("where the time went")

    story(tell, size, live(resolve(name), None))


def test_the_key_of_the_metrics_opens_them_beside_the_map_then_alone() -> None:
    async def tell(user: Watched) -> None:
        column = user.display.column
        await user.press("w")
        assert column.name_open == "why" and not column.figures.is_on_screen
        await user.press("w", "p")
        assert column.name_open == "metrics" and column.figures.is_on_screen
        assert not covered(user)
        await user.press("p")
        await user.until(lambda: "no robot waits now" in text(column.panels["why"]))
        assert column.figures.is_on_screen and covered(user)
        await user.press("p")
        assert not column.is_on_screen and not covered(user)

    story(tell)


def test_the_key_of_waits_goes_from_one_waiting_robot_to_the_next() -> None:
    async def tell(user: Watched) -> None:
        await user.press("w")
        assert user.display.column.name_open == "why" and user.session.choice.robot == NIL
        await user.at(235)
        chosen = []
        for _ in range(3):
            await user.press("w")
            chosen.append(user.session.choice.robot)
        assert set(chosen) == {0, 1} and chosen[0] == chosen[2]

    story(tell, MIDDLE)


def test_the_key_of_waits_leaves_a_robot_that_drives_again_unless_the_user_chose_it() -> None:
    """Where panels cover the map, the key closes the panel, too."""

    async def tell(user: Watched) -> None:
        for tick, waiting in ((235, {0, 1}), (259, {2})):
            await user.at(tick)
            await user.press("w")
            assert user.session.choice.robot in waiting
            await user.press("w")
        user.session.choose(1)  # which does not wait
        await user.press("w")
        assert user.session.choice.robot == 1

    story(tell)


def test_the_next_robot_is_looked_at_without_leaving_the_inspector() -> None:
    async def tell(user: Watched) -> None:
        await user.press("i", "right_parenthesis")
        await user.until(lambda: user.session.choice.robot != NIL)
        assert not covered(user) and user.display.column.name_open == "inspector"

    story(tell)


def test_inspect_tells_of_what_the_mouse_has_moved_to_and_else_of_what_is_selected() -> None:
    async def tell(user: Watched) -> None:
        floor_plan = user.session.pictures.camera.floor_plan
        one, other = floor_plan.cell(1, 4), floor_plan.cell(2, 4)
        user.session.choose(1)
        await user.pilot.hover("#map-0", offset=place_of(user, one))
        await user.until(lambda: user.session.hovered == one)
        await user.press("i")
        assert (user.session.choice.robot, user.session.choice.cell) == (NIL, one)
        await user.pilot.hover("#map-0", offset=place_of(user, other))
        await user.until(lambda: user.session.hovered == other)
        await user.press("right_parenthesis", "i")  # chosen after the mouse came to rest
        assert (user.session.choice.robot, user.session.choice.cell) == (0, NIL)

    story(tell, MIDDLE)


def test_with_nothing_selected_the_middle_of_the_map_is_inspected() -> None:
    async def tell(user: Watched) -> None:
        await user.press("i")
        choice = user.session.choice
        assert (choice.robot, choice.cell) != (NIL, NIL)

    story(tell, MIDDLE)


def test_the_largest_jam_is_gone_to_and_n_goes_through_its_robots() -> None:
    async def told() -> None:
        async with viewing(mini("strategy.right_of_way=wait"), NARROW) as user:
            await user.at(700)
            assert user.session.playback is not None
            await user.until(lambda: user.session.playback.figures[0].tick == 700)
            choice = user.session.choice
            user.display.column.figures.follow(("jam", 0))  # a click on it in the panel
            await user.until(lambda: len(choice.matches))
            await user.press("escape", "J")
            assert choice.robot in (1, 2) and choice.matches.tolist() == [1, 2]
            first = choice.robot
            await user.press("n")
            assert choice.robot == 3 - first

    asyncio.run(told())


def test_the_key_of_lost_time_goes_from_a_saturated_station_to_the_places_of_lost_time() -> None:
    async def saturated(user: Watched) -> None:
        await user.at(900)
        await user.press("y")
        camera = user.session.pictures.camera
        station = user.session.choice.cell
        assert user.session.opening.resolved[0].place_names[station] == "station 5"
        row, column = camera.place_of(station)
        assert screen_text(user.app).splitlines()[row + 1][column] == "1"  # below the title
        told = f"1 station 5, {camera.floor_plan.xy(station)}, saturated: 100 % of the run"
        await user.until(lambda: told == said(user.display.info)[0])

    async def lost(user: Watched) -> None:
        await user.at(634)
        await user.press("y")
        await user.until(lambda: said(user.display.info)[0].startswith("1 around (5, 0): 57 % of "))
        first = said(user.display.info)[0]
        await user.press("y")
        await user.until(lambda: said(user.display.info)[0].startswith("2 "))
        second = said(user.display.info)[0]
        shares = [re.findall(r"\d+(?= %)", words) for words in (first, second)]
        assert len(shares[0]) == 3 and sorted(shares[0]) == sorted(shares[1])
        assert "; 2: " in first and "; 1: 57 %, 3: " in second

    story(saturated, MIDDLE, live(resolve("factory"), None))
    story(lost, NARROW, live(resolve("tabletop-1"), None))


def test_the_key_that_scrolls_reaches_the_metrics_where_all_of_the_open_panel_is_seen() -> None:
    async def tell(user: Watched) -> None:
        column = user.display.column
        await user.until(lambda: "nothing is selected" in text(column.panels["inspector"]))
        await user.press("pagedown")
        await user.until(lambda: column.figures.scroll_offset.y > 0)
        assert not column.panels["inspector"].scroll_offset.y

    story(tell, MIDDLE)


def test_the_name_of_the_scenario_is_among_the_hints_where_there_is_no_line_for_it() -> None:
    async def tell(user: Watched) -> None:
        title = "tabletop-mini"
        assert title in said(user.display.info)[0]
        await user.pilot.resize_terminal(*MIDDLE)
        await user.until(lambda: title not in said(user.display.info)[0])

    story(tell, (99, 24))


def test_one_tick_before_the_last_known_one_the_bottleneck_is_the_same() -> None:
    async def tell(user: Watched) -> None:
        await user.at(900)
        await user.press("comma", "y")
        await user.until(lambda: user.tick == 899)
        await user.until(lambda: "1 station 5, " in said(user.display.info)[0])
        assert "bottleneck station 5, saturated 100 % of the run" in text(
            user.display.column.figures
        )

    story(tell, MIDDLE, live(resolve("factory"), None))


@pytest.mark.parametrize("keys", [("z", "w"), ("z", "p")])
def test_panels_that_a_wider_terminal_has_room_for_are_up_to_date(keys: tuple[str, ...]) -> None:
    async def tell(user: Watched) -> None:
        column = user.display.column
        await user.press(*keys)
        await user.pilot.resize_terminal(120, 36)
        await user.until(lambda: "delivered" in text(column.figures))
        await user.until(lambda: text(column.panels[column.name_open]))

    story(tell, (98, 28))
