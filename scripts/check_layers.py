#!/usr/bin/env python3
"""Fails when a source file includes a header of a higher layer.

usage: check_layers.py SRC/antipode
"""
import pathlib
import re
import sys

LAYERS = (
    "util geometry image object weights render nn matching prior zero123 gen6d synthesis orientation "
    "pose posegraph evaluation training report cli"
).split()
RANK = {folder: rank for rank, folder in enumerate(LAYERS)}
INCLUDE = re.compile(r'^\s*#\s*include\s*["<]antipode/([^/">]+)/', re.MULTILINE)
SUFFIXES = {".h", ".cc", ".cpp", ".hpp", ".inc"}


def problems_of(folder, name, text):
    """Includes in one file of `folder` that point upwards or to no known folder."""
    for match in INCLUDE.finditer(text):
        included = match.group(1)
        if included not in RANK:
            yield f"{name}: includes the unknown folder {included}/"
        elif RANK[included] > RANK[folder]:
            yield f"{name}: {folder}/ must not include {included}/, which is a higher layer"


def problems_under(root):
    for folder in sorted(path for path in root.iterdir() if path.is_dir()):
        if folder.name not in RANK:
            yield f"{folder}: is no known layer; add it to {__file__}"
            continue
        for path in sorted(folder.rglob("*")):
            if path.suffix in SUFFIXES:
                yield from problems_of(folder.name, path, path.read_text(encoding="utf-8"))


def main(arguments):
    if len(arguments) != 1:
        sys.exit(__doc__)
    problems = list(problems_under(pathlib.Path(arguments[0])))
    print("\n".join(problems) if problems else "every include points down")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
