# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""What the documents say that can be tried: commands, names in backticks, tables, links and sources."""
import collections
import glob
import os
import re

ROOT = os.path.realpath(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", ".."))

Command = collections.namedtuple("Command", "place text")  # place: file:line, for people
Name = collections.namedtuple("Name", "place text")
Source = collections.namedtuple("Source", "place language text")
Row = collections.namedtuple("Row", "place section head cells")


def documents():
    """The documents that are tried, in the order in which they are read: commands use what others before them have saved."""
    first = ["README.md", "docs/bring_up.md", "docs/nodes.md"]
    found = {os.path.relpath(path, ROOT) for path in glob.glob(os.path.join(ROOT, "docs", "**", "*.md"), recursive=True)}
    return first + sorted(found - set(first)) + ["CONTRIBUTING.md", "config/worlds/README.md"]


def anchor_of(heading):
    """What a link says after # to lead to a heading, as GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


class Document:
    """One file, taken apart."""

    def __init__(self, path):
        self.path = path
        self.commands = []   # lines of indented blocks
        self.names = []      # what stands in backticks within the text
        self.sources = []    # fenced blocks
        self.rows = []       # of tables
        self.links = []
        self.anchors = set()
        with open(os.path.join(ROOT, path), encoding="utf-8") as file:
            text = file.read()
        self.line_count = text.count("\n")
        self._read(text.split("\n"))

    def _read(self, lines):
        section = ""
        head = None
        prose = []           # paragraphs: [(line number, text)], since code and links may be broken by a line's end
        number = 0
        while number < len(lines):
            line = lines[number]
            place = "%s:%d" % (self.path, number + 1)
            if line.startswith("```"):
                end = lines.index("```", number + 1)
                self.sources.append(Source(place, line[3:].strip(), "\n".join(lines[number + 1:end])))
                number = end + 1
                continue
            if line.startswith("    ") and not prose:
                end = number
                while end < len(lines) and (lines[end].startswith("    ") or not lines[end]):
                    end += 1
                self._block(number, lines[number:end])
                number = end
                continue
            if line.startswith("#"):
                section = line.lstrip("# ")
                self.anchors.add(anchor_of(section))
            if line.startswith("|"):
                cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
                if head is None:
                    head = cells
                elif not set(line) <= set("|- :"):
                    self.rows.append(Row(place, section, head, cells))
                self._text(place, line)
            else:
                head = None
                if line:
                    prose.append((place, line.strip()))
            if not line and prose or line.startswith(("#", "|")) or number + 1 == len(lines):
                if prose:
                    self._text(prose[0][0], " ".join(text for _, text in prose))
                prose = []
            number += 1

    def _block(self, number, lines):
        if lines[0].strip().startswith("@"):
            return  # BibTeX
        for offset, line in enumerate(lines):
            command = re.sub(r"\s+#.*$", "", line).strip()
            if command:
                self.commands.append(Command("%s:%d" % (self.path, number + offset + 1), command))

    def _text(self, place, text):
        for name in re.findall(r"`([^`]+)`", text):
            self.names.append(Name(place, name))
        for link in re.findall(r"\]\(([^)\s]+)\)", text):
            if not re.match(r"[a-z]+://", link):
                self.links.append(Name(place, link))
