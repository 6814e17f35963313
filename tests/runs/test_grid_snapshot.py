"""The fixture `grid_snapshot`, as a project that uses it sees it."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from automaton.engine.jit.kernel_cache import cache_root
from automaton.pytest_plugin import difference, file_name

pytest_plugins = ["pytester"]

STORY = """
    def test_story(grid_snapshot):
        grid_snapshot({text!r})
"""
GOLDEN = "snapshots/test_it/test_story.txt"
COMPILED = str(cache_root().parent)  # found before pytester gives each project a home of its own


@pytest.fixture
def project(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> pytest.Pytester:
    monkeypatch.setenv("AUTOMATON_CACHE_DIR", COMPILED)
    pytester.makeini("[pytest]\naddopts = -p no:cacheprovider -p automaton.pytest_plugin")
    return pytester


def write_test(project: pytest.Pytester, code: str) -> None:
    project.makepyfile(test_it=code)


def golden(project: pytest.Pytester, path: str = GOLDEN) -> str:
    return (project.path / path).read_bytes().decode()


def test_a_missing_golden_fails_and_says_how_to_write_it(project: pytest.Pytester) -> None:
    write_test(project, STORY.format(text="A."))
    result = project.runpytest()
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([f"there is no golden {GOLDEN}; *pytest --update-grids writes it:"])
    result.stdout.fnmatch_lines(["A."])
    assert not (project.path / "snapshots").exists(), "a run without the option writes nothing"


def test_the_option_writes_goldens_that_then_match(project: pytest.Pytester) -> None:
    write_test(project, STORY.format(text="A.  \n.B\n\n"))
    result = project.runpytest("--update-grids")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["*grid snapshots*", f"written  {GOLDEN}"])
    assert golden(project) == "A.\n.B\n"
    again = project.runpytest()
    again.assert_outcomes(passed=1)
    again.stdout.no_fnmatch_line("*grid snapshots*")
    assert not list(project.path.glob("snapshots/**/*.part"))


def test_what_is_equal_is_not_written_again(project: pytest.Pytester) -> None:
    write_test(project, STORY.format(text="A."))
    project.runpytest("--update-grids")
    before = (project.path / GOLDEN).stat().st_mtime_ns
    project.runpytest("--update-grids").stdout.no_fnmatch_line("written*")
    assert (project.path / GOLDEN).stat().st_mtime_ns == before


def test_a_difference_is_shown_row_by_row(project: pytest.Pytester) -> None:
    write_test(project, STORY.format(text="...\nA..\n..."))
    project.runpytest("--update-grids")
    write_test(project, STORY.format(text="...\n.A.\n..."))
    result = project.runpytest()
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(
        [f"the picture differs from {GOLDEN} *", "-A..", "+.A.", " ^^"], consecutive=False
    )
    assert golden(project) == "...\nA..\n...\n", "only the option changes a golden"
    project.runpytest("--update-grids").assert_outcomes(passed=1)
    assert golden(project) == "...\n.A.\n...\n"


def test_names_parameters_and_classes_have_goldens_of_their_own(
    project: pytest.Pytester,
) -> None:
    write_test(
        project,
        """
        import pytest

        @pytest.mark.parametrize("way", ["a/b", "east"])
        def test_ways(grid_snapshot, way):
            grid_snapshot(way)
            grid_snapshot(way * 2, "after")

        class TestFloor:
            def test_ways(self, grid_snapshot):
                grid_snapshot("class")
        """,
    )
    project.runpytest("--update-grids").assert_outcomes(passed=3)
    names = sorted(path.name for path in project.path.glob("snapshots/test_it/*"))
    hashed = file_name("test_ways[a/b]")
    assert names == sorted(
        [
            *(f"{hashed}.txt", f"{hashed}-after.txt", "TestFloor.test_ways.txt"),
            *("test_ways[east].txt", "test_ways[east]-after.txt"),
        ]
    )
    assert golden(project, "snapshots/test_it/TestFloor.test_ways.txt") == "class\n"
    project.runpytest().assert_outcomes(passed=3)


def test_one_name_is_compared_once(project: pytest.Pytester) -> None:
    write_test(
        project,
        """
        def test_story(grid_snapshot):
            grid_snapshot("A.")
            grid_snapshot(".A")
        """,
    )
    result = project.runpytest("--update-grids")
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines(["*test_story.txt is compared twice in one test*"])


@pytest.mark.parametrize("workers", [(), ("-n", "1")])
def test_stale_goldens_are_reported_and_removed(
    project: pytest.Pytester, workers: tuple[str, ...]
) -> None:
    if workers:
        pytest.importorskip("xdist")
    folder = project.path / "snapshots" / "test_it"
    folder.mkdir(parents=True)
    for name in ("test_story", "test_story-old", "test_plain", "test_story_two", "test_fails-old"):
        (folder / f"{name}.txt").write_text("A.\n")
    write_test(
        project,
        """
        def test_story(grid_snapshot):
            grid_snapshot("A.")

        def test_plain():
            pass

        def test_fails(grid_snapshot):
            assert False
        """,
    )
    stale = ["test_plain.txt", "test_story-old.txt"]
    result = project.runpytest(*workers)
    result.assert_outcomes(passed=2, failed=1)
    result.stdout.fnmatch_lines([f"stale    snapshots/test_it/{name}" for name in stale])
    assert all((folder / name).exists() for name in stale)
    result = project.runpytest("--update-grids", *workers)
    result.stdout.fnmatch_lines([f"removed  snapshots/test_it/{name}" for name in stale])
    left = sorted(path.name for path in folder.iterdir())
    assert left == ["test_fails-old.txt", "test_story.txt", "test_story_two.txt"]


def test_worlds_and_floors_are_drawn(project: pytest.Pytester) -> None:
    write_test(
        project,
        """
        from automaton.runs.pictures import Story
        from automaton.floor.drawn_floors import draw_floor
        from automaton.world.resolve import resolve
        from automaton.runs.simulation import Simulation

        def test_subjects(grid_snapshot):
            grid_snapshot(draw_floor("b.s"), "floor")
            grid_snapshot(Story("A~B"), "story")
            grid_snapshot(Simulation(resolve("tabletop-mini")), "world")
        """,
    )
    # In a process of its own: pytester forgets imported modules, and Numba bears no second import.
    project.runpytest_subprocess("--update-grids").assert_outcomes(passed=1)
    assert golden(project, "snapshots/test_it/test_subjects-floor.txt") == "b.s\n"
    assert golden(project, "snapshots/test_it/test_subjects-story.txt") == "A~B\n"
    world = golden(project, "snapshots/test_it/test_subjects-world.txt")
    assert world.startswith("tick 0, seed 1")


def test_a_session_that_draws_no_world_does_not_import_numba(project: pytest.Pytester) -> None:
    write_test(
        project,
        """
        import sys

        def test_light(grid_snapshot):
            assert "numba" not in sys.modules and "numpy" not in sys.modules
        """,
    )
    project.runpytest_subprocess("-p", "no:hypothesispytest").assert_outcomes(passed=1)


def test_a_session_that_does_not_ask_has_nothing_of_it(pytester: pytest.Pytester) -> None:
    pytester.makepyfile(test_it=STORY.format(text="A."))
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*fixture 'grid_snapshot' not found"])
    pytester.makeconftest('pytest_plugins = ["automaton.pytest_plugin"]')
    pytester.runpytest_subprocess("--update-grids").assert_outcomes(passed=1)


def test_no_package_makes_every_session_load_it() -> None:
    package = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())
    assert "pytest11" not in package["project"].get("entry-points", {})


def test_the_option_is_in_the_help(project: pytest.Pytester) -> None:
    result = project.runpytest("--help")
    result.stdout.fnmatch_lines(["automaton:", "  --update-grids *golden pictures*"])


def test_rows_that_only_moved_are_not_marked_with_carets() -> None:
    assert difference("a\n", "a\nb\n").split("\n")[-1] == "+b"


def test_file_names_are_short_plain_and_different() -> None:
    assert file_name("test_a[1-2]") == "test_a[1-2]"
    assert file_name("a/b") != file_name("a:b")
    assert len(file_name("x" * 500)) < 140
