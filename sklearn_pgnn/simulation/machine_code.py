"""A model's function compiled by LLVM itself, within hundredths of a second, once a machine.

numba would take as long again to look at a function in which there is nothing to infer. What was
compiled is kept on disk, unless addresses of this process are in it.
"""

from functools import cache
from threading import Lock
from weakref import WeakValueDictionary

import llvmlite.binding as llvm
from llvmlite import ir

from sklearn_pgnn.physics.external import calls_outside
from sklearn_pgnn.simulation.disk_cache import keep, key_of, load
from sklearn_pgnn.simulation.model_function import ARRAYS, emit_model_function
from sklearn_pgnn.simulation.source import Source
from sklearn_pgnn.simulation.straight_line import FLOAT, INT

#: functions that share a memory: it takes 20 kB for each of them, and 40 kB for itself
FULL = 16


class CodeMemory:
    """Memory of the machine code of functions, at valid addresses as long as it lives."""

    def __init__(self):
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
        self.count = 0

    def __deepcopy__(self, memo) -> "CodeMemory":
        return self  # code does not change, and addresses are not copied with it

    def add(self, object_file: bytes) -> None:
        """Link an object file, which holds one function, of another name than those before it."""
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(object_file))
        self._engine.finalize_object()
        self.count += 1

    def address(self, name: str) -> int:
        """Return where a function begins."""
        return self._engine.get_function_address(name)


@cache
def processor() -> tuple[str, str, str]:
    """Return what machine code is for: the system, the processor and what it can do."""
    features = llvm.get_host_cpu_features().flatten()
    return llvm.get_process_triple(), llvm.get_host_cpu_name(), features


def target_machine() -> llvm.TargetMachine:
    """Return this machine as LLVM's target; an engine takes it over."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    triple, name, features = processor()
    return llvm.Target.from_triple(triple).create_target_machine(cpu=name, features=features, opt=1)


_KINDS = {"stuck": ir.IntType(8)}
#: the function's type: ``task, t, h`` and the data of the arrays
SIGNATURE = ir.FunctionType(
    ir.VoidType(),
    [INT, FLOAT, FLOAT, *(_KINDS.get(array, FLOAT).as_pointer() for array in ARRAYS)],
)
_LOCK = Lock()
#: where every function is that somebody holds
_MEMORIES: WeakValueDictionary[str, CodeMemory] = WeakValueDictionary()


class _Begun:
    """The memory that is not full yet."""

    memory: CodeMemory | None = None


def machine_code(source: Source, method: str) -> tuple[int, CodeMemory]:
    """Compile a model's function."""
    key = key_of("machine code", repr(source), method, *processor())
    with _LOCK:
        memory = _MEMORIES.get(key)
        if memory is None:
            object_file = _object_file(key, source, method)
            if _Begun.memory is None or _Begun.memory.count >= FULL:
                _Begun.memory = CodeMemory()
            memory = _Begun.memory
            memory.add(object_file)
            _MEMORIES[key] = memory
        return memory.address(f"model_{key}"), memory


def _object_file(key: str, source: Source, method: str) -> bytes:
    """Return the compiled function, from the disk where it was compiled before."""
    only_here = calls_outside(source.text)
    kept = None if only_here else load(key)
    if kept is not None:
        return kept
    module = llvm.parse_assembly(str(_module(f"model_{key}", source, method)))
    machine = _machine()
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
def _machine() -> llvm.TargetMachine:
    """Return what compiles, created once a process."""
    return target_machine()
