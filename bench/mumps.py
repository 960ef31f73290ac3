"""MUMPS the way IPOPT calls it: the library that CasADi brings along, with IPOPT's settings, through a few lines of C.

IPOPT reports no times of its factorisations with MUMPS, and CasADi's own interface analyses the pattern again with
every factorisation; here the pattern is analysed once and the factorisations are timed alone: those of one matrix, or,
by an audit library of the dynamic linker, those of a whole process in which IPOPT solves.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import statistics
import subprocess
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["Mumps", "Times", "times_inside", "unavailable"]

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

#: Takes dmumps_c's place wherever it is called, and tells in the end how long each factorisation took.
AUDIT = """
#define _GNU_SOURCE
#include <link.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include "dmumps_c.h"

static void (*real)(DMUMPS_STRUC_C *);
#define MOST 100000
static double seconds[MOST];
static long calls;

static double used(void) {
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return t.tv_sec + 1e-9 * t.tv_nsec;
}
static void watched(DMUMPS_STRUC_C *id) {
    int job = id->job;
    double time = used();
    real(id);
    time = used() - time;
    if (job == 2 && calls < MOST) seconds[calls++] = time;
}
unsigned la_version(unsigned version) { return LAV_CURRENT; }
unsigned la_objopen(struct link_map *map, Lmid_t space, uintptr_t *cookie) { return LA_FLG_BINDTO | LA_FLG_BINDFROM; }
uintptr_t la_symbind64(Elf64_Sym *symbol, unsigned number, uintptr_t *from, uintptr_t *to, unsigned *flags,
                       const char *name) {
    if (strcmp(name, "dmumps_c")) return symbol->st_value;
    real = (void *)symbol->st_value;
    return (uintptr_t)watched;
}
__attribute__((destructor)) static void tell(void) {
    for (long k = 0; k < calls; k++) fprintf(stderr, k ? " %.9f" : "\\nMUMPS %.9f", seconds[k]);
    if (calls) fprintf(stderr, "\\n");
}
"""


@dataclass(frozen=True)
class Times:
    """Of the factorisations of a solve: their number, the mean, the median and the least of their seconds."""

    calls: int
    mean: float
    median: float
    least: float

    @classmethod
    def of(cls, seconds: Sequence[float]) -> Times:
        """From those of each."""
        return cls(len(seconds), statistics.fmean(seconds), statistics.median(seconds), min(seconds))


def times_inside(command: list[str]) -> Times:
    """Of the processor time of MUMPS' factorisations, analyses excluded, in a process that this command starts.

    Raises:
        CalledProcessError: it failed.
        LookupError: MUMPS was not called in it.
    """
    with tempfile.TemporaryDirectory() as scratch:
        audit = _compiled(AUDIT, Path(scratch) / "audit.so", [])
        environment = {**os.environ, "LD_AUDIT": str(audit)}
        done = subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    for line in done.stderr.splitlines():
        if line.startswith("MUMPS "):
            return Times.of([float(word) for word in line.split()[1:]])
    raise LookupError("MUMPS was not called")


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
