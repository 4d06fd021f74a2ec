"""A hook of MkDocs: the pages are the project's Markdown files where they stand, so their links hold in both places."""

import re
import subprocess
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parents[2]
_IMAGE = re.compile(r"!\[[^\]]*\]\(([^)#:]+)\)")


def pages() -> list[Path]:
    """The Markdown files that git knows, in the folder of the project."""
    listed = subprocess.run(
        ["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
        cwd=ROOT, check=True, capture_output=True, text=True,
    )  # fmt: skip
    return [ROOT / name for name in listed.stdout.splitlines()]


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Those files and the images that they show, each under its path in the project; the theme's own stay."""
    ours = Files([each for each in files if each.src_dir != config.docs_dir])
    for page in pages():
        for shown in (page, *(page.parent / image for image in _IMAGE.findall(page.read_text()))):
            name = shown.resolve().relative_to(ROOT).as_posix()
            if name not in ours.src_uris:
                ours.append(File.generated(config, name, abs_src_path=str(shown)))
    return ours
