"""A model's function compiled by LLVM itself, within hundredths of a second, once a machine.

numba would take as long again to look at a function in which there is nothing to infer. What was
compiled is kept on disk, unless addresses of this process are in it.
"""

from functools import cache
from threading import Lock

import llvmlite.binding as llvm
from llvmlite import ir

from sklearn_pgnn.physics.external import calls_outside
from sklearn_pgnn.simulation.disk_cache import keep, key_of, load
from sklearn_pgnn.simulation.model_function import ARRAYS, emit_model_function
from sklearn_pgnn.simulation.source import Source
from sklearn_pgnn.simulation.straight_line import FLOAT, INT

_KINDS = {"stuck": ir.IntType(8)}
#: the function's type: ``task, t, h`` and the data of the arrays
SIGNATURE = ir.FunctionType(
    ir.VoidType(),
    [INT, FLOAT, FLOAT, *(_KINDS.get(array, FLOAT).as_pointer() for array in ARRAYS)],
)
_LOCK = Lock()
_ADDRESSES: dict[str, int] = {}


def machine_code(source: Source, method: str) -> int:
    """Compile a model's function.

    Parameters
    ----------
    source : Source
        The model's source.
    method : {"rk4", "euler"}
        Scheme of a step.

    Returns
    -------
    int
        Its address, which is valid as long as the process lives.
    """
    key = key_of("machine code", repr(source), method, *_processor())
    with _LOCK:
        if key not in _ADDRESSES:
            _ADDRESSES[key] = _linked(f"model_{key}", _object_file(key, source, method))
        return _ADDRESSES[key]


def _linked(name: str, object_file: bytes) -> int:
    """Return where in memory the function of an object file begins."""
    _, engine = _compiler()
    engine.add_object_file(llvm.ObjectFileRef.from_data(object_file))
    engine.finalize_object()
    return engine.get_function_address(name)


def _object_file(key: str, source: Source, method: str) -> bytes:
    """Return the compiled function, from the disk where it was compiled before."""
    only_here = calls_outside(source.text)
    kept = None if only_here else load(key)
    if kept is not None:
        return kept
    module = llvm.parse_assembly(str(_module(f"model_{key}", source, method)))
    machine, _ = _compiler()
    _optimise(module, machine)
    made = machine.emit_object(module)
    if not only_here:
        keep(key, made)
    return made


def _module(name: str, source: Source, method: str) -> ir.Module:
    """Write a module that holds the function."""
    module = ir.Module(name)
    module.triple = llvm.get_process_triple()
    function = ir.Function(module, SIGNATURE, name)
    builder = ir.IRBuilder(function.append_basic_block())
    emit_model_function(builder, source, method, function.args)
    builder.ret_void()
    return module


def _optimise(module, machine) -> None:
    """Keep the stages' numbers in registers; the source has shared everything else."""
    passes = llvm.create_new_function_pass_manager()
    passes.add_sroa_pass()
    builder = llvm.create_pass_builder(machine, llvm.create_pipeline_tuning_options())
    for function in module.functions:
        if not function.is_declaration:
            passes.run(function, builder)


@cache
def _processor() -> tuple[str, str, str]:
    """Return what machine code is for: the system, the processor and what it can do."""
    features = llvm.get_host_cpu_features().flatten()
    return llvm.get_process_triple(), llvm.get_host_cpu_name(), features


@cache
def _compiler():
    """Return this machine, and what links for it, created once a process."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple, name, features = _processor()
    machine = llvm.Target.from_triple(triple).create_target_machine(
        cpu=name, features=features, opt=1
    )
    return machine, llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
