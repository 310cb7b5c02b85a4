"""Loops that run as machine code: numba compiles them when they are first called.

An equation over cells, moves and regions reads best as plain loops, and as such Python is a hundred
times too slow. `compiled` keeps the loops. Machine code is kept on disk (beside the module, else in
the user's cache folder), so that a machine compiles each function once. numba is imported by the
first call, not with mlci.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from types import FunctionType
from typing import Any, cast

_LOG = logging.getLogger(__name__)


class Compiled:
    """A function that is compiled when it is first called.

    Attributes:
        function: what was written, for tests that compare both.
        signature: of numba, as for `compiled`.
    """

    def __init__(self, function: FunctionType, signature: str) -> None:
        self.function = function
        self.signature = signature
        self.__doc__ = function.__doc__
        self._machine_code: Any = None

    def __call__(self, *arguments: Any) -> Any:
        return self.machine_code()(*arguments)

    def machine_code(self) -> Any:
        """numba's dispatcher, from disk if it was compiled before."""
        if self._machine_code is None:
            import numba

            # Another compiled function that this one calls is known to numba by its machine code.
            code, known = self.function.__code__, dict(self.function.__globals__)
            for name in code.co_names:
                if isinstance(known.get(name), Compiled):
                    known[name] = known[name].machine_code()
            function = FunctionType(code, known, self.function.__name__)
            function.__qualname__ = self.function.__qualname__
            function.__module__ = self.function.__module__
            compile_it = cast(Any, numba.njit)
            # A wrapper for C is a sixth of what compiling takes, and nobody calls it.
            options = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
            with _told(function):
                try:
                    self._machine_code = compile_it(self.signature, cache=True, **options)(function)
                except (RuntimeError, OSError):  # no folder can be written to, or its disk is full
                    self._machine_code = compile_it(self.signature, **options)(function)
        return self._machine_code


def _told(function: FunctionType) -> AbstractContextManager[None]:
    """Says so on the module's logger if a function is compiled, and not read from disk."""
    from numba.core import event

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            self._say(event, "compiling, once on this machine")

        def on_end(self, event: Any) -> None:
            self._say(event, "compiled")

        def _say(self, event: Any, words: str) -> None:
            if event.data["dispatcher"].py_func is function:  # and not what it calls
                _LOG.info(words)

    told: AbstractContextManager[None] = event.install_listener("numba:compile", Listener())
    return told


def compiled(signature: str) -> Callable[[Callable[..., Any]], Compiled]:
    """Compile a function of arrays and numbers when it is first called.

    Args:
        signature: numba's, such as "f8[:](in f8[:, ::1], i4[:])": one type for each argument, so
            that nothing is compiled twice. The caller sees to types and layout. An array that is
            marked by "in" is not written to, and may be one that cannot be.
    """
    types = _IN.sub(_read_only, signature)
    return lambda function: Compiled(cast(FunctionType, function), types)


_IN = re.compile(r"\bin (\w+)\[([^]]*)\]")


def _read_only(array: re.Match[str]) -> str:
    """numba's type of an array, such as "f8[:, ::1]", that need not be writeable."""
    kind, axes = array.groups()
    return f"Array({kind}, {axes.count(',') + 1}, '{'C' if '::1' in axes else 'A'}', readonly=True)"
