"""How many multiply-adds in double precision one core of this machine does in a second, at best."""

import ctypes
import subprocess
import time
from pathlib import Path

from .casadi_model import compiler

# eight independent chains of eight lanes keep every unit busy; the sum is returned so that nothing is left out
_SOURCE = """
typedef double lanes __attribute__((vector_size(64)));
double burn(long rounds) {
  lanes a[8], total = {0};
  lanes x, y;
  for (int j = 0; j < 8; j++) { x[j] = 0.999999; y[j] = 1e-9 * j; }
  for (int i = 0; i < 8; i++) for (int j = 0; j < 8; j++) a[i][j] = i + j;
  for (long k = 0; k < rounds; k++)
    for (int i = 0; i < 8; i++) a[i] = a[i] * x + y;
  for (int i = 0; i < 8; i++) total += a[i];
  double s = 0;
  for (int j = 0; j < 8; j++) s += total[j];
  return s;
}
"""
_FLOPS_A_ROUND = 2 * 8 * 8


def peak_flops(folder: Path, rounds: int = 30_000_000, repeats: int = 5) -> float:
    """Flops a second of one core: the best of `repeats`."""
    source, library = folder / "peak.c", folder / "peak.so"
    source.write_text(_SOURCE, encoding="utf-8")
    command = [compiler(), "-O3", "-march=native", "-shared", "-fPIC", str(source), "-o", str(library)]
    subprocess.run(command, check=True, capture_output=True)
    burn = ctypes.CDLL(str(library)).burn
    burn.argtypes, burn.restype = [ctypes.c_long], ctypes.c_double
    best = 0.0
    for _ in range(repeats):
        begin = time.perf_counter()
        burn(rounds)
        best = max(best, rounds * _FLOPS_A_ROUND / (time.perf_counter() - begin))
    return best
