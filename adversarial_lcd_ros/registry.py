# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What can be chosen by name: targets, defences, searches, perturbations and surrogates.

A table is one line an entry, name to ``module:Class``, and nothing is imported before it is asked
for: settings know the names, and starting up costs no class. One of the user's own is named as
``package.module:Class``, or by an entry point of an installed package, in the group that the
table says.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from importlib import import_module
from importlib.metadata import entry_points
from inspect import isabstract
from typing import Any

from adversarial_lcd_ros.errors import ConfigError, with_suggestions

_PACKAGE = 'adversarial_lcd_ros'
NONE = 'none'


@dataclass(frozen=True, eq=False)
class Table:
    """
    Classes of one kind by name.

    Attributes
    ----------
    noun : str
        What an entry is, in errors.
    base : str
        ``module:Class`` that all entries are subclasses of, below this package.
    entries : mapping of str to str
        Name to ``module:Class``, below the package of the base; '' for one that is nothing.
    group : str
        Of entry points; '': a table that is closed.
    moved : mapping of str to str
        Names that are looked for here, and what to write instead.

    """

    noun: str
    base: str
    entries: Mapping[str, str]
    group: str = ''
    moved: Mapping[str, str] = field(default_factory=dict)

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names that ship, in their order."""
        return iter(self.entries)

    def __contains__(self, name: object) -> bool:
        """Tell whether a name ships."""
        return name in self.entries

    def __getitem__(self, name: str) -> type[Any]:
        """Return what ``find`` does."""
        return self.find(name)

    def __str__(self) -> str:
        """Return what may be chosen, in a few words."""
        return ', '.join(self.entries) + (', package.module:Class' if self.group else '')

    def check(self, name: str) -> None:
        """Raise ConfigError unless there is such an entry; imports none that ships."""
        if name not in self.entries:
            self.find(name)

    def find(self, name: str) -> type[Any]:
        """
        Return the class of that name.

        Parameters
        ----------
        name : str
            An entry, ``package.module:Class``, or the name of an entry point.

        Raises
        ------
        ConfigError
            There is no such name, module or class, or it is not of this kind.

        """
        return _find(self, name)

    def look_up(self, name: str) -> type[Any] | None:
        """Return the class of that name; None if there is none, or none any more."""
        try:
            return self.find(name)
        except ConfigError:
            return None

    def _base(self) -> type[Any]:
        found: type[Any] = load(self.noun, f'{_PACKAGE}.{self.base}')
        return found

    def _reference(self, name: str) -> str:
        """Return ``package.module:Class`` of a name."""
        if self.entries.get(name):
            return f'{_PACKAGE}.{self.base.rpartition(".")[0]}.{self.entries[name]}'
        if name in self.entries:
            raise ConfigError(f'{self.noun} {name!r} is none')
        if self.group and ':' in name:
            return name
        there = entry_points(group=f'{_PACKAGE}.{self.group}') if self.group else ()
        for entry in there:
            if entry.name == name:
                return entry.value
        if name in self.moved:
            raise ConfigError(f'{name!r} is no {self.noun}: {self.moved[name]}')
        own = (', or one of your own as package.module:Class' if self.group else '')
        names = [*self.entries, *(entry.name for entry in there)]
        raise ConfigError(f'no {self.noun} {with_suggestions([repr(name)], map(repr, names))}; '
                          f'there are: {", ".join(names)}{own}')


@lru_cache(256)
def _find(table: Table, name: str) -> type[Any]:
    reference = table._reference(name)
    found, base = load(table.noun, reference), table._base()
    if not (isinstance(found, type) and issubclass(found, base)):
        raise ConfigError(f'{table.noun} {reference} is {found!r}: expected a subclass of '
                          f'{base.__module__}.{base.__name__}')
    if isabstract(found):
        missing = ', '.join(sorted(getattr(found, '__abstractmethods__', ())))
        raise ConfigError(f'{table.noun} {reference} lacks {missing}: '
                          f'{base.__module__}.{base.__name__} says what is expected')
    own = vars(found).get('name')
    if not isinstance(own, str) or not own.isidentifier():
        raise ConfigError(f'{table.noun} {reference} has no name of its own: expected a class '
                          'attribute such as name = "mine", letters and underscores')
    return found


def load(noun: str, reference: str) -> Any:
    """Return what ``package.module:Name`` refers to; raises ConfigError."""
    module, _, attribute = reference.partition(':')
    try:
        found = import_module(module)
    except Exception as error:  # a module of the user's own may fail in any way
        raise ConfigError(
            f'{noun} {reference}: module {module!r} cannot be imported '
            f'({type(error).__name__}: {" ".join(str(error).split())}); is its folder on '
            'PYTHONPATH, or its package installed?') from error
    if not hasattr(found, attribute):
        there = [name for name, value in vars(found).items()
                 if isinstance(value, type) and value.__module__ == module]
        raise ConfigError(f'{noun} {reference}: module {module!r} has no class {attribute!r}; '
                          f'there are: {", ".join(there) or "none"}')
    return getattr(found, attribute)


TARGETS = Table('target', 'lcd.targets.base:Target', {
    'wl': 'wl:WlTarget',
    'edges': 'edges:EdgesTarget',
    'anchored': 'anchored:AnchoredTarget',
    'descriptors': 'descriptors:DescriptorsTarget',
    'vbow': 'vbow:VbowTarget',
    'objects': 'objects:ObjectsTarget',
    'wl_exact': 'wl_exact:WlExactTarget',
    'gnn': 'gnn:GnnTarget',
    'symbio': 'symbio:SymbioTarget',
}, 'targets')

DEFENCES = Table('defence', 'lcd.defences.base:Defence', {
    NONE: '',
    'geometric_check': 'geometric_check:GeometricCheck',
    'length_check': 'length_check:LengthCheck',
    'rederive': 'rederive:Rederive',
    'rederive_check': 'rederive:RederiveCheck',
    'nearest_check': 'nearest_check:NearestCheck',
    'common_part': 'common_part:CommonPart',
}, 'defences')

SEARCHES = Table('search', 'attack.search:Search', {
    'stepwise': 'searches.stepwise:Stepwise',
    'recall': 'searches.recall:Recall',
    'grabnel': 'searches.grabnel:Grabnel',
    'move_nodes': 'searches.move_nodes:MoveNodes',
    'replay': 'searches.replay:Replay',
}, 'searches', {'optimum': 'it looks into the detector, and is for recipes of the protocol '
                           '"frames" alone'})

PERTURBATIONS = Table('perturbation', 'attack.perturbations.base:Perturbation', {
    'eigencentrality': 'eigencentrality:Eigencentrality',
    'random_walk': 'random_walk:RandomWalk',
    'shortest_path': 'shortest_path:ShortestPath',
    'random_flip': 'random_flip:RandomFlip',
}, 'perturbations', {name: f'it is a search, write "search: {name}" instead'
                     for name in ('recall', 'optimum')})

SURROGATES = Table('surrogate', 'attack.surrogates.base:Surrogate', {
    'svm_rbf': 'svm_rbf:SvmRbf',
    'svm_linear': 'svm_linear:SvmLinear',
    'svm_poly': 'svm_poly:SvmPoly',
    'naive_bayes': 'naive_bayes:NaiveBayes',
    'svr': 'svr:SupportVectorRegression',
    'ard': 'ard:RelevanceDetermination',
    NONE: '',
}, 'surrogates')

# Attacks of an evaluation that look into the detector, in the place of a search.
YARDSTICKS = Table('yardstick', 'evaluation.frames.optimum:Optimum', {
    'optimum': 'optimum:Optimum',
})
