# SPDX-License-Identifier: Apache-2.0
"""A hook of mkdocs.yml: the pages at the repository's root belong to the site, and links lead to the same places there.
README.md is the site's first page. Doxygen's pages go to cpp/."""
import pathlib
import re

from mkdocs.structure.files import File

ROOT = pathlib.Path(__file__).resolve().parent.parent
CPP = ROOT / "build/docs/html"
PAGES = {"README.md": "index.md", "CHANGELOG.md": "CHANGELOG.md", "CONTRIBUTING.md": "CONTRIBUTING.md", "SECURITY.md": "SECURITY.md"}
FILES = ["LICENSE", "CITATION.cff"]
FOLDERS = {"docs/decisions": "decisions/README.md", "examples": "examples.md", "examples/python": "examples.md"}


def site_target(target):
    """Where a link of a page at the root leads in the site."""
    path, hash_, anchor = target.partition("#")
    if re.match(r"[a-z]+:", target) or not path:
        return target
    if path.rstrip("/") in FOLDERS:
        path = FOLDERS[path.rstrip("/")]
    elif path in PAGES:
        path = PAGES[path]
    else:
        path = path.removeprefix("docs/")
    return path + hash_ + anchor


def on_files(files, config):
    """Adds the pages and files of the root."""
    for source, page in PAGES.items():
        text = re.sub(r"\]\(([^)\s]+)\)", lambda link: f"]({site_target(link.group(1))})", (ROOT / source).read_text())
        files.append(File.generated(config, page, content=text))
    for name in FILES:
        files.append(File.generated(config, name, content=(ROOT / name).read_text()))
    for page in sorted(CPP.rglob("*")):
        if page.is_file():
            files.append(File.generated(config, f"cpp/{page.relative_to(CPP)}", abs_src_path=str(page)))
    return files
