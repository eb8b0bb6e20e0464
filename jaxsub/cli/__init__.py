"""The command line: arguments in, one call, files out."""

from .app import main

__all__ = ["main"]
