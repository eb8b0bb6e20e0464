"""The table of the missions' page."""

from ..tables import table


def tables(results: dict) -> dict[str, str]:
    """Time, memory and what was named, by dives."""
    header = ("dives", "CPU s", "seconds", "peak memory", "verdict", "named", "right")
    return {"missions": table(header, [_row(mission) for mission in results["missions"]])}


def _row(mission: dict) -> tuple[str, ...]:
    return (
        str(mission["dives"]),
        f"{mission['cpu_seconds']:.0f}",
        f"{mission['seconds']:.0f}",
        f"{mission['peak_GB']:.1f} GB",
        mission["verdict"],
        ", ".join(mission["named"]) or "–",
        "yes" if mission["right"] else "no",
    )
