# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
How large the rooms of the package are, before and now: python benchmarks/rooms.py COMMIT.

A room is a folder of the package, a sub-folder of evaluation one of its own; "loose" are the
modules beside them. Then the words of the pages, tables included. Prints tables in Markdown.
"""

from collections import Counter
from pathlib import PurePosixPath
import subprocess
import sys

PACKAGE = 'adversarial_lcd_ros'


def rooms(commit):
    """Return modules and lines by room, of a commit."""
    listed = git('ls-tree', '-r', '--name-only', commit, PACKAGE).splitlines()
    modules, lines = Counter(), Counter()
    for path in map(PurePosixPath, listed):
        if path.suffix == '.py' and path.name != '__init__.py':
            room = room_of(path)
            modules[room] += 1
            lines[room] += git('show', f'{commit}:{path}').count('\n')
    return modules, lines


def room_of(path):
    parts = path.parts[1:-1]
    if not parts:
        return 'loose'
    return '/'.join(parts[:2]) if parts[0] == 'evaluation' else parts[0]


def words(commit):
    """Return pages and words of the documentation by folder, of a commit."""
    pages, count = Counter(), Counter()
    for name in git('ls-tree', '-r', '--name-only', commit).splitlines():
        if name.endswith('.md'):
            folder = str(PurePosixPath(name).parent)
            pages[folder] += 1
            count[folder] += len(git('show', f'{commit}:{name}').split())
    return pages, count


def git(*arguments):
    return subprocess.run(['git', *arguments], check=True, capture_output=True, text=True).stdout


def main():
    commits = (sys.argv[1], 'HEAD')
    counts = [rooms(commit) for commit in commits]
    print_table('room', 'modules', 'lines', counts)
    for name, line in (('in all', in_all), ('largest room', largest)):
        print_line(name, (cell for pair in counts for cell in line(*pair)))
    print()
    counts = [words(commit) for commit in commits]
    print_table('pages in', 'pages', 'words', counts)
    print_line('in all', (cell for pair in counts for cell in in_all(*pair)))


def print_table(title, first, second, counts):
    print_line(title, (f'{first} at {sys.argv[1]}', second, f'{first} now', second))
    print('|---|---|---|---|---|')
    for name in sorted({name for pair in counts for name in pair[0]}):
        print_line(name, (column[name] or '-' for pair in counts for column in pair))


def print_line(name, cells):
    print(f'| {name} |', ' | '.join(map(str, cells)), '|')


def in_all(number, size):
    return sum(number.values()), sum(size.values())


def largest(modules, lines):
    room = max(lines, key=lines.get)
    return room, f'{100 * lines[room] / sum(lines.values()):.0f} %'


if __name__ == '__main__':
    main()
