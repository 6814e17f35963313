"""The provenance of a run: hashes of sources and files, versions of libraries."""

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
DECIDING = (".py", ".npz")  # files of these packages that determine runs: code and networks
LIBRARIES = ("fleet-automaton", "numpy", "numba", "msgspec")


@cache
def source_hash(plugins: tuple[str, ...] = ()) -> str:
    """16 hex digits: hash of all installed files that determine runs; `plugins`: "module:Class" names.

    The hash does not depend on where the packages are installed.
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
    """{"files": {file: hash of its content}} of the files that strategies read; {} without any."""
    files = [file for _, choice in resolved.choices for file in files_of(choice.parameters)]
    return {"files": {str(file): content_hash(file) for file in files}} if files else {}


def recorded_files(resolved: Resolved) -> dict[str, Any]:
    """Hashes of the files of strategies, and of order files as of the reading of the scenario."""
    found = {**file_hashes(resolved).get("files", {}), **dict(resolved.files)}
    return {"files": found} if found else {}


@cache
def versions() -> dict[str, str]:
    """The versions of Python and of the installed LIBRARIES, by name."""
    from importlib import metadata  # slow: it imports the email package, 5 % of the time of `check`

    found = {"python": platform.python_version()}
    for library in LIBRARIES:
        try:
            found[library] = metadata.version(library)
        except metadata.PackageNotFoundError:
            continue
    return found
