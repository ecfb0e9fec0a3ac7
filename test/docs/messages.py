# Copyright (c) 2026, the view_servo authors
# SPDX-License-Identifier: BSD-3-Clause
"""The texts in the sources that people may read as messages of something wrong."""
import collections
import re

Message = collections.namedtuple("Message", "place parts")  # place: file:line, for people; parts: what is fixed in it

LONGEST = 1000  # what stands between two parts of a message

LITERAL = re.compile(r'"(?:\\.|[^"\\\n])*"')
LITERAL_OR_CHARACTER = re.compile(r'"(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])\'')
LITERAL_OR_COMMENT = re.compile(r'("(?:\\.|[^"\\\n])*"|\'(?:\\.|[^\'\\\n])+\')|//[^\n]*|/\*.*?\*/', re.DOTALL)

# Functions whose literals are no messages of something wrong.
NO_MESSAGES = re.compile(
    r"ROS_(INFO|DEBUG)\w*"  # all is well
    r"|text|real|integer|natural|boolean|path|choice<[\w:]+>|\w+Parameter"  # the meanings of parameters
    r"|line|line\.\w+"  # the meanings of options
    r"|status\.add"  # names of what diagnostics report
    r"|guarded|\w+\.runLocked|runLocked|worker_"  # what was done, before the reason why it failed
    r"|std::logic_error|static_assert")  # a mistake of the program's


def words_of(text):
    return re.findall(r"[A-Za-z]{2,}", text)


def without_comments(text):
    """The same, as long, with blanks for comments."""
    return LITERAL_OR_COMMENT.sub(lambda match: match.group(1) or re.sub(r"[^\n]", " ", match.group(0)), text)


def with_blank_literals(text):
    """The same, as long, without what is between quotation marks."""
    return LITERAL_OR_CHARACTER.sub(
        lambda match: match.group(0)[0] + " " * (len(match.group(0)) - 2) + match.group(0)[0], text)


def callee_of(code, position):
    """What is called with the literal at this position as an argument, "" when nothing is."""
    depth = 0
    while position > 0:
        position -= 1
        char = code[position]
        if char in ")]}":
            depth += 1
        elif char in "([{":
            depth -= 1
            if depth < 0:
                if char != "(":
                    return ""
                return re.search(r"[\w:.<>]*$", code[:position].rstrip()).group(0)
        elif char == ";" and depth == 0:
            return ""
    return ""


def is_joined(between):
    """Whether two literals with this code between them are parts of one text."""
    if len(between) > LONGEST:
        return False
    last = None
    while last != between:
        last, between = between, re.sub(r"\([^()]*\)|\[[^][]*\]", "", between)
    if re.search(r"[;{}?,]|(?<!:):(?!:)|\b(return|throw)\b", between):
        return False
    return not between.strip() or re.search(r"\+|<<", between) is not None


def literals_of(text):
    """All texts, as the compiler joins them, with the compiler's escapes resolved where they matter."""
    return [part for _, parts in _expressions(text) for part in parts]


def _expressions(text):
    """(position, texts) of each expression that puts texts together; `text` may have comments."""
    text = without_comments(text)
    code = with_blank_literals(text)
    found = []
    end = None
    for match in LITERAL.finditer(text):
        line = text.rfind("\n", 0, match.start()) + 1
        if text[line:].lstrip().startswith("#include"):
            continue
        literal = match.group(0)[1:-1].replace('\\"', '"').replace("\\n", " ")
        between = code[end:match.start()] if end is not None else ";"
        end = match.end()
        if not between.strip() and found:  # the compiler makes one literal of them
            found[-1][1][-1] += literal
        elif is_joined(between):
            found[-1][1].append(literal)
        else:
            found.append((match.start(), [literal]))
    return found


def messages_of(path, text):
    """All texts of two words and more, as they are put together in one expression."""
    code = with_blank_literals(without_comments(text))
    messages = []
    for position, parts in _expressions(text):
        long_enough = any(" " in part.strip() and len(words_of(part)) >= 2 for part in parts)
        if long_enough and not NO_MESSAGES.fullmatch(callee_of(code, position)):
            messages.append(Message("%s:%d" % (path, text.count("\n", 0, position) + 1), parts))
    return messages
