"""Launch the nodes of Nav2 that the quadruped needs, on Wayproof's clock.

Run `ros2 launch navigation.launch.py`; neither a map server nor a localization is among them.
"""

from pathlib import Path

from launch import LaunchDescription
from launch_ros.actions import Node

PARAMETERS = str(Path(__file__).with_name("quadruped.yaml"))
NODES = {  # the package of each, and its topics that are renamed
    "controller_server": ("nav2_controller", [("cmd_vel", "cmd_vel_nav")]),
    "planner_server": ("nav2_planner", []),
    "behavior_server": ("nav2_behaviors", [("cmd_vel", "cmd_vel_nav")]),
    "bt_navigator": ("nav2_bt_navigator", []),
    "velocity_smoother": (
        "nav2_velocity_smoother",
        [("cmd_vel", "cmd_vel_nav"), ("cmd_vel_smoothed", "cmd_vel")],
    ),
}


def generate_launch_description():
    """Describe the nodes, and the manager that brings them up in this order."""
    simulated = {"use_sim_time": True}
    nodes = [
        Node(
            package=package,
            executable=name,
            # The controller's executable makes a node of its costmap, too: no name for both.
            name=None if name == "controller_server" else name,
            parameters=[PARAMETERS, simulated],
            remappings=remappings,
            output="screen",
        )
        for name, (package, remappings) in NODES.items()
    ]
    manager = Node(
        package="nav2_lifecycle_manager",
        executable="lifecycle_manager",
        name="lifecycle_manager_navigation",
        parameters=[simulated, {"autostart": True, "node_names": list(NODES), "bond_timeout": 0.0}],
        output="screen",
    )
    return LaunchDescription([*nodes, manager])
