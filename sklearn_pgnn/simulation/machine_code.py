"""A model's function compiled by LLVM itself, within hundredths of a second.

numba would take as long again to look at a function in which there is nothing to infer.
"""

from functools import cache
from itertools import count
from threading import Lock

import llvmlite.binding as llvm
from llvmlite import ir

from sklearn_pgnn.simulation.model_function import ARRAYS, emit_model_function
from sklearn_pgnn.simulation.source import Source
from sklearn_pgnn.simulation.straight_line import FLOAT, INT

_KINDS = {"stuck": ir.IntType(8)}
#: the function's type: ``task, t, h`` and the data of the arrays
SIGNATURE = ir.FunctionType(
    ir.VoidType(),
    [INT, FLOAT, FLOAT, *(_KINDS.get(array, FLOAT).as_pointer() for array in ARRAYS)],
)
_NUMBERS, _LOCK = count(), Lock()


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
    with _LOCK:
        name = f"model_{next(_NUMBERS)}"
        module = llvm.parse_assembly(str(_module(name, source, method)))
        machine, engine = _compiler()
        _optimise(module, machine)
        engine.add_module(module)
        engine.finalize_object()
        return engine.get_function_address(name)


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
def _compiler():
    """Return this machine, and what compiles for it, created once a process."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_triple(llvm.get_process_triple()).create_target_machine(
        cpu=llvm.get_host_cpu_name(), features=llvm.get_host_cpu_features().flatten(), opt=1
    )
    return machine, llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
