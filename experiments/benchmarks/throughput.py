"""Filter throughput against filterpy and dynamax: measured where the filter's other claims are."""

from ..fuzzy_filter.throughput import run

__all__ = ["run"]
