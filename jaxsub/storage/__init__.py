"""Files and folders that appear whole or not at all, and manifests of what jaxsub wrote."""

from .manifest import MANIFEST, Manifest
from .temporary import abandon, clear_dead, scratch
from .whole import exchange, place, written_whole

__all__ = ["MANIFEST", "Manifest", "abandon", "clear_dead", "exchange", "place", "scratch", "written_whole"]
