"""Files and folders that appear whole or not at all, and manifests of what jaxsub wrote."""

from .manifest import MANIFEST, Manifest, installed_version, require_ours, size_and_digest
from .temporary import abandon, clear_dead, scratch
from .whole import exchange, place, written_whole

__all__ = [
    "MANIFEST",
    "Manifest",
    "abandon",
    "clear_dead",
    "exchange",
    "installed_version",
    "place",
    "require_ours",
    "scratch",
    "size_and_digest",
    "written_whole",
]
