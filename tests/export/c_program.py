"""Compile exported C, and run it along an input from Python."""

import ctypes
import shutil
import subprocess

import numpy as np
import pytest

FLAGS = ("-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-std=c99")

DRIVER = """
#include "exported.c"

int run(long n, const REAL *u, const REAL *more, const REAL *x0, REAL *X, REAL *Y);

int run(long n, const REAL *u, const REAL *more, const REAL *x0, REAL *X, REAL *Y)
{
    NAME_machine machine;
    long k;
    int i;
    (void)u;
    (void)more;
    NAME_start(&machineU);
    for (i = 0; i < NX && x0; i++)
        machine.x[i] = x0[i];
    for (k = 0; k < n; k++) {
        for (i = 0; i < NX; i++)
            X[k*NX + i] = machine.x[i];
        NAME_output(&machinePU_K, Y + k*NY);
        if (k + 1 < n)
            NAME_step(&machinePU_KU_NEXTMORE);
    }
    return 0;
}
"""


def compile_c(text, folder, source="exported.c"):
    """Compile a file of C to a library and return its path; skip the test without a compiler."""
    if shutil.which("gcc") is None:
        pytest.skip("no gcc here")
    (folder / source).write_text(text, encoding="utf-8")
    library = folder / f"{source}_{len(list(folder.iterdir()))}.so"  # none that is loaded
    command = ["gcc", *FLAGS, "-shared", "-fPIC", source, "-o", library.name, "-lm"]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert built.returncode == 0, built.stderr
    return library


def run_c(text, folder, name, model, u, *, n=None, x0=None, precision="double", hold="zoh",
          by_struct=False, features=None):  # fmt: skip
    """Run an exported model along an input; return its states and outputs."""
    u = np.zeros((n, 0)) if u is None else np.atleast_2d(np.asarray(u, dtype=float).T).T
    (folder / "exported.c").write_text(text, encoding="utf-8")
    nf = 0 if features is None else np.shape(features)[1]
    nu, nx, ny = len(model.inputs), len(model.states), len(model.outputs)
    parts = {
        "U_K": f", u + k*{nu}" if nu else "",
        "U_NEXT": f", u + (k + 1)*{nu}" if nu and hold == "foh" else "",
        "MORE": f", more + (k + 1)*{nf}" if nf else "",
        "NAME": name,
        "REAL": {"double": "double", "single": "float"}[precision],
        "NX": str(nx),
        "NY": str(ny),
        "machineU": "machine, u" if nu else "machine",
    }
    driver = DRIVER.replace("machineP", f"machine, &{name}_nominal" if by_struct else "machine")
    for part, written in parts.items():
        driver = driver.replace(part, written)
    library = ctypes.CDLL(str(compile_c(driver, folder, "driver.c")))
    kind = np.float64 if precision == "double" else np.float32
    X, Y = np.zeros((len(u), nx), kind), np.zeros((len(u), ny), kind)
    start, more = (None if a is None else np.array(a, kind, order="C") for a in (x0, features))
    u = np.array(u, kind, order="C")
    given = (u, more, start, X, Y)
    pointers = (None if a is None else ctypes.c_void_p(a.ctypes.data) for a in given)
    library.run(ctypes.c_long(len(u)), *pointers)
    return X.astype(float), Y.astype(float)
