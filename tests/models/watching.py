"""What a plant does with the truth after every physics step, for tests without one."""

from wayproof.models.step_kernels import touched


def watch(truth, data, base):
    """Count what the robot touches now."""
    truth.places[truth.steps % len(truth.places)] = data.xpos[base]
    truth.see(touched(data.contact.geom, truth.is_robot, truth.is_obstacle))
