# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Put the rows of results.json as a table into docs/results: python -m benchmarks.table."""

import json
from pathlib import Path

HERE = Path(__file__).parent
PAGE = HERE.parent / 'docs' / 'results' / 'benchmarks.md'
BEGIN = '<!-- table: python -m benchmarks.table -->'
END = '<!-- end of table -->'


def seconds(value):
    """Return a time with three digits in a unit that suits it."""
    for unit, name in ((1, 's'), (1e-3, 'ms'), (1e-6, 'us')):
        if value >= unit:
            return f'{value / unit:.3g} {name}'
    return f'{value / 1e-9:.3g} ns'


def line(row):
    """Return a row in Markdown."""
    # Rows of earlier releases do not say what their mark is: at or above one it was a ratio.
    is_ratio = row.get('mark_is_ratio', (row['mark'] or 0) >= 1)
    mark = '' if row['mark'] is None else (
        f'{row["mark"]:g} x' if is_ratio else seconds(row['mark']))
    met = {None: '', True: 'yes', False: '**no**'}[row['met']]
    rival = '' if row['rival'] is None else f'{row["rival"]}: {seconds(row["rival_s"])}'
    ratio = '' if row['ratio'] is None else f'{row["ratio"]:.3g}'
    cells = row['name'], row['size'], seconds(row['ours_s']), rival, ratio, mark, met
    return f'| {" | ".join(cells)} |'


def table(rows, machine):
    """Return the table with a line about the machine."""
    about = ', '.join((machine['processor'], f'{machine["cores"]} cores',
                       f'Python {machine["python"]}', machine['time'][:10]))
    return '\n'.join([about, '', '| name | size | ours | rival | ratio | mark | met |',
                      '|---|---|---|---|---|---|---|', *map(line, rows)])


def main():
    rows, machine = (json.loads((HERE / name).read_text(encoding='utf-8'))
                     for name in ('results.json', 'machine.json'))
    page = PAGE.read_text(encoding='utf-8')
    before, _, rest = page.partition(BEGIN)
    _, found, after = rest.partition(END)
    if not found:
        raise SystemExit(f'{PAGE} has no lines {BEGIN} and {END} to put the table between')
    PAGE.write_text(f'{before}{BEGIN}\n\n{table(rows, machine)}\n\n{END}{after}',
                    encoding='utf-8')


if __name__ == '__main__':
    main()
