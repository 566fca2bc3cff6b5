# SPDX-License-Identifier: Apache-2.0
"""Writes the package's _params.py from the compiled table of parameters: generate_params.py OUTPUT"""
import pathlib
import sys
import textwrap

import _native

TYPES = {"int": "int", "float": "float", "length": "float | str", "switch": "bool"}

HEAD = '''# SPDX-License-Identifier: Apache-2.0
# Written at build time by python/generate_params.py from the table of include/pointfair/params.hpp.
"""The parameters of a run, from the library's one table."""
from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any, Literal, TypedDict

from ._native import Params as NativeParams
from ._native import paper_preset, parameter_table
from ._values import Parameter, canonical, native_params

if TYPE_CHECKING:
    from typing_extensions import Self, Unpack

PARAMETERS: tuple[Parameter, ...] = tuple(Parameter(*row) for row in parameter_table())
"""Every parameter, in the order of the stages that read them."""

'''

CLASS = '''
@dataclasses.dataclass(frozen=True, repr=False, kw_only=True)
class Params:
    """What a run does. Every field has a default that suits any cloud; ``"auto"`` is chosen from the data.

    A length is a number in the unit of the coordinates, or a text: ``"0.5%"`` of the diagonal of the bounding box,
    ``"2s"`` mean spacings, ``"auto"``; ``normal_sigma`` and ``closeness_sigma`` also take ``"0.6r"``, radii of the
    neighbourhood. Values are checked when the object is made: a wrong one raises UsageError with the range.

{attributes}
    Examples:
        >>> Params(k=24, similarity_sigma="1s")
        Params(k=24, similarity_sigma='1s')
    """

{fields}

    def __post_init__(self) -> None:
        native = native_params(self, PARAMETERS)
        self.__dict__["_native"] = native
        for parameter in PARAMETERS:
            object.__setattr__(self, parameter.name, canonical(native.text(parameter.name), parameter))

    @property
    def _native(self) -> NativeParams:
        native: NativeParams = self.__dict__["_native"]
        return native

    @classmethod
    def paper(cls) -> Self:
        """The paper's method: k = 8, one iteration, the constrained neighbourhood, squared area weight."""
        return cls._of(paper_preset())

    @classmethod
    def _of(cls, native: NativeParams) -> Self:
        texts: dict[str, Any] = {{parameter.name: native.text(parameter.name) for parameter in PARAMETERS}}
        return cls(**texts)

    def replace(self, **changes: Unpack[ParamArguments]) -> Self:
        """The same parameters with these changed."""
        return dataclasses.replace(self, **changes)

    def changed(self) -> dict[str, Any]:
        """The values that differ from the defaults, by name."""
        return {{p.name: getattr(self, p.name) for p in PARAMETERS if getattr(self, p.name) != p.default}}

    def __repr__(self) -> str:
        return f"Params({{', '.join(f'{{name}}={{value!r}}' for name, value in self.changed().items())}})"

    def __reduce__(self) -> tuple[Any, ...]:
        return _restore, (self.changed(),)


def _restore(changed: dict[str, Any]) -> Params:
    return Params(**changed)


class ParamArguments(TypedDict, total=False):
    """The fields of Params as keyword arguments."""

{arguments}
'''


def type_of(name, kind, automatic, values):
    if kind == "word":
        words = values.split("|") + (["auto"] if automatic else [])
        return f"Literal[{', '.join(repr(word) for word in words)}]"
    if kind == "length" or not automatic:
        return TYPES[kind]
    return f'{TYPES[kind]} | Literal["auto"]'


def default_of(kind, text):
    return {"on": True, "off": False}[text] if kind == "switch" else text


def range_of(kind, low, high):
    return {"int": f"{low:g} to {high:g}", "float": f"{low:g} to {high:g}", "length": "a positive length"}.get(kind, "")


def in_python(text, names):
    """Flags of the command line as names: --normal-filter becomes normal_filter."""
    for name in sorted(names, key=len, reverse=True):
        text = text.replace("--" + name.replace("_", "-"), f"``{name}``")
    return text


def main(output):
    rows = _native.parameter_table()
    names = [row[0] for row in rows]
    attributes, fields, arguments = ["Attributes:"], [], []
    for name, kind, stage, low, high, automatic, values, text, expert, default in rows:
        type_name = type_of(name, kind, automatic, values)
        span = range_of(kind, low, high)
        sentence = f"{name}: {in_python(text, names)}" + (f" ({span})" if span else "")
        attributes += textwrap.wrap(sentence, 112, initial_indent="    ", subsequent_indent="        ")
        fields.append(f"{name}: {type_name} = {default_of(kind, default)!r}")
        arguments.append(f"{name}: {type_name}")
    indented = lambda lines: textwrap.indent("\n".join(lines), "    ")
    pathlib.Path(output).write_text(HEAD + CLASS.format(attributes=indented(attributes) + "\n", fields=indented(fields),
                                                        arguments=indented(arguments)))


main(sys.argv[1])
