"""Files and folders that appear whole or not at all, and manifests of what jaxsub wrote."""

from .manifest import MANIFEST, Manifest, contents, installed_version
from .temporary import abandon, clear_dead, scratch
from .whole import exchange, place, written_whole

__all__ = [
    "MANIFEST",
    "Manifest",
    "abandon",
    "clear_dead",
    "contents",
    "exchange",
    "installed_version",
    "place",
    "scratch",
    "written_whole",
]
