"""README.md and the addresses as the page of the package shows them; called when a package is built.

Links of README.md name files of the repository. On another site they need the address of the
repository, which is in pyproject.toml alone.
"""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

LINK = re.compile(r"(!?)\[((?:[^\[\]]|!\[[^\]]*\]\([^)]*\))*)\]\((?!https?:|#|mailto:)([^)\s]+)\)")


def with_addresses(text: str, repository: str, tag: str) -> str:
    """The Markdown text with absolute links to files of the repository at a tag."""

    def absolute(link: re.Match[str]) -> str:
        picture, label, target = link.groups()
        kind = "raw" if picture else "blob"
        return f"{picture}[{with_addresses(label, repository, tag)}]({repository}/{kind}/{tag}/{target})"

    return LINK.sub(absolute, text)


class PackagePage(MetadataHookInterface):
    def update(self, metadata: dict[str, Any]) -> None:
        root = Path(self.root)
        project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))
        repository, tag = project["tool"]["package-page"]["repository"], f"v{metadata['version']}"
        readme = (root / "README.md").read_text(encoding="utf-8")
        metadata["readme"] = {
            "content-type": "text/markdown",
            "text": with_addresses(readme, repository, tag),
        }
        metadata["urls"] = {
            "Repository": repository,
            "Documentation": f"{repository}/blob/{tag}/docs/index.md",
            "Changelog": f"{repository}/blob/{tag}/CHANGELOG.md",
            "Issues": f"{repository}/issues",
        }
