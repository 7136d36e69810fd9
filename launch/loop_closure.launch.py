"""
The pipeline: graph_builder and lcd, with a man in the middle if told so, and a bag if given one.

    ros2 launch adversarial_lcd_ros loop_closure.launch.py image:=/camera/color/image_raw
    ros2 launch adversarial_lcd_ros loop_closure.launch.py bag:=bags/flat_tour attack:=true

An argument wins over the parameter file, and the file over the defaults.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    OpaqueFunction,
    SetEnvironmentVariable,
    Shutdown,
)
from launch_ros.actions import Node

PACKAGE = 'adversarial_lcd_ros'
CONFIG = Path(__file__).resolve().parents[1] / 'config'
BOOLEANS = {'true': True, 'false': False}
CHOICES = {'attack': [*BOOLEANS], 'use_sim_time': [*BOOLEANS], 'lockstep': ['', *BOOLEANS]}

# What each node takes from an argument of the same name.
PARAMETERS = {
    'graph_builder': {'model': str},
    'lcd': {'target': str, 'threshold': float},
    'attacker': {'mode': str, 'search': str, 'perturbation': str, 'surrogate': str,
                 'ratio': float},
    'bag_replay': {'bag': str, 'lockstep': BOOLEANS.__getitem__, 'rate': float, 'record': str},
}
ARGUMENTS = {
    'attack': ('false', 'Put the attacker between graph_builder and lcd.'),
    'image': ('image', 'Camera topic; compressed frames on <image>/compressed.'),
    'params_file': (str(CONFIG / 'params.yaml'), 'Parameters of the nodes.'),
    'namespace': ('', 'Namespace of nodes and topics.'),
    'use_sim_time': ('false', 'Take the time from /clock.'),
    'dds_profile': ('', 'Fast DDS profile. config/fastdds.xml: shared memory large enough for '
                        'images, and nothing leaves this machine.'),
}


def start(context):
    """Return the actions that start the nodes with the arguments given."""
    given = context.launch_configurations
    attack, frames = BOOLEANS[given['attack']], given['image']
    remappings = {'graph_builder': [('image', frames),
                                    ('image/compressed', f'{frames}/compressed')]}
    nodes = ['lcd', 'graph_builder']
    if attack:
        # The builder's graphs reach the detector through the man in the middle only.
        remappings['graph_builder'].append(('graph', 'graph_clean'))
        nodes.append('attacker')
    if given['bag']:
        nodes.append('bag_replay')
    profile = given['dds_profile']
    environment = ([SetEnvironmentVariable('FASTRTPS_DEFAULT_PROFILES_FILE', profile)]
                   if profile else [])
    return environment + [start_node(name, given, remappings.get(name, [])) for name in nodes]


def start_node(name, given, remappings):
    """Return the action that starts one node; its end, also a failure, ends the pipeline."""
    parameters = {'use_sim_time': BOOLEANS[given['use_sim_time']]}
    parameters |= {parameter: read(given[parameter])
                   for parameter, read in PARAMETERS[name].items() if given[parameter]}
    return Node(package=PACKAGE, executable=name, name=name, namespace=given['namespace'],
                parameters=[given['params_file'], parameters], remappings=remappings,
                output='screen', on_exit=Shutdown(reason=f'{name} has ended'))


def generate_launch_description():
    """Return the arguments, and the nodes that follow from them."""
    arguments = ARGUMENTS | {
        parameter: ('', f'Parameter {parameter} of {name}; empty: as params_file says.')
        for name, parameters in PARAMETERS.items() for parameter in parameters}
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=text,
                                choices=CHOICES.get(name))
          for name, (default, text) in arguments.items()),
        OpaqueFunction(function=start),
    ])
