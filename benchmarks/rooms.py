"""
How large the rooms of the package are, before and now: python benchmarks/rooms.py COMMIT.

A room is a folder of the package, a sub-folder of evaluation one of its own; "loose" are the
modules beside them. Prints a table in Markdown.
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


def git(*arguments):
    return subprocess.run(['git', *arguments], check=True, capture_output=True, text=True).stdout


def main():
    counts = [rooms(commit) for commit in (sys.argv[1], 'HEAD')]
    print(f'| room | modules at {sys.argv[1]} | lines | modules now | lines |\n'
          '|---|---|---|---|---|')
    for room in sorted({room for modules, _ in counts for room in modules}):
        print(f'| {room} |', ' | '.join(f'{modules[room] or "-"} | {lines[room] or "-"}'
                                        for modules, lines in counts), '|')
    for name, line in (('in all', lambda modules, lines: (sum(modules.values()),
                                                          f'{sum(lines.values())}')),
                       ('largest room', largest)):
        cells = [cell for modules, lines in counts for cell in line(modules, lines)]
        print(f'| {name} |', ' | '.join(map(str, cells)), '|')


def largest(modules, lines):
    room = max(lines, key=lines.get)
    return room, f'{100 * lines[room] / sum(lines.values()):.0f} %'


if __name__ == '__main__':
    main()
