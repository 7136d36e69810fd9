# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Put maps of several sequences into docs/results/map.md: python -m benchmarks.map_page FOLDER...

Folders are of the kind "map" ("adversarial-lcd map RESULTS... --output FOLDER") and are called by
their names on the page. What is concluded from the tables stands above them and is left alone.
"""

from pathlib import Path
import sys

from adversarial_lcd_ros.evaluation.kinds import open_results
from adversarial_lcd_ros.evaluation.maps.overview import page_of

PAGE = Path(__file__).parent.parent / 'docs' / 'results' / 'map.md'
BEGIN = '<!-- tables: python -m benchmarks.map_page -->'
END = '<!-- end of tables -->'


def main(folders):
    found = {path.name: open_results(path) for path in map(Path, folders)}
    others = [name for name, (kind, _) in found.items() if kind.name != 'map']
    if others or not found:
        raise SystemExit(f'expected folders of maps, found others: {", ".join(others) or "none"}')
    page = PAGE.read_text(encoding='utf-8')
    before, _, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise SystemExit(f'{PAGE} has no lines {BEGIN} and {END} to put the tables between')
    tables = page_of({name: results.summary for name, (_, results) in found.items()},
                     {name: results.environment for name, (_, results) in found.items()})
    PAGE.write_text(f'{before}{BEGIN}\n\n{tables}\n{END}{after}', encoding='utf-8')


if __name__ == '__main__':
    main(sys.argv[1:])
