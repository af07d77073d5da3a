#!/usr/bin/env python3
"""Checks that no function has more than six parameters, in the sources alone: nothing is built.

    check_parameters.py [ROOT]    prints one line for each fault; exit status 1 if there is one

It reads C++ (functions, constructors, lambdas), the shaders in it, and Python, where parameters that must be named in calls do
not count. C++ is read as clang-format leaves it: `a & b` is an expression and `A& b` a parameter.
"""
import ast
import pathlib
import re
import sys

LIMIT = 6
FOLDERS = ("stream", "preprocess", "render", "tools", "tests", "bench")

# A raw string is read as code if it holds a shader's function, and is left out otherwise.
SHADER = re.compile(r"\b(void|float|u?int|bool|[iu]?vec[234])\s+\w+\s*\([^)]*\)\s*\{")
SKIPPED = re.compile(r'//[^\n]*|/\*.*?\*/|R"(?P<mark>[^\s()\\]*)\((?P<raw>.*?)\)(?P=mark)"|"(?:\\.|[^"\\\n])*"|'
                     r"'(?<![0-9a-fA-F]')(?:\\.|[^'\\\n])+'", re.S)
DIRECTIVE = re.compile(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.M)
# A token, and whether white space precedes it.
TOKEN = re.compile(r"(\s*)(\w+|::|->|\.\.\.|&&|\|\||<=|>=|==|!=|.)", re.S)

BUILT_IN = {"void", "bool", "char", "short", "int", "long", "unsigned", "signed", "float", "double", "auto", "const",
            "volatile", "struct", "class", "typename"}
# In an expression these may stand before a name.
OPERATORS = {"new", "delete", "sizeof", "return", "throw", "co_await", "co_yield", "not", "and", "or", "case", "else"}
STATEMENTS = {"for", "if", "while", "switch", "catch"}
CLOSING = {"(": ")", "[": "]", "{": "}"}


def blank(text):
    return re.sub(r"[^\n]", " ", text)


def without_text(source):
    """The code alone, of the same length: comments, strings and directives are blank."""
    def replaced(match):
        raw = match["raw"]
        if raw is None or not SHADER.search(raw):
            return blank(match[0])
        begin = match.start("raw") - match.start()
        inner = re.sub(r"//[^\n]*", lambda comment: blank(comment[0]), raw)
        return blank(match[0][:begin]) + inner + blank(match[0][begin + len(raw):])
    return DIRECTIVE.sub(lambda match: blank(match[0]), SKIPPED.sub(replaced, source))


def closing_of(tokens, opening):
    depth = 0
    for n in range(opening, len(tokens)):
        if tokens[n][1] in CLOSING:
            depth += 1
        elif tokens[n][1] in CLOSING.values():
            depth -= 1
            if depth == 0:
                return n
    return None


def is_parameter(item):
    """Whether these tokens, without what is in brackets, declare a parameter; false for an expression."""
    if not item or item[0][1] in OPERATORS:
        return False
    if item[0][1] in BUILT_IN:
        return len(item) > 1 or item[0][1] != "const"
    for (space, token), (next_space, following) in zip(item, item[1:]):
        if token == "=":
            break
        name = re.match(r"[^\W\d]\w*$", token)
        # `Type name` and `Type<...> name`
        if (name or token == ">") and re.match(r"[^\W\d]", following) and next_space and token not in OPERATORS \
                and (name or item[1][1] != ">"):
            return True
        # `Type& name`
        if token in ("&", "*", "&&") and not space and re.match(r"[^\W\d]", following) and next_space:
            return True
    return False


def items_of(tokens):
    """What stands between the commas, without the tokens in brackets and in the arguments of templates."""
    items, item, depth, angles = [], [], 0, 0
    for n, (space, token) in enumerate(tokens):
        if token in CLOSING:
            depth += 1
        elif token in CLOSING.values():
            depth -= 1
        elif depth:
            continue
        # `Type<` has no space before it, `a < b` has.
        elif token == "<" and not space:
            angles += 1
            continue
        elif token == ">" and angles:
            angles -= 1
            if not angles:
                item.append((space, token))
            continue
        elif token == "," and not angles:
            items.append(item)
            item = []
            continue
        elif not angles:
            item.append((space, token))
    return items + [item]


def functions_of(source):
    """(line, name, parameters) of every list of parameters in a C++ source."""
    code = without_text(source)
    tokens, lines, line = [], [], 1
    for space, token in TOKEN.findall(code):
        line += space.count("\n")
        if not token.isspace():
            tokens.append((space, token))
            lines.append(line)
    found = []
    for n, (_, token) in enumerate(tokens):
        if token != "(" or n == 0 or not re.match(r"[\w\]>]", tokens[n - 1][1]) or tokens[n - 1][1] in STATEMENTS:
            continue
        end = closing_of(tokens, n)
        if end is None:
            continue
        items = items_of(tokens[n + 1:end])
        if any(is_parameter(item) for item in items):
            name = tokens[n - 1][1]
            found.append((lines[n], "a lambda" if name == "]" else name, len(items)))
    return found


def python_functions_of(source):
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            names = [one.arg for one in node.args.posonlyargs + node.args.args]
            count = len(names) - (names[:1] in (["self"], ["cls"]))
            yield node.lineno, getattr(node, "name", "a lambda"), count


def check(root):
    """The number of functions, and the faults."""
    total, faults = 0, []
    for top in FOLDERS:
        for path in sorted((root / top).rglob("*")):
            if path.suffix not in (".h", ".cpp", ".py"):
                continue
            reader = python_functions_of if path.suffix == ".py" else functions_of
            for line, name, count in reader(path.read_text()):
                total += 1
                if count > LIMIT:
                    faults.append(f"{path.relative_to(root).as_posix()}:{line}: {name} has {count} parameters; "
                                  f"group them, there may be {LIMIT}")
    return total, faults


def main():
    root = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2]
    total, faults = check(root)
    for fault in faults:
        print(fault)
    if not total:
        print(f"{root}: there are no sources")
        return 1
    print(f"{total} functions, {len(faults)} with more than {LIMIT} parameters")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
