"""LLVM on this machine: text to object code, object code to functions.

llvmlite is imported when the first tape is compiled. It is not made for threads, so one lock
guards everything that touches it; the functions it yields run without.
"""

from __future__ import annotations

import ctypes
import threading
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from closedchain.closure.tape.writer import Shape

LOCK = threading.RLock()
LEVEL = 1
"""Effort of LLVM's code generator, 0 to 3: above 1 it takes longer to write the same code."""


@dataclass(frozen=True)
class Host:
    """The machine that code is made for.

    Attributes
    ----------
    triple, cpu, features : str
        As LLVM names them.
    lanes : int
        Numbers that fit one vector register.
    fused : bool
        Whether it multiplies and adds in one operation.
    llvm : str
        Versions of LLVM and llvmlite.
    """

    triple: str
    cpu: str
    features: str
    lanes: int
    fused: bool
    llvm: str

    def shape(self, lanes: int) -> Shape:
        """Shape of code for this machine."""
        return Shape(lanes, self.fused)


@cache
def host() -> Host:
    """Describe this machine."""
    import llvmlite
    import llvmlite.binding as llvm

    with LOCK:
        llvm.initialize_native_target()
        llvm.initialize_native_asmprinter()
        triple = llvm.get_process_triple()
        has = llvm.get_host_cpu_features()
        version = ".".join(map(str, llvm.llvm_version_info))
        cpu = llvm.get_host_cpu_name()
    arm = triple.startswith(("aarch64", "arm64"))
    lanes = 8 if has.get("avx512f") else 4 if has.get("avx2") else 2
    fused = arm or bool(has.get("fma"))
    return Host(
        triple, cpu, has.flatten(), lanes, fused, f"llvm {version}, llvmlite {llvmlite.__version__}"
    )


def machine(level: int) -> Any:
    """Make a code generator for this machine, under ``LOCK``; an engine that gets one owns it."""
    import llvmlite.binding as llvm

    here = host()
    return llvm.Target.from_triple(here.triple).create_target_machine(
        cpu=here.cpu, features=here.features, opt=level, reloc="pic", codemodel="jitdefault"
    )


def object_code(text: str, level: int = LEVEL) -> bytes:
    """Compile LLVM text."""
    import llvmlite.binding as llvm

    with LOCK:
        generator = machine(level)
        # a context of its own: the global one would keep every constant for good
        module = llvm.parse_assembly(text, llvm.create_context())
        module.verify()
        return bytes(generator.emit_object(module))


@dataclass(frozen=True)
class Loaded:
    """Object code in memory: it stays as long as this or one of its functions does."""

    engine: Any = field(repr=False)

    def address(self, name: str) -> int:
        """Address of a function; KeyError where there is none of that name."""
        with LOCK:
            found = int(self.engine.get_function_address(name))
        if not found:
            raise KeyError(f"no function {name} in the object code")
        return found

    def function(self, name: str, arguments: int) -> Any:
        """Return a function of so many integers and addresses; it runs without Python's lock."""
        kinds = [ctypes.c_void_p] * arguments  # quicker to convert to than other integers
        function: Any = ctypes.CFUNCTYPE(None, *kinds)(self.address(name))
        function.code = self  # the code lives as long as the function
        return function


def loaded(code: bytes) -> Loaded:
    """Put object code into memory, ready to run; ValueError where it is none."""
    import llvmlite.binding as llvm

    with LOCK:
        generator = machine(LEVEL)
        # in the global context: one of its own could be collected before the engine is
        empty = llvm.parse_assembly("")
        image = llvm.ObjectFileRef.from_data(code)
        engine = llvm.create_mcjit_compiler(empty, generator)
        engine.add_object_file(image)
        engine.finalize_object()
    return Loaded(engine)
