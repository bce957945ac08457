#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
"""The table of captures, a scene a line, read and checked before anything runs.

    captures.py TABLE     says how many scenes there are, or what is wrong with the table, a line each (exit status 2)

docs/cluster.md explains the columns.
"""

import csv
import math
import os
import re
import shlex
import sys

SEPARATORS = {".tsv": "\t", ".csv": ","}
REQUIRED = ("name", "capture")
COLUMNS = REQUIRED + ("seed", "key", "iterations", "downscale", "options")
# A name is a folder, a wildcard of the Snakefile and a part of links: letters that need no quotes anywhere.
NAME = r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}"
# What scene.py gives to `compmark train` itself, and so is no one's to give in the column of options.
GIVEN = {
    "--data": "the column capture says it",
    "--splat": "the column capture says it",
    "--out": "each scene has a folder of its own",
    "--key": "the column key says it",
    "--seed": "the column seed says it",
    "--iterations": "the column iterations says it",
    "--downscale": "the column downscale says it",
    "--codec": "--config codec=... says it for all scenes",
    "--threads": "--config threads=... says it for all scenes",
    "--checkpoint-every": "--config checkpoint_every=... says it for all scenes",
    "--decoder": "claim, train and verify have to read with the same one, which is the program's",
    "--json-log": "each scene has a log of its own",
    "--resume": "a scene is always resumed",
    "--force": "a finished scene is kept; remove its folder to make it again",
}


class Scene:
    """A line of the table; numbers that are not given are ''."""

    def __init__(self, line, fields):
        self.line = line
        self.name = fields["name"]
        self.capture, self.key = fields["capture"], fields["key"]
        self.seed, self.iterations, self.downscale = fields["seed"], fields["iterations"], fields["downscale"]
        self.options = fields["options"]

    def words(self):
        """What scene.py is told of it: a change of these words is another scene."""
        words = ["--name", self.name, "--capture", self.capture]
        for option in ("seed", "iterations", "downscale"):
            if getattr(self, option):
                words += ["--" + option, getattr(self, option)]
        if self.key:
            words += ["--key", self.key]
        return words + ["--options=" + shlex.join(self.options)] if self.options else words


class Faults(Exception):
    """What is wrong with a table, a line each."""

    def __init__(self, lines, shown=20):
        hidden = len(lines) - shown
        super().__init__("\n".join(lines[:shown] + ([f"... and {hidden} more"] if hidden > 0 else [])))
        self.lines = lines


def whole(word, low, high):
    return word.isascii() and word.isdigit() and low <= int(word) <= high


def real(word, low, high):
    try:
        return math.isfinite(float(word)) and low <= float(word) <= high
    except ValueError:
        return False


def read_header(header, fault):
    """The columns in their order, or nothing."""
    names = [name.strip() for name in header]
    for number, name in enumerate(names):
        if not name:
            fault(1, f"column {number + 1}", "has no name", f"name it, one of {', '.join(COLUMNS)}")
        elif name not in COLUMNS:
            fault(1, name, "is no column of this table", f"the columns are {', '.join(COLUMNS)}")
        elif names.index(name) != number:
            fault(1, name, "is there twice", "keep one of the two columns")
    for name in REQUIRED:
        if name not in names:
            fault(1, name, "this column is missing", f"the first line names the columns: {', '.join(COLUMNS)}")
    return names


def check(fields, line, folder, seen, files, fault):
    """Says what is wrong with a line, and makes its paths those of the caller."""
    name = fields["name"]
    if not name:
        fault(line, "name", "is empty", "each scene needs a name, which becomes its folder")
    elif not re.fullmatch(NAME, name):
        fault(line, "name", f'"{name}" is no name of a folder',
              "use up to 100 letters, digits, dots, hyphens and underscores, and begin with a letter or digit")
    elif name.lower() in seen:  # in lower case: for some file systems Fox and fox are one folder
        fault(line, "name", f'"{name}" is the name of line {seen[name.lower()]} too', "give each scene its own")
    else:
        seen[name.lower()] = line
    for column, there, what in (("capture", os.path.isdir, "folder"), ("key", os.path.isfile, "file")):
        if not fields[column]:
            continue
        fields[column] = os.path.normpath(os.path.join(folder, fields[column]))
        if files and not there(fields[column]):
            fault(line, column, f"there is no {what} {fields[column]}",
                  "a path that begins with no / is looked for from the table's folder"
                  + ("; leave the field empty for a new key" if column == "key" else ""))
    if not fields["capture"]:
        fault(line, "capture", "is empty", "name the folder of the photographs and their cameras")
    for column, valid, low, high, kind in (("seed", whole, 0, 2**64 - 1, "whole number"),
                                           ("iterations", whole, 1, 10**9, "whole number"),
                                           ("downscale", real, 1, 64, "number")):
        if fields[column] and not valid(fields[column], low, high):
            fault(line, column, f'"{fields[column]}" is no {kind} from {low} to {high}',
                  "write one, or leave the field empty for the program's choice")
    try:
        fields["options"] = shlex.split(fields["options"])
    except ValueError as error:
        fault(line, "options", f"cannot be taken apart: {error}", "quote as a shell does, or leave the field empty")
        return
    for word in fields["options"]:
        option = word.split("=", 1)[0]
        if option in GIVEN:
            fault(line, "options", f"{option} cannot be given here", f"leave it out: {GIVEN[option]}")


def read_table(path, files=True):
    """The scenes of a table in its order; raises Faults. `files`: captures and keys have to be there."""
    faults = []
    name = str(path)

    def fault(line, field, problem, remedy):
        where = f"{name}, line {line}: {field}" if line else name
        faults.append(f"{where}: {problem}; {remedy}")

    ending = os.path.splitext(name)[1].lower()
    if ending not in SEPARATORS:
        fault(0, "", "is neither .tsv nor .csv", "name the table so that its ending says what parts its fields")
        raise Faults(faults)
    rows = []
    try:
        with open(name, encoding="utf-8-sig", newline="") as lines:
            reader = csv.reader(lines, delimiter=SEPARATORS[ending], strict=True)
            for row in reader:
                rows.append((reader.line_num, [field.strip() for field in row]))
    except OSError as error:
        fault(0, "", f"cannot be read: {error.strerror}", "name a table that is there, and that you may read")
        raise Faults(faults) from None
    except UnicodeDecodeError as error:
        fault(0, "", f"is no text in UTF-8: {error.reason}", "save it as UTF-8")
        raise Faults(faults) from None
    except csv.Error as error:
        fault(reader.line_num, "the line", f"cannot be taken apart: {error}", "close the quotes of its fields")
        raise Faults(faults) from None
    rows = [(line, row) for line, row in rows if any(row)]
    columns = read_header(rows[0][1] if rows else [], fault)
    if faults:  # without its columns no line can be read
        raise Faults(faults)
    scenes, seen = [], {}
    for line, row in rows[1:]:
        if len(row) > len(columns):
            fault(line, "the line", f"has {len(row)} fields, and the first line names {len(columns)} columns",
                  "take the fields away that are too many, or quote those that hold the separator")
            continue
        fields = dict.fromkeys(COLUMNS, "")
        fields.update(zip(columns, row))
        check(fields, line, os.path.dirname(name), seen, files, fault)
        scenes.append(Scene(line, fields))
    if not scenes and not faults:
        fault(rows[0][0], "name", "no scene follows this line", "write a line for each capture")
    if faults:
        raise Faults(faults)
    return scenes


def main(words):
    if len(words) != 1:
        print("captures: give one table: captures.py TABLE", file=sys.stderr)
        return 2
    try:
        print(f"{words[0]}: {len(read_table(words[0]))} scenes")
    except Faults as faults:
        print(faults, file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
