"""Files and folders that appear whole or not at all, and manifests of what jaxsub wrote."""

from .archive import opened_archive, write_archive
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
    "opened_archive",
    "place",
    "require_ours",
    "scratch",
    "size_and_digest",
    "write_archive",
    "written_whole",
]
