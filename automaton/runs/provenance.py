"""Name what computed a run: sources and files by their hashes, libraries by their versions."""

from __future__ import annotations

import hashlib
import importlib.util
import platform
from functools import cache
from pathlib import Path
from typing import Any

from automaton.scenario.text_files import content_hash
from automaton.strategy.lookup import files_of
from automaton.world.resolved import Resolved

PACKAGES = ("automaton", "strategies", "layouts")
DECIDING = (".py", ".npz")  # files of these packages from which runs follow: code and networks
LIBRARIES = ("fleet-automaton", "numpy", "numba", "msgspec")


@cache
def source_hash(plugins: tuple[str, ...] = ()) -> str:
    """16 hex digits of all that is installed and decides; `plugins`: "module:Class" names.

    Where the packages are installed does not matter.
    """
    digest = hashlib.sha256()
    for package in PACKAGES:
        spec = importlib.util.find_spec(package)
        if spec is not None and spec.origin is not None:
            root = Path(spec.origin).parent
            found = (path for path in root.rglob("*") if path.suffix in DECIDING)
            for path in sorted(path for path in found if path.is_file()):
                digest.update(path.relative_to(root.parent).as_posix().encode())
                digest.update(path.read_bytes())
    for plugin in sorted(plugins):
        spec = importlib.util.find_spec(plugin.partition(":")[0])
        if spec is not None and spec.origin is not None:
            digest.update(plugin.encode() + Path(spec.origin).read_bytes())
    return digest.hexdigest()[:16]


def file_hashes(resolved: Resolved) -> dict[str, Any]:
    """{"files": {file: 16 hex digits of its content}} of those that strategies read, if any do."""
    files = [file for _, choice in resolved.choices for file in files_of(choice.parameters)]
    return {"files": {str(file): content_hash(file) for file in files}} if files else {}


def recorded_files(resolved: Resolved) -> dict[str, Any]:
    """The files of strategies, and of orders as they were when the scenario was read."""
    found = {**file_hashes(resolved).get("files", {}), **dict(resolved.files)}
    return {"files": found} if found else {}


@cache
def versions() -> dict[str, str]:
    """The versions of what computed the run, by name; what is not installed is left out."""
    from importlib import metadata  # with all that reads mails: a twentieth of `check`

    found = {"python": platform.python_version()}
    for library in LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            continue
    return found
