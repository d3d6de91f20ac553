"""Plug-ins: what other packages add to a registry, found by their entry points and imported when they are named."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Generic, TypeVar

from vvvaltr.controller.core.errors import NotUnderstood, UserError
from vvvaltr.controller.core.spelling import unknown

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Registry(Generic[T]):
    """What can be chosen by name: built in, or added by an installed package.

    Nothing is imported before it is named, and installed packages are searched for names that are not built in only:
    the command line's help waits for neither. A built-in name cannot be replaced.

    Args:
        noun: what the entries are called in a message: ``driver``.
        group: the entry-point group in which a package adds one: ``vvvaltr.drivers``.
        kind: the type of an entry.
        built_in: name to entry, or to where it is, as ``module:attribute``.
    """

    noun: str
    group: str
    kind: type[T]
    built_in: Mapping[str, T | str]

    @property
    def names(self) -> tuple[str, ...]:
        """All names, the built-in ones first."""
        return (*self.built_in, *sorted(entry_points(group=self.group).names - set(self.built_in)))

    def __contains__(self, name: str) -> bool:
        return name in self.built_in or name in entry_points(group=self.group).names

    def named(self, name: str) -> T:
        """Return an entry.

        Raises:
            NotUnderstood: there is none of this name.
            UserError: the package that adds it is broken.
        """
        entry = self.built_in.get(name)
        if isinstance(entry, str):
            return self._load(EntryPoint(name, entry, self.group))
        if entry is not None:
            return entry
        for point in entry_points(group=self.group, name=name):
            return self._load(point)
        raise NotUnderstood(unknown(self.noun, name, self.names))

    def _load(self, point: EntryPoint) -> T:
        package = point.dist.name if point.dist else "vvvaltr"
        described = f"{self.noun} {point.name!r} of the package {package}"
        try:
            entry = point.load()
        except Exception as error:  # whatever a foreign module raises at import is for its author to mend
            raise UserError(
                f"{described} cannot be loaded ({type(error).__name__}: {error}); mend or uninstall the package"
            ) from error
        if not isinstance(entry, self.kind):
            raise UserError(
                f"{described}: {point.value} is a {type(entry).__name__} instead of a {self.kind.__name__}; "
                "mend or uninstall the package"
            )
        return entry
