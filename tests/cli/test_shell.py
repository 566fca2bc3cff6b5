# SPDX-License-Identifier: Apache-2.0
"""What is installed beside the program: what bash and zsh offer after its name, and the manual page."""
import re
import shutil
import subprocess
import unittest
from pathlib import Path

from program import BIN, Case
from test_verbs import VERBS

ROOT = Path(__file__).resolve().parents[2]
IN_BASH = """. "$1"; shift; COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _pointfair; printf '%s\\n' "${COMPREPLY[@]}"; complete -p pointfair"""
# zsh leaves out by itself what does not begin as the word does
IN_ZSH = """autoload -U compinit bashcompinit; compinit -D -u; bashcompinit; . "$1"; shift
COMP_WORDS=("$@") words=("$@") CURRENT=$# COMP_CWORD=$(($# - 1)); compgen -F _pointfair -- "$@[-1]" """


class Shell(Case):
    def offered(self, *words):
        """What bash offers for the last word; where that is nothing, it offers files."""
        said = subprocess.run(["bash", "--norc", "-c", IN_BASH, "bash", ROOT / "cli/completion.bash", BIN, *words],
                              capture_output=True, text=True, check=True)
        *offers, registered = filter(None, said.stdout.split("\n"))
        self.assertIn(" -o default ", registered)
        self.assertEqual(said.stderr, "")
        if shutil.which("zsh"):
            in_zsh = subprocess.run(["zsh", "-f", "-c", IN_ZSH, "zsh", ROOT / "cli/completion.bash", BIN, *words], capture_output=True, text=True)
            self.assertEqual({word for word in in_zsh.stdout.split() if word.startswith(words[-1])}, set(offers), in_zsh.stderr)
        return set(offers)

    def test_verbs(self):
        self.assertLessEqual({*VERBS, "tile", "certify", "--version"}, self.offered(""))
        self.assertEqual(self.offered("comp"), {"compare"})
        self.assertEqual(self.offered("tile", ""), {"plan", "run", "status", "merge"})

    def test_options_of_a_verb(self):
        self.assertEqual(self.offered("run", "scan.ply", "--normal-"), {"--normal-sigma", "--normal-filter"})
        self.assertEqual(self.offered("run", "--qui"), {"--quiet"})
        self.assertEqual(self.offered("compare", "--normal-"), set())
        self.assertEqual(self.offered("tile", "status", "--rep"), {"--report"})

    def test_values_of_an_option(self):
        self.assertEqual(self.offered("run", "--device", ""), {"auto", "cpu", "cuda"})
        self.assertEqual(self.offered("run", "--device", "=", "cp"), {"cpu"})
        self.assertEqual(self.offered("run", "--quiet", ""), set())

    def test_elsewhere_files(self):
        for words in (["run", ""], ["run", "sc"], ["tile", "run", ""], ["run", "--report", ""]):
            self.assertEqual(self.offered(*words), set())

    @unittest.skipUnless(shutil.which("cmake"), "CMake writes the page")
    def test_the_manual_page_has_every_verb_and_option(self):
        page = self.path("pointfair.1")
        subprocess.run(["cmake", f"-DPROGRAM={BIN}", f"-DPAGE={page}", "-P", ROOT / "cmake/manual_page.cmake"], check=True)
        parts = dict(re.findall(r'^\.SH "?(.*?)"?\n(.*?)(?=^\.SH|\Z)', page.read_text(), re.M | re.S))
        self.assertLessEqual({f"POINTFAIR {verb.upper()}" for verb in [*VERBS, "tile", "certify", "tile plan", "tile merge"]}, parts.keys())
        for words in (["run", "--help-all"], ["view", "--help"], ["tile", "merge", "--help"]):
            options = re.findall(r"^  (?:-.,)?(--[a-z-]+)", self.ok(*words).stdout.decode(), re.M)
            part = re.sub(r"\\(f[BR])?", "", parts[" ".join(["POINTFAIR", *words[:-1]]).upper()])
            self.assertEqual(re.findall(r"^\.TP\n(?:-.,)?(--[a-z-]+)", part, re.M), options)
        if shutil.which("man"):
            shown = subprocess.run(["man", "--warnings", "-l", page], capture_output=True, text=True, check=True)
            self.assertEqual(shown.stderr, "")
