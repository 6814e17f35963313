"""What the package says of itself: the versions of others with which it works, and where it runs."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from packaging.version import Version

from automaton.engine.jit.numba_parts import TRIED

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"].values()
OURS = [Requirement(line) for lines in (PROJECT["dependencies"], *EXTRAS) for line in lines]


def lowest(requirement: Requirement) -> Version | None:
    found = [Version(one.version) for one in requirement.specifier if one.operator == ">="]
    return max(found, default=None)


def installed(name: str) -> Version | None:
    try:
        return Version(metadata.version(name))
    except metadata.PackageNotFoundError:
        return None


LOWEST = {canonicalize_name(one.name): low for one in OURS if (low := lowest(one)) is not None}


@pytest.mark.parametrize("name", LOWEST)
def test_our_lowest_versions_can_be_installed_together(name: str) -> None:
    """Those of a series that is installed say what they need: no lower bound of ours is below that.

    `rich>=13.7` could never be met: Textual 8.2 wants 14.2.
    """
    here, low = installed(name), LOWEST[name]
    if here is None or here.release[:2] != low.release[:2]:
        pytest.skip(f"{name} {low} is not what is installed: {here}")
    for line in metadata.requires(name) or ():
        needed = Requirement(line)
        ours = LOWEST.get(canonicalize_name(needed.name))
        wanted = needed.marker is None or needed.marker.evaluate({"extra": ""})
        if ours is not None and wanted:
            assert needed.specifier.contains(ours), f"{name} {here} needs {needed}, we allow {ours}"


@pytest.mark.parametrize("requirement", OURS, ids=str)
def test_what_is_installed_here_is_what_we_allow(requirement: Requirement) -> None:
    here = installed(requirement.name)
    assert here is None or requirement.specifier.contains(here)


def test_one_package_has_one_lower_bound() -> None:
    bounds: dict[str, set[str]] = {}
    for one in OURS:
        bounds.setdefault(canonicalize_name(one.name), set()).add(str(one.specifier))
    assert [name for name, found in bounds.items() if len(found) > 1] == []


def test_numba_has_the_bounds_that_its_private_parts_were_tried_with() -> None:
    [numba] = [one for one in OURS if one.name == "numba"]
    first, last = TRIED
    assert lowest(numba) == Version(first)
    major, minor = Version(last).release
    assert numba.specifier.contains(f"{last}.99")
    assert not numba.specifier.contains(f"{major}.{minor + 1}")


def test_the_platform_is_said() -> None:
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert "Operating System :: POSIX" in PROJECT["classifiers"]
    assert "POSIX" in readme


def test_a_version_is_said_once_everywhere() -> None:
    cited = re.search(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert cited is not None and cited[1] == PROJECT["version"]
    assert f"## {PROJECT['version']} (" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")


def test_the_command_has_the_name_of_the_package_too() -> None:
    """`pipx run` and `uvx` look for it."""
    assert PROJECT["scripts"][PROJECT["name"]] == PROJECT["scripts"]["automaton"]


def test_a_distribution_that_replaces_a_file_of_ours_is_named(tmp_path: Path) -> None:
    package = tmp_path / "automaton"
    package.mkdir()
    for entry in (ROOT / "automaton").iterdir():
        (package / entry.name).symlink_to(entry)
    (package / "__init__.py").unlink()
    (package / "__init__.py").write_text("# of another distribution")
    command = [sys.executable, "-m", "automaton", "list"]
    surroundings = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, env=surroundings, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.startswith("automaton: another distribution, probably 'automaton' of PyPI")
    assert done.stderr.count("\n") == 1
