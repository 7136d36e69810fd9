# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Errors that a user can act on: what was found, what was expected, what to do."""

from collections.abc import Iterable
import difflib


def with_suggestions(unknown: Iterable[object], known: Iterable[str]) -> str:
    """Return names that are not known, each with the known one that it looks like."""
    names = list(known)
    words = []
    for name in map(str, unknown):
        # Cut short, or else misspelt.
        begun = [each for each in names if each.startswith(name)] if name.strip('-') else []
        close = begun[:1] or difflib.get_close_matches(name, names, 1)
        words.append(f'{name} (did you mean {close[0]}?)' if close else name)
    return ', '.join(words)


class AdversarialLcdError(Exception):
    """
    Base of every error that this package raises on purpose.

    Attributes
    ----------
    cause : str
        One stable word or two, under which a node counts what it refuses; see docs/nodes.md.

    """

    cause = 'other'

    def __init__(self, *what: object, cause: str = '') -> None:
        super().__init__(*what)
        if cause:
            self.cause = cause


class ConfigError(AdversarialLcdError):
    """A setting is unknown, of the wrong type, or out of its range."""


class FileError(AdversarialLcdError):
    """A file that cannot be read or written, is too large or too deep, or not of its form."""


class GraphError(AdversarialLcdError):
    """Arrays that do not form a valid multi-tier graph."""

    cause = 'graph'


class CodecError(AdversarialLcdError):
    """A payload that is not what its schema says."""

    cause = 'unreadable'


class SequenceError(AdversarialLcdError):
    """A bag, folder or ground truth that is missing, truncated, empty or out of order."""

    cause = 'sequence'


class ModelError(AdversarialLcdError):
    """A vocabulary, object model or target model that is missing or of the wrong form."""

    cause = 'model'


class BudgetError(AdversarialLcdError):
    """An attack asked for more queries or edits than it was granted."""


class EvaluationError(AdversarialLcdError):
    """An evaluation that cannot give an honest number: lost frames, no labels, no pairs."""
