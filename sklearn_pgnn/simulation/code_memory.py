"""Machine code in the memory of this process; it goes when nobody holds it any more."""

from functools import cache

import llvmlite.binding as llvm

#: functions that share a memory: it takes 20 kB for each of them, and 40 kB for itself
FULL = 16


class CodeMemory:
    """Memory of the machine code of some functions.

    Their addresses are valid as long as this object lives.
    """

    def __init__(self):
        self._engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), target_machine())
        self._count = 0

    def __deepcopy__(self, memo) -> "CodeMemory":
        return self  # code does not change, and addresses are not copied with it

    @property
    def is_full(self) -> bool:
        """Whether another memory is to be begun."""
        return self._count >= FULL

    def add(self, object_file: bytes) -> None:
        """Link an object file, which holds one function, of another name than those before it."""
        self._engine.add_object_file(llvm.ObjectFileRef.from_data(object_file))
        self._engine.finalize_object()
        self._count += 1

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
