# SPDX-License-Identifier: Apache-2.0
"""The code of docs/python.md and of the README's Python part runs, and prints what they say."""
import doctest
import os
import pathlib
import re

import pytest

ROOT = pathlib.Path(__file__).parents[2]
BLOCK = re.compile(r"^```(python|pycon)\n(.*?)^```", re.M | re.S)


@pytest.mark.parametrize("page", ["docs/python.md", "README.md"])
def test_the_code_of_a_page(page, tmp_path):
    blocks = BLOCK.findall((ROOT / page).read_text())
    assert blocks
    names, parser, runner = {}, doctest.DocTestParser(), doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    if page == "README.md":
        import numpy as np
        from clouds import waves

        import pointfair as pf
        names["xyz"], names["np"] = waves(), np
        pf.write(tmp_path / "scan.ply", waves())
    before = os.getcwd()
    os.chdir(tmp_path)
    try:
        for language, code in blocks:
            if language == "python":
                exec(compile(code, page, "exec"), names)
            else:
                test = parser.get_doctest(code, names, page, page, 0)
                runner.run(test, clear_globs=False)
                names.update(test.globs)
    finally:
        os.chdir(before)
    assert runner.summarize().failed == 0
