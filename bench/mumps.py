"""MUMPS the way IPOPT calls it: the library that CasADi brings along, with IPOPT's settings, through a few lines of C.

IPOPT reports no times of its factorisations with MUMPS, and CasADi's own interface analyses the pattern again with
every factorisation; here the pattern is analysed once, so that factorisations can be timed alone.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["Mumps", "unavailable"]

Floats = NDArray[np.float64]

SOURCE = """
#include <stdlib.h>
#include "dmumps_c.h"
#define ICNTL(i) icntl[(i) - 1]
#define INFOG(i) infog[(i) - 1]

DMUMPS_STRUC_C *start(int n, int64_t entries, int *rows, int *columns, double *values) {
    DMUMPS_STRUC_C *id = calloc(1, sizeof *id);
    id->job = -1; id->par = 1; id->sym = 2; id->comm_fortran = -987654;
    dmumps_c(id);
    for (int k = 1; k <= 3; k++) id->ICNTL(k) = -1;
    id->ICNTL(4) = 0;
    id->ICNTL(6) = 7;      /* mumps_permuting_scaling */
    id->ICNTL(7) = 7;      /* mumps_pivot_order */
    id->ICNTL(8) = 77;     /* mumps_scaling */
    id->ICNTL(10) = 0;
    id->ICNTL(13) = 1;
    id->ICNTL(14) = 1000;  /* mumps_mem_percent */
    id->cntl[0] = 1e-6;    /* mumps_pivtol */
    id->n = n; id->nnz = entries; id->irn = rows; id->jcn = columns; id->a = values;
    id->job = 1;
    dmumps_c(id);
    return id;
}
int factorize(DMUMPS_STRUC_C *id) { id->job = 2; dmumps_c(id); return id->INFOG(1); }
int negative(DMUMPS_STRUC_C *id) { return id->INFOG(12); }
int solve(DMUMPS_STRUC_C *id, double *b) { id->rhs = b; id->job = 3; dmumps_c(id); return id->INFOG(1); }
void stop(DMUMPS_STRUC_C *id) { id->job = -2; dmumps_c(id); free(id); }
"""


def unavailable() -> str:
    """Why MUMPS cannot be measured here; empty when it can."""
    try:
        import casadi
    except ImportError:
        return "CasADi, which brings MUMPS along, is not installed"
    if shutil.which("gcc") is None:
        return "there is no gcc to call MUMPS with"
    folder = Path(casadi.__file__).parent
    if not (folder / "include/coin-or/mumps/dmumps_c.h").exists() or not list(
        folder.glob("libcoinmumps.so*")
    ):
        return "this CasADi brings no MUMPS that can be called"
    return ""


class Mumps:
    """One symmetric matrix, analysed.

    Args:
        n: its size.
        rows, columns, values: its lower triangle, every entry once.
    """

    def __init__(
        self, n: int, rows: NDArray[np.integer], columns: NDArray[np.integer], values: Floats
    ) -> None:
        self._library = _library()
        self._rows = np.ascontiguousarray(rows + 1, dtype=np.int32)
        self._columns = np.ascontiguousarray(columns + 1, dtype=np.int32)
        self.values = np.ascontiguousarray(values, dtype=np.float64)
        self._id = ctypes.c_void_p(
            self._library.start(
                ctypes.c_int(n),
                ctypes.c_int64(self.values.size),
                *(ctypes.c_void_p(a.ctypes.data) for a in (self._rows, self._columns, self.values)),
            )
        )

    def factorize(self) -> int:
        """Factorise ``values``; the number of negative eigenvalues.

        Raises:
            ArithmeticError: MUMPS reports an error.
        """
        if error := self._library.factorize(self._id):
            raise ArithmeticError(f"MUMPS ended with {error}")
        return int(self._library.negative(self._id))

    def solve(self, rhs: Floats) -> Floats:
        """Solution for one right-hand side (n,)."""
        solution = np.array(rhs, dtype=np.float64)
        self._library.solve(self._id, ctypes.c_void_p(solution.ctypes.data))
        return solution

    def close(self) -> None:
        """Give the memory back."""
        self._library.stop(self._id)


def _library() -> ctypes.CDLL:
    """The lines of C, compiled and linked with CasADi's MUMPS."""
    import casadi

    folder = Path(casadi.__file__).parent
    mumps = sorted(folder.glob("libcoinmumps.so*"))[0]
    with tempfile.TemporaryDirectory() as scratch:
        linked = [str(mumps), f"-Wl,-rpath,{folder}"]
        library = ctypes.CDLL(str(_compiled(SOURCE, Path(scratch) / "call.so", linked)))
    library.start.restype = ctypes.c_void_p
    return library


def _compiled(source: str, target: Path, linked: list[str]) -> Path:
    """A library of some lines of C that know of MUMPS."""
    import casadi

    include = Path(casadi.__file__).parent / "include/coin-or/mumps"
    text = target.with_suffix(".c")
    text.write_text(source)
    command = ["gcc", "-O2", "-shared", "-fPIC", f"-I{include}", "-o", str(target), str(text), *linked]
    subprocess.run(command, check=True, capture_output=True)
    return target
