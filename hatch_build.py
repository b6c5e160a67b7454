"""Addresses in the package's metadata: those of the repository that this checkout is a clone of.

A fork names itself in this way, and a checkout that is no clone of a public repository names none.
"""

import re
import subprocess
from email import message_from_string
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

PAGES = {
    "Repository": "",
    "Documentation": "/tree/HEAD/docs",
    "Changelog": "/blob/HEAD/CHANGELOG.md",
    "Issues": "/issues",
}
# https://host/owner/name.git, ssh://git@host/owner/name, git@host:owner/name; a user's name or
# token before the host is left out
REMOTE = re.compile(
    r"(?:(?:https|ssh|git)://(?:[^/@]*@)?(?P<host>[\w.-]+)(?::\d+)?/|[\w.-]+@(?P<at>[\w.-]+):)"
    r"(?P<path>[\w.~/-]+?)(?:\.git)?/?"
)


class CustomMetadataHook(MetadataHookInterface):
    """Fills in `urls`, which pyproject.toml calls dynamic."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Of a source distribution the addresses are those that it was made with."""
        stored = Path(self.root) / "PKG-INFO"
        if stored.is_file():
            fields = message_from_string(stored.read_text(encoding="utf-8"))
            pairs = (text.split(", ", 1) for text in fields.get_all("Project-URL", []))
            metadata["urls"] = dict(pairs)
        else:
            metadata["urls"] = project_urls(_origin(self.root))


def project_urls(remote: str) -> dict[str, str]:
    """Addresses of the pages of a repository.

    Args:
        remote: as `git remote get-url` prints it; a path of a machine or nothing gives none.
    """
    match = REMOTE.fullmatch(remote.strip())
    if match is None:
        return {}
    home = f"https://{match['host'] or match['at']}/{match['path']}"
    return {name: home + page for name, page in PAGES.items()}


def _origin(root: str) -> str:
    if not (Path(root) / ".git").exists():
        return ""
    line = ["git", "-C", root, "config", "--get", "remote.origin.url"]
    try:
        return subprocess.run(line, capture_output=True, text=True, check=False).stdout
    except OSError:  # there is no git
        return ""
