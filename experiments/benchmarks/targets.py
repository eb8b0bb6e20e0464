"""What was aimed at, beside what was measured."""

from collections.abc import Mapping

# peers of a fit, by how their names begin, and how many times faster it is to be
_FITS = {"SciPy as users write it": 30.0, "SciPy, stacked by an expert": 30.0, "CasADi": 3.0}


def judged(found: Mapping[str, dict]) -> dict[str, dict]:
    """Each aim with its measured value and whether it is met, of the parts that were run."""
    rows: dict[str, dict] = {}

    def row(what: str, value: float, aim: float, more: bool) -> None:
        rows[what] = {"measured": value, "aim": aim, "met": bool(value >= aim if more else value <= aim)}

    if "fit" in found:
        for ours, key in (("", "times_ours"), (" in C", "times_ours_in_C")):
            for words, aim in _FITS.items():
                chosen = [value for name, value in found["fit"][key].items() if name.startswith(words)]
                row(f"a fit{ours}: times faster than {words}, its best", min(chosen), aim, more=True)
    if "many_starts" in found:
        for name, times in found["many_starts"]["times_faster"].items():
            if name.startswith("jaxsub"):
                row(f"a sweep by {name}: times faster than CasADi's C", times, 3.0, more=True)
    if "batched" in found:
        for ours in ("", "_in_C"):
            ratio = found["batched"][f"likelihood{ours}_over_CasADi_C"]
            row(f"a batched likelihood{ours.replace('_', ' ')}, over CasADi's C", ratio, 1.0, more=False)
    if "likelihood" in found:
        ratio = found["likelihood"]["ratios"]["forward_jacobian_in_simulations"]
        row("forward Jacobian of 25 coefficients, in simulations", ratio, 4.0, more=False)
    if "diagnose" in found:
        for label, aim in (("cold", 20.0), ("warm", 3.0)):
            seconds = sum(found["diagnose"][label]["making_programs_s"].values())
            row(f"making the programs of a diagnosis, {label}, s", seconds, aim, more=False)
    for what in ("samples", "batch", "candidates"):
        if "growth" in found:
            row(f"growth with {what}: slope of time", found["growth"][what]["slope_of_time"], 1.05, more=False)
    if "growth" in found:
        peaks = list(found["growth"]["batch"]["peak_GB"].values())
        row("growth with batch: peak memory, most over least", peaks[-1] / peaks[0], 1.1, more=False)
    return rows
