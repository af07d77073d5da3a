#!/usr/bin/env python3
"""Checks that documenting comments do not begin with a fragment, in the sources alone: nothing is built.

    check_comments.py [ROOT]    prints one line for each fault; exit status 1 if there is one

A documenting comment is a file's head, or the lines above something that a namespace or a class declares. Its reader has
only the declaration beside it, so that its first sentence names its subject: "The faces of a block", not "Of a block".
Noun phrases are sentences here ("Number of splats"), as are verbs without a subject ("Reads a brick"). A first
sentence ends at a full stop, a colon or a semicolon, and is a fragment if it begins with

  a word of FRAGMENTS: a preposition, conjunction, relative or pronoun, which goes on with something that was not said
  a small letter, unless the word is a name: of code (`quoted`, snake_case, camelCase, call(), a::b, one letter, any of the
  declaration's), a label (out:), a file's (manifest.json) or one of PROGRAMS

Comments within functions, tables and comments that end a line of code are not looked at. C++ is read as clang-format leaves it.

No sentence of any comment on lines of its own begins with "Of", also within functions: the subject of "Of a series, three steps
are kept" comes late or never. "In a series three steps are kept" is read once. Shaders in raw strings are not looked at.
"""
import pathlib
import re
import sys

from check_parameters import FOLDERS, without_text

FRAGMENTS = set("Across After Against Along Also And Around As At Because Before Behind Below Beside Besides Between Beyond But By During "
                "Else For From Given If In Inside Into It Its Kept Like Likewise None Nor Not Noted Of On Once Or Outside Over Past Per "
                "Same Seen Since So Such Taken Than That Their Them Then They Those Through Too Towards Under Unless Until What When "
                "Where Which While Whose With Within Without".split())
PROGRAMS = set("clang false ffmpeg gcc glibc libcgns libjpeg llvmpipe nullopt nullptr true xdotool zlib zstd".split())

RAW = re.compile(r'R"([^\s()\\]*)\(.*?\)\1"', re.S)
INVERTED = re.compile(r"(?:^|(?<=[.:;]\s))Of\s[^.:;]*[.:;]?")
COMMENT = re.compile(r"\s*///?(?:\s(.*))?$")
NAME = re.compile(r"`|\w[\w.]*[_A-Z0-9(\[]|\w+(?::|\.\w)|.(?!\w)")
TABLE = re.compile(r"\S+(?:  | \|)")
PARTS = re.compile("([{};])")
# What opens a brace after which there are declarations again.
SCOPE = re.compile(r"(?:^|[\s>])(?:class|struct|enum|union|namespace|extern)\b[^;{}()=]*(?:\([^()]*\)[^;{}()=]*)?$")


def is_fragment(sentence, declaration=""):
    """Whether the first sentence of the comment above the line `declaration` is a fragment."""
    word = re.match(r"[A-Za-z]*", sentence)[0]
    if word[:1].islower():
        return not (NAME.match(sentence) or TABLE.match(sentence) or word in PROGRAMS or re.search(rf"\b{word}\b", declaration))
    return word in FRAGMENTS


def begin_declarations(code):
    """[line] whether what begins there is declared by a namespace or a class. `code`: without comments and strings."""
    opened, head, found = [], "", []
    for line in code.split("\n"):
        found.append(all(opened) and not head.strip().endswith((",", "(", "=")))
        if line.lstrip().startswith("#"):
            continue
        *parts, rest = PARTS.split(line)
        for text, end in zip(parts[::2], parts[1::2]):
            if end == "{":
                opened.append(bool(SCOPE.search(head + text)))
            elif end == "}" and opened:
                opened.pop()
            head = ""
        head += rest + " "
    return found


def comments(lines):
    """(first line, line after it, text) of each comment on lines of its own, from 0."""
    begin = 0
    while begin < len(lines):
        end = begin
        while end < len(lines) and COMMENT.match(lines[end]):
            end += 1
        # A comment that ends a line of code goes on below itself.
        goes_on = begin > 0 and lines[begin - 1].find("//") == lines[begin].find("//") > 0
        if end > begin and not goes_on:
            yield begin, end, " ".join(COMMENT.match(line)[1] or "" for line in lines[begin:end]).strip()
        begin = max(end, begin + 1)


def first_sentences(source):
    """(line, first sentence, line of code that follows) of each documenting comment."""
    lines = source.split("\n")
    declares = begin_declarations(without_text(source))
    for begin, end, text in comments(lines):
        if declares[begin]:
            yield begin + 1, re.split(r"(?<=[.:;])\s", text)[0], lines[end] if end < len(lines) else ""


def inverted_sentences(source):
    """(line of the comment, sentence) of each sentence that begins with "Of", in comments of C++."""
    without_shaders = RAW.sub(lambda match: "\n" * match[0].count("\n"), source)
    for begin, _, text in comments(without_shaders.split("\n")):
        for match in INVERTED.finditer(text):
            yield begin + 1, match[0]


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2]
    checked = faults = 0
    for top in FOLDERS:
        for path in sorted((root / top).rglob("*")):
            if path.suffix not in (".h", ".cpp"):
                continue
            source, name = path.read_text(), path.relative_to(root).as_posix()
            for line, sentence, declaration in first_sentences(source):
                checked += 1
                if is_fragment(sentence, declaration):
                    faults += 1
                    print(f'{name}:{line}: "{sentence}" is a fragment; name its subject')
            for line, sentence in inverted_sentences(source):
                faults += 1
                print(f'{name}:{line}: "{sentence}" begins with "Of"; begin with its subject')
    if checked == 0:
        print(f"{root}: there are no sources")
        return 1
    print(f"{checked} comments, {faults} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
