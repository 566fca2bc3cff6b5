# SPDX-License-Identifier: Apache-2.0
"""Params and the table that they are made from."""
import copy
import dataclasses
import inspect
import math
import pathlib
import pickle
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pointfair as pf
from pointfair import _runs

HEADER = pathlib.Path(__file__).parents[2] / "include/pointfair/params.hpp"


def test_the_table_is_that_of_the_library():
    names = re.findall(r'ParamInfo\{\s*"(\w+)"', HEADER.read_text())
    assert len(names) > 20
    assert [p.name for p in pf.PARAMETERS] == names
    assert [f.name for f in dataclasses.fields(pf.Params)] == names
    assert list(pf.ParamArguments.__annotations__) == names
    for parameter in pf.PARAMETERS:
        assert re.search(rf"^ +{parameter.name}: \S", inspect.getdoc(pf.Params), re.M), parameter.name


@pytest.mark.parametrize("name, value, canonical", [
    ("k", 24, 24), ("k", 24.0, 24), ("k", "24", 24), ("k", np.int64(24), 24), ("k", None, "auto"), ("radius", 0.02, 0.02),
    ("radius", "0.020", 0.02), ("radius", np.float32(0.5), 0.5), ("radius", "0.5%", "0.5%"), ("radius", 1e-05, 1e-05),
    ("similarity_sigma", "1s", "1s"), ("normal_sigma", "0.6r", "0.6r"), ("constraint", "on", True), ("constraint", np.True_, True), ("relaxation", 1, 1.0),
    ("method", "mls", "mls"), ("outliers", None, "auto"),
])
def test_values_become_canonical(name, value, canonical):
    result = getattr(pf.Params(**{name: value}), name)
    assert result == canonical and type(result) is type(canonical)


@pytest.mark.parametrize("name, value", [
    ("k", 0), ("k", 513), ("k", 2.5), ("k", True), ("k", np.True_), ("k", "many"), ("k", [3]), ("k", 10**30), ("radius", -1), ("radius", 0),
    ("radius", math.inf), ("radius", math.nan), ("radius", "2r"), ("radius", "2 s"), ("radius", ""), ("radius", "\ud800"),
    ("method", "magic"), ("method", None), ("method", 3), ("constraint", "maybe"), ("constraint", None), ("crease_angle", 91),
    ("relaxation", 2.5), ("iterations", -1), ("iterations", b"2"),
])
def test_a_wrong_value_is_refused_with_the_name_and_what_to_give(name, value):
    with pytest.raises(pf.UsageError, match=rf"^{name} cannot be .*: give") as raised:
        pf.Params(**{name: value})
    assert "--" not in str(raised.value) and isinstance(raised.value, ValueError)


def test_values_that_contradict_each_other_are_refused():
    with pytest.raises(pf.UsageError, match="^constraint with radius needs k"):
        pf.Params(constraint=True, radius=1)


def test_an_unknown_name_is_refused():
    for call in (lambda: pf.denoise(np.zeros((4, 3)), sigma=3), lambda: pf.Pipeline("cpu").resolve(sigma=3)):
        with pytest.raises(pf.UsageError, match="no parameter 'sigma'"):
            call()


def test_a_mistyped_name_is_guessed():
    for wrong, right in (("iteration", "iterations"), ("viewpont", "viewpoint"), ("normal_sima", "normal_sigma")):
        with pytest.raises(pf.UsageError, match=f"did you mean {right}\\?"):
            pf.denoise(np.zeros((4, 3)), **{wrong: 3})
    with pytest.raises(pf.UsageError, match="no parameter 'zzz': help"):
        pf.denoise(np.zeros((4, 3)), zzz=3)
    with pytest.raises(pf.UsageError, match=r"Params.paper\(\)"):
        pf.denoise(np.zeros((4, 3)), preset="paper")
    taken = set(inspect.signature(pf.denoise).parameters) | set(inspect.signature(pf.Pipeline.run).parameters)
    assert set(_runs._OF_CALLS) <= taken


def test_an_argument_of_another_call_is_not_guessed_to_be_itself():
    pipeline, cloud = pf.Pipeline("cpu"), pf.Cloud(np.zeros((4, 3)))
    for call, name, where in ((pipeline.resolve, "device", "Pipeline$"), (pipeline.resolve, "viewpoint", "Pipeline.set_viewpoint$"),
                              (cloud.denoise, "return_report", "Pipeline.report$"), (pipeline.run, "normals", "Pipeline.normals$")):
        with pytest.raises(pf.UsageError, match=f"no parameter '{name}', and this call takes no such argument.*{where}"):
            call(**{name: True})
    for name, attribute in _runs._OF_CALLS.items():  # each is there
        assert attribute == "Pipeline" or hasattr(pf.Pipeline, attribute.removeprefix("Pipeline.")), name


def test_parameters_have_names_only():
    with pytest.raises(TypeError):
        pf.Params(24)  # which would be the noise
    for wrong, kind in ((24, "an int"), ({"k": 24}, "a dict"), (np.zeros((4, 3)), "a ndarray")):
        with pytest.raises(pf.UsageError, match=f"params is {kind}: give.*k=24"):
            pf.denoise(np.zeros((4, 3)), wrong)


def test_one_noise_for_each_point_is_no_parameter():
    with pytest.raises(pf.UsageError, match="^noise cannot be a ndarray: give one value; Pipeline.set_noise"):
        pf.denoise(np.zeros((4, 3)), noise=np.full(4, 0.01))


@st.composite
def params(draw):
    given_values = {}
    for p in pf.PARAMETERS:
        if not draw(st.booleans()):
            continue
        if p.kind == "int":
            given_values[p.name] = draw(st.integers(int(p.min), int(p.max)))
        elif p.kind == "float":
            given_values[p.name] = draw(st.floats(p.min, p.max))
        elif p.kind == "length":
            number = draw(st.floats(1e-30, 1e20))
            given_values[p.name] = draw(st.sampled_from([number, f"{number!r}s", f"{number!r}%"]))
        elif p.kind == "switch":
            given_values[p.name] = draw(st.booleans())
        else:
            given_values[p.name] = draw(st.sampled_from(p.values))
    if given_values.get("connectivity") == "mesh":
        for of_points in ("k", "constraint"):
            given_values.pop(of_points, None)
        if given_values.get("method") == "learned":
            del given_values["method"]
    else:
        given_values.pop("rings", None)
        given_values.setdefault("k", 8)
        if given_values.get("method") in ("fleishman", "jones"):  # they read faces
            del given_values["method"]
    if given_values.get("along") == "ray":
        given_values["method"] = draw(st.sampled_from(("bilateral", "mls", "wiener")))
    return pf.Params(**given_values)


@settings(max_examples=200, deadline=None, derandomize=True)
@given(params())
def test_params_survive_repr_pickle_copy_and_replace(value):
    assert eval(repr(value), {"Params": pf.Params}) == value
    assert pickle.loads(pickle.dumps(value)) == value == copy.deepcopy(value)
    assert hash(pickle.loads(pickle.dumps(value))) == hash(value)
    assert value.replace() == value == dataclasses.replace(value)
    assert pf.Params(**value.changed()) == value


def test_params_do_not_change():
    with pytest.raises(dataclasses.FrozenInstanceError):
        pf.Params().k = 3
    assert pf.Params().replace(k=3).k == 3


def test_the_paper_is_the_paper():
    paper = pf.Params.paper()
    assert (paper.k, paper.iterations, paper.constraint, paper.area_weight) == (8, 1, True, "squared")
