# SPDX-License-Identifier: Apache-2.0
"""`python -m pointfair` is the program pointfair, where the folder of programs is not on the PATH."""
import os
import sys

from ._errors import Error
from ._program import main, program_path

if sys.platform != "win32" and sys.argv[1:2] != ["cluster"]:
    try:
        os.execv(program_path(), [program_path(), *sys.argv[1:]])  # so that signals reach the program itself
    except Error:
        pass  # main() says so
sys.exit(main())
