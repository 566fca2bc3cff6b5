# SPDX-License-Identifier: Apache-2.0
"""Values of parameters, between Python and the texts that the library reads and prints."""
from __future__ import annotations

import dataclasses
import numbers
import operator
from typing import Any

import numpy as np

from . import _native
from ._errors import UsageError


@dataclasses.dataclass(frozen=True)
class Parameter:
    """One row of the table of parameters."""

    name: str
    """As in Params."""
    kind: str
    """int, float, length, switch or word."""
    stage: str
    """The first stage that reads it."""
    min: float
    """Of a number, in the unit given."""
    max: float
    """Likewise."""
    automatic: bool
    """Whether "auto" is allowed."""
    values: tuple[str, ...]
    """The words allowed; empty for numbers."""
    help: str
    """One line."""
    expert: bool
    """Seldom needed."""
    default: Any
    """As in Params()."""

    def __post_init__(self) -> None:
        words: Any = self.values
        object.__setattr__(self, "values", tuple(words.split("|")) if words else ())
        object.__setattr__(self, "default", canonical(self.default, self))


def canonical(text: str, parameter: Parameter) -> Any:
    """The text of a value as Python has it: True, 24, 0.02, "1s", "auto"."""
    if parameter.kind == "switch":
        return text == "on"
    if parameter.kind == "word" or text == "auto":
        return text
    if parameter.kind == "int":
        return int(text)
    return text if text[-1] in "%srm" else float(text)


def encodable(text: str) -> str:
    """The text with what UTF-8 cannot hold written out."""
    return text.encode("utf-8", "backslashreplace").decode()


def kind_of(value: Any) -> str:
    """What a value is, in words: "a list", "an int"."""
    name = type(value).__name__
    return "None" if value is None else f"{'an' if name[0] in 'aeiouAEIOU' else 'a'} {name}"


def as_text(value: Any, name: str) -> str:
    """A text, for the argument `name`."""
    if not isinstance(value, str):
        raise UsageError(f"{name} is {kind_of(value)}: give a text")
    return encodable(value)


def text_of(value: Any) -> str:
    """The text that the library reads."""
    if isinstance(value, str):
        return encodable(value)
    if value is None:
        return "auto"
    if hasattr(value, "item") and np.ndim(value) == 0:  # of an array or a tensor
        value = value.item()
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, numbers.Integral):
        return str(int(value))
    if isinstance(value, numbers.Real):
        return repr(float(value))
    return str(value)


def _check_is_one(value: Any, name: str) -> None:
    """Raises UsageError for an array, whose text would be no answer."""
    if not isinstance(value, (str, bytes)) and np.ndim(value) > 0:
        of_points = "; Pipeline.set_noise takes one for each point" if name == "noise" else ""
        raise UsageError(f"{name} cannot be {kind_of(value)}: give one value{of_points}")


def native_params(params: Any, table: tuple[Parameter, ...]) -> _native.Params:
    """The library's parameters of a Params whose fields hold what the caller gave."""
    native = _native.Params()
    for parameter in table:
        value = getattr(params, parameter.name)
        if value is not parameter.default:
            _check_is_one(value, parameter.name)
            native.set(parameter.name, text_of(value))
    native.check()
    return native


def as_threads(threads: int) -> int:
    """A number of threads, 0 for all cores."""
    try:
        number = -1 if isinstance(threads, (bool, np.bool_)) else operator.index(threads)
    except TypeError:
        number = -1
    if not 0 <= number <= 4096:
        raise UsageError(f"threads cannot be {threads!r}: give a whole number from 0, all cores, to 4096")
    return number
