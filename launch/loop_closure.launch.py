# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The pipeline: graph_builder and lcd, with a man in the middle if told so, and a bag if given one.

    ros2 launch adversarial_lcd_ros loop_closure.launch.py image:=/camera/color/image_raw
    ros2 launch adversarial_lcd_ros loop_closure.launch.py bag:=bags/flat_tour attack:=true

An argument wins over the parameter file, and the file over the defaults. A path that is not there
is looked for in the package's share folder, too: bags/flat_tour, config/fastdds.xml.
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
SHARE = Path(__file__).resolve().parents[1]
BOOLEANS = {'true': True, 'false': False}


def boolean(text):
    """Return what true or false means."""
    return BOOLEANS[text]


def found(path):
    """Return a path as it is, or below the package's share folder where it is only there."""
    shared = SHARE / path
    return str(shared) if not Path(path).exists() and shared.exists() else path


# What each node takes from an argument of the same name.
PARAMETERS = {
    'graph_builder': {'model': found, 'detector': str, 'detections': found, 'features': int,
                      'queue_depth': int},
    'lcd': {'target': str, 'threshold': float, 'defences': str, 'geometric_check': boolean,
            'hard_answers': boolean},
    'attacker': {'mode': str, 'search': str, 'perturbation': str, 'surrogate': str,
                 'ratio': float, 'max_queries': int, 'deadline_ms': float, 'seed': int},
    'map_builder': {'back_end': str, 'odometry': str, 'drift': float},
    'bag_replay': {'bag': found, 'lockstep': boolean, 'window': int, 'rate': float,
                   'stride': int, 'start_s': float, 'duration_s': float, 'loop': int,
                   'clock': boolean, 'record': str},
}
CHOICES = {name: [*BOOLEANS] for name in ('attack', 'view', 'map', 'use_sim_time')} | {
    name: ['', *BOOLEANS] for taken in PARAMETERS.values() for name, read in taken.items()
    if read is boolean}
ARGUMENTS = {
    'attack': ('false', 'Put the attacker between graph_builder and lcd.'),
    'view': ('false', 'Draw a picture of each decision on view/compressed.'),
    'map': ('false', 'Build the map that the closures make, on path and /tf.'),
    'image': ('image', 'Camera topic; compressed frames on <image>/compressed.'),
    'params_file': (str(SHARE / 'config' / 'params.yaml'), 'Parameters of the nodes.'),
    'namespace': ('', 'Namespace of nodes and topics.'),
    'use_sim_time': ('false', 'Take the time from /clock.'),
    'dds_profile': ('', 'Fast DDS profile. config/fastdds.xml: shared memory large enough for '
                        'images, and nothing leaves this machine.'),
}


def start(context):
    """Return the actions that start the nodes with the arguments given."""
    given = context.launch_configurations
    attack, frames = BOOLEANS[given['attack']], given['image']
    camera = [('image', frames), ('image/compressed', f'{frames}/compressed')]
    remappings = {'graph_builder': [*camera], 'viewer': camera}
    nodes = ['lcd', 'graph_builder']
    if attack:
        # The builder's graphs reach the detector through the man in the middle only.
        remappings['graph_builder'].append(('graph', 'graph_clean'))
        nodes.append('attacker')
    if BOOLEANS[given['view']]:
        nodes.append('viewer')
    if BOOLEANS[given['map']]:
        nodes.append('map_builder')
    if given['bag']:
        nodes.append('bag_replay')
    profile = given['dds_profile'] and found(given['dds_profile'])
    environment = ([SetEnvironmentVariable('FASTRTPS_DEFAULT_PROFILES_FILE', profile)]
                   if profile else [])
    return environment + [start_node(name, given, remappings.get(name, [])) for name in nodes]


def start_node(name, given, remappings):
    """Return the action that starts one node; its end, also a failure, ends the pipeline."""
    parameters = {'use_sim_time': BOOLEANS[given['use_sim_time']]}
    parameters |= {parameter: read(given[parameter])
                   for parameter, read in PARAMETERS.get(name, {}).items() if given[parameter]}
    return Node(package=PACKAGE, executable=name, name=name, namespace=given['namespace'],
                parameters=[found(given['params_file']), parameters], remappings=remappings,
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
