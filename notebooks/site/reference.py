"""The reference: a page of every room, as pdoc makes it of docstrings."""

import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import pdoc
import pdoc.doc
import pdoc.extract
import pdoc.render

from . import mathematics

# modules that hold what a user needs and that their rooms do not hand on
_BESIDE = (
    "jaxsub.discrepancy.explain.next_run",
    "jaxsub.filter.ekf",
    "jaxsub.information.design_limits",
    "jaxsub.recording.logs",
    "jaxsub.recording.runs",
    "jaxsub.report.drawing",
    "jaxsub.simulation.manoeuvres",
    "jaxsub.vehicle.catalogue",
)
_NAME = re.compile(r"`(jaxsub(?:\.\w+)+)(?:\(\))?`")


class Reference(NamedTuple):
    """Documented modules by name, and the address of everything in them, relative to the site's root."""

    modules: dict[str, pdoc.doc.Module]
    addresses: dict[str, str]

    @classmethod
    def of(cls, package: str) -> "Reference":
        """Of a package as it is installed here."""
        path = importlib.import_module(package).__path__
        # imported before pdoc does, which forbids modules to ask the machine what it is
        for found in pkgutil.walk_packages(path, f"{package}."):
            module = importlib.import_module(found.name)
            # pdoc lists what is in a module already, and a package may import its names at their first use
            for name in getattr(module, "__all__", ()):
                getattr(module, name)
        # the package lists names in `__all__`, of which pdoc takes it that nothing else is public
        rooms = [found.name for found in pkgutil.iter_modules(path, f"{package}.") if "._" not in found.name]
        listed = pdoc.extract.walk_specs([package, *rooms, *_BESIDE])
        modules = {name: pdoc.doc.Module.from_name(name) for name in listed}
        addresses = {}
        for name, module in modules.items():
            page = f"api/{name.replace('.', '/')}.html"
            addresses[name] = page
            for member in _members(module):
                addresses.setdefault(f"{name}.{member.qualname}", f"{page}#{member.qualname}")
        return cls(modules, addresses)

    def undocumented(self) -> list[str]:
        """Public modules, classes and functions of ours without a docstring."""
        found = {f"{name}: has no docstring": None for name, module in self.modules.items() if not module.docstring}
        for module in self.modules.values():
            for member in _members(module):
                described = isinstance(member, pdoc.doc.Class | pdoc.doc.Function) and member.name != "__init__"
                # what pdoc shows instead of a docstring that is missing is that of None
                if described and not getattr(member.obj, "__doc__", None) and member.taken_from[0].startswith("jaxsub"):
                    found[f"{'.'.join(member.taken_from)}: has no docstring"] = None
        return list(found)

    def write(self, folder: Path) -> list[str]:
        """Write a page of each module; the names in docstrings that stand for nothing."""
        pdoc.render.configure(docformat="markdown", math=False, template_directory=Path(__file__).parent / "templates")
        for name, module in self.modules.items():
            path = folder / f"{name.replace('.', '/')}.html"
            path.parent.mkdir(parents=True, exist_ok=True)
            made = pdoc.render.html_module(module, self.modules)
            path.write_text(mathematics.in_html(made), encoding="utf-8")
        (folder / "search.js").write_text(pdoc.render.search_index(self.modules), encoding="utf-8")
        texts = {name: module.docstring for name, module in self.modules.items()}
        texts |= {f"{n}.{m.qualname}": m.docstring for n, module in self.modules.items() for m in _members(module)}
        return [f"{name}: {fault}" for name, text in texts.items() for _, fault in self.names(text) if fault]

    def names(self, text: str) -> Iterator[tuple[str, str]]:
        """Every `jaxsub.name` in a text, and what is wrong with it, if anything."""
        for name in _NAME.findall(text):
            yield name, "" if name in self.addresses else self._fault(name)

    def _fault(self, name: str) -> str:
        """What is wrong with a name that has no address."""
        if not _exists(name):
            return f"`{name}` is nothing"
        room = ".".join(name.split(".")[:2])
        return "" if room in self.modules else f"`{room}` has no page"

    def linked(self, markdown: str, up: str) -> str:
        """Markdown whose `jaxsub.name`s are links to where they are described; `up` leads to the site's root."""

        def link(match: re.Match[str]) -> str:
            address = self.addresses.get(match[1])
            return f"[{match[0]}]({up}{address})" if address else match[0]

        return _NAME.sub(link, markdown)


def _members(of: pdoc.doc.Module | pdoc.doc.Class) -> Iterator[pdoc.doc.Doc]:
    for member in of.own_members if isinstance(of, pdoc.doc.Class) else of.members.values():
        if isinstance(member, pdoc.doc.Module) or (member.name.startswith("_") and member.name != "__init__"):
            continue
        yield member
        if isinstance(member, pdoc.doc.Class):
            yield from _members(member)


def _exists(name: str) -> bool:
    """Whether a name leads to something that has no page, such as a private module."""
    parts = name.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            found = __import__(".".join(parts[:cut]), fromlist=["_"])
        except ImportError:
            continue
        for part in parts[cut:]:
            if not hasattr(found, part):
                return False
            found = inspect.getattr_static(found, part)
        return True
    return False
