# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What pip and colcon install, and what the launch file starts."""

from configparser import ConfigParser
import importlib.util
import os
from pathlib import Path
import re
import shutil
import stat
import subprocess
import sys
import sysconfig
import types
import venv
from xml.etree import ElementTree
from zipfile import ZipFile

import pytest
import yaml

import adversarial_lcd_ros
from adversarial_lcd_ros.settings import NODE_CONFIGS

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = 'adversarial_lcd_ros'
NODES = sorted(NODE_CONFIGS)
EXECUTABLES = sorted([*NODES, 'adversarial-lcd'])
SHARED = ('launch', 'config', 'msg_schemas', 'bags')
FAST_DDS = ROOT / 'config' / 'fastdds.xml'
# Released into Jazzy.
ROS_PACKAGES = {'builtin_interfaces', 'diagnostic_msgs', 'geometry_msgs', 'launch', 'launch_ros',
                'nav_msgs', 'rcl_interfaces', 'rclpy', 'ros2launch', 'rosgraph_msgs',
                'sensor_msgs', 'std_msgs', 'tf2_msgs'}
# Keys of the public lists of rosdep, and the distributions that each installs on Ubuntu 24.04:
# there is none for mcap and threadpoolctl alone.
ROSDEP_KEYS = {
    'mcap-ros2-support': ('mcap-ros2-support', 'mcap'), 'python3-hypothesis': ('hypothesis',),
    'python3-jinja2': ('jinja2',), 'python3-matplotlib': ('matplotlib',),
    'python3-networkx': ('networkx',), 'python3-numba': ('numba',), 'python3-numpy': ('numpy',),
    'python3-onnxruntime-pip': ('onnxruntime',),
    'python3-opencv': ('opencv-python-headless',), 'python3-pip': ('pip',),
    'python3-pytest': ('pytest',), 'python3-rich': ('rich',),
    'python3-rosbags-pip': ('rosbags',), 'python3-scipy': ('scipy',),
    'python3-sklearn': ('scikit-learn', 'threadpoolctl'), 'python3-yaml': ('pyyaml',)}


def copy_sources(destination):
    """Copy what an installation is made from: building writes into its folder."""
    destination.mkdir()
    skipped = shutil.ignore_patterns('__pycache__', '*.pyc')
    for name in (PACKAGE, 'resource', *SHARED):
        shutil.copytree(ROOT / name, destination / name, ignore=skipped)
    for pattern in ('setup.*', 'package.xml', 'pyproject.toml', 'LICENSE', 'README.md'):
        for path in ROOT.glob(pattern):
            shutil.copy(path, destination)
    return destination


def run(*command, **options):
    # Where PYTHONPATH leads to this package, it would hide the installed one.
    paths = [path for path in os.environ.get('PYTHONPATH', '').split(os.pathsep)
             if os.path.isabs(path) and not Path(path, PACKAGE).exists()]
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True,
                          check=False, timeout=120,
                          env=os.environ | {'PYTHONPATH': os.pathsep.join(paths)}, **options)
    assert done.returncode == 0, f'{done.stdout}\n{done.stderr}'
    return done.stdout


@pytest.fixture(scope='module')
def wheel(tmp_path_factory):
    pytest.importorskip('setuptools', minversion='70.1', reason='setuptools builds no wheels')
    work = tmp_path_factory.mktemp('wheel')
    run(sys.executable, '-m', 'pip', 'wheel', '--no-deps', '--no-build-isolation', '--no-index',
        '--wheel-dir', work, copy_sources(work / 'source'))
    return next(work.glob('*.whl'))


@pytest.fixture
def environment(wheel, tmp_path):
    """Return a virtual environment with the wheel, and with this one's packages behind it."""
    prefix = tmp_path / 'environment'
    venv.create(prefix, with_pip=False)
    run(sys.executable, '-m', 'pip', '--python', prefix / 'bin' / 'python', 'install',
        '--no-deps', '--no-index', wheel)
    behind = sysconfig.get_path('purelib')
    site = next(prefix.glob('lib/python3*/site-packages'))
    (site / 'behind.pth').write_text(f'import site; site.addsitedir({behind!r})\n')
    return prefix


def data_files(wheel):
    """Return the files of a wheel that go below the prefix, with their access rights."""
    with ZipFile(wheel) as archive:
        return {entry.filename.split('.data/data/')[1]: entry.external_attr >> 16
                for entry in archive.infolist() if '.data/data/' in entry.filename}


def test_versions_agree():
    package = ElementTree.parse(ROOT / 'package.xml').getroot()
    assert package.findtext('name') == PACKAGE
    assert package.findtext('version') == adversarial_lcd_ros.__version__
    setup = ConfigParser()
    setup.read(ROOT / 'setup.cfg')
    assert setup['metadata']['version'] == f'attr: {PACKAGE}.__version__'
    cited = yaml.safe_load((ROOT / 'CITATION.cff').read_text())
    assert (cited['title'], cited['version']) == (PACKAGE, adversarial_lcd_ros.__version__)
    assert cited['license'] == package.findtext('license') == setup['metadata']['license']


def test_package_xml_names_what_is_imported_and_rosdep_keys_that_exist():
    package = ElementTree.parse(ROOT / 'package.xml').getroot()
    keys = [entry.text for kind in ('exec_depend', 'test_depend') for entry in package.iter(kind)]
    assert len(set(keys)) == len(keys)
    assert set(keys) <= ROS_PACKAGES | set(ROSDEP_KEYS)
    setup = ConfigParser()
    setup.read(ROOT / 'setup.cfg')
    wanted = {re.match(r'[\w-]+', line)[0]
              for line in setup['options']['install_requires'].split('\n') if line}
    assert wanted <= {name for key in keys for name in ROSDEP_KEYS.get(key, ())}


def run_lines(job):
    steps = yaml.safe_load((ROOT / '.github/workflows/ci.yml').read_text())['jobs'][job]['steps']
    return [line for step in steps for line in step.get('run', '').splitlines()]


def test_ci_runs_the_lines_of_the_readme():
    readme = (ROOT / 'README.md').read_text()
    section = readme.split('### With ROS 2 Jazzy\n')[1].split('\n### ')[0]
    lines = re.findall(r'^    (.+)$', section, re.M)
    # The first clones, and the last waits for a camera.
    assert 'git clone' in lines[0]
    assert 'image:=' in lines[-1]
    ran = run_lines('ros')
    at = ran.index(lines[1])
    assert ran[at:at + len(lines) - 2] == lines[1:-1]
    assert run_lines('python')[-3:] == ['make lint', 'make test', 'make demo']


def test_every_node_has_an_entry_point():
    setup = ConfigParser()
    setup.read(ROOT / 'setup.cfg')
    scripts = setup['options.entry_points']['console_scripts']
    found = re.findall(r'^(\w+) = adversarial_lcd_ros\.start:(\w+)$', scripts, re.MULTILINE)
    assert sorted(found) == [(node, node) for node in NODES]
    for node in NODES:
        assert (ROOT / PACKAGE / 'nodes' / f'{node}.py').is_file()


def test_wheel_puts_executables_where_ros2_looks(wheel):
    files = data_files(wheel)
    executables = {name: mode for name, mode in files.items() if name.startswith('lib/')}
    assert sorted(executables) == [f'lib/{PACKAGE}/{name}' for name in EXECUTABLES]
    assert all(mode & stat.S_IXUSR and mode & stat.S_IXOTH for mode in executables.values())
    assert f'share/ament_index/resource_index/packages/{PACKAGE}' in files


def test_wheel_holds_every_shared_file(wheel):
    files = data_files(wheel)
    shared = {str(path.relative_to(ROOT)) for top in SHARED for path in (ROOT / top).rglob('*')
              if path.is_file() and path.suffix != '.pyc'}
    assert {'config/params.yaml', 'launch/loop_closure.launch.py',
            'msg_schemas/MultiTierGraph.msg', 'bags/flat_tour/metadata.yaml'} <= shared
    for name in ('package.xml', *shared):
        assert f'share/{PACKAGE}/{name}' in files


def test_wheel_holds_models_and_templates(wheel):
    with ZipFile(wheel) as archive:
        names = set(archive.namelist())
    for folder in ('models', 'evaluation/templates'):
        inside = [path for path in (ROOT / PACKAGE / folder).iterdir() if path.is_file()]
        assert inside
        for path in inside:
            assert str(path.relative_to(ROOT)) in names
    assert f'{PACKAGE}/py.typed' in names
    assert not any(name.startswith('test') for name in names)


def test_executables_run_without_activation_also_after_a_move(environment, tmp_path):
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    moved = environment.rename(tmp_path / 'moved')
    link = tmp_path / 'link'
    link.symlink_to(moved / 'lib' / PACKAGE / 'bag_replay')
    (tmp_path / PACKAGE).mkdir()
    assert run(moved / 'lib' / PACKAGE / 'adversarial-lcd', '--version', cwd=tmp_path).startswith(
        'adversarial-lcd ')
    for executable in (moved / 'lib' / PACKAGE / 'lcd', link):
        # From a folder with a trap: the package is that of the prefix, never of the folder.
        (tmp_path / PACKAGE / '__init__.py').write_text('raise SystemExit("wrong package")')
        assert '--ros-args' in run(executable, '--help', cwd=tmp_path)


def test_installed_package_finds_what_is_installed(environment, tmp_path):
    command = environment / 'bin' / 'adversarial-lcd'
    assert run(command, '--version') == f'adversarial-lcd {adversarial_lcd_ros.__version__}\n'
    code = ('from adversarial_lcd_ros.paths import share_path, model_path\n'
            'print(share_path("bags/flat_tour"), model_path("vocabulary.npz"))')
    share, model = run(environment / 'bin' / 'python', '-c', code, cwd=tmp_path).split()
    assert share == str(environment / 'share' / PACKAGE / 'bags' / 'flat_tour')
    assert model.startswith(str(environment))


@pytest.mark.parametrize('options', [(), ('--symlink-install',)])
def test_colcon_gives_the_same_executables(tmp_path, options):
    colcon = shutil.which('colcon', path=os.path.dirname(sys.executable)) or shutil.which('colcon')
    if colcon is None:
        pytest.skip('colcon is not installed')
    (tmp_path / 'src').mkdir()
    copy_sources(tmp_path / 'src' / PACKAGE)
    run(colcon, 'build', *options, cwd=tmp_path)
    prefix = tmp_path / 'install' / PACKAGE
    executables = sorted(path.name for path in (prefix / 'lib' / PACKAGE).iterdir())
    assert executables == EXECUTABLES
    assert (prefix / 'share/ament_index/resource_index/packages' / PACKAGE).is_file()
    assert (prefix / 'share' / PACKAGE / 'bags/flat_tour/metadata.yaml').is_file()


def test_fast_dds_profile_holds_camera_images_and_stays_on_this_machine():
    name = '{http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles}'
    root = ElementTree.parse(FAST_DDS).getroot()
    image = 640 * 480 * 3
    assert int(root.find(f'.//{name}segment_size').text) >= 30 * image
    assert int(root.find(f'.//{name}maxMessageSize').text) >= 10 * image
    assert [e.text for e in root.iter(f'{name}address')] == ['127.0.0.1']
    assert root.find(f'.//{name}useBuiltinTransports').text == 'false'


def test_fast_dds_accepts_the_profile():
    pytest.importorskip('rclpy', reason='rclpy is not installed')
    code = 'import rclpy; rclpy.init(); rclpy.create_node("profile"); rclpy.shutdown()'
    done = subprocess.run(
        [sys.executable, '-W', 'ignore', '-c', code], capture_output=True, text=True, timeout=60,
        env=os.environ | {'FASTRTPS_DEFAULT_PROFILES_FILE': str(FAST_DDS),
                          'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST'}, check=False)
    assert (done.returncode, done.stderr) == (0, '')


class Action:
    """Stands in for an action of launch: remembers what it was made with."""

    def __init__(self, *values, **options):
        self.values, self.options = values, options


@pytest.fixture
def launched(monkeypatch):
    """
    Return a function that tells which nodes the launch file starts for some arguments.

    launch has no wheel: with stand-ins for its classes this checks the wiring of arguments, not
    that launch itself takes them.
    """
    names = {
        'launch': ('LaunchDescription',),
        'launch.actions': ('DeclareLaunchArgument', 'OpaqueFunction', 'SetEnvironmentVariable',
                           'Shutdown'),
        'launch_ros': (), 'launch_ros.actions': ('Node',)}
    for module, classes in names.items():
        stand_in = types.ModuleType(module)
        for name in classes:
            setattr(stand_in, name, type(name, (Action,), {}))
        monkeypatch.setitem(sys.modules, module, stand_in)
    path = ROOT / 'launch' / 'loop_closure.launch.py'
    spec = importlib.util.spec_from_file_location('loop_closure_launch', path)
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setattr(sys, 'dont_write_bytecode', True)
    spec.loader.exec_module(module)

    def launch(**arguments):
        *declared, start = module.generate_launch_description().values[0]
        known = {a.values[0]: a.options['default_value'] for a in declared}
        assert set(arguments) <= set(known)
        context = types.SimpleNamespace(launch_configurations=known | arguments)
        actions = start.options['function'](context)
        return {a.options.get('name', a.values): a.options for a in actions}
    launch.module = module
    return launch


def test_launch_without_attack_leaves_settings_to_the_parameter_file(launched):
    nodes = launched()
    assert sorted(nodes) == ['graph_builder', 'lcd']
    for name, node in nodes.items():
        assert node['executable'] == name
        assert node['parameters'] == [str(ROOT / 'config' / 'params.yaml'),
                                      {'use_sim_time': False}]
    assert 'graph' not in dict(nodes['graph_builder']['remappings'])


def test_launch_puts_the_attacker_between_builder_and_detector(launched):
    nodes = launched(attack='true', ratio='1e-4', mode='pass', image='/camera/image_raw')
    assert dict(nodes['graph_builder']['remappings']) == {
        'image': '/camera/image_raw', 'image/compressed': '/camera/image_raw/compressed',
        'graph': 'graph_clean'}
    assert nodes['attacker']['remappings'] == nodes['lcd']['remappings'] == []
    assert nodes['attacker']['parameters'][1] == {
        'use_sim_time': False, 'ratio': 1e-4, 'mode': 'pass'}


def test_launch_lets_the_viewer_look_at_the_same_camera(launched):
    nodes = launched(view='true', attack='true', image='/camera/image_raw')
    assert nodes['viewer']['remappings'] == nodes['graph_builder']['remappings'][:2]
    assert nodes['viewer']['parameters'][1] == {'use_sim_time': False}
    assert 'viewer' not in launched()


def test_launch_replays_a_bag_and_ends_with_it(launched):
    nodes = launched(bag='tour', lockstep='true', target='vbow', namespace='robot',
                     dds_profile='profile.xml')
    assert nodes['bag_replay']['parameters'][1] == {
        'use_sim_time': False, 'bag': 'tour', 'lockstep': True}
    assert nodes['lcd']['parameters'][1]['target'] == 'vbow'
    assert nodes.pop(('FASTRTPS_DEFAULT_PROFILES_FILE', 'profile.xml')) == {}
    assert all(node['namespace'] == 'robot' and node['on_exit'] for node in nodes.values())


def test_launch_arguments_are_parameters_of_their_nodes(launched):
    module = launched.module
    names = [name for parameters in module.PARAMETERS.values() for name in parameters]
    assert len(set(names)) == len(names)
    for node, parameters in module.PARAMETERS.items():
        known = {name: entry.default for config in NODE_CONFIGS[node]
                 for name, entry in config.__dataclass_fields__.items()}
        types = {module.boolean: bool, module.found: str}
        assert {name: types.get(read, read) for name, read in parameters.items()}.items() <= {
            name: type(default) for name, default in known.items()}.items()


def test_launch_finds_what_ships(launched, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    nodes = launched(bag='bags/flat_tour', dds_profile='config/fastdds.xml',
                     geometric_check='true', stride='2')
    assert nodes['bag_replay']['parameters'][1]['bag'] == str(ROOT / 'bags/flat_tour')
    assert nodes['bag_replay']['parameters'][1]['stride'] == 2
    assert nodes['lcd']['parameters'][1]['geometric_check'] is True
    assert ('FASTRTPS_DEFAULT_PROFILES_FILE', str(FAST_DDS)) in nodes
    (tmp_path / 'bags' / 'flat_tour').mkdir(parents=True)
    assert launched(bag='bags/flat_tour')['bag_replay']['parameters'][1]['bag'] == 'bags/flat_tour'
    assert launched(bag='/nope')['bag_replay']['parameters'][1]['bag'] == '/nope'


def test_every_python_file_says_its_licence():
    for path in [*ROOT.glob('*.py'), *(file for folder in (
            'adversarial_lcd_ros', 'benchmarks', 'examples', 'launch', 'requirements', 'soak',
            'test') for file in (ROOT / folder).rglob('*.py'))]:
        head = path.read_text(encoding='utf-8')[:200]
        assert '# SPDX-License-Identifier: Apache-2.0\n' in head, path
