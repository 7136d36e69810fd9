# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Installation by pip and by colcon alike; what is declarative is in setup.cfg.

Here are the files outside the Python package, and the executables that a wheel puts where
``ros2 run`` and ``ros2 launch`` look for them.
"""

from pathlib import Path

from setuptools import setup

try:
    from setuptools.command.bdist_wheel import bdist_wheel
except ImportError:  # before setuptools 70.1
    try:
        from wheel.bdist_wheel import bdist_wheel
    except ImportError:  # colcon on a machine without wheel builds none
        bdist_wheel = None

PACKAGE = 'adversarial_lcd_ros'
NODES = ('attacker', 'bag_replay', 'graph_builder', 'lcd', 'map_builder', 'viewer')
# Executable to the module and function that it calls.
EXECUTABLES = {'adversarial-lcd': 'cli:main', **{node: f'start:{node}' for node in NODES}}
SHARED_FOLDERS = ('launch', 'config', 'msg_schemas', 'bags')

# sh runs the lines up to exec; to Python they are a string. Unlike the scripts that pip writes,
# these find Python from where they are: the prefix may be moved, and need not be activated.
# Where the prefix has no Python of its own (pip install --user), that of the path is used.
WRAPPER = """\
#!/bin/sh
''':'
self=$(readlink -f -- "$0")
python=${{self%/lib/{package}/*}}/bin/python3
[ -x "$python" ] || python=python3
exec "$python" "$self" "$@"
'''
import sys

from {package}.{module} import {function}

sys.exit({function}())
"""


def shared_files():
    """Return data_files: every file below the shared folders keeps its place in share/."""
    share = Path('share', PACKAGE)
    files = {'share/ament_index/resource_index/packages': [f'resource/{PACKAGE}'],
             str(share): ['package.xml']}
    for path in sorted(path for top in SHARED_FOLDERS for path in Path(top).rglob('*')):
        if path.is_file() and path.suffix != '.pyc':
            files.setdefault(str(share / path.parent), []).append(str(path))
    return list(files.items())


def write_wrappers(folder):
    """Write the executables into a folder, and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, called in EXECUTABLES.items():
        module, _, function = called.partition(':')
        path = folder / name
        path.write_text(WRAPPER.format(package=PACKAGE, module=module, function=function),
                        encoding='utf-8')
        path.chmod(0o755)
    return [str(folder / name) for name in EXECUTABLES]


commands = {}
if bdist_wheel is not None:
    class WheelWithExecutables(bdist_wheel):
        """A wheel with lib/adversarial_lcd_ros/<name>, which colcon makes from entry points."""

        def run(self):
            """Add the executables to the data files, and build the wheel."""
            wrappers = write_wrappers(Path(self.bdist_dir).parent / 'executables')
            self.distribution.data_files.append((f'lib/{PACKAGE}', wrappers))
            super().run()

    commands['bdist_wheel'] = WheelWithExecutables

# colcon cannot read python_requires from setup.cfg.
setup(python_requires='>=3.10', data_files=shared_files(), cmdclass=commands)
