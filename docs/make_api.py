"""Write docs/api.md: the public names of aerojax and the acts, from the docstrings in their sources.

    make docs

Sources are read and not imported, so that annotations stand on the page as they were written.
"""

from __future__ import annotations

import ast
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = Path(__file__).with_name("api.md")
sys.path.insert(0, str(ROOT))

from aerojax import _HOMES  # noqa: E402
from experiments._launch.console import acts  # noqa: E402

HEAD = """# aerojax from Python

Made from the docstrings by `make docs`; do not edit. `import aerojax` offers these names, for example
`aerojax.read_capture(folder)`. Conventions of axes, units and colours are in the README.
"""
_SECTION = re.compile(r"^(Args|Returns|Raises|Yields):$")
_FIELD = re.compile(r"^[A-Za-z]\w*(, \w+)*: ")
"""Such as `rgb, ids: what to read`, as docstrings of dataclasses have it."""
_Definition = ast.ClassDef | ast.FunctionDef


def page() -> str:
    """The whole page."""
    parts = [HEAD]
    for module, names in _HOMES.items():
        tree = ast.parse((ROOT / f"{module.replace('.', '/')}.py").read_text(encoding="utf-8"))
        parts += [f"## {module}", ast.get_docstring(tree) or ""]
        parts += [text for name in names for text in described(name, tree)]
    rows = [f"| `{name}` | {about} |" for name, about in acts().items()]
    parts += ["## Acts", "`aerojax ACT [key=value ...]`; `aerojax ACT --help` shows the configuration."]
    parts += ["\n".join(["| act | what it does |", "|---|---|", *rows])]
    return "\n\n".join(part.strip("\n") for part in parts if part) + "\n"


def described(name: str, tree: ast.Module) -> list[str]:
    """Heading, code and text of one public name."""
    for node, after in zip(tree.body, [*tree.body[1:], None], strict=True):
        if isinstance(node, _Definition) and node.name == name:
            methods = [member for member in node.body if isinstance(member, ast.FunctionDef) and is_public(member)]
            inner = methods if isinstance(node, ast.ClassDef) else []
            texts = [f"- {block(signature(m), fenced=False)}: {first_line(m)}" for m in inner]
            return [f"### {name}", block(signature(node)), prose(ast.get_docstring(node) or ""), "\n".join(texts)]
        if isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == [name]:
            said = after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else ""
            return [f"### {name}", block(ast.unparse(node)), str(said)]
    raise ValueError(f"{name} is not defined where aerojax._HOMES says")


def is_public(method: ast.FunctionDef) -> bool:
    """Whether a method belongs on the page."""
    return not method.name.startswith("_") or method.name == "__call__"


def first_line(node: _Definition) -> str:
    """The sentence that a docstring begins with."""
    return (ast.get_docstring(node) or "").partition("\n")[0]


def signature(node: _Definition) -> str:
    """A definition without its body; of a class its fields."""
    if isinstance(node, ast.FunctionDef):
        returns = f" -> {ast.unparse(node.returns)}" if node.returns else ""
        return f"{node.name}({ast.unparse(node.args)}){returns}"
    fields = [f"    {ast.unparse(member)}" for member in node.body if isinstance(member, ast.AnnAssign)]
    return "\n".join([f"class {node.name}", *fields])


def block(code: str, *, fenced: bool = True) -> str:
    """Code as Markdown has it."""
    return f"```python\n{code}\n```" if fenced else f"`{code}`"


def prose(docstring: str) -> str:
    """A docstring as Markdown: sections and descriptions of fields become lists, other indented text stays code."""
    lines, section, item = [], False, False
    for line in docstring.splitlines():
        heading, inside = _SECTION.match(line), line.startswith("    ")
        section = bool(heading) or (section and (not line or inside))
        begins = re.match(r"    \S", line) if section else _FIELD.match(line)
        item = bool(begins) or (item and inside)
        if heading:
            lines += [f"**{heading[1]}**", ""]
        elif begins:
            lines.append(f"- {line.strip()}")
        else:
            lines.append(f"  {line.strip()}" if item and line else line)
    return "\n".join(lines)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE)
